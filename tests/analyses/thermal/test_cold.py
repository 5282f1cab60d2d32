"""Thermal noise of cold suspensions against closed forms; what is said of unknown properties."""

from __future__ import annotations

import math
import warnings

import mpmath
import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.conventions import BOLTZMANN
from suspension_cli.design import materials
from tests.support.commandline import run, strict_json
from tests.support.paths import CONFIGS

MASS, LENGTH, RADIUS = 40.0, 0.8, 0.5e-3
TEXT = f"""
[design]
name = "cold"

[constants]
temperature = 20.0

[materials.silicon]
loss = {{ angle = 0.0 }}

[[stage]]
name = "test"
body = {{ mass = {MASS}, inertia = [5.0, 5.0, 5.0] }}

[stage.wires]
count = 4
l = {LENGTH}
s = 0.3
t1 = 0.3
t2 = 0.3
d = 0.0
material = "silicon"
radius = {RADIUS}
"""


def relaxation(omega, radius, diffusivity):
    """|Im 4 J2(z)/(z^2 J1'(z))|, z^2 = -i omega r^2/D, of a round wire, in 30 digits."""
    with mpmath.workdps(30):
        z = mpmath.sqrt(-1j * omega * radius**2 / diffusivity)
        value = 4 * mpmath.besselj(2, z) / (z**2 * mpmath.besselj(1, z, derivative=1))
        return abs(float(value.imag))


@pytest.mark.parametrize("temperature", [20.0, 77.0, 123.0, 290.0])
def test_thermoelastic_noise_of_silicon_fibres(temperature):
    """A mass that does not turn on four fibres, clamped at both ends: k = T/(L - 2/q) for each with
    q = sqrt(T/(E I)), whose imaginary part is phi T/(q (L - 2/q)^2); the noise is that of the one
    resonance. The loss angle from the numbers of the table."""
    made = materials.at_temperature(materials.BUILT_IN["silicon"], temperature)
    tension, area = MASS * 9.81 / 4, math.pi * RADIUS**2
    modulus, heat = made.youngs_modulus, made.density * made.specific_heat
    strain = tension / (modulus * area)
    coefficient = made.thermal_expansion - strain * made.modulus_slope
    frequency = np.array([5.0, 12.0])
    design = sus.parse(TEXT).replace({"constants.temperature": temperature})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = sus.thermal(design, outputs=["test.x"], frequency=frequency, fidelity="beam")
    for f, amplitude in zip(frequency, found.amplitude[:, 0], strict=True):
        omega = 2 * math.pi * f
        delta = modulus * temperature * coefficient**2 / heat
        angle = delta * relaxation(omega, RADIUS, made.thermal_conductivity / heat)
        bend = math.sqrt(modulus * math.pi * RADIUS**4 / 4 / tension)
        stiffness = 4 * tension / (LENGTH - 2 * bend)
        lossy = 4 * angle * tension * bend / (LENGTH - 2 * bend) ** 2
        power = 4 * BOLTZMANN * temperature * lossy / omega / (stiffness - MASS * omega**2) ** 2
        assert amplitude == pytest.approx(math.sqrt(power), rel=5e-3)


def test_cold_silicon_is_quiet():
    """With the values of room temperature the noise at 20 K is thousands of times too high."""
    room = "thermal_expansion = 2.6e-6\nmodulus_slope = -6.7e-5\nspecific_heat = 712.0"
    old = TEXT.replace("[materials.silicon]", f"[materials.silicon]\n{room}")
    old = old.replace("loss =", "thermal_conductivity = 148.0\nloss =")
    noise = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for text in (TEXT, old):
            result = sus.thermal(sus.parse(text), frequency=[10.0], fidelity="beam")
            noise.append(result.amplitude[0, 0])
    assert noise[1] > 1000 * noise[0]


def test_ends_of_two_temperatures_have_their_own_properties():
    """The bending at either end is that of a wire which has the temperature of this end throughout;
    with one stiffness for all, so that shapes do not differ."""
    text = TEXT.replace("{ angle = 0.0 }", "{ angle = 0.0 }\nyoungs_modulus = 1.56e11")
    parts = {}
    for name, given in (
        ("both", "[[0.0, 20.0], [0.4, 20.0], [0.6, 290.0], [1.0, 290.0]]"),
        ("cold", "20.0"),
        ("warm", "290.0"),
    ):
        design = sus.parse(f"{text}\ntemperature = {given}\n")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = sus.thermal(design, frequency=[10.0], fidelity="beam")
        parts[name] = {key: value[0] for key, value in found.motions[0].parts.items()}
    for end, like in (("test.bending-upper", "cold"), ("test.bending-lower", "warm")):
        assert parts["both"][end] == pytest.approx(parts[like][end], rel=1e-6)


