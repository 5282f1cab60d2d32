"""Every kind of quantity in commands that take quantities, against the printed values."""

from __future__ import annotations

from functools import cache

import pytest

import suspension_cli as sus
from suspension_cli.quantities import vocabulary
from suspension_cli.studies import parameters
from tests.support.printed_quantities import EXAMPLES, Example

pytestmark = pytest.mark.filterwarnings("ignore::suspension_cli.errors.PendsusWarning")

OTHER_MODEL = 0.01
"""`check` judges requirements in the most complete model, and lists loads of strings."""
STEP = 1e-3
"""Of central differences, relative to the number."""

every_example = pytest.mark.parametrize("example", EXAMPLES, ids=lambda one: one.name)


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
    assert abs(printed(example) / printed(example, value) - 1) > 10 * example.accuracy


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


@every_example
def test_sensitivity(example):
    path, _ = example.number
    value = given(example)
    design = sus.parse(example.text)
    found = sus.sensitivity(design, results=[example.name], vary=[path], fidelity=example.fidelity)
    assert found.parameter == (path,)
    assert found.nominal[0] == pytest.approx(printed(example), rel=example.accuracy)
    high, low = (printed(example, value * factor) for factor in (1 + STEP, 1 - STEP))
    assert found.derivative[0, 0] == pytest.approx((high - low) / (2 * STEP * value), rel=1e-3)
