"""Time of responses of a quadruple pendulum against `numpy.linalg.solve` on 24x24 matrices."""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import suspension_cli as sus
from suspension_cli.conventions import DOFS
from suspension_cli.design.reader import parse, read
from suspension_cli.linear import response, signals
from suspension_cli.models import registry

QUADRUPLE = Path(__file__).parent.parent / "configs" / "quadruple.toml"
IMPERFECT = """
[[perturbation]]
wire = "test.1"
k_factor = 1.2
upper_offset = [1e-3, 0.0, 0.0]
"""
FREQUENCY = np.geomspace(0.01, 100, 3000)


def dense(model: Any, *, everything: bool = False, kind: type = complex) -> Callable[[], object]:
    """Build the floor: one LAPACK solve of a 24x24 matrix per frequency, 1 or 30 inputs."""
    omega = 2 * np.pi * FREQUENCY
    matrices = (model.stiffness[6:, 6:] - omega[:, None, None] ** 2 * model.mass[6:, 6:]).astype(
        kind
    )
    drives = (
        np.concatenate([np.eye(24), -model.stiffness[6:, :6]], axis=1)
        if everything
        else -model.stiffness[6:, :1]
    )
    right = np.broadcast_to(drives.astype(kind), (len(omega), *drives.shape))
    return lambda: np.linalg.solve(matrices, right)


def whole_call(analysis: Callable[..., object], **options: Any) -> Callable[[], object]:
    """Analyse the quadruple from its file on; each time it is another one, so nothing is kept."""
    number = itertools.count()

    def work() -> object:
        design = sus.read(QUADRUPLE).replace({"stage.test.wires.d": 1e-3 + 1e-9 * next(number)})
        with warnings.catch_warnings(action="ignore", category=sus.PendsusWarning):
            return analysis(design, **options)

    return work


def run(ratio: Callable[..., None], absolute: Callable[..., None]) -> None:
    """Time the longitudinal block alone, then all inputs to all outputs."""
    matrices = np.random.default_rng(0).normal(size=(1000, 24, 24)) + 1j
    ratio(
        "sus.response of a quadruple, 1,000 frequencies / complex LU 24x24",
        whole_call(sus.response, frequency=np.geomspace(0.1, 100, 1000)),
        lambda: np.linalg.solve(matrices, np.ones((1000, 24, 1), dtype=complex)),
        4.5,
    )
    model = registry.FORCE.system(read(QUADRUPLE).design)
    known = signals.bodies_with_signals(model)
    drive, motion = (
        [signals.parse_input("support.x", known)],
        [signals.parse_output(f"{model.body[-1]}.x", known)],
    )
    floor = dense(model)
    ratio(
        "response, support.x to mirror of a quadruple / dense 24x24",
        lambda: response.solve(model, FREQUENCY, drive, motion),
        floor,
        0.3,
    )
    absolute(
        "the same, 3,000 frequencies at 3 us each",
        lambda: response.solve(model, FREQUENCY, drive, motion),
        6.0,
        15,
    )
    imperfect = registry.STRING.system(parse(QUADRUPLE.read_text() + IMPERFECT))
    bodies = signals.bodies_with_signals(imperfect)
    drive, motion = (
        [signals.parse_input("support.x", bodies)],
        [signals.parse_output(f"{imperfect.body[-1]}.yaw", bodies)],
    )
    ratio(
        "response of an imperfect quadruple, one pair / dense real 24x24",
        lambda: response.solve(imperfect, FREQUENCY, drive, motion),
        dense(model, kind=float),
        3.6,
    )
    drives = [
        signals.parse_input(f"{body}.{force}", known)
        for body in model.body
        for force in signals.FORCES
    ]
    drives += [signals.parse_input(f"support.{dof}", known) for dof in DOFS]
    motions = [signals.parse_output(f"{body}.{dof}", known) for body in model.body for dof in DOFS]

    def everything() -> object:
        return response.solve(model, FREQUENCY, drives, motions)

    ratio(
        "response, 30 inputs to 24 outputs / dense 24x24, 30 inputs",
        everything,
        dense(model, everything=True),
        1,
    )
    ratio("the same / dense 24x24, one input (no limit: for comparison)", everything, floor, np.inf)
