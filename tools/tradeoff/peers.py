"""Times of this program and of others for the same work: python-control, pygwinc, plain loops."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from suspension_cli.analyses.tradeoff.measure import median_times
from suspension_cli.design.derive import mirror
from suspension_cli.design.reader import read
from suspension_cli.linear import response, signals, statespace
from suspension_cli.models import registry
from suspension_cli.physics import thermal_noise
from tests.support.paths import ROOT
from tools.tradeoff.measurement import Measurement

FREQUENCY = np.geomspace(0.1, 100.0, 1000)
"""Hz."""
OURS = "pendsus"
RESPONSE = "response of a quadruple by other programs"
NOISE = "thermal noise of a quadruple by other programs"
DESIGN = ROOT / "configs" / "quadruple.toml"


def measure_response() -> list[Measurement]:
    """Measure the response of the mirror to the support, in the force model of the quadruple."""
    import control

    design = read(DESIGN).design
    model = registry.FORCE.system(design)
    known = signals.bodies_with_signals(model)
    into = [signals.parse_input("support.x", known)]
    out = [signals.parse_output(f"{mirror(design)}.x", known)]
    omega = 2 * np.pi * FREQUENCY
    space = statespace.build(model, into, out)
    system = control.ss(space.a, space.b, space.c, space.d)
    frequency_response: Any = control.frequency_response  # its type allows for several systems
    moving = model.coordinate.index(f"{mirror(design)}.x") - 6

    def one_by_one() -> np.ndarray:
        found = []
        for one in omega:
            dynamic = model.stiffness[6:, 6:] - one**2 * model.mass[6:, 6:]
            found.append(np.linalg.solve(dynamic, -model.stiffness[6:, 0])[moving])
        return np.array(found)

    works: dict[str, Callable[[], np.ndarray]] = {
        OURS: lambda: response.solve(model, FREQUENCY, into, out).value[:, 0, 0],
        "python-control, its state space": lambda: frequency_response(system, omega).complex,
        "loop, dense solve": one_by_one,
    }
    results = [np.ravel(work()) for work in works.values()]
    first = results[0]
    apart = [float((np.abs(one - first) / np.abs(first)).max()) for one in results]
    times = median_times(list(works.values()))
    return [
        Measurement(RESPONSE, "quadruple", name, len(FREQUENCY), time, error)
        for name, time, error in zip(works, times, apart, strict=True)
    ]


def measure_noise() -> list[Measurement]:
    """Measure thermal noise of quadruples: pygwinc has one dimension and the vertical one."""
    import gwinc
    from gwinc.suspension import suspQuad

    design = read(DESIGN).design
    model = registry.VIOLIN.system(design)
    motions = [thermal_noise.parse_motion(model, f"{mirror(design)}.{dof}") for dof in "xz"]
    theirs = gwinc.load_budget("aLIGO").ifo.Suspension
    temperature = design.constants.temperature
    works: dict[str, Callable[[], Any]] = {
        f"{OURS}, six dimensions": lambda: thermal_noise.solve(
            model, FREQUENCY, motions, temperature
        ),
        "pygwinc, one dimension each": lambda: suspQuad(FREQUENCY, theirs),
    }
    times = median_times(list(works.values()))
    return [
        Measurement(NOISE, "quadruple", name, len(FREQUENCY), time, None)
        for name, time in zip(works, times, strict=True)
    ]


def measure_all() -> list[Measurement]:
    """Measure both kinds of work."""
    return [*measure_response(), *measure_noise()]
