"""What `pendsus tradeoff` compares: references in 50 digits against independent ones, methods and rungs against each other."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import exact as independent
import numpy as np
import pytest
import scenes

from suspension_cli.analysis import modes, signals
from suspension_cli.analysis.tradeoff import balance, eigen, exact, imperfect, noise, spectra, transfer
from suspension_cli.analysis.tradeoff.comparisons import COMPARISONS
from suspension_cli.analysis.tradeoff.registry import relative
from suspension_cli.analysis.tradeoff.subject import FREQUENCIES, NOISE, Subject
from suspension_cli.design.reader import read
from suspension_cli.mechanics import condensed, equilibrium

CONFIGS = Path(__file__).parent.parent / "configs"


def subject(name):
    return Subject(read(CONFIGS / f"{name}.toml").design)


@pytest.fixture(scope="module")
def single():
    return subject("husman2000/table1-case3")


@pytest.fixture(scope="module")
def double():
    return subject("double")


@pytest.fixture(scope="module")
def quadruple():
    return subject("quadruple")


# References.


def test_elimination_in_50_digits_leaves_nothing():
    mp, rng = exact.context(), np.random.default_rng(2)
    matrix = (rng.normal(size=(9, 9)) * 10.0 ** rng.uniform(-8, 8, (9, 1))) * (rng.random((9, 9)) < 0.7) + np.diag(10.0 ** rng.uniform(-3, 3, 9))
    right = rng.normal(size=(9, 2))
    solved = exact.eliminate(exact.converted(matrix), exact.converted(right))
    for i in range(9):
        for k in range(2):
            terms = [mp.mpf(float(matrix[i, j])) * solved[j][k] for j in range(9)]
            assert abs(sum(terms) - mp.mpf(float(right[i, k]))) < mp.mpf(10) ** -42 * (1 + sum(map(abs, terms)))


def test_eigenvalues_in_50_digits(double):
    """Against the invariants of M^-1 K: the sum of the eigenvalues and their product."""
    model, mp = double.model("string"), exact.context()
    block = model.blocks[0]
    assert not model.massless[block].any()
    part = replace(model)
    vars(part)["blocks"] = (block,)
    found = exact.omega_squared(part)
    k, m = (mp.matrix(exact.converted(matrix[np.ix_(block, block)])) for matrix in (model.stiffness, model.mass))
    unsymmetric = m**-1 * k
    assert found.sum() == pytest.approx(float(sum(unsymmetric[n, n] for n in range(k.rows))), rel=1e-14)
    assert found.prod() == pytest.approx(float(mp.det(k) / mp.det(m)), rel=1e-14)


@pytest.mark.parametrize("name", ["double", "quadruple"])
def test_response_in_50_digits(name, request):
    """Against the reference of the other tests, which completes the matrices first: those agree far beyond what is compared."""
    one = request.getfixturevalue(name)
    model = one.model("string")
    known = signals.bodies(model)
    ours = exact.response(model, one.omega, *one.forms(model))
    theirs = independent.compare(model, FREQUENCIES, [signals.drive("support.x", known)], [signals.motion(f"{one.last}.x", known)])
    np.testing.assert_allclose(ours, theirs.exact[:, 0, 0], rtol=1e-13)


def test_response_in_50_digits_of_a_vertical_oscillator(single):
    """H = w0^2 / (w0^2 - w^2), with w0 of the closed form."""
    from suspension_cli.models import closed_form

    model = single.model("force")
    known = signals.bodies(model)
    square = closed_form.vertical(closed_form.four_wires(single.design))
    drive, row = (signals.row(signal, model) for signal in (signals.drive("support.z", known), signals.motion("test.z", known)))
    np.testing.assert_allclose(exact.response(model, single.omega, drive, row), square / (square - single.omega**2), rtol=1e-12)


def test_equilibrium_in_50_digits(double):
    scene = imperfect.spoilt(double)
    found = balance.settled(scene)
    assert found is not None
    for ours, theirs in zip(found, imperfect.where(equilibrium.solve(scene)), strict=True):
        assert np.abs(ours - theirs).max() < 1e-12 * np.abs(ours).max()


# Methods.

ERRORS = relative(FREQUENCIES)


def test_responses_of_a_quadruple(quadruple):
    """The solved ones have all digits; a modal sum has lost what the stability atlas tells: 1e-7 at 50 Hz, everything at 1 kHz."""
    model = quadruple.model("string")
    known = signals.bodies(model)
    forms = quadruple.forms(model)
    true = independent.compare(model, FREQUENCIES, [signals.drive("support.x", known)], [signals.motion("test.x", known)]).exact[:, 0, 0]
    solved = [transfer.dense(model, quadruple.omega, *forms)]
    solved += [prepare(model, *forms)(quadruple.omega) for prepare in (transfer.chained, transfer.realised, transfer.factored)]
    for values in solved:
        assert max(ERRORS(quadruple, values, true).values()) < 1e-12
    lost = ERRORS(quadruple, transfer.modal(model, *forms)(quadruple.omega), true)
    assert lost["1 Hz"] < 1e-12
    assert 1e-8 < lost["50 Hz"] < 1e-5
    assert lost["1 kHz"] > 0.1


def test_a_dense_solve_of_a_long_chain_keeps_what_it_can():
    """Pivots chosen by the units of metres and radians lose eight digits of eight stages, tips of blades below all bodies three."""
    one = subject("eight-stages")
    model = one.model("string")
    forms = one.forms(model)
    found = ERRORS(one, transfer.dense(model, one.omega, *forms), exact.response(model, one.omega, *forms))
    assert found.pop("1 Hz") < 1e-11  # near a resonance
    assert max(found.values()) < 1e-14


def test_responses_of_a_single_pendulum_agree(single):
    model = single.model("string")
    forms = single.forms(model)
    chain = transfer.chain(model, single.omega, *forms)
    np.testing.assert_allclose(transfer.dense(model, single.omega, *forms), chain, rtol=1e-12)
    for prepare in (transfer.modal, transfer.realised, transfer.factored):
        np.testing.assert_allclose(prepare(model, *forms)(single.omega), chain, rtol=1e-12)


def test_modal_sum_with_losses_that_do_not_couple():
    """One loss angle of all wires of a stage whose motion along x is a mode by itself, and a damper on it."""
    wires = {"count": 4, "l": 0.3, "s": 0.05, "t1": 0.05, "t2": 0.05, "d": 0.0, "k": 1e4}
    raw = scenes.raw_of({"name": "test", "body": {"mass": 2.0, "inertia": [0.01] * 3}, "wires": wires, "damping": {"x": 3.0}})
    model = Subject(scenes.design_of(raw)).model("string")
    lossy = replace(model, lossy=model.stiffness * (1 + 0.1j))
    known = signals.bodies(model)
    drive, row = (signals.row(signal, model) for signal in (signals.drive("support.x", known), signals.motion("test.x", known)))
    omega = 2 * np.pi * np.array([0.1, 0.9, 5.0])
    for one in (model, lossy):
        chain = transfer.chain(one, omega, drive, row)
        for values in (transfer.modal(one, drive, row)(omega), transfer.dense(one, omega, drive, row)):
            np.testing.assert_allclose(values, chain, rtol=1e-12)


def test_blades_without_tip_mass_follow_in_a_modal_sum():
    """Coordinates without mass are eliminated and put back: those of blades here, one of which is watched."""
    one = subject("geo-silica-triple")
    model = one.model("string")
    assert model.massless[6:].any()
    drive, _ = one.forms(model)
    for n in np.flatnonzero(model.massless)[-2:]:
        row = np.eye(model.size)[n]
        wanted = exact.response(model, one.omega[:2], drive, row)
        np.testing.assert_allclose(transfer.modal(model, drive, row)(one.omega[:2]), wanted, rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize("name", ["modal sum", "state space", "zpk", "chain"])
def test_what_is_kept_is_worked_out_once(double, monkeypatch, name):
    """A method that keeps what does not depend on frequency answers as the same method anew, and does not solve for modes or poles again."""
    responses = next(item for item in COMPARISONS if item.quantity == "response" and item.compares == "methods")
    anew, kept = (next(method for method in responses.methods if method.name == f"{name}{more}") for more in ("", ", kept"))
    wanted = anew.once(double)
    assert (kept.once(double) == wanted).all()
    for place in (np.linalg, transfer.statespace, transfer.export, condensed):
        for solver in ("eigh", "eigvals", "assemble", "zero_pole_gain", "_block"):
            if hasattr(place, solver):
                monkeypatch.setattr(place, solver, None)
    assert (kept.once(double) == wanted).all()
    with pytest.raises(TypeError):
        anew.once(double)


@pytest.mark.parametrize("name", ["double", "quadruple"])
def test_eigenvalues_agree(name, request):
    one = request.getfixturevalue(name)
    true = spectra.reference(one)
    for solve in (spectra.by_block, spectra.whole, spectra.symmetric, spectra.unsymmetric, spectra.poles, spectra.bisected):
        assert max(spectra.error(one, solve(one), true).values()) < 1e-11, solve.__name__


def test_batches_are_many_of_one(single):
    """Batched eigenvalues and couplings are those of their members."""
    factor = eigen.scattered()
    one = spectra.symmetric(single)
    for many in (spectra.SYMMETRIC(single)(), spectra.BY_BLOCK(single)().omega_squared, spectra.WHOLE(single)()[0], np.sort(spectra.UNSYMMETRIC(single)())):
        np.testing.assert_allclose(many, factor[:, None] * one, rtol=1e-11)
    share = imperfect.shares()
    together = imperfect.rebuilt(single, share)
    np.testing.assert_allclose(together[-1:], imperfect.rebuilt(single, np.ones(1)), rtol=1e-12)
    closed, force = eigen.formulas_batch(single)(), eigen.force_batch(single)()
    ours = np.sort(np.concatenate([values.reshape(len(factor), -1) for values in closed.values()], axis=-1))
    theirs = np.sort(eigen.signed(np.concatenate([np.atleast_2d(values.T).T.reshape(len(factor), -1) for values in force.values()], axis=-1)))
    np.testing.assert_allclose(ours, theirs, rtol=1e-10)


@pytest.mark.parametrize("name", ["double", "quadruple"])
def test_batches_of_modes_are_those_of_their_members(name, request, monkeypatch):
    """On strings and with wires that bend: with every mass as drawn, each member has the design's own modes."""
    one = request.getfixturevalue(name)
    monkeypatch.setattr(eigen, "scattered", lambda: np.ones(3))
    for rung, batch in (("string", eigen.string_batch), ("beam", eigen.beam_batch)):
        wanted = eigen.solved(one, rung).omega_squared
        np.testing.assert_allclose(batch(one)().omega_squared, np.broadcast_to(wanted, (3, len(wanted))), rtol=1e-10)


