"""Wires, blades and stages as single objects, and their packing into the arrays of a scene."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from suspension_cli.design.bodies import body_inertia, body_mass
from suspension_cli.design.derive import (
    gives_natural_lengths,
    gravity_strength,
)
from suspension_cli.design.schema import Design, Spring, Stage
from suspension_cli.scene.arrays import Array, Index
from suspension_cli.scene.gravity import field_of
from suspension_cli.scene.links import springs
from suspension_cli.scene.scene import Bars, Blades, Bodies, Scene, Wires


@dataclass(frozen=True)
class WirePart:
    """One wire, or the leg of an inverted pendulum as a strut.

    Attributes
    ----------
    upper_point, lower_point : (3,) arrays
        Ends in the frames of the two bodies, m.
    span : (3,) array
        From the upper to the lower end in the nominal pose, m.
    stiffness
        N/m.
    torsion
        N m/rad; 0 if not given.
    loss
        Loss angle, rad.
    blade
        Name of the blade that carries the upper end.
    given
        Tension in the nominal pose that the design fixes, N.
    natural
        Whether a natural length fixes it; the pose is then solved for.
    mass : (3,) array
        Moments m_uu, m_ul, m_ll of the mass, kg; see `elements.weight`.
    """

    label: str
    upper_point: Array
    lower_point: Array
    span: Array
    stiffness: float
    torsion: float = 0.0
    loss: float = 0.0
    blade: str | None = None
    given: float | None = None
    natural: bool = False
    mass: Array = field(default_factory=lambda: np.zeros(3))

    @cached_property
    def direction(self) -> Array:
        """Unit vector from the upper to the lower end."""
        return self.span / np.sqrt(self.span @ self.span)


@dataclass(frozen=True)
class BladePart:
    """One blade.

    Attributes
    ----------
    tip : (3,) array
        In the frame of the body that carries the blade, m.
    axes : (3,) bool array
        Axes along which the tip moves.
    stiffness : (3,) array
        N/m.
    tip_mass
        kg.
    loss
        Loss angle, rad.
    load
        Weight under which the tip is at `tip`, N, if the design gives it.
    """

    label: str
    tip: Array
    axes: NDArray[np.bool_]
    stiffness: Array
    tip_mass: float
    loss: float
    load: float | None = None


@dataclass(frozen=True)
class BarPart:
    """Inertia of one bar between the body above and a stage.

    Attributes
    ----------
    upper, lower : (3,) arrays
        Ends in the frames of the two bodies, m.
    inertia : (3,) array
        kg, see `scene.Bars`.
    """

    label: str
    upper: Array
    lower: Array
    inertia: Array


@dataclass
class StagePart:
    """One stage: its wires and blades by name, their tensions (w,) and loads (3,) in N.

    `offset` is its COM from the COM above, m; `parent` the number of the body above; struts (with
    their thrust, N), flexures and bars are those of legs and of blades of a filter.
    """

    stage: Stage
    parent: int
    offset: Array
    wires: list[WirePart] = field(default_factory=list)
    blades: dict[str, BladePart] = field(default_factory=dict)
    tension: Array = field(default_factory=lambda: np.zeros(0))
    loads: dict[str, Array] = field(default_factory=dict)
    struts: list[WirePart] = field(default_factory=list)
    thrust: Array = field(default_factory=lambda: np.zeros(0))
    flexures: list[Spring] = field(default_factory=list)
    bars: list[BarPart] = field(default_factory=list)


def pack(design: Design, parts: list[StagePart]) -> Scene:
    """Pack stages into the arrays of a scene."""
    position = [np.zeros(3)]
    for part in parts:
        position.append(position[part.parent] + part.offset)
    bodies = Bodies(
        name=tuple(part.stage.name for part in parts),
        mass=np.array([body_mass(part.stage.body) for part in parts]),
        inertia=np.array([body_inertia(part.stage.body) for part in parts]),
        position=np.array(position),
    )
    wires = _lines(parts, "wires", np.concatenate([part.tension for part in parts]))
    return Scene(
        name=design.design.name,
        gravity=gravity_strength(design),
        bodies=bodies,
        wires=replace(wires, blade=_blade_numbers(parts)),
        blades=_blades(parts),
        springs=springs(design, parts, bodies.position),
        struts=_lines(parts, "struts", -np.concatenate([part.thrust for part in parts])),
        bars=_bars(parts),
        field=field_of(design),
        solves_pose=gives_natural_lengths(design),
    )


def _lines(parts: list[StagePart], kind: str, tension: Array) -> Wires:
    """Pack the wires or the struts of all stages, without blades."""
    rows = [(n, part, line) for n, part in enumerate(parts, 1) for line in getattr(part, kind)]

    def values(name: str) -> Array:
        return np.array([getattr(line, name) for _, _, line in rows], dtype=None if rows else float)

    def vectors(name: str) -> Array:
        return values(name).reshape(-1, 3)

    return Wires(
        label=tuple(line.label for _, _, line in rows),
        upper=np.array([part.parent for _, part, _ in rows], dtype=np.intp),
        lower=np.array([n for n, _, _ in rows], dtype=np.intp),
        blade=np.full(len(rows), -1),
        upper_point=vectors("upper_point"),
        lower_point=vectors("lower_point"),
        span=vectors("span"),
        length=np.sqrt((vectors("span") ** 2).sum(-1)),
        tension=tension,
        stiffness=values("stiffness"),
        torsion=values("torsion"),
        loss=values("loss"),
        mass=vectors("mass"),
    )


def _blade_numbers(parts: list[StagePart]) -> Index:
    """Number of the blade that carries each wire; -1 for none."""
    found, first = [], 0
    for part in parts:
        names = list(part.blades)
        found += [first + names.index(wire.blade) if wire.blade else -1 for wire in part.wires]
        first += len(names)
    return np.array(found, dtype=np.intp)


def _bars(parts: list[StagePart]) -> Bars:
    rows = [(n, part, bar) for n, part in enumerate(parts, 1) for bar in part.bars]
    if not rows:
        return Bars()
    return Bars(
        label=tuple(bar.label for _, _, bar in rows),
        body=np.array([(part.parent, n) for n, part, _ in rows], dtype=np.intp),
        point=np.array([(bar.upper, bar.lower) for _, _, bar in rows]),
        inertia=np.array([bar.inertia for _, _, bar in rows]),
    )


def _blades(parts: list[StagePart]) -> Blades:
    rows = [(part, name, blade) for part in parts for name, blade in part.blades.items()]
    return Blades(
        label=tuple(blade.label for _, _, blade in rows),
        body=np.array([part.parent for part, _, _ in rows], dtype=np.intp),
        axes=np.array([blade.axes for _, _, blade in rows], dtype=bool).reshape(-1, 3),
        tip=np.array([blade.tip for _, _, blade in rows]).reshape(-1, 3),
        stiffness=np.array([blade.stiffness for _, _, blade in rows]).reshape(-1, 3),
        load=np.array([part.loads[name] for part, name, _ in rows]).reshape(-1, 3),
        tip_mass=np.array([blade.tip_mass for _, _, blade in rows]),
        loss=np.array([blade.loss for _, _, blade in rows]),
    )
