"""What `pendsus tradeoff` compares: references in 50 digits against independent ones, methods and
models against each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from suspension_cli.analyses.tradeoff import (
    eigenmodes_compared,
    eigenvalues,
    equilibrium_mp,
    high_precision,
    imperfect_builds,
    thermal_noise,
    transfer_functions,
)
from suspension_cli.analyses.tradeoff.comparison import relative
from suspension_cli.analyses.tradeoff.comparisons import COMPARISONS
from suspension_cli.analyses.tradeoff.subject import FREQUENCIES, NOISE, Subject
from suspension_cli.design.reader import read
from suspension_cli.equilibrium import solve as equilibrium
from suspension_cli.linear import eigenmodes, elimination, signals
from suspension_cli.linear.pencil import Pencil
from tests.support import responses_mp as independent
from tests.support import scenes
from tests.support.paths import CONFIGS


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
    mp, rng = high_precision.context(), np.random.default_rng(2)
    matrix = (rng.normal(size=(9, 9)) * 10.0 ** rng.uniform(-8, 8, (9, 1))) * (
        rng.random((9, 9)) < 0.7
    ) + np.diag(10.0 ** rng.uniform(-3, 3, 9))
    right = rng.normal(size=(9, 2))
    solved = high_precision.eliminate(high_precision.to_mp(matrix), high_precision.to_mp(right))
    for i in range(9):
        for k in range(2):
            terms = [mp.mpf(float(matrix[i, j])) * solved[j][k] for j in range(9)]
            assert abs(sum(terms) - mp.mpf(float(right[i, k]))) < mp.mpf(10) ** -42 * (
                1 + sum(map(abs, terms))
            )


def test_eigenvalues_in_50_digits(double):
    """Against the invariants of M^-1 K: the sum of the eigenvalues and their product."""
    model, mp = double.model("string"), high_precision.context()
    block = model.blocks[0]
    assert not model.massless[block].any()
    part = replace(model)
    vars(part)["blocks"] = (block,)
    found = high_precision.omega_squared(part)
    k, m = (
        mp.matrix(high_precision.to_mp(matrix[np.ix_(block, block)]))
        for matrix in (model.stiffness, model.mass)
    )
    unsymmetric = m**-1 * k
    assert found.sum() == pytest.approx(
        float(sum(unsymmetric[n, n] for n in range(k.rows))), rel=1e-14
    )
    assert found.prod() == pytest.approx(float(mp.det(k) / mp.det(m)), rel=1e-14)


@pytest.mark.parametrize("name", ["double", "quadruple"])
def test_response_in_50_digits(name, request):
    """Against the reference of the other tests, which completes the matrices first: those agree far
    beyond what is compared."""
    one = request.getfixturevalue(name)
    model = one.model("string")
    known = signals.bodies_with_signals(model)
    ours = high_precision.response(model, one.omega, *one.forms(model))
    theirs = independent.compare(
        model,
        FREQUENCIES,
        [signals.parse_input("support.x", known)],
        [signals.parse_output(f"{one.last}.x", known)],
    )
    np.testing.assert_allclose(ours, theirs.exact[:, 0, 0], rtol=1e-13)


def test_response_in_50_digits_of_a_vertical_oscillator(single):
    """H = w0^2 / (w0^2 - w^2), with w0 of the closed form."""
    from suspension_cli.models import closed_form

    model = single.model("force")
    known = signals.bodies_with_signals(model)
    square = closed_form.vertical(closed_form.four_wires(single.design))
    drive, row = (
        signals.linear_form(signal, model)
        for signal in (
            signals.parse_input("support.z", known),
            signals.parse_output("test.z", known),
        )
    )
    np.testing.assert_allclose(
        high_precision.response(model, single.omega, drive, row),
        square / (square - single.omega**2),
        rtol=1e-12,
    )


def test_equilibrium_in_50_digits(double):
    scene = imperfect_builds.imperfect_scene(double)
    found = equilibrium_mp.solve(scene)
    assert found is not None
    for ours, theirs in zip(
        found, imperfect_builds.equilibrium_arrays(equilibrium.solve(scene)), strict=True
    ):
        assert np.abs(ours - theirs).max() < 1e-12 * np.abs(ours).max()


# Methods.

ERRORS = relative(FREQUENCIES)


def test_responses_of_a_quadruple(quadruple):
    """The solved ones have all digits; a modal sum has lost the digits listed in the stability
    atlas: 1e-7 at 50 Hz, everything at 1 kHz."""
    model = quadruple.model("string")
    known = signals.bodies_with_signals(model)
    forms = quadruple.forms(model)
    true = independent.compare(
        model,
        FREQUENCIES,
        [signals.parse_input("support.x", known)],
        [signals.parse_output("test.x", known)],
    ).exact[:, 0, 0]
    solved = [
        prepare(model, *forms)(quadruple.omega)
        for name, prepare in transfer_functions.METHODS.items()
        if name != "modal sum"
    ]
    for values in solved:
        assert max(ERRORS(quadruple, values, true).values()) < 1e-12
    lost = ERRORS(quadruple, transfer_functions.modal(model, *forms)(quadruple.omega), true)
    assert lost["1 Hz"] < 1e-12
    assert 1e-8 < lost["50 Hz"] < 1e-5
    assert lost["1 kHz"] > 0.1


def test_a_dense_solve_of_a_long_chain_keeps_what_it_can():
    """Pivots chosen by the units of metres and radians lose eight digits of eight stages, tips of
    blades below all bodies three."""
    one = subject("eight-stages")
    model = one.model("string")
    forms = one.forms(model)
    exact = high_precision.response(model, one.omega, *forms)
    for prepare in (transfer_functions.dense, transfer_functions.eliminated):
        found = ERRORS(one, prepare(model, *forms)(one.omega), exact)
        assert found.pop("1 Hz") < 1e-11  # near a resonance
        assert max(found.values()) < 1e-14


def test_responses_of_a_single_pendulum_agree(single):
    model = single.model("string")
    forms = single.forms(model)
    chain = transfer_functions.chain(model, single.omega, *forms)
    for prepare in transfer_functions.METHODS.values():
        np.testing.assert_allclose(prepare(model, *forms)(single.omega), chain, rtol=1e-12)


def test_modal_sum_with_losses_that_do_not_couple():
    """One loss angle of all wires of a stage whose motion along x is a mode alone, and a damper
    on it."""
    wires = {"count": 4, "l": 0.3, "s": 0.05, "t1": 0.05, "t2": 0.05, "d": 0.0, "k": 1e4}
    raw = scenes.raw_of(
        {
            "name": "test",
            "body": {"mass": 2.0, "inertia": [0.01] * 3},
            "wires": wires,
            "damping": {"x": 3.0},
        }
    )
    model = Subject(scenes.design_of(raw)).model("string")
    lossy = replace(model, lossy=model.stiffness * (1 + 0.1j), stretched=None)
    known = signals.bodies_with_signals(model)
    drive, row = (
        signals.linear_form(signal, model)
        for signal in (
            signals.parse_input("support.x", known),
            signals.parse_output("test.x", known),
        )
    )
    omega = 2 * np.pi * np.array([0.1, 0.9, 5.0])
    for one in (model, lossy):
        chain = transfer_functions.chain(one, omega, drive, row)
        for values in (
            transfer_functions.modal(one, drive, row)(omega),
            transfer_functions.dense(one, drive, row)(omega),
            transfer_functions.eliminated(one, drive, row)(omega),
        ):
            np.testing.assert_allclose(values, chain, rtol=1e-12)


@pytest.mark.parametrize("kind", ["lossless", "lossy", "damped"])
def test_plain_methods_condense_tips_in_every_kind_of_system(kind):
    """With loss, a damper between two bodies and on the support, or neither; a grid of more than
    one chunk."""
    one = subject("geo-silica-triple")
    model = one.model("string")
    if kind == "lossy":
        model = replace(model, lossy=model.stiffness * (1 + 1e-2j), stretched=None)
    if kind == "damped":
        x = [0, 6, 12]
        damping = model.damping.copy()
        damping[np.ix_(x, x)] += [[3.0, -3.0, 0.0], [-3.0, 5.0, -2.0], [0.0, -2.0, 2.0]]
        model = replace(model, damping=damping)
    drive, row = one.forms(model)
    omega = 2 * np.pi * np.geomspace(0.11, 900, transfer_functions.CHUNK + 3)
    chain = transfer_functions.chain(model, omega, drive, row)
    for prepare in (transfer_functions.dense, transfer_functions.eliminated):
        np.testing.assert_allclose(prepare(model, drive, row)(omega), chain, rtol=1e-9)


def test_blades_without_tip_mass_follow_in_a_modal_sum():
    """Coordinates without mass are eliminated and put back: those of blades here, one of which is
    watched."""
    one = subject("geo-silica-triple")
    model = one.model("string")
    assert model.massless[6:].any()
    drive, _ = one.forms(model)
    for n in np.flatnonzero(model.massless)[-2:]:
        row = np.eye(model.size)[n]
        wanted = high_precision.response(model, one.omega[:2], drive, row)
        np.testing.assert_allclose(
            transfer_functions.modal(model, drive, row)(one.omega[:2]),
            wanted,
            rtol=1e-9,
            atol=1e-15,
        )


@pytest.mark.parametrize("name", ["modal sum", "state space", "zpk", "chain", "dense", "LDLᵀ"])
def test_what_is_kept_is_worked_out_once(double, monkeypatch, name):
    """A method that keeps what does not depend on frequency answers as the same method anew, and
    does not solve for modes or poles again."""
    responses = next(
        item for item in COMPARISONS if item.quantity == "response" and item.compares == "methods"
    )
    anew, kept = (
        next(method for method in responses.methods if method.name == f"{name}{more}")
        for more in ("", ", kept")
    )
    wanted = anew.once(double)
    assert (kept.once(double) == wanted).all()
    for place in (
        np.linalg,
        transfer_functions,
        transfer_functions.statespace,
        transfer_functions.export,
        elimination,
    ):
        for solver in (
            "eigh",
            "eigvals",
            "assemble",
            "compute_zero_pole_gain",
            "_block",
            "by_body",
            "condense",
        ):
            if hasattr(place, solver):
                monkeypatch.setattr(place, solver, None)
    assert (kept.once(double) == wanted).all()
    with pytest.raises(TypeError):
        anew.once(double)


@pytest.mark.parametrize("name", ["double", "quadruple"])
def test_eigenvalues_agree(name, request):
    one = request.getfixturevalue(name)
    true = eigenvalues.reference(one)
    for solve in (
        eigenvalues.by_block,
        eigenvalues.whole,
        eigenvalues.symmetric,
        eigenvalues.unsymmetric,
        eigenvalues.poles,
        eigenvalues.bisected,
    ):
        assert max(eigenvalues.error(one, solve(one), true).values()) < 1e-11, solve.__name__


def test_batches_are_many_of_one(single):
    """Batched eigenvalues and couplings are those of their members."""
    factor = eigenmodes_compared.scatter_factors()
    one = eigenvalues.symmetric(single)
    for many in (
        eigenvalues.SYMMETRIC(single)(),
        eigenvalues.BY_BLOCK(single)().omega_squared,
        eigenvalues.WHOLE(single)()[0],
        np.sort(eigenvalues.UNSYMMETRIC(single)()),
    ):
        np.testing.assert_allclose(many, factor[:, None] * one, rtol=1e-11)
    share = imperfect_builds.fractions()
    together = imperfect_builds.rebuilt(single, share)
    np.testing.assert_allclose(
        together[-1:], imperfect_builds.rebuilt(single, np.ones(1)), rtol=1e-12
    )
    closed, force = (
        eigenmodes_compared.formulas_batch(single)(),
        eigenmodes_compared.force_batch(single)(),
    )
    ours = np.sort(
        np.concatenate([values.reshape(len(factor), -1) for values in closed.values()], axis=-1)
    )
    theirs = np.sort(
        eigenmodes_compared.signed_frequency(
            np.concatenate(
                [np.atleast_2d(values.T).T.reshape(len(factor), -1) for values in force.values()],
                axis=-1,
            )
        )
    )
    np.testing.assert_allclose(ours, theirs, rtol=1e-10)


@pytest.mark.parametrize("name", ["double", "quadruple"])
def test_batches_of_modes_are_those_of_their_members(name, request, monkeypatch):
    """On strings and with wires that bend: with every mass as drawn, each member has the design's
    own modes."""
    one = request.getfixturevalue(name)
    monkeypatch.setattr(eigenmodes_compared, "scatter_factors", lambda: np.ones(3))
    for model, batch in (
        ("string", eigenmodes_compared.string_batch),
        ("beam", eigenmodes_compared.beam_batch),
    ):
        wanted = eigenmodes_compared.solve_blocks(one, model).omega_squared
        np.testing.assert_allclose(
            batch(one)().omega_squared, np.broadcast_to(wanted, (3, len(wanted))), rtol=1e-10
        )


def test_thermal_noise_agrees(single):
    truth = thermal_noise.reference(single)
    model = single.model(single.top)
    for solve, limit in ((thermal_noise.dissipation, 1e-13), (thermal_noise.susceptibility, 1e-9)):
        assert (
            max(relative(NOISE)(single, solve(model, np.array(NOISE), single), truth).values())
            < limit
        )


@pytest.mark.parametrize("name", ["husman2000/figure6", "double", "geo-silica-triple"])
def test_thermal_noise_in_50_digits(name):
    """What the parts dissipate, against the imaginary part of the susceptibility, x = H f: 4 k T
    |Im H| / omega; in 50 digits nothing of it cancels."""
    one = subject(name)
    model, omega = one.model(one.top), 2 * np.pi * np.array(NOISE)
    _, row = thermal_noise.thermal.parse_motion(model, f"{one.last}.x")
    density = np.zeros(len(omega))
    pencil = Pencil.of(model)
    for block in pencil.blocks:
        force, there = row[block.keep], block.at(pencil.at(omega))
        if force.any():
            susceptibility = [
                force @ high_precision.driven_motion(there.matrix[:, 6:, n], force)
                for n in range(len(omega))
            ]
            density += 4 * 1.380649e-23 * one.temperature * np.abs(np.imag(susceptibility)) / omega
    assert thermal_noise.temperatures(one) == {one.temperature}
    np.testing.assert_allclose(thermal_noise.reference(one), np.sqrt(density), rtol=1e-9)


def test_coupling_rebuilt_agrees_with_the_design_perturbed(double):
    """Builds made of arrays, and the design with a [[perturbation]] read anew, its matrices solved
    in 50 digits."""
    np.testing.assert_allclose(
        imperfect_builds.rebuilt(double, np.ones(1)),
        imperfect_builds.reference(double, "string"),
        rtol=1e-9,
    )
    np.testing.assert_allclose(
        imperfect_builds.rebuilt(double, np.ones(1), "violin"),
        imperfect_builds.reference(double, double.imperfect.top),
        rtol=1e-9,
    )


def test_first_order_is_of_first_order(single):
    """Its error falls with the square of the imperfection."""
    share = np.array([0.08, 0.04, 0.02])
    error = np.abs(
        imperfect_builds.perturbed(single, share) - imperfect_builds.rebuilt(single, share)
    )
    assert np.log2(error[:-1] / error[1:]) == pytest.approx([2, 2], abs=0.2)


def test_newton_steps_converge(double):
    true = imperfect_builds.equilibrium_reference(double)
    linear, twice, full = (
        imperfect_builds.equilibrium_error(double, solve(double), true)
        for solve in (
            imperfect_builds.steps(1)[0],
            imperfect_builds.steps(2)[0],
            imperfect_builds.full()[0],
        )
    )
    for part in true and linear:
        assert full[part] < 1e-12 < twice[part] < 0.1 * linear[part]


# Modes by model.


def test_modes_are_paired_by_shape(double):
    wanted, found = (
        eigenmodes_compared.reference(double),
        eigenmodes_compared.solve_blocks(double, "string"),
    )
    plain = eigenmodes_compared.error(double, found, wanted)
    assert set(plain) == set(eigenmodes_compared.KINDS)
    order = np.random.default_rng(3).permutation(len(found.omega_squared))
    names = (
        "omega_squared",
        "shape",
        "energy",
        "tip_energy",
        "block",
        "q",
        "dilution",
        "wire_energy",
        "order",
    )
    mixed = replace(found, **{name: getattr(found, name)[order] for name in names})
    assert eigenmodes_compared.error(double, mixed, wanted) == plain
    off = replace(found, omega_squared=found.omega_squared * 1.02**2)
    own = eigenmodes_compared.Reference(
        eigenmodes_compared.signed_frequency(found.omega_squared),
        eigenmodes_compared.mode_kinds(found),
        eigenmodes_compared.body_shapes(double, found),
    )
    assert eigenmodes_compared.error(double, off, own) == pytest.approx(
        dict.fromkeys(eigenmodes_compared.KINDS, 0.02)
    )


def test_closed_forms_against_blocks(single):
    found = eigenmodes_compared.formulas(single)
    every = np.sort(np.concatenate(list(found.values())))
    np.testing.assert_allclose(
        every, eigenmodes.solve(single.model("closed-form")).frequency, rtol=1e-12
    )


def test_closed_forms_of_a_design_that_is_free_to_turn():
    """Wires of no width at the COM leave pitch free: a frequency of 0 has no relative error, the
    others have theirs."""
    wires = {"count": 4, "l": 0.28, "s": 0.0, "t1": 0.0965, "t2": 0.0965, "d": 0.0, "k": 1.227e4}
    one = Subject(
        scenes.design_of(
            scenes.raw_of(
                {
                    "name": "test",
                    "body": {"mass": 5.6, "inertia": [0.0227, 0.016, 0.016]},
                    "wires": wires,
                }
            )
        )
    )
    wanted, found = eigenmodes_compared.reference(one), eigenmodes_compared.formulas(one)
    assert (wanted.frequency == 0).sum() == 1
    assert max(eigenmodes_compared.error(one, found, wanted).values()) < 1e-12
    off = {kind: 1.02 * values for kind, values in found.items()}
    assert eigenmodes_compared.error(one, off, wanted) == pytest.approx(
        dict.fromkeys(eigenmodes_compared.KINDS, 0.02)
    )
