"""Labels mean the mode that is mostly their motion: against two pendulums in closed form, and the
labels that `pendsus modes` prints."""

from __future__ import annotations

import numpy as np
import pytest

from suspension_cli.linear import batch_modes, eigenmodes, mode_content
from suspension_cli.linear.mode_content import Motion
from suspension_cli.models import registry
from suspension_cli.studies import builds, variants
from tests.support.golden import CONFIGS


def mixed(angle):
    """Fractions of two modes of two motions that mix by an angle; a third motion apart."""
    cos, sin = np.cos(angle) ** 2, np.sin(angle) ** 2
    zero, one = np.zeros_like(cos), np.ones_like(cos)
    rows = [[cos, sin, zero], [sin, cos, zero], [zero, zero, one]]
    return np.moveaxis(np.array(rows), -1, 0)


def test_two_modes_that_exchange_their_character():
    """Below 45 degrees the first motion is that of the first mode, above of the second."""
    angle = np.radians([0.0, 30.0, 44.0, 46.0, 60.0, 90.0])
    found = mode_content.find(mixed(angle), Motion(0))
    assert found.mode.tolist() == [0, 0, 0, 1, 1, 1]
    assert found.other.tolist() == [1, 1, 1, 0, 0, 0]
    assert found.shared.tolist() == [False, False, True, True, False, False]
    np.testing.assert_allclose(found.fraction + found.other_fraction, 1.0, rtol=1e-12)


def test_labels_are_counted_by_frequency():
    """Two modes of one motion; where one of them is another motion, there is no second."""
    fractions = np.array(
        [
            [[0.6, 0.4], [0.9, 0.1], [0.1, 0.9]],
            [[0.4, 0.6], [0.9, 0.1], [0.1, 0.9]],
        ]
    )
    first, second = (mode_content.find(fractions, Motion(0, n)).mode for n in (1, 2))
    assert first.tolist() == [0, 1]
    assert second.tolist() == [1, -1]


def test_designs_without_modes_have_none():
    fractions = mixed(np.radians([10.0, 80.0]))
    fractions[0] = np.nan
    found = mode_content.find(fractions, Motion(0))
    assert found.mode.tolist() == [-1, 1]
    assert not found.shared.any()


def test_what_goals_see_does_not_jump():
    """The largest and smallest frequency of the modes of a label are continuous where a third mode
    takes part and the first two change places."""
    steps = np.linspace(0.0, np.pi / 2, 20001)
    fractions = mixed(steps)
    part = 0.3 * np.sin(2 * steps) ** 2  # of the first motion in the third mode
    fractions[:, 2, 0], fractions[:, 2, 2] = part, 1 - part
    frequency = np.array([1.0, 1.3, 3.0]) * np.ones((len(steps), 1))
    weight = mode_content.weights(fractions, Motion(0), smooth=True)
    high = mode_content.largest(frequency, weight)
    low = -mode_content.largest(-frequency, weight)
    assert np.abs(np.diff(high)).max() < 2e-3
    assert np.abs(np.diff(low)).max() < 2e-3
    assert (low <= high).all()
    np.testing.assert_allclose([high[0], high[-1], low[0], low[-1]], [1.0, 1.3, 1.0, 1.3])


@pytest.mark.parametrize("name", ["husman2000/table2", "imperfect", "double", "arm-cavity"])
def test_the_same_labels_as_the_table_of_modes(name):
    """In a batch of designs as in each alone, with tilted bodies and blades."""
    text = (CONFIGS / f"{name}.toml").read_text()
    designs = [*variants.designs_at(text, {"constants.gravity": np.array([9.0, 9.81])})]
    for places, scene, one in variants.alike(designs, registry.STRING.name):
        batch = builds.balance(scene, one, level=registry.STRING.name, allow_unstable=True)
        found = mode_content.of_spectrum(batch.model, batch_modes.solve(batch.model))
        for n, place in enumerate(places):
            alone = eigenmodes.solve(registry.STRING.system(designs[place]).constant)
            np.testing.assert_allclose(found[n], alone.fractions, atol=1e-6)
            for number, place in enumerate(mode_content.leading(alone.fractions).tolist()):
                _, _, rank = alone.label[number].partition("#")
                motion = mode_content.Motion(place, int(rank or 0))
                assert mode_content.find(found[n], motion).mode == number
