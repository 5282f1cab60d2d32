"""Thermal noise of any motion, from the power dissipated in each part.

The fluctuation-dissipation theorem (Callen and Welton, Phys. Rev. 83, 34 (1951)) in the form of
Levin, Phys. Rev. D 57, 659 (1998): let a force F cos(omega t) act on the observed motion r . x, and
let W be the mean power dissipated. Then

    S(omega) = 8 k T W / (F^2 omega^2),    W = (omega / 2) x^H Im(Z) x  with  Z x = F r,

one-sided, in m^2/Hz. Im(Z) is a sum over lossy parts j, each with its own temperature, and x^H
Im(Z_j) x a sum of squares, in which nothing cancels. The imaginary part of the susceptibility r .
Z^-1 r, in contrast, loses the digits of a high Q.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.conventions import BOLTZMANN, DOFS
from suspension_cli.errors import Fault, InputError, format_value
from suspension_cli.files.declared import along, derived, in_unit
from suspension_cli.linear import signals
from suspension_cli.linear.frequency_terms import quadratic_form
from suspension_cli.linear.pencil import EvaluatedBlock, Pencil
from suspension_cli.linear.signals import Signal
from suspension_cli.linear.system import LinearSystem
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact

EARTH = 6.371e6
"""Mean radius of the Earth, m (Moritz, J. Geodesy 74, 128 (2000))."""
CHUNK = 1 << 19
"""Elements of matrices evaluated at once, of the largest block."""
ROUNDING = 1e-9
"""Fraction of the sum below which a negative density is a rounding error."""


@dataclass(frozen=True)
class Thermal:
    """Thermal noise of one motion.

    Attributes
    ----------
    frequency
        Hz.
    unit
        Of the motion: m or rad.
    source
        Sources of dissipation: ``test.bending-upper`` and so on, the strongest (over all
        frequencies) first.
    density
        One-sided power spectral density by source, unit^2/Hz.
    tilt
        Angle (rad) by which the observed direction rises above x.
    """

    frequency: Float[np.ndarray, " frequency"]
    output: str
    unit: str
    source: tuple[str, ...]
    density: Float[np.ndarray, "source frequency"]
    tilt: float = 0.0

    @property
    def amplitude(self) -> Float[np.ndarray, " frequency"]:
        """Amplitude spectral density of the sum, unit/sqrt(Hz)."""
        return np.sqrt(self.density.sum(0))

    @property
    def parts(self) -> dict[str, Float[np.ndarray, " frequency"]]:
        """Amplitude spectral density by source, unit/sqrt(Hz)."""
        return {name: np.sqrt(row) for name, row in zip(self.source, self.density, strict=True)}


@dataclass(frozen=True)
class Noises:
    """Thermal noise of several motions, as it is stored.

    Attributes
    ----------
    tilt
        As in `Thermal`.
    contribution
        Amplitude spectral density by source, 0 where a source does not contribute.
    """

    frequency: Float[np.ndarray, " frequency"] = field(metadata=in_unit("Hz"))
    output: tuple[str, ...]
    source: tuple[str, ...]
    unit: tuple[str, ...] = field(metadata=along("output"))
    tilt: tuple[float, ...] = field(metadata=in_unit("rad", "output"))
    contribution: Float[np.ndarray, "frequency output source"] = field(
        metadata=in_unit("{unit}/Hz^0.5")
    )

    @property
    @derived("{unit}/Hz^0.5")
    def amplitude(self) -> Float[np.ndarray, "frequency output"]:
        """Amplitude spectral density of the sum."""
        return np.sqrt((self.contribution**2).sum(-1))

    @staticmethod
    def of(noises: list[Thermal]) -> Noises:
        """Combine the noises of several motions at the same frequencies."""
        source = tuple(dict.fromkeys(name for noise in noises for name in noise.source))
        parts = np.zeros((len(noises[0].frequency), len(noises), len(source)))
        for n, noise in enumerate(noises):
            parts[:, n, [source.index(name) for name in noise.source]] = np.sqrt(noise.density).T
        names, units, tilts = zip(
            *((one.output, one.unit, one.tilt) for one in noises), strict=True
        )
        return Noises(noises[0].frequency, names, source, units, tilts, parts)

    def each(self) -> list[Thermal]:
        """List the noise of each motion."""
        found = []
        for n, (output, unit, tilt) in enumerate(
            zip(self.output, self.unit, self.tilt, strict=True)
        ):
            parts = zip(self.source, self.contribution[:, n].T, strict=True)
            densities = {name: part**2 for name, part in parts if part.any()}
            order = sort_sources(densities)
            density = np.array([densities[name] for name in order])
            found.append(Thermal(self.frequency, output, unit, tuple(order), density, tilt))
        return found


def solve(
    model: LinearSystem,
    frequency: Float[np.ndarray, " frequency"],
    row: Float[np.ndarray, " coordinate"],
    signal: Signal,
    temperature: float,
) -> Thermal:
    """Compute the thermal noise of a linear form (`row`) of the coordinates, at frequencies in Hz.

    The frequencies are above 0. Only sources that contribute are listed; without loss there are
    none. The support is at rest. `signal` gives name and unit, `temperature` (K) is that of dampers
    and of the support's loss; other sources have their own. Raises `InputError` at a resonance
    without loss, and if a part gives power back (a spring or damper whose matrix is not positive).

    >>> from suspension_cli.design import reader
    >>> from suspension_cli.models import registry
    >>> model = registry.BEAM.system(reader.parse(reader.template("single", "single")))
    >>> signal, row = parse_motion(model, "test.x")
    >>> noise = solve(model, np.array([10.0]), row, signal, 290.0)
    >>> noise.unit, noise.density.shape[1]
    ('m', 1)
    """
    return solve_all(model, frequency, [(signal, row)], temperature)[0]


def solve_all(
    model: LinearSystem,
    frequency: Float[np.ndarray, " frequency"],
    motions: list[tuple[Signal, Float[np.ndarray, " coordinate"]]],
    temperature: float,
) -> list[Thermal]:
    """Compute the thermal noise of several motions, which share the evaluation of wires."""
    omega = 2 * np.pi * np.asarray(frequency, dtype=float)
    powers: list[dict[str, Array]] = [{} for _ in motions]
    pencil = Pencil.of(model)
    blocks = [
        (block, np.flatnonzero(forces.any(1)), forces)
        for block in pencil.blocks
        if (forces := np.array([row[block.keep] for _, row in motions])).any()
    ]
    largest = max((len(block.owner) for block, _, _ in blocks), default=1)
    step = max(CHUNK // largest**2, 64)
    for start in range(0, len(omega), step):
        now = slice(start, start + step)
        some = omega[now]
        there = pencil.at(some)
        for block, driven, forces in blocks:
            here, own = block.at(there), np.eye(len(block.keep))
            responses = here.respond(own, np.zeros((6, len(driven))), forces[driven].T)
            for number, motion in zip(driven, responses.swapaxes(0, 1), strict=True):
                lost = compute_dissipation(here, motion, temperature)
                for (cause, warmth), power in lost.items():
                    total = powers[number].setdefault(cause, np.zeros(len(omega)))
                    total[now] += 4 * BOLTZMANN * warmth * power / some
    return [
        _gather(frequency, signal, power, omega)
        for (signal, _), power in zip(motions, powers, strict=True)
    ]


def _gather(
    frequency: Float[np.ndarray, " frequency"],
    signal: Signal,
    powers: dict[str, Float[np.ndarray, " frequency"]],
    omega: Float[np.ndarray, " frequency"],
) -> Thermal:
    powers = {name: power for name, power in powers.items() if power.any()}
    _check_powers(powers, omega)
    order = sort_sources(powers)
    density = np.array([powers[name] for name in order]).reshape(-1, len(omega)).clip(0)
    return Thermal(np.asarray(frequency), signal.text, signal.unit, tuple(order), density)


def sort_sources(densities: dict[str, Float[np.ndarray, " frequency"]]) -> list[str]:
    """Sort sources by the mean logarithm of their densities, the strongest first."""
    return sorted(densities, key=lambda name: -float(np.log(densities[name].clip(1e-300)).mean()))


def _check_powers(
    powers: dict[str, Float[np.ndarray, " frequency"]], omega: Float[np.ndarray, " frequency"]
) -> None:
    """Raise `InputError` where a density is infinite or negative."""
    total = sum(powers.values(), np.zeros(len(omega)))
    if not np.isfinite(total).all():
        at = format_value(float(omega[~np.isfinite(total)][0]) / (2 * np.pi))
        problem = "is a resonance without loss, where the noise is infinite"
        remedy = "move it, or give loss_angle or damping"
        raise InputError([Fault("--frequency", problem, remedy, at)])
    for name, power in powers.items():
        if (power < -ROUNDING * total).any():
            problem = "gives power back instead of dissipating it, so it has no thermal noise"
            remedy = "make its stiffness and damping matrices positive, or its loss angle 0"
            raise InputError([Fault(name, problem, remedy)])


def compute_dissipation(
    here: EvaluatedBlock, motion: Inexact[np.ndarray, "coordinate frequency"], temperature: float
) -> dict[tuple[str, float], Float[np.ndarray, " frequency"]]:
    """Compute x^H Im(Z) x of motions x of a block, the support at rest.

    The keys of the result are the name of a source and its temperature (K). `temperature` is that
    of dampers and of the support's loss, K.
    """
    result: dict[tuple[str, float], Array] = here.dissipated(motion)
    block = here.block
    for cause, matrix, factor in (
        ("damping", block.damping, here.omega),
        ("support", block.loss, 1.0),
    ):
        if matrix.any():
            power = factor * quadratic_form(matrix, motion)
            result[cause, temperature] = result.get((cause, temperature), 0.0) + power
    return result


def parse_motion(
    model: LinearSystem, text: str, tilt: float = 0.0
) -> tuple[Signal, Float[np.ndarray, " coordinate"]]:
    """Parse a motion; also return its linear form.

    A motion along x is taken along a beam that rises by `tilt` (rad) instead.
    """
    signal = signals.parse_output(text, signals.bodies_with_signals(model))
    row = signals.linear_form(signal, model)
    if tilt and DOFS[signal.dof] == "x":
        row = np.cos(tilt) * row + np.sin(tilt) * signals.linear_form(
            replace(signal, dof=DOFS.index("z")), model
        )
    return signal, row


def compute_arm_tilt(length: float) -> float:
    """Angle (rad) of a beam of some length (m) to the horizontal at its mirrors.

    The verticals at its two ends meet at the centre of the Earth.
    """
    return length / (2 * EARTH)
