"""What commands refuse, `refusals.txt`: one line with the option, its value and what to do, exit
code 2, nothing written; and every number that is not finite."""

from __future__ import annotations

import shlex
from pathlib import Path

import click
import pytest

from suspension_cli.cli.main import COMMANDS, get
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


NUMERIC = [
    (name, param.opts[0])
    for name in COMMANDS
    for param in get(name).params
    if isinstance(param, click.Option)
    and (isinstance(param.type, click.types.FloatParamType) or param.metavar == "GRID")
]
"""Commands with their options that take a number, or a grid of them."""


@pytest.mark.parametrize("value", ["nan", "-inf", "1e999"])
@pytest.mark.parametrize(("name", "option"), NUMERIC)
def test_numbers_are_finite(name, option, value, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    files = [CONFIGS / "triple-damped.toml", CONFIGS / "double.toml"]
    count = sum(isinstance(param, click.Argument) for param in get(name).params)
    words = ("--input", "support.x", "--output", "test.x") if name == "compare" else ()
    result = run(name, *files[: 2 if words else count], *words, option, value)
    assert result.exit_code == 2, result.stderr
    assert option in result.stderr
    assert "finite" in result.stderr or "not in the range" in result.stderr
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


def test_the_walk_finds_the_options():
    assert {("tolerance", "--limit"), ("damp", "--duration"), ("response", "--frequency")} <= {
        *NUMERIC
    }


@pytest.mark.parametrize("name", ["response", "thermal", "budget", "damp"])
def test_frequencies_that_would_overflow_are_refused(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = run(name, CONFIGS / "triple-damped.toml", "--frequency", "1,1e150")
    assert result.exit_code == 2 and "above 1e+09 Hz" in result.stderr
