"""Losses that depend on frequency, made constant for state spaces and closed loops: every mode
keeps its Q."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from suspension_cli.design.reader import read
from suspension_cli.linear import eigenmodes, response, signals, statespace
from suspension_cli.linear.statespace import with_constant_loss
from suspension_cli.models import registry
from tests.support import scenes
from tests.support.commandline import run, strict_json
from tests.support.paths import CONFIGS

DESIGNS = ("double", "quadruple", "geo-silica-triple", "triple-damped", "imperfect", "five-wires")


def beam(name):
    return registry.BEAM.system(read(CONFIGS / f"{name}.toml").design)


def silica():
    model = beam("geo-silica-triple")
    known = signals.bodies_with_signals(model)
    return model, signals.parse_input("support.x", known), signals.parse_output("test.x", known)


@pytest.mark.parametrize("name", DESIGNS)
def test_every_mode_keeps_its_q(name):
    model = beam(name)
    made = with_constant_loss(model)
    old, new = eigenmodes.solve(model), eigenmodes.solve(made)
    assert made.terms == ()
    assert np.isfinite(old.q).all()
    np.testing.assert_allclose(new.q, old.q, rtol=1e-10)
    np.testing.assert_array_equal(new.frequency, old.frequency)


@pytest.mark.parametrize("name", DESIGNS)
def test_the_loss_is_one_of_motion_relative_to_the_support(name):
    """Symmetric, positive, nothing for motion of everything as one body, and no coupling that
    symmetry forbids."""
    model = beam(name)
    made = with_constant_loss(model)
    loss = made.loss
    assert (loss == loss.T).all()
    assert np.linalg.eigvalsh(loss).min() > -1e-12 * np.abs(loss).max()
    assert np.abs(loss @ model.rigid).max() < 1e-12 * np.abs(loss).max() * np.abs(model.rigid).max()
    assert [group.tolist() for group in made.blocks] == [group.tolist() for group in model.blocks]


def test_resonances_are_as_high():
    """On each resonance the response is that with losses that depend on frequency."""
    model, drive, motion = silica()
    found = eigenmodes.solve(model)
    place = found.coordinate.index("test.x")
    touched = np.abs(found.shape[:, place]) > 1e-3
    some = found.frequency[touched]
    exact, made = (
        response.solve(one, some, [drive], [motion]).value[:, 0, 0]
        for one in (model, with_constant_loss(model))
    )
    assert touched.sum() >= 5 and np.abs(exact).max() > 1e4
    np.testing.assert_allclose(np.abs(made), np.abs(exact), rtol=1e-4)


def test_the_state_space_has_these_resonances():
    """Viscous damping of each mode by its own Q, so that |x| at a resonance is that of the direct
    solution."""
    model, drive, motion = silica()
    system = statespace.build(with_constant_loss(model), [drive], [motion])
    poles = np.linalg.eigvals(system.a)
    q = np.sort(np.abs(poles[poles.imag > 0]) / (-2 * poles[poles.imag > 0].real))
    found = eigenmodes.solve(model)
    group = (
        found.block
        == found.block[np.abs(found.shape[:, found.coordinate.index("test.x")]).argmax()]
    )
    known = np.sort(found.q[group])
    soft = known < 1e6  # eigenvalues lose larger ones in their rounding
    assert soft.sum() >= 3
    np.testing.assert_allclose(q[: soft.sum()], known[soft], rtol=1e-3)


def test_dampers_stay_what_they_are():
    model = beam("triple-damped")
    damped = replace(model, damping=1e-3 * np.pad(model.mass[6:, 6:], ((6, 0), (6, 0))))
    np.testing.assert_allclose(
        eigenmodes.solve(with_constant_loss(damped)).q, eigenmodes.solve(damped).q, rtol=1e-10
    )
    np.testing.assert_allclose(
        with_constant_loss(damped).complete, with_constant_loss(model).complete, rtol=1e-12
    )


def test_nothing_to_do():
    design = scenes.design_of(scenes.chain(np.random.default_rng(1), 2))
    model = registry.STRING.system(design)
    assert with_constant_loss(model) is model


def test_local_control_takes_bent_wires_with_their_losses(tmp_path):
    """The filters of this design ring up stiff modes that lose nothing; with what the wires lose
    they are stable, and hardly damped by the loops."""
    few = ("--frequency", "1,2", "--duration", "1")
    done = run("damp", CONFIGS / "triple-damped.toml", "--json", "--out", tmp_path, *few)
    answer = strict_json(done.stdout)
    assert answer["fidelity"] == "beam" and answer["stable"]
    roll = eigenmodes.solve(beam("triple-damped"))
    stiff = max(
        (pole for pole in answer["poles"] if pole["state"] == "test.roll"),
        key=lambda pole: pole["frequency_hz"],
    )
    assert stiff["q"] == pytest.approx(roll.q[-1], rel=0.1)
