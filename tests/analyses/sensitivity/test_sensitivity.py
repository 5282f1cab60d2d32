"""Derivatives against differences of the paper's equations; degenerate pairs; the command."""

from __future__ import annotations

import tomllib

import mpmath
import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.design import reader
from suspension_cli.models import closed_form, registry
from suspension_cli.studies import parameters
from tests.support.commandline import edited, run, strict_json, written
from tests.support.derivatives import STENCIL
from tests.support.exchanging import SMALL, D
from tests.support.golden import CONFIGS

pytestmark = pytest.mark.filterwarnings("ignore::suspension_cli.errors.PendsusWarning")

CASES = CONFIGS / "husman2000"


def solved(text, *results, level=registry.STRING.name):
    return sus.sensitivity(sus.parse(text), results=results, fidelity=level, allow_unstable=True)


def column(found, result):
    """Derivatives of one result by parameter."""
    return dict(zip(found.parameter, found.derivative[:, found.result.index(result)], strict=True))


def papers_frequencies(at):
    """Frequencies by label from the paper's equations, for numbers (arrays of them) by path."""

    def own(*keys):
        return (at[f"stage.test.{key}"] for key in keys)

    length, radius = own("wires.l", "wires.radius")
    wires = closed_form.FourWires(
        *own("body.mass"),
        tuple(own("body.inertia.1", "body.inertia.2", "body.inertia.3")),
        length,
        *own("wires.s", "wires.t1", "wires.t2", "wires.d"),
        at["materials.steel302.youngs_modulus"] * np.pi * radius**2 / length,
        at["constants.gravity"],
    )
    squares = {"vertical": closed_form.vertical(wires), "yaw": closed_form.rotation(wires)}
    for names, matrix in (
        (("longitudinal", "pitch"), closed_form.longitudinal_tilt(wires)),
        (("transverse", "roll"), closed_form.sideways_roll(wires)),
    ):
        squares |= zip(names, np.sort(np.linalg.eigvals(-matrix).real).T, strict=True)
    return {f"test {name}": np.sqrt(square) / (2 * np.pi) for name, square in squares.items()}


@pytest.mark.parametrize("case", [1, 2, 3, 4])
def test_modes_against_differences_of_the_papers_equations(case):
    """Case 1 has a degenerate pair: longitudinal and transverse."""
    text = (CASES / f"table1-case{case}.toml").read_text()
    found, numbers = solved(text), {item.name: item.value for item in parameters.every(text)}
    assert set(found.parameter) == set(numbers)
    weights = np.array([*STENCIL.values()])
    for name, value in numbers.items():
        size = max(abs(value), 1e-3)
        step = 1e-3 * size * np.array([*STENCIL])
        up, down = (papers_frequencies(numbers | {name: value + sign * step}) for sign in (1, -1))
        own = found.derivative[found.parameter.index(name)]
        for result, nominal, slope in zip(found.result, found.nominal, own, strict=True):
            expected = (weights * (up[result] - down[result])).sum() / (1e-3 * size)
            assert abs(slope - expected) < 1e-7 * max(abs(expected), nominal / size), (result, name)


SPRUNG = """
[design]
name = "pair"
[[stage]]
name = "test"
body = { mass = 20.0, inertia = [0.147, 0.117, 0.110] }
[stage.wires]
count = 4
l = 0.27
s = 0.04
t1 = 0.133
t2 = 0.133
material = "steel302"
radius = 142.5e-6
[[stage.spring]]
stiffness = [[0,0,0,0,0,0], [0,0,0,0,0,0], [0,0,0,0,0,0], [0,0,0,0,0,0], [0,0,0,0,0,0], [0,0,0,0,0,0.1]]
"""


