"""The model of an analysis: the choice, what it neglects, and its linear system."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from suspension_cli.errors import InputError, format_value
from suspension_cli.linear import eigenmodes
from suspension_cli.linear.solver import Solvable, Solver
from suspension_cli.models import registry
from suspension_cli.models.choice import TOLERANCE, Frequencies, Systems
from suspension_cli.models.choice import choose as choose_model
from suspension_cli.physics import growth, near_limits

if TYPE_CHECKING:
    from suspension_cli.design.reader import Source
    from suspension_cli.design.schema import Design
    from suspension_cli.linear.system import LinearSystem
    from suspension_cli.models.base import Model
    from suspension_cli.models.choice import Comparison, Results
    from suspension_cli.models.registry import Choice
    from suspension_cli.physics.log import Log

    Request = Callable[[LinearSystem], Results]
    """The results of interest, given any model of the design."""

WARNED_ERROR = 0.01
"""Relative error of a model that the user did not choose, from which there is a warning."""


def choose(
    source: Source,
    wanted: str,
    request: Request,
    *,
    candidates: Sequence[Model] | None = None,
    tolerance: float = TOLERANCE,
) -> tuple[Choice, LinearSystem]:
    """Choose the model of one design, and build its linear system.

    `wanted` is ``"auto"`` or the name of a model, `candidates` are the models that ``"auto"`` may
    take, by default the most complete one alone. Raises `InputError` if the wanted model is not
    valid for the design.
    """
    systems = Systems.of(source.design)
    candidates = candidates or (registry.most_complete(source.design),)
    found = choose_model(source.design, wanted, candidates, systems.compare(request), tolerance)
    return found, systems(found.model)


def for_modes(
    source: Source, wanted: str, tolerance: float, *, massless: bool = False
) -> tuple[Choice, LinearSystem]:
    """Choose the model of the bodies' modes: without wire mass, if that is accurate enough.

    If `massless`, the model has matrices with a state space of finite order. Then raises
    `InputError` if a model with wire mass is wanted.
    """
    if massless and wanted != registry.AUTO and registry.by_name(wanted).has_wire_mass:
        problem = "has no state space of finite order, as its wires have mass"
        remedy = "take beam, which is valid below the first violin mode"
        raise InputError.of("--fidelity", problem, remedy, format_value(wanted))
    candidates = with_and_without_wire_mass(source)[: 1 if massless else None]
    return choose(
        source, wanted, lambda _: Frequencies(), candidates=candidates, tolerance=tolerance
    )


def with_and_without_wire_mass(source: Source) -> list[Model]:
    """The most complete models of a design without and, if it tells their mass, with wire mass."""
    light = registry.most_complete(source.design, massless=True)
    return list(dict.fromkeys([light, registry.most_complete(source.design)]))


def demand_one_of(wanted: str, models: Sequence[Model], problem: str) -> None:
    """Raise `InputError` with a problem of the wanted model unless ``auto`` or of `models`."""
    names = [registry.AUTO, *(model.name for model in models)]
    if wanted not in names:
        remedy = f"take {', '.join(names[:-1])} or {names[-1]}"
        raise InputError.of("--fidelity", problem, remedy, format_value(wanted))


def for_builds(
    source: Source,
    wanted: str,
    models: Sequence[Model],
    change: Comparison,
    tolerance: float = TOLERANCE,
) -> Choice:
    """Choose the model of many builds, of the `models` that the analysis can use.

    Raises `InputError` if the wanted model is not among these, or is not valid for the design.
    """
    demand_one_of(wanted, models, "cannot compute these results of imperfect builds")
    return choose_model(source.design, wanted, models, change, tolerance)


def describe_equilibrium(source: Source, choice: Choice, system: LinearSystem, log: Log) -> None:
    """Report the model and how well the equilibrium is balanced, for --verbose."""
    balance = f"residual force {system.residual:.0e} of the weight"
    size = f"{system.size - 6} coordinates"
    log.detail(f"{source.name}: {choice.line}; {size}, {balance}")


def stable_system(
    source: Source,
    choice: Choice,
    allow_unstable: bool,
    log: Log,
    system: Solvable | None = None,
    *,
    bends: bool = False,
) -> LinearSystem:
    """Linear system of a model (or of `system`, if known), with warnings of designs near a limit.

    Raises `InputError` if the motion grows, or warns if that is allowed. The message proposes wires
    that bend, if the analysis can use these (`bends`).
    """
    name = source.design.design.name
    solver = Solver.of(choice.model.system(source.design) if system is None else system)
    describe_equilibrium(source, choice, solver.system, log)
    grows = growth.find_growth(source.design, choice.model, solver)
    if grows is not None:
        fault = grows.fault
        if not allow_unstable:
            way = fault.remedy
            bent = grows.static and bends and not choice.model.bends_wires
            if bent and _stable_with_bending(source.design):
                way = "take --fidelity beam, whose wires stabilize it by bending"
            way += ", or give --allow-unstable"
            raise InputError([dataclasses.replace(fault, remedy=way)])
        log.warn(f"{name} is unstable: {grows.worst}; {fault.remedy}")
    is_far = near_limits.is_far_from_tipping(source.design, solver.system)
    near_limits.warn(source.design, None if is_far else solver.constant.modes, log)
    return solver.system


def _stable_with_bending(design: Design) -> bool:
    """Whether wires that bend make the equilibrium stable."""
    if registry.BEAM.unsuitable(design):
        return False
    try:
        return eigenmodes.solve(registry.BEAM.system(design)).stable
    except InputError:  # it does not balance
        return False


def warn_of_neglected(source: Source, choice: Choice, log: Log, models: Sequence[Model]) -> None:
    """Warn of the error of a model that the user did not choose.

    `models` are those that the analysis can use instead.
    """
    if not choice.error > WARNED_ERROR:
        return
    size = f"{100 * choice.error:.2g} %" if choice.error < 1 else "100 % or more"
    better = [model.name for model in models if choice.physics not in model.omits]
    remedy = (
        f"rerun with --fidelity {better[0]}" if better else "modes, response and thermal include it"
    )
    log.warn(
        f"{source.design.design.name}: the {choice.level} model neglects {choice.physics}, which"
        f" changes {choice.what} by {size}; {remedy}"
    )
