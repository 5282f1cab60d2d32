"""`pendsus check` doubts numbers that no suspension has, and trusts those that are shipped. Every
expected number is computed here."""

from __future__ import annotations

import contextlib
import math
import tomllib

import numpy as np
import pytest

from suspension_cli.analyses.check import warnings
from suspension_cli.analyses.check.statics import solve
from suspension_cli.analyses.check.warnings import find_unknown_names as names_of
from suspension_cli.design import plausibility as numbers
from suspension_cli.design import reader
from suspension_cli.design.materials import resolve
from suspension_cli.design.reader import convert, template
from suspension_cli.errors import InputError
from tests.support.commandline import (
    KINDS,
    edited,
    from_template,
    run,
    strict_json,
    written,
)
from tests.support.paths import CONFIGS

SHIPPED = sorted(
    path.relative_to(CONFIGS).with_suffix("").as_posix()
    for path in CONFIGS.rglob("*.toml")
    if path.parent.name != "built"  # converted as they are, also what is hardly believed
) + [f"new/{kind}" for kind in KINDS]
G = 9.81


def raw(name):
    """A shipped design, or one as `pendsus new` writes it."""
    kind = name.removeprefix("new/")
    found = tomllib.loads(
        template(kind, kind) if kind != name else (CONFIGS / f"{name}.toml").read_text()
    )
    reader.insert_files(found, CONFIGS)
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


