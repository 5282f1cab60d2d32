"""Modes with dampers, losses and light of any size: poles s = sigma + i omega of a suspension.

>>> from suspension_cli.design import reader
>>> from suspension_cli.models import registry
>>> model = registry.BEAM.system(reader.parse(reader.template("single", "single")))
>>> solve(model).frequency.round(3)
array([ 0.946,  0.946,  1.564,  3.495, 18.55 , 27.722])

Without losses the poles are those of constant matrices, K + s C + s^2 M, with the light of a cavity
as two coordinates more (`statespace.with_states`): eigenvalues, none of which can be
missed. Loss angles, phase lags of an oscillation, act at its frequency omega alone. Newton's method
(`roots`) follows each pole to that with losses, or removes its rounding errors; where it loses one,
or finds one twice, and where a table gives a stiffness against frequency, the poles are found by
counting (`oscillations`).

A pole that oscillates has the frequency |s| / 2 pi and Q = Im s / (-2 Re s), which is pi times the
number of oscillations in which the amplitude of a ring-down falls to 1/e. For m x'' + k (1 + i phi)
x = 0, Q = 1 / (2 tan(atan(phi) / 2)), 10.025 for phi = 0.1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.errors import Fault, InputError
from suspension_cli.linear import eigenmodes, quality
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.matrix_terms import Damper, StiffnessTable
from suspension_cli.linear.oscillations import find_oscillations, settle
from suspension_cli.linear.pencil import Block
from suspension_cli.linear.quality import Quality
from suspension_cli.linear.roots import (
    NOISE,
    ROUGH,
    Roots,
    find_all,
    repeated,
)
from suspension_cli.linear.solver import Solvable, Solver
from suspension_cli.linear.statespace import ROUNDING, with_states
from suspension_cli.linear.system import LinearSystem
from suspension_cli.linear.terms import LIGHT_ENDING, quadratic_form
from suspension_cli.linear.wire_term import EvaluatedWires, is_massive

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Inexact, Int

    from suspension_cli.linear.oscillations import Poles

UNDAMPED = 1e-12
"""Fraction of the largest damping below which a motion counts as undamped."""
NEARBY = 1e-2
"""Relative distance from its start up to which a pole is sought among eigenvalues."""
AGREES = 1e-4
"""Relative distance up to which Newton's method removes rounding errors of an eigenvalue."""
STEEP = 0.1
"""Relative change of stiffness within the factor e of the frequency that is small."""
TABLES = np.geomspace(1e-5, 1e6, 1101)
"""Frequencies (rad/s) at which changes of stiffness are measured."""
LIGHT = 0.5
"""Fraction of a mode in light above which it is the light's."""


class LostModeError(InputError):
    """A pole that the search has lost, so that its mode and the stability are unknown."""

    @staticmethod
    def of_loops(state: str, frequency: float) -> LostModeError:
        """Error for a closed-loop pole that starts in a state at a frequency, Hz."""
        problem = (
            f"the pole near {frequency:.4g} Hz in {state} was not found with all losses and delays,"
            " so whether the motion grows is not known"
        )
        remedy = "lower the losses that act on it, or the delay or gain of its loops"
        return LostModeError([Fault("control", problem, remedy)])

    @staticmethod
    def of_mode(label: str, frequency: float) -> LostModeError:
        """Error for the mode that starts from an undamped one at a frequency, Hz."""
        problem = (
            f"the mode that without losses is {label} at {frequency:.4g} Hz was not found with"
            " them, so neither the modes nor whether one grows are known"
        )
        remedy = "lower the losses or dampers that act on it, or take --fidelity beam"
        return LostModeError([Fault("stage", problem, remedy)])


