"""The stability atlas on a few points of every row: what the program does keeps its digits, what
fails does so where the atlas says.

The rows are those that `make stability` draws. EPS is a rounding error; limits say how many of
them, and what they grow with.
"""

from __future__ import annotations

import re

import numpy as np
import pytest

from suspension_cli.linear import batch_modes, eigenmodes
from suspension_cli.models import registry
from tests.support.paths import ROOT
from tools import atlas
from tools.stability import beams, blades, couplings, frequency, geometry, masses, modal
from tools.stability.references import SHAPE, design, document, omega_squared, stage
from tools.stability.row import BROKEN, Row

EPS = 2.0**-53


def assert_within(row: Row, limit, *methods: str) -> None:
    """Our errors stay below a limit (a number, or one for each value)."""
    for name in methods or row.shipped:
        assert (row.error[name] <= limit).all(), f"{name}: {row.error[name]}"


def fails(row: Row, **where: tuple[float, float]) -> None:
    """A method whose name begins with a word is right at the first value, and off at some value
    from the second one on.

    Where exactly it breaks is the luck of rounding, which differs from one processor to the next,
    so the two values lie well to either side of that.
    """
    for word, (good, bad) in where.items():
        (name,) = [name for name in row.others if name.replace(" ", "_").startswith(word)]
        error, value = row.error[name], row.value.tolist()
        assert error[value.index(good)] < BROKEN, name
        assert error[value.index(bad) :].max() > BROKEN, name


def test_roll_off():
    """A solve body by body loses a few roundings wherever no resonance is near; the exports carry
    those of an eigenvalue problem below the modes."""
    row = frequency.roll_off(np.array([0.1, 1.0, 10.0, 1e3, 1e5]))
    assert_within(row, 100 * EPS, "pendsus: body by body", "pendsus export: state space")
    assert_within(row, 1e-11, "pendsus export: zpk")
    fails(row, modal_sum=(10, 1e3), zpk=(10, 1e3))


def test_long_chain():
    row = frequency.long_chain([1, 3, 8, 30])
    assert_within(row, 60 * EPS)
    fails(row, modal_sum=(3, 8), transfer_matrices=(1, 8), state_space=(8, 30))


def test_beam_functions():
    """The chord of a slender wire is soft against its ends by 1 / (L sqrt(T / EI)), a difference
    that costs as much."""
    value = np.array([1e-3, 1e-2, 0.1, 1.0, 10.0, 30.0, 100.0, 600.0, 800.0, 1e4, 1e5])
    row = beams.row(value)
    assert_within(row, EPS * (20 + 3 * value))
    assert row.error["cosh and sinh, closed form"][:2].max() > 1e-7
    assert not np.isfinite(row.error["cosh and sinh, closed form"][-3:]).any()
    fails(row, **{"cosh_and_sinh,_4": (10, 100), "cosh_and_sinh,_closed": (600, 800)})


def test_short_sections():
    row = beams.short_sections([1e-2, 1e-4, 1e-6, 1e-7])
    assert_within(row, 1e-12)
    eliminated = row.error["stiffnesses between the ends, node eliminated"]
    assert eliminated[0] < 1e-9
    assert eliminated[2:].min() > BROKEN


def test_tiny_couplings():
    """An offset x is known to the last bit of its point (0.1 m at most), so a coupling of first
    order to EPS 0.1 / x and one of second to its square."""
    value = np.array([1e-3, 1e-5, 1e-11, 1e-13])
    row = couplings.tiny(value)
    assert_within(row, 100 * EPS + EPS * 0.1 / value, "pendsus: lower end")
    assert_within(row, 1e-12 + 2e-17 / value**2, "pendsus: upper end, second order")
    fails(row, difference=(1e-5, 1e-11))


def test_large_perturbations():
    row = couplings.large(np.array([1e-4, 1e-3, 1e-2, 0.1]))
    assert_within(row, 1e-12)
    assert (
        min(
            row.error[name][0] for name in row.others if name.startswith(("in proportion", "about"))
        )
        > BROKEN
    )
    assert row.error["one linear step"].max() > 1e-4


def test_equal_modes():
    """Shares of modes that a symmetry keeps apart do not move at all; of others by EPS over the
    gap, down to where they are taken as degenerate."""
    value = np.array([1.0, 1e-4, 1e-8, 3e-10, 1e-12, 1e-14, 1e-15])
    row = modal.equal_modes(value)
    assert_within(row, 0.0, "pendsus: symmetric design")
    assert_within(
        row,
        np.where(value < batch_modes.DEGENERATE, 1e-15, 10 * EPS / value),
        "pendsus: no symmetry left",
    )
    assert row.error["symmetric eigenvectors"].max() > BROKEN


