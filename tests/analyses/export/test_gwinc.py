"""Suspensions in noise budgets of gwinc, read and computed by the real package."""

from __future__ import annotations

import runpy
import subprocess
import sys

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.analyses.export import gwinc_budget
from tests.support.commandline import run
from tests.support.paths import CONFIGS, ROOT

gwinc = pytest.importorskip("gwinc")
BAND, ACCURACY = "8:200", 0.01
OFFSET = """
[[perturbation]]
body = "test"
com_offset = [0.003, 0.001, 0.0]
"""


@pytest.fixture(scope="module")
def quad():
    """LIGO's quadruple with a mirror whose centre of mass is off, which couples z to x."""
    return sus.parse((CONFIGS / "built/ligo-quad.toml").read_text() + OFFSET)


@pytest.fixture(scope="module")
def exported(quad):
    return sus.export(quad, format="gwinc", band=BAND, accuracy=ACCURACY)


@pytest.fixture(scope="module")
def folder(exported, tmp_path_factory):
    path = tmp_path_factory.mktemp("gwinc") / "quad"
    exported.save(path)
    return path


@pytest.fixture(scope="module")
def frequency(exported):
    """Frequencies of the table, where nothing is interpolated."""
    return exported.table["frequency"][::20]


@pytest.fixture(scope="module")
def trace(folder, frequency):
    return gwinc.load_budget(str(folder), freq=frequency).run()


def displacement(trace, *names):
    """Power spectral density in m^2/Hz of the differential arm, from that of strain."""
    from gwinc.ifo.noises import dhdl

    for name in names:
        trace = trace[name]
    return trace.psd / dhdl(trace.freq, length())[0]


def length():
    return gwinc.load_budget("aLIGO").ifo.Infrastructure.Length


def angle():
    """Between the beam and the horizontal, as gwinc has it."""
    return length() / gwinc.const.R_earth


def thermal(design, frequency, angle):
    """Thermal noise of four mirrors as gwinc counts them."""
    level, upright = sus.thermal(design, outputs=["test.x", "test.z"], frequency=frequency).motions
    return 4 * (level.amplitude**2 + (angle * upright.amplitude) ** 2)


def test_suspension_thermal_noise_is_that_of_thermal(quad, frequency, trace):
    own = thermal(quad, frequency, angle())
    np.testing.assert_allclose(displacement(trace, "SuspensionThermal"), own, rtol=1e-6)


def test_interpolation_is_as_accurate_as_demanded(quad, folder):
    frequency = np.geomspace(8.0, 200.0, 333)
    trace = gwinc.load_budget(str(folder), freq=frequency).run()
    own = thermal(quad, frequency, angle())
    found = displacement(trace, "SuspensionThermal")
    np.testing.assert_allclose(found**0.5, own**0.5, rtol=ACCURACY)


def test_seismic_noise_is_gwincs_ground_times_our_responses(quad, frequency, trace):
    """The vertical one with the coupling to x of the suspension, beside that of the beam."""
    from gwinc.noise.seismic import seismic_BSC_ISI

    ground, _ = seismic_BSC_ISI(frequency)
    signals = ["support.x", "support.z"], ["test.x", "test.z"]
    response = sus.response(quad, inputs=signals[0], outputs=signals[1], frequency=frequency).value
    level, coupled, upright = response[:, 0, 0], response[:, 0, 1], response[:, 1, 1]
    assert (abs(coupled) > 0.1 * angle() * abs(upright)).any()
    for name, through in (("Horizontal", level), ("Vertical", coupled + angle() * upright)):
        own = 4 * abs(through * ground) ** 2
        np.testing.assert_allclose(displacement(trace, "Seismic", name), own, rtol=1e-6)


def test_forces_act_through_our_susceptibility(quad, frequency, trace):
    """Noise of residual gas is that of gwinc's own budget, times the squared ratio of both."""
    plain = gwinc.load_budget("aLIGO", freq=frequency)
    theirs = gwinc.suspension.precomp_suspension(frequency, plain.ifo).tst_suscept
    ours = sus.response(quad, inputs="test.force_x", outputs="test.x", frequency=frequency)
    names = "ResidualGas", "DampingH2"
    ratio = displacement(trace, *names) / displacement(plain.run(), *names)
    np.testing.assert_allclose(ratio, abs(ours.value[:, 0, 0] / theirs) ** 2, rtol=1e-6)


