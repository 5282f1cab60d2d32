"""Sweeps of any quantity against each design alone, and what is said of requirements."""

from __future__ import annotations

import math

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.analyses.named_quantities import names_of
from suspension_cli.analyses.sweep.parameter_sweep import ParameterSweep
from suspension_cli.quantities import requirements
from suspension_cli.quantities.nominal_results import find_results
from suspension_cli.quantities.requirements import Limits
from suspension_cli.studies.job import Axis
from tests.support.commandline import document, run, written
from tests.support.golden import CONFIGS

SINGLE = "husman2000/table1-case2"
LENGTH = "stage.test.wires.l"


def alone(design: sus.Design, text: str, level: str) -> float:
    """A quantity of one design, as `pendsus check` prints it for a requirement."""
    found = requirements.find([Limits(text, low=-math.inf, high=1e99)], names_of(design))
    [verdict] = requirements.judge(found, design.design, level)
    return verdict.value


def test_thermal_noise_and_q_are_those_of_their_commands():
    """In a model whose wires bend, which `auto` takes."""
    design = sus.example("double")
    path = "stage.test.wires.radius"
    radii = [1.5e-4, 2.5e-4]
    names = ["thermal test.x:10", "Q of test longitudinal"]
    found = sus.sweep(design, vary={path: radii}, results=names)
    assert found.model in ("beam", "violin")
    assert found.unit == ("m/Hz^0.5", "1")
    for row, radius in zip(found.value, radii, strict=True):
        own = design.replace({path: radius})
        noise = sus.thermal(own, outputs=["test.x"], frequency=[10.0], fidelity=found.model)
        modes = sus.modes(own, fidelity=found.model)
        q = modes.q[list(modes.label).index("test longitudinal")]
        assert row == pytest.approx([noise.amplitude[0, 0], q], rel=1e-8)


def test_a_model_without_bending_is_completed_and_that_is_said(tmp_path):
    """Losses act where wires bend; what does not need it stays in the model that was asked for."""
    file = CONFIGS / "double.toml"
    vary = ("--vary", "stage.test.wires.d=1e-3,2e-3", "--no-plot", "--out", tmp_path)
    for names, model in (
        (["thermal test.x:10"], "beam"),
        (["thermal test.x:10", "test yaw"], "string"),
    ):
        words = [word for name in names for word in ("--result", name)]
        done = run("sweep", file, *vary, *words, "--fidelity", "string")
        assert done.exit_code == 0, done.stderr
        assert "thermal test.x:10: computed in the beam model, as losses act" in done.stderr
        assert f"model: {model} " in done.stdout
        value = sus.load(tmp_path / "double-sweep.h5").value[0, 0]
        own = sus.example("double").replace({"stage.test.wires.d": 1e-3})
        assert value == pytest.approx(alone(own, "thermal test.x:10", "beam"), rel=1e-8)


def test_only_undamped_modes_are_refused_on_wires_with_mass():
    design = sus.example("double")
    how = {"vary": {"stage.test.wires.d": [1e-3]}, "fidelity": "violin"}
    found = sus.sweep(design, results=["test.x/support.x:300"], **how)
    assert found.model == "violin"
    for name in ("5", "test pitch", "lowest pitch", "distance test pitch, test yaw"):
        with pytest.raises(sus.InputError, match="has no modes that could be followed"):
            sus.sweep(design, results=["test.x/support.x:300", name], **how)


def test_a_number_is_the_mode_as_drawn_and_a_label_the_motion():
    """Both names of one mode are told apart."""
    text = sus.example("double").text
    names = names_of(sus.example("double"))
    both = find_results(["test pitch", "modes"], names, text, "string")
    followed = [one.text for one in both[1:]]
    assert sum(name.startswith("test pitch (mode ") for name in followed) == 1
    assert len(followed) == 12
    own = find_results(["3"], names, text, "string")
    job = ParameterSweep(text, (Axis(LENGTH, (0.3,)),), "string", own)
    assert own[0].text == job.nominal.label[2]


def test_jobs_with_other_ground_are_not_mixed_up(tmp_path):
    """A run that is resumed continues only with the same motion of the support."""
    found = []
    for last in ("1e-9", "1.0000001e-9"):
        spectrum = tmp_path / "ground.csv"
        rows = [f"{0.1 * n},1e-9" for n in range(1, 2000)]
        spectrum.write_text("\n".join([*rows[:1500], f"150.05,{last}", *rows[1500:]]))
        design = sus.example("double").replace({"analysis.budget.ground": str(spectrum)})
        results = find_results(["noise test.x:10"], names_of(design), design.text, "beam")
        text = sus.example("double").text
        found.append(ParameterSweep(text, (Axis(LENGTH, (0.3,)),), "beam", results).identity)
    assert found[0] != found[1]


