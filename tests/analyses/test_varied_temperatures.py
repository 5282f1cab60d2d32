"""Temperatures, their profiles along wires and `[heat]` vary as other numbers do."""

from __future__ import annotations

import pytest

import suspension_cli as sus
from tests.support.commandline import run, written

NOISE = "thermal test.x:10"


def derivatives(design, result: str, *vary: str) -> dict[str, float]:
    found = sus.sensitivity(design, vary=vary, results=[result], fidelity="beam")
    return dict(zip(found.parameter, found.derivative[:, 0].tolist(), strict=True))


def plain(temperature):
    """A pendulum whose losses do not depend on temperature."""
    return sus.template("single").replace(
        {
            "materials": {"w": {"youngs_modulus": 2e11, "density": 7.8e3, "loss_angle": 1e-4}},
            "stage.test.wires.material": "w",
            "stage.test.wires.temperature": temperature,
        }
    )


def test_thermal_noise_goes_with_the_root_of_the_temperature():
    design = plain(250.0)
    value = sus.thermal(design, outputs=["test.x"], frequency=[10.0], fidelity="beam").amplitude
    (rate,) = derivatives(design, NOISE, "stage.test.wires.temperature").values()
    assert rate == pytest.approx(float(value.ravel()[0]) / (2 * 250.0), rel=1e-6)


def test_temperatures_of_a_profile_add_up():
    """Equal temperatures of a profile act together as the one of a uniform wire."""
    name = "stage.test.wires.temperature"
    (whole,) = derivatives(plain(250.0), NOISE, name).values()
    parts = derivatives(plain([[0.0, 250.0], [0.4, 250.0], [1.0, 250.0]]), NOISE, name)
    assert list(parts) == [f"{name}.{n}.2" for n in (1, 2, 3)]  # places stay
    assert sum(parts.values()) == pytest.approx(whole, rel=1e-4)


def test_heat_against_differences():
    design = sus.example("sapphire-fibres")
    result = "temperature of mirror"
    found = derivatives(design, result, "heat")
    for name, rate in found.items():
        power = sus.sensitivity(design, vary=[name], results=[result], fidelity="beam").value[0]
        ends = [power * 0.999, power * 1.001]
        low, high = sus.sweep(design, vary={name: ends}, results=[result], fidelity="beam").value
        assert rate == pytest.approx(float((high - low)[0]) / (ends[1] - ends[0]), rel=1e-5)
    assert set(found) == {"heat.held.support", "heat.absorbed.mirror"}


def test_temperatures_of_material_properties_do_not_vary(tmp_path):
    file = written(tmp_path, sus.example("sapphire-fibres").text, "fibres.toml")
    path = "materials.sapphire.youngs_modulus.temperature"
    refused = run("sensitivity", file, "--vary", path)
    assert refused.exit_code == 2
    assert "names no number of the design that can vary" in refused.stderr
