"""Local control: loops and their filters, noise of sensors, OSEMs (sensor and coil at a point)."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Literal

from suspension_cli.design import foton, key_rules, loop_sensors, noise_spectra, units
from suspension_cli.design.loop_filters import (
    FOTON,
    DigitalFilter,
    Root,
    expand_roots,
    make_response,
)
from suspension_cli.design.loop_sensors import Sensor, check_filter
from suspension_cli.design.noise_spectra import MotionNoise, Noise
from suspension_cli.design.typed_tables import Problems, Table, given, key

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import Float
    from numpy.typing import ArrayLike

Reference = Literal["support", "inertial"]


class Osem(Table, frozen=True):
    """An optical sensor and electromagnetic actuator: senses and pushes a body along a line."""

    name: units.Name
    stage: units.Name = key("the stage that it senses and pushes", names="stage")
    at: units.Vector = key("the point, from the stage's COM, m")
    direction: Literal["x", "y", "z", "-x", "-y", "-z"] | units.Direction = key(
        "of positive readings and forces: an axis, or a vector"
    )
    reference: Reference = key("that of a loop, whose OSEMs have the same one", "support")
    sensing: units.Row6 | None = key(
        "reading per motion of the stage along and about x, y, z, m/m and m/rad;"
        " default from at and direction"
    )
    driving: units.Row6 | None = key(
        "forces and torques on the stage along and about x, y, z per force of the"
        " coil, N/N and N m/N; default from at and direction"
    )
    sensor_noise: MotionNoise = key("as that of a loop, m/sqrt(Hz)", 0.0)
    force_noise: Noise = key("of the coil, N/sqrt(Hz), in the forms of sensor_noise", 0.0)
    driver_noise: Noise = key(
        "of the driver's input, V/sqrt(Hz), in the forms of sensor_noise; known: dac-18bit", 0.0
    )
    coil: units.Positive | None = key("force per current, N/A", unit="N/A")
    transconductance: units.Positive | None = key("current per input voltage, A/V", unit="A/V")
    driver_response: str | DigitalFilter | None = key(
        f"of the driver, current over that of transconductance: {FOTON}; or a digital filter"
    )
    counts_per_volt: units.Positive | None = key("counts per voltage, 1/V", unit="1/V")
    range: units.Positive | None = key("largest input, V; without transconductance current, A")

    def check(self) -> Problems:
        """Check the direction."""
        if not any(self.vector):
            yield "direction", "has no direction", "give x, y, z, not all zero"
        for name in given(self, "sensing", "driving"):
            if not any(getattr(self, name)):
                yield name, "is 0 for all motions", "remove it, or give six numbers, not all zero"
        yield from noise_spectra.problems(self, "sensor_noise", "force_noise", "driver_noise")
        if self.driver_response is not None:
            yield from check_filter(self, "driver_response")

    rules = (
        key_rules.needs("transconductance", "coil"),
        key_rules.needs("counts_per_volt", "transconductance"),
        key_rules.needs("driver_noise", "transconductance"),
        key_rules.needs("driver_response", "transconductance"),
        key_rules.needs("range", "coil"),
    )

    @property
    def vector(self) -> tuple[float, ...]:
        """Unit vector of the direction."""
        along = self.direction
        if isinstance(along, str):
            along = [(-1.0 if along[0] == "-" else 1.0) * (along[-1] == axis) for axis in "xyz"]
        size = math.hypot(*along) or 1.0
        return tuple(part / size for part in along)

    @property
    def geometric_row(self) -> tuple[float, ...]:
        """Reading per motion, and forces per force of the coil, of `at` and `direction`."""
        (px, py, pz), (dx, dy, dz) = self.at, self.vector
        return dx, dy, dz, py * dz - pz * dy, pz * dx - px * dz, px * dy - py * dx

    @property
    def sensing_row(self) -> tuple[float, ...]:
        """Reading per motion of the stage along and about x, y, z, m/m and m/rad."""
        return self.geometric_row if self.sensing is None else tuple(self.sensing)

    @property
    def driving_row(self) -> tuple[float, ...]:
        """Forces and torques on the stage per force of the coil, N/N and N m/N."""
        return self.geometric_row if self.driving is None else tuple(self.driving)

    @property
    def largest_force(self) -> float:
        """Largest force of the coil, N; infinite without `range`."""
        if self.range is None or self.coil is None:
            return math.inf
        return self.range * (self.transconductance or 1.0) * self.coil

    def driver_size(self, frequency: ArrayLike) -> Float[np.ndarray, " frequency"]:
        """Magnitude of the response of the driver at frequencies in Hz, 1 if it is not given."""
        import numpy as np

        at = np.asarray(frequency, dtype=float)
        if self.driver_response is None:
            return np.ones(at.shape)
        return np.abs(make_response(self.driver_response).at(at))

    def actuator_density(self, frequency: ArrayLike) -> Float[np.ndarray, " frequency"]:
        """Amplitude spectral density of the force, N/sqrt(Hz), at frequencies in Hz."""
        import numpy as np

        force_per_input = (self.transconductance or 0.0) * (self.coil or 0.0)
        driven = force_per_input * noise_spectra.density(self.driver_noise, frequency)
        driven = driven * self.driver_size(frequency)
        return np.hypot(noise_spectra.density(self.force_noise, frequency), driven)


class GainAt(Table, frozen=True):
    """Magnitude of a filter at one frequency, which sets its gain."""

    frequency: units.Frequency
    magnitude: units.Number = key("|H| there, N/m (N m/rad); if negative, reverses the sign of H")


class Loop(Table, frozen=True):
    """One local control loop from a sensor y to an actuator u = -H(f) R(f) exp(-2 pi i f T) y.

    H is a velocity damper, or gain times the product of (i f + z) over zeros z divided by that of
    (i f + p) over poles p, or a Foton string; R the response of the sensor, T a delay.
    """

    name: units.Name
    sensor: str = key("a motion, upper.x or upper.x@0,0,0.01, or the name of a [[control.sensor]]")
    actuator: str = key("a force or torque: upper.force_x")
    reference: Reference = key(
        '"support": between body and support structure; "inertial": inertial space',
        "support",
    )
    damper: float | None = key("force per velocity, N s/m (N m s/rad)", ge=-1e12, le=1e12)
    gain: units.Number | None = key(
        "H = gain prod(i f + z) / prod(i f + p); N/m (N m/rad) times Hz^(poles - zeros)"
    )
    zeros: Root = []
    poles: Root = []
    filter: str | DigitalFilter | None = key(
        f"H in N/m (N m/rad) as {FOTON}; or a digital filter: sections of a Foton filter file"
    )
    gain_at: GainAt | None = key("sets the gain of zeros and poles, or of filter")
    delay: float = key("delay of the loop in s, exp(-2 pi i f delay)", 0.0, unit="s", ge=0, le=10.0)
    sensor_response: str | DigitalFilter | None = key(
        f"reading over motion of the sensor: {FOTON}; or a digital filter"
    )
    sensor_noise: MotionNoise = key(
        "as motion, m/sqrt(Hz) or rad/sqrt(Hz): flat, a known sensor, [[f, asd], ...], a table, or"
        " a file",
        0.0,
    )
    actuator_noise: Noise = key("N/sqrt(Hz) or N m/sqrt(Hz), in the forms of sensor_noise", 0.0)

    rules = (
        key_rules.exactly_one("damper", "gain", "filter", when=lambda loop: loop.gain_at is None),
        key_rules.excludes("gain_at", "damper", "gain"),
        key_rules.excludes(
            "filter", "zeros", "poles", problem="conflicts with filter, which has its own"
        ),
        key_rules.excludes(
            "damper", "zeros", "poles", problem="conflicts with damper, which has none"
        ),
    )

    def check(self) -> Problems:
        """Check that the gain can be set, and does not grow without bound."""
        yield from noise_spectra.problems(self, "sensor_noise", "actuator_noise")
        for name in given(self, "filter", "sensor_response"):
            try:
                make_response(getattr(self, name))
            except foton.FotonError as error:
                yield name, error.problem, error.remedy
                return
        if self.gain_at is not None:
            size = abs(self.without_gain_at.at(self.gain_at.frequency))
            if not 0 < size < math.inf or self.gain_at.magnitude == 0:
                problem = "the gain cannot be set where the filter is 0 or infinite, or to 0"
                yield "gain_at", problem, "give another frequency or magnitude"
                return
        whole = self.controller_and_sensor.continuous
        zeros = len(whole.zeros)
        poles = len(whole.poles)
        if zeros <= poles or (self.damper is not None and self.sensor_response is None):
            return  # a damper acts on the velocity, which is known
        key = given(self, "filter", "sensor_response", "zeros")[0]
        what = "a filter" if self.sensor_response is None else "a filter and sensor"
        problem = f"{what} with more zeros ({zeros}) than poles ({poles}) cannot be built"
        yield key, problem, "add poles, or its gain grows with frequency without bound"

    @property
    def without_gain_at(self) -> foton.Filter:
        """The filter H before `gain_at` is applied, without sensor and delay."""
        if self.damper is not None:
            return foton.Filter(2 * math.pi * self.damper, (0j,))
        if self.filter is not None:
            return make_response(self.filter)
        gain = self.gain
        if gain is None:
            gain = 0.0 if self.gain_at is None else 1.0
        return foton.Filter(gain, expand_roots(self.zeros), expand_roots(self.poles))

    @property
    def controller(self) -> foton.Filter:
        """The filter H, without sensor and delay."""
        bare = self.without_gain_at
        if self.gain_at is None:
            return bare
        size = abs(bare.at(self.gain_at.frequency))
        return replace(bare, gain=bare.gain * self.gain_at.magnitude / size)

    @property
    def controller_and_sensor(self) -> foton.Filter:
        """The filter from motion to force: controller and sensor, without the delay."""
        made = self.controller
        return made if self.sensor_response is None else made * make_response(self.sensor_response)


class Control(Table, frozen=True):
    """Local control."""

    loop: list[Loop] = key(min_length=1)
    osem: list[Osem] = key("sensors and coils at points of stages", [])
    sensor: list[Sensor] = key("sensors that loops read by name", [])

    rules = (key_rules.unique("loop", "osem", "sensor"),)

    def named_sensor(self, loop: Loop) -> Sensor | None:
        """The sensor that a loop reads by its name; None if it reads a motion."""
        return next((one for one in self.sensor if one.name == loop.sensor), None)

    def check(self) -> Problems:
        """Check sensors that are read by name."""
        yield from loop_sensors.check_sensors(self.sensor, [loop.name for loop in self.loop])
        driving = loop_sensors.reads_force(self.sensor)
        for loop in self.loop:
            path = f"loop.{loop.name}"
            if loop.damper is not None and loop.name in driving:
                problem = "is a damper, whose force grows with frequency, so no sensor can read it"
                yield path, problem, "give a filter with as many poles as zeros"
            sensor = self.named_sensor(loop)
            if sensor is None:
                continue
            for name in ("sensor_response", "sensor_noise"):
                if not getattr(loop, name):
                    continue
                problem = f"conflicts with the sensor {sensor.name}, which has its own"
                yield f"{path}.{name}", problem, f"give it in [[control.sensor]] {sensor.name}"
            if loop.damper is not None and not loop_sensors.is_plain(sensor):
                problem = "is a damper, but its sensor does not read motions as they are"
                yield path, problem, "give a filter with as many poles as zeros"
