"""Modes of a suspension whose wires have mass: pendulum, bounce and violin modes in one list.

`mechanics.count` finds all frequencies.  For the shapes every wire is cut at a point of no symmetry, whose motion becomes six more coordinates: then
a violin mode that moves no body has a shape too, and no function is near its pole at a mode.  At a mode the stiffness of this larger
system is singular; what it takes to nothing is the shape, and from that come kinetic energies, Q and dilution.  The tensions of the pieces are
coordinates of that system too (`mechanics.stretching`).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from suspension_cli.analysis import damped, quality
from suspension_cli.analysis import modes as static_modes
from suspension_cli.analysis.modes import Modes
from suspension_cli.design.fibres import Fibre
from suspension_cli.design.scene import Array
from suspension_cli.errors import Fault, InputError
from suspension_cli.mechanics import count, dispersive, joined
from suspension_cli.mechanics.count import Progress, silent
from suspension_cli.mechanics.dispersion import LossTerm, WireTerm
from suspension_cli.mechanics.fibre import PARTS, WIDTH, Strand
from suspension_cli.mechanics.model import LinearModel

CUT = (3 - 5**0.5) / 2
"""Where wires are cut: the golden section is far from all nodes of low order."""
SLOWEST = 1e-4
"""Share of the lowest static frequency below which no mode is looked for."""
LOSSY = 1e-4
"""Decay rate over frequency above which modes are refined in the system with losses itself: below, its rounding errors are larger than what it adds."""
TOGETHER = 512
"""Modes at most whose losses are solved together."""
NEIGHBOURS = 100.0
"""Difference of the omega^2 of two modes, over what both lose, up to which losses that couple them count."""
DEGENERATE = 1e-10
"""Relative difference of frequencies below which modes are one degenerate group."""
ASIDE = np.array([0.97, 1.0, 1.03])
"""Times a mode's frequency: where the sizes of stiffnesses are taken, and the mode."""
STEP = 1e-20
"""Of the complex step that differentiates stiffnesses by frequency."""
NAMES = {"bend-1": "violin-x", "bend-2": "violin-y", "stretch": "stretch", "twist": "twist"}


Dynamic = Callable[[Any, bool], Any]
"""Dynamic stiffness (m, A, A) at s (m,), with or without loss angles."""


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


def solve(model: LinearModel, highest: float, *, damping: bool = False, progress: Progress = silent) -> Modes:
    """All modes up to a frequency.

    Parameters
    ----------
    model : LinearModel
        On `violin`.
    highest : float
        Hz.
    damping : bool
        Whether modes are those with all losses (`analysis.damped`), or those without, with a Q of first order.
    progress : callable
        Called with (steps done, steps in all, steps per second), first while frequencies are bisected, then while shapes are solved for.

    Returns
    -------
    Modes
        Unstable modes (for which the mass of wires does not count) first.
    """
    still = static_modes.solve(replace(model, terms=()))
    omega = count.frequencies(model, 2 * np.pi * highest, _lowest(still), progress)
    if not len(omega):
        raise none_below(highest)
    wires, size = _cut(model)
    shapes = _shapes(model, wires, size, omega, progress)
    total, body, kinds = _kinetic(model, wires, omega, shapes)
    wire, names = _by_name(kinds, total)
    shapes = shapes / np.sqrt(total)[:, None]
    moved = [(strand, motion) for cut in wires for strand, motion in zip(cut.pieces, _motion(cut, shapes), strict=True)]
    lost, elastic = quality.dissipated(model, omega, shapes[:, : model.size], moved)
    energy, tips = body[:, : 6 * len(model.body)], body[:, 6 * len(model.body) :]
    found = Modes(
        body=model.body,
        coordinate=model.coordinate[6:],
        omega_squared=omega**2,
        shape=_signed((shapes[:, : model.size] @ model.basis.T)[:, 6:]),
        energy=(energy / total[:, None]).reshape(len(omega), -1, 6),
        tip_energy=tips / total[:, None],
        block=_block(model, shapes),
        q=quality.ratio(omega**2, lost),
        dilution=quality.ratio(omega**2, elastic),
        wire=names,
        wire_energy=wire / total[:, None],
        order=np.zeros(len(omega), dtype=np.intp),
        decay_rate=lost / (2 * omega),
    )
    found = replace(found, order=_orders(found, kinds))
    if not damping or not np.isfinite(found.q).any():
        return _with_others(found, still)

    def dynamic(s: Any, lossy: bool) -> Any:
        return _stiffness(model, wires, size, -1j * s, lossy=lossy)

    return _with_others(_damped(found, model, moved, shapes, lost, dynamic), _refined(_still(model, still), dynamic))


