"""Static stiffness of wires against rotation of their ends, for arrays of lengths and tensions.

>>> even, odd = uniform_stiffness(np.array(1e-3), tension=100.0, half=0.25)
>>> float(even.round(4)), float(odd.round(4))  # each end has about sqrt(EI T) = 0.3162 N m/rad
(0.6325, 0.6406)

A beam of length L = 2h, bending stiffness EI and tension T, whose ends lean by a and b against its
chord, stores (a, b) S (a, b)^T / 2. With u^2 = T h^2 / EI and t = h tanh(u) / u, opposite and equal
slopes have (w'''' EI = T w''; Gonzalez and Saulson, J. Acoust. Soc. Am. 96, 207 (1994), for u >> 1)

    even, (b - a) / 2:  2 EI / t,        odd, (a + b) / 2:  2 EI u^2 t / (h^2 (1 - t/h)),
    S_uu = S_ll = (odd + even) / 4,      S_ul = (odd - even) / 4.

The chord alone has T L. Sections are joined as `elements.joined_sections` says. The principal
planes of a wire are fixed in its bodies, across its clamps.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.elements.joined_sections import Joined, join
from suspension_cli.elements.tensioned_beam import tanhc
from suspension_cli.rotations import cross
from suspension_cli.scene.scene import Fibre, Flex, Scene, Section

if TYPE_CHECKING:
    from jaxtyping import Inexact


def resistance(
    sections: tuple[Section, ...],
    length: Inexact[np.ndarray, "*#shape"] | complex,
    tension: Inexact[np.ndarray, "*#shape"] | complex,
    torsion: Inexact[np.ndarray, "*#shape"] | complex = 0.0,
) -> tuple[Inexact[np.ndarray, "2 3 *shape"], Inexact[np.ndarray, "*shape"]]:
    """Compute the static stiffness of wires of the same sections, without loss.

    Returns S_uu, S_ul, S_ll in both principal planes, and the stiffness against twisting, N m/rad.
    The lengths of the sections share `length` (m) in proportion. A wire that pushes (negative
    tension, N) has the stiffness of one without tension. `torsion` is the torsional stiffness that
    the design gives, N m/rad; 0 where it gives none.
    """
    shape = np.broadcast_shapes(np.shape(length), np.shape(tension), np.shape(torsion))
    own = _numbers([sections])[..., 0]
    own = own.reshape(*own.shape, *(1,) * len(shape))
    bend, twist = _resist(own, length, tension, torsion)
    return np.broadcast_to(bend, (2, 3, *shape)), twist


def _is_round(sections: tuple[Section, ...]) -> bool:
    return all(section.round for section in sections)


def _numbers(
    each: Sequence[tuple[Section, ...]],
) -> Inexact[np.ndarray, "number section wire"]:
    """Numbers of wires with equally many sections, all round or all not, as `_resist` takes them.

    Length, G J, I_p/A, and E I in the first plane, of wires that are not round in the second, too.
    """
    planes = 1 if _is_round(each[0]) else 2
    numbers = [
        [(one.length, one.twisting, one.polar_area, *one.rigidity[:planes]) for one in sections]
        for sections in each
    ]
    return np.array(numbers).transpose(2, 1, 0)


def _resist(
    numbers: Inexact[np.ndarray, "number section *#shape"],
    length: Inexact[np.ndarray, "*#shape"] | complex,
    tension: Inexact[np.ndarray, "*#shape"] | complex,
    torsion: Inexact[np.ndarray, "*#shape"] | complex,
) -> tuple[Inexact[np.ndarray, "plane 3 *shape"], Inexact[np.ndarray, "*shape"]]:
    """Compute `resistance` from the numbers of sections, of round wires in one plane."""
    whole, twisting, polar_area, *rigidity = numbers
    tension = np.where(np.real(tension) >= 0, tension, 0.0)
    lengths = whole * (length / whole.sum(0) + np.zeros(np.shape(tension)))
    rigidities = np.stack(rigidity, axis=1)
    if len(whole) == 1:
        even, odd = uniform_stiffness(rigidities[0], tension, lengths / 2)
        alike = odd + even
        bend = np.stack([alike, odd - even, alike], axis=1) / 4
    else:
        found = slope_stiffness(rigidities, tension, lengths[:, None])
        (even, mixed), (_, odd) = found.stiffness
        bend = np.stack([odd + even - 2 * mixed, odd - even, odd + even + 2 * mixed], axis=1) / 4
    compliance = (lengths / (twisting + tension * polar_area)).sum(0)
    twist = np.where(np.real(torsion) > 0, torsion, 1 / compliance)
    return bend, twist


def slope_stiffness(
    rigidity: Inexact[np.ndarray, "section *#shape"],
    tension: Inexact[np.ndarray, "*#shape"] | complex,
    lengths: Inexact[np.ndarray, "section *#shape"],
) -> Joined:
    """Stiffness (2, 2, ...) of joined sections of given EI (N m^2; complex with loss) on (T_s, d).

    See `elements.joined_sections`.
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