def test_part_of_a_budget_has_the_suspension_too(folder, frequency, trace):
    part = gwinc.load_budget(str(folder), freq=frequency)["SuspensionThermal"].run()
    np.testing.assert_allclose(part.psd, displacement(trace, "SuspensionThermal"), rtol=1e-12)


def test_gwincs_own_budget_stays_as_it_is(frequency, trace):
    from gwinc.suspension import precomp_suspension

    plain = gwinc.load_budget("aLIGO", freq=frequency)
    theirs = precomp_suspension(frequency, plain.ifo)
    own = gwinc.noise.suspensionthermal.suspension_thermal(frequency, plain.ifo.Suspension, theirs)
    np.testing.assert_allclose(displacement(plain.run(), "SuspensionThermal"), 4 * own, rtol=1e-9)


def test_function_and_folder_agree(exported, trace, frequency):
    made = sus.gwinc(exported, frequency).run()
    np.testing.assert_array_equal(made.psd, trace.psd)


def test_other_interferometers_and_their_coupling():
    design = sus.example("geo-silica-triple")
    made = sus.export(design, format="gwinc", band="10:50", interferometer="CE1")
    frequency = made.table["frequency"][::50]
    trace = sus.gwinc(made, frequency).run()
    assert "Coating" in [part.name for part in trace.budget]
    from gwinc.ifo.noises import dhdl

    coupling = gwinc.load_budget("CE1")
    own = thermal(design, frequency, coupling.ifo.Suspension.VHCoupling.theta)
    found = trace["SuspensionThermal"].psd / dhdl(frequency, 40e3)[0]
    np.testing.assert_allclose(found, own, rtol=1e-6)


@pytest.mark.parametrize("stages", [1, 4, 6])
def test_noise_of_all_joints_counts_in_chains_of_any_length(stages):
    """The mirror's lower joints are those of gwinc's mirror, whatever is above."""
    frequency, random = np.geomspace(10.0, 20.0, 5), np.random.default_rng(stages)
    level, upright = random.uniform(1, 2, (2, 5, 2 * stages)) * 1e-20
    upright[:, 1::2] = 0
    table = {"frequency": frequency, "name": np.array("any")}
    table |= {"horizontal_thermal": level, "vertical_thermal": upright}
    table |= {name: np.ones(5) for name in ("horizontal", "vertical", "coupling", "susceptibility")}
    ifo = gwinc.load_budget("aLIGO").ifo
    found = gwinc_budget.compute_suspension(table, frequency, ifo)

    def noise(stage, direction):
        return gwinc.noise.suspensionthermal.susptherm_stage(
            frequency, ifo.Suspension, found, stage, direction
        )

    total = sum(noise(stage, direction) for stage in range(4) for direction in ("horiz", "vert"))
    own = (level**2).sum(1) + angle() ** 2 * (upright**2).sum(1)
    np.testing.assert_allclose(total, own, rtol=1e-9)
    np.testing.assert_allclose(noise(3, "horiz"), level[:, -1] ** 2, rtol=1e-9)


def like_gwinc():
    """LIGO's quadruple with the materials, fibres and blades of gwinc's aLIGO."""
    ifo = gwinc.load_budget("aLIGO").ifo.Suspension
    text = (CONFIGS / "built/ligo-quad.toml").read_text()
    end = f"{{ length = {ifo.Fiber.EndLength}, radius = {ifo.Fiber.EndRadius} }}"
    fibre = f"sections = [{end}, {{ radius = {ifo.Fiber.Radius} }}, {end}]"
    text = text.replace("radius = 200e-6", fibre).replace('"silica"', '"fused-silica"')
    text = text.replace('material = "wire"', 'material = "c70steel"')
    for name, stage in zip(("penultimate", "upper", "top"), ifo.Stage[1:], strict=True):
        head, found, rest = text.partition(f'name = "{name}"')
        blade = f'material = "maraging"\nthickness = {stage.Blade}\nloss_angle'
        text = head + found + rest.replace("loss_angle", blade, 1)
    return sus.parse(text)


