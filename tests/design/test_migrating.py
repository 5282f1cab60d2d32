"""Another model's matrices, derived by others with other means, have the frequencies of ours; and
the names given for migrating exist."""

from __future__ import annotations

import re
import tomllib

import numpy as np
import pytest

from suspension_cli.design import bodies, schema, wires
from suspension_cli.design.reader import read
from suspension_cli.linear import eigenmodes
from suspension_cli.models import registry
from tests.support.golden import CONFIGS, ROOT

PAGE = (ROOT / "docs" / "migrating.md").read_text()
FAMILIES = {
    "longitudinal, pitch": ("x", "pitch"),
    "transverse, roll": ("y", "roll"),
    "vertical": ("z",),
    "yaw": ("yaw",),
}
KINDS = {
    "wires": wires.WireSet,
    "blades": wires.BladeSet,
    "body": bodies.Body,
    "constants": schema.Constants,
    "materials.NAME": schema.Material,
}

NUMBERS = ROOT / "measured" / "ligo" / "ligo-quad-2005.toml"
THEIRS = tomllib.loads(NUMBERS.read_text("utf-8"))["modes"]
"""Frequencies in Hz that the matrices of M. Barton's Mathematica model (symbexport4.m) have with
the numbers of quadopt.m: docs/migrating.md."""


def frequencies(level: str) -> dict[str, np.ndarray]:
    """Ours, by family, ascending."""
    design = read(CONFIGS / "ligo-quad-2005.toml").design
    found = eigenmodes.solve(registry.by_name(level).system(design))
    return {
        family: np.sort([f for dof in dofs for f in found.of(dof)])
        for family, dofs in FAMILIES.items()
    }


@pytest.mark.parametrize("family", FAMILIES)
def test_string_has_their_frequencies(family):
    np.testing.assert_allclose(frequencies("string")[family], THEIRS[family], rtol=0, atol=0.6e-8)


def test_other_models_differ_as_the_page_says():
    string, force, beam = (
        np.concatenate(list(frequencies(level).values())) for level in ("string", "force", "beam")
    )
    assert np.max(np.abs(beam / string - 1)) < 5.5e-4
    assert np.max(np.abs(force / string - 1)) == pytest.approx(0.32, abs=0.005)


def test_keys_of_ours_exist():
    named = re.findall(r"`(wires|blades|body|constants|materials\.NAME)\.(\w+)", PAGE)
    assert len(named) >= 15
    for kind, key in named:
        assert key in KINDS[kind].__struct_fields__, f"{kind}.{key}"
