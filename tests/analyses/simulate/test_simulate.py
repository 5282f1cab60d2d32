"""Closed loops in time against closed forms, the poles of the loops, and the budget."""

from __future__ import annotations

from itertools import islice

import numpy as np
import pytest
from scipy import signal
from scipy.linalg import expm

import suspension_cli as sus
from suspension_cli.analyses.simulate import solve
from suspension_cli.errors import InputError, PendsusWarning
from suspension_cli.linear import statespace
from suspension_cli.linear.statespace import with_constant_loss
from suspension_cli.models import registry
from suspension_cli.physics import closed_loop, local_control, time_domain
from tests.support import plants, scenes
from tests.support.commandline import run, strict_json
from tests.support.paths import CONFIGS

DAMPED = CONFIGS / "triple-damped.toml"
QUIET = {"noise": False, "fidelity": "string"}


def run_all(sampled, given, **how):
    """Outputs, and where actuators are at their limits, for inputs of all samples."""
    rows = iter(given)
    blocks = sampled.run(lambda count: np.array([*islice(rows, count)]), len(given), **how)
    return tuple(np.concatenate(parts) for parts in zip(*blocks, strict=True))


def test_a_step_on_a_suspension_without_loops():
    """x = A^-1 (exp(A t) - 1) B f of the state space with constant losses."""
    design = sus.example("double")
    how = QUIET | {"rate": 64.0, "duration": 5.0}
    found = sus.simulate(design, outputs=["test.x"], step=["upper.force_x=2e-3"], **how)
    model = with_constant_loss(registry.STRING.system(design.design))
    system = statespace.build(
        model, plants.drives(model, "upper.force_x"), plants.motions(model, "test.x")
    )
    one = np.eye(len(system.a))
    for n in (1, 17, 319):
        moved = np.linalg.solve(system.a, (expm(system.a * n / 64.0) - one) @ system.b)
        expected = 2e-3 * float((system.c @ moved)[0, 0])
        assert found.value[n, 0] == pytest.approx(expected, rel=1e-9)
    assert found.actuator == ()


def test_an_impulse_is_a_large_force_for_one_sample():
    how = QUIET | {"rate": 1024.0, "duration": 2.0}
    found = sus.simulate(DAMPED, outputs=["test.x"], impulse=["test.force_x=0.1"], **how)
    damped = sus.damp(
        DAMPED,
        output="test.x",
        impulse="test.force_x",
        duration=2.0,
        frequency=[1.0],
        fidelity="string",
    )
    expected = 0.1 * np.interp(found.time - 0.5 / 1024, damped.time, damped.impulse)
    size = np.abs(expected).max()
    assert np.abs(found.value[:, 0] - expected).max() < 3e-3 * size


@pytest.mark.parametrize(("rate", "error"), [(256.0, 1.5e-3), (2048.0, 1e-4)])
def test_poles_are_those_of_the_loops_with_the_hold_as_delay(rate, error):
    """The hold is half a sample of delay; what is left is of second order in f / rate, and losses
    as constant matrices."""
    design = sus.read(DAMPED)
    model = registry.STRING.system(design.design)
    plant = local_control.build_plant(design.design, model)
    motions = plants.motions(model, "test.x")
    sampled = time_domain.sample(plant, rate, [], [], motions)
    z = np.linalg.eigvals(sampled.linear().a)
    found = np.log(z[np.abs(z) > 1e-3].astype(complex)) * rate
    names = [loop.name for loop in design.control.loop]
    late = design.replace({f"control.loop.{name}.delay": 0.5 / rate for name in names})
    poles = closed_loop.find_poles(local_control.build_plant(late.design, model)).value
    low = poles[(np.abs(poles) < 2 * np.pi * 5) & (np.imag(poles) > 0)]
    assert len(low) > 12
    off = [np.abs(found - pole).min() / abs(pole) for pole in low]
    assert max(off) < error


