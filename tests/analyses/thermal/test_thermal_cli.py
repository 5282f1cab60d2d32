"""`pendsus thermal`: JSON for scripts, models, results files, pictures and refusals."""

from __future__ import annotations

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.analyses.thermal import picture, solve
from suspension_cli.grids import decade_points
from suspension_cli.physics import thermal_noise
from tests.support import plants, scenes
from tests.support.commandline import assert_refused, document, run, written
from tests.support.legible import assert_legible
from tests.support.paths import CONFIGS

CAUSES = (
    *("bending-upper", "bending-lower", "stretching", "torsion"),
    *("blades", "springs", "link", "gas", "thermoelastic"),
)
RAW = plants.raw("triple") | {"materials": {"steel302": {"loss_angle": 2e-4}}}
GRID = ("--frequency", "0.3,3,30")


@pytest.fixture
def file(tmp_path):
    return written(tmp_path, RAW, "triple.toml")


@pytest.fixture
def out(tmp_path):
    return tmp_path / "out"


def json_of(file, out, *options):
    """The JSON document of a run that went well and wrote nothing but its results."""
    answer = document("thermal", file, "--out", out, *options)
    assert [path.name for path in out.iterdir()] == ["triple-thermal.h5"]
    return answer


def test_several_mirrors(file, out):
    """Twice the amplitude of one, in the document, the text and the points that pictures add."""
    one = json_of(file, out, *GRID)
    found = sus.thermal(sus.read(file), frequency="0.1:50:60", mirrors=4)
    bare = sus.thermal(sus.read(file), frequency="0.1:50:60")
    four = json_of(file, out, "--mirrors", "4", *GRID)
    assert four["mirrors"] == 4.0 and one["mirrors"] == 1.0
    twice = 2 * np.array(one["displacement_asd"])
    np.testing.assert_allclose(four["displacement_asd"], twice, rtol=1e-12)
    finer, fine = (result.curves[0] for result in (found, bare))
    np.testing.assert_allclose(finer.amplitude, 2 * fine.amplitude, rtol=1e-12)
    assert "test.x, 4 mirrors: thermal noise" in str(found)


@pytest.mark.parametrize("highest", ["4", "30"])
def test_the_mass_of_wires_counts_where_they_vibrate(highest, file, out):
    """The beam model states its error; the default neglects nothing."""
    words = ("--no-plot", "--out", out, "--frequency", f"1:{highest}:5")
    assert run("thermal", file, *words).stdout.startswith("model: violin (the most complete); ")
    answer = json_of(file, out, *words[3:], "--fidelity", "beam")
    assert (answer["estimated_error"] < 0.003) == (highest == "4")


def test_text_for_people(file, out):
    result = run(
        "thermal",
        file,
        "--no-plot",
        "--out",
        out,
        *["--arm", "600", "--output", "test.x", "--frequency", "0.5:20:1000"],
    )
    reason, head, _names, units, *rows = result.stdout.splitlines()
    assert reason.startswith("model: violin (")
    assert head == "test.x along a beam that rises by 47.1 urad: thermal noise"
    assert units.split() == ["Hz", "m/sqrt(Hz)"]
    assert [float(row.split()[0]) for row in rows] == pytest.approx([1.0, 10.0], rel=5e-3)
    assert all("%" in row and "bending" in row for row in rows)


@pytest.mark.parametrize(
    ("frequency", "places"),
    [([2.0, 3.0], [0, 1]), ([5.0], [0]), ([1.0, 10.0, 100.0], [0, 1, 2]), ([100.0, 1.0], [1, 0])],
)
def test_frequencies_that_are_printed(frequency, places):
    assert decade_points(np.array(frequency)) == places


@pytest.mark.parametrize("listed", ["3,10,30", "30", "7,3,11"])
def test_all_listed_frequencies_are_printed(file, out, listed):
    """In the tables of noise, responses and comparisons."""
    numbers = [f"{float(one):g}" for one in listed.split(",")]
    words = [f"{number} Hz" for number in numbers]
    common = ("--frequency", listed, "--no-plot", "--out", out)
    rows = run("thermal", file, *common).stdout.splitlines()[4:]
    assert [f"{float(row.split()[0]):g} Hz" for row in rows] == words
    response = run("response", file, "--input", "support.x", *common).stdout
    compared = run("compare", file, CONFIGS / "double.toml", "--noise", "test.x", *common).stdout
    for text in (response, compared):
        rows = [line.split()[0] for line in text.splitlines() if line.strip()]
        assert sorted(number for number in rows if number in numbers) == sorted(numbers)
    budget = run("budget", file, "--ground", "nlnm", "--output", "test.x", *common).stdout
    assert all(f" {word}" in budget for word in words)


def test_long_lists_are_tables_below_each_other(file, out):
    listed = ("--frequency", "1,2,3,4,5,6,7,8", "--no-plot", "--out", out)
    text = run("budget", file, "--ground", "nlnm", "--output", "test.x", *listed).stdout
    heads = [line for line in text.splitlines() if "cause" in line]
    assert [line.count(" Hz") for line in heads] == [6, 2]


