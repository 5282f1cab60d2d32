"""Places of bodies; springs of stages, links, dampers, legs and filters; legs; curved wires.

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

**Strands.** A curved wire is clamped at its end B and loaded at its end A by a force F and a moment
M. Its cross-section at r, with unit tangent t, carries the force F and the moment m = M + (r_A - r)
x F. With the strain energy per length

    (F . t)^2 / 2 EA + (m . t)^2 / 2 GJ + |m - (m . t) t|^2 / 2 EI,

Castigliano's theorem gives the displacement and rotation of A, and so its compliance C, as
integrals along the wire (Timoshenko, Strength of Materials, part II, chapter on curved bars: thin
bars, whose curvature does not change their bending stiffness; shear neglected). The stiffness at A
is C^-1. B takes the opposite force, and the opposite moment about A. Deflections are small: the
stiffness is that of the unloaded shape, without tension.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.conventions import DOFS, GROUND
from suspension_cli.design import derive, materials, towers
from suspension_cli.design.links import Damper, EddyCurrent, Link, Strands
from suspension_cli.design.schema import Design, Stage
from suspension_cli.errors import Fault
from suspension_cli.rotations import cross, cross_matrix
from suspension_cli.scene.arrays import Array, Row
from suspension_cli.scene.scene import Spectrum

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact

    from suspension_cli.design.units import Matrix6

MU_0 = 4e-7 * np.pi
"""Magnetic constant, H/m."""
NODES = 24
"""Gauss nodes on each smooth piece of a curved wire, exact to rounding for half a turn."""
PIECES = 8
"""Pieces of a catenary."""
DOWN = np.array([0.0, 0.0, -1.0])


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
        position = derive.com_positions(design)
        number = {name: n for n, name in enumerate(position)} | {GROUND: 0}
        parent = [0, *(number[above] for _, above in derive.with_bodies_above(design))]
        offset = np.array([(0.0, 0.0, 0.0), *map(derive.com_offset, design.stage)])
        return cls(number, parent, offset, np.array([*position.values()]))

    def between(self, upper: int, lower: int) -> Float[np.ndarray, " 3"]:
        """COM of one body from that of another, m."""
        if lower and self.parent[lower] == upper:
            return self.offset[lower]  # exact where a difference of positions is rounded
        return self.position[lower] - self.position[upper]


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
        ends = places.position[first], places.position[second]
        row = {
            "label": f"{link.name}.link",
            "stiffness": link_stiffness(design, link, *ends),
            "damping": matrix(link.damping),
            "preload": np.array(link.preload) if first > second else -np.array(link.preload),
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
    return (u_shape if given.shape == "u" else catenary)(end, given.length)


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


def legs(design: Design, places: Places) -> tuple[list[Row], list[Row]]:
    """List the struts and the bars of all legs."""
    struts: list[Row] = []
    bars: list[Row] = []
    for n, stage in enumerate(design.stage, 1):
        if (table := stage.inverted_pendulum) is None:
            continue
        above, span = places.parent[n], np.array([0.0, 0.0, table.length])
        for number, top in enumerate(towers.tops(table), 1):
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
                ends = {"body": (above, n), "point": (foot, top)}
                bars.append(label | ends | {"inertia": towers.leg_inertia(table)})
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
    numbers = towers.leg_statics(table, -load[2], hung, gravity)
    length, tilt = table.length, table.top_stiffness
    across = (numbers.flexure + tilt) / length**2
    yaw = numbers.flexure / towers.ROUND_ROD if table.yaw_stiffness is None else table.yaw_stiffness
    stiffness = np.diag([across, across, 0.0, tilt, tilt, yaw])
    stiffness[0, 4] = stiffness[4, 0] = -tilt / length
    stiffness[1, 3] = stiffness[3, 1] = tilt / length
    own = {"stiffness": stiffness, "loss": numbers.loss, "leg": length}
    return [
        {"label": f"{stage.name}.leg{number}", "lower_point": top} | own
        for number, top in enumerate(towers.tops(table), 1)
    ]


def filter_blades(
    design: Design, keystone: derive.Keystone, load: Array, hung: float, gravity: float
) -> tuple[Row, float, list[Fault]]:
    """Spring of the blades of a filter under a load (6,) on its keystone, about the COM.

    Also returns the mass that couples both bodies, kg, and a fault if it is as large as the mass of
    the keystone. `hung` is the weight in the load (N) without preloads. The vertical force of the
    blades is the given load, if any.
    """
    table = next(one.filter for one in design.stage if one.name == keystone.blades_of)
    assert table is not None
    numbers = towers.filter_statics(table, -load[2], hung, gravity)
    lateral, tilt = table.lateral_stiffness, table.tilt_stiffness
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


# Curved wires.


@dataclass(frozen=True)
class Curve:
    """Nodes along the centre line of a wire, from A."""

    point: Float[np.ndarray, "node 3"]  # from A, m
    tangent: Float[np.ndarray, "node 3"]
    weight: Float[np.ndarray, " node"]  # Gauss weight times the length of the piece, m
    end: Float[np.ndarray, " 3"]  # B from A, m

    @property
    def length(self) -> float:
        """Length of the wire, m."""
        return float(self.weight.sum())


@dataclass(frozen=True)
class RoundWire:
    """Stiffness of a round wire: EA (N), EI, GJ (N m^2), and weight per length (N/m)."""

    stretching: float
    bending: float
    twisting: float
    weight: float

    @staticmethod
    def of(diameter: float, modulus: float, poisson: float, weight_density: float) -> RoundWire:
        """From diameter (m), Young's modulus (Pa), Poisson's ratio, weight per volume (N/m^3)."""
        area, second = np.pi * diameter**2 / 4, np.pi * diameter**4 / 64
        twisting = modulus / (2 * (1 + poisson)) * 2 * second
        return RoundWire(modulus * area, modulus * second, twisting, weight_density * area)


def u_shape(end: Float[np.ndarray, " 3"], length: float) -> Curve:
    """Curve of two vertical legs, down from A and up to B, joined by a half circle."""
    radius = np.hypot(end[0], end[1]) / 2
    across = np.array([end[0], end[1], 0.0]) / (2 * radius)
    first = (length - np.pi * radius - end[2]) / 2
    bottom, far = first * DOWN, end + (first + end[2]) * DOWN
    s, w = _gauss()
    cosine, sine = np.cos(np.pi * s)[:, None], np.sin(np.pi * s)[:, None]
    arc = bottom + radius * ((1 - cosine) * across + sine * DOWN)
    turn = (arc, sine * across + cosine * DOWN, w * np.pi * radius)
    return _joined([_straight(np.zeros(3), bottom), turn, _straight(far, end)], end)


def catenary(end: Float[np.ndarray, " 3"], length: float) -> Curve:
    """Curve of a hanging chain of given length L (m) between A and B.

    z = a cosh((x - b) / a) + c with u = w / 2a from sinh(u) / u = sqrt(L^2 - h^2) / w, w and h
    being the width and the height of B from A (any text on the calculus of variations).
    """
    from scipy.optimize import brentq

    width = np.hypot(end[0], end[1])
    across = np.array([end[0], end[1], 0.0]) / width
    ratio = np.sqrt(length**2 - end[2] ** 2) / width
    u = brentq(lambda u: np.sinh(u) - ratio * u, 1e-9, 3 + 2 * np.log(ratio), xtol=1e-15)
    a = width / (2 * u)
    lowest = width / 2 - a * np.arctanh(end[2] / length)
    start = -lowest / a
    s, w = _gauss()
    rows = []
    for piece in range(PIECES):
        slope = np.sinh(start) + length * (piece + s[:, None]) / PIECES / a
        root = np.sqrt(1 + slope**2)
        x, z = a * (np.arcsinh(slope) - start), a * (root - np.cosh(start))
        rows.append((x * across - z * DOWN, (across - slope * DOWN) / root, w * length / PIECES))
    return _joined(rows, end)


def polyline(points: Float[np.ndarray, "point 3"]) -> Curve:
    """Straight pieces through points (p, 3), the first at A and the last at B."""
    return _joined([_straight(*pair) for pair in pairwise(points)], points[-1])


def _straight(start: np.ndarray, end: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nodes, tangents and weights of a straight piece."""
    s, w = _gauss()
    span = end - start
    length = np.sqrt(span @ span)
    return start + s[:, None] * span, np.tile(span / length, (NODES, 1)), w * length


