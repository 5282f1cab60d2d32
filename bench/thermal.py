"""Time of the thermal noise of a quadruple pendulum in the violin model.

pygwinc's quadruple of springs in one dimension is timed too.
"""

from __future__ import annotations

from collections.abc import Callable

import gwinc
import numpy as np
from gwinc.suspension import suspQuad

import suspension_cli as sus
from bench.responses import QUADRUPLE, whole_call
from suspension_cli.design.reader import read
from suspension_cli.models import registry
from suspension_cli.physics import thermal_noise

COUNT = 3000


def run(ratio: Callable[..., None], absolute: Callable[..., None]) -> None:
    """Time the noise from 0.1 Hz to 1 kHz."""
    design = read(QUADRUPLE).design
    model = registry.VIOLIN.system(design)
    motions = [thermal_noise.parse_motion(model, f"{model.body[-1]}.{dof}") for dof in "xz"]

    def noise(count: int) -> Callable[[], object]:
        frequency = np.geomspace(0.1, 1000, count)
        return lambda: thermal_noise.solve(model, frequency, motions, design.constants.temperature)

    absolute("thermal noise of a quadruple, x and z, 3,000 frequencies", noise(COUNT), 45.0, 15)
    ratio("the same, 6,000 frequencies / 3,000 (linear: 2)", noise(2 * COUNT), noise(COUNT), 2.5)
    quadruple = gwinc.load_budget("aLIGO").ifo.Suspension
    grid = np.geomspace(0.1, 1000, COUNT)
    ratio("the same / pygwinc", noise(COUNT), lambda: suspQuad(grid, quadruple), 11)
    ratio(
        "sus.thermal of a quadruple, x and z, 3,000 frequencies / pygwinc",
        whole_call(sus.thermal, outputs=["test.x", "test.z"], frequency=grid),
        lambda: suspQuad(grid, quadruple),
        15,
    )
    fibres = sus.read(QUADRUPLE.with_name("pulled-fibres.toml"))
    few = np.geomspace(0.1, 1000, COUNT // 10)
    ratio(
        "sus.thermal of fibres of 94 sections, 3,000 frequencies / 300 (linear: 10)",
        lambda: sus.thermal(fibres, frequency=grid),
        lambda: sus.thermal(fibres, frequency=few),
        4,
        3,
    )
