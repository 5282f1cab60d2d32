"""Temperatures from conducted heat, against closed forms."""

from __future__ import annotations

import math
import tomllib

import numpy as np
import pytest
from scipy.integrate import quad

import suspension_cli as sus
from suspension_cli.design import heat_flow, materials
from suspension_cli.design.reader import parse, write_toml
from suspension_cli.errors import InputError
from suspension_cli.physics.temperatures import find_unknown_temperatures

RADIUS, LENGTH, COUNT = 0.8e-3, 0.35, 4
AREA = math.pi * RADIUS**2
POWER = 0.5
TEXT = """
[design]
name = "cold"

[materials.mine]
youngs_modulus = 4e11
density = 4000.0
loss = {{ angle = 1e-6, thermoelastic = false }}
thermal_conductivity = {conductivity}

[heat]
held = {{ support = 16.0 }}
absorbed = {{ mirror = 0.5 }}

[[stage]]
name = "mirror"
body = {{ mass = 22.9, inertia = [0.5, 0.5, 0.5] }}

[stage.wires]
count = 4
l = 0.35
s = 0.1
t1 = 0.1
t2 = 0.1
material = "mine"
{wires}
"""
ROUND = "radius = 0.8e-3"
"""T^3 below 30 K, from two nodes."""
SPRING_WIRES = {"count": 4, "l": LENGTH, "s": 0.1, "t1": 0.1, "t2": 0.1, "k": 1e6}
CUBIC = "{ temperature = [3.0, 100.0], values = [2.7, 1e5] }"


def solved(conductivity, wires=ROUND):
    design = parse(TEXT.format(conductivity=conductivity, wires=wires))
    flow = heat_flow.solve(design)
    assert flow is not None
    return design, flow


def test_constant_conductivity_gives_a_linear_profile():
    design, flow = solved("1000.0")
    rise = POWER / COUNT * LENGTH / (AREA * 1000.0)
    assert flow.temperature["mirror"] == pytest.approx(16 + rise, rel=1e-12)
    found = sus.sensitivity(
        sus.parse(TEXT.format(conductivity="1000.0", wires=ROUND)),
        results=["temperature of mirror"],
    )
    [number] = [n for n, name in enumerate(found.parameter) if name == "heat.absorbed.mirror"]
    assert found.derivative[number, 0] == pytest.approx(rise / POWER, rel=1e-6)
    profile = np.array(design.stage[0].wires.temperature)
    np.testing.assert_allclose(profile[:, 1], 16 + rise * profile[:, 0], rtol=1e-12)


def test_a_power_of_the_temperature():
    """kappa = c T^3: T^4 is linear along the wire, with the slope 4 Q/(A c)."""
    design, flow = solved(CUBIC)
    fourth = 4 * POWER / COUNT * LENGTH / (AREA * 0.1)
    assert flow.temperature["mirror"] == pytest.approx((16**4 + fourth) ** 0.25, rel=1e-10)
    profile = np.array(design.stage[0].wires.temperature)
    np.testing.assert_allclose(profile[:, 1] ** 4, 16**4 + fourth * profile[:, 0], rtol=1e-10)


@pytest.mark.parametrize("power", [0.0, 1e-15, 1e-9, 1e-3])
@pytest.mark.parametrize("held", [4.1, 16.0])
def test_little_heat_along_a_chain(held, power):
    """Down to none, as in a sweep from 0: two sets of wires in series, T^4 linear in the heat."""
    text = TEXT.format(conductivity=CUBIC, wires=ROUND)
    upper = text[text.index("[[stage]]") :]
    text = text.replace("support = 16.0", f"support = {held}").replace("= 0.5 }", f"= {power} }}")
    text = text.replace('"mirror"', '"upper"') + upper
    flow = heat_flow.solve(parse(text))
    assert flow is not None
    for name, count in (("upper", 1), ("mirror", 2)):
        fourth = count * 4 * power / COUNT * LENGTH / (AREA * 0.1)
        expected = (held**4 + fourth) ** 0.25
        assert flow.temperature[name] == pytest.approx(expected, rel=1e-12)


