"""Responses of all outputs of a design to all inputs, with their derivatives by its numbers.

With A x = f, y = C x and A = K + i K'' + i omega C - omega^2 M, a change of the matrices changes
the responses by

    dH = -Y^T dA X + dC X + Y^T dB,    A X = B,  A^T Y = C^T,

so one factorisation per frequency serves all responses and all numbers. The solutions, in plain
double precision, are accurate to some 1e-9, far below the noise of measurements (`linear.response`
has the last digits).

Modes may be damped beyond the losses of the design: `damping` of mode k adds i omega omega_k
damping_k M v_k v_k^T M, which lowers its Q to 1/damping_k and leaves all other modes as they are
(modal damping; Ewins, Modal Testing (2000), section 2.6).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design.schema import Design
from suspension_cli.linear import eigenmodes
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.signals import Signal
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import registry
from suspension_cli.studies import derivatives
from suspension_cli.studies.derivatives import Differentiable, Linear

if TYPE_CHECKING:
    from jaxtyping import Complex, Float, Int

LOSSES = ("loss_angle", "loss")
"""Keys whose numbers change only the frequency-dependent terms of models in which wires bend."""
CHUNK = 1 << 21
"""Elements of the dynamic matrices that are solved at once."""


@dataclass(frozen=True)
class Plant:
    """A design ready for responses at any frequency: its matrices and modes.

    Attributes
    ----------
    level
        Name of a model that supports derivatives.
    system
        Of the same design, in symmetry-adapted coordinates, with its terms.
    modes
        Without losses; shapes (m, N - 6) in the named coordinates.
    """

    design: Design
    level: str
    base: Differentiable
    system: LinearSystem
    modes: Modes

    @staticmethod
    def of(design: Design, level: str = registry.STRING.name) -> Plant:
        """Find the equilibrium of a design, its matrices and its modes."""
        system = registry.by_name(level).system(design)
        modes = eigenmodes.solve(system.constant)
        return Plant(design, level, derivatives.prepared(design, level), system, modes)

    @cached_property
    def modal_forces(self) -> Float[np.ndarray, "mode coordinate"]:
        """Rows M v_k of the modes."""
        return self.modes.shape @ self.base.linear.mass[6:, 6:]

    def change(self, name: str) -> Linear | None:
        """Differentiate all matrices with respect to one number, see `derivatives.of`."""
        if name not in self._changes:
            self._changes[name] = derivatives.of(self.base, name)
        return self._changes[name]

    @cached_property
    def _changes(self) -> dict[str, Linear | None]:
        return {}

    def dispersive(
        self, omega: Float[np.ndarray, " frequency"]
    ) -> Complex[np.ndarray, "frequency coordinate coordinate"] | None:
        """Frequency-dependent part of the stiffness in the named coordinates, or None."""
        if not self.system.terms:
            return None
        rows, columns, weights = self._dispersive_elements
        functions = np.concatenate(
            [np.asarray(term.at(omega).all_functions()) for term in self.system.terms]
        ).astype(complex)
        size = self.base.model.size
        result = np.zeros((len(omega), size, size), dtype=complex)
        # real weights times complex functions, in real arithmetic
        result[:, rows, columns] = (weights @ functions.view(float)).view(complex).T
        return result

    @cached_property
    def _dispersive_elements(
        self,
    ) -> tuple[
        Int[np.ndarray, " element"],
        Int[np.ndarray, " element"],
        Float[np.ndarray, "element function"],
    ]:
        """Rows and columns of elements that depend on frequency; weights of functions in them."""
        to_named = np.linalg.inv(self.system.basis)
        matrices = np.concatenate(
            [to_named.T @ np.asarray(term.all_matrices) @ to_named for term in self.system.terms]
        )
        rows, columns = np.nonzero(matrices.any(0))
        return rows, columns, np.ascontiguousarray(matrices[:, rows, columns].T)

    def respond(
        self,
        frequency: Float[np.ndarray, " frequency"],
        inputs: Sequence[Signal],
        outputs: Sequence[Signal],
        damping: Float[np.ndarray, " mode"] | None = None,
        stiffening: Float[np.ndarray, " mode"] | None = None,
    ) -> Responses:
        """Solve for all responses at frequencies in Hz, with the adjoint solutions for derivatives.

        `damping` is an added 1/Q, `stiffening` a relative change of omega^2, of each mode.
        """
        omega = 2 * np.pi * np.asarray(frequency, dtype=float)
        size = self.base.model.size
        drive = np.array([self.base.row(signal) for signal in inputs]).reshape(-1, size)
        rows = np.array([self.base.row(signal) for signal in outputs]).reshape(-1, size)
        acts = np.array([signal.acts for signal in inputs], dtype=bool)
        moves = np.where(acts, 0.0, drive.T)
        moves[6:] = 0.0
        forces = np.where(acts, drive.T, 0.0)[6:]
        state = np.empty((len(omega), size, len(inputs)), dtype=complex)
        adjoint = np.empty((len(omega), size - 6, len(outputs)), dtype=complex)
        step = max(CHUNK // size**2, 1)
        for begin in range(0, len(omega), step):
            span = slice(begin, begin + step)
            matrix = self._dynamic(omega[span], damping, stiffening)
            root = np.sqrt(np.abs(np.einsum("fnn->fn", matrix[:, 6:, 6:])))
            root[root == 0] = 1.0
            own = matrix[:, 6:, 6:] / (root[:, :, None] * root[:, None, :])
            right = forces - matrix[:, 6:, :6] @ moves[:6]
            state[span, :6] = moves[:6]
            state[span, 6:] = np.linalg.solve(own, right / root[..., None]) / root[..., None]
            watch = rows[:, 6:].T / root[..., None]
            adjoint[span] = np.linalg.solve(own.transpose(0, 2, 1), watch) / root[..., None]
        return Responses(self, omega, tuple(inputs), tuple(outputs), rows, state, adjoint)

    def _dynamic(
        self,
        omega: Float[np.ndarray, " frequency"],
        damping: Float[np.ndarray, " mode"] | None,
        stiffening: Float[np.ndarray, " mode"] | None,
    ) -> Complex[np.ndarray, "frequency coordinate coordinate"]:
        matrix, w = self.base.linear.dynamic(omega), omega[:, None, None]
        added = self.dispersive(omega)
        if added is not None:
            matrix = matrix + added
        if damping is not None:
            used = np.flatnonzero(damping)
            rates = np.sqrt(np.clip(self.modes.omega_squared[used], 0.0, None)) * damping[used]
            forces = self.modal_forces[used]
            matrix[:, 6:, 6:] += 1j * w * ((forces.T * rates) @ forces)
        if stiffening is not None and stiffening.any():
            used = np.flatnonzero(stiffening)
            forces = self.modal_forces[used]
            added = (forces.T * (self.modes.omega_squared[used] * stiffening[used])) @ forces
            matrix[:, 6:, 6:] += added
        return matrix


@dataclass(frozen=True)
class Responses:
    """Responses of outputs to inputs, with what their derivatives need.

    Attributes
    ----------
    omega
        rad/s.
    rows
        Linear forms of the outputs.
    state
        All coordinates for unit inputs.
    adjoint
        Solutions of the transposed equations for the outputs.
    """

    plant: Plant
    omega: Float[np.ndarray, " frequency"]
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    rows: Float[np.ndarray, "output coordinate"]
    state: Complex[np.ndarray, "frequency coordinate input"]
    adjoint: Complex[np.ndarray, "frequency coordinate-6 output"]

    @cached_property
    def value(self) -> Complex[np.ndarray, "frequency output input"]:
        """Responses, SI."""
        return self.rows @ self.state

    def derivative(self, change: Linear) -> Complex[np.ndarray, "frequency output input"]:
        """Differentiate all responses with respect to the number of a change."""
        w = self.omega[:, None, None]
        result = np.zeros((len(self.omega), len(self.outputs), len(self.inputs)), dtype=complex)
        parts = (
            (change.stiffness + 1j * change.loss, 1.0),
            (change.damping, 1j * w),
            (change.mass, -(w**2)),
        )
        for matrix, factor in parts:
            touched = np.flatnonzero(matrix[6:].any(1))
            from_ = np.flatnonzero(matrix[6:].any(0))
            if len(touched):
                moved = matrix[np.ix_(touched + 6, from_)] @ self.state[:, from_]
                result -= factor * (self.adjoint[:, touched].transpose(0, 2, 1) @ moved)
        if change.orientation.any():
            rows = np.array([self.plant.base.row_change(change, signal) for signal in self.outputs])
            result += rows @ self.state
            pushed = np.array(
                [
                    self.plant.base.row_change(change, signal)[6:] * signal.acts
                    for signal in self.inputs
                ]
            )
            result += self.adjoint.transpose(0, 2, 1) @ pushed.T
        return result

    def damping_derivative(self, mode: int) -> Complex[np.ndarray, "frequency output input"]:
        """Differentiate all responses by the added damping of a mode."""
        omega = float(np.sqrt(max(self.plant.modes.omega_squared[mode], 0.0)))
        return -1j * omega * self.omega[:, None, None] * self._through(mode)

    def stiffening_derivative(self, mode: int) -> Complex[np.ndarray, "frequency output input"]:
        """Differentiate all responses by the relative change of omega^2 of a mode."""
        return -float(self.plant.modes.omega_squared[mode]) * self._through(mode)

    def _through(self, mode: int) -> Complex[np.ndarray, "frequency output input"]:
        """Products of the motions of a mode in adjoint solutions and in responses."""
        force = self.plant.modal_forces[mode]
        seen = np.einsum("n,fno->fo", force, self.adjoint)
        moved = np.einsum("n,fni->fi", force, self.state[:, 6:])
        return seen[:, :, None] * moved[:, None, :]
