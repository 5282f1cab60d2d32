"""Modes of a suspension whose wires have mass: pendulum, bounce and violin modes in one list.

>>> from suspension_cli.design import reader
>>> from suspension_cli.models import registry
>>> model = registry.VIOLIN.system(reader.parse(reader.template("single", "single")))
>>> solve(model, highest=2.0).frequency.round(3)
array([0.946, 0.946, 1.564])

`linear.roots` finds all frequencies without loss. Shapes and poles with all losses are roots,
near these, of the suspension with every wire cut in two (`physics.cut_wires`, `linear.roots`). The
cut is at a point of no symmetry, whose motion becomes six more coordinates: then a violin mode that
moves no body has a shape too, and no stiffness function is near its pole at a mode.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.elements.dynamic_wire import PARTS
from suspension_cli.errors import Fault, InputError
from suspension_cli.linear import batch_modes, damped, eigenmodes, quality, roots
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.mode_pairing import pair_bodies
from suspension_cli.linear.pencil import Block, Pencil
from suspension_cli.linear.roots import Progress, Roots, silent
from suspension_cli.linear.solver import Solvable, Solver
from suspension_cli.linear.structure import Structure
from suspension_cli.linear.system import LinearSystem
from suspension_cli.linear.terms import LIGHT_ENDING
from suspension_cli.linear.wire_term import WireTerm, is_massive
from suspension_cli.models.choice import shifts_by_wire_mass
from suspension_cli.models.spectrum_error import has_wire_mass
from suspension_cli.physics import cut_wires
from suspension_cli.physics.cut_wires import CutWires
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Int

CUTS = ((3 - 5**0.5) / 2, 0.36, 0.45)
"""Fractions of a wire above the cut, tried in turn: the golden section is far from nodes of low
order, but a piece may resonate at the frequency of a mode."""
HIGHEST = 1.05
"""Highest frequency of the search for modes of bodies with wire mass, over the highest without;
wire mass lowers frequencies, except next to a violin mode."""
RAISED = 1.5
"""Highest frequency of that search over the highest without wire mass, if wires have dampers: one
that is tuned below a mode raises it."""
SLOWEST = 1e-4
"""Fraction of the lowest static frequency below which modes are not searched for."""
LONGER = 4
"""Number of steps that roots take together if wires have dampers, which move them far."""
CLOSE = 1e-6
"""Relative distance of frequencies whose shapes are solved for together."""
DEGENERATE = 1e-10
"""Relative distance of frequencies below which modes are one degenerate group."""
STRONG = 100
"""Q from dampers below which a pole is found from that without wire mass."""
TOGETHER = 256
"""Number of modes that are solved for at once."""
BODILY = 0.5
"""Fraction of the energy of a mode of bodies that is not in wires."""
FOLLOWED = 0.1
"""Largest relative change by wire mass of modes of bodies that are followed from those without it:
one that changes more is among those of wires."""
RECOIL = 0.02
"""Largest relative distance of a violin mode from the resonance between fixed ends."""
PRECISE = 1e-11
"""Relative error of a violin mode that is found by counting."""
DIVIDED = 15
"""Frequencies at which modes are counted at once."""
MINUTE = 1e8
"""Modes times the squared number of coordinates, with those of the cuts, that take about a minute:
the elimination of a mode grows with that square."""
NONE = np.zeros(0, dtype=complex)
"""No poles."""
NAMES = {"bend-1": "violin-x", "bend-2": "violin-y", "stretch": "stretch", "twist": "twist"}
"""Names of the parts of a wire's motion in `Modes.wire`."""


def solve_undamped_bodies(model: LinearSystem) -> Modes:
    """Solve for the undamped modes of bodies; with wire mass, those most like the modes without."""
    static = eigenmodes.solve(model.constant)
    if not has_wire_mass(model):
        return static
    found = solve(model, HIGHEST * float(np.nanmax(static.frequency)))
    pairs = pair_bodies(static, found, model)
    return found.select(np.sort(pairs[pairs >= 0]))


