"""Random suspensions, common and unusual, to test the choice of the model.

Common ones are chains of one to four stages. Unusual ones are light bodies on wires of up to 0.7 of
their mass, one and two wires, wires that cross, offset centres of mass, a recoil mass beside a
mirror, masses that differ 300-fold, ribbons, tapers and thick ends.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.random import Generator

from suspension_cli.design import reader
from suspension_cli.design.reader import Source
from suspension_cli.errors import InputError
from suspension_cli.linear import eigenmodes
from suspension_cli.models import registry

Raw = dict[str, Any]

GRAVITY = {"Earth": 9.81, "Moon": 1.62}
MATERIALS: dict[str, tuple[float, float]] = {
    "c70steel": (1.9e11, 7800.0),
    "steel302": (1.8e11, 7900.0),
    "tungsten": (4.1e11, 19300.0),
    "fused-silica": (7.2e10, 2200.0),
    "cord": (4e9, 1140.0),
}
"""Young's modulus (Pa) and density (kg/m^3) of the wires' materials, to size wires by."""
CORD = {"youngs_modulus": 4e9, "poisson_ratio": 0.4, "density": 1140.0, "loss_angle": 1e-2}
STRESS = (2e6, 2e9)
"""Stress in the wires, Pa, which sets their thickness: steel is used at 0.3 to 1 GPa."""
IMPERFECT = 0.25
"""Fraction of common suspensions that are built imperfectly."""


def random_source(seed: int, *, common: bool) -> Source:
    """Draw a design that hangs stably on strings and on wires that bend."""
    rng = np.random.default_rng([4388, seed, common])
    while True:
        raw = draw_design(rng, _chain if common else KINDS[int(rng.integers(len(KINDS)))])
        text = reader.write_toml(raw)
        try:
            source = Source(reader.parse(text), text, "")
            models = (registry.STRING, registry.BEAM)
            if all(eigenmodes.solve(model.system(source.design)).stable for model in models):
                return source
        except InputError:
            continue


def draw_design(rng: Generator, kind: Callable[[Generator], list[Raw]]) -> Raw:
    """Draw a design file of a kind; not every one hangs stably."""
    gravity = GRAVITY["Moon" if rng.random() < 0.1 else "Earth"]
    stages = kind(rng)
    for stage, load in zip(stages, loads(stages, gravity), strict=True):
        _give_wires(rng, stage, load)
        if "wires" in stage and rng.random() < 0.3:
            _give_blades(rng, stage, load)
        if rng.random() < 0.1:
            stage["damping"] = {"x": _between(rng, 1e-3, 1.0), "yaw": _between(rng, 1e-5, 1e-2)}
    raw = {
        "design": {"name": kind.__name__.strip("_").replace("_", "-")},
        "constants": {"gravity": gravity, "temperature": float(rng.choice([20.0, 123.0, 290.0]))},
        "materials": {"cord": CORD},
        "stage": stages,
    }
    if kind is _chain and rng.random() < IMPERFECT:
        raw["perturbation"] = [
            {
                "wire": f"{stage['name']}.1",
                "k_factor": float(rng.uniform(0.9, 1.1)),
                "upper_offset": (1e-4 * rng.uniform(-1, 1, 3)).tolist(),
            }
            for stage in stages
        ]
    return raw


def loads(stages: list[Raw], gravity: float) -> list[float]:
    """Weight (N) that the wires of each stage carry."""
    mass = {stage["name"]: stage["body"]["mass"] for stage in stages}
    above = {
        stage["name"]: stage.get("hangs_from", before)
        for stage, before in zip(stages, ["support", *mass], strict=False)
    }
    carried = dict(mass)
    for name in reversed(list(mass)):
        if above[name] != "support":
            carried[above[name]] += carried[name]
    return [gravity * carried[name] for name in mass]


def _chain(rng: Generator) -> list[Raw]:
    """One to four stages of similar masses."""
    return [_stage(rng, f"mass{n}", _between(rng, 1.0, 40.0)) for n in range(1 + rng.integers(4))]


def _light_body(rng: Generator) -> list[Raw]:
    """One or two light bodies; `_give_wires` may hang them on wires of their own mass."""
    stages = [
        _stage(rng, f"light{n}", _between(rng, 0.005, 0.5)) for n in range(1 + rng.integers(2))
    ]
    for stage in stages:
        stage["heavy"] = _between(rng, 1e-3, 0.7)
    return stages


def _few_wires(rng: Generator) -> list[Raw]:
    """Up to three stages on one or two wires each."""
    return [
        _stage(rng, f"mass{n}", _between(rng, 0.2, 30.0), int(rng.choice([1, 2])))
        for n in range(1 + rng.integers(3))
    ]


def _crossing(rng: Generator) -> list[Raw]:
    """One body on two pairs of wires that cross, seen along the beam."""
    mass = _between(rng, 0.3, 30.0)
    body, half = _body(rng, mass)
    x, inside, outside = half * _between(rng, 0.2, 1.0), half * 0.3, half * rng.uniform(0.5, 1.2)
    apart, drop = 0.02 * half, _between(rng, 0.1, 0.8)
    height = rng.uniform(0.0, 0.5) * half
    wires = [
        {
            "upper": [end * (x + side * apart), side * outside, 0.0],
            "lower": [end * (x + side * apart), -side * inside, height],
        }
        for end in (1, -1)
        for side in (1, -1)
    ]
    return [
        {"name": "crossed", "body": body, "position": [0.0, 0.0, -drop - height], "wire": wires}
    ]


def _lopsided(rng: Generator) -> list[Raw]:
    """One body on three to five wires whose centre is off its centre of mass."""
    mass = _between(rng, 0.3, 30.0)
    body, half = _body(rng, mass)
    count, drop = int(rng.integers(3, 6)), _between(rng, 0.1, 0.8)
    angle = 2 * np.pi * (np.arange(count) + rng.uniform(-0.25, 0.25, count)) / count
    foot = half * rng.uniform(0.4, 1.0, (count, 1)) * np.stack([np.cos(angle), np.sin(angle)], 1)
    foot += half * rng.uniform(-0.15, 0.15, 2)
    head = foot * rng.uniform(0.8, 1.3, (count, 1))
    height = rng.uniform(0.02, 0.4) * half
    wires = [
        {"upper": [*up.tolist(), 0.0], "lower": [*low.tolist(), height]}
        for up, low in zip(head, foot, strict=True)
    ]
    return [
        {
            "name": "lopsided",
            "body": body,
            "position": [0.0, 0.0, -drop - height],
            "wire": wires,
            "settles": bool(rng.random() < 0.7),
        }
    ]


def _tree(rng: Generator) -> list[Raw]:
    """A mirror and a recoil mass beside it, both on one upper mass."""
    return [
        _stage(rng, "upper", _between(rng, 1.0, 40.0), int(rng.choice([1, 2, 4]))),
        _stage(rng, "recoil", _between(rng, 0.2, 40.0)) | {"hangs_from": "upper"},
        _stage(rng, "mirror", _between(rng, 0.2, 40.0)) | {"hangs_from": "upper"},
    ]


def _unequal(rng: Generator) -> list[Raw]:
    """Two or three stages whose masses differ by up to a factor of 300 from one to the next."""
    mass, stages = _between(rng, 0.3, 30.0), []
    for n in range(2 + rng.integers(2)):
        stages.append(_stage(rng, f"mass{n}", mass))
        mass = float(np.clip(mass * _between(rng, 3.0, 300.0) ** rng.choice([-1, 1]), 5e-3, 300.0))
    return stages


def _shaped(rng: Generator) -> list[Raw]:
    """One or two stages on ribbons, tapers or wires with thick ends."""
    stages = [_stage(rng, f"mass{n}", _between(rng, 0.5, 50.0)) for n in range(1 + rng.integers(2))]
    for stage in stages:
        stage["profile"] = str(rng.choice(["ribbon", "taper", "thick-ends"]))
    return stages


KINDS: tuple[Callable[[Generator], list[Raw]], ...] = (
    _light_body,
    _few_wires,
    _crossing,
    _lopsided,
    _tree,
    _unequal,
    _shaped,
)


def _between(rng: Generator, low: float, high: float) -> float:
    """Draw a number whose logarithm is uniform."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _body(rng: Generator, mass: float) -> tuple[Raw, float]:
    """Draw a homogeneous box; with half its mean side, m."""
    sides = rng.uniform(0.5, 1.8, 3)
    sides *= (mass / _between(rng, 500.0, 8000.0) / sides.prod()) ** (1 / 3)
    return {"mass": mass, "shape": "box", "size": sides.tolist()}, float(sides.mean() / 2)


