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
OMEGA = np.array([0.0, 1.0, 30.0, 700.0, 8e3, 1e5])
EPS = np.finfo(float).eps


def bent(sections, omega, tension=TENSION):
    """Stiffness (4, 4, f) on the ends of each section (EI, mass, length), and how many resonances
    of all of them lie below."""
    parts, below = [], 0
    for rigidity, mass, length in sections:
        with np.errstate(all="raise", under="ignore"):
            found = beam.stiffness(rigidity, beam.waves(rigidity, tension, mass, length / 2, omega))
        parts.append(joined_sections.to_ends(_filled(4, beam.ELEMENT_PLACES, found)))
        if np.isrealobj(rigidity):
            below = below + beam.resonances_below(rigidity, tension, mass, length / 2, omega)
    return parts, below


def stretched(sections, omega):
    """The same (2, 2, f) of rods (EA, mass, length)."""
    parts = [
        joined_sections.to_ends(
            _filled(2, ((0, 0), (1, 1)), rod.stiffness(s, mass, length / 2, omega))
        )
        for s, mass, length in sections
    ]
    return parts, sum(
        rod.resonances_below(s, mass, length / 2, omega) for s, mass, length in sections
    )


def _filled(size, place, elements):
    result = np.zeros((size, size, elements.shape[-1]), dtype=elements.dtype)
    for (i, j), value in zip(place, elements, strict=True):
        result[i, j] = result[j, i] = value
    return result


def pieces(first, second, length, cuts):
    return [
        (first, second, length * (after - before)) for before, after in pairwise([0.0, *cuts, 1.0])
    ]


def largest(parts):
    """Largest element (4, 4) of each kind (ww, wt, tt) in any section: what rounding errors are
    measured with."""
    size = np.abs(np.array(parts)).max((0, 3))
    kinds = np.array([[size[i::2, j::2].max() for j in (0, 1)] for i in (0, 1)])
    return np.tile(kinds, (2, 2))


@pytest.mark.parametrize("count", CUTS)
@pytest.mark.parametrize("rigidity", [5.7e-6, 5.7e-6 * (1 + 1e-3j), 3.0, 1e-9])
def test_a_cut_wire_is_the_whole(rigidity, count):
    whole = (rigidity, 7e-5, 0.28)
    (uncut,), below = bent([whole], OMEGA)
    parts, own = bent(pieces(*whole, CUTS[count]), OMEGA)
    found, nodes, negative = joined_sections.join(parts)
    assert len(nodes) == count - 1
    assert (np.abs(found - uncut) <= 1e3 * EPS * largest(parts)[..., None]).all()
    if np.isrealobj(rigidity):
        assert np.array_equal(own + negative, below)


@pytest.mark.parametrize("count", CUTS)
def test_a_cut_rod_is_the_whole(count):
    whole = (2.3e3, 7e-5, 0.28)
    omega = np.concatenate([OMEGA, np.random.default_rng(0).uniform(0, 1e6, 50)])
    (uncut,), below = stretched([whole], omega)
    parts, own = stretched(pieces(*whole, CUTS[count]), omega)
    found, _, negative = joined_sections.join(parts)
    assert np.abs(found / uncut - 1).max() < 1e-10
    assert np.array_equal(own + negative, below)
    assert below.max() > 10


@pytest.mark.parametrize("count", CUTS)
@pytest.mark.parametrize("rigidity", [5.7e-6, 5.7e-6 * (1 + 1e-3j), 3.0])
def test_cuts_move_as_the_whole_wire_does(rigidity, count):
    """Deflection and slope of every section's ends, against the shape of the whole in many
    digits."""
    length, mass = 0.28, 7e-5
    rng = np.random.default_rng(count)
    motion = rng.normal(size=(4, 1)) + 1j * rng.normal(size=(4, 1))
    parts, _ = bent(pieces(rigidity, mass, length, CUTS[count]), OMEGA)
    sections = joined_sections.section_motions(
        joined_sections.join(parts)[1], np.repeat(motion[..., None], len(OMEGA), axis=2)
    )
    assert len(sections) == count
    for one, other in pairwise(sections):
        assert np.array_equal(one[2:], other[:2])
    assert np.array_equal(sections[0][:2, :, 0], motion[:2]) and np.array_equal(
        sections[-1][2:, :, 0], motion[2:]
    )
    for n, omega in enumerate(OMEGA[1:4], 1):
        with beam_mp.exact(beam_mp.digits_for(rigidity, TENSION, mass, length, omega)):
            one = beam_mp.Bent(rigidity, TENSION, mass, length, beam_mp.number(omega))
            shapes = [one.shape(motion[:, 0], order) for order in (0, 1)]
            for cut, section in zip(CUTS[count], sections[1:], strict=True):
                exact = [complex(shape(MP.mpf(cut) * one.length)) for shape in shapes]
                assert section[:2, 0, n] == pytest.approx(exact, rel=1e-10, abs=1e-10)


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


def silica(shape, angle=0.0):
    """(EI, mass, length) of radii and lengths."""
    modulus = 7.2e10 * (1 + 1j * angle if angle else 1)
    return [
        (modulus * np.pi * radius**4 / 4, 2200 * np.pi * radius**2, length)
        for radius, length in shape
    ]


@pytest.mark.parametrize("angle", [0.0, 1e-3])
@pytest.mark.parametrize("name", STEPPED)
def test_a_stepped_wire_against_transfer_matrices(name, angle):
    """Rounding errors are those of its stiffest section; of the whole, the ends' own stiffness
    keeps 9 digits in the worst of these."""
    sections = silica(STEPPED[name], angle)
    parts, _ = bent(sections, OMEGA)
    found, _, _ = joined_sections.join(parts)
    for n, omega in enumerate(OMEGA):
        exact = beam_mp.doubles(beam_mp.transferred(sections, TENSION, omega)[0])
        assert (np.abs(found[..., n] - exact) <= 1e3 * EPS * largest(parts)).all()
        assert np.abs(found[..., n] / exact - 1).max() < 3e-9


@pytest.mark.parametrize("name", STEPPED)
def test_resonances_of_a_stepped_wire(name):
    """The count jumps where the determinant of the held wire changes its sign, there alone."""
    sections = silica(STEPPED[name])

    def below(omega):
        parts, own = bent(sections, np.array([omega]))
        return int((own + joined_sections.join(parts)[2])[0])

    roots = held_resonances(STEPPED[name])
    assert len(roots) == 8
    for n, root in enumerate(roots):
        assert below(root * (1 - 1e-9)) == n
        assert below(root * (1 + 1e-9)) == n + 1


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
