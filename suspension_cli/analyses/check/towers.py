"""Statics of inverted pendulums and filters: load, tipping, saturation, working point."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from suspension_cli.analyses import tables
from suspension_cli.analyses.analysis import Document
from suspension_cli.design.filters import filter_statics
from suspension_cli.design.inverted_pendulum import leg_inertia, leg_statics
from suspension_cli.design.keystones import Keystone
from suspension_cli.design.plausibility import ImplausibleNumber
from suspension_cli.design.schema import Design
from suspension_cli.elements import string
from suspension_cli.equilibrium.residual_scale import carried_weights
from suspension_cli.equilibrium.solve import Equilibrium
from suspension_cli.errors import Fault, format_value
from suspension_cli.scene.scene import Scene

TIPPING = 1e-3
"""Margin of an inverted pendulum to its tipping load, over the load, below which there is a
warning."""
WORKING_RANGE = 5e-3
"""Largest plausible displacement of a keystone from its working point, m: blades are soft within
millimetres."""


Columns = dict[str, tuple[str, str, str, float]]
LEGS: Columns = {
    "stage": ("stage", "legs", "", 1),
    "thrust": ("thrust_n", "", "", 1),
    "load": ("load_n", "load\nN", ".2f", 1),
    "critical": ("critical_load_n", "tips over at\nN", ".2f", 1),
    "margin": ("margin", "margin\n%", ".3g", 100),
    "flexure": ("flexure_n_m_per_rad", "", "", 1),
    "stiffness": ("stiffness_n_per_m", "stiffness\nN/m", ".4g", 1),
    "elastic": ("elastic_stiffness_n_per_m", "", "", 1),
    "frequency": ("frequency_hz", "frequency\nHz", ".4g", 1),
    "tilt": ("tilt_m_per_rad", "ground tilt\nm/rad", ".4g", 1),
    "saturation": ("saturation", "saturation", ".2g", 1),
    "dilution": ("dilution", "", "", 1),
}
FILTERS: Columns = {
    "stage": ("stage", "filter", "", 1),
    "carried": ("carried_n", "carried\nN", ".2f", 1),
    "load": ("load_n", "", "", 1),
    "sag": ("sag_m", "sag\nmm", ".3f", 1e3),
    "stiffness": ("stiffness_n_per_m", "stiffness\nN/m", ".4g", 1),
    "frequency": ("frequency_hz", "frequency\nHz", ".4g", 1),
    "saturation": ("saturation", "saturation", ".2g", 1),
    "thermal_force": ("thermal_force_n_per_k", "thermal force\nN/K", ".3g", 1),
    "thermal_shift": ("thermal_shift_m_per_k", "shift\nmm/K", ".3g", 1e3),
}
"""Attributes of `LegLoad` and `FilterLoad`: key in JSON; heading, form and factor of the column of
the table, "" for none."""


@dataclass(frozen=True)
class LegLoad:
    """Load and lateral motion of one inverted pendulum.

    Attributes
    ----------
    thrust : list of float
        At the top of each leg in equilibrium, N.
    load, critical : float
        Weight and other vertical force on the legs, and that at which they tip over, N.
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

    stage: str
    thrust: list[float]
    load: float
    critical: float
    flexure: float
    stiffness: float
    elastic: float
    frequency: float | None
    tilt: float | None
    saturation: float
    dilution: float

    @property
    def margin(self) -> float:
        """Critical load over load, less 1; negative if it tips over."""
        return self.critical / self.load - 1


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

    stage: str
    carried: float
    load: float
    stiffness: float
    frequency: float
    sag: float
    saturation: float
    thermal_force: float
    thermal_shift: float


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
        inertia = leg_inertia(legs)
        weight = gravity * inertia.on_top * own.sum()
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
                flexure=drawn.flexure,
                stiffness=stiffness,
                elastic=drawn.elastic,
                frequency=math.sqrt(stiffness / mass) / (2 * math.pi) if stiffness > 0 else None,
                tilt=legs.length * drawn.elastic / stiffness if stiffness > 0 else None,
                saturation=-drawn.count * inertia.coupling / mass,
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


def documents(legs: tuple[LegLoad, ...], filters: tuple[FilterLoad, ...]) -> Document:
    """Return JSON lists of inverted pendulums and filters, if there are any."""
    kinds = (("inverted_pendulums", LEGS, legs), ("filters", FILTERS, filters))
    return {
        name: [{key: getattr(one, field) for field, (key, *_) in columns.items()} for one in found]
        for name, columns, found in kinds
        if found
    }


def lines(legs: tuple[LegLoad, ...], filters: tuple[FilterLoad, ...]) -> list[str]:
    """Return tables of inverted pendulums and filters, if there are any."""
    made = []
    for columns, found in ((LEGS, legs), (FILTERS, filters)):
        shown = [(field, *column) for field, (_, *column) in columns.items() if column[0]]
        heads = {str(head): str(form) for _, head, form, _ in shown}
        rows = []
        for one in found:
            values = ((getattr(one, field), factor) for field, _, _, factor in shown)
            rows.append([value * factor if factor != 1 else value for value, factor in values])
        if rows:
            made.append(tables.render(heads, rows))
    return made


def find_implausible_towers(
    design: Design, legs: tuple[LegLoad, ...], filters: tuple[FilterLoad, ...]
) -> Iterator[ImplausibleNumber]:
    """Report inverted pendulums near tipping, and filters off their working point."""
    stages = {stage.name: stage for stage in design.stage}
    for leg in legs:
        if leg.margin >= TIPPING:
            continue
        key = f"stage.{leg.stage}.inverted_pendulum"
        state = (
            f"tips over: its load of {leg.load:.6g} N is above the critical load of"
            f" {leg.critical:.6g} N"
            if leg.margin <= 0
            else f"is near tipping: its load of {leg.load:.6g} N is {100 * leg.margin:.2g} % below"
            f" the critical load of {leg.critical:.6g} N"
        )
        table = stages[leg.stage].inverted_pendulum
        assert table is not None
        least = leg.flexure + (leg.load - leg.critical) * table.length / len(leg.thrust)
        remedy = f"reduce the load, or give flexures well above {least:.6g} N m/rad"
        yield ImplausibleNumber(Fault(key, state, remedy))
    for own in filters:
        if abs(own.sag) <= WORKING_RANGE:
            continue
        way = "below" if own.sag > 0 else "above"
        problem = (
            f"the keystone is {1e3 * abs(own.sag):.3g} mm {way} its working point: it carries"
            f" {own.carried:.6g} N, not {own.load:.6g} N"
        )
        remedy = f"give load = {own.carried:.6g}, leave it out, or change the mass below"
        key = f"stage.{own.stage}.filter.load"
        yield ImplausibleNumber(Fault(key, problem, remedy, format_value(own.load)))
