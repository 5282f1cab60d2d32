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
from suspension_cli.analyses.thermal import solve as thermal
from suspension_cli.analyses.xcouple import model_error
from suspension_cli.analyses.xcouple import solve as coupling
from suspension_cli.analyses.xcouple.solve import Sweep
from suspension_cli.conventions import DOFS
from suspension_cli.design import reader
from suspension_cli.design.schema import Design
from suspension_cli.linear import eigenmodes, response, signals
from suspension_cli.models import auto, registry
from suspension_cli.models.quantity_of_interest import Frequencies, Transfer
from suspension_cli.models.registry import Choice
from suspension_cli.studies import builds
from suspension_cli.studies.axes import Axis
from tools.choices import designs

REFERENCE = "violin"
BUILDS = (41, 5)
"""Builds in a sweep of couplings, the defaults of `pendsus xcouple`."""
POINTS = 1000
"""Number of frequencies of a response or a noise."""
CHECKED = 60
"""Number of these that are compared with the reference model."""
NEAR_RESONANCE = np.geomspace(1e-7, 0.3, 80)
"""Relative distances from each resonance at which the reference is evaluated, besides `EVERYWHERE`
points."""
EVERYWHERE = 2000
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
        decision = auto.decide(design, lambda _: Frequencies(), tolerance)
        return decision.choice, listed(decision.model, decision.choice.level)

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

    return Question((registry.choose(design).level, "beam"), solve_auto, solve_on, error)


def responses(design: Design, rng: Generator, tolerance: float) -> Question:
    """Response of the last body to a motion of the support or a force on the first body."""
    dof = int(rng.integers(6))
    first, last = design.stage[0].name, design.stage[-1].name
    drive = f"support.{DOFS[dof]}" if rng.random() < 0.5 else f"{first}.{signals.FORCES[dof]}"
    grid = _grid(rng)

    def quantity(model: Any) -> Transfer:
        known = signals.bodies_with_signals(model)
        return Transfer(
            [signals.parse_input(drive, known)],
            [signals.parse_output(f"{last}.{DOFS[dof]}", known)],
            grid,
        )

    def solved(model: Any, frequency: Any) -> Any:
        one = quantity(model)
        return response.solve(model, frequency, one.inputs, one.outputs).value[:, 0, 0]

    def solve_auto() -> tuple[Choice, Any]:
        decision = auto.decide(design, quantity, tolerance, highest=float(grid[-1]))
        return decision.choice, solved(decision.model, grid)

    def solve_on(level: str) -> Any:
        return solved(registry.by_name(level).system(design), grid)

    @cache
    def exact() -> tuple[Any, Any]:
        model = registry.by_name(REFERENCE).system(design)
        dense = _dense(model, grid, tolerance)
        return dense, solved(model, dense)

    def error(quick: Any) -> float:
        return error_or_shift(rng, grid, quick, *exact())

    return Question((registry.choose(design).level, "beam"), solve_auto, solve_on, error)


def noises(design: Design, rng: Generator, tolerance: float) -> Question:
    """Thermal noise of a motion of the last body."""
    output, grid = (
        f"{design.stage[-1].name}.{rng.choice(['x', 'x', 'y', 'z', 'pitch', 'yaw'])}",
        _grid(rng),
    )

    def solved(model: Any, frequency: Any) -> Any:
        signal, row = thermal.parse_motion(model, output)
        return thermal.solve(model, frequency, row, signal, design.constants.temperature).amplitude

    def solve_auto() -> tuple[Choice, Any]:
        decision = auto.decide_for_thermal_noise(design, "auto", float(grid[-1]), tolerance)
        return decision.choice, solved(decision.model, grid)

    def solve_on(level: str) -> Any:
        return solved(registry.by_name(level).system(design), grid)

    @cache
    def exact() -> tuple[Any, Any]:
        model = registry.by_name(REFERENCE).system(design)
        dense = _dense(model, grid, tolerance)
        return dense, solved(model, dense)

    def error(quick: Any) -> float:
        return error_or_shift(rng, grid, quick, *exact())

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
        (float(_grid(rng)[-1]),),
    )
    offset = min(1e-3, 0.1 * designs.smallest_elongation(design)) * np.linspace(-1, 1, BUILDS[1])
    job = Sweep(
        text,
        (Axis("k", tuple(np.linspace(0.9, 1.1, BUILDS[0]))), Axis("offset", tuple(offset))),
        quantity,
    )

    def solve_auto() -> tuple[Choice, Any]:
        source, own = reader.Source(design, text, ""), replace(job, balanced={})
        change = model_error.coupling_change(own, tolerance)
        choice = model_choice.for_builds(source, "auto", registry.SCENE_MODELS, change, tolerance)
        return choice, replace(own, level=choice.level).compute(0, job.count)["ratio"]

    def solve_on(level: str) -> Any:
        return replace(job, level=level, balanced={}).compute(0, job.count)["ratio"]

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
        scene = coupling.impose(job.scene, job.values(0, job.count), quantity)
        found = builds.restricted(builds.balance(scene, design, level=REFERENCE), some)
        moved = replace(quantity, frequency=tuple(quantity.frequency[0] * (1 + shift)))
        value = coupling.couplings(found, moved)["ratio"][some]
        return _size_or_shift(quick, shift[None], value, np.full((1, 1), largest))

    return Question(("string", "beam"), solve_auto, solve_on, error)


QUANTITIES = {
    "modes": frequencies,
    "response": responses,
    "thermal noise": noises,
    "couplings": couplings,
}
"""Quantities of interest by name."""


def error_or_shift(rng: Generator, grid: Any, quick: Any, dense: Any, value: Any) -> float:
    """Largest error of a result at random grid points, in size or equivalent frequency shift.

    Near a resonance a relative frequency error delta changes a response by Q delta, so a result
    that is exact at a slightly shifted frequency counts with that shift. The exact result is
    interpolated linearly between its values at the frequencies `dense`.
    """
    at = np.sort(rng.choice(len(grid), CHECKED, replace=False))
    size = np.maximum(np.abs(value[:-1]), np.abs(value[1:]))
    return float(_size_or_shift(quick[at], dense / grid[at, None] - 1, value[None], size).max())


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


def _dense(model: Any, grid: Any, tolerance: float) -> Any:
    """Frequencies over a grid and a little beyond it, dense about resonances."""
    room = 1 + LARGEST_SHIFT * tolerance
    known = eigenmodes.solve(model).frequency
    known = known[known > 0]
    about = np.concatenate(
        [
            known[:, None] * (1 - NEAR_RESONANCE),
            known[:, None],
            known[:, None] * (1 + NEAR_RESONANCE),
        ],
        axis=1,
    ).ravel()
    every = np.union1d(
        np.union1d(np.geomspace(grid[0] / room, grid[-1] * room, EVERYWHERE), grid), about
    )
    return every[(every >= grid[0] / room) & (every <= grid[-1] * room)]


def _grid(rng: Generator) -> Any:
    highest = float(np.exp(rng.uniform(np.log(1.0), np.log(100.0))))
    return np.geomspace(0.1, highest, POINTS)
