"""Dampers on tips of blades, against a system of three masses, limits, and dissipation."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import eig

import suspension_cli as sus

BOLTZMANN = 1.380649e-23
BODY = 10.0
TIP = 0.2
MASS = 0.3
BLADE = 4e4
WIRE = 1.5e5
LOSS = 0.08


def blade_pair(frequency: float, mass: float = MASS, tip: float = TIP, damper: bool = True):
    """A body on four vertical wires below two blades; by symmetry, bounce is three masses."""
    table = f"damper = {{ mass = {mass!r}, frequency = {frequency!r}, loss_angle = {LOSS!r} }}"
    return sus.parse(f"""
[design]
name = "pair"
[materials.lossless]
youngs_modulus = 2e11
poisson_ratio = 0.3
loss_angle = 0.0
[[stage]]
name = "test"
body = {{ mass = {BODY}, inertia = [0.1, 0.12, 0.11] }}
[stage.wires]
count = 4
l = 0.4
s = 0.02
t1 = 0.1
t2 = 0.1
d = 0.001
k = {WIRE!r}
material = "lossless"
radius = 2e-4
[stage.blades]
count = 2
stiffness = {BLADE!r}
tip_mass = {tip!r}
{table if damper else ""}
""")


def dynamic(frequency: float, at: np.ndarray) -> np.ndarray:
    """Dynamic stiffness (f, 3, 3) of body, tips and dampers in bounce, written out."""
    spring = (2 * np.pi * frequency) ** 2 * 2 * MASS * (1 + 1j * LOSS)
    wires = 4 * WIRE
    k = np.array(
        [
            [wires, -wires, 0],
            [-wires, wires + 2 * BLADE + spring, -spring],
            [0, -spring, spring],
        ]
    )
    inertia = np.diag([BODY, 2 * TIP, 2 * MASS])
    return k - (2 * np.pi * at[:, None, None]) ** 2 * inertia


@pytest.mark.parametrize("fidelity", ["string", "beam"])
@pytest.mark.parametrize("frequency", [3.0, 13.4, 60.0])
def test_response_is_that_of_three_masses(frequency, fidelity):
    at = np.linspace(2.0, 30.0, 25)
    found = sus.response(
        blade_pair(frequency),
        inputs="test.force_z",
        outputs="test.z",
        frequency=at.tolist(),
        fidelity=fidelity,
    )
    expected = np.linalg.inv(dynamic(frequency, at))[:, 0, 0]
    np.testing.assert_allclose(np.squeeze(found.value), expected, rtol=1e-8)


def test_thermal_noise_follows_from_the_dissipation():
    """4 k T Im(1 / Z) / omega: blades and wires have no loss, so all is the dampers'."""
    at = np.linspace(5.0, 30.0, 11)
    found = sus.thermal(blade_pair(13.4), outputs="test.z", frequency=at.tolist(), fidelity="beam")
    response = np.linalg.inv(dynamic(13.4, at))[:, 0, 0]
    temperature = blade_pair(13.4).constants.temperature
    density = 4 * BOLTZMANN * temperature * -response.imag / (2 * np.pi * at)
    np.testing.assert_allclose(np.squeeze(found.amplitude), np.sqrt(density), rtol=1e-8)
    assert "test.dampers" in found.source


def test_modes_are_the_split_pair():
    """Poles of the three masses with the loss angle: s^2 = -lambda of the complex matrices."""
    found = sus.modes(blade_pair(13.4), fidelity="string")
    matrix = dynamic(13.4, np.zeros(1))[0]
    squares = eig(matrix, np.diag([BODY, 2 * TIP, 2 * MASS]), right=False)
    pair = squares[np.argsort(np.abs(squares))[:2]]
    for square in pair:
        pole = 1j * np.sqrt(square)
        assert pole.real < 0
        closest = np.argmin(np.abs(found.frequency - abs(pole) / (2 * np.pi)))
        assert found.frequency[closest] == pytest.approx(abs(pole) / (2 * np.pi), rel=1e-8)
        quality = pole.imag / (-2 * pole.real)
        assert found.q[closest] == pytest.approx(quality, rel=1e-8)


