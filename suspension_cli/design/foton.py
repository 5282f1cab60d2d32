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

A digital filter is a function of z = exp(s / rate), or of w = 2 rate (z - 1) / (z + 1) =
2 rate tanh(s / (2 rate)), near s at low frequencies. In w it has zeros and poles like a continuous
filter. Foton makes it of a design in s by moving each root to |w| = 2 rate tan(|s| / (2 rate)),
with the gain of plane ``"n"``, and so does `parse` if it gets a rate.
"""

from __future__ import annotations

import cmath
import math
import re
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import zip_longest
from typing import Any

from suspension_cli.design import foton_designs as designs
from suspension_cli.design.foton_designs import RIPPLES, FotonError

PAIRED = 1e-9
"""Relative distance within which two complex roots are conjugates."""
SIDE = {"s": "negative", "f": "negative", "n": "positive"}
"""Sign of the real part of a root of `zpk` in the left half plane, per plane."""
IN_Z = ("sos", "biquad", "zroots", "direct")
FORMATS = {"gain": ("scalar", "dB"), "sos": ("s", "o")}
FORMATS |= dict.fromkeys(("zpk", "pole", "zero", "pole2", "zero2"), tuple(SIDE))
"""Texts that may be the last argument of a factor, the first by default."""
COUNTS = {
    (1, 1): "gain",
    (1, 2): "pole zero sos",
    (2, 2): "direct setgain",
    (2, 3): "pole2 zero2 notch resgain zroots",
    (2, 4): "comb",
    (3, 3): "zpk rpoly",
    (5, 5): "biquad",
    (1, 6): " ".join(RIPPLES),
}
NUMBERS = {name: count for count, names in COUNTS.items() for name in names.split()}
"""Factors, with the least and largest number of their other arguments."""
FACTOR = re.compile(
    r"\s*(?P<times>\*|/\.)?\s*(?:(?P<number>[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)"
    r"|(?P<name>[A-Za-z_]\w*)\s*"
    r"\((?P<arguments>(?:[^()\"']|\"[^\"]*\"|'[^']*')*+)\))"
)
EXAMPLE = 'write for example zpk([0],[20;10+i*17.3;10-i*17.3],126,"n")'


@dataclass(frozen=True)
class Filter:
    """Filter H(f) = gain times the product of (i f + z) divided by that of (i f + p), f in Hz.

    Attributes
    ----------
    zeros, poles
        Hz, positive in the left half plane; complex ones with their conjugates.
    rate
        Of a digital filter the sample rate in Hz, with w / 2 pi (see the module) in place of i f.
    others
        Filters of other rates in series.
    """

    gain: float
    zeros: tuple[complex, ...] = ()
    poles: tuple[complex, ...] = ()
    rate: float = 0.0
    others: tuple[Filter, ...] = ()

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
        """Evaluate the filter at a frequency, or an array of frequencies, in Hz.

        A digital filter gives 0 above half its sample rate.
        """
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
        angle = math.pi * abs(root) / of
        if rate and not angle < math.pi / 2:
            problem = f"has a root at {abs(root):g} Hz, above half the sample rate"
            raise FotonError(problem, "give a higher rate, or leave it out")
        return root * (math.tan(angle) if rate else math.atan(angle)) / angle if angle else root

    zeros, poles = (tuple(map(move, roots)) for roots in (made.zeros, made.poles))
    gain = made.gain * normal(made.zeros) / normal(made.poles)
    return replace(normalised(gain, zeros, poles), rate=rate)


@lru_cache(maxsize=256)
def parse(text: str, rate: float = 0.0) -> Filter:
    """Parse a Foton string; with a sample rate in Hz the filter is digital.

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
    result, place, end = Filter(1.0, rate=rate), 0, len(text.rstrip())
    while place < end or not end:
        found = FACTOR.match(text, place)
        if found is None or (place == 0 and found["times"]):
            rest = text[place:].strip()
            what = f"{rest[:20]!r} is not understood" if rest else "is empty"
            raise FotonError(f"column {end - len(rest) + 1}: {what}", EXAMPLE)
        name, arguments = found["name"] or "gain", found["arguments"] or found["number"] or ""
        where = f"column {found.start('name' if found['name'] else 'number') + 1}: {name}"
        try:
            result = _add(result, name, arguments)
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
    """Write a filter as a Foton string in plane "n" (of digital ones the design), to all digits.

    Examples
    --------
    >>> format_filter(Filter(2.0, (0.0,), (4.0,)))
    'zpk([0],[4],0.5,"n")'
    """
    filter_ = change_rate(filter_, 0.0) if filter_.rate else filter_
    gain = filter_.gain * normal(filter_.zeros) / normal(filter_.poles)
    zeros, poles = (";".join(map(_write_root, some)) for some in (filter_.zeros, filter_.poles))
    return f'zpk([{zeros}],[{poles}],{_write(gain)},"n")'


