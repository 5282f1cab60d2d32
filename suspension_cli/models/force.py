"""Force model of a chain of symmetric stages on straight wires, in four uncoupled blocks.

Husman et al., Rev. Sci. Instrum. 71, 2546 (2000), sections 3a and 4. A wire with unit vector u,
tension T and spring constant k joins the upper body (arm a) to the lower one (arm b). For a small
relative displacement D of its ends it stores

    k (u . D)^2 / 2 + (T / l) (|D|^2 - (u . D)^2) / 2
    + T u . (second-order displacement of b less that of a).

A wire whose torsion is given adds torsion (u . t)^2 / 2 for a rotation t of the lower body less
that of the upper one. Summed over the wires of a symmetric set, terms odd in x or y cancel, and the
chain falls into four blocks that do not couple: longitudinal-pitch, transverse-roll, vertical, yaw.
As in the paper, blades are in series with the stretching of the wires and act along them. That is
exact only for vertical wires (the string model has the tips as coordinates). Two wires on one blade
stretch it together, so the blade counts only in motions that pull both alike.

Every number may be an array; all functions work on batches of chains. No code of the general
assembly is used.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.conventions import DOFS, SUPPORT
from suspension_cli.design.bodies import body_inertia, body_mass
from suspension_cli.design.derive import (
    beyond_symmetric_chains,
    blade_loss,
    blade_stiffness,
    com_positions,
    gravity_strength,
    set_geometry,
    wire_loss,
    wire_stiffness,
)
from suspension_cli.design.schema import Design
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models.base import BENDING, BLADE_TIPS, MASS, Model
from suspension_cli.models.surroundings import surroundings_key
from suspension_cli.rotations import cross_matrix

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact, Int

    from suspension_cli.models.base import Numbers

BLOCKS = {
    "longitudinal-pitch": ("x", "pitch"),
    "transverse-roll": ("y", "roll"),
    "vertical": ("z",),
    "yaw": ("yaw",),
}
"""The four blocks and their coordinates of each body."""

CHUNK = 1024
"""Chains solved at once: few enough that their matrices stay in the cache."""


@dataclass(frozen=True)
class Stage:
    """One stage of a chain; floats may be arrays of the batch shape.

    Attributes
    ----------
    mass, inertia
        kg; IX, IY, IZ in kg m^2.
    count
        Wires: 1, 2 (at +-t) or 4.
    l, s_upper, s_lower, t1, t2, d, d_upper
        m; the paper's symbols, see `design.schema.WireSet`.
    k, torsion
        Of one wire, N/m and N m/rad (0 if not given).
    blades
        0, or the number of blades that carry the wires.
    blade_stiffness
        Of one blade, N/m. This, k and torsion may be complex, k (1 + i phi).
    """

    mass: Numbers
    inertia: tuple[Numbers, Numbers, Numbers]
    count: int
    l: Numbers
    t1: Numbers = 0.0
    t2: Numbers = 0.0
    s_upper: Numbers = 0.0
    s_lower: Numbers = 0.0
    d: Numbers = 0.0
    d_upper: Numbers = 0.0
    k: Numbers = 1e4
    torsion: Numbers = 0.0
    blades: int = 0
    blade_stiffness: Numbers = 1e3

    def stretching(self, *, together: bool) -> Numbers:
        """Spring constant of one wire with its blade in series, N/m.

        `together`: whether the motion stretches the wires that share a blade alike (else the blade
        stays at rest).
        """
        if self.blades == 0:
            return self.k
        shared = self.count // self.blades
        if shared > 1 and not together:
            return self.k
        return 1.0 / (1.0 / self.k + shared / self.blade_stiffness)


@dataclass(frozen=True)
class Chain:
    """Stages from top to bottom, each hanging from the one before."""

    stages: tuple[Stage, ...]
    gravity: Numbers = 9.81


def stiffness(chain: Chain) -> dict[str, Inexact[np.ndarray, "... _ _"]]:
    """Stiffness matrices (..., c (n + 1), c (n + 1)) of the four blocks: N/m, N, N m.

    For c coordinates per body and n stages, the support first.
    """
    n = len(chain.stages)
    batch = np.broadcast_shapes(
        *(
            np.shape(v)
            for stage in chain.stages
            for v in (*vars(stage).values(), *stage.inertia)
            if not isinstance(v, tuple)
        )
    )
    kind = (
        complex
        if any(
            np.iscomplexobj(v) for stage in chain.stages for v in (stage.k, stage.blade_stiffness)
        )
        else float
    )
    result = {
        name: np.zeros((*batch, len(dofs) * (n + 1), len(dofs) * (n + 1)), dtype=kind)
        for name, dofs in BLOCKS.items()
    }
    load = 0.0
    for number in range(n, 0, -1):
        load = load + chain.stages[number - 1].mass * chain.gravity
        for name, block in _stage_blocks(chain.stages[number - 1], load).items():
            width = len(BLOCKS[name])
            place = slice(width * (number - 1), width * (number + 1))
            for i, row in enumerate(block):
                for j, value in enumerate(row):
                    result[name][..., place, place][..., i, j] += value
    return result


def _stage_blocks(p: Stage, load: Numbers) -> dict[str, list[list[Numbers]]]:
    """Stiffness that the wires of one stage add to each block, upper then lower body."""
    height = np.sqrt(p.l**2 - (p.t2 - p.t1) ** 2 - (p.s_lower - p.s_upper) ** 2)
    ux, uy, c = (p.s_lower - p.s_upper) / p.l, (p.t2 - p.t1) / p.l, height / p.l
    swing, lift = load / (c * p.l), load / c  # count T / l and count T
    alike = p.count * p.stretching(together=True) - swing
    apart = p.count * p.stretching(together=False) - swing
    # two wires of a pair on one blade pull it apart when the body rolls
    across = alike if p.count == 4 else apart
    s1, s2, t1, t2, d, du = p.s_upper, p.s_lower, p.t1, p.t2, p.d, p.d_upper
    # longitudinal-pitch: horizontal displacement of the ends, and their vertical one (odd in x)
    level, rise = (-1.0, du, 1.0, d), (0.0, -s1, 0.0, s2)
    along = tuple(ux * a + c * b for a, b in zip(level, rise, strict=True))
    x_pitch = _sum((apart, along), (swing, level), (swing, rise))
    x_pitch[1][1] = x_pitch[1][1] + lift * (ux * s1 + c * du)
    x_pitch[3][3] = x_pitch[3][3] + lift * (c * d - ux * s2)
    # transverse-roll: the same seen from the front (right-handed roll lowers the side that pitch
    # lifts)
    level, rise = (-1.0, -du, 1.0, -d), (0.0, -t1, 0.0, t2)
    along = tuple(uy * a - c * b for a, b in zip(level, rise, strict=True))
    y_roll = _sum((across, along), (swing, level), (swing, rise))
    y_roll[1][1] = y_roll[1][1] + lift * (uy * t1 + c * du)
    y_roll[3][3] = y_roll[3][3] + lift * (c * d - uy * t2)
    z = _sum((alike * c**2 + swing, (-1.0, 1.0)))
    # yaw: displacement of the ends along x and along y
    sweep, swerve = (-t1, t2), (-s1, s2)
    along = tuple(uy * b - ux * a for a, b in zip(sweep, swerve, strict=True))
    yaw = _sum((apart, along), (swing, sweep), (swing, swerve))
    yaw[0][0] = yaw[0][0] + lift * (ux * s1 + uy * t1)
    yaw[1][1] = yaw[1][1] - lift * (ux * s2 + uy * t2)
    for block, turning, part in ((x_pitch, (1, 3), uy), (y_roll, (1, 3), ux), (yaw, (0, 1), c)):
        twist = p.count * p.torsion * part**2
        for i in turning:
            for j in turning:
                block[i][j] = block[i][j] + (twist if i == j else -twist)
    return {"longitudinal-pitch": x_pitch, "transverse-roll": y_roll, "vertical": z, "yaw": yaw}


def _sum(*terms: tuple[Numbers, tuple[Numbers, ...]]) -> list[list[Numbers]]:
    """Sum of factor times outer product of a vector with itself, element by element."""
    size = len(terms[0][1])
    result: list[list[Numbers]] = [[0.0] * size for _ in range(size)]
    for factor, vector in terms:
        for i in range(size):
            for j in range(i + 1):
                result[i][j] = result[i][j] + factor * vector[i] * vector[j]
    for i in range(size):
        for j in range(i):
            result[j][i] = result[i][j]
    return result


def masses(chain: Chain, name: str) -> Inexact[np.ndarray, "*batch own"]:
    """Masses and moments of inertia (..., c n) of one block's coordinates, kg and kg m^2."""
    moments = {"x": 0, "y": 1, "z": 2, "roll": 0, "pitch": 1, "yaw": 2}
    values = [
        stage.mass if dof in "xyz" else stage.inertia[moments[dof]]
        for stage in chain.stages
        for dof in BLOCKS[name]
    ]
    return np.stack(np.broadcast_arrays(*values), axis=-1)


