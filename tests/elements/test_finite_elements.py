"""Finite elements for tests: right, of their proper order, and one with the exact
stiffness of wires."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from suspension_cli.design.cross_sections import circle
from suspension_cli.elements import beam, bending, rod
from suspension_cli.models.string import linear_model
from suspension_cli.scene.fibres import compose
from tests.support import beam_mp, finite_elements, scenes
from tests.support.beam_mp import MP
from tests.support.finite_elements import bent_element, end_forms, joined, rigid, strained_element

RIGIDITY, TENSION, MASS, LENGTH = 2e-2, 30.0, 3e-3, 0.4
"""lambda L = 15.5."""
MESHES = np.array([12, 24, 48])


def bent_chain(count):
    return joined([bent_element(RIGIDITY, TENSION, MASS, LENGTH / count)] * count, 2)


def order(errors):
    return np.log2(np.abs(errors[:-1]) / np.abs(errors[1:]))


def slow_squares(k, m):
    """Squares of the slowest angular frequencies, in digits that eigenvalues of M^-1 K have not."""
    half = np.linalg.inv(np.linalg.cholesky(k))
    return 1 / np.linalg.eigvalsh(half @ m @ half.T)[::-1]


def test_frequencies_of_a_held_wire_converge_at_fourth_order():
    found = np.array(
        [slow_squares(*(part[2:-2, 2:-2] for part in bent_chain(count)))[:4] for count in MESHES]
    )

    def equation(square):
        one = beam_mp.Bent(RIGIDITY, TENSION, MASS, LENGTH, MP.sqrt(square))
        a, b, l = one.alpha, one.beta, one.length
        return 2 * a * b * (1 - MP.cosh(a * l) * MP.cos(b * l)) + (a * a - b * b) * MP.sinh(
            a * l
        ) * MP.sin(b * l)

    with beam_mp.exact():
        exact = np.array(
            [
                float(MP.findroot(equation, (MP.mpf(value), MP.mpf(value) * (1 + MP.mpf("1e-6")))))
                for value in found[-1]
            ]
        )
    assert np.abs(found[-1] / exact - 1).max() < 1e-5
    assert (found > exact).all()  # consistent mass
    assert np.abs(order(found / exact - 1) - 4).max() < 0.2


def dynamic(matrix, omega, p):
    """Stiffness (2p, 2p) on the ends of a chain."""
    z = matrix[0] - omega**2 * matrix[1]
    ends = np.r_[:p, len(z) - p : len(z)]
    inner = np.arange(p, len(z) - p)
    return z[np.ix_(ends, ends)] - z[np.ix_(ends, inner)] @ np.linalg.solve(
        z[np.ix_(inner, inner)], z[np.ix_(inner, ends)]
    )


def even_odd(stiffness, p):
    form = np.array(beam_mp.ALIKE, dtype=float) if p == 2 else np.array([[1.0, -1], [1, 1]])
    return form.T @ stiffness @ form


@pytest.mark.parametrize("omega", [200.0, 1500.0, 4000.0])
def test_dynamic_stiffness_of_a_chain_converges_to_that_of_the_beam(omega):
    wave = beam.waves(RIGIDITY, TENSION, MASS, LENGTH / 2, np.array([omega]))
    exact = beam_mp.of_ends(beam.stiffness(RIGIDITY, wave), TENSION, LENGTH)[:, 0]
    found = [even_odd(dynamic(bent_chain(count), omega, 2), 2) for count in 2 * MESHES]
    errors = np.array([[one[place] for place in beam.ELEMENT_PLACES] for one in found]) / exact - 1
    assert np.abs(errors[-1]).max() < 1e-4
    assert np.abs(order(errors) - 4).max() < 0.2


@pytest.mark.parametrize("omega", [1e4, 3e4])
def test_dynamic_stiffness_of_a_chain_converges_to_that_of_the_rod(omega):
    exact = rod.stiffness(5e3, MASS, LENGTH / 2, np.array([omega]))[:, 0]
    found = [
        even_odd(
            dynamic(joined([strained_element(5e3, MASS, LENGTH / count)] * count, 1), omega, 1), 1
        )
        for count in MESHES
    ]
    errors = np.array([np.diag(one) for one in found]) / exact - 1
    assert np.abs(errors[-1]).max() < 1e-3
    assert np.abs(order(errors) - 4).max() < 0.2


def test_dynamic_stiffness_of_a_stepped_chain_converges():
    steps = [(RIGIDITY, MASS, 0.05), (RIGIDITY / 3, MASS / 2, 0.2), (RIGIDITY, MASS, 0.07)]
    exact = beam_mp.doubles(beam_mp.transferred(steps, TENSION, 900.0)[0]).real
    errors = []
    for count in MESHES:
        pieces = [
            bent_element(stiff, TENSION, mass, length / count)
            for stiff, mass, length in steps
            for _ in range(count)
        ]
        errors.append(np.linalg.norm(dynamic(joined(pieces, 2), 900.0, 2) / exact - 1))
    assert errors[-1] < 1e-5
    assert np.abs(order(np.array(errors)) - 4).max() < 0.2


def steel(raw):
    return replace(scenes.scene_of(raw), fibres=compose(scenes.design_of(raw)))


def random_chain(seed, **options):
    rng = np.random.default_rng(seed)
    kind = seed % 3
    raw = (
        scenes.chain(rng, 2)
        if kind == 0
        else scenes.bladed_chain(rng, 2, tip_mass=kind == 1, lateral=kind == 1)
    )
    return scenes.fibred(raw, rng.uniform(2e8, 8e8), ribbons=bool(rng.random() < 0.3), **options)


def massless(scene):
    """All but: a share of 1e-9 of the wires' mass is left."""
    wires = [
        replace(
            f,
            sections=tuple(
                replace(s, mass=1e-9 * s.mass, polar=1e-9 * s.polar) for s in f.sections
            ),
        )
        for f in scene.fibres.wire
    ]
    return replace(scene, fibres=replace(scene.fibres, wire=tuple(wires)))


