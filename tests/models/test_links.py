"""Links, dampers, the ground and signals between bodies, against an assembly written here.

The potential energy of a platform that carries a payload and its reaction mass, with links, is
written down in finite rotations, as jets, which carry its second derivatives.
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

import suspension_cli as sus
from suspension_cli.conventions import BOLTZMANN, DOFS
from suspension_cli.design import reader
from suspension_cli.errors import InputError
from suspension_cli.linear import damped, response, signals
from suspension_cli.models import registry
from suspension_cli.physics import thermal_noise
from tests.support import jets, plants

G = 9.81
BODIES = ("platform", "test", "reaction", "support", "ground")
POSITION = {
    "support": (0.0, 0.0, 0.0),
    "ground": (0.0, 0.0, 0.0),
    "platform": (0.0, 0.0, -0.5),
    "test": (0.0, 0.0, -0.903),
    "reaction": (0.0, 0.0, -1.004),
}
MASS = {"platform": 20.0, "test": 10.0, "reaction": 8.0}
INERTIA = {"platform": (0.3, 0.2, 0.25), "test": (0.1, 0.08, 0.09), "reaction": (0.12, 0.09, 0.1)}
# upper body, lower body, length, s, t, d, d_upper, k
WIRES = (
    ("support", "platform", 0.5, 0.05, 0.1, 0.0, 0.0, 5.0e4),
    ("platform", "test", 0.4, 0.03, 0.1, 0.001, 0.002, 3.0e4),
    ("platform", "reaction", 0.5, 0.04, 0.15, 0.001, 0.003, 2.5e4),
)
FULL = np.array(
    [
        [4.0, 0.5, 0.2, 0.01, 0.02, 0.03],
        [0.5, 6.0, 0.3, 0.02, 0.01, 0.02],
        [0.2, 0.3, 5.0, 0.03, 0.01, 0.01],
        [0.01, 0.02, 0.03, 0.4, 0.01, 0.02],
        [0.02, 0.01, 0.01, 0.01, 0.3, 0.03],
        [0.03, 0.02, 0.01, 0.02, 0.03, 0.2],
    ]
)
SIX = np.diag([30.0, 20.0, 10.0, 0.2, 0.1, 0.3])
UP = np.array([0.0, 0.0, 3.0, 0.0, 0.0, 0.0])
# first, second, point from the first's COM, stiffness, preload on the first
LINKS = (
    ("test", "reaction", (0.02, -0.03, 0.01), FULL, 0 * UP),
    ("test", "reaction", (0.0, 0.0, 0.05), SIX, UP),
    ("platform", "ground", (0.04, 0.05, -0.02), 10 * FULL, 0 * UP),
    ("reaction", "platform", (0.01, 0.0, 0.3), SIX, 0 * UP),
    ("test", "support", (0.0, 0.06, 0.0), FULL, 0 * UP),
)


def design_text(extra: str = "") -> str:
    lines = ['[design]\nname = "towers"\n']
    for (upper, lower, length, s, t, d, d_upper, k), name in zip(WIRES, BODIES, strict=False):
        inertia = list(INERTIA[name])
        lines.append(
            f'[[stage]]\nname = "{name}"\nhangs_from = "{upper}"\n'
            f"body = {{ mass = {MASS[lower]}, inertia = {inertia} }}\n[stage.wires]\ncount = 4\n"
            f"l = {length}\ns = {s}\nt1 = {t}\nt2 = {t}\nd = {d}\nd_upper = {d_upper}\nk = {k}\n"
        )
    for n, (first, second, at, k, preload) in enumerate(LINKS, 1):
        lines.append(
            f'[[link]]\nname = "link{n}"\nbetween = ["{first}", "{second}"]\nat = {list(at)}\n'
            f"stiffness = {k.tolist()}\npreload = {preload.tolist()}\nloss_angle = {0.01 * n}\n"
        )
    return "".join(lines) + extra


DAMPER = """
[[damper]]
name = "brake"
between = ["test", "reaction"]
at = [0.0, 0.02, 0.03]
damping = [1.0, 2.0, 3.0, 0.04, 0.05, 0.06]
[[damper]]
name = "feet"
between = ["platform", "ground"]
at = [0.1, 0.0, 0.0]
damping = [4.0, 5.0, 6.0, 0.0, 0.0, 0.0]
"""


def _energy() -> Any:
    """Potential energy of the tower, a jet; six coordinates of each of `BODIES`."""
    x = np.array(jets.coordinates(6 * len(BODIES))).reshape(-1, 6)
    at = {b: POSITION[b] + x[n, :3] for n, b in enumerate(BODIES)}
    turn = {b: jets.rotation(x[n, 3:]) for n, b in enumerate(BODIES)}
    total = sum(G * mass * at[body][2] for body, mass in MASS.items())
    carried = {
        "platform": G * sum(MASS.values()) / 4,
        "test": (G * MASS["test"] - UP[2]) / 4,
        "reaction": (G * MASS["reaction"] + UP[2]) / 4,
    }
    for upper, lower, length, s, t, d, d_upper, k in WIRES:
        for sx, sy in itertools.product((1, -1), (1, -1)):
            a = at[upper] + turn[upper] @ np.array([sx * s, sy * t, -d_upper])
            b = at[lower] + turn[lower] @ np.array([sx * s, sy * t, d])
            stretch = jets.length(a - b) - (length - carried[lower] / k)
            total = total + 0.5 * k * stretch * stretch
    for first, second, point, stiffness, preload in LINKS:
        other = np.array(point) + POSITION[first] - np.array(POSITION[second])
        apart = at[first] + turn[first] @ np.array(point) - at[second] - turn[second] @ other
        # in the axes of the body that comes first in the file, support and ground before all
        last = {"support": -1, "ground": -1}
        above = min(first, second, key=lambda body: last.get(body, BODIES.index(body)))
        q = turn[second].T @ turn[first]
        phi = [0.5 * (q[2, 1] - q[1, 2]), 0.5 * (q[0, 2] - q[2, 0]), 0.5 * (q[1, 0] - q[0, 1])]
        strain = np.array([*(turn[above].T @ apart), *phi])
        total = total + 0.5 * (strain @ (stiffness @ strain)) - preload @ strain
    return total


@pytest.fixture(scope="module")
def hessian() -> Any:
    energy = _energy()
    assert np.abs(energy.gradient[:18]).max() < 1e-9
    return energy.hessian


def _mass() -> Any:
    return np.diag(
        np.concatenate([[MASS[b]] * 3 + list(INERTIA[b]) for b in ("platform", "test", "reaction")])
    )


def _close(value: Any, expected: Any, tolerance: float = 1e-9) -> None:
    scale = np.abs(expected).max()
    assert np.abs(np.asarray(value) - expected).max() <= tolerance * scale


def _solved(model: Any, frequency: Any, inputs: list[str], outputs: list[str]) -> Any:
    drives, motions = plants.drives(model, *inputs), plants.motions(model, *outputs)
    return response.solve(model, frequency, drives, motions).value


def test_responses_to_support_ground_and_pair_of_forces(hessian: Any) -> None:
    model = registry.STRING.system(reader.parse(design_text().replace("loss_angle", "#")))
    frequency = np.array([0.0, 0.05, 0.31, 0.9, 3.3, 12.0, 80.0])
    inputs = [f"{b}.{d}" for b in ("ground", "support") for d in DOFS]
    inputs += ["test~reaction.force_x@0.01,0.02,0.03", "reaction~test.torque_yaw"]
    outputs = [f"{b}.{d}" for b in ("platform", "test", "reaction") for d in DOFS]
    value = _solved(model, frequency, inputs, outputs)
    columns = [-hessian[:18, 24:30], -hessian[:18, 18:24]]
    push = np.zeros((18, 2))
    push[6, 0], push[6 + 3 : 12, 0] = 1.0, np.cross([0.01, 0.02, 0.03], [1, 0, 0])
    there = np.array([0.01, 0.02, 0.03 - 0.903 + 1.004])
    push[12, 0], push[15:18, 0] = -1.0, -np.cross(there, [1, 0, 0])
    push[17, 1], push[11, 1] = 1.0, -1.0
    forces = np.concatenate([*columns, push], axis=1)
    for f, found in zip(frequency, value, strict=True):
        expected = np.linalg.solve(hessian[:18, :18] - (2 * np.pi * f) ** 2 * _mass(), forces)
        for column in range(forces.shape[1]):
            _close(found[:, column], expected[:, column])


def test_dampers_resist_relative_motion_at_their_point_alone() -> None:
    plain = registry.STRING.system(reader.parse(design_text()))
    model = registry.STRING.system(reader.parse(design_text(DAMPER)))
    c = model.damping - plain.damping
    ground = model.ground
    assert ground is not None and model.rigid is not None
    whole = np.zeros((30, 30))
    whole[:24, :24] = c
    whole[:24, 24:] = ground.damping
    whole[24:, :24] = ground.damping.T
    feet = np.array([4.0, 5.0, 6.0])
    skew = signals.cross_matrix(np.array([0.1, 0.0, -0.5]))
    j = np.concatenate([np.eye(3), -skew], axis=1)
    whole[24:, 24:] = j.T @ (feet[:, None] * j)
    rigid = np.concatenate([model.rigid, np.eye(6)])
    assert np.abs(whole @ rigid).max() < 1e-14
    velocity = np.random.default_rng(1).normal(size=30)
    place = {"platform": 6, "test": 12, "reaction": 18, "ground": 24}

    def at(body: str, point: Any) -> Any:
        v = velocity[place[body] : place[body] + 6]
        return np.concatenate([v[:3] + np.cross(v[3:], point), v[3:]])

    one = at("test", [0, 0.02, 0.03]) - at("reaction", [0, 0.02, 0.03 + 0.101])
    two = at("platform", [0.1, 0, 0]) - at("ground", [0.1, 0, -0.5])
    lost = [1.0, 2.0, 3.0, 0.04, 0.05, 0.06] @ one**2 + feet @ two[:3] ** 2
    assert velocity @ whole @ velocity == pytest.approx(lost, rel=1e-12)


TILTED = """
[design]
name = "tilted"
[[stage]]
name = "base"
body = {{ mass = 5.0, inertia = [0.05, 0.05, 0.05] }}
position = [0.0, 0.0, -0.2]
[[stage.spring]]
stiffness = [1e5, 1e5, 1e5, 30.0, 30.0, 30.0]
preload = [0.0, 0.0, 68.67, 0.0, 0.0, 0.0]
[[stage]]
name = "test"
body = {{ mass = 2.0, inertia = [0.01, 0.02, 0.03] }}
position = [0.0, 0.0, -0.3]
[[stage.spring]]
stiffness = [5e4, 6e4, 8e4, 1.3, 1.4, 1.5]
preload = [0.0, 0.0, 19.62, 0.0, 0.0, 0.0]
[[perturbation]]
body = "test"
com_offset = {offset}
[[damper]]
name = "brake"
between = ["test", "{other}"]
damping = {damping}
"""


@pytest.mark.parametrize("other", ["support", "ground"])
@pytest.mark.parametrize("axis", [3, 4, 5])
def test_rotational_damping_does_not_depend_on_the_pose(axis: int, other: str) -> None:
    """A damper against one rotation adds i omega c to the dynamic stiffness 1/H, in any pose."""
    damping = [0.0] * 6
    damping[axis] = 0.02
    design = sus.parse(TILTED.format(offset=[0.015, 0.01, 0.0], other=other, damping=damping))
    body = sus.check(design).document()["bodies"][-1]
    assert np.linalg.norm(body["rotation_rad"]) > 0.15
    frequency = np.array([0.3, 2.0, 30.0])
    name = DOFS[axis]
    found = sus.response(
        design,
        inputs=[f"test.torque_{name}"],
        outputs=[f"test.{name}"],
        frequency=frequency,
        fidelity="string",
    )
    rate = np.imag(1 / found.value[:, 0, 0]) / (2 * np.pi * frequency)
    np.testing.assert_allclose(rate, 0.02, rtol=1e-9)


BLOCK = """
[design]
name = "block"
[[stage]]
name = "test"
body = {{ mass = 2.0, inertia = [0.01, 0.01, 0.01] }}
position = [0.0, 0.0, -0.3]
[[stage.spring]]
stiffness = [50.0, 60.0, 80.0, 1.0, 1.1, 1.2]
preload = [0.0, 0.0, 19.62, 0.0, 0.0, 0.0]
[[link]]
name = "wire"
between = ["test", "ground"]
{link}
"""


def _response(text: str, level: str, frequency: Any, into: str, out: str) -> Any:
    model = registry.by_name(level).system(reader.parse(text))
    return _solved(model, frequency, [into], [out])[:, 0, 0]


TABLE = """[link.table]
axis = "z"
frequency = [0.1, 1.0, 10.0]
real = [[{0}]]
imaginary = [[{1}]]
"""


@pytest.mark.parametrize("level", ["string", "beam"])
def test_table_of_stiffness(level: str) -> None:
    frequency = np.array([0.05, 0.1, 0.6, 1.0, 3.0, 10.0, 40.0])
    omega = 2 * np.pi * frequency
    flat = BLOCK.format(link=TABLE.format("30.0, 30.0, 30.0", "0.6, 0.6, 0.6"))
    constant = BLOCK.format(link="stiffness = [0, 0, 30.0, 0, 0, 0]\nloss_angle = 0.02")
    for into in ("ground.z", "support.z", "test.force_z"):
        one, other = (_response(t, level, frequency, into, "test.z") for t in (flat, constant))
        np.testing.assert_allclose(one, other, rtol=1e-13)
    k = 30.0 * (1 + 0.02j)
    hand = k / (k + 80.0 - omega**2 * 2.0)
    np.testing.assert_allclose(
        _response(constant, level, frequency, "ground.z", "test.z"), hand, rtol=1e-12
    )
    real, imaginary = [20.0, 30.0, 60.0], [1.0, 2.0, 9.0]
    curved = BLOCK.format(link=TABLE.format("20.0, 30.0, 60.0", "1.0, 2.0, 9.0"))
    at = np.log([0.1, 1.0, 10.0])
    k = np.interp(np.log(frequency), at, real) + 1j * np.interp(np.log(frequency), at, imaginary)
    for into, force in (("ground.z", k), ("support.z", 80.0), ("test.force_z", 1.0)):
        hand = force / (k + 80.0 - omega**2 * 2.0)
        found = _response(curved, level, frequency, into, "test.z")
        np.testing.assert_allclose(found, hand, rtol=1e-12)


@pytest.mark.parametrize("level", ["string", "beam"])
def test_thermal_noise_and_mode_of_a_tabulated_link(level: str) -> None:
    text = BLOCK.format(link=TABLE.format("20.0, 30.0, 60.0", "1e-4, 2e-4, 9e-4"))
    model = registry.by_name(level).system(reader.parse(text))
    frequency = np.array([0.3, 1.0, 4.0])
    omega, at = 2 * np.pi * frequency, np.log([0.1, 1.0, 10.0])
    [found] = thermal_noise.solve(
        model, frequency, [thermal_noise.parse_motion(model, "test.z")], 290.0
    )
    assert found.source == ("wire.link",)
    k = np.interp(np.log(frequency), at, [20.0, 30.0, 60.0])
    loss = np.interp(np.log(frequency), at, [1e-4, 2e-4, 9e-4])
    susceptibility = 1 / (k + 1j * loss + 80.0 - omega**2 * 2.0)
    hand = -4 * BOLTZMANN * 290.0 / omega * susceptibility.imag
    np.testing.assert_allclose(found.amplitude**2, hand, rtol=1e-12)
    modes = damped.solve(model)
    table = lambda f: np.interp(np.log(f), at, [20.0, 30.0, 60.0])  # noqa: E731
    expected = brentq(lambda f: table(f) + 80 - 2 * (2 * np.pi * f) ** 2, 0.5, 5.0, xtol=1e-14)
    nearest = modes.frequency[np.abs(modes.frequency - expected).argmin()]
    assert nearest == pytest.approx(expected, rel=1e-9)


def test_ground_beside_an_elastic_support() -> None:
    """The frame moves the suspension point, not the ground on which links end."""
    support = "[support]\nmass = 5.0\n[support.stiffness]\nz = 400.0\n"
    text = BLOCK.format(link="stiffness = [0, 0, 30.0, 0, 0, 0]") + support
    frequency = np.array([0.2, 0.9, 3.0])
    w2 = (2 * np.pi * frequency) ** 2
    for level in ("string", "beam"):
        for into, force in (("ground.z", [30.0, 0.0]), ("support.z", None)):
            found = _response(text, level, frequency, into, "test.z")
            for value, square in zip(found, w2, strict=True):
                # coordinates: test, suspension point
                z = np.array([[110.0 - 2 * square, -80.0], [-80.0, 480.0 - 5 * square]])
                right = [0.0, 400.0] if force is None else force
                assert value == pytest.approx(np.linalg.solve(z, right)[0], rel=1e-11)


def test_signals_between_bodies_are_checked() -> None:
    model = registry.STRING.system(reader.parse(design_text()))
    known = signals.bodies_with_signals(model)
    for text, problem in (
        ("test~test.x", "names one body twice"),
        ("test~nobody.x", "names no stage or support after the ~"),
        ("support~test.force_x", "names no stage before the ~"),
        ("ground.force_x", "has no effect"),
    ):
        with pytest.raises(InputError, match=problem):
            signals.parse(text, "--input", known)
    with pytest.raises(InputError, match="ground's motion is an input"):
        signals.parse_output("ground.x", known)
    plain = registry.STRING.system(reader.parse(reader.template("single", "single")))
    with pytest.raises(InputError, match="names no body"):
        signals.parse_input("ground.x", signals.bodies_with_signals(plain))
