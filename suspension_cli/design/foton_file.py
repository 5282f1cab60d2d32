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
from collections.abc import Sequence
from pathlib import Path

from suspension_cli.errors import InputError, format_value, suggest
from suspension_cli.files import bounded

SECTIONS, BIQUADS = 10, 10
"""Sections of a module, and most second-order sections of each."""
FIRST = 12
"""Words in the first line of a section."""


def read(path: Path, module: str, numbers: Sequence[int]) -> tuple[str, float]:
    """Read sections of a module as a design string with `sos`, and the sample rate in Hz.

    Raises `InputError` with the line at fault.
    """
    lines = bounded.read_text(path, bounded.TEXT, "a Foton filter file").splitlines()
    words = [line.split() for line in lines]
    named = {name for line in lines if (found := _comment(line, "MODULES")) for name in found}
    firsts = [(n, one) for n, one in enumerate(words) if len(one) == FIRST and one[1].isdecimal()]
    every = sorted(named | {one[0] for _, one in firsts if one[0][0] != "#"})
    if not every:
        remedy = "name the .txt file of a front end, which lists # MODULES"
        raise InputError.of("", "is no Foton filter file", remedy)
    if module not in every:
        problem = f"has no module {format_value(module)}"
        raise InputError.of("", problem, suggest(module, every))
    rates = {one[0]: one[1] for line in lines if len(one := _comment(line, "SAMPLING") or []) > 1}
    text = rates.get(module, rates.get("RATE", ""))
    rate = _number(text)
    if not 0 < rate < math.inf:
        problem = f"has no sample rate of {module}" + (f" ({text})" if text else "")
        raise InputError.of("", problem, f"add the line # SAMPLING {module} 16384, with the rate")
    starts = {int(one[1]) + 1: n for n, one in firsts if one[0] == module}
    result = []
    for number in numbers:
        if number not in starts:
            there = ", ".join(map(str, sorted(starts))) or "none"
            problem = f"has no section {number} (FM{number}) of {module}"
            raise InputError.of("", problem, f"sections there: {there}")
        result.append(_section(words, starts[number]))
    return " ".join(result), rate


def _comment(line: str, key: str) -> list[str] | None:
    """Words after a key in a comment line."""
    found = re.match(rf"#+\s*{key}\s+(.*)", line)
    return found[1].split() if found else None


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def _section(words: list[list[str]], start: int) -> str:
    """Read the section whose first line has a number."""
    count = _number(words[start][3])
    if count not in range(1, BIQUADS + 1):
        problem = f"has {words[start][3]} second-order sections"
        raise InputError.of(f"line {start + 1}", problem, f"the front end takes 1 to {BIQUADS}")
    found: list[str] = []
    for n in range(start, start + int(count)):
        own = (words[n] if n < len(words) else [])[FIRST - 5 if n == start else 0 :]
        if len(own) != (5 if n == start else 4) or not all(
            math.isfinite(_number(one)) for one in own
        ):
            problem = "does not hold the coefficients of a second-order section"
            raise InputError.of(f"line {n + 1}", problem, "have Foton write the file again")
        found += [repr(_number(one)) for one in own]
    return f'sos({found[0]},[{";".join(found[1:])}],"o")'