def number(model: LinearModel, highest: float) -> int:
    """How many modes lie up to a frequency (Hz), of which no other is computed; those that do not oscillate left out."""
    lowest = _lowest(static_modes.solve(replace(model, terms=())))
    low, high = count.modes_below(model, np.array([lowest, max(2 * np.pi * highest, lowest)]))
    return int(high - low)


def none_below(highest: float) -> InputError:
    """The fault of a range without modes."""
    return InputError([Fault("--max-frequency", "lies below the lowest mode", "raise it", f"{highest!r}")])


def _lowest(still: Modes) -> float:
    """Below what no mode is looked for, rad/s."""
    return SLOWEST * float(np.sqrt(np.abs(still.omega_squared[still.omega_squared != 0]).min(initial=(2 * np.pi) ** 2)))


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


def _stiffness(model: LinearModel, wires: list[CutWires], size: int, omega: Any, *, lossy: bool = False) -> Any:
    """Dynamic stiffness (m, A + t, A + t) of the larger system and of the tensions of all pieces at omega (m,).

    Where omega is complex, with dampers, and with loss angles if `lossy`.
    """
    constant = np.real(dispersive.soft(model)).copy()
    for term in model.terms:
        if isinstance(term, WireTerm):
            static = np.array([0.0 if part == "stretch" else term.strand.static[part][i, j] for part, i, j in term.functions])
            constant -= np.tensordot(static, term.matrices, 1)
    pulled = [_tensions(cut, strand, ends, omega, lossy=lossy) for cut in wires for strand, ends in zip(cut.pieces, cut.piece_ends("stretch"), strict=True)]
    whole = size + sum(len(across) for across, _, _ in pulled)
    result = np.zeros((len(omega), whole, whole), dtype=omega.dtype)
    own = result[:, : model.size, : model.size]
    own += constant - omega[:, None, None] ** 2 * model.mass
    if np.iscomplexobj(omega):
        own += 1j * omega[:, None, None] * damped.dampers(model)
        for term in model.terms:
            if isinstance(term, LossTerm) and term.elastic and lossy:
                own += 1j * term.angle(omega.real)[:, None, None] * term.matrix
    for cut in wires:
        for part in PARTS:
            for strand, ends in zip(cut.pieces, cut.piece_ends(part), strict=True):
                if part != "stretch":
                    piece = replace(strand, lossy=lossy).at(omega).stiffness(part)
                    result[:, :size, :size] += _assembled(ends, joined.ends(piece))
    start = size
    for across, diagonal, rest in pulled:
        rows = np.arange(start, start + len(across))
        result[:, rows, :size] = np.moveaxis(across, -1, 0)
        result[:, :size, rows] = np.moveaxis(across, -1, 0).swapaxes(1, 2)
        result[:, rows, rows] = diagonal[:, None]
        result[:, :size, :size] += rest
        start += len(across)
    return result


