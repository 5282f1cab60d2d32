"""What responses must do whatever the numbers: reciprocity, rigid motion, power laws, hand
formulas."""

from __future__ import annotations

import numpy as np
import pytest

from suspension_cli.design.derive import com_positions
from suspension_cli.errors import InputError
from suspension_cli.linear import eigenmodes, response
from suspension_cli.models import registry
from suspension_cli.rotations import cross_matrix
from tests.support import paper, plants, responses_mp, scenes

MODELS = [
    ("triple", "force"),
    ("triple", "string"),
    ("quadruple", "force"),
    ("quadruple", "string"),
    ("five", "string"),
]


def solved(model, frequency, inputs, outputs):
    return response.solve(
        model, np.atleast_1d(np.asarray(frequency, dtype=float)), inputs, outputs
    ).value


def every_force(model):
    return [force for body in model.body for force in plants.forces(model, body)]


def away_from(model, frequency, apart=1e-3):
    """Those frequencies that are no resonance."""
    return frequency[
        np.abs(frequency[:, None] / eigenmodes.solve(model).frequency - 1).min(1) > apart
    ]


@pytest.mark.parametrize("loss", [False, True], ids=["lossless", "lossy"])
@pytest.mark.parametrize(("kind", "level"), MODELS)
def test_reciprocity(kind, level, loss):
    """Force i moves j as force j moves i: matrices are symmetric, complex or not."""
    model = plants.model(kind, level, loss=loss, damping=loss)
    frequency = away_from(model, np.geomspace(0.02, 2e3, 40))
    value = solved(model, frequency, every_force(model), plants.all_motions(model))
    own = np.sqrt(np.abs(np.einsum("fii->fi", value)))
    apart = np.abs(value - np.swapaxes(value, 1, 2))
    assert (apart <= 1e-12 * own[:, :, None] * own[:, None, :]).all()
    assert np.median(apart[value != 0] / np.abs(value[value != 0])) < 1e-14
    assert np.array_equal(value == 0, np.swapaxes(value, 1, 2) == 0)


@pytest.mark.parametrize(("kind", "level"), [case for case in MODELS if case[0] != "five"])
def test_a_moving_support_is_a_leaning_and_accelerating_world(kind, level):
    """Seen from the support the bodies feel -m a, and, where it rolls or pitches, gravity at an
    angle.

    x = R s + G (omega^2 M R s + m g (pitch along x, -roll along y)): nothing but rigid geometry and
    responses to forces.
    """
    model, positions = plants.model(kind, level), com_positions(plants.design(kind))
    rigid = np.zeros((model.size, 6))
    for n, body in enumerate(("support", *model.body)):
        rigid[6 * n : 6 * n + 6] = np.eye(6)
        rigid[6 * n : 6 * n + 3, 3:] = -cross_matrix(np.array(positions[body]))
    frequency = away_from(model, np.append(0.0, np.geomspace(0.01, 3.0, 25)), 1e-2)
    outputs = plants.all_motions(model)
    last = 6 * (len(model.body) + 1)
    weight = np.zeros((model.size, 6))
    weight[6:last:6, 4], weight[7:last:6, 3] = (
        sign * 9.81 * np.diag(model.mass)[6:last:6] for sign in (1, -1)
    )
    load = weight + (2 * np.pi * frequency[:, None, None]) ** 2 * (model.mass @ rigid)
    found = rigid[6:last] + solved(model, frequency, every_force(model), outputs) @ load[:, 6:last]
    expected = solved(model, frequency, plants.moves(model), outputs)
    size = np.abs(expected).max(0)
    assert (
        np.abs(found - expected) <= 1e-10 * np.where(size == 0, 1.0, np.maximum(size, 1e-3))
    ).all()


@pytest.mark.parametrize("level", ["force", "string"])
@pytest.mark.parametrize("stages", [1, 3])
@pytest.mark.parametrize("dof", ["x", "z"])
def test_every_stage_isolates_as_frequency_squared(stages, dof, level):
    """Equal stages on four leaning wires."""
    one = scenes.stage(np.random.default_rng(5), "mass")
    one["wires"] = {"count": 4, "l": 0.4, "s": 0.03, "t1": 0.08, "t2": 0.1, "k": 3e4}
    one["wires"] |= {"d": 0.002, "d_upper": 0.001}
    chain = scenes.raw_of(*(one | {"name": f"mass{n}"} for n in range(1, stages + 1)))
    model = registry.by_name(level).system(scenes.design_of(chain))
    frequency = np.geomspace(200, 2000, 20) * eigenmodes.solve(model).frequency.max()
    drive = plants.drives(model, f"support.{dof}")
    motion = plants.motions(model, f"mass{stages}.{dof}")
    answer = response.solve(model, frequency, drive, motion)
    assert answer.blocks == 1
    slope = np.gradient(np.log(np.abs(answer.value[:, 0, 0])), np.log(frequency))
    assert np.abs(slope + 2 * stages).max() < 1e-3


