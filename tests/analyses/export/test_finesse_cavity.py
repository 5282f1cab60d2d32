"""`[[cavity]]` against finesse 3: two exported suspensions in an arm cavity of finesse's own light.

finesse solves for the fields with all delays, our model has one pole. Both agree as far as few
photons are lost per round trip, and frequencies are far below c / L: the phase between the mirrors,
2 pi f L / c, is 8e-4 at 10 Hz in 4 km.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.constants import c

import suspension_cli as sus
from tests.support.paths import CONFIGS

finesse = pytest.importorskip("finesse")
pytestmark = pytest.mark.filterwarnings("ignore::suspension_cli.errors.PendsusWarning")
LENGTH, RADII, LOST, DETUNING, INPUT = 3994.5, (1934.0, 2245.0), 1e-3, 1.0, 20.0
MIRRORS = ("itm", "etm")
FORCES = {"force_x": "x", "torque_pitch": "pitch", "torque_yaw": "yaw"}


def arm(exported, power, orders):
    """An arm cavity with modes up to an order, whose mirrors are suspended; x is -z of both."""
    phase = np.degrees(2 * np.pi * DETUNING * LENGTH / c)
    model = finesse.Model()
    model.fsig.f = 1
    model.parse(f"""
        l laser P={power}
        s before laser.p1 itm.p1
        m itm R={1 - LOST} T={LOST} Rc={-RADII[0]}
        s space itm.p2 etm.p1 L={LENGTH}
        m etm R=1 T=0 phi={-phase} Rc={RADII[1]}
        cav own itm.p2.o
        pd circulating etm.p1.i
    """)
    if orders:
        model.modes(maxtem=orders)
    for name in MIRRORS:
        model.add(sus.finesse(exported[name], f"sus_{name}", getattr(model, name), -1))
    return model


@pytest.fixture(scope="module")
def designs():
    """The design in the light that finesse finds, and the suspensions without light."""
    design = sus.read(CONFIGS / "arm-cavity.toml")
    dark = design.replace({"cavity.arm.power": 0.0})
    exported = {
        name: sus.export(
            dark.replace({f"stage.{own}.mirror": own == name for own in MIRRORS}),
            format="finesse",
            fidelity="string",
        )
        for name in MIRRORS
    }
    power = float(arm(exported, INPUT, 0).run()["circulating"])
    given = {"power": power, "detuning": DETUNING, "transmission": LOST}
    lit = design.replace({f"cavity.arm.{key}": value for key, value in given.items()})
    return lit, exported


def compare(designs, frequency):
    """Responses of our model and of finesse, and those without light, among both mirrors, with
    modes of first order for the angles."""
    from finesse.analysis.actions import FrequencyResponse

    lit, exported = designs
    pairs = [(mirror, dof) for mirror in MIRRORS for dof in FORCES.values()]
    ours = sus.response(
        lit,
        inputs=[f"{mirror}.{force}" for mirror in MIRRORS for force in FORCES],
        outputs=[f"{mirror}.{dof}" for mirror, dof in pairs],
        frequency=frequency,
        fidelity="string",
        allow_unstable=True,
    ).value
    names = [(mirror, "z" if dof == "x" else dof) for mirror, dof in pairs]
    nodes = [[f"{mirror}.mech.{kind}{dof}" for mirror, dof in names] for kind in ("F_", "")]
    sign = np.array([1 if dof == "yaw" else -1 for _, dof in pairs])  # both face -x
    solved = []
    for power in (INPUT, 0.0):
        found = arm(exported, power, 1).run(FrequencyResponse(frequency, *nodes))
        values = [[found[out, into] for into in nodes[0]] for out in nodes[1]]
        solved.append(np.moveaxis(values, -1, 0) * np.outer(sign, sign))
    return ours, *solved


def test_stiffness_of_the_light_is_that_of_finesse(designs):
    """Between all motions of both mirrors."""
    frequency = np.array([0.3, 3.0, 15.0])
    found = [np.linalg.inv(value) for value in compare(designs, frequency)]
    ours, theirs = (value - found[2] for value in found[:2])
    own = np.sqrt(np.abs(np.einsum("fii->fi", theirs)))
    # one pole is right to the end mirror; by each part of the input mirror finesse is L/c earlier
    late = np.kron([[2, 1], [1, 0]], np.diag([1, 0, 0]))
    ours = ours * np.exp(2j * np.pi * frequency[:, None, None] * LENGTH / c * late)
    assert (np.abs(ours - theirs) < 7e-4 * own[:, :, None] * own[:, None, :]).all()
    along = np.abs(ours - theirs)[:, ::3, ::3] / np.abs(theirs[:, ::3, ::3])
    assert along.max() < 1e-5
    assert (own > 1.0).all()
