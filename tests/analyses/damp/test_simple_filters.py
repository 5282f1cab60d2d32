"""Loops of one pendulum with simple filters, digital ones too, against the roots of their
characteristic equations: the whole survey is `python -m tools.loops`."""

from __future__ import annotations

import random
import warnings

import numpy as np
import pytest
from scipy.optimize import brentq

import suspension_cli as sus
from tests.support.commandline import run, strict_json
from tools import loops

SOME = random.Random(5).sample(list(loops.cases()), 10)


@pytest.mark.parametrize("case", SOME, ids=str)
def test_a_sample_of_the_survey(case):
    assert not loops.check(case).startswith("FAULT")


def distance(at, poles):
    """Estimate the relative distance of poles from roots of a function by a Newton step."""
    step = 1e-6 * np.abs(poles)
    return np.abs(at(poles) * step / (at(poles + step) - at(poles)) / poles)


def solve_yaw(text, rate, sign=1.0):
    """Poles of a loop in yaw, and its characteristic function of a real or complex s."""
    case = loops.Case("yaw", text, rate, sign)
    source = sus.parse(case.source)
    with warnings.catch_warnings(action="ignore"):
        found = sus.damp(source, fidelity="string", frequency="0.5", duration=1.0).closed
    own = [name == "test.yaw" or name.startswith("loop") for name in found.state]
    return found.value[own], loops.Reference(source, case).at


def test_a_real_pole_far_to_the_left():
    """At 300 Hz and 2048 Hz of rate: beside that of the filter, ln(z) times the rate."""
    poles, at = solve_yaw('pole(300,"n")', 2048.0)
    (fast,) = poles[poles.imag == 0].real
    exact = brentq(lambda s: float(np.real(at(s))), -2300.0, -2100.0, xtol=1e-9)
    assert fast == pytest.approx(exact, rel=1e-9)
    turn = np.tan(np.pi * 300 / 2048)
    assert fast == pytest.approx(2048 * np.log((1 - turn) / (1 + turn)), rel=1e-3)
    assert len(poles) == 2


def test_a_pole_at_half_the_sample_rate():
    """Above a quarter of the rate the pole of a real root is at a negative z."""
    poles, at = solve_yaw('pole(700,"n")', 2048.0)
    (fast,) = poles[np.abs(poles) > 100]
    turn = np.tan(np.pi * 700 / 2048)
    expected = 2048 * (np.log((turn - 1) / (1 + turn)) + 1j * np.pi)
    assert fast == pytest.approx(expected, rel=1e-3)
    assert distance(at, poles).max() < 1e-8


def test_a_delay_of_one_sample():
    """Its pole z = 0, where s is infinite, is no start; with the loop closed z is -1e-7."""
    poles, at = solve_yaw('sos(1,[0;0;1;0],"o")', 2048.0)
    assert distance(at, poles).max() < 1e-8


def test_poles_of_filters_that_the_state_space_misplaces():
    """Gain that rises up to half the rate moves them there far in w, and little in z."""
    poles, at = solve_yaw('zpk([1;2],[],1,"n")', 64.0, -1.0)
    assert len(poles) == 3
    assert distance(at, poles).max() < 1e-8


def test_a_closed_loop_without_damping_has_no_margin():
    """A pole on the imaginary axis: the sensitivity there is infinite."""
    case = loops.Case("x", 'gain(-6,"dB")', 0.0, -1.0)
    found = sus.damp(sus.parse(case.source), fidelity="string", frequency="0.5", duration=1.0)
    assert found.closed.stable
    assert found.sensitivity.size > 1e9
    assert found.margin[0].distance < 1e-9


@pytest.mark.parametrize("command", ["damp", "modes", "response", "export"])
def test_commands_with_a_digital_loop(command, tmp_path):
    file = tmp_path / "my.toml"
    file.write_text(loops.Case("yaw", 'pole(300,"n")', 2048.0, 1.0).source)
    more = {
        "damp": ["--frequency", "0.5,5", "--duration", "1", "--no-plot"],
        "response": ["--closed-loop", "--allow-unstable", "--frequency", "0.5,5", "--no-plot"],
        "modes": ["--no-plot"],
    }.get(command, [])
    result = run(command, file, "--out", tmp_path / "out", "--json", *more)
    assert result.exit_code == 0, result.stderr
    strict_json(result.stdout)