def solve(system: Solvable, *, skip_lost: bool = False) -> Modes:
    """Solve for modes with dampers and losses of any size, for a system without batch axes.

    Of an unstable mode only the growing pole counts, not the decaying one at about the opposite
    value. The light of each detuned cavity has a mode of its own, or two that do not oscillate.
    With wire mass these are the modes of bodies alone, each followed from the one without: from a
    start far away a mode of wires may be found instead. Raises `LostModeError` if a pole is lost,
    but to `skip_lost` ones that oscillate, which a caller then finds otherwise.
    """
    given = Solver.of(system)
    model = given.system
    states = with_states(model)
    solver = given if states is model else Solver(states)
    still = solver.spectrum
    first = solver.modes
    damping = damping_matrix(states)
    plain = np.ones(len(first.q), dtype=bool)
    loss = np.where(still.omega_squared > 0, 1 / np.maximum(first.q, 1.0), 0.0)
    starts: list[Poles] = []
    parts: list[_Block] = []
    for number, block in enumerate(solver.blocks):
        own = np.flatnonzero(still.block == number)
        part = _Block(block, damping, still.omega_squared[own], still.motion[own])
        parts.append(part)
        if part.is_damped:
            starts.append(part.linear_poles(loss[own] if part.is_lossy else 0 * loss[own]))
            # a rigid mode has one pole, 0, beside those that dampers give it
            plain[own] = part.squared == 0
        elif part.is_lossy:
            some = part.squared > 0
            start = 1j * np.sqrt(part.squared[some] * (1 + 1j * loss[own[some]]))
            starts.append((start, part.shapes[some]))
            plain[own] = ~some
        else:
            starts.append(part.none)
    if plain.all() and not any(len(value) for value, _ in starts):
        return first
    has_light = [bool((block.keep >= model.size).any()) for block in solver.blocks]
    may_lose = [skip_lost and not some for some in has_light]  # light is told by its poles' number
    value, member, motion = _find(solver, parts, starts, first, may_lose)
    motion /= np.sqrt(quadratic_form(model.mass, motion.T[: model.size]))[:, None]
    value = np.concatenate([np.sqrt(-still.omega_squared[plain] + 0j), value])
    motion = np.concatenate([still.motion[plain], motion])
    member = np.append(still.block[plain], member)
    light = _state_fractions(model, value, motion)
    found = _evaluate(states, value, motion, light.sum(1) > LIGHT)
    made = eigenmodes.build(model, value, motion[:, : model.size], member, found)
    return _with_states_as_motions(made, model, light).ascending()


def _evaluate(
    states: LinearSystem,
    value: Complex[np.ndarray, " mode"],
    motion: Complex[np.ndarray, "mode coordinate"],
    of_light: Bool[np.ndarray, " mode"],
) -> Quality:
    """Evaluate decay and energies; modes `of_light`, whose energy is not in bodies, keep theirs."""
    found = quality.evaluate(states, value, motion)
    omega = np.imag(value)
    rate = np.real(value)
    decays = of_light & (omega > 0) & (rate < 0)
    q = np.where(decays, omega / np.where(decays, -2 * rate, 1.0), found.q)
    refined = np.where(of_light, value, found.value)
    rate = np.real(refined)
    steady = (omega > 0) & (rate > 0) & (rate <= ROUNDING * omega)
    dilution = np.where(of_light, np.nan, found.dilution)
    return replace(found, value=np.where(steady, 1j * omega, refined), q=q, dilution=dilution)


def _state_fractions(
    model: LinearSystem,
    value: Complex[np.ndarray, " mode"],
    motion: Complex[np.ndarray, "mode coordinate"],
) -> Float[np.ndarray, "mode term"]:
    """Fraction of each mode, of unit modal mass, in the states of each term that has any.

    It is that of the terms of x^T Z'(s) x: 2 s of all bodies, and q^T (C + 2 s M) q of the states q
    with their own matrices C and M. Those of light cancel where it follows at once.
    """
    terms = model.terms_with_states
    each = np.zeros((len(value), len(terms)))
    start = model.size
    for n, term in enumerate(terms):
        states = term.states()
        own = slice(-states.count, None)
        slope = states.damping[own, own] + 2 * value[:, None, None] * states.mass[own, own]
        moved = motion[:, start : start + states.count]
        each[:, n] = np.abs(np.einsum("mi,mij,mj->m", moved, slope, moved))
        start += states.count
    whole = each.sum(1) + 2 * np.abs(value)
    return each / np.where(whole > 0, whole, 1.0)[:, None]


