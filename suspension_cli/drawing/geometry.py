"""Points in space of everything in a scene, in a pose, and the views on it.

All functions take scenes and poses without batch axes.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design.schema import Design
from suspension_cli.drawing.bodies import Outline, suspension_size
from suspension_cli.elements import string
from suspension_cli.scene import links
from suspension_cli.scene.arrays import Array, Index
from suspension_cli.scene.places import Places
from suspension_cli.scene.pose import Layout, Pose, displace, layout, nominal_pose
from suspension_cli.scene.scene import Scene, Springs, Wires

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

LARGEST_ANGLE = 0.35
"""Largest rotation in the picture of a mode, rad."""
LARGEST_SLOPE = 0.3
"""Largest relative motion of the two ends of a wire, as a fraction of its length."""
LARGEST_SHIFT = 0.16
"""Largest motion of anything, as a fraction of the suspension's size."""
LARGEST_BEND = 0.06
"""Largest deflection of a blade, as a fraction of the suspension's size."""


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


def from_above(scene: Scene, outlines: list[Outline]) -> View:
    """Make a view of every body in plan (y to the right, x towards the reader), at its own height.

    No body hides another. If the bodies are too close in height, plans are compressed in x, to half
    at most.
    """
    depth = 2 * max(float(body.half[0]) for body in outlines)
    gaps = np.diff(np.sort(scene.bodies.position[1:, 2]))
    # bodies side by side, or one around another, cannot be separated in this way
    gap = gaps[gaps > 0.3 * depth].min(initial=np.inf)
    flat = float(np.clip(gap / (1.2 * depth), 0.5, 1.0))
    return View("from above", 2, np.array([[0.0, 1.0, 0.0], [-flat, 0.0, 1.0]]))


def position_of(scene: Scene, pose: Pose, body: ArrayLike, point: ArrayLike) -> Array:
    """Positions (k, 3) in space of points (k, 3) fixed in bodies (k,), m."""
    body = np.broadcast_to(np.asarray(body, dtype=np.intp), np.shape(point)[:-1])
    return (
        scene.bodies.position[body]
        + pose.shift[body]
        + pose.arms(body, np.asarray(point, dtype=float))
    )


def wire_ends(scene: Scene, pose: Pose) -> Array:
    """Upper and lower end (w, 2, 3) of every wire, m; an end on a blade moves with its tip."""
    wires, now, place = scene.wires, string.state(scene, pose), scene.bodies.position + pose.shift
    ends = (place[wires.upper] + now.upper_arm, place[wires.lower] + now.lower_arm)
    return np.stack(ends, axis=1)


def sections(scene: Scene, pose: Pose, outlines: list[Outline], view: View) -> list[Array]:
    """Closed line (p, 3) that each body shows in a view, m."""
    return [
        position_of(scene, pose, n, body.section(view.normal)) for n, body in enumerate(outlines, 1)
    ]


def brackets(scene: Scene, pose: Pose, outlines: list[Outline]) -> list[tuple[int, Array]]:
    """Lines (2, 3), m, from bodies to attachments that lie outside their outlines.

    Each comes with its body's number, from 0 without the support.
    """
    wires, held, lines = scene.wires, scene.springs, []
    free = wires.blade < 0
    body = np.concatenate([wires.lower, wires.upper[free], held.lower])
    point = np.concatenate([wires.lower_point, wires.upper_point[free], held.lower_point])
    for number, end in zip(body[body > 0] - 1, point[body > 0], strict=True):
        root = outlines[number].nearest(end)
        if np.abs(end - root).max() > 1e-9:
            lines.append((int(number), position_of(scene, pose, number + 1, np.stack([root, end]))))
    return lines


def blade_lengths(design: Design) -> dict[str, float | None]:
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


def leaves(design: Design, scene: Scene, pose: Pose, outlines: list[Outline]) -> Array:
    """Line (b, 13, 3) of each blade from its root to its tip, m, bent by a load at the tip.

    A design gives only the tips: a blade points away from the middle of its body, with its true
    length where the design gives it.
    """
    blades, lengths = scene.blades, blade_lengths(design)
    along = np.linspace(0, 1, 13)[:, None]
    lines = np.zeros((len(blades.label), 13, 3))
    for number, label in enumerate(blades.label):
        body, tip = int(blades.body[number]), blades.tip[number]
        out = np.hypot(tip[0], tip[1])
        reach = 0.2 * suspension_size(scene)
        if body:
            reach = float(outlines[body - 1].half[:2].max())
        direction = np.array([0.0, 1.0, 0.0])
        if out > 1e-6 * reach:
            direction = np.array([tip[0] / out, tip[1] / out, 0.0])
        schematic = 0.8 * out if out > 0.05 * reach else 0.5 * reach
        root = tip - direction * (lengths.get(label) or schematic)
        bend = pose.deflection[number] * (3 * along**2 - along**3) / 2
        lines[number] = root + (tip - root) * along + bend
    body = np.repeat(blades.body, lines.shape[1])
    return position_of(scene, pose, body, lines.reshape(-1, 3)).reshape(lines.shape)


