"""Read and write filters as design strings of Foton, the filter editor of LIGO and KAGRA.

A string is a product of numbers and factors, in sequence or joined by ``*``:

    zpk([z1;z2],[p1;p2],k,"n")   pole(f,"n")   zero(f,"n")   gain(k)   gain(3,"dB")
    pole2(f,Q,"n")   zero2(f,Q,"n")   rpoly([a1;a0],[b1;b0],k)   /. setgain(f,k)
    butter("LowPass",n,f)   cheby1(TYPE,n,dB,f)   cheby2(TYPE,n,dB,f)   ellip(TYPE,n,dB,dB,f)
    notch(f,Q,dB)   resgain(f,Q,dB)   comb(f,Q,dB,n)
    sos(g,[a1;a2;b1;b2],"o")   biquad(b0,b1,b2,a1,a2)   zroots([z],[p],k)   direct([b0;b1],[a1])

The last line is in z, for digital filters. `setgain` sets |H| of all before it at a frequency. The
last argument of the first factors is the plane, by default ``"s"``. With w = 2 pi f0 and s = 2 pi i
f (documentation of `FilterDesign` in LIGO's Global Diagnostics System):

- ``"s"``: roots r of `zpk` in rad/s, factors s - r, so real parts are negative in the left half
  plane. `pole` and `zero` take the positive frequency w of a factor s + w.
- ``"f"``: the same with 2 pi r for roots r in Hz.
- ``"n"``: roots r in Hz, factors 1 + i f / r, and i f where r = 0. Real parts are *positive* in the
  left half plane.

These names, types and planes may be in upper case, a list may end in ``;``, and an argument that is
empty is an empty list, or nothing.

**What Foton makes of a string** is measured: the filter files of front ends contain strings beside
the coefficients that Foton made of them (`tests/data/foton-cases.json`).

- A root r != 0 of plane ``"n"`` is divided by its modulus, (r + i f) / abs(r). So each real zero in
  the right half plane turns the sign.
- An odd excess of zeros over poles in one `zpk` of plane ``"n"`` turns the sign, too.
- With d in dB, D = 10^(abs(d) / 20) and q = (Q / 2) (8 Q^2 - 2) / (8 Q^2 - 1) sqrt(1 - 2 / D^2), a
  notch has the poles of s^2 + w s / q + w^2 and the zeros of s^2 + w s / (q D) + w^2; a `resgain`
  is its inverse. That is, with y(f) = abs(f / f0 - f0 / f), a notch is down by 3.01 dB (to
  1 / sqrt(2)) where y = y(f0 - f0 / 2 Q) + y(f0 + f0 / 2 Q), which is at f0 (1 +- 1 / Q) if Q is
  large. With D^2 <= 2 it never is. A `comb` is a series of either.

A digital filter is a function of z = exp(s / rate), or of w = 2 rate (z - 1) / (z + 1) =
2 rate tanh(s / (2 rate)), near s at low frequencies. In w it has zeros and poles like a continuous
filter. With a rate, `parse` makes what Foton makes:

- Each root of `zpk`, `rpoly`, `pole`, ... moves to abs(w) = 2 rate tan(abs(s) / (2 rate)), and
  factors keep the gain of plane ``"n"``. An excess of zeros gets poles at abs(s) = 2 rate, which is
  at 1 / pi of the rate: pairs of Q = 1 / sqrt(2), and a real pole if it is odd (cases have an
  excess of 1, 2 and 4).
- `notch`, `resgain` and `comb` keep q, and the frequency moves.
- `butter`, `cheby1`, `cheby2` and `ellip` are designed for edges that move, like those of scipy.

Without a rate nothing moves and no pole is added: the string means the filter that Foton's digital
one approaches at low frequencies, with the same sign.
"""

from __future__ import annotations

import cmath
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import zip_longest
from typing import Any

PAIRED = 1e-9
"""Relative distance within which two complex roots are conjugates."""
SIDE = {"s": "negative", "f": "negative", "n": "positive"}
"""Sign of the real part of a root of `zpk` in the left half plane, per plane."""
FACTOR = re.compile(
    r"\s*+(?P<times>\*|/\.)?\s*+(?:(?P<number>[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)"
    r"|(?P<name>[A-Za-z_]\w*+)\s*+"
    r"\((?P<arguments>(?:[^()\"']|\"[^\"]*\"|'[^']*')*+)\))"
)
EXAMPLE = 'write for example zpk([0],[20;10+i*17.3;10-i*17.3],126,"n")'
TYPES = ("LowPass", "HighPass", "BandPass", "BandStop")
MOST = 100
"""Highest order of a design, and most harmonics of a comb."""
MOST_ROOTS = 1000
"""Most zeros and poles of a filter; front ends have up to 200 of each."""
OUTSIDE = 1e-12
"""Distance beyond the unit circle that may be a rounding error of a coefficient."""

