"""A fit that explains nothing says so first, with larger uncertainties and the exchange of labels
that mends it."""

from __future__ import annotations

import h5py
import numpy as np
import pytest

from suspension_cli.design import reader
from suspension_cli.linear import eigenmodes, named_results
from suspension_cli.models import registry
from tests.support.commandline import run, strict_json, written
from tests.support.golden import CONFIGS

CASE = CONFIGS / "husman2000" / "table1-case4.toml"
E, INERTIA = "materials.steel302.youngs_modulus", "stage.test.body.inertia.2"
NAME = "husman2000-table1-case4-fit.h5"


def measured(exchange=(), **bounds):
    """Modes of a stiffer steel with 0.1 % noise, two of them under each other's labels."""
    found = eigenmodes.solve(registry.STRING.system(reader.read(CASE, (f"{E}=1.8e11",)).design))
    noise = np.random.default_rng(0).standard_normal(len(found.frequency))
    labels = named_results.labels(found)
    for first, second in [exchange] if exchange else []:
        i, j = labels.index(first), labels.index(second)
        labels[i], labels[j] = second, first
    rows = [
        {"frequency": float(f * (1 + 1e-3 * e)), "uncertainty": float(1e-3 * f), "label": label}
        for f, e, label in zip(found.frequency, noise, labels, strict=True)
    ]
    return {"mode": rows, "parameter": [{"name": E, "start": 1.7e11} | bounds, {"name": INERTIA}]}


def fitted(tmp_path, raw, *options, level="string"):
    result = run(
        "fit",
        CASE,
        written(tmp_path, raw, "measured.toml"),
        "--no-plot",
        *("--out", tmp_path / "out", "--fidelity", level),
        *options,
    )
    assert result.exit_code == 0, result.stderr
    return result


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    """Output of a good fit."""
    return strict_json(fitted(tmp_path_factory.mktemp("good"), measured(), "--json").stdout)


def test_a_misfit_is_reported_first(tmp_path):
    pair = ("test yaw", "test roll")
    model, _, first, second, *_ = fitted(tmp_path, measured(pair), level="auto").stdout.splitlines()
    assert model.startswith("model: beam (")
    assert first.startswith("MISFIT: chi^2 is ")
    assert all(f'"{label}"' in second for label in pair)


@pytest.mark.parametrize("pair", [("test yaw", "test roll"), ("test pitch", "test vertical")])
def test_exchanged_labels_are_found(pair, good, tmp_path):
    answer = strict_json(fitted(tmp_path, measured(pair), "--json").stdout)
    assert answer["misfit"]
    assert sorted(answer["exchange"]["labels"]) == sorted(pair)
    assert answer["exchange"]["chi_squared"] == pytest.approx(good["chi_squared"], rel=1e-6)


def test_a_good_fit_has_no_remark(good, tmp_path):
    assert "MISFIT" not in fitted(tmp_path, measured()).stdout
    assert (good["misfit"], good["sigma_scale"], good["exchange"]) == (False, 1.0, None)


def test_uncertainties_of_a_misfit_are_scaled(tmp_path):
    """By the root of chi^2 per degree of freedom, in JSON, file and table alike; the file gives the
    same picture again."""
    raw = measured()
    for row in raw["mode"]:
        # ten sigma, which no number explains
        row["frequency"] *= 1 + 0.01 * (-1) ** raw["mode"].index(row)
    answer = strict_json(fitted(tmp_path, raw, "--json", "--plot").stdout)
    scale = np.sqrt(answer["chi_squared"] / answer["degrees_of_freedom"])
    assert answer["misfit"]
    assert answer["sigma_scale"] == pytest.approx(scale, rel=1e-12)
    with h5py.File(tmp_path / "out" / NAME) as file:
        assert file["fit/sigma"][:].tolist() == [item["sigma"] for item in answer["parameters"]]
        assert file["fit"].attrs["sigma_scale"] == answer["sigma_scale"]
    picture = tmp_path / "out" / NAME.replace(".h5", ".png")
    before = picture.read_bytes()
    assert run("plot", picture.with_suffix(".h5")).exit_code == 0
    assert picture.read_bytes() == before
    wide = [{**row, "uncertainty": row["uncertainty"] * scale} for row in raw["mode"]]
    alike = strict_json(fitted(tmp_path, raw | {"mode": wide}, "--json").stdout)
    assert not alike["misfit"]
    for found, expected in zip(answer["parameters"], alike["parameters"], strict=True):
        assert found["sigma"] == pytest.approx(expected["sigma"], rel=1e-6)


def test_a_number_at_its_bound_has_no_uncertainty(tmp_path):
    raw = measured(lower=1e11, upper=1.75e11)
    result = fitted(tmp_path, raw)
    assert "  1.75000e+11  at its bound\n" in result.stdout
    head = (tmp_path / "out" / "husman2000-table1-case4-fitted.toml").read_text()
    assert "at its bound, from 1.7e+11" in head
    assert "nan" not in result.stdout + head
    number = strict_json(fitted(tmp_path, raw, "--json").stdout)["parameters"][0]
    assert (number["sigma"], number["at_bound"]) == (None, True)
