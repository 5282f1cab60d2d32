"""Models that the goals need: one for all modes, one for each response."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from suspension_cli.analyses import model_choice
from suspension_cli.analyses.optimise.quantities import (
    OfResponse,
    Quantity,
    with_imperfections,
)
from suspension_cli.design.schema import Design
from suspension_cli.models import auto, registry
from suspension_cli.models.quantity_of_interest import Frequencies, Transfer
from suspension_cli.models.registry import Choice


@dataclass(frozen=True)
class Models:
    """Models of all modes, and of each response."""

    modes: Choice
    responses: dict[OfResponse, Choice] = field(default_factory=dict)

    def of(self, item: Quantity) -> str:
        """Name of the model of a quantity (not of stresses and heights: straight wires)."""
        if isinstance(item, OfResponse):
            return self.responses[item].level
        return self.modes.level

    @property
    def levels(self) -> list[str]:
        """Names of all models, that of the modes first."""
        return [choice.level for choice in (self.modes, *self.responses.values())]


def choose(
    design: Design,
    quantities: tuple[Quantity, ...],
    level: str,
    tolerance: float,
    least: Models | None = None,
) -> Models:
    """Choose the cheapest models that are accurate enough at a design.

    Parameters
    ----------
    design : Design
    quantities : tuple of Quantity
    level : str
        Name of a model for all, or ``auto``.
    tolerance : float
        Relative error that ``auto`` may leave.
    least : Models, optional
        Cheapest models to take, as other designs need them.

    Raises
    ------
    InputError
        If the requested model is not valid, or has no equilibrium.
    """
    modes = _choose(design, lambda _: Frequencies(), level, tolerance, least and least.modes)
    responses = {}
    for item in quantities:
        if isinstance(item, OfResponse):
            ratio = item.ratio
            outputs = [ratio.over] + ([] if ratio.under is None else [ratio.under])
            wanted = Transfer([ratio.input], outputs, np.array([ratio.frequency]))
            responses[item] = _choose(
                with_imperfections(design, item.perturbation),
                lambda _, wanted=wanted: wanted,
                level,
                tolerance,
                least and least.responses.get(item),
            )
    return Models(modes, responses)


def _choose(
    design: Design,
    request: model_choice.Request,
    level: str,
    tolerance: float,
    least: Choice | None,
) -> Choice:
    found = model_choice.with_derivatives(
        level, design, request, tolerance, registry.SCENE_MODELS
    ).choice
    if level != registry.AUTO or least is None or found.model.cost >= least.model.cost:
        return found
    choice = replace(least, reason="other designs of the search need it")
    return auto.estimate_error(design, choice, request, tolerance).choice
