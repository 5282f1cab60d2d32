"""Lines in space that a drawing of a suspension shows, in a pose, and the views on them.

All functions take scenes and poses without batch axes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design.schema import Body, Design
from suspension_cli.scene import links
from suspension_cli.scene.arrays import Array, Index
from suspension_cli.scene.links import Places
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
LARGEST_BEND = 0.06
"""Largest deflection of a blade, as a fraction of the suspension's size."""
SMALLEST = 0.012
"""Least half extent of a body that can be seen, relative to the size of the suspension."""
FILTER_BLADES = ".blades"
"""End of the label of the spring that stands for the blades of a filter."""
ROUND = 97
"""Points on a circle, the first one included twice."""


@dataclass(frozen=True)
class View:
    """Projection of points in space onto a picture.

    Attributes
    ----------
    normal
        The axis (0, 1, 2) of the line of sight: bodies show their section across it.
    matrix : (2, 3) array
        From a point in space to the picture (right, up).
    scale
        Length of a metre in the picture.
    origin : (2,) array
        Of the suspension point in the picture.
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
ABOVE = View("from above", 2, np.array([[0.0, 1.0, 0.0], [-0.5, 0.0, 1.0]]))
"""y to the right, x towards the reader at half scale; each body at its own height."""


@dataclass(frozen=True)
class Outline:
    """Shape of a body in its own frame, with the COM at the origin.

    Attributes
    ----------
    half : (3,) array
        Half extents along x, y, z, m.
    axis
        The axis (0, 1, 2) of a cylinder; None for a box.
    inner
        Radius of a cylinder's bore, m.
    turn : (3, 3) array
        Rotation matrix from the shape to the frame of the body.
    """

    half: Array
    axis: int | None = None
    inner: float = 0.0
    turn: Array = field(default_factory=lambda: np.eye(3))

    def section(self, normal: int) -> Array:
        """Section of the body through its COM, across the axis `normal` (0, 1, 2).

        A closed line (p, 3), m: a circle across the axis of a cylinder, else a rectangle.
        """
        first, second = (axis for axis in range(3) if axis != normal)
        if self.axis == normal:
            angle = np.linspace(0, 2 * np.pi, ROUND)
            u, v = np.cos(angle), np.sin(angle)
        else:
            u, v = np.array([1.0, -1.0, -1.0, 1.0, 1.0]), np.array([1.0, 1.0, -1.0, -1.0, 1.0])
        line = np.zeros((len(u), 3))
        line[:, first], line[:, second] = u * self.half[first], v * self.half[second]
        return line @ self.turn.T

    def nearest(self, point: ArrayLike) -> Array:
        """Points (..., 3) of the body nearest to given points (..., 3), in its frame, m."""
        point = np.asarray(point, dtype=float) @ self.turn
        result = np.clip(point, -self.half, self.half)
        if self.axis is not None:
            across = [axis for axis in range(3) if axis != self.axis]
            distance = np.linalg.norm(point[..., across], axis=-1, keepdims=True)
            inside = self.half[across[0]] / np.maximum(distance, 1e-300)
            result[..., across] = point[..., across] * np.minimum(1.0, inside)
        return result @ self.turn.T


def outline(
    body: Body, mass: float, inertia: Float[np.ndarray, "3 3"], least: float = 0.0
) -> Outline:
    """Outline of one body, with half extents of at least `least`, m.

    The cylinder or box of the design; for a body given by its inertia (3, 3), kg m^2 about the COM,
    the homogeneous box of the same mass (kg) and moments, Lx^2 = 6 (Iy + Iz - Ix) / m, or 0 where
    that is negative.
    """
    if body.shape == "box":
        assert body.size is not None
        return Outline(np.maximum(np.array(body.size) / 2, least))
    if body.shape == "cylinder":
        assert body.radius is not None and body.length is not None
        axis = "xyz".index(body.axis or "x")
        half = np.full(3, max(body.radius, least))
        half[axis] = max(body.length / 2, least)
        return Outline(half, axis, body.inner_radius or 0.0)
    moments = np.diagonal(np.asarray(inertia, dtype=float))
    squares = np.maximum(6 * (moments.sum() - 2 * moments) / mass, 0.0)
    return Outline(np.maximum(np.sqrt(squares) / 2, least))


def outlines(design: Design, scene: Scene) -> list[Outline]:
    """Outlines of all bodies of a scene, large enough to be seen."""
    bodies = scene.bodies
    least = SMALLEST * suspension_size(scene)
    return [
        outline(stage.body, float(m), i, least)
        for stage, m, i in zip(design.stage, bodies.mass, bodies.inertia, strict=True)
    ]


def suspension_size(scene: Scene) -> float:
    """Size of a suspension, m.

    The largest of its height, half its width and the radius of gyration of its bodies.
    """
    position = scene.bodies.position
    ends = wire_ends(scene, nominal_pose(scene)).reshape(-1, 3)
    extent = np.ptp(np.concatenate([position, ends]), axis=0) * (0.5, 0.5, 1.0)
    gyration = np.sqrt(np.trace(scene.bodies.inertia, axis1=-2, axis2=-1) / scene.bodies.mass)
    return float(max(extent.max(), gyration.max()))


def position_of(scene: Scene, pose: Pose, body: ArrayLike, point: ArrayLike) -> Array:
    """Positions (k, 3) in space of points (k, 3) fixed in bodies (k,), m."""
    body = np.broadcast_to(np.asarray(body, dtype=np.intp), np.shape(point)[:-1])
    centre = scene.bodies.position[body] + pose.shift[body]
    return centre + pose.arms(body, np.asarray(point, dtype=float))


@dataclass(frozen=True)
class Stroke:
    """A line (p, 3) in space, m.

    `kind` is "body", "blade", "spring", "damper" or a key of `parts.WIDTHS`; `body` is the number
    of a body from 0, `grounded` whether a spring stands on the ground. Springs have their two ends,
    and before them the middle of the body that holds them, if they are not on the ground.
    """

    kind: str
    points: Array
    body: int = 0
    grounded: bool = False


@dataclass(frozen=True)
class Sketch:
    """A suspension in one pose, to be drawn in any view.

    Attributes
    ----------
    scene
        Without batch axes.
    thick
        Thickness of the support, m.
    """

    design: Design
    scene: Scene
    outlines: list[Outline]
    pose: Pose
    thick: float = 0.0
    _strokes: dict[int, list[Stroke]] = field(init=False, repr=False, default_factory=dict)

    @cached_property
    def size(self) -> float:
        """Size of the suspension, m."""
        return suspension_size(self.scene)

    @cached_property
    def leaves(self) -> Array:
        """Line (b, 13, 3) of each blade from its root to its tip, m; see `leaves`."""
        return leaves(self)

    def strokes(self, normal: int) -> list[Stroke]:
        """All lines in a view along an axis, except the support; the order is that of the scene."""
        if normal not in self._strokes:
            self._strokes[normal] = [*_bodies(self, normal), *_attachments(self)]
        return self._strokes[normal]

    def points(self, view: View) -> Array:
        """Points (k, 2) in a view of everything that is drawn, except the support."""
        return view.see(np.concatenate([one.points for one in self.strokes(view.normal)]))


def sketch_at_rest(design: Design, scene: Scene, thick: float = 0.0) -> Sketch:
    """Make the sketch of a design at rest; the support's thickness is relative to its size."""
    size = suspension_size(scene)
    return Sketch(design, scene, outlines(design, scene), nominal_pose(scene), thick * size)


