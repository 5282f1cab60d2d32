"""Properties of materials against temperature: interpolation, gaps, built-in tables against closed
forms and standards."""

from __future__ import annotations

import math
import tomllib

import pytest

import suspension_cli as sus
from suspension_cli.design import derive, materials, reader
from suspension_cli.design.materials import AgainstTemperature, value_at
from suspension_cli.errors import InputError
from suspension_cli.scene.fibres import compose
from suspension_cli.studies import parameters

ROOM = {
    "steel302": (1.7e11, 1.72e-5, None, 500.0, 16.2),
    "c70steel": (2.12e11, 1.2e-5, -2.5e-4, 486.0, 49.0),
    "maraging": (1.87e11, 1.1e-5, None, 460.0, 20.0),
    "fused-silica": (7.2e10, 3.9e-7, 1.52e-4, 772.0, 1.38),
    "silicon": (1.558e11, 2.6e-6, -6.7e-5, 712.0, 148.0),
    "sapphire": (4.0e11, 5.0e-6, None, 790.0, 40.0),
    "tungsten": (4.11e11, 4.5e-6, None, 132.0, 174.0),
    "aluminium": (6.9e10, 2.31e-5, None, 897.0, 237.0),
}
"""Modulus, expansion, slope, specific heat and conductivity at room temperature."""


def table(temperature, values):
    return AgainstTemperature(temperature=tuple(temperature), values=tuple(values))


def test_powers_of_the_temperature_are_exact_between_the_nodes():
    cubes = table([10.0, 20.0, 50.0], [1e-3 * t**3 for t in (10.0, 20.0, 50.0)])
    falling = table([50.0, 200.0], [-3.0 * t**-1.3 for t in (50.0, 200.0)])
    for t in (11.0, 19.0, 33.0, 49.0):
        assert cubes.at(t) == pytest.approx(1e-3 * t**3, rel=1e-12)
    assert falling.at(77.0) == pytest.approx(-3.0 * 77.0**-1.3, rel=1e-12)


def test_others_are_linear_and_all_constant_outside():
    slow, crossing = table([20.0, 280.0], [2.0, 1.0]), table([100.0, 200.0], [-1.0, 3.0])
    assert slow.at(150.0) == pytest.approx(1.5, rel=1e-12)
    assert crossing.at(125.0) == pytest.approx(0.0, abs=1e-12)
    assert (slow.at(4.0), slow.at(400.0)) == (2.0, 1.0)


def test_ends_and_gaps_are_unknown():
    """Between 20 and 280 K a conductivity may do anything; a modulus does not."""
    steep, slow = table([20.0, 280.0], [5000.0, 40.0]), table([20.0, 280.0], [4.06e11, 4e11])
    assert steep.unknown_range(77.0) == "unknown between 20 and 280 K"
    assert steep.unknown_range(20.0) == steep.unknown_range(280.0) == ""
    assert slow.unknown_range(77.0) == ""
    assert slow.unknown_range(4.0) == "known from 20 to 280 K"


@pytest.mark.parametrize("name", ROOM)
@pytest.mark.parametrize("temperature", [280.0, 290.0, 293.15, 300.0, 310.0])
def test_room_temperature(name, temperature):
    made = materials.at_temperature(materials.BUILT_IN[name], temperature)
    assert tuple(getattr(made, key) for key in materials.BOUNDS) == ROOM[name]


def test_every_built_in_table_is_valid():
    for name, made in materials.BUILT_IN.items():
        assert made.faults() == [], name
        assert made.temperature_range is not None, name


def test_silicon_does_not_expand_near_123_kelvin():
    given = materials.BUILT_IN["silicon"].thermal_expansion
    assert isinstance(given, AgainstTemperature)
    low, high = 100.0, 150.0
    while high - low > 1e-3:
        middle = (low + high) / 2
        low, high = (middle, high) if given.at(middle) < 0 else (low, middle)
    assert low == pytest.approx(124.0, abs=1.0)  # Middelmann et al. (2015)


ISO_11357 = (
    *(0.34407, -0.37623, -0.47824, 0.54579, 0.15393, -0.10023),
    *(-0.23778, 0.26410, -0.21704, 0.23260, 1.12705),
)
"""Polynomial of ISO 11357-4 for the specific heat of sapphire, 100 to 1200 K, J/(g K)."""


def test_heat_of_sapphire_against_the_standard_of_calorimetry():
    given = materials.BUILT_IN["sapphire"].specific_heat
    assert given is not None
    for t, error in ((100.0, 2e-3), (150.0, 2e-3), (250.0, 2e-3), (110.0, 2e-2), (225.0, 2e-2)):
        heat = 0.0
        for coefficient in ISO_11357:
            heat = heat * (t - 650) / 550 + coefficient
        assert value_at(given, t) == pytest.approx(1000 * heat, rel=error)


