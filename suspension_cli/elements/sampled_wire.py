"""A wire of many sections at many frequencies, from its values at few.

>>> import suspension_cli as sus
>>> from suspension_cli.scene.fibres import compose
>>> fibre = compose(sus.example("geo-silica-triple").design).wire[-1]
>>> wire = TautWire(fibre, tension=14.0, massive=True, lossy=True)
>>> omega = 2 * np.pi * np.geomspace(1, 100, 2000)
>>> found = SampledWire(wire, omega)["bend-1"].stiffness
>>> bool(np.allclose(found, wire.at(omega)["bend-1"].stiffness, rtol=1e-11))
True

What a wire exerts and dissipates is analytic in frequency; its poles are the resonances of the wire
with clamped ends. Over an octave without one, values at `NODES` frequencies give all others to
rounding: the terms of their Chebyshev series fall geometrically (Trefethen, Approximation Theory
and Approximation Practice (2013), chapter 8). Where the last terms are not small enough, near a
resonance or a step in a table of loss angles, each frequency is solved.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

from suspension_cli.elements.dynamic_wire import (
    DAMPERS,
    TOTAL,
    PartAtFrequencies,
    TautWire,
    WireAtFrequencies,
)
from suspension_cli.elimination import as_slice

if TYPE_CHECKING:
    from jaxtyping import Complex, Float, Inexact, Int

MANY_SECTIONS = 6
"""Sections of a wire from which on it is sampled."""
NODES = 20
"""Frequencies per piece at which functions are computed."""
FEW = 2 * NODES
"""Frequencies of a piece up to which each is solved."""
SMALL = 1e-14
"""Last Chebyshev coefficients, over the size of a function, below which the others suffice."""
SMALL_FORM = 1e-12
"""The same for what is dissipated, where the stiffness is known."""
ROUNDING = 2e-15
"""Rounding errors of the stiffness between coordinates, over the geometric mean of their own."""
LAST = 2
"""Number of last coefficients that must be small."""
SLOWEST = 1e-3
"""First resonance over the highest frequency below which resonances are too many."""
BESIDE = 1.1
"""Ratio of frequencies around a piece in which no resonance may be."""
PLACES = np.cos(np.pi * (np.arange(NODES) + 0.5) / NODES)
"""Places of the nodes in a piece, from -1 to 1: zeros of a Chebyshev polynomial."""
TO_COEFFICIENTS = 2 / NODES * chebyshev.chebvander(PLACES, NODES - 1)
TO_COEFFICIENTS[:, 0] /= 2
"""Chebyshev coefficients of values at the nodes."""


def at(strand: TautWire, omega: Inexact[np.ndarray, " frequency"]) -> WireAtFrequencies:
    """The wire at frequencies in rad/s, sampled where that is quicker."""
    many_sections = strand.massive and len(strand.fibre.sections) >= MANY_SECTIONS
    of_builds = np.ndim(strand.tension) > 0
    if many_sections and not of_builds and not np.iscomplexobj(omega) and len(omega) > 4 * FEW:
        return SampledWire(strand, omega)
    return strand.at(omega)


class SampledWire(WireAtFrequencies):
    """The parts of a wire at given frequencies (rad/s), from their values at few."""

    @cached_property
    def pieces(self) -> list[_Piece]:
        """Pieces of the frequencies that are worth sampling."""
        sections = self.strand.fibre.sections
        length = sum(section.length for section in sections)
        mass = sum(section.mass * section.length for section in sections) / length
        resonance = np.pi / length * np.sqrt(self.strand.tension / mass)  # of a string
        return _divide(self.omega, float(resonance))

    def make(self, number: int) -> SampledPart:
        """Make a part, by its number in `PARTS`."""
        pieces = _without_resonances(self.strand, number, self.pieces)
        return SampledPart(self.strand, self.omega, number, pieces=pieces)


@dataclass(frozen=True)
class SampledPart(PartAtFrequencies):
    """One part of the motion of a wire at many frequencies, from its values at few."""

    pieces: list[_Piece] = field(default_factory=list)

    @cached_property
    def solved(self) -> dict[bytes, PartAtFrequencies]:
        """The part at the frequencies that were solved so far."""
        return {}

    @cached_property
    def joined_stiffness(self) -> Inexact[np.ndarray, "*elements frequency"]:
        """Dynamic stiffness in the coordinates that join the sections."""
        found = _sample(self._at, _stiffness, self.pieces, self.omega)
        rest = self._at(self.omega[found.rest]).joined_stiffness
        if len(found.rest) == len(self.omega):
            return rest
        found.value[:, found.rest] = rest.reshape(len(found.value), -1)
        return found.value.reshape(*rest.shape[:-1], -1)

    def dissipated(
        self, motion: Inexact[np.ndarray, "end motion frequency"]
    ) -> dict[tuple[str, float], Float[np.ndarray, "motion frequency"]]:
        """Dissipation x^H Im(F) x by cause, see `PartAtFrequencies.dissipated`.

        Where it is sampled, from one quadratic form per cause. With gas, the causes share the
        dissipation of the whole wire in proportion to that in the material and by the gas alone.
        """
        forms = self._forms
        one, other = np.triu_indices(len(motion))
        products = np.conj(motion[one]) * motion[other]
        products[one != other] *= 2
        found = {}
        for n, key in enumerate(forms.keys):
            form = forms.value[len(one) * n : len(one) * (n + 1)]
            found[key] = np.maximum(_sum_real_parts(form, products), 0.0)
        total = found.pop(TOTAL, None)
        if total is not None:
            sharing = [key for key in found if key[0] != DAMPERS]
            both = sum(found[key] for key in sharing)
            for key in sharing:
                found[key] = total * found[key] / np.where(both == 0, 1.0, both)
        rest = forms.rest
        for key, own in self._at(self.omega[rest]).dissipated(motion[..., rest]).items():
            found.setdefault(key, np.zeros(motion.shape[1:]))[:, rest] = own
        return found

    @cached_property
    def _forms(self) -> _Sampled:
        """Quadratic forms as of `PartAtFrequencies.dissipation_forms`, one after the other."""
        return _sample(self._at, _forms_and_stiffness, self.pieces, self.omega)

    def _at(self, omega: Float[np.ndarray, " frequency"]) -> PartAtFrequencies:
        """The part at some frequencies, each solved; what is known of it is kept."""
        key = omega.tobytes()
        if key not in self.solved:
            self.solved[key] = PartAtFrequencies(self.strand, omega, self.number)
        return self.solved[key]


class _Values(NamedTuple):
    """Functions of frequency, and the errors of their real and imaginary parts that are allowed.

    The first of them are quadratic forms, the elements of one after the other; `keys` are theirs.
    """

    value: Inexact[np.ndarray, "function frequency"]
    limit: Complex[np.ndarray, "function frequency"]
    keys: tuple[tuple[str, float], ...] = ()


def _stiffness(part: PartAtFrequencies) -> _Values:
    """Stiffness of a part in the coordinates that join sections."""
    whole = part.joined_stiffness
    magnitude = np.abs(whole)
    if part.bends:
        own = np.sqrt(np.einsum("ii...->i...", magnitude))
        magnitude = own[:, None] * own
    rounding = ROUNDING * magnitude
    limit = SMALL * np.abs(np.real(whole)) + rounding
    if np.iscomplexobj(whole):
        limit = limit + 1j * (SMALL * np.abs(np.imag(whole)) + rounding)
    flat = whole.reshape(-1, whole.shape[-1])
    return _Values(flat, limit.reshape(flat.shape))


def _forms_and_stiffness(part: PartAtFrequencies) -> _Values:
    """Quadratic forms of a part; the stiffness must be known too."""
    forms = part.dissipation_forms()
    value = np.array(list(forms.values()))
    stiffness = _stiffness(part)
    one, other = np.triu_indices(len(part.stiffness))
    lost = np.sqrt(np.abs(value[:, one == other]))
    stored = np.sqrt(np.abs(np.einsum("ii...->i...", part.stiffness)))
    limit = SMALL_FORM * lost[:, one] * lost[:, other] + ROUNDING * stored[one] * stored[other]
    flat = -1, len(part.omega)
    return _Values(
        np.concatenate([value.reshape(flat), stiffness.value]),
        np.concatenate([(1 + 1j) * limit.reshape(flat), stiffness.limit]),
        tuple(forms),
    )


def _sum_real_parts(
    form: Inexact[np.ndarray, "pair frequency"],
    products: Inexact[np.ndarray, "pair motion frequency"],
) -> Float[np.ndarray, "motion frequency"]:
    """Real part of the sum of elements of a form times products of motions."""
    total = np.einsum("pf,pmf->mf", np.real(form), np.real(products))
    if np.iscomplexobj(form):
        total -= np.einsum("pf,pmf->mf", np.imag(form), np.imag(products))
    return total


class _Sampled(NamedTuple):
    """Functions of frequency, see `_Values`; numbers of those frequencies that must be solved."""

    value: Inexact[np.ndarray, "function frequency"]
    rest: Int[np.ndarray, " _"]
    keys: tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class _Piece:
    """Frequencies between two (rad/s), and their numbers, ascending."""

    low: float
    high: float
    omega: Float[np.ndarray, " frequency"]
    number: Int[np.ndarray, " frequency"]

    @property
    def nodes(self) -> Float[np.ndarray, " node"]:
        """Frequencies at which functions are computed, rad/s."""
        return self.low * (self.high / self.low) ** ((1 + PLACES) / 2)

    @cached_property
    def polynomials(self) -> Float[np.ndarray, "degree frequency"]:
        """Chebyshev polynomials in the logarithm of frequency."""
        place = 2 * np.log(self.omega / self.low) / np.log(self.high / self.low) - 1
        return chebyshev.chebvander(place, NODES - 1).T


def _divide(omega: Float[np.ndarray, " frequency"], resonance: float) -> list[_Piece]:
    """Divide frequencies (rad/s) into octaves, from half a resonance on into quarters of it.

    `resonance` (rad/s) is the first of the wire; the distance of others is about as much. Pieces of
    few frequencies are left out.
    """
    highest = omega.max(initial=0.0)
    if highest <= 0 or resonance < SLOWEST * highest:
        return []
    lowest = omega[omega > 0].min()
    octaves = lowest * 2.0 ** np.arange(np.log2(resonance / lowest) - 1)
    quarters = resonance * np.arange(0.5, highest / resonance, 0.25)
    inner = np.concatenate([octaves, quarters])
    inner = inner[(inner > 1.1 * lowest) & (inner < highest / 1.1)]
    edges = np.concatenate([[lowest], inner, [highest]])
    which = np.where(omega > 0, np.searchsorted(inner, omega), -1)
    pieces = []
    for n, (low, high) in enumerate(pairwise(edges)):
        number = np.flatnonzero(which == n)
        if len(number) > FEW:
            pieces.append(_Piece(low, high, omega[number], number))
    return pieces


def _without_resonances(strand: TautWire, number: int, pieces: list[_Piece]) -> list[_Piece]:
    """Choose the pieces in and beside which the part of this number has no resonance.

    One that hardly moves the ends could else be between the nodes.
    """
    if not pieces:
        return []
    bounds = [(piece.low / BESIDE, piece.high * BESIDE) for piece in pieces]
    lossless = replace(strand, lossy=False)
    count = PartAtFrequencies(lossless, np.ravel(bounds), number).resonances_below()
    same = count[::2] == count[1::2]
    return [piece for piece, chosen in zip(pieces, same, strict=True) if chosen]


def _sample(
    solve: Callable[[Float[np.ndarray, " frequency"]], PartAtFrequencies],
    compute: Callable[[PartAtFrequencies], _Values],
    pieces: list[_Piece],
    omega: Float[np.ndarray, " frequency"],
) -> _Sampled:
    """Compute functions of a part from their values at few frequencies (rad/s), where possible."""
    rest = np.ones(len(omega), dtype=bool)
    if not pieces:
        return _Sampled(np.zeros((0, len(omega))), np.flatnonzero(rest), ())
    at_nodes, limit, keys = compute(solve(np.concatenate([piece.nodes for piece in pieces])))
    lossy = np.iscomplexobj(at_nodes)
    shape = -1, len(pieces), NODES
    if lossy:
        at_nodes, limit = (
            np.concatenate([np.real(own), np.imag(own)]) for own in (at_nodes, limit)
        )
    coefficients = at_nodes.reshape(shape) @ TO_COEFFICIENTS
    last = np.abs(coefficients[..., -LAST:]).max(-1)
    small = (last <= limit.reshape(shape).max(-1)).all(0)
    value = np.zeros((len(at_nodes), len(omega)))
    for n in np.flatnonzero(small):
        number = pieces[n].number
        value[:, as_slice(number)] = coefficients[:, n] @ pieces[n].polynomials
        rest[number] = False
    rest[0] = True  # one that is solved tells the shape of what is found
    if lossy:
        real, imaginary = np.split(value, 2)
        value = real + 1j * imaginary
    return _Sampled(value, np.flatnonzero(rest), keys)
