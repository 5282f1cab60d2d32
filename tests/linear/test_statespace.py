"""State space and zero-pole-gain agree with the direct solution where they say so."""

from __future__ import annotations

import numpy as np
import pytest

from suspension_cli.analyses.export import solve as export
from suspension_cli.linear import eigenmodes, response, signals, statespace
from suspension_cli.linear.structure import Structure
from suspension_cli.models import registry
from tests.support import plants, responses_mp, scenes

ROUNDING = 1e-12
FRAME = {
    "stiffness": {"x": 1e6, "y": 2e6, "z": 3e6, "roll": 1e5},
    "mass": 80.0,
    "inertia": [3.0, 4.0, 5.0],
    "damping": {"z": 100.0, "x": 30.0},
}


def one_damper(raw):
    """Along x at the second body, so that a structure below which it reaches is dragged in x and
    pitch at once."""
    raw["stage"][1]["damping"] = {"x": 50.0}
    return raw


def massless(stiffness, **more):
    return {"support": {"stiffness": stiffness} | more}


SYSTEMS = {
    "triple": ("force", plants.raw("triple")),
    "quadruple": ("string", plants.raw("quadruple")),
    "five": ("string", plants.raw("five")),
    "frame": ("force", plants.raw("triple") | {"support": FRAME}),
    "damped-massless-frame": (
        "force",
        plants.raw("triple") | massless({"x": 1e6, "z": 3e6}, damping={"x": 300.0}),
    ),
    "dampers-massless-frame": (
        "string",
        plants.raw("five", damping=True) | massless({"x": 2e4, "pitch": 6e3, "yaw": 1e3}),
    ),
    "damper-massless-frame": (
        "force",
        one_damper(plants.raw("triple")) | massless({"x": 1e5, "pitch": 3e4}),
    ),
    "everything": ("string", plants.raw("triple", tips=True, damping=True) | {"support": FRAME}),
    "everything-five": ("string", plants.raw("five", tips=True, damping=True) | {"support": FRAME}),
}
MODELS = {
    name: registry.by_name(level).system(scenes.design_of(raw))
    for name, (level, raw) in SYSTEMS.items()
}


def ends(model):
    """The inputs and outputs of a local control problem."""
    inputs, outputs = signals.local_control_signals(model.body)
    return plants.drives(model, *inputs), plants.motions(model, *outputs)


@pytest.mark.parametrize("name", MODELS)
def test_it_is_the_direct_response(name):
    """But for what an error of `ROUNDING` in each element of K, C and M makes; the main responses
    in any case, and exactly 0 where a symmetry says so."""
    model = MODELS[name]
    inputs, outputs = ends(model)
    low, high = export.mode_range(model)
    rng = np.random.default_rng(11)
    frequency = np.exp(rng.uniform(np.log(low / 100), np.log(high * 100), 6))
    exact = responses_mp.compare(model, frequency, inputs, outputs, condition=True)
    found = statespace.build(model, inputs, outputs).at(frequency)
    assert (found[exact.exact == 0] == 0).all()
    error = np.abs(found - exact.exact) / np.where(exact.exact == 0, 1, np.abs(exact.exact))
    assert (error <= np.maximum(1e-9, ROUNDING * exact.condition)).all()
    last = model.body[-1]
    for dof in ("x", "y", "z", "yaw"):
        row = [out.text for out in outputs].index(f"{last}.{dof}")
        column = [into.text for into in inputs].index(f"support.{dof}")
        assert error[:, row, column].max() < 1e-9


@pytest.mark.parametrize("name", ["quadruple", "dampers-massless-frame", "everything-five"])
def test_the_band_is_true(name):
    """At frequencies other than those that it was measured at; from below the modes to 100 times
    the highest for the main responses."""
    model = MODELS[name]
    low, high = export.mode_range(model)
    rng = np.random.default_rng(12)
    first, last = model.body[0], model.body[-1]
    for into, out in (("support.x", "x"), ("support.z", "z"), (f"{first}.force_x", "pitch")):
        inputs, outputs = plants.drives(model, into), plants.motions(model, f"{last}.{out}")
        made = export.build(model, export.Opened(inputs, outputs))
        assert made.tolerance == 1e-9
        assert made.band[0] < low / 2
        assert made.band[1] == pytest.approx(high * 100)
        frequency = np.exp(rng.uniform(*np.log(made.band), 300))
        expected = response.solve(model, frequency, inputs, outputs).value
        error = np.abs(made.system.at(frequency) / expected - 1)[:, 0, 0]
        smooth = np.abs(np.log(frequency[:, None] / sharp(model, inputs, outputs))).min(1) > 1e-5
        assert error[smooth].max() < made.tolerance
        assert smooth.mean() > 0.98


def sharp(model, inputs, outputs):
    """Poles and zeros on the imaginary axis, next to which a relative error means nothing, Hz."""
    form = export.compute_zero_pole_gain(statespace.build(model, inputs, outputs))
    return (
        np.abs(np.concatenate([form.zeros[0][0], form.poles[0][0], [1e-9]])) / (2 * np.pi) + 1e-12
    )