def legs(scene: Scene, pose: Pose) -> Array:
    """Foot and top (l, 2, 3) of every leg of an inverted pendulum, m."""
    return _ends(scene, pose, scene.struts, np.arange(len(scene.struts.label)))


def _ends(scene: Scene, pose: Pose, lines: Wires | Springs, which: Index) -> Array:
    """Upper and lower ends (k, 2, 3) of some struts or springs, m."""
    upper = position_of(scene, pose, lines.upper[which], lines.upper_point[which])
    lower = position_of(scene, pose, lines.lower[which], lines.lower_point[which])
    return np.stack([upper, lower], axis=1)


def free_springs(scene: Scene) -> Index:
    """Numbers (k,) of the springs that are drawn: all but the flexures of legs."""

    def tops(part: Wires | Springs) -> list[tuple[float, ...]]:
        ends = zip(part.lower.tolist(), part.lower_point.tolist(), strict=True)
        return [(body, *point) for body, point in ends]

    legged = set(tops(scene.struts))
    return np.flatnonzero([top not in legged for top in tops(scene.springs)])


def spring_points(scene: Scene, pose: Pose) -> Array:
    """Upper and lower point (s, 2, 3) of every spring but the flexures of legs, m.

    They coincide in the nominal pose.
    """
    return _ends(scene, pose, scene.springs, free_springs(scene))


def link_curves(design: Design, scene: Scene, pose: Pose) -> dict[str, Array]:
    """Line (p, 3) of each link given by the geometry of its wires, m, by its label in the scene.

    In another pose the ends follow their bodies, and the line between is interpolated.
    """
    result, position = {}, scene.bodies.position
    number = Places.of(design).number
    for link in design.link:
        if link.strands is None:
            continue
        first, second = (number[name] for name in link.between)
        curve = links.link_curve(link, position[first], position[second])
        line = np.vstack([np.zeros(3), np.real(curve.point), np.real(curve.end)])
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
        ends = [
            position_of(scene, pose, body, point)
            - position_of(scene, nominal_pose(scene), body, point)
            for body, point in (
                (first, np.array(link.at)),
                (second, np.array(link.at) + line[-1] + position[first] - position[second]),
            )
        ]
        part = along[:, None] / along[-1]
        start = position[first] + np.array(link.at)
        result[f"{link.name}.link"] = start + line + (1 - part) * ends[0] + part * ends[1]
    return result


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
    wires, whole = scene.wires, suspension_size(scene)
    numbering = layout(scene)
    tips = np.concatenate([step, [0.0]])[numbering.blade]
    upper = motion[wires.upper, :3] + np.cross(motion[wires.upper, 3:], wires.upper_point)
    upper = upper + np.vstack([tips, np.zeros(3)])[wires.blade]
    lower = motion[wires.lower, :3] + np.cross(motion[wires.lower, 3:], wires.lower_point)
    slope = np.linalg.norm(lower - upper, axis=-1) / np.maximum(wires.length, 0.1 * whole)
    shift = (
        np.concatenate([np.linalg.norm(part, axis=-1) for part in (motion[:, :3], upper, lower)])
        / whole
    )
    largest = [
        np.abs(motion[:, 3:]).max(initial=0.0) / LARGEST_ANGLE,
        slope.max(initial=0.0) / LARGEST_SLOPE,
        shift.max(initial=0.0) / LARGEST_SHIFT,
        np.abs(tips).max(initial=0.0) / (LARGEST_BEND * whole),
    ]
    return 1.0 / max(*largest, 1e-300)


def mode_pose(scene: Scene, coordinate: tuple[str, ...], shape: Array) -> Pose:
    """Pose in which a mode is drawn: the nominal one, displaced by the mode's shape (c,)."""
    numbering = layout(scene)
    step = mode_step(numbering, coordinate, shape)
    return displace(numbering, nominal_pose(scene), amplitude(scene, step) * step)
