"""Modes of suspensions whose wires have mass, and of many bodies: all of them and no others, with
the Q that a lossy system has."""

from __future__ import annotations

import math

import numpy as np
import pytest
import scipy.linalg

import suspension_cli as sus
from suspension_cli.design.reader import parse, read
from suspension_cli.drawing import draw
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.linear import damped, eigenmodes, response, roots, signals
from suspension_cli.linear.pencil import Block
from suspension_cli.linear.solver import Solver
from suspension_cli.models import registry
from suspension_cli.physics import wire_modes
from tests.support import finite_elements, scenes
from tests.support.large_tower import large_tower
from tests.support.paths import CONFIGS

ELEMENTS = 16


def random_design(seed):
    """One or two stages on steel wires, round or ribbons, with or without blades; every third has
    no symmetry left in its wires."""
    rng = np.random.default_rng([77, seed])
    kind = seed % 4
    raw = (
        scenes.chain(rng, 1)
        if kind < 2
        else scenes.chain(rng, 2)
        if kind == 2
        else scenes.bladed_chain(rng, 1, tip_mass=bool(seed % 8 < 4), lateral=False)
    )
    return scenes.fibred(raw, rng.uniform(2e8, 8e8), ribbons=bool(rng.random() < 0.3))


@pytest.mark.parametrize("seed", range(4))
def test_modes_are_those_of_finite_elements(seed):
    """Their frequencies, and their number in every gap that is wider than finite elements are
    wrong; both polarisations of violin modes lie within a gap."""
    raw = random_design(seed)
    design = scenes.design_of(raw)
    model = registry.VIOLIN.system(design)
    scene = finite_elements.with_fibres(scenes.scene_of(raw), design)
    highest = finite_elements.limit(scene, ELEMENTS)
    expected = finite_elements.frequencies(scene, ELEMENTS)
    frequency, below = finite_elements.between(expected[expected < highest])
    assert len(frequency) >= 6
    assert roots.modes_below(model, 2 * np.pi * frequency).tolist() == below.tolist()
    found = wire_modes.solve(model, highest).frequency
    assert found == pytest.approx(expected[: len(found)], rel=3e-3)
    assert found[:6] == pytest.approx(expected[:6], rel=2e-4)


def _first_violin(model):
    strand = model.terms[0].strand
    return strand.held_resonances("bend-1", 1.0)[0] / (2 * np.pi)


@pytest.mark.parametrize("which", ["body", "violin"])
def test_q_is_the_width_of_the_resonance(which):
    """Lossy enough to be resolved: half the peak's power at f (1 +- 1/2Q), from the response
    alone."""
    raw = scenes.fibred(scenes.chain(np.random.default_rng(11), 1), 5e8)
    raw["materials"] = {
        "steel302": {"loss": {"angle": 2e-4 if which == "body" else 5e-2, "thermoelastic": False}}
    }
    model = registry.VIOLIN.system(scenes.design_of(raw))
    found = wire_modes.solve(model, 1.2 * _first_violin(model))
    known = signals.bodies_with_signals(model)
    drive, motion = (
        [signals.parse_input("mass1.force_x", known)],
        [signals.parse_output("mass1.x", known)],
    )
    violin = np.flatnonzero(
        (found.order == 1) & (found.fractions[:, list(found.place).index("mass1.x")] > 1e-8)
    )
    number = (
        int(np.flatnonzero([home == ("mass1", "x") for home in found.home])[0])
        if which == "body"
        else int(violin[-1])
    )
    f, q = found.frequency[number], found.q[number]
    grid = f * (1 + np.linspace(-8, 8, 4001) / q)
    power = -response.solve(model, grid, drive, motion).value[:, 0, 0].imag
    power -= np.interp(grid, grid[[0, -1]], power[[0, -1]]) * 0
    high = np.flatnonzero(power >= power.max() / 2)
    assert grid[power.argmax()] == pytest.approx(f, rel=1 / q)
    assert (grid[high[-1]] - grid[high[0]]) / f == pytest.approx(1 / q, rel=0.03)


