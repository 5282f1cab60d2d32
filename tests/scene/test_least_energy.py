"""More wires than balance can tell apart: they share the load so that the elastic energy is least
(Castigliano)."""

from __future__ import annotations

import numpy as np
import pytest

from suspension_cli.equilibrium import solve as equilibrium
from tests.support import scenes

MASS, GRAVITY = 12.0, 9.81
BODY = {"mass": MASS, "inertia": [0.1, 0.1, 0.1]}


def vertical_wires(rng, count):
    """Around the COM, each with its own k."""
    angles = 2 * np.pi * (np.arange(count) + rng.uniform(-0.2, 0.2, count)) / count
    points = [[0.1 * np.cos(a), 0.1 * np.sin(a), 0.01] for a in angles]
    return [
        {"upper": [*p[:2], 0.0], "lower": p, "k": scenes.log_uniform(rng, 1e4, 4e4)} for p in points
    ]


def angled_wires(rng):
    """Two sets of four, angled in x and y; nothing but their k and angles decides which carries
    more."""
    result = []
    for s, t in ((0.03, 0.1), (0.08, 0.05)):
        out, k = rng.uniform(-0.04, 0.04, 2), scenes.log_uniform(rng, 1e4, 4e4)
        for i, j in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
            result.append(
                {
                    "upper": [i * (s + out[0]), j * (t + out[1]), 0.0],
                    "lower": [i * s, j * t, 0.01],
                    "k": k,
                }
            )
    return result


def stage_of(wires, **more):
    return scenes.raw_of(
        {"name": "test", "body": BODY, "position": [0.0, 0.0, -0.31], "wire": wires, **more}
    )


def least_energy(wires, blades=(), spring=None):
    """Minimise sum T^2 / 2k + sum over blades F^2 / 2k subject to balance, by its Lagrange
    equations."""
    span = np.array([np.array([0, 0, -0.31]) + wire["lower"] - wire["upper"] for wire in wires])
    unit = span / np.linalg.norm(span, axis=1)[:, None]
    balance = np.array(
        [[*(-u), *np.cross(wire["lower"], -u)] for u, wire in zip(unit, wires, strict=True)]
    ).T
    load = np.array([0, 0, -MASS * GRAVITY, 0, 0, 0], dtype=float)
    if spring is not None:
        force, torque = np.array(spring["preload"][:3]), np.array(spring["preload"][3:])
        load += [*force, *(torque + np.cross(spring["at"], force))]
    hessian = np.diag([1 / wire["k"] for wire in wires])
    for blade in blades:
        on = np.array([wire.get("blade") == blade["name"] for wire in wires])
        for axis, k in zip(
            (2, 0, 1), (blade["stiffness"], *blade.get("lateral_stiffness", ())), strict=False
        ):
            pull = np.where(on, unit[:, axis], 0.0)
            hessian += np.outer(pull, pull) / k
    n = len(wires)
    scale = np.diag(hessian).mean()  # so that both halves of the system are of order 1
    system = np.block([[hessian / scale, balance.T], [balance, np.zeros((6, 6))]])
    solved = np.linalg.lstsq(system, np.concatenate([np.zeros(n), -load]), rcond=1e-12)[0]
    assert np.abs(balance @ solved[:n] + load).max() < 1e-10 * MASS * GRAVITY
    return solved[:n]


SPRING = {
    "stiffness": [10.0] * 6,
    "at": [0.02, 0.01, 0.0],
    "preload": [0.0, 0.0, 25.0, 0.3, -0.2, 0.0],
}


def on_blades(rng, wires, *, lateral=False):
    """The blades of wires: two shared by the wires of a side, and one of its own."""
    names, softness = ("left", "right", "soft"), (6e3, 8e3)
    blades = [{"name": name, "stiffness": scenes.uniform(rng, *softness)} for name in names]
    for blade in blades if lateral else ():
        blade["lateral_stiffness"] = rng.uniform(3e4, 5e4, 2)
    for number, wire in enumerate(wires):
        wire["blade"] = names[number % 2]
    wires[-1]["blade"] = "soft"
    return blades


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    "kind", ["4", "5", "7", "angled", "blades", "lateral blades", "preload", "lopsided"]
)
def test_against_the_equations_of_lagrange(kind, seed):
    """Two wires on one blade share its deflection, so the blade counts once for both; wires that
    mirror each other need not carry the same, under a lopsided load. Giving a tension that would
    come about changes nothing. The nominal pose balances."""
    rng = np.random.default_rng([16, seed])
    upright = kind in ("4", "5", "7", "preload")
    wires = (
        vertical_wires(rng, int(kind) if kind.isdigit() else 5) if upright else angled_wires(rng)
    )
    blades = on_blades(rng, wires, lateral=kind.startswith("lat")) if "blades" in kind else []
    spring = SPRING if kind in ("preload", "lopsided") else None
    if kind == "lopsided":
        spring = SPRING | {"at": [0.0, 0.0, 0.0], "preload": [0.0, 0.0, 0.0, 0.02, 0.01, 0.0]}
    more = ({"blade": blades} if blades else {}) | ({"spring": [spring]} if spring else {})
    expected = least_energy(wires, blades, spring)
    scene = scenes.scene_of(stage_of(wires, **more))
    found = scene.wires.tension
    np.testing.assert_allclose(found, expected, rtol=1e-10)
    assert np.ptp(found) > 0.1
    if blades:
        assert np.abs(found / least_energy(wires) - 1).max() > 1e-3
        unit = scene.wires.span / scene.wires.length[:, None]
        for number in range(3):
            on = scene.wires.blade == number
            load = -(found * unit[:, 2])[on].sum()
            np.testing.assert_allclose(scene.blades.load[number, 2], load, rtol=1e-12)
    pose = equilibrium.solve(scene)
    assert pose.residual < 1e-13
    assert np.abs(pose.pose.shift).max() < 1e-12
    wires[0]["tension"] = float(expected[0])
    again = scenes.scene_of(stage_of(wires, **more)).wires.tension
    np.testing.assert_allclose(again, expected, rtol=1e-10)


def test_tensions_given_are_kept():
    wires = vertical_wires(np.random.default_rng(19), 4)
    expected = least_energy(wires)
    wires[0]["tension"] = float(expected[0]) + 3.0
    found = scenes.scene_of(stage_of(wires)).wires.tension
    assert found[0] == wires[0]["tension"]
    wrench = np.array([[1.0, wire["lower"][0], wire["lower"][1]] for wire in wires]).T @ found
    np.testing.assert_allclose(wrench, [MASS * GRAVITY, 0, 0], atol=1e-10)
