"""Lines in space that a drawing of a suspension shows, in a pose, and the views on them.

All functions take scenes and poses without batch axes.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design.bodies import Body, Solid, body_inertia, body_mass, centre_of_mass
from suspension_cli.design.derive import com_positions
from suspension_cli.design.locked_stages import as_in_file, locked_names
from suspension_cli.design.schema import Design
from suspension_cli.design.wires import AnyBlade, AnyWire, names_on_tip
from suspension_cli.scene import spring_rows
from suspension_cli.scene.arrays import Array, Index
from suspension_cli.scene.places import Places
from suspension_cli.scene.pose import Layout, Pose, displace, layout, nominal_pose
from suspension_cli.scene.scene import Scene, Springs, Wires

if TYPE_CHECKING:
    from jaxtyping import Float
    from numpy.typing import ArrayLike

LARGEST_ANGLE = 0.35
"""Largest rotation in the picture of a mode, rad."""
LARGEST_SLOPE = 0.3
"""Largest relative motion of the two ends of a wire, as a fraction of its length."""
LARGEST_SHIFT = 0.16
"""Largest motion of anything, as a fraction of the suspension's size."""
LARGEST_RISE = 0.03
"""Largest motion of a damper relative to the tip that carries it, likewise."""
LARGEST_BEND = 0.06
"""Largest deflection of a blade, as a fraction of the suspension's size."""
SMALLEST = 0.012
"""Least half extent of a body that can be seen, relative to the size of the suspension."""
STEEL = 7800.0
"""Density of point masses in drawings, kg/m^3."""
DAMPER_HEIGHT = 0.03
"""Height of a damper above the tip that carries it, relative to the size of the suspension."""
ALONG = np.linspace(0, 1, 13)[:, None]
"""Places of the points of a blade along it."""


@dataclass(frozen=True)
class View:
    """Projection of points in space onto a picture by a matrix (2, 3): right, up.

    `normal` is the axis (0, 1, 2) of the line of sight: bodies show their section across it.
    `scale` is the length of a metre, `origin` (2,) the suspension point in the picture.
    """

    name: str
    normal: int
    matrix: Array
    scale: float = 1.0
    origin: Array = field(default_factory=lambda: np.zeros(2))

    def see(self, points: ArrayLike) -> Array:
        """Project points (..., 3) in space (m) to points (..., 2) in the picture."""
        return self.scale * (np.asarray(points) @ self.matrix.T) + self.origin

    def at(self, origin: ArrayLike, scale: float = 1.0) -> View:
        """Move and scale the view: suspension point at `origin`, `scale` units per metre."""
        return replace(self, origin=np.asarray(origin, dtype=float), scale=scale)


SIDE = View("side on", 1, np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]))
"""x to the right, z up."""
FACE = View("face on", 0, np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]))
"""y to the right, z up."""
ABOVE = View("from above", 2, np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 1.0]]))
"""y to the right, x towards the reader, so that a turned body keeps its shape; each body is at its
own height."""


