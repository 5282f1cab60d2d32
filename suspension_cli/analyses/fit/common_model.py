"""One model for all designs of a fit, and its error in their measured modes."""

from __future__ import annotations

import math
from collections.abc import Sequence

from suspension_cli.analyses import model_choice
from suspension_cli.design.measured import Measured
from suspension_cli.design.reader import Source
from suspension_cli.errors import attribute_faults_to
from suspension_cli.linear import eigenmodes, named_results
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import registry
from suspension_cli.models.choice import Several
from suspension_cli.models.registry import Choice


def choose(wanted: str, sources: Sequence[Source], measured: Measured) -> list[Choice]:
    """Choose the most complete model without wire mass that is valid for every design of a fit.

    Raises `InputError` if a model is wanted that cannot model imperfect builds, or has wire mass.
    """
    models = [model for model in registry.SCENE_MODELS if not model.has_wire_mass]
    model_choice.demand_one_of(wanted, models, "cannot compute derivatives")
    each = [registry.most_complete(source.design, massless=True) for source in sources]
    common = min(each, key=registry.MODELS.index)
    found = []
    for source, modes in zip(sources, measured.modes, strict=True):
        with attribute_faults_to(source.file):
            labels = {mode.label for mode in modes}
            choice, _ = model_choice.choose(
                source,
                wanted,
                lambda system, labels=labels: _request(system, labels),
                candidates=[common],
            )
            found.append(choice)
    return found


def worst(choices: Sequence[Choice]) -> Choice:
    """Choice with the largest error."""
    return max(choices, key=lambda choice: -1.0 if math.isnan(choice.error) else choice.error)


def _request(system: LinearSystem, labels: set[str | None]) -> Several:
    """Request the modes of these labels, or all if a mode has no label."""
    found = eigenmodes.solve(system.constant)
    every = tuple(named_results.Mode(name, n) for n, name in enumerate(named_results.labels(found)))
    some = tuple(mode for mode in every if mode.text in labels)
    return Several(every if None in labels or not some else some, found)
