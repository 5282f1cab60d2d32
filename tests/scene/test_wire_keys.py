"""Rings, crossing wires, necks, measured profiles, hinges and losses of springs."""

from __future__ import annotations

import math

import numpy as np
import pytest
import tomli_w
from scipy.linalg import solve_banded

import suspension_cli as sus
from suspension_cli.design import materials, reader
from suspension_cli.design.wires import reduced
from suspension_cli.elements.dynamic_wire import TautWire
from suspension_cli.models import registry
from suspension_cli.scene.fibres import compose
from tests.support import beam_mp, scenes

BODY = {"mass": 5.0, "inertia": [0.02, 0.015, 0.03]}


def single(wires, **stage):
    return scenes.raw_of({"name": "test", "body": BODY, "wires": wires} | stage)


def explicit(pairs, height, **keys):
    """The same wires one by one: (upper, lower) in x and y."""
    rows = [
        {"upper": [*upper, -0.01], "lower": [*lower, 0.002], "radius": 1e-4} | keys
        for upper, lower in pairs
    ]
    position = [0.0, 0.0, -(height + 0.012)]
    return scenes.raw_of({"name": "test", "body": BODY, "position": position, "wire": rows})


def frequencies(raw, model="string"):
    return sus.modes(sus.parse(tomli_w.dumps(scenes.plain(raw))), fidelity=model).frequency


STEEL = {"material": "steel302", "radius": 1e-4, "d": 0.002, "d_upper": 0.01, "l": 0.3}


def turned(radius, angle):
    return radius * math.cos(angle), radius * math.sin(angle)


@pytest.mark.parametrize(("count", "lower"), [(3, 0.06), (3, -0.05), (5, 0.03)])
@pytest.mark.parametrize("model", ["string", "beam"])
def test_ring_is_its_wires(count, lower, model):
    ring = STEEL | {"count": count, "ring_upper": 0.04, "ring_lower": lower, "phase": 0.3}
    angles = 0.3 + 2 * np.pi * np.arange(count) / count
    pairs = [(turned(0.04, a), turned(lower, a)) for a in angles]
    chord = math.dist(*pairs[0])
    found = frequencies(single(ring), model)
    plain = explicit(pairs, math.sqrt(0.09 - chord**2), material="steel302")
    assert found == pytest.approx(frequencies(plain, model), rel=1e-9, nan_ok=True)


def test_crossing_pair():
    pair = STEEL | {"count": 2, "t1": 0.03, "t2": -0.02}
    pairs = [((0, 0.03), (0, -0.02)), ((0, -0.03), (0, 0.02))]
    plain = explicit(pairs, math.sqrt(0.09 - 0.05**2), material="steel302")
    for model in ("force", "string"):
        found = frequencies(single(pair), model)
        assert found == pytest.approx(frequencies(plain), rel=1e-9, nan_ok=True)


SILICA = {"count": 1, "l": 0.6, "material": "fused-silica", "d": 0.01}


def fibre(keys):
    return compose(scenes.design_of(single(SILICA | keys))).wire[0]


def test_necks():
    neck = {"radius": 2e-4, "neck": {"radius": 1.5e-3, "length": 0.01, "stock": 0.004, "steps": 9}}
    sections = [
        {"radius": 1.5e-3, "length": 0.004},
        {"radius": [1.5e-3, 2e-4], "length": 0.01, "steps": 9},
        {"radius": 2e-4},
        {"radius": [2e-4, 1.5e-3], "length": 0.01, "steps": 9},
        {"radius": 1.5e-3, "length": 0.004},
    ]
    assert fibre(neck).sections == fibre({"sections": sections}).sections
    both = [frequencies(single(SILICA | k), "beam") for k in (neck, {"sections": sections})]
    assert np.array_equal(*both)


def pulled(count=400):
    """A fibre of 0.6 m as pulled: smooth necks of 20 mm, and a waist that varies by 3 %."""
    z = np.linspace(0.0, 0.6, count)
    ends = np.exp(-((z / 0.012) ** 2)) + np.exp(-(((0.6 - z) / 0.015) ** 2))
    return z, 4e-4 * (1 + 0.03 * np.sin(20 * z)) + 2.6e-3 * ends


def written(tmp_path, error=1e-3):
    z, d = pulled()
    lines = [
        "position_mm,diameter (um)",
        *(f"{1e3 * a},{1e6 * b}" for a, b in zip(z, d, strict=True)),
    ]
    (tmp_path / "fibre.csv").write_text("\n".join(lines))
    file = tmp_path / "design.toml"
    profile = {"file": "fibre.csv", "error": error}
    file.write_text(tomli_w.dumps(scenes.plain(single(SILICA | {"profile": profile}))))
    return file


def test_profile_is_read_into_the_design(tmp_path):
    source = reader.read(written(tmp_path))
    own = source.design.stage[0].wires.profile
    z, d = pulled()
    assert own.position == pytest.approx(z, abs=1e-12)
    assert own.diameter == pytest.approx(d, rel=1e-12)
    (tmp_path / "fibre.csv").unlink()
    again = reader.parse(source.text)
    assert again.stage[0].wires.profile == own
    short = written(tmp_path)
    short.write_text(short.read_text().replace("[stage.wires.profile]\nfile", "profile", 1))
    z, d = [0.0, 0.3, 0.6], [4e-4, 4e-4, 4e-4]
    (tmp_path / "fibre.csv").write_text("# pulled\n0,4e-4\n0.3;4e-4\n0.6,4e-4\n")
    assert reader.read(written(tmp_path)).design.stage[0].wires.profile.position != z


