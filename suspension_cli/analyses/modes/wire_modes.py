"""Modes of a suspension whose wires have mass: pendulum, bounce and violin modes in one list.

`linear.mode_count` finds all frequencies. For the shapes every wire is cut at a point of no
symmetry, whose motion becomes six more coordinates: then a violin mode that moves no body has a
shape too, and no stiffness function is near its pole at a mode. The dynamic stiffness of this
larger system is singular at a mode; its null vector is the shape, which gives kinetic energies, Q
and dilution. The tensions of the pieces are coordinates of the larger system too
(`linear.stretching`).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from suspension_cli.analyses.modes import damped
from suspension_cli.elements import joined_sections
from suspension_cli.elements.dynamic_wire import COORDINATES, PARTS, TautWire
from suspension_cli.errors import Fault, InputError
from suspension_cli.linear import eigenmodes, frequency_dependent, mode_count, quality
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.frequency_terms import LossTerm, WireTerm
from suspension_cli.linear.mode_count import Progress, silent
from suspension_cli.linear.system import LinearSystem
from suspension_cli.scene.arrays import Array
from suspension_cli.scene.composition import Fibre

CUT = (3 - 5**0.5) / 2
"""Fraction of a wire above the cut: the golden section is far from all nodes of low order."""
SLOWEST = 1e-4
"""Fraction of the lowest static frequency below which modes are not searched for."""
LOSSY = 1e-4
"""Decay rate over frequency above which poles are refined in the full system; below, its
rounding errors exceed the correction."""
TOGETHER = 512
"""Largest number of modes whose losses are solved together."""
NEIGHBOURS = 100.0
"""Difference of omega^2 of two modes, over the sum of their losses, up to which losses may couple
them."""
DEGENERATE = 1e-10
"""Relative difference of frequencies below which modes are one degenerate group."""
ASIDE = np.array([0.97, 1.0, 1.03])
"""Multiples of a mode's frequency: beside it, for the scale of coordinates, and at it."""
STEP = 1e-20
"""Relative complex step in frequency, for derivatives of stiffnesses."""
NAMES = {"bend-1": "violin-x", "bend-2": "violin-y", "stretch": "stretch", "twist": "twist"}
"""Names of the parts of a wire's motion in `Modes.wire`."""

Dynamic = Callable[[Any, bool], Any]
"""Dynamic stiffness (m, A + t, A + t) at s (m,), rad/s, with or without loss angles."""


@dataclass(frozen=True)
class CutWires:
    """Wires of one kind, cut in two.

    Attributes
    ----------
    stage : str
    whole : TautWire
    pieces : tuple of two TautWire
        Upper and lower piece.
    ends : dict of (w, 3 p, A) arrays
        For each part, the motion of the points (upper, cut, lower; p coordinates each) of every
        wire as linear forms of the coordinates of the larger system.
    """

    stage: str
    whole: TautWire
    pieces: tuple[TautWire, TautWire]
    ends: dict[str, Any]

    def piece_ends(self, part: str) -> tuple[Any, Any]:
        """Motion of the ends of the upper and of the lower piece: (w, 2 p, A) each."""
        p = COORDINATES[part] // 2
        return self.ends[part][:, : 2 * p], self.ends[part][:, p:]