def test_what_a_design_lacks_is_counted_with_its_reason(tmp_path):
    """Above some gain a loop is unstable: no margin, no noise, no settling."""
    file = CONFIGS / "triple-damped.toml"
    results = ("--result", "margin pitch.gain", "--result", "settling of modes")
    vary = ("--vary", "control.loop.pitch.gain=1e6,1.5e3", "--fidelity", "beam")
    answer = document("sweep", file, *vary, *results, "--out", tmp_path, "--no-plot")
    assert [row["values"][0] for row in answer["results"]] == [None, None]
    margin, settling = answer["remarks"]
    assert margin.startswith("margin pitch.gain has no value at 1 of 2 points")
    assert margin.endswith("the design has no margin: the closed loop is unstable")
    assert settling.startswith("settling of modes is infinite at 1 of 2 points")


def with_requirements(tmp_path, *tables: str):
    """A file of the single pendulum with requirements."""
    text = (CONFIGS / f"{SINGLE}.toml").read_text()
    return written(tmp_path, "\n".join([text, *(f"[[requirement]]\n{one}" for one in tables)]))


def test_limits_are_drawn_and_their_share_is_said(tmp_path):
    """A simple pendulum: f = sqrt(g / l) / 2 pi, so l of at least g / (2 pi f)^2 meets a limit."""
    limit = 0.9
    file = with_requirements(
        tmp_path,
        f'quantity = "test longitudinal"\nat_most = {limit}',
        'quantity = "test height"\nat_most = 0.1',
    )
    options = ("--vary", f"{LENGTH}=0.2:0.5:31", "--fidelity", "force", "--out", tmp_path)
    done = run("sweep", file, *options, "--result", "test longitudinal")
    found = sus.load(next(tmp_path.glob("*-sweep.h5")))
    expected = found.value[:, 0] <= limit
    assert found.required == ("test longitudinal <= 0.9 Hz",), "what is swept, on lines"
    assert found.met[:, 0].tolist() == expected.tolist()
    np.testing.assert_allclose(found.margin[:, 0], 1 - found.value[:, 0] / limit, atol=1e-12)
    assert f"met at {expected.sum()} of 31 points" in done.stdout
    heights = [
        line.get_ydata()[0] for line in found.plot().axes[0].lines if len(line.get_ydata()) == 2
    ]
    assert limit in heights


def test_maps_have_the_feasible_region_of_all_requirements(tmp_path):
    """Also of a quantity that is no result, and of requirements given for the sweep alone."""
    file = with_requirements(tmp_path, 'quantity = "test height"\nat_most = 0.35')
    grid = {LENGTH: np.linspace(0.2, 0.5, 7), "stage.test.wires.s": [0.01, 0.02]}
    found = sus.sweep(
        sus.read(file),
        vary=grid,
        results=["test longitudinal"],
        require=["test longitudinal in 0.8:1.2"],
        fidelity="string",
        workers=1,
    )
    assert found.result == ("test longitudinal",)
    assert found.required_quantity == ("test height", "test longitudinal")
    longitudinal = found.value[..., 0]
    expected = (longitudinal >= 0.8) & (longitudinal <= 1.2)
    assert found.met[..., 1].tolist() == expected.tolist()
    heights = [
        alone(sus.read(file).replace({LENGTH: one}), "test height", "string")
        for one in grid[LENGTH]
    ]
    assert found.met[:, 0, 0].tolist() == [height <= 0.35 for height in heights]
    together = found.document()["all_requirements"]
    assert together["share"] == found.met.all(-1).mean()
    assert 0 < together["share"] < 1
    assert np.array_equal(found.worst_margin >= 0, found.met.all(-1))
    figure = found.plot()
    red = [one for one in figure.axes[0].collections if one.get_edgecolor().any()]
    assert red
    assert any("red line: just met" in text.get_text() for text in figure.texts)


def test_requirements_count_however_they_are_written():
    text = sus.example("double").text
    text += '\n[[requirement]]\nquantity = "test.x/support.x:10.0"\nat_most = 1.0\n'
    found = sus.sweep(
        sus.parse(text),
        vary={LENGTH: [0.29, 0.3]},
        results=["test.x/support.x:10"],
        fidelity="string",
    )
    assert found.required_quantity == ("test.x/support.x:10",)
    assert found.met.all()
