"""Loops of many builds at once against those of each build, and against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.analyses.named_quantities import names_of
from suspension_cli.physics import (
    closed_loop_margins,
    loops_of_builds,
    margins,
    modes_with_loops,
)
from suspension_cli.quantities import solved, vocabulary
from suspension_cli.quantities.needs import Needs
from suspension_cli.quantities.solved import Solved
from suspension_cli.studies import sampling
from suspension_cli.studies.job import expand

LOOP = """
[[control.loop]]
name = "{dof}"
sensor = "test.{dof}"
actuator = "test.{force}_{dof}"
"""
SCATTERED = """
[[tolerance.wire]]
stage = "test"
upper = { normal = 0.3e-3 }
length = { normal = 1e-4 }
"""
MASS = """
[[tolerance.body]]
stage = "test"
mass = { uniform = 0.2 }
"""
LAST = """
[[tolerance.body]]
stage = "mirror"
mass = { normal = 1e-3 }
com = { normal = 1e-4 }
"""
SINGLE = sus.template("single").text
MODERATE = {
    "x": "damper = 3.0\n",
    "pitch": "gain = 20.0\nzeros = [0.0]\npoles = [[6.0, 10.0], 30.0]\n",
    "yaw": "gain = 20.0\nzeros = [0.0]\npoles = [[6.0, 10.0], 30.0]\n",
}


def loops(**settings: str) -> str:
    """Tables of loops: settings of each by its degree of freedom."""
    forces = {dof: "force" if dof in "xyz" else "torque" for dof in settings}
    return "".join(LOOP.format(dof=dof, force=forces[dof]) + own for dof, own in settings.items())


def draw(text: str, count: int, level: str, seed: int = 1) -> tuple[Solved, np.ndarray]:
    """Balance builds, and return their deviations too."""
    design = sus.parse(text).design
    scene = expand(text)
    factors = sampling.factors(design, scene)
    deviations = sampling.deviations(factors, sampling.uniforms(seed, 0, count, len(factors)))
    builds = sampling.imperfect(scene, factors, deviations)
    return solved.of_builds(builds, design, level, Needs()), deviations


def done(builds: Solved) -> int:
    """Number of builds that are done together."""
    parts = loops_of_builds.close_builds(builds.found.model, builds.designs[0])
    return sum(len(part.margins()[0]) + int((~part.poles.stable).sum()) for part in parts)


DAMPED = "[stage.damping]\nx = 0.2\ny = 0.1\nz = 0.3\nroll = 1e-3\npitch = 2e-3\nyaw = 1e-3\n\n"
LATE = {dof: own + "delay = 5e-3\n" for dof, own in MODERATE.items()}
DIGITAL = {
    "x": """filter = { design = 'zpk([0],[8;30],30,"n")', rate = 512.0 }\n""",
    "pitch": """filter = { design = 'zpk([0],[20;60],2,"n")', rate = 512.0 }\ndelay = 1e-3\n""",
    "yaw": """filter = 'zpk([0],[20;20],2,"n")'\n""",
}
CASES = {
    "estimator": (sus.example("triple-estimator").text, "beam", 3),
    "triple": (sus.example("triple-damped").text, "beam", 3),
    "dampers": (
        SINGLE.replace("[stage.wires]", DAMPED + "[stage.wires]") + loops(**MODERATE) + SCATTERED,
        "beam",
        3,
    ),
    "delays": (SINGLE + loops(**LATE) + SCATTERED, "string", 2),
    "digital": (SINGLE + loops(**DIGITAL) + SCATTERED, "string", 2),
    "tower": (sus.example("tower").text + LAST, "beam", 1),
    "massive": (SINGLE + loops(**MODERATE) + SCATTERED, "violin", 2),
}


@pytest.mark.parametrize("name", CASES)
def test_builds_have_the_margins_and_poles_of_each_alone(name):
    text, level, count = CASES[name]
    builds, _ = draw(text, count, level)
    assert done(builds) == count
    for n in range(count):
        stable, margin = closed_loop_margins.compute_margins(builds.solver(n), builds.designs[n])
        assert builds.is_stable_closed[n] == stable
        np.testing.assert_allclose(builds.margins[n], margin, rtol=1e-7)
        own = modes_with_loops.solve_modes(builds.solver(n), builds.designs[n])
        found = builds.damped_modes[n]
        assert found is not None
        np.testing.assert_allclose(found.decay_rate, own.decay_rate, rtol=1e-6)
        np.testing.assert_allclose(found.frequency, own.frequency, rtol=1e-7)
        np.testing.assert_allclose(found.fraction, own.fraction, atol=1e-7)


def test_builds_on_both_sides_of_the_limit_of_stability():
    text = sus.example("triple-damped").text.replace("gain = 1.7e3", "gain = 3.985e3")
    builds, _ = draw(text, 12, "string")
    assert done(builds) >= 10
    each = [
        closed_loop_margins.compute_margins(builds.solver(n), builds.designs[n])[0]
        for n in range(12)
    ]
    assert builds.is_stable_closed.tolist() == each
    assert 2 <= sum(each) <= 10
    assert (np.isnan(builds.margins).all((1, 2)) == ~np.array(each)).all()


def test_the_gain_margin_of_a_vertical_loop_is_that_of_its_formula():
    """L = b s / ((1 + s T)^2 m (s^2 + w^2)) is real and negative at 1 / T, if T w < 1.

    There |L| = b / (2 m T (1 / T^2 - w^2)); with |L| > 1 the loop is unstable. The loss of the
    wires, 2e-4, moves the crossing by as much.
    """
    corner = 100.0
    damper = 6745.0
    gain = damper * 2 * np.pi * corner**2
    own = f"gain = {gain}\nzeros = [0.0]\npoles = [{corner}, {corner}]\n"
    others = dict.fromkeys(("x", "y", "roll", "pitch", "yaw"), "damper = 0.5\n")
    builds, deviations = draw(SINGLE + loops(z=own, **others) + MASS, 40, "string")
    assert done(builds) == 40
    mass = 5.6 * (1 + deviations[:, 0])
    vertical = builds.fractions[:, :, 2].argmax(1)
    omega = 2 * np.pi * builds.frequency[np.arange(40), vertical]
    s = 2 * np.pi * corner
    size = damper * s / (2 * mass * (s**2 - omega**2))
    assert builds.is_stable_closed.tolist() == (size < 1).tolist()
    assert 5 < (size < 1).sum() < 35
    known = size < 1
    decibels = -20 * np.log10(size[known])
    np.testing.assert_allclose(builds.margins[known, 0, 0], decibels, rtol=1e-3, atol=3e-3)


def test_margins_of_designs_found_together_are_those_of_each():
    """The gain margin of k / ((s + a) (s + b) (s + c)) is (a + b) (b + c) (c + a) / k."""
    poles = np.array([[1.0, 2.0, 3.0], [0.5, 0.7, 9.0], [1.0, 1.0, 1.0]])

    def gain(design: np.ndarray, frequency: np.ndarray) -> np.ndarray:
        s = 2j * np.pi * frequency
        return 2.0 / np.prod(s[:, None] + poles[design], axis=1)[:, None]

    corners = [own / (2 * np.pi) for own in poles]
    found = margins.compute_margins_of_designs(gain, corners)
    for n, (a, b, c) in enumerate(poles.tolist()):
        [own] = found[n]
        assert own.gain_up == pytest.approx((a + b) * (b + c) * (c + a) / 2.0, rel=1e-10)
        [alone] = margins.compute_margins(lambda f, n=n: gain(np.full(len(f), n), f), corners[n])
        assert own == pytest.approx(alone)


def test_all_loops_have_the_smallest_margin_and_stability_needs_loops():
    design = sus.example("triple-damped")
    names = names_of(design)
    texts = "margin loops.gain", "stable", *(f"margin {loop}.gain" for loop in "xyz")
    texts += tuple(f"margin {loop}.gain" for loop in ("roll", "pitch", "yaw"))
    wanted = [vocabulary.parse(text, names, "--result") for text in texts]
    [(_, batch)] = solved.of_designs([design.design], "string", Needs.of(wanted))
    smallest, stable, *each = (float(one.values(batch)[0]) for one in wanted)
    assert stable == 1.0
    assert smallest == min(each)
    with pytest.raises(sus.InputError, match="needs loops"):
        vocabulary.parse("stable", names_of(sus.template("single")), "--result")
