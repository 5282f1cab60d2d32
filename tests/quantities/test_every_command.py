"""Every kind of quantity in every command that takes quantities, against the printed values."""

from __future__ import annotations

import tomllib
from functools import cache

import pytest
import tomli_w

import suspension_cli as sus
from suspension_cli.quantities import vocabulary
from suspension_cli.studies import parameters
from tests.analyses.tolerance.test_tolerance import job_of, perturbations
from tests.support.printed_quantities import EXAMPLES, SINGLE, Example

pytestmark = pytest.mark.filterwarnings("ignore::suspension_cli.errors.PendsusWarning")

OTHER_MODEL = 0.01
"""`check` judges requirements in the most complete model, and lists loads of strings."""
BUILDS = 2
SCATTER = """
[[tolerance.wire]]
stage = "test"
length = { normal = 1e-4 }
lower = { normal = 1e-4 }
"""
STEP = 1e-3
"""Of central differences, relative to the number."""
ROUNDING = 1e-4
"""Change of a quantity by the rounding of found numbers: a tenth of `--tolerance` of optimise."""

every_example = pytest.mark.parametrize("example", EXAMPLES, ids=lambda one: one.name)
STEPS = ("stable",)
"""Quantities that jump between values, and are refused where derivatives are needed."""
SMOOTH = [one for one in EXAMPLES if one.name not in STEPS]
every_smooth_example = pytest.mark.parametrize("example", SMOOTH, ids=lambda one: one.name)


@cache
def printed(example: Example, value: float | None = None) -> float:
    """Value of a quantity of its design, with its number changed or as it is."""
    design = sus.parse(example.text)
    path, _ = example.number
    return example.printed(design if value is None else design.replace({path: value}))


def given(example: Example) -> float:
    """Value that the design has of the number."""
    path, _ = example.number
    return float(parameters.value_of(sus.parse(example.text).design, path))


def test_every_kind_has_an_example():
    """A new kind gets a line in `tests/support/printed_quantities.py`, and all commands of it."""
    missing = {kind.pattern for kind in vocabulary.every_kind()} - {one.kind for one in EXAMPLES}
    assert not missing, f"add an Example of {missing} to tests/support/printed_quantities.py"


@every_example
def test_sweep(example):
    path, value = example.number
    found = sus.sweep(
        sus.parse(example.text),
        vary={path: [value]},
        results=[example.name],
        fidelity=example.fidelity,
    )
    assert found.nominal[0] == pytest.approx(printed(example), rel=example.accuracy)
    assert found.value[0, 0] == pytest.approx(printed(example, value), rel=example.accuracy)
    changed = pytest.approx(printed(example, value), rel=10 * example.accuracy, abs=0.0)
    assert printed(example) != changed


@every_example
def test_compare(example):
    path, value = example.number
    design = sus.parse(example.text)
    changed = design.replace({path: value, "design.name": "changed"})
    found = sus.compare(
        design, changed, results=[example.name], fidelity=example.fidelity
    ).quantities
    expected = [printed(example), printed(example, value)]
    assert found.value[0] == pytest.approx(expected, rel=example.accuracy)


@every_example
def test_requirement(example):
    limits = f'\n[[requirement]]\nquantity = "{example.name}"\nat_most = 1e19\n'
    [verdict] = sus.check(sus.parse(example.text + limits)).verdicts
    assert verdict.value == pytest.approx(printed(example), rel=OTHER_MODEL)


@every_smooth_example
def test_sensitivity(example):
    path, _ = example.number
    value = given(example)
    design = sus.parse(example.text)
    found = sus.sensitivity(design, results=[example.name], vary=[path], fidelity=example.fidelity)
    assert found.parameter == (path,)
    assert found.nominal[0] == pytest.approx(printed(example), rel=example.accuracy)
    high, low = (printed(example, value * factor) for factor in (1 + STEP, 1 - STEP))
    assert found.derivative[0, 0] == pytest.approx((high - low) / (2 * STEP * value), rel=1e-3)


@every_smooth_example
def test_optimise(example, tmp_path):
    """The nearest design that meets a limit between the value at the start and another."""
    path, value = example.number
    start = printed(example)
    end = printed(example, value)
    limit = (abs(start) + abs(end)) / 2
    side = "at_least" if abs(end) > abs(start) else "at_most"
    goals = tmp_path / "goals.toml"
    bounds = sorted([given(example), value])
    goals.write_text(
        f'[[requirement]]\nquantity = "{example.name}"\n{side} = {limit!r}\n'
        f'[[free]]\nname = "{path}"\nlower = {bounds[0]}\nupper = {bounds[1]}\n'
    )
    found = sus.optimise(sus.parse(example.text), goals, starts=1, fidelity=example.fidelity)
    assert found.met
    again = example.printed(found.design)
    assert found.quantities.after[0] == pytest.approx(again, rel=example.accuracy)
    assert abs(again) == pytest.approx(limit, rel=ROUNDING + 3 * example.accuracy)


@every_smooth_example
def test_fit(example, tmp_path):
    """The number follows from the measured value of a design that has another one."""
    path, value = example.number
    seen = printed(example, value)
    measured = tmp_path / "measured.toml"
    measured.write_text(
        f'[[quantity]]\nname = "{example.name}"\nvalue = {seen!r}\n'
        f"uncertainty = {abs(seen) * 1e-4!r}\n"
        f'[[parameter]]\nname = "{path}"\n'
    )
    found = sus.fit(measured, sus.parse(example.text), explain=False, fidelity=example.fidelity)
    again = example.printed(found.design)
    assert again == pytest.approx(seen, rel=3 * example.accuracy)
    assert abs(given(example) / value - 1) > 0.01


def builds_of(text: str) -> list[sus.Design]:
    """The designs of the builds of a tolerance analysis, with their deviations written out."""
    raw = tomllib.loads(text)
    job = job_of(raw, BUILDS)
    del raw["tolerance"]
    own = raw.get("perturbation", [])
    drawn = [perturbations(job, one) for one in job.deviations(0, BUILDS)]
    return [sus.parse(tomli_w.dumps(raw | {"perturbation": own + one})) for one in drawn]


@every_example
def test_tolerance(example):
    text = example.text + SCATTER
    found = sus.tolerance(
        sus.parse(text),
        builds=BUILDS,
        results=[example.name],
        workers=1,
        fidelity=example.fidelity,
    )
    place = 2 if example.name == "3" else found.quantity.index(example.name)
    expected = [example.printed(build) for build in builds_of(text)]
    assert found.sample[:, place] == pytest.approx(expected, rel=example.accuracy)
    same = example.name in STEPS or example.name.startswith("temperature")
    if not same:  # heat flows as in the nominal build
        assert expected[0] != expected[1]


def test_a_quantity_that_jumps_is_refused_where_derivatives_are_needed(tmp_path):
    design = sus.parse(SINGLE)
    free = '[[free]]\nname = "control.loop.x.damper"\nlower = 1.0\nupper = 9.0\n'
    goals = tmp_path / "goals.toml"
    goals.write_text('[[requirement]]\nquantity = "stable"\nat_least = 1\n' + free)
    measured = tmp_path / "measured.toml"
    quantity = '[[quantity]]\nname = "stable"\nvalue = 1.0\nuncertainty = 0.1\n'
    measured.write_text(quantity + '[[parameter]]\nname = "control.loop.x.damper"\n')
    for run in (
        lambda: sus.optimise(design, goals),
        lambda: sus.fit(measured, design),
        lambda: sus.sensitivity(design, results=["stable"]),
    ):
        with pytest.raises(sus.InputError, match="is 0 or 1, so that it has no derivative"):
            run()
