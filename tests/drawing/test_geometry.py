"""What pictures are made of: outlines, where everything stands in a pose, and displacements of
imperfect designs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.analyses.modes import picture as modes
from suspension_cli.design.bodies import Body
from suspension_cli.drawing import draw, geometry
from suspension_cli.equilibrium.nominal import expand_nominal
from suspension_cli.rotations import rotation_matrix
from suspension_cli.scene.pose import displace, layout
from tests.support.pictures import SINGLE, TRIPLE, made, solved


def test_outline_of_an_inertia_is_the_box_that_has_it():
    mass, (a, b, c) = 3.0, (0.2, 0.5, 0.9)
    inertia = mass / 12 * np.diag([b**2 + c**2, a**2 + c**2, a**2 + b**2])
    assert 2 * geometry.outline(
        Body(mass=mass, inertia=[1.0, 1.0, 1.0]), mass, inertia
    ).half == pytest.approx([a, b, c])


# geometry


def lines(sketch, kind, normal=1):
    return [one.points for one in sketch.strokes(normal) if one.kind == kind]


def test_bodies_and_wires_move_as_the_shape_says():
    still = geometry.sketch_at_rest(*made(TRIPLE))
    scene, numbering = still.scene, layout(still.scene)
    step = 1e-6 * np.random.default_rng(3).normal(size=numbering.size)
    step[:6] = 0
    moved = replace(still, pose=displace(numbering, still.pose, step))
    motion, wires = step[: 6 * 4].reshape(4, 6), scene.wires
    for n, (old, new) in enumerate(zip(lines(still, "body"), lines(moved, "body"), strict=True), 1):
        arm = still.outlines[n - 1].section(1)
        assert new - old == pytest.approx(motion[n, :3] + np.cross(motion[n, 3:], arm), abs=1e-11)
    ends = np.array(lines(moved, "wire")) - lines(still, "wire")
    tips = np.append(step, 0.0)[numbering.blade]
    upper = (
        motion[wires.upper, :3]
        + np.cross(motion[wires.upper, 3:], wires.upper_point)
        + np.where(wires.blade[:, None] >= 0, tips[wires.blade], 0.0)
    )
    assert ends[:, 0] == pytest.approx(upper, abs=1e-11)
    assert ends[:, 1] == pytest.approx(
        motion[wires.lower, :3] + np.cross(motion[wires.lower, 3:], wires.lower_point), abs=1e-11
    )


def test_a_blade_bends_from_its_root_to_the_end_of_its_wire():
    still = geometry.sketch_at_rest(*made(TRIPLE))
    numbering = layout(still.scene)
    step = np.zeros(numbering.size)
    step[numbering.name.index("top.blade1.z")] = 0.01
    moved = replace(still, pose=displace(numbering, still.pose, step))
    before, after = lines(still, "blade"), lines(moved, "blade")
    assert after[0][0] == pytest.approx(before[0][0])
    wire = lines(moved, "wire")[still.scene.wires.label.index("top.1")]
    assert after[0][-1] == pytest.approx(wire[0])
    assert after[0][-1] - before[0][-1] == pytest.approx([0, 0, 0.01])
    assert all((a == b).all() for a, b in zip(after[1:], before[1:], strict=True))
    assert np.linalg.norm(before[2][-1] - before[2][0]) == pytest.approx(0.1)


def test_positive_pitch_takes_the_top_of_a_body_to_positive_x():
    design, scene, found = solved(SINGLE)
    number = [home[1] for home in found.home].index("pitch")
    rest = geometry.sketch_at_rest(design, scene)
    sketch = geometry.sketch_mode(rest, found.coordinate, found.shape[number])
    pose = sketch.pose
    corner, half = lines(sketch, "body")[0][0], sketch.outlines[0].half
    angle = float(np.arcsin(pose.rotation[1][0, 2]))
    assert 0 < angle <= geometry.LARGEST_ANGLE
    turned = rotation_matrix([0, angle, 0]) @ (half * [1, 0, 1])
    assert corner == pytest.approx(scene.bodies.position[1] + pose.shift[1] + turned)
    assert corner[0] > half[0]


def test_each_motion_is_seen_from_where_it_shows():
    _, _, found = solved(SINGLE)
    seen = {home[1]: modes.choose_view(found, n).name for n, home in enumerate(found.home)}
    assert seen == {
        "x": "side on",
        "pitch": "side on",
        "z": "side on",
        "y": "face on",
        "roll": "face on",
        "yaw": "from above",
    }


def lines_of(strokes, kind):
    return np.array([one.points for one in strokes if one.kind == kind])


def displaced(*items):
    """Lines at rest and as drawn in side view, and the factor of exaggeration."""
    design = sus.parse(SINGLE + "".join(f"\n[[perturbation]]\n{item}\n" for item in items)).design
    sketch = geometry.sketch_at_rest(design, expand_nominal(design))
    shown, factor = draw.exaggerate(sketch)
    return sketch.strokes(1), shown[1], factor


def test_displacements_are_exaggerated_by_one_factor():
    """An upper end that is off by 0.1 mm moves the body, and all is drawn as many times larger."""
    still, shown, factor = displaced('wire = "test.1"\nupper_offset = [1e-4, 0.0, 0.0]')
    moved = lines_of(shown, "wire") - lines_of(still, "wire")
    assert factor in draw.FACTORS
    assert moved[0, 0] == pytest.approx([1e-4 * factor, 0, 0], abs=1e-12)
    assert np.abs(moved[1, 0]).max() < 1e-15
    assert 0.02 < np.abs(moved).max() / 0.4 <= draw.LARGEST_SHIFT * 2


def test_pose_is_that_of_the_equilibrium():
    """Wires cut 1 mm too long lower the body by 1 mm, to first order."""
    items = [f'wire = "test.{n}"\nlength_change = 1e-3' for n in range(1, 5)]
    still, shown, factor = displaced(*items)
    drop = (lines_of(shown, "body") - lines_of(still, "body"))[0, 0] / factor
    assert drop == pytest.approx([0, 0, -1e-3 / np.cos(np.arctan(0.133 / 0.377))], rel=0.2)


def test_nothing_to_displace():
    assert displaced()[2] is None
    assert displaced('wire = "test.1"\nk_factor = 1.1')[2] is None  # trimmed to its tension


def test_drawing_says_its_factor_and_lists_the_imperfections():
    design = sus.example("imperfect").design
    figure = draw.draw(design, expand_nominal(design))
    said = [text.get_text() for text in figure.texts]
    said += [text.get_text() for axes in figure.axes for text in axes.texts]
    assert "Dimensions, to scale; imperfections 50 times larger (grey: without)" in said
    assert {"offset of the wire's upper end", "(0.3, 0, 0) mm", "(2, 0, 5) mrad"} <= set(said)
    assert said.count("1") >= 2 <= said.count("4")  # numbers of the wires, in both views