NONSENSE = {
    "length": (
        "double",
        "stage.test.wires.l=602.0",
        "stage.test.wires.l = 602.0: is larger than any suspension (50 m); did you mean mm?",
    ),
    "depth": (
        "double",
        "stage.test.wires.d_upper=1.0",
        "stage.test.wires.d_upper = 1.0: upper ends of wires lie 1 m from the COM, ",
    ),
    "no shape": (
        "husman2000/table1-case1",
        "stage.test.wires.s=40.0",
        "stage.test.wires.s = 40.0: lower ends of wires lie 40 m from the COM, far outside the body"
        " (whose half along x is about 0.078 m); did you mean mm?",
    ),
    "wire in um": (
        "double",
        "stage.test.wires.radius=75.0",
        "stage.test.wires.radius = 75.0: is thicker than any wire (0.02 m); did you mean um?",
    ),
    "thin fibre": (
        "quadruple",
        "stage.test.wires.radius=26.7e-6",
        "stage.test.wires: wire test.1 is under 43.8 GPa, 11.8 times the strength of fused-sil",
    ),
    "large body": (
        "quadruple",
        "stage.test.body.radius=170.0",
        "stage.test.body.radius = 170.0: is larger than any suspended body (10 m); did you mean mm",
    ),
    "box in mm": (
        "double",
        "stage.upper.body.size=[100.0, 140.0, 30.0]",
        "stage.upper.body.mass = 3.0: a body of 3 kg of this size has 7.14e-06 kg/m^3, lighter than"
        " air (1.2); did you mean mm for the sizes?",
    ),
    "mass in g": (
        "double",
        "stage.upper.body.mass=3000.0",
        "than osmium (22600); did you mean g for the mass?",
    ),
    "mass alone in g": (
        "husman2000/table2",
        "stage.upper.body.mass=5860.0",
        "than osmium (22600); did you mean g for the mass?",
    ),
    "density": (
        "double",
        "stage.test.body.density=2.2",
        "stage.test.body.density = 2.2: is less dense than foam (25 kg/m^3); did you mean g/cm^3?",
    ),
    "inertia in kg cm2": (
        "husman2000/table2",
        "stage.upper.body.inertia=[812.6, 38.1, 833.8]",
        "lighter than air (1.2); did you mean kg cm^2 for the inertia?",
    ),
    "one inertia": (
        "husman2000/table2",
        "stage.upper.body.inertia=[0.08, 3.81, 0.08]",
        "one moment exceeds the sum of the other two, impossible for a rigid body; check",
    ),
    "modulus in GPa": (
        "double",
        "materials.c70steel.youngs_modulus=212.0",
        "youngs_modulus = 212.0: is softer than rubber (1e+07 Pa); did you mean GPa?",
    ),
    "strength in MPa": (
        "double",
        "materials.c70steel.tensile_strength=1980.0",
        "tensile_strength = 1980.0: is weaker than any wire (100000 Pa); did you mean MPa?",
    ),
    "expansion": (
        "double",
        "materials.c70steel.thermal_expansion=0.01",
        "= 0.01: is more than twice that of any solid (0.001 1/K); did you mean 1e-6 1/K?",
    ),
    "k in N/mm": (
        "double",
        "stage.test.wires.k=13.4",
        "wires.k = 13.4: wire test.1 is stretched by 176 % of its length; did you mean N/mm?",
    ),
    "soft blade": (
        "geo-silica-triple",
        "stage.upper.blades.stiffness=0.394",
        "stage.upper.blades.stiffness = 0.394: blade upper.blade1 sags by",
    ),
    "blade in kHz": (
        "quadruple",
        "stage.upper.blades.uncoupled_frequency=2.5e-3",
        "; did you mean kHz?",
    ),
    "blade in mHz": (
        "quadruple",
        "stage.upper.blades.uncoupled_frequency=2500.0",
        "= 2500.0: is too high to isolate from anything (100 Hz); did you mean mHz?",
    ),
    "thin blade": (
        "new/blades",
        "stage.test.blades.geometry.thickness=3e-4",
        "stage.test.blades: blade test.blade1 is under ",
    ),
    "blade in mm": (
        "new/blades",
        "stage.test.blades.geometry.thickness=1.5",
        "thickness = 1.5: is thicker than any blade (0.1 m); did you mean mm?",
    ),
    "tip in g": (
        "new/blades",
        "stage.test.blades.tip_mass=20.0",
        "tip_mass = 20.0: is more than any blade bears at its tip (10 kg); did you mean g?",
    ),
    "gravity": (
        "double",
        "constants.gravity=981.0",
        "constants.gravity = 981.0: is more than on Jupiter (30 m/s^2); did you mean cm/s^2?",
    ),
    "unstable": (
        "double",
        "stage.test.wires.d=-0.05",
        "stage: the equilibrium is unstable in the beam model: ",
    ),
    "degrees": (
        "imperfect",
        "perturbation.3.rotation=[1.5, 0.0, 0.0]",
        "is larger than in any real build (0.1 rad); did you mean degrees?",
    ),
    "offset in mm": (
        "imperfect",
        "perturbation.1.upper_offset=[0.03, 0.0, 0.0]",
        "upper_offset = [0.03, 0.0, 0.0]: is larger than in any real build (0.02 m); did you mean",
    ),
    "per cent": (
        "triple-tolerance",
        "tolerance.wire.1.radius.uniform=1.0",
        "tolerance.wire.1.radius = 1.0: is a larger fraction than in any real build (0.5); did you",
    ),
    "spread in um": (
        "triple-tolerance",
        "tolerance.wire.1.length.normal=50.0",
        "tolerance.wire.1.length = 50.0: is larger than in any real build (0.02 m); did you",
    ),
    "noise": (
        "triple-damped",
        "control.loop.x.sensor_noise=0.1",
        "sensor_noise = 0.1: is more than that of any sensor (0.0001); did you mean nm/sqrt(Hz)?",
    ),
    "sensor": (
        "triple-damped",
        "control.loop.x.sensor='uper.x'",
        'control.loop.x.sensor = "uper.x": names no body; did you mean',
    ),
    "actuator": (
        "triple-damped",
        "control.loop.x.actuator='upper.force_w'",
        "names no motion or force; did you mean",
    ),
    "input": (
        "double",
        "analysis.response.input='suport.x'",
        'analysis.response.input = "suport.x": names no body; did you mean',
    ),
    "observe": (
        "double",
        "analysis.tolerance.observe='tst@0,0,0'",
        'analysis.tolerance.observe = "tst@0,0,0": names no body; did you mean',
    ),
    "wire": (
        "double",
        "analysis.xcouple.wire='test.5'",
        'analysis.xcouple.wire = "test.5": names no wire; did you mean',
    ),
    "result": (
        "double",
        "analysis.sweep.result=['test pich']",
        'analysis.sweep.result = "test pich": is the label of no mode; did you mean',
    ),
    "vary": (
        "double",
        "analysis.sweep.vary=['stage.tset.wires.d=0:1:3']",
        "does not lead to a table of the design",
    ),
}


