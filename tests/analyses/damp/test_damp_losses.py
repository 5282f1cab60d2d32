"""Local control with losses as they are: loop gains and noise from the responses of the same model,
poles as the roots of the whole problem."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from suspension_cli.analyses.damp import closed_loop_poles, control
from suspension_cli.analyses.damp import solve as damp
from suspension_cli.design.reader import read
from suspension_cli.linear import response
from suspension_cli.models import registry
from tests.analyses.damp.test_control import loop, plant
from tests.support import plants, scenes, terms
from tests.support.paths import CONFIGS

GRID = np.array([0.3, 0.6, 1.37, 3.3, 10.0, 36.174, 51.816])


@cache
def silica():
    """Fused silica with a filter and a damper, and its model with bending wires."""
    raw = plants.tomllib.loads((CONFIGS / "geo-silica-triple.toml").read_text())
    first = raw["stage"][0]["name"]
    raw["control"] = {
        "loop": [
            loop(
                f"{first}.x", gain=1e6, zeros=[0.0], poles=[20.0, [10.0, 17.0]], sensor_noise=1e-10
            )
        ]
    }
    raw["control"]["loop"].append(loop(f"{first}.pitch", damper=0.03, sensor_noise=1e-9))
    design = scenes.design_of(raw)
    return design, registry.BEAM.system(design)


@cache
def steel():
    design = read(CONFIGS / "triple-damped.toml").design
    return design, registry.BEAM.system(design)


@cache
def answered(made):
    """What `damp` gives of the last body, moved along x."""
    design, model = made()
    last = model.body[-1]
    return damp.solve(design, model, f"{last}.x", f"{last}.force_x", GRID, 1.0, samples=3)


@pytest.mark.parametrize("made", [steel, silica])
def test_gains_and_noise_are_those_of_responses(made):
    """From what `response` gives for each actuator: 1 + L_k = det(1 + H G) / det(the same without
    k), noise -G_o (1 + H G)^-1 H n."""
    design, model = made()
    loops = design.control.loop
    count, last = len(loops), model.body[-1]
    answer = answered(made)
    drives = plants.drives(model, *(one.actuator for one in loops))
    watched = plants.motions(model, *(one.sensor for one in loops), f"{last}.x")
    found = response.solve(model, GRID, drives, watched).value
    for n, frequency in enumerate(GRID):
        g, out = found[n, :count], found[n, count]
        h = np.diag([control.evaluate_filter(one, np.array(frequency)) for one in loops])
        whole = np.eye(count) + h @ g
        for k in range(count):
            rest = np.delete(np.delete(whole, k, 0), k, 1)
            assert answer.gain[n, k] == pytest.approx(
                np.linalg.det(whole) / np.linalg.det(rest) - 1, rel=1e-9, abs=1e-12
            )
        expected = np.abs(out @ np.linalg.solve(whole, h)) * [one.sensor_noise for one in loops]
        np.testing.assert_allclose(
            answer.noise[n], expected, rtol=1e-9, atol=1e-12 * expected.max()
        )


@pytest.mark.parametrize("made", [steel, silica])
def test_poles_are_roots_with_losses_at_their_own_frequency(made):
    """The smallest singular value of Z(s) + sum of H p s^T, in units of each coordinate, is all but
    0 there and not beside it."""
    design, model = made()
    found = answered(made).closed
    closed = control.build_plant(design, model)
    some = [n for n in range(len(found.value)) if found.value[n].imag > 0][::5]
    assert len(some) >= 3
    for n in some:
        s = found.value[n]
        assert smallest(closed, s) < 1e-6 * max(
            smallest(closed, s * (1 + 1e-4)), smallest(closed, s * (1 + 1e-4j))
        )


def smallest(closed, s):
    """The least determinant of a block of the closed loop, over its size with coordinates scaled to
    1."""
    model, free = closed.model, slice(6, None)
    dynamic = (model.stiffness + s * model.damping + s**2 * model.mass).astype(complex)
    for term in model.terms:
        at = np.ix_(term.columns, term.columns)
        dynamic[at] += terms.stiffness(term, s.imag)
    for one, pushed, sensed in zip(closed.loops, closed.pushed, closed.sensed, strict=True):
        dynamic = dynamic + control.evaluate_filter(one, np.array(s / (2j * np.pi))) * np.outer(
            pushed, sensed
        )
    dynamic = dynamic[free, free]
    scale = np.sqrt(
        np.abs(model.stiffness.diagonal()[free]) + abs(s) ** 2 * model.mass.diagonal()[free]
    )
    return np.linalg.svd(dynamic / np.outer(scale, scale), compute_uv=False)[-1]


@pytest.mark.parametrize("angle", [0.1, 1e-3, 1e-9])
@pytest.mark.parametrize("c", [0.0, 0.7, 40.0])
def test_one_lossy_oscillator_by_hand(angle, c):
    """m s^2 + c s + k (1 + i phi) = 0; at phi = 0.1 alone its Q is 10.04, or Im s / (-2 Re s) =
    10.025, not the 10 of first order."""
    mass, k = 3.0, 2e4
    stage = scenes.hung({"count": 1, "l": 0.7, "k": k, "material": "lossy"}, mass, 0.1)
    raw = scenes.raw_of(stage) | {
        "materials": {"lossy": {"youngs_modulus": 1e11, "loss_angle": angle}}
    }
    closed = plant(raw, [loop("test.z", damper=c)], "string")
    found = closed_loop_poles.find(closed)
    [z] = [
        value for value, state in zip(found.value, found.state, strict=True) if state == "test.z"
    ]
    root = -c / 2 / mass + 1j * np.sqrt(complex(k * (1 + 1j * angle) / mass - (c / 2 / mass) ** 2))
    assert z.imag == pytest.approx(root.imag, rel=1e-9)
    exact = root.real if c or angle > 1e-6 else -angle / 2 * np.sqrt(k / mass)
    assert z.real == pytest.approx(exact, rel=1e-7)
    if angle == 0.1 and c == 0.0:
        assert z.imag / (-2 * z.real) == pytest.approx(10.025, abs=1e-3)
