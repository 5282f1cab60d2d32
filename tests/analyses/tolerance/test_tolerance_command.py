"""Yields, static poses of builds against geometry, the summary, the file, and which tables pendsus
tolerance refuses."""

from __future__ import annotations

import re
import tomllib
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from matplotlib.text import Text
from scipy import stats
from scipy.spatial.transform import Rotation

import suspension_cli as sus
from suspension_cli.analyses.tolerance import command
from suspension_cli.analyses.tolerance.summary import QUANTILES
from suspension_cli.equilibrium import solve as equilibrium
from suspension_cli.rotations import rotation_minus_identity, rotation_vector
from tests.analyses.tolerance.test_tolerance import job_of, statics
from tests.support.commandline import assert_refused, document, run, strict_json, written
from tests.support.couplings import FILE
from tests.support.golden import CONFIGS
from tests.support.paper import table_1

RAW = tomllib.loads(FILE.read_text())
TRIPLE = CONFIGS / "triple-tolerance.toml"


def scattered(folder, **table):
    """The stage of Figure 6 with a tolerance table."""
    return written(folder, RAW | {"tolerance": table})


def tolerance(file, out, *options, builds=120):
    """The JSON document of a run that must succeed."""
    return document(
        "tolerance", file, "--builds", str(builds), *["--workers", "1", "--out"], out, *options
    )


def test_one_factor_explains_everything(tmp_path):
    file = scattered(tmp_path, wire=[{"wire": "test.1", "length": {"uniform": 1e-5}}])
    answer = tolerance(file, tmp_path, "--seed", "3")
    [(name, value)] = answer["coupling"]["leading"]
    assert name == "test.1 length"
    assert value == pytest.approx(1.0, abs=1e-12)
    [(name, value)] = answer["coupling"]["leading_signed"]
    assert (name, abs(value)) == ("test.1 length", pytest.approx(1.0, abs=1e-12))
    file = scattered(tmp_path, body=[{"stage": "test", "mass": {"normal": 0.001}}])
    answer = tolerance(file, tmp_path)
    vertical = next(mode for mode in answer["modes"] if mode["label"] == "test vertical")
    [(name, value)] = vertical["leading"]
    assert (name, value) == ("test mass", pytest.approx(-1.0, abs=1e-12))
    # f goes with m^(-1/2), and x does not couple to z at all
    assert vertical["std_hz"] / vertical["nominal_hz"] == pytest.approx(0.0005, rel=0.15)
    assert answer["coupling"]["fraction_under_limit"] == 1.0
    assert answer["coupling"]["quantiles"] == [0.0] * len(QUANTILES)


def test_more_builds_keep_the_earlier_ones(tmp_path):
    """But for rounding: how a library solves a batch may depend on the number of builds in it."""
    file = scattered(
        tmp_path, wire=[{"stage": "test", "length": {"normal": 1e-5}, "k": {"normal": 0.01}}]
    )
    tolerance(file, tmp_path / "few", builds=30)
    tolerance(file, tmp_path / "many", "--chunk", "64", builds=70)  # in two chunks
    with (
        h5py.File(tmp_path / "few/husman2000-figure6-tolerance.h5") as few,
        h5py.File(tmp_path / "many/husman2000-figure6-tolerance.h5") as many,
    ):
        modes = len(few["tolerance/mode"])
        columns = {"value": (1e-13, modes), "ratio": (1e-9, 1), "status": (0.0, None)}
        for name, (limit, width) in columns.items():
            some = slice(None) if width is None else (slice(None), slice(width))
            expected = few[f"tolerance/{name}"][some]
            size = np.abs(np.nan_to_num(expected)).max()
            np.testing.assert_allclose(
                many[f"tolerance/{name}"][some][:30], expected, rtol=limit, atol=1e-3 * limit * size
            )


