"""Legs of inverted pendulums and blades of filters as members of the parts of a scene.

A leg is a strut from its foot to its top (stiff along its length, with the load as thrust: any lean
is exact), a spring at its top for the flexures, and a bar for its inertia and weight. The spring's
strain is in the frame of the body below: the lean of the leg relative to that body (the angle g / L
of `elements.lean`) bends the foot; the tilt of the stage less that lean bends the joint at the top.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design.derive import Keystone
from suspension_cli.design.filters import filter_statics
from suspension_cli.design.inverted_pendulum import (
    ROUND_ROD,
    InvertedPendulum,
    leg_inertia,
    leg_statics,
    tops,
)
from suspension_cli.design.schema import Design, Stage
from suspension_cli.errors import Fault
from suspension_cli.scene.arrays import Array, Row
from suspension_cli.scene.places import Places

if TYPE_CHECKING:
    from jaxtyping import Float


def legs(design: Design, places: Places) -> tuple[list[Row], list[Row]]:
    """List the struts and the bars of all legs."""
    struts: list[Row] = []
    bars: list[Row] = []
    for n, stage in enumerate(design.stage, 1):
        table, above = stage.inverted_pendulum, places.parent[n]
        for number, top in enumerate(tops(table) if table else [], 1):
            assert table is not None
            label, span = f"{stage.name}.leg{number}", np.array([0.0, 0.0, table.length])
            foot = places.offset[n] + top - span
            strut = {
                "upper": above,
                "lower": n,
                "upper_point": foot,
                "lower_point": top,
                "span": span,
                "length": table.length,
                "stiffness": table.axial_stiffness,
            }
            struts.append({"label": label} | strut)
            if table.leg_mass or table.counterweight is not None:
                bar = {"body": (above, n), "point": (foot, top), "inertia": leg_inertia(table)}
                bars.append({"label": label} | bar)
    return struts, bars


def flexures(stage: Stage, load: Array, hung: float, gravity: float) -> list[Row]:
    """List the springs of the flexures of a stage's legs, under a load (6,) about its COM.

    The load (N, N m) contains the weight of the legs on the stage, `hung` is the weight in it (N)
    without preloads.
    """
    table = stage.inverted_pendulum
    if table is None:
        return []
    numbers = leg_statics(table, -load[2], hung, gravity)
    own = {
        "stiffness": flexure_matrix(table, numbers.flexure),
        "loss": numbers.loss,
        "leg": table.length,
    }
    return [
        {"label": f"{stage.name}.leg{number}", "lower_point": top} | own
        for number, top in enumerate(tops(table), 1)
    ]


def flexure_matrix(legs: InvertedPendulum, flexure: float) -> Float[np.ndarray, "6 6"]:
    """Stiffness of the flexures of one leg, `flexure` (N m/rad) at its foot, against its strain.

    k |g|^2 / (2 L^2) + k_t (phi - lean)^2 / 2, with the lean (-g_y, g_x) / L.
    """
    length, tilt = legs.length, legs.top_stiffness
    across = (flexure + tilt) / length**2
    yaw = flexure / ROUND_ROD if legs.yaw_stiffness is None else legs.yaw_stiffness
    result = np.diag([across, across, 0.0, tilt, tilt, yaw])
    result[0, 4] = result[4, 0] = -tilt / length
    result[1, 3] = result[3, 1] = tilt / length
    return result


def filter_blades(
    design: Design, keystone: Keystone, load: Array, hung: float, gravity: float
) -> tuple[Row, float, list[Fault]]:
    """Spring of the blades of a filter under a load (6,) on its keystone, about the COM.

    Also returns the mass that couples both bodies, kg, and a fault if it is as large as the mass of
    the keystone. `hung` is the weight in the load (N) without preloads. The vertical force of the
    blades is the given load, if any.
    """
    table = next(one.filter for one in design.stage if one.name == keystone.blades_of)
    assert table is not None
    numbers = filter_statics(table, -load[2], hung, gravity)
    lateral, tilt = table.lateral_stiffness, table.tilt_stiffness
    lift = -load[2] if table.load is None else numbers.load
    row = {
        "label": f"{keystone.name}.blades",
        "lower_point": np.zeros(3),
        "stiffness": np.diag([lateral, lateral, numbers.stiffness, tilt, tilt, tilt]),
        "preload": [*-load[:2], lift, *-load[3:]],
        "loss": numbers.loss,
    }
    if numbers.coupling < table.keystone.mass:
        return row, numbers.coupling, []
    fault = Fault(
        f"stage.{keystone.blades_of}.filter.keystone.mass",
        f"is not above the mass coupling of the blades, {numbers.coupling:.3g} kg, of which it is"
        " part",
        "give the keystone the mass of the blades that moves with it, or a smaller saturation",
        f"{table.keystone.mass:g}",
    )
    return row, numbers.coupling, [fault]
