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
from tests.support import plants, scenes

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