def _with_states_as_motions(
    modes: Modes, model: LinearSystem, fraction: Float[np.ndarray, "mode term"]
) -> Modes:
    """Add the motions of states, such as the light of detuned cavities, and their fractions."""
    if not fraction.shape[1]:
        return modes
    bodies = 1 - fraction.sum(1)
    return replace(
        modes,
        wire=tuple(term.motion_name for term in model.terms_with_states),
        wire_energy=fraction,
        energy=modes.energy * bodies[:, None, None],
        tip_energy=modes.tip_energy * bodies[:, None],
    )


def mark_light(modes: Modes) -> Bool[np.ndarray, " mode"]:
    """Mark the modes of the light of cavities: two poles each, with the largest fractions in it."""
    of_light = np.array([name.endswith(LIGHT_ENDING) for name in modes.wire], dtype=bool)
    fraction = modes.wire_energy[:, of_light].sum(1)
    poles = 2 * int(of_light.sum())
    result = np.zeros(len(fraction), dtype=bool)
    for n in np.argsort(-fraction, kind="stable"):
        own = 2 if modes.omega_squared[n] > 0 else 1
        if own <= poles:
            result[n] = True
            poles -= own
    return result


def damping_matrix(model: LinearSystem) -> Float[np.ndarray, "coordinate coordinate"]:
    """Damping matrix C of dampers and of gas around bodies, N s/m."""
    return model.damping + sum(
        (term.matrix for term in model.terms if isinstance(term, Damper)),
        np.zeros(model.damping.shape),
    )


def _find(
    solver: Solver,
    parts: Sequence[_Block],
    starts: Sequence[Poles],
    first: Modes,
    may_lose: Sequence[bool],
) -> tuple[
    Complex[np.ndarray, " pole"],
    Int[np.ndarray, " pole"],
    Complex[np.ndarray, "pole coordinate"],
]:
    """Find the poles of all blocks from start values: s, block and shape.

    Raises `LostModeError` if one of wires with mass is lost; others cannot be. Those that oscillate
    are left out instead of blocks that `may_lose` some.
    """
    pencil = solver.pencil
    blocks = solver.blocks
    member = np.repeat(np.arange(len(parts)), [len(value) for value, _ in starts])
    start = Roots.starts(
        blocks,
        np.concatenate([value for value, _ in starts]),
        member,
        np.concatenate([motion for _, motion in starts]),
    )
    wires = any(part.is_massive for part in parts)
    found = find_all(pencil, blocks, start, ROUGH if wires else NOISE)
    values = found.value
    motions = found.motions(blocks, pencil.model.size)
    every: list[Poles] = []
    for number, part in enumerate(parts):
        own = member == number
        lost = found.lost[own]
        needed = lost & ~(may_lose[number] & (np.imag(start.value[own]) > 0))
        if part.is_massive and needed.any():
            omega = float(np.abs(start.value[own][needed][0]))
            near = np.where(first.block == number, first.omega_squared, np.inf)
            n = int(np.abs(near - omega**2).argmin())
            raise LostModeError.of_mode(first.label[n], omega / (2 * np.pi))
        if part.is_massive:
            every.append((values[own][~lost], motions[own][~lost]))
        elif part.has_steep_tables:
            every.append(part.counted_poles())
        elif not lost.any():
            every.append((values[own], motions[own]))
        elif part.is_lossy:
            settled = part.settled_poles((values[own], motions[own]), lost)
            every.append(part.counted_poles() if settled is None else settled)
        else:  # these are eigenvalues already
            every.append(starts[number])
    return (
        np.concatenate([value for value, _ in every]),
        np.repeat(np.arange(len(parts)), [len(value) for value, _ in every]),
        np.concatenate([motion for _, motion in every]) + 0j,
    )