@pytest.mark.parametrize(
    ("name", "atoms", "mass", "debye", "temperature"),
    [
        ("silicon", 1, 0.0281, 640.0, 10.0),
        ("sapphire", 5, 0.10196, 1042.0, 15.0),
        ("aluminium", 1, 0.02698, 428.0, 20.0),
        ("copper", 1, 0.06355, 344.0, 10.0),
    ],
)
def test_heat_in_the_cold_is_that_of_debye(name, atoms, mass, debye, temperature):
    """12 pi^4/5 R (T/theta)^3 per atom, with Debye temperatures from specific heats (Kittel,
    Introduction to Solid State Physics; sapphire Fugate and Swenson, J. Appl. Phys. 40, 3034
    (1969)); metals have 10 % more from their electrons."""
    expected = 12 * math.pi**4 / 5 * 8.314 * atoms / mass * (temperature / debye) ** 3
    given = materials.BUILT_IN[name].specific_heat
    assert given is not None
    assert value_at(given, temperature) == pytest.approx(expected, rel=0.25)


def single(tmp_text):
    return reader.convert(tomllib.loads(tmp_text))


TEXT = """
[design]
name = "one"

[constants]
temperature = {ambient}

[materials.mine]
youngs_modulus = {{ temperature = [20.0, 100.0, 300.0], values = [3e11, 2.5e11, 2e11] }}
density = 4000.0

[[stage]]
name = "test"
body = {{ mass = 5.0, inertia = [0.03, 0.03, 0.03] }}

[stage.wires]
count = 4
l = 0.3
s = 0.03
t1 = 0.05
t2 = 0.05
d = 0.001
material = "mine"
radius = 1e-4
{more}
"""


@pytest.mark.parametrize(
    ("ambient", "more", "modulus"),
    [
        (20.0, "", 3e11),
        (60.0, "", 2.75e11),
        (300.0, "", 2e11),
        (300.0, "temperature = 100.0", 2.5e11),
    ],
)
def test_wires_have_the_modulus_of_their_temperature(ambient, more, modulus):
    """Stretching, bending and the spring constant."""
    design = single(TEXT.format(ambient=ambient, more=more))
    section = compose(design).wire[0].sections[0]
    area = math.pi * 1e-8
    assert section.stretching == pytest.approx(modulus * area, rel=1e-12)
    assert section.rigidity[0] == pytest.approx(modulus * area * 1e-8 / 4, rel=1e-12)
    wires = design.stage[0].wires
    assert wires is not None
    assert derive.wire_stiffness(design, wires, 0.3) == pytest.approx(modulus * area / 0.3)


@pytest.mark.parametrize("given", ["{ upper = 300.0, lower = 100.0 }", "[[0, 300], [1, 100]]"])
def test_stiffness_of_a_wire_whose_modulus_changes_along_it(given):
    """E falls linearly with T, T linearly along it: 1/k = l ln(E_2/E_1) / (A (E_2 - E_1))."""
    design = single(TEXT.format(ambient=20.0, more=f"temperature = {given}"))
    wires = design.stage[0].wires
    assert wires is not None
    expected = math.pi * 1e-8 * (2.5e11 - 2e11) / math.log(2.5 / 2) / 0.3
    assert derive.wire_stiffness(design, wires, 0.3) == pytest.approx(expected, rel=1e-4)
    sections = compose(design).wire[0].sections
    assert sections[0].rigidity[0] == pytest.approx(2e11 * math.pi * 1e-16 / 4, rel=1e-3)
    assert sections[-1].rigidity[0] == pytest.approx(2.5e11 * math.pi * 1e-16 / 4, rel=1e-3)


def test_a_table_in_the_wrong_unit_is_refused():
    text = TEXT.format(ambient=20.0, more="").replace("3e11, 2.5e11", "3e17, 2.5e11")
    with pytest.raises(InputError, match=r"youngs_modulus\.values = .*: is 3e\+17 at 20 K.*Pa"):
        sus.parse(text)
    text = TEXT.format(ambient=20.0, more="").replace("[20.0, 100.0", "[200.0, 100.0")
    with pytest.raises(InputError, match="ascending"):
        sus.parse(text)


def test_a_number_replaces_a_built_in_table():
    text = TEXT.format(ambient=20.0, more="").replace("mine", "silicon")
    design = sus.parse(text)
    made = materials.resolve(design, "silicon")
    assert made.youngs_modulus == 3e11
    assert made.specific_heat == 3.897
    own = sus.parse(text.replace("density = 4000.0", "specific_heat = 5.0"))
    assert materials.resolve(own, "silicon").specific_heat == 5.0
    assert materials.resolve(own, "silicon", 290.0).thermal_conductivity == 148.0


def test_titanium_is_not_aluminium():
    text = TEXT.format(ambient=290.0, more="").replace('"mine"', '"titanium"')
    with pytest.raises(InputError, match="did you mean 'titanium-6al-4v'"):
        sus.parse(text)


def test_a_table_is_varied_as_a_whole():
    """A modulus that is larger by 1 % at every temperature: modes of a cold suspension follow."""
    design = sus.parse(TEXT.format(ambient=60.0, more="")).design
    path = "materials.mine.youngs_modulus"
    assert parameters.value_of(design, path) == 2.75e11
    more = parameters.shifted(design, path, 1e9)
    assert materials.resolve(more, "mine").youngs_modulus == 2.76e11
    assert materials.resolve(more, "mine", 20.0).youngs_modulus == 3.01e11
    listed = [one.name for one in parameters.every(TEXT.format(ambient=60.0, more=""))]
    assert path in listed
    assert not [name for name in listed if "values" in name]
