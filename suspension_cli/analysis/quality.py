"""Q and dilution of modes, to first order in the losses: what is dissipated in the shape that the mode has without them.

    1/Q = x^H Im(Z(omega)) x / (omega^2 x^T G x),        G = -d Re(Z) / d(omega^2)  (M, where stiffness does not depend on frequency).

Eigenvalues of the lossy system lose a Q of 1e9 in the rounding of its frequency; sums of squares keep all its digits.
`analysis.damped` goes beyond first order.  The dilution factor is the total energy over that in what is lossy
(bending, stretching, blades, ..., not the tension's): 1/Q = phi / dilution for a single loss angle phi.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from suspension_cli.design.fibres import Fibre, Losses
from suspension_cli.design.scene import Array
from suspension_cli.mechanics.dispersion import LossTerm, WireTerm
from suspension_cli.mechanics.fibre import PARTS, Strand
from suspension_cli.mechanics.model import LinearModel
from suspension_cli.mechanics.twofold import Twofold

NOTHING = 1e-30
"""What a shape that is wrong by roundings dissipates in parts that do not take part in it, over its energy."""
UNIT = 1e-9
"""A loss angle so small that what it dissipates is it times the elastic energy."""


def dissipated(model: LinearModel, omega: Array, shapes: Array, wires: Sequence[tuple[Strand, dict[str, Any]]]) -> tuple[Array, Array]:
    """What modes dissipate, x^H Im(Z) x, and the same with every loss angle 1 rad: twice the energy in lossy elements.

    Parameters
    ----------
    model : LinearModel
    omega : (m,) array
        rad/s.
    shapes : (m, N) array
        Motion of the model's own coordinates.
    wires : sequence of (Strand, dict of (c, w, m) arrays)
        Every kind of wire and the motion of its ends, for each of its parts.

    Returns
    -------
    lost, elastic : (m,) arrays
    """
    lost, elastic = np.zeros(len(omega)), np.zeros(len(omega))
    for strand, ends in wires:
        real, unit = strand.at(omega), replace(strand, fibre=_alike(strand.fibre), surrounded=None).at(omega)
        for part in PARTS:
            lost += sum(value.sum(0) for value in real.dissipated(part, ends[part]).values())
            elastic += sum(value.sum(0) for value in unit.dissipated(part, ends[part]).values()) / UNIT
    for term in model.terms:
        if isinstance(term, LossTerm):
            value = np.einsum("mi,ij,mj->m", shapes, term.matrix, shapes)
            lost += term.angle(omega) * value
            elastic += value if term.elastic else 0.0
    lost += omega * np.einsum("mi,ij,mj->m", shapes, model.damping, shapes)
    if model.lossy is not None:
        low = np.zeros_like(model.stiffness) if model.low is None else np.imag(model.low)
        moved = Twofold.of(shapes.T)
        lost += (moved * (Twofold(model.lossy.imag, low) @ moved)).summed().value
    return lost, elastic


def ends_of(model: LinearModel, shapes: Array) -> list[tuple[Strand, dict[str, Any]]]:
    """Every kind of wire and the motion of its ends in modes of shapes (m, N)."""
    terms = [term for term in model.terms if isinstance(term, WireTerm)]
    return [(term.strand, {part: np.einsum("wcN,mN->cwm", rows, shapes) for part, rows in term.forms.items()}) for term in terms]


def ratio(total: Array, part: Array) -> Array:
    """total / part, infinite where part is 0 but for the square of a rounding."""
    some = part > NOTHING * total
    return np.where(some, total / np.where(some, part, 1.0), np.inf)


def _alike(fibre: Fibre) -> Fibre:
    """A wire whose every deformation has the loss angle `UNIT`."""
    losses = Losses(UNIT, None, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0)
    return replace(fibre, sections=tuple(replace(section, losses=losses) for section in fibre.sections))
