"""Designs that differ in a number, solved as one batch: each is that of the design alone."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest
import tomli_w

from suspension_cli.linear import response
from suspension_cli.linear.signals import bodies_with_signals, parse
from suspension_cli.models import registry
from suspension_cli.studies import builds, variants
from tests.linear.test_stiff_wires import geo_tables
from tests.models.test_links import DAMPER, design_text
from tests.studies.test_derivatives import TILTED
from tests.support import scenes
from tests.support.designs import overridden
from tests.support.paths import CONFIGS

DOUBLE = (CONFIGS / "double.toml").read_text()


def in_field():
    """Wires with weight, on blades, in a tilted field with a gradient."""
    raw = scenes.fibred(scenes.bladed_chain(np.random.default_rng(4), 2, tip_mass=True))
    return tomli_w.dumps(scenes.plain(raw | {"constants": TILTED}))


def damped():
    """Dampers against the support and between stages, whose heights differ in the batch."""
    raw = tomllib.loads(DOUBLE)
    raw["stage"][0]["damping"] = {"x": 3.0, "pitch": 0.02}
    raw["stage"][1]["damping"] = {"y": 2.0, "against": "upper"}
    return tomli_w.dumps(raw)


def twisted():
    """One wire of given torsion, with losses."""
    wires = {"count": 1, "l": 0.6, "d": 0.001, "material": "c70steel", "radius": 2e-4}
    stage = scenes.hung(wires | {"torsion": 0.3}, 9.0, 0.05)
    return tomli_w.dumps(scenes.raw_of(stage))


GENERAL = ("string", "beam", "violin")
CASES = {
    "single": (
        (CONFIGS / "husman2000" / "table1-case3.toml").read_text(),
        "stage.test.wires.l",
        [0.3, 0.4, 0.5],
        ("closed-form", "force", *GENERAL),
        ("support.x", "test.force_z"),
    ),
    "torsion": (
        twisted(),
        "stage.test.wires.torsion",
        [0.1, 0.3, 1.0],
        ("force", *GENERAL),
        ("support.yaw", "test.torque_yaw"),
    ),
    "dampers": (
        damped(),
        "stage.test.wires.d",
        [1e-3, 1.5e-3, 4e-3],
        ("force", *GENERAL),
        ("support.x", "test.force_y"),
    ),
    "field": (in_field(), "stage.mass1.body.mass", [7.0, 7.5], GENERAL, ("support.x", "support.z")),
    "links": (
        design_text(DAMPER),
        "link.link3.stiffness.1.1",
        [20.0, 40.0, 100.0],
        ("string",),
        ("ground.x", "support.x", "test~reaction.force_x", "ground.roll"),
    ),
    "rigid wires": (
        tomli_w.dumps(geo_tables(1e10, tip_mass=0.02)),
        "stage.test.body.mass",
        [5.6, 5.7],
        GENERAL,
        ("support.x", "support.z"),
    ),
}


@pytest.mark.parametrize(
    ("case", "level"), [(case, level) for case, row in CASES.items() for level in row[3]]
)
def test_each_design_of_a_batch_is_that_design_alone(case, level):
    """Matrices, and responses of all bodies at three frequencies."""
    text, path, values, _, driven = CASES[case]
    frequency, reached = np.array([0.05, 1.7, 60.0]), []
    for found, here in variants.balanced(
        variants.designs_at(text, {path: np.array(values)}), level, allow_unstable=True
    ):
        assert (found.status == builds.GOOD).all()
        known = bodies_with_signals(found.model)
        inputs = [parse(name, "", known) for name in driven]
        bodies = ("support", *found.model.body)
        outputs = [parse(f"{body}.{dof}", "", known) for body in bodies for dof in "xz"]
        batch = builds.transfer(found, frequency, inputs, outputs)
        for n, place in enumerate(here):
            alone = registry.by_name(level).system(overridden(text, {path: values[place]}))
            assert found.model.coordinate == alone.coordinate
            for name in ("mass", "stiffness", "damping"):
                own, other = (
                    system.basis
                    @ np.broadcast_to(getattr(system, name), (*batch_of, alone.size, alone.size))[k]
                    @ system.basis.T
                    for system, batch_of, k in ((found.model, (len(here),), n), (alone, (1,), 0))
                )
                assert np.abs(own - other).max() <= 1e-9 * np.abs(other).max(), name
            expected = response.solve(alone, frequency, inputs, outputs).value
            size = np.abs(expected).max((1, 2), keepdims=True)
            assert (np.abs(batch[n] - expected) <= 1e-9 * np.abs(expected) + 1e-12 * size).all()
        reached += here.tolist()
    assert sorted(reached) == list(range(len(values)))
