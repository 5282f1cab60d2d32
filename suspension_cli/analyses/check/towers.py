"""Statics of inverted pendulums and filters: load, tipping, saturation, working point."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from suspension_cli.analyses.check.columns import Column
from suspension_cli.design.derive import Keystone
from suspension_cli.design.filters import filter_statics
from suspension_cli.design.inverted_pendulum import leg_inertia, leg_statics
from suspension_cli.design.schema import Design
from suspension_cli.elements import string
from suspension_cli.equilibrium.solve import Equilibrium
from suspension_cli.equilibrium.tree import carried_weights
from suspension_cli.scene.scene import Scene


@dataclass(frozen=True)
class LegLoad:
    """Load and lateral motion of one inverted pendulum.

    Attributes
    ----------
    thrust : list of float
        At the top of each leg in equilibrium, N.
    load, critical : float
        Weight and other vertical force on the legs, and that at which they tip over, N.
    margin : float
        Critical load over load, less 1; negative if it tips over.
    flexure : float
        Bending stiffness at the foot of one leg, N m/rad.
    stiffness, elastic : float
        Lateral stiffness of all legs with the load, and of the flexures alone, N/m.
    frequency : float or None
        With all that hangs moving rigidly along, Hz; None if it tips over.
    tilt : float or None
        Displacement of the stage per tilt of the ground about the height of the feet, m/rad.
    saturation : float
        Fraction of the ground's motion that the inertia of the legs passes on at high frequency,
        with all that hangs moving rigidly along.
    dilution : float
        `stiffness` over `elastic`.
    """

    stage: Annotated[str, Column("stage", "legs")]
    thrust: Annotated[list[float], Column("thrust_n")]
    load: Annotated[float, Column("load_n", "load\nN", ".2f")]
    critical: Annotated[float, Column("critical_load_n", "tips over at\nN", ".2f")]
    margin: Annotated[float, Column("margin", "margin\n%", ".3g", 100)]
    flexure: Annotated[float, Column("flexure_n_m_per_rad")]
    stiffness: Annotated[float, Column("stiffness_n_per_m", "stiffness\nN/m", ".4g")]
    elastic: Annotated[float, Column("elastic_stiffness_n_per_m")]
    frequency: Annotated[float | None, Column("frequency_hz", "frequency\nHz", ".4g")]
    tilt: Annotated[float | None, Column("tilt_m_per_rad", "ground tilt\nm/rad", ".4g")]
    saturation: Annotated[float, Column("saturation", "saturation", ".2g")]
    dilution: Annotated[float, Column("dilution")]


@dataclass(frozen=True)
class FilterLoad:
    """Working point of one filter.

    Attributes
    ----------
    carried, load : float
        Weight and other vertical force on the blades, and that for which they are set, N.
    stiffness : float
        N/m.
    frequency : float
        With a rigid load, Hz.
    sag : float
        Displacement of the keystone below its working point, m.
    saturation : float
        Fraction of the filter's motion that reaches a rigid load at high frequency.
    thermal_force : float
        Change of the blades' force with temperature, N/K.
    thermal_shift : float
        Change of the working point, m/K, upwards.
    """

    stage: Annotated[str, Column("stage", "filter")]
    carried: Annotated[float, Column("carried_n", "carried\nN", ".2f")]
    load: Annotated[float, Column("load_n")]
    stiffness: Annotated[float, Column("stiffness_n_per_m", "stiffness\nN/m", ".4g")]
    frequency: Annotated[float, Column("frequency_hz", "frequency\nHz", ".4g")]
    sag: Annotated[float, Column("sag_m", "sag\nmm", ".3f", 1e3)]
    saturation: Annotated[float, Column("saturation", "saturation", ".2g")]
    thermal_force: Annotated[float, Column("thermal_force_n_per_k", "thermal force\nN/K", ".3g")]
    thermal_shift: Annotated[float, Column("thermal_shift_m_per_k", "shift\nmm/K", ".3g", 1e3)]


def leg_loads(design: Design, scene: Scene, balanced: Equilibrium) -> tuple[LegLoad, ...]:
    """Compute the loads of inverted pendulums in an equilibrium."""
    if not scene.struts.label:
        return ()
    thrust = -string.state(scene, balanced.pose, struts=True).tension
    nominal, gravity = scene.drawn or scene, float(scene.gravity)
    as_designed, hung = carried_weights(nominal), carried_weights(scene)
    found = []
    for number, stage in enumerate(design.stage, 1):
        legs = stage.inverted_pendulum
        if legs is None:
            continue
        own = scene.struts.lower == number
        _, coupling, top = leg_inertia(legs)
        weight = gravity * (coupling + top) * own.sum()
        drawn = leg_statics(
            legs,
            float(-nominal.struts.tension[own].sum()),
            float(as_designed[number - 1]),
            gravity,
        )
        load = float(thrust[own].sum()) - weight
        stiffness = drawn.stiffness - (load - drawn.load) / legs.length
        mass = drawn.mass + float(hung[number - 1] - as_designed[number - 1]) / gravity
        found.append(
            LegLoad(
                stage=stage.name,
                thrust=thrust[own].tolist(),
                load=load,
                critical=drawn.critical,
                margin=drawn.critical / load - 1,
                flexure=drawn.flexure,
                stiffness=stiffness,
                elastic=drawn.elastic,
                frequency=math.sqrt(stiffness / mass) / (2 * math.pi) if stiffness > 0 else None,
                tilt=legs.length * drawn.elastic / stiffness if stiffness > 0 else None,
                saturation=-own.sum() * coupling / mass,
                dilution=stiffness / drawn.elastic,
            )
        )
    return tuple(found)


def filter_loads(design: Design, scene: Scene, balanced: Equilibrium) -> tuple[FilterLoad, ...]:
    """Compute the working points of filters in an equilibrium."""
    found = []
    stages = {stage.name: stage for stage in design.stage}
    for number, stage in enumerate(design.stage, 1):
        if not isinstance(stage, Keystone):
            continue
        table = stages[stage.blades_of].filter
        if table is None:
            continue
        spring = int(np.flatnonzero(scene.springs.lower == number)[-1])
        upper = int(scene.springs.upper[spring])
        pose = balanced.pose
        load = float(scene.springs.preload[spring, 2])
        stiffness = float(scene.springs.stiffness[spring, 2, 2])
        above = scene.springs.upper_point[spring]
        point = pose.shift[upper] + pose.arms(np.array([upper]), above[None])[0]
        own = pose.shift[number] + above
        force = load * (table.modulus_slope + 2 * table.thermal_expansion)
        sag = float(pose.rotation[upper][:, 2] @ (point - own))
        carried = load + stiffness * sag
        hung = float(carried_weights(scene)[number - 1])
        numbers = filter_statics(table, carried, hung, float(scene.gravity))
        found.append(
            FilterLoad(
                stage=stage.blades_of,
                carried=carried,
                load=load,
                stiffness=stiffness,
                frequency=math.sqrt(stiffness / numbers.mass) / (2 * math.pi),
                sag=sag,
                saturation=numbers.coupling / numbers.mass,
                thermal_force=force,
                thermal_shift=force / stiffness,
            )
        )
    return tuple(found)
