"""The band in which an export is right, and what is said where there is none."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.io import loadmat

from suspension_cli.analyses.export import solve as export
from suspension_cli.linear import statespace
from tests.support import plants
from tests.support.commandline import run, strict_json

DAMPED = plants.CONFIGS / "triple-damped.toml"


@pytest.mark.parametrize("form", ["mat", "control"])
def test_no_band_is_said(form, tmp_path):
    """Modal damping in place of loss angles is more than 1 % off everywhere for one of 144
    responses of this design."""
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


class Wrong:
    """A system that is right at some of the frequencies tried and 10 % off at the others."""

    def __init__(self, system, right):
        self.system, self.right = system, right

    def at(self, frequency):
        value = self.system.at(frequency)
        value[~self.right(frequency)] *= 1.1
        return value


@pytest.mark.parametrize(
    ("right", "expected"), [((1.0, 1.0001), None), ((1.0, 2.0), (1.0, 2.0)), ((0.0, 0.0), None)]
)
def test_one_frequency_is_no_band(right, expected):
    model = plants.model("triple", "force")
    inputs, outputs = plants.drives(model, "support.x"), plants.motions(model, "test.x")
    system = statespace.build(model, inputs, outputs)
    grid = np.geomspace(*statespace.agreement_band(system, model, inputs, outputs)[2], 801)
    low = grid[np.searchsorted(grid, right[0])]
    high = max(grid[np.searchsorted(grid, right[1])], low) if expected else low
    band, worst, tried = statespace.agreement_band(
        Wrong(
            system, lambda f: (f >= low * (1 - 1e-9)) & (f <= high * (1 + 1e-9)) & (right[1] > 0)
        ),
        model,
        inputs,
        outputs,
    )
    assert worst == pytest.approx(0.1)
    assert tried == (grid[0], grid[-1])
    assert band is None if expected is None else band == pytest.approx((low, high))


def test_zeros_at_infinity_are_left_out():
    """x' = A x with c A^2 b = 1 after a c b of 1e-17 that is rounding: no zero at all, degree 3."""
    a = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-6.0, -11.0, -6.0]])
    assert export._leading(a, np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0]), 0.0) == (3, 1.0)
    assert export._leading(a, np.array([0.0, 0.0, 1.0]), np.array([1.0, 1.0, 0.0]), 0.0) == (2, 1.0)
    assert export._leading(a, np.array([0.0, 0.0, 1.0]), np.array([1.0, 1.0, 0.0]), 0.0, 2)[0] == 3


def test_zeros_and_poles_written_are_numbers(tmp_path):
    """Where modal losses couple y to roll by roundings alone one zero would be at infinity, and the
    worst error NaN."""
    file = plants.CONFIGS / "husman2000" / "triple-vertical.toml"
    answer = strict_json(
        run(
            "export",
            file,
            "--loss",
            "--format",
            "zpk",
            "--json",
            "--out",
            tmp_path,
            "--input",
            "support.roll",
            "--output",
            "upper.y",
        ).stdout
    )
    assert answer["worst_error"] is not None