def modes(model):
    """Frequencies (Hz), ascending, of a model; its massless coordinates have none."""
    squares = slow_squares(model.stiffness[6:, 6:], model.mass[6:, 6:])
    return np.sqrt(squares[: len(squares) - int(model.massless.sum())]) / (2 * np.pi)


@pytest.mark.parametrize("seed", range(1))
def test_limp_wires_without_mass_are_strings(seed):
    """Bending, twisting and mass all but taken away: the modes of the string model, and above them
    nothing slow."""
    rng = np.random.default_rng(seed)
    raw = scenes.fibred(
        scenes.raw_of(
            *(
                scenes.bladed_stage(rng, name, count, 2, tip_mass=True)
                for name, count in (("upper", 2), ("test", 4))
            )
        )
    )
    scene = steel(raw)
    limp = [
        replace(
            f,
            sections=tuple(
                replace(
                    s, rigidity=(t * l**2 / 1e14,) * 2, twisting=1e-9, shape=circle(5e-10, 5e-10)
                )
                for s in f.sections
            ),
        )
        for f, t, l in zip(scene.fibres.wire, scene.wires.tension, scene.wires.length, strict=True)
    ]
    limp = massless(replace(scene, fibres=replace(scene.fibres, wire=tuple(limp))))
    expected, found = modes(linear_model(scene, split=False)), finite_elements.frequencies(limp)
    assert found[: len(expected)] == pytest.approx(expected, rel=3e-6)
    assert found[len(expected)] > 1e4


@pytest.mark.parametrize("seed", range(1))
def test_wires_without_mass_are_the_static_beams(seed):
    """Bending and twisting as they are, ribbons and blades included: the modes of strings with the
    stiffness of `flexure`."""
    scene = steel(random_chain(seed))
    expected, found = (
        modes(linear_model(bending.with_bending(scene), split=False)),
        finite_elements.frequencies(massless(scene)),
    )
    assert found[: len(expected)] == pytest.approx(expected, rel=1e-4)
    assert found[len(expected)] > 1e4


@pytest.mark.parametrize("seed", [1])
def test_cut_wires_have_the_modes_of_whole_ones(seed):
    scene = steel(random_chain(seed))
    cut = tuple(
        replace(
            f,
            sections=tuple(
                replace(one, length=share * one.length)
                for share in (0.2, 0.45, 0.35)
                for one in f.sections
            ),
        )
        for f in scene.fibres.wire
    )
    whole, parts = (
        finite_elements.frequencies(each, 32)[:40]
        for each in (scene, replace(scene, fibres=replace(scene.fibres, wire=cut)))
    )
    assert parts == pytest.approx(whole, rel=2e-3)
    assert parts[:12] == pytest.approx(whole[:12], rel=4e-4)


def exactly_below(scene, frequency):
    """How many modes lie below (Wittrick and Williams): those of the held wires, and the negative
    eigenvalues of the dynamic stiffness."""
    k, m = rigid(scene)
    omega = np.array([2 * np.pi * frequency])
    z, count = k - omega[0] ** 2 * m, 0
    for number, fibre in enumerate(scene.fibres.wire):
        (one,), tension = fibre.sections, scene.wires.tension[number]
        upper, lower = end_forms(scene, number)
        half = one.length / 2
        for plane in (0, 1):
            a, b = ([2 * plane], [2 * plane + 1])
            even = [
                (upper[a] + lower[a]) / 2,
                (lower[b] - upper[b]) / 2,
                (lower[a] - upper[a]) / 2,
                (lower[b] + upper[b]) / 2,
            ]
            wave = beam.waves(one.rigidity[plane], tension, one.mass, half, omega)
            found = beam.stiffness(one.rigidity[plane], wave)
            found = beam_mp.of_ends(found, tension, one.length)[:, 0]
            for (i, j), value in zip(beam.ELEMENT_PLACES, found, strict=True):
                product = value * even[i].T @ even[j]
                z = z + (product if i == j else product + product.T)
            count += beam.resonances_below(wave)[0]
        for row, stiffness, mass in (
            (4, one.stretching, one.mass),
            (5, finite_elements.twisting(one, tension), one.polar),
        ):
            for value, motion in zip(
                rod.stiffness(stiffness, mass, half, omega)[:, 0],
                (upper[[row]] + lower[[row]], lower[[row]] - upper[[row]]),
                strict=True,
            ):
                z = z + value * motion.T @ motion / 4
            count += rod.resonances_below(stiffness, mass, half, omega)[0]
    z = z[6:, 6:]
    scale = 1 / np.sqrt(np.abs(np.diag(z)))
    return count + int((np.linalg.eigvalsh(z * np.outer(scale, scale)) < 0).sum())


@pytest.mark.parametrize("seed", range(2))
def test_exact_wires_have_the_modes_of_finite_ones(seed):
    """Counted in every gap: modes of bodies and violin modes in pairs of polarisations, stretching
    and twisting where they are slow enough."""
    scene = steel(random_chain(seed))
    found = finite_elements.frequencies(scene)
    frequency, below = finite_elements.between(found[found < finite_elements.limit(scene)])
    assert len(frequency) > 12
    assert [exactly_below(scene, f) for f in frequency] == below.tolist()