@pytest.mark.parametrize("name", ["quadruple", "five", "everything"])
def test_zero_pole_gain(name):
    model = MODELS[name]
    inputs, outputs = (
        plants.drives(model, "support.x", "support.z", f"{model.body[0]}.force_x"),
        plants.motions(model, f"{model.body[-1]}.x", f"{model.body[0]}.z"),
    )
    made = export.build(model, export.Opened(inputs, outputs), zpk=True)
    assert made.zpk is not None
    assert made.tolerance == 1e-3
    assert made.worst < 1e-6
    assert made.band == pytest.approx(
        (export.mode_range(model)[0] / 100, export.mode_range(model)[1] * 100)
    )
    frequency = np.exp(np.random.default_rng(13).uniform(*np.log(made.band), 10))
    compared = responses_mp.compare(model, frequency, inputs, outputs)
    form = made.zpk.at(frequency)
    assert (form[compared.exact == 0] == 0).all()
    assert (np.abs(form - compared.exact) <= 1e-3 * np.abs(compared.exact)).all()
    for row_z, row_p in zip(made.zpk.zeros, made.zpk.poles, strict=True):
        for zeros, roots in zip(row_z, row_p, strict=True):
            assert np.isfinite(zeros).all()
            assert len(zeros) <= len(roots)
            assert (roots.real < 1e-9 * np.abs(roots).max(initial=1.0)).all()
    if name == "quadruple":  # isolation by four stages; no spurious zeros from rounding
        assert len(made.zpk.poles[0][0]) - len(made.zpk.zeros[0][0]) == 2 * 4
        assert made.zpk.gain[0, 1] == 0


@pytest.mark.parametrize(
    ("kind", "level"),
    [("triple", "force"), ("triple", "string"), ("quadruple", "force"), ("five", "string")],
)
def test_loss_becomes_the_damping_of_each_mode(kind, level):
    model = plants.model(kind, level, loss=True)
    found = eigenmodes.solve(model)
    closed, _ = statespace.find_poles(statespace.build(model, *ends(model)))
    assert len(closed.value) == len(found.q)
    order = np.argsort(found.frequency)
    np.testing.assert_allclose(closed.frequency, found.frequency[order], rtol=1e-6)
    np.testing.assert_allclose(1 / closed.q, 1 / found.q[order], rtol=1e-4, atol=1e-12)
    near = (found.frequency[order] * 1.2)[:6]
    inputs, outputs = (
        plants.drives(model, "support.x"),
        plants.motions(model, f"{model.body[-1]}.x"),
    )
    expected = response.solve(model, near, inputs, outputs).value
    assert np.abs(statespace.build(model, inputs, outputs).at(near) / expected - 1).max() < 1e-3


def test_names_and_units():
    model = MODELS["frame"]
    inputs = plants.drives(model, "support.z", "upper.force_x@0,0.01,0", "upper.torque_yaw")
    system = statespace.build(
        model, inputs, plants.motions(model, "test.x@0,0,0.001", "test.yaw", "frame.z", "support.z")
    )
    assert system.input == ("support.z", "upper.force_x@0,0.01,0", "upper.torque_yaw")
    assert system.input_unit == ("m", "N", "N m")
    assert system.output == ("test.x@0,0,0.001", "test.yaw", "frame.z", "support.z")
    assert system.output_unit == ("m", "rad", "m", "m")
    assert system.d[3].tolist() == [1.0, 0.0, 0.0]
    assert len(system.state) == len(set(system.state)) == len(system.a)
    blocks = [{model.coordinate[n] for n in block} for block in Structure(model).blocks]
    touched = set().union(*(block for block in blocks if block & {"test.x", "test.z", "test.yaw"}))
    assert {name.removesuffix(" rate") for name in system.state} == touched
    for name, unit in zip(system.state, system.state_unit, strict=True):
        angle = name.removesuffix(" rate").rsplit(".", 1)[1] in ("roll", "pitch", "yaw")
        assert unit == ("rad" if angle else "m") + ("/s" if name.endswith(" rate") else "")


def test_dampers_on_what_has_no_mass_are_states_too():
    """A spring and a damper without a mass: a lag of first order, one state a damper; whatever else
    has no mass is no state."""
    model = MODELS["damped-massless-frame"]
    system = statespace.build(
        model, plants.drives(model, "support.x"), plants.motions(model, "frame.x", "test.x")
    )
    assert system.state[-1] == "frame.x momentum"
    assert system.state_unit[-1] == "N s"
    assert len(system.state) == 13
    lag = np.linalg.eigvals(system.a)
    assert np.sort(lag[np.abs(lag.imag) < 1e-9].real)[0] == pytest.approx(-1e6 / 300, rel=0.01)
    for name, count in (("dampers-massless-frame", 3), ("damper-massless-frame", 1)):
        model = MODELS[name]
        system = statespace.build(model, *ends(model))
        assert len([state for state in system.state if state.endswith("momentum")]) == count
        assert len(system.state) == len(set(system.state)) == 12 * len(model.body) + count
