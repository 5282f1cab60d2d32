"""Q and dilution of modes to first order in the loss, from the dissipation in undamped shapes.

    1/Q = x^H Im(Z(omega)) x / (omega^2 x^T G x),    G = -d Re(Z) / d(omega^2)  (G = M where the
    stiffness does not depend on frequency).

Eigenvalues of the lossy system would lose a Q of 1e9 in the rounding of the frequency; sums of
squares keep all its digits. `linear.damped` goes beyond first order. The dilution factor is
the total energy over that in lossy elements (bending, stretching, blades, ...; not the energy of
the tension): 1/Q = phi / dilution for a single loss angle phi.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design.losses.bulk import Bulk
from suspension_cli.elements.dynamic_wire import PARTS, TautWire
from suspension_cli.linear.frequency_terms import LossTerm, WireTerm
from suspension_cli.linear.system import LinearSystem
from suspension_cli.scene.composition import Fibre

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact

NOTHING = 1e-30
"""Ratio of dissipation to energy that rounding errors cause in parts at rest."""
STEP = 1e-20
"""Relative complex step in frequency, for derivatives of stiffnesses."""
UNIT = 1e-9
"""A loss angle in rad, so small that dissipation is proportional to it."""


def dissipation(
    model: LinearSystem,
    omega: Float[np.ndarray, " mode"],
    shapes: Inexact[np.ndarray, "mode coordinate"],
    wires: Sequence[tuple[TautWire, dict[str, Inexact[np.ndarray, "_ _ mode"]]]],
) -> tuple[Float[np.ndarray, " mode"], Float[np.ndarray, " mode"]]:
    """Compute the dissipation x^H Im(Z) x of modes, and its value with all loss angles 1 rad.

    The latter is twice the energy in lossy elements. `omega` in rad/s; `shapes` (m, N) in the
    system's own coordinates. `wires` are the kinds of wire, each with the motion (c, w, m) of its
    ends for each of `dynamic_wire.PARTS`.
    """
    dissipation, elastic = np.zeros(len(omega)), np.zeros(len(omega))
    for strand, ends in wires:
        actual, unit = (
            strand.at(omega),
            replace(strand, fibre=_with_unit_loss(strand.fibre), surrounded=None).at(omega),
        )
        for part in PARTS:
            dissipation += sum(
                value.sum(0) for value in actual.dissipated(part, ends[part]).values()
            )
            elastic += (
                sum(value.sum(0) for value in unit.dissipated(part, ends[part]).values()) / UNIT
            )
    for term in model.terms:
        if isinstance(term, LossTerm):
            value = quadratic_form(term.matrix, shapes)
            dissipation += term.angle(omega) * value
            elastic += value if term.elastic else 0.0
    if model.damping.any():
        dissipation += omega * quadratic_form(model.damping, shapes)
    if model.lossy is not None:
        if model.stretched is None:
            dissipation += quadratic_form(np.imag(model.lossy), shapes)
        else:
            dissipation += quadratic_form(np.imag(model.stretched.soft), shapes)
            elongation = shapes @ model.stretched.form.T
            dissipation += np.abs(elongation) ** 2 @ np.imag(model.stretched.stiffness)
    return dissipation if model.active else np.maximum(dissipation, 0.0), elastic


def quadratic_form(
    matrix: Float[np.ndarray, "coordinate coordinate"],
    shapes: Inexact[np.ndarray, "mode coordinate"],
) -> Float[np.ndarray, " mode"]:
    """x^H A x of shapes x, for a symmetric A."""
    return np.real((shapes @ matrix) * shapes.conj()).sum(1)


def end_motions(
    model: LinearSystem, shapes: Inexact[np.ndarray, "mode coordinate"]
) -> list[tuple[TautWire, dict[str, Inexact[np.ndarray, "_ _ mode"]]]]:
    """Compute the `wires` of `dissipation` for shapes."""
    result = []
    for term in model.terms:
        if isinstance(term, WireTerm):
            own = shapes[:, term.columns].T
            moved = {part: form[..., term.columns] @ own for part, form in term.forms.items()}
            result.append((term.strand, {part: m.swapaxes(0, 1) for part, m in moved.items()}))
    return result


def wire_energies(
    strand: TautWire,
    ends: dict[str, Inexact[np.ndarray, "_ _ mode"]],
    omega: Float[np.ndarray, " mode"],
) -> dict[str, Float[np.ndarray, " mode"]]:
    """Compute twice the kinetic energy of wires over omega^2, -x^H dF/d(omega^2) x, by part.

    F is their dynamic stiffness at the motion x of their ends.
    """
    moving = replace(strand, lossy=False).at(omega * (1 + 1j * STEP))
    result = {}
    for part, motion in ends.items():
        # omega dF/domega = 2 omega^2 dF/d(omega^2)
        slope = np.imag(moving.stiffness(part)) / STEP
        pushed = np.einsum("abm,bwm->awm", slope, motion)
        result[part] = -np.real(motion.conj() * pushed).sum((0, 1)) / (2 * omega**2)
    return result


def knows_energy(model: LinearSystem) -> bool:
    """Whether the energy in lossy elements is known; tables against frequency lack it."""
    return any(not isinstance(term, LossTerm) or term.storage is None for term in model.terms)


def safe_ratio(
    total: Float[np.ndarray, "*batch"], part: Float[np.ndarray, "*batch"]
) -> Float[np.ndarray, "*batch"]:
    """Divide total by part; infinite where part is 0 to the square of a rounding error."""
    some = part > NOTHING * total
    return np.where(some, total / np.where(some, part, 1.0), np.inf)


def _with_unit_loss(fibre: Fibre) -> Fibre:
    """Copy a wire, with the loss angle `UNIT` in all deformations."""
    losses = (Bulk(UNIT),)
    return replace(
        fibre, sections=tuple(replace(section, losses=losses) for section in fibre.sections)
    )
