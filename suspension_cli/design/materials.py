"""Materials: tables of the design file, built-in ones, and the mechanisms of their losses.

**Bulk and surface.** The loss angle of the bulk is a constant, or a table: linear in log f and log
angle, constant beyond its ends, at the real part of a complex frequency. The surface adds d_s mu
S/V times that angle (see `cross_sections`).

**Thermoelastic loss of bending.** The loss angle is Delta Im g (`relaxation`), Delta = E T a^2/(rho
C). The coefficient a is the slope of strain against temperature at constant stress s. With the
strain s/E(T) + alpha T it is a = alpha - s E'/E^2 = alpha - u beta, u = s/E the static strain and
beta = E'/E: in a material that stiffens with temperature the loss vanishes at one tension (Cagnoli
and Willems, Phys. Rev. B 65, 174111 (2002)). Stretching and twisting drive no heat across a wire.
In a complex frequency the angle is continued analytically.

**Temperature.** Properties may be tables against temperature. `resolve` gives a material at one
temperature: numbers alone. Thermoelastic loss, which may act at another temperature at either end
of a wire, keeps the tables and evaluates them where it is asked for.
"""

from __future__ import annotations

import math
import tomllib
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, Self

import msgspec

from suspension_cli.design import key_rules, units
from suspension_cli.design.typed_tables import Problems, Table, key

if TYPE_CHECKING:
    from suspension_cli.design.cross_sections import CrossSection, Frequencies, Spectrum


WIDE_GAP = 3.0
"""Ratio of the temperatures of two neighbours in a table from which they leave a gap, if their
values differ by more than `STEEP` too: specific heats and conductivities of crystals have peaks and
bends within such a range."""
STEEP = 2.0
"""Ratio of the largest to the smallest value of a table from which it is interpolated in the
logarithms: powers of the temperature, like the specific heat of a cold crystal, are then exact."""


class AgainstTemperature(Table, frozen=True):
    """A property by temperature: interpolated, constant outside."""

    temperature: tuple[units.Kelvin, ...] = key("K, ascending", min_length=2, max_length=1000)
    values: tuple[units.Number, ...] = key(
        "value at each of them, in the unit of the property; in between linear in the logarithms if"
        " all have one sign and differ by more than a factor of 2, else linear",
        min_length=2,
        max_length=1000,
    )

    rules = (key_rules.same_length("values", "temperature"), key_rules.ascending("temperature"))

    def at(self, temperature: float) -> float:
        """Interpolate at a temperature in K.

        >>> AgainstTemperature(temperature=(10.0, 20.0), values=(1.0, 8.0)).at(15.0)
        3.375
        """
        nodes = self.temperature
        values = self.values
        if temperature <= nodes[0]:
            return values[0]
        if temperature >= nodes[-1]:
            return values[-1]
        n = bisect_right(nodes, temperature) - 1
        low = values[n]
        high = values[n + 1]
        if not self._is_steep:
            part = (temperature - nodes[n]) / (nodes[n + 1] - nodes[n])
            return low + part * (high - low)
        part = math.log(temperature / nodes[n]) / math.log(nodes[n + 1] / nodes[n])
        return low * (high / low) ** part

    def integral(self, low: float, high: float) -> float:
        """Integrate from one temperature (K) to a higher one, exactly.

        >>> cubic = AgainstTemperature(temperature=(10.0, 20.0), values=(1.0, 8.0))
        >>> round(cubic.integral(10.0, 20.0), 9)
        37.5
        """
        nodes = self.temperature
        inside = [node for node in nodes if low < node < high]
        total = 0.0
        for start, end in pairwise([low, *inside, high]):
            first = self.at(start)
            last = self.at(end)
            width = math.log(end / start)
            if width and self._is_steep and nodes[0] <= start < nodes[-1]:
                exponent = math.log(last / first) / width + 1  # of the integral of a power
                growth = math.expm1(exponent * width) / exponent if exponent else width
                total += first * start * growth
            else:
                total += (first + last) / 2 * (end - start)
        return total

    @property
    def _is_steep(self) -> bool:
        """Whether the logarithms are interpolated."""
        sizes = [abs(value) for value in self.values]
        one_sign = min(self.values) > 0 or max(self.values) < 0
        return one_sign and max(sizes) > STEEP * min(sizes)

    def unknown_range(self, temperature: float) -> str:
        """Describe where the table ends or has a gap, if a temperature (K) is there; else ""."""
        nodes = self.temperature
        if not nodes[0] <= temperature <= nodes[-1]:
            return f"known from {nodes[0]:g} to {nodes[-1]:g} K"
        for (low, high), pair in zip(pairwise(nodes), pairwise(self.values), strict=True):
            small, large = sorted(abs(value) for value in pair)
            if low < temperature < high and high > WIDE_GAP * low and large > STEEP * small:
                return f"unknown between {low:g} and {high:g} K"
        return ""