def test_a_degenerate_pair_that_mixes():
    """A spring that couples x and y of a pendulum with equal frequencies splits them into
    diagonals: omega^2 = g/l +- k/m."""
    found = solved(SPRUNG, "test longitudinal", "test transverse")
    assert found.nominal[0] == pytest.approx(found.nominal[1], rel=1e-12)
    mixed = found.derivative[found.parameter.index("stage.test.spring.1.stiffness.1.2")]
    with mpmath.workdps(50):
        step, g, l, m = (
            mpmath.mpf(10) ** -20,
            mpmath.mpf("9.81"),
            mpmath.mpf("0.27"),
            mpmath.mpf(20),
        )
        split = [
            mpmath.sqrt(square) / (2 * mpmath.pi)
            for square in mpmath.eigsy(
                mpmath.matrix([[g / l, step / m], [step / m, g / l]]), eigvals_only=True
            )
        ]
        expected = [float((f - mpmath.sqrt(g / l) / (2 * mpmath.pi)) / step) for f in split]
    np.testing.assert_allclose(sorted(mixed), expected, rtol=1e-8)
    one = (
        column(found, "test longitudinal")["stage.test.spring.1.stiffness.1.1"],
        column(found, "test transverse")["stage.test.spring.1.stiffness.1.1"],
    )
    np.testing.assert_allclose(sorted(one), [0.0, expected[1]], rtol=1e-8, atol=1e-12)


def test_a_shared_motion_is_said(tmp_path):
    """Effects on a label are those on one of the two modes that share its motion."""
    file = written(tmp_path, SMALL.replace("d = 2e-3", "d = 8.6e-4"))
    words = ["--result", "test pitch", "--fidelity", "string", "--out", tmp_path, "--no-plot"]
    shared = run("sensitivity", file, *words)
    assert shared.exit_code == 0
    assert "warning: two modes share test pitch: " in shared.stderr
    alone = run("sensitivity", file, "--set", f"{D}=2e-3", *words)
    assert "two modes" not in alone.stderr


def test_a_coupling_that_is_zero_grows_with_what_breaks_the_symmetry():
    raw = edited(
        tomllib.loads((CASES / "figure6.toml").read_text()),
        {("perturbation",): [{"wire": "test.1", "k_factor": 1.0, "upper_offset": [0.0, 0.0, 0.0]}]},
    )
    text, name = reader.write_toml(raw), "test.x@0,0,-0.001/test.z@0,0,-0.001/support.z:50"
    found = solved(text, name)
    slope = column(found, name)
    assert found.nominal[0] == 0
    assert all(
        slope[p] == 0
        for p in (
            "stage.test.wires.s",
            "stage.test.body.mass",
            "constants.gravity",
            "stage.test.wires.d",
        )
    )
    step = 1e-6
    for path, nominal in (("perturbation.1.k_factor", 1.0), ("perturbation.1.upper_offset.1", 0.0)):
        sizes = [
            solved(
                reader.write_toml(tomllib.loads(text) | _set(text, path, nominal + sign * step)),
                name,
            ).nominal[0]
            / step
            for sign in (1, -1)
        ]
        assert slope[path] == pytest.approx(np.mean(sizes), rel=1e-4, abs=1e-7)
    # a softer wire tilts the mass that moves up and down; moving its end does so to second order
    # only (all wires lean, and their pulls add up to 0)
    assert (
        slope["perturbation.1.k_factor"] > 1e-4 and slope["perturbation.1.upper_offset.1"] < 1e-10
    )
    assert found.one_percent[found.parameter.index("perturbation.1.k_factor"), 0] == pytest.approx(
        slope["perturbation.1.k_factor"] / 100, rel=1e-12
    )


def _set(text, path, value):
    raw = tomllib.loads(text)
    reader.apply_overrides(raw, (f"{path}={value!r}",))
    return raw


def test_the_model_has_wire_mass_where_results_need_it(tmp_path):
    """Wires of 3 mm under a light body change modes by more than the tolerance by their mass."""
    text = (CASES / "table1-case1.toml").read_text()
    for radius, level in ((142.5e-6, "beam"), (3e-3, "violin")):
        raw = edited(tomllib.loads(text), {("stage", 0, "wires", "radius"): radius})
        file = written(tmp_path, raw)
        words = ("--result", "test longitudinal", "--json", "--out", tmp_path)
        assert strict_json(run("sensitivity", file, *words).stdout)["fidelity"] == level


