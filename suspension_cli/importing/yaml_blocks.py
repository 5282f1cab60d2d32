"""YAML of other programs, read by key: one clear line for a value that is missing or wrong.

All values stay texts until a number is asked for, as YAML 1.1 takes `310e-6` as a text and `.5e3`
as a number.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from suspension_cli.errors import InputError, format_key, format_value, one_line
from suspension_cli.files import whole_files

MOST_BYTES = 1_000_000
"""Largest file; those of gwinc have 15 000 bytes, and one of 1 MB takes some seconds to read."""
SMALLEST = 1e-15
LARGEST = 1e15
"""Magnitudes of numbers other than 0, in SI units: far beyond those of any suspension."""


@dataclass(frozen=True)
class Block:
    """A mapping of the file, at a dotted key path."""

    path: str
    values: dict[Any, Any]

    def __contains__(self, key: str) -> bool:
        return key in self.values

    def at(self, key: str) -> str:
        """Dotted path of a key."""
        return f"{self.path}.{format_key(key)}".lstrip(".")

    def value(self, key: str, wanted: str) -> Any:
        """Value of a key, whatever its form; raises `InputError`, which says what is `wanted`."""
        if key not in self.values:
            raise InputError.of(self.at(key), "missing", f"give {wanted}")
        return self.values[key]

    def block(self, key: str, wanted: str) -> Block:
        """Mapping at a key."""
        return _as_block(self.at(key), self.value(key, wanted), wanted)

    def blocks(self, key: str, wanted: str, most: int) -> Iterator[Block]:
        """Mappings of the list at a key, numbered from 1 in their paths."""
        found = self.value(key, wanted)
        if not isinstance(found, list) or not 1 <= len(found) <= most:
            problem = f"is not a list of 1 to {most} blocks"
            raise InputError.of(self.at(key), problem, f"give {wanted}", format_value(found))
        for number, one in enumerate(found, 1):
            yield _as_block(f"{self.at(key)}.{number}", one, wanted)

    def text(self, key: str, wanted: str) -> str:
        """Text at a key."""
        found = self.value(key, wanted)
        if not isinstance(found, str):
            raise InputError.of(
                self.at(key), "is not a text", f"give {wanted}", format_value(found)
            )
        return found

    def number(self, key: str, wanted: str, *, signed: bool = False) -> float:
        """Positive number at a key, or any finite one if it may be `signed`."""
        found = self.number_or_nan(key, wanted, signed=signed)
        if math.isnan(found):
            raise InputError.of(self.at(key), "is not a number", f"give {wanted}", ".nan")
        return found

    def number_or_nan(self, key: str, wanted: str, *, signed: bool = False) -> float:
        """Number at a key that may be `.nan`."""
        text = self.value(key, wanted)
        try:
            found = math.nan if str(text).lower() == ".nan" else float(text)
        except (TypeError, ValueError):
            found = math.inf
        ordinary = SMALLEST <= abs(found) <= LARGEST and (signed or found > 0)
        if not (ordinary or math.isnan(found) or (signed and found == 0)):
            problem = "is not a number" if signed else "is not a positive number"
            raise InputError.of(self.at(key), problem, f"give {wanted}", format_value(text))
        return found


def _as_block(path: str, found: Any, wanted: str) -> Block:
    if not isinstance(found, dict):
        raise InputError.of(path, "is not a block of keys", f"give {wanted}", format_value(found))
    return Block(path, found)


def read(file: Path, kind: str) -> Block:
    """Read a file whose values are keys and their values; raises `InputError`.

    `kind` says what it should be, for the remedy of a message.
    """
    import yaml  # 20 ms, for this command alone

    text = whole_files.read_text(file, MOST_BYTES, kind)
    try:
        found = yaml.load(text, Loader=yaml.BaseLoader)
    except (yaml.YAMLError, RecursionError) as error:
        mark = getattr(error, "problem_mark", None)
        place = f" (line {mark.line + 1})" if mark else ""
        problem = getattr(error, "problem", None) or one_line(error)
        raise InputError.of("", f"is no valid YAML: {problem}{place}", "correct it") from None
    return _as_block("", {} if found is None else found, kind)