Property = float | AgainstTemperature
"""A property of a material: a number, or a table against temperature."""


def value_at(given: Property, temperature: float) -> float:
    """Evaluate a property at a temperature in K."""
    return given.at(temperature) if isinstance(given, AgainstTemperature) else given


def integrate(given: Property, low: float, high: float) -> float:
    """Integrate a property over temperature (K); negative if `high` is below `low`."""
    if high < low:
        return -integrate(given, high, low)
    if isinstance(given, AgainstTemperature):
        return given.integral(low, high)
    return given * (high - low)


class LossTable(Table, frozen=True):
    """Loss angle by frequency: interpolated linearly in the logarithms, constant outside."""

    frequency: list[units.Frequency] = key("Hz, ascending", min_length=1, max_length=10000)
    angle: list[units.PositiveLossAngle] = key(
        "loss angle at each of them, rad", min_length=1, max_length=10000
    )

    rules = (key_rules.same_length("angle", "frequency"), key_rules.ascending("frequency"))


class MaterialLoss(Table, frozen=True):
    """Losses, for the models in which wires bend."""

    angle: units.LossAngle | None = key("constant loss angle of the bulk in rad")
    table: LossTable | None = key("loss angle of the bulk by frequency, linear in the logarithms")
    surface_depth: units.Separation | None = key(
        "dissipation depth of the surface in m; default 0, or that of the built-in material unless"
        " the design gives another loss of the bulk"
    )
    thermoelastic: bool | None = key(
        "false omits thermoelastic loss, which needs density, expansion, specific heat"
        " and conductivity"
    )


class Material(Table, frozen=True):
    """A material of wires or blades; defaults are those of the built-in one of the same name."""

    youngs_modulus: units.Modulus | AgainstTemperature | None = key("Young's modulus in Pa")
    poisson_ratio: units.PoissonRatio | None = None
    density: units.Density | None = None
    thermal_expansion: units.Expansion | AgainstTemperature | None = None
    modulus_slope: units.ModulusSlope | AgainstTemperature | None = None
    specific_heat: units.SpecificHeat | AgainstTemperature | None = None
    thermal_conductivity: units.ThermalConductivity | AgainstTemperature | None = None
    tensile_strength: units.Strength | None = key(
        "stress in Pa at which it breaks (blades: yields)"
    )
    loss_angle: units.LossAngle | None = key("constant loss angle in rad, short for loss.angle")
    loss: MaterialLoss | None = None
    temperature_range: tuple[units.Kelvin, units.Kelvin] | None = key(
        "temperatures in K between which plain numbers apply; default any in a design,"
        " 280 to 310 K if built in"
    )
    source: str = key("where the numbers come from", "")

    def check(self) -> Problems:
        """Check the values of tables against the bounds of plain numbers."""
        for name, kind in BOUNDS.items():
            given = getattr(self, name)
            bounds = kind.__metadata__[0]
            if not isinstance(given, AgainstTemperature):
                continue
            for temperature, value in zip(given.temperature, given.values, strict=True):
                if not bounds.ge <= value <= bounds.le:
                    unit = bounds.extra["unit"]
                    problem = f"is {value:g} at {temperature:g} K, not {bounds.ge:g}"
                    yield f"{name}.values", f"{problem} to {bounds.le:g} {unit}", "check its unit"
                    break
        if self.temperature_range and self.temperature_range[0] > self.temperature_range[1]:
            yield "temperature_range", "has the highest temperature first", "exchange them"