def test_rigid_and_unstable_modes_have_no_derivative(tmp_path):
    text = (CASES / "table1-case2.toml").read_text()
    file = written(tmp_path, _set(text, "stage.test.wires.d", -0.6))
    lines = run("sensitivity", file, "--out", tmp_path / "out").stderr
    assert "the equilibrium is unstable" in lines
    result = run("sensitivity", file, "--allow-unstable", "--json", "--out", tmp_path)
    answer = strict_json(result.stdout)
    growing = [item["nominal"] is None for item in answer["results"]]
    assert 0 < sum(growing) < 6
    assert all([value is None for value in row] == growing for row in answer["derivative"])


def test_steps_and_per_cents(tmp_path):
    """Of a length per mm, of others per 1 %."""
    file, words = CASES / "table2.toml", ("--json", "--fidelity", "string", "--out", tmp_path)
    answer = strict_json(run("sensitivity", file, *words).stdout)
    named = {item["name"]: (n, item) for n, item in enumerate(answer["parameters"])}
    place, item = named["stage.test.wires.d"]
    assert (item["step"], item["step_unit"]) == (1e-3, "mm")
    # of the pitch mode, in % per mm
    pitch = next(n for n, one in enumerate(answer["results"]) if one["name"] == "test pitch")
    slope = 100 * 1e-3 * answer["derivative"][place][pitch] / answer["results"][pitch]["nominal"]
    assert answer["per_step"][place][pitch] == pytest.approx(slope, rel=1e-9)
    place, item = named["constants.gravity"]
    assert item["step_unit"] == "%"
    assert answer["per_step"][place] == answer["one_percent"][place]
    assert len(answer["results"]) == 18
    derivative, percent = answer["derivative"][place][0], answer["one_percent"][place][0]
    assert percent == pytest.approx(derivative * 9.81 / answer["results"][0]["nominal"], rel=1e-12)


def test_sections_of_wires():
    """A stretch of wire k_i = E A_i/l_i in series with others: vertical omega^2 of a plumb mass is
    4 k/m, k = E/(sum of l_i/A_i)."""
    raw = tomllib.loads((CASES / "table1-case1.toml").read_text())
    wires = raw["stage"][0]["wires"]
    thin, length = wires.pop("radius"), wires["l"]
    wires["sections"] = [{"radius": thin, "length": 0.1}, {"radius": [1.3 * thin, 1.2 * thin]}]
    share = dict(
        zip(
            (found := solved(reader.write_toml(raw), "test vertical")).parameter,
            found.one_percent[:, 0],
            strict=True,
        )
    )
    first, second = 0.1 / thin**2, (length - 0.1) / (1.3 * 1.2 * thin**2)
    path, whole = "stage.test.wires.sections", first + second
    # twice its share of the compliance, by half
    assert share[f"{path}.1.radius"] == pytest.approx(first / whole, rel=1e-7)
    for end in (1, 2):
        assert share[f"{path}.2.radius.{end}"] == pytest.approx(second / whole / 2, rel=1e-7)
    assert share[f"{path}.1.length"] == pytest.approx(
        -(first - 0.1 / (1.3 * 1.2 * thin**2)) / whole / 2, rel=1e-7
    )


def test_units_of_time_mass_and_length():
    """f is 1/s: scaled units of time, mass and length scale g (m/s^2), E (kg/(m s^2)), masses and
    all lengths, and nothing else."""
    found = solved((CASES / "figure6.toml").read_text())
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


def test_a_ratio_to_what_symmetry_forbids_has_no_derivative(tmp_path):
    """Nor is it a traceback: other results are reported all the same."""
    result = run(
        "sensitivity",
        CONFIGS / "double.toml",
        *["--result", "test.z/test.x/support.z:50", "--result", "1", "--json", "--out"],
        tmp_path,
    )
    reported = strict_json(result.stdout)
    assert reported["results"][0]["nominal"] is None and {
        row[0] for row in reported["derivative"]
    } == {None}
    assert any(row[1] for row in reported["derivative"])