def test_quadruple_against_gwincs_model_in_one_dimension():
    """With the same losses both agree where neither other motions nor violin modes matter."""
    frequency = np.array([15.0, 20.0, 30.0, 50.0, 100.0])
    made = sus.export(like_gwinc(), format="gwinc", band="10:110")
    ours, theirs = (
        one.run()["SuspensionThermal"].asd
        for one in (sus.gwinc(made, frequency), gwinc.load_budget("aLIGO", freq=frequency))
    )
    np.testing.assert_allclose(ours / theirs, 1, atol=0.03)
    np.testing.assert_allclose((ours / theirs)[:4], 1, atol=0.015)


def test_notebook(capsys):
    """What docs/handing-over.md says of it."""
    runpy.run_path(str(ROOT / "docs" / "notebooks" / "gwinc.py"))
    assert "- 1: +0.2 % -0.6 % -0.9 % -1.3 % -2.9 %" in capsys.readouterr().out


def command(*words):
    return subprocess.run(
        [sys.executable, "-m", "gwinc", *map(str, words)], capture_output=True, text=True
    )


def test_command_of_gwinc_draws_the_budget(tmp_path):
    """In a folder of any name, in the band of the table."""
    file = CONFIGS / "geo-silica-triple.toml"
    named = ("--name", "my.triple", "--band", "10:50", "--out", tmp_path)
    done = run("export", file, "--format", "gwinc", *named)
    assert done.exit_code == 0, done.stderr
    folder = tmp_path / "my_triple-gwinc"
    assert f"gwinc {folder}" in done.stdout
    picture = tmp_path / "budget.png"
    done = command("--save", picture, folder)
    assert (done.returncode, done.stderr) == (0, "")
    assert picture.stat().st_size > 10_000
    (tmp_path / "other").mkdir()
    renamed = folder.rename(tmp_path / "other" / "mine")
    done = command("--save", picture, "--freq", "5:100", renamed)
    assert done.returncode == 2
    assert done.stderr.startswith("Error: the table of geo-silica-triple has 10 to 50 Hz")


def test_replaced_design_is_reported(tmp_path):
    words = ("--format", "gwinc", "--band", "20:30", "--out", tmp_path, "--name", "same")
    first = run("export", CONFIGS / "geo-silica-triple.toml", *words)
    again = run("export", CONFIGS / "geo-silica-triple.toml", *words)
    other = run(
        "export", CONFIGS / "geo-silica-triple.toml", *words, "--set", "constants.gravity=9.8"
    )
    assert "another design" not in first.stderr + again.stderr
    assert "(replaced the result of another design" in other.stderr


def test_folders_of_others_are_left_alone(exported, tmp_path):
    (tmp_path / "__init__.py").write_text("mine")
    with pytest.raises(sus.InputError, match="is a Python package"):
        exported.save(tmp_path)
    assert [file.name for file in tmp_path.iterdir()] == ["__init__.py"]
    with pytest.raises(sus.InputError, match="leave out the dot"):
        exported.save(tmp_path / "some.budget")


@pytest.mark.parametrize(
    ("edits", "message"),
    [
        # upright wires that lose energy only where they bend
        ({"loss_angle = 2e-4": "", "t1 = 0.08 ": "t1 = 0.095 "}, "test.z.*no thermal noise.*loss"),
        ({"d = 0.001 ": "d = -0.2 "}, "unstable"),
    ],
)
@pytest.mark.filterwarnings("ignore::suspension_cli.errors.PendsusWarning")
def test_designs_without_vertical_loss_and_unstable_ones_are_refused(edits, message):
    text = sus.template("single").text
    for old, new in edits.items():
        assert old in text
        text = text.replace(old, new)
    with pytest.raises(sus.InputError, match=message):
        sus.export(sus.parse(text), format="gwinc", band="10:20")


def test_results_of_other_formats_are_refused(exported):
    double = sus.export(sus.example("double"), fidelity="string")
    with pytest.raises(sus.InputError, match="has no table"):
        sus.gwinc(double)
    with pytest.raises(sus.InputError, match="has no state space"):
        sus.python_control(exported)


def test_unknown_interferometer_is_named_by_gwinc(exported):
    with pytest.raises(RuntimeError, match="Unknown IFO 'aligo'"):
        gwinc_budget.suspend(exported.table, "aligo")
