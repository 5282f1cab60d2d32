"""One model for all designs of a fit, by its error in their measured modes."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence

from suspension_cli.analyses import model_choice
from suspension_cli.design.measured import Measured
from suspension_cli.design.reader import Source
from suspension_cli.errors import attribute_faults_to
from suspension_cli.linear import eigenmodes, named_results
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import auto, registry
from suspension_cli.models.auto import Decision
from suspension_cli.models.quantity_of_interest import Differentiated
from suspension_cli.models.registry import Choice


def choose(
    wanted: str, sources: Sequence[Source], measured: Measured, tolerance: float
) -> list[Decision]:
    """Choose the cheapest model that is accurate enough for every design of a fit.

    All designs get the same model. A model that is not valid for one of them is not taken.
    """
    requests = _requests(measured)
    found: list[Decision] = []
    for source, request in zip(sources, requests, strict=True):
        with attribute_faults_to(source.file):
            usable = [model for model in registry.SCENE_MODELS if not model.has_wire_mass]
            found.append(
                model_choice.with_derivatives(wanted, source.design, request, tolerance, usable)
            )
    models = sorted({one.choice.model for one in found}, key=registry.MODELS.index)
    common, reason = models[-1], "as another design of this fit needs it"
    for source in sources:
        why = common.unsuitable(source.design)
        if why:
            name = source.design.design.name
            common, reason = models[0], f"{models[-1].name} is not valid for {name}: {why}"
    return [
        decision
        if decision.choice.model is common
        else auto.estimate_error(source.design, Choice(common.name, reason), request, tolerance)
        for source, decision, request in zip(sources, found, requests, strict=True)
    ]


def keep(
    choices: Sequence[Choice], sources: Sequence[Source], measured: Measured
) -> list[Decision]:
    """Estimate the errors of models chosen before, for new values of the numbers."""
    return [
        auto.estimate_error(
            source.design, Choice(choice.level, choice.reason.partition("; ")[0]), request
        )
        for source, choice, request in zip(sources, choices, _requests(measured), strict=True)
    ]


def worst(decisions: Sequence[Decision]) -> Choice:
    """Choice with the largest error."""
    choices = [decision.choice for decision in decisions]
    return max(choices, key=lambda choice: -1.0 if math.isnan(choice.error) else choice.error)


def _requests(measured: Measured) -> list[Callable[[LinearSystem], Differentiated]]:
    return [_request({mode.label for mode in modes}) for modes in measured.modes]


def _request(labels: set[str | None]) -> Callable[[LinearSystem], Differentiated]:
    """Request the modes of these labels, or all if a mode has no label."""

    def request(system: LinearSystem) -> Differentiated:
        found = eigenmodes.solve(dataclasses.replace(system, terms=()))
        every = tuple(
            named_results.Mode(name, n) for n, name in enumerate(named_results.labels(found))
        )
        some = tuple(mode for mode in every if mode.text in labels)
        return Differentiated(every if None in labels or not some else some, found)

    return request
