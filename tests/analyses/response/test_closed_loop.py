"""`pendsus response --closed-loop`: against a body on springs by hand, and its refusals."""

from __future__ import annotations

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.files.hdf5 import open_results
from suspension_cli.linear.response import Response
from tests.support import scenes
from tests.support.commandline import assert_refused, document, run, written

LOOP = {
    "name": "x",
    "sensor": "test.x",
    "actuator": "test.force_x",
    "filter": 'zpk([0],[5;3+i*4;3-i*4],1,"n")',
    "gain_at": {"frequency": 0.7, "magnitude": 40.0},
    "delay": 0.02,
    "sensor_response": 'pole(9,"n")',
}
MASS, LENGTH = 3.0, 0.7
FORCE = ("--fidelity", "force", "--no-plot")


def design_of(**changes):
    stage = scenes.hung({"count": 1, "l": LENGTH, "k": 1e5}, MASS, 0.1)
    return scenes.plain(scenes.raw_of(stage, control={"loop": [LOOP | changes]}))


def loop_force(f):
    """H(f) with sensor and delay, written out from the formulas of the planes."""

    def shape(f):
        return 1j * f / ((1 + 1j * f / 5) * (1 + 1j * f / (3 + 4j)) * (1 + 1j * f / (3 - 4j)))

    whole = 40.0 / abs(shape(0.7)) * shape(f) * np.exp(-2j * np.pi * f * 0.02)
    return whole / (1 + 1j * f / 9)


@pytest.mark.parametrize("reference", ["support", "inertial"])
def test_a_pendulum_by_hand(reference, tmp_path):
    file = written(tmp_path, design_of(reference=reference))
    grid = ("--frequency", "0.1:50:41", "--input", "support.x", "--input", "test.force_x")
    answer = document("response", file, "--closed-loop", *grid, *FORCE, "--out", tmp_path)
    assert answer["closed_loop"] is True
    f = np.array(answer["frequency_hz"])
    h, spring = loop_force(f), MASS * 9.81 / LENGTH
    below = spring - MASS * (2 * np.pi * f) ** 2 + h
    follows = spring + (h if reference == "support" else 0)
    for one, expected in zip(answer["responses"], (follows / below, 1 / below), strict=True):
        found = np.array(one["real"]) + 1j * np.array(one["imag"])
        np.testing.assert_allclose(found, expected, rtol=1e-10)
    (stored,) = tmp_path.glob("*-response.h5")
    with open_results(stored) as results:
        assert results["response"].attrs["closed_loop"]
    assert isinstance(sus.load(stored), Response)
    assert sus.load(stored).closed_loop


def test_text_and_peak(tmp_path):
    """The largest response, between the points of the grid."""
    file = written(tmp_path, design_of())
    grid = ("--frequency", "0.3:3:5", "--out", tmp_path)
    result = run("response", file, "--closed-loop", *grid, *FORCE)
    assert "loops closed: x" in result.stdout
    f = np.linspace(0.3, 3, 200001)
    h, spring = loop_force(f), MASS * 9.81 / LENGTH
    size = np.abs((spring + h) / (spring - MASS * (2 * np.pi * f) ** 2 + h))
    assert f"largest {size.max():.4g} at" in result.stdout


def test_an_unstable_loop_is_refused(tmp_path):
    file = written(tmp_path, design_of(delay=0.4))
    (line,) = assert_refused(run("response", file, "--closed-loop", *FORCE), file, tmp_path / "no")
    assert "control: the closed loop is unstable" in line
    assert "--allow-unstable" in line
    allowed = ("--closed-loop", "--allow-unstable", "--out", tmp_path / "out", *FORCE)
    result = run("response", file, *allowed)
    assert result.exit_code == 0
    assert "unstable" in result.stderr


def test_a_design_without_loops(tmp_path):
    raw = design_of()
    del raw["control"]
    file = written(tmp_path, raw)
    (line,) = assert_refused(run("response", file, "--closed-loop", *FORCE), file, tmp_path / "no")
    assert line.startswith("control: missing; add [[control.loop]]")
