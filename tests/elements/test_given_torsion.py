"""The key `torsion` of wires: stiffness against twisting along the wire, on every model."""

from __future__ import annotations

import copy
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from suspension_cli.design.reader import convert
from suspension_cli.equilibrium import energy
from suspension_cli.equilibrium import solve as equilibrium
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.linear import eigenmodes
from suspension_cli.models import registry
from suspension_cli.scene.pose import displace, layout, nominal_pose
from tests.support.commandline import (
    modes_json,
    run,
    strict_json,
    written,
)
from tests.support.derivatives import complex_gradient, hessian

TORSION, INERTIA, LENGTH = 0.3, 0.05, 0.6


def single(**wires: Any) -> dict[str, Any]:
    """A body on one wire that ends 1 mm above its centre of mass."""
    body = {"mass": 9.0, "inertia": [0.04, 0.03, INERTIA]}
    one = {"count": 1, "l": LENGTH, "d": 0.001, "k": 1e5, "torsion": TORSION, **wires}
    return {"design": {"name": "single"}, "stage": [{"name": "test", "body": body, "wires": one}]}


GLASS = {"youngs_modulus": 7e10, "poisson_ratio": 0.25, "density": 2200.0}
MADE = {"material": "glass", "radius": 2e-4}


def yaw_of(tmp_path: Path, raw: dict[str, Any], level: str) -> dict[str, Any]:
    found = modes_json(written(tmp_path, raw), "--fidelity", level, "--no-plot", "--out", tmp_path)
    assert found["fidelity"] == level
    return next(mode for mode in found["modes"] if mode["dof"] == "yaw")


@pytest.mark.parametrize("level", ["force", "string"])
def test_yaw_of_a_body_on_one_wire(tmp_path: Path, level: str):
    assert yaw_of(tmp_path, single(), level)["frequency_hz"] == pytest.approx(
        math.sqrt(TORSION / INERTIA) / (2 * math.pi), rel=1e-12
    )


@pytest.mark.parametrize("level", ["beam", "violin"])
def test_it_overrides_what_the_cross_section_has(tmp_path: Path, level: str):
    """With its dilution: Q is 1/phi over the share of shear, 1 - T I_p/A/(GJ + T I_p/A)."""
    raw = single(**MADE) | {"materials": {"glass": GLASS | {"loss": {"angle": 1e-4}}}}
    sheared, pulled = 2.8e10 * math.pi * 2e-4**4 / 2, 9.0 * 9.81 * 2e-4**2 / 2
    found = yaw_of(tmp_path, raw, level)
    assert found["frequency_hz"] == pytest.approx(
        math.sqrt(TORSION / INERTIA) / (2 * math.pi), rel=1e-5
    )
    assert found["q"] == pytest.approx(1e4 * (1 + pulled / sheared), rel=1e-4)


@pytest.mark.parametrize("level", ["force", "string"])
def test_it_is_as_lossy_as_the_wire_is_against_stretching(tmp_path: Path, level: str):
    raw = single(**MADE) | {"materials": {"glass": GLASS | {"loss_angle": 3e-3}}}
    assert yaw_of(tmp_path, raw, level)["q"] == pytest.approx(1 / 3e-3, rel=1e-4)


def test_the_closed_forms_do_not_have_it(tmp_path: Path):
    done = run(
        "modes",
        written(tmp_path, single(count=4, s=0.02, t1=0.05, t2=0.05)),
        *["--fidelity", "closed-form", "--no-plot", "--out"],
        tmp_path,
    )
    assert done.exit_code == 2
    assert "its wires resist twisting" in done.stderr


def chain(count: int, **wires: Any) -> dict[str, Any]:
    """Two stages on wires that lean both ways, each with a torsion that counts."""
    shape = (
        {"s_upper": 0.05, "s_lower": 0.02, "t1": 0.03, "t2": 0.08}
        if count == 4
        else {"t1": 0.03, "t2": 0.08}
    )
    stages = []
    for name, torsion in (("upper", 4.0), ("test", 7.0)):
        body = {"mass": 8.0, "inertia": [0.05, 0.03, 0.06]}
        one = {
            "count": count,
            "l": 0.3,
            "d": 0.004,
            "d_upper": 0.003,
            "k": 3e4,
            "torsion": torsion,
            **shape,
            **wires,
        }
        stages.append({"name": name, "body": body, "wires": one})
    return {"design": {"name": "chain"}, "stage": stages}


