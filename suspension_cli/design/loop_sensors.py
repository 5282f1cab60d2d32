"""Sensors that loops read by name: physical ones, and ones that are computed from others.

A physical sensor reads a motion, or a sum of motions, through its own response, with its noise. A
computed one is a sum of sensors and of forces of loops, each through a filter: a blend of two
sensors, or an estimator that is told what was driven.

>>> low = SensorInput(sensor="cps", filter='zpk([],[0.1],1,"n")')
>>> blend = Sensor(name="stage", blend=True, inputs=[low, SensorInput(sensor="l4c", filter="rest")])
>>> blend.rest
'l4c'
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Annotated

from msgspec import Meta

from suspension_cli.design import foton, key_rules, noise_spectra, units
from suspension_cli.design.loop_filters import (
    FOTON,
    DigitalFilter,
    Root,
    expand_roots,
    make_response,
)
from suspension_cli.design.noise_spectra import MotionNoise
from suspension_cli.design.typed_tables import Problems, Table, given, key
from suspension_cli.errors import suggest

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import Complex, Float

REST = "rest"
"""Filter of the input of a blend that takes what the other filters leave of 1."""
BLENDS = 1e-2
"""Largest difference of the sum of the filters of a blend from 1: printed coefficients of filters
in use reach 4e-3 (log 86588 of LIGO Hanford)."""
TILTS = {"x": ("pitch", -1.0), "y": ("roll", 1.0)}
"""Angle that a sensor along an axis reads as acceleration, and the sign of this over gravity."""
BAND = (1e-3, 1e3, 2000)
"""Lowest and highest frequency, Hz, and number of points at which blends are summed."""


Motions = Annotated[dict[str, units.Number], Meta(min_length=1, max_length=100)]
"""Factors of motions by name."""


class SensorInput(Table, frozen=True):
    """What a computed sensor reads: another sensor, or the force of a loop."""

    sensor: units.Name | None = key("name of another [[control.sensor]]")
    drive: units.Name | None = key("name of a loop: the force (torque) that it demands, N (N m)")
    filter: str | DigitalFilter | None = key(
        f'{FOTON}; or a digital filter; "rest" in a blend: what the others leave of 1'
    )
    zeros: Root = []
    poles: Root = []
    gain: float = key(
        "factor on the filter: with zeros z and poles p, on prod(1 + i f/z) / prod(1 + i f/p)",
        1.0,
        ge=-1e12,
        le=1e12,
    )

    rules = (
        key_rules.exactly_one("sensor", "drive"),
        key_rules.excludes(
            "filter", "zeros", "poles", problem="conflicts with filter, which has its own"
        ),
    )

    @property
    def is_rest(self) -> bool:
        """Whether it takes what the other filters of a blend leave of 1."""
        return self.filter == REST

    @property
    def key_of_filter(self) -> str:
        """Key that gives the filter; "" if there is a gain alone."""
        return next(iter(given(self, "filter", "poles", "zeros")), "")

    @property
    def made(self) -> foton.Filter:
        """The filter with its gain; that of the rest is 1. A root at 0 Hz is a factor i f."""
        whole = foton.Filter(self.gain)
        if self.filter is not None:
            return whole if self.is_rest else whole * make_response(self.filter)
        zeros, poles = expand_roots(self.zeros), expand_roots(self.poles)
        at_rest = math.prod(abs(root) or 1.0 for root in poles)
        at_rest /= math.prod(abs(root) or 1.0 for root in zeros)
        return foton.Filter(self.gain * at_rest, zeros, poles)

    def check(self) -> Problems:
        """Check that the filter can be built."""
        if self.is_rest and (self.drive is not None or self.gain != 1):
            yield "filter", '"rest" goes with a sensor, without gain', "give a filter"
        elif self.filter is not None and not self.is_rest:
            yield from check_filter(self, "filter")
        elif self.key_of_filter:
            yield from _check_growth(self.made, "zeros")


class Sensor(Table, frozen=True):
    """A sensor that loops read by its name."""

    name: units.Name
    motion: str | Motions | None = key(
        '"support.x", "upper~support.x", or motions with factors, {"upper.x" = 1}'
    )
    response: str | DigitalFilter | None = key(f"reading over motion: {FOTON}; or a digital filter")
    sensor_noise: MotionNoise = key("as motion, in the forms of that of a loop", 0.0)
    tilt: bool = key(
        "whether it is inertial, along x or y, and reads tilt as motion: x + g pitch / (2 pi f)^2",
        default=False,
    )
    inputs: list[SensorInput] = key("of a computed sensor: sensors, and forces of loops", [])
    blend: bool = key("whether the filters of its inputs have to sum to 1", default=False)

    rules = (
        key_rules.any_of("motion", "inputs"),
        key_rules.excludes("motion", "inputs"),
        key_rules.needs("response", "motion"),
        key_rules.needs("sensor_noise", "motion"),
        key_rules.needs("blend", "inputs"),
        key_rules.needs("tilt", "response"),
    )

    @property
    def motions(self) -> dict[str, float]:
        """Motions that it reads, with their factors."""
        if isinstance(self.motion, str):
            return {self.motion: 1.0}
        return self.motion or {}

    @property
    def rest(self) -> str:
        """Name of the sensor that takes what the other filters of a blend leave of 1, or ""."""
        return next((one.sensor or "" for one in self.inputs if one.is_rest), "")

    def check(self) -> Problems:
        """Check filters and noise."""
        yield from noise_spectra.problems(self, "sensor_noise")
        if given(self, "response"):
            yield from check_filter(self, "response")
        if self.tilt:
            yield from self._check_tilt()
        rests = sum(one.is_rest for one in self.inputs)
        if rests and (not self.blend or rests > 1 or any(one.drive for one in self.inputs)):
            problem = '"rest" is for one input of a blend of sensors'
            yield "inputs", problem, "give blend = true and filters to all others, or this filter"

    def _check_tilt(self) -> Problems:
        """Check that a sensor that reads tilt is inertial, horizontal, and blind to what rests."""
        text = self.motion if isinstance(self.motion, str) else ""
        axis = text.partition("@")[0].rpartition(".")[2]
        if axis not in TILTS or "~" in text:
            problem = "is not the motion along x or y that an inertial sensor with tilt reads"
            yield "motion", problem, "give one motion, such as support.x; or leave out tilt"
        if self.response is None:
            return
        try:
            made = make_response(self.response)
        except foton.FotonError:
            return  # a fault of the response
        if made.rate or sum(zero == 0 for zero in made.zeros) < 2:
            problem = "has less than two zeros at 0 Hz, or is digital, so a tilt at rest is read as"
            problem += " an infinite motion"
            remedy = "give that of a seismometer: zpk([0;0],[0.006+i*0.006;0.006-i*0.006],...)"
            yield "response", problem, remedy

    @property
    def tilt_reading(self) -> tuple[Sensor, foton.Filter] | None:
        """The angle that it reads as motion, and its reading over this angle per gravity.

        In a frame with the pitch t about y, along whose x axis gravity is g t, the acceleration
        x'' - g t is read as that of the motion x + g t / (2 pi f)^2; with the roll r about x
        y'' + g r. None if it does not read tilt.
        """
        if not self.tilt or not isinstance(self.motion, str) or self.response is None:
            return None
        made = make_response(self.response)
        zeros = list(made.zeros)
        for _ in range(2):
            zeros.remove(next(zero for zero in zeros if zero == 0))
        stage, _, axis = self.motion.partition("@")[0].rpartition(".")
        angle, sign = TILTS[axis]
        # divided by s^2 = (2 pi i f)^2
        gain = sign * made.gain / (2 * math.pi) ** 2
        angles = Sensor(name=f"{self.name} tilt", motion=f"{stage}.{angle}")
        return angles, foton.Filter(gain, tuple(zeros), made.poles)


def check_filter(table: Table, name: str) -> Problems:
    """Check that the filter of a key is understood, and does not grow with frequency."""
    try:
        made = make_response(getattr(table, name)).continuous
    except foton.FotonError as error:
        yield name, error.problem, error.remedy
        return
    yield from _check_growth(made, name)


def _check_growth(made: foton.Filter, name: str) -> Problems:
    zeros = len(made.zeros)
    poles = len(made.poles)
    if zeros > poles:
        problem = f"a filter with more zeros ({zeros}) than poles ({poles}) cannot be built"
        yield name, problem, "add poles, or its gain grows with frequency without bound"


def check_sensors(sensors: Sequence[Sensor], drives: Sequence[str]) -> Problems:
    """Check that inputs name sensors and loops, do not go round, and that blends sum to 1.

    `drives` are the names of the loops. Keys are those below `[control]`.
    """
    known = [one.name for one in sensors]
    sound = True
    for sensor in sensors:
        for n, one in enumerate(sensor.inputs, 1):
            key_of_input = f"sensor.{sensor.name}.inputs.{n}"
            if one.sensor is not None and one.sensor not in known:
                sound = False
                yield (
                    f"{key_of_input}.sensor",
                    "names no [[control.sensor]]",
                    suggest(one.sensor, known),
                )
            if one.drive is not None and one.drive not in drives:
                yield f"{key_of_input}.drive", "names no loop", suggest(one.drive, [*drives])
    if not sound:
        return
    if around := _find_circle(sensors):
        problem = f"reads itself: {' reads '.join(around)}"
        remedy = "a sensor may read what loops have driven (drive), not its own reading"
        yield f"sensor.{around[0]}.inputs", problem, remedy
        return
    for sensor in sensors:
        if sensor.blend:
            yield from _check_blend(sensor, sensors)


def _find_circle(sensors: Sequence[Sensor]) -> list[str]:
    """Find computed sensors that read one another in a circle; names from one to itself."""
    reads = {one.name: [own.sensor for own in one.inputs if own.sensor] for one in sensors}

    def follow(names: list[str]) -> Iterator[list[str]]:
        for name in reads[names[-1]]:
            if name == names[0]:
                yield [*names, name]
            elif name not in names:
                yield from follow([*names, name])

    return next((found for name in reads for found in follow([name])), [])


def _check_blend(sensor: Sensor, sensors: Sequence[Sensor]) -> Problems:
    """Check that the filters of a blend sum to 1."""
    if sensor.rest:
        return
    try:
        size, at = largest_difference(sensor, sensors)
    except foton.FotonError:
        return  # a fault of that filter
    if not size <= BLENDS:
        problem = f"is a blend whose filters sum to 1 only within {size:.3g}, at {at:.3g} Hz"
        remedy = (
            f'at most {BLENDS:g} is allowed: give one input filter = "rest" (what the others leave'
            " of 1), or leave out blend"
        )
        yield f"sensor.{sensor.name}.inputs", problem, remedy


def largest_difference(sensor: Sensor, sensors: Sequence[Sensor]) -> tuple[float, float]:
    """Largest difference of the sum of a blend's filters from 1, and its frequency (Hz).

    With the responses of the sensors, from `BAND`'s lowest to its highest frequency.
    """
    import numpy as np

    frequency = np.geomspace(BAND[0], BAND[1], BAND[2])
    difference = np.abs(sum_of_filters(sensor, sensors, frequency) - 1)
    worst = int(difference.argmax())
    return float(difference[worst]), float(frequency[worst])


def sum_of_filters(
    sensor: Sensor, sensors: Sequence[Sensor], frequency: Float[np.ndarray, " frequency"]
) -> Complex[np.ndarray, " frequency"]:
    """Sum the filters of a computed sensor, with the responses of the sensors that it reads."""
    import numpy as np

    named = {one.name: one for one in sensors}
    total = np.zeros(len(frequency), dtype=complex)
    for one in sensor.inputs:
        if one.sensor is None:
            continue
        whole = one.made
        response = named[one.sensor].response
        if response is not None:
            whole = whole * make_response(response)
        total += whole.at(frequency)
    return total


def reads_force(sensors: Sequence[Sensor]) -> set[str]:
    """Names of the loops whose forces sensors read."""
    return {one.drive for sensor in sensors for one in sensor.inputs if one.drive is not None}


def is_plain(sensor: Sensor) -> bool:
    """Whether a sensor reads motions as they are, so that a damper can act on their velocity."""
    return bool(sensor.motions) and sensor.response is None
