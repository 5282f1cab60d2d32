"""A name of a module says which it is: base names are unique, but for the parts of an analysis."""

from __future__ import annotations

from collections import Counter

from tests.support.paths import ROOT

PARTS = {"__init__", "command", "picture", "solve"}


def test_base_names_of_modules_are_unique():
    names = Counter(path.stem for path in (ROOT / "suspension_cli").rglob("*.py"))
    assert {name for name, count in names.items() if count > 1} <= PARTS