def test_builds_are_added_until_errors_are_small(tmp_path):
    """What is reached is stated; more builds begin with those of a run of fewer."""
    file = scattered(
        tmp_path,
        wire=[{"stage": "test", "length": {"normal": 1e-5}, "k": {"normal": 0.01}}],
        require=[{"quantity": "test static roll", "below": 5e-5}],
    )
    options = ("--precision", "0.015", "--fidelity", "string", "--workers", "1", "--out", tmp_path)
    done = run("tolerance", file, *options, "--no-plot")
    assert done.exit_code == 0, done.stderr
    found = sus.load(tmp_path / "husman2000-figure6-tolerance.h5")
    assert found.builds > 2048 and found.good == found.builds
    assert "after 2,048 builds" in done.stderr
    assert 0.005 < found.largest_error <= found.precision == 0.015
    assert "asked for: 1.5 %" in done.stdout
    required = found.required[0]
    assert required.error < 0.015 * required.deviation
    assert found.joint.error <= 0.015
    few = tolerance(file, tmp_path / "few", "--fidelity", "string", builds=600)
    with (
        h5py.File(tmp_path / "husman2000-figure6-tolerance.h5") as many,
        h5py.File(tmp_path / "few/husman2000-figure6-tolerance.h5") as fewer,
    ):
        assert many["tolerance/value"].shape[0] == found.builds
        assert not np.isnan(many["tolerance/value"][:]).any()
        first = [group["tolerance/ratio"][:600] for group in (many, fewer)]
        np.testing.assert_allclose(*first, rtol=1e-8, atol=1e-12)
    assert few["precision"] is None
    bounded = run("tolerance", file, *options, "--no-plot", "--builds", "600")
    assert "600 of 600 builds hang" in bounded.stdout
    assert "more --builds reach it" in bounded.stdout


def test_failures_are_reported(tmp_path):
    file = scattered(tmp_path, wire=[{"stage": "test", "length": {"normal": 3e-3}}])
    result = run(
        "tolerance", file, "--builds", "40", "--out", tmp_path, "--workers", "1", "--no-plot"
    )
    assert result.exit_code == 0
    assert "of 40 builds failed: a wire is slack" in result.stderr
    good = int(result.stdout.split(" of 40 builds hang on taut wires")[0].split("\n")[-1])
    assert 0 < good < 36


def test_fractions_say_of_which_builds_they_are(tmp_path):
    """Of 200 builds, of which some do not hang; the table counts these with all others."""
    require = [{"quantity": "test static pitch", "below": 2e-1}]
    file = scattered(
        tmp_path, wire=[{"stage": "test", "length": {"normal": 1.5e-3}}], require=require
    )
    done = run(
        *("tolerance", file, "--builds", "200", "--out", tmp_path, "--workers", "1"),
        *("--fidelity", "string"),
    )
    found = sus.load(tmp_path / "husman2000-figure6-tolerance.h5")
    good, met = found.good, found.joint.fraction
    assert 200 * met < good < 200
    assert f"of the {good} builds that hang lie below 0.001" in done.stdout
    figure = found.plot()
    said = [text.get_text() for text in figure.findobj(Text)]
    assert any(f"{100 * met:.3g} %" in one and "of 200 builds meet" in one for one in said)
    assert any(f"{200 - good} builds failed" in one for one in said)
    assert any("of those that hang: coupling" in one for one in said)
    bars = figure.axes[0].patches
    tops = max(bars, key=lambda one: len(one.get_path().vertices)).get_path().vertices
    assert tops[:, 1].max() < 100 * good / 200


def test_equal_labels_of_modes_are_numbered(tmp_path):
    raw = tomllib.loads(sus.example("geo-silica-triple").text)
    raw["tolerance"] = {"body": [{"stage": "test", "mass": {"normal": 0.001}}]}
    answer = tolerance(written(tmp_path, raw), tmp_path, "--fidelity", "string", builds=4)
    labels = [mode["label"] for mode in answer["modes"]]
    assert len(set(labels)) == len(labels) and "upper transverse#2" in labels
    found = sus.load(next(tmp_path.glob("*.h5")))
    assert "upper transverse#2" in str(found)
    with h5py.File(next(tmp_path.glob("*.h5"))) as file:
        assert file["tolerance/mode_label"].asstr()[:].tolist() == labels


