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

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from suspension_cli.elements.joined_sections import Joined, join
from suspension_cli.elements.tensioned_beam import tanhc
from suspension_cli.rotations import cross
from suspension_cli.scene.scene import Fibre, Flex, Scene, Section

if TYPE_CHECKING:
    from collections.abc import Sequence

    from jaxtyping import Float, Inexact


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
    return _resistance(_Sections.of([sections], (1,) * len(shape)), length, tension, torsion)


class _Sections(NamedTuple):
    """Numbers of the sections of wires, from the top, that do not depend on tension."""

    length: Float[np.ndarray, "section *#shape"]  # m
    rigidity: Float[np.ndarray, "section plane *#shape"]  # N m^2; one plane if all are round
    twisting: Float[np.ndarray, "section *#shape"]  # N m^2
    polar_area: Float[np.ndarray, "section *#shape"]  # m^2

    @staticmethod
    def of(wires: Sequence[tuple[Section, ...]], shape: tuple[int, ...]) -> _Sections:
        """Take the sections of wires that have equally many, as arrays (section, *shape)."""
        planes = 1 if all(own.round for wire in wires for own in wire) else 2
        columns = [*zip(*wires, strict=True)]
        count = len(columns)

        def numbers(name: str) -> np.ndarray:
            return np.array([[getattr(own, name) for own in column] for column in columns])

        rigidity = np.moveaxis(numbers("rigidity")[..., :planes], -1, 1)
        return _Sections(
            numbers("length").reshape(count, *shape),
            rigidity.reshape(count, planes, *shape),
            numbers("twisting").reshape(count, *shape),
            numbers("polar_area").reshape(count, *shape),
        )


def _resistance(
    sections: _Sections,
    length: Inexact[np.ndarray, "*#shape"] | complex,
    tension: Inexact[np.ndarray, "*#shape"] | complex,
    torsion: Inexact[np.ndarray, "*#shape"] | complex,
) -> tuple[Inexact[np.ndarray, "2 3 *shape"], Inexact[np.ndarray, "*shape"]]:
    """Compute the static stiffness of wires, as `resistance` does."""
    tension = np.where(np.real(tension) >= 0, tension, 0.0)
    shape = np.broadcast_shapes(np.shape(length), np.shape(tension), np.shape(torsion))
    lengths = sections.length * (length / sections.length.sum(0))
    lengths = np.broadcast_to(lengths, (len(lengths), *shape))
    if len(lengths) == 1:
        even, odd = uniform_stiffness(sections.rigidity[0], tension, lengths / 2)
        alike = odd + even
        bend = np.stack([alike, odd - even, alike], axis=1) / 4
    else:
        (even, mixed), (_, odd) = slope_stiffness(
            sections.rigidity, tension, lengths[:, None]
        ).stiffness
        bend = np.stack([odd + even - 2 * mixed, odd - even, odd + even + 2 * mixed], axis=1) / 4
    compliance = (lengths / (sections.twisting + tension * sections.polar_area)).sum(0)
    given = np.real(torsion) > 0
    twist = np.where(given, torsion, 1 / compliance)
    return np.broadcast_to(bend, (2, 3, *shape)), twist


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
    each = [fibre.sections for fibre in fibres]
    kinds = [(len(own), all(section.round for section in own)) for own in each]
    if len(set(kinds)) == 1:
        return _resistance(_Sections.of(each, (-1, 1)), length, tension, torsion)
    shape = length.shape
    dtype = np.result_type(length, tension, torsion)
    bend = np.empty((2, 3, *shape), dtype=dtype)
    twist = np.empty(shape, dtype=dtype)
    for kind in dict.fromkeys(kinds):
        which = [n for n, other in enumerate(kinds) if other == kind]
        own = (number[which] for number in (length, tension, torsion))
        sections = _Sections.of([each[n] for n in which], (-1, 1))
        bend[:, :, which], twist[which] = _resistance(sections, *own)
    return bend, twist
