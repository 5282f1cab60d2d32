"""The cheapest model whose error in a quantity of interest is below a tolerance (``auto``).

Three refinements may be neglected: `base.BLADE_TIPS`, `base.BENDING` and `base.MASS`. Their effect
is estimated from the modes of the simplest model (`estimates`), before any other is built. A
refinement is neglected if its estimate is below the tolerance. Otherwise it is included or, if that
costs less, the quantity of interest is computed with and without it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np

from suspension_cli.design.schema import Design
from suspension_cli.errors import Fault, InputError, format_value
from suspension_cli.linear import eigenmodes
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import registry, wire_mass
from suspension_cli.models.base import BENDING, BLADE_TIPS, MASS, Model
from suspension_cli.models.estimates import Estimates
from suspension_cli.models.quantity_of_interest import QuantityOfInterest
from suspension_cli.models.registry import AUTO, MOST_COMPLETE, Choice
from suspension_cli.models.wire_mass import percent
from suspension_cli.scene.fibres import explain_unsuitable
from suspension_cli.scene.scene import Scene

TOLERANCE = 1e-3
"""Relative error that `auto` allows by default."""
AWAY = 2.0
"""Safety factor on the estimate of bending where bodies do not hang as drawn: bent wires then also
turn them a little, which is not estimated."""
CHANGED = 0.1
"""Relative change of a result by bending above which modes on straight wires are a poor basis for
other estimates."""
OTHER = 4.0
"""Safety factor on the estimate of wire mass from such modes."""
ZERO = "symmetry makes the response exactly 0"
"""Reason for the most complete model where a response is 0 in it too."""
NONZERO = "it makes a result nonzero"
"""In place of the change of a result that is exactly 0 in the simplest model alone."""
NOT_MET = " not met by any model of this analysis"
"""Follows the tolerance in a reason if the most complete model allowed exceeds it."""
MARGIN = 0.8
"""Fraction of the tolerance that all neglected refinements together may change."""


@dataclass(frozen=True)
class Refinement:
    """Effect of one refinement of the model on a quantity of interest.

    Attributes
    ----------
    name
        `base.BLADE_TIPS`, `base.BENDING` or `base.MASS`.
    indicator
        Estimated relative change; NaN where the design lacks the wires' properties.
    stage
        The stage that contributes most.
    change
        The relative change, computed; None where the estimate sufficed.
    taken
        Whether the chosen model includes it because of its size.
    what
        The part of the quantity that changes most; "" if not computed.
    words
        In messages in place of an infinite number; else "".
    """

    name: str
    indicator: float
    stage: str
    change: float | None
    taken: bool
    what: str = ""
    words: str = ""

    @property
    def estimate(self) -> float:
        """Relative change, computed or estimated."""
        return self.indicator if self.change is None else self.change


@dataclass(frozen=True)
class Decision:
    """A chosen model, its linear system, and the refinements that were considered."""

    choice: Choice
    model: LinearSystem
    refinements: tuple[Refinement, ...]

    @property
    def missed(self) -> str:
        """The part of the quantity that neglected physics changes most; "" if not computed."""
        return "" if self._worst is None else self._worst.what

    @property
    def physics(self) -> str:
        """The neglected physics that changes it, such as "wire bending"; "" if not computed."""
        return "" if self._worst is None else self._worst.name

    @property
    def needed(self) -> str:
        """Name of the model that includes this physics; "" if not computed."""
        return "" if self._worst is None else registry.cheapest_with(self._worst.name).name

    @property
    def _worst(self) -> Refinement | None:
        left = [
            item
            for item in _neglected(list(self.refinements), self.choice.model)
            if item.change is not None
        ]
        return max(left, key=lambda item: item.estimate, default=None)


def decide(
    design: Design,
    make: Callable[[LinearSystem], QuantityOfInterest],
    tolerance: float = TOLERANCE,
    top: str = MOST_COMPLETE.name,
    *,
    highest: float | None = None,
) -> Decision:
    """Choose the cheapest model in which a quantity is accurate to a relative tolerance.

    Where a design lacks the cross-section or material of its wires, their bending and mass are
    unknown, and are neglected.

    Parameters
    ----------
    make
        From the simplest linear system to the quantity of interest.
    top
        The most complete model allowed; physics that it omits is neglected, however large.
    highest
        The highest frequency of a response, Hz. Where a bound at this frequency requires the most
        complete model, only that is built.
    """
    base, limit = registry.choose(design), registry.by_name(top)
    build = _Builder(design)
    bound = 0.0
    if not (highest is None or limit.omits or explain_unsuitable(design, massive=True)):
        bound = build.wires().effect_on_response(highest).error
        if bound > MARGIN * tolerance:
            why = f"{MASS} may change the result by up to {percent(bound)}"
            if not np.isfinite(bound):
                why = f"{MASS}: frequencies lie near or above the first violin mode"
            model = build(limit)
            why = ZERO if make(model).zeros(model).all() else why
            return Decision(Choice(limit.name, why, 0.0), model, ())
    quantity, estimate, found = _estimator(build, build(base.model), make)
    refinements = _blade_tip_refinement(
        design, base.model, quantity, build, _remaining_tolerance([], tolerance)
    )
    for name in (BENDING, MASS):
        room = _remaining_tolerance(refinements, tolerance)
        if name == MASS and 0 < bound <= room:
            refinements.append(Refinement(MASS, bound, "", None, taken=False))
            continue
        left = estimate(name)
        if name == MASS and refinements[-1].taken and refinements[-1].indicator > CHANGED:
            left = replace(left, indicator=OTHER * left.indicator)
        if name == MASS and not np.isnan(left.indicator):
            left = replace(left, indicator=quantity.mass_bound(build.wires) or left.indicator)
        refinements.append(
            _include_if_large(left, quantity, build, room)
            if name not in limit.omits
            else _compute_if_large(left, quantity, build, tolerance)
        )
    refinements = [replace(item, words=_words(item, found, build)) for item in refinements]
    model = _chosen(refinements) or base.model
    why = base.reason if model is base.model else _clauses(refinements, quantity)
    why = ZERO if not model.omits and quantity.zeros(build(model)).all() else why
    error = _error(refinements, model)
    met = NOT_MET if error > tolerance else ""
    why += _remainder(model, refinements, f" (tolerance {100 * tolerance:g} %{met})")
    return Decision(Choice(model.name, why, error), build(model), tuple(refinements))


def estimate_error(
    design: Design,
    choice: Choice,
    make: Callable[[LinearSystem], QuantityOfInterest],
    tolerance: float = TOLERANCE,
) -> Decision:
    """Estimate the error of a model that was chosen for another reason.

    Fills in the `choice`'s error and, in its reason, the neglected physics. `make` leads from the
    model's linear system to the quantity of interest. Estimates above the relative `tolerance` are
    replaced by the computed change.
    """
    build, model = _Builder(design), choice.model
    if not model.omits:
        return Decision(replace(choice, error=0.0), build(model), ())
    quantity, estimate, found = _estimator(build, build(model), make)
    refinements = [
        replace(item, taken=False)
        for item in _blade_tip_refinement(design, model, quantity, build, 0.0)
    ]
    refinements += [
        _compute_if_large(estimate(name), quantity, build, tolerance)
        for name in (BENDING, MASS)
        if name in model.omits
    ]
    refinements = [replace(item, words=_words(item, found, build)) for item in refinements]
    return Decision(
        replace(
            choice,
            reason=choice.reason + _remainder(model, refinements, ""),
            error=_error(refinements, model),
        ),
        build(model),
        tuple(refinements),
    )


def decide_for_thermal_noise(
    design: Design, wanted: str, highest: float, tolerance: float = TOLERANCE
) -> Decision:
    """Choose the model as `for_thermal_noise` does, and build its system."""
    build = _Builder(design)
    choice = _choose_for_noise(build, wanted, highest, tolerance)
    return Decision(choice, build(choice.model), ())


def for_thermal_noise(
    design: Design, wanted: str, highest: float, tolerance: float = TOLERANCE
) -> Choice:
    """Choose the model for thermal noise, which must know where along a wire its loss acts.

    `wanted` is one of `registry.LEVELS`, `highest` the highest frequency of interest, Hz. ``auto``
    may leave a relative error `tolerance`, away from resonances. Raises `InputError` if the
    requested model does not resolve wires, or the design lacks their properties.
    """
    return _choose_for_noise(_Builder(design), wanted, highest, tolerance)


def _choose_for_noise(build: _Builder, wanted: str, highest: float, tolerance: float) -> Choice:
    design = build.design
    light, heavy = (registry.cheapest_with(name) for name in (BENDING, MASS))
    if wanted not in (AUTO, light.name, heavy.name):
        problem = f"the {wanted} model does not know where along a wire its loss acts"
        remedy = f"take {AUTO}, {light.name} or {heavy.name}"
        raise InputError([Fault("--fidelity", problem, remedy, format_value(wanted))])
    _require_valid(light, design, "give its material and radius or section, for its loss")
    if wanted == light.name and heavy.unsuitable(design):
        return Choice(light.name, f"as requested; neglected: {MASS}, of unknown effect")
    _require_valid(heavy, design, f"give its material's density, or take --fidelity {light.name}")
    if wanted == heavy.name:
        return Choice(heavy.name, "as requested", 0.0)
    effect = build.wires().effect_on_noise(highest)
    if not effect.wire:
        return Choice(light.name, "no wire has a violin mode", 0.0)
    size = percent(effect.error) if np.isfinite(effect.error) else "without bound"
    if wanted == light.name:
        return Choice(
            light.name, f"as requested; neglected: {MASS}, {size}: {effect.where}", effect.error
        )
    if effect.error > tolerance:
        return Choice(heavy.name, f"{MASS} matters: {effect.where}", 0.0)
    return Choice(
        light.name,
        f"losses along wires matter; neglected: {MASS}, {size}: {effect.where} (tolerance"
        f" {100 * tolerance:g} %)",
        effect.error,
    )


def _require_valid(model: Model, design: Design, remedy: str) -> None:
    why = model.unsuitable(design)
    if why:
        raise InputError([Fault("stage", why, remedy)])


def _estimator(
    build: _Builder, system: LinearSystem, make: Callable[[LinearSystem], QuantityOfInterest]
) -> tuple[QuantityOfInterest, Callable[[str], Refinement], Modes]:
    """The quantity of interest, the estimate of a (neglected) refinement by name, and the modes."""
    quantity, found = make(system), eigenmodes.solve(system.constant)
    of, zero = Estimates(build.design, found, build.hanging), quantity.zeros(system)

    def estimate(name: str) -> Refinement:
        change = quantity.estimate(name, found, of)
        if zero.any() and name == BENDING and not np.isnan(change).any():
            refined = build(registry.cheapest_with(name))
            if (zero & ~quantity.zeros(refined)).any():
                return Refinement(name, np.inf, "", None, taken=False, words=NONZERO)
        if name == BENDING and system.orientation is not None:
            change = AWAY * change
        stage = of.stage[int(np.argmax(change))] if of.stage else ""
        return Refinement(name, float(change.sum()), stage, None, taken=False)

    return quantity, estimate, found


def _blade_tip_refinement(
    design: Design, model: Model, quantity: QuantityOfInterest, build: _Builder, room: float
) -> list[Refinement]:
    """Blade tips as coordinates, where a model approximates blades as in series with wires."""
    stages = model.approximated_stages(design)
    if not stages:
        return []
    change, what = quantity.change(build(model), build(registry.cheapest_with(BLADE_TIPS)))
    return [Refinement(BLADE_TIPS, 1.0, stages[0], change, not change <= room, what)]


def _include_if_large(
    left: Refinement,
    quantity: QuantityOfInterest,
    build: _Builder,
    room: float,
) -> Refinement:
    """Include a refinement if it changes more than the `room` that is left of the tolerance."""
    if np.isnan(left.indicator) or left.indicator <= room:
        return left
    if left.name not in quantity.computed:
        return replace(left, taken=True)
    seen = _with_computed_change(left, quantity, build)
    return replace(seen, taken=not seen.estimate <= room)


def _compute_if_large(
    left: Refinement, quantity: QuantityOfInterest, build: _Builder, tolerance: float
) -> Refinement:
    """Compute the change by a neglected refinement where it matters, as estimates are coarse."""
    return _with_computed_change(left, quantity, build) if left.indicator > tolerance else left


def _with_computed_change(
    left: Refinement, quantity: QuantityOfInterest, build: _Builder
) -> Refinement:
    """Compute the change by a refinement, without the other refinements."""
    refined = registry.cheapest_with(left.name)
    change, what = quantity.change(build(registry.before(refined)), build(refined))
    return replace(left, change=change, what=what)


def _remaining_tolerance(refinements: list[Refinement], tolerance: float) -> float:
    """The part of the tolerance that is left for neglecting the next refinement."""
    model = _chosen(refinements)
    left = refinements if model is None else _neglected(refinements, model)
    return MARGIN * tolerance - float(np.nansum([item.estimate for item in left]))


def _chosen(refinements: list[Refinement]) -> Model | None:
    """The cheapest model with all refinements that are taken; None if none is."""
    return next(
        (registry.cheapest_with(item.name) for item in reversed(refinements) if item.taken), None
    )


def _neglected(refinements: list[Refinement], model: Model) -> list[Refinement]:
    """Refinements that a model omits."""
    return [item for item in refinements if item.name in model.omits]


def _error(refinements: list[Refinement], model: Model) -> float:
    """Sum of the changes by all neglected refinements."""
    return float(sum(item.estimate for item in _neglected(refinements, model)))


class _Builder:
    """Expands a design once, and builds the linear system of each model once."""

    def __init__(self, design: Design) -> None:
        self.design = design
        self._built: dict[str, LinearSystem] = {}
        self.wires = cache(lambda: wire_mass.massive_wires(self.hanging))

    @cached_property
    def scene(self) -> Scene:
        return wire_mass.expand_with_fibres(self.design)

    @cached_property
    def hanging(self) -> Scene:
        return wire_mass.as_hanging(self.scene)

    def __call__(self, model: Model) -> LinearSystem:
        if model.name not in self._built:
            self._built[model.name] = model.refined(self.design, self._built, self.scene)
        return self._built[model.name]


def _words(item: Refinement, found: Modes, build: _Builder) -> str:
    """Words in place of an infinite change, given the simplest model's modes; "" if finite."""
    if item.words and item.change is None:
        return item.words
    if (
        item.name == BENDING
        and item.taken
        and not found.stable
        and eigenmodes.solve(build(registry.cheapest_with(BENDING)).constant).stable
    ):
        return unrestrained_mode(found, unstable=True)
    if not np.isinf(item.estimate):
        return ""
    if item.name == MASS:
        return "frequencies lie near or above the first violin mode"
    return unrestrained_mode(found, unstable=item.change is not None) or NONZERO