def test_nothing_but_failures(tmp_path, monkeypatch):
    """What hangs nowhere is given up early here."""
    monkeypatch.setattr(equilibrium, "ITERATIONS", 12)
    monkeypatch.setattr(equilibrium, "STEPS", equilibrium.STEPS[:1])
    file = scattered(tmp_path, body=[{"stage": "test", "com": {"uniform": 0.5}}])
    answer = tolerance(file, tmp_path, builds=4)
    assert answer["good"] == 0
    assert answer["coupling"]["fraction_under_limit"] is None
    assert all(value is None for mode in answer["modes"] for value in mode["quantiles_hz"])
    assert (
        run("tolerance", file, "--builds", "4", "--workers", "1", "--out", tmp_path).exit_code == 0
    )


def test_the_default_is_what_the_builds_need(tmp_path):
    """Bending changes their couplings by a third; the error of strings, from extreme builds,
    against all builds."""
    options = ("--builds", "40", "--workers", "1", "--no-plot", "--out", tmp_path, "--json")
    ratio, error, level = [], [], []
    for words in ((), ("--tolerance", "0.9"), ("--fidelity", "beam")):
        done = run("tolerance", TRIPLE, *options, *words)
        assert "warning" not in done.stderr
        with h5py.File(tmp_path / "triple-tolerance-tolerance.h5") as results:
            ratio.append(results["tolerance"]["ratio"][:])
            error.append(results.attrs["estimated_error"])
            assert strict_json(done.stdout)["estimated_error"] == error[-1]
            assert "neglected: wire " in results.attrs["fidelity_reason"]
            level.append(results.attrs["fidelity"])
    assert level == ["beam", "string", "beam"]
    assert 0 < error[0] == error[2] < 1e-3
    new, old = ratio[:2]
    assert (new == ratio[2]).all()
    assert np.abs(old - new).max() / np.abs(new).max() == pytest.approx(error[1], rel=0.5)


@pytest.mark.parametrize(
    ("unit", "change"), [("1", "+0.02 Hz per %"), ("m", "+0.002 Hz per mm"), ("kg", "+2 Hz per kg")]
)
def test_changes_are_per_step_of_the_unit(unit, change):
    """A factor by one per cent; a number of another unit never by 0.01 of it, called a per cent."""
    summary = SimpleNamespace(factor=("test n",), factor_unit=(unit,), significant=0.1)
    rank, slope = np.array([1.0]), np.array([2.0])
    results = SimpleNamespace(displayed=("Hz", 1.0), rank=rank, slope=slope)
    found = command._causes(summary, results, 1)  # pyright: ignore
    assert found == f"test n +1.00 ({change})"


FILE = "triple-tolerance-tolerance.h5"


def test_rotation_vectors_are_scipys():
    rng = np.random.default_rng(4)
    vector = rng.normal(size=(5, 3)) * np.array([1e-12, 1e-6, 1e-3, 0.1, 1.0])[:, None]
    turn = rotation_minus_identity(vector)
    np.testing.assert_allclose(rotation_vector(turn), vector, rtol=1e-14)
    np.testing.assert_allclose(
        rotation_vector(turn[2:]), Rotation.from_matrix(np.eye(3) + turn[2:]).as_rotvec(), rtol=1e-9
    )
    assert (rotation_vector(np.zeros((2, 3, 3))) == 0).all()