def test_thermal_noise_agrees(single):
    truth = noise.reference(single)
    model = single.model(single.top)
    for solve, limit in ((noise.dissipation, 1e-13), (noise.susceptibility, 1e-9)):
        assert max(relative(NOISE)(single, solve(model, np.array(NOISE), single), truth).values()) < limit


@pytest.mark.parametrize("name", ["husman2000/figure6", "double", "geo-silica-triple"])
def test_thermal_noise_in_50_digits(name):
    """What the parts dissipate, against the imaginary part of the susceptibility, x = H f: 4 k T |Im H| / omega; in 50 digits nothing of it cancels."""
    one = subject(name)
    model, omega = one.model(one.top), 2 * np.pi * np.array(NOISE)
    _, row = noise.thermal.observed(model, f"{one.last}.x")
    density = np.zeros(len(omega))
    for block in noise.dispersive.blocks(model):
        force, there = row[block.keep], block.at(omega)
        if force.any():
            susceptibility = [force @ exact.pushed(there.matrix[:, 6:, n], force) for n in range(len(omega))]
            density += 4 * 1.380649e-23 * one.temperature * np.abs(np.imag(susceptibility)) / omega
    assert noise.warmth(one) == {one.temperature}
    np.testing.assert_allclose(noise.reference(one), np.sqrt(density), rtol=1e-9)


