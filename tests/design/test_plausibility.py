"""`pendsus check` doubts numbers that no suspension has, and trusts those that are shipped. Every
expected number is computed here."""

from __future__ import annotations

import contextlib
import math
import re
import tomllib

import numpy as np
import pytest

from suspension_cli.analyses.check import plausible
from suspension_cli.analyses.check.names import find_unknown_names as names_of
from suspension_cli.analyses.check.statics import solve
from suspension_cli.design import csv_columns
from suspension_cli.design import plausibility as numbers
from suspension_cli.design.materials import resolve
from suspension_cli.design.reader import convert, template
from suspension_cli.errors import InputError
from tests.support.commandline import (
    KINDS,
    MISSING,
    edited,
    from_template,
    run,
    strict_json,
    written,
)
from tests.support.paths import CONFIGS

SHIPPED = sorted(
    path.relative_to(CONFIGS).with_suffix("").as_posix() for path in CONFIGS.rglob("*.toml")
) + [f"new/{kind}" for kind in KINDS]
G = 9.81


def raw(name):
    """A shipped design, or one as `pendsus new` writes it."""
    kind = name.removeprefix("new/")
    found = tomllib.loads(
        template(kind, kind) if kind != name else (CONFIGS / f"{name}.toml").read_text()
    )
    csv_columns.insert_files(found, CONFIGS)
    return found


def checked(folder, document, *args):
    """Exit code, document and warnings of `pendsus check`."""
    result = run("check", written(folder, document), "--json", *args)
    lines = [line for line in result.stderr.splitlines() if line.startswith("warning: ")]
    return result, strict_json(result.stdout) if result.exit_code < 2 else {}, lines


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_designs_are_believed(name, tmp_path):
    result, answer, lines = checked(tmp_path, raw(name), "--strict")
    assert (result.exit_code, lines, answer["warnings"], answer["stable"]) == (0, [], [], True)
    shares = [part["strength_fraction"] for part in answer["wires"] + answer["blades"]]
    assert all(share is None or 0.02 < share < 0.8 for share in shares)