def _tensions(cut: CutWires, strand: Strand, ends: Any, omega: Any, *, lossy: bool) -> tuple[Any, Any, Any]:
    """Tensions of one piece of every wire as coordinates (see `mechanics.dispersive.Tensions`).

    Returns
    -------
    across : (w, A, m) array
        Towards the other coordinates.
    diagonal : (m,) array
        Towards themselves.
    rest : (m, A, A) array
        What is left of the stretching, on the even motion of the ends.
    """
    stiffness = replace(strand, lossy=lossy).at(omega).stiffness("stretch")
    even, odd = np.linalg.inv(joined.ENDS[1]) @ np.moveaxis(ends, 1, 0).reshape(2, -1)
    even, odd = even.reshape(len(ends), -1), odd.reshape(len(ends), -1)
    mixed = stiffness[0, 1] / stiffness[1, 1]
    scale = float(cut.whole.tension) / sum(section.length for section in strand.fibre.sections)
    across = scale * (odd[..., None] + even[..., None] * mixed)
    beside = stiffness[0, 0] - mixed * stiffness[0, 1]
    return across, -(scale**2) / stiffness[1, 1], beside[:, None, None] * (even.T @ even)


def _assembled(ends: Any, stiffness: Any) -> Any:
    """Sum over wires of E^T F E: (m, A, A)."""
    rows = np.einsum("abm,wbA->mwaA", stiffness, ends)
    count, width = ends.shape[0] * ends.shape[1], ends.shape[2]
    return np.swapaxes(ends.reshape(count, width), 0, 1) @ rows.reshape(len(rows), count, width)


def _shapes(model: LinearModel, wires: list[CutWires], size: int, omega: Array, progress: Progress) -> Array:
    """Shapes (m, A): what the larger system's stiffness takes to nothing, the support at rest."""
    result = np.zeros((len(omega), size))
    start, began = 0, time.monotonic()
    while start < len(omega):
        stop = start + 1
        while stop < len(omega) and omega[stop] - omega[stop - 1] <= DEGENERATE * omega[stop]:
            stop += 1
        below, matrix, above = _stiffness(model, wires, size, omega[start:stop].mean() * ASIDE)[:, 6:, 6:]
        # a coordinate that resonates by itself has no stiffness at its mode, so sizes are taken beside it
        beside = np.maximum(np.abs(np.diag(below)), np.abs(np.diag(above)))
        scale = 1 / dispersive.sizes(beside[None], np.abs(matrix[None, size - 6 :, : size - 6]), model.size - 6)[0]
        values, vectors = np.linalg.eigh(matrix * scale[:, None] * scale)
        nearest = np.argsort(np.abs(values))[: stop - start]
        vectors = static_modes.localised(np.zeros(stop - start), vectors[: size - 6, nearest])
        result[start:stop, 6:] = (vectors * scale[: size - 6, None]).T
        start = stop
        progress(start, len(omega), start / max(time.monotonic() - began, 1e-9))
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


def _still(model: LinearModel, undamped: Modes) -> Modes:
    """Modes where wires have no mass and no loss, with dampers of any strength."""
    if not damped.dampers(model).any():
        return undamped
    return damped.solve(replace(model, terms=tuple(term for term in model.terms if isinstance(term, LossTerm))), undamped)


def _refined(still: Modes, dynamic: Dynamic) -> Modes:
    """Modes without the mass of wires, the decay of the overdamped ones as it is with it."""
    decay = still.decay_rate.copy()
    for n in np.flatnonzero(still.overdamped):
        decay[n] = -damped.refined(dynamic, -decay[n] + 0j, None).real
    return replace(still, decay_rate=decay)


def _basis(model: LinearModel, moved: list[tuple[Strand, dict[str, Any]]], omega: Array, shapes: Array, lost: Array) -> damped.Basis:
    """The system in the basis of its modes (m, A) of unit modal mass, which lose `lost` (m,), (rad/s)^2.

    What loss angles couple counts for modes that lie together; of others it would shift omega^2 by its square over the difference of theirs.
    """
    own = shapes[:, : model.size]
    viscous = own @ damped.dampers(model) @ own.T
    loss = np.diag(np.maximum(lost - omega * viscous.diagonal(), 0.0))
    first, second = np.nonzero(np.triu(np.abs(np.subtract.outer(omega**2, omega**2)) < NEIGHBOURS * np.add.outer(lost, lost), 1))
    if len(first):
        both = [(strand, {part: ends[..., first] + ends[..., second] for part, ends in parts.items()}) for strand, parts in moved]
        at = np.sqrt(omega[first] * omega[second])
        motion = own[first] + own[second]
        whole = quality.dissipated(model, at, motion, both)[0] - at * np.einsum("mi,ij,mj->m", motion, damped.dampers(model), motion)
        loss[first, second] = loss[second, first] = (whole - loss[first, first] - loss[second, second]) / 2

    def losses(at: Array, place: Any) -> Any:
        return np.broadcast_to(1j * loss[np.ix_(place, place)], (len(at), len(place), len(place)))

    return damped.Basis(omega**2, np.ones(len(omega)), viscous, np.arange(len(omega)), losses)


