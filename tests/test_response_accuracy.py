"""Responses against 50-digit arithmetic on the very same matrices.

The yardstick is what nobody can avoid: relative errors of one rounding (EPS) in each element of K, C and M change a response by up to
EPS times its condition (`exact.Compared`).  Every error must be within LIMIT roundings of that, for every pair of signals at any frequency.
In itself an error must be below 1e-12 wherever the condition allows it: it does not on a resonance of high Q, where a response is all but
zero (its summands cancel, so that they are what the error must be compared with), and for motions that a slow support hardly causes (roll from
support.y goes as the frequency squared, and the couplings that cancel in it do not).
"""

from __future__ import annotations

import exact
import numpy as np
import plants
import pytest
import scenes
from scipy.linalg import eigh

from suspension_cli.analysis import modes, response
from suspension_cli.conventions import DOFS
from suspension_cli.models import fidelity

EPS = 2.0**-53
LIMIT = 64
MODELS = [("triple", "force"), ("triple", "string"), ("quadruple", "force"), ("quadruple", "string"), ("five", "string")]
CASES = [(kind, level, loss) for kind, level in MODELS for loss in (False, True)]
IDS = ["-".join((kind, level, "lossy" if loss else "lossless")) for kind, level, loss in CASES]
CHAINS = [case for case in CASES if case[0] != "five"]


def signals_of(model):
    """Support motions, forces on both ends of the chain; motions of both ends, and of a point of the last."""
    first, last = model.body[0], model.body[-1]
    ends = dict.fromkeys((first, last))
    inputs = plants.moves(model) + [force for body in ends for force in plants.forces(model, body)]
    inputs += plants.drives(model, f"{last}.force_x@0.01,-0.02,0.03")
    points = plants.motions(model, f"{last}.x@0.01,0.02,-0.003", f"{first}.z@0.05,-0.1,0.01")
    return inputs, plants.all_motions(model, *ends) + points


def assert_exact(model, frequency, limit=LIMIT):
    """Errors within what the condition allows (where it leaves digits at all: it is of first order); returns the comparison."""
    inputs, outputs = signals_of(model)
    compared = exact.compare(model, frequency, inputs, outputs)
    assert ((compared.error <= limit * EPS * compared.condition) | (EPS * compared.condition > 1e-3)).all()
    return compared


def held_resonances(model):
    """Frequencies (Hz) of every part of a chain that hangs from a body held at rest."""
    owner = np.array([name.split(".")[0] for name in model.coordinate])
    found = []
    for n in range(1, len(model.body)):
        part = np.flatnonzero(np.isin(owner, model.body[n:]))
        kept, light = part[~model.massless[part]], part[model.massless[part]]
        stiffness = model.stiffness[np.ix_(kept, kept)]
        if len(light):
            across = model.stiffness[np.ix_(light, kept)]
            stiffness = stiffness - across.T @ np.linalg.solve(model.stiffness[np.ix_(light, light)], across)
        square = eigh((stiffness + stiffness.T) / 2, model.mass[np.ix_(kept, kept)], eigvals_only=True)
        found += (np.sqrt(square[square > 0]) / (2 * np.pi)).tolist()
    return np.unique(found)


@pytest.mark.parametrize(("kind", "level", "loss"), CASES, ids=IDS)
def test_from_slow_to_fast(kind, level, loss):
    model = plants.model(kind, level, loss=loss)
    frequency = np.geomspace(0.01, 1e4, 15)
    compared = assert_exact(model, frequency)
    assert compared.error[compared.condition < 500].max() < 1e-12
    off = np.abs(frequency[:, None] / modes.solve(model).frequency - 1).min(1) > 1e-3
    outputs = [signal.text for signal in signals_of(model)[1]]
    for dof in ("x", "y", "z", "yaw"):  # how a motion of the support arrives at the last body
        assert compared.error[off, outputs.index(f"{model.body[-1]}.{dof}"), DOFS.index(dof)].max() < 1e-12


@pytest.mark.parametrize("kind", ["triple", "quadruple", "five"])
def test_with_dampers(kind):
    model = plants.model(kind, "string", loss=True, damping=True)
    assert model.damping.any()
    assert_exact(model, np.concatenate([np.geomspace(0.013, 9e3, 8), modes.solve(model).frequency[::5]]))


@pytest.mark.parametrize("kind", ["triple", "quadruple", "five"])
@pytest.mark.parametrize("loss", [False, True], ids=["lossless", "lossy"])
def test_on_resonance(kind, loss):
    """At the frequencies that `modes` tells, where a lossless system has no digits but its lossy twin has all but those that Q takes."""
    model = plants.model(kind, "string", loss=loss)
    found = modes.solve(model)
    compared = assert_exact(model, found.frequency[::2] * (1.0 if loss else 1 + 1e-13))  # not on a pole to the last bit
    if loss:
        worst = compared.error.reshape(len(compared.error), -1).max(1)
        assert np.median(worst) < 1e-9
        assert compared.error[compared.condition < 500].max() < 1e-12


