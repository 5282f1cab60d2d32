"""Read and write filters as design strings of Foton, the filter editor of LIGO and KAGRA.

A string is a product of factors, in sequence or joined by ``*``:

    zpk([z1;z2],[p1;p2],k,"n")   pole(f,"n")   zero(f,"n")   gain(k)   gain(3,"dB")
    pole2(f,Q,"n")   zero2(f,Q,"n")

The last argument is the plane, by default ``"s"``. With w = 2 pi f0 and s = 2 pi i f (documentation
of `FilterDesign` in LIGO's Global Diagnostics System):

- ``"s"``: roots r of `zpk` in rad/s, factors s - r, so real parts are negative in the left half
  plane. `pole` and `zero` take the positive frequency w of a factor s + w.
- ``"f"``: the same with 2 pi r for roots r in Hz.
- ``"n"``: roots r in Hz, factors 1 + i f / r, and i f where r = 0. Real parts are *positive* in the
  left half plane.
"""

from __future__ import annotations

import cmath
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import NoReturn

PAIRED = 1e-9
"""Relative distance within which two complex roots are conjugates."""
SIDE = {"s": "negative", "f": "negative", "n": "positive"}
"""Sign of the real part of a root of `zpk` in the left half plane, per plane."""
MINIMUM = {"gain": 1, "zpk": 3, "pole": 1, "zero": 1, "pole2": 2, "zero2": 2}
"""Factors, with the number of arguments that each needs; `pole`, `zero` take a gain as well."""
TOKEN = re.compile(
    r"\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)|(?P<name>[A-Za-z_]\w*)"
    r"|(?P<text>\"[^\"]*\"|'[^']*')|(?P<sign>[][(),;*+-]))"
)


class FotonError(ValueError):
    """Error in a Foton string: what is wrong, with its column, and what to do."""

    def __init__(self, problem: str, remedy: str) -> None:
        super().__init__(f"{problem}; {remedy}")
        self.problem, self.remedy = problem, remedy


@dataclass(frozen=True)
class Filter:
    """Filter H(f) = gain times the product of (i f + z) divided by that of (i f + p), f in Hz.

    Attributes
    ----------
    zeros, poles
        Hz, positive in the left half plane; complex ones with their conjugates.
    """

    gain: float
    zeros: tuple[complex, ...] = ()
    poles: tuple[complex, ...] = ()

    def __mul__(self, other: Filter) -> Filter:
        return Filter(self.gain * other.gain, self.zeros + other.zeros, self.poles + other.poles)

    def at(self, frequency: complex) -> complex:
        """Evaluate the filter at one frequency, Hz."""
        result = complex(self.gain)
        for zero in self.zeros:
            result *= 1j * frequency + zero
        for pole in self.poles:
            result /= 1j * frequency + pole
        return result


@lru_cache(maxsize=256)
def parse(text: str) -> Filter:
    """Parse a Foton string.

    Raises
    ------
    FotonError
        With the column of the error.

    Examples
    --------
    >>> parse('zpk([0],[20;10+i*17.3;10-i*17.3],126,"n")').zeros
    (0j,)
    >>> round(abs(parse('zpk([],[1],10,"n")').at(1.0)), 6)
    7.071068
    """
    reader = _Reader(text)
    result = reader.factor()
    while reader.kind != "end":
        if reader.text == "*":
            reader.advance()
        result = result * reader.factor()
    if not all(map(cmath.isfinite, (result.gain, *result.zeros, *result.poles))):
        raise FotonError("a gain or root is not a finite number", "check the gains and roots")
    return result


def find_without_plane(text: str) -> list[str]:
    """List the factors `pole`, `zero`, `pole2`, `zero2` of a valid string that name no plane.

    Examples
    --------
    >>> find_without_plane('gain(2) pole(30) zero(1, "n")')
    ['pole(30)']
    """
    return re.findall(r"(?:pole|zero)2?\s*\([^()\"']*\)", text)