def test_rigid_wires():
    """Where wires lean, the sums in the stiffness matrix round EPS k l / T of the soft part away,
    but what they round is kept."""
    value = np.array([1e2, 1e6, 1e10, 1e14])
    row = modal.rigid_wires(value)
    assert_within(row, 20 * EPS)
    assert row.error["eigenvalues of M⁻¹K"].max() > 1e-4


def test_rigid_wires_of_a_chain():
    row = modal.graded_chain(np.array([1e3, 1e8, 1e12, 1e14, 1e15]))
    assert_within(row, 1e-12)
    fails(row, eigenvalues=(1e8, 1e14), symmetric=(1e8, 1e14))


def test_soft_blades():
    """Nothing of a blade is lost on any model; in doubles EPS times the ratio is, or its square."""
    row = blades.row(np.array([1.0, 1e4, 1e8, 1e10, 1e15]))
    assert_within(row, 1e-9)
    fails(row, tips_with=(1e4, 1e15))


def test_soft_pitch():
    """Next to tipping, what is left of the torque keeps EPS over the distance."""
    value = np.array([1.0, 1e-2, 1e-5, 1e-8, 1e-11])
    row = geometry.soft_pitch(value)
    assert_within(row, 20 * EPS + 10 * EPS / value)
    fails(row, difference=(1.0, 1e-8))


@pytest.mark.parametrize("size", [1e-2, 1e-6, 1e-12])
def test_pitch_of_wires_ever_closer_to_the_com(size):
    """Nothing cancels, so no digit is lost however soft pitch is."""
    shape = {"s": size, "d": size}
    exact = [float(value) for value in omega_squared(stage(shape=shape))]
    found = eigenmodes.solve(registry.STRING.system(design(document(**shape))))
    np.testing.assert_allclose(np.sort(found.omega_squared), exact, rtol=20 * EPS)


def test_wires_that_end_in_the_com_leave_pitch_free():
    free = eigenmodes.solve(registry.STRING.system(design(document(s=0.0, d=0.0))))
    assert free.omega_squared[0] == 0 and free.label[0] == "test pitch"


@pytest.mark.parametrize("slope", [0.5, 1e-2, 1e-4, 3e-6])
def test_nearly_horizontal_wires(slope):
    """The last bit of the length is EPS / slope^2 of the height."""
    reach = SHAPE["l"] * float(np.sqrt((1 - slope) * (1 + slope)))
    shape = {"t1": 0.01 + reach, "t2": 0.01, "s": 0.05, "k": 5e3 / slope}
    exact = [float(value) for value in omega_squared(stage(shape=shape))]
    for model in (registry.STRING, registry.FORCE):
        found = np.sort(eigenmodes.solve(model.system(design(document(**shape)))).omega_squared)
        np.testing.assert_allclose(found, exact, rtol=20 * EPS + 3 * EPS / slope**2)


def test_nearly_slack():
    """Of a tension that is a difference, EPS over what is left."""
    value = np.array([0.5, 1e-2, 1e-9])
    row = geometry.nearly_slack(value)
    assert_within(row, 100 * EPS / value)
    fails(row, in_proportion=(0.5, 1e-2))


def test_quality():
    """No rounding shows at any Q, and nothing is left out where losses are large."""
    loss = np.array([1e-2, 1e-5, 1e-8, 1e-11, 1e-14, 1e-15])
    row = modal.quality(loss)
    assert_within(row, 20 * EPS)
    for name in row.others:  # right at some Q, wrong from 1e16 on
        assert row.error[name].min() < BROKEN < row.error[name][-2:].max()


def test_masses():
    """Pitch by a millionth of the size is known to the last bit of the offset: 1e-10; modes to a
    thousandth of that."""
    row = masses.row(np.array([1e3, 1.0, 1e-3, 1e-6]))
    assert_within(row, 3e-10, "pendsus: pitch of the light body")
    assert_within(row, 1e-12, "pendsus: ω² of all modes")
    fails(row, pitch=(1.0, 1e-3))


def test_every_row_is_tested():
    """The functions of the atlas are those called here, with their own grids."""
    text = (ROOT / "tests" / "linear" / "test_stability.py").read_text()
    for make in atlas.ROWS.values():
        assert re.search(rf"{make.__module__.rsplit('.', 1)[1]}\.{make.__name__}\(", text), make


def test_the_page_is_that_of_the_rows():
    """Every row stands in results/stability.md, with its title and its two sentences."""
    page = (ROOT / "results" / "stability.md").read_text()
    row = frequency.long_chain([1, 3])
    assert f"**{row.title}** ({row.quantity}). {row.finding}" in page
    assert page.count("\n| **") == len(atlas.ROWS)
    assert atlas.table_row(row).count("|") == atlas.HEAD.splitlines()[-1].count("|")