def static_bending(z, d, modulus, tension, count):
    """Energy of bending of a fibre of linear pieces, for the slopes of its ends and its shift.

    Linear elements of the slope f: the sum of (E I f'^2 + T f^2) / 2. Unlike that of w, this
    problem is well conditioned.
    """
    x = np.linspace(z[0], z[-1], count + 1)
    h = x[1] - x[0]
    own = np.interp((x[1:] + x[:-1]) / 2, z, d)
    rigid = modulus * np.pi / 64 * own**4
    main, side = np.zeros(count + 1), -rigid / h + tension * h / 6
    main[1:] += rigid / h + tension * h / 3
    main[:-1] += rigid / h + tension * h / 3
    band = np.zeros((3, count - 1))
    band[0, 1:], band[1], band[2, :-1] = side[1:-1], main[1:-1], side[1:-1]
    weights = np.full(count + 1, h)
    weights[[0, -1]] = h / 2
    right = np.zeros((count - 1, 3))
    right[0, 0], right[-1, 1], right[:, 2] = side[0], side[-1], weights[1:-1]
    inner = solve_banded((1, 1), band, right)
    # f = -A^-1 (b theta) + V A^-1 w, with V from the shift
    ends = np.diag(main[[0, -1]]) - right[:, :2].T @ inner[:, :2]
    moved = weights[[0, -1]] - right[:, :2].T @ inner[:, 2]
    give = weights[1:-1] @ inner[:, 2]
    # energy at given theta and shift D: theta ends theta / 2 + (D - moved theta)^2 / (2 give)
    whole = np.zeros((3, 3))
    whole[:2, :2] = ends + np.outer(moved, moved) / give
    whole[:2, 2] = whole[2, :2] = -moved / give
    whole[2, 2] = 1 / give
    return whole


@pytest.mark.parametrize("error", [1e-2, 1e-3, 1e-4])
def test_reduced_profile_is_within_its_error(error):
    """Against the fibre as measured, by finite elements of its slope."""
    z, d = pulled()
    profile = {"position": z.tolist(), "diameter": d.tolist(), "error": error}
    design = scenes.design_of(single(SILICA | {"profile": profile}))
    few = reduced(design.stage[0].wires.profile)
    assert len(few) < 60 / math.sqrt(error / 1e-2)
    wire = TautWire(compose(design).wire[0], 49.0, massive=False, lossy=False)
    modulus = materials.resolve(design, "fused-silica").youngs_modulus
    coarse, fine = (static_bending(z, d, modulus, 49.0, n) for n in (12000, 24000))
    expected = fine + (fine - coarse) / 3
    ends = beam_mp.to_ends(wire.static["bend-1"][..., None])[..., 0]  # w_1, w'_1, w_2, w'_2
    found = ends[np.ix_([1, 3, 2], [1, 3, 2])]
    root = np.sqrt(np.diag(expected))
    assert np.abs((found - expected) / np.outer(root, root)).max() < error
    middle = (d[1:] ** 2 + d[1:] * d[:-1] + d[:-1] ** 2) / 3
    mass = (np.diff(z) * middle).sum() * np.pi / 4
    own = wire.fibre.sections
    density = materials.resolve(design, "fused-silica").density
    assert sum(s.mass * s.length for s in own) == pytest.approx(density * mass, rel=1e-12)
    compliance = (np.diff(z) / (d[1:] * d[:-1])).sum() * 4 / np.pi / modulus
    assert sum(s.length / s.stretching for s in own) == pytest.approx(compliance, rel=error)


def test_loss_of_springs_is_that_of_their_material():
    wires = STEEL | {"count": 2, "t1": 0.04, "t2": 0.04}
    spring = {"stiffness": [10.0, 20.0, 30.0, 0.1, 0.2, 0.3]}
    constant = single(wires, spring=[spring | {"loss_angle": 3e-3}])
    named = single(wires, spring=[spring | {"material": "tape"}])
    named["materials"] = {"tape": {"youngs_modulus": 1e9, "loss_angle": 3e-3}}
    both = [registry.STRING.system(scenes.design_of(one)).complete for one in (constant, named)]
    assert np.array_equal(*both)


@pytest.mark.parametrize("drawn", [0.5, 0.8])
def test_spring_constant_is_that_of_the_natural_length_if_given(drawn):
    """However far apart the ends are in the file: E A over the nominal span without one."""
    text = f"""
[design]
name = "one"
[materials.soft]
youngs_modulus = 1e9
[[stage]]
name = "test"
body = {{ mass = 2.0, inertia = [0.01, 0.01, 0.01] }}
position = [0.0, 0.0, {-drawn - 0.01}]
[[stage.wire]]
upper = [0.0, 0.0, 0.0]
lower = [0.0, 0.0, 0.01]
material = "soft"
radius = 1e-4
"""
    per_length = 2 * 9.81 / (1e9 * np.pi * 1e-8)
    for key, length in (("natural_length = 0.6", 0.6), ("", drawn)):
        (wire,) = sus.check(sus.parse(text + key)).document()["wires"]
        assert wire["stretch_m"] == pytest.approx(per_length * length, rel=1e-9)
