"""Read and write filters as design strings of Foton, the filter editor of LIGO and KAGRA.

A string is a product of numbers and factors, in sequence or joined by ``*``:

    zpk([z1;z2],[p1;p2],k,"n")   pole(f,"n")   zero(f,"n")   gain(k)   gain(3,"dB")
    pole2(f,Q,"n")   zero2(f,Q,"n")   rpoly([a1;a0],[b1;b0],k)
    butter("LowPass",n,f)   cheby1("BandPass",n,dB,f1,f2)   cheby2(...)   ellip("HighPass",n,dB,dB,f)
    notch(f,Q,dB)   resgain(f,Q,dB)   comb(f,Q,dB,n)
    sos(g,[a1;a2;b1;b2],"o")   biquad(b0,b1,b2,a1,a2)   zroots([z],[p],k)   direct([b0;b1],[a1])
    closeloop(k)   /. setgain(f,g)

The last two act on all factors before them. The last argument of the first factors is the plane, by
default ``"s"``. With w = 2 pi f0 and s = 2 pi i f (documentation of `FilterDesign` in LIGO's Global
Diagnostics System):

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
from functools import lru_cache
from typing import Any

from suspension_cli.design import foton_designs as designs
from suspension_cli.design.digital import Filter
from suspension_cli.design.foton_designs import IN_Z, RIPPLES, SIMPLE, FotonError, pair

PAIRED = 1e-9
"""Relative distance within which two complex roots are conjugates."""
SIDE = {"s": "negative", "f": "negative", "n": "positive"}
"""Sign of the real part of a root of `zpk` in the left half plane, per plane."""
NUMBERS = {
    **{"gain": (1, 1), "zpk": (3, 3), "pole": (1, 2), "zero": (1, 2)},
    **{"pole2": (2, 3), "zero2": (2, 3), "rpoly": (3, 3), "notch": (2, 3), "resgain": (2, 3)},
    **{"comb": (2, 4), "sos": (1, 2), "biquad": (5, 5), "zroots": (2, 3), "direct": (2, 2)},
    **{"setgain": (2, 2), "closeloop": (0, 1)},
    **dict.fromkeys(RIPPLES, (2, 5)),
}
"""Factors, with the least and largest number of arguments beside plane or type."""
FACTOR = re.compile(
    r"\s*(?P<times>\*|/\.)?\s*(?:(?P<number>[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)(?![\w.])"
    r"|(?P<name>[A-Za-z_]\w*)\s*\((?P<arguments>(?:[^()\"']|\"[^\"]*\"|'[^']*')*+)\))"
)
EXAMPLE = 'write for example zpk([0],[20;10+i*17.3;10-i*17.3],126,"n")'


@lru_cache(maxsize=256)
def parse(text: str, rate: float | None = None) -> Filter:
    """Parse a Foton string; factors in z need the sample rate in Hz.

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
            raise FotonError(f"column {end - len(rest) + 1}: {what}", EXAMPLE)
        name = found["name"] or "gain"
        where = f"column {max(found.start('name'), found.start('number')) + 1}: {name}"
        try:
            result = _add(result, name, found["arguments"] or found["number"] or "", rate)
        except FotonError as error:
            raise FotonError(f"{where} {error.problem}", error.remedy) from None
        except (OverflowError, ZeroDivisionError):
            problem = f"{where} has numbers too large or too small to compute with"
            raise FotonError(problem, "check its frequencies, Q and gain") from None
        place = found.end()
    every = (result.gain, *(root for roots in result.factors for root, _ in roots))
    if not all(map(cmath.isfinite, every)):
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
    """Write a filter as a Foton string in plane "n" (in z where sampled), to all digits.

    Examples
    --------
    >>> format_filter(Filter(2.0, (0.0,), (4.0,)))
    'zpk([0],[4],0.5,"n")'
    """
    gain = filter_.gain * _normal(filter_.zeros) / _normal(filter_.poles)
    zeros, poles = (";".join(map(_write_root, some)) for some in (filter_.zeros, filter_.poles))
    text = f'zpk([{zeros}],[{poles}],{_write(gain)},"n")'
    for one in filter_.sampled:
        zeros, poles = (
            ";".join(_write_root(1 - 2 * math.pi * root / one.rate) for root in roots)
            for roots in (one.zeros, one.poles)
        )
        text += f" zroots([{zeros}],[{poles}],1)"
    return text


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