def _stage(rng: Generator, name: str, mass: float, count: int = 0) -> Raw:
    """Draw a body on a symmetric set."""
    body, half = _body(rng, mass)
    count = count or int(rng.choice([1, 2, 4, 4]))
    length = _between(rng, 0.08, 1.2)
    wires: Raw = {"count": count, "l": length, "d": half * float(rng.choice([0.0, 0.02, 0.1, 0.4]))}
    wires["d_upper"] = half * float(rng.choice([0.0, 0.0, 0.05]))
    if count < 4:
        wires["d"] = max(wires["d"], 1e-3)
    if count > 1:
        wires["t2"] = half * rng.uniform(0.3, 1.1)
        wires["t1"] = abs(wires["t2"] + float(rng.choice([0.0, 0.3, -0.3])) * length)
    if count == 4:
        wires["s"] = half * _between(rng, 0.05, 1.0)
    return {"name": name, "body": body, "wires": wires}


def _give_wires(rng: Generator, stage: Raw, load: float) -> None:
    """Draw material, cross-section and clamps of a stage's wires."""
    material = str(rng.choice(list(MATERIALS)))
    modulus, density = MATERIALS[material]
    given, every = stage.get("wires"), stage.get("wire", [])
    count = given["count"] if given else len(every)
    length = given["l"] if given else -stage["position"][2]
    area = load / count / _between(rng, *STRESS)
    heavy = stage.pop("heavy", None)
    if heavy is not None:
        area = heavy * stage["body"]["mass"] / (count * length * density)
    own = {"material": material} | _profile(
        rng, stage.pop("profile", ""), float(np.sqrt(area / np.pi)), length
    )
    if rng.random() < 0.3:
        own["clamp"] = "bending-point"
    settles = stage.pop("settles", False)
    for wire in [given] if given else every:
        wire |= own
        if settles:  # as long as if all carried the same, so that the body hangs elsewhere
            span = np.array(wire["lower"]) + stage["position"] - np.array(wire["upper"])
            wire["natural_length"] = float(
                np.sqrt((span**2).sum()) / (1 + load / count / modulus / area)
            )


