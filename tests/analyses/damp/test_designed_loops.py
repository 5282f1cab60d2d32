"""`pendsus damp --design lqg`: filters that are found for the loops of a design."""

from __future__ import annotations

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.analyses.damp import designed_loops
from suspension_cli.errors import InputError
from tests.support.commandline import run, strict_json
from tests.support.paths import CONFIGS

DESIGN = CONFIGS / "triple-damped.toml"
LIGHT = ("--fidelity", "string", "--frequency", "1,10", "--duration", "1")


@pytest.fixture(scope="module")
def found():
    return sus.damp(
        DESIGN,
        method="lqg",
        redesigned=["y", "roll", "yaw"],
        settling=12.0,
        sensitivity=2.5,
        fidelity="string",
        frequency=[1.0, 10.0],
        duration=1.0,
    )


def test_modes_settle_and_margins_are_kept(found):
    """By the poles and margins of the whole design, not by those of the search."""
    assert found.stable
    moved = np.array([not name.startswith("loop") for name in found.closed.state])
    low = moved & (found.closed.frequency < 10)
    sideways = np.array([".yaw" in name or ".y" in name for name in found.closed.state])
    assert (-1 / np.real(found.closed.value[low & sideways])).max() < 12 * (1 + 1e-6)
    names = list(found.loop)
    for one in found.designed:
        margin = found.margin[names.index(one.redesigned)]
        assert margin.distance > 1 / 2.5 * (1 - 1e-3)
        assert one.poles <= 20


def test_noise_of_one_loop_is_that_of_its_table(found):
    """The noise of the loop found last, over that of its sensor."""
    last = found.designed[-1]
    again = sus.damp(
        found.run.design, output=last.output, frequency=[10.0], duration=1.0, fidelity="string"
    )
    noise = again.noise[0, again.sensor.index(last.redesigned)]
    assert noise == pytest.approx(1e-9 * last.noise, rel=1e-3)


def test_noise_through_the_response_of_a_sensor():
    """The noise of a sensor is a motion, and reaches the loop through its response."""
    low_pass = {"control.loop.yaw.sensor_response": 'pole(5,"n")'}
    design = sus.read(DESIGN).replace(low_pass)
    how = {"fidelity": "string", "frequency": [10.0], "duration": 1.0, "output": "test.yaw"}
    found = sus.damp(
        design, method="lqg", redesigned=["yaw"], settling=20.0, sensitivity=2.5, **how
    )
    [one] = found.designed
    noise = found.noise[0, found.sensor.index("yaw")]
    assert noise == pytest.approx(1e-9 * one.noise, rel=1e-3)


def test_the_design_with_the_loops_is_written(tmp_path):
    how = ("--design", "lqg", "--redesign", "yaw", "--settling", "12", "--json")
    result = run("damp", DESIGN, *LIGHT, *how, "--out", tmp_path)
    assert result.exit_code == 0
    [row] = strict_json(result.stdout)["designed"]
    assert row["redesigned"] == "yaw"
    text = (tmp_path / "triple-damped-lqg.toml").read_text()
    assert "# docs/control.md explains this file." in text
    written = sus.read(tmp_path / "triple-damped-lqg.toml")
    loop = written.control.loop[-1]
    assert loop.name == "yaw"
    assert sum(2 if isinstance(root, list) else 1 for root in loop.poles) == row["poles"]
    plain = sus.read(DESIGN)
    assert written.control.loop[:-1] == plain.control.loop[:-1]
    again = run("damp", tmp_path / "triple-damped-lqg.toml", *LIGHT, "--json", "--out", tmp_path)
    first, second = (strict_json(one.stdout)["poles"] for one in (result, again))
    assert first == second


def test_a_computed_sensor_is_refused():
    with pytest.raises(InputError, match="a sensor that is computed, or that has a response"):
        sus.damp(
            CONFIGS / "triple-estimator.toml",
            method="lqg",
            redesigned=["yaw"],
            fidelity="string",
            frequency=[1.0],
            duration=1.0,
        )


REQUIRED = [
    {"quantity": "margin yaw.phase", "at_least": 60.0},
    {"quantity": "margin yaw.distance", "at_least": 0.7},
    {"quantity": "settling of upper yaw", "at_most": 12.0},
    {"quantity": "noise test.yaw:10", "at_most": 1e-14},
    {"quantity": "settling of test z", "at_most": 1.0},
    {"quantity": "lowest pitch", "at_least": 0.1},
]


def test_requirements_decide():
    """The quietest filter has 44 degrees of phase margin, and 0.55 of distance. Requirements that
    this loop does not move (the last two) do not matter for it; `check` computes the same."""
    how = {"method": "lqg", "redesigned": ["yaw"], "frequency": [10.0], "duration": 1.0}
    plain = sus.read(DESIGN)
    quietest = sus.damp(plain, settling=12.0, sensitivity=2.5, fidelity="string", **how)
    margin = quietest.margin[quietest.loop.index("yaw")]
    assert margin.phase < 60
    assert margin.distance < 0.7
    wanted = plain.replace({"requirement": REQUIRED, "analysis.budget.ground": ["aligo-isi"]})
    found = sus.damp(wanted, fidelity="beam", **how)
    # 1/0.7 is a limit of the search, too
    [one] = found.designed
    assert one.sensitivity < 1 / 0.7
    assert [row.met for row in found.required] == [True, True, True, True, False]
    again = {one.requirement.description: one for one in sus.check(found.run.design).verdicts}
    for row in found.required:
        assert row.value == pytest.approx(again[row.requirement].value, rel=1e-6)
        assert row.margin == pytest.approx(again[row.requirement].margin, rel=1e-6)


def test_requirements_that_no_filter_meets_are_reported(tmp_path):
    """The search takes the filter that comes nearest, and says so."""
    required = '\n[[requirement]]\nquantity = "margin yaw.phase"\nat_least = 89.0\n'
    design = tmp_path / "strict.toml"
    design.write_text(DESIGN.read_text() + required)
    how = ("--design", "lqg", "--redesign", "yaw", "--settling", "12")
    result = run("damp", design, *LIGHT, *how, "--out", tmp_path)
    assert result.exit_code == 0, result.stderr
    assert "NOT met" in result.stdout
    assert "margin yaw.phase >= 89 deg" in result.stdout
    assert (tmp_path / "triple-damped-lqg.toml").exists()


def test_filters_are_closed_again_as_they_are_sampled(monkeypatch):
    """At 7 Hz, unlike the rate of a front end, they would drive modes near 3 Hz."""
    monkeypatch.setattr(designed_loops, "RATE", 7.0)
    wanted = {"method": "lqg", "redesigned": ["yaw"], "settling": 12.0, "fidelity": "string"}
    with pytest.raises(InputError, match="sampled at 7 Hz"):
        sus.damp(DESIGN, frequency=[1.0], duration=1.0, **wanted)
