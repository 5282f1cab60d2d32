"""`pendsus response`: its JSON, grids, refusals, exact zeros, and the largest value, which lies at
the pole whatever the grid."""

from __future__ import annotations

import re

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.analyses.response import solve
from suspension_cli.design.reader import read
from suspension_cli.linear import eigenmodes
from tests.support import plants, scenes
from tests.support.commandline import assert_refused, document, run, written
from tests.support.paths import CONFIGS


def response_of(file, out, *options):
    """The JSON document of a run that went well."""
    return document("response", file, "--out", out, *options)


@pytest.mark.parametrize(
    ("grid", "values"),
    [
        ("2.5", [2.5]),
        ("1e-3,4,2", [1e-3, 4.0, 2.0]),
        ("1:100:3", [1.0, 10.0, 100.0]),
        ("1:100:3:log", [1.0, 10.0, 100.0]),
        ("1:100:3:lin", [1.0, 50.5, 100.0]),
        ("7:9:1", [7.0]),
        ("10:1:2", [10.0, 1.0]),
    ],
)
def test_grids(grid, values, tmp_path):
    words = ("--frequency", grid, "--fidelity", "force")
    found = response_of(CONFIGS / "double.toml", tmp_path, *words)["frequency_hz"]
    assert found == pytest.approx(values, rel=1e-14)


@pytest.mark.parametrize(
    ("d", "section", "way"),
    [
        (-0.0008, True, "take --fidelity beam"),
        (-0.005, True, "attach the wires higher above the COM"),
        (-0.0008, False, "attach the wires higher above the COM"),
    ],
)
def test_refusal_names_the_beam_model_where_bending_restrains(tmp_path, d, section, way):
    """Strings tip over 0.35 mm below the COM here, wires that bend 1 mm lower: only between the
    two, and where sections are known, does beam help."""
    wires = {"count": 4, "l": 0.28, "s": 5e-4, "t1": 0.0965, "t2": 0.0965, "d": d}
    wires |= {"material": "steel302", "radius": 1e-4} if section else {"k": 1.9e4}
    body = {"mass": 5.6, "inertia": [0.0227, 0.016, 0.016]}
    one = written(
        tmp_path,
        {"design": {"name": "soft"}, "stage": [{"name": "test", "body": body, "wires": wires}]},
    )
    out = tmp_path / "out"
    options = ("response", one, "--out", out, "--no-plot", "--frequency", "1")
    (line,) = assert_refused(run(*options, "--fidelity", "string"), one, out)
    assert way in line and line.endswith("or give --allow-unstable")
    if section:
        assert (run(*options, "--fidelity", "beam").exit_code == 0) == ("beam" in way)


def test_on_a_lossless_resonance(tmp_path):
    """The response is infinite there, which is no number: reported, not written. Loss or a hair's
    breadth make it finite."""
    stage = scenes.hung({"count": 1, "l": 0.5, "k": 100.0}, 1.0, 0.1)
    one = written(tmp_path, {"design": {"name": "one"}, "stage": [stage]})
    modes, out = sus.modes(sus.read(one), fidelity="force"), tmp_path / "out"
    frequency = modes.frequency[modes.label.index("test vertical")].item()
    pair = ("--input", "support.z", "--output", "test.z", "--fidelity", "force", "--frequency")
    words = ("response", one, "--json", "--out", out, *pair, repr(frequency))
    (line,) = assert_refused(run(*words), one, out)
    assert "resonance" in line
    response_of(one, out, *pair, repr(frequency * (1 + 1e-9)))
    response_of(one, out, *pair, repr(frequency), "--set", "stage.test.damping.z=0.1")
    every = eigenmodes.solve(plants.model("triple", "force")).frequency
    file = written(tmp_path, plants.raw("triple"), "triple.toml")
    found = sus.response(sus.read(file), frequency=every, fidelity="force")
    assert np.isfinite(found.value).all()


ZEROS = [
    ("double", "test.y"),
    ("tower", "mirror.z"),  # three legs at 120 degrees
    ("pulled-fibres", "mirror.z@0,0,0.01"),  # three wires on three blades
    ("reaction-chain", "top.z"),  # a chain beside another
]


@pytest.mark.parametrize(("name", "output"), ZEROS)
def test_zero_is_exact_and_said(name, output, tmp_path):
    ends = ("--output", output, "--frequency", "0.1:100:5", "--out", tmp_path)
    found = run("response", CONFIGS / f"{name}.toml", *ends, "--no-plot")
    assert f"support.x -> {output}: 0 by symmetry" in found.stdout.splitlines()
    answer = document("response", CONFIGS / f"{name}.toml", *ends)
    assert answer["real"] == answer["imag"] == [0.0] * 5


def test_comparison_of_zeros(tmp_path):
    designs = [CONFIGS / "double.toml", CONFIGS / "geo-silica-triple.toml"]
    ends = ("--output", "test.y", "--frequency", "0.1:100:9", "--out", tmp_path)
    found = run("compare", *designs, *ends)
    assert found.exit_code == 0
    assert "0 by symmetry: double, geo-silica-triple" in found.stdout
    assert len(list(tmp_path.glob("*test.y*.png"))) == 1


CASE = CONFIGS / "husman2000" / "table1-case1.toml"
"""Vertical wires: vertically one mass on one spring, of which gravity is no part."""


