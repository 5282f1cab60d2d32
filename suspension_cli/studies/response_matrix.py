"""Responses of all outputs of a design to all inputs, with their derivatives by its numbers.

With A x = f, y = C x and A = K + i K'' + i omega C - omega^2 M, which is symmetric, a change of the
matrices changes the responses by

    dH = -Y^T dA X + dC X + Y^T dB,    A X = B,  A Y = C^T,

so one factorisation per frequency serves all responses and all numbers; dA, dB and dC are central
differences of the matrices (`studies.derivatives`). The solutions are accurate to some 1e-9, far
below the noise of measurements (`linear.response` has the last digits).

Modes may be damped beyond the losses of the design: `damping` of mode k adds i omega omega_k
damping_k M v_k v_k^T M, which lowers its Q to 1/damping_k and leaves all other modes as they are
(modal damping; Ewins, Modal Testing (2000), section 2.6).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design.schema import Design
from suspension_cli.linear import eigenmodes
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.signals import Signal, linear_form
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import registry
from suspension_cli.studies import derivatives
from suspension_cli.studies.builds import Builds
from suspension_cli.studies.parameters import Parameter, value_of

if TYPE_CHECKING:
    from jaxtyping import Complex, Float

LOSSES = ("loss_angle", "loss")
"""Keys whose numbers change only the frequency-dependent terms of models in which wires bend."""
CHUNK = 1 << 21
"""Elements of the dynamic matrices that are solved at once."""


@dataclass(frozen=True)
class Matrices:
    """Static matrices in the named coordinates, or their derivatives.

    `loss` is the imaginary part of the stiffness, `orientation` that of each body, the support
    first.
    """

    mass: Float[np.ndarray, "coordinate coordinate"]
    stiffness: Float[np.ndarray, "coordinate coordinate"]
    damping: Float[np.ndarray, "coordinate coordinate"]
    loss: Float[np.ndarray, "coordinate coordinate"]
    orientation: Float[np.ndarray, "1+body 3 3"]

    @property
    def matters(self) -> bool:
        """Whether any matrix is not 0."""
        return any(part.any() for part in vars(self).values())

    @property
    def flat(self) -> Float[np.ndarray, " element"]:
        """All elements."""
        return np.concatenate([part.ravel() for part in vars(self).values()])

    @staticmethod
    def of(row: Float[np.ndarray, " element"], size: int) -> Matrices:
        """Separate the matrices of a row of `_flat_matrices`."""
        mass, stiffness, damping, loss = row[: 4 * size**2].reshape(4, size, size)
        return Matrices(mass, stiffness, damping, loss, row[4 * size**2 :].reshape(-1, 3, 3))

    def of_modes(self, modes: Modes) -> Float[np.ndarray, "mode mode"]:
        """Compute the matrix of modes (see `derivatives`), or its derivative."""
        moved = self.stiffness[6:, 6:] @ modes.shape.T
        return modes.shape @ (moved - modes.omega_squared * (self.mass[6:, 6:] @ modes.shape.T))

    def dynamic(
        self, omega: Float[np.ndarray, " frequency"]
    ) -> Complex[np.ndarray, "frequency coordinate coordinate"]:
        """K + i K'' + i omega C - omega^2 M at angular frequencies, rad/s."""
        w = omega[..., None, None]
        return self.stiffness + 1j * (self.loss + w * self.damping) - w**2 * self.mass


def _flat_matrices(found: Builds) -> Float[np.ndarray, "build element"]:
    """All elements of the `Matrices` of builds."""
    model, count, size = found.model, len(found.status), found.model.size
    loss = np.zeros((size, size)) if model.lossy is None else np.imag(model.lossy)
    parts = [
        np.broadcast_to(part, (count, size, size)).reshape(count, -1)
        for part in (model.mass, model.stiffness, model.damping, loss)
    ]
    assert model.orientation is not None
    return np.hstack([*parts, model.orientation.reshape(count, -1)])


@dataclass(frozen=True)
class Plant:
    """A design ready for responses at any frequency: its matrices and modes.

    Attributes
    ----------
    level
        Name of a model that supports derivatives.
    system
        In symmetry-adapted coordinates, with its terms.
    matrices
        Without the terms.
    modes
        Without losses; shapes (m, N - 6) in the named coordinates.
    """

    design: Design
    level: str
    system: LinearSystem
    matrices: Matrices
    modes: Modes

    @staticmethod
    def of(design: Design, level: str = registry.STRING.name) -> Plant:
        """Find the equilibrium of a design, its matrices and its modes."""
        system = registry.by_name(level).system(design)
        full = system.stiffness if system.lossy is None else system.lossy
        to_own = np.linalg.inv(system.basis)
        mass, stiffness, damping, loss = (
            to_own.T @ part @ to_own
            for part in (system.mass, system.stiffness, system.damping, np.imag(full))
        )
        turn = np.eye(3) if system.orientation is None else system.orientation
        turn = np.broadcast_to(turn, (len(system.body) + 1, 3, 3))
        matrices = Matrices(mass, stiffness, damping, loss, turn)
        return Plant(design, level, system, matrices, eigenmodes.solve(system.constant))

    def row(self, signal: Signal) -> Float[np.ndarray, " coordinate"]:
        """Compute the linear form of a signal in the named coordinates."""
        turned = replace(
            self.system, basis=np.eye(self.system.size), orientation=self.matrices.orientation
        )
        return linear_form(signal, turned)

    def row_change(self, change: Matrices, signal: Signal) -> Float[np.ndarray, " coordinate"]:
        """Differentiate that form: points of signals move with their bodies."""
        turned = self.matrices.orientation + change.orientation
        return linear_form(signal, replace(self.system, orientation=turned)) - self.row(signal)

    @cached_property
    def modal_forces(self) -> Float[np.ndarray, "mode coordinate"]:
        """Rows M v_k of the modes."""
        return self.modes.shape @ self.matrices.mass[6:, 6:]

    def changes(self, names: Sequence[str]) -> list[Matrices | None]:
        """Differentiate all matrices with respect to each of some numbers.

        None for a number that cannot change alone.
        """
        new = [name for name in names if name not in self._changes]
        if new:
            numbers = [Parameter(name, value_of(self.design, name)) for name in new]
            flat = self.matrices.flat
            around = derivatives.differentiate(
                self.design, numbers, self.level, _flat_matrices, nominal=flat
            )
            for name, row, good in zip(new, around.central, around.balanced, strict=True):
                self._changes[name] = Matrices.of(row, self.system.size) if good else None
        return [self._changes[name] for name in names]

    @cached_property
    def _changes(self) -> dict[str, Matrices | None]:
        return {}

    def dispersive(
        self, omega: Float[np.ndarray, " frequency"]
    ) -> Complex[np.ndarray, "frequency coordinate coordinate"]:
        """Frequency-dependent part of the stiffness in the named coordinates."""
        size, to_named = self.system.size, np.linalg.inv(self.system.basis)
        result = np.zeros((len(omega), size, size), dtype=complex)
        for term in self.system.terms:
            at = np.ix_(np.arange(len(omega)), term.columns, term.columns)
            result[at] += term.at(omega).complete
        return to_named.T @ result @ to_named

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
        size = self.system.size
        drive = np.array([self.row(signal) for signal in inputs]).reshape(-1, size)
        rows = np.array([self.row(signal) for signal in outputs]).reshape(-1, size)
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
            right = forces - matrix[:, 6:, :6] @ moves[:6]
            watched = np.broadcast_to(rows[:, 6:].T, (len(right), size - 6, len(rows)))
            root = np.sqrt(np.abs(np.einsum("fnn->fn", matrix[:, 6:, 6:])))[..., None]
            root[root == 0] = 1.0
            own = matrix[:, 6:, 6:] / (root * root.swapaxes(1, 2))
            both = np.concatenate([right, watched], axis=-1)
            x = np.linalg.solve(own, both / root) / root
            state[span, :6], state[span, 6:] = moves[:6], x[..., : len(inputs)]
            adjoint[span] = x[..., len(inputs) :]
        return Responses(self, omega, tuple(inputs), tuple(outputs), rows, state, adjoint)

    def _dynamic(
        self,
        omega: Float[np.ndarray, " frequency"],
        damping: Float[np.ndarray, " mode"] | None,
        stiffening: Float[np.ndarray, " mode"] | None,
    ) -> Complex[np.ndarray, "frequency coordinate coordinate"]:
        matrix, w = self.matrices.dynamic(omega) + self.dispersive(omega), omega[:, None, None]
        squared, forces = self.modes.omega_squared, self.modal_forces
        if damping is not None:
            rates = np.sqrt(np.clip(squared, 0.0, None)) * damping
            matrix[:, 6:, 6:] += 1j * w * ((forces.T * rates) @ forces)
        if stiffening is not None:
            matrix[:, 6:, 6:] += (forces.T * (squared * stiffening)) @ forces
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

    def derivative(self, change: Matrices) -> Complex[np.ndarray, "frequency output input"]:
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
            rows = np.array([self.plant.row_change(change, signal) for signal in self.outputs])
            result += rows @ self.state
            pushed = np.array(
                [self.plant.row_change(change, signal)[6:] * signal.acts for signal in self.inputs]
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
