"""What wires are made of: from design files to sections, against textbook values, quadrature and
series."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy import integrate

from suspension_cli.design import materials
from suspension_cli.design.cross_sections import circle, rectangle_torsion
from suspension_cli.design.derive import part_loss, wire_loss, wire_stiffness
from suspension_cli.design.materials import Bulk, Thermoelastic
from suspension_cli.design.reader import convert
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.scene.fibres import compose, explain_unsuitable
from tests.support.commandline import edited
from tests.support.designs import RAW

WIRES = ("stage", 0, "wires")
SINGLE = edited(
    RAW["single"], {(*WIRES, "l"): 0.28, (*WIRES, "material"): "fused-silica", ("materials",): {}}
)


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


ROUND = {"radius": 2e-4}
RIBBON = {"section": {"width": 1e-3, "thickness": 1e-4}}


@pytest.mark.parametrize("keys", [ROUND, RIBBON], ids=["round", "ribbon"])
def test_one_section(keys):
    """Of fused silica; a ribbon bends in x first."""
    r, (b, d) = 2e-4, (1e-3, 1e-4)
    moments, area, torsion, across = (
        ((math.pi * r**4 / 4,) * 2, math.pi * r**2, math.pi * r**4 / 2, (2 * r, 2 * r))
        if keys is ROUND
        else ((b * d**3 / 12, d * b**3 / 12), b * d, rectangle_torsion(b, d), (d, b))
    )
    raw = edited(SINGLE, {(*WIRES, key): value for key, value in keys.items()})
    if keys is RIBBON:
        del raw["stage"][0]["wires"]["radius"]
    fibre = compose(convert(raw)).wire[0]
    (section,) = fibre.sections
    young, density = 7.2e10, 2200.0
    assert section.length == pytest.approx(0.28, rel=1e-12)
    assert section.rigidity == pytest.approx([young * one for one in moments], rel=1e-12)
    assert section.stretching == pytest.approx(young * area, rel=1e-12)
    assert section.twisting == pytest.approx(young / 2.34 * torsion, rel=1e-12)
    assert section.mass == pytest.approx(density * area, rel=1e-12)
    assert section.polar == pytest.approx(density * sum(moments), rel=1e-12)
    assert section.shape.depth == pytest.approx(across, rel=1e-12)
    assert section.round == (keys is ROUND)
    assert abs(fibre.plane[0]) > 0.99


def test_torsion_of_rectangles():
    """Timoshenko and Goodier's table: 0.1406 a^4 and so on; the thin limit; any order of the
    sides."""
    for ratio, factor in ((1.0, 0.1406), (2.0, 0.229), (10.0, 0.312)):
        assert rectangle_torsion(ratio, 1.0) == pytest.approx(factor * ratio, rel=3e-3)
    assert rectangle_torsion(1.0, 1.0) == pytest.approx(0.140577, abs=1e-6)
    thin = 1e-18 / 3 * (1 - 0.63025 * 1e-2)
    assert rectangle_torsion(1e-3, 1e-5) == pytest.approx(thin, rel=1e-6)
    assert rectangle_torsion(1.0, 3.0) == rectangle_torsion(3.0, 1.0)


THICK = (
    {"length": 0.01, "radius": 4e-4},
    {"length": 0.005, "radius": [4e-4, 1.25e-4]},
    {"radius": 1.25e-4},
    {"length": 0.02, "radius": 4e-4},
)


@pytest.mark.parametrize("k", [None, 1e4])
def test_series_of_sections(k):
    """A taper's compliance is L/(E pi a b) exactly; the open section takes the rest; strings know
    the same k. A given one scales all sections and leaves their bending."""
    design = convert(in_sections(*THICK, **({} if k is None else {"k": k})))
    compliance = (0.03 / 4e-4**2 + 0.005 / (4e-4 * 1.25e-4) + 0.245 / 1.25e-4**2) / (
        7.2e10 * math.pi
    )
    expected = 1 / compliance if k is None else k
    assert wire_stiffness(design, design.stage[0].wires, 0.28) == pytest.approx(expected, rel=1e-12)
    assert expand(design).wires.stiffness == pytest.approx(expected, rel=1e-12)
    sections = compose(design).wire[0].sections
    assert len(sections) == 19
    along = sum(section.length / section.stretching for section in sections)
    assert 1 / along == pytest.approx(expected, rel=1e-12)
    assert sum(section.length for section in sections) == pytest.approx(0.28, rel=1e-14)
    assert sections[0].rigidity[0] == pytest.approx(7.2e10 * math.pi * 4e-4**4 / 4, rel=1e-12)


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


def test_clamps_of_a_set_are_mirrored():
    given = {"upper": [0.02, 0.01, -2.0]}
    found = compose(made({(*WIRES, "clamp"): given})).wire
    unit = np.array([0.02, 0.01, -2.0]) / math.sqrt(0.02**2 + 0.01**2 + 4)
    for fibre, mirror in zip(found, [(1, 1, 1), (1, -1, 1), (-1, 1, 1), (-1, -1, 1)], strict=True):
        np.testing.assert_allclose(fibre.clamp[0], unit * mirror, rtol=1e-14)
    scene = expand(made({}))
    for fibre, span, length in zip(found, scene.wires.span, scene.wires.length, strict=True):
        np.testing.assert_allclose(fibre.clamp[1], span / length, rtol=1e-14)


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
    for given, name in (
        ({"loss": {"thermoelastic": False}}, "fused-silica"),
        ({"youngs_modulus": 7e10, "density": 2200.0, "specific_heat": 700.0}, "mine"),
    ):
        assert not any(isinstance(own, Thermoelastic) for own in resolved(given, name)[0])
    assert not any(resolved({}, name)[1] for name in materials.BUILT_IN)
    assert (tabled.angle, tabled.surface_depth, string) == (0.0, 0.0, 0.0)


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
    ends = (((0, 0, 0), (0, 0, 0)), ((0.3, 0, -0.3), (0.1, 0, 0)), ((-0.1, 0, -0.3), (0.1, 0, 0)))
    made_of = {"material": "steel302", "radius": 1e-4}
    wires = [{"upper": [*a], "lower": [*b], **made_of} for a, b in ends]
    for wire in wires[1:]:
        wire["tension"] = 1.0
    edits = {("stage", 0, "position"): [0.0, 0.0, -0.3], ("stage", 0, "wire"): wires}
    raw = edited(SINGLE, edits)
    del raw["stage"][0]["wires"]
    found = compose(convert(raw)).wire
    np.testing.assert_allclose(found[1].plane, [0.0, 1.0, 0.0])
    np.testing.assert_allclose(found[0].plane, [1.0, 0.0, 0.0])