Roots = Sequence[complex]


class FotonError(ValueError):
    """Error in a Foton string: what is wrong, with its column, and what to do."""

    def __init__(self, problem: str, remedy: str) -> None:
        super().__init__(f"{problem}; {remedy}")
        self.problem = problem
        self.remedy = remedy


@dataclass(frozen=True)
class Filter:
    """Filter H(f) = gain times the product of (i f + z) divided by that of (i f + p), f in Hz."""

    gain: float
    zeros: tuple[complex, ...] = ()  # Hz, positive in the left half plane, with their conjugates
    poles: tuple[complex, ...] = ()
    rate: float = 0.0  # sample rate of a digital filter, Hz, with w / 2 pi in place of i f
    others: tuple[Filter, ...] = ()  # filters of other rates in series

    def __mul__(self, other: Filter) -> Filter:
        if other.rate != self.rate and (other.zeros or other.poles or other.others):
            return replace(self, others=(*self.others, *other.parts))
        whole = self.gain * other.gain, self.zeros + other.zeros, self.poles + other.poles
        return Filter(*whole, self.rate, self.others + other.others)

    @property
    def parts(self) -> tuple[Filter, ...]:
        """Factors of one rate each."""
        return replace(self, others=()), *self.others

    @property
    def continuous(self) -> Filter:
        """The filter with s for w: features at a frequency f appear (pi f / rate)^2 / 3 higher."""
        return math.prod((replace(one, rate=0.0) for one in self.parts), start=Filter(1.0))

    @property
    def period(self) -> float:
        """Longest sampling period, s; 0 of a continuous filter."""
        return max(1 / one.rate if one.rate else 0.0 for one in self.parts)

    def at(self, frequency: Any) -> Any:
        """Evaluate the filter at frequencies in Hz; a digital one is 0 above half its rate."""
        import numpy as np

        step, _ = warp(2j * math.pi * frequency, self.rate)
        result = complex(self.gain)
        for zero, pole in zip_longest(self.zeros, self.poles):  # in turn, against overflow
            result = result if zero is None else result * (step / (2 * math.pi) + zero)
            result = result if pole is None else result / (step / (2 * math.pi) + pole)
        if self.rate:
            result = np.where(np.abs(frequency) <= self.rate / 2, result, 0.0)
        for other in self.others:
            result = result * other.at(frequency)
        return result


def warp(s: Any, rate: float) -> tuple[Any, Any]:
    """Compute w = 2 rate tanh(s / (2 rate)) and its derivative; s and 1 without a rate."""
    import numpy as np

    if not rate:
        return s, 1.0
    ratio = np.tanh(s / (2 * rate))
    return 2 * rate * ratio, 1 - ratio**2


def change_rate(made: Filter, rate: float) -> Filter:
    """Make a continuous filter digital as Foton does, or with the rate 0 a digital one continuous.

    Raises `FotonError` for roots at or above half the rate.
    """
    of = rate or made.rate

    def move(root: complex) -> complex:
        size = abs(root)
        moved = (
            move_frequency(size, rate) if rate else of / math.pi * math.atan(math.pi * size / of)
        )
        return root * (moved / size) if size else root

    zeros, poles = (tuple(map(move, roots)) for roots in (made.zeros, made.poles))
    gain = made.gain * product(made.zeros) / product(made.poles)
    return replace(normalised(gain, zeros, poles), rate=rate)


def move_frequency(frequency: float, rate: float) -> float:
    """Compute abs(w) / 2 pi of a digital filter at a frequency in Hz; the same without a rate.

    Raises `FotonError` at or above half the rate.
    """
    if not rate:
        return frequency
    angle = math.pi * frequency / rate
    if not angle < math.pi / 2:
        problem = f"has a frequency of {frequency:g} Hz, above half the sample rate of {rate:g} Hz"
        raise FotonError(problem, "give a higher rate, or leave it out")
    return rate / math.pi * math.tan(angle)