UPPER, LAST = ("stage", 0), ("stage", -1)
NONSENSE = {
    "length": (
        "double",
        {(*LAST, "wires", "l"): 602.0},
        "stage.test.wires.l = 602.0: is longer than any suspension .50 m.; did you mean mm?",
    ),
    "height": (
        "double",
        {(*LAST, "wires", "d"): 1.0},
        "stage.test.wires.d = 1.0: lower ends of wires lie 1 m from the COM, .*; did you mean mm?",
    ),
    "depth": (
        "double",
        {(*LAST, "wires", "d_upper"): 1.0},
        (
            "stage.test.wires.d_upper = 1.0: upper ends of wires lie, on upper, 1 m .*; did you"
            " mean mm?"
        ),
    ),
    "separation": (
        "double",
        {(*LAST, "wires", "s"): 6.0},
        "stage.test.wires.s = 6.0: .*; did you mean mm?",
    ),
    "no shape": (
        "husman2000/table1-case1",
        {(*LAST, "wires", "s"): 40.0},
        "stage.test.wires.s = 40.0: .* by its inertia.*; did you mean mm?",
    ),
    "wire in mm": (
        "double",
        {(*LAST, "wires", "radius"): 0.075},
        "stage.test.wires.radius = 0.075: the wire is 0.15 m thick, .*; did you mean mm?",
    ),
    "thick wire": (
        "double",
        {(*LAST, "wires", "radius"): 0.305},
        "stage.test.wires.radius = 0.305: the wire is 0.61 m thick, .*; did you mean mm?",
    ),
    "wire in um": (
        "double",
        {(*LAST, "wires", "radius"): 75.0},
        "stage.test.wires.radius = 75.0: .*; did you mean um?",
    ),
    "ribbon": (
        "double",
        {
            (*LAST, "wires", "radius"): MISSING,
            (*LAST, "wires", "section"): {"width": 0.4, "thickness": 1e-4},
        },
        "stage.test.wires.section.width = 0.4: .*; did you mean mm?",
    ),
    "thin wire": (
        "double",
        {(*LAST, "wires", "radius"): 15.4e-6},
        "stage.test.wires: wire test.1 is under 8.8. GPa, 4.4. times the strength of c70steel",
    ),
    "thin fibre": (
        "quadruple",
        {(*LAST, "wires", "radius"): 26.7e-6},
        "stage.test.wires: wire test.1 is under 43.8 GPa, 11.8 times the strength of fused-sil",
    ),
    "body in mm": (
        "husman2000/figure3",
        {(*LAST, "body", "radius"): 90.0},
        "stage.test.body.mass = 6.0: makes the body less dense .*; did you mean mm?",
    ),
    "large body": (
        "quadruple",
        {(*LAST, "body", "radius"): 170.0},
        (
            "stage.test.body.radius = 170.0: is larger than any suspended body .10 m.; did you"
            " mean mm?"
        ),
    ),
    "box in mm": (
        "double",
        {(*UPPER, "body", "size"): [100.0, 140.0, 30.0]},
        "stage.upper.body.mass = 3.0: makes the body less dense .*; did you mean mm for",
    ),
    "mass in g": (
        "double",
        {(*UPPER, "body", "mass"): 3000.0},
        "stage.upper.body.mass = 3000.0: makes the body denser .* than osmium .*; did you mean g?",
    ),
    "mass alone in g": (
        "husman2000/table2",
        {(*UPPER, "body", "mass"): 5860.0},
        "stage.upper.body.inertia = .*; did you mean g for the mass 5860?",
    ),
    "density": (
        "double",
        {(*LAST, "body", "density"): 2.2},
        "stage.test.body.density = 2.2: is less dense than foam .25 kg/m.3.; did you mean g/cm.3?",
    ),
    "dense": (
        "double",
        {(*LAST, "body", "density"): 22000.0 * 1.1},
        "stage.test.body.density = 24200.* is denser than osmium",
    ),
    "inertia in g m2": (
        "husman2000/table2",
        {(*UPPER, "body", "inertia"): [81.26, 3.81, 83.38]},
        "stage.upper.body.inertia = .*; did you mean g m.2?",
    ),
    "inertia in kg cm2": (
        "husman2000/table2",
        {(*UPPER, "body", "inertia"): [812.6, 38.1, 833.8]},
        "stage.upper.body.inertia = .*; did you mean kg cm.2?",
    ),
    "one inertia": (
        "husman2000/table2",
        {(*UPPER, "body", "inertia"): [0.08, 3.81, 0.08]},
        "stage.upper.body.inertia = .*: one moment exceeds .*; did you mean g m.2?",
    ),
    "modulus in GPa": (
        "double",
        {("materials", "c70steel"): {"youngs_modulus": 212.0}},
        "materials.c70steel.youngs_modulus = 212.0: .*; did you mean GPa?",
    ),
    "modulus": (
        "double",
        {("materials", "c70steel"): {"youngs_modulus": 2.12e14}},
        "materials.c70steel.youngs_modulus = .*: is outside",
    ),
    "strength in MPa": (
        "double",
        {("materials", "c70steel"): {"tensile_strength": 1980.0}},
        "stage.upper.wires: .*; tensile_strength = 1980: did you mean MPa?",
    ),
    "strength": (
        "double",
        {("materials", "mine"): {"youngs_modulus": 2e11, "tensile_strength": 1e11}},
        "materials.mine.tensile_strength = .* no material bears",
    ),
    "material density": (
        "ligo-quad-2005",
        {("materials", "silica", "density"): 2.2},
        "materials.silica.density = 2.2: .*; did you mean g/cm.3?",
    ),
    "expansion": (
        "double",
        {("materials", "c70steel"): {"thermal_expansion": 0.01}},
        "materials.c70steel.thermal_expansion = 0.01: is more than 0.001 1/K",
    ),
    "k in N/mm": (
        "double",
        {(*LAST, "wires", "k"): 13.4},
        "stage.test.wires.k = 13.4: wire test.1 is stretched by 176 % .*; did you mean N/mm?",
    ),
    "soft blade": (
        "geo-silica-triple",
        {(*UPPER, "blades", "stiffness"): 0.394},
        "stage.upper.blades.stiffness = 0.394: blade .*; did you mean N/mm?",
    ),
    "blade in kHz": (
        "quadruple",
        {("stage", 1, "blades", "uncoupled_frequency"): 2.5e-3},
        "uncoupled_frequency = 0.0025: blade .* sags by .*; did you mean kHz?",
    ),
    "blade in mHz": (
        "quadruple",
        {("stage", 1, "blades", "uncoupled_frequency"): 2500.0},
        "stage.upper.blades.uncoupled_frequency = 2500.0: .*; did you mean mHz?",
    ),
    "thin blade": (
        "new/blades",
        {(*LAST, "blades", "geometry", "thickness"): 3e-4},
        "stage.test.blades: blade test.blade1 is under .* the strength of maraging",
    ),
    "blade in mm": (
        "new/blades",
        {(*LAST, "blades", "geometry", "thickness"): 1.5},
        "stage.test.blades.geometry.thickness = 1.5: .*; did you mean mm?",
    ),
    "wide blade": (
        "new/blades",
        {(*LAST, "blades", "geometry", "base_width"): 40.0},
        "stage.test.blades.geometry.base_width = 40.0: .*; did you mean mm?",
    ),
    "long blade": (
        "new/blades",
        {(*LAST, "blades", "geometry", "length"): 200.0},
        (
            "stage.test.blades.geometry.length = 200.0: is longer than any blade .10 m.; did you"
            " mean mm?"
        ),
    ),
    "tip in g": (
        "new/blades",
        {(*LAST, "blades", "tip_mass"): 20.0},
        (
            "stage.test.blades.tip_mass = 20.0: is more than the mass of the stage itself .*; did"
            " you mean g?"
        ),
    ),
    "gravity": (
        "double",
        {("constants",): {"gravity": 981.0}},
        "constants.gravity = 981.0: is outside 1 to 30 m/s.2, .*; did you mean cm/s.2?",
    ),
    "gravity gradient": (
        "double",
        {("constants",): {"gravity_gradient": 0.3}},
        "constants.gravity_gradient = 0.3: is more than 0.001 1/s.2, .*; give it in 1/s.2",
    ),
    "ring in mm": (
        "pulled-fibres",
        {(*UPPER, "wires", "ring_upper"): 140.0, (*UPPER, "wires", "ring_lower"): 140.0},
        "stage.upper.wires.ring_lower = 140.0: lower ends of wires lie 140 m .*; did you mean mm?",
    ),
    "neck in mm": (
        "double",
        {(*LAST, "wires", "neck"): {"radius": 1.5, "length": 0.01}},
        "stage.test.wires.neck.radius = 1.5: the wire is 1.5 m thick, .*; did you mean mm?",
    ),
    "unstable": (
        "double",
        {(*LAST, "wires", "d"): -0.05},
        "stage: the equilibrium is unstable in the beam model: ",
    ),
    "degrees": (
        "imperfect",
        {("perturbation", 2, "rotation"): [1.5, 0.0, 0.0]},
        "perturbation.3.rotation = .*: an error of 1.5 rad is 85.9 degrees; did you mean deg",
    ),
    "offset in mm": (
        "imperfect",
        {("perturbation", 0, "upper_offset"): [0.03, 0.0, 0.0]},
        "perturbation.1.upper_offset = .*; did you mean mm?",
    ),
    "per cent": (
        "triple-tolerance",
        {("tolerance", "wire", 0, "radius", "uniform"): 1.0},
        "tolerance.wire.1.radius = 1.0: .*; did you mean %?",
    ),
    "spread in um": (
        "triple-tolerance",
        {("tolerance", "wire", 0, "length", "normal"): 50.0},
        "tolerance.wire.1.length = 50.0: .*; did you mean um?",
    ),
    "noise": (
        "triple-damped",
        {("control", "loop", 0, "sensor_noise"): 0.1},
        "control.loop.x.sensor_noise = 0.1: .*; did you mean nm/sqrt.Hz.?",
    ),
    "gain": (
        "triple-damped",
        {("control", "loop", 0, "gain"): -1e12},
        "control.loop.x.gain = -1000000000000.0: has unity gain above 100 Hz .*; lower it, or",
    ),
    "damper": (
        "tower",
        {("control", "loop", 2, "damper"): 1e9},
        "control.loop.yaw.damper = 1000000000.0: has unity gain above 100 Hz",
    ),
    "gap": (
        "reaction-chain",
        {("damper", 0, "eddy_current", "gap"): 1e-9},
        r"damper\..*\.eddy_current\.gap = 1e-09: is inside a magnet of this strength",
    ),
    "sensor": (
        "triple-damped",
        {("control", "loop", 0, "sensor"): "uper.x"},
        'control.loop.x.sensor = "uper.x": names no body; did you mean .upper.?',
    ),
    "strange sensor": (
        "triple-damped",
        {("control", "loop", 0, "sensor"): "tpo.x"},
        'control.loop.x.sensor = "tpo.x": names no body; known here: support, upper',
    ),
    "sensed force": (
        "triple-damped",
        {("control", "loop", 0, "sensor"): "upper.force_x"},
        "control.loop.x.sensor = .*: is not a motion of a stage",
    ),
    "actuator": (
        "triple-damped",
        {("control", "loop", 0, "actuator"): "upper.force_w"},
        "control.loop.x.actuator = .*: names no motion or force; did you mean",
    ),
    "input": (
        "double",
        {("analysis",): {"response": {"input": "suport.x"}}},
        'analysis.response.input = "suport.x": names no body; did you mean .support.?',
    ),
    "observe": (
        "double",
        {("analysis",): {"tolerance": {"observe": "tst@0,0,0"}}},
        'analysis.tolerance.observe = "tst@0,0,0": names no body; did you mean .test.?',
    ),
    "wire": (
        "double",
        {("analysis",): {"xcouple": {"wire": "test.5"}}},
        'analysis.xcouple.wire = "test.5": names no wire; did you mean .test.4.?',
    ),
    "result": (
        "double",
        {("analysis",): {"sweep": {"result": ["test pich"]}}},
        'analysis.sweep.result = "test pich": is the label of no mode; did you mean .test pi',
    ),
    "path": (
        "double",
        {("analysis",): {"xcouple": {"stage.tset.wires.d": "0:0.01:3"}}},
        "analysis.xcouple.stage.tset.wires.d: does not lead to a table of the design",
    ),
    "vary": (
        "double",
        {("analysis",): {"sweep": {"vary": ["stage.tset.wires.d=0:1:3"]}}},
        "analysis.sweep.vary = .*: does not lead to a table of the design",
    ),
}


