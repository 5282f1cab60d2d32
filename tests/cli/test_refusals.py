"""What commands refuse, `refusals.txt`: one line with the option, its value and what to do, exit
code 2, nothing written."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest

from tests.support.commandline import assert_refused, from_template, run
from tests.support.paths import CONFIGS


def cases():
    """Command, design, options, parts of the message."""
    head: list[str] = []
    for line in (Path(__file__).parent / "refusals.txt").read_text(encoding="utf-8").splitlines():
        if line.startswith("["):
            head = shlex.split(line.strip("[]"))
        elif "->" in line and not line.startswith("#"):
            options, _, says = line.partition("->")
            words = [word.replace(r"\n", "\n") for word in shlex.split(options)]
            name = f"{head[0]} {options.strip()}"
            yield pytest.param(*head[:2], head[2:] + words, says.strip().split("..."), id=name)


@pytest.mark.parametrize(("command", "design", "options", "says"), list(cases()))
def test_refused(command, design, options, says, tmp_path):
    shipped = CONFIGS / design
    file = shipped if shipped.exists() else from_template(tmp_path, design)
    out = tmp_path / "out"
    form = () if command == "report" else ("--json",)
    result = run(command, file, *options, *form, "--out", out)
    assert not out.exists()
    lines = assert_refused(result, file)
    [line] = [line for line in lines if line.startswith(says[0].strip())]
    for part in says[1:]:
        assert part.strip() in line