def _gauss() -> tuple[Float[np.ndarray, " node"], Float[np.ndarray, " node"]]:
    """Gauss-Legendre nodes and weights on 0 to 1."""
    x, w = np.polynomial.legendre.leggauss(NODES)
    return (1 + x) / 2, w / 2


def _joined(rows: Sequence[Sequence[np.ndarray]], end: Float[np.ndarray, " 3"]) -> Curve:
    point, tangent, weight = (np.concatenate(parts) for parts in zip(*rows, strict=True))
    return Curve(point, tangent, weight, end)


def curve_compliance(curve: Curve, wire: RoundWire) -> Float[np.ndarray, "6 6"]:
    """Displacement and rotation of A per force and moment there, B clamped: (6, 6)."""
    unit = _unit_loads(curve)
    return _work(curve, wire, unit, unit)


def curve_stiffness(curve: Curve, wire: RoundWire) -> Float[np.ndarray, "6 6"]:
    """Force and moment on A per displacement and rotation, B clamped: (6, 6), symmetric."""
    matrix = np.linalg.inv(curve_compliance(curve, wire))
    return (matrix + matrix.T) / 2


def _unit_loads(curve: Curve) -> Float[np.ndarray, "2 node 3 6"]:
    """Internal force and moment at each node per force and moment at A."""
    result = np.zeros((2, len(curve.weight), 3, 6))
    result[0, :, :, :3] = result[1, :, :, 3:] = np.eye(3)
    result[1, :, :, :3] = -cross_matrix(curve.point)
    return result


