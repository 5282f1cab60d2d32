"""Places of bodies; springs of stages, links, dampers, legs and filters; struts and bars of legs.

**Legs.** A leg is a strut from its foot to its top (stiff along its length, with the load as
thrust: any lean is exact), a spring at its top for the flexures, and a bar for its inertia and
weight. The spring's strain is in the frame of the body below: the lean of the leg relative to that
body (the angle g / L of `elements.spring`) bends the foot; the tilt of the stage less that lean
bends the joint at the top.

**Eddy currents.** The magnet is a dipole m along an axis. The field of the currents is small beside
its own: the velocity is far below 2 / (mu_0 sigma t), and the conductor thinner than its skin
depth. A velocity v along the axis induces in the conductor, at the distance rho from the axis and z
along it, the electric field

    E_phi = v dA_phi/dz = -(3 mu_0 m / 4 pi) v rho z / (rho^2 + z^2)^(5/2),

whose currents dissipate the power c v^2, the integral of sigma E^2:

    plate from z = g to g + t:       c = mu_0^2 m^2 sigma / (64 pi) (1/g^3 - 1/(g + t)^3)
    tube from radius a to a + t:     c = 15 mu_0^2 m^2 sigma / 1024 (1/a^3 - 1/(a + t)^3)

For t << a the second is 45 mu_0^2 m^2 sigma t / (1024 a^4), known from a magnet that falls through
a pipe (wall thickness: Donoso, Ladera and Martin, Eur. J. Phys. 30, 855 (2009)). For motion across
the axis, along the plate, c is half as large: the drag on a dipole over a thin sheet from Maxwell's
receding images at low velocity (Saslow, Am. J. Phys. 60, 693 (1992)); the sheets of a thick plate
add up, as their currents are parallel to it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.conventions import DOFS, GROUND
from suspension_cli.design import materials
from suspension_cli.design.derive import (
    Keystone,
    com_offset,
    com_positions,
    gravity_strength,
    part_loss,
    with_bodies_above,
)
from suspension_cli.design.links import Damper, EddyCurrent, Link, Strands
from suspension_cli.design.schema import Design, Stage
from suspension_cli.design.towers import (
    ROUND_ROD,
    filter_statics,
    leg_inertia,
    leg_statics,
    tops,
)
from suspension_cli.errors import Fault
from suspension_cli.scene import strands
from suspension_cli.scene.arrays import Array, Row
from suspension_cli.scene.scene import Spectrum

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact

    from suspension_cli.design.units import Matrix6

MU_0 = 4e-7 * np.pi
"""Magnetic constant, H/m."""


@dataclass(frozen=True)
class Places:
    """Tree of the bodies; number 0 is the support, n the n-th stage."""

    number: dict[str, int]  # of each body by name, 0 also for the ground
    parent: list[int]  # the body above each, 0 for the support itself
    offset: Float[np.ndarray, "1+body 3"]  # COM from the COM above (or the suspension point), m
    position: Float[np.ndarray, "1+body 3"]  # COM from the suspension point, m

    @classmethod
    def of(cls, design: Design) -> Places:
        """The places of the bodies of a design."""
        position = com_positions(design)
        number = {name: n for n, name in enumerate(position)} | {GROUND: 0}
        parent = [0, *(number[above] for _, above in with_bodies_above(design))]
        offset = np.array([(0.0, 0.0, 0.0), *map(com_offset, design.stage)])
        return cls(number, parent, offset, np.array([*position.values()]))

    def between(self, upper: int, lower: int) -> Float[np.ndarray, " 3"]:
        """COM of one body from that of another, m."""
        if lower and self.parent[lower] == upper:
            return self.offset[lower]  # exact where a difference of positions is rounded
        return self.position[lower] - self.position[upper]


def of_stages(design: Design, places: Places) -> list[Row]:
    """List the springs of all stages to the bodies above them."""
    return [
        {
            "label": f"{stage.name}.spring{number}",
            "upper": places.parent[n],
            "lower": n,
            "lower_point": np.array(spring.at),
            "stiffness": matrix(spring.stiffness),
            "damping": matrix(spring.damping),
            "preload": np.array(spring.preload),
            "loss": part_loss(design, spring),
        }
        for n, stage in enumerate(design.stage, 1)
        for number, spring in enumerate(stage.spring, 1)
    ]


def between(rows: list[Row], places: Places) -> list[Row]:
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
        row = {
            "label": f"{link.name}.link",
            "stiffness": link_stiffness(
                design, link, places.position[first], places.position[second]
            ),
            "damping": matrix(link.damping),
            "preload": np.array(link.preload) if first > second else -np.array(link.preload),
            "loss": part_loss(design, link) if spectrum is None else 0.0,
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


def eddy_damping(magnet: EddyCurrent) -> Inexact[np.ndarray, "6 6"]:
    """Damping (6, 6) at a magnet along the dipole's axis and, by a plate, across it, N s/m."""
    moment = magnet.moment
    if moment is None:
        assert magnet.remanence is not None and magnet.volume is not None
        moment = magnet.remanence * magnet.volume / MU_0
    depth = 1 / magnet.gap**3 - 1 / (magnet.gap + magnet.thickness) ** 3
    strength = magnet.count * MU_0**2 * moment**2 * magnet.conductivity * depth
    along, across = 15 * strength / 1024, 0.0
    if magnet.shape == "plate":
        along = strength / (64 * np.pi)
        across = along / 2
    return np.diag([along if axis == magnet.axis else across for axis in "xyz"] + [0.0] * 3)


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