def _add(made: Filter, name: str, arguments: str, rate: float | None) -> Filter:
    """Append the filter of one factor with its arguments."""
    if name not in NUMBERS:
        remedy = "have Foton write the filter as zeros, poles and gain"
        raise FotonError(f"is not known here ({', '.join(NUMBERS)})", remedy)
    given = [_read(one.strip()) for one in re.split(r",(?![^\[]*\])", arguments) if arguments]
    if name in RIPPLES:
        if not given or not isinstance(given[0], str):
            problem, remedy = "has no type", f'write for example {name}("LowPass",...)'
            raise FotonError(problem, remedy)
        return made * designs.design(name, given[0], [_real(one) for one in given[1:]])
    known = {"gain": ("scalar", "dB"), "sos": ("o", "s")}
    in_planes = name == "zpk" or name.startswith(("pole", "zero"))
    allowed = tuple(SIDE) if in_planes else known.get(name, ())
    plane = "scalar" if name == "gain" else "s"
    if given and isinstance(given[-1], str) and allowed:
        plane = given.pop()
        if plane not in allowed:
            either = " or ".join(f'"{one}"' for one in allowed)
            raise FotonError(f'has no plane "{plane}"', f"write {either}")
    least, most = NUMBERS[name]
    if not least <= len(given) <= most:
        count = f"{least}" if least == most else f"{least} or {most}"
        raise FotonError(f"takes {count} numbers, found {len(given)}", EXAMPLE)
    if name == "zpk":
        return made * _zpk(given[0], given[1], given[2], plane)
    if name in IN_Z:
        if rate is None:
            remedy = 'write filter = { design = "...", rate = 16384.0 }'
            raise FotonError("has coefficients in z, which need a sample rate", remedy)
        return made * _in_z(name, given, plane, rate)
    if name == "rpoly":
        above, below = map(_reals, given[:2])
        return made * _stable(designs.polynomials(above, below, _real(given[2])))
    numbers = [_real(one) for one in given]
    if name == "gain":
        return made * Filter(10 ** (numbers[0] / 20) if plane == "dB" else numbers[0])
    if name == "setgain":
        return designs.set_gain(made, *numbers)
    if name == "closeloop":
        return _stable(designs.close_loop(made, *numbers))
    if name in SIMPLE:
        return made * SIMPLE[name](*numbers)
    if numbers[0] < 0 or (name.endswith("2") and not (numbers[0] > 0 and numbers[1] > 0)):
        raise FotonError("takes a positive frequency and Q", "correct them")
    roots = pair(*numbers[:2]) if name.endswith("2") else (complex(numbers[0]),)
    extra = numbers[least] if len(numbers) > least else 1.0
    zeros, poles = ((), roots) if name.startswith("pole") else (roots, ())
    return made * _in_hertz(extra, zeros, poles, plane)


def _in_z(name: str, given: list[Any], order: str, rate: float) -> Filter:
    """Make the filter of a factor with coefficients or roots in z."""
    if name == "sos":
        numbers = [number for one in given for number in _reals(one)]
        return designs.sections(numbers, order, rate)
    if name == "biquad":
        b0, b1, b2, a1, a2 = map(_real, given)
        if not b0:
            raise FotonError("has no b0", "give a coefficient that is not 0; delays are in delay")
        return designs.sections((b0, b1 / b0, b2 / b0, a1, a2), "s", rate)
    if name == "direct":
        return designs.direct(_reals(given[0]), _reals(given[1]), rate)
    zeros, poles = map(_pair_roots, given[:2])
    return designs.of_roots(zeros, poles, _real(given[2]) if len(given) > 2 else 1.0, rate)


def _zpk(zeros: Any, poles: Any, gain: Any, plane: str) -> Filter:
    side = 1 if plane == "n" else -1  # `pole` and `zero` have positive frequencies in every plane
    zeros, poles = (tuple(side * root for root in _pair_roots(some)) for some in (zeros, poles))
    remedy = f'in plane "{plane}" stable poles have {SIDE[plane]} real parts'
    return _stable(_in_hertz(_real(gain), zeros, poles, plane), remedy)


def _stable(made: Filter, remedy: str = "check the numbers") -> Filter:
    """Check that no pole of a continuous filter grows."""
    for pole in made.poles:
        if pole.real < 0:
            problem = f"has a pole at {_write_root(-pole)} Hz in the right half plane, which grows"
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
    if not isinstance(value, complex) or value.imag:
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
        return Filter(gain * _normal(poles) / _normal(zeros), zeros, poles)
    if plane == "s":
        zeros, poles = (tuple(root / (2 * math.pi) for root in roots) for roots in (zeros, poles))
    return Filter(gain * (2 * math.pi) ** (len(zeros) - len(poles)), zeros, poles)