def _work(
    curve: Curve,
    wire: RoundWire,
    one: Float[np.ndarray, "2 node 3 load"],
    other: Float[np.ndarray, "2 node 3 more"],
) -> Float[np.ndarray, "load more"]:
    """Work of internal forces and moments on the strains of others, m and rad per unit of both."""
    along = curve.tangent[:, :, None] * curve.tangent[:, None, :]
    bent = along / wire.twisting + (np.eye(3) - along) / wire.bending
    flexibility = np.stack([along / wire.stretching, bent]) * curve.weight[:, None, None]
    return np.einsum("anik,anij,anjl->kl", one, flexibility, other, optimize=True)


def sag(curve: Curve, wire: RoundWire) -> tuple[float, Float[np.ndarray, " 6"]]:
    """Largest descent (m) of a wire, clamped at both ends, under its weight.

    By the unit load method. For small deflections: a descent that is not small beside the length
    shows only that the wire does not hang in its unloaded shape. Also returns force (N) and moment
    (N m) of the wire on A.
    """
    count = len(curve.weight)
    # a force of 1 N down at each node (the last axis) is carried by the part towards B
    carried = (np.tri(count, k=-1) + 0.5 * np.eye(count))[..., None]
    moment = cross(curve.point - curve.point[:, None], DOWN)
    single = np.moveaxis(np.stack([carried * DOWN, carried * moment]), -1, -2)
    dead, unit = single @ (curve.weight * wire.weight)[:, None], _unit_loads(curve)
    wrench = np.linalg.solve(_work(curve, wire, unit, unit), _work(curve, wire, unit, dead)[:, 0])
    loaded = dead - unit @ wrench[:, None]
    return float(_work(curve, wire, single, loaded).max()), wrench
