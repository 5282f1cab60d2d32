"""Torsion of wires: under tension GJ + T I_p/A, of which the tension's part has no loss; or as the
key `torsion` gives it, on every model."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import tomli_w

import suspension_cli as sus
from suspension_cli.design.cross_sections import circle
from suspension_cli.design.materials import Bulk
from suspension_cli.design.reader import convert
from suspension_cli.errors import InputError
from suspension_cli.models import registry
from tests.elements.test_joined_sections import strand

ROUND = {"radius": 2e-4}
RIBBON = {"section": {"width": 1.2e-3, "thickness": 1e-4}}
GLASS = {"youngs_modulus": 7e10, "poisson_ratio": 0.25, "density": 2200.0}
LENGTH, MASS, YAW, TORSION = 0.6, 9.0, 0.05, 0.3
"""A stiff body on one wire: m, kg, kg m^2; a given torsion, N m/rad."""
WEIGHT = MASS * 9.81


def yaw_of(level: str, loss: dict[str, Any], **wire: Any) -> tuple[float, float]:
    """Frequency and Q of the yaw of a body that clamps its only wire 1 mm above its COM."""
    body = {"mass": MASS, "inertia": [0.04, 0.03, YAW]}
    wires = {"count": 1, "l": LENGTH, "d": 0.001, "material": "glass", **wire}
    raw = {
        "design": {"name": "hung"},
        "materials": {"glass": GLASS | loss},
        "stage": [{"name": "test", "body": body, "wires": wires}],
    }
    found = sus.modes(sus.parse(tomli_w.dumps(raw)), fidelity=level)
    assert found.model == level
    n = found.label.index("test yaw")
    return found.frequency[n], found.q[n]


def shear(shape: dict[str, Any]) -> float:
    """GJ, N m^2: of a round wire G pi r^4/2, of a ribbon G w t^3 (1/3 - 0.21 (t/w) (1 -
    (t/w)^4/12)) (Roark, good to 0.5 %)."""
    if "radius" in shape:
        return 2.8e10 * math.pi * shape["radius"] ** 4 / 2
    w, t = shape["section"]["width"], shape["section"]["thickness"]
    return 2.8e10 * w * t**3 * (1 / 3 - 0.21 * t / w * (1 - (t / w) ** 4 / 12))


def mean_square(shape: dict[str, Any]) -> float:
    """Mean of the squared distance from the axis over a cross-section, m^2: filaments that do not
    touch each other resist twisting with the load times that over their length."""
    if "radius" in shape:
        return shape["radius"] ** 2 / 2
    return (shape["section"]["width"] ** 2 + shape["section"]["thickness"] ** 2) / 12


@pytest.mark.parametrize(
    ("shape", "stiff", "lossy"),
    [(ROUND, 2e-5, 2e-5), (RIBBON, 2e-3, 5e-3)],
    ids=["round", "ribbon"],
)
def test_tension_adds_the_stiffness_of_a_bundle_of_filaments(shape, stiff, lossy):
    """Yaw of a body on one wire; Q is 1/phi times the share of the stiffness that is not shear: the
    dilution of torsion."""
    frequency, q = yaw_of("beam", {"loss": {"angle": 1e-4}}, **shape)
    whole = (shear(shape) + WEIGHT * mean_square(shape)) / LENGTH
    assert frequency == pytest.approx(math.sqrt(whole / YAW) / (2 * math.pi), rel=stiff)
    dilution = whole * LENGTH / shear(shape)
    assert dilution > (1.02 if shape is ROUND else 2)
    assert q == pytest.approx(1e4 * dilution, rel=lossy)


RADII, PARTS = (4e-4, 2e-4, 3e-4), (0.02, 0.5, 0.05)


def twisted(radii, lengths, tension, *, massive=False):
    """Round sections; the loss angle is 1e-4, the shear modulus 28 GPa."""
    wire = strand([(1e-6, 1.0, length) for length in lengths], tension, 1e-4, massive=massive)
    sections = tuple(
        replace(
            section,
            twisting=2.8e10 * math.pi * r**4 / 2,
            polar=2200 * math.pi * r**4 / 2,
            shape=circle(r, r),
            losses=(Bulk(1e-4),),
        )
        for section, r in zip(wire.fibre.sections, radii, strict=True)
    )
    return replace(wire, fibre=replace(wire.fibre, sections=sections))


def test_sections_twist_in_series():
    """Thick ends and a thin middle under the same tension, whose share in each goes with its own
    I_p/A = r^2/2; many tensions at once."""
    tensions = np.array([0.0, 80.0, 200.0])
    wire = replace(twisted(RADII, PARTS, tensions), lossy=False)
    found = wire.at(np.zeros(3))["twist"].stiffness[1, 1] / 4
    compliance = sum(
        length / (2.8e10 * math.pi * r**4 / 2 + tensions * r**2 / 2)
        for r, length in zip(RADII, PARTS, strict=True)
    )
    assert found == pytest.approx(1 / compliance, rel=1e-12)


def test_torsional_waves_run_faster_under_tension():
    """c^2 = (GJ + T I_p/A)/(rho I_p) = G/rho + sigma/rho; between held ends the resonances lie at n
    c/2L."""
    tension, r = 90.0, 2e-4
    speed = math.sqrt((2.8e10 + tension / (math.pi * r**2)) / 2200)
    wire = twisted([r], [LENGTH], tension, massive=True)
    known = np.arange(1, 4) * math.pi * speed / LENGTH
    assert wire.held_resonances("twist", known[-1])[:3] == pytest.approx(known, rel=1e-9)


# ---------------------------------------------------------------- the key `torsion`


@pytest.mark.parametrize("level", ["force", "string", "beam", "violin"])
def test_given_torsion(level):
    """It overrides what the cross-section has. Strings lose as they do by stretching, beams have
    the dilution of the tension's part."""
    loss = {"loss_angle": 1e-4}
    frequency, q = yaw_of(level, loss, torsion=TORSION, **ROUND)
    assert frequency == pytest.approx(math.sqrt(TORSION / YAW) / (2 * math.pi), rel=1e-5)
    pulled = WEIGHT * 2e-4**2 / 2 if level in ("beam", "violin") else 0.0
    assert q == pytest.approx(1e4 * (1 + pulled / shear(ROUND)), rel=1e-4)


