"""Change of couplings from one model to another, computed for some builds of a sweep."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.xcouple.solve import Sweep, couplings, impose
from suspension_cli.models import registry
from suspension_cli.models.base import Model
from suspension_cli.models.wire_mass import expand_with_fibres
from suspension_cli.scene.scene import Scene
from suspension_cli.studies import builds
from suspension_cli.studies.axes import ends_and_middle, ends_and_middle_points
from suspension_cli.studies.builds import Builds
from suspension_cli.studies.relative_change import relative_change

if TYPE_CHECKING:
    from jaxtyping import Complex

FREQUENCIES = 12
"""Number of frequencies at which models are compared."""
FEW = 512
"""Largest number of builds that are all balanced to compare models at some of them, where bending
is likely to matter: they are then known for the result."""
STIFF = 2.0
"""Relative stiffness of bending (`_bending`), over the tolerance, from which that is likely."""
ONE_MODEL_ONLY = "some builds have an equilibrium in only one of the models"
NO_BUILD = "no build at the corners and middles has an equilibrium"
WHAT = "couplings"


def coupling_change(job: Sweep, tolerance: float) -> Callable[[Model, Model], tuple[float, str]]:
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
    points = ends_and_middle_points(job.axes)

    @cache
    def scene() -> Scene:
        return expand_with_fibres(job.design)

    @cache
    def balance_all() -> bool:
        return job.count <= FEW and _bending(scene()) > STIFF * tolerance

    @cache
    def balanced(model: Model) -> Builds:
        """Builds in equilibrium: all, or the sample."""
        simpler = registry.scene_model(model.name).same_equilibrium(job.design)
        if simpler is not None:
            found = builds.with_wire_mass(balanced(simpler))
        else:
            some = job if model.bends_wires and balance_all() else sample
            found = builds.balance(
                impose(scene(), some.values(0, some.count), question),
                job.design,
                level=model.name,
                allow_unstable=job.allow_unstable,
            )
        if len(found.status) == job.count:
            job.balanced[model.name] = found
        return found

    @cache
    def ratio(model: Model) -> Complex[np.ndarray, "build frequency"]:
        if not job.has_one_design:
            return replace(sample, level=model.name).compute(0, sample.count)["ratio"]
        found = balanced(model)
        if len(found.status) == sample.count:
            return couplings(found, question)["ratio"]
        return couplings(builds.restricted(found, points), question)["ratio"][points]

    def change(simple: Model, refined: Model) -> tuple[float, str]:
        old, new = ratio(simple), ratio(refined)
        if (np.isfinite(old) != np.isfinite(new)).any():
            return float("inf"), ONE_MODEL_ONLY
        found = relative_change(old, new)
        return found, NO_BUILD if np.isnan(found) else WHAT

    return change


def _bending(scene: Scene) -> float:
    """Largest stiffness of a wire's bending, relative to that of its tension.

    For a clamp sqrt(T EI) / T l; between effective bending points EI / l remains of it.
    """
    wires, made = scene.wires, scene.fibres
    assert made is not None
    rigidity = np.array([max(max(one.rigidity) for one in fibre.sections) for fibre in made.wire])
    clamp = np.sqrt(rigidity / np.maximum(wires.tension, 1e-300)) / wires.length
    effective = np.array([fibre.effective for fibre in made.wire], dtype=bool)
    return float(np.where(effective, clamp**2, clamp).max(initial=0.0))
