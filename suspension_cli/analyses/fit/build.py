"""The problem of a fit from the texts of designs and the file of measurements."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.fit.experiment import Experiment
from suspension_cli.analyses.fit.problem import Problem
from suspension_cli.design import paths, reader
from suspension_cli.design.faults import suggest
from suspension_cli.design.measured import Free, Measured
from suspension_cli.errors import Fault, InputError, format_value
from suspension_cli.models import registry
from suspension_cli.studies import derivatives, parameters

if TYPE_CHECKING:
    from jaxtyping import Bool

    from suspension_cli.scene.arrays import Array

ABSOLUTE = {
    1e-3: ("d", "d_upper", "l"),
    0.3e-3: ("s", "s_upper", "s_lower"),
    0.5e-3: ("t1", "t2", "upper", "lower", "com_offset", "upper_offset", "lower_offset"),
}
"""Usual errors of careful building, m, of keys: prior standard deviations of default parameters."""
RELATIVE = {
    "mass": 0.002,
    "density": 0.005,
    "inertia": 0.02,
    "stiffness": 0.03,
    "uncoupled_frequency": 0.015,
    "thickness": 0.01,
    "youngs_modulus": 0.02,
    "k": 0.02,
}
"""The same of masses and bought materials, relative to the value."""


def default_parameters(text: str, level: str = registry.STRING.name) -> list[Free]:
    """List parameters of a design that are uncertain in a build, with priors around its values.

    >>> [item.name for item in default_parameters(text)]  # doctest: +SKIP
    ['stage.test.body.mass', 'stage.test.body.inertia.1', ..., 'materials.steel302.youngs_modulus']
    """
    found = [item for item in parameters.every(text, level) if default_sigma(item.name, item.value)]
    around = derivatives.differentiate(reader.parse(text), found, level)
    return [
        Free(name=item.name, prior=item.value, uncertainty=default_sigma(item.name, item.value))
        for item, matters in zip(found, around.balanced & around.matters, strict=True)
        if matters
    ]


def default_sigma(name: str, value: float) -> float | None:
    """Prior standard deviation of a parameter, SI; None for one that is not free by default.

    >>> default_sigma("stage.test.wires.d", 0.002), default_sigma("stage.test.body.mass", 10.0)
    (0.001, 0.02)
    """
    keys = [key for key in name.split(".") if not key.isdigit()]
    if keys[0] not in ("stage", "perturbation", "materials"):
        return None
    lengths = [sigma for sigma, some in ABSOLUTE.items() if keys[-1] in some]
    return lengths[0] if lengths else RELATIVE.get(keys[-1], 0.0) * abs(value) or None


def build(texts: Sequence[str], measured: Measured, files: Sequence[str], level: str) -> Problem:
    """Set up the problem of one or several measured designs, without transfer functions.

    Raises
    ------
    InputError
        If a design does not give a parameter, or a starting value lies outside its bounds.
    """
    free = measured.parameter
    rows = [measured.shares(n) for n in range(len(free))]
    shared = np.array(rows, dtype=bool).reshape(len(free), len(texts))
    start = _start(texts, measured, shared, level)
    _, _, low, high, _, _, scale = Problem([], free, shared, start).unknowns
    for n in np.flatnonzero((start < low) | (start > high))[:1]:
        bounds = f"{low[n]:g} to {high[n]:g}"
        problem = f"the design's value {start[n]:g} lies outside the bounds {bounds}"
        remedy = "give a start between them, or widen them"
        raise InputError([Fault(f"parameter.{n + 1}", problem, remedy)])
    experiments = [
        Experiment(
            text, modes, tuple(item.name for item, here in zip(free, own, strict=True) if here),
            start[own], scale[own], measured.where(n), file, level,
        )
        for n, (text, modes, own, file) in enumerate(
            zip(texts, measured.modes, shared.T, files, strict=True)
        )
    ]  # fmt: skip
    _check_starts(experiments, shared)
    return Problem(experiments, free, shared, start)


def _start(
    texts: Sequence[str],
    measured: Measured,
    shared: Bool[np.ndarray, "parameter experiment"],
    level: str,
) -> Array:
    """Choose starting values: requested ones, else those of the designs, else the priors."""
    known = [{item.name: item.value for item in parameters.every(text, level)} for text in texts]
    names, found, bad = measured.names, [], []
    for n, (item, own) in enumerate(zip(measured.parameter, shared, strict=True), 1):
        mine, where = np.flatnonzero(own), f"parameter.{n}.name"
        given = {known[e].get(item.name, item.prior) for e in mine}
        given = given if item.start is None else {item.start}
        problem, remedy = "", "give a start"
        if None in given:
            missing = next(e for e in mine if item.name not in known[e])
            problem = (
                f"the design{' of ' * bool(names[missing])}{names[missing]} gives no such number"
            )
            if any(item.name in known[e] for e in mine):
                remedy += ", or list only experiments whose designs give it"
            else:
                member = item.name.rpartition(".")[2].isdigit()  # of a list that is missing
                also = suggest(item.name, list(known[missing]))
                remedy = also if member else f"{remedy}; {also}"
        elif len(given) > 1:
            problem = "has different values in the designs that share it"
        if problem:
            bad.append(Fault(where, problem, remedy, format_value(item.name)))
        found.append(next(iter(given)))
    if bad:
        raise InputError(bad)
    return np.array(found, dtype=float)


def _check_starts(
    experiments: list[Experiment], shared: Bool[np.ndarray, "parameter experiment"]
) -> None:
    """Attribute errors in starting values to the file of measurements that gives them."""
    bad: dict[Fault, None] = {}
    for experiment, own in zip(experiments, shared.T, strict=True):
        try:
            reader.convert(experiment.document(experiment.start))
        except InputError as error:
            numbers = zip(np.flatnonzero(own), experiment.free, experiment.start, strict=True)
            for (n, name, x), fault in itertools.product(numbers, error.faults):
                if fault.key in paths.twins(name) or (fault.value or "").startswith(f'"{name}='):
                    problem = f"{name}: {fault.problem}"
                    bad[Fault(f"parameter.{n + 1}", problem, fault.remedy, f"{x:g}")] = None
    if bad:
        raise InputError(list(bad))