def _windows(omega: Array) -> list[slice]:
    """Consecutive modes (m,) that are solved together: all, or where there are very many, parts with wide gaps between."""
    result, start = [], 0
    while len(omega) - start > TOGETHER:
        last = np.arange(start + TOGETHER // 2, start + TOGETHER)
        stop = int(last[(omega[last] / omega[last - 1]).argmax()])
        result.append(slice(start, stop))
        start = stop
    return [*result, slice(start, len(omega))]


def _damped(found: Modes, model: LinearModel, moved: list[tuple[Strand, dict[str, Any]]], shapes: Array, lost: Array, dynamic: Dynamic) -> Modes:
    """Modes with all losses, from those without; without the overdamped ones."""
    parts = [
        _damped_within(
            found.some(own),
            model,
            _basis(model, [(strand, {part: ends[..., own] for part, ends in each.items()}) for strand, each in moved], omega[own], shapes[own], lost[own]),
            shapes[own],
            dynamic,
        )
        for omega in [np.sqrt(found.omega_squared)]
        for own in _windows(omega)
    ]
    return parts[0].followed_by(*parts[1:])


def _damped_within(found: Modes, model: LinearModel, basis: damped.Basis, shapes: Array, dynamic: Dynamic) -> Modes:
    """Some of the modes with all losses.

    Where losses are so large that it shows, poles that these modes give are refined in the system itself, which has all modes.
    """
    felt = np.flatnonzero(np.isfinite(found.q))
    plain = np.ones(len(found.q), dtype=bool)
    plain[felt] = False
    if not len(felt):
        return found
    here = damped.poles(basis.within(felt))
    oscillates = here.value.imag > 0
    value, share = here.value[oscillates], np.zeros((int(oscillates.sum()), len(found.q)), dtype=complex)
    share[:, felt] = here.motion[oscillates]
    share /= np.sqrt((np.abs(share) ** 2).sum(1))[:, None]
    for n in np.flatnonzero(np.abs(value.real) > LOSSY * np.abs(value)):
        value[n] = damped.refined(dynamic, value[n], share[n] @ shapes)
    weight, lead = np.abs(share) ** 2, np.abs(share).argmax(1)
    energy, tips = damped.energies(model, share @ shapes[:, : model.size])
    wires = weight @ found.wire_energy
    bodily = np.maximum(1 - wires.sum(1), 0.0)[:, None]
    new = {
        "omega_squared": np.abs(value) ** 2,
        "shape": _signed((damped.instant(share @ shapes)[:, : model.size] @ model.basis.T)[:, 6:]),
        "energy": (bodily * energy).reshape(len(value), -1, 6),
        "tip_energy": bodily * tips,
        "block": found.block[lead],
        "q": damped.quality_factor(value),
        "dilution": 1 / (weight @ (1 / found.dilution)),
        "wire_energy": wires,
        "order": found.order[lead],
        "decay_rate": -value.real,
    }
    return damped.merged(found, plain, new)


def _with_others(found: Modes, still: Modes) -> Modes:
    """Modes that do not oscillate in front: those of wires without mass."""
    n = int((still.omega_squared <= 0).sum())
    if not n:
        return found
    k = len(found.wire)

    def both(name: str) -> Any:
        return np.concatenate([getattr(still, name)[:n], getattr(found, name)])

    merged = {name: both(name) for name in ("omega_squared", "shape", "energy", "tip_energy", "block", "q", "dilution", "order", "decay_rate")}
    return replace(found, **merged, wire_energy=np.concatenate([np.zeros((n, k)), found.wire_energy]))
