"""Maps from few solutions where they are hard: the stated error beside the true one.

Poles, modes that meet, corners, and regions without a result. The true error is the largest
difference from the solution of every point.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from bench.sweeps import SINGLE, TRIPLE, sweep
from suspension_cli.analyses import named_quantities
from suspension_cli.analyses.sweep.solve import ParameterSweep
from suspension_cli.design.reader import read, replaced, with_text
from suspension_cli.linear import eigenmodes
from suspension_cli.models import registry
from suspension_cli.quantities.nominal_results import find_results
from suspension_cli.studies.interpolated import Analytic, interpolated, largest_difference
from suspension_cli.studies.job import Axis

Ranges = Mapping[str, tuple[float, float]]

SIDE = 36
"""Values of each of both numbers of a map."""
LEVEL = "string"
WIRES = "stage.test.wires."
IMPERFECT = """
[[perturbation]]
wire = "test.1"
k_factor = 1.02
"""


@dataclass(frozen=True)
class MapError:
    """What a map was computed from, and its errors.

    Attributes
    ----------
    points : int
        Number of designs that were solved for it.
    stated, true : float
        Largest error as the program states it, and against all points; None and 0 where the
        program solves every point.
    """

    points: int
    stated: float | None = None
    true: float = 0.0

    @property
    def ratio(self) -> float:
        """True error over the stated one."""
        return self.true / self.stated if self.stated else 0.0


def _axes(ranges: Ranges, path: str = "") -> tuple[Axis, ...]:
    """Spread values of numbers evenly over their ranges."""
    return tuple(
        Axis(path + key, tuple(np.linspace(low, high, SIDE).tolist()))
        for key, (low, high) in ranges.items()
    )


def _coupling(ranges: Ranges) -> Analytic:
    """Horizontal over vertical motion of a triple at 50 Hz, by errors of one of its last wires."""
    return replace(sweep(TRIPLE), axes=_axes(ranges))


def _single(ranges: Ranges, *asked: str, more: str = "") -> Analytic:
    """Results of a single pendulum, by numbers of its wires."""
    design = read(SINGLE)
    source = with_text(design, design.text + more)
    results = find_results(list(asked), named_quantities.names_of(source), source.text, LEVEL)
    return ParameterSweep(source.text, _axes(ranges, WIRES), LEVEL, results)


def _resonant_corner(ranges: Ranges, mode: int) -> Analytic:
    """Responses at the frequency of a mode that the design in the first corner has."""
    corner = replaced(read(SINGLE), {WIRES + key: low for key, (low, _) in ranges.items()})
    system = registry.by_name(LEVEL).system(corner.design)
    squared = eigenmodes.solve(system.constant).omega_squared[mode]
    frequency = float(np.sqrt(squared)) / (2 * np.pi) * (1 + 1e-9)
    asked = (f"test.{dof}/support.x:{frequency!r}" for dof in ("x", "pitch"))
    return _single(ranges, *asked)


CROSSED = {"k": (0.6, 1.4), "offset": (-2e-3, 2e-3)}
SECTIONS = {"s": (0.004, 0.006), "d": (0.0005, 0.002)}
UPRIGHT = {"t1": (0.08, 0.11), "t2": (0.08, 0.11)}
"""At equal t1 and t2 the wires are vertical, and two modes of the pendulum are equal."""
TROUBLES: dict[str, Callable[[], Analytic]] = {
    "a resonance crosses it": partial(_coupling, CROSSED),
    "a resonance in a corner": partial(_resonant_corner, SECTIONS, 2),
    "two modes of equal frequency cross": partial(
        _single, UPRIGHT, "test longitudinal", "test transverse"
    ),
    "the same, with one wire 2 % stiffer": partial(_single, UPRIGHT, "modes", more=IMPERFECT),
    "pitch passes the modes of the pendulum": partial(
        _single, {"s": (0.001, 0.006), "d": (0.0005, 0.003)}, "modes"
    ),
    "pitch tips over in a part": partial(
        _single, {"s": (0.001, 0.006), "d": (-0.003, 0.003)}, "modes"
    ),
    "a wire is slack in corners": partial(
        _coupling, {"length": (-1.75e-3, 1.75e-3), "offset": (-2e-3, 2e-3)}
    ),
    "a wire is slack in a third": partial(
        _coupling, {"length": (-3e-3, 3e-3), "offset": (-2e-3, 2e-3)}
    ),
}
"""Maps by what is hard about them."""


def compare(job: Analytic) -> MapError:
    """Compare the map of a job, if the program makes one, with the solution of every point."""
    found = interpolated(job)
    if found is None:
        return MapError(job.count)
    exact = job.compute(0, job.count)
    true = largest_difference(job, exact, found.compute(0, job.count))
    return MapError(found.surface.points + found.checked, found.error, true)


HEAD = ["map", "designs_solved", "stated_error", "true_error"]
"""Columns of `results/stability_maps.csv`; no errors where every point was solved."""


def rows(errors: Mapping[str, MapError]) -> list[list[str]]:
    """Rows of the table by trouble, see `HEAD`."""
    return [
        [trouble, str(one.points)]
        + (["", ""] if one.stated is None else [f"{one.stated:.2g}", f"{one.true:.2g}"])
        for trouble, one in errors.items()
    ]


def summary(errors: Mapping[str, MapError]) -> str:
    """Summarise the errors, below a heading."""
    ratios = [one.ratio for one in errors.values() if one.stated is not None]
    return "\n".join(
        [
            "## Stated errors of maps",
            "",
            f"[Maps of {SIDE} × {SIDE} points](stability_maps.csv) that resonances, modes that"
            " meet, tipping over and slack wires make hard: the true error is at most"
            f" {max(ratios):.2g} times the stated one in {len(ratios)} of {len(errors)}; in the"
            " others points have no result, and every point is solved.",
        ]
    )
