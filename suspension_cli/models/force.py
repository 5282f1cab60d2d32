"""Force model of a chain of symmetric stages on straight wires.

Husman et al., Rev. Sci. Instrum. 71, 2546 (2000), sections 3a and 4. A wire with unit vector u,
tension T and spring constant k joins the upper body (arm a) to the lower one (arm b). For a small
relative displacement D of its ends, of which e = u . D stretches it, it stores

    k e^2 / 2 + (T / l) (|D|^2 - e^2) / 2 + T u . (second-order displacement of b less that of a).

A rotation t displaces the end of an arm r by t x r, and to second order by t x (t x r) / 2. A wire
whose torsion is given adds torsion (u . t)^2 / 2 for a rotation t of the lower body less that of
the upper one. Summed over the wires of a symmetric set, terms odd in x or y cancel, and the
chain falls into four blocks that do not couple: longitudinal-pitch, transverse-roll, vertical, yaw.
As in the paper, blades are in series with the stretching of the wires and act along them. That is
exact only for vertical wires (the string model has the tips as coordinates). A blade counts only in
motions that pull all m wires that share it alike: of these, their mean stretching has the spring
constant 1 / (1/k + m/K) per wire with the blade's K, the rest has k.

Every number may be an array; all functions work on batches of chains. No code of the general
assembly is used.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.conventions import DOF_UNITS, DOFS, SUPPORT
from suspension_cli.design.bodies import body_inertia, body_mass, centre_of_mass
from suspension_cli.design.derive import (
    beyond_symmetric_chains,
    blade_stiffness,
    com_positions,
    gravity_strength,
    part_loss,
    set_geometry,
    wire_loss,
    wire_signs,
    wire_stiffness,
)
from suspension_cli.design.schema import Design
from suspension_cli.linear.coordinates import momentum_units
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models.base import BENDING, BLADE_TIPS, MASS, Model
from suspension_cli.models.surroundings import surroundings_key
from suspension_cli.rotations import cross_matrix, rigid_motion

if TYPE_CHECKING:
    from jaxtyping import Inexact

    from suspension_cli.models.base import Numbers

PARITY = np.array([0, 1, 2, 1, 0, 3])
"""Equal for coordinates of a body that are alike odd or even in x and y; others do not couple."""
GEOMETRY = ("t1", "t2", "s_upper", "s_lower", "d", "d_upper")
"""The paper's symbols of a set of wires, besides their length."""


@dataclass(frozen=True)
class Stage:
    """One stage of a chain; floats may be arrays of the batch shape, lengths are in m."""

    mass: Numbers  # kg
    inertia: tuple[Numbers, Numbers, Numbers]  # IX, IY, IZ, kg m^2
    count: int  # of wires: 1, 2 (at +-t) or 4
    l: Numbers  # the paper's symbols, see `design.schema.WireSet`
    t1: Numbers = 0.0
    t2: Numbers = 0.0
    s_upper: Numbers = 0.0
    s_lower: Numbers = 0.0
    d: Numbers = 0.0
    d_upper: Numbers = 0.0
    k: Numbers = 1e4  # of one wire, N/m; this, and the two below, may be complex, k (1 + i phi)
    torsion: Numbers = 0.0  # of one wire, N m/rad; 0 if not given
    blade_stiffness: Numbers = 1e3  # of one blade, N/m
    blades: int = 0  # number of blades that carry the wires

    @property
    def height(self) -> Numbers:
        """Vertical span of the wires, m."""
        across = (self.t2 - self.t1) ** 2 + (self.s_lower - self.s_upper) ** 2
        return np.sqrt(self.l**2 - across)

    def vectors(self, x: Numbers, y: Numbers, z: Numbers) -> Inexact[np.ndarray, "*batch wire 3"]:
        """Vectors of all wires from the components of that at +x, +y."""
        columns = np.stack(np.broadcast_arrays(x, y, z), axis=-1)[..., None, :]
        signs = np.array([(*sign, 1) for sign in wire_signs(self.count)])
        return columns * signs


@dataclass(frozen=True)
class Chain:
    """Stages from top to bottom, each hanging from the one before."""

    stages: tuple[Stage, ...]
    gravity: Numbers = 9.81


def stiffness(chain: Chain) -> Inexact[np.ndarray, "*batch coordinate coordinate"]:
    """Stiffness of a chain, six coordinates of the support first: N/m, N, N m."""
    load = 0.0
    blocks = []
    for stage in reversed(chain.stages):
        load = load + stage.mass * chain.gravity
        blocks.append(_stage_stiffness(stage, load))
    batch = np.broadcast_shapes(*(block.shape[:-2] for block in blocks))
    size = 6 * len(blocks) + 6
    result = np.zeros((*batch, size, size), dtype=np.result_type(*blocks))
    for n, block in enumerate(reversed(blocks)):
        result[..., 6 * n : 6 * n + 12, 6 * n : 6 * n + 12] += block
    return result


