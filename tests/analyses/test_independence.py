"""No analysis imports another, by statement or by the text of a name."""

from __future__ import annotations

import ast
import tomllib
from collections.abc import Iterator
from pathlib import Path

from tests.support.paths import ROOT

FOLDER = ROOT / "suspension_cli" / "analyses"
PREFIX = "suspension_cli.analyses."
ANALYSES = {path.name for path in FOLDER.iterdir() if (path / "command.py").is_file()}


def contract() -> dict:
    """The contract on analyses in pyproject.toml."""
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]
    (found,) = [one for one in contracts["contracts"] if one["type"] == "independence"]
    return found


def names_in(file: Path) -> Iterator[str]:
    """List the modules that a file imports, and the texts in it that name one."""
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.ImportFrom):
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value


def test_the_contract_lists_all_analyses():
    listed = {name.removeprefix(PREFIX) for name in contract()["modules"]}
    assert listed == ANALYSES


def test_no_analysis_names_another():
    """Of the registry, which finds analyses by their names, none is named in the text."""
    allowed = set()
    for line in contract()["ignore_imports"]:
        source, _, target = line.partition(" -> ")
        allowed.add((source, target))
    found = set()
    for name in ANALYSES:
        for file in sorted((FOLDER / name).rglob("*.py")):
            source = f"{PREFIX}{file.relative_to(FOLDER).with_suffix('')}".replace("/", ".")
            for text in names_in(file):
                if not text.startswith(PREFIX):
                    continue
                folder = text.removeprefix(PREFIX).partition(".")[0]
                if folder in ANALYSES - {name}:
                    found.add((source, text))
    unlisted = [
        (source, text)
        for source, text in sorted(found)
        if not any(source == one and text.startswith(other) for one, other in allowed)
    ]
    assert unlisted == []