@dataclass(frozen=True)
class _Block:
    """Coordinates that couple to no others, of a system with the states of light.

    Attributes
    ----------
    damping
        Of the system, N s/m.
    squared, shapes
        omega^2 and shapes of its undamped modes, in the coordinates of the system.
    """

    block: Block
    damping: Float[np.ndarray, "coordinate coordinate"]
    squared: Float[np.ndarray, " mode"]
    shapes: Float[np.ndarray, "mode coordinate"]

    @property
    def model(self) -> LinearSystem:
        """The system."""
        return self.block.pencil.model

    @property
    def is_damped(self) -> bool:
        """Whether dampers act."""
        keep = self.block.keep
        return bool(self.damping[np.ix_(keep, keep)].any())

    @cached_property
    def is_lossy(self) -> bool:
        """Whether the stiffness has losses, or depends on frequency."""
        terms = any(not term.is_viscous for _, term in self.block.terms)
        return terms or bool(self.block.loss.any())

    @property
    def is_massive(self) -> bool:
        """Whether there are wires with mass."""
        return any(is_massive(term) for _, term in self.block.terms)

    @property
    def has_steep_tables(self) -> bool:
        """See `has_steep_tables`."""
        return has_steep_tables(self.block, self.squared, self.shapes)

    @property
    def none(self) -> Poles:
        """No pole."""
        return np.zeros(0, dtype=complex), self.shapes[:0] + 0j

    @cached_property
    def massless(
        self,
    ) -> tuple[Float[np.ndarray, "direction coordinate"], Float[np.ndarray, " direction"], int]:
        """Massless directions of stiffness +-1, those that dampers resist first; their number.

        With the signs of the stiffness of each massless coordinate.
        """
        keep = self.block.keep
        own = keep[self.model.massless[keep]]
        light, directions = np.linalg.eigh(self.model.stiffness[np.ix_(own, own)])
        directions = (directions / np.sqrt(np.abs(light))).T
        rates, turn = np.linalg.eigh(directions @ self.damping[np.ix_(own, own)] @ directions.T)
        resisted = np.abs(rates) > UNDAMPED * np.abs(rates).max(initial=0.0)
        turn = np.concatenate([turn[:, resisted], turn[:, ~resisted]], axis=1)
        rows = np.zeros((len(own), self.model.size))
        rows[:, own] = turn.T @ directions
        return rows, turn.T @ (np.sign(light)[:, None] * turn), int(resisted.sum())

    def linear_poles(self, loss: Float[np.ndarray, " mode"]) -> Poles:
        """Poles with Im s >= 0, and shapes, of K + s C + s^2 M.

        Loss angles are damping that gives each mode its `loss`, 1/Q to first order.
        """
        rows, stiffness, resisted = self.massless
        basis = np.concatenate([self.shapes, rows[:resisted]])
        m = len(self.squared)
        c = basis @ self.damping @ basis.T
        w = np.sqrt(np.abs(self.squared))
        own = np.arange(m)
        c[own, own] += np.where(loss > 0, np.maximum(w * loss - c[own, own], 0.0), 0.0)
        k = np.zeros_like(c)
        k[own, own] = self.squared
        k[m:, m:] = stiffness[:resisted, :resisted]
        value, vectors = _eigenvalues(k, c, w)
        kept = np.imag(value) >= 0
        rigid = c[:m, :m][np.ix_(w == 0, w == 0)]
        if len(rigid):  # combinations of rigid modes without damping: 0 but for rounding
            rank = np.linalg.matrix_rank(rigid, tol=UNDAMPED * np.abs(c).max(), hermitian=True)
            kept[np.argsort(np.abs(value), kind="stable")[: len(rigid) - int(rank)]] = False
        kept[kept] = ~_mark_counterparts(value[kept], int((self.squared < 0).sum()))
        return value[kept], vectors[:, kept].T @ basis

    @cached_property
    def real_poles(self) -> Poles:
        """Poles that do not oscillate, on which losses do not act."""
        value, motion = self.linear_poles(0 * self.squared)
        return value[np.imag(value) == 0], motion[np.imag(value) == 0]

    def _real_at(self, _omega: float, _share: float) -> Poles:
        return self.real_poles

    def settled_poles(self, poles: Poles, lost: Bool[np.ndarray, " pole"]) -> Poles | None:
        """Replace lost poles by eigenvalues nearby; None if two are one, or one is far away.

        Newton's method loses some to rounding errors, of which eigenvalues have less.
        """
        value = poles[0].copy()
        motion = poles[1].copy()
        for n in np.flatnonzero(lost):
            start = complex(value[n])
            found = settle(self.poles_at if start.imag else self._real_at, start, motion[n])
            if not found or abs(found[0][0] - start) > NEARBY * abs(start):
                return None
            value[n], motion[n] = found[0]
        blocks = [self.block]
        every = Roots.starts(blocks, value, np.zeros(len(value), dtype=int), motion)
        return None if repeated(every).any() else (value, motion)

    def counted_poles(self) -> Poles:
        """Poles and shapes: those that oscillate by counting, and real ones if dampers act."""
        value, motion = self.real_poles if self.is_damped else self.none
        found, shapes = find_oscillations(self.poles_at)
        value = np.append(value, found)
        motion = np.concatenate([motion, shapes])
        blocks = [self.block]
        start = Roots.starts(blocks, value, np.zeros(len(value), dtype=int), motion)
        refined = find_all(self.block.pencil, blocks, start, NOISE)
        near = np.abs(refined.value - value) <= AGREES * np.abs(value)
        good = ~refined.lost & near
        return (
            np.where(good, refined.value, value),
            np.where(good[:, None], refined.motions(blocks, self.model.size), motion),
        )

    def poles_at(self, omega: float, share: float) -> Poles:
        """Poles with Im s > 0, and shapes, with the stiffness at a frequency (rad/s).

        Of its losses a share acts.
        """
        rows, stiffness, resisted = self.massless
        basis = np.concatenate([self.shapes, rows])
        m = len(self.squared)
        soft, k = change_of_stiffness(self.block, omega, share)
        stretch = basis @ self.model.elongation.T
        matrix = basis @ soft @ basis.T + (stretch * k) @ stretch.T
        matrix[np.arange(m), np.arange(m)] += self.squared
        matrix[m:, m:] += stiffness
        # directions that no damper resists follow
        left = np.arange(m + resisted)
        follows = np.arange(m + resisted, len(matrix))
        follow = -np.linalg.solve(matrix[np.ix_(follows, follows)], matrix[np.ix_(follows, left)])
        reduced = matrix[np.ix_(left, left)] + matrix[np.ix_(left, follows)] @ follow
        c = (basis @ self.damping @ basis.T)[np.ix_(left, left)]
        value, vectors = _eigenvalues(reduced, c, np.sqrt(np.abs(self.squared)))
        some = np.imag(value) > 0
        shapes = np.concatenate([vectors, follow @ vectors])[:, some]
        return value[some], shapes.T @ basis


