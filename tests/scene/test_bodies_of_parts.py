"""Bodies of parts: mass, COM and inertia against closed forms and sums over small cubes."""

from __future__ import annotations

import tomllib

import msgspec
import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.design import reader
from suspension_cli.design.bodies import Body, body_inertia, body_mass, centre_of_mass
from suspension_cli.linear import eigenmodes
from suspension_cli.models import registry
from tests.support.commandline import run, written
from tests.support.designs import TEXTS


def body(*parts: dict) -> Body:
    return msgspec.convert({"parts": list(parts)}, Body)


def test_dumbbell():
    """Two balls m of radius r at +-L on y: 4/5 m r^2 about y, that and 2 m L^2 across."""
    m = 3.0
    r = 0.04
    long = 0.3
    ball = {"shape": "sphere", "radius": r, "mass": m}
    made = body(ball | {"at": [0.0, long, 0.0]}, ball | {"at": [0.0, -long, 0.0]})
    along = 0.8 * m * r**2
    across = along + 2 * m * long**2
    assert body_mass(made) == 2 * m and centre_of_mass(made) == (0.0, 0.0, 0.0)
    np.testing.assert_allclose(body_inertia(made), np.diag([across, along, across]), rtol=1e-14)


def test_ballast_on_a_flange():
    """A point mass m on a body M at r: the reduced mass m M / (m + M) at r adds to it."""
    mirror = {"shape": "cylinder", "axis": "x", "radius": 0.09, "length": 0.1, "mass": 5.0}
    place = np.array([0.05, 0.02, 0.09])
    made = body(mirror, {"mass": 0.2, "at": place.tolist()})
    alone = np.array(body_inertia(msgspec.convert(mirror, Body)))
    reduced = 5.0 * 0.2 / 5.2
    added = reduced * (place @ place * np.eye(3) - np.outer(place, place))
    np.testing.assert_allclose(centre_of_mass(made), 0.2 / 5.2 * place, rtol=1e-14)
    np.testing.assert_allclose(body_inertia(made), alone + added, rtol=1e-13)


def test_against_a_sum_over_small_cubes():
    """A hollow cylinder about z and a box, integrated by the midpoint rule."""
    tube = {"shape": "cylinder", "axis": "z", "radius": 0.1, "inner_radius": 0.06, "length": 0.05}
    box = {"shape": "box", "size": [0.04, 0.08, 0.02], "density": 3000.0, "at": [0.05, -0.1, 0.07]}
    made = body(tube | {"density": 2000.0, "at": [-0.02, 0.03, 0.0]}, box)
    points = []
    weights = []
    for part in made.parts:
        half = np.array([0.1, 0.1, 0.025] if part.shape == "cylinder" else part.size)
        half = half if part.shape == "cylinder" else half / 2
        count = np.array([160, 160, 20])
        axes = [h * ((np.arange(n) + 0.5) * 2 / n - 1) for h, n in zip(half, count, strict=True)]
        grid = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
        if part.shape == "cylinder":
            distance = np.hypot(grid[:, 0], grid[:, 1])
            grid = grid[(distance < 0.1) & (distance > 0.06)]
        points.append(grid + part.at)
        weights.append(np.full(len(grid), part.density * np.prod(2 * half / count)))
    where = np.concatenate(points)
    mass = np.concatenate(weights)
    centre = mass @ where / mass.sum()
    arm = where - centre
    inertia = np.einsum("p,p,ij->ij", mass, (arm**2).sum(1), np.eye(3))
    inertia -= np.einsum("p,pi,pj->ij", mass, arm, arm)
    assert body_mass(made) == pytest.approx(mass.sum(), rel=2e-3)
    np.testing.assert_allclose(centre_of_mass(made), centre, atol=1e-4)
    np.testing.assert_allclose(body_inertia(made), inertia, atol=3e-3 * inertia.max())


def compound(name: str, place: list[float], change: dict | None = None) -> dict:
    """A text template whose last stage's body is its own shape and a ballast at a place."""
    raw = tomllib.loads(TEXTS[name])
    stage = raw["stage"][-1]
    stage["body"] = {"parts": [stage["body"], {"mass": 0.4, "at": place}]} | (change or {})
    return raw


