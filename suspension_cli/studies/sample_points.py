"""Points of the unit cube from which builds are drawn: random, low-discrepancy, or in blocks.

Random numbers are counter-based (Philox; Salmon et al., Proc. SC11 (2011)). Low-discrepancy points
are those of `REPLICATES` independently scrambled Sobol sequences (Owen, J. Complexity 14, 466
(1998)), whose scatter gives the error of a mean. Sobol indices need blocks of points. The point of
a build depends only on its number, so builds can be drawn in any chunks.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from jaxtyping import Float, Int
    from scipy.stats.qmc import Sobol

RANDOM, SOBOL = "random", "sobol"
"""Names of the methods of sampling."""
REPLICATES = 8
"""Number of scrambled sequences, and of batches from which errors of Sobol indices follow."""
LEAST = 16
"""Smallest number of points of a replicate."""
LEAST_ROWS = 8
"""Smallest number of points of a replicate, for Sobol indices."""
BITS = 32
"""Binary digits of the points of a Sobol sequence."""


@dataclass(frozen=True)
class SamplePoints:
    """Points of the unit cube, one for each build.

    Attributes
    ----------
    method : {"random", "sobol"}
    count
        Number of builds; with groups, (k + 2) N.
    groups
        For Sobol indices: the group, from 0 to k - 1, of each coordinate. The builds are then
        those of matrices A and B (N rows each) of independent points, and for each group of A with
        the group's columns from B (Saltelli et al., Comput. Phys. Commun. 181, 259 (2010)).
    """

    method: str
    seed: int
    count: int
    groups: tuple[int, ...] = ()

    @property
    def blocks(self) -> int:
        """Number of matrices whose rows are the builds."""
        return max(self.groups) + 3 if self.groups else 1

    @property
    def rows(self) -> int:
        """Number of builds of each matrix."""
        return self.count // self.blocks

    @property
    def independent(self) -> int:
        """Number of first builds that are independent samples: A and B, or all."""
        return min(self.blocks, 2) * self.rows

    def replicate(self, build: Int[np.ndarray, " build"]) -> Int[np.ndarray, " build"]:
        """Replicate, from 0 to `REPLICATES` - 1, of builds by number."""
        return (build % self.rows) * REPLICATES // self.rows

    def of(self, start: int, stop: int, width: int) -> Float[np.ndarray, "stop-start width"]:
        """Points, in [0, 1), of builds start to stop - 1."""
        replicates = 1 if self.method == RANDOM else REPLICATES
        size, both = self.rows // replicates, width * min(self.blocks, 2)
        pieces = [np.zeros((0, width))]
        while start < stop:
            piece, first = divmod(start, size)
            last = min(first + stop - start, size)
            block, replicate = divmod(piece, replicates)
            if self.method == RANDOM:
                points = uniforms(self.seed, first, last, both)
            else:
                points = scrambled_sobol(self.seed, replicate, first, last, both)
            if block < 2:
                points = points[:, block * width : (block + 1) * width]
            else:
                from_b = np.array(self.groups) == block - 2
                points = np.where(from_b, points[:, width:], points[:, :width])
            pieces.append(points)
            start += last - first
        return np.concatenate(pieces)


def largest_count(wanted: int, method: str, groups: int = 0) -> int:
    """The most builds, up to `wanted`, that a method can use; 0 if there is none.

    Sobol sequences take `REPLICATES` times a power of two; Sobol indices of k groups take that for
    each of k + 2 matrices, with either method.
    """
    if method == RANDOM and not groups:
        return wanted
    unit = REPLICATES * (groups + 2 if groups else 1)
    rows = wanted // unit
    if rows < (LEAST_ROWS if groups else LEAST):
        return 0
    return unit << (rows.bit_length() - 1)


def smallest_count(groups: int = 0) -> int:
    """The fewest builds of Sobol sequences, or of the Sobol indices of k groups."""
    return REPLICATES * ((groups + 2) * LEAST_ROWS if groups else LEAST)


def uniforms(seed: int, start: int, stop: int, width: int) -> Float[np.ndarray, "stop-start width"]:
    """Draw uniform numbers in [0, 1) of builds start to stop - 1.

    Each build takes whole Philox blocks of four numbers, so its numbers depend only on seed and
    build.
    """
    blocks = -(-width // 4)
    stream = np.random.Philox(key=seed)
    stream.advance(start * blocks)
    return np.random.Generator(stream).random((stop - start, 4 * blocks))[:, :width]


def scrambled_sobol(
    seed: int, replicate: int, start: int, stop: int, width: int
) -> Float[np.ndarray, "stop-start width"]:
    """Points start to stop - 1 of one scrambled Sobol sequence.

    They are in the middle of the intervals that their binary digits stand for.
    """
    engine = _engine(seed, replicate, width)
    engine.reset()
    if start:
        engine.fast_forward(start)
    with warnings.catch_warnings():
        # a part of a sequence need not have a power of two of points
        warnings.simplefilter("ignore", UserWarning)
        return engine.random(stop - start) + 0.5 ** (BITS + 1)


@lru_cache(maxsize=REPLICATES)
def _engine(seed: int, replicate: int, width: int) -> Sobol:
    """Make one scrambled Sobol sequence; scrambling takes as long as some hundred builds."""
    from scipy.stats import qmc

    return qmc.Sobol(width, bits=BITS, rng=np.random.default_rng([seed, replicate]))
