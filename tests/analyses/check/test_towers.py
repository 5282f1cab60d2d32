"""What `pendsus check` reports of inverted pendulums and filters."""

from __future__ import annotations

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.analyses.check import solve, statics
from suspension_cli.design import reader
from tests.design.test_parts import TOWER as GOOD

G = 9.81


def checked(*settings):
    raw = reader.parse_with_overrides(GOOD, settings)
    return statics.solve(raw)


def source(*settings):
    import tomllib

    raw = tomllib.loads(GOOD)
    reader.apply_overrides(raw, settings)
    return reader.Source(reader.convert(raw), reader.write_toml(raw), "t.toml")


def test_loads_and_margin():
    [legs], load = checked().legs, 402.0 * G
    stiffness = (2 * np.pi * 0.06) ** 2 * 402.0
    np.testing.assert_allclose([legs.load, legs.stiffness], [load, stiffness], rtol=1e-12)
    np.testing.assert_allclose(legs.thrust, [load / 3] * 3, rtol=1e-12)
    # K = (W_tip - W) / L
    np.testing.assert_allclose(legs.critical, load + 0.5 * stiffness, rtol=1e-12)
    np.testing.assert_allclose(legs.tilt, 0.5 + G / (2 * np.pi * 0.06) ** 2, rtol=1e-12)
    np.testing.assert_allclose(legs.frequency, 0.06, rtol=1e-12)


def test_working_point_and_its_thermal_shift():
    [blades] = checked(
        "stage.ip.filter.load=1000.0",
        "stage.ip.filter.modulus_slope=-2.5e-4",
        "stage.ip.filter.thermal_expansion=1e-5",
    ).filters
    k = (2 * np.pi * 0.3) ** 2 * 1000.0 / G
    np.testing.assert_allclose(blades.sag, (102.0 * G - 1000.0) / k, rtol=1e-9)
    np.testing.assert_allclose(blades.thermal_force, -0.23, rtol=1e-12)
    np.testing.assert_allclose(blades.thermal_shift, -0.23 / k, rtol=1e-12)


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        (("stage.ip.inverted_pendulum.frequency=0.01",), "is near tipping: its load of 3943.62 N"),
        (("stage.ip.filter.load=1100.0",), "mm above its working point: it carries 1000.62 N"),
        (("stage.ip.inverted_pendulum.length=500.0",), "is larger than any part of a suspension"),
        (("stage.ip.filter.frequency=300.0",), "is too high to isolate from anything"),
    ],
)
def test_a_warning_says_what_and_what_to_do(settings, says):
    lines = [item.line("") for item in solve.solve(source(*settings)).warnings]
    assert any(says in line for line in lines), lines


@pytest.mark.filterwarnings("ignore::suspension_cli.errors.PendsusWarning")
def test_tipping_is_a_finding():
    text = GOOD.replace("frequency = 0.06", "stiffness = 600.0")
    found = sus.check(sus.parse(text))
    assert found.stable is False
    assert any("tips over: its load of 3943.62 N is above" in w.line("") for w in found.warnings)
    assert "inverted_pendulums" in found.document() and "filters" in found.document()
    assert found.document()["inverted_pendulums"][0]["frequency_hz"] is None
    assert "tips over at" in str(found)
    assert not sus.modes(sus.parse(text), fidelity="string").stable
