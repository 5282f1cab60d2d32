"""Starts of searches for gains of loops by velocity damping.

A mass m with the damper c in a loop on its own motion has Q = m omega/c at omega = sqrt(g/l). With
the roll-off H = g i f / (i f + p), the damper at omega is Im H / omega = g p / (2 pi (p^2 + f^2)).
"""

from __future__ import annotations

import math

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.analyses.optimise.evaluator import Evaluator
from suspension_cli.analyses.optimise.free_numbers import FreeDesign
from suspension_cli.analyses.optimise.search import FEASIBLE, Search
from suspension_cli.analyses.optimise.velocity_damping import ModalDamping, find_start
from suspension_cli.design.goals import Free, Goals, QuantityRequirement
from tests.support.commandline import written

MASS = 2.0
LENGTH = 0.5
OMEGA = math.sqrt(9.81 / LENGTH)
LOOP = """
[[control.loop]]
name = "x"
sensor = "test.x"
actuator = "test.force_x"
"""
PENDULUM = f"""
[design]
name = "one"

[[stage]]
name = "test"
body = {{ mass = {MASS}, inertia = [0.01, 0.01, 0.01] }}
wires = {{ count = 4, l = {LENGTH}, s = 0.03, t1 = 0.1, t2 = 0.1, d = 0.0, k = 1e6 }}
{LOOP}"""
DAMPER = PENDULUM + "damper = 0.1\n"
ROLL_OFF = PENDULUM + "gain = 0.1\nzeros = [0.0]\npoles = [3.0]\n"


def evaluator_of(text: str, number: str, upper: float, quantity: str, **limit) -> Evaluator:
    wanted = Goals(
        free=[Free(name=f"control.loop.x.{number}", lower=1e-3, upper=upper, scale="log")],
        requirement=[QuantityRequirement(quantity=quantity, **limit)],
    )
    return Evaluator.of(FreeDesign.of(text, wanted), sus.parse(text))


@pytest.mark.parametrize("q", [1.0, 8.0, 50.0])
def test_one_mode_has_the_damper_of_its_quality_factor(q):
    evaluator = evaluator_of(DAMPER, "damper", 100.0, "Q of test x", at_most=5.0)
    fraction = ModalDamping.of(evaluator, [0]).solve(q)
    damper = 1e-3 + (100.0 - 1e-3) * fraction[0]
    assert damper == pytest.approx(MASS * OMEGA / q, rel=1e-9)


def test_a_filter_damps_by_its_phase_at_the_mode():
    evaluator = evaluator_of(ROLL_OFF, "gain", 1e4, "Q of test x", at_most=5.0)
    fraction = ModalDamping.of(evaluator, [0]).solve(8.0)
    gain = 1e-3 + (1e4 - 1e-3) * fraction[0]
    hertz = OMEGA / (2 * np.pi)
    damper = gain * 3.0 / (2 * np.pi * (3.0**2 + hertz**2))
    assert damper == pytest.approx(MASS * OMEGA / 8.0, rel=1e-9)


def test_the_start_is_the_largest_quality_factor_that_meets_the_goals():
    """Without an objective the nearest design counts: of Q = 1, 2 and 4 the least damper."""
    search = Search(evaluator_of(DAMPER, "damper", 100.0, "Q of test x", at_most=5.0))
    start = find_start(search, search.point(search.freed.begin))
    assert start.quality_factor == 4.0
    value = search.freed.values(start.point.fraction)["control.loop.x.damper"]
    assert value == pytest.approx(MASS * OMEGA / 4.0, rel=1e-9)


def test_goals_that_are_met_or_concern_no_loop_have_no_such_start():
    for quantity, limit in (("Q of test x", {"at_most": 1e4}), ("test x", {"at_least": 5.0})):
        search = Search(evaluator_of(DAMPER, "damper", 100.0, quantity, **limit))
        assert find_start(search, search.point(search.freed.begin)) is None


UNSTABLE = """
requirement = [
    { quantity = "margin x.phase", at_least = 60.0 },
    { quantity = "Q of test x", at_most = 5.0 },
]

[[free]]
name = "control.loop.x.damper"
lower = -20.0
upper = 20.0
"""


def test_an_optimum_from_a_file_with_an_unstable_loop(tmp_path):
    """A negative damper makes the pendulum swing up, so the file's own number has no margin."""
    design = sus.parse(DAMPER).replace({"control.loop.x.damper": -1.0})
    found = sus.optimise(design, written(tmp_path, UNSTABLE, "goals.toml"), starts=1)
    assert found.met
    assert found.numbers.after[0] == pytest.approx(MASS * OMEGA / 5.0, rel=1e-3)
    assert found.starts.origin == ("file", "velocity damping (Q = 4)")
    assert np.isnan(found.starts.before[0]) and found.starts.place.tolist() == [0, 1]
    assert "it was found from velocity damping (Q = 4)" in str(found)


def test_without_gains_to_choose_an_unstable_start_is_refused(tmp_path):
    design = sus.parse(ROLL_OFF).replace({"control.loop.x.gain": -1.0})
    poles = UNSTABLE.replace("x.damper", "x.poles.1").replace("-20.0", "1.0")
    goals = written(tmp_path, poles, "goals.toml")
    with pytest.raises(sus.InputError, match="no finite value in the starting design"):
        sus.optimise(design, goals, starts=1)


def test_a_triple_with_a_hundredfold_gain():
    """It makes the yaw loop unstable; the damped start meets the goals."""
    text = sus.example("triple-damped").replace({"control.loop.yaw.gain": 1.7e5}).text
    limits = (
        QuantityRequirement(quantity="settling of upper yaw", at_most=5.0),
        QuantityRequirement(quantity="margin yaw.phase", at_least=30.0),
    )
    free = Free(name="control.loop.yaw.gain", lower=1.0, upper=1e6, scale="log")
    wanted = Goals(free=[free], requirement=list(limits))
    search = Search(Evaluator.of(FreeDesign.of(text, wanted), sus.parse(text)))
    own = search.point(search.freed.begin)
    start = find_start(search, own)
    assert own is None
    assert start.point.worst <= FEASIBLE
