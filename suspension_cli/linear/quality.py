"""Decay, dilution and kinetic energy of modes, from the dissipation in their shapes.

>>> from suspension_cli.design import reader
>>> from suspension_cli.linear import batch_modes
>>> from suspension_cli.models import registry
>>> model = registry.BEAM.system(reader.parse(reader.template("single", "single")))
>>> solved = batch_modes.solve(model)
>>> poles = 1j * np.sqrt(solved.omega_squared)
>>> evaluate(model, poles, solved.motion).q[3:].round()
array([5049., 5000., 4998.])

Rounding of the stiffness would hide a Q of 1e10 in a pole s = sigma + i omega. With Z' = dZ/ds, the
imaginary part of x^H Z(s) x = 0 gives sigma from the dissipation at omega, sums of squares in which
nothing cancels:

    sigma Im(x^H Z' x) = -x^H Im(Z(i omega)) x,    Im(x^H Z' x) = 2 omega x^H G x,

with G = -d Re(Z) / d(omega^2), which is M where the stiffness does not depend on frequency. In an
undamped shape this is Q = omega / (-2 sigma) to first order in the loss.

The dilution factor is the total energy over that in lossy elements (bending, stretching, blades,
...; not the energy of the tension): 1/Q = phi / dilution for a single loss angle phi.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.elements.dynamic_wire import PARTS
from suspension_cli.linear.matrix_terms import StiffnessTable
from suspension_cli.linear.system import LinearSystem
from suspension_cli.linear.terms import TermWithStates, quadratic_form
from suspension_cli.linear.wire_term import WireTerm, is_massive

if TYPE_CHECKING:
    from jaxtyping import Complex, Float, Inexact

NOTHING = 1e-30
"""Ratio of dissipation to energy that rounding errors cause in parts at rest."""
SLOW = 1e-4
"""Decay rate over frequency up to which it follows from the dissipation."""
STEP = 1e-20
"""Relative complex step in frequency, for derivatives of stiffnesses."""
UNIT = 1e-9
"""A loss angle in rad, so small that dissipation is proportional to it."""


@dataclass(frozen=True)
class Quality:
    """Decay and energies of modes of any size.

    Attributes
    ----------
    value
        Poles, rad/s; the slow decays of those that oscillate are from dissipation.
    q
        Im s / (-2 Re s); infinite without decay, 0 where nothing oscillates and energy is lost.
    dilution
        NaN where the energy in lossy elements is not known, and where nothing oscillates.
    weight
        x^H G x: twice the kinetic energy over omega^2, that of wires included, kg m^2.
    bodily
        Fraction of this in bodies and blade tips.
    wires
        Fraction in each of `dynamic_wire.PARTS` of the wires of each term with mass.
    """

    value: Complex[np.ndarray, " mode"]
    q: Float[np.ndarray, " mode"]
    dilution: Float[np.ndarray, " mode"]
    weight: Float[np.ndarray, " mode"]
    bodily: Float[np.ndarray, " mode"]
    wires: Float[np.ndarray, "term part mode"]


def evaluate(
    model: LinearSystem,
    value: Complex[np.ndarray, " mode"],
    motion: Inexact[np.ndarray, "mode coordinate"],
    power: Float[np.ndarray, " mode"] | float = 0.0,
    *,
    wires: bool = True,
) -> Quality:
    """Evaluate poles `value` (rad/s) with motions (m, rad) of the system's own coordinates.

    `power` is Im x^H f of further forces -f. Without `wires` their mass is neglected.
    """
    oscillates = np.imag(value) > 0
    omega = np.maximum(np.imag(value), 0.0)
    x = motion.T
    lost, elastic = _dissipation(model, omega, x)
    bodily = quadratic_form(model.mass, x)
    moving = end_motions(model, motion) if wires and any(map(is_massive, model.terms)) else []
    energy = np.zeros((len(moving), len(PARTS), len(omega)))
    for n, (term, ends) in enumerate(moving):
        energy[n] = _wire_energies(term, ends, np.where(oscillates, omega, 1.0)) * oscillates
    weight = bodily + energy.sum((0, 1))
    lost = lost + power
    inertia = weight.copy()
    for term in model.terms:
        if isinstance(term, TermWithStates):
            inertia += term.inertia(np.where(oscillates, omega, 1.0), x)
    some = oscillates & (np.abs(lost) > NOTHING * omega**2 * weight)
    sigma = np.where(some, -lost / np.where(some, 2 * omega * inertia, 1.0), 0.0)
    slow = oscillates & (np.abs(np.real(value)) <= SLOW * omega)
    refined = np.where(slow, sigma + 1j * omega, value)
    decays = np.real(refined) < 0
    q = np.where(decays, omega / (-2 * np.where(decays, np.real(refined), -1.0)), np.inf)
    stores = elastic > NOTHING * omega**2 * weight
    dilution = np.abs(value) ** 2 * weight / np.where(stores, elastic, 1.0)
    dilution = np.where(stores, dilution, np.inf)
    # tables against frequency lack the energy in lossy elements
    known = any(not isinstance(term, StiffnessTable) for term in model.terms)
    return Quality(
        refined,
        np.where(~oscillates & (lost > 0), 0.0, q),
        np.where(oscillates & known, dilution, np.nan),
        weight,
        bodily / np.where(weight > 0, weight, 1.0),
        energy / np.where(weight > 0, weight, 1.0),
    )


def _dissipation(
    model: LinearSystem,
    omega: Float[np.ndarray, " mode"],
    x: Inexact[np.ndarray, "coordinate mode"],
) -> tuple[Float[np.ndarray, " mode"], Float[np.ndarray, " mode"]]:
    """Compute the dissipation x^H Im(Z) x, and twice the energy in lossy elements."""
    lost = omega * quadratic_form(model.damping, x)
    elastic = np.zeros(len(omega))
    if model.is_lossy:
        lost += quadratic_form(np.imag(model.soft), x)
        lost += np.imag(model.k) @ np.abs(model.elongation @ x) ** 2
    for term in model.terms:
        ends = term.within(term.columns)
        moved = x[term.columns]
        lost += sum(term.at(omega).dissipated(ends, moved).values())
        alike = term.with_loss_angle(UNIT)
        if alike is not None:
            elastic += sum(alike.at(omega).dissipated(ends, moved).values()) / UNIT
    return lost if model.active else np.maximum(lost, 0.0), elastic


def end_motions(
    model: LinearSystem, motion: Inexact[np.ndarray, "mode coordinate"]
) -> list[tuple[WireTerm, dict[str, Inexact[np.ndarray, "_ _ mode"]]]]:
    """Compute the motions (c, w, m) of the ends of all wires, by `dynamic_wire.PARTS`."""
    result = []
    for term in model.terms:
        if isinstance(term, WireTerm):
            own = motion[:, term.columns].T
            moved = {part: (rows @ own).swapaxes(0, 1) for part, rows in term.motion.items()}
            result.append((term, moved))
    return result


def _wire_energies(
    term: WireTerm,
    ends: dict[str, Inexact[np.ndarray, "_ _ mode"]],
    omega: Float[np.ndarray, " mode"],
) -> Float[np.ndarray, "part mode"]:
    """Compute twice the kinetic energy of wires over omega^2, -x^H dF/d(omega^2) x, by part.

    F is their dynamic stiffness at the motion x of their ends.
    """
    moving = replace(term.strand, lossy=False).at(omega * (1 + 1j * STEP))
    result = []
    for part in PARTS:
        # omega dF/domega = 2 omega^2 dF/d(omega^2)
        slope = np.imag(moving[part].stiffness) / STEP
        motion = ends[part]
        pushed = np.einsum("abm,bwm->awm", slope, motion)
        result.append(-np.real(motion.conj() * pushed).sum((0, 1)) / (2 * omega**2))
    return np.array(result)
