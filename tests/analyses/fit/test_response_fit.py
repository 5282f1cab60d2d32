"""Fits of transfer functions: derivatives, the truth within its region, wrong channels,
what is determined, what to measure next, and the command on files of data."""

from __future__ import annotations

import tomllib
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

import suspension_cli as sus
from suspension_cli.analyses.fit import (
    changes,
    chi_squared_search,
    determined,
    findings,
    picture,
    start,
)
from suspension_cli.analyses.fit import solve as fit
from suspension_cli.analyses.fit.explanations import name_factor
from suspension_cli.analyses.fit.solution import Solution
from suspension_cli.analyses.fit.start import default_parameters
from suspension_cli.conventions import DOFS
from suspension_cli.design import measured as measured_file
from suspension_cli.design import paths, reader
from suspension_cli.design.measured import Free, Measured, Transducer
from suspension_cli.drawing.panels import COLUMN
from suspension_cli.linear import signals
from suspension_cli.measurements import read as read_measured
from suspension_cli.measurements.transfer_function import MeasuredResponse
from suspension_cli.studies import parameters
from suspension_cli.studies.response_matrix import Plant
from tests.support.commandline import assert_refused, run, strict_json
from tests.support.golden import CONFIGS, ROOT
from tests.support.legible import assert_legible, said
from tools import asbuilt_trials as trials

DOUBLE = (CONFIGS / "double.toml").read_text()
PLANE = ("x", "pitch")
GRID = np.geomspace(0.2, 30.0, 120)


def plane(seed, **how):
    """A double pendulum measured in x and pitch alone."""
    return trials.double(seed, **{"dofs": PLANE, "frequency": GRID} | how)


