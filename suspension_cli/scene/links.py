"""Springs of a scene: `[[stage.spring]]`, flexures, `[[link]]` and `[[damper]]`, one row each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.conventions import DOFS, GROUND, SUPPORT
from suspension_cli.design import materials
from suspension_cli.design.derive import gravity_strength, spring_loss
from suspension_cli.design.links import Damper, Link, Strands
from suspension_cli.design.schema import Design
from suspension_cli.scene import eddy_current, strands, tensions
from suspension_cli.scene.arrays import Array
from suspension_cli.scene.scene import Spectrum, Springs

if TYPE_CHECKING:
    from jaxtyping import Inexact

    from suspension_cli.design.units import Matrix6


@dataclass(frozen=True)
class SpringPart:
    """One spring between two bodies, see `Springs`."""

    label: str
    upper: int
    lower: int
    lower_point: Sequence[float] | Inexact[np.ndarray, " 3"]
    stiffness: Inexact[np.ndarray, "6 6"]
    damping: Inexact[np.ndarray, "6 6"]
    preload: Sequence[float] | Inexact[np.ndarray, " 6"]
    loss: float
    grounded: bool = False
    spectrum: Spectrum | None = None
    leg: float = 0.0


def springs(design: Design, parts: Sequence[Any], position: Array) -> Springs:
    """Collect all springs of a design, those of stages first.

    `parts` are the `parts.StagePart` of each stage, `position` (n + 1, 3) the nominal COMs from the
    suspension point, m; row 0 is the support.
    """
    rows: list[SpringPart] = []
    for n, part in enumerate(parts, 1):
        legs = part.stage.inverted_pendulum
        length = 0.0 if legs is None else legs.length
        flexures = [(spring, length) for spring in part.flexures]
        for spring, leg in (*((spring, 0.0) for spring in part.stage.spring), *flexures):
            rows.append(
                SpringPart(
                    f"{part.stage.name}.spring{len(rows) + 1}",
                    part.parent,
                    n,
                    spring.at,
                    matrix(spring.stiffness),
                    matrix(spring.damping),
                    spring.preload,
                    spring_loss(design, spring),
                    leg=leg,
                )
            )
    rows += [*_links(design, position), *_dampers(design, position)]
    lower = np.array([row.lower_point for row in rows]).reshape(-1, 3)
    # a stage's own offset rather than a difference of positions: exact where that is exact
    offset = np.array(
        [
            parts[row.lower - 1].offset
            if parts[row.lower - 1].parent == row.upper
            else position[row.lower] - position[row.upper]
            for row in rows
        ]
    ).reshape(-1, 3)
    return Springs(
        label=tuple(row.label for row in rows),
        upper=np.array([row.upper for row in rows], dtype=np.intp),
        lower=np.array([row.lower for row in rows], dtype=np.intp),
        upper_point=lower + offset,
        lower_point=lower,
        stiffness=np.array([row.stiffness for row in rows]).reshape(-1, 6, 6),
        damping=np.array([row.damping for row in rows]).reshape(-1, 6, 6),
        preload=np.array([row.preload for row in rows]).reshape(-1, 6),
        leg=np.array([row.leg for row in rows]),
        loss=np.array([row.loss for row in rows]),
        grounded=np.array([row.grounded for row in rows], dtype=bool),
        spectrum=tuple(row.spectrum for row in rows),
    )


def matrix(given: Matrix6 | None) -> Inexact[np.ndarray, "6 6"]:
    """Return six diagonal elements, a 6x6 matrix or None (zeros) as a matrix (6, 6)."""
    if given is None:
        return np.zeros((6, 6))
    found = np.array(given)
    return found if found.ndim == 2 else np.diag(found)


def numbers(design: Design, between: Sequence[str]) -> tuple[int, int]:
    """Return the numbers of both bodies; 0 for the support and the ground."""
    known = {SUPPORT: 0, GROUND: 0} | {stage.name: n for n, stage in enumerate(design.stage, 1)}
    return known[between[0]], known[between[1]]


def _links(design: Design, position: Array) -> list[SpringPart]:
    rows = []
    for link in design.link:
        first, second = numbers(design, link.between)
        spectrum = None if link.table is None else spectrum_of(design, link)
        rows.append(
            SpringPart(
                f"{link.name}.link",
                *_ordered(first, second, link.at, position),
                link_stiffness(design, link, position[first], position[second]),
                matrix(link.damping),
                np.array(link.preload) if first > second else -np.array(link.preload),
                link_loss(design, link) if spectrum is None else 0.0,
                link.between[1] == GROUND,
                spectrum,
            )
        )
    return rows


def _ordered(
    first: int, second: int, at: Sequence[float], position: Array
) -> tuple[int, int, Sequence[float] | Inexact[np.ndarray, " 3"]]:
    """Order two bodies by number, the upper one first; the point in the frame of the lower."""
    if first > second:
        return second, first, at
    return first, second, np.array(at) + position[first] - position[second]


def _dampers(design: Design, position: Array) -> list[SpringPart]:
    rows = []
    for damper in design.damper:
        first, second = numbers(design, damper.between)
        rows.append(
            SpringPart(
                f"{damper.name}.damper",
                *_ordered(first, second, damper.at, position),
                np.zeros((6, 6)),
                damper_matrix(damper),
                [0.0] * 6,
                0.0,
                damper.between[1] == GROUND,
            )
        )
    return rows


def damper_matrix(damper: Damper) -> Inexact[np.ndarray, "6 6"]:
    """Damping (6, 6) of a damper at its point, N s/m, N m s/rad."""
    magnet = damper.eddy_current
    if magnet is None:
        return matrix(damper.damping)
    moment = magnet.moment
    if moment is None:
        assert magnet.remanence is not None and magnet.volume is not None
        moment = magnet.remanence * magnet.volume / eddy_current.MU_0
    return magnet.count * eddy_current.damping_matrix(
        magnet.shape,
        "xyz".index(magnet.axis),
        moment,
        magnet.conductivity,
        magnet.thickness,
        magnet.gap,
    )


def link_stiffness(
    design: Design, link: Link, first: Array, second: Array
) -> Inexact[np.ndarray, "6 6"]:
    """Static stiffness (6, 6) of a link at its point, N/m, N and N m.

    `first` and `second` (3,) are the nominal COMs of its two bodies, m.
    """
    if link.strands is not None:
        curve = link_curve(link, first, second)
        return link.strands.count * strands.stiffness(curve, wire_of(design, link.strands))
    if link.table is None:
        return matrix(link.stiffness)
    return np.diag(link.table.factor * np.array(_static(link)))


def link_loss(design: Design, link: Link) -> float:
    """Constant loss angle of a link, rad: its own, or that of the material of its strands."""
    if link.loss_angle is not None:
        return link.loss_angle
    if link.strands is None:
        return 0.0
    return materials.constant_angle(design, link.strands.material)


def link_curve(link: Link, first: Array, second: Array) -> strands.Curve:
    """Unloaded shape of a wire of a link, from its end on the first body."""
    given = link.strands
    assert given is not None
    near = np.array(link.at)
    end = second + np.array(given.to) - first - near
    if given.shape == "points":
        middle = [np.array(point) - near for point in given.points]
        return strands.polyline(np.array([0.0 * end, *middle, end]))
    assert given.length is not None
    return (strands.u_shape if given.shape == "u" else strands.catenary)(end, given.length)


def wire_of(design: Design, given: Strands) -> strands.RoundWire:
    """Stiffness and weight of one wire of a link."""
    made = materials.resolve(design, given.material)
    poisson = 0.3 if made.poisson_ratio is None else made.poisson_ratio
    assert made.youngs_modulus is not None
    weight = gravity_strength(design) * (made.density or 0.0)
    return strands.RoundWire.of(given.diameter, made.youngs_modulus, poisson, weight)


def _static(link: Link) -> list[float]:
    """Static stiffness along each axis, without the factor of the table."""
    table = link.table
    assert table is not None
    given = [row[0] for row in table.real] if table.static is None else table.static
    if table.axis is None:
        return list(given)
    result = [0.0] * 6
    result[DOFS.index(table.axis)] = given[0]
    return result


def spectrum_of(design: Design, link: Link) -> Spectrum:
    """Complex stiffness of a link against frequency, as a factor on its static stiffness."""
    table, static = link.table, _static(link)
    assert table is not None
    axes = range(6) if table.axis is None else [DOFS.index(table.axis)]

    def over(axis: int, values: list[float]) -> tuple[float, ...]:
        return tuple(value / static[axis] for value in values)

    rows = zip(axes, table.real, table.imaginary, strict=True)
    return Spectrum(
        design.constants.temperature,
        tuple(table.frequency),
        tuple((axis, over(axis, re), over(axis, im)) for axis, re, im in rows if static[axis] != 0),
    )


def preload_wrenches(design: Design, position: Array) -> list[tuple[int, Array]]:
    """Forces and torques of the preloads of links about the COMs of the bodies, N and N m."""
    found = []
    for link in design.link:
        if not any(link.preload):
            continue
        wrench, at = np.array(link.preload), np.array(link.at)
        first, second = numbers(design, link.between)
        found.append((first, tensions.move_wrench(wrench, at)))
        if second:
            there = at + position[first] - position[second]
            found.append((second, -tensions.move_wrench(wrench, there)))
    return found