def test_stiff_spring_is_mass_on_the_tip():
    at = [5.0, 14.0, 25.0]
    results = [
        sus.response(
            design, inputs="test.force_z", outputs="test.z", frequency=at, fidelity="string"
        ).value
        for design in (blade_pair(1e5), blade_pair(1.0, tip=TIP + MASS, damper=False))
    ]
    np.testing.assert_allclose(*results, rtol=1e-6)


def test_force_model_refuses_it_and_a_tip_needs_mass():
    with pytest.raises(sus.InputError, match="have tip masses"):
        sus.modes(blade_pair(13.4), fidelity="force")
    with pytest.raises(sus.InputError, match="needs tip_mass"):
        blade_pair(13.4, tip=0.0)


def test_builds_in_a_batch_are_those_alone():
    """Three lengths of wires in one batch give the responses of the three designs."""
    lengths = [0.38, 0.4, 0.42]
    base = blade_pair(13.4)
    found = sus.sweep(
        base,
        vary={"stage.test.wires.l": lengths},
        results=["test.z/test.force_z:13", "test.x/support.x:13"],
        fidelity="string",
    )
    for n, (output, drive) in enumerate([("test.z", "test.force_z"), ("test.x", "support.x")]):
        alone = [
            sus.response(
                base.replace({"stage.test.wires.l": length}),
                inputs=drive,
                outputs=output,
                frequency=[13.0],
                fidelity="string",
            ).value
            for length in lengths
        ]
        together = found.document()["results"][n]["values"]
        np.testing.assert_allclose(together, np.abs(np.squeeze(alone)), rtol=1e-8)


def test_dampers_of_ligo_have_the_q_that_was_measured():
    """Hanford's ITMX (LHO aLOG 40098); the model's modes are 0.8 % low without dampers too."""
    with_dampers = sus.modes(sus.example("bounce-roll-dampers"), fidelity="beam")
    without = sus.modes(sus.example("built/ligo-quad"), fidelity="beam")
    measured = {"penultimate vertical": (9.797, 4770), "penultimate roll": (13.902, 2840)}
    for label, (frequency, quality) in measured.items():
        damped = with_dampers.label.index(label)
        assert with_dampers.frequency[damped] == pytest.approx(frequency, rel=0.01)
        assert with_dampers.q[damped] == pytest.approx(quality, rel=0.01)
        # as measured before: about 500,000 (LIGO-T1500343)
        assert without.q[without.label.index(label)] == pytest.approx(5e5, rel=0.05)


def test_two_dampers_on_each_tip_are_five_masses():
    """Body, tips, and two dampers on each tip, in bounce."""
    first, second = (
        f"{{ mass = {MASS}, frequency = {frequency}, loss_angle = {LOSS} }}"
        for frequency in (13.4, 9.0)
    )
    one = f"damper = {{ mass = {MASS!r}, frequency = 13.4, loss_angle = {LOSS!r} }}"
    text = blade_pair(13.4).text.replace(one, f"damper = [{first}, {second}]")
    at = np.linspace(2.0, 30.0, 25)
    found = sus.response(
        sus.parse(text),
        inputs="test.force_z",
        outputs="test.z",
        frequency=at.tolist(),
        fidelity="string",
    )
    omega = 2 * np.pi * at
    matrix = dynamic(13.4, at)
    spring = (2 * np.pi * 9.0) ** 2 * 2 * MASS * (1 + 1j * LOSS)
    inertia = 2 * MASS * omega**2
    matrix[:, 1, 1] -= inertia * spring / (spring - inertia)
    expected = np.linalg.inv(matrix)[:, 0, 0]
    np.testing.assert_allclose(np.squeeze(found.value), expected, rtol=1e-8)
