"""What wires lose, by place and cause, against integrals of the squared curvature and displacement
in many digits."""

from __future__ import annotations

import numpy as np
import pytest

from suspension_cli.design.schema import Gas
from suspension_cli.elements import loss
from tests.elements.test_joined_sections import SHAPE, strand
from tests.support import beam_mp

LENGTH, TENSION, MASS = 0.6, 100.0, 5e-3
SPLIT = np.linalg.inv(np.array(beam_mp.ALIKE, dtype=float))
RNG = np.random.default_rng(9)
MOTIONS = np.vstack([np.eye(4), RNG.normal(size=(2, 4)) + 1j * RNG.normal(size=(2, 4))])
"""w1, w1', w2, w2': each end alone, and all at once."""


def wire(slenderness, angle, surrounded=None, *, cuts=(1.0,), massive=True):
    ei = TENSION * LENGTH**2 / slenderness**2
    rows = [(ei, MASS, LENGTH * share) for share in cuts]
    return strand(rows, TENSION, angle, massive=massive, surrounded=surrounded)


def integrals(one, angle, drag, omega):
    """Im(EI), and integrals of |w''|^2 over each half and of |w|^2, for each of `MOTIONS`."""
    rigidity = one.fibre.sections[0].rigidity[0] * (1 + 1j * angle)
    arguments = (rigidity, TENSION, MASS - 1j * drag / omega, LENGTH)
    with beam_mp.exact(60 + beam_mp.digits_for(*arguments, omega)):
        exact = beam_mp.Bent(*arguments, beam_mp.number(omega))
        h = exact.length / 2
        return rigidity.imag, np.array(
            [
                [float(exact.squared(motion, *task)) for motion in MOTIONS]
                for task in ((2, 0, h), (2, h, 2 * h), (0, 0, 2 * h))
            ]
        )


def dissipated(one, omega):
    found = one.at(np.array([omega]))["bend-1"].dissipated((SPLIT @ MOTIONS.T)[..., None])
    return {cause: value[:, 0] for (cause, _), value in found.items()}


@pytest.mark.parametrize("omega", [0.1, 300.0, 2e4])
@pytest.mark.parametrize(
    ("slenderness", "angle"), [(1e-3, 1e-12), (30.0, 1e-3), (30.0, 1e-12), (300.0, 1e-12)]
)
def test_each_half_loses_by_its_curvature(slenderness, angle, omega):
    """Im(EI) times the integral of |w''|^2, however small the loss."""
    one = wire(slenderness, angle)
    rigidity, (upper, lower, _) = integrals(one, angle, 0.0, omega)
    found = dissipated(one, omega)
    scale = rigidity * (upper + lower)
    assert (np.abs(found["bending-upper"] - rigidity * upper) <= 1e-9 * scale).all()
    assert (np.abs(found["bending-lower"] - rigidity * lower) <= 1e-9 * scale).all()


@pytest.mark.parametrize("omega", [3.0, 300.0, 2e4])
@pytest.mark.parametrize(("angle", "pressure"), [(1e-5, 1e-3), (1e-3, 10.0), (1e-9, 1e2)])
def test_gas_takes_its_part(angle, pressure, omega):
    """omega^2 Im(mu) times the integral of |w|^2; with bending, all that the ends lose."""
    around = Gas(pressure=pressure, molar_mass=0.028, temperature=290.0)
    one = wire(50.0, angle, around)
    drag = SHAPE.drag(*loss.surface_drag(around))[0]
    rigidity, (upper, lower, moved) = integrals(one, angle, drag, omega)
    found = dissipated(one, omega)
    expected = rigidity * (upper + lower), omega * drag * moved
    bending = found["bending-upper"] + found["bending-lower"]
    np.testing.assert_allclose(bending + found["gas"], sum(expected), rtol=1e-9)
    within = 3 * (angle + drag / (MASS * omega)) + 1e-9
    np.testing.assert_allclose(bending, expected[0], rtol=within)
    np.testing.assert_allclose(found["gas"], expected[1], rtol=within)


@pytest.mark.parametrize("massive", [False, True])
@pytest.mark.parametrize("omega", [1.0, 500.0])
def test_sections_lose_what_the_whole_does(massive, omega):
    """Parts of a uniform wire, one of which is cut in its middle."""
    expected, found = (
        dissipated(wire(50.0, 1e-3, cuts=cuts, massive=massive), omega)
        for cuts in ((1.0,), (0.2, 0.7, 0.1))
    )
    for cause, value in expected.items():
        np.testing.assert_allclose(found[cause], value, rtol=1e-9)