BOUNDS: dict[str, Any] = {
    "youngs_modulus": units.Modulus,
    "thermal_expansion": units.Expansion,
    "modulus_slope": units.ModulusSlope,
    "specific_heat": units.SpecificHeat,
    "thermal_conductivity": units.ThermalConductivity,
}
"""Keys of a material that may be tables against temperature, and the types of their numbers."""


MaterialAtTemperature = Any
"""A `Material` whose properties are numbers, those at one temperature."""


def at_temperature(material: Material, temperature: float) -> MaterialAtTemperature:
    """Give a material at a temperature in K: tables against temperature become numbers."""
    values = {
        name: given.at(temperature)
        for name in BOUNDS
        if isinstance(given := getattr(material, name), AgainstTemperature)
    }
    return msgspec.structs.replace(material, **values) if values else material


class Mechanism:
    """A mechanism of loss, with the constants of one material: a frozen dataclass.

    Materials are from `look_up`, with None for what is unknown; properties may be tables against
    temperature (`value_at`).

    Loss angles are in rad, finite at zero frequency, and add up; `omega` is in rad/s, of any shape,
    not negative, or complex (of a damped mode).
    """

    name: ClassVar[str]
    """For messages."""
    uniform: ClassVar[bool] = False
    """Whether it acts in every deformation; otherwise in bending alone."""
    cause: ClassVar[str] = ""
    """Cause under which `pendsus thermal` lists its dissipation in the bending of wires: ``clamps``
    for ``test.clamps``; "" to list it with the bending of either end."""

    @classmethod
    def check(cls, own: Any, material: Any) -> Problems:
        """Check a design's table of a material; `material` has the built-in values too."""
        del own, material
        yield from ()

    @classmethod
    def of(cls, material: Any, wire: Table | None) -> Self | None:
        """Read the constants from a material and the table of the wire (None for a blade).

        None if this mechanism does not act.
        """
        raise NotImplementedError

    def bending(
        self, shape: CrossSection, plane: int, omega: Frequencies, temperature: float
    ) -> Spectrum:
        """Loss angle of bending in one plane; with a `coefficient` a, divided by a^2."""
        raise NotImplementedError

    def stretching(self, shape: CrossSection, omega: Frequencies) -> Spectrum:
        """Loss angle of stretching, and by default of twisting; 0 unless `uniform`."""
        import numpy as np

        del shape
        return np.zeros(np.shape(omega))

    twisting = stretching

    def coefficient(self, area: float, temperature: float) -> tuple[float, float] | None:
        """(p, q) of a bending angle proportional to a^2, with a = p - q T at the tension T (N).

        At most one mechanism of a material has it.
        """
        del area, temperature
        return None

    @property
    def acts_unstrained(self) -> bool:
        """Whether it has a loss without static strain."""
        return True