@pytest.mark.parametrize("slip", NONSENSE)
def test_nonsense_is_noticed(slip, tmp_path):
    name, override, expected = NONSENSE[slip]
    result, answer, lines = checked(tmp_path, raw(name), "--strict", "--set", override)
    assert result.exit_code == 1, result.stderr
    assert any(expected in line for line in lines), lines
    assert len(answer["warnings"]) == len(lines)


LAST = ("stage", -1)


@pytest.mark.parametrize("slip", ["length", "tip in g", "unstable"])
def test_nonsense_is_reported_and_only_strict_fails(slip, tmp_path):
    name, override, _ = NONSENSE[slip]
    result, answer, lines = checked(tmp_path, raw(name), "--set", override)
    assert result.exit_code == 0 and len(answer["warnings"]) == len(lines) > 0
    strict = run("check", tmp_path / "design.toml", "--strict", "--set", override)
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
LENGTHS = (
    "l", "s", "s_upper", "s_lower", "t1", "t2", "d", "d_upper", "radius", "inner_radius", "length",
    "size", "position", "upper", "lower", "at", "thickness", "base_width", "upper_offset",
    "lower_offset", "com_offset",
)  # fmt: skip
FACTORS |= dict.fromkeys(LENGTHS, (1000.0,))


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
                    *warnings.find_implausible_loads(design, solve(design)),
                ]:
                    missed.append((way, value * factor))
    assert not missed


def scaled(document, rng):
    """Another suspension: lengths, cross-sections, densities and stiffnesses scaled by 0.5 to 2
    each."""
    length, thick, dense, stiff = np.exp(rng.uniform(-math.log(2), math.log(2), 4))
    powers = dict.fromkeys([*LENGTHS, "width", "length_change"], length)
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
            keys[0]
            in ("control", "tolerance", "analysis", "constants", "gas", "materials", "cavity")
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
        strained = {wire.label.rsplit(".", 1)[0] for wire in carried.wires if wire.strain > 0.03}
        for doubt in warnings.find_serious(design):
            stage = doubt.key.split(".")[1]
            assert ("times the strength" in doubt.problem and stage in broken) or (
                "stretched" in doubt.problem and stage in strained
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
    options = ("--fidelity", "string", "--frequency", "1", "--out", tmp_path, "--no-plot")
    assert run("response", written(tmp_path, document), *options).exit_code == 2
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
        assert ([doubt for doubt in found if "inertia" in doubt.key] == []) == believed


@pytest.mark.parametrize(
    "args",
    [
        ("modes", "--no-plot"),
        ("response", "--frequency", "1,3", "--no-plot"),
        ("thermal", "--frequency", "1,3", "--no-plot"),
        ("export",),
        ("info", "--frequency", "1,3"),
        ("sweep", "--vary", "stage.test.wires.d=0.001,0.002", "--result", "1", "--no-plot"),
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
        "pole(30) without a plane: in rad/s by Foton's rule, not in Hz, with another gain at 0 Hz"
        ' than 1; write pole(30, "n") for Hz and a gain of 1, or pole(30, "s") if this'
    ),
    "zero2(2, 3) * pole (4) pole2(8,1)": (
        "zero2(2, 3) and pole (4) and pole2(8,1) without a plane: in rad/s by Foton's rule, not in"
        ' Hz, with another gain at 0 Hz than 1; write zero2(2, 3, "n") for'
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
