"""What refinements would change, estimated from the modes of the simplest model: against closed
forms and against the models themselves."""

from __future__ import annotations

import math

import numpy as np
import pytest

from suspension_cli.linear import eigenmodes
from suspension_cli.models import registry
from suspension_cli.models.estimates import Estimates
from suspension_cli.models.quantity_of_interest import Frequencies
from suspension_cli.models.violin import with_wire_mass
from tests.support import scenes

STEEL = {"youngs_modulus": 2e11, "poisson_ratio": 0.3, "density": 7800.0}


def pendulum(radius=1e-4, count=4, **wires):
    """A body of 4 kg on wires of half a metre at the height of its COM, far apart."""
    given = (
        {"count": count, "l": 0.5, "material": "plain", "radius": radius, "k": 1e6}
        | ({"s": 0.1, "t1": 0.1, "t2": 0.1} if count == 4 else {"d": 0.01})
        | wires
    )
    stage = {"name": "test", "body": {"mass": 4.0, "inertia": [0.02, 0.02, 0.02]}, "wires": given}
    return scenes.design_of(
        {"design": {"name": "one"}, "materials": {"plain": STEEL}, "stage": [stage]}
    )


def of(design, level="string"):
    found = eigenmodes.solve(registry.by_name(level).system(design))
    return found, Estimates(design, found)


def mode(found, dof):
    return next(n for n, home in enumerate(found.home) if home[1] == dof)


def test_swinging_wires_bend_by_u_over_l():
    """Both ends bend: the pendulum is shorter by 2 u; with 10 % for higher orders."""
    found, weighed = of(pendulum(d=0.0))
    tension = 9.81
    reach = math.sqrt(2e11 * math.pi * 1e-16 / 4 / tension)
    assert weighed.bending[mode(found, "y"), 0] == pytest.approx(
        1.1 * reach / (0.5 - 2 * reach), rel=2e-3
    )


def test_bending_points_leave_the_square():
    found, weighed = of(pendulum(d=0.0, clamp="bending-point"))
    reach = math.sqrt(2e11 * math.pi * 1e-16 / 4 / 9.81)
    assert weighed.bending[mode(found, "y"), 0] == pytest.approx(1.1 * (reach / 0.5) ** 2, rel=1e-3)


def test_mass_of_swinging_wires_is_a_third():
    found, weighed = of(pendulum(d=0.0))
    held = 4 * 7800 * math.pi * 1e-8 * 0.5
    assert weighed.mass[mode(found, "y"), 0] == pytest.approx(1.1 * held / 3 / 4.0 / 2, rel=2e-3)


def test_first_violin_mode():
    _, weighed = of(pendulum())
    assert weighed.violin[0] == pytest.approx(
        math.sqrt(9.81 / (7800 * math.pi * 1e-8)) / 2 / 0.5, rel=1e-12
    )


def test_a_body_free_to_spin_is_held_by_torsion_alone():
    found, weighed = of(pendulum(count=1))
    assert weighed.bending[mode(found, "yaw"), 0] == np.inf


def test_wires_of_unknown_material():
    raw = scenes.chain(np.random.default_rng(1), 2)
    _, weighed = of(scenes.design_of(raw))
    assert np.isnan(weighed.bending).all()
    assert np.isnan(weighed.mass).all()
    assert np.isnan(weighed.violin).all()


@pytest.mark.parametrize("effective", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_small_changes_are_estimated_within_a_factor_of_three(seed, effective):
    """Of the mode that changes most, against beams; and the mass of wires, against wires with
    mass."""
    rng = np.random.default_rng([91, seed])
    raw = scenes.fibred(scenes.chain(rng, 1 + seed % 4), float(10 ** rng.uniform(8.5, 9.5)))
    for stage in raw["stage"]:
        stage["wires"] |= {"clamp": "bending-point"} if effective else {}
    design = scenes.design_of(raw)
    string, beam, violin = (
        registry.by_name(level).system(design) for level in ("string", "beam", "violin")
    )
    weighed = Estimates(design, eigenmodes.solve(string))
    bending, mass = weighed.bending.sum(1).max(), weighed.mass.sum(1).max()
    requested = Frequencies()
    if bending < 0.03:
        assert 1 / 3.5 < requested.change(string, beam)[0] / bending < 3.5
    if mass < 0.03:
        assert 1 / 3.5 < requested.change(beam, violin)[0] / mass < 3.5


def test_light_models_gain_mass_without_being_built_anew():
    """What `auto` makes of a beam is the very model that is built for wires with mass."""
    design = pendulum()
    beam, violin = (registry.by_name(level).system(design) for level in ("beam", "violin"))
    for mine, theirs in zip(with_wire_mass(beam).terms, violin.terms, strict=True):
        omega = np.array([10.0, 1e3, 1e4])
        which = np.arange(len(mine.matrices))
        np.testing.assert_array_equal(
            mine.at(omega).functions(which), theirs.at(omega).functions(which)
        )
