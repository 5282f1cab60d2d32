"""Elimination of many small symmetric systems at once, body by body.

>>> stiffness = np.array([[2.0, -1.0], [-1.0, 1.0]])  # two springs of 1 N/m in a row
>>> pattern = by_body(np.array([1, 2]), stiffness != 0)
>>> elements = stiffness[pattern.row, pattern.column][:, None]  # of one system
>>> pattern.solve(elements, np.array([[[0.0]], [[1.0]]]))[:, 0, 0]  # 1 N pulls at the end
array([1., 2.])

In a chain or tree each body couples only to the one that it hangs from. Elimination from the leaves
up, D = L diag(d) L^T, then needs few elements; other couplings fill in. All P systems are
eliminated at once, with the system axis last. The transmission from support to mirror becomes a
product of those of the stages, so it keeps its relative accuracy however small it is (factors of a
graded matrix; Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., chapter 10). Where a
part resonates alone its pivots are nearly singular, and the body above loses digits. A correction
from the residual restores these (ibid., chapter 12), more of them where the first is not small. A
residual that remains shows that the system needs pivoting.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Inexact, Int


Positions: TypeAlias = "slice | Int[np.ndarray, ' _']"

ROUNDING = 4e-15
"""Fraction of its terms up to which a sum is a rounding error."""
SMALL = 1e-6
"""Relative correction of a coordinate up to which its square, which is left, is negligible."""
MORE = 2
"""Corrections after the first where that is not small."""
BACKWARD = 1e-14
"""Residual, over the sum of the magnitudes of its terms, up to which it is a rounding error; a
system with more is solved with pivoting."""
TOGETHER = 16
"""Functions of frequency that are evaluated together: a term has about as many."""
FEW = 128
"""Systems up to which a step of elimination changes all its elements at once, not row by row."""


@dataclass(frozen=True)
class Pattern:
    """Elements on and above the diagonal of symmetric systems, in their order of elimination.

    `order` has the coordinates in which they are eliminated, called steps; `later` the later steps
    that each is coupled to then, ascending.
    """

    order: Int[np.ndarray, " coordinate"]
    later: tuple[Int[np.ndarray, " _"], ...]

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return len(self.order)

    @cached_property
    def start(self) -> list[int]:
        """Number of each step's first element, on the diagonal; last, the number of elements."""
        return [0, *np.cumsum([1 + len(steps) for steps in self.later]).tolist()]

    @cached_property
    def row(self) -> Int[np.ndarray, " element"]:
        """Coordinate of the step of each element."""
        return np.repeat(self.order, np.diff(self.start))

    @cached_property
    def column(self) -> Int[np.ndarray, " element"]:
        """Coordinate of the same step, on the diagonal, or of a later one."""
        steps = [step for n, later in enumerate(self.later) for step in (n, *later)]
        return self.order[np.array(steps, dtype=int)]

    @cached_property
    def coupled(self) -> list[Positions]:
        """`later`, as slices where the steps are consecutive."""
        return [as_slice(steps) for steps in self.later]

    @cached_property
    def updated(self) -> list[list[Positions]]:
        """Elements that eliminating a step changes: for each later step, those from it on."""
        return [
            [as_slice(self._number[m, steps[k:]]) for k, m in enumerate(steps)]
            for steps in self.later
        ]

    @cached_property
    def updated_at_once(
        self,
    ) -> list[tuple[Int[np.ndarray, " _"], Int[np.ndarray, " _"], Int[np.ndarray, " _"]]]:
        """Elements that eliminating a step changes, and the two of its row whose product each is.

        The numbers of the two are those among the elements of the row beyond the diagonal.
        """
        result = []
        for steps in self.later:
            first, second = np.triu_indices(len(steps))
            result.append((self._number[steps[first], steps[second]], first, second))
        return result

    @cached_property
    def _number(self) -> Int[np.ndarray, "step step"]:
        """Number of the element of each step and a later one, or the same; -1 if there is none."""
        result = np.full((self.size, self.size), -1)
        for n, steps in enumerate(self.later):
            result[n, n] = self.start[n]
            result[n, steps] = self.start[n] + 1 + np.arange(len(steps))
        return result

    def factor(
        self, elements: Inexact[np.ndarray, "element system"], held: float | None = None
    ) -> Factors:
        """Eliminate systems, in place; singular parts give infinite or NaN solutions.

        Coordinates whose pivot is below the fraction `held` of their diagonal element, so that it
        is a rounding error, are held by that.
        """
        pivots = []
        multipliers = []
        least = np.full(elements.shape[1], np.inf)
        size = np.abs(elements[self.start[:-1]]) if held is not None else elements[:0]
        size[size == 0] = 1.0
        few = elements.shape[1] <= FEW
        for n in range(self.size):
            row = elements[self.start[n] : self.start[n + 1]]
            pivot = row[0]
            if held is not None:
                np.minimum(least, pivot / size[n], out=least)
                pivot = np.where(np.abs(pivot) > held * size[n], pivot, size[n])
            pivots.append(1.0 / pivot)
            multipliers.append(row[1:] * pivots[-1])
            if few:
                changed, first, second = self.updated_at_once[n]
                elements[changed] -= multipliers[-1][first] * row[1 + second]
            else:
                for k, changed in enumerate(self.updated[n]):
                    elements[changed] -= multipliers[-1][k] * row[1 + k :]
        return Factors(self, pivots, multipliers, least)

    def assemble(
        self, elements: Inexact[np.ndarray, "element system"]
    ) -> Inexact[np.ndarray, "coordinate coordinate system"]:
        """Assemble whole matrices."""
        result = np.zeros((self.size, self.size, elements.shape[-1]), dtype=elements.dtype)
        result[self.row, self.column] = result[self.column, self.row] = elements
        return result

    def solve(
        self,
        elements: Inexact[np.ndarray, "element system"],
        rhs: Inexact[np.ndarray, "coordinate input system"],
    ) -> Inexact[np.ndarray, "coordinate input system"]:
        """Solve D x = b with corrections; where these do not suffice, with pivoting."""
        right = rhs[self.order]
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            factors, x, correction = self._first_solution(elements, right)
            large = ~(np.abs(correction) <= SMALL * np.abs(x)).all((0, 1))
            x += correction
            result = np.empty_like(x)
            result[self.order] = x
            again = np.flatnonzero(large)
            if len(again):
                some = as_slice(again)
                exact = self._is_exact(elements[:, some], x[..., some], right[..., some], ROUNDING)
                again = again[~exact]
            if len(again):
                result[..., again] = self._corrected(
                    factors.select(again), elements[:, again], x[..., again], rhs[..., again]
                )
        return result

    def _first_solution(
        self,
        elements: Inexact[np.ndarray, "element system"],
        right: Inexact[np.ndarray, "step input system"],
    ) -> tuple[
        Factors,
        Inexact[np.ndarray, "step input system"],
        Inexact[np.ndarray, "step input system"],
    ]:
        """Factors, solution without pivoting in the order of steps, and its first correction."""
        factors = self.factor(elements.copy())
        x = factors.solve(right.astype(np.result_type(right, elements)))
        return factors, x, factors.solve(self._residual(elements, x, right))

    def _corrected(
        self,
        factors: Factors,
        elements: Inexact[np.ndarray, "element system"],
        x: Inexact[np.ndarray, "step input system"],
        rhs: Inexact[np.ndarray, "coordinate input system"],
    ) -> Inexact[np.ndarray, "coordinate input system"]:
        """Correct solutions, in the order of steps, some more times; or solve with pivoting."""
        right = rhs[self.order]
        for _ in range(MORE):
            x = x + factors.solve(self._residual(elements, x, right))
        result = np.empty_like(x)
        result[self.order] = x
        inexact = ~self._is_exact(elements, x, right)
        if inexact.any():
            result[..., inexact] = self._solve_pivoting(elements[:, inexact], rhs[..., inexact])
        return result

    def solve_nearly_singular(
        self,
        elements: Inexact[np.ndarray, "element system"],
        rhs: Inexact[np.ndarray, "coordinate vector system"],
    ) -> Inexact[np.ndarray, "coordinate vector system"]:
        """Solve D x = b beside roots, where x is mainly the shape of the root.

        Its size is undetermined, so corrections may be large. Not finite at a root to the last bit.
        """
        right = rhs[self.order]
        with np.errstate(all="ignore"):
            _, x, correction = self._first_solution(elements, right)
            x += correction
            result = np.empty_like(x)
            result[self.order] = x
            inexact = ~self._is_exact(elements, x, right)
            if inexact.any():
                matrix = self.assemble(elements[:, inexact])
                result[..., inexact] = dense(matrix, rhs[..., inexact])
        return result

    def _is_exact(
        self,
        elements: Inexact[np.ndarray, "element system"],
        x: Inexact[np.ndarray, "step input system"],
        right: Inexact[np.ndarray, "step input system"],
        limit: float = BACKWARD,
    ) -> Bool[np.ndarray, " system"]:
        """Whether solutions, in the order of steps, are those of equal equations but for rounding.

        Elements that cancel may then still change from one correction to the next: nothing gives
        them more digits.
        """
        residual = np.abs(self._residual(elements, x, right))
        terms = self._residual(-np.abs(elements), np.abs(x), np.abs(right))
        return np.asarray((residual <= limit * terms).all((0, 1)))

    def _solve_pivoting(
        self,
        elements: Inexact[np.ndarray, "element system"],
        rhs: Inexact[np.ndarray, "coordinate input system"],
    ) -> Inexact[np.ndarray, "coordinate input system"]:
        """Solve D x = b by LU with pivoting and one correction."""
        matrix = self.assemble(elements)
        solution = dense(matrix, rhs)
        residual = np.empty_like(solution)
        residual[self.order] = self._residual(elements, solution[self.order], rhs[self.order])
        return solution + dense(matrix, residual)

    def _residual(
        self,
        elements: Inexact[np.ndarray, "element system"],
        x: Inexact[np.ndarray, "coordinate input system"],
        right: Inexact[np.ndarray, "coordinate input system"],
    ) -> Inexact[np.ndarray, "coordinate input system"]:
        """Compute b - D x in doubles, in the order of steps."""
        result = right.astype(np.result_type(x, elements))
        for n, coupled in enumerate(self.coupled):
            row = elements[self.start[n] : self.start[n + 1], None]
            result[n] -= row[0] * x[n]
            result[n] -= (row[1:] * x[coupled]).sum(0)
            result[coupled] -= row[1:] * x[n]
        return result


