"""Quantities side by side: the numbers of the commands, verdicts, measured values, refusals."""

from __future__ import annotations

import math

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.analyses.compare import compared_quantities
from suspension_cli.files import hdf5
from tests.support.commandline import document, run
from tests.support.legible import assert_legible, said
from tests.support.paths import CONFIGS

BEAM = {"fidelity": "beam"}
LOSSLESS = 1e-6
"""Modes are listed with their losses, which change frequencies by 1 / (8 Q^2) and with phi."""
FREE = (
    "test pitch",
    "5",
    "lowest vertical",
    "yaw 2",
    "Q of test longitudinal",
    "decay of test longitudinal",
    "settling of test longitudinal",
    "dilution of test longitudinal",
    "test violin 1",
    "test.x/support.x:10",
    "coupling",
    "peak of test.x/support.x:0.1:5",
    "smallest of test.x/support.x:20:30",
    "thermal test.x:10",
    "force noise test.force_x:10",
    "tension test.1",
    "stress test wires",
    "stress fraction test wires",
    "test height",
    "test static pitch",
    "top fraction of test pitch",
    "fraction of upper pitch in test pitch",
    "distance test pitch, test longitudinal",
)
"""Quantities of a design without loops."""
DAMPED = (
    "margin x.gain",
    "margin x.phase",
    "margin x.delay",
    "margin x.distance",
    "noise test.x:10",
    "rms test.x:0.05:10",
)
SAGGING = ("sag of upper blades",)


def values_of(design, texts, **options):
    """Values that compare gives for a design beside itself; both columns are the same."""
    found = sus.compare(design, design, results=list(texts), **options).quantities
    assert found.name == tuple(texts)
    assert np.array_equal(found.value[:, 0], found.value[:, 1])
    assert np.nanmax(np.abs(found.change)) == 0
    return dict(zip(found.name, found.value[:, 0].tolist(), strict=True))


@pytest.fixture(scope="module")
def lossy():
    return sus.example("geo-silica-triple")


@pytest.fixture(scope="module")
def free(lossy):
    return values_of(lossy, FREE, **BEAM)


def test_modes(lossy, free):
    modes = sus.modes(lossy, **BEAM)
    labels = list(modes.label)
    pitch = labels.index("test pitch")
    along = labels.index("test longitudinal")
    frequency = modes.frequency
    vertical = [f for f, label in zip(frequency, labels, strict=True) if "vertical" in label]
    ratio = frequency[pitch] / frequency[along]
    yaw = [f for f, label in zip(frequency, labels, strict=True) if label.endswith("yaw")]
    expected = {
        "yaw 2": sorted(yaw)[1],
        "test pitch": frequency[pitch],
        "5": frequency[4],
        "lowest vertical": min(vertical),
        "Q of test longitudinal": modes.q[along],
        "decay of test longitudinal": modes.decay_rate[along],
        "settling of test longitudinal": 1 / modes.decay_rate[along],
        "dilution of test longitudinal": modes.dilution[along],
        "top fraction of test pitch": modes.top_fraction[pitch],
        "distance test pitch, test longitudinal": max(ratio, 1 / ratio) - 1,
    }
    for name, value in expected.items():
        assert free[name] == pytest.approx(value, rel=LOSSLESS), name


def test_violin_modes(lossy, free):
    modes = sus.modes(lossy, fidelity="violin", max_frequency=700.0)
    own = [
        frequency
        for frequency, motion in zip(modes.frequency, modes.motion, strict=True)
        if motion.startswith("test violin") and motion.endswith(" 1")
    ]
    assert free["test violin 1"] == pytest.approx(min(own), rel=1e-8)


def test_responses(lossy, free):
    asked = {"inputs": ["support.x"], "outputs": ["test.x"], **BEAM}
    at_10 = abs(sus.response(lossy, frequency=[10.0], **asked).value[0, 0, 0])
    assert free["test.x/support.x:10"] == pytest.approx(at_10, rel=1e-9)
    band = sus.response(lossy, frequency="0.1:5:2000", **asked)
    assert free["peak of test.x/support.x:0.1:5"] == pytest.approx(
        band.largest.size[0, 0], rel=1e-3
    )
    fall = np.abs(sus.response(lossy, frequency="20:30:50", **asked).value[:, 0, 0])
    assert free["smallest of test.x/support.x:20:30"] == pytest.approx(fall.min(), rel=1e-9)
    couple = sus.response(
        lossy,
        inputs=["support.z"],
        outputs=["test.x@0,0,-0.001", "test.z@0,0,-0.001"],
        frequency=[50.0],
        **BEAM,
    ).value[0, :, 0]
    assert free["coupling"] == pytest.approx(abs(couple[0] / couple[1]), abs=1e-12)


