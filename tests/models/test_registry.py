"""Models are ordered, and each says what it neglects."""

from __future__ import annotations

import re

import pytest

from suspension_cli.design.reader import read
from suspension_cli.models import registry
from suspension_cli.models.choice import Frequencies, Systems, choose
from suspension_cli.models.registry import Choice
from tests.support.paths import CONFIGS


def test_models_are_ordered():
    """From the cheapest to the most complete, which omits nothing."""
    costs = [model.cost for model in registry.MODELS]
    omitted = [len(model.omits) for model in registry.MODELS]
    assert costs == sorted(costs)
    assert omitted == sorted(omitted, reverse=True)
    assert registry.MOST_COMPLETE.omits == ()
    # which options read without the models
    assert ("auto", *(model.name for model in registry.MODELS)) == registry.LEVELS
    assert all(model.description and model.valid_for for model in registry.MODELS)


@pytest.mark.parametrize("level", registry.FILES)
def test_every_line_says_what_is_neglected(level):
    """Also where nothing was estimated, and where nothing is neglected."""
    line = Choice(level, "as requested").line
    omitted = " and ".join(registry.by_name(level).omits)
    said = f"neglected: {omitted}, of unknown effect" if omitted else registry.NOTHING
    assert line == f"model: {level} (as requested); {said}"


def test_the_reason_names_what_matters_and_what_does_not():
    """In per cent of the modes, the tolerance in all its digits."""
    design = read(CONFIGS / "double.toml").design
    compare = Systems(design).compare(lambda _: Frequencies())
    line = choose(design, "auto", registry.MODELS, compare, 2.5e-4).line
    assert re.fullmatch(
        r"model: beam \(wire bending changes [a-z ]+ by up to 25 %\); neglected: wire mass,"
        r" 0\.0\d+ % in [a-z ]+ \(tolerance 0\.025 %\)",
        line,
    )
