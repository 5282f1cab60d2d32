"""Responses with control loops closed, and peaks of responses between the points of a grid."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import elementwise

from suspension_cli.analyses.damp import control
from suspension_cli.drawing.added_points import NARROWEST, add_points
from suspension_cli.linear import signals
from suspension_cli.linear.response import Peaks, Response
from suspension_cli.models.choice import Transfer
from suspension_cli.scene.arrays import Array, Index

if TYPE_CHECKING:
    from jaxtyping import Complex

    from suspension_cli.design.schema import Design
    from suspension_cli.linear.system import LinearSystem

Names = tuple[Sequence[str], Sequence[str]]
LOW = 0.1
"""Fraction of the largest magnitude on the grid from which a peak may be the largest."""


@dataclass(frozen=True)
class ClosedTransfer(Transfer):
    """Responses of outputs to inputs with all loops of a design closed."""

    design: Design

    def values(
        self, model: LinearSystem, frequency: Array
    ) -> Complex[np.ndarray, "frequency output input"]:
        """Solve for the responses (f, o, i) at frequencies (f,) in Hz."""
        plant, at = control.build_plant(self.design, model), np.asarray(frequency)
        return control.solve_responses(plant, at, self.inputs, self.outputs).value


def make_transfer(
    design: Design, model: LinearSystem, names: Names, frequency: Array, *, closed: bool
) -> Transfer:
    """Responses between inputs and outputs given by name, with all loops closed or not."""
    bodies, (inputs, outputs) = signals.bodies_with_signals(model), names
    into = [signals.parse_input(text, bodies) for text in inputs]
    out = [signals.parse_output(text, bodies) for text in outputs]
    if closed:
        return ClosedTransfer(into, out, frequency, design)
    return Transfer(into, out, frequency)


def find_peaks(
    answer: Response,
    solve: Callable[[Array], Complex[np.ndarray, "frequency output input"]],
    resonances: Array,
) -> Peaks:
    """Find the largest magnitude of every response within the band of its grid.

    Points are added until each peak is resolved, at `resonances` (modes or poles, Hz) and at maxima
    on the grid; then the magnitude is maximised between the neighbours of the highest point. A peak
    narrower than the distance of neighbours can be is that of a pole without loss: infinite.
    """
    frequency, order = np.unique(answer.frequency, return_index=True)
    above = frequency > 0
    points = frequency[above], answer.value[order][above]
    if len(points[0]):
        points = add_points(solve, *points, resonances, least=LOW)
    frequency = np.concatenate([frequency[~above], points[0]])
    value = np.concatenate([answer.value[order][~above], points[1]])
    size = np.abs(value).reshape(len(frequency), -1)
    top, best = size.argmax(0), size.max(0)
    where = frequency[top]
    pair = np.flatnonzero((top > 0) & (top < len(frequency) - 1) & (best > 0))
    low, middle, high = (frequency[top[pair] + shift] for shift in (-1, 0, 1))
    best[pair[high - low < 4 * NARROWEST * middle]] = np.inf

    def negative_size(place: Array, pair: Index, middle: Array, span: Array) -> Array:
        """Negative magnitude at a fraction of the span from the middle."""
        found = solve((middle + place * span).ravel())
        return -np.abs(found).reshape(len(found), -1)[np.arange(len(found)), pair.ravel()]

    inside = np.isfinite(best[pair]) & (low > 0)
    pair, low, middle, high = pair[inside], low[inside], middle[inside], high[inside]
    if len(pair):
        span = high - low
        found = elementwise.find_minimum(
            negative_size,
            ((low - middle) / span, 0.0 * span, (high - middle) / span),
            args=(pair, middle, span),
            tolerances={"xatol": 1e-6, "xrtol": 0.0, "fatol": 0.0, "frtol": 0.0},
        )
        better = -found.f_x > best[pair]
        best[pair[better]] = -found.f_x[better]
        where[pair[better]] = (middle + found.x * span)[better]
    shape = answer.value.shape[1:]
    return Peaks(where.reshape(shape), best.reshape(shape))
