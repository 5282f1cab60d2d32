"""Gas drag against the Maxwell distribution, sums over surface elements, and the equation of a
stretched wire."""

from __future__ import annotations

import math
import re
from typing import Any

import mpmath
import numpy as np
import pytest
import tomli_w

import suspension_cli as sus
from suspension_cli.conventions import AVOGADRO, BOLTZMANN
from suspension_cli.design.bodies import Body, body_inertia
from suspension_cli.design.cross_sections import circle, rectangle
from suspension_cli.design.schema import Gas
from suspension_cli.elements import loss as drag

AIR = Gas(pressure=1e-5, molar_mass=0.028, temperature=300.0)
NODES, WEIGHTS = np.polynomial.legendre.leggauss(12)


def test_coefficients_from_the_maxwell_distribution():
    """Momentum that a moving surface hands to a gas with n k T = 1, m = 1, k T = 1, differentiated
    numerically."""

    def density(v):
        return mpmath.exp(-v * v / 2) / mpmath.sqrt(2 * mpmath.pi)

    def normal(u):
        """Arriving molecules have the relative velocity w; as many leave, with the mean speed of a
        half Maxwellian's flux."""
        arriving = mpmath.quad(lambda w: w * w * density(u - w), [0, 5, 20])
        count = mpmath.quad(lambda w: w * density(u - w), [0, 5, 20])
        leaving = mpmath.quad(lambda w: w * w * density(w), [0, 5, 20]) / mpmath.quad(
            lambda w: w * density(w), [0, 5, 20]
        )
        return arriving + count * leaving

    unit = Gas(pressure=1.0, molar_mass=AVOGADRO, temperature=1.0 / BOLTZMANN)
    found_normal, found_along = drag.surface_drag(unit)
    assert found_normal == pytest.approx(float(mpmath.diff(normal, 0)), rel=1e-9)
    assert found_along == pytest.approx(
        float(mpmath.quad(lambda w: w * density(w), [0, 5, 20])), rel=1e-12
    )


def summed(points, normals, areas):
    """Damping matrix of surface elements: forces -D v and their torques, for all six motions."""
    normal, along = drag.surface_drag(AIR)
    total = np.zeros((6, 6))
    for point, n, area in zip(points, normals, areas, strict=True):
        local = area * (along * np.eye(3) + (normal - along) * np.outer(n, n))
        cross = np.array(
            [[0, -point[2], point[1]], [point[2], 0, -point[0]], [-point[1], point[0], 0]]
        )
        lever = np.hstack([np.eye(3), -cross])  # v + w x r
        total += lever.T @ local @ lever
    return total


def faces_of_box(size):
    for axis in range(3):
        b, c = [n for n in range(3) if n != axis]
        for side in (-1, 1):
            for i, wi in zip(NODES, WEIGHTS, strict=True):
                for j, wj in zip(NODES, WEIGHTS, strict=True):
                    point, normal = np.zeros(3), np.zeros(3)
                    point[axis], point[b], point[c] = (
                        side * size[axis] / 2,
                        i * size[b] / 2,
                        j * size[c] / 2,
                    )
                    normal[axis] = side
                    yield point, normal, wi * wj * size[b] * size[c] / 4


def faces_of_cylinder(radius, hole, length, axis):
    turn = np.roll(np.eye(3), axis - 2, axis=0)  # z to the axis
    azimuth = (np.arange(24) + 0.5) * 2 * np.pi / 24
    for f in azimuth:
        out = np.array([np.cos(f), np.sin(f), 0.0])
        for x, k in zip(NODES, WEIGHTS, strict=True):
            for r, sign in ((radius, 1.0), (hole, -1.0)):
                point = r * out + np.array([0, 0, x * length / 2])
                yield turn @ point, turn @ (sign * out), k * length / 2 * r * 2 * np.pi / 24
            r = (radius + hole) / 2 + x * (radius - hole) / 2
            for side in (-1, 1):
                point = r * out + np.array([0, 0, side * length / 2])
                yield (
                    turn @ point,
                    turn @ np.array([0, 0, side]),
                    k * (radius - hole) / 2 * r * 2 * np.pi / 24,
                )


