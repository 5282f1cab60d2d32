"""What pendsus fit promises: the truth is found, uncertainties are what they say, a fit that
explains nothing says so first, and errors are reported."""

from __future__ import annotations

import re
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy import stats

from suspension_cli.analyses.fit import solve as fit
from suspension_cli.design import reader
from suspension_cli.design.measured import Free, Measured, Mode
from suspension_cli.linear import eigenmodes
from suspension_cli.models import registry
from tests.support.commandline import assert_refused, edited, run, strict_json, written
from tests.support.faulty_designs import parse
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
    names = eigenmodes.solve(registry.STRING.system(reader.read(file).design)).label
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


def test_as_many_parameters_as_data(tmp_path):
    """One parameter meets one frequency, which tests nothing. E and radius together count as E r^2
    alone, so that they cannot meet two frequencies that contradict each other."""
    design = written(tmp_path, CASE.read_text(), "design.toml")
    vertical = '[[mode]]\nlabel = "test vertical"\nfrequency = 11.4\nuncertainty = 0.1\n'
    roll = '[[mode]]\nlabel = "test roll"\nfrequency = 15.0\nuncertainty = 0.1\n'
    modulus = '[[parameter]]\nname = "materials.steel302.youngs_modulus"\n'
    radius = '[[parameter]]\nname = "stage.test.wires.radius"\n'
    short = written(tmp_path, vertical + modulus, "one.toml")
    exact = run("fit", design, short, "--fidelity", "string", "--out", tmp_path)
    assert "MISFIT" not in exact.stdout
    assert "for 0 degrees of freedom: the data determine the parameters and test" in exact.stdout
    both = written(tmp_path, vertical + roll + modulus + radius, "two.toml")
    found = run("fit", design, both, "--fidelity", "string", "--out", tmp_path / "two")
    said = found.stdout + found.stderr
    assert "MISFIT" in said and "0 degrees of freedom: there are at least as many" in said
    assert re.search(r"test (vertical|roll) is off by [+-]\d", said)
    assert "test nothing" not in said


def test_what_is_determined_does_not_depend_on_the_start():
    """f^2 is proportional to E, whose relative uncertainty is twice that of f."""
    measured = [Mode(frequency=11.4, uncertainty=0.1, label="test vertical")]
    for start in (2e9, 2e11):
        number = Free(name="materials.steel302.youngs_modulus", start=start)
        found = fit.solve(
            [CASE.read_text()], Measured(mode=measured, parameter=[number]), level="string"
        )
        [line] = found.determined
        assert line == "determined: materials.steel302.youngs_modulus (to 1.8 %)"


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


def test_the_fitted_design(tmp_path):
    """It has the fitted values with the digits that matter, and the modes that the fit reports."""
    result = run("fit", CASE, MEASURED, "--out", tmp_path, "--json")
    answer = strict_json(result.stdout)
    fitted = tmp_path / "husman2000-table1-case4-fitted.toml"
    assert fitted.read_text().startswith(
        "# table1-case4.toml, fitted to table1-case4.toml by pendsus"
    )
    design = reader.read(fitted).design
    digits = answer["digits"]
    assert 3 <= digits <= 6
    assert f"rounded to {digits} digits" in fitted.read_text()
    modulus = design.materials["steel302"].youngs_modulus
    assert modulus == float(f"{answer['parameters'][0]['value']:.{digits}g}")
    assert answer["fidelity"] == "beam" and 0 < answer["estimated_error"] < 1e-3
    again = eigenmodes.solve(registry.BEAM.system(design))
    changes = [
        (mode["after_hz"] - again.frequency[again.label.index(mode["label"])])
        / mode["uncertainty_hz"]
        for mode in answer["modes"]
    ]
    assert 1e-6 < np.linalg.norm(changes) < 0.1