def unrestrained_mode(found: Modes, *, unstable: bool) -> str:
    """Name the mode that straight wires leave `unstable`, or else free; "" if there is none."""
    sign = -1 if unstable else 0
    names = [
        label
        for label, value in zip(found.label, found.omega_squared, strict=True)
        if np.sign(value) == sign
    ]
    if not names:
        return ""
    return (
        f"straight wires leave {names[0]} unstable, bending stabilizes it"
        if unstable
        else f"straight wires leave {names[0]} free, bending restrains it"
    )


def _clauses(refinements: list[Refinement], quantity: QuantityOfInterest) -> str:
    """Why each included refinement is needed."""
    clauses: list[str] = []
    verb = f" {quantity.effect}"
    for item in refinements:
        if item.taken and item.words:
            clauses.append(f"{item.name}: {item.words}")
        elif item.taken:
            size = "an estimated" if item.change is None else "up to"
            size += f" {percent(item.estimate)}"
            clauses.append(f"{item.name}{verb} by {size}, stage {item.stage}")
            verb = ""
    return ", and ".join(clauses)


def _remainder(model: Model, refinements: list[Refinement], limit: str) -> str:
    """Neglected and unknown physics, for the end of a reason; "" if there is none."""
    left = _neglected(refinements, model)
    small = [
        f"{item.name} ({item.words})"
        if item.words
        else f"{item.name}, {'estimated ' * (item.change is None)}{percent(item.estimate)}"
        for item in left
        if not np.isnan(item.indicator)
    ]
    unknown = [item.name for item in left if np.isnan(item.indicator)]
    text = f"; neglected: {', and '.join(small)}{limit}" if small else ""
    if unknown:
        text += f"; unknown: {' and '.join(unknown)}, as wires lack a material or a cross-section"
    return text
