"""Terms in frequency: a term with states of its own, and each term against its matrices."""

import gc
import weakref
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.linear import damped, response, statespace
from suspension_cli.linear.coordinates import AddedCoordinates
from suspension_cli.linear.matrix_terms import (
    Damper,
    MatrixTerm,
    StiffnessTable,
    StructuralLoss,
)
from suspension_cli.linear.solver import Solver
from suspension_cli.linear.terms import TermWithStates, quadratic_form
from tests.support import plants

RATE = 30.0
"""Of relaxation, rad/s."""
STRENGTH = 40.0
"""Stiffness of the relaxing spring, N/m."""


@dataclass(frozen=True)
class Relaxation(MatrixTerm, TermWithStates):
    """A spring in series with a dashpot, whose deflection is a state: k i omega / (i omega + r)."""

    is_viscous: ClassVar[bool] = True

    def _lag(self, omega):
        return omega / (1j * omega + RATE)

    @property
    def motion_name(self):
        return "test.light"

    def states(self):
        row = self.matrix[np.argmax(np.diag(self.matrix))] / np.sqrt(self.matrix.max())
        stiffness = np.block([[self.matrix, -row[:, None]], [-row, np.eye(1)]])
        damping = np.diag([*np.zeros(len(self.matrix)), 1 / RATE])
        return AddedCoordinates(
            ("relaxed.1",), ("sqrt(J)",), ("s sqrt(J)",), 0 * damping, stiffness, damping
        )

    def inertia(self, omega, motion):
        raise NotImplementedError


@pytest.fixture
def relaxed():
    """A pendulum whose motion along x is also resisted by a relaxing spring."""
    model = plants.model("single")
    x = model.index("test", "x")
    matrix = np.zeros((model.size, model.size))
    matrix[x, x] = STRENGTH
    return replace(model, terms=(*model.terms, Relaxation("relaxation", 290.0, matrix)))


def test_states_replace_a_term(relaxed):
    frequency = np.geomspace(0.05, 50.0, 40)
    ends = plants.drives(relaxed, "support.x"), plants.motions(relaxed, "test.x")
    alone = statespace.with_states(relaxed)
    expected = response.solve(relaxed, frequency, *ends).value
    np.testing.assert_allclose(response.solve(alone, frequency, *ends).value, expected, rtol=1e-10)
    plain = replace(relaxed, terms=())
    assert np.abs(response.solve(plain, frequency, *ends).value / expected - 1).max() > 0.1


def test_states_have_names_and_units(relaxed):
    ends = plants.drives(relaxed, "support.x"), plants.motions(relaxed, "test.x")
    system = statespace.build(relaxed, *ends)
    units = dict(zip(system.state, system.state_unit, strict=True))
    assert units["relaxed.1 momentum"] == "s sqrt(J)"
    assert units["test.x"] == "m" and units["test.x rate"] == "m/s"


def test_poles_are_those_of_the_state_space(relaxed):
    modes = damped.solve(relaxed)
    ends = plants.drives(relaxed, "support.x"), plants.motions(relaxed, "test.x")
    poles = np.linalg.eigvals(statespace.build(relaxed, *ends).a)
    for n in np.flatnonzero((modes.energy[:, 0, 0] > 0.01) & (modes.omega_squared > 0)):
        sigma = -modes.decay_rate[n]
        pole = sigma + 1j * np.sqrt(modes.omega_squared[n] - sigma**2)
        assert np.abs(poles - pole).min() < 1e-9 * abs(pole)
    assert (modes.decay_rate > 0.1).any()


OMEGA = np.array([0.5, 20.0])


@pytest.mark.parametrize(
    ("term", "function"),
    [
        (StructuralLoss("a", 290.0, np.eye(2), lambda w: 1e-3 * w), 1e-3j * OMEGA),
        (Damper("a", 290.0, np.eye(2)), 1j * OMEGA),
        (
            StiffnessTable("a", 290.0, np.eye(2), lambda w: 1e-3 * w, lambda w: w / 10),
            (0.1 + 1e-3j) * OMEGA,
        ),
    ],
)
def test_functions(term, function):
    (found,) = term.at(OMEGA).functions(np.array([0]))
    np.testing.assert_array_equal(found, function)
    motion = np.array([[1.0, 2.0], [0.0, 1.0]])
    ((key, lost),) = term.at(OMEGA).dissipated(term.within(np.arange(2)), motion).items()
    assert key == ("a", 290.0)
    np.testing.assert_allclose(lost, function.imag * (motion**2).sum(0))
    (none,) = term.at(OMEGA, lossy=False).functions(np.array([0]))
    np.testing.assert_array_equal(none.real, function.real)
    assert not none.imag.any()


def test_a_solver_is_freed_without_the_garbage_collector():
    gc.collect()
    gc.disable()
    try:
        solver = Solver(replace(plants.model("triple", "beam")))
        ends = plants.drives(solver.system, "support.x"), plants.motions(solver.system, "test.x")
        response.solve(solver, np.array([0.1, 10.0]), *ends)
        assert len(solver.modes.frequency)
        gone = weakref.ref(solver), weakref.ref(solver.system)
        del solver
        assert [one() for one in gone] == [None, None]
    finally:
        gc.enable()


def test_a_form_is_not_negative_by_rounding_alone():
    """A spring between points that move alike, of a rounded matrix; and one that gives power."""
    rounded = np.array([[1.0, -1.0], [-1.0, 1.0 - 2.0**-53]])
    motion = np.array([[1.0, 1.0], [1.0, -1.0]])
    np.testing.assert_array_equal(quadratic_form(rounded, motion), [0.0, 4.0])
    active = np.array([[1.0, 0.0], [0.0, -1e-3]])
    np.testing.assert_array_equal(quadratic_form(active, motion[:, :1]), [1.0 - 1e-3])
    np.testing.assert_array_equal(quadratic_form(active, np.array([[0.0], [1.0]])), [-1e-3])


def test_rounding_of_a_tower_gives_no_power_back():
    """Near 1.64 Hz springs of a keystone lose less than rounding errors of what they store."""
    design = sus.example("built/kagra-typea")
    found = sus.thermal(design, frequency=np.geomspace(0.1, 1000, 3000)[900:925])
    assert (found.amplitude > 0).all()
