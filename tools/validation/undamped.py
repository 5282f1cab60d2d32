"""Modes and responses of a design without losses, dampers and links, model by model."""

from __future__ import annotations

import tomllib
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment

from suspension_cli.design import reader
from suspension_cli.design.schema import Design
from suspension_cli.linear import eigenmodes, response, signals
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import registry


def parse(text: str) -> Design:
    """Read a design without losses, dampers and links."""
    raw = tomllib.loads(text)
    raw = {key: value for key, value in raw.items() if key not in ("damper", "link")}
    return reader.parse(reader.write_toml(_without_loss(raw)))


def _without_loss(value: Any) -> Any:
    if isinstance(value, dict):
        kept = (key for key in value if key not in ("q", "loss_angle"))
        return {key: _without_loss(value[key]) for key in kept}
    return [_without_loss(one) for one in value] if isinstance(value, list) else value


def system(design: Design, model: str) -> LinearSystem:
    """Assemble a model."""
    return registry.by_name(model).system(design)


def frequencies(model: LinearSystem) -> tuple[np.ndarray, list[str]]:
    """Frequencies of the oscillating modes (Hz), ascending, and their labels."""
    found = eigenmodes.solve(model)
    kept = np.flatnonzero(np.isfinite(found.frequency))
    return np.asarray(found.frequency)[kept], [found.motion[n] for n in kept]


def pair(known: np.ndarray, ours: np.ndarray) -> np.ndarray:
    """Number of our mode for each known one, such that the sum of log ratios is least.

    Pairs that cross have the same sum as those that do not; the small squares choose the latter.
    """
    with np.errstate(divide="ignore"):
        apart = np.abs(np.log(known[:, None] / ours))
    return linear_sum_assignment(apart + 1e-6 * apart**2)[1]


def respond(model: LinearSystem, pairs: list[tuple[str, str]], frequency: np.ndarray) -> np.ndarray:
    """Responses (pair, frequency) from an input to an output each."""
    known = signals.bodies_with_signals(model)
    inputs = [signals.parse_input(one, known) for one in dict.fromkeys(a for a, _ in pairs)]
    outputs = [signals.parse_output(one, known) for one in dict.fromkeys(b for _, b in pairs)]
    found = response.solve(model, frequency, inputs, outputs)
    return np.array([found.value[:, found.output.index(b), found.input.index(a)] for a, b in pairs])
