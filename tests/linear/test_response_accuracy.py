"""Every response against 50-digit arithmetic with the model's own numbers.

Errors are at most 1e-8 of each response, or 1e-14 of what its body moves by (1 rad counts as 1 m)
where that is more: on resonance and off, from motions that a slow support hardly causes (1e-12 of
its own) to transmissions of 1e-40, and at frequencies drawn at random, some of which fall near a
zero. Only within 1e-5 of a pole without loss is the condition of the problem the yardstick.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import eigh

from suspension_cli.linear import eigenmodes, response
from suspension_cli.models import registry
from tests.support import plants, responses_mp, scenes

EPS = 2.0**-53
REQUIRED = 1e-8
FAINT = 1e-6
MODELS = [
    ("triple", "force"),
    ("quadruple", "string"),
    ("five", "string"),
]
CASES = [(kind, level, loss) for kind, level in MODELS for loss in (False, True)]
IDS = ["-".join((kind, level, "lossy" if loss else "lossless")) for kind, level, loss in CASES]
BESIDE = [1e-4, -1e-5]
CHAINS = [case for case in CASES if case[0] != "five"]


def signals_of(model):
    """Support motions, forces on both ends of the chain; motions of all bodies, and of points of
    both ends."""
    first, last = model.body[0], model.body[-1]
    ends = dict.fromkeys((first, last))
    inputs = plants.moves(model) + [force for body in ends for force in plants.forces(model, body)]
    inputs += plants.drives(model, f"{last}.force_x@0.01,-0.02,0.03")
    points = plants.motions(model, f"{last}.x@0.01,0.02,-0.003", f"{first}.z@0.05,-0.1,0.01")
    return inputs, plants.all_motions(model) + points


def body_motion(value, outputs):
    """Largest motion (f, o, i) of each output's body."""
    body = np.array([signal.body for signal in outputs])
    return np.stack([np.abs(value[:, body == name]).max(1) for name in body], axis=1)


def assert_promised(compared, outputs, required=REQUIRED):
    size = np.abs(compared.exact)
    limit = required * np.maximum(size, FAINT * body_motion(size, outputs))
    assert (np.where(size, compared.error * size, compared.error) <= limit).all()


def assert_exact(model, frequency):
    """All pairs of signals: half of the inputs at one half of the frequencies, the others at the
    other."""
    inputs, outputs = signals_of(model)
    for n in range(2):
        if len(frequency[n::2]):
            found = responses_mp.compare(model, frequency[n::2], inputs[n::2], outputs)
            assert_promised(found, outputs)


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


@pytest.mark.parametrize(("kind", "level", "loss"), CASES, ids=IDS)
def test_from_slow_to_fast(kind, level, loss):
    assert_exact(plants.model(kind, level, loss=loss), np.array([0.01, 1e4]))


@pytest.mark.parametrize(("kind", "level", "loss"), CASES, ids=IDS)
def test_at_random(kind, level, loss):
    """Most of them among the modes, where zeros are; others for each model."""
    rng = np.random.default_rng([11, CASES.index((kind, level, loss))])
    frequency = np.exp(
        np.concatenate(
            [rng.uniform(np.log(0.01), np.log(1e4), 1), rng.uniform(np.log(0.3), np.log(30.0), 2)]
        )
    )
    assert_exact(plants.model(kind, level, loss=loss), frequency)


@pytest.mark.parametrize(("kind", "level", "loss"), CASES, ids=IDS)
def test_each_input_alone(kind, level, loss):
    """One input at a time gives what all together give: close to poles, and where parts of the
    chain resonate alone."""
    model = plants.model(kind, level, loss=loss)
    inputs, outputs = signals_of(model)
    beside = eigenmodes.solve(model).frequency * (1 + 1e-4)
    parts = held_resonances(model) * (1 + 1e-5) if kind != "five" else []
    frequency = np.concatenate([beside, parts, np.geomspace(0.01, 100, 30)])
    together = response.solve(model, frequency, inputs, outputs).value
    for n, signal in enumerate(inputs):
        alone = response.solve(model, frequency, [signal], outputs).value[..., 0]
        whole = together[..., n : n + 1]
        size = np.maximum(np.abs(whole), FAINT * body_motion(whole, outputs))[..., 0]
        assert (np.abs(alone - whole[..., 0]) <= 2 * REQUIRED * size).all()


@pytest.mark.parametrize(("kind", "level", "loss"), CASES, ids=IDS)
def test_on_resonance(kind, level, loss):
    """Exactly at the frequencies of `modes`; of modes without loss, 1e-5 beside them.

    Every second mode of a design, and of its twin with or without losses the others.
    """
    model = plants.model(kind, level, loss=loss)
    found = eigenmodes.solve(model)
    lossless = np.array(
        [True] * len(found.q) if not loss else [q is None or not q < 1e12 for q in found.q]
    )
    assert loss == (not lossless.all())
    frequency = np.where(lossless, found.frequency * (1 + 1e-5), found.frequency)
    assert_exact(model, frequency[int(loss) :: 2])


@pytest.mark.parametrize("kind", ["quadruple", "five"])
@pytest.mark.parametrize("offset", BESIDE)
def test_beside_a_resonance(kind, offset):
    """Modes at one distance, and others at another."""
    model = plants.model(kind, "string")
    assert_exact(model, eigenmodes.solve(model).frequency[BESIDE.index(offset) :: 5] * (1 + offset))


@pytest.mark.parametrize("kind", ["quadruple", "five"])
def test_with_dampers(kind):
    model = plants.model(kind, "string", loss=True, damping=True)
    assert model.damping.any()
    assert_exact(
        model, np.concatenate([np.geomspace(0.013, 9e3, 5), eigenmodes.solve(model).frequency[::5]])
    )


