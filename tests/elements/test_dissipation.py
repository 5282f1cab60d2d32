"""What wires lose, by place and cause, against integrals of the squared curvature and displacement
in many digits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from suspension_cli.design.cross_sections import circle
from suspension_cli.design.losses import Bulk
from suspension_cli.design.schema import Gas
from suspension_cli.elements import gas
from suspension_cli.elements.dynamic_wire import TautWire
from suspension_cli.scene.composition import Fibre, Section
from tests.support import beam_mp

LENGTH, TENSION, MASS = 0.6, 100.0, 5e-3
SPLIT = np.linalg.inv(np.array(beam_mp.ALIKE, dtype=float))
RNG = np.random.default_rng(9)
MOTIONS = np.vstack([np.eye(4), RNG.normal(size=(2, 4)) + 1j * RNG.normal(size=(2, 4))])
"""w1, w1', w2, w2': each end alone, and all at once."""
SHAPE = circle(2e-4, 2e-4)


def wire(slenderness, angle, surrounded=None):
    rigidity, nowhere = TENSION * LENGTH**2 / slenderness**2, np.zeros(3)
    section = Section(
        LENGTH, (rigidity, rigidity), 1e4, 1e-3, MASS, 1e-10, SHAPE, (Bulk(angle),) if angle else ()
    )
    fibre = Fibre("", (section,), nowhere, (nowhere, nowhere), (290.0, 290.0))
    return TautWire(fibre, TENSION, massive=True, lossy=True, surrounded=surrounded)


def integrals(strand, drag, omega):
    """Integrals of |w''|^2 over each half and of |w|^2, for each of `MOTIONS`."""
    (own,) = strand.fibre.sections
    rigidity = own.rigidity[0] * (1 + 1j * sum(loss.angle for loss in own.losses))
    arguments = (rigidity, TENSION, MASS - 1j * drag / omega, LENGTH)
    with beam_mp.exact(60 + beam_mp.digits_for(*arguments, omega)):
        one = beam_mp.Bent(*arguments, beam_mp.number(omega))
        h = one.length / 2
        return rigidity.imag, np.array(
            [
                [float(one.squared(motion, *task)) for motion in MOTIONS]
                for task in ((2, 0, h), (2, h, 2 * h), (0, 0, 2 * h))
            ]
        )


def dissipated(strand, omega, motions=MOTIONS):
    found = strand.at(np.array([omega]))["bend-1"].dissipated((SPLIT @ motions.T)[..., None])
    return {cause: value[:, 0] for cause, value in found.items()}


@pytest.mark.parametrize("omega", [0.1, 300.0, 2e4])
@pytest.mark.parametrize("angle", [1e-12, 1e-3])
@pytest.mark.parametrize("slenderness", [1e-3, 30.0, 1e3])
def test_each_half_loses_by_its_curvature(slenderness, angle, omega):
    """Im(EI) times the integral of |w''|^2, however small the loss."""
    strand = wire(slenderness, angle)
    if np.sqrt(np.sqrt(MASS / strand.fibre.sections[0].rigidity[0]) * omega) * LENGTH > 300:
        return
    rigidity, (upper, lower, _) = integrals(strand, 0.0, omega)
    found = dissipated(strand, omega)
    scale = rigidity * (upper + lower)
    assert (np.abs(found["bending-upper"] - rigidity * upper) <= 1e-9 * scale).all()
    assert (np.abs(found["bending-lower"] - rigidity * lower) <= 1e-9 * scale).all()


@pytest.mark.parametrize("omega", [3.0, 300.0, 2e4])
@pytest.mark.parametrize(("angle", "pressure"), [(1e-5, 1e-3), (1e-3, 10.0), (1e-9, 1e2)])
def test_gas_takes_its_part(angle, pressure, omega):
    """omega^2 Im(mu) times the integral of |w|^2; with bending, all that the ends lose."""
    around = Gas(pressure=pressure, molar_mass=0.028, temperature=290.0)
    strand = wire(50.0, angle, around)
    drag = SHAPE.drag(*gas.surface_drag(around))[0]
    rigidity, (upper, lower, moved) = integrals(strand, drag, omega)
    found = dissipated(strand, omega)
    expected = rigidity * (upper + lower), omega * drag * moved
    bending = found["bending-upper"] + found["bending-lower"]
    np.testing.assert_allclose(bending + found["gas"], sum(expected), rtol=1e-9)
    within = 3 * (angle + drag / (MASS * omega)) + 1e-9
    np.testing.assert_allclose(bending, expected[0], rtol=within)
    np.testing.assert_allclose(found["gas"], expected[1], rtol=within)


@pytest.mark.parametrize("massive", [False, True])
def test_sections_lose_what_the_whole_does(massive):
    """Thirds of a uniform wire, the middle one cut in its middle."""
    strand = replace(wire(50.0, 1e-3), massive=massive)
    (own,) = strand.fibre.sections
    thirds = tuple(replace(own, length=own.length * share) for share in (0.2, 0.6, 0.2))
    joined = replace(strand, fibre=replace(strand.fibre, sections=thirds))
    for omega in (1.0, 500.0):
        expected, found = dissipated(strand, omega), dissipated(joined, omega)
        for cause, value in expected.items():
            np.testing.assert_allclose(found[cause], value, rtol=1e-9)
