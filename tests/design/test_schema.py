"""The JSON Schema that editors rely on, and units in the types of all numbers."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any, get_args, get_origin, get_type_hints

import jsonschema
import msgspec
import pytest

from suspension_cli.design.schema import Design
from tests.support.commandline import edited, run, strict_json
from tests.support.designs import RAW
from tests.support.faulty_designs import NUMBERS, TYPES
from tests.support.golden import configs

SCHEMA = strict_json(run("schema").stdout)
VALIDATOR = jsonschema.Draft202012Validator(SCHEMA)


def test_is_a_schema():
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    assert SCHEMA["$schema"] == "https://json-schema.org/draft/2020-12/schema"


@pytest.mark.parametrize("name", RAW)
def test_accepts_good_designs(name):
    VALIDATOR.validate(RAW[name])


@pytest.mark.parametrize("config", configs(), ids=lambda path: path.stem)
def test_accepts_the_designs_that_we_ship(config: Path):
    VALIDATOR.validate(tomllib.loads(config.read_text(encoding="utf-8")))


UNKNOWN = [
    (),
    ("design",),
    ("constants",),
    ("stage", 0),
    ("stage", 0, "body"),
    ("stage", 0, "wires"),
    ("materials", "steel302"),
    ("perturbation", 0),
]


@pytest.mark.parametrize("place", UNKNOWN, ids=lambda place: ".".join(map(str, place)))
def test_rejects_unknown_keys(place):
    base = edited(
        RAW["single"],
        {
            ("constants",): {},
            ("materials", "steel302"): {},
            ("perturbation",): [{"wire": "test.1", "k_factor": 2.0}],
        },
    )
    VALIDATOR.validate(base)
    assert not VALIDATOR.is_valid(edited(base, {(*place, "unheard_of"): 1}))


SAYABLE = [
    case for case in (*TYPES, *NUMBERS) if "finite" not in case.says and "2026" not in case.says
]
"""JSON has neither NaN nor dates."""


@pytest.mark.parametrize("case", SAYABLE, ids=lambda case: case.name)
def test_rejects_what_the_reader_rejects(case):
    assert not VALIDATOR.is_valid(edited(RAW[case.base], case.edits))


def test_every_number_is_described():
    """Editors show what a key means and its unit."""
    bare = [
        f"{table}.{key}"
        for table, content in SCHEMA["$defs"].items()
        for key, value in content.get("properties", {}).items()
        for kind in [value, *value.get("anyOf", [])]
        if kind.get("type") == "number" and "description" not in kind and "description" not in value
    ]
    assert bare == []


DEPENDS = {
    "AgainstTemperature": "values",
    "Damping": "x y z roll pitch yaw",
    "Damper": "damping",
    "Distribution": "normal uniform truncate",
    "FrameDamping": "x y z roll pitch yaw",
    "GainAt": "magnitude",
    "Link": "stiffness damping preload",
    "Loop": "damper gain sensor_noise actuator_noise",
    "MotionSpectrum": "asd",
    "NoiseSpectrum": "asd",
    "Osem": "sensor_noise force_noise driver_noise range sensing driving",
    "Requirement": "band below above",
    "RequiredQuantity": "at_least at_most",
    "Sensor": "motion sensor_noise",
    "SensorInput": "gain",
    "Spring": "stiffness damping preload",
    "StiffnessTable": "real imaginary static",
    "Wire": "temperature",
    "WireSet": "temperature",
}
"""Numbers whose unit depends on other keys."""


def unit(kind: object) -> str:
    """SI unit of a type of the design file; "" if it has none."""
    facts = [
        one.extra for one in getattr(kind, "__metadata__", ()) if isinstance(one, msgspec.Meta)
    ]
    return next((extra["unit"] for extra in facts if extra and "unit" in extra), "")


def without_unit(kind: Any, name: str, found: set[str]) -> set[str]:
    """Names of the fields below a type that hold a float without a unit."""
    if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
        for key, hint in get_type_hints(kind, include_extras=True).items():
            without_unit(hint, f"{kind.__name__}.{key}", found)
    elif unit(kind):
        pass
    elif hasattr(kind, "__metadata__"):
        without_unit(kind.__origin__, name, found)
    elif kind is float:
        found.add(name)
    elif get_origin(kind) is not None:
        for part in get_args(kind):
            without_unit(part, name, found)
    return found


def test_numbers_have_units():
    depends = {f"{table}.{key}" for table, keys in DEPENDS.items() for key in keys.split()}
    assert without_unit(Design, "", set()) == depends