@dataclass(frozen=True)
class Outline:
    """Shape of a body: half extents (3,), m, along x, y, z, about its COM.

    A cylinder has an axis (0, 1, 2), perhaps an inner radius (m); a box and a sphere have none.
    `turn` (3, 3) is the rotation matrix from the shape to the frame of the body. A body of several
    `parts` has the outlines of these, whose middles are `at` (3,) from its COM, m.
    """

    half: Array
    axis: int | None = None
    inner: float = 0.0
    turn: Array = field(default_factory=lambda: np.eye(3))
    is_sphere: bool = False
    at: Array = field(default_factory=lambda: np.zeros(3))
    parts: tuple[Outline, ...] = ()

    @property
    def shapes(self) -> tuple[Outline, ...]:
        """The outlines of its parts, turned with the body; its own if it has none."""
        return tuple(replace(one, turn=self.turn) for one in self.parts) or (self,)

    def section(self, normal: int) -> Array:
        """Section of a single shape through its middle, across the axis `normal` (0, 1, 2).

        A closed line (p, 3), m: a circle across the axis of a cylinder, else a rectangle.
        """
        sides = np.delete(np.eye(3) * self.half, normal, axis=0)
        corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1], [1, 1]])
        if self.axis == normal or self.is_sphere:
            angle = np.linspace(0, 2 * np.pi, 97)
            corners = np.column_stack([np.cos(angle), np.sin(angle)])
        return (self.at + corners @ sides) @ self.turn.T

    def nearest(self, point: ArrayLike) -> Array:
        """Points (..., 3) of the body nearest to given points (..., 3), in its frame, m."""
        found = np.array([one.nearest_of_shape(point) for one in self.shapes])
        distance = np.linalg.norm(found - np.asarray(point, dtype=float), axis=-1)
        return np.take_along_axis(found, distance.argmin(0)[None, ..., None], 0)[0]

    def nearest_of_shape(self, point: ArrayLike) -> Array:
        """Points (..., 3) of a single shape nearest to given points (..., 3), m."""
        point = np.asarray(point, dtype=float) @ self.turn - self.at
        result = np.clip(point, -self.half, self.half)
        if self.is_sphere:
            distance = np.linalg.norm(point, axis=-1, keepdims=True)
            result = point * np.minimum(1.0, self.half[0] / np.maximum(distance, 1e-300))
        if self.axis is not None:
            across = np.delete(np.arange(3), self.axis)
            distance = np.linalg.norm(point[..., across], axis=-1, keepdims=True)
            inside = self.half[across[0]] / np.maximum(distance, 1e-300)
            result[..., across] = point[..., across] * np.minimum(1.0, inside)
        return (self.at + result) @ self.turn.T


def outline(
    body: Solid, mass: float, inertia: Float[np.ndarray, "3 3"], least: float = 0.0
) -> Outline:
    """Outline of one body, with half extents of at least `least`, m.

    The cylinder or box of the design; for a body given by its inertia (3, 3), kg m^2 about the COM,
    the homogeneous box of the same mass (kg) and moments, Lx^2 = 6 (Iy + Iz - Ix) / m, or 0 where
    that is negative.
    """
    if body.shape == "cylinder":
        assert body.radius is not None and body.length is not None
        axis = "xyz".index(body.axis or "x")
        half = np.full(3, body.radius)
        half[axis] = body.length / 2
        return Outline(np.maximum(half, least), axis, body.inner_radius or 0.0)
    if isinstance(body, Body) and body.parts:
        return _outline_of_parts(body, least)
    if body.shape == "sphere":
        assert body.radius is not None
        return Outline(np.full(3, max(body.radius, least)), is_sphere=True)
    if body.shape == "box":
        assert body.size is not None
        return Outline(np.maximum(np.array(body.size) / 2, least))
    moments = np.diagonal(np.asarray(inertia, dtype=float))
    squares = np.maximum(6 * (moments.sum() - 2 * moments) / mass, 0.0)
    return Outline(np.maximum(np.sqrt(squares) / 2, least))


def _outline_of_parts(body: Body, least: float) -> Outline:
    """Outline of a body of parts; point masses are drawn as balls of steel."""
    centre = np.array(centre_of_mass(body))
    shapes = []
    for part in body.parts:
        mass = body_mass(part)
        if part.shape is None and part.inertia is None:
            radius = max((3 * mass / (4 * np.pi * STEEL)) ** (1 / 3), least)
            shape = Outline(np.full(3, radius), is_sphere=True)
        else:
            shape = outline(part, mass, np.array(body_inertia(part)), least)
        shapes.append(replace(shape, at=np.array(part.at) - centre))
    half = np.max([np.abs(one.at) + one.half for one in shapes], axis=0)
    return Outline(half, parts=tuple(shapes))