def _bodies(sketch: Sketch, normal: int) -> Iterator[Stroke]:
    """Sections of bodies, and the bores of cylinders."""
    for n, body in enumerate(sketch.outlines):
        section = position_of(sketch.scene, sketch.pose, n + 1, body.section(normal))
        yield Stroke("body", section, n)
        if body.axis == normal and body.inner:
            ratio = body.inner / float(np.max(np.delete(body.half, normal)))
            middle = section[:-1].mean(0)
            yield Stroke("bore", middle + ratio * (section - middle), n)


def _attachments(sketch: Sketch) -> Iterator[Stroke]:
    """Everything that holds bodies, and brackets from bodies to attachments outside them.

    A bracket has no length where the attachment is on the body.
    """
    scene, pose = sketch.scene, sketch.pose
    wires, held = scene.wires, scene.springs
    free = wires.blade < 0
    body = np.concatenate([wires.lower, wires.upper[free], held.lower])
    point = np.concatenate([wires.lower_point, wires.upper_point[free], held.lower_point])
    body, point = body[body > 0], point[body > 0]
    roots = [sketch.outlines[n - 1].nearest(end) for n, end in zip(body, point, strict=True)]
    start = position_of(scene, pose, body, np.reshape(roots, (-1, 3)))
    lines = np.stack([start, position_of(scene, pose, body, point)], axis=1)
    for n, line in zip(body.tolist(), lines, strict=True):
        yield Stroke("bracket", line, n - 1)
    yield from (Stroke("wire", line) for line in wire_ends(scene, pose))
    yield from (Stroke("blade", line) for line in sketch.leaves)
    yield from (Stroke("leg", line) for line in _ends(scene, pose, scene.struts))
    yield from _springs(sketch)
    number = Places.of(sketch.design).number
    for cavity in sketch.design.cavity:
        ends = np.array([number[name] for name in cavity.between])
        yield Stroke("light", position_of(scene, pose, ends, np.zeros((2, 3))))


