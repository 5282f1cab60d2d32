"""Results files of format 3 as version 1.0.0 writes them, and what was printed with them, are in
tests/data/format-3/; every version 1.x reads them.

Until 1.0.0 is released they may be made again: `python -m tests.files.test_kept_format`.
"""

from __future__ import annotations

import json
import shlex
from typing import Any

import pytest

import suspension_cli as sus
from tests.support.commandline import run
from tests.support.paths import DATA

FOLDER = DATA / "format-3"
CASE = "configs/husman2000/table1-case3.toml"
COMMANDS = {
    "modes": f"modes {CASE}",
    "response": f"response {CASE} --frequency 1,10",
    "thermal": f"thermal {CASE} --output test.x --output test.pitch --frequency 10,100",
    "xcouple": "xcouple configs/husman2000/figure6.toml --sweep k=1,1.1,offset=0,1e-3 --workers 1",
}
"""One record, a list of records, and a sweep."""


def among(document: Any, printed: Any) -> Any:
    """A document without the keys that were added to those printed, at any depth."""
    if isinstance(printed, dict):
        return {key: among(document[key], value) for key, value in printed.items()}
    if isinstance(printed, list) and len(document) == len(printed):
        return [among(*pair) for pair in zip(document, printed, strict=True)]
    return document


@pytest.mark.parametrize("name", COMMANDS)
def test_results_of_version_1_are_read(name):
    found = sus.load(FOLDER / f"{name}.h5")
    printed = json.loads((FOLDER / f"{name}.json").read_text())
    document = found.document()
    assert among(document, printed) == printed
    assert str(found)


def make() -> None:
    """Write the files anew."""
    for name, words in COMMANDS.items():
        more = ("--json", "--no-plot", "--name", name, "--out", "tests/data/format-3")
        done = run(*shlex.split(words), *more)
        (FOLDER / f"{name}.json").write_text(done.stdout)
        (FOLDER / f"{name}-{name}.h5").rename(FOLDER / f"{name}.h5")


if __name__ == "__main__":
    make()
