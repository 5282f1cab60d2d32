"""Responses of builds by one elimination for all, against those of each design alone."""

from __future__ import annotations

import numpy as np
import pytest

from suspension_cli.design.reader import read
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.linear import response, signals
from suspension_cli.models import registry
from suspension_cli.scene.stack import stack_scenes
from suspension_cli.studies import builds
from tests.support.golden import CONFIGS

FREQUENCY = np.array([0.0, 1e-3, 0.05, 0.2, 3.0, 50.0])
INPUTS = ("support.x", "support.z", "support.yaw")


@pytest.mark.parametrize("level", ["string", "beam"])
@pytest.mark.parametrize("name", ["imperfect", "triple-tolerance", "cryogenic-payload", "tower"])
def test_as_a_design_alone(name, level, monkeypatch):
    """Errors are at most 1e-8 of a response, or 1e-14 of the support's motion; in any chunks."""
    design = read(CONFIGS / f"{name}.toml").design
    model = registry.by_name(level).system(design)
    known = signals.bodies_with_signals(model)
    drives = [signals.parse_input(text, known) for text in INPUTS]
    seen = [signals.parse_output(f"{model.body[-1]}.{dof}", known) for dof in ("x", "z", "pitch")]
    alone = response.solve(model, FREQUENCY, drives, seen).value
    found = builds.balance(stack_scenes([expand(design)] * 3), design, level=level)
    for chunk in (1, 12, 512):
        monkeypatch.setattr(response, "BUILDS", chunk)
        batch = builds.transfer(found, FREQUENCY, drives, seen)
        assert (np.abs(batch - alone) <= 1e-8 * np.maximum(np.abs(alone), 1e-6)).all()


def test_a_build_that_failed_leaves_the_others_alone():
    """One with a slack wire has no response."""
    design = read(CONFIGS / "triple-tolerance.toml").design
    found = builds.balance(stack_scenes([expand(design)] * 3), design)
    found.status[1] = builds.SLACK
    found.model.stiffness[1] = np.nan
    known = signals.bodies_with_signals(found.model)
    drive, out = signals.parse_input("support.x", known), signals.parse_output("test.x", known)
    value = builds.transfer(found, np.array([1.0]), [drive], [out])[:, 0, 0, 0]
    assert np.isnan(value[1])
    assert value[0] == pytest.approx(value[2], rel=1e-12)
