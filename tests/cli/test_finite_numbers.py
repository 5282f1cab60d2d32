"""Every option that takes a number refuses NaN, infinity and what overflows to it."""

from __future__ import annotations

import click
import pytest

from suspension_cli.cli.main import COMMANDS, get
from tests.support.commandline import run
from tests.support.paths import CONFIGS

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


@pytest.mark.parametrize("name", ["response", "thermal", "budget", "damp", "info"])
def test_frequencies_that_would_overflow_are_refused(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = run(name, CONFIGS / "triple-damped.toml", "--frequency", "1,1e150")
    assert result.exit_code == 2 and "above 1e+09 Hz" in result.stderr
