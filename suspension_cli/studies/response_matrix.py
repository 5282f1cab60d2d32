"""Responses of all outputs of a design to all inputs, with their derivatives by its numbers.

With A x = f, y = C x and A = Z(omega), which is symmetric (`linear.pencil`), a change of the
matrices changes the responses by

    dH = -Y^T dA X + dC X + Y^T dB,    A X = B,  A Y = C^T,

so one factorisation per frequency serves all responses and all numbers: the adjoint solutions Y are
responses to the outputs as forces. dA, dB and dC are central differences of the matrices
(`studies.derivatives`).

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
from suspension_cli.linear import eigenmodes, response
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.signals import Signal, linear_form
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import registry
from suspension_cli.studies import derivatives
from suspension_cli.studies.parameters import Parameter, value_of

if TYPE_CHECKING:
    from jaxtyping import Complex, Float


@dataclass(frozen=True)
class Matrices:
    """Derivatives of static matrices in the named coordinates.

    `loss` is that of the imaginary part of the stiffness, `orientation` that of the rotation of
    each body, the support first.
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

    def of_modes(self, modes: Modes) -> Float[np.ndarray, "mode mode"]:
        """Differentiate the matrix of modes (see `derivatives`)."""
        moved = self.stiffness[6:, 6:] @ modes.shape.T
        return modes.shape @ (moved - modes.omega_squared * (self.mass[6:, 6:] @ modes.shape.T))


@dataclass(frozen=True)
class Plant:
    """A design ready for responses at any frequency, in a model that supports builds.

    Its system is in symmetry-adapted coordinates, the shapes of modes in the named ones.
    """

    design: Design
    level: str
    system: LinearSystem
    modes: Modes

    @staticmethod
    def of(design: Design, level: str = registry.STRING.name) -> Plant:
        """Find the equilibrium of a design, its matrices and its modes."""
        system = registry.by_name(level).system(design)
        return Plant(design, level, system, eigenmodes.solve(system.constant))

    def row(self, signal: Signal) -> Float[np.ndarray, " coordinate"]:
        """Compute the linear form of a signal, which no choice of coordinates of tips changes."""
        return linear_form(signal, self.system)

    def row_change(self, change: Matrices, signal: Signal) -> Float[np.ndarray, " coordinate"]:
        """Differentiate that form: points of signals move with their bodies."""
        turn = self.system.orientation
        turn = (np.eye(3) if turn is None else turn) + change.orientation
        return linear_form(signal, replace(self.system, orientation=turn)) - self.row(signal)

    @cached_property
    def modal_forces(self) -> Float[np.ndarray, "mode coordinate"]:
        """Rows M v_k of the modes, in the named coordinates."""
        momentum = np.pad(self.modes.shape, ((0, 0), (6, 0))) @ self.system.basis @ self.system.mass
        return (momentum @ self.system.basis.T)[:, 6:]

    def changes(self, names: Sequence[str]) -> list[Matrices | None]:
        """Differentiate all matrices with respect to each of some numbers.

        None for a number that cannot change alone.
        """
        if not names:
            return []
        numbers = [Parameter(name, value_of(self.design, name)) for name in names]
        size = self.system.size
        bodies = len(self.system.body) + 1
        shape = np.zeros(4 * size**2 + 9 * bodies)
        around = derivatives.differentiate(self.design, numbers, self.level, nominal=shape)
        found: list[Matrices | None] = []
        for row, good in zip(around.central, around.balanced, strict=True):
            mass, stiffness, damping, loss = row[: 4 * size**2].reshape(4, size, size)
            turn = row[4 * size**2 :].reshape(-1, 3, 3)
            found.append(Matrices(mass, stiffness, damping, loss, turn) if good else None)
        return found

    def respond(
        self,
        frequency: Float[np.ndarray, " frequency"],
        inputs: Sequence[Signal],
        outputs: Sequence[Signal],
        damping: Float[np.ndarray, " mode"] | None = None,
    ) -> Responses:
        """Solve for all responses at frequencies in Hz, with the adjoint solutions for derivatives.

        `damping` is an added 1/Q of each mode.
        """
        omega = 2 * np.pi * np.asarray(frequency, dtype=float)
        basis = self.system.basis
        size = self.system.size
        count = len(inputs)
        drives = np.array([self.row(signal) for signal in inputs]).reshape(-1, size)
        rows = np.array([self.row(signal) for signal in outputs]).reshape(-1, size)
        acts = [*(signal.acts for signal in inputs), *([True] * len(rows))]
        x, _ = response.transfer(
            self._damped(damping),
            omega,
            np.concatenate([drives, rows]),
            acts,
            np.eye(size),
            finite=False,
        )
        x = basis @ x
        return Responses(
            self, omega, tuple(inputs), tuple(outputs), rows, x[..., :count], x[:, 6:, count:]
        )

    def _damped(self, damping: Float[np.ndarray, " mode"] | None) -> LinearSystem:
        """System with an added damping of modes."""
        if damping is None or not damping.any():
            return self.system
        forces = np.pad(self.modal_forces, ((0, 0), (6, 0))) @ self.system.basis
        rates = np.sqrt(np.clip(self.modes.omega_squared, 0.0, None)) * damping
        return replace(self.system, damping=self.system.damping + (forces.T * rates) @ forces)


@dataclass(frozen=True)
class Responses:
    """Responses of outputs to inputs, with what their derivatives need.

    `omega` is in rad/s, `rows` are the linear forms of the outputs, `state` all coordinates for
    unit inputs, and `adjoint` all for unit forces where the outputs are.
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
            moving = np.flatnonzero(matrix[6:].any(0))
            if len(touched):
                moved = matrix[np.ix_(touched + 6, moving)] @ self.state[:, moving]
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
        force = self.plant.modal_forces[mode]
        seen = np.einsum("n,fno->fo", force, self.adjoint)
        moved = np.einsum("n,fni->fi", force, self.state[:, 6:])
        through = seen[:, :, None] * moved[:, None, :]
        return -1j * omega * self.omega[:, None, None] * through