def solve(
    system: Solvable, highest: float, *, damping: bool = False, progress: Progress = silent
) -> Modes:
    """Solve for all modes of the violin model up to a frequency (Hz).

    If `damping`, with all losses (see `linear.damped`); else for undamped modes, with Q to first
    order in the losses. Modes that do not oscillate are first; for undamped modes these neglect
    wire mass. Raises `InputError` if no mode lies below `highest`, or if one is lost.
    """
    prepared = Solver.of(system)
    model = prepared.system
    static = prepared.constant.modes
    lowest = _lowest_frequency(static)
    omega = roots.mode_frequencies(prepared, 2 * np.pi * highest, lowest, progress)
    if not len(omega):
        raise no_mode_error(highest)
    strong = static.select(slice(0))
    if damping and (damped.damping_matrix(model).any() or model.terms_with_states):
        # wire mass may move a pole far; one that is lost here is followed from without losses
        static = damped.solve(prepared, skip_lost=True)
        of_light = damped.mark_light(static)
        fast = 2 * STRONG * np.abs(static.decay_rate) > np.sqrt(np.abs(static.omega_squared))
        below = static.omega_squared <= (2 * np.pi * highest) ** 2
        strong = static.select((static.omega_squared > 0) & below & fast & ~of_light)
        static = static.select((static.omega_squared <= 0) | (of_light & below))
    of_light = damped.mark_light(static)
    still = static.select((static.omega_squared <= 0) | of_light)
    # overdamped modes oscillate without dampers
    count = len(omega) - int((static.overdamped & ~of_light).sum()) // 2
    modes = _find_modes(prepared, omega, strong, count, progress, damping=damping)
    return _joined(still, modes)


def _find_modes(
    prepared: Solver,
    omega: Float[np.ndarray, " mode"],
    strong: Modes,
    count: int,
    progress: Progress,
    *,
    damping: bool,
) -> Modes:
    """Find the modes at frequencies without loss (rad/s), `count` of them with losses.

    The wires are cut at another place for those that are missed. `strong` are modes that dampers
    resist strongly.
    """
    began = time.monotonic()
    left = omega
    found: list[Modes] = []
    others: list[Modes] = []
    for fraction in CUTS:
        solver = _WiresCut.of(prepared, fraction, strong)
        others = []
        missed = []
        done = len(omega) - len(left)
        if fraction == CUTS[0] and len(strong.q):
            found.append(solver.describe(solver.strong))
        for part in _split(left):
            known = np.concatenate([solver.strong.value, *map(_poles, found)])
            result, good = solver.solve(part, damping=damping, known=known)
            found.append(result.select(good))
            others.append(result.select(~good))
            missed.append(part[~good])
            done += len(part)
            progress(done, len(omega), done / max(time.monotonic() - began, 1e-9))
        left = np.concatenate(missed)
        short = count - sum(len(part.q) for part in found)
        if not len(left) or short <= 0:
            return found[0].followed_by(*found[1:]).ascending()
    rest = others[0].followed_by(*others[1:]).ascending()
    raise damped.LostModeError.of_mode(rest.label[0], float(left[0]) / (2 * np.pi))


def _poles(modes: Modes) -> Complex[np.ndarray, " mode"]:
    """Poles s (rad/s) of modes that oscillate."""
    squared = np.maximum(modes.omega_squared - modes.decay_rate**2, 0.0)
    return -modes.decay_rate + 1j * np.sqrt(squared)


def _joined(still: Modes, modes: Modes) -> Modes:
    """Join modes that do not oscillate, and those of light, with modes that move wires."""
    moving = np.asarray((modes.wire_energy > 1e-12).any(0))
    of_wires = [name for name, some in zip(modes.wire, moving, strict=True) if some]
    light = [n for n, name in enumerate(still.wire) if name.endswith(LIGHT_ENDING)]
    names = (*of_wires, *(still.wire[n] for n in light))
    energy = np.zeros((len(still.q), len(names)))
    energy[:, len(of_wires) :] = still.wire_energy[:, light]
    without_light = np.zeros((len(modes.q), len(light)))
    of_both = np.concatenate([modes.wire_energy[:, moving], without_light], axis=1)
    modes = replace(modes, wire=names, wire_energy=of_both)
    return replace(still, wire=names, wire_energy=energy).followed_by(modes).ascending()


def solve_between(system: Solvable, low: float, high: float) -> Modes:
    """Solve for the undamped modes of the violin model between two frequencies, Hz.

    Raises `InputError` if there is none.
    """
    prepared = Solver.of(system)
    omega = roots.mode_frequencies(prepared, 2 * np.pi * high, 2 * np.pi * low)
    if not len(omega):
        raise no_mode_error(high)
    none = prepared.constant.modes.select(slice(0))
    solver = _WiresCut.of(prepared, CUTS[0], none)
    found = [solver.solve(part, damping=False)[0] for part in _split(omega)]
    return found[0].followed_by(*found[1:]).ascending()