def _stage_stiffness(p: Stage, load: Numbers) -> Inexact[np.ndarray, "*batch 12 12"]:
    """Stiffness that the wires of one stage add to its upper and its lower body."""
    u = p.vectors((p.s_lower - p.s_upper) / p.l, (p.t2 - p.t1) / p.l, -p.height / p.l)
    a = p.vectors(p.s_upper, p.t1, -p.d_upper)
    b = p.vectors(p.s_lower, p.t2, p.d)
    tension = load * p.l / (p.count * p.height)
    shape = np.broadcast_shapes(u.shape, a.shape, b.shape, (*np.shape(tension), 1, 1))
    u, a, b = (np.broadcast_to(vector, shape) for vector in (u, a, b))
    moved = np.zeros((*shape, 12))  # D per coordinate
    moved[..., 6:9] = np.eye(3)
    moved[..., :3] = -np.eye(3)
    moved[..., 3:6] = cross_matrix(a)
    moved[..., 9:] = -cross_matrix(b)
    stretch = (u[..., None, :] @ moved)[..., 0, :]
    twist = np.concatenate([np.zeros(shape), -u, np.zeros(shape), u], axis=-1)
    forms = [
        (p.k - tension / p.l, stretch),
        (tension / p.l, moved.reshape(*shape[:-2], -1, 12)),
        (p.torsion, twist),
    ]
    if p.blades:
        shared = p.count // p.blades
        carried = np.array([_blade(p, n) for n in range(p.count)]) == np.arange(p.blades)[:, None]
        softer = 1.0 / (1.0 / p.k + shared / p.blade_stiffness) - p.k
        forms.append((softer / shared, carried @ stretch))
    rows = np.concatenate([own for _, own in forms], axis=-2)
    factors = [np.broadcast_to(np.asarray(k)[..., None], own.shape[:-1]) for k, own in forms]
    columns = np.swapaxes(rows, -1, -2)
    result = (columns * np.concatenate(factors, axis=-1)[..., None, :]) @ rows
    for turning, arm, sign in ((slice(3, 6), a, -1.0), (slice(9, 12), b, 1.0)):
        outer = (u[..., :, None] * arm[..., None, :]).sum(-3)
        trace = np.trace(outer, axis1=-2, axis2=-1)[..., None, None]
        turned = (outer + np.swapaxes(outer, -1, -2)) / 2 - trace * np.eye(3)
        result[..., turning, turning] += sign * np.asarray(tension)[..., None, None] * turned
    result = (result + np.swapaxes(result, -1, -2)) / 2
    return np.where(np.tile(PARITY[:, None] == PARITY, (2, 2)), result, 0.0)


def _blade(p: Stage, wire: int) -> int:
    """Number of the blade that carries a wire; each of two carries the wires on its side of y."""
    if p.blades == p.count:
        return wire
    return int(p.blades == 2 and wire_signs(p.count)[wire][1] < 0)


def chain(design: Design, *, lossy: bool = False) -> Chain:
    """The chain of a suitable design, with complex spring constants if `lossy`."""
    stages = []
    for stage in design.stage:
        table = stage.wires
        blades = stage.blades
        assert table is not None
        shape = set_geometry(table)
        inertia = body_inertia(stage.body)
        mass = body_mass(stage.body)
        elastic = 1 + 1j * wire_loss(design, table, shape.length) if lossy else 1.0
        of_blades: dict[str, Any] = {}
        if blades is not None:
            k = blade_stiffness(design, blades, mass, blades.count)
            own = k * (1 + 1j * part_loss(design, blades)) if lossy else k
            of_blades = {"blades": blades.count, "blade_stiffness": own}
        stages.append(
            Stage(
                mass=mass,
                inertia=(inertia[0][0], inertia[1][1], inertia[2][2]),
                count=shape.count,
                l=shape.length,
                **{key: getattr(shape, key) for key in GEOMETRY},
                k=wire_stiffness(design, table, shape.length) * elastic,
                torsion=(table.torsion or 0.0) * elastic,
                **of_blades,
            )
        )
    return Chain(tuple(stages), gravity_strength(design))


def lossy(design: Design) -> bool:
    """Whether a chain's wires or blades have loss angles."""
    return any(
        wire_loss(design, s.wires, s.wires.l)
        or (s.blades is not None and part_loss(design, s.blades))
        for s in design.stage
        if s.wires is not None
    )


def _linear_model(designs: Sequence[Design], *, batch: bool) -> LinearSystem:
    """Linear model of the chain of one design, or of those of a batch of the same topology."""
    links, with_loss = (
        [chain(design, lossy=is_lossy) for design in designs] for is_lossy in (False, True)
    )
    plain = stacked(links) if batch else links[0]
    masses = [value for p in plain.stages for value in (p.mass, p.mass, p.mass, *p.inertia)]
    lost = None
    if lossy(designs[0]):
        lost = stiffness(stacked(with_loss) if batch else with_loss[0])
    return assembled(designs[0], masses, stiffness(plain), lost)


