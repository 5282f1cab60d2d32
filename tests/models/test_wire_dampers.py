"""Dampers on wires, against closed forms of strings, masses and springs, and dissipation."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq, root

import suspension_cli as sus
from suspension_cli.elements.dynamic_wire import TautWire
from suspension_cli.scene.fibres import compose

BOLTZMANN = 1.380649e-23
BODY = 20.0
WIRES = 2
LENGTH = 0.5
TENSION = BODY * 9.81 / WIRES
PER_LENGTH = 7800 * np.pi * 1e-8
STRETCHING = 1e5
"""N/m, of one wire."""


def two_wires(dampers: str, constants: str = "", loss: float = 0.0) -> sus.Design:
    """A heavy body on two wires of so soft a material that they bend as strings do, to 1e-5."""
    return sus.parse(f"""
[design]
name = "strings"
{constants}
[materials.soft]
youngs_modulus = 2e7
poisson_ratio = 0.3
density = 7800.0
loss_angle = {loss!r}
[[stage]]
name = "test"
body = {{ mass = {BODY}, inertia = [0.5, 0.5, 0.5] }}
[stage.wires]
count = {WIRES}
l = {LENGTH}
t1 = 0.2
t2 = 0.2
d = 0.001
material = "soft"
radius = 1e-4
k = {STRETCHING}
dampers = [{dampers}]
""")


def damper(mass: float, frequency: float, at: float = 0.5, loss: float = 0.1, acts="across") -> str:
    """One damper, as in a design file."""
    return (
        f"{{ at = {at!r}, mass = {mass!r}, frequency = {frequency!r}, loss_angle = {loss!r},"
        f' acts = "{acts}" }}'
    )


def node_stiffness(omega, mass, frequency, at=0.5, loss=0.0):
    """Stiffness of two strings between fixed ends, and a damper, where they meet; N/m."""
    spring = (2 * np.pi * frequency) ** 2 * mass * (1 + 1j * loss)
    of_damper = -mass * omega**2 * spring / (spring - mass * omega**2)
    waves = omega / np.sqrt(TENSION / PER_LENGTH)
    strings = sum(TENSION * waves / np.tan(waves * part * LENGTH) for part in (at, 1 - at))
    return strings + of_damper


def test_point_mass_in_the_middle_has_the_frequencies_of_the_tangent_equation():
    """Even modes: 2 T k cot(k l / 2) = m omega^2; odd ones are those of the string alone."""
    mass = 2e-5
    fibre = compose(two_wires(damper(mass, 1e6))).wire[0]
    wire = TautWire(fibre, TENSION, massive=True, lossy=False)
    speed = np.sqrt(TENSION / PER_LENGTH)

    def off_balance(angle: float) -> float:
        omega = 2 * angle * speed / LENGTH
        return 2 * TENSION * omega / speed * np.cos(angle) - mass * omega**2 * np.sin(angle)

    even = [brentq(off_balance, n * np.pi + 1e-6, (n + 1) * np.pi - 1e-6) for n in range(3)]
    odd = np.pi * np.arange(1, 3)
    expected = np.sort([*even, *odd]) * 2 * speed / LENGTH
    found = wire.held_resonances("bend-1", 2 * np.pi * 2000.0)
    np.testing.assert_allclose(found[: len(expected)], expected, rtol=3e-5)


@pytest.mark.parametrize(
    ("at", "mass", "frequency"), [(0.5, 2e-5, 600.0), (0.3, 5e-6, 1200.0), (0.8, 1e-6, 300.0)]
)
def test_resonances_between_fixed_ends_are_those_of_two_strings(at, mass, frequency):
    fibre = compose(two_wires(damper(mass, frequency, at))).wire[0]
    wire = TautWire(fibre, TENSION, massive=True, lossy=False)
    for omega in wire.held_resonances("bend-1", 2 * np.pi * 1500.0):
        waves = omega / np.sqrt(TENSION / PER_LENGTH)
        if abs(np.sin(waves * at * LENGTH)) < 1e-3:
            continue  # the damper is at a node
        low, high = (
            node_stiffness(omega * (1 + sign * 1e-4), mass, frequency, at) for sign in (-1, 1)
        )
        assert low.real > 0 > high.real


@pytest.mark.parametrize("loss", [1e-3, 0.2, 0.6])
def test_modes_are_complex_roots_of_two_strings_and_a_damper(loss):
    """The recoil of the body moves some modes by 1e-6."""
    mass = 5e-6
    found = sus.modes(
        two_wires(damper(mass, 590.0, loss=loss)), fidelity="violin", max_frequency=900
    )
    bending = np.array(["violin" in dof for _, dof in found.home])
    assert bending.sum() == 8 * WIRES / 2

    def off_balance(parts):
        value = node_stiffness(parts[0] + 1j * parts[1], mass, 590.0, loss=loss)
        return value.real, value.imag

    for number in np.flatnonzero(bending):
        # |s| and Q of the pole s = i omega, omega = a + i b
        frequency = 2 * np.pi * found.frequency[number]
        angle = np.arcsin(1 / (2 * np.hypot(found.q[number], 0.5)))
        start = frequency * np.array([np.cos(angle), np.sin(angle)])
        exact = root(off_balance, start, tol=1e-12)
        assert exact.success
        assert np.hypot(*exact.x) == pytest.approx(frequency, rel=3e-5)
        assert exact.x[0] / (2 * exact.x[1]) == pytest.approx(found.q[number], rel=3e-4)


def test_q_of_a_light_damper_far_from_resonance_is_first_order_perturbation():
    """1/Q = Im D |w|^2 / (omega^2 times the modal mass, half that of the wire)."""
    mass, frequency, loss = 1e-9, 1500.0, 0.1
    found = sus.modes(
        two_wires(damper(mass, frequency, loss=loss)), fidelity="violin", max_frequency=640
    )
    number = [dof for _, dof in found.home].index("violin-x")
    omega = 2 * np.pi * found.frequency[number]
    spring = (2 * np.pi * frequency) ** 2 * mass * (1 + 1j * loss)
    lost = (-mass * omega**2 * spring / (spring - mass * omega**2)).imag
    expected = omega**2 * PER_LENGTH * LENGTH / 2 / lost
    assert found.q[number] == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(("output", "acts"), [("test.x", "across"), ("test.z", "along")])
def test_thermal_noise_is_that_of_the_response(output, acts):
    """4 k T Im(1 / Z) / omega of the response, where noise is summed over what dissipates."""
    design = two_wires(damper(2e-5, 590.0, 0.3, acts=acts), loss=1e-4)
    at = [20.0, 300.0, 585.0, 640.0, 1500.0]
    found = sus.thermal(design, outputs=output, frequency=at, fidelity="violin")
    force = output.replace("test.", "test.force_")
    response = sus.response(
        design, inputs=force, outputs=output, frequency=at, fidelity="violin"
    ).value
    density = -4 * BOLTZMANN * design.constants.temperature * np.imag(np.squeeze(response))
    density /= 2 * np.pi * np.array(at)
    np.testing.assert_allclose(np.squeeze(found.amplitude), np.sqrt(density), rtol=1e-7)
    assert "test.dampers" in found.source


def test_damper_along_the_wires_splits_bounce():
    """Body, point of the wires and damper on springs in series, with losses; wires are light."""
    mass, frequency, loss = 0.01, 15.9, 0.05
    found = sus.modes(
        two_wires(damper(mass, frequency, loss=loss, acts="along"), loss=1e-4),
        fidelity="violin",
        max_frequency=40,
    )
    spring = WIRES * (2 * np.pi * frequency) ** 2 * mass * (1 + 1j * loss)
    half = 2 * WIRES * STRETCHING * (1 + 1e-4j)
    node = 2 * half + spring
    joined = np.array(
        [
            [half - half**2 / node, -half * spring / node],
            [-half * spring / node, spring - spring**2 / node],
        ]
    )
    squares = np.linalg.eigvals(joined / np.array([BODY, WIRES * mass])[:, None])
    poles = 1j * np.sqrt(squares)
    for pole in poles:
        nearest = np.argmin(np.abs(found.q / (pole.imag / (-2 * pole.real)) - 1))
        assert found.q[nearest] == pytest.approx(pole.imag / (-2 * pole.real), rel=1e-3)
        assert found.frequency[nearest] == pytest.approx(abs(pole) / (2 * np.pi), rel=1e-5)


def test_auto_takes_wires_with_mass_if_a_damper_shifts_a_mode():
    tuned = sus.modes(two_wires(damper(0.01, 15.9, acts="along")))
    assert tuned.model == "violin"
    assert "test vertical" in tuned.label
    assert sus.modes(two_wires(damper(1e-5, 590.0))).model == "beam"


def test_with_weight_the_mass_moves_with_the_wire_in_all_models():
    """Of a mass in the middle a quarter moves with the body: m / 4, as for a wire m / 3."""
    mass = 0.4
    weighed = two_wires(damper(mass, 500.0), "[constants]\nwire_weight = true")
    found = sus.modes(weighed, fidelity="string")
    bounce = found.frequency[found.label.index("test vertical")]
    of_wires = WIRES * PER_LENGTH * LENGTH
    moving = BODY + WIRES * mass / 4 + of_wires / 3
    assert bounce == pytest.approx(np.sqrt(WIRES * STRETCHING / moving) / (2 * np.pi), rel=1e-5)


def test_quantities_of_batches_have_dampers():
    found = sus.sweep(
        two_wires(damper(5e-6, 590.0)),
        vary={"stage.test.wires.dampers.1.frequency": [400.0, 590.0]},
        results=["test violin 1"],
    )
    lowest = [
        brentq(lambda f, own=own: node_stiffness(2 * np.pi * f, 5e-6, own).real, 350.0, own - 1e-3)
        for own in (400.0, 590.0)
    ]
    np.testing.assert_allclose(found.document()["results"][0]["values"], lowest, rtol=3e-5)


@pytest.mark.parametrize(
    ("dampers", "message"),
    [
        (damper(1e-5, 500.0, at=1.0), "must be at least 0.001 and at most 0.999"),
        (damper(1e-5, 500.0, at=0.6) + "," + damper(1e-5, 500.0), "sort them by at"),
        ("{ mass = 1e-5, loss_angle = 0.1 }", "frequency"),
    ],
)
def test_faults_are_refused(dampers, message):
    with pytest.raises(sus.InputError, match=message):
        two_wires(dampers)


def test_a_damper_needs_the_cross_section_of_its_wire():
    text = """
[design]
name = "bare"
[[stage]]
name = "test"
body = { mass = 1.0, inertia = [0.01, 0.01, 0.01] }
[stage.wires]
count = 1
l = 0.3
k = 1e4
dampers = [{ mass = 1e-4, frequency = 100.0, loss_angle = 0.1 }]
"""
    with pytest.raises(sus.InputError, match="need the wire's cross-section"):
        sus.parse(text)
