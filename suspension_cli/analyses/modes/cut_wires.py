"""Linear system with every wire with mass cut in two.

Each wire is cut at a point of no symmetry, whose motion becomes six more coordinates. Then a violin
mode that moves no body has a shape too, and no stiffness function is near its pole at a mode.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from suspension_cli.elements.dynamic_wire import COORDINATES, PARTS
from suspension_cli.elements.joined_sections import ENDS
from suspension_cli.linear.frequency_terms import WireTerm
from suspension_cli.linear.pencil import Pencil
from suspension_cli.linear.system import LinearSystem, Stretching
from suspension_cli.scene.arrays import Array
from suspension_cli.scene.composition import Fibre

CUTS = ((3 - 5**0.5) / 2, 0.36, 0.45)
"""Fractions of a wire above the cut, tried in turn: the golden section is far from nodes of low
order, but a piece may resonate at the frequency of a mode."""
PER_WIRE = sum(COORDINATES[part] // 2 for part in PARTS)
"""Coordinates of a cut."""


def cut_all(model: LinearSystem, fraction: float = CUTS[0]) -> tuple[LinearSystem, list[WireTerm]]:
    """Cut every wire in two; also return the wires of each kind.

    The coordinates are the model's, then those of every cut. The first terms are the upper and
    lower pieces of the wires of each kind.
    """
    whole = [term for term in model.terms if isinstance(term, WireTerm)]
    names = [
        f"{term.stage}.cut{n}.{k}"
        for term in whole
        for n in range(len(term.forms["twist"]))
        for k in range(PER_WIRE)
    ]
    size = model.size + len(names)
    soft = np.zeros((size, size), dtype=Pencil.of(model).soft.dtype)
    soft[: model.size, : model.size] = Pencil.of(model).soft
    pieces, start = [], model.size
    for term in whole:
        upper, lower = _cut(term, fraction, start, size)
        for sign, one in (-1, term), (1, upper), (1, lower):
            soft[np.ix_(one.columns, one.columns)] += sign * _static_stiffness(one)
        pieces += [upper, lower]
        start += PER_WIRE * len(term.forms["twist"])
    others = [term for term in model.terms if not isinstance(term, WireTerm)]

    def padded(matrix: Array) -> Array:
        return np.pad(matrix, (0, size - model.size))

    system = LinearSystem(
        model.body,
        (*model.coordinate, *names),
        np.eye(size),
        np.append(model.massless, np.ones(len(names), dtype=bool)),
        padded(model.mass),
        np.real(soft),
        padded(model.damping),
        None if model.lossy is None else soft,
        Stretching(np.zeros((0, size)), np.zeros(0), soft),
        terms=(*pieces, *(term.spread(np.eye(model.size, size)) for term in others)),
        active=model.active,
    )
    return system, whole


def _cut(term: WireTerm, fraction: float, start: int, size: int) -> list[WireTerm]:
    """Cut the wires of a kind; their cuts are the coordinates from `start` on."""
    upper: dict[str, Array] = {}
    lower: dict[str, Array] = {}
    for part in PARTS:
        p = COORDINATES[part] // 2
        ends = np.zeros((len(term.forms[part]), 3 * p, size))
        outer = ENDS[p] @ term.forms[part]
        ends[:, :p, : outer.shape[2]], ends[:, 2 * p :, : outer.shape[2]] = (
            outer[:, :p],
            outer[:, p:],
        )
        for n in range(len(ends)):
            ends[n, p : 2 * p, start + PER_WIRE * n : start + PER_WIRE * n + p] = np.eye(p)
        back = np.linalg.inv(ENDS[p])
        upper[part], lower[part] = back @ ends[:, : 2 * p], back @ ends[:, p:]
        start += p
    every = np.arange(size)
    fibres = _cut_fibre(term.strand.fibre, fraction)
    return [
        WireTerm(
            term.stage, replace(term.strand, fibre=fibre), term.number, every, forms, size
        ).spread(np.eye(size))
        for fibre, forms in zip(fibres, (upper, lower), strict=True)
    ]


def _static_stiffness(term: WireTerm) -> Array:
    """Static stiffness of wires among `term.columns`, without their stretching."""
    result = np.zeros((len(term.columns),) * 2)
    for part, rows in term.motion.items():
        if part != "stretch":
            static = term.strand.static[part]
            result += np.einsum("wic,ij,wjd->cd", rows, static, rows)
    return result


def _cut_fibre(fibre: Fibre, fraction: float) -> tuple[Fibre, Fibre]:
    """Divide a wire at the cut into an upper and a lower piece."""
    left = fraction * sum(section.length for section in fibre.sections)
    upper, lower = [], []
    for section in fibre.sections:
        inside = min(max(left, 0.0), section.length)
        left -= section.length
        if inside > 1e-12 * section.length:
            upper.append(replace(section, length=inside))
        if section.length - inside > 1e-12 * section.length:
            lower.append(replace(section, length=section.length - inside))
    return replace(fibre, sections=tuple(upper)), replace(fibre, sections=tuple(lower))
