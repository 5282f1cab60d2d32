"""Responses of all outputs of a design to all inputs, with their derivatives by its numbers.

With A x = f, y = C x and A = K + i K'' + i omega C - omega^2 M, a change of the matrices changes
the responses by

    dH = -Y^T dA X + dC X + Y^T dB,    A X = B,  A^T Y = C^T,

so one factorisation per frequency serves all responses and all numbers; dA, dB and dC are central
differences of the matrices (`studies.derivatives`). The solutions, in plain
double precision, are accurate to some 1e-9, far below the noise of measurements (`linear.response`
has the last digits).

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
    from jaxtyping import Complex, Float, Int

LOSSES = ("loss_angle", "loss")
"""Keys whose numbers change only the frequency-dependent terms of models in which wires bend."""
FEW = 24
"""Designs up to which matrices are computed one by one, as loading compiled loops takes longer."""
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
        row = _flat_matrices(derivatives.together([system]))[0]
        modes = eigenmodes.solve(system.constant)
        return Plant(design, level, system, Matrices.of(row, system.size), modes)

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
            around = derivatives.differentiate(
                self.design,
                numbers,
                self.level,
                _flat_matrices,
                few=FEW,
                nominal=self.matrices.flat,
            )
            for name, row, good in zip(new, around.central, around.balanced, strict=True):
                self._changes[name] = Matrices.of(row, self.system.size) if good else None
        return [self._changes[name] for name in names]

    @cached_property
    def _changes(self) -> dict[str, Matrices | None]:
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
        size = self.system.size
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
        matrix, w = self.matrices.dynamic(omega), omega[:, None, None]
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