def test_a_gradient_along_the_wire():
    """A mass that does not turn, with one loss angle: the energy of bending falls as exp(-2 q s)
    from either clamp, q = sqrt(T/(E I)), so the mean temperature of the upper end is that of the
    clamp and 1/(2 q L) of the whole difference; that of both ends is the mean of both clamps. The
    stiffness is T/(L - 2/q), each end adds phi T/(2 q (L - 2/q)^2) to its imaginary part."""
    text = TEXT.replace("{ angle = 0.0 }", "{ angle = 1e-6, thermoelastic = false }")
    text = text.replace("[materials.silicon]", "[materials.silicon]\nyoungs_modulus = 1.56e11")
    noise = {}
    for name, given in (("mean", "155.0"), ("gradient", "{ upper = 20.0, lower = 290.0 }")):
        design = sus.parse(f"{text}\ntemperature = {given}\n")
        found = sus.thermal(design, frequency=[3.0, 12.0], outputs=["test.x"], fidelity="beam")
        noise[name] = found.motions[0]
    np.testing.assert_allclose(noise["gradient"].amplitude, noise["mean"].amplitude, rtol=1e-3)
    rigidity = 1.56e11 * math.pi * RADIUS**4 / 4
    tension = MASS * 9.81 / 4
    bend = math.sqrt(rigidity / tension)
    omega = 2 * math.pi * np.array([3.0, 12.0])
    free = LENGTH - 2 * bend
    lossy = 1e-6 * 4 * tension * bend / free**2
    power = 4 * BOLTZMANN * 155 * lossy / omega / (4 * tension / free - MASS * omega**2) ** 2
    np.testing.assert_allclose(noise["gradient"].amplitude, np.sqrt(power), rtol=5e-3)
    share = math.sqrt(rigidity / (MASS * 9.81 / 4)) / (2 * LENGTH)
    for end, kelvin in (("upper", 20 + 270 * share), ("lower", 290 - 270 * share)):
        source = f"test.bending-{end}"
        ratio = (noise["gradient"].parts[source] / noise["mean"].parts[source]) ** 2
        np.testing.assert_allclose(ratio, kelvin / 155, rtol=3e-3)


def test_one_temperature_however_it_is_given():
    amplitudes = []
    for given in ("77.0", "{ upper = 77.0, lower = 77.0 }", "[[0, 77], [0.3, 77], [1, 77]]"):
        found = sus.thermal(sus.parse(f"{TEXT}\ntemperature = {given}\n"), frequency=[1.0, 30.0])
        amplitudes.append(found.amplitude.tolist())
    assert amplitudes[0] == amplitudes[1] == amplitudes[2]


def answer(tmp_path, text, *args):
    file = tmp_path / "one.toml"
    file.write_text(text)
    result = run("thermal", file, "--json", "--out", tmp_path, "--frequency", "10,100", *args)
    assert result.exit_code == 0, result.stderr
    lines = [line for line in result.stderr.splitlines() if line.startswith("warning: ")]
    return strict_json(result.stdout), lines


def test_unknown_properties_are_named(tmp_path):
    """Material, part, temperature, properties, the loss that is wrong, and what to do."""
    _, (line,) = answer(
        tmp_path, TEXT.replace("silicon", "c70steel").replace("{ angle = 0.0 }", "{ angle = 1e-4 }")
    )
    assert "materials.c70steel: used at 20 K (test.wires)" in line
    assert "thermal_expansion, modulus_slope, specific_heat, thermal_conductivity known" in line
    assert "known from 280 to 310 K" in line
    assert "its stiffness and thermoelastic loss may be wrong by orders of magnitude" in line
    assert "give values for 20 K in [materials.c70steel]" in line
    assert "youngs_modulus" in line


def test_what_is_known_is_not_named(tmp_path):
    """Silicon at 20 K, any built-in material at room temperature, numbers that a design gives."""
    assert answer(tmp_path, TEXT.replace("{ angle = 0.0 }", "{}"))[1] == []
    for ambient, name in ((290.0, "c70steel"), (300.0, "fused-silica")):
        text = TEXT.replace("20.0", str(ambient), 1).replace("silicon", name)
        assert answer(tmp_path, text.replace("{ angle = 0.0 }", "{}"))[1] == []
    own = "youngs_modulus = 2e11\ndensity = 7800.0\nthermal_expansion = 1e-7\n"
    own += "specific_heat = 3.0\nthermal_conductivity = 10.0\n"
    text = TEXT.replace("silicon", "mine").replace(
        "loss = { angle = 0.0 }", f"{own}loss_angle = 1e-4"
    )
    assert answer(tmp_path, text)[1] == []
    (line,) = answer(tmp_path, text.replace(own, f"{own}temperature_range = [4.0, 10.0]\n"))[1]
    assert "known from 4 to 10 K" in line
    assert "bulk loss" in line


def test_gap_of_sapphire(tmp_path):
    text = TEXT.replace("silicon", "sapphire").replace("{ angle = 0.0 }", "{ angle = 1e-7 }")
    assert answer(tmp_path, text)[1] == []
    (line,) = answer(tmp_path, text.replace("temperature = 20.0", "temperature = 77.0"))[1]
    assert "thermal_conductivity unknown between 20 and 280 K" in line