def test_parameters_known_only_together_are_written_with_more_digits():
    """E and the mass are known to 1 % each, but bounce, which depends on E over m, to 1e-6."""
    modes = Mode(label="test vertical", frequency=11.4, uncertainty=1e-5)
    free = [
        Free(name="materials.steel302.youngs_modulus", prior=1.7e11, uncertainty=1.7e9),
        Free(name="stage.test.body.mass", prior=20.0, uncertainty=0.2),
    ]
    found = fit.solve([CASE.read_text()], Measured(mode=[modes], parameter=free))
    assert (found.sigma > 1e-3 * found.value).all()
    again = eigenmodes.solve(registry.STRING.system(reader.parse(found.toml[0])))
    bounce = again.frequency[again.label.index("test vertical")]
    assert bounce == pytest.approx(found.after[0], abs=1e-6)
    assert found.digits >= 5


E = "materials.steel302.youngs_modulus"
VERTICAL = {"label": "test vertical", "uncertainty": 0.1}
SHORT = {"design": str(CASE), "set": ["stage.test.wires.l=0.3"]}
BASES = {
    "modes": {"mode": [VERTICAL | {"frequency": 11.4}], "parameter": [{"name": E}]},
    "joint": {
        "experiment": [
            {"name": "long", "design": str(CASE), "mode": [VERTICAL | {"frequency": 11.3}]},
            SHORT | {"mode": [VERTICAL | {"frequency": 14.0}]},
        ],
        "parameter": [{"name": E}],
    },
}
FAULTY = parse(Path(__file__).parent / "faulty_measurements.txt", BASES, "modes")["faults"]


@pytest.mark.parametrize("case", FAULTY, ids=lambda case: case.name)
def test_bad_measurements_are_refused(case, tmp_path):
    file = written(tmp_path, edited(BASES[case.base], case.edits), "measured.toml")
    design, out = [CASE] if case.base == "modes" else [], tmp_path / "out"
    lines = assert_refused(run("fit", *design, file, "--out", out), file, out)
    named = [line.replace(f'parameter."{E}"', "parameter.1") for line in lines]
    assert any(line.startswith(case.says) for line in named), lines


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


def test_a_negative_stiffness_is_not_accepted_in_silence(tmp_path):
    """A frame that would have to push: kept, with a warning; with a bound it ends there."""
    raw = {
        "mode": [{"label": "test vertical", "frequency": 12.5, "uncertainty": 0.01}],
        "parameter": [{"name": "stage.test.spring.1.stiffness.3", "start": 0.0}],
    }
    spring = "\n[[stage.spring]]\nstiffness = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]\n"
    design = tmp_path / "sprung.toml"
    design.write_text(CASE.read_text() + spring)
    stiff = eigenmodes.solve(registry.STRING.system(reader.read(design).design))
    vertical = stiff.frequency[stiff.label.index("test vertical")]
    raw["mode"][0]["frequency"] = float(vertical) - 0.2
    words = ("--out", tmp_path, "--no-plot", "--quiet", "--fidelity", "string")
    result = run("fit", design, written(tmp_path, raw, "measured.toml"), *words)
    assert result.exit_code == 0, result.stderr
    assert "stage.test.spring.1.stiffness.3 is fitted as -" in result.stderr
    assert "N/m" in result.stderr and "lower = 0.0" in result.stderr
    raw["parameter"][0]["lower"] = 0.0
    bounded = run("fit", design, written(tmp_path, raw, "measured.toml"), *words)
    assert "is fitted as -" not in bounded.stderr
    assert "at its bound" in bounded.stdout, bounded.stdout


INERTIA = "stage.test.body.inertia.2"
NAME = "husman2000-table1-case4-fit.h5"


def measured(exchange=(), **bounds):
    """Modes of a stiffer steel with 0.1 % noise, two of them under each other's labels."""
    found = eigenmodes.solve(registry.STRING.system(reader.read(CASE, (f"{E}=1.8e11",)).design))
    noise = np.random.default_rng(0).standard_normal(len(found.frequency))
    labels = found.label
    for first, second in [exchange] if exchange else []:
        i, j = labels.index(first), labels.index(second)
        labels[i], labels[j] = second, first
    rows = [
        {"frequency": float(f * (1 + 1e-3 * e)), "uncertainty": float(1e-3 * f), "label": label}
        for f, e, label in zip(found.frequency, noise, labels, strict=True)
    ]
    return {"mode": rows, "parameter": [{"name": E, "start": 1.7e11} | bounds, {"name": INERTIA}]}


