"""Elimination of many small symmetric systems at once, body by body.

In a chain or tree each body couples only to the one that it hangs from. Elimination from the leaves
up, D = L diag(d) L^T, then needs few elements; other couplings fill in. All P systems are
eliminated at once, with the system axis last. The transmission from support to mirror becomes a
product of those of the stages, so it keeps its relative accuracy however small it is (factors of a
graded matrix; Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., chapter 10). Where a
part resonates alone its pivots are nearly singular, and the body above loses digits. A correction
from the residual restores these (ibid., chapter 12); a large one shows that the system needs
pivoting.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

if TYPE_CHECKING:
    from jaxtyping import Bool, Inexact, Int


Positions: TypeAlias = "slice | Int[np.ndarray, ' _']"

LARGE = 1e-6
"""Relative correction of a coordinate above which a system is solved with pivoting."""


@dataclass(frozen=True)
class Pattern:
    """Elements on and above the diagonal of symmetric systems, in their order of elimination.

    Attributes
    ----------
    order
        The coordinates in the order in which they are eliminated, called steps.
    later
        Later steps that each is coupled to when it is eliminated, ascending.
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
        position = {
            (n, m): self.start[n] + 1 + k
            for n, steps in enumerate(self.later)
            for k, m in enumerate(steps.tolist())
        }
        return [
            [
                as_slice(np.array([self.start[m], *(position[m, other] for other in steps[k:])]))
                for k, m in enumerate(steps, start=1)
            ]
            for steps in (later.tolist() for later in self.later)
        ]

    def factor(
        self, elements: Inexact[np.ndarray, "element system"], held: float | None = None
    ) -> Factors:
        """Eliminate systems, in place; singular parts give infinite or NaN solutions.

        Coordinates whose pivot is below the fraction `held` of their diagonal element, so that it
        is a rounding error, are held by that.
        """
        pivots, multipliers, least = [], [], np.full(elements.shape[1], np.inf)
        size = np.abs(elements[self.start[:-1]]) if held is not None else elements[:0]
        size[size == 0] = 1.0
        for n, updated in enumerate(self.updated):
            row = elements[self.start[n] : self.start[n + 1]]
            pivot = row[0]
            if held is not None:
                np.minimum(least, pivot / size[n], out=least)
                pivot = np.where(np.abs(pivot) > held * size[n], pivot, size[n])
            pivots.append(1.0 / pivot)
            multipliers.append(row[1:] * pivots[-1])
            for k, changed in enumerate(updated):
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
        largest: float = LARGE,
    ) -> Inexact[np.ndarray, "coordinate input system"]:
        """Solve D x = b with one correction; where that is over the `largest`, with pivoting."""
        right = rhs[self.order]
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            factors = self.factor(elements.copy())
            x = right.astype(np.result_type(right, elements))
            factors.solve(x)
            correction = self._residual(elements, x, right)
            factors.solve(correction)
            large = ~(np.abs(correction) <= largest * np.abs(x)).all((0, 1))
            x += correction
            result = np.empty_like(x)
            result[self.order] = x
            if large.any():
                elements, right = elements[:, large], right[..., large]
                matrix, residual = self.assemble(elements), np.empty_like(x[..., large])
                solution = dense(matrix, rhs[..., large])
                residual[self.order] = self._residual(elements, solution[self.order], right)
                result[..., large] = solution + dense(matrix, residual)
        return result

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
    rest = coupled[np.ix_(order, order)]
    rest = rest | rest.T
    later = []
    for n in range(len(order)):
        later.append(n + 1 + np.flatnonzero(rest[n, n + 1 :]))
        rest[np.ix_(later[-1], later[-1])] = True
    return Pattern(order, tuple(later))


@dataclass(frozen=True)
class Factors:
    """Eliminated systems, solvable for any right-hand sides.

    Attributes
    ----------
    pivots
        1/d of each step.
    multipliers
        L of the later steps coupled to each.
    least
        Least pivot over its diagonal element, of systems in which coordinates may be held.
    """

    pattern: Pattern
    pivots: list[Inexact[np.ndarray, " system"]]
    multipliers: list[Inexact[np.ndarray, "_ system"]]
    least: Inexact[np.ndarray, " system"]

    def select(self, which: Int[np.ndarray, " system"]) -> Factors:
        """Select some of the systems, or the one that all share."""
        if len(self.least) == 1:
            return self
        pivots, multipliers = (
            [each[..., which] for each in part] for part in (self.pivots, self.multipliers)
        )
        return Factors(self.pattern, pivots, multipliers, self.least[which])

    def solve(
        self, x: Inexact[np.ndarray, "step input system"]
    ) -> Inexact[np.ndarray, "step input system"]:
        """Solve for right-hand sides in the order of steps, in place."""
        driven, coupled = np.asarray(x.any((1, 2))), self.pattern.coupled
        for n, multipliers in enumerate(self.multipliers):
            if driven[n] and len(multipliers):
                x[coupled[n]] -= multipliers[:, None] * x[n]
                driven[coupled[n]] = True
        x *= np.array(self.pivots)[:, None]
        for n in range(len(x) - 1, -1, -1):
            if len(self.multipliers[n]):
                x[n] -= (self.multipliers[n][:, None] * x[coupled[n]]).sum(0)
        return x


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
    linked, remaining, groups = linked | linked.T, np.ones(len(linked), dtype=bool), []
    while remaining.any():
        group, front = np.zeros((2, len(linked)), dtype=bool)
        front[remaining.argmax()] = True
        while front.any():
            group |= front
            front = linked[front].any(0) & ~group
        remaining &= ~group
        groups.append(np.flatnonzero(group))
    return groups
