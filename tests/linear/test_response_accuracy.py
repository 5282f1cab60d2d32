"""Responses against LU with pivoting in 80 bits, and near poles and zeros in 50 digits, from the
model's own numbers.

Errors are at most 1e-8 of each response, and of those below 1e-6 of what their body moves by (1 rad
counts as 1 m) 1e-14 of that: on resonance and off, from motions that a slow support hardly causes
to transmissions of 1e-40. Only within 1e-5 of a pole without loss is the condition of the problem
the yardstick.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.linalg import eigh

from suspension_cli.design.reader import read
from suspension_cli.linear import eigenmodes, response, signals
from suspension_cli.models import registry
from tests.support import plants, responses_80, responses_mp, scenes
from tests.support.golden import ROOT

EPS = 2.0**-53
REQUIRED = 1e-8
FAINT = 1e-6
FORBIDDEN = 1e-8
"""What rounding leaves, in the reference, of a response that a symmetry makes 0."""
MODELS = [("triple", "force"), ("quadruple", "string"), ("five", "string")]
CASES = [(kind, level, loss) for kind, level in MODELS for loss in (False, True)]
IDS = ["-".join((kind, level, "lossy" if loss else "lossless")) for kind, level, loss in CASES]
DESIGNS = (
    "tower",
    "reaction-chain",
    "cryogenic-payload",
    "eight-stages",
    "pulled-fibres",
    "quadruple",
    "ligo-quad-2005",
    "triple-tolerance",
)
FREQUENCY = {"string": np.array([1e-3, 0.031, 0.7, 8.3, 410.0])}
FREQUENCY["beam"] = FREQUENCY["string"][::2]
wide = pytest.mark.skipif(
    not responses_80.IS_WIDE, reason="numpy.longdouble is no wider than double here"
)


@cache
def system(name, level):
    return registry.by_name(level).system(read(ROOT / "configs" / f"{name}.toml").design)


def assert_promised(model, frequency, drives, acts):
    """All bodies' motions under drives (i, N), forces (`acts`, one each) or motions of the
    support."""
    bodies, size = len(model.body), model.size
    acts = np.array(acts)
    omega = 2 * np.pi * np.asarray(frequency)
    rows = np.eye(size)[6 : 6 * (bodies + 1)]
    found, _ = response.transfer(model, omega, drives, acts.tolist(), rows)
    moves, forces = np.where(acts, 0.0, drives[:, :6].T), np.where(acts, drives.T, 0.0)
    for w, values in zip(omega, found, strict=True):
        exact = responses_80.solve(model, w, moves, forces)[6 : 6 * (bodies + 1)]
        error, own = np.abs(values - exact).astype(float), np.abs(exact).astype(float)
        moved = own.reshape(bodies, 6, -1).max(1)
        if not acts.all() and w < 2 * np.pi:
            rigid = np.abs(model.rigid[6 : 6 * (bodies + 1)]).reshape(bodies, 6, 6).max(1)
            moved = np.maximum(moved, rigid @ np.abs(moves))
        moved = np.repeat(moved, 6, axis=0)
        limit = np.where(values == 0, FORBIDDEN * moved, REQUIRED * np.maximum(own, FAINT * moved))
        assert (error <= limit).all(), (w / (2 * np.pi), np.nanmax(error / limit))


def assert_exact(model, frequency):
    """The support's motions, and forces on both ends of the chain, one of them at a point."""
    first, last = model.body[0], model.body[-1]
    inputs = plants.moves(model) + plants.forces(model, first)
    inputs += plants.drives(model, f"{last}.force_x@0.01,-0.02,0.03", f"{last}.torque_yaw")
    drives = np.array([signals.linear_form(signal, model) for signal in inputs])
    assert_promised(model, frequency, drives, [signal.acts for signal in inputs])


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


@wide
@pytest.mark.parametrize(("kind", "level", "loss"), CASES, ids=IDS)
def test_at_any_frequency(kind, level, loss):
    """Slow, fast and at random; at the frequencies of `modes` and, of modes without loss, 1e-5 and
    1e-4 beside; where a part of a chain resonates alone, in which elimination from the mirror up
    meets a nearly singular part although the whole is far from any resonance."""
    model = plants.model(kind, level, loss=loss)
    rng = np.random.default_rng([11, CASES.index((kind, level, loss))])
    some = np.exp(np.append(rng.uniform(*np.log([0.01, 1e4])), rng.uniform(*np.log([0.3, 30]), 2)))
    found = eigenmodes.solve(model)
    lossless = np.array([not loss or q is None or not q < 1e12 for q in found.q])
    assert loss == (not lossless.all())
    modes = np.where(lossless, found.frequency * (1 + 1e-5), found.frequency)
    parts = held_resonances(model)[:: 4 + loss] * (1 + 1e-6)
    frequency = [[0.01, 1e4], some, modes[int(loss) :: 2], found.frequency[::5] * (1 - 1e-4)]
    if kind != "five":
        frequency += [parts, parts[::2] * (1 - 1e-5), parts[1::2] * (1 + 2e-3)]
    assert_exact(model, np.concatenate(frequency))


