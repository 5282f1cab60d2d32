"""Changes of a TOML text that leave its comments, its order and its layout as they are.

    rewritten(text, document)  # the text with the values of the document, and as little else

`_Layout` finds where each value and each line of keys stands in a text, which tomllib has read
before, so it is valid TOML. `_Edits` compares the values of the text with those that are wanted,
and collects the pieces that differ. Libraries that keep comments take seconds for designs with long
tables of numbers, and any design would wait for them.
"""

from __future__ import annotations

import functools
import math
import re
import tomllib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import Any

from suspension_cli.design.typed_tables import Raw
from suspension_cli.errors import escape_unprintable

Path = tuple[str | int, ...]
"""Keys, and places in lists from 0."""
ACROSS = 6
"""Numbers in each line of a long array."""
LARGE = 1e6
"""Numbers from here on are written with a power of ten."""

_GAP = re.compile(r"(?:[ \t\r\n]|#[^\n]*)*+")
_BLANKS = re.compile(r"[ \t]*+")
_REST_OF_LINE = re.compile(r"[^\n]*+\n?")
_WIDE_GAP = re.compile(r" {2,}+(?=#)")
_STRING = r"""\"\"\"(?:\\.|[^\\])*?\"\"\""{0,2}|'''.*?''''{0,2}|"(?:\\.|[^"\\\n])*+"|'[^'\n]*+'"""
_SCALAR = re.compile(rf"{_STRING}|[^\s,\]}}#]++(?:\ \d\d:[^\s,\]}}#]++)?", re.DOTALL)
"""A value without members; a date and its time may have a space between them."""
_KEY = re.compile(r"""[\w-]++|"(?:\\.|[^"\\\n])*+"|'[^'\n]*+'""")


@dataclass(frozen=True)
class _Line:
    """A header, or a key with its value: what it defines, and its whole lines of text."""

    path: Path
    start: int
    end: int


@dataclass(frozen=True)
class _Slot:
    """Where a new key of a table goes: behind the last one.

    `prefix` are the keys that go before it in a table that is written by dotted keys. `of_new` is
    true if the header of the table is itself new.
    """

    at: int
    prefix: tuple[str, ...]
    indent: str = ""
    inline: bool = False
    of_new: bool = False