def test_statics_of_wires_of_unequal_length():
    """On four plumb wires at the height of the COM a body lies in the plane that fits their ends
    best: height, roll and pitch from the changes of length; to 1 %, for what gravity resists."""
    wires = [{"stage": "test", "length": {"uniform": 2e-6}}]
    job = job_of(table_1(1) | {"tolerance": {"wire": wires}}, 20)
    longer, found = job.deviations(0, 20), job.compute(0, 20)
    ends = job.scene.wires.lower_point
    x, y = ends[:, 0], ends[:, 1]
    static = statics(job, found)[:, 0]
    scale = 2e-6
    np.testing.assert_allclose(static[:, 2], -longer.mean(1), atol=0.01 * scale)
    np.testing.assert_allclose(
        static[:, 3], -longer @ y / (y**2).sum(), atol=0.01 * scale / np.abs(y).max()
    )
    np.testing.assert_allclose(
        static[:, 4], longer @ x / (x**2).sum(), atol=0.01 * scale / np.abs(x).max()
    )


def test_statics_of_a_com_off_its_place():
    """A pendulum on one wire at a height d above the COM hangs with the wire's line through the
    COM: it turns by the offset over d, and the point where the COM is as drawn moves by it."""
    raw = {
        "design": {"name": "one"},
        "stage": [
            {
                "name": "test",
                "body": {"mass": 5.0, "inertia": [0.02, 0.02, 0.03]},
                "wires": {"count": 1, "l": 0.3, "d": 0.02, "k": 1e6},
            }
        ],
        "tolerance": {"body": [{"stage": "test", "com": {"uniform": 1e-4}}]},
    }
    job = job_of(raw, 30)
    offset, static = job.deviations(0, 30), statics(job, job.compute(0, 30))[:, 0]
    arm = 0.02 - offset[:, 2]
    angle = np.arctan2(np.hypot(offset[:, 0], offset[:, 1]), arm)
    np.testing.assert_allclose(np.hypot(static[:, 3], static[:, 4]), angle, rtol=1e-9)
    np.testing.assert_allclose(static[:, 4] / -static[:, 3], offset[:, 0] / offset[:, 1], rtol=1e-6)
    assert (static[:, 4] * offset[:, 0] > 0).all()  # the heavier side goes down
    # the wire stays plumb, and the lower end in its place: the point is d below it in the body
    np.testing.assert_allclose(static[:, 0], -0.02 * np.sin(static[:, 4]), rtol=1e-3)
    np.testing.assert_allclose(static[:, 2], 0.02 * (1 - np.cos(angle)), rtol=1e-3)


REQUIRE = (
    "test static pitch < 0.05",
    "upper static height in -1e-4:2e-4",
    "test pitch in 0.49:0.51",
    "coupling < 1e-3",
    "test.x/support.x:10 > 5e-6",
)


def test_yields(tmp_path):
    """Those of the file's columns, with Wilson's intervals; `plot` finds them again."""
    words = [word for text in REQUIRE for word in ("--require", text)]
    raw = tomllib.loads(TRIPLE.read_text())
    raw["tolerance"].pop("require")
    base = (written(tmp_path, raw), "--builds", "150", "--fidelity", "string", "--workers", "1")
    reported = run("tolerance", *base, "--out", tmp_path, *words)
    assert reported.exit_code == 0, reported.stderr
    answer = sus.load(tmp_path / FILE).document()
    with h5py.File(tmp_path / FILE) as stored:
        group = stored["tolerance"]
        names = group["quantity"].asstr()[:].tolist()
        column = dict(zip(names, group["value"][:].T, strict=True))
        pitch = column["test pitch"]
        height = column["upper static height"]
        turned = column["test static pitch"]
        met = np.array(
            [
                np.abs(turned) < 0.05,
                (height >= -1e-4) & (height <= 2e-4),
                (pitch >= 0.49) & (pitch <= 0.51),
                np.abs(group["ratio"][:, 0]) < 1e-3,
                column["test.x/support.x:10"] > 5e-6,
            ]
        )
        assert group["yield"][:] == pytest.approx(met.mean(1))
        assert group.attrs["yield_of_all"] == pytest.approx(met.all(0).mean())
        value = group["value"][:]
        width = len(names)
        assert group["result_mean"][:width] == pytest.approx(value.mean(0), rel=1e-12)
        np.testing.assert_allclose(
            group["result_quantiles"][:width], np.quantile(value, QUANTILES, 0).T
        )
    assert len(answer["requirements"]) == 5
    for item, row in zip(
        [*answer["requirements"], answer["all_requirements"]], [*met, met.all(0)], strict=True
    ):
        assert item["yield"] == pytest.approx(row.mean())
        expected = stats.binomtest(int(row.sum()), 150).proportion_ci(method="wilson")
        assert item["interval"] == pytest.approx(tuple(expected))
    pitches = next(s for s in answer["statics"] if s["quantity"] == "test static pitch")
    assert pitches["unit"] == "rad"
    assert pitches["std"] == pytest.approx(turned.std())
    assert "|test static pitch| < 50 mrad" in reported.stdout
    assert "all together" in reported.stdout
    assert "% of builds lie below 0.001" in reported.stdout
    assert {path.name for path in tmp_path.glob("triple*")} == {FILE, FILE[:-3] + ".png"}
    # only what is significant is printed
    least = answer["significant_correlation"]
    assert least == pytest.approx(3 / np.sqrt(150))
    printed = [abs(float(word)) for word in re.findall(r" ([-+]\d\.\d\d) \(", reported.stdout)]
    assert printed and min(printed) > least - 0.005


