"""Random designs for the tests, as the parsed TOML that a design file gives.

Every function takes a seeded numpy Generator. Numbers are those of real suspensions (bodies of 1 to
40 kg with the inertia of solid blocks, wires of 0.15 to 1 m and 1e3 to 1e5 N/m), so that what is
compared is well conditioned.
"""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
from numpy.random import Generator

from suspension_cli.design import reader
from suspension_cli.design.schema import Design
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.scene.scene import Scene

Raw = dict[str, Any]
BLADE_COUNTS = [(1, 1), (2, 1), (2, 2), (4, 2), (4, 4)]
"""Wires of a set and blades that can carry them."""


def design_of(raw: Raw) -> Design:
    """A checked design."""
    return reader.convert(plain(raw))


def plain(value: Any) -> Any:
    """A copy in the types that a TOML file has."""
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [plain(item) for item in value]
    return value.item() if isinstance(value, np.generic) else value


def scene_of(raw: Raw) -> Scene:
    """The scene that a parsed file stands for."""
    return expand(design_of(raw))


def hung(wires: dict[str, Any], mass: float, inertia: float, **more: Any) -> dict[str, Any]:
    """A stage `test` of a body with equal moments of inertia on a set of wires."""
    body = {"mass": mass, "inertia": [inertia] * 3}
    return {"name": "test", "body": body, "wires": wires} | more


def raw_of(*stages: Raw, name: str = "random", **more: Any) -> Raw:
    """A document with these stages."""
    return {"design": {"name": name}, "stage": list(stages), **more}


