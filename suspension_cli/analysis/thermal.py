"""Thermal noise of any motion, from the power that each part dissipates.

The fluctuation-dissipation theorem (Callen and Welton, Phys. Rev. 83, 34 (1951)) in the form of Levin, Phys. Rev. D 57, 659 (1998): push on
what is observed, r . x, with a force F cos(omega t), and let W be the mean power that is lost.  Then

    S(omega) = 8 k T W / (F^2 omega^2),    W = (omega / 2) x^H Im(Z) x  with  Z x = F r,

one-sided, in m^2/Hz.  Im(Z) is a sum over all that is lossy, each part with its own temperature, and x^H Im(Z_j) x a sum of squares: unlike
the imaginary part of the susceptibility r . Z^-1 r, in which the loss of a good suspension drowns, nothing cancels.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from suspension_cli.analysis import signals
from suspension_cli.analysis.signals import Signal
from suspension_cli.conventions import BOLTZMANN, DOFS
from suspension_cli.design.scene import Array
from suspension_cli.errors import Fault, InputError, shown
from suspension_cli.mechanics import dispersive
from suspension_cli.mechanics.dispersive import EvaluatedBlock
from suspension_cli.mechanics.model import LinearModel

EARTH = 6.371e6
"""Mean radius of the Earth, m (Moritz, J. Geodesy 74, 128 (2000))."""
CHUNK = 1024
"""Frequencies worked on at once: their matrices stay in the cache."""
ROUNDING = 1e-9
"""A source below 0 by more than this share of the sum gives power back; by less, it is rounding."""


@dataclass(frozen=True)
class Thermal:
    """Thermal noise of one motion.

    Attributes
    ----------
    frequency : (f,) array
        Hz.
    output : str
        What is observed.
    unit : str
        Of the motion: m or rad.
    source : tuple of str
        What dissipates: ``test.bending-upper`` and so on, the strongest (over all frequencies) first.
    density : (s, f) array
        One-sided power spectral density of each source's part, unit^2/Hz.
    tilt : float
        Angle (rad) by which the direction observed rises above x.
    """

    frequency: Array
    output: str
    unit: str
    source: tuple[str, ...]
    density: Array
    tilt: float = 0.0

    @property
    def amplitude(self) -> Array:
        """Amplitude spectral density (f,) of the sum, unit/sqrt(Hz)."""
        return np.sqrt(self.density.sum(0))

    @property
    def parts(self) -> dict[str, Array]:
        """Amplitude spectral density of each source's part."""
        return {name: np.sqrt(row) for name, row in zip(self.source, self.density, strict=True)}


def solve(model: LinearModel, frequency: Array, row: Array, signal: Signal, temperature: float) -> Thermal:
    """Thermal noise of a linear form of the coordinates.

    Parameters
    ----------
    model : LinearModel
        On `beam` or `violin`.
    frequency : (f,) array
        Hz, above 0.
    row : (N,) array
        The linear form; the support is at rest.
    signal : Signal
        Its name and unit.
    temperature : float
        Of dampers and of the support's loss, K.

    Returns
    -------
    Thermal
        Without the sources that have no part in the motion; none at all for a model (or a motion) without loss.

    Raises
    ------
    InputError
        At a resonance without loss, and if a part gives power back (a spring or damper whose matrix is not positive).
    """
    omega = 2 * np.pi * np.asarray(frequency, dtype=float)
    powers: dict[str, Array] = {}
    for block in dispersive.blocks(model):
        force = row[block.keep][:, None]
        if not force.any():
            continue
        for start in range(0, len(omega), CHUNK):
            now = slice(start, start + CHUNK)
            there = block.at(omega[now])
            motion = there.solve(np.zeros((6, 1)), force)[:, 0]
            for (cause, warmth), lost in dissipated(there, motion, temperature).items():
                power = powers.setdefault(cause, np.zeros(len(omega)))
                power[now] += 4 * BOLTZMANN * warmth * lost / omega[now]
    powers = {name: power for name, power in powers.items() if power.any()}
    _demand_sound(powers, omega)
    order = strongest_first(powers)
    density = np.array([powers[name] for name in order]).reshape(-1, len(omega)).clip(0)
    return Thermal(np.asarray(frequency), signal.text, signal.unit, tuple(order), density)


def strongest_first(densities: dict[str, Array]) -> list[str]:
    """Sources by the mean of the logarithm of their densities: those first that matter over most of the band."""
    return sorted(densities, key=lambda name: -float(np.log(densities[name].clip(1e-300)).mean()))


def _demand_sound(powers: dict[str, Array], omega: Array) -> None:
    """Raise `InputError` where a density is infinite or below 0."""
    total = sum(powers.values(), np.zeros(len(omega)))
    if not np.isfinite(total).all():
        at = float(omega[~np.isfinite(total)][0]) / (2 * np.pi)
        remedy = "move it, or give loss_angle or damping"
        raise InputError([Fault("--frequency", "is a resonance without loss, where the noise is infinite", remedy, shown(at))])
    for name, power in powers.items():
        if (power < -ROUNDING * total).any():
            remedy = "make its stiffness and damping matrices positive, or its loss angle 0"
            raise InputError([Fault(name, "gives power back instead of dissipating it, so it has no thermal noise", remedy)])


def dissipated(there: EvaluatedBlock, motion: Any, temperature: float) -> dict[tuple[str, float], Array]:
    """x^H Im(Z) x (f,) by cause and its temperature, for motions (c, f) of a block with the support at rest."""
    result: dict[tuple[str, float], Array] = {}
    block = there.block
    whole = np.concatenate([np.zeros((6, motion.shape[1])), motion])
    for term in there.terms:
        for key, lost in term.dissipated(whole).items():
            result[key] = result.get(key, 0.0) + lost
    for cause, matrix, factor in (("damping", block.damping[:, 6:], there.omega), ("support", np.imag(block.constant[:, 6:]), 1.0)):
        if matrix.any():
            lost = factor * np.einsum("if,ij,jf->f", np.conj(motion), matrix, motion, optimize=True).real
            result[cause, temperature] = result.get((cause, temperature), 0.0) + lost
    return result


def susceptibility(model: LinearModel, frequency: Array, row: Array, temperature: float) -> Array:
    """The same density (f,) from -Im(r . Z^-1 r): 4 k T / omega times it.  Loses the digits that a high Q takes; all at one temperature."""
    omega = 2 * np.pi * np.asarray(frequency, dtype=float)
    total = np.zeros(len(omega))
    for block in dispersive.blocks(model):
        force = row[block.keep][:, None]
        if force.any():
            total += (force.T @ np.moveaxis(block.at(omega).solve(np.zeros((6, 1)), force), -1, 0))[:, 0, 0].imag
    return -4 * BOLTZMANN * temperature / omega * total


def observed(model: LinearModel, text: str, tilt: float = 0.0) -> tuple[Signal, Array]:
    """A motion by name, and its linear form; a motion along x is taken along a beam that rises by `tilt` (rad) instead."""
    signal = signals.motion(text, signals.bodies(model))
    row = signals.row(signal, model)
    if tilt and DOFS[signal.dof] == "x":
        row = np.cos(tilt) * row + np.sin(tilt) * signals.row(replace(signal, dof=DOFS.index("z")), model)
    return signal, row


def arm_tilt(length: float) -> float:
    """Angle (rad) between a beam of some length (m) and the horizontal at its mirrors: the verticals at its two ends meet in the Earth's centre."""
    return length / (2 * EARTH)
