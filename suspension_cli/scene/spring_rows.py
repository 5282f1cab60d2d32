"""Springs of a scene from the springs of stages, links, dampers and the blades of filters."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.conventions import DOFS, GROUND
from suspension_cli.design import derive, materials, towers
from suspension_cli.design.links import Damper, Link, Strands
from suspension_cli.design.schema import Design
from suspension_cli.errors import Fault
from suspension_cli.scene.arrays import Array, Row
from suspension_cli.scene.curved_wires import (
    Curve,
    RoundWire,
    catenary,
    curve_stiffness,
    polyline,
    u_shape,
)
from suspension_cli.scene.eddy_currents import eddy_damping
from suspension_cli.scene.places import Places
from suspension_cli.scene.scene import Spectrum

if TYPE_CHECKING:
    from jaxtyping import Inexact

    from suspension_cli.design.units import Matrix6


def of_stages(design: Design, places: Places) -> list[Row]:
    """List the springs of all stages to the bodies above them.

    Besides its arrays, a spring has whether it `carries` the load of its body, as far as preloads
    that are given do not.
    """
    return [
        {
            "label": f"{stage.name}.spring{number}",
            "upper": places.parent[n],
            "lower": n,
            "lower_point": np.array(spring.at),
            "stiffness": matrix(spring.stiffness),
            "damping": matrix(spring.damping),
            "preload": np.zeros(6) if spring.preload is None else np.array(spring.preload),
            "carries": spring.preload is None and stage.rests_on_springs,
            "loss": derive.part_loss(design, spring),
        }
        for n, stage in enumerate(design.stage, 1)
        for number, spring in enumerate(stage.spring, 1)
    ]


def with_upper_points(rows: list[Row], places: Places) -> list[Row]:
    """Add to springs their points in the frame of the upper body."""
    return [
        row | {"upper_point": row["lower_point"] + places.between(row["upper"], row["lower"])}
        for row in rows
    ]


def matrix(given: Matrix6 | None) -> Inexact[np.ndarray, "6 6"]:
    """Return six diagonal elements, a 6x6 matrix or None (zeros) as a matrix (6, 6)."""
    if given is None:
        return np.zeros((6, 6))
    found = np.array(given)
    return found if found.ndim == 2 else np.diag(found)


def of_links(design: Design, places: Places) -> list[Row]:
    """List the links and the dampers; the body of lower number is the upper one."""
    rows: list[Row] = []
    for link in design.link:
        first, second = (places.number[name] for name in link.between)
        spectrum = None if link.table is None else spectrum_of(design, link)
        on_lower = np.array(link.preload) if first > second else -np.array(link.preload)
        row = {
            "label": f"{link.name}.link",
            "stiffness": link_stiffness(
                design, link, places.position[first], places.position[second]
            ),
            "damping": matrix(link.damping),
            "preload": on_lower,
            "loss": derive.part_loss(design, link) if spectrum is None else 0.0,
            "spectrum": spectrum,
        }
        rows.append(row)
    for damper in design.damper:
        rows.append({"label": f"{damper.name}.damper", "damping": damper_matrix(damper)})
    for row, table in zip(rows, (*design.link, *design.damper), strict=True):
        first, second = (places.number[name] for name in table.between)
        shift = np.zeros(3) if first > second else places.between(first, second)
        row |= {
            "upper": min(first, second),
            "lower": max(first, second),
            "lower_point": np.array(table.at) - shift,
            "grounded": table.between[1] == GROUND,
        }
    return rows


def damper_matrix(damper: Damper) -> Inexact[np.ndarray, "6 6"]:
    """Damping (6, 6) of a damper at its point, N s/m, N m s/rad."""
    magnet = damper.eddy_current
    return matrix(damper.damping) if magnet is None else eddy_damping(magnet)


def link_stiffness(
    design: Design, link: Link, first: Array, second: Array
) -> Inexact[np.ndarray, "6 6"]:
    """Static stiffness (6, 6) of a link at its point, N/m, N and N m.

    `first` and `second` (3,) are the nominal COMs of its two bodies, m.
    """
    if link.strands is not None:
        curve = link_curve(link, first, second)
        return link.strands.count * curve_stiffness(curve, wire_of(design, link.strands))
    if link.table is None:
        return matrix(link.stiffness)
    static = _static(link)
    return np.diag([link.table.factor * static.get(axis, 0.0) for axis in range(6)])


def link_curve(link: Link, first: Array, second: Array) -> Curve:
    """Unloaded shape of a wire of a link, from its end on the first body."""
    given = link.strands
    assert given is not None
    near = np.array(link.at)
    end = second + np.array(given.to) - first - near
    if given.shape == "points":
        middle = [np.array(point) - near for point in given.points]
        return polyline(np.array([0.0 * end, *middle, end]))
    assert given.length is not None
    if given.shape == "u":
        return u_shape(end, given.length)
    return catenary(end, given.length)


def wire_of(design: Design, given: Strands) -> RoundWire:
    """Stiffness and weight of one wire of a link."""
    made = materials.resolve(design, given.material)
    poisson = 0.3 if made.poisson_ratio is None else made.poisson_ratio
    assert made.youngs_modulus is not None
    weight = derive.gravity_strength(design) * (made.density or 0.0)
    return RoundWire.of(given.diameter, made.youngs_modulus, poisson, weight)


def _static(link: Link) -> dict[int, float]:
    """Static stiffness along each axis of a link's table, without its factor."""
    table = link.table
    assert table is not None
    given = [row[0] for row in table.real] if table.static is None else table.static
    axes = range(6) if table.axis is None else [DOFS.index(table.axis)]
    return dict(zip(axes, given, strict=True))


def spectrum_of(design: Design, link: Link) -> Spectrum:
    """Complex stiffness of a link against frequency, as a factor on its static stiffness."""
    table = link.table
    assert table is not None
    rows = zip(_static(link).items(), table.real, table.imaginary, strict=True)
    axes = tuple(
        (axis, tuple(one / static for one in real), tuple(one / static for one in imaginary))
        for (axis, static), real, imaginary in rows
        if static != 0
    )
    return Spectrum(design.constants.temperature, tuple(table.frequency), axes)


def filter_blades(
    design: Design, keystone: derive.Keystone, load: Array, hung: float, gravity: float
) -> tuple[Row, float, list[Fault]]:
    """Spring of the blades of a filter under a load (6,) on its keystone, about the COM.

    Also returns the mass that couples both bodies, kg, and a fault if it is as large as the mass of
    the keystone. `hung` is the weight in the load (N) without preloads. The vertical force of the
    blades is the given load, if any.
    """
    table = keystone.blades_table
    numbers = towers.filter_statics(table, -load[2], hung, gravity)
    lateral = table.lateral_stiffness
    tilt = table.tilt_stiffness
    lift = -load[2] if table.load is None else numbers.load
    row = {
        "label": f"{keystone.name}.blades",
        "lower_point": np.zeros(3),
        "stiffness": np.diag([lateral, lateral, numbers.stiffness, tilt, tilt, tilt]),
        "preload": [*-load[:2], lift, *-load[3:]],
        "loss": numbers.loss,
    }
    if numbers.coupling < table.keystone.mass:
        return row, numbers.coupling, []
    fault = Fault(
        f"stage.{keystone.blades_of}.filter.keystone.mass",
        f"is not above the mass coupling of the blades, {numbers.coupling:.3g} kg, of which it is"
        " part",
        "give the keystone the mass of the blades that moves with it, or a smaller saturation",
        f"{table.keystone.mass:g}",
    )
    return row, numbers.coupling, [fault]
