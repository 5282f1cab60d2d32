"""Parts that dissipate nothing are named where Q and thermal noise are printed: against what the
model itself dissipates part by part."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest

from suspension_cli.design.reader import convert
from suspension_cli.models import registry
from suspension_cli.physics import thermal_noise
from suspension_cli.physics.lossless import find_lossless
from tests.support.commandline import (
    KINDS,
    edited,
    from_template,
    modes_json,
    run,
    strict_json,
)
from tests.support.paths import CONFIGS

GRID = ("--frequency", "1,30")


def thermal_json(file, folder, *args):
    result = run("thermal", file, "--json", "--out", folder, *GRID, *args)
    assert result.exit_code == 0, result.stderr
    return strict_json(result.stdout), [
        line for line in result.stderr.splitlines() if line.startswith("warning: ")
    ]


def test_blades_given_by_stiffness_are_named(tmp_path):
    """Of three sets of blades one is given by its geometry and material; the vertical motion of the
    others is without noise of their own."""
    answer, warnings = thermal_json(CONFIGS / "quadruple.toml", tmp_path, "--output", "test.z")
    assert answer["without_loss"] == ["upper.blades", "penultimate.blades"]
    assert "top.blades" in answer["contributions"]
    assert not {"upper.blades", "penultimate.blades"} & set(answer["contributions"])
    (line,) = warnings
    assert (
        "quadruple: no loss: upper.blades, penultimate.blades;" in line
        and "give loss_angle of upper.blades, penultimate.blades" in line
    )


def test_materials_without_bulk_loss_are_named(tmp_path):
    """Type 302 has the heat that makes thermoelastic loss and no loss angle: twisting and
    stretching dissipate nothing."""
    file = CONFIGS / "husman2000" / "figure3.toml"
    answer, warnings = thermal_json(file, tmp_path, "--output", "test.yaw")
    assert answer["without_loss"] == ["test.wires"]
    assert set(answer["contributions"]) == {"test.bending-upper", "test.bending-lower"}
    (line,) = warnings
    assert (
        "only thermoelastic loss where they bend: test.wires (steel302)" in line
        and "give materials.steel302.loss_angle" in line
    )
    answer, warnings = thermal_json(
        file, tmp_path, "--output", "test.yaw", "--set", "materials.steel302.loss_angle=1e-4"
    )
    assert (
        answer["without_loss"] == []
        and warnings == []
        and "test.torsion" in answer["contributions"]
    )


def test_modes_name_it_where_they_print_q(tmp_path):
    file = CONFIGS / "triple-damped.toml"
    result = run("modes", file, "--out", tmp_path, "--no-plot", "--fidelity", "force")
    assert " Q  " in result.stdout
    assert (
        "no loss in the force model, which uses only loss angles given in the design: upper.blades,"
        " middle.blades;" in result.stderr
    )
    silent = run(
        "modes",
        file,
        "--out",
        tmp_path,
        *["--no-plot", "--fidelity", "force", "--set", "materials.steel302.loss_angle=0"],
    )
    assert " Q  " not in silent.stdout and "no loss" not in silent.stderr
    assert modes_json(file, "--out", tmp_path)["without_loss"] == ["upper.blades", "middle.blades"]


def test_springs_supports_and_single_wires():
    """A spring and a support with neither loss angle nor damper; one wire of five that is of
    another material."""
    spring = {"stiffness": [0.0, 0.0, 0.0, 0.0, 0.0, 0.1]}
    five = tomllib.loads((CONFIGS / "five-wires.toml").read_text())
    raw = edited(
        five,
        {
            ("stage", 0, "wire", 2, "material"): "dull",
            ("materials", "dull"): {"youngs_modulus": 2e11},
            ("stage", 0, "spring"): [spring],
        },
    )
    raw |= {"support": {"stiffness": {"z": 1e6}}}
    found = find_lossless(convert(raw), "beam")
    assert [(one.part, one.material, bool(one.bending)) for one in found] == [
        ("support", (), False),
        ("bench.3", ("dull",), False),
        ("bench.springs", (), False),
    ]
    for cure in ({("support", "loss_angle"): 1e-3}, {("support", "damping"): {"z": 1.0}}):
        assert "support" not in [
            one.part for one in find_lossless(convert(edited(raw, cure)), "beam")
        ]
    for cure in ({"loss_angle": 1e-3}, {"damping": [0.0, 0.0, 0.0, 0.0, 0.0, 1e-3]}):
        assert "bench.springs" not in [
            one.part
            for one in find_lossless(
                convert(edited(raw, {("stage", 0, "spring"): [spring | cure]})), "beam"
            )
        ]


def sources(design):
    """Every part that dissipates in some motion of a design on `beam`."""
    model = registry.BEAM.system(design)
    found: set[str] = set()
    for body in model.body:
        for dof in ("x", "y", "z", "roll", "pitch", "yaw"):
            motion = thermal_noise.parse_motion(model, f"{body}.{dof}")
            found |= set(thermal_noise.solve(model, np.array([3.3]), [motion], 290.0)[0].source)
    return found


@pytest.mark.parametrize(
    "kind",
    ["quadruple", "payload-recoil-mass", "husman2000/table2", "eight-stages", "geo-silica-triple"],
)
def test_named_is_what_dissipates_nothing(kind):
    """Of a part that is named nothing comes, or bending alone; from all others something does,
    whatever moves."""
    design = convert(tomllib.loads((CONFIGS / f"{kind}.toml").read_text()))
    lossy = sources(design)
    named = {one.part: bool(one.bending) for one in find_lossless(design, "beam")}
    for stage in design.stage:
        parts = {
            "wires": ("bending-upper", "bending-lower", "stretching", "torsion"),
            "blades": ("blades",),
            "springs": ("springs",),
        }
        has = {"wires": stage.wires, "blades": stage.blades, "springs": stage.spring}
        for word, kinds in parts.items():
            seen = {kind for kind in kinds if f"{stage.name}.{kind}" in lossy}
            part = f"{stage.name}.{word}"
            if not has[word]:
                assert part not in named
            elif part not in named:
                assert seen == set(kinds), part
            else:
                assert seen == ({"bending-upper", "bending-lower"} if named[part] else set()), part


@pytest.mark.parametrize("kind", KINDS)
def test_templates_have_losses(kind, tmp_path):
    """In every model, so that Q is that of the same suspension whichever is taken."""
    file = from_template(tmp_path, kind)
    for level in ("auto", "string", "beam"):
        result = run("modes", file, "--out", tmp_path, "--no-plot", "--fidelity", level)
        assert "no loss" not in result.stderr, result.stderr
    answer, warnings = thermal_json(file, tmp_path)
    assert answer["without_loss"] == [] and warnings == []