def solve(
    model: LinearSystem, highest: float, *, damping: bool = False, progress: Progress = silent
) -> Modes:
    """Solve for all modes up to a frequency.

    Parameters
    ----------
    model : LinearSystem
        Of the violin model.
    highest : float
        Hz.
    damping : bool
        Solve for modes with all losses (see `modes.damped`); else for undamped modes, with Q to
        first order in the losses.
    progress : callable
        Called with (steps done, steps in all, steps per second), first while frequencies are
        bisected, then while shapes are solved for.

    Returns
    -------
    Modes
        Modes that do not oscillate first; for undamped modes, these neglect wire mass.

    Raises
    ------
    InputError
        If no mode lies below `highest`.
    """
    static = eigenmodes.solve(replace(model, terms=()))
    omega = mode_count.frequencies(model, 2 * np.pi * highest, _lowest_frequency(static), progress)
    if not len(omega):
        raise no_mode_error(highest)
    wires, size = _cut_wires(model)
    shapes = _solve_shapes(model, wires, size, omega, progress)
    total, body, kinds = _kinetic_energies(model, wires, omega, shapes)
    wire, names = _sum_by_name(kinds, total)
    shapes = shapes / np.sqrt(total)[:, None]
    moved = [
        (wire, motion)
        for cut in wires
        for wire, motion in zip(cut.pieces, _motion(cut, shapes), strict=True)
    ]
    lost, elastic = quality.dissipation(model, omega, shapes[:, : model.size], moved)
    energy, tips = body[:, : 6 * len(model.body)], body[:, 6 * len(model.body) :]
    found = Modes(
        body=model.body,
        coordinate=model.coordinate[6:],
        omega_squared=omega**2,
        shape=_fix_signs((shapes[:, : model.size] @ model.basis.T)[:, 6:]),
        energy=(energy / total[:, None]).reshape(len(omega), -1, 6),
        tip_energy=tips / total[:, None],
        block=_leading_blocks(model, shapes),
        q=quality.safe_ratio(omega**2, lost),
        dilution=quality.safe_ratio(omega**2, elastic),
        wire=names,
        wire_energy=wire / total[:, None],
        order=np.zeros(len(omega), dtype=np.intp),
        decay_rate=lost / (2 * omega),
    )
    found = replace(found, order=_half_waves(found, kinds))
    if not damping or not np.isfinite(found.q).any():
        return _prepend_static(found, static)

    def dynamic(s: Any, lossy: bool) -> Any:
        return _stiffness(model, wires, size, -1j * s, lossy=lossy)

    return _prepend_static(
        _solve_damped(found, model, moved, shapes, lost, dynamic),
        _refine_overdamped(_solve_massless(model, static), dynamic),
    )


def count_modes(model: LinearSystem, highest: float) -> int:
    """Count the modes that oscillate below a frequency (Hz), without solving for them."""
    lowest = _lowest_frequency(eigenmodes.solve(replace(model, terms=())))
    low, high = mode_count.modes_below(model, np.array([lowest, max(2 * np.pi * highest, lowest)]))
    return int(high - low)


def no_mode_error(highest: float) -> InputError:
    """Error for a frequency range without modes."""
    return InputError(
        [
            Fault(
                "--max-frequency",
                "is below the lowest mode, so there is no mode to list",
                "raise it",
                f"{highest!r}",
            )
        ]
    )


def _lowest_frequency(static: Modes) -> float:
    """Frequency below which modes are not searched for, rad/s."""
    squared = np.abs(static.omega_squared[static.omega_squared != 0])
    return SLOWEST * float(np.sqrt(squared.min(initial=(2 * np.pi) ** 2)))


