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
from suspension_cli.linear.double_double import DoubleDouble
from suspension_cli.linear.frequency_terms import LossTerm, WireTerm
from suspension_cli.linear.system import LinearSystem
from suspension_cli.scene.composition import Fibre

if TYPE_CHECKING:
    from jaxtyping import Float

NOTHING = 1e-30
"""Ratio of dissipation to energy that rounding errors cause in parts at rest."""
UNIT = 1e-9
"""A loss angle in rad, so small that dissipation is proportional to it."""


def dissipation(
    model: LinearSystem,
    omega: Float[np.ndarray, " mode"],
    shapes: Float[np.ndarray, "mode coordinate"],
    wires: Sequence[tuple[TautWire, dict[str, Float[np.ndarray, "_ _ mode"]]]],
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
        low = np.zeros_like(model.stiffness) if model.low is None else np.imag(model.low)
        motion = DoubleDouble.of(shapes.T)
        dissipation += (motion * (DoubleDouble(np.imag(model.lossy), low) @ motion)).summed().value
    return dissipation if model.active else np.maximum(dissipation, 0.0), elastic


def quadratic_form(
    matrix: Float[np.ndarray, "coordinate coordinate"],
    shapes: Float[np.ndarray, "mode coordinate"],
) -> Float[np.ndarray, " mode"]:
    """x^T A x of real shapes x, for a symmetric A."""
    return ((shapes @ matrix) * shapes).sum(1)


def end_motions(
    model: LinearSystem, shapes: Float[np.ndarray, "mode coordinate"]
) -> list[tuple[TautWire, dict[str, Float[np.ndarray, "_ _ mode"]]]]:
    """Compute the `wires` of `dissipation` for shapes."""
    terms = [term for term in model.terms if isinstance(term, WireTerm)]
    return [
        (
            term.strand,
            {part: np.einsum("wcN,mN->cwm", rows, shapes) for part, rows in term.forms.items()},
        )
        for term in terms
    ]


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