def test_only_some_numbers_are_varied():
    """A path of a table means all numbers below it, and derivatives are those among all."""
    design = sus.example("double")
    asked = {"results": ["test pitch", "test height"], "fidelity": "string"}
    paths = ["stage.test.wires", "stage.upper.body.mass"]
    every = sus.sensitivity(design, **asked)
    some = sus.sensitivity(design, vary=paths, **asked)
    expected = [n for n, name in enumerate(every.parameter) if name.startswith(tuple(paths))]
    assert some.parameter == tuple(every.parameter[n] for n in expected)
    assert len(some.parameter) > 4
    np.testing.assert_allclose(some.derivative, every.derivative[expected], rtol=1e-9)


DAMPED = CONFIGS / "triple-damped.toml"
ANY = {
    "Q of test pitch": "stage.test.wires.d",
    "settling of modes": "stage.test.body.mass",
    "peak of test.x/support.x:0.2:5": "stage.test.wires.l",
    "margin pitch.gain": "stage.upper.body.mass",
    "noise test.x:3": "stage.test.wires.l",
    "thermal test.x:10": "stage.test.wires.d",
    "tension test.1": "stage.test.body.mass",
    "test height": "stage.test.wires.l",
    "top fraction of test pitch": "stage.test.wires.d",
    "distance test pitch, test longitudinal": "stage.test.wires.d",
    "test.x/support.x:0.6": "stage.test.wires.l",
    "lowest pitch": "stage.test.wires.d",
}
"""Quantities of every kind, and a number that changes each."""


@pytest.fixture(scope="module")
def every():
    """Derivatives of them all by these numbers."""
    with pytest.MonkeyPatch.context() as patch:
        numbers = [one for one in parameters.every(DAMPED.read_text(), "beam") if one.name in NAMED]
        patch.setattr(parameters, "every", lambda *_: tuple(numbers))
        return solved(DAMPED.read_text(), *ANY, level="beam")


NAMED = set(ANY.values())


@pytest.mark.parametrize("name", ANY)
def test_any_quantity_against_differences_of_designs(name, every):
    """Central differences between files with other numbers, by another step; the stated error
    covers the difference but for the error of these."""
    path = ANY[name]
    design = sus.read(DAMPED)
    number = every.parameter.index(path)
    result = every.result.index(name)
    value = float(every.value[number])
    step = 1e-3 * max(value, 1e-3)
    sides = []
    for factor in (1, -1, 2, -2):
        changed = design.replace({path: value + factor * step})
        [verdict] = sus.check(
            changed.replace({"requirement": [{"quantity": name, "at_least": -1e9}]})
        ).verdicts
        sides.append(verdict.value)
    near = (sides[0] - sides[1]) / (2 * step)
    far = (sides[2] - sides[3]) / (4 * step)
    expected = (4 * near - far) / 3
    found = every.derivative[number, result]
    assert found == pytest.approx(expected, rel=1e-4)
    exact = name in ("test.x/support.x:0.6", "lowest pitch")
    error = every.derivative_error[number, result]
    assert np.isnan(error) if exact else error < 1e-3 * abs(found)


def test_errors_are_printed(tmp_path):
    words = ["--result", "tension test.1", "--result", "test yaw", "--fidelity", "string"]
    done = run("sensitivity", CONFIGS / "double.toml", *words, "--out", tmp_path, "--no-plot")
    assert done.exit_code == 0, done.stderr
    [first, second] = [line for line in done.stdout.splitlines() if line.startswith("  [")][:2]
    assert "% of the largest change)" in first and "error" not in second


def test_a_mode_that_the_design_lacks_has_no_derivatives():
    """On wires that bend one mode alone of this design is mostly test pitch."""
    names = ["test pitch#2", "test.x/support.x:10"]
    found = sus.sensitivity(sus.example("quadruple"), results=names, fidelity="beam")
    assert np.isnan(found.nominal[0]) and np.isnan(found.derivative[:, 0]).all()
    assert found.nominal[1] > 0 and np.isfinite(found.derivative[:, 1]).any()


def test_one_quantity_by_two_names_is_listed_once():
    names = ["test.x/support.x:10", "test.x/support.x:10.0"]
    found = sus.sensitivity(sus.example("double"), results=names, fidelity="string")
    assert found.result == ("test.x/support.x:10",)