def test_a_locked_stage_conducts_as_before():
    """The profile below it is that of the design with all stages, and warnings name its wires."""
    text = TEXT.format(conductivity=CUBIC, wires=ROUND)
    lower = text[text.index("[[stage]]") :]
    narrow = "{ temperature = [17.0, 300.0], values = [500.0, 400.0] }"
    other = f"[materials.other]\nyoungs_modulus = 2e11\nthermal_conductivity = {narrow}\n"
    upper = lower.replace('"mirror"', '"upper"').replace('"mine"', '"other"')
    whole = sus.parse(text[: text.index("[[stage]]")] + other + upper + lower)
    locked = whole.replace({"stage.upper.locked": True})
    for change in ({}, {"heat.absorbed.mirror": 0.2}, {"stage.upper.wires.radius": 0.5e-3}):
        design = whole.replace(change).design
        (mirror,) = locked.replace(change).design.stage
        assert mirror.wires.temperature == design.stage[1].wires.temperature
    with pytest.warns(UserWarning, match=r"other: used at 16 K \(upper.wires\), .* conducted heat"):
        found = sus.check(locked)
    assert found.statics.heat[0].label == "upper.wires"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"heat.held": {"ground": 16.0}}, "lacks upper, from which no wire or link conducts"),
        ({"stage.mirror.wires.material": "bare"}, "materials.bare.thermal_conductivity: missing"),
        ({"stage.mirror.wires": SPRING_WIRES}, "stage.mirror.wires: conducts an unknown heat"),
    ],
)
def test_faults_of_heat_beside_a_locked_stage(changes, words):
    text = TEXT.format(conductivity="1000.0", wires=ROUND)
    lower = text[text.index("[[stage]]") :]
    bare = "[materials.bare]\nyoungs_modulus = 2e11\n"
    design = sus.parse(text.replace('"mirror"', '"upper"') + bare + lower)
    with pytest.raises(InputError) as caught:
        design.replace(changes | {"stage.upper.locked": True})
    assert words in str(caught.value)


def test_attachments_on_a_body_of_parts_are_from_its_origin():
    """Conductors are as long as what hangs, wherever the COM is."""
    raw = tomllib.loads(TEXT.format(conductivity="1000.0", wires=ROUND))
    (stage,) = raw["stage"]
    stage["body"] = {"parts": [{"mass": 20.0}, {"mass": 2.0, "at": [0.0, 0.0, 0.1]}]}
    stage["body"]["parts"][0]["inertia"] = [0.5, 0.5, 0.5]
    del stage["wires"]
    stage["position"] = [0.0, 0.0, -0.35]
    places = [[x, y, 0.0] for x in (-0.1, 0.1) for y in (-0.1, 0.1)]
    stage["wire"] = [
        {"upper": place, "lower": place, "material": "mine", "radius": RADIUS} for place in places
    ]
    strands = {"to": [0.2, 0.0, 0.0], "material": "mine", "diameter": 1e-3}
    link = {"name": "strap", "between": ["mirror", "support"], "at": [0.2, 0.0, 0.0]}
    raw["link"] = [link | {"strands": strands | {"shape": "points", "points": []}}]
    flow = heat_flow.solve(parse(write_toml(raw)))
    assert flow is not None
    lengths = [piece.length for one in flow.conductors for piece in one.pieces]
    assert lengths == pytest.approx([0.35] * 5, rel=1e-12)


@pytest.mark.parametrize("name", ["silicon", "copper", "aluminium", "tungsten"])
def test_integrals_of_tables(name):
    table = materials.BUILT_IN[name].thermal_conductivity
    nodes = [node for node in table.temperature if 7 < node < 295]
    expected = quad(table.at, 7.0, 295.0, points=nodes, limit=200, epsrel=1e-11)[0]
    assert materials.integrate(table, 7.0, 295.0) == pytest.approx(expected, rel=1e-9)
    assert materials.integrate(table, 295.0, 7.0) == pytest.approx(-expected, rel=1e-9)


def test_sections_of_two_materials_and_a_taper():
    """Resistances in series; a taper of radii a and b has those of a cone, L/(pi a b)."""
    wires = """
sections = [
    { length = 0.05, radius = [1.6e-3, 0.8e-3], steps = 256 },
    { length = 0.20, radius = 0.8e-3 },
    { length = 0.10, radius = 0.8e-3, material = "other" },
]
[materials.other]
youngs_modulus = 2e11
density = 8000.0
thermal_conductivity = 50.0
"""
    _, flow = solved("1000.0", wires)
    heat = POWER / COUNT
    joint = 16 + heat / 1000 * (0.05 / (math.pi * 1.6e-3 * 0.8e-3) + 0.2 / AREA)
    assert flow.temperature["mirror.wires 1"] == pytest.approx(joint, rel=1e-5)
    expected = joint + heat * 0.1 / (50 * AREA)
    assert flow.temperature["mirror"] == pytest.approx(expected, rel=1e-5)


