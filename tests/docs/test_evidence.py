"""Tables of what is verified, measured and fitted: alike on all pages, with numbers that their
commands print."""

from __future__ import annotations

import shlex

import pytest

from tests.support.paths import ROOT
from tools.validation import __main__ as validation
from tools.validation import counter_tests, evidence

ROWS = [(kind, row) for kind in evidence.KINDS for row in evidence.rows(kind)]
PREFIX = "python -m tools.validation "
QUICK = {"ligo-quad-2005", "ligo-quad", "kagra-prm", "geo", "caltech-40m", "kagra-measured"}
"""Parts of the page that take below a few seconds; `evidence --run` runs all commands."""


@pytest.mark.parametrize("path", evidence.PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_tables_are_those_of_the_source(path):
    text = path.read_text("utf-8")
    assert evidence.page(text) == text, "run: python -m tools.validation.evidence"
    assert {found[1] for found in evidence.BLOCK.finditer(text)} >= {"measured", "fitted"}


@pytest.mark.parametrize(("kind", "row"), ROWS, ids=[f"{kind}: {row.what}" for kind, row in ROWS])
def test_rows_name_commands_that_exist(kind, row):
    first, *words = shlex.split(row.command)
    assert first in ("python", "pendsus", "make")
    if row.command.startswith(PREFIX):
        known = {*validation.PARTS, *validation.kagra.SUSPENSIONS, "ligo-quad"}
        assert set(words[2:]) <= known and row.prints
    for word in words:
        assert not word.startswith("tests/") or (ROOT / word).exists()


@pytest.mark.parametrize("part", sorted(QUICK))
def test_commands_print_the_numbers(part, capsys):
    validation.show(part)
    shown = capsys.readouterr().out
    own = [row for _, row in ROWS if row.command == PREFIX + part]
    assert own
    for row in own:
        for text in row.prints:
            assert text in shown, row.what


@pytest.mark.parametrize("number", [2, 5, 7])
def test_edited_saves_agree_when_put_back(number):
    """SRM, SR3 and BS with the wires and legs of SUMCON's matrices: all modes."""
    error, labels = counter_tests.deviations(counter_tests.CHANGES[number])
    assert len(labels) == 45 and abs(error).max() < 1e-3


def test_what_is_wrong_is_refused():
    with pytest.raises(SystemExit, match="no such part"):
        validation.show("kagra-nothing")
