"""Causes of a budget as people read them: equal OSEMs together, and at most seven lines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.conventions import BETWEEN

if TYPE_CHECKING:
    from suspension_cli.design.control import Osem
    from suspension_cli.design.schema import Design
    from suspension_cli.physics.noise_budget import MotionBudget

PART = "part"
STAGE = "stage"
"""Ways to group causes, as `budget --by` has them."""
MOST = 7
"""Lines of causes in a table or a panel."""


@dataclass(frozen=True)
class Grouped:
    """A budget whose causes are groups, the largest first; `others` are those in the last one."""

    budget: MotionBudget
    others: tuple[str, ...] = ()

    @property
    def remarks(self) -> list[str]:
        """What the last line sums."""
        return [f"others: {', '.join(self.others)}"] if self.others else []


def group(one: MotionBudget, design: Design, by: str = PART) -> Grouped:
    """Sum the powers of the sensors, and of the coils, of equal OSEMs of a stage, and of the rest.

    With `by` `STAGE`, those of all sensors of a stage, and of all its actuators, instead. The rest
    are those behind the first six, if there are more than `MOST` groups.
    """
    lines = _by_stage if by == STAGE else _equal
    merged = _merged(one, lines(one.cause, design))
    size = _largest_fractions(merged)
    names = [merged.cause[n] for n in np.argsort(-size, kind="stable")]
    rest = names[MOST - 1 :] if int((size > 0).sum()) > MOST else []
    rest = [name for name in rest if size[merged.cause.index(name)] > 0]
    kept = {name: [merged.cause.index(name)] for name in names if name not in rest}
    if rest:
        kept[f"{len(rest)} others"] = [merged.cause.index(name) for name in rest]
    return Grouped(_merged(merged, kept), tuple(rest))


def _largest_fractions(one: MotionBudget) -> np.ndarray:
    """Largest fraction of the sum that each cause has at any frequency."""
    with np.errstate(invalid="ignore", divide="ignore"):
        fraction = one.contribution / one.amplitude[:, None]
    return np.nan_to_num(fraction).max(0, initial=0.0)


def _equal(causes: Sequence[str], design: Design) -> dict[str, list[int]]:
    """Numbers of causes by line: equal OSEMs of a stage make one, all others one each."""
    osems = {} if design.control is None else {one.name: one for one in design.control.osem}
    lines: dict[tuple[str, ...], list[int]] = {}
    for n, cause in enumerate(causes):
        kind, _, name = cause.partition(".")
        known = osems.get(name) if kind in ("sensor", "actuator") else None
        key = (cause,) if known is None else (kind, known.stage, _noise(known, kind))
        lines.setdefault(key, []).append(n)
    found = {}
    for (kind, *of), numbers in lines.items():
        several = len(numbers) > 1
        name = f"{len(numbers)} {kind}s of {of[0]}" if several else causes[numbers[0]]
        alike = sum(one.partition("#")[0] == name for one in found)
        if alike:  # other sensors on the same stage
            name = f"{name}#{alike + 1}"
        found[name] = numbers
    return found


def _by_stage(causes: Sequence[str], design: Design) -> dict[str, list[int]]:
    """Numbers of causes by line: sensors of a stage make one, its actuators another."""
    stages = _stages(design)
    found: dict[str, list[int]] = {}
    for n, cause in enumerate(causes):
        kind, _, _ = cause.partition(".")
        name = f"{kind}s of {stages[cause]}" if cause in stages else cause
        found.setdefault(name, []).append(n)
    return found


def _stages(design: Design) -> dict[str, str]:
    """Stage (or support, or several) of each sensor and actuator, by the name of its cause."""
    control = design.control
    if control is None:
        return {}
    found = {}
    for osem in control.osem:
        found[f"sensor.{osem.name}"] = osem.stage
        found[f"actuator.{osem.name}"] = osem.stage
    for sensor in control.sensor:
        bodies = dict.fromkeys(_body(text) for text in sensor.motions)
        found[f"sensor.{sensor.name}"] = " and ".join(bodies)
    for loop in control.loop:
        found[f"sensor.{loop.name}"] = _body(loop.sensor)
        found[f"actuator.{loop.name}"] = _body(loop.actuator)
    return found


def _body(signal: str) -> str:
    """The (first) body that a signal names."""
    return signal.partition(".")[0].partition(BETWEEN)[0]


def _noise(osem: Osem, kind: str) -> str:
    """Noise of the sensor or the coil of an OSEM, for comparison."""
    if kind == "sensor":
        return repr(osem.sensor_noise)
    gain = (osem.coil, osem.transconductance, osem.driver_response)
    return repr((osem.force_noise, osem.driver_noise, gain))


def _merged(one: MotionBudget, groups: Mapping[str, Sequence[int]]) -> MotionBudget:
    """Sum the powers of causes."""

    def summed(power: np.ndarray) -> np.ndarray:
        columns = [power[:, numbers].sum(1) for numbers in groups.values()]
        return np.stack(columns, axis=1) if columns else power[:, :0]

    sources = [{one.source[n] for n in numbers} for numbers in groups.values()]
    return replace(
        one,
        cause=tuple(groups),
        source=tuple(found.pop() if len(found) == 1 else "" for found in sources),
        contribution=np.sqrt(summed(one.contribution**2)),
        mean_square=summed(one.mean_square),
        mean_square_velocity=summed(one.mean_square_velocity),
    )
