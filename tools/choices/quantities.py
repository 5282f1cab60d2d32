"""Quantities of interest of random suspensions, by `auto` or any model, and their errors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import msgspec
import numpy as np
from numpy.random import Generator
from scipy.optimize import linear_sum_assignment

from suspension_cli.analyses import model_choice
from suspension_cli.analyses.modes import wire_modes
from suspension_cli.analyses.xcouple import model_error
from suspension_cli.analyses.xcouple import solve as coupling
from suspension_cli.analyses.xcouple.solve import Sweep
from suspension_cli.design import reader
from suspension_cli.design.schema import Design
from suspension_cli.linear import eigenmodes, signals
from suspension_cli.models import registry
from suspension_cli.models.registry import Choice
from suspension_cli.studies.axes import Axis
from tools.choices import designs

REFERENCE = "violin"
BUILDS = (41, 5)
"""Builds in a sweep of couplings, the defaults of `pendsus xcouple`."""
LARGEST_SHIFT = 10.0
"""Largest apparent frequency shift considered, in tolerances."""
SHIFTS = 300
"""Number of shifts either way at which the couplings of builds beyond the tolerance are tried."""
ALIKE = 0.5
"""Overlap above which two modes are the same; a body mode mixed with a wire mode has no partner."""


@dataclass(frozen=True)
class Question:
    """One quantity of interest of one design.

    Attributes
    ----------
    cheaper : tuple of str
        Models cheaper than the reference that can compute it.
    solve_auto : callable
        Return the choice of `auto`, and its result.
    solve_on : callable
        Compute the result with a model, from the design.
    error : callable
        Relative error of a result against the reference model.
    """

    cheaper: tuple[str, ...]
    solve_auto: Callable[[], tuple[Choice, Any]]
    solve_on: Callable[[str], Any]
    error: Callable[[Any], float]


def frequencies(design: Design, _: Generator, tolerance: float) -> Question:
    """Frequencies of the modes of bodies and blade tips."""

    def listed(model: Any, level: str) -> Any:
        still = eigenmodes.solve(model)
        return model, wire_modes.solve(
            model, float(np.nanmax(still.frequency))
        ) if level == REFERENCE else still

    def solve_auto() -> tuple[Choice, Any]:
        source = reader.Source(design, "", "")
        choice, model = model_choice.for_modes(source, "auto", tolerance)
        return choice, listed(model, choice.level)

    def solve_on(level: str) -> Any:
        return listed(registry.by_name(level).system(design), level)

    exact = cache(lambda: solve_on(REFERENCE))

    def error(quick: Any) -> float:
        model, slow = exact()
        back = np.linalg.inv(model.basis)
        mass = (back.T @ model.mass @ back)[6:, 6:]
        # the force model has no blade tips
        here = [slow.coordinate.index(name) for name in quick[1].coordinate]
        overlap = np.abs(slow.shape[:, here] @ mass[np.ix_(here, here)] @ quick[1].shape.T)
        rows, columns = linear_sum_assignment(-overlap)
        good = (overlap[rows, columns] > ALIKE) & (slow.frequency[rows] > 0)
        return float(
            np.abs(quick[1].frequency[columns] / np.where(good, slow.frequency[rows], 1.0) - 1)[
                good
            ].max(initial=0.0)
        )

    return Question(("beam",), solve_auto, solve_on, error)


def couplings(design: Design, rng: Generator, tolerance: float) -> Question:
    """Coupling x over z of the last body for vertical motion of the support.

    At a point a little below its centre, over errors of one wire's stiffness and upper end.
    """
    last, text = design.stage[-1].name, reader.write_toml(msgspec.to_builtins(design))
    model = registry.STRING.system(design)
    known, wire = signals.bodies_with_signals(model), model.wire.index(f"{last}.1")
    motions = (signals.parse_output(f"{last}.{dof}@0,0,-0.001", known) for dof in "xz")
    quantity = coupling.CouplingRequest(
        wire,
        len(design.stage),
        "loaded-length",
        signals.parse_input("support.z", known),
        *motions,
        (_frequency(rng),),
    )
    offset = min(1e-3, 0.1 * designs.smallest_elongation(design)) * np.linspace(-1, 1, BUILDS[1])
    job = Sweep(
        text,
        (Axis("k", tuple(np.linspace(0.9, 1.1, BUILDS[0]))), Axis("offset", tuple(offset))),
        quantity,
    )

    def solve_auto() -> tuple[Choice, Any]:
        source, change = reader.Source(design, text, ""), model_error.coupling_change(job)
        choice = model_choice.for_builds(source, "auto", registry.SCENE_MODELS, change, tolerance)
        return choice, solve_on(choice.level)

    def solve_on(level: str) -> Any:
        return replace(job, level=level).compute(0, job.count)["ratio"]

    reference = cache(lambda: solve_on(REFERENCE))

    def error(quick: Any) -> float:
        exact = reference()
        hung = np.isfinite(exact)
        if (np.isfinite(quick) != hung).any():
            return float("inf")
        largest = np.abs(exact[hung]).max(initial=0.0)
        off = np.where(hung, np.abs(quick - exact), 0.0).max(1) / (largest or 1.0)
        if off.max() > tolerance:
            far = np.flatnonzero(off > tolerance / 10)
            off[far] = shifted(quick[far, 0], far, largest)
        return float(off.max())

    def shifted(quick: Any, some: Any, largest: float) -> Any:
        """Errors of some builds, in size or equivalent shift of the frequency."""
        side = np.geomspace(1e-8, LARGEST_SHIFT * tolerance, SHIFTS)
        shift = np.concatenate([-side[side < 1][::-1], [0.0], side])
        values = {name: value[some] for name, value in job.values(0, job.count).items()}
        scene = coupling.impose(job.scene, values, quantity)
        moved = replace(quantity, frequency=tuple(quantity.frequency[0] * (1 + shift)))
        value = coupling.compute_coupling(scene, design, moved, level=REFERENCE)["ratio"]
        return _size_or_shift(quick, shift[None], value, np.full((1, 1), largest))

    return Question(("string", "beam"), solve_auto, solve_on, error)


QUANTITIES = {
    "modes": frequencies,
    "couplings": couplings,
}
"""Quantities of interest by name."""


def _size_or_shift(quick: Any, shift: Any, value: Any, size: Any) -> Any:
    """Errors (n,) of results, in size or frequency shift, the smaller of the larger of both.

    `value` (n, d) are exact at frequencies shifted by `shift` (n, d), straight lines in between;
    errors in size are relative to `size` (n, d - 1).
    """
    difference, step = quick[:, None] - value[:, :-1], np.diff(value, axis=1)
    along = np.clip(
        (difference * step.conj()).real / np.maximum(np.abs(step) ** 2, 1e-300), 0.0, 1.0
    )
    frequency_shift = np.abs(shift[:, :-1] + along * np.diff(shift, axis=1))
    size_error = np.where(
        size > 0,
        np.abs(difference - along * step) / np.maximum(size, 1e-300),
        np.where(difference == 0, 0.0, np.inf),
    )
    return np.maximum(size_error, frequency_shift).min(1)


def _frequency(rng: Generator) -> float:
    return float(np.exp(rng.uniform(np.log(1.0), np.log(100.0))))
