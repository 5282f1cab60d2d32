"""Wires with mass, cut in two: the dynamic stiffness of a suspension, and the shapes of its modes.

Every wire is cut at a point of no symmetry, whose motion becomes six more coordinates. Then a
violin mode that moves no body has a shape too, and no stiffness function is near its pole at a
mode. The dynamic stiffness of this larger system is singular at a mode; its null vector is the
shape. The tensions of the pieces are coordinates too (`linear.stretching`).
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.elements import joined_sections
from suspension_cli.elements.dynamic_wire import COORDINATES, PARTS, TautWire
from suspension_cli.linear import damped, eigenmodes, frequency_dependent
from suspension_cli.linear.frequency_terms import LossTerm, WireTerm
from suspension_cli.linear.mode_count import Progress
from suspension_cli.linear.system import LinearSystem
from suspension_cli.scene.composition import Fibre

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact

CUT = (3 - 5**0.5) / 2
"""Fraction of a wire above the cut: the golden section is far from nodes of low order."""
DEGENERATE = 1e-10
"""Relative difference of frequencies below which modes are one degenerate group."""
ASIDE = np.array([0.97, 1.0, 1.03])
"""Multiples of a mode's frequency at which matrices are evaluated: at it, and beside it for the
scale of coordinates."""
NUMBERS = 8_000_000
"""Most elements of the matrices that are evaluated at once, 64 MB."""


@dataclass(frozen=True)
class CutWires:
    """Wires of one kind, cut in two.

    Attributes
    ----------
    pieces
        Upper and lower piece.
    ends : dict of (w, 3 p, A) arrays
        For each part, the motion of the points (upper, cut, lower; p coordinates each) of every
        wire as linear forms of the larger system's coordinates.
    """

    stage: str
    whole: TautWire
    pieces: tuple[TautWire, TautWire]
    ends: dict[str, Float[np.ndarray, "wire _ coordinate"]]

    def piece_ends(
        self, part: str
    ) -> tuple[Float[np.ndarray, "wire end coordinate"], Float[np.ndarray, "wire end coordinate"]]:
        """Motion of the ends of the upper and of the lower piece, (w, 2 p, A) each."""
        p = COORDINATES[part] // 2
        return self.ends[part][:, : 2 * p], self.ends[part][:, p:]


def cut_all(model: LinearSystem) -> tuple[list[CutWires], int]:
    """Cut every wire in two; also return the size A of the larger system.

    Its coordinates are the model's, then those of every cut.
    """
    terms = [term for term in model.terms if isinstance(term, WireTerm)]
    per_wire = sum(COORDINATES[part] // 2 for part in PARTS)
    size = model.size + per_wire * sum(len(term.forms["twist"]) for term in terms)
    wires, start = [], model.size
    for term in terms:
        number, ends, offset = len(term.forms["twist"]), {}, 0
        for part in PARTS:
            p = COORDINATES[part] // 2
            outer = np.einsum("ij,wjN->wiN", joined_sections.ENDS[p], term.forms[part])
            every = np.zeros((number, 3 * p, size))
            every[:, :p, : model.size], every[:, 2 * p :, : model.size] = outer[:, :p], outer[:, p:]
            for w in range(number):
                for k in range(p):
                    every[w, p + k, start + per_wire * w + offset + k] = 1.0
            ends[part] = every
            offset += p
        upper, lower = (replace(term.strand, fibre=own) for own in _cut_fibre(term.strand.fibre))
        wires.append(CutWires(term.stage, term.strand, (upper, lower), ends))
        start += per_wire * number
    return wires, size


def _cut_fibre(fibre: Fibre) -> tuple[Fibre, Fibre]:
    """Divide a wire at the cut into an upper and a lower piece."""
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


def _add_losses(
    own: Inexact[np.ndarray, "frequency coordinate coordinate"],
    model: LinearSystem,
    omega: Inexact[np.ndarray, " frequency"],
    *,
    lossy: bool,
) -> None:
    """Add tables of stiffness, and where omega is complex dampers and losses, in place."""
    elastic = [term for term in model.terms if isinstance(term, LossTerm) and term.elastic]
    for term in elastic:
        if term.storage is not None:
            own += term.storage(np.real(omega))[:, None, None] * term.matrix
    if np.iscomplexobj(omega):
        own += 1j * omega[:, None, None] * damped.damping_matrix(model)
        for term in elastic if lossy else ():
            own += 1j * term.angle(np.real(omega))[:, None, None] * term.matrix


def dynamic_stiffness(
    model: LinearSystem,
    wires: list[CutWires],
    size: int,
    omega: Inexact[np.ndarray, " frequency"],
    *,
    lossy: bool = False,
) -> Inexact[np.ndarray, "frequency all all"]:
    """Dynamic stiffness (m, A + t, A + t) of the larger system and the tensions of its pieces.

    At omega (m,), rad/s. Complex omega includes dampers, and loss angles if `lossy`.
    """
    constant = np.real(frequency_dependent.stiffness_without_stretching(model)).copy()
    for term in model.terms:
        if isinstance(term, WireTerm):
            for (part, i, j), matrix in zip(term.functions, term.matrices, strict=True):
                if part != "stretch":
                    constant -= term.strand.static[part][i, j] * matrix
    whole = size + 2 * sum(len(cut.ends["stretch"]) for cut in wires)
    result = np.zeros((len(omega), whole, whole), dtype=omega.dtype)
    own = result[:, : model.size, : model.size]
    own += constant - omega[:, None, None] ** 2 * model.mass
    _add_losses(own, model, omega, lossy=lossy)
    start = size
    for cut in wires:
        for part in PARTS:
            for wire, ends in zip(cut.pieces, cut.piece_ends(part), strict=True):
                moved = np.flatnonzero(ends.any((0, 1)))
                stiffness = replace(wire, lossy=lossy).at(omega).stiffness(part)
                if part != "stretch":
                    own = _assemble(ends[..., moved], joined_sections.to_ends(stiffness))
                else:
                    across, diagonal, own = _tensions(cut, wire, ends[..., moved], stiffness)
                    rows = np.arange(start, start + len(ends))
                    result[:, rows[:, None], moved] = across
                    result[:, moved[:, None], rows] = across.swapaxes(1, 2)
                    result[:, rows, rows] = diagonal[:, None]
                    start += len(ends)
                result[:, moved[:, None], moved] += own
    return result


def _tensions(
    cut: CutWires,
    wire: TautWire,
    ends: Float[np.ndarray, "wire end coordinate"],
    stiffness: Inexact[np.ndarray, "2 2 frequency"],
) -> tuple[
    Inexact[np.ndarray, "frequency wire coordinate"],
    Inexact[np.ndarray, " frequency"],
    Inexact[np.ndarray, "frequency coordinate coordinate"],
]:
    """Stiffness with the tensions of one piece of every wire as coordinates (`linear.stretching`).

    Returns the stiffness between tensions and other coordinates, that of the tensions, and the rest
    of stretching, on the even motion of the ends.
    """
    even, odd = np.moveaxis(np.linalg.inv(joined_sections.ENDS[1]) @ ends, 1, 0)
    mixed = stiffness[0, 1] / stiffness[1, 1]
    scale = float(cut.whole.tension) / sum(section.length for section in wire.fibre.sections)
    across = scale * (odd + even * mixed[:, None, None])
    remainder = stiffness[0, 0] - mixed * stiffness[0, 1]
    return across, -(scale**2) / stiffness[1, 1], remainder[:, None, None] * (even.T @ even)


def _assemble(
    ends: Float[np.ndarray, "wire end coordinate"],
    stiffness: Inexact[np.ndarray, "end end frequency"],
) -> Inexact[np.ndarray, "frequency coordinate coordinate"]:
    """Sum of E^T F E over wires, of `ends` E and `stiffness` F."""
    rows = np.einsum("abm,wbA->mwaA", stiffness, ends)
    count, width = ends.shape[0] * ends.shape[1], ends.shape[2]
    return np.swapaxes(ends.reshape(count, width), 0, 1) @ rows.reshape(len(rows), count, width)


def solve_shapes(
    model: LinearSystem,
    wires: list[CutWires],
    size: int,
    omega: Float[np.ndarray, " mode"],
    progress: Progress,
) -> Float[np.ndarray, "mode coordinate"]:
    """Solve for shapes (m, A): null vectors of the larger system, with the support at rest."""
    result, began = np.zeros((len(omega), size)), time.monotonic()
    stops = [*(np.flatnonzero(np.diff(omega) > DEGENERATE * omega[1:]) + 1), len(omega)]
    groups = [slice(*ends) for ends in pairwise([0, *stops])]
    # tensions of both pieces of every wire come beside the coordinates
    whole = size + 2 * sum(len(cut.ends["twist"]) for cut in wires)
    step = max(1, NUMBERS // (len(ASIDE) * whole**2))
    for first in range(0, len(groups), step):
        some = groups[first : first + step]
        centre = np.array([omega[group].mean() for group in some])
        matrices = dynamic_stiffness(model, wires, size, (centre[:, None] * ASIDE).ravel())
        matrices = matrices[:, 6:, 6:].reshape(len(some), len(ASIDE), whole - 6, whole - 6)
        for group, (below, matrix, above) in zip(some, matrices, strict=True):
            # a coordinate that resonates alone has no stiffness at its mode, so scales are taken
            # beside it
            beside = np.maximum(np.abs(np.diag(below)), np.abs(np.diag(above)))[None]
            across = np.abs(matrix[None, size - 6 :, : size - 6])
            scale = 1 / frequency_dependent.coordinate_scales(beside, across, model.size - 6)[0]
            values, vectors = np.linalg.eigh(matrix * scale[:, None] * scale)
            count = group.stop - group.start
            nearest = np.argsort(np.abs(values))[:count]
            vectors = eigenmodes.localise(np.zeros(count), vectors[: size - 6, nearest])
            result[group, 6:] = (vectors * scale[: size - 6, None]).T
        done = some[-1].stop
        progress(done, len(omega), done / max(time.monotonic() - began, 1e-9))
    return result


def piece_motions(
    cut: CutWires, shapes: Float[np.ndarray, "mode coordinate"]
) -> list[dict[str, Float[np.ndarray, "_ wire mode"]]]:
    """Even and odd motion (c, w, m) of both pieces of every wire in shapes (m, A), by part."""
    pieces: list[dict[str, Float[np.ndarray, "_ wire mode"]]] = [{}, {}]
    for part in PARTS:
        back = np.linalg.inv(joined_sections.ENDS[COORDINATES[part] // 2])
        for piece, ends in zip(pieces, cut.piece_ends(part), strict=True):
            piece[part] = np.einsum("ab,wbA,mA->awm", back, ends, shapes, optimize=True)
    return pieces