BODIES = {
    "box": (Body(shape="box", size=(0.1, 0.25, 0.4), mass=1.0), faces_of_box((0.1, 0.25, 0.4))),
    "disc": (  # along x by default
        Body(shape="cylinder", radius=0.09, length=0.1, mass=1.0),
        faces_of_cylinder(0.09, 0.0, 0.1, 0),
    ),
    "tube": (
        Body(shape="cylinder", axis="y", radius=0.09, inner_radius=0.05, length=0.3, mass=1.0),
        faces_of_cylinder(0.09, 0.05, 0.3, 1),
    ),
    "pole": (
        Body(shape="cylinder", axis="z", radius=0.02, length=0.6, mass=1.0),
        faces_of_cylinder(0.02, 0.0, 0.6, 2),
    ),
}


@pytest.mark.parametrize("name", BODIES)
def test_bodies_against_surface_elements(name):
    body, faces = BODIES[name]
    expected = summed(*zip(*faces, strict=True))
    found = drag.body_damping(body, AIR)
    assert found is not None
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12 * expected.max())


def test_no_shape_no_drag():
    assert drag.body_damping(Body(mass=1.0, inertia=[1.0, 1.0, 1.0]), AIR) is None


def test_wires_against_long_bodies():
    """A long thin cylinder or plate, by its length."""
    long = 1e6
    pole = Body(shape="cylinder", axis="z", radius=2e-4, length=long, mass=1.0)
    plate = Body(shape="box", size=(1e-4, 1e-3, long), mass=1.0)
    for body, shape in ((pole, circle(2e-4, 2e-4)), (plate, rectangle(width=1e-3, thickness=1e-4))):
        expected = np.diag(drag.body_damping(body, AIR))[[0, 1, 2, 5]] / long
        np.testing.assert_allclose(shape.drag(*drag.surface_drag(AIR)), expected, rtol=1e-8)


# ---------------------------------------------------------------- a mass that bounces on one wire

PRESSURE, MOLAR, WARMTH = 20.0, 0.028, 300.0
LENGTH, RADIUS, MASS = 0.8, 5e-5, 0.3
YOUNG, DENSITY = 7e10, 2200.0
BOUNCE: dict[str, Any] = {
    "design": {"name": "bounce"},
    "constants": {"temperature": WARMTH},
    "gas": {"pressure": PRESSURE, "molar_mass": MOLAR},
    "materials": {"glass": {"youngs_modulus": YOUNG, "density": DENSITY}},
    "stage": [
        {
            "name": "test",
            "body": {"mass": MASS, "inertia": [1e-3, 1e-3, 1e-3]},
            "wires": {"count": 1, "l": LENGTH, "d": 0.01, "material": "glass", "radius": RADIUS},
        }
    ],
}


def dragged(frequency: float) -> tuple[complex, complex]:
    """z of the mass for a unit motion of the support and for a unit force on it: EA u'' + (mu w^2 -
    i w c) u = 0, c = 2 pi r p sqrt(m/(2 pi k T))."""
    with mpmath.workdps(40):
        w, radius = 2 * mpmath.pi * frequency, mpmath.mpf(RADIUS)
        mean = mpmath.sqrt(MOLAR / AVOGADRO / (2 * mpmath.pi * BOLTZMANN * WARMTH))
        rub = 2 * mpmath.pi * radius * PRESSURE * mean
        stiff = YOUNG * mpmath.pi * radius**2
        kappa = mpmath.sqrt((DENSITY * mpmath.pi * radius**2 * w**2 - 1j * w * rub) / stiff)
        far, cos = mpmath.sin(kappa * LENGTH) / kappa, mpmath.cos(kappa * LENGTH)
        dynamic = stiff * cos / far - MASS * w**2
        return complex(stiff / far / dynamic), complex(1 / dynamic)


@pytest.mark.parametrize("frequency", [40.0, 3562.0], ids=["bounce", "second stretching mode"])
def test_drag_along_a_wire(frequency):
    """The response, and the thermal noise, all of it from the gas: S = -(4 k T/w) Im of the
    susceptibility."""
    moved, susceptibility = dragged(frequency)
    design = sus.parse(tomli_w.dumps(BOUNCE))
    way = {"outputs": ["test.z"], "frequency": [frequency], "fidelity": "violin"}
    found = sus.response(design, inputs=["support.z"], **way).value.item()
    assert abs(found / moved - 1) < 1e-11
    plain = sus.parse(tomli_w.dumps({key: BOUNCE[key] for key in BOUNCE if key != "gas"}))
    # the drag can be seen at all
    assert abs(sus.response(plain, inputs=["support.z"], **way).value.item() / moved - 1) > 1e-7
    noise = sus.thermal(design, **way).document()
    density = -4 * BOLTZMANN * WARMTH / (2 * math.pi * frequency) * susceptibility.imag
    for name in (noise["contributions"]["test.gas"], noise["displacement_asd"]):
        assert name[0] == pytest.approx(math.sqrt(density), rel=1e-10)