def test_requirements_of_the_design_and_shares_of_variance(tmp_path):
    """The vertical mode of a stage varies with its mass alone: f ~ m^(-1/2). Requirements of the
    tolerance, of the design and of the command count together."""
    table = {
        "body": [{"stage": "test", "mass": {"normal": 0.001}, "com": {"normal": 1e-5}}],
        "require": [{"quantity": "test vertical", "above": 1.0}],
    }
    own = [{"quantity": "test static pitch", "at_least": -1, "at_most": 1}]
    file = written(tmp_path, table_1(1) | {"tolerance": table, "requirement": own})
    result = run(
        *("tolerance", file, "--builds", "300", "--require", "lowest vertical < 1"),
        *("--fidelity", "string", "--workers", "1", "--json", "--out", tmp_path),
    )
    assert result.exit_code == 0, result.stderr
    answer = strict_json(result.stdout)
    found = answer["variance_shares"]
    assert found["tolerances"] == ["test body mass", "test body com"]
    vertical = found["results"].index("test vertical")
    assert found["share"][vertical] == pytest.approx([1.0, 0.0], abs=1e-3)
    assert found["share_error"][vertical] == pytest.approx([0.0, 0.0], abs=1e-3)
    assert found["r_squared"][vertical] == pytest.approx(1.0, abs=1e-4)
    assert [item["requirement"] for item in answer["requirements"]] == [
        "test vertical > 1 Hz",
        "test static pitch in -1000 to 1000 mrad",
        "lowest vertical < 1 Hz",
    ]
    assert [item["yield"] for item in answer["requirements"]] == [1.0, 1.0, 0.0]
    assert answer["all_requirements"]["yield"] == 0.0


def test_requirements_on_no_quantity_are_refused(tmp_path):
    raw = tomllib.loads(TRIPLE.read_text())
    raw["tolerance"]["require"] = [{"quantity": "test pitsch", "below": 1}]
    file, out = written(tmp_path, raw), tmp_path / "out"
    result = run("tolerance", file, "--fidelity", "string", "--out", out)
    [line] = assert_refused(result, file, out)
    assert line.startswith(
        'tolerance.require.1.quantity = "test pitsch": is no quantity of this design'
    )


def test_check_finds_unknown_quantities(tmp_path):
    raw = tomllib.loads(TRIPLE.read_text())
    raw["tolerance"]["require"] = [
        {"quantity": name, "below": 1}
        for name in ("test pitch", "test pitsch", "test static pitch", "tset static pitch")
    ]
    result = run("check", written(tmp_path, raw))
    found = [line for line in result.stderr.splitlines() if "tolerance.require" in line]
    assert len(found) == 2
    assert 'tolerance.require.2.quantity = "test pitsch": is no quantity of this' in found[0]
    assert 'tolerance.require.4.quantity = "tset static pitch": names no stage' in found[1]
