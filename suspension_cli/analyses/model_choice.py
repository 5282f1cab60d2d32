"""The model of an analysis: the choice, what it neglects, and its linear system."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from suspension_cli.analyses.options import TOLERANCE

if TYPE_CHECKING:
    from suspension_cli.analyses.analysis import Log
    from suspension_cli.design.reader import Source
    from suspension_cli.design.schema import Design
    from suspension_cli.linear.system import LinearSystem
    from suspension_cli.models.auto import Decision
    from suspension_cli.models.base import Model
    from suspension_cli.models.quantity_of_interest import QuantityOfInterest, Several
    from suspension_cli.models.registry import Choice

    Request = Callable[[LinearSystem], QuantityOfInterest]
    """The quantity of interest, given any model of the design."""
    Change = Callable[[Model, Model], tuple[float, str]]
    """The largest relative change of results from a model to a more complete one, and where it is;
    if it is infinite or (NaN) unknown, why."""

WARNED_ERROR = 0.01
"""Relative error of a model that the user did not choose, from which there is a warning."""


def choose(
    source: Source,
    wanted: str,
    request: Request | None = None,
    tolerance: float = TOLERANCE,
    top: Model | None = None,
    highest: float | None = None,
) -> Decision:
    """Choose the cheapest model that is accurate enough, or take the `wanted` one.

    Parameters
    ----------
    wanted
        ``"auto"`` or the name of a model.
    request
        The quantity of interest; by default the frequencies of the modes.
    tolerance
        Relative error that ``"auto"`` may leave.
    top
        The most complete model that the analysis can use; by default any.
    highest
        The highest frequency of a response, Hz, see `auto.decide`.

    Raises `InputError` if the wanted model is not valid for the design.
    """
    from suspension_cli.models import auto, registry
    from suspension_cli.models.quantity_of_interest import Frequencies

    request = request or (lambda _: Frequencies())
    if wanted == registry.AUTO:
        limit = registry.MOST_COMPLETE if top is None else top
        return auto.decide(source.design, request, tolerance, limit.name, highest=highest)
    return auto.estimate_error(
        source.design, registry.choose(source.design, wanted), request, tolerance
    )


def without_wire_mass(source: Source, wanted: str, tolerance: float) -> Decision:
    """Choose a model whose matrices have a state space of finite order.

    Raises `InputError` if a model with wire mass is wanted.
    """
    from suspension_cli.errors import Fault, InputError, format_value
    from suspension_cli.models import registry

    if wanted != registry.AUTO and registry.by_name(wanted).has_wire_mass:
        problem = "has no state space of finite order, as its wires have mass"
        remedy = "take beam, which is valid below the first violin mode"
        raise InputError([Fault("--fidelity", problem, remedy, format_value(wanted))])
    return choose(source, wanted, tolerance=tolerance, top=registry.BEAM)


def for_builds(
    source: Source,
    wanted: str,
    models: Sequence[Model],
    change: Change,
    tolerance: float = TOLERANCE,
) -> Choice:
    """Choose the cheapest model whose error in the results of many builds is below a tolerance.

    Each suitable model is compared with the next more complete one at some of the builds, by
    `change`: the largest relative change of the results from one model to another. The error of a
    model is the sum of all changes from it to the most complete one. Models simpler than one that
    is too inaccurate are not tried.

    `models` are those that the analysis can use, from the cheapest to the most complete. If none
    meets the tolerance of ``"auto"``, the most complete one is taken. Raises `InputError` if the
    wanted model is not among `models`, or is not valid for the design.
    """
    from suspension_cli.models import registry
    from suspension_cli.models.auto import MARGIN, NOT_MET

    design = source.design
    if wanted == registry.AUTO:
        usable = [one for one in models if one.automatic and not one.unsuitable(design)]
    else:
        demand_one_of(wanted, models, "cannot compute these results of imperfect builds")
        usable = [registry.choose(design, wanted).model]
    later = registry.MODELS[registry.MODELS.index(usable[0]) + 1 :]
    chain = [usable[0], *(one for one in later if one.automatic and not one.unsuitable(design))]
    limit = MARGIN * tolerance
    # from the most complete model down: one that is too inaccurate rules out all simpler ones
    first, steps, errors = len(chain) - 1, [], [0.0]
    while first and (wanted != registry.AUTO or first >= len(usable) - 1 or errors[0] <= limit):
        first -= 1
        steps.insert(0, _Step.between(chain[first], chain[first + 1], change))
        errors.insert(0, sum(step.change for step in steps))
    number = next(
        (n for n in range(first, len(usable)) if errors[n - first] <= limit), len(usable) - 1
    )
    model, before, left = chain[number], steps[: number - first], steps[number - first :]
    unknown = _unknown_physics(chain[-1], design)
    for one in left:
        if math.isnan(one.change):
            unknown.insert(0, f"unknown: {one.physics}, as {one.what}")
    left = [one for one in left if not math.isnan(one.change)]
    error = math.nan if unknown else float(errors[number - first])
    if wanted != registry.AUTO:
        reason, end = registry.choose(design, wanted).reason, ""
    else:
        met = NOT_MET if errors[number - first] > tolerance else ""
        reason, end = model.valid_for, f" (tolerance {100 * tolerance:g} %{met})"
        if number:
            reason = _why([one for one in before if not one.change <= limit] or before)
    parts = [f"neglected: {', and '.join(one.size for one in left)}{end}"] if left else []
    return registry.Choice(model.name, "; ".join([reason, *parts, *unknown]), error)


@dataclasses.dataclass(frozen=True)
class _Step:
    """From one model to the next more complete one: added physics and change of the results."""

    physics: str
    change: float
    what: str

    @classmethod
    def between(cls, simple: Model, refined: Model, change: Change) -> _Step:
        """Compute the step between two models."""
        from suspension_cli.errors import InputError
        from suspension_cli.models import registry

        try:
            found, what = change(simple, refined)
        except InputError:
            found, what = math.inf, f"the {refined.name} model has no equilibrium"
        physics = registry.adds(refined, simple) or f"approximations of the {simple.name} model"
        return cls(physics, found, what)

    @property
    def size(self) -> str:
        """The physics with the size of its effect."""
        from suspension_cli.models.wire_mass import percent

        known = math.isfinite(self.change)
        return self.physics + (f", {percent(self.change)}" if known else f" ({self.what})")


def _why(steps: list[_Step]) -> str:
    """Why the model after these steps is needed."""
    from suspension_cli.models.wire_mass import percent

    clauses, before = [], ""
    for step in steps:
        if not math.isfinite(step.change):
            clauses.append(f"{step.physics}: {step.what}")
        else:
            verb = "" if step.what == before else f" changes {step.what}"
            clauses.append(f"{step.physics}{verb} by up to {percent(step.change)}")
            before = step.what
    return ", and ".join(clauses)


def _unknown_physics(highest: Model, design: Design) -> list[str]:
    """Physics that no model valid for a design has, and why; empty if one has it all."""
    if not highest.omits:
        return []
    from suspension_cli.models import registry

    why = next(
        found
        for one in registry.MODELS[registry.MODELS.index(highest) + 1 :]
        if (found := one.unsuitable(design))
    )
    return [f"unknown: {' and '.join(highest.omits)}, as {why}"]


def demand_one_of(wanted: str, models: Sequence[Model], problem: str) -> None:
    """Raise `InputError` with a problem of the wanted model if it is not one of these."""
    from suspension_cli.errors import Fault, InputError, format_value
    from suspension_cli.models import registry

    names = [model.name for model in models]
    if wanted not in names:
        remedy = f"take {', '.join((registry.AUTO, *names[:-1]))} or {names[-1]}"
        raise InputError([Fault("--fidelity", problem, remedy, format_value(wanted))])


def with_derivatives(
    wanted: str, design: Design, request: Request, tolerance: float, models: Sequence[Model]
) -> Decision:
    """Choose the cheapest model with derivatives that is accurate enough, or the `wanted` one.

    Arguments as of `choose`; `models` are those whose derivatives the analysis can use, from the
    cheapest to the most complete. Raises `InputError` if the wanted model is not among these, or is
    not valid for the design.
    """
    from suspension_cli.models import auto, registry

    if wanted != registry.AUTO:
        demand_one_of(wanted, models, "cannot compute derivatives")
        return auto.estimate_error(design, registry.choose(design, wanted), request, tolerance)
    decision = auto.decide(design, request, tolerance, models[-1].name)
    if decision.choice.model in models:
        return decision
    # what cheaper models cannot neglect, the first with derivatives includes
    choice = registry.Choice(models[0].name, "the cheapest model with derivatives")
    return auto.estimate_error(design, choice, request, tolerance)


def named_results(
    texts: list[str] | tuple[str, ...],
) -> Callable[[LinearSystem], Several]:
    """The results of these names as quantity of interest; all modes if there are none."""
    from suspension_cli.linear import eigenmodes, named_results, signals
    from suspension_cli.models.quantity_of_interest import Several

    def request(system: LinearSystem) -> Several:
        found = eigenmodes.solve(system.constant)
        names = list(texts) or [named_results.ALL]
        return Several(
            named_results.parse(names, found, signals.bodies_with_signals(system)), found
        )

    return request


def stable_system(
    source: Source,
    choice: Choice,
    allow_unstable: bool,
    log: Log,
    system: LinearSystem | None = None,
    *,
    bends: bool = False,
) -> LinearSystem:
    """Linear system of a model (or `system`, if known), with warnings of designs near a limit.

    Raises `InputError` if the motion grows, or warns if that is allowed. The message proposes wires
    that bend, if the analysis can use these (`bends`).
    """
    from suspension_cli.analyses import growth
    from suspension_cli.analyses.check import warnings as near_limits
    from suspension_cli.errors import InputError
    from suspension_cli.linear import eigenmodes

    name = source.design.design.name
    system = choice.model.system(source.design) if system is None else system
    log.detail(f"{name}: {choice.line}; residual force {system.residual:.0e} of the weight")
    grows = growth.find_growth(source.design, choice.model, system)
    if grows is not None:
        fault = grows.fault
        if not allow_unstable:
            way = fault.remedy
            bent = grows.static and bends and not choice.model.bends_wires
            if bent and _stable_with_bending(source.design):
                way = "take --fidelity beam, whose wires stabilize it by bending"
            raise InputError(
                [dataclasses.replace(fault, remedy=f"{way}, or give --allow-unstable")]
            )
        log.warn(f"{name} is unstable: {grows.worst}; {fault.remedy}")
    near_limits.warn(source.design, system, eigenmodes.solve(system.constant), log)
    return system


def _stable_with_bending(design: Design) -> bool:
    """Whether wires that bend make the equilibrium stable."""
    from suspension_cli.errors import InputError
    from suspension_cli.linear import eigenmodes
    from suspension_cli.models import registry

    if registry.BEAM.unsuitable(design):
        return False
    try:
        return eigenmodes.solve(registry.BEAM.system(design)).stable
    except InputError:  # it does not balance
        return False


def warn_of_neglected(
    source: Source, decision: Decision, log: Log, models: tuple[Model, ...] = ()
) -> None:
    """Warn of the error of a model that the user did not choose.

    `models` are those that the analysis can use instead.
    """
    choice = decision.choice
    if not choice.error > WARNED_ERROR:
        return
    size = f"{100 * choice.error:.2g} %" if choice.error < 1 else "100 % or more"
    better = decision.needed in [model.name for model in models]
    remedy = (
        f"rerun with --fidelity {decision.needed}"
        if better
        else "modes, response and thermal include it"
    )
    log.warn(
        f"{source.design.design.name}: the {choice.level} model neglects {decision.physics}, which"
        f" changes {decision.missed} by {size}; {remedy}"
    )
