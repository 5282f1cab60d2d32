"""Where everything of a scene stands in a pose, as points in space, and the views on it.

All functions take scenes and poses without batch axes.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from suspension_cli.design.scene import Array, Scene
from suspension_cli.design.schema import Design, Stage
from suspension_cli.mechanics.pose import Layout, Pose, displaced, layout, nominal_pose
from suspension_cli.plots.bodies import Outline, size

LARGEST_ANGLE = 0.35
"""Largest rotation in a picture of a mode, rad."""
LARGEST_SLOPE = 0.3
"""Largest motion of a wire's ends against each other, as a share of its length."""
LARGEST_SHIFT = 0.16
"""Largest motion of anything, as a share of the suspension's size."""
LARGEST_BEND = 0.06
"""Largest motion of a blade's tip on its blade, as a share of the suspension's size."""


@dataclass(frozen=True)
class View:
    """A direction to look from.

    Attributes
    ----------
    name : str
    normal : int
        The axis (0, 1, 2) along which one looks: bodies show their section across it.
    matrix : (2, 3) array
        Takes a point in space to the picture (right, up).
    scale : float
        Size of a metre in the picture.
    origin : (2,) array
        Where the suspension point stands in the picture.
    """

    name: str
    normal: int
    matrix: Array
    scale: float = 1.0
    origin: Array = field(default_factory=lambda: np.zeros(2))

    def see(self, points: Any) -> Array:
        """Points (..., 3) in space (m) as points (..., 2) in the picture."""
        return self.scale * (np.asarray(points) @ self.matrix.T) + self.origin

    def at(self, origin: Any, scale: float = 1.0) -> View:
        """The same view with its suspension point at another place of the picture, and to another scale."""
        return replace(self, origin=np.asarray(origin, dtype=float), scale=scale)


SIDE = View("side on", 1, np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]))
"""x to the right, z up."""
FACE = View("face on", 0, np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]))
"""y to the right, z up."""


def from_above(scene: Scene, outlines: list[Outline]) -> View:
    """Every body seen in plan (y to the right, x towards the reader), at its own height, so that none hides another.

    Plans are true to scale where the bodies are far enough apart in height, and flattened to half at most.
    """
    depth = 2 * max(float(body.half[0]) for body in outlines)
    gaps = np.diff(np.sort(scene.bodies.position[1:, 2]))
    # bodies side by side, or one around another, cannot be kept apart in this way
    gap = gaps[gaps > 0.3 * depth].min(initial=np.inf)
    flat = float(np.clip(gap / (1.2 * depth), 0.5, 1.0))
    return View("from above", 2, np.array([[0.0, 1.0, 0.0], [-flat, 0.0, 1.0]]))


def moved(scene: Scene, pose: Pose, body: Any, point: Any) -> Array:
    """Positions (k, 3) in space of points (k, 3) fixed in bodies (k,), m."""
    body = np.broadcast_to(np.asarray(body, dtype=np.intp), np.shape(point)[:-1])
    return scene.bodies.position[body] + pose.shift[body] + pose.arms(body, np.asarray(point, dtype=float))


def wire_ends(scene: Scene, pose: Pose) -> Array:
    """Both ends (w, 2, 3) of every wire, m; an end on a blade moves with its tip."""
    wires = scene.wires
    on_blade = (wires.blade >= 0)[:, None]
    lift = np.where(on_blade, pose.deflection[wires.blade], 0.0) if len(scene.blades.label) else 0.0
    upper = moved(scene, pose, wires.upper, wires.upper_point + lift)
    return np.stack([upper, moved(scene, pose, wires.lower, wires.lower_point)], axis=1)


def sections(scene: Scene, pose: Pose, outlines: list[Outline], view: View) -> list[Array]:
    """The closed line (p, 3) that each body shows in a view, m."""
    return [moved(scene, pose, n, body.section(view.normal)) for n, body in enumerate(outlines, 1)]


def brackets(scene: Scene, pose: Pose, outlines: list[Outline]) -> list[tuple[int, Array]]:
    """Lines (2, 3) in m from bodies (numbered from 0, without the support) to attachments that lie outside their outlines."""
    wires, held, lines = scene.wires, scene.springs, []
    free = wires.blade < 0
    body = np.concatenate([wires.lower, wires.upper[free], held.lower])
    point = np.concatenate([wires.lower_point, wires.upper_point[free], held.lower_point])
    for number, end in zip(body[body > 0] - 1, point[body > 0], strict=True):
        root = outlines[number].nearest(end)
        if np.abs(end - root).max() > 1e-9:
            lines.append((int(number), moved(scene, pose, number + 1, np.stack([root, end]))))
    return lines