@pytest.mark.parametrize("slip", NONSENSE)
def test_nonsense_is_noticed(slip, tmp_path):
    name, edits, expected = NONSENSE[slip]
    result, answer, lines = checked(tmp_path, edited(raw(name), edits), "--strict")
    assert result.exit_code == 1, result.stderr
    assert any(
        re.search(
            (
                f": {expected}".replace("?", r"\?")
                if not expected.startswith("uncoupled")
                else expected.replace("?", r"\?")
            ),
            line,
        )
        for line in lines
    ), lines
    assert len(answer["warnings"]) == len(lines)


def test_a_sound_modulus_is_not_suspected(tmp_path):
    """Where the masses are wrong, not the modulus, no unit of it is suggested."""
    edits = {(*LAST, "body", "radius"): 170.0}
    _, _, lines = checked(tmp_path, edited(raw("double"), edits))
    assert any("is stretched by" in line for line in lines)
    assert not any("modulus" in line and "did you mean" in line for line in lines)


@pytest.mark.parametrize("slip", ["length", "tip in g", "unstable"])
def test_nonsense_is_reported_and_only_strict_fails(slip, tmp_path):
    name, edits, _ = NONSENSE[slip]
    result, answer, lines = checked(tmp_path, edited(raw(name), edits))
    assert result.exit_code == 0 and len(answer["warnings"]) == len(lines) > 0
    strict = run("check", tmp_path / "design.toml", "--strict")
    assert strict.exit_code == 1
    assert (
        f"design.toml: {len(lines)} warning" in strict.stdout
        and "good" not in strict.stdout.splitlines()[0]
    )


