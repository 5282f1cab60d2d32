"""Sections of wire joined end to end, by elimination of the nodes between them.

Beams are joined in the coordinates q = (W, phi, a, b) of `beam.chord_stiffness`: deflection in the
middle of the chord, its slope, and the slopes of the two ends relative to it. Two beams of lengths
L_A (above) and L_B meet in a node, which is eta off the chord of the whole and leans by zeta
against it. The motion of both parts is

    W_A = W - L_B phi / 2 + eta / 2,                 W_B = W + L_A phi / 2 + eta / 2,
    phi_A = phi + eta / L_A,                         phi_B = phi - eta / L_B,
    a_A = a - eta / L_A,  b_A = zeta - eta / L_A,    a_B = zeta + eta / L_B,  b_B = b + eta / L_B,

q_A = P_A (q, eta, zeta) and q_B likewise. No force on the node gives (eta, zeta) = N q from
P_A^T K_A P_A + P_B^T K_B P_B, and with M = P [1; N] the whole is M_A^T K_A M_A + M_B^T K_B M_B. An
error of N enters in its square, as at any place without force, and what EI / L_A^3 of a short
section multiplies is its small deformation alone: in the usual difference of stiffnesses of the
ends it would swamp the tension and the longer section.

The number of resonances of the clamped wire below this frequency exceeds that of its parts by the
number of negative eigenvalues of the stiffness of (eta, zeta) (Wittrick and Williams, Q. J. Mech.
Appl. Math. 24, 263 (1971)).

Rods are joined as springs between their ends and springs from each end to the ground (`join_rods`),
because in the sum of both the stiffness of a nearly rigid wire would swamp its inertia.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from jaxtyping import Inexact, Int

ENDS = {
    2: np.array([[1.0, 0, -1, 0], [0, -1, 0, 1], [1, 0, 1, 0], [0, 1, 0, 1]]),
    1: np.array([[1.0, -1], [1, 1]]),
}
"""By p, the matrix from even and odd motion to the two ends: (W_s, T_s, W_a, T_a) of
`elements.beam` to (w_1, w'_1, w_2, w'_2), and (U_s, U_a) of `elements.rod` to (u_1, u_2)."""


def to_ends(
    even_odd: Inexact[np.ndarray, "end end frequency"],
) -> Inexact[np.ndarray, "end end frequency"]:
    """Transform a stiffness (2p, 2p, f) on even and odd motion to the two ends."""
    back = np.linalg.inv(ENDS[len(even_odd) // 2])
    return np.einsum("ki,klf,lj->ijf", back, even_odd, back)


def to_chord(length: Inexact[np.ndarray, " frequency"] | float) -> Inexact[np.ndarray, "... 4 4"]:
    """Matrix from even and odd motion to (W, phi, a, b), of beams of given lengths (m).

    phi = W_a / h, a = T_a - T_s - phi, b = T_a + T_s - phi.
    """
    result = np.zeros((*np.shape(length), 4, 4), dtype=np.result_type(length, float))
    result[..., 0, 0] = result[..., 2, 3] = result[..., 3, 1] = result[..., 3, 3] = 1
    result[..., 2, 1] = -1
    result[..., 1, 2] = 2 / length
    result[..., 2, 2] = result[..., 3, 2] = -2 / length
    return result


def chord_to_even_odd(
    stiffness: Inexact[np.ndarray, "4 4 frequency"],
    length: Inexact[np.ndarray, " frequency"] | float,
) -> Inexact[np.ndarray, "4 4 frequency"]:
    """Transform a stiffness on (W, phi, a, b) of beams (lengths in m) to even and odd motion."""
    form = to_chord(length)
    return np.moveaxis(form.swapaxes(-1, -2) @ np.moveaxis(stiffness, -1, 0) @ form, 0, -1)


def join(
    parts: list[Inexact[np.ndarray, "4 4 frequency"]],
    lengths: list[Inexact[np.ndarray, " frequency"] | float],
) -> tuple[
    Inexact[np.ndarray, "4 4 frequency"],
    list[tuple[Inexact[np.ndarray, "4 4 frequency"], ...]],
    Int[np.ndarray, " frequency"],
]:
    """Join sections of a beam.

    Parameters
    ----------
    parts
        Stiffness of each section on (W, phi, a, b), from the top.
    lengths
        Of each section, m.

    Returns
    -------
    whole
        Stiffness of all sections together on its (W, phi, a, b).
    motions
        By joint, the motion of all above it and of the section below it per motion of both.
    negative
        Number of negative eigenvalues of the stiffnesses of the nodes (of real stiffnesses only).
    """
    whole, length, motions = np.moveaxis(parts[0], -1, 0), lengths[0], []
    negative = np.zeros(len(whole), dtype=int)
    for part, own in zip(parts[1:], lengths[1:], strict=True):
        below = np.moveaxis(part, -1, 0)
        upper, lower = _node_forms(length, own, len(whole))
        both = upper.swapaxes(1, 2) @ whole @ upper + lower.swapaxes(1, 2) @ below @ lower
        node = _node_motion(both)
        if not np.iscomplexobj(both):
            negative = negative + (np.linalg.eigvalsh(both[:, 4:, 4:]) < 0).sum(-1)
        upper = upper[..., :4] + upper[..., 4:] @ node
        lower = lower[..., :4] + lower[..., 4:] @ node
        whole = upper.swapaxes(1, 2) @ whole @ upper + lower.swapaxes(1, 2) @ below @ lower
        whole, length = (whole + whole.swapaxes(1, 2)) / 2, length + own
        motions.append((np.moveaxis(upper, 0, -1), np.moveaxis(lower, 0, -1)))
    return np.moveaxis(whole, 0, -1), motions, negative


def _node_forms(
    above: Inexact[np.ndarray, " frequency"] | float,
    below: Inexact[np.ndarray, " frequency"] | float,
    count: int,
) -> tuple[Inexact[np.ndarray, "frequency 4 6"], Inexact[np.ndarray, "frequency 4 6"]]:
    """P_A and P_B of two beams of given lengths (m)."""
    upper = np.zeros((count, 4, 6), dtype=np.result_type(above, below, float))
    lower = np.zeros_like(upper)
    for form, other, slope in ((upper, -below, 1 / above), (lower, above, -1 / below)):
        form[:, 0, [0, 4]], form[:, 0, 1] = [1, 0.5], other / 2
        form[:, 1, 1], form[:, 1, 4] = 1, slope
        form[:, 2, 4] = form[:, 3, 4] = -slope
    upper[:, 2, 2] = upper[:, 3, 5] = 1
    lower[:, 2, 5] = lower[:, 3, 3] = 1
    return upper, lower


def join_rods(
    parts: list[Inexact[np.ndarray, "2 2 frequency"]],
) -> tuple[
    Inexact[np.ndarray, "2 2 frequency"],
    list[tuple[Inexact[np.ndarray, "2 2 frequency"], ...]],
    Int[np.ndarray, " frequency"],
]:
    """Join sections of a rod.

    A section is a spring c between its ends, and springs r_1 and r_2 from its ends to the ground
    (its inertia). A node between two sections, A above B, with S = c_A + c_B + r_A2 + r_B1 gives

        c = c_A c_B / S,
        r_1 = r_A1 + c_A (r_A2 + r_B1) / S,    r_2 = r_B2 + c_B (r_A2 + r_B1) / S.

    Parameters
    ----------
    parts
        Stiffness of each section on the even and odd motion of its ends, diagonal.

    Returns
    -------
    whole
        Stiffness of all sections together on the even and odd motion of the ends.
    motions, negative
        As for `join`, on the even and odd motion.
    """
    even, odd = parts[0][0, 0], parts[0][1, 1]
    spring, upper, lower = (odd - even) / 4, even / 2, even / 2
    motions, negative = [], np.zeros(np.shape(even), dtype=int)
    form = ENDS[1]
    back = np.linalg.inv(form)
    eps = np.finfo(float).eps
    for part in parts[1:]:
        below, end = (part[1, 1] - part[0, 0]) / 4, part[0, 0] / 2
        own, ground = spring + below + lower + end, lower + end
        size = np.abs(spring) + np.abs(below) + np.abs(lower) + np.abs(end)
        own = np.where(own == 0, eps * size, own)  # just beside a resonance of the node
        node, one = np.stack([spring / own, below / own]), np.ones_like(own)
        ends = [[one, 0 * one], node], [node, [0 * one, one]]
        motions.append(
            tuple(np.einsum("ij,jkf,kl->ilf", back, np.array(end), form) for end in ends)
        )
        if not np.iscomplexobj(own):
            negative = negative + (own < 0)
        upper, lower, spring = (
            upper + spring * ground / own,
            end + below * ground / own,
            spring * below / own,
        )
    return (
        np.array([[upper + lower, lower - upper], [lower - upper, upper + lower + 4 * spring]]),
        motions,
        negative,
    )


def _node_motion(
    both: Inexact[np.ndarray, "frequency 6 6"],
) -> Inexact[np.ndarray, "frequency 2 4"]:
    """Motion (eta, zeta) of a node without force, from the stiffness on (q, eta, zeta)."""
    own, coupling = both[:, 4:, 4:], both[:, 4:, :4]
    try:
        return -np.linalg.solve(own, coupling)
    except np.linalg.LinAlgError:  # at a resonance: solve just beside it
        beside = (np.linalg.det(own) == 0) * np.finfo(float).eps * np.abs(both).max((1, 2))
        return -np.linalg.solve(own + beside[:, None, None] * np.eye(2), coupling)


def section_motions(
    motions: list[tuple[Inexact[np.ndarray, "end end frequency"], ...]],
    motion: Inexact[np.ndarray, "end motion frequency"],
) -> list[Inexact[np.ndarray, "end motion frequency"]]:
    """Motion of every section, from that of the whole, in the coordinates that joined them.

    Parameters
    ----------
    motions
        From `join` or `join_rods`.
    motion
        Of r motions of the whole.
    """
    result = []
    for above, below in reversed(motions):
        result.append(np.einsum("ijf,jrf->irf", below, motion))
        motion = np.einsum("ijf,jrf->irf", above, motion)
    return [motion, *reversed(result)]
