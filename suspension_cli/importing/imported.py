"""An imported design: its text as TOML, and what it has otherwise than the file it is from."""

from __future__ import annotations

import json
import re
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from suspension_cli.design import reader
from suspension_cli.design.reader import Source
from suspension_cli.errors import InputError


@dataclass(frozen=True)
class Imported:
    """A converted file."""

    text: str  # the design as TOML
    notes: list[str]  # what it has otherwise than the file, or not at all
    files: dict[str, str]  # CSV files of stiffness tables that it names, as text by name
    next_command: str  # what to run first, without `pendsus`; {file} stands for the design

    def source(self) -> Source:
        """Read the design with its tables; raises `InputError` with its faults."""
        with tempfile.TemporaryDirectory() as folder:
            for name, text in {**self.files, "design.toml": self.text}.items():
                (Path(folder) / name).write_text(text, encoding="utf-8")
            try:
                source = reader.read(Path(folder) / "design.toml")
            except InputError as error:  # of a file that only stands there for this check
                raise InputError(error.faults) from None
        return replace(source, file="", text=source.text if self.files else self.text)


def with_notes(origin: str, heading: str, notes: list[str], lines: list[str]) -> str:
    """Text of a design, after comments that say where it is from and list the notes."""
    first = f"# Converted by `pendsus import` {origin}"
    comments = [f"# {heading}", *(f"#   {note}" for note in notes)] if notes else []
    return "\n".join([first, *comments, *lines, ""])


def table(head: str, keys: dict[str, Any], comment: str = "", **comments: str) -> list[str]:
    """Lines of a table, after an empty one; `comments` stand beside their keys."""
    lines = ["", f"[{head}]" + (f"  # {comment}" if comment else "")]
    for key, value in keys.items():
        text = repr(value) if key == "phase" else _value(value)  # rounding spoils its symmetry
        lines.append(f"{key} = {text}" + (f"  # {comments[key]}" if comments.get(key) else ""))
    return lines


def _value(value: Any) -> str:
    if isinstance(value, bool | str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, dict):
        return f"{{ {', '.join(f'{key} = {_value(one)}' for key, one in value.items())} }}"
    if isinstance(value, int):
        return str(value)
    if not isinstance(value, float):
        return f"[{', '.join(map(_value, value))}]"
    mantissa, _, power = f"{value:.8e}".partition("e")
    if -4 <= int(power) < 6:
        return repr(float(f"{value:.9g}"))
    return f"{mantissa.rstrip('0').rstrip('.')}e{int(power)}"


def plain(text: str, most: int = 60) -> str:
    """Text for a comment or a title: printable characters in one line."""
    return "".join(one if one.isprintable() else " " for one in text)[:most].strip()


def word(text: str, default: str) -> str:
    """Name of a table: letters, digits, _ and -, starting with a letter."""
    bare = re.sub(r"[^A-Za-z0-9_]+", "-", text).strip("-")[:60]
    return bare if re.match(r"[A-Za-z]", bare) else f"{default}-{bare}".rstrip("-")
