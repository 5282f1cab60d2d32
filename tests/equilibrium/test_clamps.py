"""Clamps of wires of which the design gives the effective bending points."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from suspension_cli.equilibrium import solve as equilibrium
from suspension_cli.equilibrium.hanging import hang
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.errors import InputError
from suspension_cli.linear import eigenmodes, response
from suspension_cli.linear.signals import parse_input, parse_output
from suspension_cli.models import registry
from suspension_cli.scene.pose import layout
from suspension_cli.scene.scene import stack_scenes
from suspension_cli.studies import builds
from tests.support.scenes import design_of, raw_of

MASS, GRAVITY, MODULUS, RADIUS = 4.0, 9.81, 2.1e11, 2e-4
TENSION = MASS * GRAVITY / 4
REACH = np.sqrt(MODULUS * np.pi * RADIUS**4 / 4 / TENSION)
"""Distance from a clamp to the effective bending point, sqrt(E I / T), m."""
STIFFNESS = 1e5


def frequencies(level, clamp, *perturbation):
    """Modes of a body on four vertical wires, whose ends are the bending points or the clamps."""
    beyond = 0.0 if clamp == "bending-point" else REACH
    own = {"material": "hard", "radius": RADIUS, "k": STIFFNESS, "clamp": clamp}
    wires = [
        {"upper": [x, y, beyond], "lower": [x, y, 5e-3 - beyond]} | own
        for x in (-0.02, 0.02)
        for y in (-0.05, 0.05)
    ]
    body = {"mass": MASS, "inertia": [0.01, 0.012, 0.014]}
    stage = {"name": "test", "body": body, "position": [0.0, 0.0, -0.305], "wire": wires}
    hard = {"youngs_modulus": MODULUS, "poisson_ratio": 0.3, "density": 7800.0}
    raw = raw_of(stage, materials={"hard": hard}, perturbation=list(perturbation))
    return eigenmodes.solve(registry.by_name(level).system(design_of(raw))).frequency


@pytest.mark.parametrize("level", ["beam", "violin"])
@pytest.mark.parametrize(
    "error",
    [
        {"length_change": 2e-5},
        {"length_change": -4e-5},
        {"k_factor": 1.1},
        {"upper_offset": [0.0, 0.0, 2e-5], "hold": "natural-length"},
    ],
    ids=["longer", "shorter", "stiffer", "raised"],
)
def test_imperfections_do_not_move_clamps(level, error):
    """A wire too long pulls less: its bending point moves, its clamps stay where they are.

    So builds of a design that gives the bending points are those of one that gives the clamps.
    """
    error = {"wire": "test.1", **error}
    known = frequencies(level, "wire", error)
    np.testing.assert_allclose(frequencies(level, "bending-point", error), known, rtol=2e-7)
    assert np.abs(known / frequencies(level, "wire") - 1).max() > 1e-6


# Designs of given natural lengths

BODIES = ("support", "test")
SHIFTS = {
    "aside": (0.01, -0.004, 0.0),
    "higher": (0.0, 0.0, 0.004),  # wires are slack as drawn
    "lower": (0.002, 0.0, -0.015),
}
FEET = ((0.05, 0.01), (-0.03, 0.04), (-0.025, -0.045))
LOPSIDED, MIRRORED = "lopsided", "mirrored"
LAYERS = {"sections": [{"radius": 5e-4, "length": 0.01}, {"radius": RADIUS}]}


def as_built(kind, shift=(0.0, 0.0, 0.0), perturbation=(), **wire):
    """A body on wires of given natural lengths and bending points, drawn anywhere."""
    return design_of(tables_as_built(kind, shift, perturbation, **wire))


def tables_as_built(kind, shift=(0.0, 0.0, 0.0), perturbation=(), **wire):
    mirrored = kind == MIRRORED
    feet = [(x, y) for x in (-0.02, 0.02) for y in (-0.05, 0.05)] if mirrored else FEET
    lean = (0.7, 0.8) if mirrored else (0.9, 0.8)
    own = {"material": "hard", "clamp": "bending-point"}
    own |= ({} if "sections" in wire else {"radius": RADIUS}) | wire
    rows = [
        {
            "upper": [lean[0] * x, lean[1] * y, 0.0],
            "lower": [x, y, 0.005],
            "natural_length": 0.3 if mirrored else 0.3 + 4e-4 * n,
        }
        | own
        for n, (x, y) in enumerate(feet)
    ]
    material = {"youngs_modulus": 3e9, "poisson_ratio": 0.3, "density": 1200.0, "loss_angle": 0.01}
    position = (np.array([0.0, 0.0, -0.31]) + shift).tolist()
    body = {"mass": 0.2, "inertia": [3e-4, 4e-4, 5e-4]}
    return raw_of(
        {"name": "test", "body": body, "position": position, "wire": rows},
        materials={"hard": material},
        constants={"wire_weight": "sections" in wire},
        perturbation=list(perturbation),
    )


def results(level, design):
    """Frequencies of modes, and responses in units of the largest."""
    model = registry.by_name(level).system(design)
    inputs = [parse_input(f"support.{dof}", BODIES) for dof in ("x", "yaw")]
    outputs = [parse_output(f"test.{dof}", BODIES) for dof in ("x", "pitch", "z")]
    found = response.solve(model, np.array([0.2, 3.0, 60.0]), inputs, outputs).value
    return eigenmodes.solve(model.constant).frequency, found / np.abs(found).max((-1, -2))[
        :, None, None
    ]


WRONG = {"wire": "test.1", "length_change": 1e-5, "hold": "natural-length"}
TRIMMED = {"wire": "test.1", "k_factor": 1.2, "upper_offset": [1e-3, 0.0, 2e-4]}
MOVED = {"body": "test", "com_offset": [1e-3, 2e-3, 0.0]}


@pytest.mark.parametrize(
    ("kind", "wire", "level"),
    [
        (LOPSIDED, {}, "violin"),
        (MIRRORED, {}, "beam"),
        (LOPSIDED, LAYERS, "beam"),
        (LOPSIDED, {"clamp": "wire"}, "string"),
        (MIRRORED, {"clamp": "wire", "bending": "hinged"}, "string"),
    ],
    ids=["lopsided", "mirrored", "layers with weight", "strings", "hinged strings"],
)
def test_results_do_not_depend_on_the_drawn_pose(kind, wire, level):
    """Nor do tensions of trimmed wires, and hinges."""
    for errors in ([], [WRONG], [MOVED, TRIMMED]):
        known = results(level, as_built(kind, perturbation=errors, **wire))
        for shift in SHIFTS.values():
            found = results(level, as_built(kind, shift, errors, **wire))
            np.testing.assert_allclose(found[0], known[0], rtol=1e-9)
            np.testing.assert_allclose(found[1], known[1], rtol=1e-9, atol=1e-12)


def test_slack_strings_of_a_batch():
    """No bending point of a slack wire: the build fails, and says which wire."""
    slack = as_built(MIRRORED)
    slack.stage[0].wire[2] = msgspec.structs.replace(slack.stage[0].wire[2], natural_length=0.31)
    designs = [as_built(MIRRORED), slack]
    found = builds.balance(stack_scenes([expand(one) for one in designs]), designs[0], level="beam")
    assert found.status.tolist() == [builds.GOOD, builds.SLACK]
    assert found.wire[1] in (1, 2)
    with pytest.raises(InputError, match=r"wire test\.[23] is slack"):
        registry.by_name("beam").system(slack)


@pytest.mark.parametrize("level", ["beam", "violin"])
def test_hanging_clamps_keep_the_symmetry(level):
    model = registry.by_name(level).system(as_built(MIRRORED, SHIFTS["higher"]))
    inputs = [parse_input("support.x", BODIES)]
    outputs = [parse_output(f"test.{dof}", BODIES) for dof in ("y", "roll", "yaw")]
    assert not response.solve(model, np.array([1.0]), inputs, outputs).value.any()


def test_hinged_strings_as_they_hang_are_beams():
    """But for exp(-l / u), with the torsion given to both, and beams drawn as they hang."""
    wire = {"clamp": "wire", "bending": "hinged", "torsion": 1e-9}
    hangs = equilibrium.solve(expand(as_built(MIRRORED, clamp="wire"))).pose.shift[1]
    found, _ = results("string", as_built(MIRRORED, SHIFTS["aside"], **wire))
    expected, _ = results("beam", as_built(MIRRORED, hangs, **wire))
    np.testing.assert_allclose(found, expected, rtol=1e-7)


def test_trimming_needs_a_pose():
    adrift = as_built(LOPSIDED, (0.0, 0.0, 5.0), [TRIMMED])
    with pytest.raises(InputError, match="no equilibrium found"):
        expand(adrift)


def test_a_saddle_that_two_ways_lead_to_is_not_sought_a_third_time(monkeypatch):
    """Two strings that end below the centre of mass do not hold its pitch."""
    raw = tables_as_built(MIRRORED)
    stage = raw["stage"][0]
    stage["wire"] = stage["wire"][:2]
    for wire, y in zip(stage["wire"], (-0.02, 0.02), strict=True):
        wire["upper"] = [0.0, y, 0.0]
        wire["lower"] = [0.0, y, -0.02]
    stage["position"] = [0.0, 0.0, -0.28]
    scene = expand(design_of(raw))
    taken = []
    whole = equilibrium._continue

    def counted(*given):
        taken.append(given[-1])
        return whole(*given)

    monkeypatch.setattr(equilibrium, "_continue", counted)
    found = hang(scene).found
    assert found.converged
    assert not equilibrium._is_stable(scene, layout(scene), found)
    assert taken == [equilibrium.STEPS[0]]