def explicit(raw: dict[str, Any]) -> dict[str, Any]:
    """The same wires one by one."""
    scene = expand(convert(raw))
    result = copy.deepcopy(raw)
    for n, stage in enumerate(result["stage"], 1):
        torsion = stage.pop("wires")["torsion"]
        stage["position"] = (scene.bodies.position[n] - scene.bodies.position[n - 1]).tolist()
        mine = np.flatnonzero(scene.wires.lower == n)
        ends = [
            (scene.wires.upper_point[w].tolist(), scene.wires.lower_point[w].tolist()) for w in mine
        ]
        stage["wire"] = [
            {"upper": upper, "lower": lower, "k": 3e4, "torsion": torsion} for upper, lower in ends
        ]
    return result


@pytest.mark.parametrize("count", [2, 4])
def test_force_and_string_agree_on_wires_that_lean(count: int):
    """Roll and pitch twist such wires too. Each by its own way, and against no torsion at all it
    counts."""
    raw = chain(count)
    quick, general = (registry.by_name(level).system(convert(raw)) for level in ("force", "string"))
    size = np.abs(quick.stiffness).max()
    np.testing.assert_allclose(quick.stiffness, general.stiffness, atol=1e-13 * size)
    limp = registry.FORCE.system(convert(chain(count, torsion=1e-15))).stiffness
    changed = np.abs(np.diag(quick.stiffness - limp))
    assert (changed[[9, 10, 11]] > (0.01 if count == 4 else [-1, 0.01, 0.01])).all()


def test_wires_one_by_one_are_the_set():
    one, other = (
        eigenmodes.solve(registry.STRING.system(convert(raw)))
        for raw in (chain(4), explicit(chain(4)))
    )
    assert one.frequency == pytest.approx(other.frequency, rel=1e-9)
    assert one.label == other.label


def crooked() -> dict[str, Any]:
    """Wires that all differ, one of them with a torsion, so that the suspension hangs askew."""
    raw = explicit(chain(4))
    for n, wire in enumerate(raw["stage"][1]["wire"]):
        wire["upper"] = [value + 1e-3 * (n + axis) for axis, value in enumerate(wire["upper"])]
        wire["natural_length"] = 0.295 + 0.001 * n
        wire["torsion"] = 2.0 + n
    return raw


def test_turning_everything_costs_nothing():
    """In any pose: the energy as all bodies turn about one point together, and the forces as
    gradients of the energy."""
    scene = expand(convert(crooked()))
    numbering, rng = layout(scene), np.random.default_rng(5)
    pose = displace(numbering, nominal_pose(scene), 0.2 * rng.normal(size=numbering.size))
    weightless = replace(scene, gravity=0.0)
    place = scene.bodies.position + pose.shift
    step = np.zeros(numbering.size)
    axis = np.array([0.3, -0.5, 0.7])
    for n, here in enumerate(place):
        turned = rotated(axis, here)
        step[6 * n : 6 * n + 3], step[6 * n + 3 : 6 * n + 6] = turned - here, axis
    moved = displace(numbering, pose, step)
    before, after = (energy.energy(weightless, each) for each in (pose, moved))
    limp = replace(weightless, wires=replace(scene.wires, torsion=0 * scene.wires.torsion))
    twist = before - energy.energy(limp, pose)
    assert twist > 1e-3
    assert after - energy.energy(limp, moved) == pytest.approx(twist, rel=1e-9)


