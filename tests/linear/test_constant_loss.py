"""Losses that depend on frequency, made constant for state spaces and closed loops: every mode
keeps its Q."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from suspension_cli.design.reader import read
from suspension_cli.linear import eigenmodes
from suspension_cli.linear.statespace import with_constant_loss
from suspension_cli.linear.structure import Structure
from suspension_cli.models import registry
from tests.support.commandline import run, strict_json
from tests.support.paths import CONFIGS

DESIGNS = ("double", "quadruple", "geo-silica-triple", "triple-damped", "imperfect", "five-wires")


def beam(name):
    return registry.BEAM.system(read(CONFIGS / f"{name}.toml").design)


@pytest.mark.parametrize("name", DESIGNS)
def test_every_mode_keeps_its_q(name):
    """By a loss that is symmetric, positive, nothing for motion of everything as one body, and
    couples nothing that symmetry forbids; dampers stay what they are."""
    plain = beam(name)
    dampers = 1e-3 * np.pad(plain.mass[6:, 6:], ((6, 0), (6, 0)))
    for model in (plain, replace(plain, damping=dampers)):
        made = with_constant_loss(model)
        old, new = eigenmodes.solve(model), eigenmodes.solve(made)
        assert made.terms == () and np.isfinite(old.q).all()
        np.testing.assert_allclose(new.q, old.q, rtol=1e-10)
        np.testing.assert_array_equal(new.frequency, old.frequency)
        loss = made.loss
        assert (loss == loss.T).all()
        assert np.linalg.eigvalsh(loss).min() > -1e-12 * np.abs(loss).max()
        size = np.abs(loss).max() * np.abs(model.rigid).max()
        assert np.abs(loss @ model.rigid).max() < 1e-12 * size
        assert [group.tolist() for group in Structure(made).blocks] == [
            group.tolist() for group in Structure(model).blocks
        ]


def test_local_control_takes_bent_wires_with_their_losses(tmp_path):
    """The filters of this design ring up stiff modes that lose nothing; with what the wires lose
    they are stable, and hardly damped by the loops."""
    few = ("--frequency", "1,2", "--duration", "1")
    done = run("damp", CONFIGS / "triple-damped.toml", "--json", "--out", tmp_path, *few)
    answer = strict_json(done.stdout)
    assert answer["fidelity"] == "beam" and answer["stable"]
    rolls = [pole for pole in answer["poles"] if pole["state"] == "test.roll"]
    stiff = max(rolls, key=lambda pole: pole["frequency_hz"])
    assert stiff["q"] == pytest.approx(eigenmodes.solve(beam("triple-damped")).q[-1], rel=0.1)
