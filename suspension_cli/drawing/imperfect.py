"""Imperfections of a design in a drawing: exaggerated, with the pose that they cause."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from suspension_cli.design.imperfections import Imperfection, perturbed, perturbed_part
from suspension_cli.design.paths import DISPLAYED
from suspension_cli.design.schema import Design, Perturbation
from suspension_cli.drawing import geometry
from suspension_cli.drawing.bodies import suspension_size
from suspension_cli.drawing.canvas import Canvas
from suspension_cli.drawing.dimensions import write_note
from suspension_cli.drawing.geometry import View
from suspension_cli.drawing.parts import Sketch
from suspension_cli.drawing.style import INK
from suspension_cli.equilibrium import nominal
from suspension_cli.equilibrium import solve as equilibrium
from suspension_cli.rotations import rotation_matrix, rotation_minus_identity, rotation_vector
from suspension_cli.scene.arrays import Array
from suspension_cli.scene.pose import Pose
from suspension_cli.scene.scene import Scene

LARGEST_SHIFT = 0.1
"""Largest displacement in a drawing, as a fraction of the suspension's size."""
LARGEST_ANGLE = 0.3
"""Largest rotation in a drawing, rad."""
THICK = 2.0
"""Width of a wire with imperfections, points."""
LABEL = 0.75
"""Place of its number along a wire, from its upper end."""
FACTORS = tuple(m * 10.0**n for n in range(-2, 9) for m in (1, 2, 5))
"""Factors of exaggeration; below 1 where imperfections are larger than a drawing can show."""
NOTHING = 1e-12
"""Displacement over the suspension's size, or rotation in rad, below which nothing is drawn."""


@dataclass(frozen=True)
class Exaggerated:
    """A suspension with imperfections.

    Attributes
    ----------
    sketch
        Displaced ends of wires, bodies shifted and turned, all `factor` times.
    factor
        1, 2 or 5 times a power of ten.
    """

    sketch: Sketch
    factor: float


def exaggerate(sketch: Sketch) -> Exaggerated | None:
    """Displace a suspension by its imperfections, times the factor that shows them well.

    A point at n in the nominal design, and at p in the equilibrium of the imperfect one, is drawn
    at n + f (p - n), with one factor f for all; rotation vectors are multiplied by f. The `sketch`
    is without imperfections, at rest. None if nothing is displaced.
    """
    if not sketch.design.perturbation:
        return None
    whole = sketch.scene
    actual = nominal.expand(sketch.design)
    change = _change_of_pose(whole, actual)
    turns = _turns(sketch.design, whole)
    outer = _displaced(sketch, actual, change, turns, 1.0)
    shift = np.abs(_places(outer) - _places(sketch)).max() / suspension_size(whole)
    angle = max(np.abs(turns).max(), np.abs(rotation_vector(change.turn)).max())
    if max(shift, angle) < NOTHING:
        return None
    largest = min(LARGEST_SHIFT / max(shift, NOTHING), LARGEST_ANGLE / max(angle, NOTHING))
    factor = max((one for one in FACTORS if one <= largest), default=FACTORS[0])
    return Exaggerated(_displaced(sketch, actual, change, turns, factor), factor)


def draw_marks(canvas: Canvas, view: View, flawed: Exaggerated, order: float) -> None:
    """Draw the wires that have imperfections as thick lines, each with its number."""
    sketch = flawed.sketch
    labels, ends = sketch.scene.wires.label, geometry.wire_ends(sketch.scene, sketch.pose)
    for name in dict.fromkeys(item.wire for item in sketch.design.perturbation if item.wire):
        line = view.see(ends[labels.index(name)])
        canvas.line(line, INK, THICK, order)
        place = line[0] + LABEL * (line[1] - line[0])
        write_note(canvas, place, name.rpartition(".")[2])


def describe(design: Design) -> list[tuple[str, str, str]]:
    """List the imperfections of a design: part, quantity, value with its unit."""
    rows = []
    for item in design.perturbation:
        part, name = perturbed_part(item)
        for kind in perturbed(part):
            value = getattr(item, kind.name)
            if value is not None:
                rows.append((name, _quantity(kind), _value(kind, value)))
        if item.wire is not None and item.hold == "natural-length":
            rows.append((item.wire, "unstretched length", "as designed, not trimmed"))
    return rows


def _quantity(kind: Imperfection) -> str:
    return f"factor on {kind.quantity}" if kind.relative else kind.quantity


def _value(kind: Imperfection, value: float | tuple[float, ...]) -> str:
    if kind.relative:
        return f"{value:.6g}"
    unit, per = DISPLAYED[kind.unit]
    numbers = [f"{per * one:.4g}" for one in np.atleast_1d(value)]
    text = f"({', '.join(numbers)})" if len(numbers) > 1 else numbers[0]
    return f"{text} {unit}".replace("-", "−")


def _change_of_pose(whole: Scene, actual: Scene) -> Pose:
    """Equilibrium of an imperfect scene relative to that without imperfections."""
    before, after = equilibrium.solve(whole), equilibrium.solve(actual)
    if not (before.converged and after.converged):
        after = before
    first, second = before.pose, after.pose
    turned = second.rotation @ np.swapaxes(first.rotation, -1, -2) - np.eye(3)
    return Pose(second.shift - first.shift, turned, second.deflection - first.deflection)


def _turns(design: Design, scene: Scene) -> Array:
    """Rotation vector (n, 3) of the mass of each body relative to its attachments, rad."""
    result = np.zeros((len(scene.bodies.name), 3))
    for item in design.perturbation:
        if item.body in scene.bodies.name and _rotation(item) is not None:
            result[scene.bodies.name.index(item.body)] += _rotation(item)
    return result


def _rotation(item: Perturbation) -> tuple[float, float, float] | None:
    return getattr(item, "rotation", None)


def _displaced(sketch: Sketch, actual: Scene, change: Pose, turns: Array, factor: float) -> Sketch:
    """Displace a sketch `factor` times as far as the imperfections do."""

    def between(before: Array, after: Array) -> Array:
        return before + factor * (after - before)

    whole = sketch.scene
    bodies, wires, blades, springs = whole.bodies, whole.wires, whole.blades, whole.springs
    scene = replace(
        whole,
        bodies=replace(bodies, position=between(bodies.position, actual.bodies.position)),
        wires=replace(
            wires,
            upper_point=between(wires.upper_point, actual.wires.upper_point),
            lower_point=between(wires.lower_point, actual.wires.lower_point),
        ),
        blades=replace(blades, tip=between(blades.tip, actual.blades.tip)),
        springs=replace(
            springs,
            upper_point=between(springs.upper_point, actual.springs.upper_point),
            lower_point=between(springs.lower_point, actual.springs.lower_point),
        ),
    )
    pose = Pose(
        factor * change.shift,
        rotation_minus_identity(factor * rotation_vector(change.turn)),
        factor * change.deflection,
    )
    turned = [
        replace(body, turn=rotation_matrix(factor * turn)) if turn.any() else body
        for body, turn in zip(sketch.outlines, turns, strict=True)
    ]
    return replace(sketch, scene=scene, pose=pose, outlines=turned)


def _places(sketch: Sketch) -> Array:
    """Ends of all wires and centres of mass (k, 3), m."""
    scene, pose = sketch.scene, sketch.pose
    centres = scene.bodies.position + pose.shift
    return np.concatenate([geometry.wire_ends(scene, pose).reshape(-1, 3), centres])