def test_wires_and_links_end_where_they_are_attached():
    """Points of a body of parts are from its origin: a ballast does not change any length."""
    mirror = "{ mass = 20.0, inertia = [0.5, 0.5, 0.5] }"
    ends = [(x, y) for x in (-0.1, 0.1) for y in (-0.1, 0.1)]
    rows = "".join(
        f"""
[[stage.wire]]
upper = [{x}, {y}, 0.0]
lower = [{x}, {y}, 0.0]
material = "mine"
radius = 0.8e-3
"""
        for x, y in ends
    )
    link = """
[[link]]
name = "strap"
between = ["mirror", "support"]
at = [0.1, 0.0, 0.0]
strands = { to = [0.2, 0.0, 0.0], shape = "points", points = [[0.3, 0.0, 0.1]], \
material = "mine", diameter = 1e-3 }
"""
    head, _, _ = TEXT.format(conductivity=1e3, wires="").partition("body =")
    found = []
    for body in (mirror, f"{{ parts = [{mirror}, {{ mass = 2.0, at = [0.0, 0.0, -0.1] }}] }}"):
        text = f"{head}position = [0.0, 0.0, -0.4]\nbody = {body}\n{rows}{link}"
        found.append(heat_flow.list_conductors(parse(text)))
    plain, of_parts = found
    assert len(plain) == 5
    assert plain == of_parts
    assert sum(length for length, _ in plain[0].pieces[0].stretches) == pytest.approx(0.4)


def test_heat_is_conserved_in_a_network():
    """Three bodies, two heat links: what is absorbed reaches the held bodies; a free body that
    absorbs nothing passes on what it takes."""
    changes = {
        "heat.held": {"ground": 8.0, "support": 290.0},
        "heat.absorbed": {"mirror": 0.3, "intermediate": 0.02},
        "materials.maraging.thermal_conductivity": 5.0,
        "materials.pure-aluminium.thermal_conductivity": 5000.0,
    }
    design = sus.example("cryogenic-payload").replace(changes).design
    flow = heat_flow.solve(design)
    assert flow is not None
    gained = dict.fromkeys(flow.temperature, 0.0) | flow.absorbed
    for one in flow.conductors:
        gained[one.ends[0]] -= flow.power(one)
        gained[one.ends[1]] += flow.power(one)
    for name in ("marionette", "intermediate", "mirror"):
        assert abs(gained[name]) < 1e-9
    assert gained["ground"] + gained["support"] == pytest.approx(0.32, rel=1e-9)
    assert gained["support"] < 0 < gained["ground"]  # the warm support heats
    order = [flow.temperature[name] for name in ("ground", "marionette", "intermediate", "mirror")]
    assert order == sorted(order)


def test_noise_is_that_of_the_profile():
    """As with the same profile given in the file."""
    design = sus.parse(TEXT.format(conductivity=CUBIC, wires=ROUND))
    found = sus.thermal(design, frequency=[3.0, 30.0, 300.0])
    profile = design.design.stage[0].wires.temperature
    text = TEXT.format(conductivity=CUBIC, wires=f"{ROUND}\ntemperature = {profile}")
    cut = text[: text.index("[heat]")] + text[text.index("[[stage]]") :]
    np.testing.assert_array_equal(
        found.amplitude, sus.thermal(sus.parse(cut), frequency=[3.0, 30.0, 300.0]).amplitude
    )
    cold = cut.replace(str(profile), "16.0")
    quiet = sus.thermal(sus.parse(cold), frequency=[3.0, 30.0, 300.0])
    assert (found.amplitude > quiet.amplitude).all()


