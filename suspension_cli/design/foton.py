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

import ast
import cmath
import math
import operator
import re
import warnings
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NoReturn

PAIRED = 1e-9
"""Relative distance within which two complex roots are conjugates."""
SIDE = {"s": "negative", "f": "negative", "n": "positive"}
"""Sign of the real part of a root of `zpk` in the left half plane, per plane."""
MINIMUM = {"gain": 1, "zpk": 3, "pole": 1, "zero": 1, "pole2": 2, "zero2": 2}
"""Factors, with the number of arguments that each needs; `pole`, `zero` take a gain as well."""
FACTOR = re.compile(
    r"\s*(?P<times>\*?)\s*(?P<name>[A-Za-z_]\w*)\s*"
    r"\((?P<arguments>(?:[^()\"']|\"[^\"]*\"|'[^']*')*+)\)"
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
    result, place, end = Filter(1.0), 0, len(text.rstrip())
    while place < end or not end:
        found = FACTOR.match(text, place)
        if found is None or (place == 0 and found["times"]):
            rest = text[place:].strip()
            _fail(end - len(rest), f"{rest[:20]!r} is not understood" if rest else "is empty")
        columns = found.start("name"), found.start("arguments")
        result *= _factor(found["name"], columns[0], found["arguments"], columns[1])
        place = found.end()
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


def _factor(name: str, column: int, arguments: str, start: int) -> Filter:
    """Read one factor from its name and arguments, and their columns."""
    if name not in MINIMUM:
        problem = f"{name} is not known here ({', '.join(MINIMUM)})"
        _fail(column, problem, "have Foton write the filter as zeros, poles and gain")
    # the same text in Python, column by column
    text = re.sub(r"(?<=[\d.])[ij]\b", "j", arguments).replace(";", ",")
    try:
        with warnings.catch_warnings(action="ignore"):
            nodes = ast.parse(f"[{text}]", mode="eval").body
        assert isinstance(nodes, ast.List)
        given = [(_value(node, start), start + node.col_offset - 1) for node in nodes.elts]
        return _make(name, column, given)
    except (
        SyntaxError,
        ValueError,
        AssertionError,
        TypeError,
        RecursionError,
        MemoryError,
    ) as error:
        if isinstance(error, FotonError):
            raise
        _fail(start, f"the arguments of {name} cannot be read")
    except (OverflowError, ZeroDivisionError):
        problem = f"{name} has numbers too large or too small to compute with"
        _fail(column, problem, "check its frequencies, Q and gain")


def _value(node: ast.expr, start: int) -> Any:
    """A string, a complex number (1, -i*2, 1+i*2, 1+2*i, 1-2i), or roots with their columns."""
    place = start + node.col_offset - 1
    match node:
        case ast.Constant(value=str(text)):
            return text
        case ast.Constant(value=int() | float() | complex() as number):
            if not cmath.isfinite(number):
                _fail(place, "the number is too large", "write a smaller one")
            return complex(number)
        case ast.Name(id="i" | "j"):
            return 1j
        case ast.UnaryOp(op=ast.UAdd() | ast.USub() as sign, operand=operand):
            return complex(_value(operand, start)) * (-1 if isinstance(sign, ast.USub) else 1)
        case ast.BinOp(left=left, op=ast.Add() | ast.Sub() | ast.Mult() as sign, right=right):
            combine = {ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul}
            terms = (complex(_value(one, start)) for one in (left, right))
            return combine[type(sign)](*terms)
        case ast.List(elts=members):
            return [(_value(one, start), start + one.col_offset - 1) for one in members]
        case _:
            return _fail(place, "a number, a vector of roots or a plane expected")


def _fail(column: int, problem: str, remedy: str = "") -> NoReturn:
    raise FotonError(
        f"column {column + 1}: {problem}",
        remedy or 'write for example zpk([0],[20;10+i*17.3;10-i*17.3],126,"n")',
    )


def _make(name: str, column: int, given: list[tuple[object, int]]) -> Filter:
    plane = "scalar" if name == "gain" else "s"
    if given and isinstance(given[-1][0], str):
        plane, at = str(given[-1][0]), given.pop()[1]
        allowed = ("scalar", "dB") if name == "gain" else tuple(SIDE)
        if plane not in allowed:
            known = " or ".join(f'"{one}"' for one in allowed)
            _fail(at, f'"{plane}" is not known', f"write {known}")
    least = MINIMUM[name]
    most = least + (name not in ("zpk", "gain"))
    if not least <= len(given) <= most:
        count = f"{least}" if least == most else f"{least} or {most}"
        _fail(column, f"{name} takes {count} numbers, found {len(given)}")
    if name == "zpk":
        zeros, poles = (_roots(*one) for one in given[:2])
        made = _normalise(_number(*given[2]), zeros, poles, plane)
        for pole in made.poles:
            if pole.real < 0:
                where = f"at {_write_root(-pole)} Hz is in the right half plane"
                remedy = f'in plane "{plane}" stable poles have {SIDE[plane]} real parts'
                _fail(given[1][1], f"a pole {where} and grows", remedy)
        return made
    numbers = [_number(*one) for one in given]
    if name == "gain":
        return Filter(10 ** (numbers[0] / 20) if plane == "dB" else numbers[0])
    extra = numbers[least] if len(numbers) > least else 1.0
    if numbers[0] < 0:
        _fail(given[0][1], f"the frequency of {name} is negative", "give it positive")
    roots: tuple[complex, ...] = (complex(numbers[0]),)
    if name not in ("pole", "zero"):
        f0, q = numbers[:2]
        if not q > 0 or f0 == 0:
            _fail(column, f"{name} takes a positive frequency and Q", "correct them")
        # f0^2 - f^2 + i f f0 / Q = (i f + r1) (i f + r2), r1 + r2 = f0 / Q, r1 r2 = f0^2
        half, root = f0 / (2 * q), f0 * cmath.sqrt(1 / (4 * q * q) - 1)
        roots = (half + root, half - root)
    if plane != "n":  # `pole` and `zero` have positive frequencies in every plane
        roots = tuple(-root for root in roots)
    is_pole = name.startswith("pole")
    return _normalise(extra, () if is_pole else roots, roots if is_pole else (), plane)


def _number(value: object, column: int) -> float:
    if not isinstance(value, complex) or value.imag:
        _fail(column, "a real number expected")
    return value.real


def _roots(value: object, column: int) -> tuple[complex, ...]:
    """Check the roots of a vector: complex ones come in conjugate pairs."""
    if isinstance(value, complex):  # Foton takes one root without brackets
        value = [(value, column)]
    if not isinstance(value, list):
        _fail(column, "a vector of roots expected", "write [0.1;0.2], or [] for none")
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
            _fail(at, problem, f"add {_write_root(root.conjugate())}")
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
