"""Responses in 50 digits from the model's own numbers.

Errors are at most 1e-8 of each response, and of those below 1e-6 of what their body moves by (1 rad
counts as 1 m) 1e-14 of that: on resonance and off, from motions that a slow support hardly causes
to transmissions of 1e-40. Only within 1e-5 of a pole without loss is the condition of the problem
the yardstick.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import eigh

from suspension_cli.design.reader import read
from suspension_cli.linear import eigenmodes
from suspension_cli.linear.structure import Structure
from suspension_cli.models import registry
from tests.support import plants, responses_mp, scenes
from tests.support.paths import CONFIGS

EPS = 2.0**-53
REQUIRED, FAINT = 1e-8, 1e-6
SHIPPED = (
    "tower",
    "reaction-chain",
    "cryogenic-payload",
    "eight-stages",
    "pulled-fibres",
    "quadruple",
    "ligo-quad-2005",
    "triple-tolerance",
)
STRUCTURE = {"stiffness": {"x": 2e6, "z": 5e6, "pitch": 3e5, "yaw": 4e5}, "loss_angle": 1e-3}


def with_tables(**tables):
    """The quadruple with losses and further tables."""
    raw = plants.raw("quadruple", loss=True) | tables
    return registry.STRING.system(scenes.design_of(raw))


def with_imperfection(**item):
    raw = plants.raw("quadruple") | {"perturbation": [item]}
    return registry.STRING.system(scenes.design_of(raw))


def tree():
    """A recoil mass beside the mirror, springs, 18 coordinates that all couple."""
    model = registry.STRING.system(scenes.design_of(scenes.crooked(np.random.default_rng(0))))
    assert len(Structure(model).blocks) == 1
    return model


CASES = {
    f"{kind} {level} {'lossy' if loss else 'lossless'}": lambda kind=kind, level=level, loss=loss: (
        plants.model(kind, level, loss=loss)
    )
    for kind, level in (("triple", "force"), ("quadruple", "string"), ("five", "string"))
    for loss in (False, True)
} | {
    "dampers": lambda: plants.model("quadruple", loss=True, damping=True),
    "dampers without symmetry": lambda: plants.model("five", loss=True, damping=True),
    "tree": tree,
    "stiffer wire": lambda: with_imperfection(
        wire="test.1", k_factor=1.2, upper_offset=[1e-3, 0.0, 0.0]
    ),
    "shifted wire": lambda: with_imperfection(wire="penultimate.1", lower_offset=[1e-3, 0.0, 0.0]),
    "higher wire": lambda: with_imperfection(wire="top.1", upper_offset=[0.0, 0.0, 1e-3]),
    "structure": lambda: with_tables(
        support=STRUCTURE | {"mass": 300.0, "inertia": [20.0, 30.0, 40.0]}
    ),
    "massless structure": lambda: with_tables(support=STRUCTURE),
}


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
            stiffness = stiffness - across.T @ np.linalg.solve(
                model.stiffness[np.ix_(light, light)], across
            )
        square = eigh(
            (stiffness + stiffness.T) / 2, model.mass[np.ix_(kept, kept)], eigvals_only=True
        )
        found += (np.sqrt(square[square > 0]) / (2 * np.pi)).tolist()
    return np.unique(found)


def forces(model):
    """On both ends of the chain, one of them at a point."""
    first, last = model.body[0], model.body[-1]
    others = plants.drives(model, f"{last}.force_x@0.01,-0.02,0.03", f"{last}.torque_yaw")
    return plants.forces(model, first) + others


def assert_promised(model, frequency, inputs):
    """All bodies' motions; rounding is allowed in the reference where a symmetry makes them 0."""
    compared = responses_mp.compare(model, frequency, inputs, plants.all_motions(model))
    size, bodies = np.abs(compared.exact), len(model.body)
    moved = np.repeat(size.reshape(len(size), bodies, 6, -1).max(2), 6, axis=1)
    limit = REQUIRED * np.maximum(size, np.where(compared.error == 1, 1.0, FAINT) * moved)
    error = np.where(size > 0, compared.error * size, compared.error)
    assert (error <= limit).all(), np.max(error / np.where(limit > 0, limit, 1.0))


@pytest.mark.parametrize("name", CASES)
def test_at_any_frequency(name):
    """Slow, fast and at random; at the frequencies of `modes` and, of modes without loss, 1e-5
    beside; where a part of a chain resonates alone, in which elimination from the mirror up meets
    a nearly singular part although the whole is far from any resonance."""
    model = CASES[name]()
    rng = np.random.default_rng([11, list(CASES).index(name)])
    some = np.exp([rng.uniform(*np.log([0.01, 1e4])), *rng.uniform(*np.log([0.3, 30]), 2)])
    found = eigenmodes.solve(model)
    modes = np.where(found.q > 1e12, found.frequency * (1 + 1e-5), found.frequency)
    frequency = [[0.01, 221.65260329156, 1e4], some, modes[1::4]]
    if not name.startswith(("five", "tree")):
        parts = held_resonances(model)[::8]
        frequency += [parts * (1 + 1e-6), parts[1::2] * (1 + 2e-3)]
    if name.endswith("wire"):  # other inputs lead to what the last digits of K leave
        assert_promised(model, frequency[0], plants.drives(model, "support.x", "support.yaw"))
        return
    assert_promised(model, np.concatenate(frequency), plants.moves(model) + forces(model))
    assert_promised(model, [0.0], forces(model))


@pytest.mark.parametrize(
    ("level", "frequency"), [("string", [1e-3, 0.7, 410.0]), ("beam", [1e-3, 8.3])]
)
@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_designs(name, level, frequency):
    model = registry.by_name(level).system(read(CONFIGS / f"{name}.toml").design)
    assert_promised(model, frequency, plants.moves(model))
    assert_promised(model, [0.01, *frequency[1:]], forces(model))


@pytest.mark.parametrize(("kind", "offset"), [("quadruple", 1e-9), ("five", -1e-10)])
def test_near_a_pole(kind, offset):
    """The closer to a lossless pole, the less the last digit of a spring constant lets us know.

    omega0^2 = v^T K v for a mode of unit modal mass. Relative errors e of the elements of K move it
    by up to e |v|^T |K| |v| = e kappa omega0^2, those of M by e |v|^T |M| |v| omega0^2, of order e
    omega0^2. Near the pole H = r / (omega0^2 - omega^2), so its relative error is e (kappa + 1) /
    (2 |f / f0 - 1|).
    """
    model = plants.model(kind, "string")
    found = eigenmodes.solve(model)
    inputs, outputs = plants.moves(model), plants.all_motions(model)
    which = slice(None, None, 3)
    compared = responses_mp.compare(
        model, found.frequency[which] * (1 + offset), inputs, outputs, condition=True
    )
    shape = np.abs(np.linalg.solve(model.basis, np.pad(found.shape, ((0, 0), (6, 0))).T).T)
    kappa = np.einsum("mi,ij,mj->m", shape, np.abs(model.stiffness), shape) / found.omega_squared
    kappa += np.einsum("mi,ij,mj->m", shape, np.abs(model.mass), shape)
    # where the pole has the greatest share
    strong = np.abs(compared.exact) > np.abs(compared.exact).max((1, 2), keepdims=True) * 0.03
    derived = kappa[which, None, None] / (2 * abs(offset))
    assert np.abs(compared.condition / derived - 1)[strong].max() < 0.5
    assert (compared.error / derived)[strong].max() < 16 * EPS
