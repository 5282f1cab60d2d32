"""Filter modules of Foton from the responses of an exported system.

A file has a module per response, with at most ten of its sections. Of the zeros and poles of a
response those are removed first that change it least in the band: a pole with the zero nearest to
it, or one alone. Roots above a quarter of the sample rate go anyway. The rest is made digital as
Foton does. What all this changes is measured on the coefficients as written, against the state
space, off resonance.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.analyses.export.solve import (
    GRID,
    Exported,
    compute_zero_pole_gain,
    off_resonance,
)
from suspension_cli.design import foton, foton_file
from suspension_cli.design.foton import Filter
from suspension_cli.design.foton_file import FilterFile, Module
from suspension_cli.errors import InputError

if TYPE_CHECKING:
    from jaxtyping import Complex, Float

    Units = Complex[np.ndarray, " unit"]

ORDER = 2 * foton_file.BIQUADS
"""Most poles of a section."""
FAINT = 1e-4
"""Change of a response up to which roots are removed that a section has room for."""
STRIDE = 4
"""Every fourth frequency is enough to choose them."""
REAL = 1e-3
"""Imaginary over real part up to which a pair of roots is a double real one."""
SHARE = 0.25
"""Largest frequency of a root over the sample rate."""
LONGEST = 35
"""Letters of the name of a module; front ends read 39."""


def make_foton(
    made: Exported,
    rate: float = 16384.0,
    band: tuple[float, float] = (0.1, 100.0),
    accuracy: float = 0.01,
) -> FilterFile:
    """Make a module of each response that is not 0, of as few sections as the accuracy allows.

    Raises `InputError` if the band ends above a quarter of the rate.
    """
    if band[1] > SHARE * rate:
        problem = f"is not four times the end of the band, {band[1]:g} Hz"
        raise InputError.of("--rate", problem, "give a higher rate, or --band", f"{rate:g}")
    form = compute_zero_pole_gain(made.system)
    frequency = np.geomspace(*band, GRID)
    whole = made.system.at(frequency)
    modules = []
    for o, i in np.argwhere(form.gain != 0):
        exact = whole[:, o, i]
        tried = []
        for count in range(1, foton_file.SECTIONS + 1):
            zeros, poles = (_units(r[o, i], SHARE * rate) for r in (form.zeros, form.poles))
            parts = _reduce(zeros, poles, frequency[::STRIDE], exact[::STRIDE], count * ORDER)
            text = [_digitise(part, rate) for part in parts]
            value = np.prod([foton.parse(one, rate).at(frequency) for one in text], axis=0)
            off = np.abs(value / exact - 1)[:, None, None]
            tried.append((float(off_resonance(off, frequency).max()), parts, text))
            if tried[-1][0] <= accuracy or len(parts) < count:
                break
        error, parts, text = min(tried, key=lambda one: one[0])
        signals = made.system.output[o], made.system.input[i]
        name = name_module("_".join(signals), [one.name for one in modules])
        modules.append(Module(name, *signals, parts, text, error))
    return FilterFile(rate, band, tuple(modules))


def name_module(text: str, taken: Sequence[str]) -> str:
    """Name of a module for a text, unlike those that are taken."""
    name = re.sub(r"\W+", "_", text).upper()[:LONGEST]
    same = sum(one.startswith(name) for one in taken)
    return f"{name}_{same}" if same else name


def _units(roots: Complex[np.ndarray, " root"], limit: float) -> Units:
    """Roots in Hz, positive in the left half plane, one of each pair, below a limit."""
    own = -np.asarray(roots, dtype=complex) / (2 * np.pi)
    own = np.where(np.abs(np.imag(own)) <= REAL * np.abs(np.real(own)), np.real(own), own)
    return own[(np.imag(own) >= 0) & (np.abs(own) < limit)]


def _count(units: Any) -> Any:
    """Number of roots that units stand for."""
    return 1 + (np.imag(units) > 0)


def _roots(unit: complex) -> tuple[complex, ...]:
    """The roots of a unit."""
    return (unit, unit.conjugate()) if np.imag(unit) else (unit,)


def _reduce(
    zeros: Units,
    poles: Units,
    frequency: Float[np.ndarray, " frequency"],
    exact: Complex[np.ndarray, " frequency"],
    most: int,
) -> list[Filter]:
    """Remove units until at most `most` poles are left, and no more zeros, and split the rest."""
    undamped = np.real(poles) < 0  # by rounding errors
    poles = np.where(undamped, 1j * np.imag(poles), poles)
    one = np.ones((1, len(frequency)))  # a row for no zero and no pole
    above, below = (
        np.array([*(foton.normalised(1.0, _roots(u), ()).at(frequency) for u in units), *one])
        for units in (zeros, poles)
    )
    rest = exact * below.prod(0) / above.prod(0)
    while True:
        counts = [np.append(_count(units), 0) for units in (zeros, poles)]
        order = counts[1].sum()
        spare = counts[1].sum() - counts[0].sum()
        pairs = [(-1, n) for n in range(len(poles))] + [(n, -1) for n in range(len(zeros))]
        for n, count in enumerate(counts[1][:-1]):
            apart = np.where(counts[0][:-1] == count, np.abs(zeros - poles[n]), np.inf)
            pairs += [(int(apart.argmin()), n)] if np.isfinite(apart).any() else []
        left = [spare + counts[0][z] - counts[1][p] for z, p in pairs]
        pairs = [pair for pair, n in zip(pairs, left, strict=True) if n >= 0 or n > spare]
        change = np.array([rest * above[z] / below[p] for z, p in pairs])
        size = _deviation(change)[1] if pairs else np.array([np.inf])
        chosen = int(size.argmin())
        if spare >= 0 and (not pairs or (order <= most and size[chosen] > FAINT)):
            return split(zeros, poles, float(_deviation(rest)[0]))
        z, p = pairs[chosen]
        rest = change[chosen]
        if z >= 0:
            zeros = np.delete(zeros, z)
            above = np.delete(above, z, 0)
        if p >= 0:
            poles = np.delete(poles, p)
            below = np.delete(below, p, 0)


def _deviation(values: Complex[np.ndarray, "*change frequency"]) -> tuple[np.ndarray, np.ndarray]:
    """Real constants nearest to values along the last axis, and their largest distances."""
    size = np.abs(values)
    constant = np.sqrt(size.max(-1) * size.min(-1)) * np.sign(np.real(values).sum(-1))
    return constant, np.abs(values / constant[..., None] - 1).max(-1)


def split(zeros: Units, poles: Units, gain: float) -> list[Filter]:
    """Split into filters of up to `ORDER` poles, pairs first, with the zeros next to them.

    Roots are in Hz, one of each pair; the gain is that of factors (r + i f) / abs(r).
    """
    zeros, poles = (some[np.lexsort((np.abs(some), -_count(some)))] for some in (zeros, poles))
    ordered = [root for unit in poles for root in _roots(unit)]
    below = [ordered[n : n + ORDER] for n in range(0, len(ordered), ORDER)] or [[]]
    above: list[list[complex]] = [[] for _ in below]
    for unit in zeros:
        room = [n for n in range(len(below)) if len(below[n]) >= len(above[n]) + _count(unit)]
        nearest = min(room, key=lambda n: min(abs(abs(unit) - abs(pole)) for pole in below[n]))
        above[nearest] += _roots(unit)
    made = [foton.normalised(1.0, tuple(z), tuple(p)) for z, p in zip(above, below, strict=True)]
    return [made[0] * Filter(gain), *made[1:]]


def _digitise(part: Filter, rate: float) -> str:
    """Second-order sections of a filter at a sample rate, as a design string."""
    return write_sections(foton.change_rate(part, rate))


def write_sections(made: Filter) -> str:
    """Write the second-order sections of a digital filter as a design string."""
    from scipy import signal

    zeros, poles = (-2 * np.pi * np.array(some) for some in (made.zeros, made.poles))
    gain = made.gain * (2 * np.pi) ** (len(poles) - len(zeros))
    rows = signal.zpk2sos(*signal.bilinear_zpk(zeros, poles, gain, made.rate))
    gain = float(rows[:, 0].prod())
    numbers = np.column_stack([rows[:, 4:], rows[:, 1:3] / rows[:, :1]]).ravel().tolist()
    return f'sos({gain!r},[{";".join(map(repr, numbers))}],"o")'
