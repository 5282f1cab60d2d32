"""Static stiffness of wires against rotation of their ends, for arrays of lengths and tensions.

A beam of length L = 2h, bending stiffness EI and tension T, whose ends lean by a and b against its
chord, stores (a, b) S (a, b)^T / 2. With u^2 = T h^2 / EI and t = h tanh(u) / u, opposite and equal
slopes have (w'''' EI = T w''; Gonzalez and Saulson, J. Acoust. Soc. Am. 96, 207 (1994), for u >> 1)

    even, (b - a) / 2:  2 EI / t,        odd, (a + b) / 2:  2 EI u^2 t / (h^2 (1 - t/h)),
    S_uu = S_ll = (odd + even) / 4,      S_ul = (odd - even) / 4.

The chord alone has T L. Two beams of lengths L_A (above) and L_B meet in a node, eta off the chord
of both together and leaning by zeta against it. Their own slopes are

    a_A = a - eta / L_A,  b_A = zeta - eta / L_A,    a_B = zeta + eta / L_B,  b_B = b + eta / L_B,

and their chords add T (1/L_A + 1/L_B) eta^2 / 2. No force on the node gives eta and zeta for a = 1
and for b = 1; the stiffness of both follows from the energy, in which an error of eta or zeta
enters as its square. As EI / L^3 does not appear, a short section swamps no long one.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from jaxtyping import Inexact

    from suspension_cli.scene.composition import Section

GAP_TERMS = 10
"""Terms of the series of (cosh u - sinh(u)/u) / u^2, for |u| < 1."""


class Slopes(NamedTuple):
    """Stiffness S_uu, S_ul and S_ll against the slopes of the ends to the chord, N m."""

    uu: Inexact[np.ndarray, "*shape"]
    ul: Inexact[np.ndarray, "*shape"]
    ll: Inexact[np.ndarray, "*shape"]


def resistance(
    sections: tuple[Section, ...],
    length: Inexact[np.ndarray, "*#shape"] | complex,
    tension: Inexact[np.ndarray, "*#shape"] | complex,
    torsion: Inexact[np.ndarray, "*#shape"] | complex = 0.0,
) -> tuple[Inexact[np.ndarray, "2 3 *shape"], Inexact[np.ndarray, "*shape"]]:
    """Compute the static stiffness of wires of the same sections, without loss.

    Parameters
    ----------
    sections
        From the upper to the lower end; their lengths share `length` in proportion.
    length, tension
        Of each wire, m and N (at least 0); complex numbers for complex steps.
    torsion
        Torsional stiffness that the design gives, N m/rad; 0 where it gives none.

    Returns
    -------
    bend
        S_uu, S_ul, S_ll in both principal planes, N m.
    twist
        Stiffness against twisting, N m/rad.
    """
    planes = 1 if all(section.round for section in sections) else 2
    shape = np.broadcast_shapes(np.shape(length), np.shape(tension), np.shape(torsion))
    stretch = length / sum(section.length for section in sections)
    rigidity = np.array([section.rigidity[:planes] for section in sections])
    slopes = slope_stiffness(
        rigidity.reshape(-1, planes, *(1,) * len(shape)),
        tension,
        [section.length * stretch for section in sections],
    )
    whole = np.stack([np.broadcast_to(own, (planes, *shape)) for own in slopes], axis=1)
    compliance = sum(
        section.length * stretch / (section.twisting + tension * section.polar_area)
        for section in sections
    )
    given = np.real(torsion) > 0
    twist = np.where(given, torsion, 1 / compliance)
    return np.broadcast_to(whole, (2, 3, *shape)), twist


def slope_stiffness(
    rigidity: Inexact[np.ndarray, "section *#shape"],
    tension: Inexact[np.ndarray, "*#shape"] | complex,
    lengths: Sequence[Inexact[np.ndarray, "*#shape"] | complex],
) -> Slopes:
    """Stiffness of joined sections on the slopes of the ends to the chord.

    Parameters
    ----------
    rigidity
        EI of the sections, N m^2; complex with loss.
    tension
        N.
    lengths
        Of the sections, m.
    """
    parts = map(_uniform, rigidity, [tension] * len(lengths), lengths)
    whole, above = next(parts), lengths[0]
    for part, length in zip(parts, lengths[1:], strict=True):
        whole, above = _join(whole, part, above, length, tension), above + length
    return whole


def hinge_distances(
    sections: tuple[Section, ...],
    length: Inexact[np.ndarray, "*#shape"] | complex,
    tension: Inexact[np.ndarray, "*#shape"] | complex,
) -> tuple[Inexact[np.ndarray, "*shape"], Inexact[np.ndarray, "*shape"]]:
    """Distances u = M / V (m) from the upper and lower clamp at which a wire seems to be hinged.

    M is the moment and V the shear force on one clamp when the other is displaced sideways: a chord
    that turns by phi, both slopes being -phi, has (S_uu + S_ul) phi and (T L + S_uu + 2 S_ul +
    S_ll) phi / L. In the first plane, the soft one of a ribbon. `length` is that between the
    clamps; the arguments are those of `resistance`.
    """
    bend, _ = resistance(sections, length, tension)
    uu, ul, ll = bend[0]
    force = (tension * length + uu + 2 * ul + ll) / length
    return (uu + ul) / force, (ul + ll) / force


def _uniform(
    rigidity: Inexact[np.ndarray, "*#shape"],
    tension: Inexact[np.ndarray, "*#shape"] | complex,
    length: Inexact[np.ndarray, "*#shape"] | complex,
) -> Slopes:
    h = length / 2
    square = tension / rigidity * h**2
    u = np.sqrt(square)
    soft = np.abs(square) < 1  # in stiff or short beams 1 - tanh(u)/u cancels
    far = np.where(soft, 1, u)
    lag = np.tanh(far) / far  # tanh(u)/u
    ratio = far**2 / (1 - lag)  # u^2 / (1 - tanh(u)/u)
    if np.any(soft):
        near = np.where(soft, square, 0)
        cosh, total = np.cosh(np.where(soft, u, 0)), np.zeros_like(near)
        for k in range(GAP_TERMS, 0, -1):
            total = total * near + 2 * k / math.factorial(2 * k + 1)
        lag = np.where(soft, 1 - near * total / cosh, lag)
        ratio = np.where(soft, cosh / total, ratio)
    even, odd = 2 * rigidity / (h * lag), 2 * rigidity * ratio * lag / h
    same = (odd + even) / 4
    return Slopes(same, (odd - even) / 4, same)


def _join(
    upper: Slopes,
    lower: Slopes,
    above: Inexact[np.ndarray, "*#shape"] | complex,
    below: Inexact[np.ndarray, "*#shape"] | complex,
    tension: Inexact[np.ndarray, "*#shape"] | complex,
) -> Slopes:
    p, q = 1 / above, 1 / below
    string = tension * (p + q)
    # forces on the node: eta and zeta by themselves and mixed, then per a and per b
    ee = p**2 * (upper.uu + 2 * upper.ul + upper.ll) + string
    ee = ee + q**2 * (lower.uu + 2 * lower.ul + lower.ll)
    ez, zz = q * (lower.uu + lower.ul) - p * (upper.ul + upper.ll), upper.ll + lower.uu
    ea, za = -p * (upper.uu + upper.ul), upper.ul
    eb, zb = q * (lower.ul + lower.ll), lower.ul
    over = 1 / (ee * zz - ez**2)
    motions = []
    for (e, z), a, b in (((ea, za), 1, 0), ((eb, zb), 0, 1)):
        eta, zeta = (ez * z - zz * e) * over, (ez * e - ee * z) * over
        motions.append((eta, a - p * eta, zeta - p * eta, zeta + q * eta, b + q * eta))

    def energy(i: int, j: int) -> Inexact[np.ndarray, "*shape"]:
        (eta, *one), (other_eta, *other) = motions[i], motions[j]
        total = string * eta * other_eta
        for part, (a, b), (c, d) in ((upper, one[:2], other[:2]), (lower, one[2:], other[2:])):
            total = total + part.uu * a * c + part.ul * (a * d + b * c) + part.ll * b * d
        return total

    return Slopes(energy(0, 0), energy(0, 1), energy(1, 1))
