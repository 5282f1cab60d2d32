"""Time of the thermal noise of a quadruple pendulum in the violin model: 30 us per frequency."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from bench.responses import QUADRUPLE
from suspension_cli.analyses.thermal import solve as thermal
from suspension_cli.design.reader import read
from suspension_cli.models import registry

COUNT = 3000


def run(ratio: Callable[..., None], absolute: Callable[..., None]) -> None:
    """Time the noise from 0.1 Hz to 1 kHz."""
    design = read(QUADRUPLE).design
    model = registry.VIOLIN.system(design)
    signal, row = thermal.parse_motion(model, f"{model.body[-1]}.x")

    def noise(count: int) -> Callable[[], object]:
        frequency = np.geomspace(0.1, 1000, count)
        return lambda: thermal.solve(model, frequency, row, signal, design.constants.temperature)

    absolute(
        "thermal noise of a quadruple, 3,000 frequencies at 30 us each", noise(COUNT), 90.0, 15
    )
    ratio("the same, 6,000 frequencies / 3,000 (linear: 2)", noise(2 * COUNT), noise(COUNT), 2.5)
