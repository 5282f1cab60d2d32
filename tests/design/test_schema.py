"""`pendsus schema`: a JSON Schema that editors can rely on."""

from __future__ import annotations

import tomllib
from pathlib import Path

import jsonschema
import pytest

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