def dynamics(chain: Chain) -> dict[str, Inexact[np.ndarray, "*axes"]]:
    """M^(-1/2) K M^(-1/2) of the four blocks, without the support: symmetric, 1/s^2."""
    result = {}
    for name, matrix in stiffness(chain).items():
        width, root = len(BLOCKS[name]), 1.0 / np.sqrt(masses(chain, name))
        result[name] = matrix[..., width:, width:] * root[..., :, None] * root[..., None, :]
    return result


def eigenvalues(chain: Chain) -> dict[str, Inexact[np.ndarray, "*axes"]]:
    """omega^2 (rad/s)^2 of all modes, ascending in each block, (..., c n); negative if unstable."""
    sizes = {
        np.shape(v)
        for stage in chain.stages
        for v in (*vars(stage).values(), *stage.inertia)
        if isinstance(v, np.ndarray) and v.ndim
    }
    if len(sizes) != 1 or len(shape := sizes.pop()) != 1 or shape[0] <= CHUNK:
        return {name: np.linalg.eigvalsh(matrix) for name, matrix in dynamics(chain).items()}
    parts = [
        {
            name: np.linalg.eigvalsh(matrix)
            for name, matrix in dynamics(_part(chain, slice(start, start + CHUNK))).items()
        }
        for start in range(0, shape[0], CHUNK)
    ]
    return {name: np.concatenate([part[name] for part in parts]) for name in BLOCKS}