FACTORS = {
    "mass": (1e3,),
    "tip_mass": (1e3,),
    "youngs_modulus": (1e-9, 1e-6),
    "inertia": (1e3, 1e4, 1e6),
    "uncoupled_frequency": (1e3, 1e-3),
    "rotation": (57.3,),
}
FACTORS |= dict.fromkeys(
    (
        "l",
        "s",
        "s_upper",
        "s_lower",
        "t1",
        "t2",
        "d",
        "d_upper",
        "radius",
        "inner_radius",
        "length",
        "size",
        "position",
    ),
    (1000.0,),
)
FACTORS |= dict.fromkeys(
    (
        "upper",
        "lower",
        "at",
        "thickness",
        "base_width",
        "upper_offset",
        "lower_offset",
        "com_offset",
    ),
    (1000.0,),
)


def leaves(node, way=()):
    """Every number of a document, with its path."""
    if isinstance(node, (dict, list)):
        for key, value in node.items() if isinstance(node, dict) else enumerate(node):
            yield from leaves(value, (*way, key))
    elif isinstance(node, float) and node:
        yield way, node


@pytest.mark.parametrize(
    "name",
    [
        "double",
        "new/blades",
        "ligo-quad-2005",
        "imperfect",
        "husman2000/triple-vertical",
        "five-wires",
        "geo-silica-triple",
    ],
)
def test_every_slip_of_a_unit_is_noticed(name):
    """Each number in mm instead of m, g instead of kg, GPa instead of Pa, ... : refused, or
    doubted."""
    document, missed = raw(name), []
    for way, value in leaves(document):
        key = next(part for part in reversed(way) if isinstance(part, str))
        for factor in FACTORS.get(key, ()):
            with contextlib.suppress(InputError):
                design = convert(edited(document, {way: value * factor}))
                if not [
                    *numbers.find_implausible(design),
                    *plausible.find_implausible_loads(design, solve(design)),
                ]:
                    missed.append((way, value * factor))
    assert not missed


