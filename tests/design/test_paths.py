"""Dotted paths lead through documents and designs alike; units of numbers come from the types of
the design's tables."""

from __future__ import annotations

import tomllib

import pytest

import suspension_cli as sus
from suspension_cli.analyses.fit.printed_parameters import change_unit
from suspension_cli.design import paths, reader
from suspension_cli.design.paths import format_with_unit, unit_of
from suspension_cli.errors import InputError
from suspension_cli.studies import parameters
from tests.support.paths import CONFIGS

TEXT = (CONFIGS / "triple-damped.toml").read_text()


def test_every_number_is_found_where_it_is_listed():
    raw = tomllib.loads(TEXT)
    listed = [item for key, value in raw.items() for item in paths.numbers(key, value)]
    assert len(listed) > 30
    for path, value in listed:
        assert paths.value_at(raw, path) == value


def test_documents_and_designs_change_alike():
    """A setting in the text, and a change of the checked design."""
    path = "stage.middle.wires.l"
    value = paths.value_at(tomllib.loads(TEXT), path)
    by_text = reader.parse_with_overrides(TEXT, paths.settings({path: value + 0.01}))
    by_tree = paths.changed(reader.parse(TEXT), path.split("."), lambda number: number + 0.01)
    assert by_text == by_tree
    assert reader.parse(TEXT).stage[1].wires.l == value


@pytest.mark.parametrize(
    ("key", "place"),
    [("upper", 0), ("2", 1), ("0", None), ("3", None), ("²", None), ("lower", None)],
)
def test_members_by_name_or_number(key, place):
    assert paths.member([{"name": "upper"}, {"name": "test"}], key) == place


@pytest.mark.parametrize(
    ("path", "problem"),
    [
        ("stage.tset.wires.l", "there is no 'tset' here"),
        ("stage.test.wires.l.x", "stage.test.wires.l is a value, not a table"),
    ],
)
def test_paths_that_lead_nowhere(path, problem):
    with pytest.raises(InputError) as caught:
        paths.assign(tomllib.loads(TEXT), path.split("."), 1.0, f"{path}=1.0")
    assert caught.value.faults[0].problem == problem


@pytest.mark.parametrize(
    ("path", "unit"),
    {
        "stage.test.wires.d": "m",
        "stage.test.wire.2.upper.3": "m",
        "stage.test.wires.sections.2.radius.1": "m",
        "stage.upper.blades.uncoupled_frequency": "Hz",
        "stage.upper.spring.1.stiffness.3": "",
        "stage.test.body.inertia.1.2": "kg m^2",
        "materials.steel302.youngs_modulus": "Pa",
        "constants.gravity": "m/s^2",
        "stage.test.wires.nonsense": "",
    }.items(),
)
def test_unit_of_a_path(path, unit):
    assert unit_of(path) == unit


def test_every_length_of_the_shipped_designs_has_its_unit():
    known = {"d", "d_upper", "l", "s", "t1", "t2", "radius", "length", "thickness"}
    for name in sus.examples():
        for item in parameters.every(sus.example(name).text):
            if item.name.rsplit(".", 1)[-1] in known:
                assert unit_of(item.name) == "m", item.name


def test_numbers_are_written_as_people_read_them():
    assert format_with_unit("stage.test.wires.d", -0.0021) == "-2.1 mm"
    assert format_with_unit("materials.a.youngs_modulus", 1.7e11) == "170 GPa"
    assert format_with_unit("stage.test.body.mass", 5.6) == "5.6 kg"
    assert format_with_unit("materials.a.poisson_ratio", 0.3) == "0.3"
    assert format_with_unit("gas.pressure", 1e-6) == "1e-06 Pa"


def test_changes_of_fitted_numbers_are_printed_in_their_natural_steps():
    assert change_unit("stage.test.wires.ring", 0.05) == ("mm", 1e3)
    assert change_unit("stage.test.wires.radius", 2e-4) == ("%", 1 / 2e-6)
    assert change_unit("stage.test.wires.s", -0.02) == ("mm", 1e3)
    assert change_unit("link.strap.stiffness.1", 0.0) == ("SI", 1.0)