def _cut_wires(model: LinearSystem) -> tuple[list[CutWires], int]:
    """Cut every wire in two; with the size A of the larger system.

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
        upper, lower = _cut_fibre(term.strand.fibre)
        wires.append(
            CutWires(
                term.stage,
                term.strand,
                (replace(term.strand, fibre=upper), replace(term.strand, fibre=lower)),
                ends,
            )
        )
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


def _add_losses(own: Any, model: LinearSystem, omega: Any, *, lossy: bool) -> None:
    """Add tables of stiffness, and where omega is complex dampers and losses, in place."""
    elastic = [term for term in model.terms if isinstance(term, LossTerm) and term.elastic]
    for term in elastic:
        if term.storage is not None:
            own += term.storage(omega.real)[:, None, None] * term.matrix
    if np.iscomplexobj(omega):
        own += 1j * omega[:, None, None] * damped.damping_matrix(model)
        for term in elastic if lossy else ():
            own += 1j * term.angle(omega.real)[:, None, None] * term.matrix


def _stiffness(
    model: LinearSystem, wires: list[CutWires], size: int, omega: Any, *, lossy: bool = False
) -> Any:
    """Dynamic stiffness (m, A + t, A + t) of the larger system and the tensions of its pieces.

    At omega (m,), rad/s. Where omega is complex, with dampers, and with loss angles if `lossy`.
    """
    constant = np.real(frequency_dependent.stiffness_without_stretching(model)).copy()
    for term in model.terms:
        if isinstance(term, WireTerm):
            static = np.array(
                [
                    0.0 if part == "stretch" else term.strand.static[part][i, j]
                    for part, i, j in term.functions
                ]
            )
            constant -= np.tensordot(static, term.matrices, 1)
    pulled = [
        _tensions(cut, wire, ends, omega, lossy=lossy)
        for cut in wires
        for wire, ends in zip(cut.pieces, cut.piece_ends("stretch"), strict=True)
    ]
    whole = size + sum(len(across) for across, _, _ in pulled)
    result = np.zeros((len(omega), whole, whole), dtype=omega.dtype)
    own = result[:, : model.size, : model.size]
    own += constant - omega[:, None, None] ** 2 * model.mass
    _add_losses(own, model, omega, lossy=lossy)
    for cut in wires:
        for part in PARTS:
            for wire, ends in zip(cut.pieces, cut.piece_ends(part), strict=True):
                if part != "stretch":
                    piece = replace(wire, lossy=lossy).at(omega).stiffness(part)
                    result[:, :size, :size] += _assemble(ends, joined_sections.to_ends(piece))
    start = size
    for across, diagonal, rest in pulled:
        rows = np.arange(start, start + len(across))
        result[:, rows, :size] = np.moveaxis(across, -1, 0)
        result[:, :size, rows] = np.moveaxis(across, -1, 0).swapaxes(1, 2)
        result[:, rows, rows] = diagonal[:, None]
        result[:, :size, :size] += rest
        start += len(across)
    return result


def _tensions(
    cut: CutWires, wire: TautWire, ends: Any, omega: Any, *, lossy: bool
) -> tuple[Any, Any, Any]:
    """Stiffness with the tensions of one piece of every wire as coordinates (`linear.stretching`).

    Returns
    -------
    across : (w, A, m) array
        Between the tensions and the other coordinates.
    diagonal : (m,) array
        Of the tensions.
    rest : (m, A, A) array
        Remaining stiffness of stretching, on the even motion of the ends.
    """
    stiffness = replace(wire, lossy=lossy).at(omega).stiffness("stretch")
    even, odd = np.linalg.inv(joined_sections.ENDS[1]) @ np.moveaxis(ends, 1, 0).reshape(2, -1)
    even, odd = even.reshape(len(ends), -1), odd.reshape(len(ends), -1)
    mixed = stiffness[0, 1] / stiffness[1, 1]
    scale = float(cut.whole.tension) / sum(section.length for section in wire.fibre.sections)
    across = scale * (odd[..., None] + even[..., None] * mixed)
    beside = stiffness[0, 0] - mixed * stiffness[0, 1]
    return across, -(scale**2) / stiffness[1, 1], beside[:, None, None] * (even.T @ even)


def _assemble(ends: Any, stiffness: Any) -> Any:
    """Sum of E^T F E (m, A, A) over wires, of E (w, a, A) and F (a, a, m)."""
    rows = np.einsum("abm,wbA->mwaA", stiffness, ends)
    count, width = ends.shape[0] * ends.shape[1], ends.shape[2]
    return np.swapaxes(ends.reshape(count, width), 0, 1) @ rows.reshape(len(rows), count, width)


def _solve_shapes(
    model: LinearSystem, wires: list[CutWires], size: int, omega: Array, progress: Progress
) -> Array:
    """Solve for shapes (m, A): null vectors of the larger system, with the support at rest."""
    result = np.zeros((len(omega), size))
    start, began = 0, time.monotonic()
    while start < len(omega):
        stop = start + 1
        while stop < len(omega) and omega[stop] - omega[stop - 1] <= DEGENERATE * omega[stop]:
            stop += 1
        below, matrix, above = _stiffness(model, wires, size, omega[start:stop].mean() * ASIDE)[
            :, 6:, 6:
        ]
        # a coordinate that resonates alone has no stiffness at its mode, so the scale is taken
        # beside it
        beside = np.maximum(np.abs(np.diag(below)), np.abs(np.diag(above)))
        scale = (
            1
            / frequency_dependent.coordinate_scales(
                beside[None], np.abs(matrix[None, size - 6 :, : size - 6]), model.size - 6
            )[0]
        )
        values, vectors = np.linalg.eigh(matrix * scale[:, None] * scale)
        nearest = np.argsort(np.abs(values))[: stop - start]
        vectors = eigenmodes.localise(np.zeros(stop - start), vectors[: size - 6, nearest])
        result[start:stop, 6:] = (vectors * scale[: size - 6, None]).T
        start = stop
        progress(start, len(omega), start / max(time.monotonic() - began, 1e-9))
    return result


def _motion(cut: CutWires, shapes: Array) -> list[dict[str, Any]]:
    """Even and odd motion (c, w, m) of both pieces of every wire in shapes (m, A), by part."""
    pieces: list[dict[str, Any]] = [{}, {}]
    for part in PARTS:
        back = np.linalg.inv(joined_sections.ENDS[COORDINATES[part] // 2])
        for piece, ends in zip(pieces, cut.piece_ends(part), strict=True):
            piece[part] = np.einsum("ab,wbA,mA->awm", back, ends, shapes, optimize=True)
    return pieces


def _kinetic_energies(
    model: LinearSystem, wires: list[CutWires], omega: Array, shapes: Array
) -> tuple[Array, Array, list[tuple[CutWires, str, Array]]]:
    """Twice the kinetic energy over omega^2 of shapes (m, A).

    Returns
    -------
    total : (m,) array
    body : (m, N - 6) array
        Of each coordinate of bodies and blade tips.
    kinds : list of (CutWires, str, (m,) array)
        Of each part of the motion of each kind of wire.
    """
    own = shapes[:, : model.size]
    total = np.einsum("mi,ij,mj->m", own, model.mass, own)
    body, tips = eigenmodes.energy_fractions(model, own)
    body = np.concatenate([body, tips], axis=1) * total[:, None]
    kinds: list[tuple[CutWires, str, Array]] = []
    for cut in wires:
        own = {part: np.zeros(len(omega)) for part in PARTS}
        for wire, motion in zip(cut.pieces, _motion(cut, shapes), strict=True):
            moving = replace(wire, lossy=False).at(omega * (1 + 1j * STEP))
            for part in PARTS:
                # omega dF/domega = 2 omega^2 dF/d(omega^2)
                slope = moving.stiffness(part).imag / STEP
                own[part] -= np.einsum(
                    "awm,abm,bwm->m", motion[part], slope, motion[part], optimize=True
                ) / (2 * omega**2)
        kinds += [(cut, part, own[part]) for part in PARTS]
    return total + sum((energy for _, _, energy in kinds), np.zeros(len(omega))), body, kinds


def _sum_by_name(
    kinds: list[tuple[CutWires, str, Array]], total: Array
) -> tuple[Array, tuple[str, ...]]:
    """Sum energies by stage and part of the motion of wires: (m, k), and their names (k).

    Motions without energy in any mode are left out.
    """
    wire: dict[str, Array] = {}
    for cut, part, energy in kinds:
        name = f"{cut.stage}.{NAMES[part]}"
        wire[name] = wire.get(name, 0.0) + energy
    names = tuple(name for name in wire if (wire[name] > 1e-12 * total).any())
    return np.array([wire[name] for name in names]).reshape(-1, len(total)).T, names


def _leading_blocks(model: LinearSystem, shapes: Array) -> Any:
    """Number (m,) of the block that each mode moves most; 0 for modes that move no body."""
    size = np.array([np.abs(shapes[:, group]).sum(1) for group in model.blocks])
    return size.argmax(0)


def _half_waves(found: Modes, kinds: list[tuple[CutWires, str, Array]]) -> Any:
    """Number of half waves (m,) along the wires of each wire mode; 0 of other modes.

    That of the nearest resonance between fixed ends, of the kind of wire that moves most.
    """
    result = np.zeros(len(found.q), dtype=np.intp)
    home, omega = found.home, np.sqrt(found.omega_squared)
    for stage, dof in set(home):
        alike = [
            (cut, part, energy)
            for cut, part, energy in kinds
            if (cut.stage, NAMES[part]) == (stage, dof)
        ]
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


def _fix_signs(shape: Array) -> Array:
    """Give shapes the sign in which their largest coordinate is positive."""
    if not shape.size:
        return shape
    lead = shape[np.arange(len(shape)), np.abs(shape).argmax(1)]
    return shape * np.where(lead < 0, -1.0, 1.0)[:, None]


def _solve_massless(model: LinearSystem, undamped: Modes) -> Modes:
    """Modes without the mass and loss of wires, with dampers of any strength."""
    if not damped.damping_matrix(model).any():
        return undamped
    return damped.solve(
        replace(model, terms=tuple(term for term in model.terms if isinstance(term, LossTerm))),
        undamped,
    )


def _refine_overdamped(static: Modes, dynamic: Dynamic) -> Modes:
    """Refine the decay rates of overdamped modes with the mass of wires."""
    decay = static.decay_rate.copy()
    for n in np.flatnonzero(static.overdamped):
        decay[n] = -damped.refine_pole(dynamic, -decay[n] + 0j, None).real
    return replace(static, decay_rate=decay)


def _build_basis(
    model: LinearSystem,
    moved: list[tuple[TautWire, dict[str, Any]]],
    omega: Array,
    shapes: Array,
    lost: Array,
) -> damped.Basis:
    """Transform the system to its modes (m, A) of unit modal mass, with losses `lost` (m,).

    `lost` is in (rad/s)^2. Coupling by loss angles is kept for modes close together; for others it
    would shift omega^2 by only its square over their difference of omega^2.
    """
    own = shapes[:, : model.size]
    viscous = own @ damped.damping_matrix(model) @ own.T
    loss = np.diag(np.maximum(lost - omega * viscous.diagonal(), 0.0))
    first, second = np.nonzero(
        np.triu(
            np.abs(np.subtract.outer(omega**2, omega**2)) < NEIGHBOURS * np.add.outer(lost, lost), 1
        )
    )
    if len(first):
        both = [
            (wire, {part: ends[..., first] + ends[..., second] for part, ends in parts.items()})
            for wire, parts in moved
        ]
        at = np.sqrt(omega[first] * omega[second])
        motion = own[first] + own[second]
        whole = quality.dissipation(model, at, motion, both)[0] - at * np.einsum(
            "mi,ij,mj->m", motion, damped.damping_matrix(model), motion
        )
        loss[first, second] = loss[second, first] = (
            whole - loss[first, first] - loss[second, second]
        ) / 2

    def losses(at: Array, place: Any) -> Any:
        return np.broadcast_to(1j * loss[np.ix_(place, place)], (len(at), len(place), len(place)))

    return damped.Basis(omega**2, np.ones(len(omega)), viscous, np.arange(len(omega)), losses)


def _split_modes(omega: Array) -> list[slice]:
    """Split consecutive modes (m,) at wide gaps into parts that are solved together."""
    result, start = [], 0
    while len(omega) - start > TOGETHER:
        last = np.arange(start + TOGETHER // 2, start + TOGETHER)
        stop = int(last[(omega[last] / omega[last - 1]).argmax()])
        result.append(slice(start, stop))
        start = stop
    return [*result, slice(start, len(omega))]


def _solve_damped(
    found: Modes,
    model: LinearSystem,
    moved: list[tuple[TautWire, dict[str, Any]]],
    shapes: Array,
    lost: Array,
    dynamic: Dynamic,
) -> Modes:
    """Solve for modes with all losses, except overdamped ones, from the undamped modes."""
    omega, parts = np.sqrt(found.omega_squared), []
    for own in _split_modes(omega):
        motion = [
            (wire, {part: ends[..., own] for part, ends in each.items()}) for wire, each in moved
        ]
        basis = _build_basis(model, motion, omega[own], shapes[own], lost[own])
        parts.append(_solve_damped_part(found.some(own), model, basis, shapes[own], dynamic))
    return parts[0].followed_by(*parts[1:])


def _solve_damped_part(
    found: Modes, model: LinearSystem, basis: damped.Basis, shapes: Array, dynamic: Dynamic
) -> Modes:
    """Solve for modes with all losses from some of the undamped modes.

    Where losses are large, poles are refined in the full system, which has all modes.
    """
    lossy = np.flatnonzero(np.isfinite(found.q))
    if not len(lossy):
        return found
    here = damped.find_poles(basis.within(lossy))
    oscillates = here.value.imag > 0
    value = here.value[oscillates]
    amplitude = np.zeros((len(value), len(found.q)), dtype=complex)
    amplitude[:, lossy] = here.motion[oscillates]
    amplitude /= np.sqrt((np.abs(amplitude) ** 2).sum(1))[:, None]
    for n in np.flatnonzero(np.abs(value.real) > LOSSY * np.abs(value)):
        value[n] = damped.refine_pole(dynamic, value[n], amplitude[n] @ shapes)
    weight, lead = np.abs(amplitude) ** 2, np.abs(amplitude).argmax(1)
    energy, tips = damped.mean_energies(model, amplitude @ shapes[:, : model.size])
    wires = weight @ found.wire_energy
    bodily = np.maximum(1 - wires.sum(1), 0.0)[:, None]
    new = {
        "omega_squared": np.abs(value) ** 2,
        "shape": _fix_signs(
            (damped.real_shapes(amplitude @ shapes)[:, : model.size] @ model.basis.T)[:, 6:]
        ),
        "energy": (bodily * energy).reshape(len(value), -1, 6),
        "tip_energy": bodily * tips,
        "block": found.block[lead],
        "q": damped.quality_factor(value),
        "dilution": 1 / (weight @ (1 / found.dilution)),
        "wire_energy": wires,
        "order": found.order[lead],
        "decay_rate": -value.real,
    }
    return damped.merge_modes(found, ~np.isfinite(found.q), new)


def _prepend_static(found: Modes, static: Modes) -> Modes:
    """Prepend the modes that do not oscillate, from a solution without wire mass."""
    first = static.some(slice(int((static.omega_squared <= 0).sum())))
    energy = np.zeros((len(first.q), len(found.wire)))
    return replace(first, wire=found.wire, wire_energy=energy).followed_by(found)
