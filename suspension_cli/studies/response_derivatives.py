"""Derivatives of the magnitude of a response at one frequency, by the adjoint method.

For a response y = r x with A x = f, dy = dr x + a (df - dA x) with A^T a = r: all derivatives of
one response cost one more solution.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.linear import response, signals
from suspension_cli.linear.named_results import Ratio
from suspension_cli.linear.signals import Signal
from suspension_cli.linear.system import LinearSystem
from suspension_cli.studies.builds import forbidden
from suspension_cli.studies.derivatives import Differentiable, Linear

if TYPE_CHECKING:
    from jaxtyping import Complex, Float, Inexact


@dataclass(frozen=True)
class Slope:
    """A response of a design, or the ratio of two, with its adjoint solutions.

    Attributes
    ----------
    outputs
        Complex value y, linear form r and adjoint a of each.
    state
        All coordinates for a unit input.
    signals
        The outputs, then the input.
    """

    size: float
    outputs: list[
        tuple[complex, Float[np.ndarray, " coordinate"], Complex[np.ndarray, " coordinate-6"]]
    ]
    state: Complex[np.ndarray, " coordinate"]
    omega: float
    base: Differentiable
    signals: list[Signal]

    @staticmethod
    def of(base: Differentiable, model: LinearSystem, item: Ratio) -> Slope:
        """Solve for a response; `model` is the design's system in symmetry-adapted coordinates."""
        watched = [item.over] + ([] if item.under is None else [item.under])
        # in symmetry-adapted coordinates zeros by symmetry are exact
        known = signals.bodies_with_signals(model)
        plain = [signals.parse_output(signal.text, known) for signal in watched]
        exact = response.solve(model, np.array([item.frequency]), [item.input], plain).value[
            0, :, 0
        ]
        omega = 2 * np.pi * item.frequency
        ground = item.input.is_ground
        matrix = (base.linear.driven_by_ground if ground else base.linear).dynamic(omega)
        drive, own = base.row(item.input), slice(6, None)
        state = np.zeros(len(matrix), dtype=complex)
        state[:6] = 0.0 if item.input.acts else drive[:6]
        force = drive[6:] if item.input.acts else 0.0
        state[own] = _solve_scaled(matrix[own, own], force - matrix[own, :6] @ state[:6])
        rows = [base.row(signal) for signal in watched]
        for row in rows if ground else ():
            row[:6] = 0.0  # the support is at rest
        outputs = [
            (complex(value), row, _solve_scaled(matrix[own, own].T, row[6:]))
            for value, row in zip(exact, rows, strict=True)
        ]
        with np.errstate(invalid="ignore", divide="ignore"):
            size = abs(exact[0]) if len(exact) == 1 else abs(exact[0] / exact[1])
        return Slope(float(size), outputs, state, omega, base, [*watched, item.input])

    def of_size(self, change: Linear) -> float:
        """Compute the derivative of the magnitude; NaN for a ratio to 0."""
        *watched, drive = self.signals
        moved_by = change.driven_by_ground if drive.is_ground else change
        right = -moved_by.dynamic(self.omega)[6:] @ self.state
        if drive.acts:
            right = right + self.base.row_change(change, drive)[6:]
        moved = [
            0.0
            if forbidden(change.mirrors, signal, drive)
            else self.base.row_change(change, signal) @ self.state + a @ right
            for signal, (_, _, a) in zip(watched, self.outputs, strict=True)
        ]
        value, slope = self.outputs[0][0], moved[0]
        if len(moved) > 1:
            under, other = self.outputs[1][0], moved[1]
            if under == 0:
                return np.nan
            value, slope = value / under, (slope * under - value * other) / under**2
        return float(abs(slope) if value == 0 else (np.conj(value) * slope).real / abs(value))


def _solve_scaled(
    matrix: Complex[np.ndarray, "coordinate coordinate"], right: Inexact[np.ndarray, " coordinate"]
) -> Complex[np.ndarray, " coordinate"]:
    """Solve in scaled coordinates."""
    root = np.sqrt(np.abs(np.diag(matrix)))
    root[root == 0] = 1.0
    return np.linalg.solve(matrix / np.outer(root, root), right / root) / root
