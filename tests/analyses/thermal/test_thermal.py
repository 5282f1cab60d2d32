"""Thermal noise: the power lost against the susceptibility, a pendulum on one wire in many digits,
equipartition, symmetry."""

from __future__ import annotations

import copy
import math
import tomllib

import numpy as np
import pytest

from suspension_cli.conventions import BOLTZMANN
from suspension_cli.design.reader import template
from suspension_cli.errors import InputError
from tests.support import plants
from tests.support.lossy import (
    FREQUENCY,
    KINDS,
    LEVELS,
    form,
    from_susceptibility,
    lossier,
    model_of,
    noise,
    raw,
)
from tests.support.pendulums import Pendulum

LOST = {"silica": 1e-8}
"""Short sections are 1e4 times as stiff as the whole fibre; joining them takes as many digits, both
of the stiffness and of the power."""


# two routes and a split


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("kind", KINDS)
def test_power_lost_is_the_imaginary_susceptibility(kind, level):
    """Measured: 1e-13 for a single pendulum to 8e-10 for silica under three stages, whose loss
    drowns in the susceptibility."""
    model = model_of(raw(kind), level)
    some = FREQUENCY[::5]
    for dof in ("x", "z", "pitch"):
        found = noise(model, f"test.{dof}@0,0,0.001" if dof == "x" else f"test.{dof}", some)
        row = form(model, found.output)
        np.testing.assert_allclose(
            found.density.sum(0),
            from_susceptibility(model, some, row),
            rtol=1e-6,
        )


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("kind", KINDS)
def test_and_to_all_digits_where_loss_is_large(kind, level):
    model = model_of(lossier(raw(kind), 0.05), level)
    found = noise(model, "test.x@0,0,0.001")
    row = form(model, found.output)
    np.testing.assert_allclose(
        found.density.sum(0),
        from_susceptibility(model, FREQUENCY, row),
        rtol=LOST.get(kind, 1e-10),
    )


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("kind", KINDS)
def test_no_source_is_negative(kind, level):
    model = model_of(raw(kind), level)
    for dof in ("x", "y", "z", "roll", "pitch", "yaw"):
        found = noise(model, f"test.{dof}", FREQUENCY[::5])
        assert len(found.source)
        assert (found.density >= 0).all()
        assert found.density.any(1).all()
        np.testing.assert_allclose(
            sum(part**2 for part in found.parts.values()), found.amplitude**2, rtol=1e-12
        )


def test_every_kind_of_source_has_its_name():
    found = noise(model_of(raw("around")), "test.x@0,0.01,0.02")
    assert {name.rpartition(".")[2] for name in found.source} >= {
        "bending-upper",
        "bending-lower",
        "stretching",
        "damping",
        "springs",
        "support",
    }


# one wire


@pytest.mark.parametrize("inertia", [1e-9, 1e-4, 1e3], ids=["free", "between", "clamped"])
@pytest.mark.parametrize("level", LEVELS)
def test_point_mass_on_a_wire(level, inertia):
    """From the wire's equation in 50 digits; the end of the wire is free to turn, turns with the
    body, is clamped. Violin modes at 284 Hz, ... ."""
    one = Pendulum(inertia=inertia)
    frequency = np.array(
        [
            0.01,
            0.3,
            0.7,
            1.0,
            5.0,
            30.0,
            100.0,
            282.0,
            283.0,
            283.5,
            284.0,
            290.0,
            560.0,
            1000.0,
            5000.0,
        ]
    )
    expected = [one.density_of_noise(value, massive=level == "violin") for value in frequency]
    np.testing.assert_allclose(
        noise(model_of(one.raw(), level), "test.x", frequency).density.sum(0), expected, rtol=1e-11
    )


# equipartition


def test_equipartition_of_everything():
    """Viscous loss alone: over all frequencies k T times the static compliance, however many modes
    there are."""
    design = tomllib.loads(template("single", "single"))
    design["stage"][0]["damping"] = {
        "x": 60.0,
        "y": 50.0,
        "z": 900.0,
        "roll": 0.5,
        "pitch": 0.4,
        "yaw": 0.4,
    }
    design["materials"] = {"steel302": {"loss": {"thermoelastic": False}}}
    model = model_of(design, "beam")
    stiffness = model.stiffness[6:, 6:]
    log = np.linspace(math.log(1e-4), math.log(1e5), 20001)
    for dof in ("x", "pitch", "z"):
        found = noise(model, f"test.{dof}", np.exp(log))
        assert found.source == ("damping",)
        row = form(model, f"test.{dof}")
        area = np.trapezoid(found.density.sum(0) * np.exp(log), log) + found.density[0, 0] * 1e-4
        expected = BOLTZMANN * 290 * row[6:] @ np.linalg.solve(stiffness, row[6:])
        assert area == pytest.approx(expected, rel=1e-5)


# symmetry and frames


def test_temperatures():
    """Each part dissipates at its own: twice as warm below, twice the power from there."""
    cold = raw("silica")
    for stage in cold["stage"]:
        stage["wires"]["temperature"] = {"upper": 100.0, "lower": 100.0}
    cold["materials"] = {
        name: {"loss": {"thermoelastic": False}}
        for name in ("fused-silica", "c70steel", "maraging")
    }
    warm = copy.deepcopy(cold)
    step = [[0.0, 100.0], [0.45, 100.0], [0.55, 200.0], [1.0, 200.0]]
    warm["stage"][-1]["wires"]["temperature"] = step
    before, after = (noise(model_of(given), "test.x") for given in (cold, warm))
    for source, part in before.parts.items():
        if source != "test.stretching":  # at the temperatures of the whole wire
            np.testing.assert_allclose(
                after.parts[source],
                part * (math.sqrt(2) if source == "test.bending-lower" else 1),
                rtol=5e-3,  # violin modes bend the middle too
            )


# faults


def test_without_loss_there_is_none():
    given = plants.raw("single")
    given["materials"] = {"steel302": {"loss": {"thermoelastic": False}}}
    found = noise(model_of(given), "test.x")
    assert found.source == ()
    assert found.density.shape == (0, len(FREQUENCY))
    assert not found.amplitude.any()


def test_what_gives_power_back_is_refused():
    given = raw("single")
    matrix = np.diag([1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    spring = {"stiffness": (-10 * matrix).tolist(), "loss_angle": 0.1, "active": True}
    given["stage"][0]["spring"] = [spring]
    with pytest.raises(InputError, match="gives power back"):
        noise(model_of(given), "test.x")