def suspension_size(scene: Scene) -> float:
    """Size of a suspension, m: its height, half its width or its largest radius of gyration."""
    ends = _ends(scene, nominal_pose(scene), scene.wires).reshape(-1, 3)
    extent = np.ptp(np.concatenate([scene.bodies.position, ends]), axis=0) * (0.5, 0.5, 1.0)
    gyration = np.sqrt(np.trace(scene.bodies.inertia, axis1=-2, axis2=-1) / scene.bodies.mass)
    return float(max(extent.max(), gyration.max()))


def position_of(scene: Scene, pose: Pose, body: ArrayLike, point: ArrayLike) -> Array:
    """Positions (k, 3) in space of points (k, 3) fixed in bodies (k,), m."""
    body = np.broadcast_to(np.asarray(body, dtype=np.intp), np.shape(point)[:-1])
    centre = scene.bodies.position[body] + pose.shift[body]
    return centre + pose.arms(body, np.asarray(point, dtype=float))


def _ends(scene: Scene, pose: Pose, lines: Wires | Springs, moved: Array | float = 0.0) -> Array:
    """Upper and lower ends (k, 2, 3) of wires, struts or springs, m.

    `moved` is by how much upper ends have moved in their bodies.
    """
    upper = position_of(scene, pose, lines.upper, lines.upper_point + moved)
    lower = position_of(scene, pose, lines.lower, lines.lower_point)
    return np.stack([upper, lower], axis=1)


@dataclass(frozen=True)
class Stroke:
    """A line (p, 3) in space, m.

    `kind` is "body", "locked", "blade", "spring", "damper", "mass" or a key of `parts.WIDTHS`;
    `body` is the number of a body from 0, `grounded` whether a spring stands on the ground. Springs
    have their two ends; those that are not on the ground, before them the middle of the body that
    holds them. A mass on a wire or a blade has the point there, then its own.
    """

    kind: str
    points: Array
    body: int = 0
    grounded: bool = False


@dataclass(frozen=True)
class Sketch:
    """A suspension in one pose, to be drawn in any view; size and thickness of the support in m.

    `brackets` are the bodies (k,) and the two ends there (k, 2, 3) of the lines to attachments that
    are outside bodies. `raised` is how far dampers on tips have moved relative to these (m), by the
    names of their coordinates.
    """

    design: Design
    scene: Scene
    outlines: list[Outline]
    brackets: tuple[Index, Array]
    pose: Pose
    size: float
    thick: float = 0.0
    raised: Mapping[str, float] = field(default_factory=dict)
    _strokes: dict[int, list[Stroke]] = field(init=False, repr=False, default_factory=dict)

    def locate(self, body: ArrayLike, point: ArrayLike) -> Array:
        """Positions (k, 3) in space of points (k, 3) fixed in bodies (k,), m."""
        return position_of(self.scene, self.pose, body, point)

    def wire_ends(self) -> Array:
        """Upper and lower end (w, 2, 3) of every wire, m; an end on a blade moves with its tip."""
        tips = np.vstack([self.pose.deflection, np.zeros(3)])[self.scene.wires.blade]
        return _ends(self.scene, self.pose, self.scene.wires, tips)

    def strokes(self, normal: int) -> list[Stroke]:
        """All lines in a view along an axis, except the support; the order is that of the scene."""
        if normal not in self._strokes:
            parts = (
                _locked(self.design, normal, SMALLEST * self.size),
                _bodies(self, normal),
                _lines(self),
                _springs(self),
                _masses(self),
            )
            self._strokes[normal] = [stroke for part in parts for stroke in part]
        return self._strokes[normal]

    def points(self, view: View) -> Array:
        """Points (k, 2) in a view of everything that is drawn, except the support."""
        return view.see(np.concatenate([one.points for one in self.strokes(view.normal)]))


