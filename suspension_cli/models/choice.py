"""The model of a result: the cheapest whose error in that result is below a tolerance (``auto``).

The error of a model is computed: the largest relative changes of the result, at a few points, from
that model to the next more complete one, and so on to the most complete that is valid for the
design. A caller gives the models that it can use and that are worth comparing: for a response of
one design the most complete one alone, as wires that do not bend lack the losses that limit its
peaks, and those without mass cost more than half as much; for modes also the one without wire mass;
for many designs all.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from suspension_cli.design.kept_results import keep_last
from suspension_cli.design.schema import Design
from suspension_cli.errors import InputError
from suspension_cli.linear import quality
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.mode_pairing import pair_bodies
from suspension_cli.linear.signals import Signal
from suspension_cli.linear.solver import Solvable, Solver
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import registry
from suspension_cli.models.base import BLADE_TIPS, Model
from suspension_cli.models.registry import AUTO, Choice
from suspension_cli.models.spectrum_error import has_wire_mass, largest_error
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Complex, Float, Inexact

    Comparison = Callable[[Model, Model], tuple[float, str]]
    """The largest relative change of results from a model to a more complete one, and which result
    changes; if it is infinite or (NaN) unknown, why."""

ONE_MODEL_ONLY = "some builds have an equilibrium in only one of the models"
NO_BUILD = "no build that was compared has an equilibrium"
TOLERANCE = 1e-3
"""Relative error that `auto` allows by default."""
SAME = 1e-6
"""Relative distance of frequencies up to which curves resolve both from either."""


def choose(
    design: Design,
    wanted: str,
    candidates: Sequence[Model],
    compare: Comparison,
    tolerance: float = TOLERANCE,
) -> Choice:
    """Choose the cheapest of some models whose error is below a tolerance, or the `wanted` one.

    `wanted` is ``"auto"`` or the name of a model. The candidates are from the cheapest to the most
    complete; those that are not valid are passed over. If none is accurate enough, the most
    complete is taken. What its error is, and what it neglects, is in the result.

    Raises `InputError` if the wanted model is not valid for the design.
    """
    asked = None if wanted == AUTO else registry.choose(design, wanted)
    usable = [asked.model] if asked else _suitable(candidates, design)
    more = registry.MODELS[registry.MODELS.index(usable[-1]) + 1 :]
    chain = [*usable, *_suitable(more, design)]
    # from the most complete model down: one that is too inaccurate rules out all simpler ones
    number = len(usable) - 1
    steps = list[_Step]()
    reason = asked.reason if asked else ""
    for n in reversed(range(len(chain) - 1)):
        step = _step(chain[n], chain[n + 1], design, compare)
        if n < number and not math.fsum(one.change for one in (step, *steps)) <= tolerance:
            reason = f"{step.physics}: {step.what}"
            if math.isfinite(step.change):
                size = percent(step.change)
                reason = f"{step.physics} changes {step.what} by up to {size}"
            break
        steps.insert(0, step)
        number = min(n, number)
    error = math.fsum(step.change for step in steps)
    steps = [step for step in steps if step.physics]
    if not reason:
        enough = "accurate enough" if error <= tolerance else ""
        reason = enough or "the most complete that this analysis can use"
        reason = reason if steps else "the most complete"
    clauses = [reason]
    if known := [step.effect for step in steps if not math.isnan(step.change)]:
        missed = " not met by any model of this analysis" if error > tolerance else ""
        limit = f" (tolerance {100 * tolerance:g} %{missed})" if not asked else ""
        clauses.append(f"neglected: {', and '.join(known)}{limit}")
    clauses += [f"unknown: {one.physics}, as {one.what}" for one in steps if math.isnan(one.change)]
    if chain[-1].omits:
        why = registry.MOST_COMPLETE.unsuitable(design)
        clauses.append(f"unknown: {' and '.join(chain[-1].omits)}, as {why}")
        error = math.nan
    worst = max(steps, key=lambda step: step.change, default=_Step("", 0.0, ""))
    return Choice(chain[number].name, "; ".join(clauses), error, worst.physics, worst.what)


def _suitable(models: Sequence[Model], design: Design) -> list[Model]:
    return [one for one in models if one.automatic and not one.unsuitable(design)]


class _Step(NamedTuple):
    """From one model to the next more complete one: added physics and change of the results."""

    physics: str
    change: float
    what: str

    @property
    def effect(self) -> str:
        """The physics with the size of its effect, and on what."""
        if not math.isfinite(self.change):
            return f"{self.physics} ({self.what})"
        return f"{self.physics}, {percent(self.change)} in {self.what}"


def _step(simple: Model, refined: Model, design: Design, compare: Comparison) -> _Step:
    """Compute the step between two models; both are the same for some designs."""
    physics = registry.adds(refined, simple)
    approximates = bool(simple.approximated_stages(design))
    if not approximates and set(physics.split(" and ")) <= {"", BLADE_TIPS}:
        return _Step("", 0.0, "")
    try:
        return _Step(physics, *compare(simple, refined))
    except InputError:
        return _Step(physics, math.inf, f"the {refined.name} model has no equilibrium")


def percent(value: float) -> str:
    """Format a relative change in per cent, to two digits; rounding errors are "0 %".

    >>> percent(0.000123)
    '0.012 %'
    """
    return f"{0 if value < 1e-15 else float(f'{100 * value:.2g}'):g} %"


class Systems:
    """Linear systems of one design in several models, each built once."""

    def __init__(self, design: Design) -> None:
        self.design = design
        self._built: dict[str, LinearSystem] = {}
        self._solvers: dict[str, Solver] = {}

    @staticmethod
    @keep_last
    def of(design: Design) -> Systems:
        """Return the systems of a design, which the analyses of one command share."""
        return Systems(design)

    def __call__(self, model: Model) -> LinearSystem:
        """Return the linear system of a model."""
        if model.name not in self._built:
            self._built[model.name] = model.refined(self.design, self._built)
        return self._built[model.name]

    def solver(self, model: Model) -> Solver:
        """Return the solver of that system."""
        if model.name not in self._solvers:
            self._solvers[model.name] = Solver(self(model))
        return self._solvers[model.name]

    def compare(self, request: Callable[[LinearSystem], Results]) -> Comparison:
        """Return the comparison of results that are requested from any system of this design."""
        return lambda simple, refined: request(self(simple)).change(
            self.solver(simple), self.solver(refined)
        )


def compare_builds(solve: Callable[[Model], list[tuple[str, np.ndarray]]]) -> Comparison:
    """Return the comparison of arrays of results of some builds, each relative to its largest.

    `solve` computes them in one model, with their names; where the first is finite, a build has
    results. The last may be missing in some models. The change is infinite if a build has results
    in only one of the models.
    """
    known = cache(solve)

    def change(simple: Model, refined: Model) -> tuple[float, str]:
        old = known(simple)
        new = known(refined)
        exists, still = (np.isfinite(found[0][1]) for found in (old, new))
        if (exists != still).any():
            return math.inf, ONE_MODEL_ONLY
        if not exists.any():
            return math.nan, NO_BUILD
        pairs = zip(old, new, strict=False)
        changes = [(relative_change(one, other), name) for (name, one), (_, other) in pairs]
        return max((one for one in changes if not math.isnan(one[0])), key=lambda one: one[0])

    return change


def relative_change(
    old: Inexact[np.ndarray, "*build"], new: Inexact[np.ndarray, "*build"]
) -> float:
    """Compute the largest change over the largest value; NaN if no build is known in both."""
    known = np.isfinite(old) & np.isfinite(new)
    if not known.any():
        return math.nan
    largest = float(np.abs(new[known]).max())
    change = float(np.abs((old - new)[known]).max())
    if change == 0:
        return 0.0
    return change / largest if largest > 0 else math.inf


class Results(Protocol):
    """Results of a design, whose error decides on the model."""

    def change(self, simple: Solver, refined: Solver) -> tuple[float, str]:
        """Compute their largest relative change from one model to another, and which changes."""
        ...


@dataclass(frozen=True)
class Frequencies:
    """The frequencies of all modes of the bodies."""

    def change(self, simple: Solver, refined: Solver) -> tuple[float, str]:
        """Compute the change of the mode that changes most; modes are paired by their shapes."""
        modes, changes = shifts(simple, refined)
        most = int(np.argmax(changes))
        return _described(float(changes[most]), modes.label[most])


@dataclass(frozen=True)
class Transfer:
    """Responses of outputs to inputs at frequencies (f,) in Hz."""

    inputs: list[Signal]
    outputs: list[Signal]
    frequency: Array

    def values(
        self, system: Solvable, frequency: Array
    ) -> Complex[np.ndarray, "frequency output input"]:
        """Solve for the responses at frequencies in Hz."""
        from suspension_cli.linear import response

        return response.solve(system, frequency, self.inputs, self.outputs).value

    def change(self, simple: Solver, refined: Solver) -> tuple[float, str]:
        """Compute the largest change, see `spectrum_error`."""
        found = largest_error(self.frequency, simple, refined, self.values)
        o, i = found.place
        return found.value, f"{self.outputs[o].text}/{self.inputs[i].text}"


def shifts(simple: Solvable, refined: Solvable) -> tuple[Modes, Float[np.ndarray, " mode"]]:
    """Compute the relative changes of the bodies' modes, and the modes of the refined model.

    The modes are those without wire mass; modes are paired by their shapes. Infinite where a mode
    becomes stable.
    """
    quick = Solver.of(simple)
    complete = Solver.of(refined)
    new = complete.constant.modes
    changes = np.zeros(len(new.omega_squared))
    if quick.system.soft is not complete.system.soft:
        old = quick.constant.modes
        a = old.omega_squared[pair_bodies(new, old, complete.system)]
        b = new.omega_squared
        changes = np.where(b > 0, np.abs(np.sqrt(np.abs(a) / np.where(b > 0, b, 1.0)) - 1), 0.0)
        if old.stable != new.stable:
            changes[0] = np.inf
    if has_wire_mass(complete.system) and not has_wire_mass(quick.system):
        changes = changes + shifts_by_wire_mass(new, complete.system)
    return new, changes


def estimate_resonances(solver: Solver) -> Float[np.ndarray, " resonance"]:
    """Frequencies (Hz) where resonances may be: those of modes without wire mass, and with it.

    A peak beside a zero may be narrower than its shift by wire mass, and show nowhere else. Shifts
    below `SAME` are too small for two.
    """
    modes = solver.constant.modes
    if not has_wire_mass(solver.system):
        return modes.frequency
    shift = shifts_by_wire_mass(modes, solver.system)
    lowered = modes.frequency * (1 - shift)
    return np.concatenate([modes.frequency[shift > SAME], lowered])


def shifts_by_wire_mass(found: Modes, model: LinearSystem) -> Float[np.ndarray, " mode"]:
    """Relative change of each frequency by the mass of wires, by Rayleigh's quotient.

    With the dynamic stiffness Z(omega) of the wires with mass, and Z_0 without, the mode x changes
    by the fraction q(omega) = x^T (Z - Z_0) x / (2 omega^2 x^T M x), where x^T M x = 1. Close to a
    mode of wires q has a pole, so the changed frequency counts: with q and its slope in ln omega,
    which is negative (Foster), the change y is that nearest to 0 of y = q(y) = c / (y - e), with
    e = q / slope and c = -q^2 / slope. That is y = q far from the pole, and sqrt(c) at it: there
    the mode and that of the wires repel each other.
    """
    good = found.omega_squared > 0
    omega = np.sqrt(found.omega_squared[good])
    shapes = np.linalg.solve(model.basis, np.pad(found.shape[good], ((0, 0), (6, 0))).T)
    change = np.zeros(len(omega))
    for term, ends in quality.end_motions(model, shapes.T):
        there = replace(term.strand, lossy=False).at(omega * (1 + 1j * quality.STEP))
        for part, moved in ends.items():
            stiffness = there[part].stiffness
            added = np.real(stiffness) - term.strand.static[part][..., None]
            quotient, slope = (
                np.einsum("iwm,ijm,jwm->m", moved, matrix, moved) / (2 * omega**2)
                for matrix in (added, np.imag(stiffness) / quality.STEP)
            )
            change += _beside_pole(quotient, slope)
    result = np.zeros(len(good))
    result[good] = np.abs(change)
    return result


def _beside_pole(
    quotient: Float[np.ndarray, " mode"], slope: Float[np.ndarray, " mode"]
) -> Float[np.ndarray, " mode"]:
    """Solve y = c / (y - e) for y nearest to 0, from the value and slope of its right side at 0."""
    falls = slope < 0
    slope = np.where(falls, slope, -1.0)
    pole = quotient / slope
    strength = -(quotient**2) / slope
    further = np.abs(pole) + np.sqrt(pole**2 + 4 * strength)
    nearest = np.sign(quotient) * 2 * strength / np.where(further > 0, further, 1.0)
    return np.where(falls, nearest, quotient)


def _described(change: float, label: str) -> tuple[float, str]:
    """Return the change of a mode with its label, or if it is infinite the reason."""
    return change, label if np.isfinite(change) else f"it decides whether {label} is stable"