def test_thermal_noise(lossy, free):
    motion = sus.thermal(lossy, outputs=["test.x"], frequency=[10.0], **BEAM).amplitude[0]
    assert free["thermal test.x:10"] == pytest.approx(motion, rel=1e-9)
    force = {"inputs": ["test.force_x"], "outputs": ["test.x"], "frequency": [10.0]}
    moved = abs(sus.response(lossy, **force, **BEAM).value[0, 0, 0])
    assert free["force noise test.force_x:10"] == pytest.approx(motion / moved, rel=1e-9)


def test_loads_and_poses(lossy, free):
    statics = sus.check(lossy).statics
    own = [wire for wire in statics.wires if wire.stage == "test"]
    assert free["tension test.1"] == pytest.approx(own[0].tension, rel=1e-6)
    assert free["stress test wires"] == pytest.approx(max(wire.stress for wire in own), rel=1e-6)
    fraction = max(wire.fraction for wire in own)
    assert free["stress fraction test wires"] == pytest.approx(fraction, rel=1e-6)
    assert free["test static pitch"] == pytest.approx(0.0, abs=1e-9)
    [lowest] = [low.z for low in statics.lowest if low.name == "test"]
    assert 0 < free["test height"] <= -lowest


def test_loops_noise_and_sag():
    design = sus.example("triple-damped")
    found = values_of(design, (*DAMPED, *SAGGING), **BEAM)
    loops = sus.damp(design)
    own = loops.margin[list(loops.loop).index("x")]
    assert found["margin x.gain"] == pytest.approx(min(own.gain_up_db, -own.gain_down_db))
    for word in ("phase", "delay", "distance"):
        assert found[f"margin x.{word}"] == pytest.approx(getattr(own, word), rel=1e-6)
    budget = sus.budget(design, outputs=["test.x"], frequency="0.05:10:400", **BEAM)
    assert found["noise test.x:10"] == pytest.approx(budget.amplitude[-1], rel=1e-9)
    assert found["rms test.x:0.05:10"] == pytest.approx(budget.rms[0], rel=1e-3)
    blades = [one.sag for one in sus.check(design).statics.blades if one.stage == "upper"]
    assert found["sag of upper blades"] == pytest.approx(max(blades), rel=1e-6)


# Verdicts, measured values, what is missing.


REQUIRED = """
[[requirement]]
quantity = "lowest pitch"
at_most = {limit}
note = "design document, 4.2"
[[requirement]]
quantity = "test static pitch"
at_most = 1e-3
"""


@pytest.fixture(scope="module")
def required(tmp_path_factory):
    """Two designs with different limits; the first meets its own."""
    folder = tmp_path_factory.mktemp("required")
    text = (CONFIGS / "double.toml").read_text()
    (folder / "loose.toml").write_text(text + REQUIRED.format(limit=1.1))
    strict = text.replace('name = "double"', 'name = "strict"', 1)
    (folder / "strict.toml").write_text(strict + REQUIRED.format(limit=0.9))
    return folder


def test_each_design_is_judged_by_its_own_requirements(required):
    designs = [sus.read(required / f"{name}.toml") for name in ("loose", "strict")]
    found = sus.compare(*designs, **BEAM).quantities
    assert found.name == ("lowest pitch", "test static pitch")
    for item, design in enumerate(designs):
        for row, verdict in enumerate(sus.check(design).verdicts):
            [own] = found.verdicts_on(row, item)
            assert own.description == verdict.requirement.description
            assert (own.met, own.note) == (verdict.met, verdict.requirement.limits.note)
            assert own.margin == pytest.approx(verdict.margin, rel=1e-9)
    assert [one.met for one in found.verdict] == [True, True, False, True]