def test_a_material_at_several_temperatures_is_named_once(tmp_path):
    """A wire from 16 to 22 K beside one at 20 K: one line with the range."""
    text = TEXT.replace("silicon", "c70steel").replace(
        "loss = { angle = 0.0 }", "loss_angle = 1e-4"
    )
    profile = "temperature=[[0.0,16.0],[1.0,22.0]]"
    _, (line,) = answer(tmp_path, text, "--set", f"stage.test.wires.{profile}")
    assert "materials.c70steel: used at 16 to 22 K (test.wires)" in line
    assert "give values for 16 to 22 K in [materials.c70steel]" in line


def test_check_names_them_too(tmp_path):
    file = tmp_path / "one.toml"
    file.write_text(TEXT.replace("silicon", "maraging").replace("loss = { angle = 0.0 }", ""))
    result = run("check", file, "--strict")
    assert result.exit_code == 1
    assert "materials.maraging: used at 20 K (test.wires)" in result.stderr
    assert run("check", CONFIGS / "cryogenic-payload.toml", "--strict").exit_code == 0


# ---------------------------------------------------------------- losses that a material lacks

BARE = TEXT.replace("temperature = 20.0", "temperature = 290.0").replace("silicon", "mine")
GLASS = "youngs_modulus = 7.2e10\npoisson_ratio = 0.17\ndensity = 2200.0\nloss_angle = 4.1e-10"


def test_missing_losses_are_computed(tmp_path):
    """Of a glass with a loss angle alone: what is stated is what the built-in one gives."""
    text = BARE.replace("loss = { angle = 0.0 }", GLASS)
    bare, (line,) = answer(tmp_path, text)
    full, none = answer(
        tmp_path, BARE.replace("mine", "fused-silica").replace("loss = { angle = 0.0 }", "")
    )
    assert none == []
    ratio = np.max(np.array(full["displacement_asd"]) / np.array(bare["displacement_asd"]))
    assert ratio > 10
    (words,) = bare["missing_losses"]
    assert words == f"surface and thermoelastic loss of mine (a factor of {ratio:.3g})"
    assert bare["estimated_error"] == pytest.approx(ratio - 1, rel=1e-6)
    assert "with the values of fused-silica" in line
    assert "loss.surface_depth, thermal_expansion, specific_heat, thermal_conductivity" in line
    assert full["missing_losses"] == []
    assert full["estimated_error"] == 0


def test_nothing_is_not_said_of_a_loss_that_is_left_out(tmp_path):
    file = tmp_path / "one.toml"
    file.write_text(BARE.replace("loss = { angle = 0.0 }", GLASS))
    first = run("thermal", file, "--no-plot", "--out", tmp_path).stdout.splitlines()[0]
    assert "neglected: surface and thermoelastic loss of mine" in first
    assert "nothing" not in first


def test_a_material_like_no_other(tmp_path):
    """Its missing loss cannot be computed."""
    unlike = "youngs_modulus = 1e10\ndensity = 1500.0\nloss_angle = 1e-3"
    found, (line,) = answer(tmp_path, BARE.replace("loss = { angle = 0.0 }", unlike))
    assert found["missing_losses"] == ["thermoelastic loss of mine (of unknown size)"]
    assert "give thermal_expansion, specific_heat, thermal_conductivity in [materials.mine]" in line
    off = "loss = { angle = 1e-3, thermoelastic = false }"
    meant = unlike.replace("loss_angle = 1e-3", off)
    found, lines = answer(tmp_path, BARE.replace("loss = { angle = 0.0 }", meant))
    assert (found["missing_losses"], lines) == ([], [])


def test_the_shipped_quadruple_has_the_losses_of_its_fibres():
    design = sus.read(CONFIGS / "built" / "ligo-quad.toml")
    found = sus.thermal(design, frequency=[100.0])
    # with built-in fused silica
    other = design.replace({"stage.test.wires.material": "fused-silica"})
    same = sus.thermal(other, frequency=[100.0])
    assert found.amplitude[:, 0] == pytest.approx(same.amplitude[:, 0], rel=1e-9)
    assert found.amplitude[:, 0][0] == pytest.approx(4.94e-22, rel=0.01)


def test_losses_of_modes(tmp_path):
    """Q of a glass with a loss angle alone is too high by the factor that is stated."""
    quality, texts = [], []
    for name, table in (("mine", GLASS), ("fused-silica", "")):
        file = tmp_path / f"{name}.toml"
        file.write_text(BARE.replace("mine", name).replace("loss = { angle = 0.0 }", table))
        result = run("modes", file, "--no-plot", "--out", tmp_path, "--fidelity", "beam")
        quality.append(sus.load(tmp_path / "cold-modes.h5").q)
        texts.append(" ".join(result.stdout.split()))
    ratio = np.max(quality[0] / quality[1])
    stated = f"surface and thermoelastic loss of mine (a factor of {ratio:.3g}) in the Q of a mode"
    assert stated in texts[0]
    assert "thermoelastic" not in texts[1]
