"""Local control: loops and their filters, noise of sensors, OSEMs (sensor and coil at a point)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Literal

from msgspec import Meta

from suspension_cli.design import foton, key_rules, noise_spectra, units
from suspension_cli.design.noise_spectra import MotionNoise, Noise
from suspension_cli.design.typed_tables import Problems, Table, doc, given, key

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
    sensor_noise: MotionNoise = key("as that of a loop, m/sqrt(Hz)", 0.0)
    force_noise: Noise = key("of the coil, N/sqrt(Hz), in the forms of sensor_noise", 0.0)
    driver_noise: Noise = key(
        "of the driver's input, V/sqrt(Hz), in the forms of sensor_noise; known: dac-18bit", 0.0
    )
    coil: units.Positive | None = key("force per current, N/A", unit="N/A")
    transconductance: units.Positive | None = key("current per input voltage, A/V", unit="A/V")
    counts_per_volt: units.Positive | None = key("counts per voltage, 1/V", unit="1/V")
    range: units.Positive | None = key("largest input, V; without transconductance current, A")

    def check(self) -> Problems:
        """Check the direction."""
        if not any(self.vector):
            yield "direction", "has no direction", "give x, y, z, not all zero"
        yield from noise_spectra.problems(self, "sensor_noise", "force_noise", "driver_noise")

    rules = (
        key_rules.needs("transconductance", "coil"),
        key_rules.needs("counts_per_volt", "transconductance"),
        key_rules.needs("driver_noise", "transconductance"),
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

    def actuator_density(self, frequency: ArrayLike) -> Float[np.ndarray, " frequency"]:
        """Amplitude spectral density of the force, N/sqrt(Hz), at frequencies in Hz."""
        import numpy as np

        force_per_input = (self.transconductance or 0.0) * (self.coil or 0.0)
        driven = force_per_input * noise_spectra.density(self.driver_noise, frequency)
        return np.hypot(noise_spectra.density(self.force_noise, frequency), driven)


Hertz = Annotated[float, Meta(ge=-1e9, le=1e9)]
Root = Annotated[
    list[Hertz | Annotated[list[Hertz], doc(count=2)]],
    doc("roots in Hz, positive for the left half plane, or [re, im] for a conjugate pair"),
]


class GainAt(Table, frozen=True):
    """Magnitude of a filter at one frequency, which sets its gain."""

    frequency: units.Frequency
    magnitude: units.Number = key("|H| there, N/m (N m/rad); if negative, reverses the sign of H")


FOTON = 'a Foton string: zpk([z;z],[p;p],k,"n"), gain(k), pole(f,"n"), ... and products of these'


class DigitalFilter(Table, frozen=True):
    """A digital filter: sections of a Foton filter file, or a design with a sample rate."""

    file: str | None = key("Foton filter file (.txt) of a front end, from this file's folder")
    module: str | None = key("name of the filter module in the file: M0_DAMP_L")
    sections: list[Annotated[int, Meta(ge=1, le=10)]] = key("sections that are on: 1 is FM1", [])
    design: str | None = key(f"{FOTON}, made digital as Foton does; of a file, its sections")
    rate: float | None = key("sample rate in Hz of the design", unit="Hz", gt=0, le=1e9)
    gain: float = key("factor on the filter", 1.0, unit="1", ge=-1e12, le=1e12)
    source: str = key("where the design comes from; filled in for a file", "")

    rules = (
        key_rules.exactly_one("file", "design"),
        key_rules.needs("file", "module"),
        key_rules.needs("file", "sections"),
        key_rules.together("design", "rate"),
    )

    def check(self) -> Problems:
        """Check that a file was read."""
        if self.file is not None:
            remedy = "read the design from its file, or give design and rate"
            yield "file", "is read only with a design file, not with its text alone", remedy


def make_response(given: str | DigitalFilter) -> foton.Filter:
    """Make the filter that a key gives; raises `FotonError`."""
    if isinstance(given, str):
        return foton.parse(given)
    made = foton.parse(given.design or "gain(1)", given.rate or 0.0)
    return replace(made, gain=made.gain * given.gain)


class Loop(Table, frozen=True):
    """One local control loop from a sensor y to an actuator u = -H(f) R(f) exp(-2 pi i f T) y.

    H is a velocity damper, or gain times the product of (i f + z) over zeros z divided by that of
    (i f + p) over poles p, or a Foton string; R the response of the sensor, T a delay.
    """

    name: units.Name
    sensor: str = key("a motion of a stage: upper.x, upper.x@0,0,0.01")
    actuator: str = key("a force or torque on a stage: upper.force_x")
    reference: Reference = key(
        '"support": between body and support structure; "inertial": inertial space',
        "support",
    )
    damper: float | None = key("force per velocity, N s/m (N m s/rad)", ge=-1e12, le=1e12)
    gain: units.Number | None = key(
        "H = gain times the product of (i f + z) over that of (i f + p); N/m (N m/rad)"
        " times Hz^(number of poles - number of zeros)"
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


def expand_roots(given: Sequence[float | list[float]]) -> tuple[complex, ...]:
    """List roots in Hz as complex numbers; a pair [re, im] stands for both conjugates."""
    pairs = ((one, [one[0], -one[1]]) if isinstance(one, list) else ([one],) for one in given)
    return tuple(complex(*root) for pair in pairs for root in pair)


class Control(Table, frozen=True):
    """Local control."""

    loop: list[Loop] = key(min_length=1)
    osem: list[Osem] = key("sensors and coils at points of stages", [])

    rules = (key_rules.unique("loop", "osem"),)