def wire_ends(scene: Scene, pose: Pose) -> Array:
    """Upper and lower end (w, 2, 3) of every wire, m; an end on a blade moves with its tip."""
    tips = np.vstack([pose.deflection, np.zeros(3)])[scene.wires.blade]
    return _ends(scene, pose, scene.wires, tips)


def leaves(sketch: Sketch) -> Array:
    """Line (b, 13, 3) of each blade from its root to its tip, m, bent by a load at the tip.

    A design gives only the tips: a blade points away from the middle of its body, with its true
    length where the design gives it.
    """
    scene, blades, lengths = sketch.scene, sketch.scene.blades, _blade_lengths(sketch.design)
    along = np.linspace(0, 1, 13)[:, None]
    lines = np.zeros((len(blades.label), 13, 3))
    for number, (label, body) in enumerate(zip(blades.label, blades.body.tolist(), strict=True)):
        tip = blades.tip[number]
        reach = float(sketch.outlines[body - 1].half[:2].max()) if body else 0.2 * sketch.size
        out = float(np.hypot(tip[0], tip[1]))
        direction = np.array([0.0, 1.0, 0.0])
        if out > 1e-6 * reach:
            direction = np.array([tip[0] / out, tip[1] / out, 0.0])
        schematic = 0.8 * out if out > 0.05 * reach else 0.5 * reach
        root = tip - direction * (lengths[label] or schematic)
        bend = sketch.pose.deflection[number] * (3 * along**2 - along**3) / 2
        lines[number] = position_of(scene, sketch.pose, body, root + (tip - root) * along + bend)
    return lines


def _blade_lengths(design: Design) -> dict[str, float | None]:
    """Length (m) of each blade by its label in the scene; None where the design gives none."""
    result: dict[str, float | None] = {}
    for stage in design.stage:
        blades = {blade.name: blade.geometry for blade in stage.blade}
        if stage.blades is not None:
            names = (f"blade{number}" for number in range(1, stage.blades.count + 1))
            blades = dict.fromkeys(names, stage.blades.geometry)
        for name, given in blades.items():
            result[f"{stage.name}.{name}"] = given.length if given else None
    return result


def _ends(scene: Scene, pose: Pose, lines: Wires | Springs, moved: Array | float = 0.0) -> Array:
    """Upper and lower ends (k, 2, 3) of wires, struts or springs, m.

    `moved` is by how much upper ends have moved in their bodies.
    """
    upper = position_of(scene, pose, lines.upper, lines.upper_point + moved)
    lower = position_of(scene, pose, lines.lower, lines.lower_point)
    return np.stack([upper, lower], axis=1)


def free_springs(scene: Scene) -> Index:
    """Numbers (k,) of the springs that are drawn: all but the flexures of legs."""

    def tops(part: Wires | Springs) -> list[tuple[float, ...]]:
        ends = zip(part.lower.tolist(), part.lower_point.tolist(), strict=True)
        return [(body, *point) for body, point in ends]

    legged = set(tops(scene.struts))
    return np.flatnonzero([top not in legged for top in tops(scene.springs)])


def _springs(sketch: Sketch) -> Iterator[Stroke]:
    """Springs, dampers and links of curved wires; the ends of springs coincide at rest."""
    scene, pose, springs = sketch.scene, sketch.pose, sketch.scene.springs
    curves, ends = dict(_link_curves(sketch)), _ends(scene, pose, springs)
    for n in free_springs(scene).tolist():
        label, body, grounded = springs.label[n], int(springs.upper[n]), bool(springs.grounded[n])
        if label in curves:
            yield Stroke("link", curves[label], grounded=grounded)
            continue
        if label.endswith(FILTER_BLADES):
            yield from _filter_leaves(sketch, n, ends[n, 1])
            continue
        held = position_of(scene, pose, body, np.zeros(3))
        if body == 0:
            held = np.array([*ends[n, 0, :2], held[2]])
        points = ends[n] if grounded else np.vstack([held, ends[n]])
        kind = "damper" if label.endswith(".damper") else "spring"
        yield Stroke(kind, points, grounded=grounded)


