"""Legs of inverted pendulums and blades of filters as elements of a scene.

A leg is a strut from its foot to its top (stiff along its length, with the load as thrust: any lean
is exact), a spring at its top for the flexures, and a bar for its inertia and weight. The spring's
strain is in the frame of the body below: the lean of the leg relative to that body (the angle g / L
of `elements.lean`) bends the foot; the tilt of the stage less that lean bends the joint at the top.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design.filters import filter_statics
from suspension_cli.design.inverted_pendulum import (
    LegStatics,
    leg_inertia,
    leg_statics,
    tops,
)
from suspension_cli.design.keystones import Keystone, filter_of
from suspension_cli.design.schema import Design, Spring
from suspension_cli.errors import Fault
from suspension_cli.scene import tensions
from suspension_cli.scene.arrays import Array
from suspension_cli.scene.parts import BarPart, StagePart, WirePart

if TYPE_CHECKING:
    from suspension_cli.design.units import Matrix6

UP = np.array([0.0, 0.0, 1.0])


def add_legs(part: StagePart) -> None:
    """Add the struts and bars of the legs of a stage to it, without thrust."""
    legs = part.stage.inverted_pendulum
    if legs is None:
        return
    inertia = leg_inertia(legs)
    for number, top in enumerate(tops(legs), 1):
        label, lower = f"{part.stage.name}.leg{number}", np.array(top)
        foot = part.offset + lower - legs.length * UP
        part.struts.append(
            WirePart(
                label=label,
                upper_point=foot,
                lower_point=lower,
                span=legs.length * UP,
                stiffness=legs.axial_stiffness,
            )
        )
        if legs.leg_mass or legs.counterweight is not None:
            numbers = np.array([inertia.foot, inertia.coupling, inertia.top])
            part.bars.append(BarPart(label, foot, lower, numbers))


def bar_weights(part: StagePart, gravity: float) -> tuple[Array, Array]:
    """Weight of the bars of a stage: wrenches (6,) on it and the body below, about their COMs."""
    totals = [np.zeros(6), np.zeros(6)]
    for bar in part.bars:
        loads = (bar.inertia[2] + bar.inertia[1], bar.inertia[0] + bar.inertia[1])
        for n, (mass, point) in enumerate(zip(loads, (bar.lower, bar.upper), strict=True)):
            totals[n] = totals[n] + tensions.weight_wrench(gravity * mass, point)
    return totals[0], totals[1]


def balance_legs(
    part: StagePart, load: Array, hung: float, gravity: float, weight: float
) -> list[Fault]:
    """Set thrusts and flexures of the legs of a stage under a load (6,) about its COM.

    The load (N, N m) contains the weight of the legs on the stage; `weight` is its size, `hung` the
    weight in it (N) without preloads. Returns the faults: a load that the legs cannot balance, or
    that pulls one.
    """
    legs = part.stage.inverted_pendulum
    assert legs is not None
    key = f"stage.{part.stage.name}.inverted_pendulum"
    wrenches = tensions.wire_wrenches(
        np.array([strut.direction for strut in part.struts]),
        np.array([strut.lower_point for strut in part.struts]),
    )
    # of more than three legs, equally stiff, the least elastic energy
    compliance = np.diag([1.0 / strut.stiffness for strut in part.struts])
    tension, left_over = tensions.least_energy(wrenches, load, compliance)
    lower = np.array([strut.lower_point for strut in part.struts])
    upper = np.array([strut.upper_point for strut in part.struts])
    stiffness = np.array([strut.stiffness for strut in part.struts])
    part.thrust = -tensions.equalise_mirrored(tension, upper, lower, stiffness)
    numbers = leg_statics(legs, -load[2], hung, gravity)
    matrix = flexure_matrix(legs.length, numbers)
    for point in lower:
        part.flexures.append(
            Spring(stiffness=matrix, at=tuple(point.tolist()), loss_angle=numbers.loss)
        )
    faults = tensions.report_imbalance(
        left_over,
        weight,
        key,
        "hang the load at the height of the legs' circle, or below its centre",
    )
    return faults or [
        Fault(
            key,
            f"leg {strut.label} would be pulled in the nominal pose (thrust {thrust.real:.3g} N)",
            "place the load between the legs",
        )
        for strut, thrust in zip(part.struts, part.thrust, strict=True)
        if not thrust.real > 0
    ]


def flexure_matrix(length: float, numbers: LegStatics) -> Matrix6:
    """Stiffness (6 rows of 6) of the flexures of one leg against the strain of its spring.

    k |g|^2 / (2 L^2) + k_t (phi - lean)^2 / 2, with the lean (-g_y, g_x) / L.
    """
    foot, top = numbers.flexure / length**2, numbers.top / length**2
    mixed = numbers.top / length
    result = [[0.0] * 6 for _ in range(6)]
    result[0][0] = result[1][1] = foot + top
    result[3][3] = result[4][4] = numbers.top
    result[5][5] = numbers.yaw
    result[0][4] = result[4][0] = -mixed
    result[1][3] = result[3][1] = mixed
    return [*result]


def hold_keystone(
    design: Design, part: StagePart, load: Array, hung: float, gravity: float
) -> list[Fault]:
    """Add the blades of a keystone under a load (6,) about its COM to it.

    `hung` is the weight in the load (N) without preloads. The vertical force of the blades is the
    given load, if any. Returns a fault if the mass coupling is as large as the mass of the
    keystone.
    """
    stage = part.stage
    assert isinstance(stage, Keystone)
    table = filter_of(design, stage).filter
    assert table is not None
    numbers = filter_statics(table, -load[2], hung, gravity)
    preload = -load
    if table.load is not None:
        preload = np.array([*preload[:2], numbers.load, *preload[3:]])
    lateral, tilt = table.lateral_stiffness, table.tilt_stiffness
    part.flexures.append(
        Spring(
            stiffness=[lateral, lateral, numbers.stiffness, tilt, tilt, tilt],
            preload=preload.tolist(),
            loss_angle=numbers.loss,
        )
    )
    coupling = numbers.coupling
    if coupling:
        part.bars.append(
            BarPart(
                f"{stage.blades_of}.blades",
                part.offset,
                np.zeros(3),
                np.array([-coupling, coupling, -coupling]),
            )
        )
    if coupling.real >= table.keystone.mass.real:
        return [
            Fault(
                f"stage.{stage.blades_of}.filter.keystone.mass",
                f"is not above the mass coupling of the blades, {coupling.real:.3g} kg, of which it"
                " is part",
                "give the keystone the mass of the blades that moves with it, or a smaller"
                " saturation",
                f"{table.keystone.mass.real:g}",
            )
        ]
    return []
