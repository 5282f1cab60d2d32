"""Sections of wire joined end to end, by elimination of the nodes between them.

A section is a stiffness between its upper (u) and its lower end (l), p coordinates each: deflection
and slope of a bent beam (p = 2), displacement or rotation of a rod (p = 1). Joining the sections
above a node (A) to the section below it (B), with no force on the node,

    S = A_ll + B_uu,    node = -S^-1 (A_lu upper + B_ul lower),
    whole = diag(A_uu, B_ll) - [A_ul; B_lu] S^-1 [A_lu, B_ul].

The number of resonances of the clamped wire below this frequency exceeds that of its parts by the
number of negative eigenvalues of S (Wittrick and Williams, Q. J. Mech. Appl. Math. 24, 263 (1971)).

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


def to_even_odd(
    stiffness: Inexact[np.ndarray, "end end frequency"],
) -> Inexact[np.ndarray, "end end frequency"]:
    """Transform a stiffness (2p, 2p, f) on the two ends to even and odd motion."""
    form = ENDS[len(stiffness) // 2]
    return np.einsum("ki,klf,lj->ijf", form, stiffness, form)


def join(
    parts: list[Inexact[np.ndarray, "end end frequency"]],
) -> tuple[
    Inexact[np.ndarray, "end end frequency"],
    list[Inexact[np.ndarray, "end//2 end frequency"]],
    Int[np.ndarray, " frequency"],
]:
    """Join sections of a beam.

    Parameters
    ----------
    parts
        Stiffness of each section between its ends, from the top.

    Returns
    -------
    whole
    nodes
        Motion of each inner node per motion of the upper end and of the node below.
    negative
        Number of negative eigenvalues of the stiffnesses S of the nodes (of real stiffnesses only).
    """
    whole, nodes = parts[0], []
    p = len(whole) // 2
    negative = np.zeros(whole.shape[-1], dtype=int)
    for part in parts[1:]:
        own = whole[p:, p:] + part[:p, :p]
        coupling = np.concatenate([whole[p:, :p], part[:p, p:]], axis=1)
        try:
            node = _node_motion(own, coupling)
        except np.linalg.LinAlgError:
            own = _off_resonance(own, np.abs(whole[p:, p:]) + np.abs(part[:p, :p]))
            node = _node_motion(own, coupling)
        if not np.iscomplexobj(own):
            negative = negative + (np.linalg.eigvalsh(np.moveaxis(own, -1, 0)) < 0).sum(-1)
        joined = np.einsum("kif,kjf->ijf", coupling, node)
        joined[:p, :p] += whole[:p, :p]
        joined[p:, p:] += part[p:, p:]
        whole = (joined + np.swapaxes(joined, 0, 1)) / 2
        nodes.append(node)
    return whole, nodes, negative


def join_rods(
    parts: list[Inexact[np.ndarray, "2 2 frequency"]],
) -> tuple[
    Inexact[np.ndarray, "2 2 frequency"],
    list[Inexact[np.ndarray, "1 2 frequency"]],
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
    nodes, negative
        As for `join`.
    """
    even, odd = parts[0][0, 0], parts[0][1, 1]
    spring, upper, lower = (odd - even) / 4, even / 2, even / 2
    nodes, negative = [], np.zeros(np.shape(even), dtype=int)
    eps = np.finfo(float).eps
    for part in parts[1:]:
        below, end = (part[1, 1] - part[0, 0]) / 4, part[0, 0] / 2
        own, ground = spring + below + lower + end, lower + end
        size = np.abs(spring) + np.abs(below) + np.abs(lower) + np.abs(end)
        own = np.where(own == 0, eps * size, own)  # just beside a resonance of the node
        nodes.append(np.stack([spring / own, below / own])[None])
        if not np.iscomplexobj(own):
            negative = negative + (own < 0)
        upper, lower, spring = (
            upper + spring * ground / own,
            end + below * ground / own,
            spring * below / own,
        )
    return (
        np.array([[upper + lower, lower - upper], [lower - upper, upper + lower + 4 * spring]]),
        nodes,
        negative,
    )


def _off_resonance(
    own: Inexact[np.ndarray, "node node frequency"],
    size: Inexact[np.ndarray, "node node frequency"],
) -> Inexact[np.ndarray, "node node frequency"]:
    """Shift exactly singular stiffnesses (p, p, f) of a node by one rounding of `size`."""
    singular = np.linalg.det(np.moveaxis(own, -1, 0)) == 0
    return own + singular * np.finfo(float).eps * size.max((0, 1)) * np.eye(len(own))[..., None]


def _node_motion(
    own: Inexact[np.ndarray, "node node frequency"],
    coupling: Inexact[np.ndarray, "node 2*node frequency"],
) -> Inexact[np.ndarray, "node 2*node frequency"]:
    """-S^-1 coupling, (p, 2p, f), for the stiffness S (p, p, f) of a node."""
    return -np.moveaxis(
        np.linalg.solve(np.moveaxis(own, -1, 0), np.moveaxis(coupling, -1, 0)), 0, -1
    )


def section_motions(
    nodes: list[Inexact[np.ndarray, "end//2 end frequency"]],
    motion: Inexact[np.ndarray, "end motion frequency"],
) -> list[Inexact[np.ndarray, "end motion frequency"]]:
    """Motion (2p, r, f) of the ends of every section, from that of the ends of the whole.

    Parameters
    ----------
    nodes
        From `join` or `join_rods`.
    motion
        Of the upper and the lower end of the whole.
    """
    p = len(motion) // 2
    upper, below, result = motion[:p], motion[p:], []
    for motion_per_neighbours in reversed(nodes):
        ends_above = np.concatenate([upper, below])
        node = np.einsum("ijf,jrf->irf", motion_per_neighbours, ends_above)
        result.append(np.concatenate([node, below]))
        below = node
    result.append(np.concatenate([upper, below]))
    return result[::-1]
