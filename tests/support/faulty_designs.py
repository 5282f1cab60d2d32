"""Faulty designs, and what the command must say of each: `faulty_designs.txt`, as cases."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tests.support.commandline import MISSING, Edits
from tests.support.designs import RAW, TEXTS


@dataclass(frozen=True)
class Case:
    """One faulty design and the line that it must give.

    Attributes
    ----------
    name : str
    edits : dict
        What spoils the base, see `commandline.edited`.
    says : str
        How the line goes on after the file: ``KEY = VALUE: PROBLEM``, or the beginning of it.
    remedy : str
        A part of what comes after the semicolon.
    base : str
        Which of `designs.RAW` is spoilt.
    """

    name: str
    edits: Edits
    says: str
    remedy: str = ""
    base: str = field(default="single")


def way(node: Any, dotted: str) -> tuple[str | int, ...]:
    """The keys and positions that a path in the words of a parsed file stands for."""
    steps: list[str | int] = []
    chain = tomllib.loads(f"{dotted} = 0")
    while isinstance(chain, dict):
        [(step, chain)] = chain.items()
        if isinstance(node, list) or step.isdigit():
            names = [item.get("name") for item in node or ()]
            place = int(step) - 1 if step.isdigit() else names.index(step)
            node = node[place] if node and place < len(node) else None
            steps.append(place)
        else:
            node = node.get(step) if node else None
            steps.append(step)
    return tuple(steps)


def parse(file: Path, bases: dict[str, Any], base: str = "single") -> dict[str, list[Case]]:
    """Cases of a table by the heading above them; they spoil `base`, where they name no other of
    the bases."""
    cases: dict[str, list[Case]] = {}
    first, edits, title = base, {}, ""
    for line in filter(None, file.read_text(encoding="utf-8").splitlines()):
        if line.startswith("## "):
            base, title = first, line[3:]
            cases[title] = []
        elif line.startswith("# "):
            continue
        elif line.startswith("["):
            base = line.strip("[]")
        elif line.startswith("delete "):
            edits[way(bases[base], line.removeprefix("delete "))] = MISSING
        else:
            edit, arrow, says = line.partition(" -> ")
            if not line.startswith("    "):
                key, _, value = edit.partition(" = ")
                edits[way(bases[base], key)] = tomllib.loads(f"value = {value}")["value"]
            if arrow or line.startswith("    "):
                says, _, remedy = (f"{edit}: {says}" if arrow else line.strip()).partition(" ... ")
                name = f"{base}-{len(cases[title])}-{says}"[:60]
                cases[title].append(Case(name, edits, says, remedy, base))
                edits = {}
    return cases


TABLE = parse(Path(__file__).with_suffix(".txt"), RAW)
HUGE = Case(
    "huge-integer",
    {("stage", 0, "wires", "l"): 10**399},
    f"stage.test.wires.l = 1{56 * '0'}...: must be at least 1e-09 and at most 100000",
)
TYPES, NUMBERS = TABLE["types"], [*TABLE["numbers"], HUGE]
CASES = [HUGE, *(case for cases in TABLE.values() for case in cases)]


def explicit(*wires: Any, position: tuple[float, float, float] = (0.0, 0.0, -0.4)) -> Edits:
    """The single pendulum on wires of its own."""
    made = [{"upper": upper, "lower": lower, "k": 1e4} for upper, lower in wires]
    keys = {"wires": MISSING, "position": list(position), "wire": made}
    return {("stage", 0, key): value for key, value in keys.items()}


def plumb(x: float, y: float) -> tuple[list[float], list[float]]:
    """A vertical wire."""
    return [x, y, 0.0], [x, y, 0.0]


NO_DESIGNS: dict[str, tuple[bytes, str]] = {
    "empty": (b"", "is empty; start a design with `pendsus new`"),
    "white": (b" \n\t\n", "is empty; "),
    "comment": (b"# nothing yet\n\n# or ever\n", "is empty; "),
    "binary": (bytes(range(256)), "is not text (UTF-8); "),
    "nul": (b'[design]\nname = "a\x00b"\n', "is not TOML: "),
    "latin-1": ("[design]\ntitle = 'Müller'\n".encode("latin-1"), "is not text (UTF-8); "),
    "utf-16": ("[design]\nname = 'x'\n".encode("utf-16"), "is not text (UTF-8); "),
    "unclosed": (b"[design\nname = 'x'\n", "is not TOML: "),
    "no-value": (b"[design]\nname =\n", "is not TOML: "),
    "bare-word": (b"[design]\nname = single\n", "is not TOML: "),
    "twice": (b"[design]\nname = 'x'\nname = 'y'\n", "is not TOML: "),
    "table-twice": (b"[design]\nname = 'x'\n[design]\n", "is not TOML: "),
    "long-integer": (b"[design]\nname = 1" + b"0" * 5000 + b"\n", "line 2: is not TOML: "),
    "prose": (b"Dear Sir or Madam,\n", "is not TOML: "),
    "json": (b'{"design": {"name": "x"}}\n', "is not TOML: "),
    "nested": (b"x = " + b"[" * 5000 + b"]" * 5000, "tables or arrays are nested too deeply; "),
    "nested-less": (
        TEXTS["single"].encode() + b"[analysis.xcouple]\nx = " + b"[" * 300 + b"]" * 300,
        # how deep is too deep depends on the version of Python
        ("tables or arrays are nested too deeply; ", "analysis.xcouple.x = "),
    ),
    "hexadecimal": (b"[design]\nname = 0x" + b"f" * 5000, "design.name = "),
}
"""Files that are no designs at all: their bytes, and how the first line goes on after the file."""
