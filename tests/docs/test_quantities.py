"""docs/quantities.md says which quantities there are, and in which commands they work."""

from __future__ import annotations

import re
from functools import cache

import pytest

import suspension_cli as sus
from suspension_cli.analyses.named_quantities import names_of
from suspension_cli.quantities import vocabulary
from suspension_cli.quantities.names import Names
from tests.quantities import test_every_command
from tests.support.paths import ROOT
from tests.support.printed_quantities import FREE, SINGLE

TEXT = " ".join((ROOT / "docs" / "quantities.md").read_text().split())
ROWS = (ROOT / "docs" / "quantities.md").read_text().partition("|---|")[2].partition("\n\n")[0]
CODE = re.compile(r"`([^`]+)`")
TESTED_AS = {"requirement": "check"}
DAMPED = sus.example("triple-damped").text
ON_SPRINGS = FREE.partition('material = "steel302"')[0] + "k = 2e4\n"
NEEDS = {
    "`margin ...` needs loops": (FREE, "margin x.gain", "give [[control.loop]] tables"),
    "`rms coil ...` OSEMs": (FREE, "rms coil F1", "give [[control.osem]] tables"),
    "`dilution of ...` a design without loops": (SINGLE, "dilution of test yaw", "loops store"),
    "`sag of ...` blades": (FREE, "sag of test blades", "names no wire or blade"),
    "of a wire its cross-section": (ON_SPRINGS, "stress test.1", "give its cross-section"),
    "of a blade its geometry": (DAMPED, "stress upper blades", "give its geometry"),
}


@cache
def written_names() -> list[str]:
    """Names in the first column, with what `...` and `.phase` leave out filled in."""
    found: list[str] = []
    for row in ROWS.splitlines()[1:]:
        first, *rest = CODE.findall(row.split("|")[1])
        own = [first]
        for name in rest:
            if name.endswith("..."):
                own.append(name.removesuffix("...") + first.partition(" of ")[2])
            elif name.startswith("."):
                own.append(first.rpartition(".")[0] + name)
            else:
                own.append(name)
        found += own
    return found


def kind_of(name: str, names: Names) -> str:
    """Pattern of the kind to which a name belongs, whether or not a design has such a quantity."""
    for kind in vocabulary.every_kind():
        try:
            found = kind.parse(name, names, "")
        except sus.InputError:
            return kind.pattern
        if found is not None:
            return kind.pattern
    return f"none: {name}"


def test_the_table_has_every_kind():
    names = names_of(sus.parse(DAMPED))
    assert {kind_of(name, names) for name in written_names()} == {
        kind.pattern for kind in vocabulary.every_kind()
    }


def test_the_commands_are_those_in_which_every_kind_is_tested():
    """`tests/quantities/test_every_command.py` runs each kind in each of them."""
    [said] = re.findall(r"Every kind of quantity in this table works in (.*?) for ", TEXT)
    marked = [
        name.removeprefix("test_")
        for name, test in vars(test_every_command).items()
        if any(mark.name == "parametrize" for mark in getattr(test, "pytestmark", []))
    ]
    assert set(CODE.findall(said)) == {TESTED_AS.get(name, name) for name in marked}


@pytest.mark.parametrize("statement", NEEDS)
def test_a_design_that_lacks_what_a_quantity_needs_is_refused(statement):
    text, name, said = NEEDS[statement]
    assert statement in TEXT
    with pytest.raises(sus.InputError) as raised:
        vocabulary.parse(name, names_of(sus.parse(text)))
    assert said in str(raised.value)
