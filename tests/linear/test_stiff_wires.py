"""Blades far softer than their wires: nothing of a blade may drown in a nearly rigid wire, on any
model, up to 1e10 times its stiffness."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest

from suspension_cli.conventions import DOFS
from suspension_cli.design import reader
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.linear import batch_modes, eigenmodes, mode_pairing, response, signals
from suspension_cli.models import registry
from suspension_cli.physics import thermal_noise, wire_modes
from suspension_cli.quantities import solved
from suspension_cli.quantities.needs import Needs
from suspension_cli.scene.scene import stack_scenes
from tests.support.golden import ROOT
from tests.support.soft_blades_mp import column

REQUIRED = 1e-9
RATIOS = (1e2, 1e6, 1e10)
SOFT = 394.0
"""N/m of a blade of its upper stage."""


def geo_tables(ratio, stages=3, tip_mass=0.0, *, fibres=False):
    """The triple pendulum of GEO 600 (or its upper stages) on wires in the two upper stages that
    are so many times stiffer than their blades."""
    raw = tomllib.loads((ROOT / "configs" / "geo-silica-triple.toml").read_text())
    raw["stage"] = raw["stage"][:stages]
    if fibres:  # of several sections; on blades, and rigid too
        raw["stage"][2]["blades"] = {"count": 4, "stiffness": SOFT}
    for stage in raw["stage"][: 3 if fibres else 2]:
        stage["wires"]["k"] = float(ratio) * SOFT
        stage["blades"]["tip_mass"] = tip_mass
    return raw


def geo(*arguments, **more):
    return reader.convert(geo_tables(*arguments, **more))


def responses(model, frequency, inputs, outputs):
    known = signals.bodies_with_signals(model)
    drives = [signals.parse_input(name, known) for name in inputs]
    seen = [signals.parse_output(name, known) for name in outputs]
    return response.solve(model, np.asarray(frequency, dtype=float), drives, seen).value


@pytest.mark.parametrize("ratio", RATIOS[::2])
@pytest.mark.parametrize("level", ["string", "beam", "violin"])
def test_column_of_rods(level, ratio):
    """Vertical motion: blades and rods in series, with losses; thermal noise and modes (the
    response is a row of `tests/linear/test_stability.py`)."""
    raw, exact = column(ratio, massive=level == "violin")
    model = registry.by_name(level).system(reader.convert(raw))
    frequency = np.array([0.01, 1.0, 2.5, 40.0])
    if level != "string":
        [found] = thermal_noise.solve(
            model, frequency, [thermal_noise.parse_motion(model, "test.z")], 290.0
        )
        noise = found.density.sum(0)
        assert np.abs(noise / [exact.density(f, 290.0) for f in frequency] - 1).max() < REQUIRED
    found = wire_modes.solve(model, 20.0) if level == "violin" else eigenmodes.solve(model)
    vertical = found.of("z")
    assert len(vertical) >= 2
    assert max(abs(f / exact.frequency_near(f) - 1) for f in vertical[:2]) < REQUIRED


def assert_linear(values):
    """Values at ratios of 1e8, 1e9 and 1e10 that go to a limit as 1/k lie on a straight line."""
    expected = values[1] + (values[1] - values[0]) / 10
    assert (np.abs(values[2] - expected) <= REQUIRED * np.abs(values[2])).all()


@pytest.mark.parametrize(
    "parts", [{}, {"fibres": True}, {"tip_mass": 0.02}], ids=["wires", "fibres", "tips"]
)
@pytest.mark.parametrize("level", ["string", "beam", "violin"])
def test_rigid_wires_are_a_limit(level, parts):
    """Every response of leaning wires, of which no closed form is at hand."""
    models = [registry.by_name(level).system(geo(ratio, **parts)) for ratio in (1e8, 1e9, 1e10)]
    outputs = [f"{body}.{dof}" for body in models[0].body for dof in DOFS]
    assert_linear(
        [
            responses(model, [0.05, 1.0, 7.0], [f"support.{dof}" for dof in DOFS], outputs)
            for model in models
        ]
    )


@pytest.mark.parametrize("level", ["string", "beam", "violin"])
def test_modes_of_rigid_wires_are_a_limit(level):
    """Frequencies and Q."""
    models = [registry.by_name(level).system(geo(ratio, stages=2)) for ratio in (1e8, 1e9, 1e10)]
    found = [
        wire_modes.solve(model, 1.6) if level == "violin" else eigenmodes.solve(model).up_to(1.6)
        for model in models
    ]
    assert len(found[0].q) >= 5
    assert_linear([one.frequency for one in found])
    if level != "string":
        assert_linear([one.q for one in found])


@pytest.mark.parametrize("tip_mass", [0.0, 0.02])
@pytest.mark.parametrize("ratio", RATIOS[1:])
def test_modes_of_batches(ratio, tip_mass):
    """`tolerance` finds the modes of a design without imperfections, from one matrix in doubles."""
    design = geo(ratio, tip_mass=tip_mass)
    scene = stack_scenes([expand(design)] * 2)
    found = solved.of_builds(scene, design, registry.STRING.name, Needs())
    alone = batch_modes.solve(registry.STRING.system(design))
    order = mode_pairing.pair_batch(alone.shape, found.spectrum.shape)
    squared = np.take_along_axis(found.spectrum.omega_squared, order, axis=-1)
    # A heavy tip on a nearly rigid wire stays a coordinate, whose stiffness is the sum of both:
    # some roundings (2e-16) of it, 12e-16 of the ratio with the worst library.
    lost = 5e-15 * ratio if tip_mass else 0.0
    assert squared[1] == pytest.approx(alone.omega_squared, rel=REQUIRED + lost)