def test_coupling_rebuilt_agrees_with_the_design_perturbed(double):
    """Builds made of arrays, and the design with a [[perturbation]] read anew, its matrices solved in 50 digits."""
    np.testing.assert_allclose(imperfect.rebuilt(double, np.ones(1)), imperfect.string_reference(double), rtol=1e-9)
    np.testing.assert_allclose(imperfect.rebuilt(double, np.ones(1), "violin"), imperfect.reference(double), rtol=1e-9)


def test_first_order_is_of_first_order(single):
    """Its error falls with the square of the imperfection."""
    share = np.array([0.08, 0.04, 0.02])
    error = np.abs(imperfect.perturbed(single, share) - imperfect.rebuilt(single, share))
    assert np.log2(error[:-1] / error[1:]) == pytest.approx([2, 2], abs=0.2)


def test_newton_steps_converge(double):
    true = imperfect.hung(double)
    linear, twice, full = (imperfect.apart(double, solve(double), true) for solve in (imperfect.steps(1)[0], imperfect.steps(2)[0], imperfect.full()[0]))
    for part in true and linear:
        assert full[part] < 1e-12 < twice[part] < 0.1 * linear[part]


# Modes by rung.


def test_modes_are_paired_by_shape(double):
    wanted, found = eigen.reference(double), eigen.solved(double, "string")
    plain = eigen.error(double, found, wanted)
    assert set(plain) == set(eigen.KINDS)
    order = np.random.default_rng(3).permutation(len(found.omega_squared))
    names = ("omega_squared", "shape", "energy", "tip_energy", "block", "q", "dilution", "wire_energy", "order")
    mixed = replace(found, **{name: getattr(found, name)[order] for name in names})
    assert eigen.error(double, mixed, wanted) == plain
    off = replace(found, omega_squared=found.omega_squared * 1.02**2)
    own = eigen.Reference(eigen.signed(found.omega_squared), eigen.kinds(found), eigen.bodily(double, found))
    assert eigen.error(double, off, own) == pytest.approx(dict.fromkeys(eigen.KINDS, 0.02))


def test_closed_forms_against_blocks(single):
    found = eigen.formulas(single)
    every = np.sort(np.concatenate(list(found.values())))
    np.testing.assert_allclose(every, modes.solve(single.model("closed-form")).frequency, rtol=1e-12)


def test_closed_forms_of_a_design_that_is_free_to_turn():
    """Wires of no width at the COM leave pitch free: a frequency of 0 has no relative error, the others have theirs."""
    wires = {"count": 4, "l": 0.28, "s": 0.0, "t1": 0.0965, "t2": 0.0965, "d": 0.0, "k": 1.227e4}
    one = Subject(scenes.design_of(scenes.raw_of({"name": "test", "body": {"mass": 5.6, "inertia": [0.0227, 0.016, 0.016]}, "wires": wires})))
    wanted, found = eigen.reference(one), eigen.formulas(one)
    assert (wanted.frequency == 0).sum() == 1
    assert max(eigen.error(one, found, wanted).values()) < 1e-12
    off = {kind: 1.02 * values for kind, values in found.items()}
    assert eigen.error(one, off, wanted) == pytest.approx(dict.fromkeys(eigen.KINDS, 0.02))
