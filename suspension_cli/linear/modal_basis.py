"""Equations of motion in the basis of the undamped modes, with losses of any size.

Z(s) = K + s C + s^2 M + L(omega), with K, C, M symmetric and L the stiffness that loss angles add
(i phi K, ...) at the frequency omega = Im s of the motion. A loss angle is the phase lag of an
oscillation, so L(0) = 0. Of wires with mass, L is also what their mass changes, at omega = -i s.

In the basis of the undamped modes (omega_j, x_j, of unit modal mass) and of the massless directions
e_j of unit stiffness,

    (k_j + s^2 m_j) y_j + sum over k of G_jk(s) y_k = 0,
    G = X^T (s C + L) X,    k_j = omega_j^2 or 1,    m_j = 1 or 0,

which is exact, as the basis is complete. The stiffness is diagonal in it, so that of a stiff wire
adds no rounding error to the loss of a soft mode. Let S be the modes that losses couple strongly
(one alone, or several close together). With the others, R, eliminated,

    -s^2 = an eigenvalue of  k_S + G_SS - G_SR (k_R + s^2 m_R + G_RR)^-1 G_RS,

and a Q of 1e12 keeps all its digits.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.linear.elastic_losses import ElasticLosses

if TYPE_CHECKING:
    from jaxtyping import Complex, Float, Inexact, Int

ROUNDING = 1e-10
"""Coupling of two modes by losses, over their own losses, that is a rounding error; it would mix
modes of equal frequency."""
STEPS = 30
"""Most steps of any iteration."""
FEW = 30
"""Number of equations up to which elimination is as fast as iteration."""
EXACT = np.finfo(float).eps / 8
"""Relative change at which an iterative solution of linear equations is exact in doubles."""
CONVERGED = 4 * np.finfo(float).eps
"""Relative change at which an iteration ends."""


@dataclass(frozen=True)
class Basis:
    """Equations of motion in the basis of undamped modes and massless directions.

    Attributes
    ----------
    stiffness, inertia
        k_j and m_j: omega_j^2 and 1 of a mode, 1 (or -1) and 0 of a massless direction.
    viscous
        X^T C X, 1/s.
    place
        Numbers of these coordinates among those of `elastic`.
    elastic
        X^T L(omega) X.
    """

    stiffness: Float[np.ndarray, " coordinate"]
    inertia: Float[np.ndarray, " coordinate"]
    viscous: Float[np.ndarray, "coordinate coordinate"]
    place: Int[np.ndarray, " coordinate"]
    elastic: ElasticLosses

    def losses(
        self, s: Inexact[np.ndarray, " frequency"]
    ) -> Complex[np.ndarray, "frequency coordinate coordinate"]:
        """G at s, rad/s; without loss angles where s is real."""
        s = np.asarray(s, dtype=complex)
        oscillates = np.imag(s) > 0
        if self.elastic.is_constant and oscillates.all() and len(s) and not self.viscous.any():
            one = self._without_rounding(self.elastic.at(np.imag(s)[:1], self.place))
            return np.broadcast_to(one, (len(s), *one.shape[1:]))
        result = s[:, None, None] * self.viscous
        if oscillates.any():
            result[oscillates] += self.elastic.at(-1j * s[oscillates], self.place)
        return self._without_rounding(result)

    def own_losses(
        self, s: Complex[np.ndarray, " frequency"]
    ) -> Complex[np.ndarray, "frequency coordinate"]:
        """G_kk at s, rad/s, of oscillating motion."""
        return s[:, None] * self.viscous.diagonal() + self.elastic.diagonal(np.imag(s), self.place)

    def loss_rows(
        self, s: Complex[np.ndarray, " frequency"], row: Int[np.ndarray, " frequency"]
    ) -> tuple[
        Complex[np.ndarray, "frequency coordinate"], Complex[np.ndarray, "frequency coordinate"]
    ]:
        """One `row` of G at each s, and `own_losses`; s as there."""
        own = self.own_losses(s)
        result = s[:, None] * self.viscous[row] + self.elastic.rows(np.imag(s), self.place, row)
        size = np.sqrt(np.abs(own))
        least = ROUNDING * size[np.arange(len(s)), row, None] * size
        return np.where(np.abs(result) > least, result, 0.0), own

    def _without_rounding(
        self, losses: Complex[np.ndarray, "frequency coordinate coordinate"]
    ) -> Complex[np.ndarray, "frequency coordinate coordinate"]:
        """Set elements that are rounding errors to 0, in place."""
        size = np.abs(np.diagonal(losses, axis1=1, axis2=2))
        square = np.real(losses) ** 2  # faster than the magnitude
        square += np.imag(losses) ** 2
        losses[square <= ROUNDING**2 * size[:, :, None] * size[:, None, :]] = 0.0
        return losses

    def within(self, some: Int[np.ndarray, " some"]) -> Basis:
        """Restrict to coordinates that losses do not couple to the others."""
        return Basis(
            self.stiffness[some],
            self.inertia[some],
            self.viscous[np.ix_(some, some)],
            self.place[some],
            self.elastic,
        )


def condense(
    basis: Basis,
    group: Int[np.ndarray, " group"],
    s: complex,
    losses: Complex[np.ndarray, "coordinate coordinate"],
    least: float = 0.0,
) -> tuple[
    Complex[np.ndarray, "group group"],
    Complex[np.ndarray, "other group"],
    Int[np.ndarray, " other"],
]:
    """Eliminate all modes but a group: G_SS - G_SR (k_R + s^2 m_R + G_RR)^-1 G_RS.

    `losses` is G at s. Modes whose relative contribution is below `least` are left out. Also
    returns the motion of the eliminated modes with the group, and their numbers.
    """
    own, column = losses[np.ix_(group, group)], losses[:, group]
    diagonal = basis.stiffness + s**2 * basis.inertia + np.diagonal(losses)
    part = (np.abs(column) ** 2).max(1) > least * np.abs(diagonal) * np.abs(own).max()
    part[group] = False
    others = np.flatnonzero(part)
    rest = losses[others[:, None], others]
    follow = -_solve_far(diagonal[others], rest, column[others])
    return own + losses[np.ix_(group, others)] @ follow, follow, others


def _solve_far(
    diagonal: Complex[np.ndarray, " other"],
    losses: Complex[np.ndarray, "other other"],
    right: Complex[np.ndarray, "other group"],
) -> Complex[np.ndarray, "other group"]:
    """Solve the equations of modes far from resonance, which losses couple little.

    The given `diagonal` replaces that of the losses, which are changed. Jacobi's iteration takes
    far fewer operations than elimination, which is used where the former does not converge.
    """
    np.fill_diagonal(losses, 0.0)
    if len(diagonal) > FEW:
        scaled = right / diagonal[:, None]
        result, last = scaled, np.inf
        for _ in range(STEPS):
            new = scaled - (losses @ result) / diagonal[:, None]
            moved = np.abs(new - result).max()
            result = new
            if moved <= EXACT * np.abs(new).max():
                return result
            if not moved < last / 4:
                break
            last = moved
    np.fill_diagonal(losses, diagonal)
    return np.linalg.solve(losses, right)
