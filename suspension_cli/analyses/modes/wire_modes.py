"""Modes of a suspension whose wires have mass: pendulum, bounce and violin modes in one list.

`linear.mode_count` finds all frequencies without loss. Shapes, from which kinetic energies and
dilution follow, and poles with all losses are roots, near these, of the suspension with its wires
cut in two (`cut_wires`, `linear.roots`).
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.modes.cut_wires import CUTS, cut_all
from suspension_cli.elements.dynamic_wire import PARTS
from suspension_cli.errors import Fault, InputError
from suspension_cli.linear import batch_modes, damped, eigenmodes, mode_count, quality, roots
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.frequency_terms import WireTerm
from suspension_cli.linear.mode_count import Progress, silent
from suspension_cli.linear.pencil import Block, Pencil
from suspension_cli.linear.roots import Roots
from suspension_cli.linear.system import LinearSystem
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Int

SLOWEST = 1e-4
"""Fraction of the lowest static frequency below which modes are not searched for."""
CLOSE = 1e-6
"""Relative distance of frequencies whose shapes are solved for together."""
DEGENERATE = 1e-10
"""Relative distance of frequencies below which modes are one degenerate group."""
STRONG = 100
"""Q from dampers below which a pole is found from that without wire mass."""
TOGETHER = 256
"""Number of modes that are solved for at once."""
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
    has_dampers = damping and bool(damped.damping_matrix(model).any())
    if has_dampers:
        static = damped.solve(model, static)
    oscillates = static.select(has_dampers & (static.omega_squared > 0))
    strong = oscillates.select((oscillates.q < STRONG) & (oscillates.frequency <= highest))
    count = len(omega) - int(static.overdamped.sum()) // 2  # these oscillate without dampers
    found: list[_Found] = []
    others: list[_Found] = []
    began, left, short = time.monotonic(), np.arange(len(omega)), 0
    for fraction in CUTS:
        others, missed, solver = [], [], _Solver.of(model, fraction, strong)
        if fraction == CUTS[0] and len(strong.q):
            found.append(solver.describe(solver.strong))
        for part in _split(omega[left]):
            result, good = solver.solve(omega[left[part]], damping=damping)
            found.append(result.select(good))
            others.append(result.select(~good))
            missed.append(left[part[~good]])
            done = len(omega) - len(left) + int(part[-1]) + 1
            progress(done, len(omega), done / max(time.monotonic() - began, 1e-9))
        left = np.concatenate(missed)
        short = count - sum(len(part.value) for part in found)
        if not len(left) or short <= 0:
            break
    else:
        found.append(_Found.join(others).select(np.arange(len(left)) < short))
    modes = _build_modes(model, _Found.join(found), damping)
    still = static.select(slice(int((static.omega_squared <= 0).sum())))
    energy = np.zeros((len(still.q), len(modes.wire)))
    return replace(still, wire=modes.wire, wire_energy=energy).followed_by(modes)


def _split(omega: Float[np.ndarray, " mode"]) -> list[Int[np.ndarray, " _"]]:
    """Split modes, ascending, into parts that are solved at once."""
    result: list[list[int]] = [[]]
    apart = np.flatnonzero(np.diff(omega) > CLOSE * omega[1:]) + 1
    for group in np.split(np.arange(len(omega)), apart):
        if len(result[-1]) + len(group) > TOGETHER and result[-1]:
            result.append([])
        result[-1] += group.tolist()
    return [np.array(part) for part in result]


@dataclass(frozen=True)
class _Found:
    """Modes that oscillate, of unit modal mass with that of wires.

    Attributes
    ----------
    shape
        In the coordinates of the uncut system.
    energy
        Fraction of the kinetic energy in each part of the motion of each kind of wire (`moving`).
    lost, elastic
        See `quality.dissipation`.
    """

    moving: list[tuple[WireTerm, str]]
    value: Complex[np.ndarray, " mode"]
    shape: Array
    energy: Float[np.ndarray, "mode kind"]
    lost: Float[np.ndarray, " mode"]
    elastic: Float[np.ndarray, " mode"]

    def select(self, some: Bool[np.ndarray, " mode"]) -> _Found:
        """Select some modes."""
        parts = (self.value, self.shape, self.energy, self.lost, self.elastic)
        return _Found(self.moving, *(part[some] for part in parts))

    @staticmethod
    def join(parts: list[_Found]) -> _Found:
        """Join modes, ascending."""
        names = ("value", "shape", "energy", "lost", "elastic")
        both = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
        order = batch_modes.ascending(np.abs(both["value"]) ** 2)
        return _Found(parts[0].moving, **{name: part[order] for name, part in both.items()})


@dataclass(frozen=True)
class _Solver:
    """Solver for modes near given frequencies, with wires cut at one place."""

    model: LinearSystem
    pencil: Pencil
    block: Block
    moving: list[tuple[WireTerm, str]]
    strong: Roots

    @staticmethod
    def of(model: LinearSystem, fraction: float, strong: Modes) -> _Solver:
        """Cut the wires of a system; find the poles of modes that are strongly damped."""
        cut, kinds = cut_all(model, fraction)
        pencil = Pencil.of(cut)
        order = np.argsort(pencil.owner[6:], kind="stable")
        block = Block(pencil, 6 + order, np.ones(6, dtype=bool))
        value = -strong.decay_rate + 1j * np.sqrt(
            np.maximum(strong.omega_squared - strong.decay_rate**2, 0.0)
        )
        shapes = np.zeros((len(value), cut.size))
        shapes[:, : model.size] = np.pad(strong.shape, ((0, 0), (6, 0))) @ model.basis
        motion = np.zeros((len(block.owner), len(value)))
        motion[: len(block.keep)] = shapes[:, block.keep].T
        start = Roots.starts(value, np.zeros(len(value), dtype=int), motion)
        found = roots.find_roots(pencil, [block], start, strong.decay_rate, "all")
        known = found.select(~(found.lost | roots.repeated(found)))
        return _Solver(
            model, pencil, block, [(term, part) for term in kinds for part in PARTS], known
        )

    def solve(
        self, omega: Float[np.ndarray, " mode"], *, damping: bool
    ) -> tuple[_Found, Bool[np.ndarray, " mode"]]:
        """Solve for the modes at frequencies without loss (rad/s), and mark those that are found.

        If `damping`, for the poles and shapes with all losses.
        """
        random = np.random.default_rng(0).normal(size=(len(self.block.owner), len(omega)))
        start = Roots.starts(1j * omega, np.zeros(len(omega), dtype=int), random)
        groups, blocks = roots.group_roots(start, CLOSE), [self.block]
        found = roots.iterate(self.pencil, blocks, start, groups, 3, "none", fixed=True)
        found = roots.iterate(self.pencil, blocks, found, groups, 2, "none")
        each = list(np.arange(len(omega))[:, None])
        found = roots.iterate(self.pencil, blocks, found, each, roots.STEPS, "none")
        motion = found.motion[:, np.argsort(np.imag(found.value), kind="stable")]
        # the shapes are real but for a factor
        lead = np.take_along_axis(motion, np.abs(motion).argmax(0)[None], 0)
        motion = np.real(motion / lead)
        for group in roots.group_roots(start, DEGENERATE):
            if len(group) > 1:
                vectors = np.linalg.qr(motion[:, group])[0]
                motion[:, group] = batch_modes.localise(np.zeros(len(group)), vectors)
        start = replace(start, motion=motion + 0j)
        result = self.describe(start)
        if not damping:
            return result, omega > 0
        # to first order in the losses; the poles of pieces, which their losses move, may be near
        first = 1j * np.sqrt(omega**2 + 1j * result.lost)
        start = replace(start, value=first)
        found = roots.find_roots(self.pencil, blocks, start, result.lost / (2 * omega), "all")
        every = self.strong.followed_by(found)
        again = roots.repeated(every)[len(self.strong.value) :]
        return self.describe(found), ~(found.lost | again)

    def describe(self, found: Roots) -> _Found:
        """Compute energies and dissipation."""
        value, motion = found.value, found.motion
        shapes = np.zeros((len(value), self.pencil.model.size), dtype=complex)
        shapes[:, self.block.keep] = motion[: len(self.block.keep)].T
        omega, ends = np.imag(value), quality.end_motions(self.pencil.model, shapes)
        pieces = [list(quality.wire_energies(*one, omega).values()) for one in ends]
        wires = [
            a + b for n in range(0, len(pieces), 2) for a, b in zip(*pieces[n : n + 2], strict=True)
        ]
        energy = np.array(wires).reshape(len(wires), len(value))
        own = shapes[:, : self.model.size]
        total = quality.quadratic_form(self.model.mass, own) + energy.sum(0)
        lost, elastic = quality.dissipation(self.pencil.model, omega, shapes, ends)
        return _Found(
            self.moving,
            value,
            own / np.sqrt(total)[:, None],
            (energy / total).T,
            lost / total,
            elastic / total,
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


def _build_modes(model: LinearSystem, found: _Found, damping: bool) -> Modes:
    """Build the modes that oscillate, ascending."""
    omega, value = np.imag(found.value), found.value
    sigma = -found.lost / (2 * omega)
    if damping:
        sigma = np.where(np.abs(sigma) < damped.SLOW * omega, sigma, np.real(value))
        sigma = sigma if model.active else np.minimum(sigma, 0.0)
        value = sigma + 1j * omega
    wire: dict[str, Array] = {}
    for (term, part), energy in zip(found.moving, found.energy.T, strict=True):
        name = f"{term.stage}.{NAMES[part]}"
        wire[name] = wire.get(name, 0.0) + energy
    names = tuple(name for name in wire if (wire[name] > 1e-12).any())
    energy, tips = eigenmodes.energy_fractions(model, found.shape)
    bodily = np.maximum(1 - found.energy.sum(1), 0.0)[:, None]
    shape = (damped.real_shapes(found.shape) @ model.basis.T)[:, 6:]
    q = damped.quality_factor(value) if damping else quality.safe_ratio(omega**2, found.lost)
    modes = Modes(
        body=model.body,
        coordinate=model.coordinate[6:],
        omega_squared=np.abs(value) ** 2,
        shape=_fix_signs(shape),
        energy=(bodily * energy).reshape(len(omega), -1, 6),
        tip_energy=bodily * tips,
        block=np.argmax([np.abs(found.shape[:, own]).sum(1) for own in model.blocks], axis=0),
        q=q,
        dilution=quality.safe_ratio(np.abs(value) ** 2, found.elastic),
        wire=names,
        wire_energy=np.array([wire[name] for name in names]).reshape(len(names), len(omega)).T,
        order=np.zeros(len(omega), dtype=np.intp),
        decay_rate=-sigma,
        top=model.top,
    )
    return replace(modes, order=_half_waves(modes, found))


def _half_waves(modes: Modes, found: _Found) -> Int[np.ndarray, " mode"]:
    """Number of half waves along the wires of each wire mode; 0 of other modes.

    It is that of the nearest resonance between fixed ends, of the kind of wire that moves most.
    """
    omega, home = np.imag(found.value), modes.home
    result = np.zeros(len(omega), dtype=np.intp)
    for stage, dof in set(home):
        alike = [
            n
            for n, (term, part) in enumerate(found.moving)
            if (term.stage, NAMES[part]) == (stage, dof)
        ]
        here = np.array([n for n, place in enumerate(home) if place == (stage, dof)])
        most = found.energy[here][:, alike].argmax(1) if alike else np.zeros(0, dtype=int)
        for number in set(most.tolist()):
            term, part = found.moving[alike[number]]
            own = here[most == number]
            resonances = term.strand.held_resonances(part, float(omega[own].max()))
            result[own] = np.abs(resonances - omega[own, None]).argmin(1) + 1
    return result


def _fix_signs(shape: Float[np.ndarray, "mode coordinate"]) -> Float[np.ndarray, "mode coordinate"]:
    """Give shapes the sign in which their largest coordinate is positive."""
    if not shape.size:
        return shape
    lead = shape[np.arange(len(shape)), np.abs(shape).argmax(1)]
    return shape * np.where(lead < 0, -1.0, 1.0)[:, None]
