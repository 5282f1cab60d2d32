"""The largest value that `response` prints lies at the pole, whatever the grid."""

from __future__ import annotations

import re

import numpy as np
import pytest

from suspension_cli.design.reader import read
from tests.support.commandline import run
from tests.support.golden import CONFIGS

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
