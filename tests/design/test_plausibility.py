"""`pendsus check` doubts numbers that no suspension has, and trusts those that are shipped. Every
expected number is computed here."""

from __future__ import annotations

import contextlib
import math
import tomllib
from pathlib import Path

import pytest

from suspension_cli.design import checks as numbers
from suspension_cli.design import reader
from suspension_cli.design.materials import resolve
from suspension_cli.design.reader import convert, template
from suspension_cli.errors import InputError
from suspension_cli.physics import near_limits
from suspension_cli.physics.statics import solve
from tests.support.commandline import (
    KINDS,
    edited,
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


NONSENSE = [
    line.partition(" -> ")
    for line in (Path(__file__).parent / "implausible.txt").read_text().splitlines()
    if " -> " in line and not line.startswith("#")
]


@pytest.mark.parametrize(("slip", "expected"), [(one, says) for one, _, says in NONSENSE])
def test_nonsense_is_noticed(slip, expected, tmp_path):
    """With exit code 1 if --strict is given."""
    name, override = slip.split(" ", 1)
    result, answer, lines = checked(tmp_path, raw(name), "--strict", "--set", override)
    assert result.exit_code == 1, result.stderr
    assert any(expected in line for line in lines), lines
    assert len(answer["warnings"]) == len(lines)
    result = run("check", tmp_path / "design.toml", "--set", override)
    assert result.exit_code == 0 and f"design.toml: {len(lines)} warning" in result.stdout
    assert "good" not in result.stdout.splitlines()[0]


LAST = ("stage", -1)


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
                    *near_limits.find_implausible_loads(design, solve(design)),
                ]:
                    missed.append((way, value * factor))
    assert not missed


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
    result = run(args[0], file, *args[1:], "--out", tmp_path)
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


@pytest.mark.parametrize(
    ("given", "warns"),
    [
        ('zpk([0],[],50,"n") pole(30,"n") pole(40,"n")', True),
        ({"design": 'zpk([-2],[30;40],50,"n")', "rate": 2048.0}, True),
        ('zpk([0],[30;40],50,"n")', False),
        ('zero(0,"n") pole(30,"n") pole(40,"n") gain(50)', False),
    ],
)
def test_a_sign_that_foton_turns_is_noticed(given, warns, tmp_path):
    raw_design = raw("triple-damped")
    loop = raw_design["control"]["loop"][0]
    for key in ("zeros", "poles", "gain", "gain_at"):
        loop.pop(key, None)
    loop["filter"] = given
    file = written(tmp_path, raw_design)
    lines = run("check", file).stderr.splitlines()
    found = [line for line in lines if "Foton turns the sign" in line]
    assert len(found) == warns
    assert all("control.loop.x.filter = " in line for line in found)


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