def principal_planes(
    plane: Inexact[np.ndarray, "*#wire 3"], clamp: Inexact[np.ndarray, "*#wire 3"]
) -> Inexact[np.ndarray, "*wire 2 3"]:
    """Unit vectors (..., 2, 3) of both principal planes, across a clamp (..., 3)."""
    first = plane - (plane * clamp).sum(-1, keepdims=True) * clamp
    first = first / np.sqrt((first**2).sum(-1, keepdims=True))
    return np.stack([first, cross(clamp, first)], axis=-2)


def with_planes(scene: Scene) -> Scene:
    """Fill `flex` of a scene with the principal planes of its wires, without stiffness."""
    assert scene.fibres is not None
    planes = np.array([fibre.plane for fibre in scene.fibres.wire]).reshape(-1, 3)
    clamps = np.array([fibre.clamp for fibre in scene.fibres.wire]).reshape(-1, 2, 3)
    upper, lower = (principal_planes(planes, clamps[:, end]) for end in (0, 1))
    bend = np.zeros((len(planes), 2, 3))
    twist = np.zeros(len(planes))
    return replace(scene, flex=Flex(upper, lower, bend, twist))


def wire_resistance(scene: Scene) -> Flex | None:
    """Bending and torsional stiffness of wires, or the given torsion of strings; or None."""
    wires = scene.wires
    if scene.flex is not None or not wires.torsion.any():
        return scene.flex
    along = wires.span / wires.length[..., None]
    across = np.where(np.abs(along[..., :1]) < 0.9, np.eye(3)[0], np.eye(3)[1])
    planes = principal_planes(across, along)
    return Flex(planes, planes, None, wires.torsion)


def resistance_of_wires(
    fibres: tuple[Fibre, ...],
    length: Inexact[np.ndarray, "wire build"],
    tension: Inexact[np.ndarray, "wire build"],
    torsion: Inexact[np.ndarray, "wire build"],
) -> tuple[Inexact[np.ndarray, "2 3 wire build"], Inexact[np.ndarray, "wire build"]]:
    """Stiffness of wires against slopes in both planes, and against twist, see `resistance`."""
    shape = length.shape
    dtype = np.result_type(length, tension, torsion)
    bend = np.empty((2, 3, *shape), dtype=dtype)
    twist = np.empty(shape, dtype=dtype)
    each = [fibre.sections for fibre in fibres]
    kinds = [(len(sections), _is_round(sections)) for sections in each]
    for kind in dict.fromkeys(kinds):
        which = [n for n, other in enumerate(kinds) if other == kind]
        alike = _numbers([each[n] for n in which])[..., None]
        own = (number[which] for number in (length, tension, torsion))
        bend[:, :, which], twist[which] = _resist(alike, *own)
    return bend, twist