def as_slice(numbers: Int[np.ndarray, " _"]) -> Positions:
    """Positions as a slice where they are consecutive."""
    if len(numbers) and numbers[-1] - numbers[0] + 1 != len(numbers):
        return numbers
    return slice(numbers[0], numbers[-1] + 1) if len(numbers) else slice(0)


def by_body(
    owner: Int[np.ndarray, " coordinate"], coupled: Bool[np.ndarray, "coordinate coordinate"]
) -> Pattern:
    """Order coordinates for elimination: those of the last body first.

    `owner` is the number of the body of each coordinate, larger than that of its parent; `coupled`
    (c, c) marks the non-zero elements.
    """
    return _by_body(owner.astype(int).tobytes(), coupled.tobytes())


@lru_cache(maxsize=64)
def _by_body(owners: bytes, couplings: bytes) -> Pattern:
    owner = np.frombuffer(owners, dtype=int)
    coupled = np.frombuffer(couplings, dtype=bool).reshape(len(owner), -1)
    order = np.argsort(-owner, kind="stable")
    later = []
    rest = (coupled | coupled.T)[np.ix_(order, order)]
    for n in range(len(order)):
        later.append(n + 1 + np.flatnonzero(rest[n, n + 1 :]))
        rest[np.ix_(later[-1], later[-1])] = True
    return Pattern(order, tuple(later))