def log_uniform(rng: Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def uniform(rng: Generator, low: float, high: float) -> float:
    return float(rng.uniform(low, high))


def body(rng: Generator) -> Raw:
    """A solid block, given by its mass and moments of inertia."""
    mass, density = log_uniform(rng, 1.0, 40.0), log_uniform(rng, 2200.0, 8000.0)
    sides = rng.uniform(0.6, 1.6, 3)
    sides *= (mass / density / sides.prod()) ** (1 / 3)
    squares = sides**2
    return {
        "mass": mass,
        "inertia": [float(mass * (squares.sum() - square) / 12) for square in squares],
    }


def full_inertia(rng: Generator, mass: float) -> list[list[float]]:
    """A positive definite inertia with products, that of a body of some 0.1 m."""
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    matrix = mass * 0.01 * turn @ np.diag(rng.uniform(0.6, 1.0, 3)) @ turn.T
    return ((matrix + matrix.T) / 2).tolist()


def wire_set(
    rng: Generator,
    count: int = 4,
    *,
    size: float = 0.1,
    angled: bool = True,
    splayed: bool = True,
    raised: bool = True,
) -> Raw:
    """A symmetric set on a body of some half width `size` (m).

    angled: t1 and t2 may differ; splayed: s_upper and s_lower may differ; raised: d and d_upper may
    be other than 0.
    """
    result: Raw = {
        "count": count,
        "l": log_uniform(rng, 0.15, 1.0),
        "k": log_uniform(rng, 1e3, 1e5),
    }
    if count > 1:
        t2 = uniform(rng, 0.5, 1.2) * size
        result |= {"t2": t2, "t1": t2}
        if angled and rng.random() < 0.7:
            result["t1"] = abs(t2 + uniform(rng, -0.5, 0.5) * result["l"] * 0.6)
    if count == 4:
        s = log_uniform(rng, 0.1, 1.0) * size
        if splayed and rng.random() < 0.5:
            result |= {"s_upper": abs(s + uniform(rng, -0.2, 0.2) * result["l"]), "s_lower": s}
        else:
            result["s"] = s
    if raised and (count < 4 or rng.random() < 0.7):
        result |= {"d": uniform(rng, 0.001, 0.03), "d_upper": uniform(rng, 0.0, 0.02)}
    return result


def blade_set(rng: Generator, count: int, *, tip_mass: bool = False, lateral: bool = False) -> Raw:
    result: Raw = {"count": count, "stiffness": log_uniform(rng, 1e3, 1e4)}
    if tip_mass:
        result["tip_mass"] = uniform(rng, 0.05, 0.3)
    if lateral:
        result["lateral_stiffness"] = [log_uniform(rng, 1e4, 1e5), log_uniform(rng, 1e4, 1e5)]
    return result


def stage(
    rng: Generator,
    name: str = "test",
    count: int = 4,
    *,
    blades: Raw | None = None,
    **options: bool,
) -> Raw:
    """A stage on a symmetric set, whose options are those of `wire_set`."""
    block = body(rng)
    half = 0.5 * (block["mass"] / 4000.0) ** (1 / 3)
    result: Raw = {"name": name, "body": block, "wires": wire_set(rng, count, size=half, **options)}
    return result if blades is None else result | {"blades": blades}


def single(rng: Generator, **options: bool) -> Raw:
    """One symmetric stage on four wires."""
    return raw_of(stage(rng, **options))


def chain(rng: Generator, stages: int) -> Raw:
    """A symmetric chain without blades; 1, 2 or 4 wires a stage."""
    return raw_of(
        *(stage(rng, f"mass{n}", int(rng.choice([1, 2, 4, 4]))) for n in range(1, stages + 1))
    )


def bladed_stage(
    rng: Generator, name: str, wires: int, blades: int, *, angled: bool = False, **options: bool
) -> Raw:
    """A stage on blades; by default under vertical wires."""
    return stage(
        rng, name, wires, blades=blade_set(rng, blades, **options), angled=angled, splayed=angled
    )


def bladed_chain(rng: Generator, stages: int, **options: bool) -> Raw:
    """A symmetric chain in which some stages, at least the first, hang from blades under vertical
    wires."""
    result = []
    for n in range(1, stages + 1):
        wires, blades = BLADE_COUNTS[rng.integers(len(BLADE_COUNTS))]
        if n == 1 or rng.random() < 0.6:
            result.append(bladed_stage(rng, f"mass{n}", wires, blades, **options))
        else:
            result.append(stage(rng, f"mass{n}", wires))
    return raw_of(*result)


def spring(rng: Generator) -> Raw:
    """A spring with a full symmetric stiffness, weak against the wires, a point off the COM and a
    preload."""
    unit = np.array([10.0, 10.0, 10.0, 0.5, 0.5, 0.5])
    root = rng.normal(size=(6, 6)) * unit[:, None]
    stiffness = root @ root.T / 6
    preload = rng.uniform(-1, 1, 6) * [0.3, 0.3, 0.3, 0.01, 0.01, 0.01]
    return {
        "stiffness": ((stiffness + stiffness.T) / 2).tolist(),
        "at": rng.uniform(-0.1, 0.1, 3).tolist(),
        "preload": preload.tolist(),
    }


def crooked_stage(
    rng: Generator, name: str, load: float, *, blades: bool = False, springs: int = 0, **more: Any
) -> Raw:
    """Four explicit wires with nothing symmetric left, cut to natural lengths that roughly carry
    `load` (N)."""
    mass = log_uniform(rng, 2.0, 20.0)
    s, t, height = uniform(rng, 0.02, 0.08), uniform(rng, 0.06, 0.14), uniform(rng, 0.2, 0.6)
    position = np.array([*rng.uniform(-2e-3, 2e-3, 2), -height])
    result: Raw = {
        "name": name,
        "body": {"mass": mass, "inertia": full_inertia(rng, mass)},
        "position": position.tolist(),
        **more,
    }
    result["wire"] = []
    for number, (along, across) in enumerate([(1, 1), (1, -1), (-1, 1), (-1, -1)]):
        lower = np.array([along * s, across * t, 0.01]) + rng.uniform(-3e-3, 3e-3, 3)
        upper = np.array([along * s, across * t * 0.7, -0.01]) + rng.uniform(-3e-3, 3e-3, 3)
        span = position + lower - upper
        k, length = log_uniform(rng, 1e4, 4e4), float(np.linalg.norm(span))
        share = (load + 9.81 * mass) / 4 * length / -span[2]
        wire = {
            "upper": upper.tolist(),
            "lower": lower.tolist(),
            "k": k,
            "natural_length": float(length - share / k),
        }
        if blades:
            wire["blade"] = ("left", "left", "right", "right")[number]
        result["wire"].append(wire)
    if blades:
        result["blade"] = [
            {"name": side} | blade_set(rng, 1, tip_mass=True, lateral=True)
            for side in ("left", "right")
        ]
        for blade in result["blade"]:
            del blade["count"]
        result["blade"][0]["at"] = rng.uniform(-0.1, 0.1, 3).tolist()
    if springs:
        result["spring"] = [spring(rng) for _ in range(springs)]
    return result


def crooked(rng: Generator) -> Raw:
    """A tree with nothing symmetric: an upper mass on blades, a mirror and a recoil mass beside
    each other, springs."""
    below = 2 * 15.0 * 9.81
    upper = crooked_stage(rng, "upper", below, blades=True, springs=1)
    mirror = crooked_stage(rng, "mirror", 0.0, springs=2)
    recoil = crooked_stage(rng, "recoil", 0.0, blades=bool(rng.random() < 0.5), hangs_from="upper")
    return raw_of(upper, mirror, recoil)


def perturbations(rng: Generator, raw: Raw) -> Raw:
    """The same design, built imperfectly: one wire and one body of every stage of symmetric
    sets."""
    items: list[Raw] = []
    for one in raw["stage"]:
        count = one["wires"]["count"]
        items.append(
            {
                "wire": f"{one['name']}.{rng.integers(1, count + 1)}",
                "k_factor": uniform(rng, 0.8, 1.25),
                "upper_offset": rng.uniform(-1e-3, 1e-3, 3).tolist(),
                "lower_offset": rng.uniform(-1e-3, 1e-3, 3).tolist(),
                "length_change": uniform(rng, -1e-4, 1e-4),
                "hold": str(rng.choice(["loaded-length", "natural-length"])),
            }
        )
        items.append(
            {
                "body": one["name"],
                "com_offset": rng.uniform(-5e-4, 5e-4, 3).tolist(),
                "rotation": rng.uniform(-0.01, 0.01, 3).tolist(),
            }
        )
    return raw | {"perturbation": items}


def fibred(
    raw: Raw, stress: float = 6e8, *, material: str = "steel302", ribbons: bool = False
) -> Raw:
    """The same symmetric chain on wires of a cross-section that carries its load at such a stress
    (Pa)."""
    result, load = copy.deepcopy(raw), 0.0
    for one in reversed(result["stage"]):
        load += 9.81 * one["body"]["mass"]
        wires = one["wires"]
        del wires["k"]
        area = load / wires["count"] / stress
        section = (
            {"section": {"width": (4 * area) ** 0.5, "thickness": (area / 4) ** 0.5}}
            if ribbons
            else {"radius": (area / np.pi) ** 0.5}
        )
        wires |= {"material": material} | section
    return result


def step_of(
    rng: Generator, names: tuple[str, ...], length: float, angle: float, *, support: bool = True
) -> Any:
    """A random step in generalised coordinates: up to `length` (m) and `angle` (rad)."""
    scale = np.array(
        [angle if name.rsplit(".", 1)[1] in ("roll", "pitch", "yaw") else length for name in names]
    )
    if not support:
        scale[:6] = 0.0
    return rng.uniform(-1, 1, len(names)) * scale


def turned(raw: Raw, turn: Any) -> Raw:
    """A design of explicit wires and springs by a rotation (3, 3), in the frames of bodies that are
    turned too."""
    six = np.kron(np.eye(2), turn)
    result = copy.deepcopy(raw)
    for one in result["stage"]:
        one["position"] = (turn @ one["position"]).tolist()
        one["body"]["inertia"] = _symmetric(turn @ np.array(one["body"]["inertia"]) @ turn.T)
        for wire in one["wire"]:
            wire["upper"], wire["lower"] = (
                (turn @ wire["upper"]).tolist(),
                (turn @ wire["lower"]).tolist(),
            )
        for spring_ in one.get("spring", []):
            spring_["at"] = (turn @ spring_["at"]).tolist()
            spring_["preload"] = (six @ spring_.get("preload", np.zeros(6))).tolist()
            spring_["stiffness"] = _symmetric(six @ np.array(spring_["stiffness"]) @ six.T)
    return result


def _symmetric(matrix: Any) -> list[list[float]]:
    return ((matrix + matrix.T) / 2).tolist()
