"""What couplings on strings leave out is told: against the whole sweep on the top rung."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scenes
from commandline import run

from suspension_cli.analysis import rungs, signals
from suspension_cli.analysis.coupling import Axis, Question, Sweep
from suspension_cli.design import reader

CONFIGS = Path(__file__).parent.parent / "configs"


def job(text, body):
    known = ("support", body)
    motions = (signals.motion(f"{body}.{dof}", known) for dof in "xz")
    question = Question(0, 1, "loaded-length", signals.drive("support.z", known), *motions, (5.0, 50.0))
    return Sweep(text, (Axis("k", (0.8, 1.0, 1.2)), Axis("offset", (-1e-3, 0.0, 1e-3))), question)


def test_ends_of_the_axes_tell_what_the_whole_sweep_would():
    text = (CONFIGS / "husman2000" / "figure6.toml").read_text()
    asked = job(text, "test")
    rung, error = rungs.coupling_error(asked)
    assert rung == "violin"
    old, new = (one.compute(0, one.count)["ratio"] for one in (asked, replace(asked, level="violin")))
    assert error == pytest.approx(np.abs(old - new).max() / np.abs(new).max(), rel=0.3)
    assert 1e-4 < error < 1e-1


def test_wires_of_unknown_section():
    raw = scenes.chain(np.random.default_rng(3), 1)
    rung, error = rungs.coupling_error(job(reader.dump(scenes.plain(raw)), raw["stage"][0]["name"]))
    assert rung == ""
    assert math.isnan(error)


def test_the_command_tells(tmp_path):
    design = str(CONFIGS / "geo-silica-triple.toml")
    done = run("xcouple", design, "--sweep", "k=0.9:1.1:3,offset=-1e-3:1e-3:3", "--json", "--out", str(tmp_path))
    assert "--fidelity violin has them" in done.stderr
    found = json.loads(done.stdout)
    assert found["fidelity"] == "string"
    assert found["estimated_error"] > 0.01
    done = run("xcouple", design, "--sweep", "k=0.9:1.1:3,offset=-1e-3:1e-3:3", "--json", "--fidelity", "violin", "--out", str(tmp_path))
    assert "has them" not in done.stderr
    assert json.loads(done.stdout)["fidelity"] == "violin"