@pytest.mark.parametrize("level", ["string", "beam"])
def test_attachments_stay_where_they_are_on_the_body(level):
    """The same body by its mass and inertia, with all heights from the COM by hand."""
    raw = compound("single", [0.0, 0.0, -0.08])
    parts = reader.convert(raw)
    made = parts.stage[-1].body
    x, y, z = centre_of_mass(made)
    assert x == y == 0.0 and z < -1e-3
    inertia = [list(row) for row in body_inertia(made)]
    by_hand = tomllib.loads(TEXTS["single"])
    by_hand["stage"][-1]["body"] = {"mass": body_mass(made), "inertia": inertia}
    by_hand["stage"][-1]["wires"]["d"] -= z
    model = registry.by_name(level)
    found, wanted = (
        eigenmodes.solve(model.system(design)).omega_squared
        for design in (parts, reader.convert(by_hand))
    )
    np.testing.assert_allclose(found, wanted, rtol=1e-9)


def test_chain_below_a_body_of_parts():
    """Upper ends, links and the place of what hangs below are from the origin too."""
    raw = tomllib.loads(sus.example("triple-damped").text)
    raw.pop("control")
    stiffness = {"stiffness": [5.0, 7.0, 9.0, 0.1, 0.2, 0.3]}
    raw["link"] = [
        {"name": "down", "between": ["middle", "upper"], "at": [0.02, 0.0, 0.01]} | stiffness,
        {"name": "up", "between": ["upper", "support"], "at": [0.03, 0.0, 0.01]} | stiffness,
    ]
    plain = reader.convert(raw)
    stage = raw["stage"][0]
    # the same body, its origin 20 mm above its COM
    low = 0.02
    given = plain.stage[0].body
    mass = body_mass(given)
    whole = {"mass": mass, "inertia": [list(row) for row in body_inertia(given)]}
    stage["body"] = {"parts": [whole | {"at": [0.0, 0.0, -low]}]}
    raw["link"][1]["at"][2] -= low
    stage["wires"]["d"] = stage["wires"].get("d", 0.0) - low
    raw["stage"][1]["wires"]["d_upper"] = raw["stage"][1]["wires"].get("d_upper", 0.0) + low
    model = registry.STRING
    found, wanted = (
        eigenmodes.solve(model.system(design)).omega_squared
        for design in (reader.convert(raw), plain)
    )
    np.testing.assert_allclose(found, wanted, rtol=1e-9)


def test_command_prints_the_com(tmp_path):
    file = written(tmp_path, reader.write_toml(compound("single", [0.0, 0.0, -0.08])), "a.toml")
    done = run("check", file)
    assert done.exit_code == 0 and "in parts, COM at (0.0000, 0.0000, -" in done.stdout
    assert run("draw", file, "--out", tmp_path).exit_code == 0


@pytest.mark.parametrize(
    ("parts", "key", "problem"),
    [
        ([{"mass": 1.0}, {"mass": 1.0, "at": [0.0, 0.1, 0.0]}], "parts", "moment of inertia of 0"),
        ([{"shape": "sphere", "mass": 1.0}], "parts.1.radius", "missing"),
        ([{"radius": 0.1, "mass": 1.0}], "parts.1.radius", "goes with shape"),
    ],
)
def test_refusals(parts, key, problem):
    raw = tomllib.loads(TEXTS["single"])
    raw["stage"][-1]["body"] = {"parts": parts}
    with pytest.raises(sus.InputError) as refused:
        reader.convert(raw)
    fault = refused.value.faults[0]
    assert fault.key == f"stage.test.body.{key}" and problem in fault.problem


def test_keys_beside_parts_are_refused():
    with pytest.raises(sus.InputError) as refused:
        reader.convert(compound("single", [0.0, 0.0, 0.1], {"mass": 3.0}))
    assert "conflicts with parts" in refused.value.faults[0].problem
