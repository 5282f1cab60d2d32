"""Random builds: uniform numbers, the deviations that a `[tolerance]` table makes of them, and
imperfect scenes.

Random numbers are counter-based (Philox; Salmon et al., Proc. SC11 (2011)): those of a build depend
on its number and the seed alone, so builds can be drawn in any chunks.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design.imperfections import AXES, PARTS, Imperfection, Part, scattered
from suspension_cli.design.schema import Design, Distribution
from suspension_cli.equilibrium import hanging
from suspension_cli.errors import InputError
from suspension_cli.scene import applied_imperfections
from suspension_cli.scene.scene import Scene

if TYPE_CHECKING:
    from jaxtyping import Float

SMALLEST = 1e-3
"""Smallest factor (on k, mass, ...): a normal distribution has tails."""

UNIFORM = 1e-3
"""Limit over the standard deviation below which a normal distribution is uniform, to 1e-7."""
FURTHER = 2**64
"""Added to a seed, gives points that are independent of the builds of all seeds."""


def uniforms(seed: int, start: int, stop: int, width: int) -> Float[np.ndarray, "stop-start width"]:
    """Draw uniform numbers in [0, 1) of builds start to stop - 1.

    Each build takes whole Philox blocks of four numbers, so its numbers depend only on seed and
    build.
    """
    blocks = -(-width // 4)
    stream = np.random.Philox(key=seed)
    stream.advance(start * blocks)
    return np.random.Generator(stream).random((stop - start, 4 * blocks))[:, :width]


@dataclass(frozen=True)
class ScatteredNumber:
    """One number that scatters: ``test.1 length``, ``test com x``.

    `number` is that of its part, `axis` 0, 1 or 2 for vectors; `hold` is for wires. Numbers of one
    tolerance share a `group`, ``test wires length``.
    """

    label: str
    number: int
    imperfection: Imperfection
    axis: int
    spread: Distribution
    hold: str = "loaded-length"
    group: str = ""

    @property
    def unit(self) -> str:
        """``m``, or ``1`` for a fraction of the nominal value."""
        return self.imperfection.unit


def factors(design: Design, scene: Scene) -> tuple[ScatteredNumber, ...]:
    """List the numbers that a design's `[tolerance]` table lets scatter, in a fixed order.

    Raises `InputError` if there is no such table.
    """
    given = design.tolerance
    if given is None:
        raise InputError.of(
            "tolerance",
            "missing",
            f"add a table [[tolerance.PART]] with PART one of {', '.join(PARTS)}",
        )
    return tuple(
        factor
        for part in PARTS
        for item in getattr(given, part)
        for label, number in applied_imperfections.members(scene, part).items()
        for factor in _of_part(part, item, number, label)
    )


def _of_part(part: Part, item: Distribution, number: int, label: str) -> Iterator[ScatteredNumber]:
    """List the numbers of one part to which a table gives a distribution, if it is about it."""
    stage = getattr(item, "stage", None)
    whole = part in ("body", "link")
    if label != getattr(item, part, stage) and (whole or label.partition(".")[0] != stage):
        return
    several = part if part == "body" else f"{part}s"
    owner = f"{stage} {several}" if stage else getattr(item, part)
    if part == "blade" and "." not in label:
        label = f"{label} blades"
    for row in scattered(part):
        if spread := getattr(item, row.spread):
            for axis, name in enumerate(AXES if row.vector else ("",)):
                full = f"{label} {row.spread} {name}".rstrip()
                hold = getattr(item, "hold", ScatteredNumber.hold)
                group = f"{owner} {row.spread}"
                yield ScatteredNumber(full, number, row, axis, spread, hold, group)


def deviations(
    chosen: tuple[ScatteredNumber, ...], u: Float[np.ndarray, "build factor"]
) -> Float[np.ndarray, "build factor"]:
    """Compute the deviations of every number from nominal, m or fractions, at points `u`."""
    from scipy.special import ndtr, ndtri

    result = np.empty_like(u)
    for n, factor in enumerate(chosen):
        spread = factor.spread
        if spread.uniform is not None:
            result[:, n] = spread.uniform * (2 * u[:, n] - 1)
            continue
        sigma = spread.normal or 0.0
        tail = ndtr(-spread.truncate / sigma) if spread.truncate and sigma else 0.0
        # the middle of the interval of a 53-bit number; the last one rounds to 1, whose deviation
        # is infinite
        middle = np.minimum(u[:, n] + 2.0**-54, 1 - 2.0**-53)
        result[:, n] = sigma * ndtri(tail + (1 - 2 * tail) * middle)
        if spread.truncate:
            result[:, n] = np.clip(result[:, n], -spread.truncate, spread.truncate)
    return result


def standard_deviations(chosen: tuple[ScatteredNumber, ...]) -> Float[np.ndarray, " factor"]:
    """Compute the exact standard deviation of the deviation of every number; all means are 0.

    A normal distribution cut off at t standard deviations on both sides has the variance
    1 - 2 t phi(t) / (2 Phi(t) - 1) of the whole one (Johnson, Kotz and Balakrishnan, Continuous
    Univariate Distributions, volume 1, section 10.1).
    """
    from scipy.special import erf

    result = np.empty(len(chosen))
    for n, factor in enumerate(chosen):
        spread = factor.spread
        if spread.uniform is not None:
            result[n] = spread.uniform / np.sqrt(3)
            continue
        sigma = spread.normal or 0.0
        result[n] = sigma
        if spread.truncate and sigma:
            t = spread.truncate / sigma
            density = np.exp(-(t**2) / 2) / np.sqrt(2 * np.pi)
            left = 1 - 2 * t * density / erf(t / np.sqrt(2))
            # the difference of nearly equal numbers: a narrow cut leaves a uniform distribution
            result[n] = sigma * np.sqrt(left) if t > UNIFORM else spread.truncate / np.sqrt(3)
    return result


Change = tuple[Imperfection, int, str, int | None, np.ndarray]
"""An imperfection of builds: which, the number of its wire or body, what is kept (`hold`), the axis
(None: all), and its deviations from neutral."""


def imperfect(
    scene: Scene, chosen: tuple[ScatteredNumber, ...], values: Float[np.ndarray, "build factor"]
) -> Scene:
    """Apply random deviations to a scene; the builds become its first axis."""
    factors = zip(chosen, values.T, strict=True)
    changes = [(one.imperfection, one.number, one.hold, one.axis, own) for one, own in factors]
    # a wire is trimmed first
    changes.sort(key=lambda change: change[2] == "natural-length")
    return impose(scene, changes, SMALLEST)


def impose(scene: Scene, changes: Iterable[Change], least: float = 0.0) -> Scene:
    """Apply imperfections to a scene in their order; the builds become its first axis.

    Deviations of one number add. Factors are at least `least`.
    """
    table: dict[tuple[str, int, str], dict[Imperfection, np.ndarray]] = {}
    for row, number, hold, axis, deviation in changes:
        here = table.setdefault((row.part, number, hold), {})
        amount = here.setdefault(row, np.zeros((len(deviation), 3 if row.vector else 1)))
        amount[:, slice(None) if axis is None else [axis]] += deviation[:, None]
    for (part, number, hold), rows in table.items():
        amounts = {}
        for row, amount in rows.items():
            value = np.maximum(1.0 + amount, least) if row.relative else amount
            amounts[row.name] = value if row.vector else value[:, 0]
        scene = hanging.impose(scene, part, number, amounts, hold)
    return scene