def test_a_coil_at_its_limit_pushes_with_its_limit():
    """A position feedback k that would need more than L: the end is G (F - L), with the static
    response G."""
    coil = {"name": "F1", "stage": "upper", "at": [0.0, 0.0, 0.0], "direction": "x"}
    others = [
        {"name": "F2", "stage": "upper", "at": [0.0, 0.1, 0.0], "direction": "x"},
        {"name": "F3", "stage": "upper", "at": [0.0, 0.0, 0.1], "direction": "x"},
    ]
    limited = coil | {"coil": 0.5, "transconductance": 0.1, "range": 0.1}
    loop = {
        "name": "x",
        "sensor": "upper.x",
        "actuator": "upper.force_x",
        "filter": 'gain(1000) pole(50,"n")',
    }
    raw = plants.raw("triple") | {"control": {"loop": [loop], "osem": [limited, *others]}}
    strong = dict.fromkeys(("x", "y", "z"), 30.0)
    raw["stage"][0]["damping"] = strong | dict.fromkeys(("roll", "pitch", "yaw"), 0.5)
    design = scenes.design_of(raw)
    model = registry.STRING.system(design)
    plant = local_control.build_plant(design, model)
    watched = plants.motions(model, "upper.x")
    pushed = plants.drives(model, "upper.force_x")
    sampled = time_domain.sample(plant, 128.0, pushed, [], watched)
    given = np.zeros((128 * 120, sampled.linear().b.shape[1]))
    given[:, 0] = 0.3
    found, at_limit = run_all(sampled, given)
    force = found[-1, sampled.motions :]
    assert force[0] == pytest.approx(-0.1 * 0.1 * 0.5)
    assert at_limit[-1].tolist() == [True, False, False]
    static = local_control.solve_responses(
        plant.without_loops(), np.array([0.0]), pushed, watched
    ).real.item()
    assert found[-1, 0] == pytest.approx(static * (0.3 - 0.005), rel=1e-3)


def test_spectra_are_those_of_the_budget(monkeypatch):
    """Averages of 67 pieces scatter in each of some hundreds of bins. The hold is half a sample of
    delay."""
    monkeypatch.setattr(solve, "LONGEST_PIECE", 1 << 12)
    rate = 128.0
    how = {"ground": ["nlnm"], "fidelity": "string", "outputs": ["test.x", "upper.yaw"]}
    design = sus.read(DAMPED)
    names = [loop.name for loop in design.control.loop]
    held = design.replace({f"control.loop.{name}.delay": 0.5 / rate for name in names})
    found = sus.simulate(DAMPED, rate=rate, duration=1100.0, seed=3, **how)
    assert found.averages == 67
    some = (found.frequency > 0.8) & (found.frequency < 10.0)
    expected = sus.budget(held, frequency=found.frequency[some].tolist(), **how)
    # without thermal noise, which simulate leaves out
    known = np.array([cause != "thermal" for cause in expected.cause])
    density = (expected.contribution[:, :, known] ** 2).sum(-1)
    ratio = found.density[some] ** 2 / density
    smooth = np.abs(np.gradient(np.log(density), axis=0)).max(1) < 0.1
    assert smooth.sum() > 150
    for own in ratio[smooth].T:
        assert own.mean() == pytest.approx(1.0, abs=0.05)
        assert own.std() < 0.25


def test_a_seed_gives_a_run():
    how = {"rate": 128.0, "duration": 1.0, "fidelity": "string"}
    first, same, other = (sus.simulate(DAMPED, seed=seed, **how).value for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, same)
    assert (first != other).any()


def test_the_command(tmp_path):
    result = run(
        "simulate", DAMPED, "--fidelity", "string", "--rate", "256", "--duration", "2",
        "--ground", "nlnm", "--json", "--out", tmp_path,
    )  # fmt: skip
    assert result.exit_code == 0
    answer = strict_json(result.stdout)
    assert [one["actuator"] for one in answer["actuators"]][:2] == ["x", "y"]
    stored = sus.load(tmp_path / "triple-damped-simulate.h5")
    assert stored.value.shape == (512, 1)
    assert answer["outputs"][0]["rms"] == pytest.approx(stored.rms[0])


@pytest.mark.parametrize(
    ("how", "message"),
    [
        ({"step": ["upper.force_x"]}, "gives no size"),
        ({"step": ["upper.x=1"]}, "is not a force or torque"),
        ({"impulse": ["uper.force_x=1"]}, "names no body"),
        ({"duration": 1e-4, "rate": 1e3}, "is less than a sample at 1000 Hz"),
        (
            {"duration": 1e6, "rate": 1e6},
            "a results file of 6.4e.04 GB, where .* are free",
        ),
        ({"rate": 16.0}, "above half the sample rate"),
    ],
)
def test_what_makes_no_sense(how, message):
    with pytest.raises(InputError, match=message):
        sus.simulate(DAMPED, **({"duration": 1.0, "fidelity": "string"} | how))


def test_a_filter_of_a_rate_that_does_not_divide_that_of_the_run():
    with pytest.raises(InputError, match="rate of 512 Hz, of which 1000 Hz is no multiple; give"):
        sus.simulate(slow_loop(512.0), duration=1.0, fidelity="string", rate=1000.0)
    with pytest.raises(InputError, match="of which 256 Hz is no multiple; give rate=512"):
        sus.simulate(slow_loop(512.0), duration=1.0, fidelity="string", rate=256.0)


def coil(**how):
    """A coil on the upper mass at its COM, along x."""
    place = {"stage": "upper", "at": [0.0, 0.0, 0.0], "direction": "x"}
    return {"name": "F", "coil": 0.5, "transconductance": 0.1} | place | how


