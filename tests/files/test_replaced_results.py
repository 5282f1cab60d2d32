"""What is said when a results file is written again."""

from __future__ import annotations

import sys

import pytest

import suspension_cli as sus
from tests.support.commandline import run

REPLACED = "(replaced the result of another design of this name"


@pytest.mark.parametrize("command", ["modes", "sweep"])
def test_an_edit_of_a_file_is_the_same_design(tmp_path, monkeypatch, command):
    """Another file of this name is not, nor are other values of --set."""
    file = tmp_path / "mine.toml"
    words = ["--out", tmp_path / "out", "--no-plot", "--fidelity", "string", "--name", "same"]
    if command == "sweep":
        words += ["--vary", "stage.test.wires.l=0.28:0.3:2", "--workers", "1"]

    def messages(text: str, name: str = "mine.toml", *more: str) -> str:
        path = file.with_name(name)
        path.write_text(text)
        given = [command, str(path), *map(str, words), *more]
        monkeypatch.setattr(sys, "argv", ["pendsus", *given])
        result = run(*given)
        assert result.exit_code == 0
        return result.stderr

    text = sus.template("single").text
    edited = text.replace("d = 0.001", "d = 0.0012")
    assert edited != text
    assert REPLACED not in messages(text)
    assert REPLACED not in messages(edited)
    assert REPLACED in messages(edited, "mine.toml", "--set", "constants.gravity=9.8")
    assert REPLACED in messages(text, "other.toml")
