"""Error of couplings in a model, by the physics that it neglects."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from suspension_cli.analyses.xcouple.solve import Sweep
from suspension_cli.design import reader
from suspension_cli.models import registry, wire_mass
from suspension_cli.models.auto import percent
from suspension_cli.models.registry import SCENE_MODELS, STRING, Choice
from suspension_cli.studies.axes import Axis
from suspension_cli.studies.relative_change import relative_change

PROBED = 3
"""Axes of a sweep at both ends of which models are compared, so 2 to this power of its builds."""
FREQUENCIES = 12
"""Number of frequencies at which models are compared."""
FEW = 500
"""Builds up to which a sweep that may need wire mass has it: the string model saves less time than
it takes to compare both."""
EDGE = 0.8
"""Fraction of the tolerance up to which these comparisons accept the string model."""
NEGLECTED = {
    model.name: registry.adds(model, STRING) for model in SCENE_MODELS if model.bends_wires
}
"""Physics that the string model neglects, by the model that has it."""


def estimate_coupling_error(job: Sweep) -> tuple[str, float]:
    """Estimate the error of a sweep by the physics that its model neglects.

    Parameters
    ----------
    job : Sweep
        In the string or the beam model.

    Returns
    -------
    level : str
        The most complete model that is valid for the design; "" if it is that of the sweep.
    error : float
        Largest change of the coupling by this model, relative to the largest coupling of the builds
        at the ends of the axes. NaN if unknown: there is no such model, a build has an equilibrium
        in only one of the models, or no build has one.
    """
    design = reader.parse(job.text)
    level = next(m.name for m in reversed(SCENE_MODELS) if not m.unsuitable(design))
    if level == job.level:
        return "", float("nan") if registry.by_name(level).omits else 0.0
    axes = tuple(
        Axis(
            axis.name,
            tuple(
                dict.fromkeys((axis.values[0] if n < PROBED else axis.values[-1], axis.values[-1]))
            ),
        )
        for n, axis in enumerate(job.axes)
    )
    frequency = job.question.frequency
    some = tuple(
        frequency[n]
        for n in np.unique(
            np.linspace(0, len(frequency) - 1, min(FREQUENCIES, len(frequency))).astype(int)
        )
    )
    probe = replace(job, axes=axes, question=replace(job.question, frequency=some))
    old, new = (
        np.asarray(one.compute(0, one.count)["ratio"])
        for one in (probe, replace(probe, level=level))
    )
    return level, (
        float("nan") if (np.isfinite(new) != np.isfinite(old)).any() else relative_change(old, new)
    )


def choose_model(job: Sweep, choice: Choice, tolerance: float | None) -> tuple[Sweep, Choice, str]:
    """Choose the string model for a sweep, or a more complete one if the tolerance requires it.

    Parameters
    ----------
    job : Sweep
    choice : Choice
        Of the string model.
    tolerance : float or None
        Relative to the largest coupling; None keeps the string model whatever its error.

    Returns
    -------
    job : Sweep
    choice : Choice
    higher : str
        The model with the physics that the string model neglects; "" if none is valid.
    """
    if tolerance is not None and job.count <= FEW:
        soon = _needs_mass(job, tolerance)
        if soon:
            level = registry.MOST_COMPLETE.name
            return replace(job, level=level), Choice(level, soon, 0.0), level
    higher, error = estimate_coupling_error(job)
    more = NEGLECTED.get(higher, "")
    if higher and tolerance is not None and error > EDGE * tolerance:
        verb = "change" if " and " in more else "changes"
        reason = (
            f"{more} {verb} couplings by up to {percent(error)} of the largest; tolerance"
            f" {100 * tolerance:g} %"
        )
        exact = not registry.by_name(higher).omits
        return (
            replace(job, level=higher),
            Choice(higher, reason, 0.0 if exact else math.nan),
            higher,
        )
    return job, _with_error(choice, higher, error), higher


def estimate_choice(job: Sweep, choice: Choice) -> Choice:
    """Fill in the error of a model that the user requested, and what it neglects."""
    return _with_error(choice, *estimate_coupling_error(job))


def _with_error(choice: Choice, higher: str, error: float) -> Choice:
    model = choice.model
    if not model.omits:
        return replace(choice, error=0.0)
    if not higher:
        left = f"unknown: {model.omits[0]}, as wires lack a material or a cross-section"
    else:
        more = registry.adds(registry.by_name(higher), model)
        left = (
            f"unknown: {more}, as some builds at the ends of the axes have no equilibrium in the"
            f" {model.name} or the {higher} model"
            if math.isnan(error)
            else f"neglected: {more}, {percent(error)} of the largest coupling"
        )
    return replace(choice, error=error, reason=f"{choice.reason}; {left}")


def _needs_mass(job: Sweep, tolerance: float) -> str:
    """Why a sweep may need wire mass, by an upper estimate that costs little; "" if not."""
    design = reader.parse(job.text)
    if registry.MOST_COMPLETE.unsuitable(design):
        return ""
    bound = wire_mass.effect_on_response(design, float(max(job.question.frequency))).error
    if bound < 1.0:  # couplings change by less than the responses that they are ratios of
        return ""
    size = f"by up to {percent(bound)}" if math.isfinite(bound) else "near violin modes"
    return f"wire mass may change couplings {size}; tolerance {100 * tolerance:g} %"
