"""A quantity of each kind, and its value from the commands that print it for one design.

The values are read from modes, responses, statics, budgets, poles and margins; none is computed by
`quantities/`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

import suspension_cli as sus

SINGLE = sus.template("single").text.replace(
    "[stage.wires]",
    """[stage.blades]
count = 2
loss_angle = 1e-3

[stage.blades.geometry]
length = 0.2
base_width = 0.05
thickness = 1.5e-3
shape_factor = 1.5
material = "maraging"

[[perturbation]]
body = "test"
com_offset = [1e-4, 2e-4, 0.0]

[[control.loop]]
name = "x"
sensor = "test.x"
actuator = "test.force_x"
damper = 2.0
sensor_noise = 1e-10

[stage.wires]""",
)
"""A pendulum on blades, with a loop, whose body is not quite in place."""
FREE = sus.template("single").text
"""Without loops, and with losses in wires only."""
HEATED = FREE + "[heat]\nheld = { support = 290.0 }\nabsorbed = { test = 1e-4 }\n"
"""Without loops, and with a mirror that absorbs heat."""
DOUBLE = sus.example("double").text
COIL = """
[[control.osem]]
name = "F1"
stage = "test"
at = [0.0, 0.0, 0.0]
direction = "x"
sensor_noise = 1e-10
"""
WITH_COIL = SINGLE.replace("sensor_noise = 1e-10\n", "") + COIL
WIRES = "stage.test.wires"
LENGTH = f"{WIRES}.l", 0.29
HEIGHT = f"{WIRES}.d", 1.3e-3
RADIUS = f"{WIRES}.radius", 1.03e-4
ABSORBED = "heat.absorbed.test", 1.1e-4
MASS = "stage.test.body.mass", 5.8
BEAM = {"fidelity": "beam"}
BODY_RADIUS = 0.09

Printed = Callable[[sus.Design], float]


def _temperature(design: sus.Design) -> float:
    known = {one.name: one.temperature for one in sus.check(design).statics.temperatures}
    return known["test"]


def _labelled(label: str, column: str, design: sus.Design) -> float:
    modes = sus.modes(design, **BEAM)
    return float(getattr(modes, column)[list(modes.label).index(label)])


def _frequencies(design: sus.Design, *motions: str) -> list[float]:
    """Frequencies of all modes of some motions, ascending."""
    modes = sus.modes(design, **BEAM)
    pairs = zip(modes.frequency.tolist(), modes.label, strict=True)
    return sorted(value for value, label in pairs if label.endswith(motions))


def _third(design: sus.Design) -> float:
    return float(sus.modes(design, **BEAM).frequency[2])


def _lowest_pitch(design: sus.Design) -> float:
    return _frequencies(design, "pitch")[0]


def _second_in_plane(design: sus.Design) -> float:
    return _frequencies(design, "pitch", "longitudinal")[1]


def _difference(design: sus.Design) -> float:
    [yaw] = _frequencies(design, "yaw")
    return abs(_lowest_pitch(design) - yaw)


def _distance(design: sus.Design) -> float:
    [yaw] = _frequencies(design, "yaw")
    low, high = sorted([_lowest_pitch(design), yaw])
    return high / low - 1


def _closed_pole(design: sus.Design) -> complex:
    """Pole of the pendulum with its loop closed: the one next to the mode without loops."""
    mode = 2 * np.pi * _labelled("test longitudinal", "frequency", design)
    poles = sus.damp(design, **BEAM).closed.value
    return complex(poles[np.abs(np.abs(poles) - mode).argmin()])


def _quality(design: sus.Design) -> float:
    pole = _closed_pole(design)
    return abs(pole) / (-2 * pole.real)


def _decay(design: sus.Design) -> float:
    return -_closed_pole(design).real


def _settling(design: sus.Design) -> float:
    return 1 / _decay(design)


def _violin(design: sus.Design) -> float:
    modes = sus.modes(design, fidelity="violin", max_frequency=600.0)
    pairs = zip(modes.frequency.tolist(), modes.label, strict=True)
    return min(value for value, label in pairs if label.startswith("test violin"))


def _response(design: sus.Design, drive: str, *outputs: str, frequency: object) -> np.ndarray:
    """Magnitudes by frequency and output."""
    asked = {"inputs": [drive], "outputs": list(outputs), "frequency": frequency}
    return np.abs(sus.response(design, **asked, **BEAM).value[:, :, 0])


def _at_10_hz(design: sus.Design) -> float:
    return float(_response(design, "support.x", "test.x", frequency=[10.0])[0, 0])


def _largest(design: sus.Design) -> float:
    return float(_response(design, "support.x", "test.x", frequency="2:5:50").max())


def _coupling(design: sus.Design) -> float:
    """Of the point of the mirror that `[analysis.xcouple]` observes by default."""
    points = [f"test.{axis}@0,0,-0.001" for axis in "xz"]
    [[over, under]] = _response(design, "support.z", *points, frequency=[50.0])
    return float(over / under)


def _thermal(output: str, frequency: float, design: sus.Design) -> float:
    found = sus.thermal(design, outputs=[output], frequency=[frequency], **BEAM)
    return float(found.amplitude[0, 0])


def _torque(design: sus.Design) -> float:
    [[turned]] = _response(design, "test.torque_yaw", "test.yaw", frequency=[1e-3])
    return _thermal("test.yaw", 1e-3, design) / float(turned)


def _noise(design: sus.Design) -> float:
    found = sus.budget(design, outputs=["test.x"], frequency=[10.0, 11.0], **BEAM)
    return float(found.amplitude[0, 0])


def _rms(design: sus.Design) -> float:
    found = sus.budget(design, outputs=["test.x"], frequency="0.5:5:1000", **BEAM)
    return float(found.rms[0, 0])


def _coil_rms(design: sus.Design) -> float:
    found = sus.budget(design, outputs=["test.x"], frequency="0.5:5:1000", **BEAM)
    [drive] = found.drive
    return float(drive.force)


def _margin(which: str, design: sus.Design) -> float:
    [margin] = sus.damp(design, fidelity="string").margin
    return float(getattr(margin, which))


def _largest_load(part: str, what: str, design: sus.Design) -> float:
    loads = getattr(sus.check(design).statics, part)
    return max(float(getattr(load, what)) for load in loads)


def _first_wire(design: sus.Design) -> float:
    return float(sus.check(design).statics.wires[0].fraction)


def _static_pitch(design: sus.Design) -> float:
    return float(sus.check(design).statics.bodies[0].rotation[1])


def _height(design: sus.Design) -> float:
    """Of the centre of the cylinder: above its lowest point, but for what imperfections move it."""
    [lowest] = sus.check(design.replace({"perturbation": []})).statics.lowest
    [moved] = sus.check(design).statics.bodies
    return -float(lowest.z) - BODY_RADIUS - float(moved.shift[2])


def _fraction(design: sus.Design) -> float:
    modes = sus.modes(design, **BEAM)
    [upper, _] = modes.energy[list(modes.label).index("test pitch")]
    return float(upper[4])


@dataclass(frozen=True)
class Example:
    """A quantity of a kind, on a design, with a number that changes it, and what prints it.

    `accuracy` is that of what is printed: frequencies with losses, integrals over a grid.
    """

    kind: str
    name: str
    number: tuple[str, float]
    printed: Printed
    text: str = SINGLE
    fidelity: str = "beam"
    accuracy: float = 1e-5


EXAMPLES = (
    Example("STAGE MOTION, STAGE MOTION#N", "test pitch", HEIGHT, _lowest_pitch),
    Example("N", "3", LENGTH, _third),
    Example("lowest MOTION", "lowest pitch", HEIGHT, _lowest_pitch),
    Example("FAMILY N", "longitudinal-pitch 2", HEIGHT, _second_in_plane, FREE),
    Example("distance MODE, MODE", "distance test pitch, lowest yaw", LENGTH, _distance),
    Example("difference MODE, MODE", "difference test pitch, yaw 1", LENGTH, _difference, FREE),
    Example("Q of MODE", "Q of test longitudinal", MASS, _quality),
    Example("decay of MODE", "decay of test longitudinal", MASS, _decay),
    Example("settling of MODE", "settling of test longitudinal", MASS, _settling),
    Example(
        "dilution of MODE",
        "dilution of test yaw",
        LENGTH,
        partial(_labelled, "test yaw", "dilution"),
        FREE,
    ),
    Example(
        "top fraction of MODE",
        "top fraction of test pitch",
        LENGTH,
        partial(_labelled, "test pitch", "top_fraction"),
        DOUBLE,
    ),
    Example(
        "fraction of STAGE MOTION in MODE",
        "fraction of upper pitch in test pitch",
        LENGTH,
        _fraction,
        DOUBLE,
    ),
    Example("STAGE violin ORDER, lowest violin", "test violin 1", RADIUS, _violin, FREE),
    Example(
        "OUTPUT/INPUT:FREQUENCY, OVER/UNDER/INPUT:FREQUENCY",
        "test.x/support.x:10",
        LENGTH,
        _at_10_hz,
    ),
    Example("coupling", "coupling", HEIGHT, _coupling),
    Example(
        "peak|largest|smallest of OUTPUT/INPUT:LOW:HIGH",
        "largest of test.x/support.x:2:5",
        LENGTH,
        _largest,
        FREE,
    ),
    Example(
        "thermal MOTION:FREQUENCY", "thermal test.x:10", RADIUS, partial(_thermal, "test.x", 10.0)
    ),
    Example("force noise FORCE:FREQUENCY", "force noise test.torque_yaw:0.001", RADIUS, _torque),
    Example("noise MOTION:FREQUENCY", "noise test.x:10", LENGTH, _noise),
    Example(
        "rms MOTION, rms MOTION:LOW:HIGH, rms coil OSEM",
        "rms test.x:0.5:5",
        LENGTH,
        _rms,
        accuracy=3e-4,
    ),
    Example(
        "rms MOTION, rms MOTION:LOW:HIGH, rms coil OSEM",
        "rms coil F1:0.5:5",
        LENGTH,
        _coil_rms,
        WITH_COIL,
        accuracy=3e-4,
    ),
    Example(
        "stable",
        "stable",
        ("control.loop.x.damper", -2.0),
        lambda design: float(sus.damp(design, fidelity="string").stable),
        fidelity="string",
    ),
    Example(
        "margin LOOP.gain|phase|delay|distance",
        "margin x.delay",
        MASS,
        partial(_margin, "delay"),
        fidelity="string",
    ),
    Example(
        "tension WIRE, tension STAGE wires",
        "tension test wires",
        MASS,
        partial(_largest_load, "wires", "tension"),
        fidelity="string",
    ),
    Example(
        "stress WIRE, stress STAGE wires|blades",
        "stress test wires",
        RADIUS,
        partial(_largest_load, "wires", "stress"),
        fidelity="string",
    ),
    Example(
        "stress fraction WIRE, stress fraction STAGE wires|blades",
        "stress fraction test.1",
        RADIUS,
        _first_wire,
        fidelity="string",
    ),
    Example(
        "sag of BLADE, sag of STAGE blades",
        "sag of test blades",
        MASS,
        partial(_largest_load, "blades", "sag"),
        fidelity="string",
    ),
    Example(
        "STAGE static x|y|height|roll|pitch|yaw",
        "test static pitch",
        HEIGHT,
        _static_pitch,
        fidelity="string",
    ),
    Example("STAGE height", "test height", LENGTH, _height, FREE, "string"),
    Example(
        "temperature of STAGE", "temperature of test", ABSORBED, _temperature, HEATED, "string"
    ),
)
