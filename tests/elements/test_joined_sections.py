"""Sections joined into one wire: a cut that is none, and steps against products of transfer
matrices."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from suspension_cli.elements import beam, joined_sections, rod
from tests.support import beam_mp
from tests.support.beam_mp import MP
from tests.support.references import kept

CUTS = {2: [0.37], 3: [0.1, 0.83], 7: [0.05, 0.2, 0.31, 0.5, 0.77, 0.9]}
TENSION = 13.7
OMEGA = np.array([0.0, 1.0, 30.0, 700.0, 8e3, 1.1e5])
EPS = np.finfo(float).eps


def bent(sections, omega, tension=TENSION):
    """Stiffness (4, 4, s, f) of each section (EI, mass, length) on (W, T_s, phi, d), the lengths,
    and how many resonances of all of them lie below."""
    rigidity, mass, length = (np.array(column)[:, None] for column in zip(*sections, strict=True))
    with np.errstate(all="raise", under="ignore"):
        wave = beam.waves(rigidity, tension, mass, length / 2, omega)
        elements = beam.stiffness(rigidity, wave)
    parts = np.zeros((4, 4, *elements[0].shape), dtype=elements[0].dtype)
    for (i, j), value in zip(beam.ELEMENT_PLACES, elements, strict=True):
        parts[i, j] = parts[j, i] = value
    below = beam.resonances_below(wave).sum(0) if np.isrealobj(rigidity) else 0
    return parts, length, below


def joined(sections, omega):
    """Stiffness (4, 4, f) of all sections on the deflections and slopes of the ends, and the number
    of resonances below, of lossless ones."""
    parts, lengths, below = bent(sections, omega)
    whole = joined_sections.join(parts, np.full(lengths.shape, TENSION), lengths)
    length = lengths.sum()
    whole.stiffness[2, 2] += TENSION * length
    form = from_ends(length)
    return np.einsum("ki,klf,lj->ijf", form, whole.stiffness, form), below + whole.negative


def stretched(sections, omega):
    """Even and odd stiffness (s, f) of rods (EA, mass, length), and the resonances."""
    rigidity, mass, length = (np.array(column)[:, None] for column in zip(*sections, strict=True))
    return (
        rod.stiffness(rigidity, mass, length / 2, omega),
        rod.resonances_below(rigidity, mass, length / 2, omega).sum(0),
    )


def pieces(first, second, length, cuts):
    return [
        (first, second, length * (after - before)) for before, after in pairwise([0.0, *cuts, 1.0])
    ]


def scale(ends):
    """Root (4, 4, f) of the products of diagonal elements, by which rounding is judged."""
    diagonal = np.abs(np.diagonal(ends).T)
    return np.sqrt(diagonal[:, None] * diagonal)


@pytest.mark.parametrize("count", CUTS)
@pytest.mark.parametrize("rigidity", [5.7e-6, 5.7e-6 * (1 + 1e-3j), 3.0, 1e-9])
def test_a_cut_wire_is_the_whole(rigidity, count):
    whole = (rigidity, 7e-5, 0.28)
    uncut, below = joined([whole], OMEGA)
    found, own = joined(pieces(*whole, CUTS[count]), OMEGA)
    change = (joined([whole], OMEGA * (1 + 1e-6))[0] - uncut) / 1e-6  # by a rounding of omega
    assert (np.abs(found - uncut) <= 1e3 * EPS * (scale(uncut) + np.abs(change))).all()
    if np.isrealobj(rigidity):
        assert np.array_equal(own, below)


@pytest.mark.parametrize("count", CUTS)
def test_a_cut_rod_is_the_whole(count):
    whole = (2.3e3, 7e-5, 0.28)
    omega = np.concatenate([OMEGA, np.random.default_rng(0).uniform(0, 1e6, 50)])
    (even, odd), below = stretched([whole], omega)
    parts, own = stretched(pieces(*whole, CUTS[count]), omega)
    (between, upper, lower), motions, negative = joined_sections.join_rods(springs(*parts))
    assert upper + lower + 4 * between == pytest.approx(odd[0], rel=1e-10)
    assert upper == pytest.approx(even[0] / 2, rel=1e-10, abs=1e-12)
    assert np.abs(lower - upper).max() < 1e-10 * np.abs(odd).max()
    assert np.array_equal(own + negative, below)
    assert below.max() > 10
    moved = joined_sections.section_motions(motions, np.ones((2, 1, len(omega))))
    for one, other in pairwise(moved):
        assert one[1] == pytest.approx(other[0])


def springs(even, odd):
    """Springs between the ends of rods, and from either end to the ground."""
    return np.array([(odd - even) / 4, even / 2, even / 2])


@pytest.mark.parametrize("count", CUTS)
@pytest.mark.parametrize("rigidity", [5.7e-6, 5.7e-6 * (1 + 1e-3j), 3.0])
def test_cuts_move_as_the_whole_wire_does(rigidity, count):
    """Deflection and slope of every section's ends, against the shape of the whole in many
    digits."""
    length, mass = 0.28, 7e-5
    rng = np.random.default_rng(count)
    motion = rng.normal(size=(4, 1)) + 1j * rng.normal(size=(4, 1))  # w_1, w'_1, w_2, w'_2
    parts, lengths, _ = bent(pieces(rigidity, mass, length, CUTS[count]), OMEGA)
    chord = from_ends(length) @ motion
    joints = joined_sections.join(parts, np.full(lengths.shape, TENSION), lengths).motions
    motions = joined_sections.section_motions(
        joints, np.repeat(chord[..., None], len(OMEGA), axis=2)
    )
    assert len(motions) == count
    sections = [
        np.linalg.solve(from_ends(own), np.moveaxis(moved[:, 0], -1, 0)[..., None])[..., 0].T
        for own, moved in zip(lengths[:, 0], motions, strict=True)
    ]
    for one, other in pairwise(sections):
        assert one[2:] == pytest.approx(other[:2], rel=1e-10, abs=1e-10)
    for n, omega in enumerate(OMEGA[1:4], 1):
        with beam_mp.exact(beam_mp.digits_for(rigidity, TENSION, mass, length, omega)):
            one = beam_mp.Bent(rigidity, TENSION, mass, length, beam_mp.number(omega))
            shapes = [one.shape(motion[:, 0], order) for order in (0, 1)]
            for place, section in zip(CUTS[count], sections[1:], strict=True):
                exact = [complex(shape(MP.mpf(place) * one.length)) for shape in shapes]
                assert section[:2, n] == pytest.approx(exact, rel=1e-10, abs=1e-10)


def from_ends(length):
    """(W, T_s, phi, d) of the motion w_1, w'_1, w_2, w'_2 of the ends of a beam."""
    chord = np.array([-1, 0, 1, 0]) / length
    return np.array([[0.5, 0, 0.5, 0], [0, -0.5, 0, 0.5], chord, [0, 0.5, 0, 0.5] - chord])


STEPPED = {
    "thick ends": [(0.75e-3, 5e-3), (0.1e-3, 0.27), (0.75e-3, 5e-3)],
    "tapers": [
        (1.5e-3, 20e-3),
        (0.8e-3, 2e-3),
        (0.4e-3, 2e-3),
        (0.2e-3, 0.5),
        (0.4e-3, 2e-3),
        (0.8e-3, 2e-3),
        (1.5e-3, 20e-3),
    ],
    "thin waist": [(0.2e-3, 0.2), (0.1e-3, 2e-3), (0.2e-3, 0.3)],
    "short and stiff ends": [(0.75e-3, 1e-3), (0.1e-3, 0.278), (0.75e-3, 1e-3)],
}
SHORTEST = {
    "0.1 mm above": [(1.5e-3, 1e-4), (1.4e-3, 1e-4), (0.2e-3, 0.6)],
    "10 um between": [(1.5e-3, 20e-3), (0.8e-3, 1e-5), (0.2e-3, 0.5), (0.4e-3, 1e-3)],
}
"""Their stiffness EI/l^3 is up to 10^12 times that of the tension, T/l."""


def silica(shape, angle=0.0):
    """(EI, mass, length) of radii and lengths."""
    modulus = 7.2e10 * (1 + 1j * angle if angle else 1)
    return [
        (modulus * np.pi * radius**4 / 4, 2200 * np.pi * radius**2, length)
        for radius, length in shape
    ]


@pytest.mark.parametrize("angle", [1e-3])
@pytest.mark.parametrize("name", STEPPED | SHORTEST)
def test_a_stepped_wire_against_transfer_matrices(name, angle):
    """Even the smallest element keeps 11 digits, however short and stiff a section is."""
    sections = silica((STEPPED | SHORTEST)[name], angle)
    found, _ = joined(sections, OMEGA)
    for n, omega in enumerate(OMEGA):
        exact = beam_mp.doubles(beam_mp.transferred(sections, TENSION, omega)[0])
        assert np.abs(found[..., n] / exact - 1).max() < 1e-11


@pytest.mark.parametrize("name", STEPPED)
def test_resonances_of_a_stepped_wire(name):
    """The count jumps where the determinant of the held wire changes its sign, there alone."""
    sections = silica(STEPPED[name])

    def below(omega):
        return int(joined(sections, np.array([omega]))[1][0])

    roots = held_resonances(STEPPED[name])
    assert len(roots) == 8
    for n, root in enumerate(roots):
        assert below(root * (1 - 1e-9)) == n
        assert below(root * (1 + 1e-9)) == n + 1


def test_a_node_that_resonates_to_the_last_bit():
    """Two sections whose stiffnesses cancel at their node: no singular matrix, and one side of the
    resonance or the other."""
    sign = np.array([[1.0], [-1.0]])
    beams = np.diag([4.0, 1.0, 0.0, 1.0])[..., None, None] * sign
    rods = springs(*np.array([1.0, 3.0])[:, None, None] * sign)
    for whole, motions, negative in (
        joined_sections.join(beams, np.zeros((2, 1)), np.ones((2, 1))),
        joined_sections.join_rods(rods),
    ):
        assert np.isfinite(whole).all()
        assert np.isfinite(motions[0]).all()
        assert negative.tolist() in ([0], [1], [2])


@kept
def held_resonances(shape):
    """The first eight roots of the determinant of the held wire, looked for between ninety places
    up to beyond the last of them."""
    sections = silica(shape)
    determinant = lambda omega: beam_mp.transferred(sections, TENSION, omega)[1]  # noqa: E731
    highest, roots = 2500.0, []
    while len(roots) < 8:
        highest, roots = 2 * highest, []
        grid = np.linspace(1.0, highest, 90).tolist()
        signs = [np.sign(determinant(omega)) for omega in grid]
        for low, high, one, other in zip(grid, grid[1:], signs, signs[1:], strict=False):
            while one != other and high - low > 1e-12 * high:
                middle = (low + high) / 2
                low, high = (middle, high) if np.sign(determinant(middle)) == one else (low, middle)
            roots += [(low + high) / 2] if one != other else []
    return roots[:8]
