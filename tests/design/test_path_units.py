"""Units of numbers of a design come from the types of its tables."""

import pytest

import suspension_cli as sus
from suspension_cli.analyses.fit.findings import change_unit
from suspension_cli.design.paths import format_with_unit, unit_of
from suspension_cli.studies import parameters


@pytest.mark.parametrize(
    ("path", "unit"),
    {
        "stage.test.wires.d": "m",
        "stage.test.wire.2.upper.3": "m",
        "stage.test.wires.sections.2.radius.1": "m",
        "stage.upper.blades.uncoupled_frequency": "Hz",
        "stage.upper.spring.1.stiffness.3": "",
        "stage.test.body.inertia.1.2": "kg m^2",
        "materials.steel302.youngs_modulus": "Pa",
        "constants.gravity": "m/s^2",
        "stage.test.wires.nonsense": "",
    }.items(),
)
def test_unit_of_a_path(path, unit):
    assert unit_of(path) == unit


def test_every_length_of_the_shipped_designs_has_its_unit():
    known = {"d", "d_upper", "l", "s", "t1", "t2", "radius", "length", "thickness"}
    for name in sus.examples():
        for item in parameters.every(sus.example(name).text):
            if item.name.rsplit(".", 1)[-1] in known:
                assert unit_of(item.name) == "m", item.name


def test_numbers_are_written_as_people_read_them():
    assert format_with_unit("stage.test.wires.d", -0.0021) == "-2.1 mm"
    assert format_with_unit("materials.a.youngs_modulus", 1.7e11) == "170 GPa"
    assert format_with_unit("stage.test.body.mass", 5.6) == "5.6 kg"
    assert format_with_unit("materials.a.poisson_ratio", 0.3) == "0.3"
    assert format_with_unit("gas.pressure", 1e-6) == "1e-06 Pa"


def test_changes_of_fitted_numbers_are_printed_in_their_natural_steps():
    assert change_unit("stage.test.wires.ring", 0.05) == ("mm", 1e3)
    assert change_unit("stage.test.wires.radius", 2e-4) == ("%", 1 / 2e-6)
    assert change_unit("stage.test.wires.s", -0.02) == ("mm", 1e3)
    assert change_unit("link.strap.stiffness.1", 0.0) == ("SI", 1.0)
