"""What `check` lists of a design: loads of its parts, with their JSON keys and table columns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, NamedTuple

if TYPE_CHECKING:
    pass

SAG = 0.05
"""Largest sag of a link over its length that is a small deflection."""
NOTED = 4e-3
"""Weight over tension above which `check` notes that a design leaves it out; frequencies of
pendulums change by up to a quarter of it."""


class Column(NamedTuple):
    """Key in JSON; heading ("" for no column in the table), form and factor of its numbers.

    Fields of the parts that are listed are annotated with it.
    """

    key: str
    head: str = ""
    form: str = ""
    factor: float = 1.0


Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Stress:
    """Stress of a wire or blade.

    `stress` (Pa) is the largest, at the thinnest section of a wire or the base of a blade; None if
    the geometry is unknown. `strength` is the tensile strength (Pa) of the section with the largest
    ratio of stress to strength, `fraction`, and `material` its material; None and "" if unknown.
    """

    label: str
    stress: Annotated[float | None, Column("stress_pa", "stress\nMPa", ".0f", 1e-6)]
    strength: Annotated[float | None, Column("strength_pa")]
    fraction: Annotated[float | None, Column("strength_fraction", "of strength\n%", ".3g", 100)]
    material: str

    @property
    def stage(self) -> str:
        """Name of its stage."""
        return self.label.rsplit(".", 1)[0]

    @property
    def number(self) -> str:
        """Its number or name in the stage."""
        return self.label.rsplit(".", 1)[1]


@dataclass(frozen=True)
class WireLoad(Stress):
    """Load of one wire: tension (N), elongation (m), and that over its loaded length."""

    label: Annotated[str, Column("wire", "wire")]
    tension: Annotated[float, Column("tension_n", "tension\nN", ".2f")]
    stretch: Annotated[float, Column("stretch_m", "stretch\nmm", ".3f", 1e3)]
    strain: Annotated[float, Column("stretch_fraction")]


@dataclass(frozen=True)
class BladeLoad(Stress):
    """Load of one blade: vertical force at its tip (N), and deflection of the tip (m)."""

    label: Annotated[str, Column("blade", "blade")]
    load: Annotated[float, Column("load_n", "load\nN", ".2f")]
    sag: Annotated[float, Column("sag_m", "sag\nmm", ".3f", 1e3)]


@dataclass(frozen=True)
class BodyPose:
    """Displacement (m) and rotation vector (rad) of one body from its nominal pose."""

    name: Annotated[str, Column("stage")]
    shift: Annotated[Vector, Column("shift_m")]
    rotation: Annotated[Vector, Column("rotation_rad")]


@dataclass(frozen=True)
class Lowest:
    """Lowest point of a stage: z (m) from the suspension point, and the part there."""

    name: Annotated[str, Column("stage")]
    z: Annotated[float, Column("z_m")]
    point: Annotated[str, Column("point")]


@dataclass(frozen=True)
class LegLoad:
    """Load and lateral motion of one inverted pendulum.

    `thrust` is that at the top of each leg; the `margin` to the critical load, at which the legs
    tip over, is relative. `flexure` is the bending stiffness at the foot of one leg; `stiffness` is
    lateral, of all legs with the load, `elastic` of their flexures alone, `dilution` their ratio.
    `frequency` is with all that hangs moving rigidly along, `tilt` the displacement per tilt of the
    ground; None if the legs tip over. `saturation` is the fraction of the ground's motion that the
    inertia of the legs passes on at high frequency.
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

    The blades carry `carried`, and are set for `load`; the keystone is `sag` below its working
    point. `frequency` is with a rigid load, `saturation` the fraction of the filter's motion that
    reaches it at high frequency. With temperature the force and the working point (upwards) change.
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


@dataclass(frozen=True)
class CavityLoad:
    """Light of one cavity.

    Control balances the static `force` on each mirror, outwards. `stability` is g1 g2; `soft` and
    `hard` are torsional stiffnesses of the two combinations of angles, of pitch and yaw alike;
    `spring` is the static stiffness of the optical spring; `pole` half the width of the resonance,
    None if unknown.
    """

    name: Annotated[str, Column("cavity", "cavity")]
    force: Annotated[float, Column("force_n", "force\nmN", ".4g", 1e3)]
    stability: Annotated[float, Column("g1_g2", "g1 g2", ".4g")]
    soft: Annotated[float, Column("soft_n_m_per_rad", "soft\nN m/rad", ".4g")]
    hard: Annotated[float, Column("hard_n_m_per_rad", "hard\nN m/rad", ".4g")]
    spring: Annotated[float, Column("spring_n_per_m", "spring\nN/m", ".4g")]
    pole: Annotated[float | None, Column("pole_hz", "pole\nHz", ".4g")]