def test_verdicts_are_printed_stored_and_drawn(required, tmp_path):
    paths = [required / f"{name}.toml" for name in ("loose", "strict")]
    done = run("compare", *paths, "--fidelity", "beam", "--out", tmp_path)
    assert done.exit_code == 0, done.stderr
    [row] = [line for line in done.stdout.splitlines() if line.strip().startswith("lowest pitch ")]
    assert "met (+8.39 %)" in row and "NOT met (-12 %)" in row
    assert "lowest pitch <= 1.1 Hz; lowest pitch <= 0.9 Hz" in row
    stored = sus.load(tmp_path / "double-and-strict-compare.h5")
    assert [one.met for one in stored.quantities.verdict] == [True, True, False, True]
    assert str(stored) in done.stdout
    figures = list(stored.figures().values())
    assert any("not met: strict" in " ".join(said(figure)) for figure in figures)
    for figure in figures:
        assert_legible(figure)
    found = document("compare", *paths, "--fidelity", "beam", "--out", tmp_path)
    first = found["quantities"][0]
    assert first["requirements"][1]["met"] is False
    assert first["requirements"][1]["note"] == "design document, 4.2"
    assert first["change_percent"] == [None, 0.0]


def test_one_model_for_all_designs():
    """What a fine wire needs is taken for the other design too, and its error is stated."""
    design = sus.example("double")
    longer = design.replace({"stage.test.wires.l": 0.3, "design.name": "longer"})
    found = sus.compare(design, longer, results=["test.x/support.x:300"])
    assert set(found.models) == {"violin"}
    assert found.estimated_error < 1e-3
    exact = sus.response(longer, inputs="support.x", outputs="test.x", frequency=300.0)
    value = abs(complex(exact.value.ravel()[0]))
    assert found.quantities.value[0, 1] == pytest.approx(value, rel=1e-9)


def test_what_a_design_lacks_has_a_reason():
    double = sus.example("double")
    single = sus.example("husman2000/table1-case3")
    found = sus.compare(double, single, results=["tension upper.1", "tension test.1"], **BEAM)
    assert np.isnan(found.quantities.value[0, 1])
    assert "husman2000-table1-case3 has no value of tension upper.1" in str(found)
    assert found.document()["quantities"][0]["missing"].keys() == {"husman2000-table1-case3"}


def test_measured_values_have_a_column(tmp_path):
    measured = tmp_path / "seen.toml"
    measured.write_text(
        '[[quantity]]\nname = "stress test wires"\nvalue = 3.8e8\nuncertainty = 1e7\n'
        '[[mode]]\nlabel = "test pitch"\nfrequency = 1.01\nuncertainty = 0.01\n'
    )
    design = sus.example("double")
    found = sus.compare(design, measured, results=["test pitch"], **BEAM).quantities
    assert found.name == ("test pitch", "stress test wires")
    assert found.value[:, 1].tolist() == [1.01, 3.8e8]
    stress = max(wire.stress for wire in sus.check(design).statics.wires if wire.stage == "test")
    assert found.change[1, 1] == pytest.approx(100 * (3.8e8 / stress - 1))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("test pich", "is no quantity of this design; did you mean 'test pitch'"),
        ("thermal test.x", "has no frequency"),
        ("margin x.gain", "names no loop"),
    ],
)
def test_a_quantity_that_no_design_has_is_refused(text, said):
    done = run("compare", CONFIGS / "double.toml", CONFIGS / "double.toml", "--result", text)
    assert done.exit_code == 2
    assert done.stderr.count("\n") == 1
    assert "--result" in done.stderr and said in done.stderr


def test_an_unstable_design_has_no_noise_but_loads():
    """A number of a steady state is missing, with the reason; a load is there."""
    design = sus.example("husman2000/figure6")
    tipping = design.replace({"stage.test.wires.s": 0.0, "stage.test.wires.d": -1e-4})
    names = ["test.x/support.x:10", "tension test.1"]
    found = sus.compare(design, tipping, results=names, fidelity="string").quantities
    assert np.isnan(found.value[0, 1]) and math.isfinite(found.value[1, 1])
    assert [one.reason for one in found.missing] == [
        "has no steady state, or a response that is divided by is 0"
    ]


def test_changes_are_relative_to_the_first_value():
    value = np.array([[2.0, np.nan, 3.0], [0.0, 0.0, 1.0], [-2.0, -1.0, np.nan]])
    found = compared_quantities.ComparedQuantities(("a", "b", "c"), ("1",) * 3, value)
    expected = [[np.nan, np.nan, 50.0], [np.nan, 0.0, np.nan], [np.nan, 50.0, np.nan]]
    np.testing.assert_array_equal(found.change, expected)


def test_a_file_without_quantities_is_read_as_before(tmp_path):
    """The group is only there if something was compared."""
    design = sus.example("double")
    path = tmp_path / "x.h5"
    sus.compare(design, design, **BEAM).save(path)
    with hdf5.open_results(path) as file:
        assert "quantities" not in file["compare"]
    assert sus.load(path).quantities is None
