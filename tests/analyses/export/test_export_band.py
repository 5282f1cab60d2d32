"""The band in which an export is right, and what is said where there is none."""

from __future__ import annotations

import json
import tomllib

import numpy as np
import pytest
from scipy.io import loadmat

import suspension_cli as sus
from suspension_cli.design.reader import template
from tests.support import plants
from tests.support.commandline import run, strict_json, written

DAMPED = plants.CONFIGS / "triple-damped.toml"


@pytest.mark.parametrize("form", ["mat", "control"])
def test_no_band_is_said(form, tmp_path):
    """The pitch of the support moves the upper mass along x by losses alone at most frequencies:
    that response of 144 is more than 1 % off everywhere."""
    arguments = ("export", DAMPED, "--loss", "--format", form, "--out", tmp_path)
    done = run(*arguments)
    assert done.exit_code == 0
    assert (
        "no band" in done.stdout
        and "0 to 0" not in done.stdout
        and "from" not in done.stdout.split("no band")[1].splitlines()[0]
    )
    answer = strict_json(run(*arguments, "--json").stdout)
    assert answer["band_hz"] is None
    assert answer["worst_error"] > 0.01
    if form == "mat":
        assert np.isnan(
            loadmat(tmp_path / "triple-damped-statespace.mat", simplify_cells=True)["pendsus"][
                "band_hz"
            ]
        ).all()
    else:
        written = strict_json((tmp_path / "triple-damped-statespace-control.json").read_text())
        assert written["band_hz"] is None and json.dumps(written, allow_nan=False)


def test_zeros_and_poles_written_are_numbers(tmp_path):
    """Where losses couple y to roll by roundings alone one zero would be at infinity, and the worst
    error NaN."""
    file = plants.CONFIGS / "husman2000" / "triple-vertical.toml"
    signal = ("--input", "support.roll", "--output", "upper.y")
    options = ("--loss", "--format", "zpk", "--json", "--out", tmp_path, *signal)
    answer = strict_json(run("export", file, *options).stdout)
    assert answer["worst_error"] is not None


@pytest.mark.parametrize("output", ["test.x", "test.yaw"])
@pytest.mark.parametrize("error", [0.01, 0.1])
def test_bands_of_agreement_with_wires_that_have_mass(output, error, tmp_path):
    """Where the file departs from `response` on violin, far above the modes."""
    into = f"support.{output[5:]}"
    options = ("--input", into, "--output", output, "--format", "npz", "--out", tmp_path)
    answer = strict_json(run("export", DAMPED, *options, "--json").stdout)["agreement"]
    assert answer["model"] == "violin"
    band = answer["pairs"][0][f"band_hz_{100 * error:g}_percent"]
    with np.load(tmp_path / "triple-damped-statespace.npz") as read:
        a, b, c, d = (read[name] for name in "ABCD")
        ends = [read[f"agreement_{end}_hz"][[0.01, 0.1].index(error)] for end in ("from", "to")]
    assert np.ravel(ends) == pytest.approx(band)
    f = band[1] * np.array([0.9, 1.1])
    made = [(c @ np.linalg.solve(2j * np.pi * at * np.eye(len(a)) - a, b) + d)[0, 0] for at in f]
    design = sus.read(DAMPED)
    found = sus.response(design, inputs=[into], outputs=[output], frequency=f, fidelity="violin")
    inside, beyond = np.abs(made / found.value[:, 0, 0] - 1)
    assert 0.5 * error < inside < error < beyond < 1.5 * error
    lowest = sus.modes(design, fidelity="string").frequency[0]
    assert band[0] < lowest  # resonances and zeros do not interrupt it


@pytest.mark.parametrize("form", ["mat", "hdf5", "control"])
def test_agreement_is_not_known_without_cross_sections(form, tmp_path):
    raw = tomllib.loads(template("single", "single"))
    wires = raw["stage"][0]["wires"]
    del wires["radius"], wires["material"]
    wires["k"] = 4e4
    file = written(tmp_path, raw)
    options = ("export", file, "--format", form, "--out", tmp_path)
    said = run(*options).stdout
    assert "agreement with the violin model" in said
    assert "is not known: wire test.1 has no cross-section; give the material" in said
    answer = strict_json(run(*options, "--json").stdout)["agreement"]
    assert answer["pairs"] is None and "no cross-section" in answer["unknown"]
