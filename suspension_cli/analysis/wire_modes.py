"""Modes of a suspension whose wires have mass: pendulum, bounce and violin modes in one list.

`mechanics.count` finds all frequencies.  For the shapes every wire is cut at a point of no symmetry, whose motion becomes six more coordinates: then
a violin mode that moves no body has a shape too, and no function is near its pole at a mode.  At a mode the stiffness of this larger
system is singular; what it takes to nothing is the shape, and from that come kinetic energies, Q and dilution.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from suspension_cli.analysis import modes as static_modes
from suspension_cli.analysis import quality
from suspension_cli.analysis.modes import Modes
from suspension_cli.design.fibres import Fibre
from suspension_cli.design.scene import Array
from suspension_cli.errors import Fault, InputError
from suspension_cli.mechanics import count, joined
from suspension_cli.mechanics.dispersion import WireTerm
from suspension_cli.mechanics.fibre import PARTS, WIDTH, Strand
from suspension_cli.mechanics.model import LinearModel

CUT = (3 - 5**0.5) / 2
"""Where wires are cut: the golden section is far from all nodes of low order."""
SLOWEST = 1e-4
"""Share of the lowest static frequency below which no mode is looked for."""
DEGENERATE = 1e-10
"""Relative difference of frequencies below which modes are one degenerate group."""
ASIDE = np.array([0.97, 1.0, 1.03])
"""Times a mode's frequency: where the sizes of stiffnesses are taken, and the mode."""
STEP = 1e-20
"""Of the complex step that differentiates stiffnesses by frequency."""
NAMES = {"bend-1": "violin-x", "bend-2": "violin-y", "stretch": "stretch", "twist": "twist"}


@dataclass(frozen=True)
class CutWires:
    """Wires of one kind, cut in two.

    Attributes
    ----------
    stage : str
    whole : Strand
    pieces : tuple of two Strand
    ends : dict of arrays
        For each part, how the ends (upper, cut, lower; p coordinates each) of every wire move: (w, 3 p, A).
    """

    stage: str
    whole: Strand
    pieces: tuple[Strand, Strand]
    ends: dict[str, Any]

    def piece_ends(self, part: str) -> tuple[Any, Any]:
        """How the ends of the upper and of the lower piece move: (w, 2 p, A) each."""
        p = WIDTH[part] // 2
        return self.ends[part][:, : 2 * p], self.ends[part][:, p:]


def solve(model: LinearModel, highest: float) -> Modes:
    """All modes up to a frequency.

    Parameters
    ----------
    model : LinearModel
        On `violin`.
    highest : float
        Hz.

    Returns
    -------
    Modes
        Unstable modes (for which the mass of wires does not count) first.
    """
    still = static_modes.solve(replace(model, terms=()))
    lowest = SLOWEST * float(np.sqrt(np.abs(still.omega_squared[still.omega_squared != 0]).min(initial=(2 * np.pi) ** 2)))
    omega = count.frequencies(model, 2 * np.pi * highest, lowest)
    if not len(omega):
        raise InputError([Fault("--max-frequency", "lies below the lowest mode", "raise it", f"{highest!r}")])
    wires, size = _cut(model)
    shapes = _shapes(model, wires, size, omega)
    total, body, kinds = _kinetic(model, wires, omega, shapes)
    wire, names = _by_name(kinds, total)
    moved = [(strand, motion) for cut in wires for strand, motion in zip(cut.pieces, _motion(cut, shapes), strict=True)]
    lost, elastic = quality.dissipated(model, omega, shapes[:, : model.size], moved)
    energy, tips = body[:, : 6 * len(model.body)], body[:, 6 * len(model.body) :]
    share = (energy / total[:, None]).reshape(len(omega), -1, 6), tips / total[:, None]
    shape = (shapes[:, : model.size] @ model.basis.T / np.sqrt(total)[:, None])[:, 6:]
    found = Modes(
        body=model.body,
        coordinate=model.coordinate[6:],
        omega_squared=omega**2,
        shape=_signed(shape),
        energy=share[0],
        tip_energy=share[1],
        block=_block(model, shapes),
        q=quality.ratio(omega**2 * total, lost),
        dilution=quality.ratio(omega**2 * total, elastic),
        wire=names,
        wire_energy=wire / total[:, None],
        order=np.zeros(len(omega), dtype=np.intp),
        decay_rate=lost / (2 * omega * total),
    )
    found = replace(found, order=_orders(found, kinds))
    return _with_unstable(found, still)


