"""Time and error of methods for a response, from the matrices of a model on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from suspension_cli.analyses.export.solve import compute_zero_pole_gain
from suspension_cli.analyses.tradeoff.measure import median_times
from suspension_cli.design.derive import mirror
from suspension_cli.design.reader import read
from suspension_cli.linear import response, signals, statespace
from suspension_cli.linear.signals import Signal
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models.registry import STRING
from tests.support.paths import ROOT
from tools.stability import naive
from tools.stability.references import compare
from tools.stability.row import relative
from tools.tradeoff.measurement import Measurement

WORK = "response of the mirror by methods"
DESIGNS = [
    ROOT / "configs" / f"{name}.toml"
    for name in ("husman2000/table1-case3", "double", "geo-silica-triple", "quadruple")
]
BAND = (0.1, 1000.0)
"""Hz."""
FEW, MANY = 200, 20_000
"""Frequencies of a response whose time is measured."""
CHECKED = 25
"""Frequencies at which the errors are computed."""
ENDS = (("x", "x"), ("x", "pitch"), ("z", "z"), ("yaw", "yaw"), ("y", "roll"))
"""Motions of the support and of the mirror whose responses are compared."""
OURS = "body by body"
METHODS: dict[str, Callable[[LinearSystem, Any, Signal, Signal], Any]] = {
    OURS: lambda model, at, into, out: response.solve(model, at, [into], [out]).value[:, 0, 0],
    "dense solve": naive.dense,
    "modal sum": naive.modal_sum,
    "state space": lambda model, at, into, out: statespace.build(model, [into], [out]).at(at)[
        :, 0, 0
    ],
    "zpk": lambda model, at, into, out: compute_zero_pole_gain(
        statespace.build(model, [into], [out])
    ).at(at)[:, 0, 0],
}


def measure_methods(file: Path) -> list[Measurement]:
    """Measure each method on the string model of a design.

    The error is the largest of the responses of `ENDS` that are not 0, against 50 digits on the
    same matrices.
    """
    design = read(file).design
    model = STRING.system(design)
    known = signals.bodies_with_signals(model)
    ends = [
        (
            signals.parse_input(f"support.{upper}", known),
            signals.parse_output(f"{mirror(design)}.{lower}", known),
        )
        for upper, lower in ENDS
    ]
    checked = np.geomspace(*BAND, CHECKED)
    errors = dict.fromkeys(METHODS, 0.0)
    for into, out in ends:
        exact = compare(model, checked, [into], [out]).exact[:, 0, 0]
        if not exact.any():  # wires that lead to the centre of mass do not tilt it
            continue
        for name, solve in METHODS.items():
            error = relative(solve(model, checked, into, out), exact).max()
            errors[name] = max(errors[name], float(error))
    rows: list[Measurement] = []
    for count in (FEW, MANY):
        at = np.geomspace(*BAND, count)
        # a copy has none of the cached properties of the model
        works = [
            lambda solve=solve, at=at: solve(replace(model), at, *ends[0])
            for solve in METHODS.values()
        ]
        rows += [
            Measurement(WORK, design.design.name, name, count, time, errors[name])
            for name, time in zip(METHODS, median_times(works), strict=True)
        ]
    return rows


def measure_all() -> list[Measurement]:
    """Measure all methods on all designs."""
    return [row for file in DESIGNS for row in measure_methods(file)]