def lowest_violin_mode(system: Solvable, stage: str, order: int) -> float:
    """Find the lowest violin mode of some order, Hz, of the wires of a stage ("": of all wires).

    It lies near the resonance of a wire between fixed ends, from which the recoil of the bodies
    moves it. If there are other modes nearby, their shapes tell which is of these wires.
    Raises `InputError` if there is none.
    """
    solver = Solver.of(system)
    wires = [term for term in solver.system.terms if isinstance(term, WireTerm)]
    own = [term for term in wires if stage in ("", term.stage)]
    held = np.array([_held_bending(term, order) for term in own])
    if not held.size:
        raise no_mode_error(0.0)
    window = held.min() * np.array([1 - RECOIL, 1 + RECOIL])
    inside = (held >= window[0]) & (held <= window[1])
    count = np.array([len(term.forms["twist"]) for term in own])
    expected = int((inside * count[:, None]).sum())
    below = roots.modes_below(solver, window)
    others = any(_resonates(term, window) for term in wires if term not in own)
    if below[1] - below[0] == expected and not others:
        return _bisect(solver, int(below[0]) + 1, *window.tolist()) / (2 * np.pi)
    found = solve_between(solver, *(window / (2 * np.pi)).tolist())
    rows = zip(found.frequency, found.order, found.home, strict=True)
    known = [
        float(frequency)
        for frequency, waves, (body, motion) in rows
        if waves == order and stage in ("", body) and motion.startswith("violin")
    ]
    return min(known, default=np.nan)


def _held_bending(term: WireTerm, order: int) -> list[float]:
    """Resonances of an order of both planes of a wire between fixed ends, rad/s."""
    sections = term.strand.fibre.sections
    mass = sum(section.mass * section.length for section in sections)
    length = sum(section.length for section in sections)
    string = np.pi * order * float(np.sqrt(term.strand.tension / (mass * length)))
    found = []
    for part in ("bend-1", "bend-2"):
        found.append(float(term.strand.held_resonances(part, string)[order - 1]))
    return found


def _resonates(term: WireTerm, window: Float[np.ndarray, " end"]) -> bool:
    """Whether a wire between fixed ends resonates within a window, rad/s."""
    below = term.strand.resonances_below(window)
    return bool(below[1] > below[0])


def _bisect(solver: Solver, number: int, low: float, high: float) -> float:
    """Find mode number `number`, from 1, between two frequencies in rad/s."""
    while high - low > PRECISE * high:
        inner = np.linspace(low, high, DIVIDED + 2)
        place = int(np.searchsorted(roots.modes_below(solver, inner), number))
        low = float(inner[max(place - 1, 0)])
        high = float(inner[min(place, DIVIDED + 1)])
    return high


def solve_bodies(
    system: Solvable,
    admit: Callable[[int, float], None] = lambda _number, _top: None,
    progress: Progress = silent,
) -> Modes:
    """Solve for the modes of bodies with all losses.

    With wire mass each is followed from the one without, if that changes it by less than
    `FOLLOWED`. If one of them is lost or a mode of wires, or one is found twice, all modes up to
    the highest without wire mass are solved for; before, `admit` is called with their number and
    that frequency, Hz.
    """
    solver = Solver.of(system)
    if not any(map(is_massive, solver.system.terms)):
        return damped.solve(solver)
    if shifts_by_wire_mass(solver.constant.modes, solver.system).max(initial=0.0) < FOLLOWED:
        with contextlib.suppress(damped.LostModeError):
            found = damped.solve(solver)
            share = found.energy.sum((1, 2)) + found.tip_energy.sum(1)
            bodily = (share > BODILY) | damped.mark_light(found)
            if bodily.all() and not _repeated(solver.system, found):
                return found
    top = float(np.nanmax(solver.modes.frequency))
    if any(isinstance(term, WireTerm) and term.strand.damped for term in solver.system.terms):
        top *= RAISED  # else wire mass lowers all frequencies
    admit(count_modes(solver, top), top)
    found = solve(solver, top, damping=True, progress=progress)
    of_bodies = found.order == 0
    return found.select(of_bodies) if of_bodies.any() else found


