"""What wires are made of: from design files to sections, against textbook values, quadrature and
series."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy import integrate

from suspension_cli.conventions import AVOGADRO
from suspension_cli.design import materials
from suspension_cli.design.cross_sections import circle, rectangle_torsion
from suspension_cli.design.derive import part_loss, wire_loss, wire_stiffness
from suspension_cli.design.losses import Bulk, Thermoelastic
from suspension_cli.design.reader import convert, read
from suspension_cli.design.sections import Stretch, stretches
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.scene.fibres import compose, explain_unsuitable
from tests.support.commandline import edited, run, strict_json, written
from tests.support.designs import RAW
from tests.support.golden import configs

WIRES = ("stage", 0, "wires")
SINGLE = edited(
    RAW["single"], {(*WIRES, "l"): 0.28, (*WIRES, "material"): "fused-silica", ("materials",): {}}
)

ROUND = {"material": "wire", "radius": 1e-4}
RICH = edited(
    RAW["rich"],
    {
        (*place, key): value
        for place in (("stage", 0, "wire", 1), ("stage", 2, "wires"))
        for key, value in ROUND.items()
    },
)
"""A tree with everything in it, all of whose wires could be beams."""


def made(edits: Any, base: Any = SINGLE) -> Any:
    return convert(edited(base, edits))


def first(edits: Any, base: Any = SINGLE) -> Any:
    return compose(made(edits, base)).wire[0]


def in_sections(*parts: Any, **more: Any) -> Any:
    """The single pendulum on wires of several sections."""
    raw = edited(
        SINGLE,
        {
            (*WIRES, "sections"): list(parts),
            **{(*WIRES, key): value for key, value in more.items()},
        },
    )
    del raw["stage"][0]["wires"]["radius"]
    return raw


def test_round_wire():
    (section,) = first({(*WIRES, "radius"): 2e-4}).sections
    young, r = 7.2e10, 2e-4
    assert section.length == pytest.approx(0.28, rel=1e-12)
    assert section.rigidity == pytest.approx((young * math.pi * r**4 / 4,) * 2, rel=1e-12)
    assert section.stretching == pytest.approx(young * math.pi * r**2, rel=1e-12)
    assert section.twisting == pytest.approx(young / (2 * 1.17) * math.pi * r**4 / 2, rel=1e-12)
    assert (section.mass, section.polar) == pytest.approx(
        (2200 * math.pi * r**2, 2200 * math.pi * r**4 / 2), rel=1e-12
    )
    assert section.shape.depth == pytest.approx((4e-4, 4e-4), rel=1e-12)
    assert section.round


def test_ribbon():
    raw = edited(SINGLE, {(*WIRES, "section"): {"width": 1e-3, "thickness": 1e-4}})
    del raw["stage"][0]["wires"]["radius"]
    fibre = compose(convert(raw)).wire[0]
    (section,) = fibre.sections
    young = 7.2e10
    assert section.rigidity == pytest.approx(
        (young * 1e-3 * 1e-12 / 12, young * 1e-4 * 1e-9 / 12), rel=1e-12
    )
    assert section.twisting == pytest.approx(
        young / 2.34 * rectangle_torsion(1e-3, 1e-4), rel=1e-12
    )
    assert section.shape.depth == (1e-4, 1e-3)
    assert section.polar == pytest.approx(2200 * (1e-15 + 1e-13) / 12, rel=1e-12)
    assert not section.round
    assert abs(fibre.plane[0]) > 0.99


def test_torsion_of_rectangles():
    """Timoshenko and Goodier's table: 0.1406 a^4 and so on; the thin limit; any order of the
    sides."""
    for ratio, factor in (
        (1.0, 0.1406),
        (1.2, 0.166),
        (1.5, 0.196),
        (2.0, 0.229),
        (3.0, 0.263),
        (5.0, 0.291),
        (10.0, 0.312),
    ):
        assert rectangle_torsion(ratio, 1.0) == pytest.approx(factor * ratio, rel=3e-3)
    assert rectangle_torsion(1.0, 1.0) == pytest.approx(0.140577, abs=1e-6)
    assert rectangle_torsion(1e-3, 1e-5) == pytest.approx(
        1e-18 / 3 * (1 - 0.63025 * 1e-2), rel=1e-6
    )
    assert rectangle_torsion(1.0, 3.0) == rectangle_torsion(3.0, 1.0)


@pytest.mark.parametrize("config", configs(), ids=lambda path: path.stem)
def test_in_the_order_of_the_scene(config):
    design = read(config).design
    scene = expand(design)
    if explain_unsuitable(design, massive=False):
        return
    found = compose(design)
    assert tuple(fibre.label for fibre in found.wire) == scene.wires.label
    assert tuple(blade.label for blade in found.blade) == scene.blades.label
    drawn = (scene.drawn or scene).wires
    for fibre, k, length, span in zip(
        found.wire, drawn.stiffness, drawn.length, drawn.span, strict=True
    ):
        assert 1 / sum(
            section.length / section.stretching for section in fibre.sections
        ) == pytest.approx(k, rel=1e-12)
        assert sum(section.length for section in fibre.sections) == pytest.approx(length, rel=1e-12)
        assert fibre.plane @ fibre.plane == pytest.approx(1, rel=1e-12)
        assert abs(fibre.plane @ span) < 1e-12
        for direction in fibre.clamp:
            assert direction @ direction == pytest.approx(1, rel=1e-12)
            assert direction @ span > 0


THICK = (
    {"length": 0.01, "radius": 4e-4},
    {"length": 0.005, "radius": [4e-4, 1.25e-4]},
    {"radius": 1.25e-4},
    {"length": 0.02, "radius": 4e-4},
)


def test_series_of_sections():
    """A taper's compliance is L/(E pi a b) exactly; the open section takes the rest; strings know
    the same k."""
    design = convert(in_sections(*THICK))
    young = 7.2e10
    compliance = (0.03 / 4e-4**2 + 0.005 / (4e-4 * 1.25e-4) + 0.245 / 1.25e-4**2) / (
        young * math.pi
    )
    wires = design.stage[0].wires
    assert wire_stiffness(design, wires, 0.28) == pytest.approx(1 / compliance, rel=1e-12)
    assert expand(design).wires.stiffness == pytest.approx(1 / compliance, rel=1e-12)
    fibre = compose(design).wire[0]
    assert len(fibre.sections) == 19
    assert sum(section.length / section.stretching for section in fibre.sections) == pytest.approx(
        compliance, rel=1e-12
    )
    assert sum(section.length for section in fibre.sections) == pytest.approx(0.28, rel=1e-14)
    given = convert(in_sections(*THICK, k=1e4))
    assert 1 / sum(
        section.length / section.stretching for section in compose(given).wire[0].sections
    ) == pytest.approx(1e4, rel=1e-12)
    assert compose(given).wire[0].sections[0].rigidity == fibre.sections[0].rigidity


def test_materials_of_sections():
    """Steel ends on a fibre of silica; each has its losses and the whole its loss in stretching."""
    parts = ({"length": 0.1, "radius": 2e-4, "material": "mine"}, {"radius": 1e-4})
    raw = edited(
        in_sections(*parts), {("materials", "mine"): {"youngs_modulus": 2e11, "loss_angle": 1e-3}}
    )
    design = convert(raw)
    upper, lower = compose(design).wire[0].sections
    assert (upper.losses, upper.mass) == ((Bulk(1e-3),), 0.0)
    assert lower.losses[0] == Bulk(4.1e-10, surface_depth=1.5e-2)
    moduli = [one.rigidity[0] / one.shape.moments[0] for one in (upper, lower)]
    assert moduli == pytest.approx([2e11, 7.2e10], rel=1e-15)
    shares = [0.1 / (2e11 * 4e-8), 0.18 / (7.2e10 * 1e-8)]
    assert wire_loss(design, design.stage[0].wires, 0.28) == pytest.approx(
        1e-3 * shares[0] / sum(shares), rel=1e-12
    )
    assert explain_unsuitable(design, massive=False) == ""
    assert (
        explain_unsuitable(design, massive=True) == "wire test.1 is of mine, which has no density"
    )


def test_lengths_that_miss_a_little_are_shared_out():
    fibre = compose(
        convert(
            in_sections({"length": 0.14, "radius": 2e-4}, {"length": 0.14 + 1e-8, "radius": 1e-4})
        )
    ).wire[0]
    assert sum(section.length for section in fibre.sections) == pytest.approx(0.28, rel=1e-15)


@pytest.mark.parametrize(("a", "b"), [(4e-4, 1e-4), (1e-4, 3e-4), (2e-4, 2e-4)])
def test_step_of_a_taper(a, b):
    """Every property is the mean along the cone that its docstring says, by quadrature."""

    def mean(power):
        return integrate.quad(lambda s: (a + (b - a) * s) ** power, 0, 1, epsabs=0, epsrel=1e-12)[0]

    step = circle(a, b)
    assert math.pi / step.area == pytest.approx(mean(-2), rel=1e-10)
    assert math.pi / 4 / step.moments[0] == pytest.approx(mean(-4), rel=1e-10)
    assert math.pi / 2 / step.torsion == pytest.approx(mean(-4), rel=1e-10)
    assert step.bulk == pytest.approx((math.pi * mean(2), math.pi / 2 * mean(4)), rel=1e-10)


def bent(pieces: list[Stretch], tension: float, young: float) -> float:
    """Sideways stiffness of one end of a wire whose ends stay upright: each piece's cosh and sinh,
    chained."""
    chain = np.eye(4)
    for piece in pieces:
        rigidity = young * piece.shape.moments[0]
        k = math.sqrt(tension / rigidity)
        c, s = math.cosh(k * piece.length), math.sinh(k * piece.length)
        # deflection, slope, moment, and the side force, which stays
        step = np.array(
            [
                [1, s / k, (c - 1) / tension, (s / k - piece.length) / tension],
                [0, c, k * s / tension, (c - 1) / tension],
                [0, tension * s / k, c, s / k],
                [0, 0, 0, 1],
            ]
        )
        chain = step @ chain
    (force_of_moment, force_of_side), (deflect_moment, deflect_side) = chain[1, 2:], chain[0, 2:]
    side = 1.0
    moment = -force_of_side / force_of_moment * side
    return -side / (deflect_moment * moment + deflect_side * side)


def test_tapers_converge_with_the_square_of_a_step():
    def cone(steps):
        wire = (
            convert(in_sections({"radius": [4e-4, 1.25e-4], "steps": steps}, l=0.28)).stage[0].wires
        )
        return bent(stretches(wire, 0.005), 14.0, 7.2e10)

    def shape(s, state, end=0.005):
        """The same by integrating the equation of the beam."""
        rigidity = 7.2e10 * math.pi / 4 * (4e-4 - 2.75e-4 * s / end) ** 4
        _, slope, moment, side = state
        return [slope, moment / rigidity, 14.0 * slope + side, 0.0]

    columns = [
        integrate.solve_ivp(shape, (0, 0.005), start, method="DOP853", rtol=1e-12, atol=1e-14).y[
            :, -1
        ]
        for start in ([0, 0, 1.0, 0], [0, 0, 0, 1.0])
    ]
    moment = -columns[1][1] / columns[0][1]
    exact = -1 / (columns[0][0] * moment + columns[1][0])
    errors = [abs(cone(steps) / exact - 1) for steps in (16, 32, 64, 128)]
    orders = [math.log2(coarse / fine) for coarse, fine in pairwise(errors)]
    assert orders == pytest.approx([2, 2, 2], abs=0.1)
    assert errors[0] < 5e-3


def test_clamps_of_a_set_are_mirrored():
    given = {"upper": [0.02, 0.01, -2.0]}
    found = compose(made({(*WIRES, "clamp"): given})).wire
    unit = np.array([0.02, 0.01, -2.0]) / math.sqrt(0.02**2 + 0.01**2 + 4)
    for fibre, mirror in zip(found, [(1, 1, 1), (1, -1, 1), (-1, 1, 1), (-1, -1, 1)], strict=True):
        np.testing.assert_allclose(fibre.clamp[0], unit * mirror, rtol=1e-14)
    scene = expand(made({}))
    for fibre, span, length in zip(found, scene.wires.span, scene.wires.length, strict=True):
        np.testing.assert_allclose(fibre.clamp[1], span / length, rtol=1e-14)


def test_temperatures_and_gas():
    raw = edited(RICH, {("gas",): {"pressure": 1e-6, "molar_mass": 0.002}})
    raw = edited(
        raw,
        {
            ("stage", 1, "wires", "temperature"): {"upper": 80, "lower": 20.0},
            ("stage", 0, "wire", 0, "temperature"): 100,
        },
    )
    found = compose(convert(edited(raw, {("stage", 0, "blade", 0, "temperature"): 150.0})))
    assert [fibre.temperature for fibre in found.wire[:4]] == [
        (100.0, 100.0),
        (300.0, 300.0),
        (300.0, 300.0),
        (80.0, 20.0),
    ]
    assert [blade.temperature for blade in found.blade] == [150.0, 300.0, 300.0, 300.0]
    assert (found.gas.pressure, found.gas.temperature, found.temperature) == (1e-6, 300.0, 300.0)
    assert found.gas.molecule == pytest.approx(0.002 / AVOGADRO, rel=1e-14)
    assert compose(made({})).gas is None


BLADES = ("stage", 0, "blades")


def blade_of(**table: Any) -> Any:
    design = made({BLADES: {"count": 2, "stiffness": 1e3} | table})
    return compose(design).blade[0], part_loss(design, design.stage[0].blades)


def test_losses_of_blades():
    """Its own angle wins over the material's; the material of a geometry, or one that is named;
    strings know what a design gives."""
    bare, angle = blade_of()
    assert (bare.losses, bare.angle, bare.thickness, angle) == (None, 0.0, 0.0, 0.0)
    named, angle = blade_of(material="maraging", thickness=2e-3)
    assert (named.losses[0].angle, named.thickness, angle) == (1e-4, 2e-3, 0.0)
    own, angle = blade_of(material="maraging", thickness=2e-3, loss_angle=3e-5)
    bulk, heat = own.losses
    assert (bulk.angle, heat.expansion, own.angle, angle) == (3e-5, 1.1e-5, 3e-5, 3e-5)
    geometry = {
        "length": 0.2,
        "base_width": 0.04,
        "thickness": 2e-3,
        "shape_factor": 1.4,
        "material": "maraging",
    }
    design = made({BLADES: {"count": 2, "geometry": geometry}})
    (shaped, _) = compose(design).blade
    assert (shaped.losses[0].angle, shaped.thickness) == (1e-4, 2e-3)


def resolved(table: Any, name: str = "fused-silica") -> Any:
    design = made({("materials", name): table, (*WIRES, "material"): name})
    return compose(design).wire[0].sections[0].losses, wire_loss(
        design, design.stage[0].wires, 0.28
    )


def test_losses_of_materials():
    (bulk, heat), string = resolved({})
    assert (bulk, heat.heat_capacity, string) == (Bulk(4.1e-10, surface_depth=1.5e-2), 772.0, 0.0)
    for table in ({"loss_angle": 1e-6}, {"loss": {"angle": 1e-6}}):
        (own, _), string = resolved(table)
        # the built-in surface goes with the built-in bulk
        assert (own.angle, own.surface_depth, string) == (1e-6, 0.0, 1e-6)
    (both, _), _ = resolved({"loss": {"angle": 1e-6, "surface_depth": 1e-3}})
    assert (both.angle, both.surface_depth) == (1e-6, 1e-3)
    (rough, _), string = resolved({"loss": {"surface_depth": 1e-1}})
    assert (rough.angle, rough.surface_depth, string) == (4.1e-10, 1e-1, 0.0)
    (tabled, _), string = resolved(
        {"loss": {"table": {"frequency": [1.0, 10.0], "angle": [1e-9, 1e-8]}}}
    )
    np.testing.assert_array_equal(tabled.table, [[1.0, 10.0], [1e-9, 1e-8]])
    assert [own.name for own in resolved({}, "steel302")[0]] == ["thermoelastic"]
    assert (tabled.angle, tabled.surface_depth, string) == (0.0, 0.0, 0.0)


def test_thermoelastic_loss_is_left_out():
    """When the design says so, or when a value is missing."""
    for table in ({"loss": {"thermoelastic": False}}, {}):
        name = "fused-silica" if table else "mine"
        losses, _ = resolved(
            table
            or {
                "youngs_modulus": 7e10,
                "density": 2200.0,
                "specific_heat": 700.0,
                "thermal_conductivity": 1.4,
            },
            name,
        )
        assert not any(isinstance(own, Thermoelastic) for own in losses)


@pytest.mark.parametrize("name", materials.BUILT_IN)
def test_built_in_materials_leave_strings_without_loss(name):
    _, string = resolved({}, name)
    assert string == 0.0


def test_unsuited():
    assert explain_unsuitable(made({}), massive=True) == ""
    only_k = edited(SINGLE, {(*WIRES, "k"): 1e4})
    del only_k["stage"][0]["wires"]["radius"]
    assert explain_unsuitable(convert(only_k), massive=False) == "wire test.1 has no cross-section"
    no_stuff = edited(SINGLE, {(*WIRES, "k"): 1e4})
    del no_stuff["stage"][0]["wires"]["material"]
    assert explain_unsuitable(convert(no_stuff), massive=False) == "wire test.1 has no material"
    assert explain_unsuitable(convert(RAW["rich"]), massive=False).startswith("wire upper.2 has no")


def test_a_wire_along_x_bends_in_y_first():
    wire = {
        "upper": [0.1, 0.0, 0.0],
        "lower": [-0.1, 0.0, 0.0],
        "material": "steel302",
        "radius": 1e-4,
        "tension": 1.0,
    }
    carrying = {
        "upper": [0.0, 0.0, 0.0],
        "lower": [0.0, 0.0, 0.0],
        "material": "steel302",
        "radius": 1e-4,
    }
    pull = {**wire, "upper": [-0.1, 0.0, -0.3], "lower": [0.1, 0.0, 0.0]}
    level = {**wire, "upper": [0.3, 0.0, -0.3], "lower": [0.1, 0.0, 0.0]}
    raw = edited(
        SINGLE,
        {("stage", 0, "position"): [0.0, 0.0, -0.3], ("stage", 0, "wire"): [carrying, level, pull]},
    )
    del raw["stage"][0]["wires"]
    found = compose(convert(raw)).wire
    np.testing.assert_allclose(found[1].plane, [0.0, 1.0, 0.0])
    np.testing.assert_allclose(found[0].plane, [1.0, 0.0, 0.0])


def test_whole_numbers():
    """1 is as good as 1.0, in unions of numbers and tables too."""
    assert first(
        {(*WIRES, "temperature"): 4, (*WIRES, "clamp"): {"upper": [0, 0, -1]}}
    ).temperature == (4, 4)


@pytest.mark.parametrize(
    "parts",
    [
        THICK,
        ({"radius": [4e-4, 1.25e-4]},),
        ({"section": {"width": 1e-4, "thickness": 1e-4 * math.pi * 1.25**2}},),
    ],
)
def test_stress_is_that_of_the_thinnest_place(parts, tmp_path):
    """`check` reports the stress in the thinnest section, or at the thin end of a taper."""
    answer = strict_json(run("check", written(tmp_path, in_sections(*parts)), "--json").stdout)
    for wire in answer["wires"]:
        assert wire["stress_pa"] == pytest.approx(
            wire["tension_n"] / (math.pi * 1.25e-4**2), rel=1e-12
        )