def has_steep_tables(
    block: Block,
    squared: Float[np.ndarray, " mode"],
    shapes: Float[np.ndarray, "mode coordinate"],
) -> bool:
    """Whether tables of stiffness may give an oscillation several frequencies, or none.

    That of a mode follows from the stiffness at its frequency. There is one as long as no stiffness
    changes by much within the factor e of the frequency: not by more than `STEEP` of the static
    stiffness K in any motion, x^T (dK / d ln omega) x <= STEEP x^T K x. The undamped modes of the
    block are given by omega^2 and shape.
    """
    moves = squared > 0
    omega = np.sqrt(squared[moves])
    steep = 0.0
    for n, term in block.terms:
        if not isinstance(term, StiffnessTable):
            continue
        slope = np.abs(np.diff(term.storage(TABLES)) / np.diff(np.log(TABLES))).max()
        motion = shapes[:, term.columns]
        changed = slope * motion @ block.pencil.structure.weights[n].sum(0) @ motion.T
        if changed[~moves].any():
            return True
        relative = changed[np.ix_(moves, moves)] / (omega[:, None] * omega)
        steep += float(np.linalg.norm(relative, 2))
    return steep > STEEP


def change_of_stiffness(
    block: Block, omega: float, share: float
) -> tuple[Complex[np.ndarray, "coordinate coordinate"], Complex[np.ndarray, " wire"]]:
    """Change from static soft stiffness and k to those at a frequency (rad/s).

    That is by the terms of a block that are no dampers, with a share of the losses.
    """
    model = block.pencil.model
    soft = 1j * np.imag(model.soft) + np.zeros(model.mass.shape)
    k = 1j * np.imag(model.k) + np.zeros(len(model.k))
    for n, term in block.terms:
        if term.is_viscous:
            continue
        here = term.at(np.array([omega]))
        own = np.ix_(term.columns, term.columns)
        functions = here.functions(np.arange(len(term.compact)))
        weights = block.pencil.structure.weights[n]
        for function, matrix in zip(functions, weights, strict=True):
            soft[own] += complex(function[0]) * matrix
        if isinstance(here, EvaluatedWires):
            static = np.real(model.k[here.term.number])
            k[here.term.number] = 1 / here.compliance[..., 0] - static
    return np.real(soft) + 1j * share * np.imag(soft), np.real(k) + 1j * share * np.imag(k)


