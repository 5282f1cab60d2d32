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
error of N enters in its square, as no force acts on the node. EI / L_A^3 of a short section
multiplies only its small deformation; in the usual difference of stiffnesses of the ends it would
swamp the tension and the longer section.

The number of resonances of the clamped wire below this frequency exceeds that of its parts by the
number of negative eigenvalues of the stiffness of (eta, zeta) (Wittrick and Williams, Q. J. Mech.
Appl. Math. 24, 263 (1971)).

Rods are joined as springs between their ends and springs from each end to the ground (`join_rods`):
in the sum of both, the stiffness of a nearly rigid wire would swamp its inertia.
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
    """Matrix from even and odd motion to (W, phi, a, b), for beams of given lengths (m).

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
    parts: Inexact[np.ndarray, "4 4 section frequency"],
    lengths: Inexact[np.ndarray, "section *#frequency"],
) -> tuple[
    Inexact[np.ndarray, "4 4 frequency"],
    list[tuple[Inexact[np.ndarray, "_ frequency 4 4"], ...]],
    Int[np.ndarray, " frequency"],
]:
    """Join sections of a beam in pairs, then the pairs, until one is left.

    Parameters
    ----------
    parts
        Stiffness of each section on (W, phi, a, b), from the top.
    lengths
        Of each section, m.

    Returns
    -------
    whole
        Stiffness of all together on (W, phi, a, b).
    motions
        By round, the motion of upper and lower parts per motion of the joined pairs.
    negative
        Number of negative eigenvalues of the stiffnesses of the nodes, if real.
    """
    whole, motions = np.moveaxis(parts, (0, 1), (-2, -1)), []
    negative = np.zeros(whole.shape[1], dtype=int)
    while len(whole) > 1:
        paired = len(whole) // 2 * 2
        above, below = (whole[start:paired:2] for start in (0, 1))
        upper, lower = _node_forms(lengths[0:paired:2], lengths[1:paired:2])
        both = upper.swapaxes(-1, -2) @ above @ upper + lower.swapaxes(-1, -2) @ below @ lower
        node = _node_motion(both)
        if not np.iscomplexobj(both):
            negative = negative + (np.linalg.eigvalsh(both[..., 4:, 4:]) < 0).sum((0, -1))
        upper, lower = (form[..., :4] + form[..., 4:] @ node for form in (upper, lower))
        pairs = upper.swapaxes(-1, -2) @ above @ upper + lower.swapaxes(-1, -2) @ below @ lower
        whole = np.concatenate([(pairs + pairs.swapaxes(-1, -2)) / 2, whole[paired:]])
        lengths = np.concatenate([lengths[0:paired:2] + lengths[1:paired:2], lengths[paired:]])
        motions.append((upper, lower))
    return np.moveaxis(whole[0], 0, -1), motions, negative


def _node_forms(
    above: Inexact[np.ndarray, "pair *#frequency"],
    below: Inexact[np.ndarray, "pair *#frequency"],
) -> tuple[
    Inexact[np.ndarray, "pair *#frequency 4 6"],
    Inexact[np.ndarray, "pair *#frequency 4 6"],
]:
    """P_A and P_B of pairs of beams of given lengths (m)."""
    upper = np.zeros((*above.shape, 4, 6), dtype=above.dtype)
    lower = np.zeros_like(upper)
    for form, other, slope in ((upper, -below, 1 / above), (lower, above, -1 / below)):
        form[..., 0, [0, 4]], form[..., 0, 1] = [1, 0.5], other / 2
        form[..., 1, 1], form[..., 1, 4] = 1, slope
        form[..., 2, 4] = form[..., 3, 4] = -slope
    upper[..., 2, 2] = upper[..., 3, 5] = 1
    lower[..., 2, 5] = lower[..., 3, 3] = 1
    return upper, lower


def join_rods(
    parts: Inexact[np.ndarray, "2 section frequency"],
) -> tuple[
    Inexact[np.ndarray, "2 2 frequency"],
    list[tuple[Inexact[np.ndarray, "_ frequency 2 2"], ...]],
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
        Stiffness of each section on the even and on the odd motion of its ends.

    Returns
    -------
    whole
        Stiffness of all together on the even and odd motion of the ends.
    motions, negative
        As for `join`, on the even and odd motion.
    """
    even, odd = parts
    springs, motions = np.array([(odd - even) / 4, even / 2, even / 2]), []  # c, r_1, r_2
    negative, form = np.zeros(even.shape[-1], dtype=int), ENDS[1]
    while springs.shape[1] > 1:
        paired = springs.shape[1] // 2 * 2
        (c_a, r_a1, r_a2), (c_b, r_b1, r_b2) = (springs[:, n:paired:2] for n in (0, 1))
        terms = np.array([c_a, c_b, r_a2, r_b1])
        own = terms.sum(0)
        # just beside a resonance of the node
        own = np.where(own == 0, np.finfo(float).eps * np.abs(terms).sum(0), own)
        if not np.iscomplexobj(own):
            negative = negative + (own < 0).sum(0)
        node, ground = np.stack([c_a / own, c_b / own], axis=-1), (r_a2 + r_b1) / own
        pairs = np.array([c_a * node[..., 1], r_a1 + c_a * ground, r_b2 + c_b * ground])
        springs = np.concatenate([pairs, springs[:, paired:]], axis=1)
        still = np.broadcast_to(np.eye(2), (*own.shape, 2, 2))
        ends = (
            np.stack([still[..., 0, :], node], axis=-2),
            np.stack([node, still[..., 1, :]], axis=-2),
        )
        motions.append(tuple(np.linalg.inv(form) @ end @ form for end in ends))
    c, upper, lower = springs[:, 0]
    whole = np.array([[upper + lower, lower - upper], [lower - upper, upper + lower + 4 * c]])
    return whole, motions, negative


def _node_motion(
    both: Inexact[np.ndarray, "pair frequency 6 6"],
) -> Inexact[np.ndarray, "pair frequency 2 4"]:
    """Motion (eta, zeta) of a node without force, from the stiffness on (q, eta, zeta)."""
    own, coupling = both[..., 4:, 4:], both[..., 4:, :4]
    try:
        return -np.linalg.solve(own, coupling)
    except np.linalg.LinAlgError:  # at a resonance: solve just beside it
        beside = (np.linalg.det(own) == 0) * np.finfo(float).eps * np.abs(both).max((-1, -2))
        return -np.linalg.solve(own + beside[..., None, None] * np.eye(2), coupling)


def section_motions(
    motions: list[tuple[Inexact[np.ndarray, "_ frequency end end"], ...]],
    motion: Inexact[np.ndarray, "end motion frequency"],
) -> Inexact[np.ndarray, "section end motion frequency"]:
    """Motion of every section, from that of the whole, in the coordinates that joined them.

    Parameters
    ----------
    motions
        From `join` or `join_rods`.
    motion
        Of r motions of the whole.
    """
    parts = np.moveaxis(motion, -1, 0)[None]
    for upper, lower in reversed(motions):
        joined = parts[: len(upper)]
        both = np.stack([upper @ joined, lower @ joined], axis=1)
        parts = np.concatenate([both.reshape(-1, *both.shape[2:]), parts[len(upper) :]])
    return np.moveaxis(parts, 1, -1)
