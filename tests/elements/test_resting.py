"""Static stiffness of wires on the slopes of their ends, against products of transfer matrices in
many digits, and in limits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from suspension_cli.design.cross_sections import circle, rectangle
from suspension_cli.elements import resting
from suspension_cli.scene.composition import Section
from tests.support import beam_mp

STEPS = {
    "uniform": [(1.0, 1.0)],
    "thick ends": [(0.01, 400.0), (0.98, 1.0), (0.01, 300.0)],
    "tapered": [(0.1, 50.0), (0.2, 8.0), (0.4, 1.0), (0.3, 20.0)],
}
"""Share of the length and of the bending stiffness of each section."""


def wire(steps, rigidity, twisting=3e-6):
    shape = circle(1e-4, 1e-4)
    return tuple(
        Section(
            share, (rigidity * own, 2 * rigidity * own), 1e4, twisting * own, 0.0, 0.0, shape, ()
        )
        for share, own in STEPS[steps]
    )


def exact(sections, tension, length):
    """S_uu, S_ul, S_ll in the first plane: of ends that turn while the chord rests."""
    rows = [(own.rigidity[0], 0.0, own.length * length) for own in sections]
    ends = beam_mp.doubles(beam_mp.transferred(rows, tension, 0.0)[0]).real
    return np.array([ends[1, 1], ends[1, 3], ends[3, 3]])


@pytest.mark.parametrize("rigidity", [1e-8, 1e-4, 1.0])
@pytest.mark.parametrize("steps", STEPS)
def test_stiffness_in_many_digits(steps, rigidity):
    """From long soft wires (u = 1e3) to short stiff ones (u = 0.1)."""
    sections, tension = wire(steps, rigidity), np.array([3.0, 40.0])
    found, _ = resting.resistance(sections, np.array([[0.3], [0.6]]), tension)
    assert found.shape == (2, 3, 2, 2)
    for i, length in enumerate((0.3, 0.6)):
        for j, pull in enumerate(tension):
            expected = exact(sections, pull, length)
            np.testing.assert_allclose(found[0, :, i, j], expected, rtol=1e-11)


@pytest.mark.parametrize("steps", STEPS)
def test_both_planes_of_a_ribbon(steps):
    own = wire(steps, 1e-4)
    turned = [replace(part, rigidity=part.rigidity[::-1]) for part in own]
    flat = tuple(replace(part, shape=rectangle(width=1e-3, thickness=1e-4)) for part in own)
    found, _ = resting.resistance(flat, 0.4, 20.0)
    for bend, part in zip(found, (own, tuple(turned)), strict=True):
        np.testing.assert_allclose(bend, resting.resistance(part, 0.4, 20.0)[0][0], rtol=1e-14)


def test_beam_without_tension():
    """4 EI/L and 2 EI/L of any text on beams; the derivative by tension there is 2 L/15, -L/30."""
    (section,) = sections = wire("uniform", 2.0)
    (bend, _), _ = resting.resistance(sections, 0.5, 0.0)
    ei = section.rigidity[0]
    np.testing.assert_allclose(bend, np.array([4, 2, 4]) * ei / 0.5, rtol=1e-14)
    (bend, _), _ = resting.resistance(sections, 0.5, 1e-20j)
    np.testing.assert_allclose(bend.imag / 1e-20, [0.5 / 7.5, -0.5 / 30, 0.5 / 7.5], rtol=1e-12)


@pytest.mark.parametrize("steps", STEPS)
def test_complex_steps_are_differences(steps):
    sections, step = wire(steps, 1e-4), 1e-5
    for direction in ((1.0, 0.0), (0.0, 10.0)):
        length, tension = (np.array([0.3, 0.7]), np.array([10.0, 30.0]))
        found, _ = resting.resistance(
            sections, length + 1e-30j * direction[0], tension + 1e-30j * direction[1]
        )
        ends = [
            resting.resistance(
                sections, length + sign * step * direction[0], tension + sign * step * direction[1]
            )[0]
            for sign in (1, -1)
        ]
        slope = (ends[0] - ends[1]) / (2 * step)
        np.testing.assert_allclose(
            found.imag / 1e-30, slope, rtol=1e-6, atol=1e-9 * np.abs(slope).max()
        )


def test_twist():
    """Sections in series, each with GJ + T I_p/A; a stiffness that the design gives wins."""
    sections = wire("thick ends", 1.0)
    per_area = sections[0].polar_area
    expected = 1 / sum(own.length * 0.3 / (own.twisting + 7.0 * per_area) for own in sections)
    _, twist = resting.resistance(sections, 0.3, 7.0, np.array([0.0, 0.2]))
    np.testing.assert_allclose(twist, [expected, 0.2], rtol=1e-14)


@pytest.mark.parametrize("steps", STEPS)
def test_hinges(steps):
    """Moment over shear force at each clamp when the other is displaced."""
    sections = wire(steps, 1e-5)
    rows = [(own.rigidity[0], 0.0, own.length * 0.3) for own in sections]
    ends = beam_mp.doubles(beam_mp.transferred(rows, 9.0, 0.0)[0]).real
    upper, lower = resting.hinge_distances(sections, 0.3, 9.0)
    np.testing.assert_allclose(upper, abs(ends[1, 2] / ends[0, 2]), rtol=1e-11)
    np.testing.assert_allclose(lower, abs(ends[3, 0] / ends[2, 0]), rtol=1e-11)
    if steps == "uniform":
        assert upper == pytest.approx(np.sqrt(1e-5 / 9.0), rel=1e-3)