def _repeated(model: LinearSystem, found: Modes) -> bool:
    """Whether a mode is found twice: with one frequency, and a similar shape."""
    shapes = np.pad(found.shape, ((0, 0), (6, 0))) @ model.basis
    overlap = np.abs(shapes @ model.mass @ shapes.T)
    size = np.sqrt(overlap.diagonal())
    alike = np.isclose(found.omega_squared[:, None], found.omega_squared, rtol=1e-9, atol=0.0)
    return bool((np.triu(alike, 1) & (overlap > (1 - BODILY) * np.outer(size, size))).any())


def _split(omega: Float[np.ndarray, " mode"]) -> list[Float[np.ndarray, " _"]]:
    """Split frequencies, ascending, into parts that are solved at once, close ones together."""
    apart = np.flatnonzero(np.diff(omega) > CLOSE * omega[1:]) + 1
    at = np.searchsorted(apart, np.arange(TOGETHER, len(omega), TOGETHER))
    return np.split(omega, np.unique(apart[at[at < len(apart)]]))


@dataclass(frozen=True)
class _WiresCut:
    """Solver for modes near given frequencies, with wires of several kinds cut at one place.

    `whole` is that of the system with whole wires, `strong` are the poles of strongly damped modes.
    """

    whole: Solver
    pencil: Pencil
    block: Block
    kinds: list[CutWires]
    strong: Roots

    @staticmethod
    def of(whole: Solver, fraction: float, strong: Modes) -> _WiresCut:
        """Cut the wires of a system; find the shapes of modes that are strongly damped."""
        cut, kinds = cut_wires.cut_all(whole.system, fraction)
        pencil = Pencil(Structure(cut))
        order = np.argsort(pencil.owner[6:], kind="stable")
        blocks = [Block(pencil, 6 + order, np.ones(6, dtype=bool))]
        shapes = np.zeros((len(strong.q), cut.size))
        model = whole.system
        shapes[:, : model.size] = np.pad(strong.shape, ((0, 0), (6, 0))) @ model.basis
        member = np.zeros(len(strong.q), dtype=int)
        start = Roots.starts(blocks, _poles(strong), member, shapes)
        # poles of whole wires are poles of cut ones: a search from them might lose them again
        known = roots.find_shapes(pencil, blocks, start)
        return _WiresCut(whole, pencil, blocks[0], kinds, known.select(~roots.repeated(known)))

    def solve(
        self,
        omega: Float[np.ndarray, " mode"],
        *,
        damping: bool,
        known: Complex[np.ndarray, " known"] = NONE,
    ) -> tuple[Modes, Bool[np.ndarray, " mode"]]:
        """Solve for the modes at frequencies without loss (rad/s), and mark those that are found.

        If `damping`, for the poles and shapes with all losses; those that are `known` (rad/s), with
        wires cut here or elsewhere, do not count again.
        """
        blocks = [self.block]
        member = np.zeros(len(omega), dtype=int)
        random = np.random.default_rng(0).normal(size=(len(omega), self.pencil.model.size))
        start = Roots.starts(blocks, 1j * omega, member, random)
        found = roots.find_roots(self.pencil, blocks, start, 0.0, "none", CLOSE, 3)
        motion = found.motion[:, np.argsort(np.imag(found.value), kind="stable")]
        # the shapes are real but for a factor
        lead = np.take_along_axis(motion, np.abs(motion).argmax(0)[None], 0)
        motion = np.real(motion / lead)
        for group in roots.group_roots(start, DEGENERATE, 0 * omega):
            if len(group) > 1:
                vectors = np.linalg.qr(motion[:, group])[0]
                motion[:, group] = batch_modes.localise(np.zeros(len(group)), vectors)
        start = replace(start, motion=motion + 0j)
        if not damping:
            return self.describe(start), omega > 0
        # to first order in the losses; the poles of pieces, which their losses move, may be near
        shapes = start.motions(blocks, self.pencil.model.size)
        q = quality.evaluate(self.pencil.model, start.value, shapes).q
        start = replace(start, value=1j * np.sqrt(omega**2 * (1 + 1j / q)))
        damped_wires = any(kind.term.strand.damped for kind in self.kinds)
        together = LONGER if damped_wires else roots.TOGETHER
        found = roots.find_roots(self.pencil, blocks, start, omega / (2 * q), together=together)
        # of those that are one the nearest to its start counts: others have strayed
        order = np.argsort(np.abs(found.value - start.value) / omega, kind="stable")
        again = np.zeros(len(omega), dtype=bool)
        again[order] = roots.repeated(found.select(order))
        again |= roots.mark_known(self.pencil, blocks, found, known)
        return self.describe(found), ~(found.lost | again)

    def describe(self, found: Roots) -> Modes:
        """Build the modes of roots, in their order."""
        value = found.value
        cut = self.pencil.model
        motion = found.motions([self.block], cut.size)
        own = motion[:, : self.whole.system.size]
        quantities = quality.evaluate(cut, value, motion)
        # of all pieces
        first = np.cumsum([0, *(len(kind.pieces) for kind in self.kinds[:-1])])
        energy = np.add.reduceat(quantities.wires, first, axis=0)
        of_dampers = np.array([kind.damper_energies(motion) for kind in self.kinds])
        of_dampers = of_dampers / np.where(quantities.weight > 0, quantities.weight, 1.0)
        energy += of_dampers
        quantities = replace(quantities, bodily=quantities.bodily - of_dampers.sum((0, 1)))
        shape = own / np.sqrt(quantities.weight)[:, None]
        block = np.argmax(
            [np.abs(own[:, some]).sum(1) for some in self.whole.structure.blocks], axis=0
        )
        modes = eigenmodes.build(self.whole.system, value, shape, block, quantities)
        wire: dict[str, Array] = {}
        for kind, parts in zip(self.kinds, energy, strict=True):
            for part, fraction in zip(PARTS, parts, strict=True):
                name = f"{kind.term.stage}.{NAMES[part]}"
                wire[name] = wire.get(name, 0.0) + fraction
        modes = replace(modes, wire=tuple(wire), wire_energy=np.array([*wire.values()]).T)
        return replace(modes, order=self._half_waves(modes, np.imag(value), energy))

    def _half_waves(
        self,
        modes: Modes,
        omega: Float[np.ndarray, " mode"],
        energy: Float[np.ndarray, "kind part mode"],
    ) -> Int[np.ndarray, " mode"]:
        """Number of half waves along the wires of each wire mode; 0 of other modes.

        It is that of the nearest resonance between fixed ends, of the kind of wire that moves most.
        """
        part_of = {NAMES[part]: part for part in PARTS}
        result = np.zeros(len(omega), dtype=np.intp)

        @cache
        def resonances(kind: int, part: str) -> Array:
            return self.kinds[kind].term.strand.held_resonances(part, float(omega.max()))

        for n, (stage, dof) in enumerate(modes.home):
            part = part_of.get(dof)
            alike = [kind for kind, own in enumerate(self.kinds) if own.term.stage == stage]
            if part and alike:
                kind = max(alike, key=lambda kind: energy[kind, PARTS.index(part), n])
                result[n] = np.abs(resonances(kind, part) - omega[n]).argmin() + 1
        return result


def count_modes(system: Solvable, highest: float) -> int:
    """Count the modes that oscillate below a frequency (Hz), without solving for them."""
    solver = Solver.of(system)
    lowest = _lowest_frequency(solver.constant.modes)
    low, high = roots.modes_below(solver, np.array([lowest, max(2 * np.pi * highest, lowest)]))
    return int(high - low)


def most_in_a_minute(model: LinearSystem, most: int) -> int:
    """Number of modes that are found in about a minute, at most `most`; fewer of larger systems."""
    wires = sum(len(term.number) for term in model.terms if isinstance(term, WireTerm))
    coordinates = model.size + cut_wires.PER_CUT * wires
    return min(most, int(MINUTE / coordinates**2))


def no_mode_error(highest: float) -> InputError:
    """Error for a frequency range without modes."""
    problem = "is below the lowest mode, so there is no mode to list"
    return InputError([Fault("--max-frequency", problem, "raise it", f"{highest!r}")])


def _lowest_frequency(static: Modes) -> float:
    """Frequency below which modes are not searched for, rad/s."""
    squared = np.abs(static.omega_squared[static.omega_squared != 0])
    return SLOWEST * float(np.sqrt(squared.min(initial=(2 * np.pi) ** 2)))