def _part(chain: Chain, which: slice) -> Chain:
    def cut(value: Any) -> Any:
        if isinstance(value, tuple):
            return tuple(cut(item) for item in value)
        return value[which] if isinstance(value, np.ndarray) and value.ndim else value

    stages = tuple(
        Stage(**{key: cut(value) for key, value in vars(stage).items()}) for stage in chain.stages
    )
    return Chain(stages, cut(chain.gravity))


def unsuited(design: Design) -> str:
    """Why a design is not a symmetric chain; "" if it is one."""
    if design.link or design.damper:
        return "it has [[link]] or [[damper]]"
    if reason := beyond_symmetric_chains(design):
        return reason
    above = SUPPORT
    for stage in design.stage:
        if stage.inverted_pendulum is not None:
            return f"stage {stage.name} stands on legs"
        if stage.filter is not None:
            return f"stage {stage.name} has a filter"
        if stage.wires is None:
            return (
                f"stage {stage.name} has explicit wires"
                if stage.wire
                else f"stage {stage.name} hangs on no wires"
            )
        if stage.hangs_from not in (None, above):
            return "it branches"
        if stage.spring:
            return f"stage {stage.name} has springs"
        if stage.blades is not None and (stage.blades.tip_mass or stage.blades.lateral_stiffness):
            return f"the blades of stage {stage.name} have tip masses or lateral compliance"
        if stage.blades is not None and stage.blades.load is not None:
            return (
                f"the blades of stage {stage.name} have a given load, so that the pose is"
                " solved for"
            )
        inertia = body_inertia(stage.body)
        if any(inertia[i][j] for i in range(3) for j in range(3) if i != j):
            return f"the inertia of stage {stage.name} has products"
        above = stage.name
    return "it is perturbed" if design.perturbation else ""


def series_is_approximate(design: Design) -> list[str]:
    """Stages with angled wires on blades, which are not exactly in series."""
    found = []
    for stage in design.stage:
        if stage.blades is not None and stage.wires is not None:
            shape = set_geometry(stage.wires)
            if shape.t1 != shape.t2 or shape.s_upper != shape.s_lower:
                found.append(stage.name)
    return found


def chain(design: Design, *, lossy: bool = False) -> Chain:
    """The chain of a suitable design, with complex spring constants if `lossy`."""
    stages = []
    for stage in design.stage:
        assert stage.wires is not None
        shape, inertia, mass = (
            set_geometry(stage.wires),
            body_inertia(stage.body),
            body_mass(stage.body),
        )
        blades = stage.blades
        k = wire_stiffness(design, stage.wires, shape.length)
        elastic = 1 + 1j * wire_loss(design, stage.wires, shape.length) if lossy else 1.0
        per_blade = 1.0 if blades is None else blade_stiffness(design, blades, mass, blades.count)
        stages.append(
            Stage(
                mass=mass,
                inertia=(inertia[0][0], inertia[1][1], inertia[2][2]),
                count=shape.count,
                l=shape.length,
                t1=shape.t1,
                t2=shape.t2,
                s_upper=shape.s_upper,
                s_lower=shape.s_lower,
                d=shape.d,
                d_upper=shape.d_upper,
                k=k * elastic,
                torsion=(stage.wires.torsion or 0.0) * elastic,
                blades=0 if blades is None else blades.count,
                blade_stiffness=(
                    per_blade * (1 + 1j * blade_loss(design, blades))
                    if lossy and blades is not None
                    else per_blade
                ),
            )
        )
    return Chain(tuple(stages), gravity_strength(design))