def chain(count: int, torsion: float = 1.0, **wires: Any) -> Any:
    """Two stages on wires that lean both ways, each with a torsion that counts."""
    shape = {"s_upper": 0.05, "s_lower": 0.02} if count == 4 else {}
    stages = []
    for name, factor in (("upper", 4.0), ("test", 7.0)):
        own = {"count": count, "l": 0.3, "d": 0.004, "d_upper": 0.003, "k": 3e4}
        own |= {"t1": 0.03, "t2": 0.08, "torsion": factor * torsion, **shape, **wires}
        body = {"mass": 8.0, "inertia": [0.05, 0.03, 0.06]}
        stages.append({"name": name, "body": body, "wires": own})
    return convert({"design": {"name": "chain"}, "stage": stages})


@pytest.mark.parametrize("count", [2, 4])
def test_force_and_string_agree_on_wires_that_lean(count: int):
    """Roll and pitch twist such wires too. Each by its own way, and against no torsion at all it
    counts."""
    quick, general = (registry.by_name(level).system(chain(count)) for level in ("force", "string"))
    size = np.abs(quick.stiffness).max()
    np.testing.assert_allclose(quick.stiffness, general.stiffness, atol=1e-13 * size)
    limp = registry.FORCE.system(chain(count, 1e-15)).stiffness
    changed = np.abs(np.diag(quick.stiffness - limp))
    assert (changed[[9, 10, 11]] > (0.01 if count == 4 else [-1, 0.01, 0.01])).all()


def test_the_closed_forms_do_not_have_it():
    wires = {"count": 4, "l": 0.3, "s": 0.02, "t1": 0.05, "t2": 0.05, "d": 0.0, "k": 1e4}
    stage = {"name": "test", "body": {"mass": 8.0, "inertia": [0.05] * 3}}
    stage["wires"] = wires | {"torsion": 1.0}
    with pytest.raises(InputError, match="its wires resist twisting"):
        registry.choose(convert({"design": {"name": "one"}, "stage": [stage]}), "closed-form")


def test_a_wire_that_leans_resists_along_itself():
    """A body held by an oblique wire at its centre of mass: K of the rotations is torsion times e
    e^T, with e along the wire, and no other."""
    e, found = np.array([0.48, 0.6, -0.64]), []
    for torsion in ({"torsion": TORSION}, {}):
        ends = {"upper": [0.0, 0.0, 0.0], "lower": [0.0, 0.0, 0.0]}
        stage = {
            "name": "test",
            "position": (0.5 * e).tolist(),
            "body": {"mass": 1.0, "inertia": [1.0, 1.0, 1.0]},
            "wire": [ends | {"k": 1e4, "tension": 1e-9} | torsion],
            "spring": [{"stiffness": [1.0] * 6, "preload": [0.0, 0.0, 9.81, 0.0, 0.0, 0.0]}],
        }
        design = convert({"design": {"name": "held"}, "stage": [stage]})
        found.append(registry.STRING.system(design).stiffness)
    change = found[0] - found[1]
    np.testing.assert_allclose(change[9:, 9:], TORSION * np.outer(e, e), atol=1e-14)
    np.testing.assert_allclose(change[3:6, 9:], -TORSION * np.outer(e, e), atol=1e-14)
    change[np.ix_([3, 4, 5, 9, 10, 11], [3, 4, 5, 9, 10, 11])] = 0
    assert np.abs(change).max() == 0
