"""What the tests of cross-coupling share: the stage of Figure 6, questions about it, and the same
stage in 60 digits."""

from __future__ import annotations

from typing import Any

import numpy as np

from suspension_cli.analyses.xcouple import imperfect_builds
from suspension_cli.conventions import DOFS
from suspension_cli.design.reader import read
from suspension_cli.design.schema import Design
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.linear import signals
from suspension_cli.physics.couplings import CouplingRequest, couplings
from suspension_cli.studies import builds
from tests.support import imperfect_stage_mp
from tests.support.golden import CONFIGS
from tests.support.references import kept

FILE = CONFIGS / "husman2000" / "figure6.toml"
TRIPLE_FILE = CONFIGS / "husman2000" / "table2.toml"
FIGURE_6, TRIPLE = read(FILE).design, read(TRIPLE_FILE).design
SHAPE = {
    "l": 0.28,
    "s": 0.005,
    "t1": 0.0965,
    "t2": 0.0965,
    "d": 0.001,
    "k": 7e10 * np.pi * 125e-6**2 / 0.28,
}
MASS, RADIUS, LENGTH = 5.6, 0.09, 0.10
ACROSS = MASS * (3 * RADIUS**2 + LENGTH**2) / 12
INERTIA = (MASS * RADIUS**2 / 2, ACROSS, ACROSS)
"""Of a cylinder along x."""
POINT = (0.0, 0.0, -0.001)
FAMILY = {"x": 0, "pitch": 0, "y": 1, "roll": 1, "z": 2, "yaw": 3}
FORBIDDEN = np.array([[FAMILY[out] != FAMILY[into] for into in DOFS] for out in DOFS])
"""Couplings (6, 6) between degrees of freedom that mirrors in x and y forbid: 26 of them."""
VECTORS = ("offset", "lower_offset", "com")


def question(
    design: Design = FIGURE_6,
    wire: str = "test.1",
    hold: str = "loaded-length",
    frequency: Any = (50.0,),
    over: str = "x",
    body: str = "",
) -> CouplingRequest:
    """x (or another motion) over z of a point 1 mm below the COM of the last stage, for vertical
    motion of the support."""
    scene = expand(design)
    known = ("support", *scene.bodies.name)
    last, at = known[-1], "@0,0,-0.001"
    return CouplingRequest(
        wire=scene.wires.label.index(wire),
        body=scene.bodies.name.index(body or wire.split(".")[0]) + 1,
        hold=hold,
        input=signals.parse_input("support.z", known),
        over=signals.parse_output(f"{last}.{over}{at}", known),
        under=signals.parse_output(f"{last}.z{at}", known),
        frequency=tuple(frequency),
    )


def answers(
    values: dict[str, Any],
    requested: CouplingRequest | None = None,
    design: Design = FIGURE_6,
    level: str = "string",
) -> dict[str, Any]:
    """Results of builds by the batch: `values` are arrays by the short names of `pendsus
    xcouple`."""
    requested = requested or question(design)
    table = {name: np.atleast_1d(np.asarray(value, dtype=float)) for name, value in values.items()}
    scene = imperfect_builds.impose(expand(design), table, requested)
    return couplings(builds.balance(scene, design, level=level), requested)


def ratios(
    values: dict[str, Any], requested: CouplingRequest | None = None, design: Design = FIGURE_6
) -> Any:
    """The (real) ratios of builds, all of which must be good."""
    found = answers(values, requested, design)
    assert not found["status"].any()
    assert not found["ratio"].imag.any()
    return found["ratio"][:, 0].real


def exact(build: dict[str, float], wire: int = 0, hold: str = "loaded-length") -> float:
    """The ratio of one build of the stage of Figure 6 in 60 digits, from the same short names."""
    return _exact({name: float(value) for name, value in build.items()}, wire, hold)


@kept
def _exact(build: dict[str, float], wire: int, hold: str) -> float:
    given: dict[str, Any] = {
        "k": build.get("k", 1),
        "length": build.get("length", 0),
        "load": build.get("mass", 1),
        "inertias": build.get("inertia", 1),
    }
    given |= {stem: [build.get(stem + axis, 0.0) for axis in ("", "_y", "_z")] for stem in VECTORS}
    return float(
        imperfect_stage_mp.ratio(MASS, INERTIA, SHAPE, point=POINT, wire=wire, hold=hold, **given)
    )


def balanced(
    values: dict[str, Any], requested: CouplingRequest, design: Design, level: str = "string"
) -> builds.Builds:
    """Builds of a batch in equilibrium."""
    return builds.balance(
        imperfect_builds.impose(expand(design), values, requested), design, level=level
    )
