"""Dotted paths lead through documents and designs alike."""

from __future__ import annotations

import tomllib

import pytest

from suspension_cli.design import paths, reader
from suspension_cli.errors import InputError
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