def test_dilution_of_a_pendulum_on_one_wire():
    """E_total / E_bending = 2 L / u if the mass may turn, L / u if it may not (u = sqrt(EI / T);
    Gonzalez and Saulson 1994)."""
    stage = scenes.hung(
        {"count": 1, "l": 0.5, "material": "c70steel", "radius": 1e-4, "d": 0.0}, 1.0, 1e3
    )
    model = registry.BEAM.system(scenes.design_of({"design": {"name": "one"}, "stage": [stage]}))
    found = eigenmodes.solve(model)
    number = next(n for n, home in enumerate(found.home) if home[1] == "x")
    u = np.sqrt(2.12e11 * np.pi / 4 * 1e-16 / 9.81)
    # so much inertia does not turn
    assert found.dilution[number] == pytest.approx(0.5 / u, rel=0.02)


def test_held_twisting_is_diluted_by_tension_alone():
    """Wires that twist between bodies that all but stand still: every wire has its mode, with its
    energy in shear, which is lossy, and in its tension: 1 + T (r^2/2)/(G pi r^4/2)."""
    design = read(CONFIGS / "double.toml").design
    found = wire_modes.solve(registry.VIOLIN.system(design), 6000.0)
    for stage in design.stage:
        here = [n for n, home in enumerate(found.home) if home == (stage.name, "twist")]
        assert len(here) == stage.wires.count
        shear = 2.12e11 / (2 * (1 + 0.29)) * math.pi * stage.wires.radius**2
        pull = float(
            expand(design)
            .wires.tension[[label.startswith(stage.name) for label in expand(design).wires.label]]
            .mean()
        )
        assert found.dilution[here] == pytest.approx(1 + pull / shear, abs=1e-6)


@pytest.mark.parametrize("symmetric", [True, False])
def test_frequencies_are_those_of_the_matrices(symmetric: bool) -> None:
    model = registry.STRING.system(parse(large_tower(5, 3, 12, symmetric=symmetric)))
    assert model.size == 6 + 6 * 17
    found = eigenmodes.solve(model)
    square = scipy.linalg.eigh(model.stiffness[6:, 6:], model.mass[6:, 6:], eigvals_only=True)
    assert found.omega_squared == pytest.approx(square, rel=1e-7)


def test_drawing_and_check_of_many_bodies_stay_short() -> None:
    text = large_tower(5, 3, 12, symmetric=False)
    design = parse(text)
    figure = draw.draw(design, expand(design), tabulate=False)
    words = [text.get_text() for text in figure.findobj() if hasattr(text, "get_text")]
    assert words.count("left3b") == 1
    assert not any(word.endswith("kg") for word in words)
    lines = str(sus.check(sus.parse(text))).splitlines()
    assert sum("left3b.1 to 4" in line for line in lines) == 1
    assert max(len(line) for line in lines) < 120


KEYSTONE = """
[design]
name = "gas"
[[stage]]
name = "f"
body = { mass = 50.0, inertia = [2.0, 2.0, 3.0] }
[stage.wires]
count = 4
l = 0.5
s = 0.1
t1 = 0.1
t2 = 0.1
d = 0.1
material = "maraging"
radius = 1e-3
[stage.filter]
frequency = 0.4
q = 30.0
lateral_stiffness = 1e8
tilt_stiffness = 1e7
keystone = { mass = 0.4 }
mass_coupling = 0.38
[[stage]]
name = "test"
body = { mass = 40.0, inertia = [0.5, 0.5, 0.5] }
wires = { count = 1, l = 4.0, d = 0.01, material = "maraging", radius = 4e-3 }
"""


