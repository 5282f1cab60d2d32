"""Change of couplings from one model to another, computed for some builds of a sweep."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.xcouple.solve import Sweep
from suspension_cli.models.base import Model
from suspension_cli.studies.axes import ends_and_middle
from suspension_cli.studies.relative_change import relative_change

if TYPE_CHECKING:
    from jaxtyping import Complex

FREQUENCIES = 12
"""Number of frequencies at which models are compared."""
ONE_MODEL_ONLY = "some builds have an equilibrium in only one of the models"
NO_BUILD = "no build at the corners and middles has an equilibrium"
WHAT = "couplings"


def coupling_change(job: Sweep) -> Callable[[Model, Model], tuple[float, str]]:
    """The change of a sweep's couplings, as `model_choice.for_builds` takes it.

    Couplings are compared at the corners and middles of the swept space, relative to the largest
    there; the change is infinite where a build has an equilibrium in only one of the models. Only
    their sizes are compared: a sweep at one frequency has no axis along which a shifted resonance
    would show. A resonance that is met only between the compared builds is not seen; the estimate
    then holds at the frequencies compared.
    """
    frequency = job.question.frequency
    count = min(FREQUENCIES, len(frequency))
    some = np.unique(np.linspace(0, len(frequency) - 1, count).astype(int))
    question = replace(job.question, frequency=tuple(frequency[n] for n in some))
    sample = replace(job, axes=ends_and_middle(job.axes), question=question)

    @cache
    def ratio(model: Model) -> Complex[np.ndarray, "build frequency"]:
        return replace(sample, level=model.name).compute(0, sample.count)["ratio"]

    def change(simple: Model, refined: Model) -> tuple[float, str]:
        old, new = ratio(simple), ratio(refined)
        if (np.isfinite(old) != np.isfinite(new)).any():
            return float("inf"), ONE_MODEL_ONLY
        found = relative_change(old, new)
        return found, NO_BUILD if np.isnan(found) else WHAT

    return change