@dataclass(frozen=True)
class Factors:
    """Eliminated systems: 1/d of each step, and L of the later steps coupled to each.

    `least` is the least pivot over its diagonal element, of systems in which coordinates may be
    held.
    """

    pattern: Pattern
    pivots: list[Inexact[np.ndarray, " system"]]
    multipliers: list[Inexact[np.ndarray, "_ system"]]
    least: Inexact[np.ndarray, " system"]

    def select(self, some: Bool[np.ndarray, " system"] | Int[np.ndarray, " _"]) -> Factors:
        """Select some of the systems."""
        pivots = [part[some] for part in self.pivots]
        multipliers = [part[:, some] for part in self.multipliers]
        return Factors(self.pattern, pivots, multipliers, self.least[some])

    def solve(
        self, x: Inexact[np.ndarray, "step input system"]
    ) -> Inexact[np.ndarray, "step input system"]:
        """Solve for right-hand sides in the order of steps, in place."""
        driven = np.asarray(x.any((1, 2)))
        coupled = self.pattern.coupled
        for n, multipliers in enumerate(self.multipliers):
            if driven[n] and len(multipliers):
                x[coupled[n]] -= multipliers[:, None] * x[n]
                driven[coupled[n]] = True
        x *= np.array(self.pivots)[:, None]
        for n in range(len(x) - 1, -1, -1):
            if len(self.multipliers[n]):
                x[n] -= (self.multipliers[n][:, None] * x[coupled[n]]).sum(0)
        return x


