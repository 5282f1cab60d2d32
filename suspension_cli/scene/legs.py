"""Legs of inverted pendulums: struts, bars and the springs of their flexures.

A leg is a strut from its foot to its top (stiff along its length, with the load as thrust: any lean
is exact), a spring at its top for the flexures, and a bar for its inertia and weight. The spring's
strain is in the frame of the body below: the lean of the leg relative to that body (the angle g / L
of `elements.spring`) bends the foot; the tilt of the stage less that lean bends the joint at the
top.
"""

from __future__ import annotations

import numpy as np

from suspension_cli.design import towers
from suspension_cli.design.schema import Design, Stage
from suspension_cli.scene.arrays import Array, Row
from suspension_cli.scene.places import Places


def struts_and_bars(design: Design, places: Places) -> tuple[list[Row], list[Row]]:
    """List the struts and the bars of all legs."""
    struts: list[Row] = []
    bars: list[Row] = []
    for n, stage in enumerate(design.stage, 1):
        table = stage.inverted_pendulum
        if table is None:
            continue
        above = places.parent[n]
        span = np.array([0.0, 0.0, table.length])
        for number, top in enumerate(towers.tops(table), 1):
            label = {"label": f"{stage.name}.leg{number}"}
            foot = places.offset[n] + top - span  # from the COM of the body above
            strut = {
                "upper": above,
                "lower": n,
                "upper_point": foot,
                "lower_point": top,
                "span": span,
                "length": table.length,
                "stiffness": table.axial_stiffness,
            }
            struts.append(label | strut)
            if table.leg_mass or table.counterweight is not None:
                ends = {"body": (above, n), "point": (foot, top)}
                bars.append(label | ends | {"inertia": towers.leg_inertia(table)})
    return struts, bars


def flexures(stage: Stage, load: Array, hung: float, gravity: float) -> list[Row]:
    """List the springs of the flexures of a stage's legs, under a load (6,) about its COM.

    The load (N, N m) contains the weight of the legs on the stage, `hung` is the weight in it (N)
    without preloads. Against its strain a leg has the stiffness of its flexure k (N m/rad, at its
    foot) and of its top k_t,

        k |g|^2 / (2 L^2) + k_t (phi - lean)^2 / 2, with the lean (-g_y, g_x) / L.
    """
    table = stage.inverted_pendulum
    if table is None:
        return []
    numbers = towers.leg_statics(table, -load[2], hung, gravity)
    length = table.length
    tilt = table.top_stiffness
    across = (numbers.flexure + tilt) / length**2
    yaw = numbers.flexure / towers.ROUND_ROD if table.yaw_stiffness is None else table.yaw_stiffness
    stiffness = np.diag([across, across, 0.0, tilt, tilt, yaw])
    stiffness[0, 4] = stiffness[4, 0] = -tilt / length
    stiffness[1, 3] = stiffness[3, 1] = tilt / length
    common = {"stiffness": stiffness, "loss": numbers.loss, "leg": length}
    return [
        {"label": f"{stage.name}.leg{number}", "lower_point": top} | common
        for number, top in enumerate(towers.tops(table), 1)
    ]
