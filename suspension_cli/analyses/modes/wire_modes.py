"""Modes of a suspension whose wires have mass: pendulum, bounce and violin modes in one list.

`linear.mode_count` finds all frequencies. Shapes, from which kinetic energies, Q and dilution
follow, come from the suspension with its wires cut in two (`cut_wires`).
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.modes import cut_wires
from suspension_cli.analyses.modes.cut_wires import CutWires
from suspension_cli.elements.dynamic_wire import PARTS, TautWire
from suspension_cli.errors import Fault, InputError
from suspension_cli.linear import damped, eigenmodes, mode_count, quality, strong_damping
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.elastic_losses import ElasticLosses
from suspension_cli.linear.frequency_terms import LossTerm
from suspension_cli.linear.modal_basis import Basis
from suspension_cli.linear.mode_count import Progress, silent
from suspension_cli.linear.system import LinearSystem
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Int

    from suspension_cli.linear.strong_damping import Dynamic

SLOWEST = 1e-4
"""Fraction of the lowest static frequency below which modes are not searched for."""
LOSSY = 1e-4
"""Decay rate over frequency above which poles are refined in the full system; below, rounding
errors exceed the correction."""
TOGETHER = 512
"""Largest number of modes whose losses are solved together."""
NEIGHBOURS = 100.0
"""Difference of omega^2 of two modes, over the sum of their losses, up to which losses may couple
them."""
CLOSE = 0.02
"""Relative difference of omega^2 up to which the coupling of two modes by losses is computed. It
follows from the sum of both shapes at the frequency between them; if they lie farther apart, a
piece of a wire may resonate there."""
STEP = 1e-20
"""Relative complex step in frequency, for derivatives of stiffnesses."""
NAMES = {"bend-1": "violin-x", "bend-2": "violin-y", "stretch": "stretch", "twist": "twist"}
"""Names of the parts of a wire's motion in `Modes.wire`."""


def solve(
    model: LinearSystem, highest: float, *, damping: bool = False, progress: Progress = silent
) -> Modes:
    """Solve for all modes of the violin model up to a frequency (Hz).

    If `damping`, with all losses (see `modes.damped`); else for undamped modes, with Q to first
    order in the losses. Modes that do not oscillate are first; for undamped modes these neglect
    wire mass. `progress` is called with (steps done, total steps, steps per second), while
    frequencies are bisected, then while shapes are solved for. Raises `InputError` if no mode lies
    below `highest`.
    """
    static = eigenmodes.solve(model.constant)
    omega = mode_count.frequencies(model, 2 * np.pi * highest, _lowest_frequency(static), progress)
    if not len(omega):
        raise no_mode_error(highest)
    wires, size = cut_wires.cut_all(model)
    shapes = cut_wires.solve_shapes(model, wires, size, omega, progress)
    total, body, kinds = _kinetic_energies(model, wires, omega, shapes)
    wire, names = _sum_by_name(kinds, total)
    shapes = shapes / np.sqrt(total)[:, None]
    moved = [
        (wire, motion)
        for cut in wires
        for wire, motion in zip(cut.pieces, cut_wires.piece_motions(cut, shapes), strict=True)
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
        block=np.argmax([np.abs(shapes[:, group]).sum(1) for group in model.blocks], axis=0),
        q=quality.safe_ratio(omega**2, lost),
        dilution=quality.safe_ratio(omega**2, elastic),
        wire=names,
        wire_energy=wire / total[:, None],
        order=np.zeros(len(omega), dtype=np.intp),
        decay_rate=lost / (2 * omega),
        top=model.top,
    )
    found = replace(found, order=_half_waves(found, kinds))
    if not damping or not _is_lossy(found).any():
        return _prepend_static(found, static)

    def dynamic(
        s: Complex[np.ndarray, " pole"], lossy: bool
    ) -> Complex[np.ndarray, "pole row column"]:
        return cut_wires.dynamic_stiffness(model, wires, size, -1j * s, lossy=lossy)

    return _prepend_static(
        _solve_damped(found, model, moved, shapes, lost, dynamic),
        _refine_overdamped(_solve_massless(model, static), dynamic),
    )