@dataclass(frozen=True)
class Elements:
    """Elements of the equations of a block, by row; the columns of the support come first.

    Each has weights of functions of frequency; of many builds, its values.
    """

    row: Int[np.ndarray, " element"]
    column: Int[np.ndarray, " element"]
    weights: Inexact[np.ndarray, "element function"]

    @staticmethod
    def of(pieces: list[tuple[Any, Any, int, Any]], functions: int) -> Elements:
        """Sum pieces: rows, columns, the first function that they have weights of, and these."""
        row, column = (np.concatenate([piece[n] for piece in pieces]) for n in (0, 1))
        places, member = np.unique(np.stack([row, column]), axis=1, return_inverse=True)
        kind = np.result_type(*(piece[3] for piece in pieces))
        weights = np.zeros((places.shape[1], functions), dtype=kind)
        apart = len(member) == places.shape[1]  # no element is in two pieces
        start = 0
        for rows, _, first, own in pieces:
            span = slice(first, first + own.shape[1])
            here = member[start : start + len(rows)], span
            weights[here] = own if apart else weights[here] + own
            start += len(rows)
        return Elements(places[0], places[1], weights)

    def select(self, some: Bool[np.ndarray, " element"]) -> Elements:
        """Select some of the elements."""
        return Elements(self.row[some], self.column[some], self.weights[some])

    @cached_property
    def groups(
        self,
    ) -> list[tuple[slice, Int[np.ndarray, " element"], Float[np.ndarray, "element function"]]]:
        """Groups of functions, the elements that they act on, and their weights there."""
        result = []
        for start in range(0, self.weights.shape[1], TOGETHER):
            own = slice(start, start + TOGETHER)
            elements = np.flatnonzero(self.weights[:, own].any(1))
            result.append((own, elements, self.weights[elements, own]))
        return result

    def at(
        self, functions: Inexact[np.ndarray, "function system"]
    ) -> Inexact[np.ndarray, "element system"]:
        """Evaluate the elements."""
        if len(functions) <= TOGETHER:
            return multiply_real(self.weights, functions) if len(functions) else self.weights
        result = np.zeros((len(self.row), functions.shape[1]), dtype=functions.dtype)
        for own, elements, weights in self.groups:
            result[elements] += multiply_real(weights, functions[own])
        return result

    def multiply(
        self,
        functions: Inexact[np.ndarray, "function system"],
        motion: Inexact[np.ndarray, "unknown vector system"],
    ) -> Inexact[np.ndarray, "unknown vector system"]:
        """Multiply motions of the unknowns, the support at rest."""
        own = self.column >= 6
        values = self.at(functions)[own, None]
        result = np.zeros(motion.shape, dtype=complex)
        rows, starts = np.unique(self.row[own], return_index=True)
        result[rows] = np.add.reduceat(values * motion[self.column[own] - 6], starts)
        return result

    def transformed(
        self,
        to_absolute: Float[np.ndarray, "all all"],
        place: Int[np.ndarray, " all"],
        error: Float[np.ndarray, "unknown all"],
    ) -> Elements:
        """Change unknowns: old = `to_absolute` @ new. Rounding errors become 0.

        `error` is a bound of other errors of the new elements of the first function.
        """
        dense = np.zeros((self.weights.shape[1], *error.shape))
        dense[:, self.row, self.column] = self.weights.T
        result = np.zeros_like(dense)
        for start in range(0, len(dense), TOGETHER):
            members = slice(start, start + TOGETHER)
            used = (dense[members] != 0).any(0)
            rows = np.flatnonzero(used.any(1))
            columns = np.flatnonzero(used.any(0))
            if not len(rows):
                continue
            matrix = dense[members][:, rows[:, None], columns]
            left = to_absolute[6 + rows, 6:]
            right = to_absolute[columns]
            terms = np.abs(left).T @ sizes(matrix, place[6 + rows], place[columns]) @ np.abs(right)
            bound = ROUNDING * terms
            if start == 0:
                bound[0] += error
            changed = left.T @ matrix @ right
            result[members] = np.where(np.abs(changed) > bound, changed, 0.0)
        row, column = np.nonzero(result.any(0))
        return Elements(row, column, np.ascontiguousarray(result[:, row, column].T))