def format_filter(filter_: Filter, plane: str = "n") -> str:
    """Write a filter as a Foton string, to all digits.

    Examples
    --------
    >>> format_filter(Filter(2.0, (0.0,), (4.0,)))
    'zpk([0],[4],0.5,"n")'
    """
    size = len(filter_.zeros) - len(filter_.poles)
    if plane == "n":
        unit = 1.0
        gain = filter_.gain * _normal(filter_.zeros) / _normal(filter_.poles)
    else:
        unit = -1.0 if plane == "f" else -2 * math.pi
        gain = filter_.gain * (2 * math.pi) ** -size
    zeros, poles = (
        ";".join(_write_root(unit * root) for root in roots)
        for roots in (filter_.zeros, filter_.poles)
    )
    return f'zpk([{zeros}],[{poles}],{_write(gain)},"{plane}")'


def _normal(roots: tuple[complex, ...]) -> float:
    """Product of the roots that are not 0: factor between (i f + r) and (1 + i f / r)."""
    return complex(math.prod(root or 1.0 for root in roots)).real


def _write(value: float) -> str:
    text = repr(float(value) + 0.0)  # no negative zero
    return text.removesuffix(".0")


def _write_root(root: complex) -> str:
    root = complex(root)
    if root.imag == 0:
        return _write(root.real)
    return f"{_write(root.real)}{'-' if root.imag < 0 else '+'}i*{_write(abs(root.imag))}"