def test_a_body_of_which_only_the_area_is_known():
    """A sphere: elements of its surface summed, and Epstein's drag (Phys. Rev. 23, 710 (1924)) of
    pi R^2 n m v (4/3) (1 + pi/8) with the mean velocity v = sqrt(8 k T/(pi m))."""
    radius = 0.07
    points, normals, areas = [], [], []
    for u, w in zip(NODES, WEIGHTS, strict=True):
        for azimuth in (np.arange(24) + 0.5) * 2 * np.pi / 24:
            across = math.sqrt(1 - u * u)
            normal = np.array([across * math.cos(azimuth), across * math.sin(azimuth), u])
            points.append(radius * normal)
            normals.append(normal)
            areas.append(radius**2 * w * 2 * np.pi / 24)
    body = Body(mass=1.0, inertia=[0.01] * 3, surface_area=4 * math.pi * radius**2)
    found = drag.body_damping(body, AIR)
    np.testing.assert_allclose(found, summed(points, normals, areas), rtol=1e-12, atol=1e-24)
    assert AIR.temperature is not None
    density = AIR.pressure / (BOLTZMANN * AIR.temperature)
    speed = math.sqrt(8 * BOLTZMANN * AIR.temperature / (math.pi * AIR.molecule))
    epstein = math.pi * radius**2 * density * AIR.molecule * speed * 4 / 3 * (1 + math.pi / 8)
    assert found is not None
    assert found[0, 0] == pytest.approx(epstein, rel=1e-12)


def test_a_shape_beside_the_inertia_is_its_surface():
    """Mass and moments as given, drag of the shape."""
    sizes: Any = {"shape": "cylinder", "axis": "x", "radius": 0.1, "length": 0.15}
    whole = Body(mass=5.0, **sizes)
    given = Body(mass=5.0, inertia=[0.03, 0.02, 0.01], **sizes)
    np.testing.assert_array_equal(drag.body_damping(given, AIR), drag.body_damping(whole, AIR))
    assert [row[n] for n, row in enumerate(body_inertia(given))] == [0.03, 0.02, 0.01]
    assert drag.body_damping(Body(mass=5.0, inertia=[0.03, 0.02, 0.01]), AIR) is None


def test_bodies_without_a_surface_are_named():
    text = sus.template("double").text
    way: Any = {"outputs": ["upper.x"], "frequency": [100.0], "fidelity": "beam"}
    bare = "body = { mass = 3.0, inertia = [0.02, 0.02, 0.02] }"
    text = re.sub(r"^body = .*$", bare, text, count=1, flags=re.MULTILINE)
    gas = "\n[gas]\npressure = 1e-3\n"
    assert all(item.key != "gas" for item in sus.check(sus.parse(text)).warnings)
    (found,) = [item for item in sus.check(sus.parse(text + gas)).warnings if item.key == "gas"]
    assert "exerts no drag on upper" in found.problem
    assert "surface_area" in found.remedy
    with pytest.warns(sus.PendsusWarning, match="exerts no drag on upper"):
        none = sus.thermal(sus.parse(text + gas), **way)
    cured = text.replace("0.02] }", "0.02], surface_area = 0.1 }", 1)
    given = sus.thermal(sus.parse(cured + gas), **way)
    assert "upper.gas" not in none.source
    assert "upper.gas" in given.source
    boxed = text.replace("0.02] }", '0.02], shape = "box", size = [0.1, 0.1, 0.1] }', 1)
    given = sus.thermal(sus.parse(boxed + gas), **way)
    assert "upper.gas" in given.source


def test_sphere_by_its_radius_is_that_of_its_surface():
    gas = Gas(pressure=1e-4, temperature=300.0)
    radius = 0.07
    ball = Body(shape="sphere", radius=radius, mass=3.0)
    by_area = Body(mass=3.0, inertia=[0.01] * 3, surface_area=4 * np.pi * radius**2)
    own = drag.body_damping(ball, gas)
    np.testing.assert_allclose(own, drag.body_damping(by_area, gas), rtol=1e-14)
