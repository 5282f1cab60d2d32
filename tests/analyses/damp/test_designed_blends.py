"""`pendsus damp --design blend`: complementary filters of two sensors from their noise."""

from __future__ import annotations

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.design import noise_spectra
from suspension_cli.design.foton import Filter
from suspension_cli.design.loop_filters import make_response
from suspension_cli.errors import InputError
from suspension_cli.physics import blends
from tests.support.commandline import run, strict_json
from tests.support.paths import CONFIGS

LIGHT = {"fidelity": "string", "frequency": [1.0], "duration": 1.0}
OMEGA = np.logspace(-2, 2, 1000)
FREQUENCY = OMEGA / (2 * np.pi)


def published_noises(omega):
    """Noise of two sensors in test_complementary_filter.py of terrencetec/kontrol."""
    s = 1j * omega
    return np.abs(10 * (0.1 * s + 1) / (10 * s + 1)), np.abs((10 * s + 1) / (0.1 * s + 1))


def table_of(noise):
    """A noise in m/sqrt(Hz), of 1e-10 times the published one, as a table."""
    return {"frequency": FREQUENCY.tolist(), "asd": (1e-10 * noise).tolist()}


def blended(first, second, **inputs):
    """The damped triple pendulum with a blend of two sensors in its loop in x."""
    plain = sus.read(CONFIGS / "triple-damped.toml")
    sensors = [
        {"name": "one", "motion": "upper~support.x", "sensor_noise": first},
        {"name": "two", "motion": "upper.x", "sensor_noise": second},
        {
            "name": "both",
            "blend": True,
            "inputs": [
                {"sensor": "one", "filter": 'zpk([],[0.1],1,"n")'},
                {"sensor": "two", "filter": "rest"},
            ],
        }
        | inputs,
    ]
    silent = plain.replace({"control.loop.x.sensor_noise": 0.0})
    return silent.replace({"control.sensor": sensors, "control.loop.x.sensor": "both"})


def filters_of(design):
    """Responses of both inputs of the blend at `FREQUENCY`."""
    [sensor] = [one for one in design.design.control.sensor if one.blend]
    [explicit] = [one for one in sensor.inputs if not one.is_rest]
    made = make_response(explicit.filter).at(FREQUENCY)
    both = {explicit.sensor: made}
    return both.setdefault("one", 1 - made), both.setdefault("two", 1 - made)


def test_the_published_blend():
    """The bound 1.37332, order 4, and the noise at [400] and [599] that kontrol's test prints."""
    one, two = published_noises(OMEGA)
    found = sus.damp(blended(table_of(one), table_of(two)), method="blend", order=2, **LIGHT)
    [blend] = found.blends
    assert blend.bound == pytest.approx(1.37332, rel=1e-3)
    assert blend.poles == 4
    first, second = filters_of(found.run.design)
    noise = np.hypot(np.abs(first) * one, np.abs(second) * two)
    assert noise[400] == pytest.approx(4.11535263, rel=1e-3)
    assert noise[599] == pytest.approx(0.70350559, rel=1e-3)


def test_the_bound_is_that_of_another_solver():
    """gamma of `control.hinfsyn` on the plant [[0, n2/n1, 1], [n1/n2, -n2/n1, 0]]."""
    control = pytest.importorskip("control")
    pytest.importorskip("slycot")
    corners = [(10.0, (0.3, 2.0), (0.05, 0.1)), (3.0, (20.0,), (0.7,))]
    for gain, zeros, poles in corners:
        [found, _] = blends.blend(Filter(gain * np.prod(poles) / np.prod(zeros), zeros, poles))
        s = control.tf("s")
        ratio = control.tf([gain], [1], 0)
        for zero in zeros:
            ratio *= 1 + s / zero
        for pole in poles:
            ratio /= 1 + s / pole
        none, one = control.tf([0], [1], 0), control.tf([1], [1], 0)
        plant = control.combine_tf([[none, 1 / ratio, one], [ratio, -1 / ratio, none]])
        _, _, bound, _ = control.hinfsyn(control.ss(plant), 1, 1)
        assert found.bound / blends.ABOVE == pytest.approx(bound, rel=1e-3)


@pytest.mark.parametrize(("first", "second"), [("cps-quarter-mm", "t240"), ("gs13", "cps-1mm")])
def test_known_sensors(first, second):
    """Where their noises are known, and differ by less than the largest ratio, the bound holds up
    to the error of the fit."""
    found = sus.damp(blended(first, second), method="blend", **LIGHT)
    [blend] = found.blends
    ratio = noise_spectra.density(first, FREQUENCY) / noise_spectra.density(second, FREQUENCY)
    one, two = filters_of(found.run.design)
    reached = np.hypot(np.abs(one) * ratio, np.abs(two) / ratio)
    near = (np.abs(np.log(ratio)) < np.log(blend.largest) / 2) & (FREQUENCY > 0.02)
    assert reached[near].max() < blend.bound * (1 + blend.misfit)


def test_the_design_with_the_filters_is_written(tmp_path):
    blended("cps-quarter-mm", "t240").save(tmp_path / "start.toml")
    light = ("--fidelity", "string", "--frequency", "1,10", "--duration", "1")
    how = ("--design", "blend", "--redesign", "both", "--json")
    result = run("damp", tmp_path / "start.toml", *light, *how, "--out", tmp_path)
    assert result.exit_code == 0, result.stderr
    [row] = strict_json(result.stdout)["blends"]
    assert (row["blended"], row["first"], row["second"]) == ("both", "one", "two")
    again = sus.read(tmp_path / "triple-damped-blend.toml")
    first, second = filters_of(again)
    np.testing.assert_allclose(first + second, 1, rtol=1e-12)


def test_what_cannot_be_blended_is_refused():
    with pytest.raises(InputError, match="has no blend of two sensors"):
        sus.damp(CONFIGS / "triple-damped.toml", method="blend", **LIGHT)
    with pytest.raises(InputError, match="names no blend"):
        sus.damp(blended("t240", "gs13"), method="blend", redesigned=["x"], **LIGHT)
    with pytest.raises(InputError, match="is 0, so all is read by it"):
        sus.damp(blended(0.0, "gs13"), method="blend", **LIGHT)
    apart = [[0.001, 1e-9], [0.01, 1e-10]], [[0.05, 1e-9], [0.5, 1e-10]]
    with pytest.raises(InputError, match="overlap over a decade"):
        sus.damp(blended(*apart), method="blend", **LIGHT)
