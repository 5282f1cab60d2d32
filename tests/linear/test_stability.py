"""The stability atlas on a few points of every row: what the program does keeps its digits, what
fails does so where the atlas says.

The rows are those that `make stability` draws. EPS is a rounding error; limits say how many of
them, and what they grow with.
"""

from __future__ import annotations

import numpy as np
import pytest

from suspension_cli.linear import batch_modes, eigenmodes
from suspension_cli.models import registry
from tests.support.paths import ROOT
from tools import atlas
from tools.stability import frequency
from tools.stability.references import SHAPE, design, document, omega_squared, stage
from tools.stability.row import BROKEN

EPS = 2.0**-53


CASES = {
    # a solve body by body loses a few roundings wherever no resonance is near; the exports carry
    # those of an eigenvalue problem below the modes
    "roll-off": (
        [0.1, 1.0, 10.0, 1e3, 1e5],
        {"body by body": 100 * EPS, "state space": 100 * EPS, "zpk": 1e-11},
        {"modal sum": (10, 1e3), "zpk": (10, 1e3)},
    ),
    "long-chain": (
        [1, 3, 8, 30],
        {"": 60 * EPS},
        {"modal sum": (3, 8), "transfer matrices": (1, 8), "state space": (8, 30)},
    ),
    # the chord of a slender wire is soft against its ends by 1 / (L sqrt(T / EI)), a difference
    # that costs as much
    "beam-functions": (
        [1e-3, 1e-2, 0.1, 1.0, 10.0, 30.0, 100.0, 600.0, 800.0, 1e4, 1e5],
        {"": lambda value: EPS * (20 + 3 * value)},
        {"cosh and sinh, 4": (10, 100), "cosh and sinh, closed": (600, 800)},
    ),
    # the accuracy of a map that was compared with full solutions
    "maps": (
        [0.05, 0.1, 0.3],
        {"": 1e-6},
        {"polynomial": (0.1, 0.3), "spline": (0.1, 0.3)},
    ),
    "short-sections": (
        [1e-2, 1e-4, 1e-6, 1e-7],
        {"": 1e-12},
        {"stiffnesses between the ends": (1e-2, 1e-6)},
    ),
    # an offset x is known to the last bit of its point (0.1 m at most), so a coupling of first
    # order to EPS 0.1 / x and one of second to its square
    "tiny-couplings": (
        [1e-3, 1e-5, 1e-11, 1e-13],
        {
            "lower end": lambda value: 100 * EPS + EPS * 0.1 / value,
            "upper end, second order": lambda value: 1e-12 + 2e-17 / value**2,
        },
        {"difference": (1e-5, 1e-11)},
    ),
    "large-perturbations": (
        [1e-4, 1e-3, 1e-2, 0.1],
        {"": 1e-12},
        {"in proportion": (None, 1e-4), "about": (None, 1e-4)},
    ),
    # shares of modes that a symmetry keeps apart do not move at all; of others by EPS over the
    # gap, down to where they are taken as degenerate
    "equal-modes": (
        [1.0, 1e-4, 1e-8, 3e-10, 1e-12, 1e-14, 1e-15],
        {
            "symmetric design": 0.0,
            "no symmetry left": lambda value: np.where(
                value < batch_modes.DEGENERATE, 1e-15, 10 * EPS / value
            ),
        },
        {"symmetric eigenvectors": (1.0, 1e-14)},
    ),
    # where wires lean, the sums in the stiffness matrix round EPS k l / T of the soft part away,
    # but what they round is kept
    "rigid-wires": ([1e2, 1e6, 1e10, 1e14], {"": 20 * EPS}, {}),
    "rigid-chain": (
        [1e3, 1e8, 1e12, 1e14, 1e15],
        {"": 1e-12},
        {"eigenvalues": (1e8, 1e14), "symmetric": (1e8, 1e14)},
    ),
    # nothing of a blade is lost on any model; in doubles EPS times the ratio is, or its square
    "soft-blades": ([1.0, 1e4, 1e8, 1e10, 1e15], {"": 1e-9}, {"tips with": (1e4, 1e15)}),
    # next to tipping, what is left of the torque keeps EPS over the distance
    "soft-pitch": (
        [1.0, 1e-2, 1e-5, 1e-8, 1e-11],
        {"": lambda value: 20 * EPS + 10 * EPS / value},
        {"difference": (1.0, 1e-8)},
    ),
    # of a tension that is a difference, EPS over what is left
    "slack": ([0.5, 1e-2, 1e-9], {"": lambda value: 100 * EPS / value}, {"in prop": (0.5, 1e-2)}),
    # no rounding shows at any Q, and nothing is left out where losses are large
    "quality": (
        [1e-2, 1e-5, 1e-8, 1e-11, 1e-14, 1e-15],
        {"": 20 * EPS},
        {"poles": (1e-5, 1e-14), "width": (1e-5, 1e-14)},
    ),
    # pitch by a millionth of the size is known to the last bit of the offset: 1e-10; modes to a
    # thousandth of that
    "masses": (
        [1e3, 1.0, 1e-3, 1e-6],
        {"pitch of the light body": 3e-10, "ω² of all modes": 1e-12},
        {"pitch": (1.0, 1e-3)},
    ),
}
"""Of each row: values; limits of our errors by a part of the method's name; of others by their
beginnings, a value at which they are right (or None), and one from which on they are wrong
somewhere.

Where exactly a method breaks is the luck of rounding, which differs from one processor to the next,
so the two values lie well to either side of that.
"""


@pytest.mark.parametrize("name", atlas.ROWS)
def test_row(name):
    value, limits, broken = CASES[name]
    row = atlas.ROWS[name](np.array(value))
    for method in row.shipped:
        (limit,) = [limit for part, limit in limits.items() if part in method]
        allowed = limit(np.array(value)) if callable(limit) else limit
        assert (row.error[method] <= allowed).all(), f"{method}: {row.error[method]}"
    for beginning, (good, bad) in broken.items():
        (method,) = [other for other in row.others if other.startswith(beginning)]
        if good is not None:
            assert row.error[method][value.index(good)] < BROKEN, method
        assert row.error[method][value.index(bad) :].max() > BROKEN, method


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


def test_the_page_is_that_of_the_rows():
    """Every row stands in results/stability.md, with its title and its two sentences."""
    page = (ROOT / "results" / "stability.md").read_text()
    row = frequency.long_chain([1, 3])
    assert f"**{row.title}** ({row.quantity}). {row.finding}" in page
    assert page.count("\n| **") == len(atlas.ROWS)
    assert atlas.table_row(row).count("|") == atlas.HEAD.splitlines()[-1].count("|")