def body_motion(value, outputs):
    """Largest motion (f, o, i) of each output's body."""
    body = np.array([signal.body for signal in outputs])
    return np.stack([np.abs(value[:, body == name]).max(1) for name in body], axis=1)


def assert_close(compared, outputs):
    """The promise, against 50 digits."""
    size = np.abs(compared.exact)
    limit = REQUIRED * np.maximum(size, FAINT * body_motion(size, outputs))
    assert (np.where(size, compared.error * size, compared.error) <= limit).all()


@pytest.mark.parametrize(("kind", "level", "loss"), CASES, ids=IDS)
def test_each_input_alone(kind, level, loss):
    """One input at a time gives what all together give: close to poles, and where parts of the
    chain resonate alone."""
    model = plants.model(kind, level, loss=loss)
    inputs, outputs = plants.moves(model), plants.all_motions(model)
    inputs += plants.forces(model, model.body[0])
    beside = eigenmodes.solve(model).frequency * (1 + 1e-4)
    parts = held_resonances(model) * (1 + 1e-5) if kind != "five" else []
    frequency = np.concatenate([beside, parts, np.geomspace(0.01, 100, 30)])
    together = response.solve(model, frequency, inputs, outputs).value
    for n, signal in enumerate(inputs):
        alone = response.solve(model, frequency, [signal], outputs).value[..., 0]
        whole = together[..., n : n + 1]
        size = np.maximum(np.abs(whole), FAINT * body_motion(whole, outputs))[..., 0]
        assert (np.abs(alone - whole[..., 0]) <= 2 * REQUIRED * size).all()


@wide
@pytest.mark.parametrize("kind", ["quadruple", "five"])
def test_with_dampers(kind):
    model = plants.model(kind, "string", loss=True, damping=True)
    assert model.damping.any()
    assert_exact(model, [0.013, 0.7, *eigenmodes.solve(model).frequency[::5], 9e3])


@wide
def test_trees_without_symmetry():
    """Beyond the chains: a recoil mass beside the mirror, springs, 18 coordinates that all
    couple."""
    model = registry.STRING.system(scenes.design_of(scenes.crooked(np.random.default_rng(0))))
    assert len(model.blocks) == 1
    assert_exact(model, [0.01, 0.3, 17.0, 1e3])


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
    raw = plants.raw("quadruple") | {"perturbation": [imperfection]}
    model, frequency = registry.STRING.system(scenes.design_of(raw)), [0.01, 3.3, 221.65260329156]
    inputs = plants.drives(model, "support.yaw", "support.x")
    outputs = plants.all_motions(model)
    found = responses_mp.compare(model, frequency, inputs, outputs)
    assert_close(found, outputs)


@wide
@pytest.mark.parametrize("level", FREQUENCY)
@pytest.mark.parametrize("name", DESIGNS)
def test_motions_of_the_support_of_shipped_designs(name, level):
    model = system(name, level)
    assert_promised(model, FREQUENCY[level], np.eye(6, model.size), [False] * 6)


@wide
@pytest.mark.parametrize("level", FREQUENCY)
@pytest.mark.parametrize("name", ["reaction-chain", "eight-stages", "quadruple"])
def test_forces_on_shipped_designs(name, level):
    """On the last body of the chain and the first, and at 0 Hz, where the support is moved too."""
    model = system(name, level)
    last = 6 * len(model.body)
    drives = np.eye(model.size)[[*range(6, 12), *range(last, last + 6)]]
    assert_promised(model, [0.0, 0.01, 3.3, 100.0], drives, [True] * 12)
    if name != "reaction-chain":
        assert_promised(model, [0.0], np.eye(6, model.size), [False] * 6)


def test_nothing_lossy_is_real():
    """Without loss nothing is computed in complex numbers, so no imaginary part is left."""
    model = system("quadruple", "string").lossless
    omega = np.array([0.1, 10.0, 1000.0])
    found, _ = response.transfer(
        model, omega, np.eye(6, model.size), [False] * 6, np.eye(model.size)
    )
    assert found.any() and not np.imag(found).any()


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


def test_near_a_zero():
    """Where a response changes its sign, to the last bit of the frequency: what is left of its
    summands is known to a few roundings of them."""
    model = plants.model("quadruple", "string")
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
        assert compared.condition.max() > 1e10
        assert (compared.error < REQUIRED + 16 * EPS * compared.condition).all()
    assert found >= len(model.body) - 1


@pytest.mark.parametrize("massless", [False, True])
def test_on_a_support_that_gives_way(massless):
    """What the structure does, too: of a slow ground's motion it feels next to nothing."""
    raw = plants.raw("quadruple", loss=True)
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
    found = responses_mp.compare(model, np.array([0.01, 2.0, 1e3]), inputs, outputs)
    assert_close(found, outputs)
