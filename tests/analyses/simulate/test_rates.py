"""Loops whose filters run at a divisor of the rate of the run."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import linalg, signal

import suspension_cli as sus
from suspension_cli.design import foton
from suspension_cli.errors import InputError, PendsusWarning
from suspension_cli.linear import statespace
from suspension_cli.linear.statespace import with_constant_loss
from suspension_cli.models import registry
from suspension_cli.physics import closed_loop, local_control, time_domain
from tests.support import plants

QUIET = {"noise": False, "fidelity": "string"}
DAMPING = 'zpk([0],[12;8+i*9;8-i*9],40,"n")'
"""A velocity damper of 40 / 2 pi N s/m up to 12 Hz."""
LOW_PASS = 'pole(15,"n")'


def of_loops(*loops):
    """The triple with loops along axes of its upper mass, by axis."""
    made = []
    for axis, keys in loops:
        acts = "force" if axis in "xyz" else "torque"
        ends = {"name": axis, "sensor": f"upper.{axis}", "actuator": f"upper.{acts}_{axis}"}
        made.append(ends | {"sensor_response": LOW_PASS} | keys)
    return sus.example("triple-damped").replace({"control": {"loop": made}})


def slow(rate, design=DAMPING):
    """Keys of a loop with a digital filter."""
    return {"filter": {"design": design, "rate": rate}}


def coefficients(text, rate):
    """Numerator and denominator in z of a Foton string at a rate, by the bilinear transform."""
    made = foton.parse(text, rate)
    excess = len(made.poles) - len(made.zeros)
    zeros, poles = (-2 * np.pi * np.array(roots) for roots in (made.zeros, made.poles))
    gain = made.gain * (2 * np.pi) ** excess
    return signal.zpk2tf(*signal.bilinear_zpk(zeros, poles, gain, rate))


def by_hand(design, rate, slow_rate, delay, count):
    """Displacement after a step, sample by sample: direct forms of the filters, and exp(A T)."""
    model = with_constant_loss(registry.STRING.system(design.design))
    system = statespace.build(
        model, plants.drives(model, "upper.force_x"), plants.motions(model, "upper.x", "test.x")
    )
    size = len(system.a)
    whole = np.zeros((size + 1, size + 1))
    whole[:size, :size] = system.a
    whole[:size, size:] = system.b
    change = linalg.expm(whole / rate)
    state = np.zeros(size)
    above, below = coefficients(LOW_PASS, rate)
    above_slow, below_slow = coefficients(DAMPING, slow_rate)
    read, passed = np.zeros(len(above)), np.zeros(len(below))
    sampled, demanded = np.zeros(len(above_slow)), np.zeros(len(below_slow))
    pending = [0.0] * delay
    moved = []
    for n in range(count):
        motion, last = system.c @ state
        moved.append(last)
        read = np.append(motion, read[:-1])
        passed = np.append(0.0, passed[:-1])
        passed[0] = above @ read - below[1:] @ passed[1:]
        if n % round(rate / slow_rate) == 0:
            sampled = np.append(passed[0], sampled[:-1])
            demanded = np.append(0.0, demanded[:-1])
            demanded[0] = above_slow @ sampled - below_slow[1:] @ demanded[1:]
        pending.append(-demanded[0])
        force = 1e-3 + pending.pop(0)
        state = (change @ np.append(state, force))[:size]
    return np.array(moved)


@pytest.mark.parametrize(("slow_rate", "delay"), [(128.0, 0), (64.0, 3), (512.0, 1)])
def test_a_slow_loop_is_that_made_by_hand(slow_rate, delay):
    design = of_loops(("x", slow(slow_rate) | {"delay": delay / 512}))
    how = QUIET | {"rate": 512.0, "duration": 4.0, "step": ["upper.force_x=1e-3"]}
    found = sus.simulate(design, outputs=["test.x"], **how)
    expected = by_hand(design, 512.0, slow_rate, delay, 2048)
    assert np.abs(found.value[:, 0] - expected).max() < 1e-9 * np.abs(expected).max()


def test_loops_of_three_rates_run_at_their_own():
    """The period of three and four samples is twelve; loops that do not touch one another move as
    alone."""
    loops = ("x", slow(64.0)), ("y", slow(48.0)), ("z", slow(192.0))
    how = QUIET | {"rate": 192.0, "duration": 5.0, "outputs": ["test.x", "test.y", "test.z"]}
    how["step"] = ["upper.force_x=1e-3", "upper.force_y=2e-3", "upper.force_z=1e-3"]
    together = sus.simulate(of_loops(*loops), **how).value
    for n, loop in enumerate(loops):
        alone = sus.simulate(of_loops(loop), **how).value
        assert np.abs(together - alone)[:, n].max() < 1e-9 * np.abs(alone[:, n]).max()


def test_the_hold_is_half_a_period_of_delay():
    """Poles of a loop at 64 Hz in a run at 512 Hz, against those of one that is 1/128 s late."""
    design = of_loops(("x", slow(64.0)))
    model = registry.STRING.system(design.design)
    plant = local_control.build_plant(design.design, model)
    sampled = time_domain.sample(plant, 512.0, [], [], plants.motions(model, "test.x"))
    change = np.linalg.multi_dot([one.a for one in sampled.phases()[::-1]])
    z = np.linalg.eigvals(change).astype(complex)
    found = np.log(z[np.abs(z) > 1e-3]) * 64.0
    late = of_loops(("x", slow(64.0) | {"delay": 1 / 128}))
    poles = closed_loop.find_poles(local_control.build_plant(late.design, model)).value
    low = found[(np.abs(found) < 2 * np.pi * 3) & (np.imag(found) > 0)]
    assert len(low) == 5
    assert max(np.abs(poles - pole).min() / abs(pole) for pole in low) < 1e-4


def test_reading_slowly_without_an_anti_alias_filter_is_warned_of():
    bare = of_loops(("x", slow(64.0) | {"sensor_response": "gain(1)"}))
    how = QUIET | {"rate": 512.0, "duration": 0.5}
    with pytest.warns(PendsusWarning, match="reads at 64 Hz without an anti-alias filter, so what"):
        sus.simulate(bare, **how)


def test_rates_that_hardly_meet_are_refused():
    loops = ("x", slow(2048 / 63)), ("y", slow(2048 / 64)), ("z", slow(2048 / 65))
    with pytest.raises(InputError, match="of the rates of all filters only every 262,080 samples"):
        sus.simulate(of_loops(*loops), rate=2048.0, duration=0.5, **QUIET)