def of_loop(loop, *osems):
    """The triple with one loop in x."""
    ends = {"name": "x", "sensor": "upper.x", "actuator": "upper.force_x"}
    control = {"loop": [ends | loop]} | ({"osem": list(osems)} if osems else {})
    return sus.example("triple-damped").replace({"control": control})


DAMPING = 'zpk([0],[12;8+i*9;8-i*9],20,"n")'
"""A velocity damper of 20 / 2 pi N s/m up to 12 Hz."""


def slow_loop(rate, **more):
    """The triple with a damper in x whose filter is digital."""
    return of_loop({"filter": {"design": DAMPING, "rate": rate}} | more)


def test_the_start_of_a_run_is_as_loud_as_the_rest():
    """Noise has grown, and damped motions have settled, before."""
    how = {"rate": 64.0, "duration": 200.0, "fidelity": "string", "outputs": ["upper.yaw"]}
    found = sus.simulate(DAMPED, **how)
    first = np.sqrt((found.value[: 64 * 50] ** 2).mean())
    assert first == pytest.approx(found.rms[0], rel=0.2)


def test_motions_that_never_settle_are_warned_of():
    """Without loops the modes of steel wires take hours."""
    how = {"rate": 256.0, "duration": 2.0, "fidelity": "string", "ground": ["nlnm"]}
    with pytest.warns(PendsusWarning, match="resonances with so little damping are smaller"):
        sus.simulate(sus.example("double"), **how)


def test_an_undamped_suspension_follows_slow_ground_and_does_not_ring(tmp_path):
    """Ground far below the modes moves all as one. A start with a jump would ring at 0.7 Hz for
    hours, as much as the ground moves."""
    slow = tmp_path / "slow.csv"
    slow.write_text("frequency (Hz),x (m/sqrt(Hz))\n0.001,1e-6\n0.02,1e-6\n0.2,1e-16\n10,1e-16\n")
    how = {"rate": 16.0, "duration": 800.0, "fidelity": "string", "outputs": ["test.x"]}
    with pytest.warns(PendsusWarning, match="so little damping"):
        found = sus.simulate(sus.example("double"), ground=[f"x={slow}"], **how)
    frequency, power = signal.welch(found.value[:, 0], 16.0, nperseg=16 * 100, detrend=False)
    of_modes = power[(frequency > 0.4) & (frequency < 3.0)].sum() * frequency[1]
    assert found.rms[0] > 5e-8
    assert np.sqrt(of_modes) < 1e-3 * found.rms[0]


def test_delays_are_rounded_with_a_warning():
    late = of_loop({"gain": 1e6, "zeros": [0.0], "poles": [20.0, [10.0, 17.3]], "delay": 1e-4})
    how = QUIET | {"rate": 2048.0, "duration": 0.1}
    with pytest.warns(PendsusWarning, match="delay of 0.0001 s is rounded to 0 samples at 2048"):
        sus.simulate(late, step=["upper.force_x=1e-3"], **how)


def test_a_range_before_a_driver_with_a_response_is_refused():
    others = [
        coil(name="A", at=[0.0, 0.1, 0.0]),
        coil(name="B", at=[0.0, 0.0, 0.1]),
    ]
    limited = coil(range=1.0, driver_response='pole(10,"n")')
    design = of_loop({"damper": 20.0}, limited, *others)
    with pytest.raises(InputError, match=r"control.osem.F.range: .*before driver_response"):
        sus.simulate(design, duration=0.1, fidelity="string")


def test_unstable_loops_are_refused_or_grow():
    """A damper of the wrong sign, by the poles of the loops."""
    design = of_loop({"damper": -20.0})
    how = QUIET | {"duration": 20.0, "rate": 256.0, "step": ["upper.force_x=1e-6"]}
    with pytest.raises(InputError, match=r"control\.loop\.x: the sampled loops are unstable"):
        sus.simulate(design, outputs=["upper.x"], **how)
    with pytest.warns(PendsusWarning, match="unstable"):
        found = sus.simulate(design, outputs=["upper.x"], allow_unstable=True, **how)
    late = np.abs(found.value[-256 * 5 :]).max()
    assert late > 10 * np.abs(found.value[: 256 * 5]).max()


def test_loops_that_only_the_rate_makes_unstable_are_refused():
    """At 32 Hz the hold is 16 ms of delay."""
    strong = of_loop({"gain": 3e4 * 2 * np.pi * 300.0, "zeros": [0.0], "poles": [300.0]})
    with pytest.raises(InputError, match="the sampled loops are unstable at"):
        sus.simulate(strong, rate=1024.0, duration=1.0, **QUIET)
