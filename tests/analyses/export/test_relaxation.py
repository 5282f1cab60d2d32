"""State spaces with losses: Q and isolation against the violin model, passivity, closed forms."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.analyses.export import relaxation
from suspension_cli.analyses.export import solve as export
from suspension_cli.conventions import DOFS
from suspension_cli.design import reader
from suspension_cli.errors import InputError
from suspension_cli.models import registry
from tests.support import plants
from tests.support.commandline import assert_refused, run
from tests.support.golden import CONFIGS

BAND = np.geomspace(0.1, 100, 300)
PAIRS = {
    "double": ("support.x", "test.x"),
    "triple-damped": ("upper.force_x", "test.x"),
    "payload-recoil-mass": ("support.z", "mirror.z"),
    "pulled-fibres": ("support.x", "mirror.pitch"),
    "geo-silica-triple": ("support.x", "test.x"),
}


def exported(name, into, out, **settings):
    return sus.export(
        sus.read(CONFIGS / f"{name}.toml"), inputs=into, outputs=out, loss=True, **settings
    )


@pytest.mark.parametrize("name", PAIRS)
def test_isolation_and_q_are_right_together(name):
    """Off resonance 1 % of the exact response, over 8 decades; Q within 2 %."""
    into, out = PAIRS[name]
    made = exported(name, into, out)
    assert made.q_error < 0.02
    found = sus.response(
        sus.read(CONFIGS / f"{name}.toml"), inputs=into, outputs=out, frequency=BAND
    )
    error = np.abs(made.system.at(BAND) / found.value - 1)[:, 0, 0]
    assert np.quantile(error, 0.9) < 0.01
    assert np.median(error) < 2e-3


def test_of_one_mass_on_one_lossy_spring():
    """Q = 1 / phi at the vertical mode of Table I, case 1; H = 1/(k (1 + i phi) - m omega^2)."""
    design = sus.read(CONFIGS / "husman2000" / "table1-case1.toml")
    design = design.replace({"materials.steel302.loss_angle": 1e-3})
    made = sus.export(design, inputs="test.force_z", outputs="test.z", loss=True, fidelity="beam")
    poles = np.linalg.eigvals(made.system.a)
    (pole,) = poles[poles.imag > 1.0]
    assert abs(pole) / (-2 * pole.real) == pytest.approx(1e3, rel=0.01)
    assert made.system.a.shape == (2, 2)
    k = 160554.8  # 1/H at rest, N/m, without loss
    frequency = np.array([0.1, 1.0, 10.0, 50.0, 100.0])
    static, mass = _stiffness_and_mass(made.system)
    assert static == pytest.approx(k, rel=5e-3)
    expected = 1 / (static * (1 + 1e-3j) - mass * (2 * np.pi * frequency) ** 2)
    assert made.system.at(frequency)[:, 0, 0] == pytest.approx(expected, rel=2e-3)


def _stiffness_and_mass(system):
    """k and m of an oscillator, from its response to a force at rest and far above its mode."""
    low, high = np.real(1 / system.at(np.array([1e-6, 1e4]))[:, 0, 0])
    return low, (low - high) / (2e4 * np.pi) ** 2


@pytest.mark.parametrize(
    ("name", "into", "out", "most"),
    [
        ("quadruple", None, None, 150),
        ("quadruple", "support.x", "test.x", 40),
        ("triple-damped", "support.x", "test.x", 30),
    ],
)
def test_few_states_suffice(name, into, out, most):
    """1 % of responses, between the frequencies at which states were chosen, and 2 % of Q."""
    signals = {} if into is None else {"inputs": into, "outputs": out}
    made = sus.export(sus.read(CONFIGS / f"{name}.toml"), loss=True, **signals)
    assert made.worst <= 0.01 and made.q_error <= 0.02
    assert len(made.system.state) <= most
    assert np.linalg.eigvals(made.system.a).real.max() < 1e-9
    grid = np.geomspace(0.11, 97, 531)
    design = sus.read(CONFIGS / f"{name}.toml")
    inputs, outputs = list(made.system.input), list(made.system.output)
    found = sus.response(design, inputs=inputs, outputs=outputs, frequency=grid)
    exact = np.asarray(found.value).reshape(len(grid), len(outputs), len(inputs))
    value = made.system.at(grid)
    size = np.maximum(np.abs(exact), 1e-6 * np.abs(exact).max((1, 2), keepdims=True))
    error = np.where(exact == 0, 0.0, np.abs(value - exact) / size)
    assert np.quantile(error, 0.95, axis=0).max() < 0.011


def test_more_states_are_more_accurate():
    """The sum of the errors, that of Q counted half, falls from row to row of the table."""
    made = exported("quadruple", "support.x", "test.x")
    orders = made.orders
    size = orders.worst + orders.q_error / 2
    assert len(size) > 3
    assert (np.diff(size) < 0).all() and (np.diff(orders.states) > 0).all()
    assert (orders.states[-1], orders.worst[-1]) == (len(made.system.state), made.worst)
    whole = sus.export(sus.read(CONFIGS / "quadruple.toml"), loss=True)
    assert len(whole.system.state) > 2 * len(made.system.state)


@pytest.mark.parametrize("order", [16, 20])
def test_the_order_is_honoured(order):
    made = exported("quadruple", "support.x", "test.x", order=order)
    assert order - 2 <= len(made.system.state) <= order
    assert np.linalg.eigvals(made.system.a).real.max() < 1e-9


@pytest.mark.parametrize("order", ["0", "-3", "many", "1e9"])
def test_orders_are_positive_integers(order, tmp_path):
    result = run("export", CONFIGS / "double.toml", "--loss", "--order", order, "--out", tmp_path)
    assert result.exit_code == 2
    assert "'--order'" in result.stderr and not list(tmp_path.iterdir())


@pytest.mark.parametrize("form", ["mat", "npz", "hdf5", "zpk", "control", "foton", "finesse"])
def test_all_formats_have_the_small_system(form, tmp_path):
    options = ("--loss", "--order", "9", "--band", "0.1:30", "--format", form, "--json")
    signals = ("--input", "support.x", "--output", "test.x")
    file = CONFIGS / "double.toml"
    result = run("export", file, *options, *signals, "--out", tmp_path)
    assert result.exit_code == 0, result.stderr
    document = json.loads(result.stdout)
    assert len(document["state"]) <= 9
    assert document["orders"][-1]["states"] == len(document["state"])


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--loss", "--order", "5"), "is less than the 8 states of the bodies"),
        (("--order", "20"), "add --loss, or leave it out"),
        (("--loss", "--order", "20", "--format", "gwinc"), "gwinc has no states"),
    ],
)
def test_orders_without_a_sense_are_refused(options, words, tmp_path):
    file = CONFIGS / "double.toml"
    signals = ("--input", "support.x", "--output", "test.x", "--out", tmp_path)
    (line,) = assert_refused(run("export", file, *options, *signals), file, tmp_path)
    assert words in line


def test_it_only_takes_energy():
    """Power into a driving point, Re(i omega H), is positive at all frequencies; no pole grows."""
    forces = [f"upper.{kind}" for kind in ("force_x", "force_y", "force_z", "torque_yaw")]
    motions = [f"upper.{kind}" for kind in ("x", "y", "z", "yaw")]
    made = exported("double", forces, motions)
    assert np.linalg.eigvals(made.system.a).real.max() < 1e-9
    wide = np.geomspace(1e-4, 1e4, 200)
    power = 2j * np.pi * wide[:, None, None] * made.system.at(wide)
    sym = (power + np.conj(np.swapaxes(power, 1, 2))) / 2
    size = np.abs(power).max((1, 2))
    assert (np.linalg.eigvalsh(sym).min(1) > -1e-9 * size).all()


def test_symmetric_motions_stay_apart():
    """A response that symmetry forbids is exactly 0."""
    made = exported("double", "support.x", ["test.x", "test.y"])
    assert not made.system.at(BAND)[:, 1].any()


@pytest.mark.parametrize("band", ["1", "2:1", "0:3", "a:b", "1:inf"])
def test_a_band_has_two_ends(band, tmp_path):
    file = CONFIGS / "double.toml"
    (line,) = assert_refused(run("export", file, "--loss", "--band", band), file, tmp_path)
    assert "--band" in line and "0.1:100" in line


@pytest.mark.parametrize("band", ["1e-9:1e9", "0.1:1e6", "1e-300:1"])
def test_bands_that_need_too_many_states_are_refused(band, tmp_path):
    """Before anything is computed with them; the end that is named is not refused."""
    file = CONFIGS / "double.toml"
    result = run("export", file, "--loss", "--band", band, "--out", tmp_path)
    (line,) = assert_refused(result, file, tmp_path)
    assert line.startswith("--band = ")
    low = float(band.partition(":")[0])
    if band == "1e-300:1":
        assert line.endswith("spans more than 20 decades; begin it at a higher frequency")
        return
    assert "states for losses and modes of wires" in line
    end = re.search(r"; end it at (\S+) Hz or below$", line)
    assert end is not None
    model = registry.MOST_COMPLETE.system(reader.read(file).design)
    relaxation.check_size(model, (low, float(end[1])))
    with pytest.raises(InputError):
        relaxation.check_size(model, (low, 1.2 * float(end[1])))


def test_a_table_of_all_modes_of_wires_is_refused(tmp_path):
    """For gwinc each of them would take frequencies of its own."""
    file = CONFIGS / "double.toml"
    options = ("--format", "gwinc", "--band", "1:1e9", "--out", tmp_path)
    (line,) = assert_refused(run("export", file, *options), file, tmp_path)
    assert re.match(r'--band = "1:1e9": contains [\d,]+ modes of wires', line)


def test_errors_are_judged_against_the_motion_of_the_body():
    """As docs/accuracy.md does: a response of 1e-17 of its body's motion is a rounding error."""
    design = sus.read(CONFIGS / "triple-damped.toml")
    model = registry.BEAM.system(design.design)
    inputs = plants.drives(model, "support.pitch")
    outputs = plants.motions(
        model, *(f"{body}.{dof}" for body in ("upper", "test") for dof in DOFS)
    )
    frequency = np.array([0.3, 2.0, 20.0])
    exact = export.solve_exactly(model, frequency, export.Opened(inputs, [outputs[0], outputs[11]]))
    found = sus.response(
        design,
        inputs="support.pitch",
        outputs=[one.text for one in outputs],
        frequency=frequency,
        fidelity="beam",
    )
    size = np.abs(found.value)[..., 0]
    largest = np.stack([size[:, :6].max(1), size[:, 6:].max(1)], axis=1)
    assert exact.motion[..., 0] == pytest.approx(largest, rel=1e-9)

    exact = export.Exact(np.array([[[1.0], [1e-17], [1e-3], [0.0]]]), np.ones((1, 4, 1)))
    errors = exact.errors_of(np.array([[[1.01], [1e-10], [1.01e-3], [1e-30]]]))[0, :, 0]
    assert errors[:3] == pytest.approx([0.01, 1e-4, 0.01]) and errors[3] == np.inf
