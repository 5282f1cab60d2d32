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
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

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
EXAMPLE = 'write for example zpk([0],[20;10+i*17.3;10-i*17.3],126,"n")'


class FotonError(ValueError):
    """Error in a Foton string: what is wrong, with its column, and what to do."""

    def __init__(self, problem: str, remedy: str = EXAMPLE) -> None:
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

    def at(self, frequency: Any) -> Any:
        """Evaluate the filter at a frequency, or an array of frequencies, in Hz."""
        result = complex(self.gain)
        for zero in self.zeros:
            result = result * (1j * frequency + zero)
        for pole in self.poles:
            result = result / (1j * frequency + pole)
        return result


@lru_cache(maxsize=256)
def parse(text: str) -> Filter:
    """Parse a Foton string.

    Raises
    ------
    FotonError
        With the column of the factor at fault.

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
            what = f"{rest[:20]!r} is not understood" if rest else "is empty"
            raise FotonError(f"column {end - len(rest) + 1}: {what}")
        where = f"column {found.start('name') + 1}: {found['name']}"
        try:
            result *= _make(found["name"], found["arguments"])
        except FotonError as error:
            raise FotonError(f"{where} {error.problem}", error.remedy) from None
        except (OverflowError, ZeroDivisionError):
            problem = f"{where} has numbers too large or too small to compute with"
            raise FotonError(problem, "check its frequencies, Q and gain") from None
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


def format_filter(filter_: Filter) -> str:
    """Write a filter as a Foton string in plane "n", to all digits.

    Examples
    --------
    >>> format_filter(Filter(2.0, (0.0,), (4.0,)))
    'zpk([0],[4],0.5,"n")'
    """
    gain = filter_.gain * _normal(filter_.zeros) / _normal(filter_.poles)
    zeros, poles = (";".join(map(_write_root, some)) for some in (filter_.zeros, filter_.poles))
    return f'zpk([{zeros}],[{poles}],{_write(gain)},"n")'


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


def _make(name: str, arguments: str) -> Filter:
    """Make the filter of one factor from its arguments."""
    if name not in MINIMUM:
        remedy = "have Foton write the filter as zeros, poles and gain"
        raise FotonError(f"is not known here ({', '.join(MINIMUM)})", remedy)
    given = [_read(one.strip()) for one in re.split(r",(?![^\[]*\])", arguments) if arguments]
    plane, allowed = ("scalar", ("scalar", "dB")) if name == "gain" else ("s", tuple(SIDE))
    if given and isinstance(given[-1], str):
        plane = given.pop()
        if plane not in allowed:
            known = " or ".join(f'"{one}"' for one in allowed)
            raise FotonError(f'has no plane "{plane}"', f"write {known}")
    least = MINIMUM[name]
    most = least + (name not in ("zpk", "gain"))
    if not least <= len(given) <= most:
        count = f"{least}" if least == most else f"{least} or {most}"
        raise FotonError(f"takes {count} numbers, found {len(given)}")
    if name == "zpk":
        return _zpk(given[0], given[1], given[2], plane)
    numbers = [_real(one) for one in given]
    if name == "gain":
        return Filter(10 ** (numbers[0] / 20) if plane == "dB" else numbers[0])
    if numbers[0] < 0 or (name.endswith("2") and not (numbers[0] > 0 and numbers[1] > 0)):
        raise FotonError("takes a positive frequency and Q", "correct them")
    roots: tuple[complex, ...] = (complex(numbers[0]),)
    if name.endswith("2"):
        # f0^2 - f^2 + i f f0 / Q = (i f + r1) (i f + r2), r1 + r2 = f0 / Q, r1 r2 = f0^2
        f0, q = numbers[:2]
        half, root = f0 / (2 * q), f0 * cmath.sqrt(1 / (4 * q * q) - 1)
        roots = (half + root, half - root)
    extra = numbers[least] if len(numbers) > least else 1.0
    zeros, poles = ((), roots) if name.startswith("pole") else (roots, ())
    return _in_hertz(extra, zeros, poles, plane)


def _zpk(zeros: Any, poles: Any, gain: Any, plane: str) -> Filter:
    side = 1 if plane == "n" else -1  # `pole` and `zero` have positive frequencies in every plane
    zeros, poles = (tuple(side * root for root in _pair_roots(some)) for some in (zeros, poles))
    made = _in_hertz(_real(gain), zeros, poles, plane)
    for pole in made.poles:
        if pole.real < 0:
            problem = f"has a pole at {_write_root(-pole)} Hz in the right half plane, which grows"
            remedy = f'in plane "{plane}" stable poles have {SIDE[plane]} real parts'
            raise FotonError(problem, remedy)
    return made


def _read(text: str) -> Any:
    """Read an argument: a string, a list of roots, or a number (1, -i*2, 1+i*2, 1+2*i, 1-2i)."""
    if quoted := re.fullmatch(r"([\"'])(.*)\1", text):
        return quoted[2]
    if vector := re.fullmatch(r"\[([^\[\]]*)\]", text):
        return [_read(root) for root in re.split("[;,]", vector[1]) if vector[1].strip()]
    plain = re.sub(r"\s", "", text).replace("i", "j")
    plain = re.sub(r"j\*([\d.]+(?:e[+-]?\d+)?)", r"\1j", plain).replace("*j", "j")
    try:
        number = complex(plain)
    except ValueError:
        problem = f"has {text.strip()[:20]!r} instead of a number, a vector of roots or a plane"
        raise FotonError(problem) from None
    if not cmath.isfinite(number):
        raise FotonError(f"has a number that is too large ({text})", "write a smaller one")
    return number


def _real(value: Any) -> float:
    if not isinstance(value, complex) or value.imag:
        raise FotonError("takes real numbers here")
    return value.real


def _pair_roots(value: Any) -> tuple[complex, ...]:
    """Check the roots of a vector (or one alone): complex ones come in conjugate pairs."""
    if isinstance(value, str):
        raise FotonError("takes vectors of roots", "write [0.1;0.2], or [] for none")
    left: list[complex] = value if isinstance(value, list) else [value]
    result: list[complex] = []
    while left:
        root, *left = left
        result.append(root)
        if root.imag:
            near = min(left, key=lambda other: abs(other - root.conjugate()), default=root)
            if abs(near - root.conjugate()) > PAIRED * abs(root):
                problem = f"has no conjugate of the complex root {_write_root(root)}"
                raise FotonError(problem, f"add {_write_root(root.conjugate())}")
            left.remove(near)
            result.append(root.conjugate())
    return tuple(result)


def _in_hertz(
    gain: float, zeros: tuple[complex, ...], poles: tuple[complex, ...], plane: str
) -> Filter:
    """Convert the gain and the roots of a plane, positive in the left half plane."""
    if plane == "n":
        return Filter(gain * _normal(poles) / _normal(zeros), zeros, poles)
    if plane == "s":
        zeros, poles = (tuple(root / (2 * math.pi) for root in roots) for roots in (zeros, poles))
    return Filter(gain * (2 * math.pi) ** (len(zeros) - len(poles)), zeros, poles)