def sketch_at_rest(design: Design, scene: Scene, thick: float = 0.0) -> Sketch:
    """Make the sketch of a design at rest; the support's thickness is relative to its size."""
    size = suspension_size(scene)
    bodies = scene.bodies
    outlines = [
        outline(stage.body, float(m), i, SMALLEST * size)
        for stage, m, i in zip(design.stage, bodies.mass, bodies.inertia, strict=True)
    ]
    brackets = _brackets(scene, outlines)
    return Sketch(design, scene, outlines, brackets, nominal_pose(scene), size, thick * size)


def _locked(design: Design, normal: int, least: float) -> Iterator[Stroke]:
    """Sections of locked bodies, with half extents of at least `least`, m."""
    held = locked_names(design)
    if not held:
        return
    whole = as_in_file(design)
    place = com_positions(whole)
    for stage in whole.stage:
        if stage.name in held:
            inertia = np.array(body_inertia(stage.body))
            shape = outline(stage.body, body_mass(stage.body), inertia, least)
            for part in shape.shapes:
                yield Stroke("locked", place[stage.name] + part.section(normal))


def _bodies(sketch: Sketch, normal: int) -> Iterator[Stroke]:
    """Sections of bodies, and the bores of cylinders."""
    bodies = enumerate(sketch.outlines)
    for n, body in ((n, shape) for n, whole in bodies for shape in whole.shapes):
        section = body.section(normal)
        yield Stroke("body", sketch.locate(n + 1, section), n)
        if body.axis == normal and body.inner:
            middle = body.turn @ body.at
            ratio = body.inner / float(np.max(np.delete(body.half, normal)))
            bore = middle + (section - middle) * ratio
            yield Stroke("bore", sketch.locate(n + 1, bore), n)


def _brackets(scene: Scene, outlines: list[Outline]) -> tuple[Index, Array]:
    """Compute `Sketch.brackets`, of no length where attachments are on their bodies."""
    wires = scene.wires
    held = scene.springs
    free = wires.blade < 0
    body = np.concatenate([wires.lower, wires.upper[free], held.lower])
    point = np.concatenate([wires.lower_point, wires.upper_point[free], held.lower_point])
    point = point[body > 0]
    body = body[body > 0]
    roots = [outlines[n - 1].nearest(end) for n, end in zip(body.tolist(), point, strict=True)]
    return body, np.stack([np.reshape(roots, (-1, 3)), point], axis=1)


def _lines(sketch: Sketch) -> Iterator[Stroke]:
    """Brackets, wires, blades, legs, and the light of cavities."""
    body, ends = sketch.brackets
    lines = sketch.locate(body[:, None], ends)
    for n, line in zip(body.tolist(), lines, strict=True):
        yield Stroke("bracket", line, n - 1)
    yield from (Stroke("wire", line) for line in sketch.wire_ends())
    yield from (Stroke("blade", line) for line in blade_lines(sketch))
    legs = _ends(sketch.scene, sketch.pose, sketch.scene.struts)
    yield from (Stroke("leg", line) for line in legs)
    for cavity in sketch.design.cavity:
        number = Places.of(sketch.design).number
        mirrors = [number[name] for name in cavity.between]
        yield Stroke("light", sketch.locate(mirrors, np.zeros((2, 3))))


def blade_lines(sketch: Sketch) -> Iterator[Array]:
    """Line (13, 3) of each blade from its root to its tip, m, bent by a load at the tip.

    A design gives only the tips: a blade points away from the middle of its body, with its true
    length where the design gives it.
    """
    blades = sketch.scene.blades
    tables = _blade_tables(sketch.design)
    for n, (table, body) in enumerate(zip(tables, blades.body.tolist(), strict=True)):
        tip = blades.tip[n]
        bent = sketch.pose.deflection[n]
        reach = float(sketch.outlines[body - 1].half[:2].max()) if body else 0.2 * sketch.size
        out = float(np.hypot(tip[0], tip[1]))
        on_axis = out <= 1e-6 * reach
        direction = np.array([0.0, 1.0, 0.0] if on_axis else [tip[0] / out, tip[1] / out, 0.0])
        span = 0.8 * out if out > 0.05 * reach else 0.5 * reach
        if table.geometry is not None:
            span = table.geometry.length
        bend = bent * (3 * ALONG**2 - ALONG**3) / 2
        yield sketch.locate(body, tip + direction * span * (ALONG - 1) + bend)