def lossy(design: Design) -> bool:
    """Whether a chain's wires or blades have loss angles."""
    return any(
        wire_loss(design, s.wires, s.wires.l)
        or (s.blades is not None and blade_loss(design, s.blades))
        for s in design.stage
        if s.wires is not None
    )


def linear_model(design: Design) -> LinearSystem:
    """Linear model of a symmetric chain: its four blocks in one matrix."""
    return assembled(design, chain(design), chain(design, lossy=True) if lossy(design) else None)


def assembled(design: Design, links: Chain, lossy: Chain | None) -> LinearSystem:
    """Linear model of a chain (or a batch of chains) with the names of a design."""
    bodies = (SUPPORT, *(stage.name for stage in design.stage))
    size, stiff = 6 * len(bodies), _whole(links, 6 * len(bodies))
    mass = np.zeros(stiff.shape)
    for name in BLOCKS:
        rows = _rows(name, len(bodies))[len(BLOCKS[name]) :]
        mass[..., rows, rows] = masses(links, name)
    return LinearSystem(
        body=bodies[1:],
        coordinate=tuple(f"{body}.{dof}" for body in bodies for dof in DOFS),
        basis=np.eye(size),
        massless=np.zeros(size, dtype=bool),
        mass=mass,
        stiffness=stiff,
        damping=np.zeros((size, size)),
        lossy=None if lossy is None else _whole(lossy, size),
        rigid=_rigid_motion(design),
    )


def _rows(name: str, bodies: int) -> Int[np.ndarray, " own"]:
    """The coordinates of one block among six of every body."""
    return np.array([6 * n + DOFS.index(dof) for n in range(bodies) for dof in BLOCKS[name]])


def _whole(links: Chain, size: int) -> Inexact[np.ndarray, "*batch coordinate coordinate"]:
    """All four blocks in one matrix."""
    blocks = stiffness(links)
    result = np.zeros((*blocks["vertical"].shape[:-2], size, size), dtype=blocks["vertical"].dtype)
    for name, matrix in blocks.items():
        rows = _rows(name, size // 6)
        result[..., rows[:, None], rows] = matrix
    return result


def _rigid_motion(design: Design) -> Float[np.ndarray, "coordinate 6"]:
    """Motion of all coordinates when everything moves with the support as one rigid body."""
    positions = com_positions(design)
    result = np.concatenate([np.eye(6)] * (len(design.stage) + 1))
    for n, stage in enumerate(design.stage, 1):
        result[6 * n : 6 * n + 3, 3:] = -cross_matrix(np.array(positions[stage.name]))
    return result


def stacked(chains: Sequence[Chain]) -> Chain:
    """Chains of the same stages as one chain of arrays (p,)."""
    stages = (_stacked_stages(same) for same in zip(*(one.stages for one in chains), strict=True))
    return Chain(tuple(stages), np.array([one.gravity for one in chains]))


def _stacked_stages(stages: Sequence[Stage]) -> Stage:
    numbers: dict[str, Numbers] = {
        name: np.array([vars(stage)[name] for stage in stages])
        for name in vars(stages[0])
        if name not in ("count", "blades", "inertia")
    }
    x, y, z = np.array([stage.inertia for stage in stages]).T
    return Stage(count=stages[0].count, blades=stages[0].blades, inertia=(x, y, z), **numbers)


class Force(Model):
    """The paper's force model; arrays of chains are solved at once."""

    name = "force"
    description = "forces on straight wires of a symmetric chain, in four blocks"
    valid_for = "symmetric chain"
    omits = (BLADE_TIPS, BENDING, MASS)
    cost = 1.0

    def unsuitable(self, design: Design) -> str:
        """Why a design is not a symmetric chain; "" if it is one."""
        return unsuited(design)

    def suspension(self, design: Design) -> LinearSystem:
        """The linear model on a rigid support."""
        return linear_model(design)

    def approximated_stages(self, design: Design) -> tuple[str, ...]:
        """Stages whose blades hold angled wires."""
        return tuple(series_is_approximate(design))

    def batch_key(self, design: Design) -> Hashable:
        """Counts of wires and blades, whether anything is lossy, dampers and support structure."""
        sets = tuple(
            (stage.wires and stage.wires.count, stage.blades and stage.blades.count)
            for stage in design.stage
        )
        return (sets, lossy(design), surroundings_key(design))

    def batch(self, designs: Sequence[Design]) -> LinearSystem:
        """Chains of the same topology as one linear model, designs as the first axis."""
        links = stacked([chain(design) for design in designs])
        with_loss = (
            stacked([chain(design, lossy=True) for design in designs])
            if lossy(designs[0])
            else None
        )
        return assembled(designs[0], links, with_loss)


FORCE = Force()