@dataclass(frozen=True)
class Equations:
    """Equations of one block in one choice of coordinates q, with x = T q.

    `owner` is the number of the body of each unknown; `to_absolute` T (6 + c, 6 + c) with the
    support's coordinates, None if q = x.
    """

    elements: Elements
    owner: list[int]
    to_absolute: Float[np.ndarray, "coordinate coordinate"] | None = None

    @cached_property
    def pattern(self) -> Pattern:
        """Order of elimination, and the elements that it needs."""
        coupled = np.eye(len(self.owner), 6 + len(self.owner), 6, dtype=bool)
        coupled[self.elements.row, self.elements.column] = True
        return by_body(np.array(self.owner, dtype=int), coupled[:, 6:])

    @cached_property
    def _in_pattern(self) -> tuple[Int[np.ndarray, " element"], Elements]:
        """Numbers in the pattern of the elements that it has, and these; not mirrored ones."""
        number = np.full((len(self.owner), 6 + len(self.owner)), -1)
        number[self.pattern.row, 6 + self.pattern.column] = np.arange(len(self.pattern.row))
        place = number[self.elements.row, self.elements.column]
        return place[place >= 0], self.elements.select(place >= 0)

    @cached_property
    def _pull(self) -> Elements:
        """Elements in the columns of the support."""
        return self.elements.select(self.elements.column < 6)

    def solve(
        self,
        functions: Inexact[np.ndarray, "function system"],
        moves: Float[np.ndarray, "6 input #system"],
        forces: Float[np.ndarray, "own input #system"],
    ) -> Inexact[np.ndarray, "own input system"]:
        """Solve for coordinates q, given support motions and forces on x."""
        values = self.in_pattern(functions)
        own, inputs = forces.shape[:2]
        shape = self.pattern.size, inputs, values.shape[1]
        right = np.zeros(shape, dtype=values.dtype)
        if self.to_absolute is not None:
            forces = np.tensordot(self.to_absolute[6 : 6 + own, 6 : 6 + own].T, forces, 1)
        right[:own] = forces
        moving = np.flatnonzero(moves.any((1, 2)))
        pulling = self._pull.at(functions) if len(moving) else values[:0]
        for motion in moving:
            driven = np.flatnonzero(moves[motion].any(1))
            pull = np.flatnonzero(self._pull.column == motion)
            rows = self._pull.row[pull, None]
            right[rows, driven] -= pulling[pull, None] * moves[motion, driven]
        return self.pattern.solve(values, right)[:own]

    def in_pattern(
        self, functions: Inexact[np.ndarray, "function system"]
    ) -> Inexact[np.ndarray, "element system"]:
        """Evaluate the elements of the pattern."""
        place, elements = self._in_pattern
        values = elements.at(functions)
        result = np.zeros((len(self.pattern.row), values.shape[1]), dtype=values.dtype)
        result[place] = values
        return result