def fitted(tmp_path, raw, *options, level="string"):
    result = run(
        "fit",
        CASE,
        written(tmp_path, raw, "measured.toml"),
        "--no-plot",
        *("--out", tmp_path / "out", "--fidelity", level),
        *options,
    )
    assert result.exit_code == 0, result.stderr
    return result


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    """Output of a good fit."""
    return strict_json(fitted(tmp_path_factory.mktemp("good"), measured(), "--json").stdout)


def test_a_misfit_is_reported_first(tmp_path):
    pair = ("test yaw", "test roll")
    model, _, first, second, *_ = fitted(tmp_path, measured(pair), level="auto").stdout.splitlines()
    assert model.startswith("model: beam (")
    assert first.startswith("MISFIT: chi^2 is ")
    assert all(f'"{label}"' in second for label in pair)


@pytest.mark.parametrize("pair", [("test yaw", "test roll"), ("test pitch", "test vertical")])
def test_exchanged_labels_are_found(pair, good, tmp_path):
    answer = strict_json(fitted(tmp_path, measured(pair), "--json").stdout)
    assert answer["misfit"]
    assert sorted(answer["exchange"]["labels"]) == sorted(pair)
    assert answer["exchange"]["chi_squared"] == pytest.approx(good["chi_squared"], rel=1e-6)


def test_a_good_fit_has_no_remark(good, tmp_path):
    assert "MISFIT" not in fitted(tmp_path, measured()).stdout
    assert (good["misfit"], good["sigma_scale"], good["exchange"]) == (False, 1.0, None)


def test_uncertainties_of_a_misfit_are_scaled(tmp_path):
    """By the root of chi^2 per degree of freedom, in JSON, file and table alike; the file gives the
    same picture again."""
    raw = measured()
    for row in raw["mode"]:
        # ten sigma, which no number explains
        row["frequency"] *= 1 + 0.01 * (-1) ** raw["mode"].index(row)
    answer = strict_json(fitted(tmp_path, raw, "--json", "--plot").stdout)
    scale = np.sqrt(answer["chi_squared"] / answer["degrees_of_freedom"])
    assert answer["misfit"]
    assert answer["sigma_scale"] == pytest.approx(scale, rel=1e-12)
    with h5py.File(tmp_path / "out" / NAME) as file:
        assert file["fit/sigma"][:].tolist() == [item["sigma"] for item in answer["parameters"]]
        assert file["fit"].attrs["sigma_scale"] == answer["sigma_scale"]
        variance = np.diag(file["fit/covariance"][:])
        np.testing.assert_allclose(np.sqrt(variance), file["fit/sigma"][:], rtol=1e-12)
    picture = tmp_path / "out" / NAME.replace(".h5", ".png")
    before = picture.read_bytes()
    assert run("plot", picture.with_suffix(".h5")).exit_code == 0
    assert picture.read_bytes() == before
    wide = [{**row, "uncertainty": row["uncertainty"] * scale} for row in raw["mode"]]
    alike = strict_json(fitted(tmp_path, raw | {"mode": wide}, "--json").stdout)
    assert not alike["misfit"]
    for found, expected in zip(answer["parameters"], alike["parameters"], strict=True):
        assert found["sigma"] == pytest.approx(expected["sigma"], rel=1e-6)


def test_a_number_at_its_bound_has_no_uncertainty(tmp_path):
    raw = measured(lower=1e11, upper=1.75e11)
    result = fitted(tmp_path, raw)
    assert "  1.75000e+11  at its bound\n" in result.stdout
    head = (tmp_path / "out" / "husman2000-table1-case4-fitted.toml").read_text()
    assert "at its bound, from 1.7e+11" in head
    assert "nan" not in result.stdout + head
    number = strict_json(fitted(tmp_path, raw, "--json").stdout)["parameters"][0]
    assert (number["sigma"], number["at_bound"]) == (None, True)
