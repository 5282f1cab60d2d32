"""Lines of a budget: equal OSEMs together, the largest in front, at most seven."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.analyses.budget import cause_groups
from suspension_cli.physics import ground

PLACES = {
    "F1": ([0.05, 0.0, 0.03], "x"),
    "F2": ([0.05, 0.1, -0.03], "x"),
    "F3": ([0.05, -0.1, -0.03], "x"),
    "LF": ([0.0, 0.1, 0.05], "z"),
    "RT": ([0.0, -0.1, 0.05], "z"),
    "SD": ([0.0, 0.12, 0.0], "y"),
}


@pytest.fixture(scope="module")
def budget() -> sus.Budget:
    """A damped triple with six BOSEMs, one of which has a noisier coil."""
    osems = [
        {"name": name, "stage": "upper", "at": at, "direction": direction, "sensor_noise": "bosem"}
        | {"force_noise": 2e-9 if name == "SD" else 1e-9}
        for name, (at, direction) in PLACES.items()
    ]
    design = sus.example("triple-damped")
    loops = [one.name for one in design.design.control.loop]
    silent = {f"control.loop.{name}.sensor_noise": 0.0 for name in loops}
    noisy = design.replace({"control.osem": osems} | silent)
    how = {"outputs": ["test.y"], "ground": ["vc-e"], "fidelity": "beam"}
    return sus.budget(noisy, frequency=[0.5, 1.0, 10.0], **how)


def test_powers_of_equal_osems_are_summed(budget):
    """Coils of another noise have a line of their own; the result keeps each cause."""
    grouped = cause_groups.group(budget.first, budget.run.design.design).budget
    assert {"6 sensors of upper", "5 actuators of upper", "actuator.SD"} <= {*grouped.cause}
    parts = budget.first.parts
    for line, kind, names in (
        ("6 sensors of upper", "sensor", PLACES),
        ("5 actuators of upper", "actuator", [*PLACES][:-1]),
    ):
        power = sum(parts[f"{kind}.{name}"] ** 2 for name in names)
        assert grouped.parts[line] ** 2 == pytest.approx(power, rel=1e-12)
    assert grouped.amplitude == pytest.approx(budget.first.amplitude, rel=1e-12)
    assert grouped.total_rms == pytest.approx(budget.first.total_rms, rel=1e-12)
    assert len(budget.document()["contributions"]) == len(parts) > 12


def test_causes_by_stage(budget):
    """One line for all sensors of a stage, one for all its actuators."""
    design = budget.run.design.design
    grouped = cause_groups.group(budget.first, design, "stage").budget
    assert {"sensors of upper", "actuators of upper"} < {*grouped.cause}
    assert not any(name.startswith(("sensor.", "actuator.")) for name in grouped.cause)
    power = sum(budget.first.parts[f"actuator.{name}"] ** 2 for name in PLACES)
    assert grouped.parts["actuators of upper"] ** 2 == pytest.approx(power, rel=1e-12)
    assert grouped.amplitude == pytest.approx(budget.first.amplitude, rel=1e-12)


def test_the_largest_is_in_front_and_the_rest_is_one_line(budget, monkeypatch):
    """What it sums is said."""
    monkeypatch.setattr(cause_groups, "MOST", 3)
    found = cause_groups.group(budget.first, budget.run.design.design)
    shown = [name for name, part in found.budget.parts.items() if part.any()]
    assert shown[0] == "ground.y"
    assert shown[2:] == ["3 others"]
    assert found.budget.amplitude == pytest.approx(budget.first.amplitude, rel=1e-12)
    [remark] = found.remarks
    assert re.fullmatch("others: [^,]+, [^,]+, [^,]+", remark)
    assert remark in str(budget)


def test_vibration_criteria_have_their_velocity_in_each_third_octave():
    """50 um/s for vc-a above 8 Hz, 3.12 um/s for vc-e above 1 Hz."""
    for name, middle, rms in (("vc-a", 16.0, 50e-6), ("vc-e", 2.0, 3.12e-6), ("vc-a", 4.0, 25e-6)):
        band = np.linspace(middle * 2 ** (-1 / 6), middle * 2 ** (1 / 6), 4001)
        velocity = 2 * np.pi * band * ground.parse([name], [], Path())["z"].at(band)
        assert np.sqrt(np.trapezoid(velocity**2, band)) == pytest.approx(rms, rel=0.01)