def scaled(document, rng):
    """Another suspension: lengths, cross-sections, densities and stiffnesses scaled by 0.5 to 2
    each."""
    length, thick, dense, stiff = np.exp(rng.uniform(-math.log(2), math.log(2), 4))
    powers = dict.fromkeys(
        (
            "l",
            "s",
            "s_upper",
            "s_lower",
            "t1",
            "t2",
            "d",
            "d_upper",
            "length",
            "size",
            "position",
            "upper",
            "lower",
            "at",
            "width",
        ),
        length,
    )
    powers |= dict.fromkeys(
        (
            "base_width",
            "upper_offset",
            "lower_offset",
            "com_offset",
            "length_change",
            "inner_radius",
        ),
        length,
    )
    powers |= {
        "mass": dense * length**3,
        "inertia": dense * length**5,
        "density": dense,
        "stiffness": stiff,
        "tip_mass": dense * length**3,
    }
    edits = {}
    for way, value in leaves(document):
        keys = [part for part in way if isinstance(part, str)]
        factor = powers.get(keys[-1], 1.0)
        if (
            keys[0] in ("control", "tolerance", "analysis", "constants", "gas", "materials")
            or "spring" in keys
        ):
            continue
        if keys[-1] in ("radius", "thickness"):
            factor = (
                thick if "wires" in keys or "wire" in keys or keys[-1] == "thickness" else length
            )
        edits[way] = value * float(factor)
    return edited(document, edits)


@pytest.mark.parametrize("name", SHIPPED)
def test_other_sizes_are_believed(name):
    """Nothing serious is said of a suspension of half or twice the size, but that wires or blades
    break which do."""
    rng, document = np.random.default_rng(sum(map(ord, name))), raw(name)
    for _ in range(6):
        design = convert(scaled(document, rng))
        carried = solve(design)
        broken = {
            part.label.rsplit(".", 1)[0]
            for part in (*carried.wires, *carried.blades)
            if part.fraction is not None and part.fraction > 1
        }
        strained = {
            wire.label.rsplit(".", 1)[0]
            for wire in carried.wires
            if wire.stretch > 0.03 * wire.length
        }
        for doubt in plausible.find_serious(design):
            stage = doubt.fault.key.split(".")[1]
            assert ("times the strength" in doubt.fault.problem and stage in broken) or (
                "stretched" in doubt.fault.problem and stage in strained
            ), doubt