class _Layout:
    """What a valid TOML text reads as, and the places of its values, lines and tables."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.document = tomllib.loads(text)
        self.spans: dict[Path, tuple[int, int]] = {}  # of values, not of tables with headers
        self.lines: list[_Line] = []
        self.slots: dict[Path, _Slot] = {}
        self._counts: dict[Path, int] = {}  # members of arrays of tables
        self._scan()

    def _scan(self) -> None:
        table: Path = ()
        at = self._after(_GAP, 0)
        self.slots[()] = _Slot(at, ())
        while at < len(self.text):
            start = self.text.rfind("\n", 0, at) + 1
            indent = self.text[start:at]
            if self.text[at] == "[":
                is_member = self.text.startswith("[[", at)
                keys, at = self._keys(at + 1 + is_member)
                table = path = self._table(keys, is_member)
                end = self._after(_REST_OF_LINE, at)
                self.slots[table] = _Slot(end, (), indent)
            else:
                keys, at = self._keys(at)
                path = (*table, *keys)
                end = self._after(_REST_OF_LINE, self._value(at, path))
                for n in range(len(keys)):
                    self.slots[(*table, *keys[:n])] = _Slot(end, keys[:n], indent)
            self.lines.append(_Line(path, start, end))
            at = self._after(_GAP, end)

    def _after(self, pattern: re.Pattern[str], at: int) -> int:
        found = pattern.match(self.text, at)
        return found.end() if found else at

    def _keys(self, at: int) -> tuple[tuple[str, ...], int]:
        """Read dotted keys; return the place behind what follows them: ``=`` or ``]``."""
        keys: list[str] = []
        while True:
            at = self._after(_BLANKS, at)
            end = self._after(_KEY, at)
            written = self.text[at:end]
            quoted = written[0] in "\"'"
            keys.append(next(iter(tomllib.loads(f"{written}=0"))) if quoted else written)
            at = self._after(_BLANKS, end) + 1
            if self.text[at - 1] != ".":
                return tuple(keys), at

    def _table(self, keys: tuple[str, ...], is_member: bool) -> Path:
        """Path of the table of a header, through the last members of arrays of tables."""
        path: Path = ()
        for key in keys[:-1]:
            path = (*path, key)
            if path in self._counts:
                path = (*path, self._counts[path] - 1)
        path = (*path, keys[-1])
        if not is_member:
            return path
        self._counts[path] = self._counts.get(path, 0) + 1
        return (*path, self._counts[path] - 1)

    def _value(self, at: int, path: Path) -> int:
        """Note the span of a value and of its members; return its end."""
        start = self._after(_GAP, at)
        opening = self.text[start]
        if opening == "[":
            end = self._array(start + 1, path)
        elif opening == "{":
            end = self._inline_table(start + 1, path)
        else:
            end = self._after(_SCALAR, start)
        self.spans[path] = start, end
        return end

    def _array(self, at: int, path: Path) -> int:
        count = 0
        at = self._after(_GAP, at)
        while self.text[at] != "]":
            at = self._after(_GAP, self._value(at, (*path, count)))
            count += 1
            if self.text[at] == ",":
                at = self._after(_GAP, at + 1)
        return at + 1

    def _inline_table(self, at: int, path: Path) -> int:
        at = self._after(_GAP, at)
        while self.text[at] != "}":
            keys, at = self._keys(at)
            end = self._value(at, (*path, *keys))
            for n in range(len(keys)):
                self.slots[(*path, *keys[:n])] = _Slot(end, keys[:n], inline=True)
            at = self._after(_GAP, end)
            if self.text[at] == ",":
                at = self._after(_GAP, at + 1)
        return at + 1


class _Edits:
    """Pieces of a text that change."""

    def __init__(self, layout: _Layout) -> None:
        self.layout = layout
        self.slots = layout.slots.copy()
        self.newline = _newline(layout.text)
        # start, end, whether it is of a new table, what stands there instead
        self.pieces: list[tuple[int, int, bool, str]] = []

    def applied(self) -> str:
        """The changed text."""
        parts: list[str] = []
        done = 0
        # where one table ends its new keys come before new tables
        for start, end, _, new in sorted(self.pieces, key=lambda piece: piece[:3]):
            parts += [self.layout.text[done:start], new]
            done = end
        return "".join([*parts, self.layout.text[done:]])

    def change(self, path: Path, old: object, new: object) -> None:
        """Change a value that the text gives."""
        if same(old, new):
            return
        span = self.layout.spans.get(path)
        if isinstance(old, dict) and isinstance(new, dict):
            if self._is_kept(path, old, new):
                self._change_table(path, old, new)
                return
        elif isinstance(old, list) and isinstance(new, list):
            if span is None and _is_tables(new):
                self._change_tables(path, old, new)
                return
            if span is not None and len(old) == len(new):
                self._change_members(path, old, new)
                return
        if span is None:
            self._remove(path)
            self._add(path, new)
        else:
            self._replace(*span, self._literal(new))

    def _replace(self, start: int, end: int, new: str) -> None:
        """Put another value in place of one; a comment behind it stays in its column."""
        gap = _WIDE_GAP.match(self.layout.text, end)
        if gap and "\n" not in new:
            width = gap.end() - start - len(new)
            self.pieces.append((start, gap.end(), False, new + " " * max(width, 2)))
        else:
            self.pieces.append((start, end, False, new))

    def _is_kept(self, path: Path, old: Raw, new: Raw) -> bool:
        """Whether a table can change key by key, rather than be written anew."""
        if path in self.layout.spans:
            return self._has_all_keys(path, old, new)
        # without keys only a header of its own shows that there is a table
        return bool(new) or not path or any(line.path == path for line in self.layout.lines)

    def _has_all_keys(self, path: Path, old: Raw, new: Any) -> bool:
        """Whether no key of an inline table is lost, also of tables in it with dotted keys."""
        if not old or not isinstance(new, dict) or not old.keys() <= new.keys():
            return False
        dotted = [key for key in old if (*path, key) not in self.layout.spans]
        return all(self._has_all_keys((*path, key), old[key], new[key]) for key in dotted)

    def _change_table(self, path: Path, old: Raw, new: Raw) -> None:
        for key in old:
            if key in new:
                self.change((*path, key), old[key], new[key])
            else:
                self._remove((*path, key))
        added = [key for key in new if key not in old]
        for key in sorted(added, key=lambda key: _has_header(new[key])):
            self._add((*path, key), new[key])

    def _change_members(self, path: Path, old: Sequence[object], new: Sequence[object]) -> None:
        for n, (before, after) in enumerate(zip(old, new, strict=False)):
            self.change((*path, n), before, after)

    def _change_tables(self, path: Path, old: list[Raw], new: list[Raw]) -> None:
        """Change an array of tables with headers, whose number may differ."""
        self._change_members(path, old, new)
        for n in range(len(new), len(old)):
            self._remove((*path, n))
        last = max(line.end for line in self._lines_of(path))
        for table in new[len(old) :]:
            self._insert_table(last, path, table, is_member=True)

    def _lines_of(self, path: Path) -> list[_Line]:
        return [line for line in self.layout.lines if line.path[: len(path)] == path]

    def _remove(self, path: Path) -> None:
        self.pieces += [(line.start, line.end, False, "") for line in self._lines_of(path)]

    def _add(self, path: Path, value: Any) -> None:
        """Add a key that the text does not give; new tables of the whole design have headers."""
        if len(path) == 1 and _has_header(value):
            for table in value if isinstance(value, list) else [value]:
                is_member = isinstance(value, list)
                self._insert_table(len(self.layout.text), path, table, is_member=is_member)
            return
        slot = self.slots.get(path[:-1])
        if slot is None:  # only its members have headers
            slot = _Slot(max(line.end for line in self._lines_of(path[:-1])), (), of_new=True)
            self._insert_table(slot.at, path[:-1], {})
            self.slots[path[:-1]] = slot
        written = f"{_dotted((*slot.prefix, path[-1]))} = {self._literal(value)}"
        if slot.inline:
            self.pieces.append((slot.at, slot.at, False, f", {written}"))
        else:
            self._insert_line(slot.at, slot.indent + written, of_new=slot.of_new)

    def _insert_table(self, at: int, path: Path, table: Raw, *, is_member: bool = False) -> None:
        if table and not is_member and all(isinstance(one, dict) for one in table.values()):
            for key, one in table.items():
                self._insert_table(at, (*path, key), one)
            return
        head = _dotted([key for key in path if isinstance(key, str)])
        self._insert_line(at, "", of_new=True)
        self._insert_line(at, f"[[{head}]]" if is_member else f"[{head}]", of_new=True)
        for key, value in table.items():
            self._insert_line(at, f"{_dotted([key])} = {self._literal(value)}", of_new=True)

    def _insert_line(self, at: int, line: str, *, of_new: bool) -> None:
        within = at > 0 and self.layout.text[at - 1] != "\n"  # at the end of an unended line
        written = f"{self.newline}{line}" if within else f"{line}{self.newline}"
        self.pieces.append((at, at, of_new, written))

    def _literal(self, value: Any) -> str:
        return _literal(value).replace("\n", self.newline)


@functools.lru_cache(maxsize=8)
def _layout(text: str) -> _Layout:
    """Cached, as many designs may be made from one text."""
    return _Layout(text)


def rewritten(text: str, document: Raw) -> str:
    r"""Write the values of a document into the text of another one.

    Parameters
    ----------
    text : str
        TOML.
    document : dict
        As `tomllib` gives it.

    Returns
    -------
    str
        TOML that reads as the document. Only values that differ are written anew; new keys go to
        the end of their table. Every other line is as it was.

    Examples
    --------
    >>> print(rewritten("d = 1e-3  # drawn wire\n", {"d": 0.002, "count": 4}), end="")
    d = 0.002  # drawn wire
    count = 4
    """
    edits = _Edits(_layout(text))
    edits.change((), edits.layout.document, document)
    return edits.applied()


def headed(lines: Iterable[str], text: str) -> str:
    """Put comments before a TOML text, with its ends of lines."""
    comments = [f"# {escape_unprintable(line)}".rstrip() for line in lines]
    return _newline(text).join([*comments, "", text])


def _newline(text: str) -> str:
    return "\r\n" if "\r\n" in text else "\n"


def same(one: object, other: object) -> bool:
    """Whether two values of documents are written alike: 1 is not 1.0, and nan is nan."""
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(same(one[key], other[key]) for key in one)
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(map(same, one, other))
    return one is other or repr(one) == repr(other)


def _is_tables(value: object) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(one, dict) for one in value)


def _has_header(value: object) -> bool:
    """Whether a new value of the whole design is written below a header."""
    return _is_tables(value) or isinstance(value, dict)


def _dotted(keys: Sequence[str | int]) -> str:
    import tomli_w

    return ".".join(tomli_w.dumps({str(key): 0}).removesuffix(" = 0\n") for key in keys)


def _literal(value: Any) -> str:
    """Write a value; tables inline, long arrays of numbers in several lines."""
    import tomli_w

    if isinstance(value, dict):
        inside = ", ".join(f"{_dotted([key])} = {_literal(one)}" for key, one in value.items())
        return f"{{ {inside} }}" if inside else "{}"
    if isinstance(value, float) and LARGE <= abs(value) < math.inf:
        return f"{Decimal(repr(value)).normalize():e}".replace("e+", "e")
    if not isinstance(value, list):
        return tomli_w.dumps({"x": value}).removeprefix("x = ").removesuffix("\n")
    items = [_literal(one) for one in value]
    if len(items) <= ACROSS or not all(isinstance(one, float) for one in value):
        return f"[{', '.join(items)}]"
    rows = [", ".join(items[n : n + ACROSS]) for n in range(0, len(items), ACROSS)]
    return "[\n    " + ",\n    ".join(rows) + ",\n]"