def rotated(axis: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Rodrigues' formula."""
    angle = float(np.linalg.norm(axis))
    u = axis / angle
    return (
        point * math.cos(angle)
        + np.cross(u, point) * math.sin(angle)
        + u * (u @ point) * (1 - math.cos(angle))
    )


def test_forces_and_stiffness_are_derivatives_of_the_energy():
    scene = expand(convert(crooked()))
    numbering, rng = layout(scene), np.random.default_rng(6)
    pose = displace(numbering, nominal_pose(scene), 0.1 * rng.normal(size=numbering.size))
    gradient, stiffness = energy.gradient_and_stiffness(scene, numbering, pose)
    expected = complex_gradient(energy.energy, scene, numbering, pose, np.zeros(numbering.size))
    assert np.abs(gradient - expected).max() < 1e-12 * np.abs(expected).max()
    expected = hessian(energy.energy, scene, numbering, pose)
    assert np.abs(stiffness - expected).max() < 1e-10 * np.abs(expected).max()


def test_a_wire_that_leans_resists_along_itself():
    """A body held by an oblique wire at its centre of mass: K of the rotations is torsion times e
    e^T, with e along the wire, and no other."""
    e = np.array([0.48, 0.6, -0.64])
    wire = {
        "upper": [0.0, 0.0, 0.0],
        "lower": [0.0, 0.0, 0.0],
        "k": 1e4,
        "torsion": TORSION,
        "tension": 1e-9,
    }
    hold = {"stiffness": [1.0] * 6, "preload": [0.0, 0.0, 9.81, 0.0, 0.0, 0.0]}
    stage = {
        "name": "test",
        "position": (0.5 * e).tolist(),
        "body": {"mass": 1.0, "inertia": [1.0, 1.0, 1.0]},
        "wire": [wire],
        "spring": [hold],
    }
    with_it = registry.STRING.system(
        convert({"design": {"name": "held"}, "stage": [stage]})
    ).stiffness
    del wire["torsion"]
    without = registry.STRING.system(
        convert({"design": {"name": "held"}, "stage": [stage]})
    ).stiffness
    change = with_it - without
    np.testing.assert_allclose(change[9:, 9:], TORSION * np.outer(e, e), atol=1e-14)
    np.testing.assert_allclose(change[3:6, 9:], -TORSION * np.outer(e, e), atol=1e-14)
    change[np.ix_([3, 4, 5, 9, 10, 11], [3, 4, 5, 9, 10, 11])] = 0
    assert np.abs(change).max() == 0


def test_a_body_on_one_wire_no_longer_turns_freely():
    """An imperfect one, for which the pose is sought."""
    raw = single() | {"perturbation": [{"wire": "test.1", "lower_offset": [0.002, 0.001, 0.0]}]}
    scene = expand(convert(raw))
    found = equilibrium.solve(scene)
    assert np.all(found.converged)
    stiffness = energy.gradient_and_stiffness(scene, layout(scene), found.pose)[1]
    assert np.linalg.eigvalsh(stiffness[6:, 6:]).min() > 0.1 * TORSION


@pytest.mark.parametrize("level", ["string", "beam"])
def test_sensitivity_of_yaw(tmp_path: Path, level: str):
    """f ~ sqrt(torsion): 1 % more is 0.5 %, by the exact derivatives on string and by differences
    on beam; no other mode changes."""
    path = written(tmp_path, single(**MADE) | {"materials": {"glass": GLASS}})
    found = strict_json(
        run(
            "sensitivity", path, "--fidelity", level, "--json", "--no-plot", "--out", tmp_path
        ).stdout
    )
    row = [item["name"] for item in found["parameters"]].index("stage.test.wires.torsion")
    for item, change in zip(found["results"], found["one_percent"][row], strict=True):
        assert change == pytest.approx(0.5 if item["name"] == "test yaw" else 0.0, abs=1e-6)


@pytest.mark.parametrize("level", ["force", "string", "beam"])
def test_sweep(tmp_path: Path, level: str):
    """A batch of designs: a response, losses included, is that of each design alone."""
    raw = single(**MADE) | {"materials": {"glass": GLASS | {"loss": {"angle": 1e-3}}}}
    way, common = (
        "test.yaw/support.yaw:0.4",
        ("--fidelity", level, "--json", "--no-plot", "--out", tmp_path),
    )
    vary = ("--vary", "stage.test.wires.torsion=0.1:1:3", "--result", way)
    done = run("sweep", written(tmp_path, raw), *vary, *common)
    found = strict_json(done.stdout)["results"][0]
    assert done.exit_code == 0
    for value, torsion in zip(found["values"], (0.1, 0.55, 1.0), strict=True):
        raw["stage"][0]["wires"]["torsion"] = torsion
        way = ("--input", "support.yaw", "--output", "test.yaw", "--frequency", 0.4)
        alone = strict_json(run("response", written(tmp_path, raw), *way, *common).stdout)
        assert value == pytest.approx(math.hypot(alone["real"][0], alone["imag"][0]), rel=1e-9)
        assert value == pytest.approx(
            1 / abs(1 - INERTIA * (2 * math.pi * 0.4) ** 2 / torsion), rel=1e-3
        )
