"""Wires of several sections against products of transfer matrices in many digits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from suspension_cli.design.cross_sections import circle, rectangle
from suspension_cli.design.materials import Bulk
from suspension_cli.elements import joined_sections, resting
from suspension_cli.elements.dynamic_wire import TautWire
from suspension_cli.scene.scene import Fibre, Section
from tests.support import beam_mp
from tests.support.beam_mp import MP
from tests.support.references import kept

TENSION = 13.7
STRETCHING = 2.3e3
"""EA, N."""
OMEGA = np.array([0.0, 1.0, 30.0, 700.0, 8e3, 1.1e5])
SHAPE = circle(2e-4, 2e-4)
PIECES = (0.05, 0.15, 0.11, 0.19, 0.27, 0.13, 0.1)


def strand(rows, tension=TENSION, angle=0.0, *, massive=True, lossy=True, surrounded=None):
    """A wire of sections: bending stiffness (twice as much in the second plane, which round wires
    do not have), mass per length and length of each."""
    losses, nowhere = (Bulk(angle),) if angle else (), np.zeros(3)
    sections = tuple(
        Section(length, (ei, 2 * ei), STRETCHING, 1e-3, mass, 1e-10, SHAPE, losses, 290.0)
        for ei, mass, length in rows
    )
    fibre = Fibre("", sections, nowhere, (nowhere, nowhere))
    return TautWire(fibre, tension, massive, lossy and bool(angle), surrounded)


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
MORE = {
    "uniform": [(0.1e-3, 0.28)],
    "cut but uniform": [(0.1e-3, 0.28 * share) for share in PIECES],
    "0.1 mm above": [(1.5e-3, 1e-4), (1.4e-3, 1e-4), (0.2e-3, 0.6)],
    "10 um between": [(1.5e-3, 20e-3), (0.8e-3, 1e-5), (0.2e-3, 0.5), (0.4e-3, 1e-3)],
}
"""Of the shortest, the stiffness EI/l^3 is up to 10^12 times that of the tension, T/l."""


def ribbon(wire):
    """The same of another shape, with both planes."""
    shape = rectangle(width=1e-3, thickness=1e-4)
    sections = tuple(replace(one, shape=shape) for one in wire.fibre.sections)
    return replace(wire, fibre=replace(wire.fibre, sections=sections))


def silica(shape):
    """(EI, mass, length) of radii and lengths."""
    return [
        (7.2e10 * np.pi * radius**4 / 4, 2200 * np.pi * radius**2, length)
        for radius, length in shape
    ]


@pytest.mark.parametrize("name", STEPPED | MORE)
def test_bending_against_transfer_matrices(name):
    """Even the smallest element keeps 11 digits, however short and stiff a section is."""
    rows, angle = silica((STEPPED | MORE)[name]), 1e-3
    with np.errstate(all="raise", under="ignore"):
        found = ribbon(strand(rows, angle=angle)).at(OMEGA)
    for part, factor in (("bend-1", 1), ("bend-2", 2)):
        ends = beam_mp.to_ends(found[part].stiffness)
        lossy = [(factor * ei * (1 + 1j * angle), mass, length) for ei, mass, length in rows]
        for n, omega in enumerate(OMEGA):
            exact = beam_mp.doubles(beam_mp.transferred(lossy, TENSION, omega)[0])
            assert np.abs(ends[..., n] / exact - 1).max() < 1e-11


@pytest.mark.parametrize("name", STEPPED)
def test_resonances_of_a_stepped_wire(name):
    """The count jumps where the determinant of the held wire changes its sign, there alone."""
    rows, roots = silica(STEPPED[name]), np.array(held_resonances(STEPPED[name]))
    found = strand(rows).held_resonances("bend-1", roots[-1])
    assert found[:8] == pytest.approx(roots, rel=1e-9)


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


@pytest.mark.parametrize("pieces", [(1.0,), (0.1, 0.73, 0.17), PIECES], ids=len)
def test_stretching_against_the_rod_in_many_digits(pieces):
    """From creeping to dozens of waves, however small the loss; held, it resonates at whole half
    waves."""
    length, mass, angle = 0.28, 7e-5, 1e-9
    rows = [(1e-6, mass, length * share) for share in pieces]
    wave = np.sqrt(STRETCHING / mass) / length
    omega = wave * 10.0 ** np.linspace(-4, 2, 25)
    found = strand(rows, angle=angle).at(omega)["stretch"].stiffness
    form = MP.matrix(joined_sections.ENDS[1].tolist())
    for n, w in enumerate(omega.tolist()):
        with beam_mp.exact():
            exact, nudged = (
                form.T
                * beam_mp.Strained(
                    STRETCHING * (1 + 1j * angle), mass, length, beam_mp.number(w) * MP.mpf(change)
                ).stiffness()
                * form
                for change in (1, "1.00000000000000000001")
            )
            for i in (0, 1):
                condition = float(abs(nudged[i, i] / exact[i, i] - 1) * MP.mpf(10) ** 20)
                limit = 1e-14 * len(pieces) * (1 + condition)
                assert abs(beam_mp.number(found[i, i, n]) / exact[i, i] - 1) < limit
                lost = float(exact[i, i].imag)
                assert found[i, i, n].imag == pytest.approx(lost, rel=1e3 * limit)
    known = np.pi * wave * np.arange(1, 40)
    resonances = strand(rows).held_resonances("stretch", known[-1])
    assert resonances[:39] == pytest.approx(known, rel=1e-10)


def test_a_node_that_resonates_to_the_last_bit():
    """Two sections whose stiffnesses cancel at their node: no singular matrix, and one side of the
    resonance or the other."""
    sign = np.array([[1.0], [-1.0]])
    beams = np.diag([4.0, 1.0, 0.0, 1.0])[..., None, None] * sign
    rods = np.array([0.5, 0.5, 0.5])[:, None, None] * sign
    for whole, motions, negative in (
        joined_sections.join(beams, np.zeros((2, 1)), np.ones((2, 1))),
        joined_sections.join_rods(rods),
    ):
        assert np.isfinite(whole).all()
        assert np.isfinite(motions[0]).all()
        assert negative.tolist() in ([0], [1], [2])


# ---------------------------------------------------------------- at rest

SHARES = {
    "uniform": [(1.0, 1.0)],
    "thick ends": [(0.01, 400.0), (0.98, 1.0), (0.01, 300.0)],
    "tapered": [(0.1, 50.0), (0.2, 8.0), (0.4, 1.0), (0.3, 20.0)],
}
"""Share of the length and of the bending stiffness of each section."""


@pytest.mark.parametrize("rigidity", [1e-6, 1e-4, 1.0])
@pytest.mark.parametrize("name", SHARES)
def test_static_stiffness_and_hinges(name, rigidity):
    """Of wires of many lengths and tensions at once, from long soft to short stiff ones, in both
    planes of a ribbon; hinges are the moment over the shear force where the other end is
    displaced."""
    wire = strand([(rigidity * own, 0.0, share) for share, own in SHARES[name]])
    plain, flat = wire.fibre.sections, ribbon(wire).fibre.sections
    lengths, tensions = np.array([[0.3], [0.6]]), np.array([3.0, 40.0])
    found, twist = resting.resistance(flat, lengths, tensions, np.array([0.0, 0.2]))
    hinges = resting.hinge_distances(plain, lengths, tensions)
    per_area = flat[0].polar_area
    for i, length in enumerate((0.3, 0.6)):
        for j, pull in enumerate(tensions):
            for plane, factor in enumerate((1.0, 2.0)):
                rows = [(factor * one.rigidity[0], 0.0, one.length * length) for one in plain]
                ends = beam_mp.doubles(beam_mp.transferred(rows, pull, 0.0)[0]).real
                slopes = [ends[1, 1], ends[1, 3], ends[3, 3]]
                np.testing.assert_allclose(found[plane, :, i, j], slopes, rtol=1e-11)
                if plane == 0:
                    known = abs(ends[1, 2] / ends[0, 2]), abs(ends[3, 0] / ends[2, 0])
                    assert [one[i, j] for one in hinges] == pytest.approx(known, rel=1e-11)
        assert twist[i].tolist() == pytest.approx([(1e-3 + 3.0 * per_area) / length, 0.2])


def test_beam_without_tension():
    """4 EI/L and 2 EI/L of any text on beams; with mass, at rest."""
    (bend, _), _ = resting.resistance(strand([(2.0, 0.0, 1.0)]).fibre.sections, 0.5, 0.0)
    np.testing.assert_allclose(bend, np.array([4, 2, 4]) * 2.0 / 0.5, rtol=1e-14)
    found = strand([(2.0, 1e-3, 0.5)], 0.0).at(np.zeros(1))["bend-1"].stiffness
    ends = beam_mp.to_ends(found)[..., 0]
    np.testing.assert_allclose(ends[[0, 1, 1], [0, 1, 3]], [192.0, 16.0, 8.0], rtol=1e-11)