def blade_lengths(design: Design) -> dict[str, float | None]:
    """The length (m) of each blade by its label in the scene; None where the design gives no geometry."""
    result: dict[str, float | None] = {}
    for stage in design.stage:
        result |= _lengths(stage)
    return result


def _lengths(stage: Stage) -> dict[str, float | None]:
    lengths = {f"{stage.name}.{blade.name}": blade.geometry.length if blade.geometry else None for blade in stage.blade}
    if stage.blades is not None:
        given = stage.blades.geometry.length if stage.blades.geometry else None
        lengths |= {f"{stage.name}.blade{number}": given for number in range(1, stage.blades.count + 1)}
    return lengths


def leaves(design: Design, scene: Scene, pose: Pose, outlines: list[Outline]) -> list[Array]:
    """Each blade as a line (m, 3) from its root to its tip, bent as a cantilever under a load at its tip, m.

    A design says where the tips are, not the roots: a blade is drawn pointing away from the middle of its body,
    with its own length where the design gives it.
    """
    blades, lengths = scene.blades, blade_lengths(design)
    along = np.linspace(0, 1, 13)[:, None]
    result = []
    for number, label in enumerate(blades.label):
        body, tip = int(blades.body[number]), blades.tip[number]
        out = np.hypot(tip[0], tip[1])
        reach = float(outlines[body - 1].half[:2].max()) if body else 0.2 * size(scene)
        direction = np.array([tip[0] / out, tip[1] / out, 0.0]) if out > 1e-6 * reach else np.array([0.0, 1.0, 0.0])
        root = tip - direction * (lengths.get(label) or (0.8 * out if out > 0.05 * reach else 0.5 * reach))
        line = root + (tip - root) * along + pose.deflection[number] * (3 * along**2 - along**3) / 2
        result.append(moved(scene, pose, body, line))
    return result


def spring_points(scene: Scene, pose: Pose) -> Array:
    """Both points (s, 2, 3) of every spring, m; they coincide in the nominal pose."""
    springs = scene.springs
    upper = moved(scene, pose, springs.upper, springs.upper_point)
    return np.stack([upper, moved(scene, pose, springs.lower, springs.lower_point)], axis=1)


def step_of(numbering: Layout, coordinate: tuple[str, ...], shape: Array) -> Array:
    """A mode's shape (N - 6,) as a step (N',) in the coordinates of a scene, by their names; others stay at rest."""
    place = {name: n for n, name in enumerate(numbering.name)}
    step = np.zeros(numbering.size)
    for name, value in zip(coordinate, shape, strict=True):
        if name in place:
            step[place[name]] = value
    return step


def amplitude(scene: Scene, step: Array) -> float:
    """The factor by which to draw a step (N,): as large as stays a picture of the suspension.

    Rotations, the slope of wires and the motion of anything each have their largest; the first one met counts.
    """
    motion = step[: 6 * (len(scene.bodies.name) + 1)].reshape(-1, 6)
    wires, whole = scene.wires, size(scene)
    numbering = layout(scene)
    tips = np.concatenate([step, [0.0]])[numbering.blade]
    upper = motion[wires.upper, :3] + np.cross(motion[wires.upper, 3:], wires.upper_point)
    upper = upper + np.where((wires.blade >= 0)[:, None], tips[wires.blade], 0.0) if len(tips) else upper
    lower = motion[wires.lower, :3] + np.cross(motion[wires.lower, 3:], wires.lower_point)
    slope = np.linalg.norm(lower - upper, axis=-1) / np.maximum(wires.length, 0.1 * whole)
    shift = np.concatenate([np.linalg.norm(part, axis=-1) for part in (motion[:, :3], upper, lower)]) / whole
    largest = [
        np.abs(motion[:, 3:]).max(initial=0.0) / LARGEST_ANGLE,
        slope.max(initial=0.0) / LARGEST_SLOPE,
        shift.max(initial=0.0) / LARGEST_SHIFT,
        np.abs(tips).max(initial=0.0) / (LARGEST_BEND * whole),
    ]
    return 1.0 / max(*largest, 1e-300)


def pose_of(scene: Scene, coordinate: tuple[str, ...], shape: Array) -> Pose:
    """The pose in which a mode is drawn: the nominal one, displaced by the mode's shape (N - 6,)."""
    numbering = layout(scene)
    step = step_of(numbering, coordinate, shape)
    return displaced(numbering, nominal_pose(scene), amplitude(scene, step) * step)
