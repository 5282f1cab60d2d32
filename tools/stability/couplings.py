"""Cross-coupling by one imperfect wire, for offsets from 1e-14 m to 0.15 m."""

from __future__ import annotations

from typing import Any

import numpy as np
import tomli_w

from suspension_cli.analyses.xcouple.imperfect_builds import ImperfectBuilds
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.linear import signals
from suspension_cli.physics.couplings import CouplingRequest
from suspension_cli.studies.job import Axis
from tools.stability.energy import Stage
from tools.stability.references import INERTIA, MASS, SHAPE, design, document, imperfect_stage_mp
from tools.stability.row import SHIPPED, Row, relative

TINY = 10.0 ** np.arange(-3, -15, -1)
LARGE = np.geomspace(1e-5, 0.15, 24)
FREQUENCY, POINT = 50.0, (0.0, 0.0, -0.001)


def _shipped(offset: Any, name: str = "lower_offset") -> Any:
    """Ratios for offsets of an end of wire 1 along x, as `pendsus xcouple` computes them."""
    raw = document()
    bodies = ("support", "test")
    question = CouplingRequest(
        wire=0,
        body=1,
        hold="loaded-length",
        input=signals.parse_input("support.z", bodies),
        over=signals.parse_output("test.x@0,0,-0.001", bodies),
        under=signals.parse_output("test.z@0,0,-0.001", bodies),
        frequency=(FREQUENCY,),
    )
    sweep = ImperfectBuilds(tomli_w.dumps(raw), (Axis(name, tuple(map(float, offset))),), question)
    return sweep.compute(0, len(offset))["ratio"][:, 0].real


def _exact(offset: float, name: str = "lower_offset") -> float:
    return float(
        imperfect_stage_mp.ratio(
            MASS, INERTIA, SHAPE, FREQUENCY, POINT, **{name: (float(offset), 0, 0)}
        )
    )


def _built(offset: float) -> Stage:
    """The imperfect stage in its nominal pose."""
    item = {"wire": "test.1", "lower_offset": [float(offset), 0.0, 0.0]}
    return Stage.nominal(expand(design(document() | {"perturbation": [item]})))


def tiny(offset: Any = TINY) -> Row:
    """Compute errors of vertical to longitudinal coupling for small offsets of one wire."""
    reference, second = (
        np.array([_exact(value, name) for value in offset]) for name in ("lower_offset", "offset")
    )
    equilibria = [_built(value).balanced() for value in offset]
    methods = {
        "lengths from coordinates": [
            one.ratio(FREQUENCY, POINT, one.stiffness) for one in equilibria
        ],
        "difference quotients of energy": [
            one.ratio(FREQUENCY, POINT, one.quotients()) for one in equilibria
        ],
    }
    return Row(
        title="Tiny couplings",
        driver="offset of one end of one wire (m)",
        quantity="vertical to longitudinal at 50 Hz",
        value=np.asarray(offset),
        error={
            f"{SHIPPED}: lower end": relative(_shipped(offset), reference),
            f"{SHIPPED}: upper end, second order": relative(_shipped(offset, "offset"), second),
        }
        | {name: relative(values, reference) for name, values in methods.items()},
        finding=(
            "A coupling of 10⁻¹⁰ is below the rounding of lengths from coordinates; difference"
            " quotients lose half of all digits. The program counts elongations from the nominal"
            " pose, and keeps exact zeros."
        ),
        limit=(
            "the last bit of a point, 10⁻¹⁸ m, over the offset; of couplings of second order ratios"
            " below 10⁻¹⁷ are rounding"
        ),
    )


def large(offset: Any = LARGE) -> Row:
    """Compute errors of the same coupling for large offsets, where the equilibrium pose differs."""
    reference = np.array([_exact(value) for value in offset])
    drawn = [_built(value) for value in offset]
    slope = _exact(1e-9) / 1e-9
    once = [one.displaced(np.linalg.solve(one.stiffness, -one.gradient)) for one in drawn]
    newton = [one.balanced() for one in drawn]
    methods = {
        "in proportion to the offset": slope * np.asarray(offset),
        "about the nominal pose": [one.ratio(FREQUENCY, POINT, one.stiffness) for one in drawn],
        "one linear step": [one.ratio(FREQUENCY, POINT, one.stiffness) for one in once],
        "undamped Newton": [one.ratio(FREQUENCY, POINT, one.stiffness) for one in newton],
    }
    return Row(
        title="Large perturbations",
        driver="offset of one end of one wire (m)",
        quantity="vertical to longitudinal at 50 Hz",
        value=np.asarray(offset),
        error={SHIPPED: relative(_shipped(offset), reference)}
        | {name: relative(values, reference) for name, values in methods.items()},
        finding=(
            "An imperfect body hangs elsewhere than drawn: models about the nominal pose, or in"
            " proportion to the imperfection, are wrong from 10 μm on. The program finds the"
            " pose, with finite rotations."
        ),
        limit="none found; where a build has no equilibrium on taut wires it says so",
    )
