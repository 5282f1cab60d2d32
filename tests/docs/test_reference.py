"""The generated parts of the documentation are those of the program as it is, and a site's links
are really checked."""

from __future__ import annotations

from typing import get_type_hints

import pytest

import suspension_cli as sus
from suspension_cli.cli.main import COMMANDS
from tests.support.golden import ROOT
from tools import links, reference


@pytest.mark.parametrize("path", reference.PAGES, ids=lambda path: path.name)
def test_pages_are_what_the_program_says(path):
    text = path.read_text()
    assert reference.page(text) == text, "run: make reference"


def test_the_stub_has_the_functions_as_they_are():
    assert reference.STUB.read_text() == reference.stub(), "run: make reference"


def test_every_command_has_its_table():
    text = (ROOT / "docs" / "commands.md").read_text()
    assert [found[2] for found in reference.BLOCK.finditer(text)] == list(COMMANDS)


def test_every_table_of_the_format_is_there():
    """Those that are not are described in the row of the key that takes them, key by key."""
    text = (ROOT / "docs" / "design-file.md").read_text()
    shown = {found[2] for found in reference.BLOCK.finditer(text)}
    within = {
        name
        for name, kind in reference.TYPES.items()
        if f"`{{ {', '.join(kind.__struct_fields__)} }}`" in text
    }
    # which hold nothing but tables that are shown
    assert set(reference.TYPES) - shown - within == {"Design", "Control", "Tolerance"}


@pytest.mark.parametrize("name", reference.TYPES)
def test_every_key_says_what_it_means(name):
    kind = reference.TYPES[name]
    hints = get_type_hints(kind, include_extras=True)
    for key in kind.__struct_fields__:
        hint = hints[key]
        if name != "Design":
            assert reference.description(hint) or "tables" in reference.takes(hint), key
        assert reference.takes(hint)


def test_stale_tables_are_made_anew():
    assert (
        reference.page("a\n<!--keys:Gas-->\nold\n<!--end-->\nb")
        == f"a\n<!--keys:Gas-->\n\n{reference.keys('Gas')}\n\n<!--end-->\nb"
    )


def test_links_that_lead_nowhere_are_found(tmp_path):
    (tmp_path / "a.html").write_text(
        '<h1 id="top"></h1><a href="b.html#here">b</a><a href="#top">top</a><img src="p.png"><a href="https://x.org/y">x</a>'
    )
    (tmp_path / "b.html").write_text('<a href="a.html#nowhere">a</a><a href="c.html">c</a>')
    assert sorted(links.broken(tmp_path)) == [
        "a.html: b.html#here: no such anchor",
        "a.html: p.png: no such file",
        "b.html: a.html#nowhere: no such anchor",
        "b.html: c.html: no such file",
    ]


def test_the_site_has_the_meaning_of_options():
    text = "<!--options:damp-->\n\nshort\n\n<!--end-->\n<!--keys:Gas-->\nkept\n<!--end-->"
    found = reference.expand(text)
    assert "| `--highest FLOAT RANGE` | Frequency in Hz up to which modes are damped" in found
    assert "short" not in found and "kept" in found


def test_the_site_documents_all_public_names():
    found = reference.documented_names()
    errors = {"InputError", "PendsusError", "PendsusWarning"}
    for name in {*sus.__all__} - errors:
        assert name.startswith("_") or f".{name}\n" in found, name
