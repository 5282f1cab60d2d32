"""What `pendsus fit` promises: the truth is found, uncertainties are what they say, and errors are
reported."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from suspension_cli.analyses import registry as analyses
from suspension_cli.analyses.fit import solve as fit
from suspension_cli.analyses.fit.problem import build
from suspension_cli.design import measured, reader
from suspension_cli.design.measured import Free, Measured, Mode
from suspension_cli.files.hdf5 import open_results
from suspension_cli.linear import eigenmodes, named_results
from suspension_cli.models import registry
from tests.support.commandline import assert_refused, run, strict_json, written
from tests.support.golden import CONFIGS, ROOT

TRIPLE = CONFIGS / "husman2000" / "table2.toml"
CASE = CONFIGS / "husman2000" / "table1-case4.toml"
TRUTH = {
    "materials.steel302.youngs_modulus": 1.78e11,
    "stage.middle.blades.stiffness": 440.0,
    "stage.test.wires.d": 3.1e-3,
}
REGION = 7.8147
"""95 % of chi^2 with three degrees of freedom."""
FREE = [Free(name=name) for name in TRUTH]


def frequencies(file, values):
    """Frequencies of a design with numbers put in, and the labels of the design as drawn."""
    names = named_results.labels(eigenmodes.solve(registry.STRING.system(reader.read(file).design)))
    design = reader.read(file, tuple(f"{path}={value!r}" for path, value in values.items())).design
    return eigenmodes.solve(registry.STRING.system(design)).frequency, names


@pytest.fixture(scope="module")
def truth():
    return frequencies(TRIPLE, TRUTH)


def modes_of(truth, noise=None, share=0.005, labelled=True):
    frequency, names = truth
    noise = np.zeros(len(frequency)) if noise is None else noise
    return [
        Mode(
            frequency=float(f * (1 + share * e)),
            uncertainty=float(share * f),
            label=name if labelled else None,
        )
        for f, e, name in zip(frequency, noise, names, strict=True)
    ]


def test_the_truth_is_found_without_noise(truth):
    for labelled in (True, False):
        found = fit.solve(
            [TRIPLE.read_text()], Measured(mode=modes_of(truth, labelled=labelled), parameter=FREE)
        )
        np.testing.assert_allclose(found.value, list(TRUTH.values()), rtol=1e-8)
        assert found.chi_squared < 1e-12
        assert found.freedom == 15


def test_the_truth_lies_in_the_95_percent_region_so_often(truth):
    """Synthetic data of a perturbed triple with 0.5 % noise, 12 trials: 10 to 12 in the region;
    distances are distributed as chi^2."""
    text, distance, apart = TRIPLE.read_text(), [], []
    for trial in range(12):
        noise = np.random.default_rng(trial).standard_normal(18)
        found = fit.solve([text], Measured(mode=modes_of(truth, noise), parameter=FREE))
        apart.append((found.value - list(TRUTH.values())) / found.sigma)
        correlation = found.covariance / np.outer(found.sigma, found.sigma)
        distance.append(float(apart[-1] @ np.linalg.solve(correlation, apart[-1])))
    assert 10 <= sum(value < REGION for value in distance) <= 12
    assert stats.kstest(distance, stats.chi2(3).cdf).pvalue > 0.05
    within = (np.abs(apart) < 1).mean()  # 68 %, give or take 8: of all three numbers together
    assert 0.55 < within < 0.81


def test_one_number_by_hand():
    """Young's modulus from the vertical mode alone: f goes with its root but for what gravity
    adds."""
    given = Measured(
        mode=[Mode(frequency=11.4, uncertainty=0.1, label="test vertical")],
        parameter=[Free(name="materials.steel302.youngs_modulus")],
    )
    found = fit.solve([CASE.read_text()], given)
    design = reader.read(CASE).design
    m, l, t, radius, g = 20.0, 0.36, 0.133, design.stage[0].wires.radius, 9.81
    sin2 = (t / l) ** 2
    k = ((2 * np.pi * 11.4) ** 2 - g * sin2 / (l * np.sqrt(1 - sin2))) * m / (4 * (1 - sin2))
    assert found.value[0] == pytest.approx(k * l / (np.pi * radius**2), rel=1e-8)
    slope = np.pi * radius**2 / l * 4 * (1 - sin2) / m / (8 * np.pi**2 * 11.4)
    assert found.sigma[0] == pytest.approx(0.1 / slope, rel=1e-7)
    assert found.freedom == 0 and found.chi_squared < 1e-12


def test_priors_bounds_and_what_the_data_cannot_tell():
    """E and radius only count as E r^2: a prior on one gives the other; without, that combination
    alone is known."""
    both = [
        Free(name="materials.steel302.youngs_modulus"),
        Free(name="stage.test.wires.radius", prior=142.5e-6, uncertainty=1e-6),
    ]
    modes_measured = [
        Mode(frequency=f, uncertainty=0.05, label=label)
        for f, label in ((11.4, "test vertical"), (19.0, "test roll"))
    ]
    found = fit.solve([CASE.read_text()], Measured(mode=modes_measured, parameter=both))
    sigma = found.sigma / found.scale  # they cannot explain both modes
    assert found.value[1] == pytest.approx(142.5e-6, rel=1e-6)
    assert sigma[1] == pytest.approx(1e-6, rel=1e-6)
    relative = sigma / found.value
    assert found.singular[1] < 1e-8 * found.singular[0]
    np.testing.assert_allclose(np.abs(found.direction[1]), np.array([2, 1]) / np.sqrt(5), rtol=1e-6)
    assert relative[0] == pytest.approx(
        np.hypot(2 * relative[1], found.singular[0] ** -1 * np.sqrt(5)), rel=1e-4
    )
    blind = fit.solve(
        [CASE.read_text()],
        Measured(mode=modes_measured, parameter=[both[0], Free(name="stage.test.wires.radius")]),
    )
    assert np.isinf(blind.sigma).all()
    free = Free(name=both[0].name, lower=1.6e11, upper=1.65e11, start=1.62e11)
    bounded = fit.solve([CASE.read_text()], Measured(mode=modes_measured, parameter=[free]))
    assert bounded.at_bound.all() or 1.6e11 < bounded.value[0] < 1.65e11


MEASURED = ROOT / "measured" / "husman2000" / "table1-case4.toml"


def test_the_command(tmp_path):
    result = run("fit", CASE, MEASURED, "--out", tmp_path)
    assert result.exit_code == 0, result.stderr
    assert "chi^2" in result.stdout
    answer = strict_json(run("fit", CASE, MEASURED, "--out", tmp_path, "--json").stdout)
    fitted = tmp_path / "husman2000-table1-case4-fitted.toml"
    assert fitted.read_text().startswith(
        "# table1-case4.toml, fitted to table1-case4.toml by pendsus"
    )
    design = reader.read(fitted).design
    assert design.materials["steel302"].youngs_modulus == answer["parameters"][0]["value"]
    assert answer["fidelity"] == "beam" and 0 < answer["estimated_error"] < 1e-3
    again = eigenmodes.solve(registry.BEAM.system(design))
    for mode in answer["modes"]:
        assert mode["after_hz"] == pytest.approx(
            again.frequency[again.label.index(mode["label"])], rel=1e-12
        )
    png = tmp_path / "husman2000-table1-case4-fit.png"
    before = png.read_bytes()
    assert run("plot", png.with_suffix(".h5")).exit_code == 0
    assert png.read_bytes() == before
    with open_results(png.with_suffix(".h5")) as file:
        loaded = analyses.loaded(file, "")
    assert f"{loaded}\n" == result.stdout
    assert loaded.document() == answer
    loaded.save(tmp_path / "again.h5")
    assert (tmp_path / "again.h5").read_bytes() == png.with_suffix(".h5").read_bytes()


MODE = {"frequency": 11.4, "uncertainty": 0.1, "label": "test vertical"}
PLAIN = {"frequency": 1.0, "uncertainty": 0.1}
NUMBER = {"name": "materials.steel302.youngs_modulus"}
GIVEN = {"mode": [MODE], "parameter": [NUMBER]}
D, LENGTH = "stage.test.wires.d", "stage.test.wires.sections.1.length"
BAD = {
    "empty": ({"mode": None, "parameter": None}, "is empty"),
    "no modes": ({"mode": None}, "none of mode, transfer_function, experiment"),
    "a design": (
        {"mode": None, "parameter": None, "stage": []},
        "is a design (it has [[stage]]), not a file of measurements",
    ),
    "a label and a direction": (
        {"mode": [MODE | {"dof": ["z"]}]}, 'mode.1.dof = ["z"]: conflicts with label',
    ),
    "no direction": ({"mode": [PLAIN | {"dof": ["q"]}]}, 'mode.1.dof.1 = "q": must be one of'),
    "shared by none": (
        {"parameter": [NUMBER | {"experiments": ["a"]}]},
        'parameter.1.experiments = ["a"]: there are no',
    ),
    "unknown key": ({"modes": 1}, "modes = 1: unknown key"),
    "no uncertainty": ({"mode": [{"frequency": 1.0}]}, "mode.1.uncertainty: missing"),
    "certain": ({"mode": [MODE | {"uncertainty": 0.0}]}, "mode.1.uncertainty = 0.0"),
    "half a prior": (
        {"parameter": [NUMBER | {"prior": 1e11}]}, "parameter.1: prior and uncertainty",
    ),
    "bounds": (
        {"parameter": [NUMBER | {"lower": 2.0, "upper": 1.0}]},
        "parameter.1.lower = 2.0: is not below",
    ),
    "start": (
        {"parameter": [NUMBER | {"lower": 2.0, "start": 1.0}]},
        "parameter.1.start = 1.0: lies outside",
    ),
    "twice": ({"parameter": [NUMBER, NUMBER]}, "parameter.2.name"),
    # what does not fit the design
    "no such mode": (
        {"mode": [MODE | {"label": "test sideways"}]},
        'mode.1.label = "test sideways": is the label of no mode',
    ),
    "measured twice": (
        {"mode": [MODE, MODE]},
        'mode.2.label = "test vertical": does not name exactly one mode',
    ),
    "no such direction": (
        {"mode": [MODE, PLAIN | {"dof": ["z"]}]},
        'mode.2.dof = ["z"]: no unassigned mode moves mainly in these',
    ),
    "too many": ({"mode": [PLAIN] * 7}, "mode: the design has only 6 modes"),
    "no such number": (
        {"parameter": [{"name": "stage.test.wires.q"}]},
        'parameter.1.name = "stage.test.wires.q": the design gives no such number',
    ),
    "member of what is not in the design": (
        {"parameter": [{"name": LENGTH}]},
        f'parameter.1.name = "{LENGTH}": the design gives no such number',
    ),
    "start of what is not in the design": (
        {"parameter": [{"name": "perturbation.1.k_factor", "start": 1.1}]},
        "parameter.1 = 1.1: perturbation.1.k_factor: the design gives no perturbation of which",
    ),
    "not in the design": (
        {"parameter": [{"name": "support.stiffness.z"}]},
        'parameter.1.name = "support.stiffness.z": the design gives no such number',
    ),
    "no sound start": (
        {"parameter": [{"name": D, "start": 1e9}]}, f"parameter.1 = 1e+09: {D}: must be at least",
    ),
    "outside": (
        {"parameter": [NUMBER | {"upper": 1e11}]},
        "parameter.1: the design's value 1.7e+11 lies outside the bounds",
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", BAD)
def test_bad_measurements_are_refused(kind, tmp_path):
    changes, problem = BAD[kind]
    raw = {key: value for key, value in (GIVEN | changes).items() if value is not None}
    file, out = written(tmp_path, raw, "measured.toml"), tmp_path / "out"
    lines = assert_refused(run("fit", CASE, file, "--out", out), file, out)
    named = [line.replace(f'parameter."{NUMBER["name"]}"', "parameter.1") for line in lines]
    assert any(line.startswith(problem) for line in named), lines


def test_a_fit_that_ends_at_an_unstable_design_says_so(tmp_path):
    """From a start that is unstable the search finds no way back."""
    raw = {
        "mode": [{"label": "test pitch", "frequency": 0.78, "uncertainty": 0.01}],
        "parameter": [{"name": "stage.upper.wires.d", "start": -0.02}],
    }
    words = (CONFIGS / "double.toml", written(tmp_path, raw, "measured.toml"), "--out", tmp_path)
    result = run("fit", *words, "--no-plot", "--quiet")
    says = "the fitted design double is unstable in the beam model: upper pitch grows at "
    assert result.exit_code == 0 and says in result.stderr


def test_a_search_ends_where_chi_squared_is_least():
    """28 numbers, a third of them hardly known: chi^2 does not change with any at the end."""
    data = measured.read(ROOT / "measured" / "husman2000" / "table2.toml")
    problem = build([TRIPLE.read_text()], data, [""], registry.STRING.name)
    z, chi_squared = problem.minimise(problem.unknowns.start)
    assert chi_squared == pytest.approx(17.83, abs=0.01)
    gradient = 2 * problem.jacobian(z).T @ problem.residual(z) * problem.unknowns.scale
    assert np.abs(gradient).max() < 0.05