def normalised(gain: float, zeros: tuple[complex, ...], poles: tuple[complex, ...]) -> Filter:
    """Make a filter of plane "n"."""
    return Filter(gain * normal(poles) / normal(zeros), zeros, poles)


def normal(roots: tuple[complex, ...]) -> float:
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


def _add(made: Filter, name: str, arguments: str) -> Filter:
    """Append the filter of one factor with its arguments."""
    given, plane = _split_arguments(name, arguments)
    if name in IN_Z:
        if not made.rate:
            remedy = 'write filter = { design = "...", rate = 16384.0 }'
            raise FotonError("is in z, which needs a sample rate", remedy)
        numbers = [_pair_roots(one) if name == "zroots" else _reals(one) for one in given]
        order = {"order": plane} if name == "sos" else {}
        found = getattr(designs, name)(*numbers, **order)
        gain, zeros, poles = designs.from_z(found, made.rate)
        return made * Filter(gain, zeros, poles, made.rate)
    if name in ("gain", "setgain"):
        gain, *at = _reals(given)[::-1]
        gain = 10 ** (gain / 20) if plane == "dB" else gain
        return replace(made, gain=made.gain * (gain / _size(made, at[0]) if at else gain))
    if name == "zpk":
        factor = _zpk(given[0], given[1], given[2], plane)
    elif name == "rpoly":
        factor = _zpk(*designs.rpoly(*map(_reals, given)), "s")
    elif name in RIPPLES:
        factor = _zpk(*designs.prototype(name, str(given[0]), _reals(given[1:])), "s")
    elif name in ("notch", "resgain", "comb"):
        zeros, poles = map(tuple, designs.peaks(name, *_reals(given)))
        factor = Filter(1.0, zeros, poles)
    else:
        f0, *others = _reals(given)
        roots = designs.pair(f0, others.pop(0)) if name.endswith("2") else [complex(f0)]
        if f0 < 0:
            raise FotonError("takes a positive frequency and Q", "correct them")
        both = ((), tuple(roots)) if name.startswith("pole") else (tuple(roots), ())
        factor = _in_hertz(sum(others) if others else 1.0, *both, plane)
    return made * (change_rate(factor, made.rate) if made.rate else factor)


def _split_arguments(name: str, arguments: str) -> tuple[list[Any], str]:
    """Read the arguments of a factor; the plane or format, the last of them, by itself."""
    if name not in NUMBERS:
        remedy = "have Foton write the filter as zeros, poles and gain"
        raise FotonError(f"is not known here ({', '.join(NUMBERS)})", remedy)
    given = [_read(one.strip()) for one in re.split(r",(?![^\[]*\])", arguments) if arguments]
    allowed = FORMATS.get(name, ("",))
    own = name not in RIPPLES and isinstance((given or [0])[-1], str)
    plane = given.pop() if own else allowed[0]
    if plane not in allowed:
        known = " or ".join(f'"{one}"' for one in allowed)
        raise FotonError(f'has no plane "{plane}"', f"write {known}")
    least, most = NUMBERS[name]
    if not least <= len(given) <= most:
        count = f"{least}" if least == most else f"{least} or {most}"
        raise FotonError(f"takes {count} numbers, found {len(given)}", EXAMPLE)
    return given, plane


def _size(made: Filter, frequency: float) -> float:
    """Magnitude of a filter at a frequency in Hz."""
    import numpy as np

    with np.errstate(all="ignore"):
        size = float(abs(made.at(np.array([frequency]))[0]))
    if not 0 < size < math.inf:
        raise FotonError("sets a gain where the filter is 0 or infinite", "name another place")
    return size


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
        raise FotonError(problem, EXAMPLE) from None
    if not cmath.isfinite(number):
        raise FotonError(f"has a number that is too large ({text})", "write a smaller one")
    return number


def _real(value: Any) -> float:
    if not isinstance(value, (complex, float)) or value.imag:
        raise FotonError("takes real numbers here", EXAMPLE)
    return value.real


def _reals(value: Any) -> list[float]:
    """Check the numbers of a vector (or one alone), which are real."""
    return [_real(one) for one in (value if isinstance(value, list) else [value])]


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
        return normalised(gain, zeros, poles)
    if plane == "s":
        zeros, poles = (tuple(root / (2 * math.pi) for root in roots) for roots in (zeros, poles))
    return Filter(gain * (2 * math.pi) ** (len(zeros) - len(poles)), zeros, poles)