@dataclass(frozen=True)
class LinkLoad:
    """A link or damper between two bodies: stiffness (N/m) and damping (N s/m) along x, y, z.

    Of a link given by its geometry also the length (m) of one wire, the weight (N) of all, which
    the models leave out, and the largest descent (m) of a wire under it, as a small deflection.
    `table` are the lowest and highest frequency (Hz) of a table of stiffness.
    """

    label: Annotated[str, Column("label")]
    between: Annotated[tuple[str, ...], Column("between")]
    stiffness: Annotated[Vector, Column("stiffness")]
    damping: Annotated[Vector, Column("damping")]
    length: Annotated[float | None, Column("length")] = None
    weight: Annotated[float | None, Column("weight")] = None
    sag: Annotated[float | None, Column("sag")] = None
    table: Annotated[tuple[float, float] | None, Column("table")] = None

    @property
    def hangs_freely(self) -> bool:
        """Whether it sags too far for a small deflection."""
        return self.sag is not None and self.length is not None and self.sag > SAG * self.length


@dataclass(frozen=True)
class BodyHeat:
    """Temperature of a body (K), and the heat (W) that it absorbs, and takes up where it is held.

    What a held body takes up leaves through a cooler; below 0 it is a source of heat.
    """

    name: Annotated[str, Column("body", "body")]
    temperature: Annotated[float, Column("temperature_k", "temperature\nK", ".3f")]
    absorbed: Annotated[float, Column("absorbed_w", "absorbed\nW", ".4g")]
    removed: Annotated[float | None, Column("removed_w", "removed\nW", ".4g")]


@dataclass(frozen=True)
class ConductedHeat:
    """Heat (W) that wires or a link conduct from a warm to a cold body, with their temperatures."""

    label: Annotated[str, Column("label")]
    warm: Annotated[str, Column("from")]
    cold: Annotated[str, Column("to")]
    power: Annotated[float, Column("heat_w")]
    high: Annotated[float, Column("from_k")]
    low: Annotated[float, Column("to_k")]


@dataclass(frozen=True)
class ReducedProfile:
    """Numbers of places of a measured profile of a fibre, and of its uniform sections."""

    wire: Annotated[str, Column("wire")]
    places: Annotated[int, Column("places")]
    sections: Annotated[int, Column("sections")]


@dataclass(frozen=True)
class WireWeights:
    """Weight of the wires of a design, in all (N), and largest over tension, of `wire`.

    `sag` is the largest distance of a wire from the straight line between its ends, m: w l / (8 T)
    for the part w of its weight across it (Irvine, Cable Structures, MIT Press (1981), section
    1.2). `error` is that of the stiffness of straight wires: across, (W/T)^2 / 12, or along them,
    the largest decrease of a wire's stiffness k by its sag, w^2 k l / (12 T^3), over k (Ernst, Der
    Bauingenieur 40, 52 (1965)).
    """

    included: bool
    wire: str
    total: Annotated[float, Column("total_n")]
    ratio: Annotated[float, Column("largest_over_tension")]
    sag: Annotated[float, Column("sag_m")]
    error: Annotated[float, Column("error")]

    @property
    def line(self) -> str:
        """Describe the weight in a line; "" if it is left out and small."""
        if self.included:
            return (
                f"wires weigh {self.total:.4g} N, up to {100 * self.ratio:.2g} % of their tension"
                f" ({self.wire}); largest sag {1e3 * self.sag:.3g} mm; the error by straight wires"
                f" is {100 * self.error:.1g} %"
            )
        if self.ratio < NOTED:
            return ""
        return (
            f"wires weigh up to {100 * self.ratio:.2g} % of their tension ({self.wire});"
            " constants.wire_weight = true includes this"
        )


@dataclass(frozen=True)
class Statics:
    """Statics of a design; `top` is z of the highest end of a wire, m."""

    wires: tuple[WireLoad, ...]
    blades: tuple[BladeLoad, ...]
    bodies: tuple[BodyPose, ...]
    lowest: tuple[Lowest, ...]
    top: float
    residual: float
    links: tuple[LinkLoad, ...] = ()
    legs: tuple[LegLoad, ...] = ()
    filters: tuple[FilterLoad, ...] = ()
    cavities: tuple[CavityLoad, ...] = ()
    profiles: tuple[ReducedProfile, ...] = ()
    weights: WireWeights | None = None
    temperatures: tuple[BodyHeat, ...] = ()
    heat: tuple[ConductedHeat, ...] = ()

    @property
    def height(self) -> float:
        """Height from the lowest to the highest point, m."""
        return self.top - min(stage.z for stage in self.lowest)
