"""Roots s of a pencil, Z(s) x = 0: their number, and each by Newton's method at its own shift.

>>> from suspension_cli.design import reader
>>> from suspension_cli.models import registry
>>> model = registry.VIOLIN.system(reader.parse(reader.template("single", "single")))
>>> mode_frequencies(model, highest=10.0, lowest=0.1).round(3)  # rad/s
array([5.941, 5.944, 9.827])

A step of inverse iteration from a shape x at s solves Z(s) y = Z'(s) x, and the stationary value of
y^T Z y gives the next s (Rayleigh quotient iteration for matrices that depend on s; Lancaster,
Lambda-matrices and Vibrating Systems, 1966, chapter 6),

    s' = s - y^T Z(s) y / (y^T Z'(s) y) = s - y^T Z'(s) x / (y^T Z'(s) y),

which converges with the third order, as Z = Z^T: for all roots at once, with the tensions of wires
among the unknowns. Roots closer to one another than losses move them start together: for several x
at one shift, s' are eigenvalues of the same quotient of small matrices, and their eigenvectors
combine the y.

The output v = H (sensed . x + reads . v) of a filter of a control loop, with H = N / D, is one more
unknown of its block, with the equation N (sensed . x + reads . v) - D v = 0, so that poles of H are
as harmless as its delay, exp(-s T) in N. These equations are not symmetric, and convergence is of
second order.

With massive wires the determinant of Z(omega) has poles, so a search for its zeros may miss some.
The number of modes below omega, however, is J(omega) = J_0(omega) + s(Z(omega)), with J_0 the
number of resonances below omega of all wires clamped at both ends and s the number of negative
eigenvalues of Z (Wittrick and Williams, Q. J. Mech. Appl. Math. 24, 263, 1971). Bisection of this
integer finds each mode, near-degenerate pairs and modes that move no body included.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.design.foton import Filter, warp
from suspension_cli.elimination import dense, solve_each
from suspension_cli.linear.pencil import Block, Loss, Pencil, Piece
from suspension_cli.linear.solver import Solvable, Solver
from suspension_cli.linear.wire_term import WireTerm

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Inexact, Int

    Functions = Inexact[np.ndarray, "function frequency"]

BESIDE = 1e-6
"""Relative step for the derivative of functions of frequency."""
STEPS = 40
"""Most steps for one root (usually 3)."""
ASIDE = 1e-8
"""Relative distance of shifts from roots in the first steps: at a root rounding errors mix the
shapes of a degenerate pair."""
FIRST = 3
"""Number of these steps."""
CONVERGED = 1e-13
"""Relative step at which an iteration ends."""
NOISE = 1e-9
"""Relative step below which an iteration that no longer improves has ended."""
ROUGH = 1e-6
"""Largest relative step that may be a rounding error: that of soft modes beside modes of 1e5 times
their frequency."""
STRAYED = 0.5
"""Relative distance from its start beyond which a root counts as another one."""
SAME = 1e-6
"""Relative distance of two roots, and of their shapes, up to which they are one."""
TOGETHER = 2
"""Number of steps of roots that start together."""
CLOSE = 2e-3
"""Relative distance up to which roots start together."""
WIDE = 1.5
"""Largest ratio of roots that start together."""
ALIKE = 1e-11
"""Relative distance up to which roots found together keep the shapes that they start with."""
LITTLE = 1e-6
"""Fraction of the largest motion that filters without a motion are taken to read at the start."""
GRID = 256
"""Frequencies of the initial count, and those counted at once."""
CIRCLE = 32
"""Points of a circle around which roots are counted."""
BALANCED = 3
"""Times that rows and columns are divided by the roots of their largest elements."""

Progress = Callable[[int, int, float], None]
"""Called with (steps done, total steps, steps per second)."""


def silent(_done: int, _all: int, _rate: float) -> None:
    """Report no progress."""


@dataclass(frozen=True)
class Roots:
    """Roots with their shapes; those of one set all oscillate, or are all real.

    Attributes
    ----------
    value
        s, rad/s, with Im s >= 0.
    block
        Number of the block of each.
    motion
        Coordinates, then tensions, of that block; rows beyond are 0. Starts may lack tensions.
    lost
        Whether no root was found near the start value, which is given instead.
    """

    value: Complex[np.ndarray, " root"]
    block: Int[np.ndarray, " root"]
    motion: Complex[np.ndarray, "unknown root"]
    lost: Bool[np.ndarray, " root"]

    @staticmethod
    def starts(
        blocks: Sequence[Block],
        value: Complex[np.ndarray, " root"],
        block: Int[np.ndarray, " root"],
        motion: Inexact[np.ndarray, "root coordinate"],
    ) -> Roots:
        """Start values, with motions in the coordinates of the system."""
        own = np.zeros((max(len(one.owner) for one in blocks), len(value)), dtype=complex)
        for n, number in enumerate(block.tolist()):
            keep = blocks[number].keep
            own[: len(keep), n] = motion[n, keep]
        return Roots(value + 0j, block, own, np.zeros(len(value), dtype=bool))

    def motions(self, blocks: Sequence[Block], size: int) -> Complex[np.ndarray, "root coordinate"]:
        """Motions of all coordinates of the system."""
        result = np.zeros((len(self.value), size), dtype=complex)
        for row, number, column in zip(result, self.block.tolist(), self.motion.T, strict=True):
            keep = blocks[number].keep
            row[keep] = column[: len(keep)]
        return result

    def select(self, some: Bool[np.ndarray, " root"] | Int[np.ndarray, " some"]) -> Roots:
        """Select some of them, or put them in another order."""
        return Roots(self.value[some], self.block[some], self.motion[:, some], self.lost[some])

    def followed_by(self, other: Roots) -> Roots:
        """Append roots of the same blocks."""
        pairs = ((getattr(self, name), getattr(other, name)) for name in vars(self))
        return Roots(*(np.concatenate(pair, axis=-1) for pair in pairs))


@dataclass(frozen=True)
class Feedback:
    """One filter of control loops: v = H(s) (`sensed` . x + `reads` . v).

    H is the `filter`, later by `delay` (s). `reads` are weights of the outputs of all filters of
    the block; forces -v act on the coordinates `pushed`.
    """

    sensed: Float[np.ndarray, " coordinate"]
    reads: Float[np.ndarray, " filter"]
    pushed: Float[np.ndarray, " coordinate"]
    filter: Filter
    delay: float

    def at(
        self, s: Complex[np.ndarray, " frequency"]
    ) -> tuple[Complex[np.ndarray, "3 frequency"], Complex[np.ndarray, "3 frequency"]]:
        """Evaluate 1, N and D, and their derivatives."""
        values = self._functions(s)
        return values, (self._functions(s * (1 + BESIDE)) - values) / (BESIDE * s)

    def _functions(
        self, s: Complex[np.ndarray, " frequency"]
    ) -> Complex[np.ndarray, "3 frequency"]:
        with np.errstate(all="ignore"):  # far to the left a delay overflows, and the root is lost
            late = np.exp(-s * self.delay)
        numerator = np.prod([part.gain for part in self.filter.parts]) * late
        denominator = np.ones(len(s), dtype=complex)
        for part in self.filter.parts:
            at = warp(s, part.rate)[0] / (2 * np.pi)
            for root in part.zeros:
                numerator *= at + root
            for root in part.poles:
                denominator *= (at + root) / (abs(root) or 1.0)
                numerator /= abs(root) or 1.0
        return np.array([np.ones(len(s)), numerator, denominator])


@dataclass(frozen=True)
class ClosedBlock(Block):
    """A block with the outputs of filters of control loops as unknowns after the tensions."""

    loops: tuple[Feedback, ...]

    @cached_property
    def owner(self) -> list[int]:
        """Number of the body of each unknown; the loops go with the support."""
        return [*Block(self.pencil, self.keep, self.pull).owner, *(0 for _ in self.loops)]

    @cached_property
    def pieces(self) -> list[Piece]:
        """Pieces of the elements of a `Block`, then those of the functions of each `Feedback`."""
        keep = self.keep
        plain = Block(self.pencil, self.keep, self.pull)
        result = list(plain.pieces)
        first = plain.elements.weights.shape[1]
        outputs = len(self.owner) - len(self.loops)
        for n, loop in enumerate(self.loops, outputs):
            force = np.array([n])
            read = np.flatnonzero(loop.reads)
            pushed = np.flatnonzero(loop.pushed[keep])
            sensed = np.flatnonzero(loop.sensed[keep])
            forces = loop.pushed[keep[pushed], None]
            readings = loop.sensed[keep[sensed], None]
            result.append((pushed, np.full_like(pushed, 6 + n), first, forces))
            result.append((np.full_like(sensed, n), 6 + sensed, first + 1, readings))
            weights = loop.reads[read, None]
            result.append((np.full_like(read, n), 6 + outputs + read, first + 1, weights))
            result.append((force, 6 + force, first + 2, -np.ones((1, 1))))
            first += 3
        return result


def solve_filters(
    block: ClosedBlock,
    s: Complex[np.ndarray, " root"],
    motion: Complex[np.ndarray, "root coordinate"],
) -> Complex[np.ndarray, "filter root"]:
    """Solve for the outputs of all filters of a block in motions at frequencies s (rad/s).

    Filters that read no motion of the block get a little, so that those whose pole is at s move.
    """
    if not len(block.loops):
        return np.zeros((0, len(s)), dtype=complex)
    forms = np.array([loop.sensed for loop in block.loops])
    sensed = forms @ motion.T
    sensed[~forms[:, block.keep].any(1)] = LITTLE * np.abs(motion).max(1)
    gains = np.array([over / under for _, over, under in (loop.at(s)[0] for loop in block.loops)])
    reads = np.array([loop.reads for loop in block.loops])
    if not reads.any():
        return gains * sensed
    matrix = np.eye(len(gains)) - gains.T[:, :, None] * reads
    return np.linalg.solve(matrix, (gains * sensed).T[:, :, None])[:, :, 0].T


def find_roots(
    pencil: Pencil,
    blocks: Sequence[Block],
    start: Roots,
    width: Float[np.ndarray, " root"] | float = 0.0,
    loss: Loss = "all",
    close: float = CLOSE,
    known: int = 0,
    noise: float = ROUGH,
    together: int = TOGETHER,
) -> Roots:
    """Find the roots near start values, which all oscillate, or are all real.

    Those closer than `close`, or than their `width`, by how much losses may move each (rad/s),
    take their first `together` steps together. In the first `known` steps values stay, if shapes
    are unknown. Those with relative rounding errors above `noise` are lost.
    """
    if not len(start.value):
        return start
    found = start
    width = np.broadcast_to(width, start.value.shape)
    if (np.imag(start.value) > 0).all():
        groups = [g for g in group_roots(start, close, width) if known or len(g) > 1]
        found = _iterate(pencil, blocks, start, groups, known + together, loss, known)
    each = list(np.arange(len(start.value))[:, None])
    found = _iterate(pencil, blocks, found, each, STEPS, loss, noise=noise)
    far = np.abs(found.value - start.value) > STRAYED * np.abs(start.value)
    lost = found.lost | far | ~np.isfinite(found.motion).all(0)
    value = np.where(lost, start.value, found.value)
    motion = np.where(lost, start.motion, found.motion)
    return Roots(value, start.block, motion, lost)


def find_all(pencil: Pencil, blocks: Sequence[Block], start: Roots, noise: float = ROUGH) -> Roots:
    """Find the roots near start values: those that oscillate with all losses, others with dampers.

    Those that are found twice, and those with relative rounding errors above `noise`, are lost.
    """
    value = start.value.copy()
    motion = start.motion.copy()
    lost = start.lost.copy()
    for oscillates in (True, False):
        some = (np.imag(start.value) > 0) == oscillates
        acting: Loss = "all" if oscillates else "dampers"
        found = find_roots(pencil, blocks, start.select(some), loss=acting, noise=noise)
        value[some] = found.value
        motion[:, some] = found.motion
        lost[some] = found.lost | repeated(found)
    return Roots(value, start.block, motion, lost)


def repeated(found: Roots) -> Bool[np.ndarray, " root"]:
    """Mark roots that are found a second time, with the same shape."""
    shapes = found.motion / np.sqrt((np.abs(found.motion) ** 2).sum(0))
    alike = np.abs(shapes.conj().T @ shapes) > 1 - SAME
    alike &= found.block[:, None] == found.block
    alike &= np.isclose(found.value[:, None], found.value, rtol=SAME, atol=0.0)
    return np.tril(alike, -1).any(1)


def find_shapes(pencil: Pencil, blocks: Sequence[Block], start: Roots) -> Roots:
    """Find the shapes of roots whose values are known, by inverse iteration from start shapes."""
    each = list(np.arange(len(start.value))[:, None])
    return _iterate(pencil, blocks, start, each, FIRST, "all", FIRST)


def mark_known(
    pencil: Pencil, blocks: Sequence[Block], found: Roots, known: Complex[np.ndarray, " known"]
) -> Bool[np.ndarray, " root"]:
    """Mark roots of the first block that are among known ones, of which only the values are given.

    Inverse iteration at the values of known roots near a found one, from as many random shapes,
    spans their shapes; of a degenerate root, it spans as many dimensions as are known.
    """
    near = np.isclose(found.value[:, None], known, rtol=SAME, atol=0.0)
    value = known[near.any(0)]
    result = np.zeros(len(found.value), dtype=bool)
    if not len(value):
        return result
    member = np.zeros(len(value), dtype=int)
    random = np.random.default_rng(1).normal(size=(len(value), pencil.model.size))
    shapes = find_shapes(pencil, blocks, Roots.starts(blocks, value, member, random)).motion
    near = near[:, near.any(0)]
    motion = found.motion / np.sqrt((np.abs(found.motion) ** 2).sum(0))
    new = np.zeros(len(found.value), dtype=bool)
    for n in np.flatnonzero(near.any(1)):
        beside = new & np.isclose(found.value, found.value[n], rtol=SAME, atol=0.0)
        shape = np.concatenate([shapes[:, near[n]], motion[:, beside]], axis=1)
        span = np.linalg.qr(shape / np.abs(shape).max(0))[0]
        result[n] = (np.abs(span.conj().T @ motion[:, n]) ** 2).sum() > 1 - SAME
        new[n] = not result[n]
    return result


def group_roots(
    start: Roots, close: float, width: Float[np.ndarray, " root"]
) -> list[Int[np.ndarray, " _"]]:
    """Group roots of one block that are close together."""
    result: list[list[int]] = []
    size = np.abs(start.value)
    for n in np.lexsort([size, start.block]).tolist():
        last = result[-1][-1] if result else n
        near = close * size[n] + 2 * (width[n] + width[last])
        if (
            last != n
            and start.block[n] == start.block[last]
            and abs(start.value[n] - start.value[last]) <= near
            and size[n] <= WIDE * size[result[-1][0]]
        ):
            result[-1].append(n)
        else:
            result.append([n])
    return [np.array(group) for group in result]


def _iterate(
    pencil: Pencil,
    blocks: Sequence[Block],
    roots: Roots,
    groups: list[Int[np.ndarray, " _"]],
    steps: int,
    loss: Loss,
    known: int = 0,
    noise: float = ROUGH,
) -> Roots:
    """Iterate groups of roots of one block, each at one shift, until they converge."""
    value = roots.value.copy()
    motion = roots.motion.copy()
    lost = roots.lost.copy()
    real = bool((np.imag(value) == 0).all())
    moving = groups
    last = np.full(len(groups), np.inf)
    for step in range(steps):
        if not moving:
            break
        old = value.copy()
        shift = _choose_shifts(value, moving, aside=step < FIRST)
        current = replace(roots, value=value, motion=motion)
        _advance(pencil, blocks, current, moving, shift, loss, keeps_values=step < known)
        if real:
            value = np.real(value) + 0j
        gone = ~np.isfinite(value) | ((np.imag(value) <= 0) & (not real))
        value = np.where(gone, old, value)
        lost = lost | gone
        moved = np.array([np.abs((value - old)[group]).max() for group in moving]) / np.abs(shift)
        done, rough = _have_ended(moved, last)
        lost = _mark(lost, [moving[n] for n in np.flatnonzero(rough & (moved > noise))])
        done |= np.array([lost[group].any() for group in moving])
        left = np.flatnonzero(~done) if step >= known else np.arange(len(moving))
        moving = [moving[n] for n in left]
        last = moved[left]
    if steps == STEPS:
        lost = _mark(lost, moving)
    return replace(roots, value=value, motion=motion, lost=lost)


def _choose_shifts(
    value: Complex[np.ndarray, " root"], groups: list[Int[np.ndarray, " _"]], *, aside: bool
) -> Complex[np.ndarray, " group"]:
    """Choose the shift of each group of roots: beside their mean, further if `aside`."""
    mean = np.array([value[group].mean() for group in groups])
    spread = [np.abs(value[group] - own).max() for group, own in zip(groups, mean, strict=True)]
    further = ASIDE * np.abs(mean) if aside else 0.0
    return mean + (np.array(spread) / 3 + further)


def _have_ended(
    moved: Float[np.ndarray, " group"], last: Float[np.ndarray, " group"]
) -> tuple[Bool[np.ndarray, " group"], Bool[np.ndarray, " group"]]:
    """Which iterations have ended, from their last two relative steps; of these, which are rough.

    The steps of rough ones are nothing but rounding errors. The first step has none before it.
    """
    # steps shrink by a steady factor, or faster: the next one would be moved^2 / last
    ratio = np.where(np.isfinite(last), moved / np.maximum(last, 1e-300), 1.0)
    done = moved * np.minimum(ratio, 1.0) <= CONVERGED
    done |= (moved <= NOISE) & (2 * moved >= last)
    rough = ~done & (moved <= ROUGH) & (moved >= last)
    return done | rough, rough


def _advance(
    pencil: Pencil,
    blocks: Sequence[Block],
    roots: Roots,
    groups: list[Int[np.ndarray, " _"]],
    shift: Complex[np.ndarray, " group"],
    loss: Loss,
    *,
    keeps_values: bool,
) -> None:
    """Take one step of groups of roots, each at its shift, in place; or of their shapes alone."""
    both = np.concatenate([shift, shift * (1 + BESIDE)])
    there = pencil.at_poles(both, loss, np.tile(np.imag(shift), 2))
    member = np.array([roots.block[group[0]] for group in groups])
    for number in np.unique(member).tolist():
        here = np.flatnonzero(member == number)
        block = blocks[number]
        own = [groups[n] for n in here]
        s = shift[here]
        values = block.at(there).functions
        functions, slopes = _with_slopes(
            block, s, values[:, here], values[:, len(shift) + here], loss
        )
        size = len(block.owner)
        x = np.zeros((size, max(map(len, own)), len(own)), dtype=complex)
        for n, group in enumerate(own):
            x[:, : len(group), n] = roots.motion[:size, group]
        quotients, y = _step(block, functions, slopes, x)
        for n, group in enumerate(own):
            k = len(group)
            shapes = y[:, :k, n]
            if keeps_values:
                roots.motion[:size, group] = shapes
                continue
            quotient = quotients[n, :k, :k]
            # else s is a root to the last bit, or those of a group have one shape: each goes alone
            if np.isfinite(shapes).all() and (k == 1 or np.isfinite(quotient).all()):
                alike = ALIKE * float(np.abs(s[n]))
                change, turn = _diagonalise(quotient, alike)
                roots.value[group] = s[n] - change
                roots.motion[:size, group] = shapes @ turn


def _with_slopes(
    block: Block,
    s: Complex[np.ndarray, " frequency"],
    functions: Functions,
    beside: Functions,
    loss: Loss,
) -> tuple[Functions, Functions]:
    """Complete functions of a block at s, known also at s (1 + BESIDE), and their derivatives."""
    slopes = (beside - functions) / (BESIDE * s)
    slopes[:2] = 0.0
    slopes[2] = float(loss != "none")
    slopes[3] = 2 * s
    if isinstance(block, ClosedBlock):
        of_loops = [loop.at(s) for loop in block.loops]
        functions = np.concatenate([functions, *(one for one, _ in of_loops)])
        slopes = np.concatenate([slopes, *(slope for _, slope in of_loops)])
    return functions, slopes


def sums_within(
    pencil: Pencil, block: Block, centre: complex, radius: float, loss: Loss
) -> Complex[np.ndarray, " sum"]:
    """Count the roots of a block in a circle (rad/s), and sum (s - centre) and its square.

    By the argument principle, the sum of g(s) over all roots is the integral of g tr(Z^-1 Z') along
    the circle over 2 pi i; the trapezoidal rule converges geometrically (Delves and Lyness, Math.
    Comp. 21, 543, 1967). A count that is no whole number says that a root is near the circle. Sums
    are known where the roots themselves are not: two that coincide and have one shape move by the
    square root of a rounding error.
    """
    offset = radius * np.exp(2j * np.pi * np.arange(CIRCLE) / CIRCLE)
    s = centre + offset
    oscillating = np.full(2 * CIRCLE, centre.imag)
    there = pencil.at_poles(np.append(s, s * (1 + BESIDE)), loss, oscillating)
    values = block.at(there).functions
    functions, slopes = _with_slopes(block, s, values[:, :CIRCLE], values[:, CIRCLE:], loss)
    matrix, slope = (block.matrix(one)[:, 6:] for one in (functions, slopes))
    trace = np.einsum("iif->f", dense(matrix, slope))
    return np.array([np.mean(trace * offset**power) for power in (1, 2, 3)])


def _mark(
    lost: Bool[np.ndarray, " root"], groups: list[Int[np.ndarray, " _"]]
) -> Bool[np.ndarray, " root"]:
    """Mark groups of roots as lost too."""
    result = lost.copy()
    for group in groups:
        result[group] = True
    return result


def _step(
    block: Block,
    functions: Functions,
    slopes: Functions,
    x: Complex[np.ndarray, "unknown vector frequency"],
) -> tuple[
    Complex[np.ndarray, "frequency vector vector"],
    Complex[np.ndarray, "unknown vector frequency"],
]:
    """Compute y, and matrices whose eigenvalues are s - s'; columns of 0 do not take part.

    They are not finite at a root to the last bit.
    """
    right = block.elements.multiply(slopes, x)
    with np.errstate(all="ignore"):
        if isinstance(block, ClosedBlock):  # these equations are not symmetric
            y = dense(block.matrix(functions)[:, 6:], right)
        else:
            values = block.absolute.in_pattern(functions)
            y = block.absolute.pattern.solve_nearly_singular(values, right)
        size = np.abs(y).max(0)
        size[size == 0] = 1.0
        y = y / size
        right = right / size
        first = np.einsum("ukf,uvf->fkv", y, right)
        second = np.einsum("ukf,uvf->fkv", y, block.elements.multiply(slopes, y))
        second += np.eye(len(size)) * ~y.any(0).T[:, None]
        return solve_each(second, first), y


def _diagonalise(
    matrix: Complex[np.ndarray, "vector vector"], alike: float
) -> tuple[Inexact[np.ndarray, " vector"], Inexact[np.ndarray, "vector vector"]]:
    """Eigenvalues and vectors; of those `alike`, vectors that are close to unit vectors."""
    if len(matrix) == 1:
        return matrix[0], np.eye(1)
    found: Any = np.linalg.eig(matrix)
    value, vectors = found
    left = np.arange(len(value))
    while len(left):
        near = np.abs(value[left] - value[left[0]]) <= alike
        same = left[near]
        left = left[~near]
        if len(same) > 1:
            lead = np.sort(np.argsort(-np.abs(vectors[:, same]).max(1), kind="stable")[: len(same)])
            vectors[:, same] = vectors[:, same] @ np.linalg.pinv(vectors[lead][:, same])
    return value, vectors


def modes_below(
    system: Solvable,
    omega: Float[np.ndarray, " frequency"],
    step: Callable[[int], None] = lambda _: None,
) -> Int[np.ndarray, " frequency"]:
    """Count the modes below frequencies in rad/s, above 0.

    `step` is called with the number of frequencies done since the last call.
    """
    solver = Solver.of(system)
    total = np.zeros(len(omega), dtype=int)
    for term in solver.system.terms:
        if isinstance(term, WireTerm):
            total += len(term.forms["twist"]) * term.strand.resonances_below(omega)
    for start in range(0, len(omega), GRID):
        span = slice(start, start + GRID)
        there = solver.pencil.at(omega[span], lossy=False)
        for block in solver.blocks:
            matrix = np.moveaxis(block.at(there).matrix[:, 6:], -1, 0)
            tensions = len(block.keep)
            # scaling does not change the signs of eigenvalues (Sylvester)
            for _ in range(BALANCED):
                size = np.abs(matrix).max(-1)
                scale = 1 / np.sqrt(np.where(size > 0, size, 1.0))
                matrix = matrix * scale[:, :, None] * scale[:, None, :]
            total[span] += (np.linalg.eigvalsh(matrix) < 0).sum(-1)
            total[span] -= (np.diagonal(matrix, axis1=1, axis2=2)[:, tensions:] < 0).sum(-1)
        step(len(omega[span]))
    return total


def mode_frequencies(
    system: Solvable, highest: float, lowest: float, progress: Progress = silent
) -> Float[np.ndarray, " mode"]:
    """Find all modes between two frequencies > 0 by bisection to the last bit, in rad/s.

    Ascending; a degenerate frequency is repeated. For a system with massive wires (violin model).
    """
    solver = Solver.of(system)
    grid = np.geomspace(lowest, highest, GRID)
    counts = np.maximum.accumulate(modes_below(solver, grid))
    number = np.arange(counts[0] + 1, counts[-1] + 1)
    upper = np.searchsorted(counts, number)
    low = grid[upper - 1]
    high = grid[upper]
    halvings = np.ceil(np.log2(np.maximum((high - low) / np.spacing(high), 1.0))) + 1
    started = time.monotonic()
    done = 0.0
    expected = int(halvings.sum())
    repeats = 1.0

    def step(number: int) -> None:
        nonlocal done
        done = min(done + number * repeats, expected)
        progress(int(done), expected, done / max(time.monotonic() - started, 1e-9))

    while True:
        middle = (low + high) / 2
        unresolved = (middle > low) & (middle < high)
        if not unresolved.any():
            return high
        unique, where = np.unique(middle[unresolved], return_inverse=True)
        repeats = len(where) / len(unique)
        is_reached = modes_below(solver, unique, step)[where] >= number[unresolved]
        high[unresolved] = np.where(is_reached, middle[unresolved], high[unresolved])
        low[unresolved] = np.where(is_reached, low[unresolved], middle[unresolved])
