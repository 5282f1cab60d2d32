"""A support structure that gives way, and dampers between bodies: hand formulas and what must not
change."""

from __future__ import annotations

import numpy as np
import pytest

from suspension_cli.conventions import DOFS
from suspension_cli.design.derive import com_positions
from suspension_cli.errors import InputError
from suspension_cli.linear import response
from suspension_cli.models import registry
from suspension_cli.rotations import cross_matrix
from tests.support import plants, scenes

LEVELS = ("force", "string")
MASS, K, FRAME = 4.0, 2.5e3, 7e3


def solved(model, frequency, inputs, outputs):
    answer = response.solve(
        model,
        np.atleast_1d(np.asarray(frequency, dtype=float)),
        plants.drives(model, *inputs),
        plants.motions(model, *outputs),
    )
    return answer.value


def bouncer(level, *, loss=0.0, **support):
    """A mass on one vertical wire, on a structure; `support` is the [support] table."""
    stage = scenes.hung({"count": 1, "l": 0.5, "k": K, "material": "lossy"}, MASS, 0.1)
    materials = {"lossy": {"youngs_modulus": 1e11, "loss_angle": loss}}
    more = {"support": support} if support else {}
    return registry.by_name(level).system(
        scenes.design_of(scenes.raw_of(stage, materials=materials, **more))
    )


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize(("heavy", "loss"), [(0.0, 0.0), (50.0, 0.0), (50.0, 2e-3)])
def test_a_structure_by_hand(level, heavy, loss):
    """Two masses in a row: the structure (with mass or without) stands on the ground by a spring
    and a damper, the body hangs from the structure."""
    c, frame_loss = 30.0, 5 * loss
    structure = {"stiffness": {"z": FRAME}, "mass": heavy, "damping": {"z": c}}
    model = bouncer(level, loss=loss, loss_angle=frame_loss, **structure)
    assert model.massless[model.coordinate.index("frame.z")] == (heavy == 0)
    frequency = np.append(0.0, np.geomspace(0.05, 200, 60))
    omega = 2 * np.pi * frequency
    wire, ground = K * (1 + 1j * loss), FRAME * (1 + 1j * frame_loss) + 1j * omega * c
    value = solved(model, frequency, ["support.z", "test.force_z"], ["test.z", "frame.z"])
    for n, w in enumerate(omega):  # in absolute displacements of the structure and the body
        matrix = np.array([[wire + ground[n] - heavy * w**2, -wire], [-wire, wire - MASS * w**2]])
        structure, body = np.linalg.solve(matrix, np.array([[ground[n], 0], [0, 1]]))
        np.testing.assert_allclose(value[n, 0], body, rtol=1e-12)
        np.testing.assert_allclose(
            value[n, 1, 0] + 1, structure[0], rtol=0, atol=1e-12 * max(1, abs(value[n, 1, 0]))
        )
        np.testing.assert_allclose(value[n, 1, 1], structure[1], rtol=1e-12)


@pytest.mark.parametrize("level", LEVELS)
def test_a_stiff_structure_is_none(level):
    raw = plants.raw("triple", loss=True)
    bare = registry.by_name(level).system(scenes.design_of(raw))
    frequency = np.geomspace(0.11, 90, 30)
    inputs = [f"support.{dof}" for dof in DOFS]
    outputs = [f"{body}.{dof}" for body in bare.body for dof in DOFS]
    expected = solved(bare, frequency, inputs, outputs)
    support = {"stiffness": dict.fromkeys(DOFS, 1e9), "mass": 100.0, "inertia": [5.0] * 3}
    stiff = registry.by_name(level).system(scenes.design_of(raw | {"support": support}))
    found = solved(stiff, frequency, inputs, outputs)
    assert np.array_equal(found == 0, expected == 0)
    away = np.max(np.abs(found - expected) / np.where(expected == 0, 1, np.abs(expected)))
    # the structure's mass on its stiffness, at the highest frequency, and its inertia in yaw
    own = (2 * np.pi * 90) ** 2 / 1e9
    assert away == pytest.approx(own * 100.0, rel=0.1)
    turned = np.abs(found[-1, 5::6, 5] / expected[-1, 5::6, 5] - 1)
    np.testing.assert_allclose(turned, own * 5.0, rtol=0.1)


def test_directions_left_out_are_rigid():
    model = bouncer("force", stiffness={"z": FRAME, "pitch": 1e4})
    assert model.coordinate[-2:] == ("frame.z", "frame.pitch")
    with pytest.raises(InputError, match="rigid in this direction"):
        solved(model, 1.0, ["support.y"], ["frame.y"])
    with pytest.raises(InputError, match="names no body"):
        plants.motions(bouncer("force"), "frame.z")
    np.testing.assert_array_equal(
        solved(model, [0.3, 7.0], ["support.x"], ["test.x"]),
        solved(bouncer("force"), [0.3, 7.0], ["support.x"], ["test.x"]),
    )


def rigid_motions(model, design):
    """Everything (the structure's deflection apart) moved or turned as one, (N, 6)."""
    positions, motions = com_positions(design), np.zeros((model.size, 6))
    for n, body in enumerate(("support", *model.body)):
        motions[6 * n : 6 * n + 6] = np.eye(6)
        motions[6 * n : 6 * n + 3, 3:] = -cross_matrix(np.array(positions[body]))
    return motions


@pytest.mark.parametrize("against", ["support", "upper", "middle"])
def test_dampers_do_not_resist_what_moves_as_one(against):
    raw = plants.raw("triple")
    values = {"x": 3.0, "y": 2.0, "z": 5.0, "roll": 0.5, "pitch": 0.3, "yaw": 0.4}
    raw["stage"][2]["damping"] = values | {"against": against}
    design = scenes.design_of(raw)
    model, bare = (
        registry.FORCE.system(scenes.design_of(one)) for one in (raw, plants.raw("triple"))
    )
    assert not bare.damping.any()
    rigid = rigid_motions(model, design)
    assert (np.abs(model.damping @ rigid) <= 1e-15 * (np.abs(model.damping) @ np.abs(rigid))).all()
    assert np.array_equal(model.damping, model.damping.T)
    assert np.linalg.eigvalsh(model.damping)[0] > -1e-14
    own = slice(model.index("test", "x"), model.index("test", "x") + 6)
    np.testing.assert_array_equal(np.diag(model.damping)[own], list(values.values()))
    other = {"support": 0, "upper": 6, "middle": 12}[against]
    # a force between the two bodies: what one gets the other gives
    force = -model.damping[:, own.start]
    assert force[own.start] == -3.0
    assert force[other] == 3.0
    lever = com_positions(design)["test"][2] - com_positions(design)[against][2]
    assert force[other + 4] == pytest.approx(3.0 * lever, rel=1e-14)