@pytest.mark.parametrize("kind", ["triple", "quadruple", "five"])
@pytest.mark.parametrize("offset", [1e-9, -1e-6])
def test_near_a_pole(kind, offset):
    """The closer to a lossless pole, the less the last digit of a spring constant lets us know.

    omega0^2 = v^T K v for a mode of unit modal mass.  Relative errors e of the elements of K move it by up to
    e |v|^T |K| |v| = e kappa omega0^2, those of M by e |v|^T |M| |v| omega0^2, of order e omega0^2.  Near the pole
    H = r / (omega0^2 - omega^2), so its relative error is e (kappa + 1) / (2 |f / f0 - 1|).
    """
    model = plants.model(kind, "string")
    found = modes.solve(model)
    inputs, outputs = plants.moves(model), plants.all_motions(model)
    which = slice(None, None, 3)
    compared = exact.compare(model, found.frequency[which] * (1 + offset), inputs, outputs)
    shape = np.abs(np.linalg.solve(model.basis, np.pad(found.shape, ((0, 0), (6, 0))).T).T)
    kappa = np.einsum("mi,ij,mj->m", shape, np.abs(model.stiffness), shape) / found.omega_squared
    kappa += np.einsum("mi,ij,mj->m", shape, np.abs(model.mass), shape)
    strong = np.abs(compared.exact) > np.abs(compared.exact).max((1, 2), keepdims=True) * 0.03  # where the pole has the greatest share
    derived = kappa[which, None, None] / (2 * abs(offset))
    assert np.abs(compared.condition / derived - 1)[strong].max() < 0.5
    assert (compared.error / derived)[strong].max() < 4 * EPS


@pytest.mark.parametrize(("kind", "level", "loss"), CHAINS, ids=IDS[: len(CHAINS)])
@pytest.mark.parametrize("offset", [0.0, 1e-10, -1e-5, 2e-3])
def test_where_a_part_resonates_by_itself(kind, level, loss, offset):
    """Elimination from the mirror up meets a nearly singular part here, although the whole is far from any resonance."""
    model = plants.model(kind, level, loss=loss)
    frequency = held_resonances(model) * (1 + offset)
    assert len(frequency) >= 12
    compared = assert_exact(model, frequency[:: len(frequency) // 6])
    assert compared.error[compared.condition < 500].max() < 1e-12


@pytest.mark.parametrize("kind", ["triple", "quadruple"])
def test_near_a_zero(kind):
    """Where a response vanishes its summands have all their digits: the error is a rounding of those, not of what is left."""
    model = plants.model(kind, "string")
    inputs, outputs = plants.drives(model, f"{model.body[0]}.force_x"), plants.motions(model, f"{model.body[0]}.x")
    grid = np.geomspace(0.1, 10, 4001)
    value = response.solve(model, grid, inputs, outputs).value[:, 0, 0].real
    turns = np.flatnonzero(np.sign(value[:-1]) != np.sign(value[1:]))
    found = 0
    for n in turns:
        low, high = grid[n], grid[n + 1]
        for _ in range(60):
            middle = (low + high) / 2
            same = response.solve(model, np.array([middle]), inputs, outputs).value[0, 0, 0].real * value[n] > 0
            low, high = (middle, high) if same else (low, middle)
        compared = exact.compare(model, [low, high], inputs, outputs)
        if np.abs(compared.exact).max() > np.abs(value[n]):  # a pole
            continue
        found += 1
        assert compared.condition.max() > 1e10
        error = (compared.error * np.abs(compared.exact)).max()
        assert error <= LIMIT * EPS * (compared.condition * np.abs(compared.exact)).max()
    assert found >= len(model.body) - 1


@pytest.mark.parametrize("seed", range(3))
def test_trees_without_symmetry(seed):
    """Beyond the chains: a recoil mass beside the mirror, springs, 18 coordinates that all couple.

    One factor more than LIMIT: LU with partial pivoting is stable against the largest elements, not against each by itself, and
    these systems mix them all.
    """
    model = fidelity.linear_model(scenes.design_of(scenes.crooked(np.random.default_rng(seed))), "string")
    assert len(model.blocks) == 1
    rng = np.random.default_rng([7, seed])
    compared = assert_exact(model, np.exp(rng.uniform(np.log(0.03), np.log(1e3), 4)), limit=8 * LIMIT)
    assert compared.error[compared.condition < 10].max() < 1e-12
