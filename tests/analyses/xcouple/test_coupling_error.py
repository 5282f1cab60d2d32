"""Errors of couplings in each model against whole sweeps in the most complete one, and the choice
that follows from them."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import h5py
import numpy as np
import pytest

from suspension_cli.analyses import model_choice
from suspension_cli.analyses.xcouple.solve import CouplingRequest, Sweep, coupling_change
from suspension_cli.design import reader
from suspension_cli.design.reader import Source
from suspension_cli.linear import signals
from suspension_cli.models import registry
from suspension_cli.models.choice import ONE_MODEL_ONLY
from suspension_cli.studies.job import Axis
from tests.support.commandline import run
from tests.support.paths import CONFIGS

GRID = "k=0.9:1.1:3,offset=-1e-3:1e-3:3"


def job(text, body):
    known = ("support", body)
    motions = (signals.parse_output(f"{body}.{dof}", known) for dof in "xz")
    question = CouplingRequest(
        0, 1, "loaded-length", signals.parse_input("support.z", known), *motions, (5.0, 50.0)
    )
    k, offset = np.linspace(0.8, 1.2, 7), np.linspace(-1e-3, 1e-3, 5)
    return Sweep(text, (Axis("k", tuple(k)), Axis("offset", tuple(offset))), question)


def choice_for(requested, wanted="auto", tolerance=1e-3):
    source = Source(reader.parse(requested.text), requested.text, "")
    change = coupling_change(requested)
    return model_choice.for_builds(source, wanted, registry.SCENE_MODELS, change, tolerance)


def test_corners_and_middles_give_the_error_of_the_whole_sweep():
    requested = job((CONFIGS / "husman2000" / "figure6.toml").read_text(), "test")
    old, new = (
        replace(requested, level=level).compute(0, requested.count)["ratio"]
        for level in ("string", "violin")
    )
    choice = choice_for(requested, "string")
    assert choice.error == pytest.approx(np.abs(old - new).max() / np.abs(new).max(), rel=0.3)
    assert 1e-4 < choice.error < 1e-1
    assert choice_for(requested, tolerance=1.001 * choice.error).level == "string"
    assert choice_for(requested, tolerance=0.999 * choice.error).level == "beam"
    assert choice_for(requested, tolerance=1e-12).level == "violin"


def test_the_default_is_what_the_couplings_need(tmp_path):
    """To the tolerance: relative to the largest coupling."""
    design = CONFIGS / "geo-silica-triple.toml"
    found = {
        words: json.loads(
            run("xcouple", design, "--sweep", GRID, "--json", "--out", tmp_path, *words).stdout
        )
        for words in (
            (),
            ("--tolerance", "1"),
            ("--tolerance", "0.05"),
            ("--fidelity", "string"),
            ("--fidelity", "violin"),
        )
    }
    default, loose, medium, strings, exact = found.values()
    levels = [one["fidelity"] for one in (default, loose, medium)]
    assert levels == ["violin", "string", "beam"]
    assert default["estimated_error"] == 0.0 < medium["estimated_error"] < 0.05
    assert 0.05 < loose["estimated_error"] == strings["estimated_error"] < 1.0
    assert default["ratio_real"] == exact["ratio_real"]
    assert loose["ratio_real"] == strings["ratio_real"]
    old, new = (
        np.array(one["ratio_real"]) + 1j * np.array(one["ratio_imag"]) for one in (loose, exact)
    )
    assert np.abs(old - new).max() / np.abs(new).max() == pytest.approx(
        loose["estimated_error"], rel=0.3
    )


ROD = """
[design]
name = "rod"
[[stage]]
name = "test"
body = { mass = 2.0, inertia = [0.0147, 0.0117, 0.011] }
[stage.wires]
count = 4
l = 0.4
s = 0.02
t1 = 0.1
t2 = 0.1
d = 0.001
material = "c70steel"
radius = 8e-3
"""
"""Rods of 8 mm: bending lifts the weight off some of them in every build whose ends are 1 mm
off."""


def test_builds_that_hang_on_strings_alone(tmp_path):
    """No finite error of strings: `auto` takes what shows that they do not hang."""
    choice = choice_for(job(ROD, "test"), "string")
    assert math.isinf(choice.error)
    design = tmp_path / "rod.toml"
    design.write_text(ROD)
    words = ("xcouple", design, "--sweep", GRID, "--json", "--out", tmp_path)
    done = run(*words, "--fidelity", "string")
    found = json.loads(done.stdout)
    assert found["estimated_error"] is None
    assert ONE_MODEL_ONLY in found["error_unknown"]
    with h5py.File(tmp_path / "rod-xcouple.h5") as results:
        assert ONE_MODEL_ONLY in results.attrs["fidelity_reason"]
    assert registry.by_name(json.loads(run(*words).stdout)["fidelity"]).bends_wires


def test_the_tolerance_that_no_model_meets():
    """Without a density there is no wire mass; the reason says that its effect is unknown."""
    text = (
        ROD.replace("8e-3", "3e-3").replace('"c70steel"', '"mine"')
        + "[materials.mine]\nyoungs_modulus = 2e11\npoisson_ratio = 0.3\n"
    )
    choice = choice_for(job(text, "test"))
    assert choice.level == "beam" and math.isnan(choice.error)
    assert "unknown: wire mass, as wire test.1 is of mine, which has no density" in choice.line