def _filter_leaves(sketch: Sketch, number: int, tip: Array) -> Iterator[Stroke]:
    """Blades of a filter, schematic: four arcs from its rim to the tip on its keystone (3,), m."""
    body = int(sketch.scene.springs.upper[number])
    along = np.linspace(0, 1, 13)[:, None]
    for axis, sign in product((0, 1), (1.0, -1.0)):
        rim = sketch.scene.springs.upper_point[number].copy()
        rim[axis] = sign * 0.85 * sketch.outlines[body - 1].half[axis]
        root = position_of(sketch.scene, sketch.pose, body, rim)
        rise = along * (1 - along) * [0.0, 0.0, 0.5 * np.linalg.norm((tip - root)[:2])]
        yield Stroke("blade", root + along * (tip - root) + rise)


def _link_curves(sketch: Sketch) -> Iterator[tuple[str, Array]]:
    """Label in the scene, and line (p, 3), m, of each link given by the geometry of its wires.

    In another pose the ends follow their bodies, and the line between is interpolated.
    """
    scene, number = sketch.scene, Places.of(sketch.design).number
    position, rest = scene.bodies.position, nominal_pose(sketch.scene)
    for link in sketch.design.link:
        if link.strands is None:
            continue
        first, second = (number[name] for name in link.between)
        curve = links.link_curve(link, position[first], position[second])
        line = np.vstack([np.zeros(3), np.real(curve.point), np.real(curve.end)])
        line += position[first] + np.array(link.at)
        moved = [
            position_of(scene, sketch.pose, body, end - position[body])
            - position_of(scene, rest, body, end - position[body])
            for body, end in ((first, line[0]), (second, line[-1]))
        ]
        length = np.linalg.norm(np.diff(line, axis=0), axis=1).cumsum()
        part = np.append(0.0, length / length[-1])[:, None]
        yield f"{link.name}.link", line + (1 - part) * moved[0] + part * moved[1]


def mode_step(numbering: Layout, coordinate: tuple[str, ...], shape: Array) -> Array:
    """Step (N,) in the coordinates of a scene from a mode's shape (c,), by coordinate names.

    Coordinates that the mode lacks stay at rest.
    """
    moved = dict(zip(coordinate, shape, strict=True))
    return np.array([moved.get(name, 0.0) for name in numbering.name])


def amplitude(scene: Scene, step: Array) -> float:
    """Largest factor for drawing a step (N,) that leaves the suspension recognisable.

    Rotations, slopes of wires, deflections of blades and motions have limits (`LARGEST_...`).
    """
    motion = step[: 6 * (len(scene.bodies.name) + 1)].reshape(-1, 6)
    wires, size = scene.wires, suspension_size(scene)
    tips = np.append(step, 0.0)[layout(scene).blade]
    upper, lower = (
        motion[body, :3] + np.cross(motion[body, 3:], point)
        for body, point in ((wires.upper, wires.upper_point), (wires.lower, wires.lower_point))
    )
    upper = upper + np.vstack([tips, np.zeros(3)])[wires.blade]
    slope = np.linalg.norm(lower - upper, axis=-1) / np.maximum(wires.length, 0.1 * size)
    shift = np.linalg.norm(np.concatenate([motion[:, :3], upper, lower]), axis=-1) / size
    limits = (
        (motion[:, 3:], LARGEST_ANGLE),
        (slope, LARGEST_SLOPE),
        (shift, LARGEST_SHIFT),
        (tips / size, LARGEST_BEND),
    )
    largest = [np.abs(values).max(initial=0.0) / limit for values, limit in limits]
    return 1.0 / max(*largest, 1e-300)


def mode_pose(scene: Scene, coordinate: tuple[str, ...], shape: Array) -> Pose:
    """Pose in which a mode is drawn: the nominal one, displaced by the mode's shape (c,)."""
    numbering = layout(scene)
    step = mode_step(numbering, coordinate, shape)
    return displace(numbering, nominal_pose(scene), amplitude(scene, step) * step)
