"""Differences of quantities between models, against the models' own results."""

from __future__ import annotations

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.analyses.named_quantities import names_of
from suspension_cli.models import registry
from suspension_cli.quantities import vocabulary
from suspension_cli.quantities.differences import compare_designs
from suspension_cli.quantities.quantity import Quantity


def compare(design: sus.Design, *texts: str, simple: str, refined: str) -> tuple[float, str]:
    """Largest change of quantities from one model to another, and which."""
    names = names_of(design)
    wanted = [vocabulary.parse(text, names, "--result") for text in texts]
    change = compare_designs(wanted, [design.design])
    return change(registry.by_name(simple), registry.by_name(refined))


@pytest.fixture(scope="module")
def double() -> sus.Design:
    return sus.example("double")


def test_a_mode_changes_as_modes_prints_it(double):
    values = [sus.modes(double, fidelity=level) for level in ("string", "beam")]
    before, after = (one.frequency[list(one.label).index("test pitch")] for one in values)
    found, name = compare(double, "test pitch", simple="string", refined="beam")
    assert name == "test pitch"
    assert found == pytest.approx(abs(before / after - 1), rel=1e-6)


def test_wire_mass_changes_a_mode_by_its_share(double):
    """Rayleigh's quotient is second order in the change of shape."""
    values = [sus.modes(double, fidelity=level) for level in ("beam", "violin")]
    before, after = (one.frequency[list(one.label).index("test vertical")] for one in values)
    found, _ = compare(double, "test vertical", simple="beam", refined="violin")
    assert found == pytest.approx(abs(before / after - 1), rel=0.05)


def test_a_response_changes_as_response_prints_it(double):
    one = "test.x/support.x:3.7"
    sizes = []
    for level in ("string", "violin"):
        found = sus.response(
            double, inputs=["support.x"], outputs=["test.x"], frequency=[3.7], fidelity=level
        )
        sizes.append(abs(found.value.ravel()[0]))
    change, _ = compare(double, one, "test pitch", simple="string", refined="violin")
    pitch, _ = compare(double, "test pitch", simple="string", refined="violin")
    alone, _ = compare(double, one, simple="string", refined="violin")
    assert alone == pytest.approx(abs(sizes[0] / sizes[1] - 1), rel=1e-6)
    assert change == max(alone, pitch)


def test_a_design_that_one_model_cannot_hold_up_decides():
    """Without bending this wire's stage falls over; on beams it stands."""
    design = sus.example("double")
    low = design.replace({"stage.test.wires.d": -5e-3})
    change, _ = compare(low, "test.x/support.x:10", simple="string", refined="beam")
    assert np.isinf(change)


def test_an_infinite_value_hides_no_change():
    """The others are compared with the largest finite value."""

    class Fixed(Quantity):
        def read(self, solved):
            return solved

        def values(self, solved):
            return solved

    found = Fixed("fixed", "1").change(np.array([1.0, np.inf, 2.0]), np.array([2.0, np.inf, 4.0]))
    np.testing.assert_allclose(found, [0.25, 0.0, 0.5])
    found = Fixed("fixed", "1").change(np.array([1.0, 3.0]), np.array([1.0, np.inf]))
    assert found[0] == 0 and np.isinf(found[1])