def legs(design: Design, places: Places) -> tuple[list[Row], list[Row]]:
    """List the struts and the bars of all legs."""
    struts: list[Row] = []
    bars: list[Row] = []
    for n, stage in enumerate(design.stage, 1):
        if (table := stage.inverted_pendulum) is None:
            continue
        above, span = places.parent[n], np.array([0.0, 0.0, table.length])
        for number, top in enumerate(tops(table), 1):
            foot, label = places.offset[n] + top - span, {"label": f"{stage.name}.leg{number}"}
            strut = {
                "upper": above,
                "lower": n,
                "upper_point": foot,
                "lower_point": top,
                "span": span,
                "length": table.length,
                "stiffness": table.axial_stiffness,
            }
            struts.append(label | strut)
            if table.leg_mass or table.counterweight is not None:
                bar = {"body": (above, n), "point": (foot, top), "inertia": leg_inertia(table)}
                bars.append(label | bar)
    return struts, bars


def flexures(stage: Stage, load: Array, hung: float, gravity: float) -> list[Row]:
    """List the springs of the flexures of a stage's legs, under a load (6,) about its COM.

    The load (N, N m) contains the weight of the legs on the stage, `hung` is the weight in it (N)
    without preloads. Against its strain a leg has the stiffness of its flexure k (N m/rad, at its
    foot) and of its top k_t,

        k |g|^2 / (2 L^2) + k_t (phi - lean)^2 / 2, with the lean (-g_y, g_x) / L.
    """
    table = stage.inverted_pendulum
    if table is None:
        return []
    numbers, length, tilt = (
        leg_statics(table, -load[2], hung, gravity),
        table.length,
        table.top_stiffness,
    )
    across = (numbers.flexure + tilt) / length**2
    yaw = numbers.flexure / ROUND_ROD if table.yaw_stiffness is None else table.yaw_stiffness
    stiffness = np.diag([across, across, 0.0, tilt, tilt, yaw])
    stiffness[0, 4] = stiffness[4, 0] = -tilt / length
    stiffness[1, 3] = stiffness[3, 1] = tilt / length
    own = {"stiffness": stiffness, "loss": numbers.loss, "leg": length}
    return [
        {"label": f"{stage.name}.leg{number}", "lower_point": top} | own
        for number, top in enumerate(tops(table), 1)
    ]


def filter_blades(
    design: Design, keystone: Keystone, load: Array, hung: float, gravity: float
) -> tuple[Row, float, list[Fault]]:
    """Spring of the blades of a filter under a load (6,) on its keystone, about the COM.

    Also returns the mass that couples both bodies, kg, and a fault if it is as large as the mass of
    the keystone. `hung` is the weight in the load (N) without preloads. The vertical force of the
    blades is the given load, if any.
    """
    table = next(one.filter for one in design.stage if one.name == keystone.blades_of)
    assert table is not None
    numbers = filter_statics(table, -load[2], hung, gravity)
    lateral, tilt = table.lateral_stiffness, table.tilt_stiffness
    lift = -load[2] if table.load is None else numbers.load
    row = {
        "label": f"{keystone.name}.blades",
        "lower_point": np.zeros(3),
        "stiffness": np.diag([lateral, lateral, numbers.stiffness, tilt, tilt, tilt]),
        "preload": [*-load[:2], lift, *-load[3:]],
        "loss": numbers.loss,
    }
    faults = []
    if numbers.coupling >= table.keystone.mass:
        key, value = f"stage.{keystone.blades_of}.filter.keystone.mass", f"{table.keystone.mass:g}"
        problem = (
            f"is not above the mass coupling of the blades, {numbers.coupling:.3g} kg, of which"
        )
        remedy = (
            "give the keystone the mass of the blades that moves with it, or a smaller saturation"
        )
        faults.append(Fault(key, f"{problem} it is part", remedy, value))
    return row, numbers.coupling, faults
