"""Stability of a design, in the most complete model without mass of wires."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, replace

import numpy as np

from suspension_cli.analyses import growth
from suspension_cli.design.plausibility import ImplausibleNumber
from suspension_cli.design.schema import Design
from suspension_cli.errors import InputError
from suspension_cli.linear import eigenmodes
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.models import registry


@dataclass(frozen=True)
class Stability:
    """Whether a design is stable, in a model, with a warning if not; None if no model is valid."""

    stable: bool | None = None
    model: str | None = None
    modes: Modes | None = None
    warnings: tuple[ImplausibleNumber, ...] = ()


def solve(design: Design) -> Stability:
    """Find whether motion grows, with wires that bend where the design gives their section."""
    complete = registry.most_complete(design, massless=True)
    for model in (complete, registry.choose(design).model):
        with (
            contextlib.suppress(InputError, np.linalg.LinAlgError, ArithmeticError),
            np.errstate(all="ignore"),
        ):
            system = model.system(design)
            modes = eigenmodes.solve(system.constant)
            grows = growth.find_growth(design, model, system)
            return Stability(grows is None, model.name, modes, _warnings(model.name, grows))
    return Stability()


def _warnings(level: str, grows: growth.Growth | None) -> tuple[ImplausibleNumber, ...]:
    if grows is None:
        return ()
    fault = grows.fault
    problem = fault.problem.replace(":", f" in the {level} model:", 1)
    remedy = f"{fault.remedy}, or stiffen the flexures of legs" if grows.static else fault.remedy
    return (ImplausibleNumber(replace(fault, problem=problem, remedy=remedy)),)