@dataclass(frozen=True)
class Bulk(Mechanism):
    """Loss of bulk and surface."""

    name: ClassVar[str] = "bulk"
    uniform: ClassVar[bool] = True

    angle: float  # constant, of the bulk, rad
    table: tuple[tuple[float, ...], tuple[float, ...]] | None = None  # Hz and rad, instead
    surface_depth: float = 0.0  # dissipation depth d_s, m

    @classmethod
    def check(cls, own: Any, material: Any) -> Problems:
        """Check that one loss of the bulk is given."""
        if (loss := own.loss) is None:
            return
        if loss.angle is not None and own.loss_angle is not None:
            problem = "conflicts with loss_angle, which is short for it"
            yield "loss.angle", problem, "keep one of the two"
        if loss.surface_depth and material.loss.angle is None and material.loss.table is None:
            problem = "has no effect without a loss of the bulk, to which it is relative"
            yield "loss.surface_depth", problem, "give angle or table too"
        if loss.table is not None and (own.loss_angle is not None or loss.angle is not None):
            yield "loss.table", "conflicts with a constant loss angle", "keep one of the two"

    @classmethod
    def of(cls, material: Any, wire: Table | None) -> Self | None:
        """Read the constants; None for a material without bulk loss."""
        del wire
        loss = material.loss
        if loss.table is None and not loss.angle:
            return None
        table = loss.table and (tuple(loss.table.frequency), tuple(loss.table.angle))
        return cls(loss.angle or 0.0, table, loss.surface_depth or 0.0)

    def bending(
        self, shape: CrossSection, plane: int, omega: Frequencies, temperature: float
    ) -> Spectrum:
        """Loss angle of bending in one plane, rad."""
        del temperature
        return self._at(omega, shape.bending_ratio(plane))

    def stretching(self, shape: CrossSection, omega: Frequencies) -> Spectrum:
        """Loss angle of stretching, rad."""
        return self._at(omega, shape.stretching_ratio)

    def twisting(self, shape: CrossSection, omega: Frequencies) -> Spectrum:
        """Loss angle of twisting, rad."""
        return self._at(omega, shape.twisting_ratio)

    def _at(self, omega: Frequencies, ratio: float) -> Spectrum:
        """Loss angle of bulk and surface for mu S/V = `ratio` in 1/m."""
        import numpy as np

        surface = 1 + self.surface_depth * ratio
        if self.table is None:
            return (self.angle + 0.0 * np.asarray(omega)) * surface
        frequency, angle = self.table
        inside = np.clip(np.real(omega) / (2 * math.pi), frequency[0], frequency[-1])
        return np.exp(np.interp(np.log(inside), np.log(frequency), np.log(angle))) * surface


CONSTANTS = ("density", "thermal_expansion", "specific_heat", "thermal_conductivity")
"""Keys of a material that thermoelastic loss needs beside Young's modulus."""


@dataclass(frozen=True)
class Thermoelastic(Mechanism):
    """Thermoelastic loss of bending."""

    name: ClassVar[str] = "thermoelastic"

    youngs_modulus: Property  # Pa
    density: float  # kg/m^3
    expansion: Property  # linear thermal expansion alpha, 1/K
    modulus_slope: Property  # beta = (1/E) dE/dT, 1/K
    heat_capacity: Property  # specific heat, J/(kg K)
    conductivity: Property  # thermal, W/(m K)

    @classmethod
    def check(cls, own: Any, material: Any) -> Problems:
        """Check that a material with ``thermoelastic = true`` has the constants."""
        missing = [key for key in CONSTANTS if getattr(material, key) is None]
        if own.loss is not None and own.loss.thermoelastic and missing:
            problem = f"has no effect without {', '.join(missing)}"
            yield "loss.thermoelastic", problem, "give what is missing, or remove it"

    @classmethod
    def of(cls, material: Any, wire: Table | None) -> Self | None:
        """Read the constants; None where one is unknown, or with ``thermoelastic = false``."""
        del wire
        constants = [getattr(material, key) for key in ("youngs_modulus", *CONSTANTS)]
        if material.loss.thermoelastic is False or None in constants:
            return None
        modulus, density, expansion, capacity, conductivity = constants
        slope = material.modulus_slope or 0.0
        return cls(modulus, density, expansion, slope, capacity, conductivity)

    def bending(
        self, shape: CrossSection, plane: int, omega: Frequencies, temperature: float
    ) -> Spectrum:
        """Loss angle over a^2, K^2; 0 for a blade of unknown thickness."""
        import numpy as np

        depth = shape.depth[plane]
        if math.isinf(depth):
            return 0.0 * (np.asarray(omega) + temperature)
        capacity = self.density * value_at(self.heat_capacity, temperature)
        conductivity = value_at(self.conductivity, temperature)
        strength = value_at(self.youngs_modulus, temperature) * temperature / capacity
        phase = np.asarray(omega) * (capacity * (depth / 2) ** 2 / conductivity)
        return strength * shape.relaxation(phase)

    def coefficient(self, area: float, temperature: float) -> tuple[float, float]:
        """a without tension, 1/K, and its decrease per tension, 1/(K N)."""
        stiffness = value_at(self.youngs_modulus, temperature) * area
        slope = value_at(self.modulus_slope, temperature)
        return value_at(self.expansion, temperature), slope / stiffness

    @property
    def acts_unstrained(self) -> bool:
        """Whether the material expands."""
        return self.expansion != 0