# refusals


def test_wires_without_material_or_cross_section(out, tmp_path):
    for change, problem in (
        ({"k": 1e4}, "has no cross-section"),
        ({"k": 1e4, "radius": 1e-4}, "has no material"),
    ):
        stage = scenes.hung({"count": 1, "l": 0.5, **change}, 5.0, 0.02)
        file = written(tmp_path, {"design": {"name": "one"}, "stage": [stage]})
        for level in ("auto", "beam", "violin"):
            (line,) = assert_refused(
                run("thermal", file, "--json", "--out", out, "--fidelity", level), file, out
            )
            assert line.startswith(f"stage: wire test.1 {problem}")


def test_wires_without_density(out, tmp_path):
    material = {"youngs_modulus": 2e11, "loss_angle": 1e-4}
    wires = {"count": 1, "l": 0.5, "material": "mine", "radius": 1e-4}
    stage = {"name": "test", "body": {"mass": 5.0, "inertia": [0.02] * 3}, "wires": wires}
    file = written(
        tmp_path, {"design": {"name": "triple"}, "materials": {"mine": material}, "stage": [stage]}
    )
    answer = json_of(file, out, *GRID)
    assert answer["fidelity"] == "beam"
    assert answer["estimated_error"] is None and "no density" in answer["error_unknown"]


# files and pictures


def many(sources):
    frequency = np.geomspace(0.1, 1000, 50)
    level = np.geomspace(1, 1e-12, len(sources))
    parts = np.sqrt(level) * 1e-15 / frequency[:, None] ** 2
    return thermal_noise.MotionNoise(frequency, "test.x", "m", 3e-4, tuple(sources), parts)


def test_what_is_drawn_and_what_is_said():
    causes = [f"stage{n}.{cause}" for n in range(4) for cause in CAUSES[:7]]
    noise = many([*causes, "damping", "support"])
    stages = [f"stage{n}" for n in range(4)]
    figure = picture.draw([noise], "Many sources", stages[::-1])
    above, below = figure.axes
    assert above.get_ylabel() == below.get_ylabel() == "test.x (m/√Hz)"
    words = [text.get_text() for text in figure.texts]
    first, second = words.index("by stage"), words.index("by cause")
    assert words[first + 1 : second] == ["sum", *stages[::-1], "whole suspension"]
    assert len(words[second + 1 :]) == picture.LINES
    assert words[second + 1] == "sum" and words[-1] == "other"
    assert any("300 µrad" in text.get_text() for text in figure.texts)
    low, high = above.get_ylim()
    assert low < noise.amplitude.min() and high > noise.amplitude.max()
    assert_legible(figure)


def test_sums_by_stage_and_by_cause_are_the_whole():
    noise = many([f"stage{n}.{cause}" for n in range(9) for cause in CAUSES])
    for place in (0, 2):
        parts = picture.sum_groups(noise, lambda source, n=place: source.partition(".")[n])
        assert len(parts) == picture.LINES - 1
        whole = np.sqrt(sum(part**2 for part in parts.values()))
        np.testing.assert_allclose(whole, noise.amplitude, rtol=1e-12)


def test_the_curve_of_the_picture_is_computed_when_it_is_needed(file, tmp_path, monkeypatch):
    """Once for picture and file, not for the numbers alone, and never for what was loaded."""
    calls = []
    refine = solve.add_from_model
    monkeypatch.setattr(solve, "add_from_model", lambda *a, **k: calls.append(a) or refine(*a, **k))
    found = sus.thermal(sus.read(file), frequency="0.1:50:60")
    assert str(found) and found.document() and found.fine is None and not calls
    found.save(tmp_path / "noise.h5")
    found.plot()
    assert len(calls) == 1
    loaded = sus.load(tmp_path / "noise.h5")
    loaded.plot()
    np.testing.assert_array_equal(loaded.fine, found.complete().fine)
    assert len(loaded.fine) == len(loaded.fine_frequency) > 200 and len(calls) == 1


def test_peaks_reach_their_tips_in_the_picture(file):
    coarse = sus.thermal(sus.read(file), frequency="0.1:50:60")
    fine = coarse.curves[0]
    at = np.searchsorted(fine.frequency, coarse.frequency)
    assert len(fine.frequency) > 200
    np.testing.assert_allclose(fine.amplitude[at], coarse.amplitude[:, 0], rtol=1e-12)
    tip = float(fine.frequency[fine.amplitude.argmax()])
    grid = f"{tip * (1 - 1e-4)!r},{tip!r}"
    (near,) = sus.thermal(sus.read(file), frequency=grid, fidelity=coarse.model).motions
    assert fine.amplitude.max() == pytest.approx(near.amplitude[1], rel=1e-6)
    assert fine.amplitude.max() > coarse.amplitude[:, 0].max()