def _cut(model: LinearModel) -> tuple[list[CutWires], int]:
    """Every kind of wire cut in two, and the size of the larger system: the model's coordinates, then six of every cut."""
    terms = [term for term in model.terms if isinstance(term, WireTerm)]
    per_wire = sum(WIDTH[part] // 2 for part in PARTS)
    size = model.size + per_wire * sum(len(term.forms["twist"]) for term in terms)
    wires, start = [], model.size
    for term in terms:
        number, ends, offset = len(term.forms["twist"]), {}, 0
        for part in PARTS:
            p = WIDTH[part] // 2
            outer = np.einsum("ij,wjN->wiN", joined.ENDS[p], term.forms[part])
            every = np.zeros((number, 3 * p, size))
            every[:, :p, : model.size], every[:, 2 * p :, : model.size] = outer[:, :p], outer[:, p:]
            for w in range(number):
                for k in range(p):
                    every[w, p + k, start + per_wire * w + offset + k] = 1.0
            ends[part] = every
            offset += p
        upper, lower = _halved(term.strand.fibre)
        wires.append(CutWires(term.stage, term.strand, (replace(term.strand, fibre=upper), replace(term.strand, fibre=lower)), ends))
        start += per_wire * number
    return wires, size


def _halved(fibre: Fibre) -> tuple[Fibre, Fibre]:
    """A wire as two: above and below the cut."""
    left = CUT * sum(section.length for section in fibre.sections)
    upper, lower = [], []
    for section in fibre.sections:
        inside = min(max(left, 0.0), section.length)
        left -= section.length
        if inside > 1e-12 * section.length:
            upper.append(replace(section, length=inside))
        if section.length - inside > 1e-12 * section.length:
            lower.append(replace(section, length=section.length - inside))
    return replace(fibre, sections=tuple(upper)), replace(fibre, sections=tuple(lower))


def _stiffness(model: LinearModel, wires: list[CutWires], size: int, omega: Array) -> Any:
    """Real dynamic stiffness (m, A, A) of the larger system."""
    constant = model.stiffness.copy()
    for term in model.terms:
        if isinstance(term, WireTerm):
            static = np.array([term.strand.static[part][i, j] for part, i, j in term.functions])
            constant -= np.tensordot(static, term.matrices, 1)
    result = np.zeros((len(omega), size, size))
    result[:, : model.size, : model.size] = constant - omega[:, None, None] ** 2 * model.mass
    for cut in wires:
        for part in PARTS:
            for strand, ends in zip(cut.pieces, cut.piece_ends(part), strict=True):
                result += _assembled(ends, _on_ends(strand, part, omega))
    return result


def _on_ends(strand: Strand, part: str, omega: Any) -> Any:
    """Stiffness (2p, 2p, m) of a piece between its ends, without loss."""
    return joined.ends(replace(strand, lossy=False).at(omega).stiffness(part))


def _assembled(ends: Any, stiffness: Any) -> Any:
    """Sum over wires of E^T F E: (m, A, A)."""
    rows = np.einsum("abm,wbA->mwaA", stiffness, ends)
    count, width = ends.shape[0] * ends.shape[1], ends.shape[2]
    return np.swapaxes(ends.reshape(count, width), 0, 1) @ rows.reshape(len(rows), count, width)


def _shapes(model: LinearModel, wires: list[CutWires], size: int, omega: Array) -> Array:
    """Shapes (m, A): what the larger system's stiffness takes to nothing, the support at rest."""
    result = np.zeros((len(omega), size))
    start = 0
    while start < len(omega):
        stop = start + 1
        while stop < len(omega) and omega[stop] - omega[stop - 1] <= DEGENERATE * omega[stop]:
            stop += 1
        below, matrix, above = _stiffness(model, wires, size, omega[start:stop].mean() * ASIDE)[:, 6:, 6:]
        # a coordinate that resonates by itself has no stiffness at its mode, so sizes are taken beside it
        scale = 1 / np.sqrt(np.maximum(np.abs(np.diag(below)), np.abs(np.diag(above))))
        values, vectors = np.linalg.eigh(matrix * scale[:, None] * scale)
        nearest = np.argsort(np.abs(values))[: stop - start]
        vectors = static_modes.localised(np.zeros(stop - start), vectors[:, nearest])
        result[start:stop, 6:] = (vectors * scale[:, None]).T
        start = stop
    return result


def _motion(cut: CutWires, shapes: Array) -> list[dict[str, Any]]:
    """Even and odd motion (c, w, m) of both pieces of every wire in modes (m, A), by part."""
    pieces: list[dict[str, Any]] = [{}, {}]
    for part in PARTS:
        back = np.linalg.inv(joined.ENDS[WIDTH[part] // 2])
        for piece, ends in zip(pieces, cut.piece_ends(part), strict=True):
            piece[part] = np.einsum("ab,wbA,mA->awm", back, ends, shapes, optimize=True)
    return pieces


def _kinetic(model: LinearModel, wires: list[CutWires], omega: Array, shapes: Array) -> tuple[Array, Array, list[tuple[CutWires, str, Array]]]:
    """Twice the kinetic energy over omega^2: in all, of each coordinate of the bodies (m, N - 6), and of every part of every kind of wire."""
    own = shapes[:, : model.size]
    total = np.einsum("mi,ij,mj->m", own, model.mass, own)
    body, tips = static_modes.energies(model, own)
    body = np.concatenate([body, tips], axis=1) * total[:, None]
    kinds: list[tuple[CutWires, str, Array]] = []
    for cut in wires:
        own = {part: np.zeros(len(omega)) for part in PARTS}
        for strand, motion in zip(cut.pieces, _motion(cut, shapes), strict=True):
            moving = replace(strand, lossy=False).at(omega * (1 + 1j * STEP))
            for part in PARTS:
                slope = moving.stiffness(part).imag / STEP  # omega dF/domega = 2 omega^2 dF/d(omega^2)
                own[part] -= np.einsum("awm,abm,bwm->m", motion[part], slope, motion[part], optimize=True) / (2 * omega**2)
        kinds += [(cut, part, own[part]) for part in PARTS]
    return total + sum((energy for _, _, energy in kinds), np.zeros(len(omega))), body, kinds


def _by_name(kinds: list[tuple[CutWires, str, Array]], total: Array) -> tuple[Array, tuple[str, ...]]:
    """Energies (m, k) of what the wires of each stage do, and its names; what never moves is left out."""
    wire: dict[str, Array] = {}
    for cut, part, energy in kinds:
        name = f"{cut.stage}.{NAMES[part]}"
        wire[name] = wire.get(name, 0.0) + energy
    names = tuple(name for name in wire if (wire[name] > 1e-12 * total).any())
    return np.array([wire[name] for name in names]).reshape(-1, len(total)).T, names


def _block(model: LinearModel, shapes: Array) -> Any:
    """The block of coordinates in which each mode moves most; modes that move no body count as of the first."""
    size = np.array([np.abs(shapes[:, group]).sum(1) for group in model.blocks])
    return size.argmax(0)


def _orders(found: Modes, kinds: list[tuple[CutWires, str, Array]]) -> Any:
    """Number of half waves of each mode that lives in wires: the nearest resonance between held ends of the kind that moves most."""
    result = np.zeros(len(found.q), dtype=np.intp)
    home, omega = found.home, np.sqrt(found.omega_squared)
    for stage, dof in set(home):
        alike = [(cut, part, energy) for cut, part, energy in kinds if (cut.stage, NAMES[part]) == (stage, dof)]
        if not alike:
            continue
        here = np.array([n for n, place in enumerate(home) if place == (stage, dof)])
        most = np.array([energy[here] for _, _, energy in alike]).argmax(0)
        for number in set(most.tolist()):
            cut, part, _ = alike[number]
            own = here[most == number]
            resonances = cut.whole.held_resonances(part, float(omega[own].max()))
            result[own] = np.abs(resonances - omega[own, None]).argmin(1) + 1
    return result


def _signed(shape: Array) -> Array:
    """Shapes with the sign in which their largest coordinate is positive."""
    if not shape.size:
        return shape
    lead = shape[np.arange(len(shape)), np.abs(shape).argmax(1)]
    return shape * np.where(lead < 0, -1.0, 1.0)[:, None]


def _with_unstable(found: Modes, still: Modes) -> Modes:
    """Modes that do not oscillate in front: those of the model at rest."""
    n = int((still.omega_squared <= 0).sum())
    if not n:
        return found
    k = len(found.wire)

    def both(name: str) -> Any:
        return np.concatenate([getattr(still, name)[:n], getattr(found, name)])

    merged = {name: both(name) for name in ("omega_squared", "shape", "energy", "tip_energy", "block", "q", "dilution", "order", "decay_rate")}
    return replace(found, **merged, wire_energy=np.concatenate([np.zeros((n, k)), found.wire_energy]))