def normalised(gain: float, zeros: tuple[complex, ...], poles: tuple[complex, ...]) -> Filter:
    """Make a filter of factors (r + i f) / abs(r), and i f for roots 0."""
    return Filter(gain * product(poles) / product(zeros), zeros, poles)


def product(roots: tuple[complex, ...]) -> float:
    """Product of the moduli of the roots that are not 0."""
    return math.prod(abs(root) for root in roots if root)


def sign_of_excess(zeros: Roots, poles: Roots) -> int:
    """Sign that Foton gives a `zpk` of plane "n" for its excess of zeros over poles."""
    excess = max(len(zeros) - len(poles), 0)
    return -1 if excess % 2 else 1


def _roll_off(excess: int, rate: float) -> tuple[complex, ...]:
    """Poles in Hz that Foton adds to a digital `zpk` for its excess of zeros over poles."""
    pair = _pair(rate / math.pi, math.sqrt(0.5))
    single = (complex(rate / math.pi),)
    return pair * (excess // 2) + single * (excess % 2)


def format_filter(filter_: Filter) -> str:
    """Write a filter as a Foton string in plane "n" (of digital ones the design), to all digits.

    >>> format_filter(Filter(2.0, (0.0,), (4.0,)))
    'zpk([0],[4],0.5,"n")'
    >>> format_filter(Filter(2.0, (-3.0,), (4.0,)))  # (i f - 3) / 3 is positive at high frequencies
    'zpk([-3],[4],1.5,"n")'
    """
    filter_ = change_rate(filter_, 0.0) if filter_.rate else filter_
    gain = filter_.gain * product(filter_.zeros) / product(filter_.poles)
    gain *= sign_of_excess(filter_.zeros, filter_.poles)
    zeros, poles = (";".join(map(_write, some)) for some in (filter_.zeros, filter_.poles))
    return f'zpk([{zeros}],[{poles}],{_write(gain)},"n")'


def _write(root: complex) -> str:
    real, imaginary = (
        repr(float(part) + 0.0).removesuffix(".0")  # no negative zero
        for part in (root.real, abs(root.imag))
    )
    if not root.imag:
        return real
    sign = "-" if root.imag < 0 else "+"
    return f"{real}{sign}i*{imaginary}"


@lru_cache(maxsize=256)
def parse(text: str, rate: float = 0.0) -> Filter:
    """Parse a Foton string; with a sample rate in Hz the filter is digital.

    Raises `FotonError` with the column of the factor at fault.

    >>> parse('zpk([0],[20;10+i*17.3;10-i*17.3],126,"n")').zeros
    (0j,)
    >>> round(abs(parse('zpk([],[1],10,"n")').at(1.0)), 6)
    7.071068
    """
    result = Filter(1.0, rate=rate)
    place = 0
    end = len(text.rstrip("; \t\r\n"))
    while place < end or not end:
        found = FACTOR.match(text, place, end)
        if found is None or (place == 0 and found["times"]):
            rest = text[place:end].strip()
            what = f"{rest[:20]!r} is not understood" if rest else "is empty"
            raise FotonError(f"column {end - len(rest) + 1}: {what}", EXAMPLE)
        name = (found["name"] or "gain").lower()
        arguments = found["arguments"] or found["number"] or ""
        where = f"column {found.start('name' if found['name'] else 'number') + 1}: {name}"
        try:
            result = _add(result, name, arguments)
            _check_count(len(result.zeros) + len(result.poles))
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

    >>> find_without_plane('gain(2) pole(30) zero(1, "n")')
    ['pole(30)']
    """
    return re.findall(r"(?:pole|zero)2?\s*\([^()\"']*\)", text, re.IGNORECASE)


def find_turned(text: str) -> list[str]:
    """List the factors `zpk` of a valid string whose sign is the opposite of prod(1 + i f / z).

    >>> find_turned('zpk([0],[],5,"n") zpk([0],[3],5,"n") zpk([-2],[3],5,"n") gain(-1)')
    ['zpk([0],[],5,"n")', 'zpk([-2],[3],5,"n")']
    """
    result = []
    for found in re.finditer(r"zpk\s*\([^()]*\)", text, re.IGNORECASE):
        zeros, poles, _, *plane = _read_arguments(found[0].partition("(")[2][:-1], 3, PLANES)
        behind = sum(not root.imag and root.real < 0 for root in _pair_roots(zeros))
        turned = sign_of_excess(_pair_roots(zeros), _pair_roots(poles)) * (-1) ** behind
        if plane == ["n"] and turned < 0:
            result.append(found[0])
    return result


def _add(made: Filter, name: str, arguments: str) -> Filter:
    """Append the filter of one factor with its arguments."""
    if name not in FACTORS:
        remedy = "have Foton write the filter as zeros, poles and gain"
        raise FotonError(f"is not known here ({', '.join(FACTORS)})", remedy)
    least, most, make, planes = FACTORS[name]
    given = _read_arguments(arguments, most, planes)
    plane = planes[0] if planes else "s"
    if planes and given and isinstance(given[-1], str):
        plane = given.pop()
        if plane not in planes:
            known = " or ".join(f'"{one}"' for one in planes)
            raise FotonError(f'has no plane "{plane}"', f"write {known}")
    if not least <= len(given) <= most:
        count = f"{least}" if least == most else f"{least} or {most}"
        raise FotonError(f"takes {count} numbers, found {len(given)}", EXAMPLE)
    return make(made, name, plane, *given)


def _read_arguments(text: str, most: int, planes: tuple[str, ...]) -> list[Any]:
    """Read the arguments of a factor: up to `most`, then one of the texts `planes`.

    Arguments without text are left out if there are more, else they are empty lists.
    """
    parts = [one.strip() for one in _split(text)] if text.strip() else []
    last = _read(parts[-1]) if parts and parts[-1] else None
    if planes and isinstance(last, str):
        most += 1
    if len(parts) > most:
        parts = [one for one in parts if one]
    given = [_read(one) if one else [] for one in parts]
    if planes and isinstance(last, str):
        given[-1] = {one.lower(): one for one in planes}.get(last.lower(), last)
    return given


def _split(arguments: str) -> list[str]:
    """Split arguments at the commas outside brackets."""
    parts = [""]
    for piece in re.findall(r"\[[^\]]*\]?|,|[^,\[]+", arguments):
        if piece == ",":
            parts.append("")
        else:
            parts[-1] += piece
    return parts


def _read(text: str) -> Any:
    """Read an argument: a string, a list of roots, or a number (1, -i*2, 1+i*2, 1+2*i, 1-2i)."""
    if quoted := re.fullmatch(r"([\"'])(.*)\1", text):
        return quoted[2]
    if vector := re.fullmatch(r"\[([^\[\]]*)\]", text):
        roots = re.split("[;,]", vector[1])
        _check_count(len(roots))
        return [_read(root) for root in roots if root.strip()]
    plain = re.sub(r"\s", "", text).lower().replace("i", "j")
    plain = re.sub(r"j\*([\d.]+(?:e[+-]?\d+)?)", r"\1j", plain).replace("*j", "j")
    try:
        number = complex(plain)
    except ValueError:
        problem = f"has {text.strip()[:20]!r} instead of a number, a vector of roots or a plane"
        raise FotonError(problem, EXAMPLE) from None
    if not cmath.isfinite(number):
        raise FotonError(f"has a number that is too large ({text})", "write a smaller one")
    return number


def _check_count(count: int) -> None:
    """Raise `FotonError` for more roots than a filter has, which would take long to pair."""
    if count > MOST_ROOTS:
        remedy = f"give up to {MOST_ROOTS}; a front end takes 200"
        raise FotonError(f"has {count} zeros and poles", remedy)


def _reals(*value: Any) -> list[float]:
    """Check numbers, or those of a vector, which are real."""
    numbers = value[0] if len(value) == 1 and isinstance(value[0], list) else value
    if any(not isinstance(one, (complex, float)) or one.imag for one in numbers):
        raise FotonError("takes real numbers here", EXAMPLE)
    return [one.real for one in numbers]


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
                problem = f"has no conjugate of the complex root {_write(root)}"
                raise FotonError(problem, f"add {_write(root.conjugate())}")
            left.remove(near)
            result.append(root.conjugate())
    return tuple(result)


# Factors in s: each is appended to `made`, with its name, its plane and its arguments.


def _append(
    made: Filter, gain: float, zeros: tuple[complex, ...], poles: tuple[complex, ...], plane: str
) -> Filter:
    """Append gain and roots of a plane, positive in the left half plane."""
    excess = len(zeros) - len(poles)
    if made.rate and excess > 0:
        problem = "has more zeros than poles, which Foton's files show of zpk in plane n alone"
        remedy = 'write zeros and poles of a digital filter together: zpk([2],[30],1,"n")'
        raise FotonError(problem, remedy)
    if plane == "n":
        whole = normalised(gain, zeros, poles)
    else:
        unit = 2 * math.pi if plane == "s" else 1.0
        zeros, poles = (tuple(root / unit for root in roots) for roots in (zeros, poles))
        whole = Filter(gain * (2 * math.pi) ** excess, zeros, poles)
    return made * (change_rate(whole, made.rate) if made.rate else whole)


def _gain(made: Filter, name: str, unit: str, *numbers: Any) -> Filter:
    """Multiply the filter, or set its magnitude at a frequency in Hz."""
    import numpy as np

    *at, gain = _reals(*numbers)
    gain = 10 ** (gain / 20) if unit == "dB" else gain
    if name == "setgain":
        with np.errstate(all="ignore"):
            size = float(abs(made.at(np.array(at))[0]))
        if not 0 < size < math.inf:
            raise FotonError("sets a gain where the filter is 0 or infinite", "name another place")
        gain /= size
    return replace(made, gain=made.gain * gain)


def _zpk(made: Filter, name: str, plane: str, zeros: Any, poles: Any, gain: Any) -> Filter:
    del name
    (gain,) = _reals(gain)
    side = 1 if plane == "n" else -1  # `pole` and `zero` have positive frequencies in every plane
    zeros, poles = (tuple(side * root for root in _pair_roots(some)) for some in (zeros, poles))
    for pole in poles:
        if pole.real < 0:
            hertz = -pole / (2 * math.pi) if plane == "s" else -pole
            problem = f"has a pole at {_write(hertz)} Hz in the right half plane, which grows"
            remedy = f'in plane "{plane}" stable poles have {SIDE[plane]} real parts'
            raise FotonError(problem, remedy)
    if plane == "n":
        gain *= sign_of_excess(zeros, poles)
        if made.rate:
            poles += _roll_off(max(len(zeros) - len(poles), 0), made.rate)
    return _append(made, gain, zeros, poles, plane)


def _roots(made: Filter, name: str, plane: str, *numbers: Any) -> Filter:
    """One pole or zero, or a pair with a Q."""
    f0, *others = _reals(*numbers)
    roots = _pair(f0, others.pop(0)) if name.endswith("2") else (complex(f0),)
    if f0 < 0:
        raise FotonError("takes a positive frequency and Q", "correct them")
    both = ((), roots) if name.startswith("pole") else (roots, ())
    return _append(made, sum(others) if others else 1.0, *both, plane)


def _pair(f0: float, q: float) -> tuple[complex, complex]:
    """Roots r of f0^2 - f^2 + i f f0 / Q = (i f + r1) (i f + r2)."""
    if not (f0 > 0 and q > 0):
        raise FotonError("takes a positive frequency and Q", "correct them")
    half = f0 / (2 * q)
    root = f0 * cmath.sqrt(1 / (4 * q * q) - 1)
    return half + root, half - root


def _peaks(made: Filter, name: str, plane: str, *numbers: Any) -> Filter:
    """A notch, a resonant gain, or a comb, with peaks where its height is positive."""
    del plane
    f0, q, height, count = [*_reals(*numbers), *[0.0, 0.0][len(numbers) - 2 :]]
    harmonics = range(1, int(count) + 1) if name == "comb" else range(1, 2)
    if not (f0 > 0 and q > 0.5):
        raise FotonError("takes a positive frequency and a Q above 0.5", "correct them")
    if not 10 ** (abs(height) / 20) > math.sqrt(2):
        kind = "depth" if name == "notch" else "height"
        problem = f"has a {kind} of {height:g} dB, but its width is where its gain has changed by"
        remedy = f"give a {kind} above 3.01 dB, like 40: {name}(60,30,40)"
        raise FotonError(f"{problem} 3.01 dB", remedy)
    if count != int(count) or not 1 <= len(harmonics) <= MOST:
        remedy = f"give frequency (Hz), Q, height (dB) and 1 to {MOST}: comb(60,30,-40,4)"
        raise FotonError("has no number of harmonics", remedy)
    poles = list[complex]()
    zeros = list[complex]()
    sharp = _pole_q(q, height)
    flat = sharp * 10 ** (abs(height) / 20)
    for n in harmonics:
        place = move_frequency(n * f0, made.rate)
        poles += _pair(place, sharp)
        zeros += _pair(place, flat)
    if name == "resgain" or (name == "comb" and height > 0):
        poles, zeros = zeros, poles
    return made * replace(normalised(1.0, tuple(zeros), tuple(poles)), rate=made.rate)


def _pole_q(q: float, height: float) -> float:
    """Q of the poles of a notch from that of Foton, and its depth in dB."""
    squared = 8 * q * q
    return q / 2 * (squared - 2) / (squared - 1) * math.sqrt(1 - 2 / 10 ** (abs(height) / 10))


def _prototype(made: Filter, name: str, plane: str, kind: Any, *numbers: Any) -> Filter:
    """A design of scipy: `butter`, `cheby1`, `cheby2` or `ellip`."""
    del plane
    count = 1 + RIPPLES[name]
    given = _reals(*numbers)
    shape = kind.lower() if isinstance(kind, str) else ""
    order = int(given[0]) if given else 0
    edges = given[count:]
    known = [one.lower() for one in TYPES]
    if shape not in known or not 1 <= order <= MOST or len(edges) != 1 + shape.startswith("band"):
        problem = f"takes a type, an order up to {MOST}, {count - 1} ripples (dB), band edges (Hz)"
        remedy = f'write {", ".join(TYPES)} as in ellip("BandPass",4,1,40,10,20)'
        raise FotonError(problem, remedy)
    moved = [2 * math.pi * move_frequency(edge, made.rate) for edge in edges]
    zeros, poles, gain = _design(name, order, *given[1:count], band=moved, shape=shape)
    whole = _zpk(Filter(1.0), name, "s", zeros, poles, gain)
    return made * replace(whole, rate=made.rate)


def _design(
    name: str, order: int, *ripples: float, band: list[float], shape: str
) -> tuple[list[complex], list[complex], float]:
    """Design a continuous filter with the edges `band` (rad/s) by scipy."""
    import numpy as np
    from scipy import signal

    edges = band if len(band) > 1 else band[0]
    try:
        with np.errstate(all="ignore"):
            found = getattr(signal, name)(order, *ripples, edges, shape, True, "zpk")
    except ValueError as error:
        raise FotonError(f"cannot be designed: {error}", "correct it") from None
    return found[0].tolist(), found[1].tolist(), float(found[2])


def _rpoly(made: Filter, name: str, plane: str, above: Any, below: Any, gain: Any) -> Filter:
    """A ratio of polynomials in s, highest power first."""
    from scipy.signal import tf2zpk

    above = _reals(above)
    below = _reals(below)
    if not any(above) or not any(below):
        raise FotonError("has a polynomial that is 0", "correct it")
    zeros, poles, leading = tf2zpk(above, below)
    whole = float(leading) * _reals(gain)[0]
    return _zpk(made, name, plane, zeros.tolist(), poles.tolist(), whole)


# Factors in z: a gain, and numbers 1 - z0 of zeros and poles z0, as many of each.


def _zroots(zeros: Any, poles: Any, gain: Any = 1.0) -> tuple[float, Roots, Roots]:
    zeros = _pair_roots(zeros)
    poles = _pair_roots(poles)
    if len(zeros) != len(poles):
        problem = f"has {len(zeros)} zeros and {len(poles)} poles"
        raise FotonError(problem, "give as many of each, with roots 0 for delays")
    return _reals(gain)[0], [1 - zero for zero in zeros], [1 - pole for pole in poles]


def _direct(above: Any, below: Any) -> tuple[float, Roots, Roots]:
    """The sum of b_k/z^k, over 1 less that of a_k/z^k from k = 1."""
    import numpy as np

    above = _reals(above)
    below = _reals(below)
    size = max(len(above), len(below) + 1)
    rows = ([*row, *[0.0] * (size - len(row))] for row in (above, [1.0, *(-a for a in below)]))
    zeros, poles = (1 - np.roots(row) for row in rows)
    return above[0], zeros.tolist(), poles.tolist()


def _biquad(*numbers: Any) -> tuple[float, Roots, Roots]:
    b0, b1, b2, a1, a2 = _reals(*numbers)
    return b0, _quadratic(b1 / b0, b2 / b0), _quadratic(a1, a2)


def _sos(first: Any, others: Any = None, order: str = "s") -> tuple[float, Roots, Roots]:
    """Second-order sections: a gain, then b1, b2, a1, a2; or a1, a2, b1, b2 ("o")."""
    gain, *numbers = [*_reals(first), *_reals(others or [])]
    if len(numbers) % 4:
        problem = f"has {len(numbers)} numbers beside the gain, instead of 4 for each section"
        raise FotonError(problem, 'write sos(gain,[a1;a2;b1;b2;...],"o")')
    found: list[list[complex]] = [[], []]
    for n in range(0, len(numbers), 2):
        found[(n // 2 + (order == "o")) % 2] += _quadratic(*numbers[n : n + 2])
    return gain, found[0], found[1]


def _quadratic(first: float, second: float) -> list[complex]:
    """Numbers 1 - z0 of the roots z0 of 1 + first/z + second/z^2, which keep their digits."""
    if second == 0:
        return [1 + first, 1.0]
    half = (2 + first) / 2
    product = math.fsum((1.0, first, second))
    root = cmath.sqrt(half * half - product)
    if root.imag:
        return [half + root, (half + root).conjugate()]
    # the root without cancellation; the other one from the product of both
    large = half + (root if half >= 0 else -root)
    small = product / large if large else 0.0
    return [large, small]


def _in_z(made: Filter, name: str, order: str, *given: Any) -> Filter:
    """Append gain prod(1 - z0/z) / prod(1 - p/z), with zeros and poles in w. As z is
    (1 + w / 2 rate) / (1 - w / 2 rate), 1 - z0/z is

        (1 + z0) / (2 rate) (w + 2 rate (1 - z0) / (1 + z0)) / (1 + w / 2 rate).
    """
    if not (rate := made.rate):
        remedy = 'write filter = { design = "...", rate = 16384.0 }'
        raise FotonError("is in z, which needs a sample rate", remedy)
    make = {"sos": _sos, "biquad": _biquad, "zroots": _zroots, "direct": _direct}[name]
    gain, zeros, poles = make(*given, **({"order": order} if name == "sos" else {}))
    delays = min(zeros.count(1.0), poles.count(1.0))  # z0 = 0, which cancel
    found: list[tuple[complex, ...]] = []
    for sign, roots in ((1, zeros), (-1, poles)):
        kept = sorted(roots, key=lambda root: root != 1.0)[delays:]
        # the others are at half the rate
        inside = [root for root in kept if abs(root - 2) > OUTSIDE]
        if sign < 0 and (len(inside) < len(kept) or any(abs(1 - p) > 1 + OUTSIDE for p in kept)):
            problem = "has a pole outside the unit circle, which grows, or at half the sample rate"
            raise FotonError(problem, "check the signs and the order of the coefficients")
        size = math.prod((2 - root) * math.pi / rate for root in inside)
        gain *= (complex(size).real * 2.0 ** (len(kept) - len(inside))) ** sign
        found.append(tuple(rate / math.pi * root / (2 - root) for root in inside))
    return made * Filter(gain, found[0], found[1], rate)


RIPPLES = {"butter": 0, "cheby1": 1, "cheby2": 1, "ellip": 2}
"""Designs of scipy, with their number of ripples and attenuations, dB."""
PLANES = tuple(SIDE)
FACTORS: dict[str, tuple[int, int, Callable[..., Filter], tuple[str, ...]]] = {
    "gain": (1, 1, _gain, ("scalar", "dB")),
    "setgain": (2, 2, _gain, ()),
    "zpk": (3, 3, _zpk, PLANES),
    "pole": (1, 2, _roots, PLANES),
    "zero": (1, 2, _roots, PLANES),
    "pole2": (2, 3, _roots, PLANES),
    "zero2": (2, 3, _roots, PLANES),
    "rpoly": (3, 3, _rpoly, ()),
    "notch": (2, 3, _peaks, ()),
    "resgain": (2, 3, _peaks, ()),
    "comb": (2, 4, _peaks, ()),
    "sos": (1, 2, _in_z, ("s", "o")),
    "biquad": (5, 5, _in_z, ()),
    "zroots": (2, 3, _in_z, ()),
    "direct": (2, 2, _in_z, ()),
    **dict.fromkeys(RIPPLES, (1, 6, _prototype, ())),
}
"""Least and largest number of arguments of each factor, its function, and texts that may be its
last argument, the first by default."""
