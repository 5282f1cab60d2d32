"""Pictures redrawn from results files, as PDF and SVG, with limits of axes, several in one; and
results as CSV."""

from __future__ import annotations

import csv

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.drawing.panels import Across, Line, Panel, Rule, draw, limited
from tests.support.commandline import assert_refused, run, written
from tests.support.designs import TEXTS

PNG = b"\x89PNG\r\n\x1a\n"


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """A folder with the modes of a design, its design file gone."""
    folder = tmp_path_factory.mktemp("results")
    design = written(folder, TEXTS["double"])
    assert run("modes", design, "--json", "--plot", "--out", folder).exit_code == 0
    design.unlink()
    return folder


def test_redraws_from_the_file_alone(results, tmp_path):
    result = run("plot", results / "double-modes.h5", "--out", tmp_path / "again")
    assert result.exit_code == 0, result.stderr
    assert result.stdout == ""
    assert result.stderr == f"wrote {tmp_path / 'again' / 'double-modes.png'}\n"
    picture = (tmp_path / "again" / "double-modes.png").read_bytes()
    assert picture.startswith(PNG)
    assert picture == (results / "double-modes.png").read_bytes()


def test_default_is_beside_the_file(results, tmp_path):
    copy = tmp_path / "renamed.h5"
    copy.write_bytes((results / "double-modes.h5").read_bytes())
    assert run("plot", copy, "-q").stderr == ""
    assert sorted(path.name for path in tmp_path.iterdir()) == ["renamed.h5", "renamed.png"]


@pytest.mark.parametrize("content", [b"", b"no HDF5"])
def test_no_results(content, tmp_path):
    file = written(tmp_path, content, "x.h5")
    [line] = assert_refused(run("plot", file), file)
    assert line.startswith("is not HDF5")
    assert [path.name for path in tmp_path.iterdir()] == ["x.h5"]


def test_truncated_results(results, tmp_path):
    file = written(tmp_path, (results / "double-modes.h5").read_bytes()[:9000], "x.h5")
    assert_refused(run("plot", file), file)


def test_missing_results_and_folders(tmp_path):
    [line] = assert_refused(run("plot", tmp_path / "x.h5"), tmp_path / "x.h5")
    assert line.startswith("is missing")
    assert_refused(run("plot", tmp_path), tmp_path)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("results")
    for name in ("double", "single"):
        written(folder, sus.template(name).text, f"{name}.toml")
    for name in ("double", "single"):
        options = ("--fidelity", "string", "--frequency", "0.5:5:6", "--no-plot", "-q")
        done = run("response", folder / f"{name}.toml", *options, "--csv", "--out", folder)
        assert done.exit_code == 0, done.stderr
    return folder


def table(path):
    with path.open(newline="") as stream:
        head, *rows = csv.reader(stream)
    return head, rows


def test_modes_and_points_of_a_sweep_have_rows(folder, tmp_path):
    design = folder / "single.toml"
    done = run("modes", design, "--fidelity", "string", "--csv", "--no-plot", "--out", tmp_path)
    assert done.exit_code == 0, done.stderr
    head, rows = table(tmp_path / "single-modes.csv")
    assert head[:2] == ["mode (1)", "label"] and len(rows) == 6
    place = head.index("frequency (Hz)")
    assert float(rows[0][place]) == sus.modes(sus.read(design), fidelity="string").frequency[0]
    vary = ("--vary", "stage.test.wires.l=0.3,0.4,0.5", "--vary", "stage.test.wires.d=0,1e-3")
    options = ("--fidelity", "string", "--workers", "1", "--no-plot", "--csv", "--out", tmp_path)
    done = run("sweep", design, *vary, "--result", "test yaw", *options)
    assert done.exit_code == 0, done.stderr
    head, rows = table(tmp_path / "single-sweep.csv")
    assert [row[:2] for row in rows] == [
        [length, d] for length in ("0.3", "0.4", "0.5") for d in ("0.0", "0.001")
    ]
    found = sus.load(tmp_path / "single-sweep.h5").value[:, :, 0].ravel()
    column = next(n for n, name in enumerate(head) if "test yaw" in name)
    assert [float(row[column]) for row in rows] == found.tolist()


@pytest.mark.parametrize(("form", "start"), [("pdf", b"%PDF"), ("svg", b"<?xml")])
def test_vector_pictures_are_the_same_bytes_again(folder, form, start, tmp_path):
    pictures = []
    for n in range(2):
        out = tmp_path / str(n)
        stored = folder / "double-response.h5"
        done = run("plot", stored, "--format", form, "--x", "0.6:4", "--out", out)
        assert done.exit_code == 0, done.stderr
        pictures.append((out / f"double-response.{form}").read_bytes())
    assert pictures[0].startswith(start)
    assert pictures[0] == pictures[1]


def test_several_results_in_one_picture(folder, tmp_path):
    files = [folder / f"{name}-response.h5" for name in ("double", "single")]
    done = run("plot", *files, "--together", "--out", tmp_path)
    assert done.exit_code == 0, done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["double-and-single-compare.png"]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--x", "4:0.6"), "two ascending numbers"),
        (("--x", "low:4"), "two ascending numbers"),
        (("--x", "0:4"), "logarithmic axis"),
        (("--together",), "at least two"),
    ],
)
def test_options_that_make_no_sense(options, words, folder, tmp_path):
    done = run("plot", folder / "double-response.h5", *options, "--out", tmp_path / "out")
    assert done.exit_code == 2
    assert words in done.stderr
    assert not list(tmp_path.rglob("*.png"))


def test_limits_of_one_quantity_leave_the_others():
    """The poles' frequencies get the limits, the time of the impulse response does not."""
    x, quantities = np.geomspace(0.1, 100, 20), ("frequency (Hz)", "time (s)", "frequency (Hz)")
    lines = [Line(x, x)]
    with limited((0.5, 5.0), (0.1, 50.0)):
        drawn = [Panel("size (m)", lines, rules=[Rule(60.0)], across=Across(q)) for q in quantities]
        figure = draw("Made up", "", drawn)
    first, second, third = figure.axes
    assert first.get_xlim() == third.get_xlim() == (0.5, 5.0)
    assert second.get_xlim()[1] > 60
    assert first.get_ylim() == (0.1, 50.0) != third.get_ylim()
    labels = {text.get_text() for text in first.get_xticklabels()}
    assert {"0.5", "2", "5"} <= labels and "3" not in labels


def test_a_drawing_has_no_axes(folder, tmp_path):
    design = folder / "single.toml"
    run("modes", design, "--fidelity", "string", "--no-plot", "-q", "--out", tmp_path)
    stored = tmp_path / "single-modes.h5"
    done = run("plot", stored, "--x", "1:2", "--out", tmp_path / "out")
    assert_refused(done, stored, tmp_path / "out")


def test_the_main_table_is_that_declared_first(tmp_path):
    design = sus.example("triple-damped")
    found = sus.damp(design, frequency=[1.0, 2.0], duration=1.0, fidelity="string")
    found.save(tmp_path / "d.csv")
    assert (tmp_path / "d.csv").read_text().startswith("time (s),impulse")
    assert (tmp_path / "d-frequency.csv").read_text().startswith("frequency (Hz)")