def test_a_damped_keystone_lighter_than_its_wire_loses_no_mode():
    """Its vertical mode, at 1.9 kHz without the mass of the wire, moves far with it. Below 300 Hz
    all modes that the frequencies without loss promise are found, each once."""
    design = sus.parse(KEYSTONE).design
    model = registry.VIOLIN.system(design)
    with pytest.raises(damped.LostModeError, match="f-keystone vertical at 1883 Hz"):
        damped.solve(model)
    found = wire_modes.solve(model, 300.0, damping=True)
    number = roots.modes_below(model, 2 * np.pi * np.array([300.0]))[0]
    assert len(found.q) == number > 50
    light = damped.solve(registry.BEAM.system(design)).up_to(3.0)
    assert found.frequency[:9] == pytest.approx(light.frequency, rel=0.06)
    vertical = light.label.index("test vertical")
    assert found.q[vertical] == pytest.approx(30.0, rel=1e-3)


def test_a_degenerate_root_is_known_as_often_as_it_was_found():
    """Pendulum modes in x and y have one frequency: of both, one is new if one is known."""
    model = registry.BEAM.system(sus.parse(KEYSTONE).design)
    solver = Solver(model)
    pencil = solver.pencil
    order = np.argsort(pencil.owner[6:], kind="stable")
    blocks = [Block(pencil, 6 + order, np.ones(6, dtype=bool))]
    undamped = solver.constant.modes.select(slice(9))
    shapes = np.pad(undamped.shape, ((0, 0), (6, 0))) @ model.basis
    values = 1j * np.sqrt(undamped.omega_squared)
    start = roots.Roots.starts(blocks, values, np.zeros(9, dtype=int), shapes)
    found = roots.find_roots(pencil, blocks, start)
    assert found.value[0] == pytest.approx(found.value[1], rel=1e-9)
    pair = [
        roots.mark_known(pencil, blocks, found, found.value[:number])[:2].sum()
        for number in (0, 1, 2)
    ]
    assert pair == [0, 1, 2]
    assert (
        roots.mark_known(pencil, blocks, found, found.value[2:]).tolist()
        == [False] * 2 + [True] * 7
    )


def test_nearly_equal_pairs_are_resolved():
    """Violin modes of one wire in two planes whose thickness differs by a part in 1e9."""
    raw = scenes.fibred(scenes.chain(np.random.default_rng(5), 1), 5e8, ribbons=True)
    side = 3e-4
    raw["stage"][0]["wires"]["section"] = {"width": side * (1 + 1e-9), "thickness": side}
    model = registry.VIOLIN.system(scenes.design_of(raw))
    found = wire_modes.solve(model, 1.2 * _first_violin(model))
    kinds = [home[1] for home, order in zip(found.home, found.order, strict=True) if order]
    assert kinds.count("violin-x") == kinds.count("violin-y") == len(kinds) // 2 > 0
    strand = model.terms[0].strand
    soft, stiff = (strand.held_resonances(part, 1.0)[0] for part in ("bend-1", "bend-2"))
    assert 0 < stiff / soft - 1 < 1e-9
    frequency = found.frequency[found.order > 0]
    assert (np.diff(frequency) >= 0).all()
    assert np.abs(frequency[0] * 2 * np.pi / soft - 1) < 1e-3


@pytest.mark.parametrize("seed", [0, 2, 3])
def test_modes_are_orthogonal_and_their_energy_is_all_there(seed):
    """Shares sum to 1; at a mode the dynamic stiffness of the bodies takes its shape to nothing."""
    design = scenes.design_of(random_design(seed))
    model = registry.VIOLIN.system(design)
    found = wire_modes.solve(model, 1.3 * _first_violin(model))
    assert found.fractions.sum(1) == pytest.approx(1.0, abs=1e-9)
    assert (found.fractions > -1e-12).all()
    assert (found.order > 0).any()
    bodies = eigenmodes.solve(registry.BEAM.system(design))
    # the mass of wires, at most 1 % of the bodies'
    assert found.frequency[:6] == pytest.approx(bodies.frequency[:6], rel=2e-3)
    assert found.q[:6] == pytest.approx(bodies.q[:6], rel=2e-2)