def _blade_tables(design: Design) -> list[AnyBlade]:
    """Table of each blade of a design."""
    tables: list[AnyBlade] = []
    for stage in design.stage:
        tables += stage.blade if stage.blades is None else [stage.blades] * stage.blades.count
    return tables


def _masses(sketch: Sketch) -> Iterator[Stroke]:
    """Dampers: above the tips of blades, one above the other, and on wires."""
    blades = sketch.scene.blades
    tips = sketch.locate(blades.body, blades.tip + sketch.pose.deflection)
    for label, table, tip in zip(blades.label, _blade_tables(sketch.design), tips, strict=True):
        for n, name in enumerate(names_on_tip(label, len(table.dampers)), 1):
            height = n * DAMPER_HEIGHT * sketch.size + sketch.raised.get(name, 0.0)
            yield Stroke("mass", tip + np.array([[0.0, 0.0, 0.0], [0.0, 0.0, height]]))
    wires: list[AnyWire] = []
    for stage in sketch.design.stage:
        wires += stage.wire if stage.wires is None else [stage.wires] * stage.wires.count
    for table, (upper, lower) in zip(wires, sketch.wire_ends(), strict=True):
        for damper in table.dampers:
            yield Stroke("mass", np.tile(upper + damper.at * (lower - upper), (2, 1)))


def free_springs(scene: Scene) -> Index:
    """Numbers (k,) of the springs that are drawn: all but the flexures of legs."""
    springs = scene.springs
    legs = scene.struts
    same = (springs.lower_point[:, None] == legs.lower_point).all(-1)
    return np.flatnonzero(~(same & (springs.lower[:, None] == legs.lower)).any(1))


def _springs(sketch: Sketch) -> Iterator[Stroke]:
    """Springs, dampers and links of curved wires; the ends of springs coincide at rest."""
    scene = sketch.scene
    springs = sketch.scene.springs
    curves = dict(_link_curves(sketch))
    ends = _ends(scene, sketch.pose, springs)
    for n in free_springs(scene).tolist():
        label = springs.label[n]
        body = int(springs.upper[n])
        grounded = bool(springs.grounded[n])
        if label in curves:
            yield Stroke("link", curves[label], grounded=grounded)
        elif label.endswith(".blades"):
            yield from _filter_blades(sketch, n, ends[n, 1])
        else:
            held = sketch.locate(body, np.zeros(3))
            if body == 0:
                held = np.array([*ends[n, 0, :2], held[2]])
            points = ends[n] if grounded else np.vstack([held, ends[n]])
            kind = "damper" if label.endswith(".damper") else "spring"
            yield Stroke(kind, points, grounded=grounded)


def _filter_blades(sketch: Sketch, number: int, tip: Array) -> Iterator[Stroke]:
    """Blades of a filter, schematic: four arcs from its rim to the tip on its keystone (3,), m."""
    springs = sketch.scene.springs
    body = int(springs.upper[number])
    half = sketch.outlines[body - 1].half if body else np.full(3, 0.2 * sketch.size)
    for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        rim = np.array([x, y, 0]) * 0.85 * half + springs.upper_point[number] * (not x, not y, 1)
        root = sketch.locate(body, rim)
        rise = ALONG * (1 - ALONG) * [0.0, 0.0, 0.5 * np.linalg.norm((tip - root)[:2])]
        yield Stroke("blade", root + ALONG * (tip - root) + rise)


