"""Sensitivities against differences of whole runs; beams against strings where wires hardly bend,
degenerate pairs, fits, and the commands."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from suspension_cli.analyses.fit import solve as fit
from suspension_cli.analyses.optimise.mode_families import solve_modes
from suspension_cli.analyses.sensitivity import solve as sensitivity
from suspension_cli.design import paths, reader
from suspension_cli.design.measured import Experiment, Free, Measured, Mode
from suspension_cli.linear import eigenmodes, named_results, response, signals
from suspension_cli.models import registry
from suspension_cli.studies import variants
from tests.equilibrium.test_blade_load import UNEQUAL, built
from tests.equilibrium.test_clamps import tables_as_built
from tests.support.commandline import assert_refused, run, strict_json, written
from tests.support.golden import CONFIGS
from tests.support.scenes import plain

DOUBLE = CONFIGS / "double.toml"
NUMBERS = ("stage.test.wires.d", "materials.c70steel.youngs_modulus")


def beam(text, *overrides):
    """Linear model and modes of a design read anew."""
    model = registry.BEAM.system(reader.parse_with_overrides(text, overrides))
    return model, eigenmodes.solve(replace(model, terms=()))


@cache
def solved(text, *results, level="beam"):
    model = registry.by_name(level).system(reader.parse(text))
    requested = named_results.parse(
        list(results) or ["modes"], solve_modes(model), signals.bodies_with_signals(model)
    )
    return sensitivity.solve(text, requested, level), requested


def whole_run(text, level, requested, numbers):
    """All modes, then the sizes of responses, of a design with numbers put in."""
    overrides = paths.symmetric_settings(numbers)
    model = registry.by_name(level).system(reader.parse_with_overrides(text, overrides))
    known, sizes = signals.bodies_with_signals(model), []
    for item in (item for item in requested if isinstance(item, named_results.Ratio)):
        outputs = [
            signals.parse_output(s.text, known) for s in (item.over, item.under) if s is not None
        ]
        y = response.solve(model, np.array([item.frequency]), [item.input], outputs).value[0, :, 0]
        sizes.append(abs(y[0] if len(y) == 1 else y[0] / y[1]))
    return np.array([*solve_modes(model).frequency, *sizes])


def sectioned():
    """Thick ends and a taper, in gas."""
    raw = tomllib.loads(DOUBLE.read_text())
    del (wires := raw["stage"][1]["wires"])["radius"]
    wires["sections"] = [
        {"radius": 120e-6, "length": 0.01},
        {"radius": [75e-6, 70e-6], "steps": 2},
        {"radius": 110e-6, "length": 0.012},
    ]
    wires["d"] = wires["d_upper"] = 0.002
    return reader.write_toml(raw | {"gas": {"pressure": 1e-3}})


def heavy():
    """Wires of 1 mm, whose mass and stiffness matter."""
    raw = tomllib.loads((CONFIGS / "husman2000" / "table1-case2.toml").read_text())
    raw["stage"][0]["wires"]["radius"] = 1e-3
    return reader.write_toml(raw)


COUPLING = "test.x@0,0,-0.001/test.z@0,0,-0.001/support.z:50"
CASES = {
    "triple-tolerance": (
        ("string", "beam", "violin"),
        ["test.x/support.x:3", "test.pitch/test.x@0,0,0.001/support.x:9"],
    ),
    "quadruple": (("string", "beam"), ["test.x@0,0,0.001/support.x:10"]),
    "tower": (("string", "beam"), ["mirror.x/support.x:1"]),
    "imperfect": (("string", "beam"), [COUPLING, "test.z/test.force_z@0.01,0,0:5"]),
    "payload-recoil-mass": (("string",), ["mirror.pitch/support.x:3"]),
    "five-wires": (("string", "beam"), []),
    "triple-damped": (("beam",), ["test.x/support.x:0.6"]),
    "sections": (("beam",), ["test.x/support.x:10", "test.pitch/test.x/support.x:20"]),
    "heavy": (("violin",), ["test.x/support.x:150"]),
    "hanging": (("string",), ["test.x@0,0,0.01/support.x:2"]),
    "bending points": (("beam",), ["test.x/support.x:2"]),
    "tilted": (("string",), ["test.x/support.x:2"]),
}
MADE = {
    "sections": sectioned,
    "heavy": heavy,
    "hanging": lambda: reader.write_toml(plain(built((0.01, 0.0, 0.0), UNEQUAL))),
    "bending points": lambda: reader.write_toml(plain(tables_as_built("lopsided", (0.01, 0, 0)))),
    "tilted": lambda: reader.write_toml(
        tomllib.loads((CONFIGS / "triple-damped.toml").read_text()) | {"constants": TILTED}
    ),
}
TILTED = {"gravity": [0.3, -0.2, -9.7], "gravity_gradient": 2e-4, "wire_weight": True}


@pytest.mark.parametrize(
    ("case", "level"), [(case, level) for case, (levels, _) in CASES.items() for level in levels]
)
def test_against_richardson_extrapolation_of_whole_runs(case, level):
    """Equilibria that move, blades, clamps, sections, losses, dampers, points of bodies that turn:
    five-point differences of runs of the program, each design read anew.

    All numbers are changed at once, by random shares of each: a derivative that is wrong in any of
    them shows. Errors are relative to the largest derivative of each result.
    """
    text = MADE[case]() if case in MADE else (CONFIGS / f"{case}.toml").read_text()
    found, requested = solved(text, "modes", *CASES[case][1], level=level)
    chosen, rng = np.flatnonzero(found.free & (found.value != 0)), np.random.default_rng(3)
    shares = rng.uniform(0.5, 1, len(chosen)) * rng.choice([-1, 1], len(chosen))
    change = found.value[chosen] * shares

    def run_at(share):
        values = (found.value[chosen] + share * change).tolist()
        names = [found.parameter[n] for n in chosen]
        return whole_run(text, level, requested, dict(zip(names, values, strict=True)))

    step = 1e-4 if level == "violin" else 1e-5
    sides = [run_at(n * step) - run_at(-n * step) for n in (1, 2)]
    expected = (8 * sides[0] - sides[1]) / (12 * step)
    each = change[:, None] * found.derivative[chosen]
    # derivatives of degenerate modes by several numbers add up in the mean alone
    same = np.abs(found.nominal[:, None] / found.nominal - 1) < 1e-6
    error = same @ (each.sum(0) - expected) / same.sum(1) / np.abs(each).max(0)
    assert np.abs(error).max() < 1e-6


def test_numbers_that_only_wires_that_bend_know():
    """A wire of given k pulls as a string whatever its radius; on beam EI goes with r^4 and GJ with
    E/(1 + nu), so E and r count by E r^4. Only the tension's part of torsion, T r^2/2 in yaw, goes
    with r^2."""
    raw = tomllib.loads(DOUBLE.read_text())
    raw["stage"][1]["wires"] |= {"k": 13000.0}
    raw["stage"][0]["wires"] |= {"k": 50000.0}
    text = reader.write_toml(raw)
    string, bent = (solved(text, "modes", level=level)[0] for level in ("string", "beam"))
    radii, modulus = (
        [f"stage.{name}.wires.radius" for name in ("upper", "test")],
        "materials.c70steel.youngs_modulus",
    )
    assert not {*radii, modulus} & set(string.parameter)
    share = dict(zip(bent.parameter, bent.one_percent, strict=True))
    assert share[modulus][bent.result.index("test pitch")] > 0.05
    yaw = bent.result.index("upper yaw")
    tensioned = sum(share[name] for name in radii) - 4 * share[modulus]
    turning = np.array(["yaw" in name for name in bent.result])
    np.testing.assert_allclose(
        tensioned[~turning], 0.0, atol=1e-6 * np.abs(4 * share[modulus]).max()
    )
    assert (tensioned[turning] > 1e-7).all()
    twist = share["materials.c70steel.poisson_ratio"]
    assert twist[yaw] < -1e-4 and abs(twist[bent.result.index("test longitudinal")]) < 1e-6


def test_units_of_time_mass_and_length():
    """f is 1/s: scaled units of time, mass and length scale g, E, masses and lengths, and nothing
    else."""
    found, _ = solved((CONFIGS / "husman2000" / "figure6.toml").read_text())
    share = dict(zip(found.parameter, found.one_percent, strict=True))
    g, modulus, mass = (
        share["constants.gravity"],
        share["materials.fused-silica.youngs_modulus"],
        share["stage.test.body.mass"],
    )
    lengths = sum(
        share[name]
        for name in share
        if name.rsplit(".", 1)[1] in ("l", "s", "t1", "t2", "d", "radius", "length")
    )
    np.testing.assert_allclose(g + modulus, 0.5, atol=1e-7)
    np.testing.assert_allclose(mass + modulus, 0.0, atol=1e-7)
    np.testing.assert_allclose(lengths + g - modulus, 0.0, atol=1e-7)


def hair_thin(file, thinner):
    """A design whose wires keep their spring constants but are thinner: they bend less."""
    raw = tomllib.loads(file.read_text())
    for stage in raw["stage"]:
        wires = stage["wires"]
        modulus = {"c70steel": 2.12e11, "steel302": 1.7e11}[wires["material"]]
        wires["k"] = modulus * np.pi * wires["radius"] ** 2 / wires["l"]
        wires["radius"] /= thinner
    return reader.write_toml(raw)


def apart(text, *results):
    """Largest difference of the derivatives on beam and string, of the change in proportion."""
    string, bent = (solved(text, *results, level=level)[0] for level in ("string", "beam"))
    rows = [bent.parameter.index(name) for name in string.parameter]
    value, nominal = np.abs(string.value)[:, None], np.abs(string.nominal)
    return np.nanmax(
        np.abs(bent.derivative[rows] - string.derivative) * np.maximum(value, 1e-3) / nominal
    )


def test_strings_in_the_limit_of_hair_thin_wires():
    """What bending adds goes with sqrt(E I/T), the square of the radius: three times thinner, nine
    times closer."""
    results = ["modes", "test.x/support.x:10", "test.pitch/test.x/support.x:3"]
    file = CONFIGS / "husman2000" / "table1-case4.toml"
    thin, thinner = (apart(hair_thin(file, by), *results) for by in (100, 300))
    assert 1e-6 < thin < 1e-3
    assert thinner == pytest.approx(thin / 9, rel=0.02)


def test_a_degenerate_pair():
    """Longitudinal and transverse of a mass on four plumb wires: each branch has the derivative
    that it has on strings."""
    file = CONFIGS / "husman2000" / "table1-case1.toml"
    text = hair_thin(file, 1e4)
    pair = ["test longitudinal", "test transverse"]
    found, _ = solved(text, *pair)
    assert found.nominal[0] == pytest.approx(found.nominal[1], rel=1e-9)
    assert apart(text, *pair) < 3e-7
    spring = [[0.0] * 6 for _ in range(6)]
    spring[5][5] = 0.1
    raw = tomllib.loads(text)
    raw["stage"][0]["spring"] = [{"stiffness": spring}]
    mixed = {}
    # a spring that couples x and y turns the pair into diagonals, whose frequencies part
    for level in ("string", "beam"):
        found, _ = solved(reader.write_toml(raw), *pair, level=level)
        mixed[level] = found.derivative[found.parameter.index("stage.test.spring.1.stiffness.1.2")]
    assert mixed["string"].min() < 0 < mixed["string"].max()
    np.testing.assert_allclose(np.sort(mixed["beam"]), np.sort(mixed["string"]), rtol=1e-6)


def test_on_a_resonance_and_a_coupling_that_is_zero():
    """Half a line's width from the top of a peak, where steps of all but the smallest size would
    lead over it: against such small steps. A coupling that is zero cannot grow by what keeps the
    symmetry."""
    text, name = DOUBLE.read_text(), "stage.test.wires.l"
    model, _ = beam(text)
    states = eigenmodes.solve(model)
    quality, peak = float(states.q[1]), float(states.frequency[1])
    assert quality > 1e3
    found, requested = solved(
        text, "test.z/test.x/support.x:5", f"test.x/support.x:{peak * (1 + 0.5 / quality)!r}"
    )
    assert found.nominal[0] == 0 and not found.derivative[:, 0].any()
    value, step = 0.28, 0.28 * 0.02 / quality
    low, high = (
        whole_run(text, "beam", requested, {name: value + sign * step})[-1] for sign in (-1, 1)
    )
    slope = found.derivative[found.parameter.index(name), 1]
    assert abs(slope) * value > 0.05 * quality * found.nominal[1]
    assert slope == pytest.approx((high - low) / (2 * step), rel=1e-3)


def test_numbers_that_cannot_change_alone_are_the_same_as_on_strings():
    text = (CONFIGS / "five-wires.toml").read_text()
    string, bent = solved(text, "modes", level="string")[0], solved(text, "modes")[0]
    fixed = [
        {name for name, free in zip(found.parameter, found.free, strict=True) if not free}
        for found in (string, bent)
    ]
    assert fixed[0] == fixed[1] and "stage.bench.position.1" in fixed[1]
    assert np.isnan(bent.derivative[~bent.free]).all()


def seen(text, *overrides, share=0.001):
    """All modes of a design on beam with numbers put in, as if measured, under the labels of the
    design as drawn."""
    names = named_results.labels(beam(text)[1])
    return [
        Mode(frequency=float(f), uncertainty=share * float(f), label=name)
        for f, name in zip(beam(text, *overrides)[1].frequency, names, strict=True)
    ]


TRUTH = (0.0013, 1.95e11)


def put(values):
    return [f"{name}={value!r}" for name, value in zip(NUMBERS, values, strict=True)]


def test_a_fit_on_beam_finds_what_strings_cannot():
    text = DOUBLE.read_text()
    requested = Measured(
        mode=seen(text, *put(TRUTH)), parameter=[Free(name=name) for name in NUMBERS]
    )
    found = fit.solve([text], requested, level="beam")
    np.testing.assert_allclose(found.value, TRUTH, rtol=1e-6)
    assert found.chi_squared < 1e-9
    mistaken = fit.solve([text], requested)
    assert np.abs(mistaken.value / TRUTH - 1).max() > 0.03 and mistaken.chi_squared > 100


def test_experiments_on_beam_share_numbers():
    """Two states of one design, modes of one without labels."""
    text = DOUBLE.read_text()
    longer = text.replace("l = 0.28\n", "l = 0.31\n")
    assert longer != text
    plain = [
        Mode(frequency=mode.frequency, uncertainty=mode.uncertainty)
        for mode in seen(longer, *put(TRUTH))
    ]
    both = [
        Experiment(design="x", name="short", mode=seen(text, *put(TRUTH))),
        Experiment(design="x", name="long", mode=plain),
    ]
    found = fit.solve(
        [text, longer],
        Measured(experiment=both, parameter=[Free(name=name) for name in NUMBERS]),
        level="beam",
    )
    np.testing.assert_allclose(found.value, TRUTH, rtol=1e-6)


def test_the_commands(tmp_path):
    answer = strict_json(
        run("sensitivity", DOUBLE, "--fidelity", "beam", "--json", "--out", tmp_path).stdout
    )
    assert answer["fidelity"] == "beam" and answer["estimated_error"] < 1e-3
    assert "materials.c70steel.poisson_ratio" in [item["name"] for item in answer["parameters"]]
    reported = run(
        "sensitivity",
        CONFIGS / "husman2000" / "table1-case4.toml",
        "--fidelity",
        "beam",
        "--no-plot",
        "--out",
        tmp_path,
    )
    assert (
        reported.stdout.startswith("model: beam (as requested); neglected: wire mass")
        and "warning" not in reported.stderr
    )
    reported = run("sensitivity", DOUBLE, "--fidelity", "string", "--no-plot", "--out", tmp_path)
    assert (
        "the string model neglects wire bending, which changes test pitch by 25 %; rerun with"
        " --fidelity beam" in reported.stderr
    )


def test_a_fit_by_the_command(tmp_path):
    """From modes of the beam model in files; stability is not judged by the string model."""
    rows = [
        {"label": mode.label, "frequency": mode.frequency, "uncertainty": mode.uncertainty}
        for mode in seen(DOUBLE.read_text(), *put(TRUTH))
    ]
    file = written(
        tmp_path, {"mode": rows, "parameter": [{"name": name} for name in NUMBERS]}, "measured.toml"
    )
    result = run("fit", DOUBLE, file, "--fidelity", "beam", "--json", "--out", tmp_path)
    answer = strict_json(result.stdout)
    assert answer["fidelity"] == "beam" and "warning" not in result.stderr
    assert [item["value"] for item in answer["parameters"]] == pytest.approx(TRUTH, rel=1e-6)
    rows[0]["label"] = "test nonsense"
    wrong = written(tmp_path, {"mode": rows, "parameter": [{"name": NUMBERS[0]}]}, "wrong.toml")
    lines = assert_refused(
        run("fit", DOUBLE, wrong, "--fidelity", "beam", "--out", tmp_path / "none"),
        wrong,
        tmp_path / "none",
    )
    assert any("is the label of no mode" in line for line in lines)
    reported = run("fit", DOUBLE, file, "--fidelity", "string", "--no-plot", "--out", tmp_path)
    assert "rerun with --fidelity beam" in reported.stderr


@pytest.mark.parametrize(
    ("command", "level"),
    [("sensitivity", "closed-form"), ("sensitivity", "force"), ("fit", "force"), ("fit", "violin")],
)
def test_models_without_derivatives_are_refused(command, level, tmp_path):
    file = CONFIGS / "husman2000" / "table1-case4.toml"
    measured = (
        [CONFIGS.parent / "measured" / "husman2000" / "table1-case4.toml"]
        if command == "fit"
        else []
    )
    lines = assert_refused(
        run(command, file, *measured, "--fidelity", level, "--out", tmp_path / "out"),
        file,
        tmp_path / "out",
    )
    able = "string, beam or violin" if command == "sensitivity" else "string or beam"
    assert lines == [f'--fidelity = "{level}": cannot compute derivatives; take auto, {able}']


def test_wires_without_material_are_refused(tmp_path):
    raw = tomllib.loads(DOUBLE.read_text())
    del raw["stage"][0]["wires"]["radius"]
    raw["stage"][0]["wires"]["k"] = 50000.0
    file = written(tmp_path, raw)
    lines = assert_refused(
        run("sensitivity", file, "--fidelity", "beam", "--out", tmp_path / "out"),
        file,
        tmp_path / "out",
    )
    assert any("has no cross-section" in line for line in lines)


@pytest.mark.parametrize("level", ["force", "string", "beam"])
def test_designs_with_dampers_are_one_batch_whatever_their_heights(level):
    """Each has the damping matrix of its own geometry."""
    upper, test = DOUBLE.read_text().split("[stage.wires]")[0], DOUBLE.read_text()
    text = test.replace(upper, f"{upper}[stage.damping]\nx = 3.0\npitch = 0.02\n\n", 1)
    head, tail = text.rsplit("[stage.wires]", 1)
    text = f'{head}[stage.damping]\ny = 2.0\nagainst = "upper"\n\n[stage.wires]{tail}'
    name, values = "stage.test.wires.d", np.array([1e-3, 1.5e-3, 4e-3])
    [(found, here)] = variants.balanced(text, {name: values}, level)
    for n, place in enumerate(here):
        design = variants.overridden(text, {name: values[place]})
        expected = registry.by_name(level).system(design).damping
        np.testing.assert_array_equal(found.model.damping[n], expected)