@pytest.mark.parametrize("level", ["force", "string"])
def test_single_pendulum_by_hand(level):
    """On one wire through its COM: g / l, with a damper c against the support, (g / l + i w c / m)
    / (g / l - w^2 + i w c / m)."""
    mass, length, c = 3.0, 0.7, 0.4
    stage = scenes.hung({"count": 1, "l": length, "k": 1e5}, mass, 0.1, damping={"x": c})
    model = registry.by_name(level).system(scenes.design_of(scenes.raw_of(stage)))
    frequency = np.geomspace(1e-3, 1e3, 500)
    s = 2j * np.pi * frequency
    by_support, by_force = solved(
        model,
        frequency,
        plants.drives(model, "support.x", "test.force_x"),
        plants.motions(model, "test.x"),
    )[:, 0].T
    below = 9.81 / length + s**2 + s * c / mass
    np.testing.assert_allclose(by_support, (9.81 / length + s * c / mass) / below, rtol=1e-12)
    np.testing.assert_allclose(by_force, 1 / mass / below, rtol=1e-12)


def test_points_move_with_their_body():
    """x + t x p at a point, a force there with its torque about the COM."""
    model = plants.model("five")
    point = np.array([0.03, -0.02, 0.05])
    turned = model.orientation[1] @ point
    at = "@" + ",".join(map(str, point))
    frequency = np.array([0.3, 3.0])
    whole = solved(model, frequency, plants.forces(model, "test"), plants.all_motions(model))
    lever = np.hstack([np.eye(3), -cross_matrix(turned)])
    found = solved(
        model,
        frequency,
        plants.drives(model, *(f"test.force_{d}{at}" for d in "xyz")),
        plants.motions(model, *(f"test.{d}{at}" for d in "xyz")),
    )
    np.testing.assert_allclose(found, lever @ whole @ lever.T, rtol=1e-11)


@pytest.mark.parametrize("case", paper.TABLE_1)
def test_models_agree(case):
    """The paper's single pendulums: closed forms, force model and strings share no code.

    Where the support hardly causes a motion (roll from y, slowly), roundings of the elements of K
    are what is left of it: see `exact`. Where it causes none, but no symmetry says so (roll from
    roll, with the wires' upper ends in one line), a model may keep a rounding.
    """
    design = scenes.design_of(paper.table_1(case))
    models = [
        registry.by_name(level).system(design) for level in ("closed-form", "force", "string")
    ]
    frequency = away_from(models[0], np.geomspace(0.05, 1e4, 40), 0.02)
    inputs, outputs = (
        plants.moves(models[0]) + plants.forces(models[0], "test"),
        plants.all_motions(models[0]),
    )
    answers = [solved(model, frequency, inputs, outputs) for model in models]
    none = np.any([(answer == 0).all(0) for answer in answers], axis=0)
    assert max(np.abs(answer[:, none]).max() for answer in answers) < 1e-13
    compared = responses_mp.compare(models[0], frequency, inputs, outputs, condition=True)
    for answer in answers:
        error = np.where(
            none, 0.0, np.abs(answer - compared.exact) / np.where(none, 1.0, np.abs(compared.exact))
        )
        assert (error <= np.maximum(1e-12, 2.0**-52 * compared.condition)).all()


def test_on_a_lossless_pole_it_is_refused():
    stage = scenes.hung({"count": 1, "l": 0.5, "k": 100.0}, 1.0, 0.1)
    model = registry.FORCE.system(scenes.design_of(scenes.raw_of(stage)))
    (pole,) = eigenmodes.solve(model).of("z")
    vertical = plants.drives(model, "support.z"), plants.motions(model, "test.z")
    free = plants.drives(model, "test.torque_yaw"), plants.motions(model, "test.yaw")
    for frequency, signals in (([1.0, pole], vertical), (0.0, free)):
        with pytest.raises(InputError, match="resonance without loss"):
            solved(model, frequency, *signals)
    assert np.isfinite(solved(model, pole * (1 + 1e-12), *vertical)).all()