def _eigenvalues(
    stiffness: Inexact[np.ndarray, "state state"],
    damping: Float[np.ndarray, "state state"],
    omega: Float[np.ndarray, " mode"],
) -> tuple[Complex[np.ndarray, " pole"], Complex[np.ndarray, "state pole"]]:
    """Poles and shapes of coordinates q of unit mass, whose speeds are v, and of massless ones e.

    Dampers resist all the e (Tisseur and Meerbergen, SIAM Review 43, 235 (2001)):

        (w q)' = w v,    v' = -K_vv q - K_ve e - C_vv v - C_ve e',
        0 = K_ev q + K_ee e + C_ev v + C_ee e',

    with w = `omega` of the modes, so that rigid ones, of w = 0, have one state, v.
    """
    m = len(omega)
    moving = np.flatnonzero(omega)
    rows = omega[moving, None] * np.eye(m)[moving]
    e = len(stiffness) - m
    per_state = stiffness[:, moving] / omega[moving]
    held = np.concatenate([per_state[m:], damping[m:, :m], stiffness[m:, m:]], axis=1)
    follow = -np.linalg.solve(damping[m:, m:], held)  # e'
    moved = np.concatenate([per_state[:m], damping[:m, :m], stiffness[:m, m:]], axis=1)
    states = np.concatenate(
        [
            np.pad(rows, ((0, 0), (len(moving), e))),
            -moved - damping[:m, m:] @ follow,
            follow,
        ]
    )
    found: Any = np.linalg.eig(states)
    value = found.eigenvalues + 0j
    vectors = found.eigenvectors[len(moving) :] + 0j
    still = value == 0
    vectors[:m] /= np.where(still, 1.0, value)  # v = s q
    return value, vectors


def _mark_counterparts(value: Complex[np.ndarray, " pole"], most: int) -> Bool[np.ndarray, " pole"]:
    """Mark at most so many real poles that are decaying counterparts of growing ones.

    Poles that grow because of negative damping have none.
    """
    out = np.zeros(len(value), dtype=bool)
    real = np.imag(value) == 0
    for growing in np.flatnonzero(real & (np.real(value) > 0))[:most]:
        decaying = np.flatnonzero(real & (np.real(value) < 0) & ~out)
        if len(decaying):
            out[decaying[np.abs(value[decaying] + value[growing]).argmin()]] = True
    return out
