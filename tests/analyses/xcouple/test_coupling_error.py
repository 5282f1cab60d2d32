"""What couplings on strings leave out is told: against the whole sweep on the top rung."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import h5py
import numpy as np
import pytest

from suspension_cli.analyses.xcouple import model_error
from suspension_cli.analyses.xcouple.solve import CouplingRequest, Sweep
from suspension_cli.design import reader
from suspension_cli.linear import signals
from suspension_cli.studies.axes import Axis
from tests.support import scenes
from tests.support.commandline import run
from tests.support.paths import CONFIGS


def job(text, body):
    known = ("support", body)
    motions = (signals.parse_output(f"{body}.{dof}", known) for dof in "xz")
    question = CouplingRequest(
        0, 1, "loaded-length", signals.parse_input("support.z", known), *motions, (5.0, 50.0)
    )
    return Sweep(text, (Axis("k", (0.8, 1.0, 1.2)), Axis("offset", (-1e-3, 0.0, 1e-3))), question)


def test_ends_of_the_axes_tell_what_the_whole_sweep_would():
    text = (CONFIGS / "husman2000" / "figure6.toml").read_text()
    asked = job(text, "test")
    rung, error = model_error.estimate_coupling_error(asked)
    assert rung == "violin"
    old, new = (
        one.compute(0, one.count)["ratio"] for one in (asked, replace(asked, level="violin"))
    )
    assert error == pytest.approx(np.abs(old - new).max() / np.abs(new).max(), rel=0.3)
    assert 1e-4 < error < 1e-1


def test_wires_of_unknown_section():
    raw = scenes.chain(np.random.default_rng(3), 1)
    rung, error = model_error.estimate_coupling_error(
        job(reader.write_toml(scenes.plain(raw)), raw["stage"][0]["name"])
    )
    assert rung == ""
    assert math.isnan(error)


def test_the_command_tells(tmp_path):
    design = str(CONFIGS / "geo-silica-triple.toml")
    done = run(
        "xcouple",
        design,
        "--sweep",
        "k=0.9:1.1:3,offset=-1e-3:1e-3:3",
        "--json",
        "--out",
        str(tmp_path),
    )
    assert "rerun with --fidelity violin" in done.stderr
    found = json.loads(done.stdout)
    assert found["fidelity"] == "string"
    assert found["estimated_error"] > 0.01
    done = run(
        "xcouple",
        design,
        "--sweep",
        "k=0.9:1.1:3,offset=-1e-3:1e-3:3",
        "--json",
        "--fidelity",
        "violin",
        "--out",
        str(tmp_path),
    )
    assert "has them" not in done.stderr
    assert json.loads(done.stdout)["fidelity"] == "violin"


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


def test_builds_that_hang_on_strings_alone_tell_nothing():
    rung, error = model_error.estimate_coupling_error(job(ROD, "test"))
    assert rung == "violin"
    assert math.isnan(error)


def test_no_coupling_on_either_is_no_error():
    asked = job((CONFIGS / "husman2000" / "table1-case3.toml").read_text(), "test")
    assert model_error.estimate_coupling_error(
        replace(asked, axes=(Axis("mass", (0.9, 1.1)),))
    ) == (
        "violin",
        0.0,
    )


def test_the_command_says_what_it_does_not_know(tmp_path):
    design = tmp_path / "rod.toml"
    design.write_text(ROD)
    done = run(
        "xcouple",
        str(design),
        "--sweep",
        "k=0.9:1.1:3,offset=-1e-3:1e-3:3",
        "--json",
        "--out",
        str(tmp_path),
    )
    assert (
        "is not known, as not all builds at the ends of the axes have an equilibrium in both"
        " models; rerun with --fidelity violin" in done.stderr
    )
    assert json.loads(done.stdout)["estimated_error"] is None
    with h5py.File(tmp_path / "rod-xcouple.h5") as results:
        assert "in the string or the violin model" in results.attrs["fidelity_reason"]


def test_the_command_names_what_the_higher_rung_has(tmp_path):
    """Without a density there is no mass of wires to leave out; a change of several hundred per
    cent is written out."""
    design = tmp_path / "rod.toml"
    design.write_text(
        ROD.replace("8e-3", "3e-3").replace('"c70steel"', '"mine"')
        + "[materials.mine]\nyoungs_modulus = 2e11\npoisson_ratio = 0.3\n"
    )
    done = run(
        "xcouple",
        str(design),
        "--sweep",
        "k=0.9:1.1:3,offset=-1e-3:1e-3:3",
        "--json",
        "--out",
        str(tmp_path),
    )
    warned = next(line for line in done.stderr.splitlines() if "rerun with" in line)
    assert (
        "wire bending changes these couplings by" in warned
        and "mass" not in warned
        and "e+" not in warned
    )


GRID = "k=0.9:1.1:3,offset=-1e-3:1e-3:3"


def test_a_tolerance_decides(tmp_path):
    """Without one the sweep is on strings; with one, on what keeps to it."""
    design = CONFIGS / "geo-silica-triple.toml"
    loose, close, asked = (
        json.loads(
            run("xcouple", design, "--sweep", GRID, "--json", "--out", tmp_path, *words).stdout
        )
        for words in (("--tolerance", "1"), ("--tolerance", "0.05"), ("--fidelity", "violin"))
    )
    assert (loose["fidelity"], close["fidelity"]) == ("string", "violin")
    assert 0.05 < loose["estimated_error"] < 1.0 and close["estimated_error"] == 0.0
    assert close["ratio_real"] == asked["ratio_real"] and close["ratio_imag"] == asked["ratio_imag"]
    old, new = (
        np.array(one["ratio_real"]) + 1j * np.array(one["ratio_imag"]) for one in (loose, close)
    )
    assert np.abs(old - new).max() / np.abs(new).max() == pytest.approx(
        loose["estimated_error"], rel=0.3
    )


def test_a_requested_model_reports_its_error(tmp_path):
    """As much as if `auto` had taken it, without a warning; less with wires that bend."""
    words = ("xcouple", CONFIGS / "double.toml", "--sweep", "k=0.9:1.1:3", "--json", "--no-plot")
    done = {
        level: run(*words, "--out", tmp_path, "--fidelity", level)
        for level in ("auto", "string", "beam", "violin")
    }
    error = {level: json.loads(one.stdout)["estimated_error"] for level, one in done.items()}
    assert error["string"] == error["auto"] > error["beam"] > 0.0
    assert error["violin"] == 0.0
    assert "warning" not in done["string"].stderr


def test_the_matrix_tells_too(tmp_path):
    design = CONFIGS / "imperfect.toml"
    plain, close = (
        json.loads(run("xcouple", design, "--matrix", "--json", "--out", tmp_path, *words).stdout)
        for words in ((), ("--tolerance", "1e-4"))
    )
    assert plain["fidelity"] == "string" and plain["estimated_error"] > 1e-4
    assert close["fidelity"] == "violin" and close["estimated_error"] == 0.0
    exact = json.loads(
        run(
            "xcouple", design, "--matrix", "--json", "--out", tmp_path, "--fidelity", "violin"
        ).stdout
    )
    assert close["matrix_real"] == exact["matrix_real"]
