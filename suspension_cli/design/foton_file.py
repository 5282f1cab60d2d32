"""Filter files of the front ends of LIGO and KAGRA, as Foton writes them.

Lines that start with # hold `# MODULES NAME ...`, `# SAMPLING NAME RATE` (or `# SAMPLING RATE
RATE`, for all modules) and the designs. Each of up to ten sections of a module has a line

    MODULE INDEX SWITCHING COUNT RAMP TIMEOUT NAME gain a1 a2 b1 b2

and, for COUNT > 1 second-order sections, COUNT - 1 lines ``a1 a2 b1 b2``, with

    H(z) = gain prod (1 + b1/z + b2/z^2) / (1 + a1/z + a2/z^2)

(`fmReadCoeff.c` and `iir_filter` of LIGO's real-time code generator, Bork et al., SoftwareX 13,
100619 (2021)). The coefficients count; designs are comments. INDEX is from 0, the buttons FM1 to
FM10 of the control room from 1, and so are sections here.
"""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from suspension_cli.design import foton
from suspension_cli.design.foton import Filter
from suspension_cli.errors import InputError, format_value, suggest
from suspension_cli.files import whole_files
from suspension_cli.files.documents import Layout

SECTIONS = 10
"""Sections of a module."""
BIQUADS = 10
"""Most second-order sections of each."""
MOST = 4 * whole_files.TOML
"""Largest file, bytes; those of front ends have up to a few MB."""
FIRST = 12
"""Words in the first line of a section."""


COMMENT: dict[str, Any] = {"initial_indent": "# ", "subsequent_indent": "# "}


@dataclass(frozen=True)
class Module:
    """A filter module that stands for a response, or for a filter of a loop."""

    in_json: ClassVar = Layout(
        only="name output input sections poles error", names={"name": "module"}
    )
    name: str
    output: str
    input: str
    section: list[Filter]  # in s, or digital ones, in series
    text: list[str]  # their coefficients at the sample rate, as design strings with `sos`
    error: float = 0.0  # largest relative error in the band, off resonance; 0 of a filter of a loop

    @property
    def sections(self) -> int:
        """Number of sections."""
        return len(self.section)

    @property
    def poles(self) -> int:
        """Number of poles."""
        return sum(len(part.poles) for part in self.section)


@dataclass(frozen=True)
class FilterFile:
    """Modules with their sample rate and the band of their errors, Hz; that of loops is None."""

    in_json: ClassVar = Layout(only="rate module", names={"rate": "rate_hz", "module": "modules"})
    rate: float
    band: tuple[float, float] | None
    module: tuple[Module, ...]


def read(path: Path, module: str, numbers: Sequence[int]) -> tuple[str, float]:
    """Read sections of a module as a design string with `sos`, and the sample rate in Hz.

    Raises `InputError` with the line at fault.
    """
    lines = whole_files.read_text(path, MOST, "a Foton filter file").splitlines()
    words = [line.lstrip("#").split() for line in lines]
    heads = [words[n] for n, line in enumerate(lines) if line.startswith("#") and words[n]]
    indices = set(map(str, range(SECTIONS)))
    starts = [n for n, one in enumerate(words) if len(one) == FIRST and one[1] in indices]
    known = {name for one in heads if one[0] == "MODULES" for name in one[1:]}
    known |= {words[n][0] for n in starts}
    if module not in known:
        problem = f"has no module {format_value(module)}" if known else "is no Foton filter file"
        remedy = suggest(module, sorted(known)) if known else "name the .txt file of a front end"
        raise InputError.of("", problem, remedy)
    rates = {one[1]: one[2] for one in heads if one[0] == "SAMPLING" and len(one) > 2}
    rate = _number(rates.get(module, rates.get("RATE", "")))
    if not 0 < rate < math.inf:
        problem = f"has no sample rate of {module}"
        raise InputError.of("", problem, f"add the line # SAMPLING {module} 16384, with the rate")
    own = {int(words[n][1]) + 1: n for n in starts if words[n][0] == module}
    for number in numbers:
        if number not in own:
            there = ", ".join(map(str, sorted(own))) or "none"
            problem = f"has no section {number} (FM{number}) of {module}"
            raise InputError.of("", problem, f"sections there: {there}")
    return " ".join(_section(words, own[number]) for number in numbers), rate


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def _section(words: list[list[str]], start: int) -> str:
    """Read the section that starts with a line, whose number is from 0."""
    count = _number(words[start][3])
    found = words[start][FIRST - 5 :]
    if count not in range(1, BIQUADS + 1):
        problem = f"has {words[start][3]} second-order sections"
        raise InputError.of(f"line {start + 1}", problem, f"front ends take 1 to {BIQUADS}")
    for n in range(start, start + int(count)):
        line = words[n] if n < len(words) else []
        own = found if n == start else line
        if len(own) != 4 + (n == start) or not all(math.isfinite(_number(one)) for one in own):
            problem = "does not hold the coefficients of a second-order section"
            raise InputError.of(f"line {n + 1}", problem, "have Foton write the file again")
        found = found if n == start else [*found, *own]
    return f'sos({found[0]},[{";".join(found[1:])}],"o")'


def lines(bank: FilterFile, command: str) -> list[str]:
    """Lines of a filter file that a command writes."""
    result = ["# FILTERS FOR ONLINE SYSTEM", "#", *textwrap.wrap(command, 90, **COMMENT), "#"]
    result += [f"# MODULES {one.name}" for one in bank.module]
    for one in bank.module:
        result += ["", f"### {one.name}", f"# SAMPLING {one.name} {bank.rate:g}"]
        about = f"# {one.output} over {one.input}, SI"
        if bank.band is not None:
            low, high = bank.band
            about += f"; relative error {one.error:.2g} from {low:g} to {high:g} Hz off resonance"
        result.append(about)
        for n, (part, text) in enumerate(zip(one.section, one.text, strict=True)):
            design = foton.format_filter(part).replace(";", "; ")
            wrapped = textwrap.wrap(design, 90, break_long_words=False)
            result.append(f"# DESIGN   {one.name} {n} " + " \\\n#    ".join(wrapped))
            gain, *numbers = re.findall(r"[-+.\de]*\d", text)
            rows = [" ".join(numbers[k : k + 4]) for k in range(0, len(numbers), 4)]
            result.append(f"{one.name} {n} 21 {len(rows)} 0 0 part{n + 1} {gain} {rows[0]}")
            result += [f"    {row}" for row in rows[1:]]
    return result