def test_the_truth_lies_in_the_95_percent_region_and_wrong_channels_are_found():
    """4 builds with resonances up to tens of per cent off, each with a sensor or an actuator that
    is inverted or scaled; docs/fit.md has 200 with all 36 functions."""
    distances = []
    for seed in range(4):
        given, true = plane(seed)
        wrong = (trials.KINDS[seed % 2], seed // 2 % 2, ("sa"[seed // 2 % 2] + "-x",) * 2)
        found = trials.spoil(given, *wrong).fit()
        assert trials.is_found(found.responses.corrections, *wrong), (seed, found.responses)
        (channel,) = findings.document(found, [None])["wrong_channels"]
        assert channel["kind"] == wrong[0] and list(channel["channels"]) == [wrong[2][0]]
        distances.append(trials.distance(found, true))
    assert sum(d < stats.chi2(6).ppf(0.95) for d in distances) >= 3
    assert stats.kstest(distances, stats.chi2(6).cdf).pvalue > 0.02


def test_channels_are_found_exchanged_and_left_alone_when_right():
    for seed in range(2):
        given, _ = trials.double(
            seed, dofs=("x", "y", "roll", "pitch"), frequency=np.geomspace(0.2, 30, 60)
        )
        side, letter = seed % 2, "sa"[seed % 2]
        for names in ((f"{letter}-x", f"{letter}-y"), (f"{letter}-pitch", f"{letter}-roll")):
            found = trials.spoil(given, "exchange", side, names).fit().responses
            assert trials.is_found(found.corrections, "exchange", side, names), (seed, found)
        assert given.fit().responses.corrections == ()


def test_only_a_sum_is_known():
    """Of two heights that the data see together, the sentence says so; of E and r, E r^2."""
    spread = 1e-6 * np.array([[1.0, -0.999], [-0.999, 1.0]])
    lines, taken = determined.combinations(
        ["a.d", "a.d_upper"], [True, True], np.full(2, 1e-3), spread, np.array([True, True])
    )
    assert lines == ["only the sum of a.d and a.d_upper is known (to 0.045 mm)"]
    assert taken == {0, 1}
    free = [
        Free(name=name) for name in ("stage.test.wires.radius", "materials.c70steel.youngs_modulus")
    ]
    made = trials.simulate(
        DOUBLE, {}, free, np.random.default_rng(0), stage="test", dofs=("z",), frequency=GRID
    )
    assert "c70steel.youngs_modulus" in "; ".join(made.fit().determined)


def test_delays_and_mixing_are_fitted():
    """A sensor that is late and turned, an actuator that leaks into another: found as such."""
    given, _ = plane(1, calibration=0.0, noise=0.01)
    true = {
        "sensor.s-x.delay": 2e-3,
        "sensor.s-x.mix.upper.pitch": 1e-3,
        "actuator.a-x.mix.upper.torque_pitch": 2e-3,
    }
    late, turned, leak = true.values()
    value = {(one.output, one.input): one.value for one in given.functions}
    for out in ("s-x", "s-pitch"):
        value[out, "a-x"] = value[out, "a-x"] + leak * value[out, "a-pitch"]
    for into in ("a-x", "a-pitch"):
        both = value["s-x", into] + turned * value["s-pitch", into]
        value["s-x", into] = np.exp(-2j * np.pi * GRID * late) * both
    functions = [replace(one, value=value[one.output, one.input]) for one in given.functions]
    unsure = {
        "s-x": {"delay_uncertainty": 0.01, "mix_uncertainty": {"upper.pitch": 5e-3}},
        "a-x": {"mix_uncertainty": {"upper.torque_pitch": 5e-3}},
    }
    sensors, actuators = (
        [Transducer(name=one.name, signal=one.signal, **unsure.get(one.name, {})) for one in side]
        for side in (given.measured.sensor, given.measured.actuator)
    )
    measured = Measured(parameter=given.measured.parameter, sensor=sensors, actuator=actuators)
    found = fit.solve([DOUBLE], measured, (), functions, explain=False).responses
    values = dict(zip(found.nuisance, found.nuisance_value, strict=True))
    sigmas = dict(zip(found.nuisance, found.nuisance_sigma, strict=True))
    for name, expected in true.items():
        assert abs(values[name] - expected) < 6 * sigmas[name] + 0.02 * expected, name


def measure(design, names, grid, noise=0.03, inverted=()):
    """Diagonal functions of the upper mass, measured with 3 % noise."""
    random, functions = np.random.default_rng(2), []
    forces = [f"upper.{signals.FORCES[DOFS.index(name)]}" for name in names]
    outputs = [f"upper.{name}" for name in names]
    found = sus.response(design, inputs=forces, outputs=outputs, frequency=grid, fidelity="beam")
    for n, (drive, output) in enumerate(zip(forces, outputs, strict=True)):
        exact = found.value.reshape(len(grid), len(names), len(names))[:, n, n]
        sigma = noise * np.abs(exact)
        scatter = random.standard_normal((2, len(grid)))
        value = (exact + sigma * (scatter[0] + 1j * scatter[1])) * (-1 if output in inverted else 1)
        functions.append(
            MeasuredResponse(
                names[n], drive, output, grid, value, sigma, np.full(len(grid), np.nan)
            )
        )
    return functions


def test_a_wrong_height_is_found_at_high_q(monkeypatch):
    """Q of 1e4 and more, one d wrong by 1.5 mm, the sensor of pitch inverted: three functions are
    explained, as the single change explains them, after few derivatives of designs."""
    built = sus.parse(DOUBLE).replace({"stage.upper.wires.d": 0.0035})
    names, grid = ("x", "roll", "pitch"), np.geomspace(0.2, 10, 160)
    functions = measure(built, names, grid, inverted=("upper.pitch",))
    calls, differentiate = [], Plant.changes

    def counted(plant, names):
        calls.append(len(names))
        return differentiate(plant, names)

    monkeypatch.setattr(Plant, "changes", counted)
    free = [item for item in default_parameters(DOUBLE, "beam") if item.name.endswith((".d", ".l"))]
    found = fit.solve([DOUBLE], Measured(parameter=free), (), functions, level="beam")
    assert not found.misfit and found.chi_squared < 1.1 * 960
    assert found.responses.resonance[:, 4].max() > 1e4
    (wrong,) = found.responses.corrections
    assert wrong.kind == "sign" and {wrong.channel[0], *wrong.also.split()} >= {"upper.pitch"}
    best = found.responses.changes[0]
    assert best.name == "stage.upper.wires.d" and best.change == pytest.approx(1.5e-3, rel=0.02)
    n = found.name.index(best.name)
    assert abs(found.value[n] - 0.0035) < 4 * found.sigma[n]
    assert len(calls) < 200  # 143 on one machine


def test_a_fault_of_one_height_is_found_among_all_numbers(monkeypatch):
    """Simulated data of a triple in tests/data/high-q (described there), all of its 25 uncertain
    numbers free: the truth, after few derivatives of the 25 numbers."""
    calls, differentiate = [], Plant.changes

    def counted(plant, names):
        calls.append(len(names))
        return differentiate(plant, names)

    monkeypatch.setattr(Plant, "changes", counted)
    folder = ROOT / "tests" / "data" / "high-q"
    file = folder / "measured.toml"
    given = measured_file.read(file)
    text = (folder / "design.toml").read_text()
    functions = read_measured.read_all(given, file)
    found = fit.solve([text], given, (), functions, level="beam", explain=False)
    assert not found.misfit and found.chi_squared < 1.1 * found.freedom
    n = found.name.index("stage.m2.wires.d")
    assert abs(found.value[n] - 0.0025) < 3 * found.sigma[n] < 1e-4
    (wrong,) = found.responses.corrections
    assert wrong.kind == "sign" and wrong.channel == ("osem-pitch",)
    # 8 on one machine; hundreds if every step needs them
    assert calls.count(len(found.name)) < 40, calls.count(len(found.name))


def test_a_search_goes_on_from_its_own_better_suggestion():
    """At the end of a search in a wrong minimum, with wrong gains and losses, the change of one
    number is fitted with gains and losses of its own, and the fit goes on from there."""
    built = sus.parse(DOUBLE).replace({"stage.upper.wires.d": 0.0035})
    functions = measure(built, ("x", "pitch"), np.geomspace(0.2, 10, 100))
    sensors = [
        Transducer(name=f"upper.{dof}", signal=f"upper.{dof}", gain_uncertainty=0.05)
        for dof in PLANE
    ]
    free = [item for item in default_parameters(DOUBLE, "beam") if item.name.endswith((".d", ".l"))]
    given = Measured(parameter=free, sensor=sensors)
    problem = fit.with_functions(start.build([DOUBLE], given, [""], "beam"), given, functions)
    begin = Solution(problem, problem.unknowns.start)
    z = problem.unknowns.start.copy()
    z[problem.parts[0]] += 0.002 * np.where(np.arange(problem.count) % 2, 1, -1)
    z[problem.parts[1]] = -0.2
    z[problem.parts[2]] = np.log(0.05)
    stuck = Solution(problem, z, problem.chi_squared(z))
    assert stuck.misfit
    found = chi_squared_search.Search.of(begin, stuck).go_on()
    assert not found.misfit
    assert found.z[[item.name for item in free].index("stage.upper.wires.d")] == pytest.approx(
        0.0035, abs=1e-4
    )


def test_changes_of_two_numbers_are_found_together():
    """Two heights wrong by as much, neither of which explains anything alone."""
    true = {"stage.upper.wires.d": 0.0038, "stage.test.wires.d": 0.0028}
    built = sus.parse(DOUBLE).replace(true)
    functions = measure(built, ("x", "pitch"), np.geomspace(0.2, 10, 60))
    free = [item for item in default_parameters(DOUBLE, "beam") if item.name.endswith((".d", ".l"))]
    given = Measured(parameter=free)
    problem = fit.with_functions(start.build([DOUBLE], given, [""], "beam"), given, functions)
    begin = Solution(problem, problem.unknowns.start)
    few = changes.Changes.of(problem)
    singles = [*few.of_one(begin)]
    assert all(end.misfit for end in singles)
    pair = next(end for end in few.of_two(begin, singles) if not end.misfit)
    assert {*pair.problem.experiment[0].free} == {*true}
    for name, value in zip(pair.problem.experiment[0].free, pair.z, strict=False):
        assert value == pytest.approx(true[name], abs=5e-5)


def test_a_spring_that_the_model_lacks_is_not_absorbed_in_silence():
    """A torsion spring on the upper mass looks like a height of its wires' ends, m g d: only the
    prior of that height contradicts it."""
    damped = DOUBLE.replace("[stage.wires]", "[stage.damping]\npitch = 0.02\n\n[stage.wires]", 1)
    upper, test = damped.split('[[stage]]\nname = "test"')
    spring = "[[stage.spring]]\nstiffness = [0.0, 0.0, 0.0, 0.0, 0.03, 0.0]\n\n"
    built = sus.parse(f'{upper}{spring}[[stage]]\nname = "test"{test}')
    functions = measure(built, ("pitch",), np.geomspace(0.3, 10.0, 120), noise=0.05)
    name, given = "stage.upper.wires.d", 2e-3
    free = [Free(name=name, prior=given, uncertainty=1e-4)]
    found = fit.solve([damped], Measured(parameter=free), (), functions, level="beam")
    weight = 9.81 * (3.0 + 2.7)
    assert found.value[0] - given == pytest.approx(0.03 / weight, rel=0.15)
    assert found.chi_squared - found.prior_chi_squared < 1.25 * found.freedom
    assert found.misfit and found.unlikely_priors
    [(far, pull)] = found.far
    assert far == name and pull == pytest.approx((found.value[0] - given) / 1e-4)
    lines = "\n".join(findings.first_lines(found))
    assert "MISFIT: chi^2 of the prior alone" in lines and "upper.d (+" in lines
    assert findings.document(found, [None])["far_from_priors"][0]["name"] == name


def test_a_missing_cable_is_suggested(monkeypatch):
    """5 N/m between the masses, which heights and lengths absorb only in part: named with its
    bodies, its stiffness within a few per cent, and the chi^2 of a model that has it. Other ways to
    explain the misfit, which take most of the time, are left out."""
    monkeypatch.setattr(chi_squared_search.Search, "go_on", lambda this: this.found)
    cable = (
        '\n[[link]]\nname = "cable"\nbetween = ["upper", "test"]\n'
        "stiffness = [5.0, 5.0, 5.0, 0.0, 0.0, 0.0]\n"
    )
    values = {item.name: item.value for item in parameters.every(DOUBLE)}
    free = [
        Free(name=name, prior=values[name], uncertainty=sigma)
        for name, sigma in trials.DOUBLE.items()
    ]
    made = trials.simulate(
        DOUBLE + cable, {}, free, np.random.default_rng(1),
        stage="upper", dofs=("x", "y"), frequency=np.geomspace(0.2, 20, 60),
    )  # fmt: skip
    found = fit.solve([DOUBLE], made.measured, (), made.functions, explain=False)
    assert found.unlikely
    best = found.responses.links[0]
    assert best.between == ("upper", "test")
    assert best.stiffness[0] == pytest.approx(5.0, rel=0.1)
    assert best.chi_squared < 1.2 * found.freedom < 0.8 * found.chi_squared
    lines = findings.first_lines(found)
    assert any("a link or cable may be missing" in line and best.text in line for line in lines)
    (told, *_) = findings.document(found, [None])["missing_links"]
    assert list(told["between"]) == ["upper", "test"]


def test_a_loss_angle_is_found_where_wires_bend():
    """It acts only through frequency-dependent terms, and is known from data off the peaks."""
    name, true = "materials.c70steel.loss_angle", 0.1

    def text(value):
        raw = tomllib.loads(DOUBLE)
        reader.apply_overrides(raw, paths.symmetric_settings({name: value}))
        return reader.write_toml(raw)

    plant = Plant.of(reader.parse(text(true)), "beam")
    known = signals.bodies_with_signals(plant.system)
    drive, sensor = signals.parse_input("test.force_x", known), "test.x"
    grid = np.geomspace(0.3, 30, 100)
    value = plant.respond(grid, [drive], [signals.parse_output(sensor, known)]).value[:, 0, 0]
    size = 1e-3 * np.abs(value)
    one = MeasuredResponse("a", drive.text, sensor, grid, value, size, np.full(100, np.nan))
    free = Measured(parameter=[Free(name=name)])
    found = fit.solve([text(0.03)], free, (), [one], level="beam", explain=False)
    assert abs(found.value[0] - true) < 2 * found.sigma[0] < 0.2 * true


def test_factors_are_named():
    assert "root of 10" in name_factor(3.15)
    assert "2 pi" in name_factor(1 / 6.3)
    assert name_factor(1.7) == "1.7"


@pytest.fixture
def files(tmp_path):
    """A file of measurements with one CSV per function."""
    made = trials.double(0, dofs=PLANE, frequency=np.geomspace(0.2, 30, 30))[0]
    lines = []
    for n, one in enumerate(made.functions):
        rows = np.column_stack([one.frequency, one.value.real, one.value.imag, one.uncertainty])
        np.savetxt(
            tmp_path / f"{n}.csv",
            rows,
            delimiter=",",
            header="frequency,real,imag,sigma",
            comments="",
        )
        lines.append(
            f'[[transfer_function]]\nname = "{one.name}"\nfile = "{n}.csv"\n'
            f'input = "{one.input}"\noutput = "{one.output}"\nfrequency = "frequency"\n'
            'real = "real"\nimaginary = "imag"\nuncertainty = "sigma"\n'
        )
    for table, items in (("sensor", made.measured.sensor), ("actuator", made.measured.actuator)):
        lines += [
            f'[[{table}]]\nname = "{one.name}"\nsignal = "{one.signal}"\ngain_uncertainty = 0.05\n'
            for one in items
        ]
    lines += [
        f'[[parameter]]\nname = "{name}"\nprior = {item.prior}\nuncertainty = {item.uncertainty}\n'
        for name, item in ((one.name, one) for one in made.measured.parameter[:3])
    ]
    path = tmp_path / "measured.toml"
    path.write_text("\n".join(lines))
    return path


def test_command(files, tmp_path):
    """JSON, files and text of the command; results read back print and draw the same."""
    design, out = CONFIGS / "double.toml", tmp_path / "out"
    result = run("fit", design, files, "--fidelity", "string", "--json", "--plot", "--out", out)
    document = strict_json(result.stdout)
    assert {one["name"] for one in document["channels"]} == {
        "sensor.s-x.gain",
        "sensor.s-pitch.gain",
        "actuator.a-x.gain",
        "actuator.a-pitch.gain",
    }
    assert len(document["transfer_functions"]) == 4 and document["resonances"]
    assert document["single_changes"] and document["measure_next"] and document["determined"]
    loaded = sus.load(out / "double-fit.h5")
    assert loaded.responses is not None
    assert findings.document(loaded, [None])["single_changes"] == document["single_changes"]
    figures = picture.draw(loaded, "Made up"), picture.draw_responses(loaded.responses, "Made up")
    for figure in figures:
        assert figure.get_figwidth() == COLUMN
        assert_legible(figure)
    assert "fitted to 4 transfer functions" in " ".join(said(figures[0]))
    table, axes = loaded.responses.resonance, figures[0].axes[0]
    after = next(line.get_xdata() for line in axes.lines if line.get_label() == "after")
    np.testing.assert_allclose(after, (table[:, 3] - table[:, 0]) / table[:, 1])
    assert sorted(path.name for path in out.iterdir()) == [
        "double-fit-responses.png",
        "double-fit.h5",
        "double-fit.png",
        "double-fitted.toml",
    ]


def test_data_without_uncertainties(files, tmp_path):
    design, whole = CONFIGS / "double.toml", files.read_text()
    files.write_text(whole.replace('uncertainty = "sigma"\n', ""))
    for data in tmp_path.glob("*.csv"):
        data.write_text(data.read_text().replace("sigma", "unknown"))
    words = ("--fidelity", "string", "--out", tmp_path / "out")
    (line, *_) = assert_refused(run("fit", design, files, *words), files)
    assert "gives no uncertainty" in line and "--relative-uncertainty" in line
    options = ("--relative-uncertainty", "0.03", "--no-explain", "--json")
    found = strict_json(run("fit", design, files, *options, *words).stdout)
    assert found["measure_next"] == []
    finer = ("--relative-uncertainty", "0.01", "--no-explain", "--json")
    other = strict_json(run("fit", design, files, *finer, *words).stdout)
    assert other["chi_squared"] > 3 * found["chi_squared"]
    bare = tmp_path / "bare.toml"
    bare.write_text('[[mode]]\nlabel = "test pitch"\nfrequency = 0.8\nuncertainty = 0.01\n')
    (line,) = assert_refused(run("fit", design, bare, *words), bare)
    assert line.startswith("parameter: missing; name the numbers to fit")


def test_a_search_starts_again_from_the_best_single_change():
    """One function of high Q, d wrong by 4 mm, six numbers that are hardly known: the first search
    ends at three times the chi^2 of a change of d alone."""
    values = {item.name: item.value for item in parameters.every(DOUBLE)}
    free = [
        Free(name=name, prior=values[name], uncertainty=10 * sigma)
        for name, sigma in trials.DOUBLE.items()
    ]
    name, true = "stage.upper.wires.d", values["stage.upper.wires.d"] + 4e-3
    given = trials.simulate(
        DOUBLE, {name: true}, free, np.random.default_rng(1),
        stage="upper", dofs=("x",), frequency=np.geomspace(0.2, 20, 240), q=1e4,
    )  # fmt: skip
    found = given.fit()
    n = found.name.index(name)
    assert not found.misfit and abs(found.value[n] - true) < 4 * found.sigma[n]
