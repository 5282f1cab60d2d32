"""Which mode a label means in any design: the one that is mostly that motion.

A label such as ``test pitch`` names a motion, and the mode that it belongs to differs from design
to design: where two modes exchange their character, pitch becomes the pendulum mode, and the
pendulum mode pitch. So in each design the label means the mode with the largest fraction of kinetic
energy in the motion, of those that `pendsus modes` gives this label, if there is one. A numbered
label (``test pitch#2``) means the second of these in order of frequency.

Near the place where two modes exchange character both have about the same fraction. They share the
motion then, and the label tells one from the other no longer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.linear.batch_modes import Spectrum
from suspension_cli.linear.system import LinearSystem

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Inexact, Int

EQUAL = 1e-9
"""Difference of fractions that differ by rounding alone (two equal bodies, two blades)."""
SHARED = 0.8
"""Fraction of a motion in one mode, over that in the mode with most of it, from which both share
it: 44 and 56 % of two that share it alone."""
APART = 0.5
"""The same ratio, up to which the second mode has no effect on goals of `pendsus optimise`."""


@dataclass(frozen=True)
class Motion:
    """Motion that a label names: its place among those with kinetic energy (`Modes.place`).

    `number` is that of a numbered label, from 1, or 0.
    """

    place: int
    number: int = 0


@dataclass(frozen=True)
class Content:
    """The mode that a label means in each design, and the one with most of its motion beside it.

    Modes are numbered from 0, ascending in omega^2; -1 if there is none. Fractions are of the
    kinetic energy of each of the two modes; NaN without it.
    """

    mode: Int[np.ndarray, "*build"]
    other: Int[np.ndarray, "*build"]
    fraction: Float[np.ndarray, "*build"]
    other_fraction: Float[np.ndarray, "*build"]

    @property
    def ratio(self) -> Float[np.ndarray, "*build"]:
        """Fraction in the other mode over that in the mode; 0 without the one or the other."""
        known = (self.mode >= 0) & (self.other >= 0) & (self.fraction > 0)
        ratio = self.other_fraction / np.where(known, self.fraction, 1.0)
        return np.where(known, ratio, 0.0)

    @property
    def shared(self) -> Bool[np.ndarray, "*build"]:
        """Whether both modes share the motion, see `SHARED`."""
        return self.ratio >= SHARED


def number_labels(motions: Sequence[str]) -> list[str]:
    """Name modes by their motions; where several have the same, by its number in this order too.

    >>> number_labels(["test yaw", "test pitch", "test yaw"])
    ['test yaw#1', 'test pitch', 'test yaw#2']
    """
    return [
        name if motions.count(name) == 1 else f"{name}#{motions[: n + 1].count(name)}"
        for n, name in enumerate(motions)
    ]


def leading(fractions: Float[np.ndarray, "*build mode place"]) -> Int[np.ndarray, "*build mode"]:
    """Motion with most of the kinetic energy of each mode, which gives it its label.

    Of those that are equal but for rounding the first.
    """
    return (fractions >= fractions.max(-1, keepdims=True) - EQUAL).argmax(-1)


def find(fractions: Float[np.ndarray, "*build mode place"], motion: Motion) -> Content:
    """Find the mode that a label means in designs with these `fractions` of kinetic energy.

    Designs without modes have fractions that are NaN.
    """
    known = np.asarray(np.isfinite(fractions).all((-2, -1)))
    own = np.where(known[..., None], fractions[..., motion.place], 0.0)
    has_label = leading(fractions) == motion.place
    if motion.number:
        place = np.cumsum(has_label, axis=-1)
        chosen = has_label & (place == motion.number)
        mode = np.where(chosen.any(-1), chosen.argmax(-1), -1)
    else:
        mode = (own + has_label).argmax(-1)  # a fraction is below 1
    mode = np.where(known, mode, -1)
    taken = np.arange(own.shape[-1]) == mode[..., None]
    if motion.number:  # others of this label are not in doubt
        taken = taken | has_label
    rest = np.where(taken, -1.0, own)
    other = np.where((mode >= 0) & (rest.max(-1) >= 0), rest.argmax(-1), -1)
    return Content(mode, other, *(_at(own, number) for number in (mode, other)))


def describe_shared(
    name: str,
    motion: Motion,
    fractions: Float[np.ndarray, "mode place"],
    frequency: Float[np.ndarray, " mode"],
) -> str:
    """Say which two modes of a design share the motion that a name means; "" if none do.

    `frequency` are those of the modes, Hz.
    """
    found = find(fractions, motion)
    if not found.shared:
        return ""
    first = frequency[int(found.mode)]
    second = frequency[int(found.other)]
    own = 100 * found.fraction
    other = 100 * found.other_fraction
    return (
        f"two modes share {name}: {first:.5g} and {second:.5g} Hz, with {own:.0f} and"
        f" {other:.0f} % of their kinetic energy in it"
    )


def weights(
    fractions: Float[np.ndarray, "*build mode place"], motion: Motion, *, smooth: bool
) -> Float[np.ndarray, "*build mode"]:
    """Weight with which each mode counts as the one that a label means, from 0 to 1.

    1 for the mode that `find` finds (where no mode has the number of a label, for the one that
    comes nearest to it) and for those that share the motion with it. If `smooth`, a mode gains
    weight gradually between `APART` and `SHARED`, so that a number that depends on all of them does
    not jump where two modes exchange their character; else others have none.
    """
    found = find(fractions, motion)
    mode = np.where(found.mode < 0, found.other, found.mode)
    own = fractions[..., motion.place]
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.nan_to_num(own / _at(own, mode)[..., None])
    if motion.number:
        ratio = np.where(leading(fractions) == motion.place, 0.0, ratio)
    weight = share_weight(ratio, smooth=smooth)
    return np.where(np.arange(own.shape[-1]) == mode[..., None], 1.0, weight)


def share_weight(
    ratio: Float[np.ndarray, "*build"], *, smooth: bool
) -> Float[np.ndarray, "*build"]:
    """Weight of a fraction of energy by its ratio to a larger one: 1 from `SHARED` on.

    If `smooth`, it falls gradually to 0 at `APART`; else it is 0 below `SHARED`.
    """
    if not smooth:
        return (ratio >= SHARED) * 1.0
    part = np.clip((ratio - APART) / (SHARED - APART), 0.0, 1.0)
    return part**2 * (3 - 2 * part)


def largest(
    values: Float[np.ndarray, "*build item"], weight: Float[np.ndarray, "*build item"]
) -> Float[np.ndarray, "*build"]:
    """Largest of values with weights from 0 to 1, continuous in both.

    The largest value of weight 1, raised towards larger ones by their weight (an integral of
    Choquet, Ann. Inst. Fourier 5, 131 (1954), with the largest weight as the measure of a set).

    >>> largest(np.array([1.0, 2.0, 4.0]), np.array([1.0, 0.0, 0.5])).tolist()
    2.5
    """
    order = np.argsort(-values, axis=-1, kind="stable")
    descending = np.take_along_axis(values, order, -1)
    reached = np.maximum.accumulate(np.take_along_axis(weight, order, -1), axis=-1)
    steps = descending[..., :-1] - descending[..., 1:]
    return descending[..., -1] + (
        np.where(reached[..., :-1] > 0, steps, 0.0) * reached[..., :-1]
    ).sum(-1)


def _at(
    values: Float[np.ndarray, "*build mode"], number: Int[np.ndarray, "*build"]
) -> Float[np.ndarray, "*build"]:
    """Values of modes by number; NaN where it is -1."""
    found = np.take_along_axis(values, np.maximum(number, 0)[..., None], -1)[..., 0]
    return np.where(number < 0, np.nan, found)


def frequencies(
    omega_squared: Float[np.ndarray, "*build mode"], number: Int[np.ndarray, "*build"]
) -> Float[np.ndarray, "*build"]:
    """Frequencies (Hz) of modes by number; NaN without one, or where it grows."""
    squared = _at(omega_squared, number)
    return np.sqrt(np.where(squared >= 0, squared, np.nan)) / (2 * np.pi)


def of_spectrum(model: LinearSystem, found: Spectrum) -> Float[np.ndarray, "*build mode place"]:
    """Fractions of kinetic energy in each motion (`Modes.fractions`) of the modes of a batch."""
    with np.errstate(invalid="ignore"):
        return np.concatenate(energy_fractions(model, found.motion), axis=-1)


def energy_fractions(
    model: LinearSystem, shapes: Inexact[np.ndarray, "*build mode coordinate"]
) -> tuple[Float[np.ndarray, "*build mode moving"], Float[np.ndarray, "*build mode tip"]]:
    """Fractions of mean kinetic energy in the coordinates of bodies and of tips, summing to 1.

    Squares of M^(1/2) v with the M of each body, so never negative. A body's M includes tip masses
    that move with it.
    """
    bodies = len(model.body)
    body_energy = np.zeros((*shapes.shape[:-1], 6 * bodies))
    for n in range(bodies):
        rows = slice(6 * (n + 1), 6 * (n + 2))
        root = _root(model.mass[..., rows, rows])
        body_energy[..., 6 * n : 6 * (n + 1)] = np.abs(shapes[..., rows] @ root) ** 2
    tips = slice(6 * (bodies + 1), model.size)
    basis = model.basis[tips, tips]
    mass = np.diagonal(basis @ model.mass[..., tips, tips] @ basis.T, axis1=-2, axis2=-1)
    tip_energy = np.abs((shapes @ model.basis.T)[..., tips]) ** 2 * mass[..., None, :]
    total = (body_energy.sum(-1) + tip_energy.sum(-1))[..., None]
    return body_energy / total, tip_energy / total


def _root(mass: Float[np.ndarray, "*build 6 6"]) -> Float[np.ndarray, "*build 6 6"]:
    """Square roots of mass matrices, which are symmetric."""
    diagonal = np.diagonal(mass, axis1=-2, axis2=-1)
    if (mass == diagonal[..., None] * np.eye(6)).all():
        return np.sqrt(np.maximum(diagonal, 0.0))[..., None] * np.eye(6)
    values, vectors = np.linalg.eigh(mass)
    return (vectors * np.sqrt(np.maximum(values, 0.0))[..., None, :]) @ np.swapaxes(vectors, -1, -2)