def test_what_is_carried(tmp_path):
    """By hand: 5.6 kg on two vertical wires from two blades, and 0.02 kg on each tip."""
    _, answer, _ = checked(tmp_path, raw("new/blades"))
    pull, radius, modulus, strength = 5.6 * G / 2, 150e-6, 1.7e11, 2.07e9
    stress = pull / (math.pi * radius**2)
    for wire in answer["wires"]:
        expected = {
            "tension_n": pull,
            "stress_pa": stress,
            "stretch_fraction": stress / modulus,
            "strength_pa": strength,
            "strength_fraction": stress / strength,
        }
        assert {key: wire[key] for key in expected} == pytest.approx(expected, rel=1e-12)
    length, width, thickness = 0.20, 0.04, 0.0015
    load = pull + 0.02 * G
    k = 1.87e11 * width * thickness**3 / (4 * 1.35 * length**3)
    for blade in answer["blades"]:
        expected = {
            "load_n": load,
            "sag_m": load / k,
            "stress_pa": 6 * load * length / (width * thickness**2),
            "strength_pa": 1.7e9,
        }
        assert {key: blade[key] for key in expected} == pytest.approx(expected, rel=1e-12)
        assert blade["strength_fraction"] == pytest.approx(expected["stress_pa"] / 1.7e9, rel=1e-12)
    assert answer["height_m"] == pytest.approx(0.40 + 0.003 + 0.09, rel=1e-12)
    assert answer["lowest"] == [
        {"stage": "test", "z_m": pytest.approx(-0.493, rel=1e-12), "point": "body"}
    ]
    assert (
        "height 0.493 m; lowest points: test -0.493 m (body)"
        in run("check", tmp_path / "design.toml").stdout
    )


def test_lowest_points():
    """Of a body without a shape its wires or its COM; of a turned cylinder the rim."""
    carried = solve(convert(raw("husman2000/table1-case1")))
    assert [(low.point, low.z) for low in carried.lowest] == [
        ("centre of mass", pytest.approx(-0.27))
    ]
    turned = edited(
        raw("husman2000/figure3"),
        {
            (*LAST, "wires", "count"): 4,
            ("perturbation",): [{"body": "test", "com_offset": [0.0, 0.0, -0.002]}],
        },
    )
    before, after = solve(convert(raw("husman2000/figure3"))), solve(convert(turned))
    assert before.lowest[0].z == pytest.approx(-0.18 - 0.001 - 0.09)
    assert after.lowest[0].z == pytest.approx(before.lowest[0].z - 0.002, abs=1e-4)


def test_weakest_section():
    """Of a wire of two materials the stress that counts is the one nearest to its strength, not the
    largest."""
    sections = [
        {"length": 0.02, "radius": 60e-6, "material": "fused-silica"},
        {"radius": 70e-6, "material": "c70steel"},
    ]
    document = edited(raw("double"), {(*LAST, "wires", "sections"): sections})
    del document["stage"][-1]["wires"]["radius"]
    wire, *_ = [wire for wire in solve(convert(document)).wires if wire.label.startswith("test")]
    assert wire.stress == pytest.approx(wire.tension / (math.pi * 60e-6**2))
    assert (wire.material, wire.strength) == (
        "c70steel",
        resolve(convert(document), "c70steel").tensile_strength,
    )
    assert wire.fraction == pytest.approx(wire.tension / (math.pi * 70e-6**2) / 1.98e9)


def test_held_by_bending_alone_is_not_unstable(tmp_path):
    """Wires clamped below the COM: strings fall over, wires that bend do not."""
    document = edited(
        raw("new/single"),
        {
            (*LAST, "wires", "radius"): 300e-6,
            (*LAST, "wires", "s"): 0.0,
            (*LAST, "wires", "d"): -0.0005,
        },
    )
    assert (
        run(
            "response",
            written(tmp_path, document),
            "--fidelity",
            "string",
            "--frequency",
            "1",
            "--out",
            tmp_path,
            "--no-plot",
        ).exit_code
        == 2
    )
    result, answer, lines = checked(tmp_path, document, "--strict")
    assert (result.exit_code, answer["stable"], answer["stability_model"], lines) == (
        0,
        True,
        "beam",
        [],
    )


def test_density_from_inertia():
    """The homogeneous ellipsoid is the most compact body: its density is found, to rounding, and a
    ball of osmium is just believed."""
    for density, believed in ((22_500.0, True), (22_700.0, False)):
        radius = 0.05
        mass = density * 4 / 3 * math.pi * radius**3
        body = {"mass": mass, "inertia": [0.4 * mass * radius**2] * 3}
        stage = {
            "name": "test",
            "body": body,
            "wires": {"count": 1, "l": 0.5, "d": 0.01, "material": "c70steel", "radius": 5e-4},
        }
        found = numbers.find_implausible(convert({"design": {"name": "ball"}, "stage": [stage]}))
        assert ([doubt for doubt in found if "inertia" in doubt.fault.key] == []) == believed


