"""What `pendsus tolerance` promises: the summary, the file, and which tables it refuses."""

from __future__ import annotations

import tomllib
from types import SimpleNamespace

import h5py
import numpy as np
import pytest

from suspension_cli.analyses.tolerance import report
from suspension_cli.analyses.tolerance.statistics import QUANTILES
from suspension_cli.equilibrium import solve as equilibrium
from tests.support.commandline import run, strict_json, written
from tests.support.couplings import FILE
from tests.support.golden import CONFIGS

RAW = tomllib.loads(FILE.read_text())
TRIPLE = CONFIGS / "triple-tolerance.toml"


def scattered(folder, **table):
    """The stage of Figure 6 with a tolerance table."""
    return written(folder, RAW | {"tolerance": table})


def tolerance(file, out, *options, builds=120):
    """The JSON document of a run that must succeed."""
    result = run(
        "tolerance",
        file,
        "--builds",
        str(builds),
        *["--json", "--workers", "1", "--out"],
        out,
        *options,
    )
    assert result.exit_code == 0, result.stderr
    return strict_json(result.stdout)


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
    file = scattered(
        tmp_path, wire=[{"stage": "test", "length": {"normal": 1e-5}, "k": {"normal": 0.01}}]
    )
    tolerance(file, tmp_path / "few", builds=30)
    tolerance(file, tmp_path / "many", "--chunk", "64", builds=70)  # in two chunks
    with (
        h5py.File(tmp_path / "few/husman2000-figure6-tolerance.h5") as few,
        h5py.File(tmp_path / "many/husman2000-figure6-tolerance.h5") as many,
    ):
        for name in ("frequency", "ratio", "status"):
            assert few[f"tolerance/{name}"][:].tobytes() == many[f"tolerance/{name}"][:30].tobytes()


def test_failures_are_reported(tmp_path):
    file = scattered(tmp_path, wire=[{"stage": "test", "length": {"normal": 3e-3}}])
    result = run(
        "tolerance", file, "--builds", "40", "--out", tmp_path, "--workers", "1", "--no-plot"
    )
    assert result.exit_code == 0
    assert "of 40 builds failed: a wire is slack" in result.stderr
    good = int(result.stdout.split(" of 40 builds hang on taut wires")[0].split("\n")[-1])
    assert 0 < good < 36


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


BODY = {"stage": "test", "mass": {"normal": 0.01}}


@pytest.mark.parametrize(
    "options",
    [
        ("--builds", "0"),
        ("--seed", "-1"),
        ("--limit", "0"),
        ("--builds", "many"),
        ("--chunk", "0"),
        ("--workers", "0"),
    ],
)
def test_bad_options_are_refused(options, tmp_path):
    file = scattered(tmp_path, body=[BODY])
    result = run("tolerance", file, *options, "--out", tmp_path / "out")
    assert result.exit_code == 2
    assert not (tmp_path / "out").exists()


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
    ("unit", "change"),
    [("1", "+0.02 Hz per %"), ("m", "+0.002 Hz per mm"), ("kg", "+2 Hz per kg")],
)
def test_changes_are_per_step_of_the_unit(unit, change):
    """A factor by one per cent; a number of another unit never by 0.01 of it, called a per cent."""
    factor = SimpleNamespace(label="test n", unit=unit)
    summary = SimpleNamespace(job=SimpleNamespace(factors=(factor,)), significant=0.1)
    quantity = SimpleNamespace(displayed=("Hz", 1.0))
    results = SimpleNamespace(quantity=quantity, rank=np.array([1.0]), slope=np.array([2.0]))
    found = report._causes(summary, results, 1)  # pyright: ignore
    assert found == f"test n +1.00 ({change})"