class _Reader:
    """Recursive-descent parser of a string, with its next token: kind, text and column from 0."""

    def __init__(self, text: str) -> None:
        self._tokens = self._split(text)
        self.advance()
        if self.kind == "end":
            self._fail(0, "is empty")

    def _split(self, text: str) -> Iterator[tuple[str, str, int]]:
        place, end = 0, len(text.rstrip())
        while place < end:
            found = TOKEN.match(text, place)
            if not found:
                place = end - len(text[place:end].lstrip())
                self._fail(place, f"{text[place]!r} is not understood")
            kind, place = str(found.lastgroup), found.end()
            yield kind, found[kind], found.start(kind)
        yield "end", "", end

    def advance(self) -> str:
        """Pass over the next token, and return its text."""
        before = getattr(self, "text", "")
        self.kind, self.text, self.column = next(self._tokens)
        return before

    def _take(self, wanted: str) -> None:
        if self.text != wanted:
            self._expected(f'"{wanted}"')
        self.advance()

    def _fail(self, column: int, problem: str, remedy: str = "") -> NoReturn:
        raise FotonError(
            f"column {column + 1}: {problem}",
            remedy or 'write for example zpk([0],[20;10+i*17.3;10-i*17.3],126,"n")',
        )

    def _expected(self, what: str) -> NoReturn:
        found = "the end" if self.kind == "end" else self.text
        self._fail(self.column, f"{what} expected, found {found}")

    def factor(self) -> Filter:
        """Read one factor."""
        if self.kind != "name":
            self._expected("a factor")
        name, column = self.text, self.column
        if name not in MINIMUM:
            problem = f"{name} is not known here ({', '.join(MINIMUM)})"
            self._fail(column, problem, "have Foton write the filter as zeros, poles and gain")
        self.advance()
        self._take("(")
        arguments: list[tuple[object, int]] = []
        while self.text != ")":
            if arguments:
                self._take(",")
            start = self.column
            arguments.append((self._argument(), start))
        self.advance()
        try:
            return self._make(name, column, arguments)
        except (OverflowError, ZeroDivisionError):
            problem = f"{name} has numbers too large or too small to compute with"
            self._fail(column, problem, "check its frequencies, Q and gain")

    def _argument(self) -> object:
        if self.kind == "text":
            return self.advance()[1:-1]
        if self.text != "[":
            return self._complex()
        self.advance()
        roots: list[tuple[complex, int]] = []
        while self.text != "]":
            if roots:
                if self.text not in (",", ";"):
                    self._expected('";" or "]"')
                self.advance()
            column = self.column
            roots.append((self._complex(), column))
        self.advance()
        return roots

    def _complex(self) -> complex:
        """Read a complex number: 1, -i*2, 1+i*2, 1+2*i, 1-2i."""
        sign = -1.0 if self.text in ("+", "-") and self.advance() == "-" else 1.0
        total = sign * self._term()
        while self.text in ("+", "-"):
            sign = -1.0 if self.advance() == "-" else 1.0
            total += sign * self._term()
        if not cmath.isfinite(total):
            self._fail(self.column, "the number before is too large", "write a smaller one")
        return total

    def _term(self) -> complex:
        value, units = 1.0 + 0j, 0
        while True:
            if self.kind == "number":
                value *= float(self.advance())
            elif self.text in ("i", "j"):
                self.advance()
                value, units = value * 1j, units + 1
            else:
                self._expected("a number")
            if self.text == "*":
                self.advance()
            elif self.text not in ("i", "j") or units:
                return value

    def _make(self, name: str, column: int, given: list[tuple[object, int]]) -> Filter:
        plane = "scalar" if name == "gain" else "s"
        if given and isinstance(given[-1][0], str):
            plane, at = str(given[-1][0]), given.pop()[1]
            allowed = ("scalar", "dB") if name == "gain" else tuple(SIDE)
            if plane not in allowed:
                known = " or ".join(f'"{one}"' for one in allowed)
                self._fail(at, f'"{plane}" is not known', f"write {known}")
        least = MINIMUM[name]
        most = least + (name not in ("zpk", "gain"))
        if not least <= len(given) <= most:
            count = f"{least}" if least == most else f"{least} or {most}"
            self._fail(column, f"{name} takes {count} numbers, found {len(given)}")
        if name == "zpk":
            zeros, poles = (self._roots(*one) for one in given[:2])
            made = _normalise(self._number(*given[2]), zeros, poles, plane)
            for pole in made.poles:
                if pole.real < 0:
                    where = f"at {_write_root(-pole)} Hz is in the right half plane"
                    remedy = f'in plane "{plane}" stable poles have {SIDE[plane]} real parts'
                    self._fail(given[1][1], f"a pole {where} and grows", remedy)
            return made
        numbers = [self._number(*one) for one in given]
        if name == "gain":
            return Filter(10 ** (numbers[0] / 20) if plane == "dB" else numbers[0])
        extra = numbers[least] if len(numbers) > least else 1.0
        if numbers[0] < 0:
            self._fail(given[0][1], f"the frequency of {name} is negative", "give it positive")
        roots: tuple[complex, ...] = (complex(numbers[0]),)
        if name not in ("pole", "zero"):
            f0, q = numbers[:2]
            if not q > 0 or f0 == 0:
                self._fail(column, f"{name} takes a positive frequency and Q", "correct them")
            # f0^2 - f^2 + i f f0 / Q = (i f + r1) (i f + r2), r1 + r2 = f0 / Q, r1 r2 = f0^2
            half, root = f0 / (2 * q), f0 * cmath.sqrt(1 / (4 * q * q) - 1)
            roots = (half + root, half - root)
        if plane != "n":  # `pole` and `zero` have positive frequencies in every plane
            roots = tuple(-root for root in roots)
        is_pole = name.startswith("pole")
        return _normalise(extra, () if is_pole else roots, roots if is_pole else (), plane)

    def _number(self, value: object, column: int) -> float:
        if not isinstance(value, complex) or value.imag:
            self._fail(column, "a real number expected")
        return value.real

    def _roots(self, value: object, column: int) -> tuple[complex, ...]:
        """Check the roots of a vector: complex ones come in conjugate pairs."""
        if isinstance(value, complex):  # Foton takes one root without brackets
            value = [(value, column)]
        if not isinstance(value, list):
            self._fail(column, "a vector of roots expected", "write [0.1;0.2], or [] for none")
        left: list[tuple[complex, int]] = list(value)
        result: list[complex] = []
        while left:
            root, at = left.pop(0)
            if root.imag == 0:
                result.append(root)
                continue
            distance = [abs(other - root.conjugate()) for other, _ in left]
            if not distance or min(distance) > PAIRED * abs(root):
                problem = f"the complex root {_write_root(root)} has no conjugate"
                self._fail(at, problem, f"add {_write_root(root.conjugate())}")
            left.pop(distance.index(min(distance)))
            result += [root, root.conjugate()]
        return tuple(result)


def _normalise(
    gain: float, zeros: tuple[complex, ...], poles: tuple[complex, ...], plane: str
) -> Filter:
    """Convert roots and gain of a plane to those of `Filter`."""
    if plane == "n":
        return Filter(gain * _normal(poles) / _normal(zeros), zeros, poles)
    if plane == "f":
        zeros, poles = (tuple(-root for root in roots) for roots in (zeros, poles))
    else:
        zeros, poles = (tuple(-root / (2 * math.pi) for root in roots) for roots in (zeros, poles))
    return Filter(gain * (2 * math.pi) ** (len(zeros) - len(poles)), zeros, poles)
