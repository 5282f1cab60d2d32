"""Closed loops in time against closed forms, the poles of the loops, and the budget."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal
from scipy.linalg import expm

import suspension_cli as sus
from suspension_cli.errors import InputError
from suspension_cli.linear import statespace
from suspension_cli.linear.statespace import with_constant_loss
from suspension_cli.models import registry
from suspension_cli.physics import closed_loop, local_control, time_domain
from tests.support import plants, scenes
from tests.support.commandline import run, strict_json
from tests.support.paths import CONFIGS

DAMPED = CONFIGS / "triple-damped.toml"
QUIET = {"noise": False, "fidelity": "string"}


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
    z = np.linalg.eigvals(sampled.linear()[0].a)
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
    given = np.zeros((128 * 120, sampled.linear()[0].b.shape[1]))
    given[:, 0] = 0.3
    found, at_limit = sampled.run(given)
    force = found[-1, sampled.motions :]
    assert force[0] == pytest.approx(-0.1 * 0.1 * 0.5)
    assert at_limit[-1].tolist() == [True, False, False]
    static = local_control.solve_responses(
        plant.without_loops(), np.array([0.0]), pushed, watched
    ).real.item()
    assert found[-1, 0] == pytest.approx(static * (0.3 - 0.005), rel=1e-3)


def test_spectra_are_those_of_the_budget():
    """Averages of 40 pieces scatter by 1 / sqrt(40) in each of some hundred bins."""
    rate = 128.0
    how = {"ground": ["nlnm"], "fidelity": "string", "outputs": ["test.x", "upper.yaw"]}
    found = sus.simulate(DAMPED, rate=rate, duration=1200.0, seed=3, **how)
    frequency, power = signal.welch(found.value.T, rate, nperseg=int(40 * rate), detrend=False)
    some = (frequency > 0.8) & (frequency < 6.0)
    expected = sus.budget(DAMPED, frequency=frequency[some].tolist(), **how)
    # without thermal noise, which simulate leaves out
    known = np.array([cause != "thermal" for cause in expected.cause])
    density = (expected.contribution[:, :, known] ** 2).sum(-1)
    ratio = power[:, some].T / density
    smooth = np.abs(np.gradient(np.log(density), axis=0)).max(1) < 0.1
    assert smooth.sum() > 60
    for own in ratio[smooth].T:
        assert own.mean() == pytest.approx(1.0, abs=0.08)
        assert own.std() < 0.35


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
        ({"duration": 1e5, "rate": 1e4}, "makes 1,000,000,000 samples"),
        ({"rate": 16.0}, "above half the sample rate"),
    ],
)
def test_what_makes_no_sense(how, message):
    with pytest.raises(InputError, match=message):
        sus.simulate(DAMPED, **({"duration": 1.0, "fidelity": "string"} | how))


def test_a_filter_of_another_rate():
    design = sus.read(DAMPED)
    loop = {"name": "yaw", "sensor": "upper.yaw", "actuator": "upper.torque_yaw"}
    loop["filter"] = {"design": 'zpk([0],[12;8+i*9;8-i*9],0.6,"n")', "rate": 512.0}
    other = design.replace({"control.loop": [loop]})
    with pytest.raises(InputError, match="has a rate of 512 Hz; give rate=512"):
        sus.simulate(other, duration=1.0, fidelity="string", rate=1024.0)