def _profile(rng: Generator, profile: str, radius: float, length: float) -> Raw:
    """Draw a cross-section whose area is that of a round wire of some radius, about."""
    if profile == "ribbon":
        flat = _between(rng, 3.0, 20.0)
        thickness = radius * float(np.sqrt(np.pi / flat))
        return {"section": {"width": flat * thickness, "thickness": thickness}}
    if profile == "taper":
        ends = [radius * rng.uniform(1.0, 2.0), radius * rng.uniform(0.7, 1.0)]
        return {"sections": [{"radius": ends[:: int(rng.choice([1, -1]))], "steps": 6}]}
    if profile == "thick-ends":
        end = {"length": length * rng.uniform(0.02, 0.1), "radius": radius * rng.uniform(1.5, 3.0)}
        return {"sections": [end, {"radius": radius}, end]}
    return {"radius": radius}


def _give_blades(rng: Generator, stage: Raw, load: float) -> None:
    """Hang a symmetric set from blades."""
    count = {1: 1, 2: 2, 4: int(rng.choice([2, 4]))}[stage["wires"]["count"]]
    blades: Raw = {
        "count": count,
        "stiffness": load / count / _between(rng, 2e-3, 0.2),
        "loss_angle": _between(rng, 1e-5, 1e-3),
    }
    if rng.random() < 0.4:
        blades["tip_mass"] = load / 9.81 * _between(rng, 1e-3, 0.05)
    if rng.random() < 0.2:
        blades["lateral_stiffness"] = [blades["stiffness"] * 30.0, blades["stiffness"] * 100.0]
    stage["blades"] = blades