def count_modes(model: LinearSystem, highest: float) -> int:
    """Count the modes that oscillate below a frequency (Hz), without solving for them."""
    lowest = _lowest_frequency(eigenmodes.solve(model.constant))
    low, high = mode_count.modes_below(model, np.array([lowest, max(2 * np.pi * highest, lowest)]))
    return int(high - low)


def no_mode_error(highest: float) -> InputError:
    """Error for a frequency range without modes."""
    problem = "is below the lowest mode, so there is no mode to list"
    return InputError([Fault("--max-frequency", problem, "raise it", f"{highest!r}")])


def _lowest_frequency(static: Modes) -> float:
    """Frequency below which modes are not searched for, rad/s."""
    squared = np.abs(static.omega_squared[static.omega_squared != 0])
    return SLOWEST * float(np.sqrt(squared.min(initial=(2 * np.pi) ** 2)))


def _kinetic_energies(
    model: LinearSystem,
    wires: list[CutWires],
    omega: Float[np.ndarray, " mode"],
    shapes: Float[np.ndarray, "mode coordinate"],
) -> tuple[
    Float[np.ndarray, " mode"],
    Float[np.ndarray, "mode moving"],
    list[tuple[CutWires, str, Float[np.ndarray, " mode"]]],
]:
    """Twice the kinetic energy over omega^2 of shapes.

    The total, that of each coordinate of bodies and blade tips, and of each part of the motion of
    each kind of wire.
    """
    own = shapes[:, : model.size]
    total = quality.quadratic_form(model.mass, own)
    body, tips = eigenmodes.energy_fractions(model, own)
    body = np.concatenate([body, tips], axis=1) * total[:, None]
    kinds: list[tuple[CutWires, str, Array]] = []
    for cut in wires:
        own = {part: np.zeros(len(omega)) for part in PARTS}
        for wire, motion in zip(cut.pieces, cut_wires.piece_motions(cut, shapes), strict=True):
            moving = replace(wire, lossy=False).at(omega * (1 + 1j * STEP))
            for part in PARTS:
                # omega dF/domega = 2 omega^2 dF/d(omega^2)
                slope = np.imag(moving.stiffness(part)) / STEP
                own[part] -= np.einsum(
                    "awm,abm,bwm->m", motion[part], slope, motion[part], optimize=True
                ) / (2 * omega**2)
        kinds += [(cut, part, own[part]) for part in PARTS]
    return total + sum((energy for _, _, energy in kinds), np.zeros(len(omega))), body, kinds


def _sum_by_name(
    kinds: list[tuple[CutWires, str, Float[np.ndarray, " mode"]]], total: Float[np.ndarray, " mode"]
) -> tuple[Float[np.ndarray, "mode motion"], tuple[str, ...]]:
    """Sum energies by stage and part of the motion of wires; also return their names.

    Motions without energy in any mode are left out.
    """
    wire: dict[str, Array] = {}
    for cut, part, energy in kinds:
        name = f"{cut.stage}.{NAMES[part]}"
        wire[name] = wire.get(name, 0.0) + energy
    names = tuple(name for name in wire if (wire[name] > 1e-12 * total).any())
    return np.array([wire[name] for name in names]).reshape(-1, len(total)).T, names