def sizes(
    matrix: Float[np.ndarray, "*rows row column"],
    of_row: Int[np.ndarray, " row"] | None,
    of_column: Int[np.ndarray, " column"],
) -> Float[np.ndarray, "*rows row column"]:
    """Largest absolute element over the rows and columns of equal, neighbouring places.

    A place is the translation of a body, its rotation, a blade tip, or a tension.
    """
    result = np.abs(matrix)
    for axis, place in ((-2, of_row), (-1, of_column)):
        if place is not None:
            is_first = np.ones(len(place), dtype=bool)
            is_first[1:] = place[1:] != place[:-1]
            number = is_first.cumsum() - 1
            result = np.maximum.reduceat(result, is_first.nonzero()[0], axis).take(number, axis)
    return result


def rounding(
    matrix: Inexact[np.ndarray, "row row"], place: Int[np.ndarray, " row"]
) -> Float[np.ndarray, "row row"]:
    """Largest rounding errors of the elements of a matrix of the forms of several parts."""
    size = sizes(matrix, place, place)
    own = np.sqrt(np.diag(size))
    return ROUNDING * np.maximum(size, own[:, None] * own)


def multiply_real(
    matrix: Float[np.ndarray, "*rows coordinate"],
    columns: Inexact[np.ndarray, "coordinate frequency"],
) -> Inexact[np.ndarray, "*rows frequency"]:
    """Multiply a real matrix by real or complex columns, in real arithmetic."""
    if not np.iscomplexobj(columns):
        return matrix @ columns
    return (matrix @ np.ascontiguousarray(columns).view(float)).view(complex)


def dense(
    matrix: Inexact[np.ndarray, "size size system"], rhs: Inexact[np.ndarray, "size column system"]
) -> Inexact[np.ndarray, "size column system"]:
    """Solve systems, stacked on the last axis, by LU with partial pivoting (LAPACK).

    The solution is not finite where a matrix is singular to the last bit.
    """
    size = np.abs(matrix).max(1)
    # powers of 2: pivots do not depend on units, and scaling does not round
    scale = np.exp2(-np.rint(np.log2(np.where(size > 0, size, 1.0)) / 2))[:, None]
    stacked = (np.moveaxis(part, -1, 0) for part in (matrix * scale * scale[:, 0], scale * rhs))
    return scale * np.moveaxis(solve_each(*stacked), 0, -1)


def solve_each(
    matrix: Inexact[np.ndarray, "*batch size size"],
    right: Inexact[np.ndarray, "*#batch size column"],
) -> Inexact[np.ndarray, "*batch size column"]:
    """Solve stacked systems; NaN where they are singular."""
    try:
        return np.linalg.solve(matrix, right)
    except np.linalg.LinAlgError:
        if matrix.ndim == 2:
            return np.full(right.shape, np.nan)
        right = np.broadcast_to(right, (*matrix.shape[:-2], *right.shape[-2:]))
        return np.stack([solve_each(m, r) for m, r in zip(matrix, right, strict=True)])


def connected_groups(linked: Bool[np.ndarray, "node node"]) -> list[Int[np.ndarray, " _"]]:
    """Group the nodes of a graph that are connected, directly or through others.

    A link counts in both directions. Nodes within a group are ascending, and groups ordered by
    their first. (The import of `scipy.sparse.csgraph` takes longer than a suspension's modes.)

    >>> connected_groups(np.array([[0, 0, 1], [0, 0, 0], [0, 0, 0]], dtype=bool))
    [array([0, 2]), array([1])]
    """
    linked = linked | linked.T
    remaining = np.ones(len(linked), dtype=bool)
    groups = []
    while remaining.any():
        group = np.zeros(len(linked), dtype=bool)
        front = np.zeros(len(linked), dtype=bool)
        front[remaining.argmax()] = True
        while front.any():
            group |= front
            front = linked[front].any(0) & ~group
        remaining &= ~group
        groups.append(np.flatnonzero(group))
    return groups