def test_what_is_varied_is_solved_again():
    """A sweep of the radius, and of the heat."""
    design = sus.parse(TEXT.format(conductivity="1000.0", wires=ROUND))
    results = ["thermal mirror.x:10"]
    for path, values in (
        ("stage.mirror.wires.radius", [0.7e-3, 0.9e-3]),
        ("heat.absorbed.mirror", [0.1, 0.9]),
    ):
        swept = sus.sweep(design, vary={path: values}, results=results)
        for value, found in zip(values, np.ravel(swept.value), strict=True):
            alone = sus.thermal(design.replace({path: value}), frequency=[10.0])
            assert found == pytest.approx(alone.amplitude[0, 0], rel=1e-3)


def test_check_lists_temperatures_and_heat():
    found = sus.check(sus.parse(TEXT.format(conductivity="1000.0", wires=ROUND)))
    support, mirror = found.statics.temperatures
    assert support.removed == pytest.approx(POWER, rel=1e-12)
    assert (mirror.absorbed, mirror.removed) == (POWER, None)
    (wires,) = found.statics.heat
    assert (wires.warm, wires.cold) == ("mirror", "support")
    assert wires.high == mirror.temperature
    assert "absorbed" in str(found)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            {"heat.held": {"mirror": 10.0, "support": 16.0}},
            "heat.absorbed.mirror = 0.5: has no effect, as mirror is held at 10 K; remove one",
        ),
        ({"heat.held": {"suport": 16.0}}, "heat.held.suport = 16.0: names no body; did you mean"),
        ({"heat.held": {}}, "heat.held = {}: is empty; give a temperature: { support = 16.0 }"),
        ({"heat.held": {"support": 1200.0}}, "heat.held.support = 1200.0: must be greater than 0"),
        ({"heat.held": {"ground": 16.0}}, "lacks mirror, from which no wire or link conducts heat"),
        ({"heat.absorbed": {"mirror": -1.0}}, "heat.absorbed.mirror = -1.0: must be at least 0"),
        ({"heat.absorbed": {"support": 1.0}}, "heat.absorbed.support = 1.0: has no effect"),
        ({"stage.mirror.wires.temperature": 20.0}, "20.0: follows from [heat]; remove one"),
        ({"heat.absorbed.mirror": 1e4}, "no temperatures up to 1000 K carry the heat away; check"),
    ],
)
def test_faults(changes, words):
    design = sus.parse(TEXT.format(conductivity="1000.0", wires=ROUND))
    with pytest.raises(InputError) as caught:
        design.replace(changes)
    assert words in str(caught.value)


def test_a_conductivity_that_is_not_known():
    text = TEXT.format(conductivity="1000.0", wires=ROUND)
    with pytest.raises(InputError, match=r"materials.mine.thermal_conductivity: missing; give it"):
        sus.parse(text.replace("thermal_conductivity = 1000.0", ""))
    narrow = "{ temperature = [4.0, 20.0], values = [1000.0, 1000.0] }"
    design = sus.parse(TEXT.format(conductivity=narrow, wires=ROUND))
    with pytest.warns(UserWarning, match=r"used at 37\.\d+ K .* thermal_conductivity known from 4"):
        sus.check(design)


def test_springs_conduct_no_heat_so_their_conductivity_does_not_matter():
    text = TEXT.format(conductivity="1000.0", wires=ROUND)
    spring = """
[[stage.spring]]
stiffness = [1.0, 1.0, 1.0, 1.0, 1.0, 1.0]
material = "{material}"
[materials.metal]
youngs_modulus = 2e11
loss = {{ angle = 1e-4 }}
thermal_conductivity = {{ temperature = [200.0, 300.0], values = [1e3, 1e3] }}
"""
    design = parse(text + spring.format(material="metal"))
    assert not find_unknown_temperatures(design, "beam")
    of_metal = text.replace('material = "mine"', 'material = "metal"')
    found = find_unknown_temperatures(parse(of_metal + spring.format(material="mine")), "beam")
    assert found and all("conducted heat" in fault.problem for fault in found)


def test_a_conductivity_may_spoil_the_loss_and_the_heat():
    design = sus.parse(TEXT.format(conductivity="1000.0", wires=ROUND)).replace(
        {"stage.mirror.wires.material": "titanium-6al-4v", "heat.absorbed.mirror": 1e-6}
    )
    found = find_unknown_temperatures(design.design, "beam")
    wrong = "its stiffness, thermoelastic loss and conducted heat may be wrong"
    assert found and all(wrong in fault.problem for fault in found)