def _half_waves(
    found: Modes, kinds: list[tuple[CutWires, str, Float[np.ndarray, " mode"]]]
) -> Int[np.ndarray, " mode"]:
    """Number of half waves along the wires of each wire mode; 0 of other modes.

    It is that of the nearest resonance between fixed ends, of the kind of wire that moves most.
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


def _fix_signs(shape: Float[np.ndarray, "mode coordinate"]) -> Float[np.ndarray, "mode coordinate"]:
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
    start = -decay[static.overdamped] + 0j
    decay[static.overdamped] = -np.real(strong_damping.refine_poles(dynamic, start, None))
    return replace(static, decay_rate=decay)


def _build_basis(
    model: LinearSystem,
    moved: list[tuple[TautWire, dict[str, Float[np.ndarray, "... mode"]]]],
    omega: Float[np.ndarray, " mode"],
    shapes: Float[np.ndarray, "mode coordinate"],
    lost: Float[np.ndarray, " mode"],
) -> Basis:
    """Transform the system to its modes of unit modal mass, with losses `lost`, (rad/s)^2.

    Coupling by loss angles is kept only for modes close together. For others it would shift omega^2
    by its square over their difference of omega^2; where that is much, poles are refined in the
    full system anyway.
    """
    own = shapes[:, : model.size]
    viscous = own @ damped.damping_matrix(model) @ own.T
    elastic = lost - omega * viscous.diagonal()
    loss = np.diag(elastic if model.active else np.maximum(elastic, 0.0))
    apart = np.abs(np.subtract.outer(omega**2, omega**2))
    near = (apart < NEIGHBOURS * np.add.outer(lost, lost)) & (apart < CLOSE * omega**2)
    first, second = np.nonzero(np.triu(near, 1))
    if len(first):
        both = [
            (wire, {part: ends[..., first] + ends[..., second] for part, ends in parts.items()})
            for wire, parts in moved
        ]
        at = np.sqrt(omega[first] * omega[second])
        motion = own[first] + own[second]
        whole = quality.dissipation(model, at, motion, both)[0] - at * quality.quadratic_form(
            damped.damping_matrix(model), motion
        )
        loss[first, second] = loss[second, first] = (
            whole - loss[first, first] - loss[second, second]
        ) / 2

    return Basis(
        omega**2,
        np.ones(len(omega)),
        viscous,
        np.arange(len(omega)),
        ElasticLosses(1j * loss, omega),
    )


def _split_modes(omega: Float[np.ndarray, " mode"]) -> list[slice]:
    """Split consecutive modes at wide gaps into parts that are solved together."""
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
    moved: list[tuple[TautWire, dict[str, Float[np.ndarray, "... mode"]]]],
    shapes: Float[np.ndarray, "mode coordinate"],
    lost: Float[np.ndarray, " mode"],
    dynamic: Dynamic,
) -> Modes:
    """Solve for modes with all losses, except overdamped ones, from the undamped modes."""
    omega, parts = np.sqrt(found.omega_squared), []
    for own in _split_modes(omega):
        motion = [
            (wire, {part: ends[..., own] for part, ends in each.items()}) for wire, each in moved
        ]
        basis = _build_basis(model, motion, omega[own], shapes[own], lost[own])
        parts.append(_solve_damped_part(found.select(own), model, basis, shapes[own], dynamic))
    return parts[0].followed_by(*parts[1:])


def _solve_damped_part(
    found: Modes,
    model: LinearSystem,
    basis: Basis,
    shapes: Float[np.ndarray, "mode coordinate"],
    dynamic: Dynamic,
) -> Modes:
    """Solve for modes with all losses from some of the undamped modes.

    Where losses are large, poles are refined in the full system, which has all modes.
    """
    lossy = np.flatnonzero(_is_lossy(found))
    if not len(lossy):
        return found
    here = damped.find_poles(basis.within(lossy))
    oscillates = np.imag(here.value) > 0
    value = here.value[oscillates]
    amplitude = np.zeros((len(value), len(found.q)), dtype=complex)
    amplitude[:, lossy] = here.motion[oscillates]
    amplitude /= np.sqrt((np.abs(amplitude) ** 2).sum(1))[:, None]
    strong = np.abs(np.real(value)) > LOSSY * np.abs(value)
    value[strong] = strong_damping.refine_poles(dynamic, value[strong], amplitude[strong] @ shapes)
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
        "decay_rate": -np.real(value) if model.active else np.maximum(-np.real(value), 0.0),
    }
    return damped.merge_modes(found, ~_is_lossy(found), new)


def _is_lossy(found: Modes) -> Bool[np.ndarray, " mode"]:
    """Whether losses, positive or negative, act on each mode."""
    return np.isfinite(found.q) | (found.decay_rate < 0)


def _prepend_static(found: Modes, static: Modes) -> Modes:
    """Prepend the modes that do not oscillate, from a solution without wire mass."""
    first = static.select(slice(int((static.omega_squared <= 0).sum())))
    energy = np.zeros((len(first.q), len(found.wire)))
    return replace(first, wire=found.wire, wire_energy=energy).followed_by(found)
