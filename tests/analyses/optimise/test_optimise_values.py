"""What `pendsus optimise` computes from a design: exact derivatives, batches, stress, shares, and
which mode is which."""

from __future__ import annotations

import tomllib
from dataclasses import replace

import msgspec
import numpy as np
import pytest

from suspension_cli.analyses.check import statics
from suspension_cli.analyses.optimise.evaluate import Results, with_imperfections
from suspension_cli.design import reader
from suspension_cli.design.derive import com_positions
from suspension_cli.design.goals import Free, Goal, Goals
from suspension_cli.errors import InputError
from suspension_cli.linear import damped, eigenmodes
from suspension_cli.models import registry
from tests.support import derivatives as differences
from tests.support.optima import EVERY, TRIPLE, values_of


def test_derivatives_of_every_kind_of_goal():
    """Along a change of all numbers at once, against differences of the eighth order, ties and the
    imperfect equilibrium included."""
    every = values_of(TRIPLE.read_text(), EVERY)
    # away from coincidences of the design as drawn
    start = every.freed.begin + np.array([0.01, 0.02, -0.03, 0.03, 0.01])
    change, step = 0.3 * np.array([0.6, -0.8, 1.0, 0.7, -0.9]), 2e-3
    found = every.slopes(start) @ change
    slope = sum(
        weight * (every.at(start + n * step * change) - every.at(start - n * step * change))
        for n, weight in differences.STENCIL.items()
    )
    np.testing.assert_allclose(found, slope / step, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("hinged", [False, True])
def test_stress_and_height_are_those_of_check(hinged):
    """Of each design of a batch, and none where a wire is slack."""
    raw = tomllib.loads(TRIPLE.read_text())
    if hinged:
        del raw["stage"][2]["wires"]["clamp"]
        raw["stage"][2]["wires"]["bending"] = "hinged"
    raw["perturbation"] = [
        {"body": "test", "com_offset": [1e-4, 2e-4, 0.0]},
        {"wire": "test.1", "length_change": -1e-4},
    ]
    goals = Goals(
        goal=[Goal(kind="stress", at_most=1.0), Goal(kind="height", at_most=1.0)],
        free=[Free(name="stage.test.wires.l", lower=0.2, upper=0.4)],
    )
    values = values_of(reader.write_toml(raw), goals)
    designs = [values.freed.design(np.array([place])) for place in (0.2, 0.5)]
    loose = msgspec.structs.replace(designs[0].perturbation[1], length_change=2e-3)
    designs += [with_imperfections(designs[0], [loose])]
    *good, slack = Results(values, designs).values
    assert np.isnan(slack).all()
    with pytest.raises(InputError, match="slack"):
        statics.solve(designs[-1])
    for design, found in zip(designs, good, strict=False):
        loads = statics.solve(design)
        parts = [part for part in (*loads.wires, *loads.blades) if part.fraction is not None]
        height = -com_positions(design)["test"][2] - loads.bodies[-1].shift[2]
        expected = [*(part.fraction for part in parts), height]
        np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_top_mass_fraction_is_the_damping_rate_from_there():
    """With C = beta M of the top mass every pole moves to the left by beta/2 of its share, for a
    small beta."""
    model, beta = registry.STRING.system(reader.read(TRIPLE).design), 1e-4
    top = np.zeros_like(model.mass)
    top[6:12, 6:12] = beta * model.mass[6:12, 6:12]
    found, slowed = eigenmodes.solve(model), damped.solve(replace(model, damping=top))
    for frequency, share in zip(found.frequency, found.top_fraction, strict=True):
        near = slowed.decay_rate[np.abs(slowed.frequency / frequency - 1) < 1e-7]
        assert np.abs(near / (beta / 2) - share).min() < 1e-6
