"""Faulty designs, and what the command must say of each: a table."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import date
from math import inf, nan
from typing import Any

from tests.support.commandline import MISSING, Edits
from tests.support.designs import TEXTS

STAGE = ("stage", 0)
WIRES = (*STAGE, "wires")
BODY = (*STAGE, "body")
WIRE = (*STAGE, "wire", 0)
BLADE = (*STAGE, "blade", 0)
SPRING = (*STAGE, "spring", 0)
LOOP = ("control", "loop", 0)

DIAGONAL = {"mass": 5.6, "inertia": [0.02, 0.02, 0.02]}
RING = {"count": 3, "l": 0.28, "ring": 0.05, "material": "steel302", "radius": 1e-4}
PROFILE = {"position": [0.0, 0.28], "diameter": [2e-4, 2e-4]}
HALF_RING = {key: value for key, value in RING.items() if key != "ring"} | {"ring_upper": 0.1}
UNSORTED = {"position": [0.0, 0.2, 0.1, 0.28], "diameter": [2e-4] * 4}
SIX = [1.0, 1.0, 1.0, 1.0, 1.0, 1.0]
HANGING = {"upper": [0.0, 0.0, 0.0], "lower": [0.0, 0.0, 0.0], "k": 1e4}


@dataclass(frozen=True)
class Case:
    """One faulty design and the line that it must give.

    Attributes
    ----------
    name : str
    edits : dict
        What spoils the base, see `commandline.edited`.
    says : str
        How the line goes on after the file: ``KEY = VALUE: PROBLEM``, or the beginning of it.
    remedy : str
        A part of what comes after the semicolon.
    base : str
        Which of `designs.RAW` is spoilt.
    """

    name: str
    edits: Edits
    says: str
    remedy: str = ""
    base: str = field(default="single")


def wires(key: str, value: Any, problem: str, shown: str, remedy: str = "") -> Case:
    """A value of the wires of the single pendulum that will not do."""
    return Case(
        f"{key}-{shown}"[:40],
        {(*WIRES, key): value},
        f"stage.test.wires.{key} = {shown}: {problem}",
        remedy,
    )


TYPES = [
    wires("l", "0.4", "must be a number", '"0.4"', "loaded length of each wire, m"),
    wires("l", True, "must be a number", "true"),
    wires("l", date(2026, 1, 2), "must be a number", "2026-01-02"),
    wires("l", [0.4], "must be a number", "[0.4]"),
    wires("l", {"m": 0.4}, "must be a number", "{m}"),
    wires("material", 302, "must be a string", "302"),
    wires("material", 'no"name\n', "", r'"no\"name\n"', "letters, digits"),
    wires("count", "4", "must be an integer", '"4"', "number of wires"),
    wires("count", 0, "must be at least 1", "0"),
    wires("section", 1e-4, "must be a table", "0.0001", "width, thickness"),
    Case(
        "stage-table",
        {("stage",): {"name": "test"}},
        "stage = {name}: must be an array",
        "[[stage]]",
    ),
    Case("stage-of-numbers", {("stage",): [1]}, "stage.1 = 1: must be a table", "name, body"),
    Case("design-string", {("design",): "single"}, 'design = "single": must be a table', "name"),
    Case("materials-array", {("materials",): []}, "materials = []: must be a table"),
    Case(
        "material-number",
        {("materials", "x"): 1},
        "materials.x = 1: must be a table",
        "youngs_modulus",
    ),
    Case("wires-array", {WIRES: [{"count": 4}]}, "stage.test.wires = [{count}]: must be a table"),
    Case(
        "inertia-number",
        {BODY: {"mass": 1.0, "inertia": 0.1}},
        "stage.test.body.inertia = 0.1: must be an array",
        "moments of inertia",
    ),
    Case("title-number", {("design", "title"): 1}, "design.title = 1: must be a string"),
]

NUMBERS = [
    wires("l", -0.4, "must be at least 1e-09", "-0.4"),
    wires("l", 0, "must be at least 1e-09", "0"),
    wires("s", -0.01, "must be at least 0", "-0.01"),
    wires("l", nan, "must be finite", "nan"),
    wires("l", inf, "must be finite", "inf"),
    wires("d", -inf, "must be finite", "-inf"),
    wires("l", 1e300, "must be at least 1e-09 and at most 100000", "1e+300"),
    wires("d", -1e300, "must be at least -100000", "-1e+300"),
    wires("l", 10**399, "must be at least 1e-09 and at most 100000", "1" + 56 * "0" + "..."),
    wires("k", 0.0, "must be at least 1e-12", "0.0"),
    wires("l", 1e-320, "must be at least 1e-09", "1e-320"),
    Case(
        "mass-negative",
        {BODY: {**DIAGONAL, "mass": -5.6}},
        "stage.test.body.mass = -5.6: must be at least",
        "mass in kg",
    ),
    Case(
        "gravity-zero",
        {("constants", "gravity"): 0.0},
        "constants.gravity = 0.0: must be greater than 0",
    ),
    Case(
        "poisson",
        {("materials", "x"): {"poisson_ratio": 0.5}},
        "materials.x.poisson_ratio = 0.5: must be greater than -1 and less than 0.5",
    ),
]

KEYS = [
    Case("no-design", {("design",): MISSING}, "design: missing", "a table with name"),
    Case("no-stage", {("stage",): MISSING}, "stage: missing", "bodies, top to bottom"),
    Case("stage-empty", {("stage",): []}, "stage = []: has 0 elements", "bodies, top to bottom"),
    Case("no-name", {("design", "name"): MISSING}, "design.name: missing", "letters, digits"),
    Case("no-stage-name", {(*STAGE, "name"): MISSING}, "stage.1.name: missing"),
    Case("no-body", {BODY: MISSING}, "stage.test.body: missing"),
    Case(
        "no-l",
        {(*WIRES, "l"): MISSING},
        "stage.test.wires.l: missing",
        "loaded length of each wire, m",
    ),
    Case("no-s", {(*WIRES, "s"): MISSING}, "stage.test.wires.s: missing", "half separation in x"),
    Case(
        "no-t1", {(*WIRES, "t1"): MISSING}, "stage.test.wires.t1: missing", "half separation in y"
    ),
    Case(
        "no-material",
        {(*WIRES, "material"): MISSING},
        "stage.test.wires.material: missing",
        "k in N/m",
    ),
    Case("no-radius", {(*WIRES, "radius"): MISSING}, "stage.test.wires.radius: missing", "section"),
    Case(
        "unknown-key",
        {(*WIRES, "raduis"): 1e-4},
        "stage.test.wires.raduis = 0.0001: unknown key",
        "did you mean 'radius'?",
    ),
    Case(
        "unknown-table", {("stages",): [{}]}, "stages = [{}]: unknown key", "did you mean 'stage'?"
    ),
    Case(
        "odd-key",
        {(*WIRES, "a\nb; c"): 1},
        r'stage.test.wires."a\nb; c" = 1: unknown key',
        "known here",
    ),
    Case(
        "unknown-material",
        {(*WIRES, "material"): "steel320"},
        'stage.test.wires.material = "steel320": names no material',
        "did you mean 'steel302'?",
    ),
    Case(
        "material-name",
        {("materials", "a b"): {"youngs_modulus": 1e11}},
        'materials."a b": ',
        "letters, digits",
    ),
    Case(
        "no-modulus",
        {("materials", "mine"): {"density": 1e3}},
        "materials.mine.youngs_modulus: missing",
        "Pa",
    ),
    Case("design-name", {("design", "name"): "../x"}, 'design.name = "../x": ', "letters, digits"),
    Case(
        "design-name-newline",
        {("design", "name"): "x\n"},
        r'design.name = "x\n": ',
        "letters, digits",
    ),
    Case(
        "support",
        {(*STAGE, "name"): "support"},
        'stage.support.name = "support": is the name of the suspension point',
    ),
    Case(
        "same-stage",
        {("stage", 1, "name"): "upper"},
        'stage.upper.name = "upper": is the name of an earlier stage',
        base="double",
    ),
    Case(
        "hangs-later",
        {(*STAGE, "hangs_from"): "test"},
        'stage.upper.hangs_from = "test": names no earlier stage',
        base="rich",
    ),
    Case(
        "hangs-unknown",
        {("stage", 1, "hangs_from"): "uper"},
        'stage.test.hangs_from = "uper": names no earlier',
        "did you mean 'upper'?",
        "rich",
    ),
    Case(
        "hangs-itself",
        {("stage", 1, "hangs_from"): "test"},
        'stage.test.hangs_from = "test": names no earlier stage',
        base="rich",
    ),
    Case(
        "unknown-analysis",
        {("analysis", "mode"): {}},
        "analysis.mode: unknown command",
        "did you mean 'modes'?",
    ),
    Case(
        "unknown-option",
        {("analysis", "modes", "fidelty"): "string"},
        'analysis.modes.fidelty = "string": no option',
        "did you mean 'fidelity'?",
    ),
    Case(
        "bad-option",
        {("analysis", "modes", "fidelity"): "best"},
        "analysis.modes.fidelity = \"best\": 'best' is not one of",
        "--help",
    ),
    Case(
        "bad-flag",
        {("analysis", "modes", "plot"): "perhaps"},
        'analysis.modes.plot = "perhaps": must be true or false',
        "--help",
    ),
    Case(
        "flag-date",
        {("analysis", "modes", "plot"): date(2026, 1, 2)},
        "analysis.modes.plot = 2026-01-02: must be true or false",
        "--help",
    ),
    Case(
        "option-array",
        {("analysis", "modes", "fidelity"): ["a", "b"]},
        'analysis.modes.fidelity = ["a", "b"]: ',
        "--help",
    ),
    Case("analysis-number", {("analysis", "modes"): 1}, "analysis.modes = 1: must be a table"),
    Case(
        "analysis-nan",
        {("analysis", "xcouple", "k"): nan},
        "analysis.xcouple.k = nan: must be finite",
    ),
    Case("analysis-huge", {("analysis", "xcouple", "k"): 2**70}, f"analysis.xcouple.k = {2**70}: "),
]

GEOMETRY = [
    wires(
        "l",
        0.015,
        "the wire is not longer than its horizontal span of 0.015 m",
        "0.015",
        "longer wire",
    ),
    Case(
        "span-x",
        {(*WIRES, "s"): MISSING, (*WIRES, "s_upper"): 0.0, (*WIRES, "s_lower"): 1.0},
        "stage.test.wires.l = 0.28: the wire is not longer than",
    ),
    Case(
        "s-twice",
        {(*WIRES, "s_upper"): 0.02},
        "stage.test.wires.s = 0.01: conflicts with s_upper or s_lower",
    ),
    Case(
        "s-half",
        {(*WIRES, "s"): MISSING, (*WIRES, "s_upper"): 0.02},
        "stage.test.wires: s_upper and s_lower go together",
        "give both",
    ),
    Case(
        "s-for-two",
        {(*WIRES, "count"): 2},
        "stage.test.wires.s = 0.01: must be 0 for 2 wires",
        "remove it",
    ),
    Case(
        "t-for-one",
        {(*WIRES, "count"): 1, (*WIRES, "s"): MISSING, (*WIRES, "t1"): MISSING},
        "stage.test.wires.t2 = 0.095: must be 0 for 1 wire",
    ),
    Case(
        "radius-and-section",
        {(*WIRES, "section"): {"width": 1e-3, "thickness": 1e-4}},
        "stage.test.wires.radius = 0.0001: conflicts with a section",
    ),
    Case(
        "set-and-wires",
        {(*STAGE, "wire"): [HANGING]},
        "stage.test.wire: conflicts with a symmetric set",
        "keep one",
    ),
    Case(
        "hangs-on-nothing",
        {WIRES: MISSING, (*STAGE, "position"): [0, 0, -1]},
        "stage.test: none of wires, wire, spring, inverted_pendulum",
        "give one: wires",
    ),
    Case(
        "position-superfluous",
        {(*STAGE, "position"): [0.0, 0.0, -0.3]},
        "stage.test.position = [0.0, 0.0, -0.3]: a symmetric set implies",
        "keep one",
    ),
    Case(
        "position-missing",
        {(*STAGE, "position"): MISSING},
        "stage.upper.position: missing",
        "nominal COM from the COM above",
        "rich",
    ),
    Case(
        "position-short",
        {(*STAGE, "position"): [0.0, 0.0]},
        "stage.upper.position = [0.0, 0.0]: must be an array of 3 numbers",
        "x, y, z",
        "rich",
    ),
    Case(
        "position-nan",
        {(*STAGE, "position"): [0.0, nan, 0.0]},
        "stage.upper.position.2 = nan: must be finite",
        "",
        "rich",
    ),
    Case(
        "ends-at-one-point",
        {(*WIRE, "lower"): [0.01, 0.1, 0.4]},
        "stage.upper.wire.1.lower = [0.01, 0.1, 0.4]: both ends",
        "check upper",
        "rich",
    ),
    Case(
        "length-and-tension",
        {(*WIRE, "tension"): 1.0, (*WIRE, "natural_length"): 0.4},
        "stage.upper.wire.1.tension = 1.0: conflicts with",
        "one",
        "rich",
    ),
    Case(
        "wire-unknown-blade",
        {("stage", 0, "wire", 2, "blade"): "lift"},
        'stage.upper.wire.3.blade = "lift": names no',
        "did you mean 'left'?",
        "rich",
    ),
]

BLADES = [
    Case(
        "two-ways",
        {(*BLADE, "uncoupled_frequency"): 3.0},
        "stage.upper.blade.left: stiffness and uncoupled_frequency are both given",
        "exactly one",
        "rich",
    ),
    Case(
        "no-way",
        {(*BLADE, "stiffness"): MISSING},
        "stage.upper.blade.left: none of stiffness, uncoupled_frequency, geometry",
        "exactly one",
        "rich",
    ),
    Case(
        "set-two-ways",
        {(*STAGE, "blades", "stiffness"): 1e3},
        "stage.test.blades: stiffness and geometry are both given",
        "exactly one",
        "blades",
    ),
    Case(
        "blade-count",
        {(*STAGE, "blades", "count"): 4},
        "stage.test.blades.count = 4: cannot carry 2 wires",
        "give 1 or 2",
        "blades",
    ),
    Case(
        "blades-without-set",
        {(*STAGE, "blades"): {"count": 2, "stiffness": 1e3}},
        "stage.upper.blades: has no effect without wires",
        "[[stage.blade]]",
        "rich",
    ),
    Case(
        "blade-material",
        {(*STAGE, "blades", "geometry", "material"): "maragin"},
        'stage.test.blades.geometry.material = "maragin"',
        "'maraging'",
        "blades",
    ),
    Case(
        "blade-same-name",
        {("stage", 0, "blade", 1, "name"): "left", ("stage", 0, "wire", 1, "blade"): "left"},
        'stage.upper.blade.left.name = "left": is also the name of an earlier blade',
        base="rich",
    ),
    Case(
        "blade-idle",
        {("stage", 0, "wire", 1, "blade"): MISSING},
        "stage.upper.blade.right: carries no wire",
        'blade = "right"',
        "rich",
    ),
    Case(
        "tip-light",
        {(*BLADE, "tip_mass"): 1e-30},
        "stage.upper.blade.left.tip_mass = 1e-30: is too small",
        "give 0",
        "rich",
    ),
    Case(
        "tip-mass",
        {(*BLADE, "tip_mass"): -1.0},
        "stage.upper.blade.left.tip_mass = -1.0: must be at least 0",
        "kg",
        "rich",
    ),
]

BODIES = [
    Case(
        "shape-and-inertia",
        {(*BODY, "inertia"): [1.0, 1.0, 1.0]},
        "stage.test.body.inertia = [1.0, 1.0, 1.0]: conflicts with shape",
        "remove",
    ),
    Case("no-inertia", {BODY: {"mass": 1.0}}, "stage.test.body.inertia: missing", "moments"),
    Case("no-mass", {BODY: {"inertia": [1.0, 1.0, 1.0]}}, "stage.test.body.mass: missing", "kg"),
    Case(
        "no-shape",
        {BODY: {**DIAGONAL, "radius": 0.1}},
        'stage.test.body.radius = 0.1: goes with shape = "cylinder"',
        "change shape",
    ),
    Case(
        "mass-and-density",
        {(*BODY, "density"): 1e3},
        "stage.test.body: mass and density are both given",
        "exactly one",
    ),
    Case(
        "no-body-radius",
        {(*BODY, "radius"): MISSING},
        "stage.test.body.radius: missing",
        "radius of a cylinder, m",
    ),
    Case(
        "box-radius",
        {
            (*BODY, "shape"): "box",
            (*BODY, "size"): [0.1] * 3,
            (*BODY, "axis"): MISSING,
            (*BODY, "length"): MISSING,
        },
        "stage.test.body.radius = 0.09: goes with shape",
        "remove",
    ),
    Case(
        "shape",
        {(*BODY, "shape"): "ball"},
        'stage.test.body.shape = "ball": must be one of box, cylinder',
    ),
    Case(
        "hole",
        {(*BODY, "inner_radius"): 0.09},
        "stage.test.body.inner_radius = 0.09: is not below radius = 0.09",
        "smaller",
    ),
    Case(
        "inertia-zero",
        {BODY: {"mass": 1.0, "inertia": [0.1, 0.0, 0.1]}},
        "stage.test.body.inertia = [0.1, 0.0, 0.1]: has a moment of inertia of 0 kg m^2",
    ),
    Case(
        "inertia-mixed",
        {BODY: {"mass": 1.0, "inertia": [0.1, [0.0, 0.1, 0.0], 0.1]}},
        "stage.test.body.inertia = [0.1, [0.0, 0.1, 0.0], 0.1]: mixes",
    ),
    Case(
        "inertia-skew",
        {BODY: {"mass": 1.0, "inertia": [[1, 0.1, 0], [0.2, 1, 0], [0, 0, 1]]}},
        "stage.test.body.inertia = [[1.0, 0.1, 0.0], [0.2, 1.0, 0.0], [0.0, 0.0, 1.0]]: is not"
        " symmetric",
    ),
    Case(
        "inertia-indefinite",
        {BODY: {"mass": 1.0, "inertia": [[1, 2, 0], [2, 1, 0], [0, 0, 1]]}},
        "stage.test.body.inertia = [[1.0, 2.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 1.0]]: has a"
        " moment of inertia of -1 kg m^2",
    ),
    Case(
        "inertia-two",
        {BODY: {"mass": 1.0, "inertia": [0.1, 0.1]}},
        "stage.test.body.inertia = [0.1, 0.1]: has 2 elements",
        "3x3",
    ),
    Case(
        "inertia-denormal",
        {BODY: {"mass": 1.0, "inertia": [0.1, 1e-320, 0.1]}},
        "stage.test.body.inertia.2 = 1e-320: is too small",
    ),
    Case(
        "mass-of-shape",
        {BODY: {"shape": "box", "size": [1e-8] * 3, "density": 1.0}},
        "stage.test.body.density = 1.0: the body has 1e-24 kg",
        "sizes",
    ),
    Case(
        "spring-skew",
        {(*SPRING, "stiffness"): [[1.0, 2.0, 0, 0, 0, 0], *([0.0] * 6 for _ in range(5))]},
        "stage.upper.spring.1.stiffness = [",
        "equal",
        "rich",
    ),
    Case(
        "spring-mixed",
        {(*SPRING, "damping"): [[1.0] * 6, 1, 1, 1, 1, 1]},
        "stage.upper.spring.1.damping = [",
        "six rows",
        "rich",
    ),
    Case(
        "spring-five",
        {(*SPRING, "stiffness"): SIX[:5]},
        "stage.upper.spring.1.stiffness = [1.0, 1.0, 1.0, 1.0, 1.0]: has 5 elements",
        "6x6",
        "rich",
    ),
]

AROUND = [
    Case(
        "frame-rigid",
        {("support", "stiffness"): {}},
        "support.stiffness: leaves the support rigid in every direction",
        "leave [support] out",
        "rich",
    ),
    Case(
        "frame-stage",
        {("stage", 2, "name"): "frame"},
        'stage.frame.name = "frame": is the name of the support structure',
        "another",
        "rich",
    ),
    Case(
        "frame-mass",
        {("support", "mass"): -1.0},
        "support.mass = -1.0: must be at least 0",
        "kg",
        "rich",
    ),
    Case(
        "frame-light",
        {("support", "mass"): 1e-140},
        "support.mass = 1e-140: is too small",
        "give 0",
        "rich",
    ),
    Case(
        "frame-thin",
        {("support", "inertia"): [0.0, 1e-99, 0.0]},
        "support.inertia = [0.0, 1e-99, 0.0]: is too small",
        "give 0",
        "rich",
    ),
    Case(
        "damped-against",
        {(*STAGE, "damping", "against"): "suport"},
        'stage.upper.damping.against = "suport": names no',
        "did you mean 'support'?",
        "rich",
    ),
    Case(
        "damped-negative",
        {(*STAGE, "damping", "x"): -0.1},
        "stage.upper.damping.x = -0.1: must be at least 0",
        "N s/m",
        "rich",
    ),
    Case("no-loop", {("control", "loop"): []}, "control.loop = []: has 0 elements", "", "rich"),
    Case(
        "loop-twice",
        {(*LOOP, "gain"): 1.0},
        "control.loop.swing: damper and gain are both given",
        "exactly one",
        "rich",
    ),
    Case(
        "loop-name",
        {("control", "loop", 1, "name"): "swing"},
        'control.loop.swing.name = "swing": is also the name of an earlier loop',
        "own",
        "rich",
    ),
    Case(
        "loop-zeros",
        {("control", "loop", 1, "poles"): []},
        "control.loop.turn.zeros = [0.1]: a filter with more zeros (1) than poles (0)",
        "add poles",
        "rich",
    ),
    Case(
        "loop-filter",
        {(*LOOP, "poles"): [1.0]},
        "control.loop.swing.poles = [1.0]: conflicts with damper, which has none",
        "keep one",
        "rich",
    ),
    Case(
        "loop-foton",
        {(*LOOP, "damper"): MISSING, (*LOOP, "filter"): "zpk([0],[1+i],2)"},
        'control.loop.swing.filter = "zpk([0],[1+i],2)": column 1: zpk has no conjugate of',
        "add 1-i*1",
        "rich",
    ),
    Case(
        "loop-foton-order",
        {(*LOOP, "damper"): MISSING, (*LOOP, "filter"): "zero(3)"},
        'control.loop.swing.filter = "zero(3)": a filter with more zeros (1) than poles (0)',
        "without bound",
        "rich",
    ),
    Case(
        "loop-foton-twice",
        {(*LOOP, "filter"): "gain(1)"},
        "control.loop.swing: damper and filter are both given",
        "exactly one",
        "rich",
    ),
    Case(
        "loop-sensor",
        {(*LOOP, "sensor_response"): "gain(2"},
        'control.loop.swing.sensor_response = "gain(2": column 1:',
        "zpk",
        "rich",
    ),
    Case(
        "loop-delay",
        {(*LOOP, "delay"): -1e-3},
        "control.loop.swing.delay = -0.001: must be at least 0",
        "delay of the loop in s",
        "rich",
    ),
    Case(
        "loop-gain-at",
        {(*LOOP, "damper"): MISSING, (*LOOP, "gain_at"): {"frequency": 1.0, "magnitude": 0.0}},
        "control.loop.swing.gain_at: the gain cannot be set",
        "another frequency",
        "rich",
    ),
    Case(
        "loop-noise-lists",
        {(*LOOP, "sensor_noise"): {"frequency": [1.0, 2.0], "asd": [1e-9, 1e-9, 1e-9]}},
        "control.loop.swing.sensor_noise: asd and frequency are lists of one length",
        "frequency = [...]",
        "rich",
    ),
    Case(
        "loop-noise-order",
        {(*LOOP, "sensor_noise"): {"frequency": [2.0, 1.0], "asd": [1e-9, 1e-9]}},
        "control.loop.swing.sensor_noise.frequency = [2.0, 1.0]: is not in ascending order",
        "sort",
        "rich",
    ),
    Case(
        "loop-noise-zero",
        {(*LOOP, "sensor_noise"): {"frequency": [1.0, 2.0], "asd": [1e-9, 0.0]}},
        "control.loop.swing.sensor_noise.asd.2 = 0.0: must be greater than 0",
        "give",
        "rich",
    ),
    Case(
        "loop-noise-mixed",
        {(*LOOP, "sensor_noise"): {"asd": [1e-9, 1e-9]}},
        "control.loop.swing.sensor_noise: asd and frequency are lists of one length",
        "corner",
        "rich",
    ),
    Case(
        "loop-root",
        {(*LOOP, "poles"): [[1.0]]},
        "control.loop.swing.poles.1 = [1.0]: has 1 elements",
        "",
        "rich",
    ),
]

PERTURBATIONS = [
    Case(
        "nothing-named",
        {("perturbation",): [{"k_factor": 1.1}]},
        "perturbation.1: none of wire, body, blade, leg, link",
        "exactly one",
    ),
    Case(
        "both-named",
        {("perturbation",): [{"wire": "test.1", "body": "test"}]},
        "perturbation.1: wire and body are both given",
    ),
    Case(
        "no-such-wire",
        {("perturbation",): [{"wire": "test.5", "k_factor": 1.1}]},
        'perturbation.1.wire = "test.5": names no wire',
        "test.",
    ),
    Case(
        "no-wire-name",
        {("perturbation",): [{"wire": "test", "k_factor": 1.1}]},
        'perturbation.1.wire = "test": ',
        "test.1",
    ),
    Case(
        "no-such-body",
        {("perturbation",): [{"body": "tset", "rotation": [0, 0, 1e-3]}]},
        'perturbation.1.body = "tset": names no stage',
        "'test'",
    ),
    Case(
        "nothing-to-do",
        {("perturbation",): [{"wire": "test.1"}]},
        "perturbation.1: changes nothing",
        "k_factor",
    ),
    Case(
        "not-for-a-body",
        {("perturbation",): [{"body": "test", "rotation": [0, 0, 1e-3], "k_factor": 2.0}]},
        "perturbation.1.k_factor = 2.0: is not for a body",
    ),
    Case(
        "hold",
        {("perturbation",): [{"wire": "test.1", "k_factor": 1.1, "hold": "length"}]},
        'perturbation.1.hold = "length": must be one of',
    ),
    Case(
        "factor-zero",
        {("perturbation",): [{"wire": "test.1", "k_factor": 0}]},
        "perturbation.1.k_factor = 0: must be at least 1e-06",
    ),
    Case(
        "too-long",
        {
            ("stage", 0, "wires", "count"): 2,
            (*WIRES, "s"): MISSING,
            ("perturbation",): [{"wire": "test.1", "length_change": 9.0}],
        },
        "stage.test.wire: wire test.1 is slack in equilibrium",
        "shorten",
    ),
]


def explicit(*wires: Any, position: tuple[float, float, float] = (0.0, 0.0, -0.4)) -> Edits:
    """The single pendulum on wires of its own."""
    made = [{"upper": upper, "lower": lower, "k": 1e4} for upper, lower in wires]
    return {WIRES: MISSING, (*STAGE, "position"): list(position), (*STAGE, "wire"): made}


def plumb(x: float, y: float) -> tuple[list[float], list[float]]:
    """A vertical wire."""
    return [x, y, 0.0], [x, y, 0.0]


BALANCE = [
    Case(
        "pulled",
        explicit(([0.1, 0.0, 0.0], [0.0, 0.0, 0.0])),
        "stage.test: cannot balance in the nominal pose: ",
        "natural_length",
    ),
    Case(
        "slack",
        explicit(plumb(0.1, 0.0), plumb(0.2, 0.0)),
        "stage.test.wire: wire test.2 would be slack in the nominal pose (tension -54.9 N)",
        "remove",
    ),
    Case(
        "pushed",
        explicit(([0.0, 0.0, 0.0], [0.0, 0.0, 0.0]), position=(0.0, 0.0, 0.4)),
        "stage.test.wire: wire test.1 would be slack",
        "remove",
    ),
    Case(
        "springs-alone",
        {
            WIRES: MISSING,
            (*STAGE, "position"): [0, 0, -1],
            (*STAGE, "spring"): [{"stiffness": SIX}],
        },
        "stage.test.spring: cannot balance in the nominal pose: -54.9 N of force along z left over",
        "preload",
    ),
    Case(
        "wrong-tension",
        {
            ("stage", 0, "wire", 1, "tension"): 1.0,
            ("stage", 0, "wire", 2, "natural_length"): MISSING,
        },
        "stage.upper: cannot balance",
        "move",
        "rich",
    ),
    Case(
        "natural-too-long",
        {("stage", 0, "wire", 2, "natural_length"): 0.5},
        "stage.upper.wire: wire upper.3 is slack in equilibrium",
        "shorten",
        "rich",
    ),
]

GLASS = ("materials", "glass")
PARTS = (*WIRES, "sections")


def fibre(name: str, edits: Edits, says: str, remedy: str = "") -> Case:
    """A fault of the wires, materials or gas of the base that has them all."""
    return Case(name, edits, says, remedy, "fibres")


FIBRES = [
    fibre(
        "two-angles",
        {("materials", "c70steel", "loss_angle"): 1e-4},
        "materials.c70steel.loss.angle = 0.0003: conflicts with loss_angle",
        "keep one",
    ),
    fibre(
        "angle-and-table",
        {(*GLASS, "loss", "angle"): 1e-4},
        "materials.glass.loss.table: conflicts with a constant",
        "keep one",
    ),
    fibre(
        "table-and-angle",
        {(*GLASS, "loss_angle"): 1e-4},
        "materials.glass.loss.table: conflicts with a constant",
        "keep one",
    ),
    fibre(
        "table-uneven",
        {(*GLASS, "loss", "table", "angle"): [1e-9]},
        "materials.glass.loss.table.angle = [1e-09]: has 1 values for 2 of frequency",
        "each",
    ),
    fibre(
        "table-falls",
        {(*GLASS, "loss", "table", "frequency"): [1.0, 1.0]},
        "materials.glass.loss.table.frequency = [1.0, 1.0]: is not in ascending order",
        "sort",
    ),
    fibre(
        "table-zero",
        {(*GLASS, "loss", "table", "angle"): [0.0, 1e-9]},
        "materials.glass.loss.table.angle.1 = 0.0: must be greater than 0",
        "rad",
    ),
    fibre(
        "table-key",
        {(*GLASS, "loss", "table", "phi"): [1e-9]},
        "materials.glass.loss.table.phi = [1e-09]: unknown key",
        "known here",
    ),
    fibre(
        "loss-number",
        {(*GLASS, "loss"): 1e-4},
        "materials.glass.loss = 0.0001: must be a table",
        "angle",
    ),
    fibre(
        "loss-key",
        {(*GLASS, "loss", "surface"): 1e-2},
        "materials.glass.loss.surface = 0.01: unknown key",
        "'surface_depth'",
    ),
    fibre(
        "thermoelastic",
        {(*GLASS, "loss", "thermoelastic"): 0},
        "materials.glass.loss.thermoelastic = 0: must be true or false",
        "thermoelastic",
    ),
    fibre(
        "depth",
        {(*GLASS, "loss", "surface_depth"): -1.0},
        "materials.glass.loss.surface_depth = -1.0: must be at least 0",
        "in m",
    ),
    fibre(
        "depth-without-bulk",
        {("materials", "steel302", "loss"): {"surface_depth": 1e-6}},
        "materials.steel302.loss.surface_depth = 1e-06: has no effect",
        "give angle or table too",
    ),
    fibre(
        "thermoelastic-constants",
        {
            ("materials", "rough"): {
                "youngs_modulus": 7e10,
                "density": 2200.0,
                "thermal_expansion": 4e-7,
                "loss": {"thermoelastic": True},
            }
        },
        "materials.rough.loss.thermoelastic = true: has no effect without specific_heat,"
        " thermal_conductivity",
        "give what is missing",
    ),
    fibre(
        "conductivity",
        {(*GLASS, "thermal_conductivity"): 0.0},
        "materials.glass.thermal_conductivity = 0.0: must be at least",
        "W/(m K)",
    ),
    fibre(
        "radius-and-sections",
        {(*WIRES, "radius"): 1e-4},
        "stage.test.wires.radius = 0.0001: conflicts with sections",
        "keep one",
    ),
    fibre(
        "section-and-sections",
        {(*WIRES, "section"): {"width": 1e-3, "thickness": 1e-4}},
        "stage.test.wires.section: conflicts with sections",
    ),
    fibre(
        "no-sections",
        {PARTS: []},
        "stage.test.wires.sections = []: has 0 elements",
        "upper to the lower end",
    ),
    fibre(
        "sections-table",
        {PARTS: {"radius": 1e-4}},
        "stage.test.wires.sections = {radius}: must be an array",
        "[[stage.test.wires.sections]]",
    ),
    fibre(
        "section-bare",
        {(*PARTS, 0): {"length": 0.01}},
        "stage.test.wires.sections.1: none of radius, section",
        "exactly one: radius (m) or section",
    ),
    fibre(
        "section-both",
        {(*PARTS, 3, "radius"): 1e-4},
        "stage.test.wires.sections.4: radius and section are both given",
        "exactly one",
    ),
    fibre(
        "taper-one",
        {(*PARTS, 1, "radius"): [1e-4]},
        "stage.test.wires.sections.2.radius = [0.0001]: has 1 elements",
        "[upper, lower] of a taper",
    ),
    fibre(
        "taper-word",
        {(*PARTS, 1, "radius"): "thin"},
        'stage.test.wires.sections.2.radius = "thin": must be a number',
        "[upper, lower]",
    ),
    fibre(
        "taper-zero",
        {(*PARTS, 1, "radius"): [1e-4, 0]},
        "stage.test.wires.sections.2.radius.2 = 0: must be at least 1e-09",
        "length in m",
    ),
    fibre(
        "taper-steps",
        {(*PARTS, 1, "steps"): 0},
        "stage.test.wires.sections.2.steps = 0: must be at least 1",
        "uniform steps",
    ),
    fibre(
        "steps-without-taper",
        {(*PARTS, 0, "steps"): 4},
        "stage.test.wires.sections.1.steps = 4: goes with a taper",
        "[upper, lower]",
    ),
    fibre(
        "two-rests",
        {(*PARTS, 0, "length"): MISSING},
        "stage.test.wires.sections.3.length: missing",
        "section 1 takes the rest already",
    ),
    fibre(
        "no-rest",
        {(*PARTS, 0, "length"): 0.3},
        "stage.test.wires.sections: take 0.315 m of 0.28 m and leave nothing",
        "shorter",
    ),
    fibre(
        "too-short",
        {(*PARTS, 2, "length"): 0.25},
        "stage.test.wires.sections: sum to 0.275 m, but the wire is 0.28 m long",
        "leave out one length",
    ),
    fibre(
        "too-long-explicit",
        {("stage", 1, "wire", 0, "sections", 0, "length"): 0.2},
        "stage.mass.wire.1.sections: sum to 0.399 m, but the wire is 0.299 m long",
    ),
    fibre(
        "part-material",
        {(*PARTS, 3, "material"): "c70stel"},
        'stage.test.wires.sections.4.material = "c70stel": names',
        "'c70steel'",
    ),
    fibre(
        "no-part-material",
        {PARTS: [{"radius": 1e-4}], (*WIRES, "material"): MISSING},
        "stage.test.wires.sections.1.material: missing",
        "for the whole wire",
    ),
    fibre(
        "clamp-word",
        {(*WIRES, "clamp"): "wires"},
        'stage.test.wires.clamp = "wires": must be one of bending-point, wire',
        "directions",
    ),
    fibre(
        "clamp-number", {(*WIRES, "clamp"): 1}, "stage.test.wires.clamp = 1: must be", "directions"
    ),
    fibre(
        "clamp-up",
        {(*WIRES, "clamp", "upper"): [0.0, 0.0, 1.0]},
        "stage.test.wires.clamp.upper = [0.0, 0.0, 1.0]: makes an angle of 3.09 rad with the wire",
        "lower end",
    ),
    fibre(
        "clamp-askew",
        {(*WIRES, "clamp", "upper"): [0, 1, -1]},
        "stage.test.wires.clamp.upper = [0.0, 1.0, -1.0]: makes an angle of 0.732 rad with the"
        " wire",
        "0.5 rad",
    ),
    fibre(
        "clamp-nowhere",
        {(*WIRES, "clamp", "lower"): [0, 0, 0]},
        "stage.test.wires.clamp.lower = [0.0, 0.0, 0.0]: has no direction",
        "not all zero",
    ),
    fibre(
        "clamp-two",
        {(*WIRES, "clamp", "lower"): [0, -1]},
        "stage.test.wires.clamp.lower = [0, -1]: must be an array of 3 numbers",
        "x, y, z",
    ),
    fibre(
        "clamp-end",
        {(*WIRES, "clamp", "top"): [0, 0, -1]},
        "stage.test.wires.clamp.top = [0, 0, -1]: unknown key",
        "upper",
    ),
    fibre(
        "kelvin",
        {(*WIRES, "temperature"): 0},
        "stage.test.wires.temperature = 0: must be greater than 0",
        "K",
    ),
    fibre(
        "kelvin-end",
        {(*WIRES, "temperature"): {"upper": 290.0}},
        "stage.test.wires.temperature.lower: missing",
        "in K",
    ),
    fibre(
        "kelvin-word",
        {(*WIRES, "temperature"): "cold"},
        'stage.test.wires.temperature = "cold": must be a number',
        "{ upper, lower }",
    ),
    fibre(
        "blade-thickness",
        {(*STAGE, "blades", "material"): MISSING},
        "stage.test.blades.thickness = 0.002: has no effect without material",
        "give material too",
    ),
    fibre(
        "blade-stuff",
        {(*STAGE, "blades", "material"): "steel"},
        'stage.test.blades.material = "steel": names no material',
        "[materials.NAME]",
    ),
    Case(
        "blade-twice",
        {(*STAGE, "blades", "thickness"): 1e-3},
        "stage.test.blades.thickness = 0.001: conflicts with geometry",
        "keep one",
        "blades",
    ),
    fibre("gas-empty", {("gas",): {}}, "gas.pressure: missing", "Pa"),
    fibre(
        "gas-air",
        {("gas", "pressure"): 1e5},
        "gas.pressure = 100000.0: must be at least 0 and at most 1000",
        "molecules",
    ),
    fibre(
        "gas-mass",
        {("gas", "molar_mass"): 28.0},
        "gas.molar_mass = 28.0: must be at least 0.001 and at most 1",
        "kg/mol",
    ),
]

NEW_WIRES = [
    wires("count", 3, "is not 1, 2 or 4", "3", "ring"),
    wires("phase", 0.3, "goes with a ring", "0.3", "ring in m"),
    Case(
        "ring-and-s",
        {(*WIRES, "ring"): 0.01, (*WIRES, "t1"): MISSING, (*WIRES, "t2"): MISSING},
        "stage.test.wires.s = 0.01: conflicts with a ring",
    ),
    Case(
        "ring-half",
        {(*STAGE, "wires"): HALF_RING},
        "stage.test.wires: ring_upper and ring_lower go together",
        "give both",
    ),
    Case(
        "ring-twice",
        {(*STAGE, "wires"): RING | {"ring_upper": 0.1}},
        "stage.test.wires.ring = 0.05: conflicts with ring_upper",
    ),
    Case(
        "ring-in-mm",
        {(*STAGE, "wires"): HALF_RING | {"ring_lower": 5.0}},
        "stage.test.wires.l = 0.28: the wire is not longer than its horizontal span",
        "mm",
    ),
    Case(
        "ring-of-two-blades",
        {(*STAGE, "wires"): RING, (*STAGE, "blades"): {"count": 2, "stiffness": 1e3}},
        "stage.test.blades.count = 2: cannot carry 3 wires",
        "1 or 3",
    ),
    Case(
        "neck-thin",
        {(*WIRES, "neck"): {"radius": 5e-5, "length": 0.01}},
        "stage.test.wires.neck.radius = 5e-05: is not above the radius of the fibre (0.0001 m)",
    ),
    Case(
        "neck-long",
        {(*WIRES, "neck"): {"radius": 1e-3, "length": 10.0}},
        "stage.test.wires.neck.length = 10.0: both necks take 20 m of 0.28",
        "mm",
    ),
    Case(
        "neck-and-sections",
        {
            (*WIRES, "radius"): MISSING,
            (*WIRES, "sections"): [{"radius": 1e-4}],
            (*WIRES, "neck"): {"radius": 1e-3, "length": 0.01},
        },
        "stage.test.wires.sections: conflicts with neck",
    ),
    Case(
        "profile-and-radius",
        {(*WIRES, "profile"): PROFILE},
        "stage.test.wires.radius = 0.0001: conflicts with profile",
    ),
    Case(
        "profile-short",
        {(*WIRES, "radius"): MISSING, (*WIRES, "profile"): PROFILE | {"position": [0.0, 0.1]}},
        "stage.test.wires.profile: is 0.1 m long, but the wire is 0.28 m",
        "position_mm",
    ),
    Case(
        "profile-ragged",
        {(*WIRES, "radius"): MISSING, (*WIRES, "profile"): PROFILE | {"position": [0.0]}},
        "stage.test.wires.profile.diameter = [0.0002, 0.0002]: has 2 values for 1 of",
    ),
    Case(
        "profile-order",
        {(*WIRES, "radius"): MISSING, (*WIRES, "profile"): UNSORTED},
        "stage.test.wires.profile.position",
        "sort",
    ),
    Case(
        "profile-missing",
        {(*WIRES, "radius"): MISSING, (*WIRES, "profile"): "nowhere.csv"},
        'stage.test.wires.profile = "nowhere.csv": cannot be read (No such file',
        "folder",
    ),
    Case(
        "hinged-k",
        {(*WIRES, "bending"): "hinged", (*WIRES, "k"): 1e4, (*WIRES, "radius"): MISSING},
        'stage.test.wires.bending = "hinged": needs the wire\'s cross-section',
        "radius",
    ),
    wires("bending", "clamped", "must be one of hinged", '"clamped"'),
    Case(
        "gravity-up",
        {("constants", "gravity"): [0.0, 0.0, 9.81]},
        "constants.gravity = [0.0, 0.0, 9.81]: does not point down",
        "-9.81",
    ),
    Case("gravity-two", {("constants", "gravity"): [0.0, -9.81]}, "constants.gravity"),
    Case(
        "gradient-rows",
        {("constants", "gravity_gradient"): [[0.0, 0.0, 0.0]]},
        "constants.gravity_gradient = [[0.0, 0.0, 0.0]]: has 1 elements",
        "symmetric 3x3",
    ),
    Case(
        "gradient-curl",
        {("constants", "gravity_gradient"): [[0.0, 1e-6, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]},
        "constants.gravity_gradient = [[0.0, 1e-06, 0.0], ",
        "make element (i, j) equal to (j, i)",
    ),
    Case(
        "spring-material",
        {(*STAGE, "spring"): [{"stiffness": SIX, "material": "glas"}]},
        'stage.test.spring.1.material = "glas": names no material',
    ),
    Case(
        "spring-thickness",
        {(*STAGE, "spring"): [{"stiffness": SIX, "thickness": 1e-3}]},
        "stage.test.spring.1.thickness = 0.001: has no effect without material",
    ),
]

CASES = [
    *NEW_WIRES,
    *TYPES,
    *NUMBERS,
    *KEYS,
    *GEOMETRY,
    *BLADES,
    *BODIES,
    *AROUND,
    *FIBRES,
    *PERTURBATIONS,
    *BALANCE,
]

NO_DESIGNS: dict[str, tuple[bytes, str]] = {
    "empty": (b"", "is empty; start a design with `pendsus new`"),
    "white": (b" \n\t\n", "is empty; "),
    "comment": (b"# nothing yet\n\n# or ever\n", "is empty; "),
    "binary": (bytes(range(256)), "is not text (UTF-8); "),
    "nul": (b'[design]\nname = "a\x00b"\n', "is not TOML: "),
    "latin-1": ("[design]\ntitle = 'Müller'\n".encode("latin-1"), "is not text (UTF-8); "),
    "utf-16": ("[design]\nname = 'x'\n".encode("utf-16"), "is not text (UTF-8); "),
    "unclosed": (b"[design\nname = 'x'\n", "is not TOML: "),
    "no-value": (b"[design]\nname =\n", "is not TOML: "),
    "bare-word": (b"[design]\nname = single\n", "is not TOML: "),
    "twice": (b"[design]\nname = 'x'\nname = 'y'\n", "is not TOML: "),
    "table-twice": (b"[design]\nname = 'x'\n[design]\n", "is not TOML: "),
    "long-integer": (b"[design]\nname = 1" + b"0" * 5000 + b"\n", "is not TOML: "),
    "prose": (b"Dear Sir or Madam,\n", "is not TOML: "),
    "json": (b'{"design": {"name": "x"}}\n', "is not TOML: "),
    "nested": (b"x = " + b"[" * 5000 + b"]" * 5000, "tables or arrays are nested too deeply; "),
    "nested-less": (
        TEXTS["single"].encode() + b"[analysis.xcouple]\nx = " + b"[" * 300 + b"]" * 300,
        # how deep is too deep depends on the version of Python
        ("tables or arrays are nested too deeply; ", "analysis.xcouple.x = "),
    ),
    "hexadecimal": (b"[design]\nname = 0x" + b"f" * 5000, "design.name = "),
}
"""Files that are no designs at all: their bytes, and how the first line goes on after the file."""
