"""Every model keeps the protocol: one design, many designs, physics omitted; and only models/ knows
their names."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import suspension_cli
from suspension_cli.design.reader import read
from suspension_cli.models import registry
from suspension_cli.models.choice import Frequencies, Systems, choose
from suspension_cli.models.registry import Choice
from tests.support.paths import CONFIGS

CASE = CONFIGS / "husman2000" / "table1-case3.toml"
NAMES = re.compile("|".join(f'"{model.name}"' for model in registry.MODELS))
EXAMPLE = re.compile(r"^ *>>> .*$", re.MULTILINE)
HOME = Path(suspension_cli.__file__).parent


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


def test_physics_between_models():
    assert registry.adds(registry.BEAM, registry.STRING) == "wire bending"
    assert registry.adds(registry.VIOLIN, registry.STRING) == "wire bending and wire mass"
    design = read(CASE).design
    assert registry.most_complete(design) is registry.VIOLIN
    assert registry.most_complete(design, massless=True) is registry.BEAM


def test_names_of_models_stay_in_their_folder():
    """Elsewhere the properties of a model decide, so that another one takes its file and the
    registry."""
    found = [
        str(path.relative_to(HOME))
        for path in HOME.rglob("*.py")
        if "models" not in path.relative_to(HOME).parts
        and path.name != "api.py"
        and NAMES.search(EXAMPLE.sub("", path.read_text()).replace('"string": (str', ""))
    ]
    assert found == []


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
