"""Loads of imperfect designs whose strings end at hinges (`bending = "hinged"`)."""

from __future__ import annotations

import tomllib

import numpy as np

from suspension_cli.analyses.check import statics
from suspension_cli.design import reader
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.models import registry
from suspension_cli.scene import stack
from tests.support.golden import CONFIGS


def test_tensions_of_an_imperfect_build_are_those_of_beams():
    """A string between hinges carries what the beam between the clamps carries, but for the
    energy of bending: 1e-5 here. Balanced between the clamps it differed by 0.4 %."""
    raw = tomllib.loads((CONFIGS / "husman2000" / "table2.toml").read_text())
    for stage in raw["stage"]:
        stage["wires"] = {**stage["wires"], "bending": "hinged"}
        del stage["wires"]["clamp"]
    raw["perturbation"] = [{"wire": "test.1", "length_change": -1e-4}]
    design = reader.parse(reader.write_toml(raw))
    beam = registry.scene_model("beam")
    scene = stack.stack_scenes([beam.completed(expand(design), design)])
    _, found = beam.in_equilibrium(scene, design)
    tensions = [load.tension for load in statics.solve(design).wires]
    np.testing.assert_allclose(tensions, found.tension[0], rtol=1e-5)