def assembled(
    design: Design,
    masses: Sequence[Numbers],
    stiffness: Inexact[np.ndarray, "*batch coordinate coordinate"],
    lossy: Inexact[np.ndarray, "*batch coordinate coordinate"] | None,
) -> LinearSystem:
    """Linear model of a chain (or a batch of chains) with the names of a design.

    `masses` are those of all coordinates of all stages, kg and kg m^2.
    """
    bodies = (SUPPORT, *(stage.name for stage in design.stage))
    positions = com_positions(design)
    size = 6 * len(bodies)
    mass = np.zeros((*stiffness.shape[:-2], size, size))
    for n, value in enumerate(masses, 6):
        mass[..., n, n] = value
    rigid = rigid_motion(size, np.array([positions[body] for body in bodies]))
    soft = stiffness if lossy is None else stiffness + 1j * np.imag(lossy)
    return LinearSystem(
        body=bodies[1:],
        coordinate=tuple(f"{body}.{dof}" for body in bodies for dof in DOFS),
        unit=len(bodies) * DOF_UNITS,
        momentum_unit=len(bodies) * momentum_units(DOF_UNITS),
        basis=np.eye(size),
        massless=np.zeros(size, dtype=bool),
        mass=mass,
        damping=np.zeros((size, size)),
        soft=soft,
        elongation=np.zeros((0, size)),
        k=np.zeros(0),
        allowed=np.ones((size, size), dtype=bool),
        rigid=rigid,
    )


def stacked(chains: Sequence[Chain]) -> Chain:
    """Chains of the same stages as one chain of arrays (p,)."""
    stages = []
    for same in zip(*(one.stages for one in chains), strict=True):
        numbers: dict[str, Any] = {
            name: np.array([vars(stage)[name] for stage in same])
            for name in vars(same[0])
            if name not in ("count", "blades")
        }
        stages.append(replace(same[0], **numbers | {"inertia": tuple(numbers["inertia"].T)}))
    return Chain(tuple(stages), np.array([one.gravity for one in chains]))


class Force(Model):
    """The paper's force model; arrays of chains are solved at once."""

    name = "force"
    description = "forces on straight wires of a symmetric chain, in four blocks"
    valid_for = "symmetric chain"
    omits = (BLADE_TIPS, BENDING, MASS)
    cost = 1.0

    def unsuitable(self, design: Design) -> str:
        """Why a design is not a symmetric chain; "" if it is one."""
        if design.link or design.damper or design.cavity:
            return "it has [[link]], [[damper]] or [[cavity]]"
        if reason := beyond_symmetric_chains(design):
            return reason
        above = SUPPORT
        for stage in design.stage:
            where = f"stage {stage.name}"
            blades = stage.blades
            inertia = body_inertia(stage.body)
            soft = blades is not None and (blades.tip_mass or blades.lateral_stiffness)
            loaded = blades is not None and blades.load is not None
            centre = any(centre_of_mass(stage.body))
            products = any(inertia[i][j] for i in range(3) for j in range(3) if i != j)
            reasons = {
                f"{where} stands on legs": stage.inverted_pendulum is not None,
                f"{where} has a filter": stage.filter is not None,
                f"{where} has explicit wires": stage.wire,
                f"{where} hangs on no wires": stage.wires is None,
                "it branches": stage.hangs_from not in (None, above),
                f"{where} has springs": stage.spring,
                f"the blades of {where} have tip masses or lateral compliance": soft,
                f"the blades of {where} have a given load, so that the pose is solved for": loaded,
                f"the inertia of {where} has products": products,
                f"the COM of {where} is not at the origin of its parts": centre,
            }
            if reason := next((text for text, there in reasons.items() if there), ""):
                return reason
            above = stage.name
        return "it is perturbed" if design.perturbation else ""

    def suspension(self, design: Design) -> LinearSystem:
        """The linear model on a rigid support."""
        return _linear_model([design], batch=False)

    def approximated_stages(self, design: Design) -> tuple[str, ...]:
        """Stages with angled wires on blades, which are not exactly in series."""
        found = []
        for stage in design.stage:
            if stage.blades is not None and stage.wires is not None:
                shape = set_geometry(stage.wires)
                if shape.t1 != shape.t2 or shape.s_upper != shape.s_lower:
                    found.append(stage.name)
        return tuple(found)

    def batch_key(self, design: Design) -> Hashable:
        """Counts of wires and blades, whether anything is lossy, dampers and support structure."""
        sets = tuple(
            (stage.wires and stage.wires.count, stage.blades and stage.blades.count)
            for stage in design.stage
        )
        return (sets, lossy(design), surroundings_key(design))

    def batch(self, designs: Sequence[Design]) -> LinearSystem:
        """Chains of the same topology as one linear model, designs as the first axis."""
        return _linear_model(designs, batch=True)


FORCE = Force()
