"""State spaces with losses: Q and isolation against the violin model, passivity, closed forms."""

from __future__ import annotations

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
    """Q = 1 / phi at the vertical mode of Table I, case 1; the loss angle holds over the band."""
    design = sus.read(CONFIGS / "husman2000" / "table1-case1.toml")
    design = design.replace({"materials.steel302.loss_angle": 1e-3})
    made = sus.export(design, inputs="test.force_z", outputs="test.z", loss=True, fidelity="beam")
    poles = np.linalg.eigvals(made.system.a)
    (pole,) = poles[poles.imag > 1.0]
    assert abs(pole) / (-2 * pole.real) == pytest.approx(1e3, rel=0.01)
    compliance = 1 / made.system.at(np.array([1.0]))[0, 0, 0]
    assert compliance.imag / compliance.real == pytest.approx(1e-3, rel=0.2)


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
    assert "states for losses and modes of wires" in line
    low = float(band.partition(":")[0])
    end = re.search(r"; end it at (\S+) Hz or below$", line)
    if band == "1e-300:1":
        assert line.endswith("; begin it at a higher frequency")
        return
    assert end is not None
    model = registry.MOST_COMPLETE.system(reader.read(file).design)
    relaxation.check_size(model, (low, float(end[1])), 2.0)
    with pytest.raises(InputError):
        relaxation.check_size(model, (low, 1.2 * float(end[1])), 2.0)


def test_a_table_of_all_modes_of_wires_is_refused(tmp_path):
    """For gwinc each of them would take frequencies of its own."""
    file = CONFIGS / "double.toml"
    options = ("--format", "gwinc", "--band", "1:1e9", "--out", tmp_path)
    (line,) = assert_refused(run("export", file, *options), file, tmp_path)
    assert re.match(r'--band = "1:1e9": contains [\d,]+ modes of wires', line)


def test_the_number_of_states_is_estimated():
    """It is at most some times too large."""
    design = sus.example("double")
    model = registry.MOST_COMPLETE.system(design.design)
    for band in ((0.1, 30.0), (0.1, 100.0)):
        made = sus.export(design, loss=True, band="{}:{}".format(*band), accuracy=0.5)
        count = len(made.system.state)
        assert count <= relaxation._estimate_states(model, band, 2.0) < 4 * count


def test_errors_are_judged_against_the_motion_of_the_body():
    """As docs/promises.md does: a response of 1e-17 of its body's motion is a rounding error."""
    design = sus.read(CONFIGS / "triple-damped.toml")
    model = registry.BEAM.system(design.design)
    inputs = plants.drives(model, "support.pitch")
    outputs = plants.motions(
        model, *(f"{body}.{dof}" for body in ("upper", "test") for dof in DOFS)
    )
    frequency = np.array([0.3, 2.0, 20.0])
    exact = export._solve(model, frequency, inputs, [outputs[0], outputs[11]])
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

    exact = export._Exact(np.array([[[1.0], [1e-17], [1e-3], [0.0]]]), np.ones((1, 4, 1)))
    errors = exact.errors_of(np.array([[[1.01], [1e-10], [1.01e-3], [1e-30]]]))[0, :, 0]
    assert errors[:3] == pytest.approx([0.01, 1e-4, 0.01]) and errors[3] == np.inf
