"""`pendsus compare`: modes paired by shape, overlaid curves and their ratios, changed numbers."""

from __future__ import annotations

import re

import h5py
import numpy as np
import pytest

import suspension_cli as sus
from tests.support.commandline import document, run, written
from tests.support.paths import CONFIGS

DOUBLE = sus.example("double")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A design, a copy with a longer wire and another name, and results of the copy."""
    folder = tmp_path_factory.mktemp("compare")
    written(folder, DOUBLE.text, "a.toml")
    longer = DOUBLE.replace({"stage.upper.wires.l": 0.303, "design.name": "longer"})
    written(folder, longer.text, "b.toml")
    (folder / "bare.csv").write_text("f,re,im\n1,2,3\n2,3,4\n")
    grid = ("--frequency", "0.3:30:40")
    for command in (("response", *grid), ("thermal", *grid), ("modes",)):
        options = ("--fidelity", "beam", "-q", "--no-plot")
        done = run(command[0], folder / "b.toml", *command[1:], *options, "--out", folder)
        assert done.exit_code == 0, done.stderr
    return folder


def compared(folder, out, *items):
    words = (folder / i if (folder / i).exists() else i for i in items)
    return document("compare", *words, "--fidelity", "beam", "--out", out)


def test_modes_of_two_designs_are_those_of_each(folder, tmp_path):
    found = compared(folder, tmp_path, "a.toml", "b.toml")
    assert found["designs"] == ["double", "longer"]
    errors = [
        sus.modes(sus.read(folder / name), fidelity="beam").estimated_error
        for name in ("a.toml", "b.toml")
    ]
    assert (found["fidelity"], found["estimated_error"]) == ("beam", max(errors))
    rows = np.array([row["frequency_hz"] for row in found["modes"]])
    for column, name in ((0, "a.toml"), (1, "b.toml")):
        design = sus.read(folder / name)
        own = sus.modes(design, fidelity="beam").frequency
        assert np.sort(rows[:, column]) == pytest.approx(np.sort(own), rel=1e-12)
    assert min(row["overlap"][1] for row in found["modes"]) > 0.9
    assert found["changes"]["longer"] == [
        {"path": "stage.upper.wires.l", "before": "300 mm", "after": "303 mm"}
    ]


def test_a_variant_is_the_design_with_other_values(folder, tmp_path):
    words = ("--variant", "longer: stage.upper.wires.l=0.303", "--input", "support.x")
    found = compared(folder, tmp_path, "a.toml", *words)
    other = compared(folder, tmp_path, "a.toml", "b.toml", "--input", "support.x")
    assert found["designs"] == ["double", "longer"]
    for name in ("modes", "responses"):
        assert found[name] == other[name]
    both = sus.compare(DOUBLE, variants=["stage.upper.wires.l=0.303; stage.test.wires.d=2e-3"])
    assert both.name == ("double", "upper.wires.l=0.303, test.wires.d=2e-3")
    assert [change.path for change in both.change[1]] == [
        "stage.upper.wires.l",
        "stage.test.wires.d",
    ]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("a.toml", "--variant", "longer"), "is no variant"),
        (("a.toml", "--variant", ": stage.upper.wires.l=0.3"), "is no variant"),
        (("a.toml", "--variant", "x: stage.upper.wires.q=0.3"), "unknown key"),
        (("longer-modes.h5", "--variant", "x: stage.upper.wires.l=0.3"), "needs a design"),
        (("a.toml",), "at least two items"),
        (("a.toml", "missing.toml"), "cannot be read"),
        (("bare.csv", "bare.csv"), "only measurements are given"),
        (("a.toml", "bare.csv"), "does not say which signals were measured"),
    ],
)
def test_faults_are_one_line(folder, words, said):
    done = run("compare", *(folder / i if (folder / i).exists() else i for i in words))
    assert done.exit_code == 2
    assert said in done.stderr
    assert done.stderr.count("\n") == 1
    assert ";" in done.stderr


def test_modes_are_paired_by_shape_and_not_by_order():
    # ten times the moments of inertia carry yaw below both pendulum modes
    design = sus.example("husman2000/table1-case3")
    heavy = design.replace({"stage.test.body.inertia": [1.472, 1.176, 1.107]})
    first, second = sus.modes(design, fidelity="string"), sus.modes(heavy, fidelity="string")
    assert first.label.index("test yaw") != second.label.index("test yaw")
    found = sus.compare(design, heavy, fidelity="string").modes
    for n, label in enumerate(found.label):
        assert found.frequency[n, 0] == first.frequency[first.label.index(label)]
        assert found.frequency[n, 1] == second.frequency[second.label.index(label)]


def test_what_is_neglected_says_in_which_analysis(tmp_path):
    """Modes may need a simpler model than responses, which neglect nothing then."""
    double = CONFIGS / "double.toml"
    words = ("--variant", "long: stage.test.wires.l=0.3", "--output", "test.x")
    done = run("compare", double, *words, "--no-plot", "--out", tmp_path)
    first = done.stdout.splitlines()[0]
    assert "violin model" in first
    assert "neglected in modes (beam model): wire mass" in first


def test_stored_results_and_designs_on_one_grid(folder, tmp_path):
    found = compared(folder, tmp_path, "a.toml", "longer-response.h5", "longer-thermal.h5")
    (response,), (noise,) = found["responses"], found["noises"]
    f = response["curves"][1]["frequency_hz"]
    at = {
        name: sus.response(sus.read(folder / name), frequency=f, fidelity="beam").value[:, 0, 0]
        for name in ("a.toml", "b.toml")
    }
    ratio = response["curves"][1]["ratio"]
    assert ratio["frequency_hz"] == f
    value = np.array(ratio["real"]) + 1j * np.array(ratio["imag"])
    assert value == pytest.approx(at["b.toml"] / at["a.toml"], rel=1e-9)
    low = {
        name: sus.thermal(sus.read(folder / name), frequency=f, fidelity="beam").amplitude[:, 0]
        for name in ("a.toml", "b.toml")
    }
    assert noise["curves"][1]["ratio"]["real"] == pytest.approx(low["b.toml"] / low["a.toml"])


def test_other_grids_are_interpolated_between_their_points():
    design = sus.example("double")
    fine = sus.response(design, frequency="20:50:400", fidelity="string")
    coarse = sus.response(design, frequency="19:49:300", fidelity="string")
    (overlay,) = sus.compare(fine, coarse).overlay
    ratio = overlay.curves[1].ratio
    # f^-4: between two points of the grid the logarithm is straight
    assert ratio == pytest.approx(np.ones(len(ratio)), abs=2e-3)
    assert overlay.curves[1].ratio_frequency[0] >= 20.0
    late = {"closed_loop": True, "fidelity": "string"}
    damped = sus.example("triple-damped")  # whose phase turns from point to point
    fine, coarse = (sus.response(damped, frequency=f"2:4:{n}", **late) for n in (400, 300))
    (overlay,) = sus.compare(fine, coarse).overlay
    assert overlay.curves[1].ratio == pytest.approx(1, abs=2e-3)


def test_measured_data_beside_designs(folder, tmp_path):
    f = np.array([0.4, 1.0, 2.0])
    model = sus.response(
        sus.read(folder / "a.toml"),
        inputs=["upper.force_x"],
        outputs=["upper.x"],
        frequency=f,
        fidelity="beam",
    ).value[:, 0, 0]
    text = "f,re,im\n" + "".join(
        f"{x!r},{2 * y.real!r},{2 * y.imag!r}\n"
        for x, y in zip(f.tolist(), model.tolist(), strict=True)
    )
    (folder / "drive.csv").write_text(text)
    signals = ("--input", "upper.force_x", "--output", "upper.x")
    found = compared(folder, tmp_path, "a.toml", "drive.csv", *signals)
    (overlay,) = found["responses"]
    assert overlay["reference"] == "double"
    assert overlay["curves"][1]["ratio"]["real"] == pytest.approx([2, 2, 2], rel=1e-9)
    table = (
        '[[transfer_function]]\nfile = "drive.csv"\ninput = "upper.force_x"\noutput = "shadow"\n'
    )
    table += '[[sensor]]\nname = "shadow"\nsignal = "upper.x"\ngain = 2.0\n'
    table += '[[mode]]\nfrequency = 1.85\nuncertainty = 0.01\nlabel = "test pitch"\n'
    (folder / "measured.toml").write_text(table)
    found = compared(folder, tmp_path, "a.toml", "measured.toml")
    ratio = found["responses"][0]["curves"][1]["ratio"]
    assert ratio["real"] == pytest.approx([1, 1, 1], rel=1e-9)
    pitch = next(row for row in found["modes"] if row["label"] == "test pitch")
    assert pitch["frequency_hz"][1] == 1.85


def test_text_pictures_and_stored_comparison(folder, tmp_path):
    items = [folder / "a.toml", folder / "b.toml", folder / "longer-response.h5"]
    options = ("--fidelity", "beam", "--format", "svg", "--csv")
    done = run("compare", *items, *options, "--out", tmp_path)
    assert done.exit_code == 0, done.stderr
    assert re.search(r"\n +double +b\n +upper wires l +300 mm +303 mm\n", done.stdout)
    assert "test.x / support.x (m/m)" in done.stdout
    stem = "double-and-b-and-1-more-compare"
    names = {path.name for path in tmp_path.iterdir()}
    assert {f"{stem}.h5", f"{stem}.svg", f"{stem}-test.x-support.x.svg"} <= names
    ratios = (tmp_path / f"{stem}-overlay-1-curves-2-ratio_frequency.csv").read_text()
    assert ratios.startswith("ratio_frequency (Hz),ratio real (1),ratio imag (1)\n0.3,")
    again = sus.load(tmp_path / f"{stem}.h5")
    assert str(again) == done.stdout.rstrip("\n")
    done = run("plot", tmp_path / f"{stem}.h5", "--format", "svg", "--out", tmp_path / "again")
    assert done.exit_code == 0, done.stderr
    for picture in (tmp_path / "again").iterdir():  # with the same resonances resolved
        assert picture.read_bytes() == (tmp_path / picture.name).read_bytes()
    with h5py.File(tmp_path / f"{stem}.h5") as file:
        for name in ("changes/before", "overlay/1/curves/2/value", "overlay/1/curves/2/ratio"):
            data = file[f"compare/{name}"]
            assert [len(scale[0]) for scale in data.dims] == [*data.shape]
    with h5py.File(tmp_path / f"{stem}.h5", "r+") as file:  # as an earlier file, which had none
        for curve in file["compare/overlay/1/curves"].values():
            for name in ("fine", "fine_frequency"):
                if name in curve:
                    del curve[name]
    (curves,) = [one.curves for one in sus.load(tmp_path / f"{stem}.h5").overlay]
    assert [one.fine for one in curves] == [None] * 3
    assert run("plot", tmp_path / f"{stem}.h5", "--out", tmp_path / "again").exit_code == 0


def test_changes_that_no_digit_shows_are_0():
    """A mass that is heavier by 1e-6 of itself: "0", not "-0.000162"."""
    design = sus.template("single")
    mass = design.design.stage[0].body.mass
    near = design.replace({"stage.test.body.mass": mass * (1 + 1e-6)})
    far = design.replace({"stage.test.body.mass": mass * 1.02})
    changes = []
    for other in (near, far):
        rows = [line.split() for line in str(sus.compare(design, other)).splitlines()]
        (row,) = [row for row in rows if row[-2:] == ["test", "vertical"]]
        changes.append(row[2])
    assert changes[0] == "0"
    assert 0.1 < abs(float(changes[1])) < 2