@pytest.mark.parametrize(
    "args",
    [
        ("modes", "--no-plot"),
        ("response", "--frequency", "1,3", "--no-plot"),
        ("thermal", "--frequency", "1,3", "--no-plot"),
        ("export",),
        ("info", "--frequency", "1,3"),
        (
            "sweep",
            "--vary",
            "stage.test.wires.d=0.001,0.002",
            "--result",
            "1",
            "--workers",
            "1",
            "--no-plot",
        ),
        ("sensitivity", "--result", "1", "--no-plot"),
    ],
    ids=lambda args: args[0],
)
def test_analyses_repeat_what_is_serious(args, tmp_path):
    """Once, in one line; and not what is merely odd."""
    file = written(
        tmp_path,
        edited(raw("double"), {(*LAST, "wires", "radius"): 20e-6, (*LAST, "wires", "d"): 0.15}),
    )
    assert "far outside the body" in run("check", file).stderr
    out = () if args[0] == "info" else ("--out", tmp_path)
    result = run(args[0], file, *args[1:], *out)
    assert result.exit_code == 0, result.stderr
    lines = [line for line in result.stderr.splitlines() if "times the strength" in line]
    assert len(lines) == 1 and lines[0].startswith(
        "warning: double: stage.test.wires: wire test.1 is under 5.27 GPa, 2.66 times the strength"
        " of c70steel (1.98 GPa)"
    )
    assert "far outside the body" not in result.stderr


ROOTS = {
    'pole(30) zpk([0],[9],1,"n") pole2(4,1,"n")': (
        "pole(30) without a plane: in rad/s by Foton's rule, not in Hz, and pole(30) divides the"
        ' gain at 0 Hz by 30; write pole(30, "n") for Hz and a gain of 1, or pole(30, "s") if this'
    ),
    "zero2(2, 3) * pole (4) pole2(8,1)": (
        "zero2(2, 3) and pole (4) and pole2(8,1) without a plane: in rad/s by Foton's rule, not in"
        ' Hz, and zero2(2, 3) multiplies the gain at 0 Hz by 2^2; write zero2(2, 3, "n") for'
    ),
    "zpk([0],[-9],1) pole(7,'s') pole(8, \"f\") gain(2)": None,
}


@pytest.mark.parametrize("command", [("check",), ("damp", "--no-plot"), ("response", "--no-plot")])
@pytest.mark.parametrize("text", ROOTS)
def test_roots_without_plane_are_noticed_once_per_filter(command, text, tmp_path):
    loops = ("control", "loop")
    changes = {(*loops, 0, "sensor_response"): text, (*loops, 1, "sensor_response"): "pole(5)"}
    file = written(tmp_path, edited(raw("triple-damped"), changes))
    out = () if command == ("check",) else ("--out", tmp_path, "--fidelity", "string")
    result = run(*command[:1], file, *command[1:], *out)
    lines = [line for line in result.stderr.splitlines() if "without a plane" in line]
    expected = ["pole(5) without a plane", *([ROOTS[text]] if ROOTS[text] else [])]
    assert len(lines) == len(expected)
    for one in expected:
        assert sum(".sensor_response = " in line and one in line for line in lines) == 1


def test_numbers_that_keep_a_design_from_balancing_are_named_with_the_fault(tmp_path):
    """Five tensions cannot hold a body that a wire pulls 200 m aside: the millimetres are named
    beside the imbalance."""
    file = written(
        tmp_path, edited(raw("five-wires"), {("stage", 0, "wire", 4, "upper"): [-200.0, 0.14, 0.0]})
    )
    result = run("check", file)
    assert result.exit_code == 2 and result.stdout == ""
    assert "did you mean mm?" in result.stderr and all(
        line.startswith(f"{file}: ") for line in result.stderr.splitlines()
    )


def test_names_of_templates_are_known(tmp_path):
    design = convert(
        tomllib.loads(from_template(tmp_path, "triple").read_text())
        | {"analysis": {"response": {"input": ["support.x", "test.force_x"]}}}
    )
    assert names_of(design, None, lambda _: True) == []


def test_strict_is_quiet_about_good_designs(tmp_path):
    result = run("check", from_template(tmp_path), "--strict")
    assert result.exit_code == 0 and result.stderr == "" and ": good; " in result.stdout