def largest(out, *options):
    """Magnitudes and frequencies (Hz) that the command prints as the largest."""
    result = run("response", CASE, "--fidelity", "string", "--no-plot", "--out", out, *options)
    assert result.exit_code == 0, result.stderr
    found = re.findall(
        r"largest ([0-9.e+-]+|infinite \(no loss there\)) at (\S+) Hz", result.stdout
    )
    return [(np.inf if size.startswith("inf") else float(size), float(at)) for size, at in found]


def natural():
    """sqrt(k / m) / (2 pi) of the vertical mode, Hz."""
    design = read(CASE).design
    (stage,) = design.stage
    stiffness = 1.7e11 * np.pi * stage.wires.radius**2 / stage.wires.l
    return np.sqrt(4 * stiffness / stage.body.mass) / (2 * np.pi)


VERTICAL = ("--input", "support.z", "--output", "test.z")


@pytest.mark.parametrize("loss", [1e-2, 1e-5, 1e-9])
@pytest.mark.parametrize("grid", ["1:100:2000", "1:100:3", "30,7,2"])
def test_of_one_mass_on_one_spring(loss, grid, tmp_path):
    """|x / x0| = sqrt(1 + phi^2) / phi at the resonance, to first order in 1/Q where it is
    largest."""
    [(size, at)] = largest(
        tmp_path, *VERTICAL, "--frequency", grid, "--set", f"materials.steel302.loss_angle={loss}"
    )
    assert size == pytest.approx(np.sqrt(1 + loss**2) / loss, rel=5e-4)
    assert at == pytest.approx(natural(), rel=1e-4)


def test_without_loss_it_is_infinite(tmp_path):
    [(size, at)] = largest(
        tmp_path, *VERTICAL, "--frequency", "1:100:50", "--set", "materials.steel302.loss_angle=0"
    )
    assert size == np.inf
    assert at == pytest.approx(natural(), rel=1e-5)


def test_no_pole_beyond_the_grid_counts(tmp_path):
    """Above all modes the largest value is the first; a response that symmetry forbids has none."""
    options = (*VERTICAL, "--output", "test.x", "--frequency", "200:400:10")
    (up,) = largest(tmp_path, *options)
    assert up[1] == 200.0
    assert up[0] == pytest.approx(1 / ((200 / natural()) ** 2 - 1), rel=2e-3)


def test_largest_values_of_many_responses():
    """Peaks of a matrix of responses are those of each response alone, and above all points of a
    dense grid around them."""
    design = sus.read(CONFIGS / "geo-silica-triple.toml")
    supports = [f"support.{dof}" for dof in "xyz"]
    motions = [f"test.{dof}" for dof in "xyz"]
    grid = np.geomspace(0.1, 30, 300)
    peaks = sus.response(design, inputs=supports, outputs=motions, frequency=grid).largest
    for n, (into, out) in enumerate(zip(supports, motions, strict=True)):
        alone = sus.response(design, inputs=[into], outputs=[out], frequency=grid).largest
        at = peaks.frequency[n, n]
        size = peaks.size[n, n]
        assert size == pytest.approx(alone.size[0, 0], rel=1e-6)
        assert at == pytest.approx(alone.frequency[0, 0], rel=1e-8)
        near = at * (1 + np.linspace(-1e-3, 1e-3, 2001))
        around = sus.response(design, inputs=[into], outputs=[out], frequency=near).value
        assert size >= np.abs(around).max() * (1 - 1e-9)


def test_curve_and_peaks_are_computed_when_they_are_needed(tmp_path, monkeypatch):
    """Once for text, picture and file, not for the values alone, and never for what was loaded."""
    calls = []
    refine = solve.add_from_model
    monkeypatch.setattr(solve, "add_from_model", lambda *a, **k: calls.append(a) or refine(*a, **k))
    found = sus.response(sus.example("double"), frequency="0.1:50:60", fidelity="string")
    assert found.document() and found.fine is None and not calls
    found.save(tmp_path / "response.h5")
    found.plot()
    assert f"{found.largest.size[0, 0]:.4g}" in str(found)
    assert len(calls) == 1
    loaded = sus.load(tmp_path / "response.h5")
    loaded.plot()
    np.testing.assert_array_equal(loaded.fine, found.complete().fine)
    np.testing.assert_array_equal(loaded.largest.size, found.largest.size)
    assert str(loaded) == str(found) and len(calls) == 1


@pytest.mark.filterwarnings("ignore::suspension_cli.PendsusWarning")
def test_curves_have_the_peaks_of_modes_that_wire_mass_shifts():
    """KAGRA's tower: heat links on coiled wires resonate at 1.674 Hz, at 1.676 Hz without mass."""
    question = {"inputs": "support.x", "outputs": "TM.y", "fidelity": "violin"}
    tower = sus.example("built/kagra-typea")
    close = sus.response(tower, frequency=np.linspace(1.67425, 1.67441, 161), **question)
    wide = sus.response(tower, frequency=np.geomspace(1.0, 3.0, 160), **question)
    frequency, value = wide.curve
    near = np.abs(frequency - 1.67433) < 1e-4
    assert near.any()
    assert np.abs(value[near]).max() > 0.5 * np.abs(close.value).max()
