"""Inertial sensors that read tilt as motion: x + g pitch / omega^2, y - g roll / omega^2."""

from __future__ import annotations

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.design.loop_filters import make_response
from suspension_cli.errors import InputError
from tests.support.paths import CONFIGS

FREQUENCY = np.array([0.05, 0.3, 3.0])
OMEGA = 2 * np.pi * FREQUENCY
SEISMOMETER = 'zpk([0;0],[0.01+i*0.01;0.01-i*0.01],5000,"n")'
FILTER = 'zpk([0],[20;30],30,"n")'
LIGHT = {"fidelity": "string", "frequency": FREQUENCY}


def fed(axis, *, tilt=True, **sensor):
    """The triple with one loop, from a seismometer on the support to the upper mass."""
    plain = sus.read(CONFIGS / "triple-damped.toml")
    one = {"name": "seis", "motion": f"support.{axis}", "response": SEISMOMETER, "tilt": tilt}
    loop = {"name": axis, "sensor": "seis", "actuator": f"upper.force_{axis}", "filter": FILTER}
    return plain.replace({"control": {"sensor": [one | sensor], "loop": [loop]}})


def respond(design, into, out, **how):
    return sus.response(design, inputs=[into], outputs=[out], **LIGHT, **how).value.ravel()


@pytest.mark.parametrize(("axis", "angle", "sign"), [("x", "pitch", 1.0), ("y", "roll", -1.0)])
def test_feed_forward_of_tilt(axis, angle, sign):
    """A tilt of the support moves the mirror directly, and by the force of the loop."""
    out = f"test.{axis}"
    closed = respond(fed(axis), f"support.{angle}", out, closed_loop=True)
    direct = respond(fed(axis), f"support.{angle}", out)
    moved = respond(fed(axis), f"upper.force_{axis}", out)
    read = make_response(SEISMOMETER).at(FREQUENCY) * sign * 9.81 / OMEGA**2
    expected = direct - moved * make_response(FILTER).at(FREQUENCY) * read
    np.testing.assert_allclose(closed, expected, rtol=1e-9)
    assert (np.abs(closed - direct) > 1e-3 * np.abs(closed)).any()


def test_tilt_in_the_budget(tmp_path):
    """Tilt of the ground moves the mirror coherently through the suspension and the sensor."""
    table = tmp_path / "tilt.csv"
    table.write_text("frequency,asd\n0.01,1e-9\n100,1e-9\n")
    design = fed("x")
    found = sus.budget(design, outputs=["test.x"], ground=[f"pitch={table}"], **LIGHT)
    part = found.motions[0].parts["ground.pitch"]
    closed = respond(design, "support.pitch", "test.x", closed_loop=True)
    np.testing.assert_allclose(part, 1e-9 * np.abs(closed), rtol=1e-6)


def test_a_sensor_on_a_stage_reads_its_tilt():
    """A loop in x from a seismometer on the upper mass becomes unstable by tilt here."""
    stable = []
    for tilt in (False, True):
        found = sus.damp(
            fed("x", tilt=tilt, motion="upper.x"), **LIGHT, duration=1.0, allow_unstable=True
        )
        stable.append(found.stable)
    assert stable == [True, False]


@pytest.mark.parametrize(
    ("sensor", "message"),
    [
        ({"motion": "support.z"}, "is not the motion along x or y"),
        ({"motion": "upper~support.x"}, "is not the motion along x or y"),
        ({"response": 'zpk([0],[0.01],100,"n")'}, "less than two zeros at 0 Hz"),
    ],
)
def test_what_reads_no_tilt_is_refused(sensor, message):
    with pytest.raises(InputError, match=message):
        fed("x", **sensor)