def _link_curves(sketch: Sketch) -> Iterator[tuple[str, Array]]:
    """Label in the scene, and line (p, 3), m, of each link given by the geometry of its wires.

    In another pose the ends follow their bodies, and the line between is interpolated.
    """
    links = [link for link in sketch.design.link if link.strands is not None]
    if not links:
        return
    places = Places.of(sketch.design)
    number = places.number
    position = sketch.scene.bodies.position
    origin = places.position
    for link in links:
        first, second = (number[name] for name in link.between)
        curve = spring_rows.link_curve(link, origin[first], origin[second])
        line = np.vstack([np.zeros(3), np.real(curve.point), np.real(curve.end)])
        line += origin[first] + np.array(link.at)
        start, end = (
            sketch.locate(body, point - position[body]) - point
            for body, point in ((first, line[0]), (second, line[-1]))
        )
        length = np.linalg.norm(np.diff(line, axis=0), axis=1).cumsum()
        part = np.append(0.0, length / length[-1])[:, None]
        yield f"{link.name}.link", line + (1 - part) * start + part * end


def mode_step(numbering: Layout, coordinate: tuple[str, ...], shape: Array) -> Array:
    """Step (N,) in the coordinates of a scene from a mode's shape (c,), by coordinate names.

    Coordinates that the mode lacks stay at rest.
    """
    moved = dict(zip(coordinate, shape, strict=True))
    return np.array([moved.get(name, 0.0) for name in numbering.name])


def amplitude(
    scene: Scene, step: Array, size: float | None = None, raised: Iterable[float] = ()
) -> float:
    """Largest factor for drawing a step (N,) that leaves the suspension recognisable.

    In a picture of a `size` in m, by default that of the suspension. `raised` are motions of
    dampers relative to the tips that carry them.
    """
    motion = step[: 6 * (len(scene.bodies.name) + 1)].reshape(-1, 6)
    wires = scene.wires
    size = suspension_size(scene) if size is None else size
    tips = np.append(step, 0.0)[layout(scene).blade]

    def end(body: Index, point: Array) -> Array:
        return motion[body, :3] + np.cross(motion[body, 3:], point)

    upper = end(wires.upper, wires.upper_point) + np.vstack([tips, np.zeros(3)])[wires.blade]
    lower = end(wires.lower, wires.lower_point)
    slope = np.linalg.norm(lower - upper, axis=-1) / np.maximum(wires.length, 0.1 * size)
    shift = np.linalg.norm(np.concatenate([motion[:, :3], upper, lower]), axis=-1) / size
    largest = (
        np.abs(motion[:, 3:]).max(initial=0.0) / LARGEST_ANGLE,
        slope.max(initial=0.0) / LARGEST_SLOPE,
        shift.max(initial=0.0) / LARGEST_SHIFT,
        np.abs(tips).max(initial=0.0) / size / LARGEST_BEND,
        max(map(abs, raised), default=0.0) / size / LARGEST_RISE,
    )
    return 1.0 / max(*largest, 1e-300)


def sketch_mode(
    rest: Sketch,
    coordinate: tuple[str, ...],
    shape: Array,
    size: float | None = None,
    phase: float = 1.0,
    *,
    of_dampers: bool = False,
) -> Sketch:
    """Displace the sketch at rest by the shape (c,) of a mode, at a phase from 1 to -1.

    In a picture of a `size`, see `amplitude`. Dampers that move far more than the bodies are drawn
    less far out, but in modes `of_dampers`, where the bodies are nearly at rest.
    """
    numbering = layout(rest.scene)
    step = mode_step(numbering, coordinate, shape)
    moved = dict(zip(coordinate, shape.tolist(), strict=True))
    raised = {
        name: moved[name]
        for label, table in zip(rest.scene.blades.label, _blade_tables(rest.design), strict=True)
        for name in names_on_tip(label, len(table.dampers))
        if name in moved
    }
    factor = amplitude(rest.scene, step, size, raised.values() if of_dampers else ())
    largest = LARGEST_RISE * (size or rest.size)
    return replace(
        rest,
        pose=displace(numbering, nominal_pose(rest.scene), phase * factor * step),
        raised={
            name: phase * min(max(factor * value, -largest), largest)
            for name, value in raised.items()
        },
    )