@pytest.mark.parametrize("kind", ["quadruple", "five"])
@pytest.mark.parametrize("offset", [1e-9, -1e-10])
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


@pytest.mark.parametrize(("kind", "level", "loss"), CHAINS, ids=IDS[: len(CHAINS)])
@pytest.mark.parametrize("offset", [0.0, -1e-5, 2e-3])
def test_where_a_part_resonates_alone(kind, level, loss, offset):
    """Elimination from the mirror up meets a nearly singular part here, although the whole is far
    from any resonance."""
    model = plants.model(kind, level, loss=loss)
    frequency = held_resonances(model) * (1 + offset)
    assert len(frequency) >= 12
    first = len(frequency) // 6 * (offset < 0)
    assert_exact(model, frequency[first :: len(frequency) // 2])


@pytest.mark.parametrize("loss", [False, True], ids=["lossless", "lossy"])
@pytest.mark.parametrize("kind", ["quadruple"])
def test_near_a_zero(kind, loss):
    """Where a response changes its sign, to the last bit of the frequency: what is left of its
    summands is known to a few roundings of them."""
    model = plants.model(kind, "string", loss=loss)
    inputs, outputs = (
        plants.drives(model, f"{model.body[0]}.force_x"),
        plants.motions(model, f"{model.body[0]}.x"),
    )
    grid = np.geomspace(0.1, 10, 1001)
    value = response.solve(model, grid, inputs, outputs).value[:, 0, 0].real
    turns = np.flatnonzero(np.sign(value[:-1]) != np.sign(value[1:]))
    poles, found = eigenmodes.solve(model).frequency, 0
    for n in turns:
        low, high = grid[n], grid[n + 1]
        # where it changes its sign too, and may be infinite
        if ((poles > low) & (poles < high)).any():
            continue
        for _ in range(9):
            points = np.linspace(low, high, 101)
            same = response.solve(model, points, inputs, outputs).value[:, 0, 0].real * value[n] > 0
            last = int(np.flatnonzero(same)[-1])
            low, high = points[last], points[min(last + 1, 100)]
        compared = responses_mp.compare(model, [low, high], inputs, outputs, condition=True)
        found += 1
        assert loss or compared.condition.max() > 1e10
        assert (compared.error < REQUIRED + 16 * EPS * compared.condition).all()
    assert found >= len(model.body) - 1


@pytest.mark.parametrize("seed", range(1))
def test_trees_without_symmetry(seed):
    """Beyond the chains: a recoil mass beside the mirror, springs, 18 coordinates that all
    couple."""
    model = registry.STRING.system(scenes.design_of(scenes.crooked(np.random.default_rng(seed))))
    assert len(model.blocks) == 1
    rng = np.random.default_rng([7, seed])
    assert_exact(model, np.append(np.exp(rng.uniform(np.log(0.01), np.log(1e4), 3)), 0.01))


@pytest.mark.parametrize(("kind", "level", "loss"), CASES, ids=IDS)
def test_one_input_at_a_time(kind, level, loss):
    """Among the modes, and where a part resonates alone; every second frequency for a design, the
    others for its twin without losses."""
    model = plants.model(kind, level, loss=loss)
    rng = np.random.default_rng(13)
    parts = held_resonances(model) if len(model.body) > 1 else np.zeros(0)
    frequency = np.concatenate(
        [
            np.exp(rng.uniform(np.log(0.3), np.log(30.0), 2)),
            parts[::10] * (1 + 1e-6),
            parts[1::10] * (1 + 1e-4),
            [0.01, 1e3],
        ]
    )
    inputs, outputs = signals_of(model)
    found = responses_mp.compare(model, frequency[int(loss) :: 2], inputs, outputs, alone=True)
    assert_promised(found, outputs)


@pytest.mark.parametrize("kind", ["quadruple"])
@pytest.mark.parametrize("massless", [False, True])
def test_on_a_support_that_gives_way(kind, massless):
    """What the structure does, too: of a slow ground's motion it feels next to nothing."""
    raw = plants.raw(kind, loss=True)
    raw["support"] = {
        "stiffness": {"x": 2e6, "z": 5e6, "pitch": 3e5, "yaw": 4e5},
        "loss_angle": 1e-3,
    }
    if not massless:
        raw["support"] |= {"mass": 300.0, "inertia": [20.0, 30.0, 40.0]}
    model = registry.STRING.system(scenes.design_of(raw))
    inputs = plants.moves(model) + plants.drives(
        model, "frame.force_x", "frame.torque_yaw", f"{model.body[-1]}.force_z"
    )
    outputs = plants.all_motions(model, model.body[0], model.body[-1]) + plants.motions(
        model, "frame.x", "frame.z", "frame.pitch", "frame.yaw"
    )
    found = responses_mp.compare(model, np.geomspace(0.01, 1e3, 9), inputs, outputs)
    assert_promised(found, outputs)


@pytest.mark.parametrize(
    "imperfection",
    [
        {"wire": "test.1", "k_factor": 1.2, "upper_offset": [1e-3, 0.0, 0.0]},
        {"wire": "penultimate.1", "lower_offset": [1e-3, 0.0, 0.0]},
        {"wire": "top.1", "upper_offset": [0.0, 0.0, 1e-3]},
    ],
)
def test_couplings_of_an_imperfect_wire(imperfection):
    """Far above and far below the modes."""
    raw = plants.raw("quadruple")
    raw["perturbation"] = [imperfection]
    model = registry.STRING.system(scenes.design_of(raw))
    frequency, outputs = [0.01, 3.3, 221.65260329156], plants.all_motions(model)
    inputs = plants.drives(model, "support.yaw", "support.x")
    assert_promised(responses_mp.compare(model, frequency, inputs, outputs), outputs)