MECHANISMS: tuple[type[Mechanism], ...] = (Bulk, Thermoelastic)


def mechanisms_of(material: Any, wire: Table | None) -> tuple[Mechanism, ...]:
    """List the mechanisms that act in a material, from `look_up`, and wire (or blade)."""
    found = (kind.of(material, wire) for kind in MECHANISMS)
    return tuple(one for one in found if one is not None)


BUILT_IN = msgspec.convert(
    tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8")),
    dict[str, Material],
)
"""Built-in materials by name; the file has their sources."""


class WithMaterials(Protocol):
    """A design, as far as its materials."""

    @property
    def materials(self) -> dict[str, Material]:
        """Tables of materials by name."""
        ...

    @property
    def constants(self) -> Any:
        """Constants, among them the temperature in K."""
        ...


def look_up(design: WithMaterials, name: str) -> Material:
    """Look up a material: values of the design, then built-in ones, with all losses in `loss`.

    Properties may be tables against temperature. A surface depth is relative to the loss angle of
    the bulk, so both built-in ones are dropped if the design gives a bulk loss.
    """
    own = design.materials.get(name, Material())
    base = BUILT_IN.get(name, Material())
    loss = _given(base.loss)
    own_loss = _given(own.loss)
    if own.loss_angle is not None:
        own_loss = {"angle": own.loss_angle, **own_loss}
    if {"angle", "table"} & own_loss.keys():
        loss = {key: loss[key] for key in loss.keys() - {"angle", "table", "surface_depth"}}
    return msgspec.structs.replace(base, **_given(own) | {"loss": MaterialLoss(**loss | own_loss)})


def resolve(
    design: WithMaterials, name: str, temperature: float | None = None
) -> MaterialAtTemperature:
    """Look up a material at a temperature in K (None: that of the design), with numbers alone."""
    there = design.constants.temperature if temperature is None else temperature
    return at_temperature(look_up(design, name), there)


def find_unknown(design: WithMaterials, name: str, temperature: float) -> Iterator[tuple[str, str]]:
    """List keys of a material whose values do not apply at a temperature (K), each with its range.

    Plain numbers of a design apply at any temperature unless it gives a `temperature_range`.
    """
    own = design.materials.get(name, Material())
    base = BUILT_IN.get(name, Material())
    found = look_up(design, name)
    given = own.loss_angle is not None or own.loss is not None
    for property_name in (*BOUNDS, "loss"):
        value = getattr(found, property_name)
        if isinstance(value, AgainstTemperature):
            if problem := value.unknown_range(temperature):
                yield property_name, problem
            continue
        from_design = getattr(own, property_name) is not None
        if property_name == "loss":
            from_design = given
        limits = own.temperature_range or (None if from_design else base.temperature_range)
        missing = value is None or value == MaterialLoss()
        if limits is not None and not missing and not limits[0] <= temperature <= limits[1]:
            yield property_name, f"known from {limits[0]:g} to {limits[1]:g} K"


def _given(table: Material | MaterialLoss | None) -> dict[str, Any]:
    """Values that a table gives."""
    values = {} if table is None else msgspec.structs.asdict(table)
    return {key: value for key, value in values.items() if value not in (None, "")}


def constant_angle(design: WithMaterials, name: str) -> float:
    """Look up the constant loss angle that the design itself gives a material, rad; 0 if none.

    It is the only loss of a material in the string model.
    """
    own = design.materials.get(name, Material())
    return getattr(own.loss, "angle", None) or own.loss_angle or 0.0


def known(design: WithMaterials) -> list[str]:
    """List the names of materials that a design may use."""
    return sorted({*BUILT_IN, *design.materials})
