"""`pendsus damp`: JSON, results file, warnings and refusals."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.text import Text

import suspension_cli as sus
from suspension_cli.design import foton
from tests.support import plants
from tests.support.commandline import run, written
from tests.support.foton import written_response

DAMPERS = {"x": 20.0, "y": 20.0, "z": 30.0, "roll": 0.2, "pitch": 0.05, "yaw": 0.2}

QUICK = ("--fidelity", "force")
FOTON = 'zpk([0],[-20;-10+i*17;-10-i*17],3e6,"f")'


def damped(dofs=tuple(DAMPERS), **changes):
    """The template triple with dampers on its upper mass, by default six."""
    loops = [
        {
            "name": f"loop-{dof}",
            "sensor": f"upper.{dof}",
            "actuator": f"upper.{'force' if dof in 'xyz' else 'torque'}_{dof}",
            "damper": value,
        }
        | {"sensor_noise": 1e-10}
        for dof, value in DAMPERS.items()
        if dof in dofs
    ]
    loops[0] |= changes
    return plants.raw("triple") | {"control": {"loop": loops}}


def test_the_loops_that_are_drawn():
    found = sus.damp(sus.parse(sus.example("triple-damped").text), fidelity="string")

    def drawn(**setting):
        texts = [text.get_text() for text in found.plot(**setting).findobj(Text)]
        assert "others closed" in texts
        return next(text for text in texts if text.startswith("loop gain of"))

    assert drawn() == "loop gain of the 3 most critical of 6 loops"
    assert drawn(loops=["yaw"]) == "loop gain of 1 of 6 loops"


def test_foton_strings_beside_the_results(tmp_path):
    """A line per loop, read back to the same response."""
    raw = damped(("x", "z"), damper=None, filter=FOTON, delay=1e-3)
    del raw["control"]["loop"][0]["damper"]
    file = written(tmp_path, raw)
    few = ("--frequency", "1,2", "--duration", "1")
    result = run("damp", file, "--foton", "--no-plot", "--out", tmp_path / "out", *few, *QUICK)
    assert result.exit_code == 0, result.stderr
    (text,) = [path.read_text() for path in (tmp_path / "out").glob("*-foton.txt")]
    strings = [line for line in text.splitlines() if line and not line.startswith("#")]
    assert "# not included: delay of 0.001 s" in text
    first, second = (foton.parse(one) for one in strings)
    assert first.at(3.0) == pytest.approx(
        foton.parse(raw["control"]["loop"][0]["filter"]).at(3.0), rel=1e-12
    )
    assert second.at(3.0) == pytest.approx(2j * np.pi * 3.0 * DAMPERS["z"], rel=1e-12)
    for one in (first, second):
        text = foton.format_filter(one)
        assert written_response(text, 3.0) == pytest.approx(one.at(3.0), rel=1e-12)
        assert written_response(text, 3.0, 16384.0) == pytest.approx(one.at(3.0), rel=2e-3)
    assert "ms" in result.stdout
    assert "dB" in result.stdout
    assert "All loops at once" in result.stdout
