"""Sections of wire, one below the other, as one: their inner nodes eliminated from the top down, and found again.

Every section is a stiffness between its upper and its lower end, p coordinates each (deflection and slope of a bent beam: p = 2; one
for a rod).  Joining what stands above a node (A) to the section below it (B) and letting the node go where no force is left on it,

    S = A_ll + B_uu,    node = -S^-1 (A_lu upper + B_ul lower),    whole = diag(A_uu, B_ll) - [A_ul; B_lu] S^-1 [A_lu, B_ul].

S has as many negative eigenvalues as the held whole has resonances more, below this frequency, than its parts (Wittrick and Williams, Q. J. Mech.
Appl. Math. 24, 263 (1971)).

Sections of rods are joined by what pulls their ends together and what else holds each end (`join_rods`), as in the sum of both the stiffness of a
nearly rigid wire would drown its inertia.
"""

from __future__ import annotations

from typing import Any

import numpy as np

# (w_1, w'_1, w_2, w'_2) from the even and odd motion (W_s, T_s, W_a, T_a) of `mechanics.beam`, and (u_1, u_2) from (U_s, U_a)
ENDS = {2: np.array([[1.0, 0, -1, 0], [0, -1, 0, 1], [1, 0, 1, 0], [0, 1, 0, 1]]), 1: np.array([[1.0, -1], [1, 1]])}


def ends(even_odd: Any) -> Any:
    """A stiffness (2p, 2p, f) on even and odd motion, taken to the two ends."""
    back = np.linalg.inv(ENDS[len(even_odd) // 2])
    return np.einsum("ki,klf,lj->ijf", back, even_odd, back)


def even_odd(stiffness: Any) -> Any:
    """A stiffness (2p, 2p, f) on the two ends, taken to even and odd motion."""
    form = ENDS[len(stiffness) // 2]
    return np.einsum("ki,klf,lj->ijf", form, stiffness, form)


def join(parts: list[Any]) -> tuple[Any, list[Any], Any]:
    """Join sections.

    Parameters
    ----------
    parts : list of (2p, 2p, f) arrays
        Stiffness of each section between its ends, from the top.

    Returns
    -------
    whole : (2p, 2p, f) array
    nodes : list of (p, 2p, f) arrays
        Each inner node's motion from those of the upper end and of the node below.
    negative : (f,) int array
        How many negative eigenvalues the nodes' own stiffnesses have (real stiffnesses only).
    """
    whole, nodes = parts[0], []
    p = len(whole) // 2
    negative = np.zeros(whole.shape[-1], dtype=int)
    for part in parts[1:]:
        own = whole[p:, p:] + part[:p, :p]
        pull = np.concatenate([whole[p:, :p], part[:p, p:]], axis=1)
        try:
            move = _following(own, pull)
        except np.linalg.LinAlgError:
            own = _off_resonance(own, np.abs(whole[p:, p:]) + np.abs(part[:p, :p]))
            move = _following(own, pull)
        if not np.iscomplexobj(own):
            negative = negative + (np.linalg.eigvalsh(np.moveaxis(own, -1, 0)) < 0).sum(-1)
        new = np.einsum("kif,kjf->ijf", pull, move)
        new[:p, :p] += whole[:p, :p]
        new[p:, p:] += part[p:, p:]
        whole = (new + np.swapaxes(new, 0, 1)) / 2
        nodes.append(move)
    return whole, nodes, negative


def join_rods(parts: list[Any]) -> tuple[Any, list[Any], Any]:
    """Join sections of a rod.

    A section is a spring c between its ends, and r_1 and r_2 from each of them to the ground (its inertia).  A node between two of them, A above B, with
    S = c_A + c_B + r_A2 + r_B1 gives

        c = c_A c_B / S,    r_1 = r_A1 + c_A (r_A2 + r_B1) / S,    r_2 = r_B2 + c_B (r_A2 + r_B1) / S.

    Parameters
    ----------
    parts : list of (2, 2, f) arrays
        Stiffness of each section on the even and odd motion of its ends, diagonal.

    Returns
    -------
    whole : (2, 2, f) array
        The same of all together.
    nodes, negative
        As for `join`.
    """
    even, odd = parts[0][0, 0], parts[0][1, 1]
    spring, upper, lower = (odd - even) / 4, even / 2, even / 2
    nodes, negative = [], np.zeros(np.shape(even), dtype=int)
    for part in parts[1:]:
        below, end = (part[1, 1] - part[0, 0]) / 4, part[0, 0] / 2
        own, held = spring + below + lower + end, lower + end
        own = np.where(own == 0, np.finfo(float).eps * (np.abs(spring) + np.abs(below) + np.abs(lower) + np.abs(end)), own)  # beside a resonance of the node
        nodes.append(np.stack([spring / own, below / own])[None])
        if not np.iscomplexobj(own):
            negative = negative + (own < 0)
        upper, lower, spring = upper + spring * held / own, end + below * held / own, spring * below / own
    return np.array([[upper + lower, lower - upper], [lower - upper, upper + lower + 4 * spring]]), nodes, negative


def _off_resonance(own: Any, size: Any) -> Any:
    """A node's stiffness (p, p, f), a sum of parts of some size (p, p, f); at a resonance of the node, to the last bit, beside it by half a rounding."""
    singular = np.linalg.det(np.moveaxis(own, -1, 0)) == 0
    return own + singular * np.finfo(float).eps * size.max((0, 1)) * np.eye(len(own))[..., None]


def _following(own: Any, pull: Any) -> Any:
    """Motion (p, 2p, f) of a node of stiffness (p, p, f) that is pulled on by (p, 2p, f)."""
    return -np.moveaxis(np.linalg.solve(np.moveaxis(own, -1, 0), np.moveaxis(pull, -1, 0)), 0, -1)


def sections_moved(nodes: list[Any], motion: Any) -> list[Any]:
    """Motion (2p, r, f) of the ends of every section, from that of the ends of the whole (2p, r, f)."""
    p = len(motion) // 2
    upper, below, found = motion[:p], motion[p:], []
    for move in reversed(nodes):
        node = np.einsum("ijf,jrf->irf", move, np.concatenate([upper, below]))
        found.append(np.concatenate([node, below]))
        below = node
    found.append(np.concatenate([upper, below]))
    return found[::-1]
