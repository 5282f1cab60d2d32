"""Static stiffness of wires against rotation of their ends, for arrays of lengths and tensions.

A beam of length L = 2h, bending stiffness EI and tension T, whose ends lean by a and b against its
chord, stores (a, b) S (a, b)^T / 2. With u^2 = T h^2 / EI and t = h tanh(u) / u, opposite and equal
slopes have (w'''' EI = T w''; Gonzalez and Saulson, J. Acoust. Soc. Am. 96, 207 (1994), for u >> 1)

    even, (b - a) / 2:  2 EI / t,        odd, (a + b) / 2:  2 EI u^2 t / (h^2 (1 - t/h)),
    S_uu = S_ll = (odd + even) / 4,      S_ul = (odd - even) / 4.

The chord alone has T L. Sections are joined as `elements.joined_sections` says.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.elements.functions import tanhc
from suspension_cli.elements.joined_sections import Joined, join

if TYPE_CHECKING:
    from jaxtyping import Inexact

    from suspension_cli.scene.composition import Section


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
        Of each wire, m and N (a wire that pushes has the stiffness of one without tension);
        complex numbers for complex steps.
    torsion
        Torsional stiffness that the design gives, N m/rad; 0 where it gives none.

    Returns
    -------
    bend
        S_uu, S_ul, S_ll in both principal planes, N m.
    twist
        Stiffness against twisting, N m/rad.
    """
    tension = np.where(np.real(tension) >= 0, tension, 0.0)
    planes = 1 if all(section.round for section in sections) else 2
    shape = np.broadcast_shapes(np.shape(length), np.shape(tension), np.shape(torsion))
    stretch = length / sum(section.length for section in sections)
    rigidity = np.array([section.rigidity[:planes] for section in sections])
    lengths = np.stack([section.length * stretch + np.zeros((1, *shape)) for section in sections])
    rigidity = rigidity.reshape(*rigidity.shape, *(1,) * len(shape))
    (even, mixed), (_, odd) = slope_stiffness(rigidity, tension, lengths).stiffness
    bend = np.stack([odd + even - 2 * mixed, odd - even, odd + even + 2 * mixed], axis=1) / 4
    compliance = sum(
        section.length * stretch / (section.twisting + tension * section.polar_area)
        for section in sections
    )
    given = np.real(torsion) > 0
    twist = np.where(given, torsion, 1 / compliance)
    return np.broadcast_to(bend, (2, 3, *shape)), twist


def slope_stiffness(
    rigidity: Inexact[np.ndarray, "section *#shape"],
    tension: Inexact[np.ndarray, "*#shape"] | complex,
    lengths: Inexact[np.ndarray, "section *#shape"],
) -> Joined:
    """Stiffness (2, 2, ...) of joined sections on (T_s, d), see `elements.joined_sections`.

    Parameters
    ----------
    rigidity
        EI of the sections, N m^2; complex with loss.
    tension
        N.
    lengths
        Of the sections, m.
    """
    even, odd = uniform_stiffness(rigidity, tension, lengths / 2)
    none = np.zeros_like(even)
    parts = np.array([[even, none], [none, odd]])
    return join(parts, np.broadcast_to(tension, lengths.shape), lengths)


def uniform_stiffness(
    rigidity: Inexact[np.ndarray, "*#shape"],
    tension: Inexact[np.ndarray, "*#shape"] | complex,
    half: Inexact[np.ndarray, "*#shape"],
) -> list[Inexact[np.ndarray, "*shape"]]:
    """Stiffness of uniform beams of length 2 `half` on T_s and on d."""
    lag, gap = tanhc(np.sqrt(tension / rigidity) * half)
    return [2 * rigidity / (half * lag), 2 * rigidity * lag / (half * gap)]


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
