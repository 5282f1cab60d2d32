"""Faults in the tables of inverted pendulums and filters: one line each, with a remedy."""

from __future__ import annotations

import msgspec
import pytest

from suspension_cli.design import reader
from suspension_cli.design.derive import add_keystones, drop_keystones
from suspension_cli.errors import InputError

GOOD = """
[design]
name = "t"
[[stage]]
name = "ip"
body = { mass = 300.0, inertia = [20.0, 20.0, 40.0] }
[stage.inverted_pendulum]
length = 0.5
count = 3
radius = 0.6
frequency = 0.06
[stage.filter]
frequency = 0.3
keystone = { mass = 2.0 }
[[stage]]
name = "f"
body = { mass = 100.0, inertia = [4.0, 4.0, 6.0] }
wires = { count = 1, l = 1.0, d = 0.01, k = 1e6 }
"""
LEGS, BLADES = "stage.ip.inverted_pendulum", "stage.ip.filter"
FAULTS = [
    (
        f"{LEGS}.points=[[1,0,0],[0,1,0],[-1,0,0]]",
        f"{LEGS}.points = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]: conflicts",
    ),
    (f"{LEGS}.stiffness=600.0", f"{LEGS}: stiffness and frequency are both given; give exactly"),
    (f"{LEGS}.length=-0.5", f"{LEGS}.length = -0.5: "),
    (f"{LEGS}.count=2", f"{LEGS}.count = 2: "),
    (f"{LEGS}.lenght=0.5", f"{LEGS}.lenght = 0.5: unknown key"),
    (f"{LEGS}.leg_com=0.2", f"{LEGS}.leg_mass: missing; give the mass of a leg"),
    (f"{LEGS}.counterweight={{mass=1.0, below=100.0}}", f"{LEGS}.counterweight.below = 100"),
    (
        "stage.ip.wires={count=1, l=1.0, k=1e6}",
        "stage.ip.wires: conflicts with inverted_pendulum; ",
    ),
    (f"{BLADES}.stiffness=100.0", f"{BLADES}: stiffness and frequency are both given; "),
    (f"{BLADES}.q=0.5", f"{BLADES}.q = 0.5: must be greater than 1 "),
    (f"{BLADES}.mass_coupling=3.0", f"{BLADES}.mass_coupling = 3.0: is not below the mass of"),
    (f"{BLADES}.keystone.inertia=[0,1,1]", f"{BLADES}.keystone.inertia.1 = 0: "),
    ("stage.f.hangs_from=ip-keyston", "stage.f.hangs_from = 'ip-keyston': names no earlier stage"),
    ("stage.f.name=ip-keystone", "stage.ip-keystone.name = 'ip-keystone': is the name"),
]


@pytest.mark.parametrize(("setting", "says"), FAULTS, ids=[f[0] for f in FAULTS])
def test_a_fault_is_one_line_with_a_remedy(setting, says):
    with pytest.raises(InputError) as caught:
        reader.parse_with_overrides(GOOD, (setting,))
    lines = str(caught.value).splitlines()
    assert len(lines) == 1, lines
    assert lines[0].startswith(says.replace("'", '"')) or lines[0].startswith(says), lines[0]
    assert "; " in lines[0]


def test_legs_on_one_line_are_refused():
    on_line = GOOD.replace("count = 3\nradius = 0.6", "points = [[0,0,0],[1,0,0],[2,0,0]]")
    with pytest.raises(InputError, match="all legs on one line"):
        reader.parse(on_line)


def test_a_load_beside_the_legs_is_refused():
    from suspension_cli.equilibrium.nominal import expand

    beside = GOOD.replace("count = 3\nradius = 0.6", "points = [[1,0,0],[2,1,0],[2,-1,0]]")
    with pytest.raises(
        InputError, match=r"leg ip\.leg\d would be pulled .* place the load between"
    ):
        expand(reader.parse(beside))


def test_a_saturation_beyond_the_keystone_is_refused():
    from suspension_cli.equilibrium.nominal import expand

    design = reader.parse_with_overrides(GOOD, (f"{BLADES}.saturation=0.1",))
    with pytest.raises(InputError, match=r"keystone\.mass = 2: is not above the mass coupling"):
        expand(design)


def test_keystones_are_stages_that_the_file_does_not_list():
    design = reader.parse(GOOD)
    assert [stage.name for stage in design.stage] == ["ip", "ip-keystone", "f"]
    listed = drop_keystones(design)
    assert [stage.name for stage in listed.stage] == ["ip", "f"]
    assert add_keystones(listed) == design
    assert msgspec.structs.asdict(add_keystones(design.__class__(**msgspec.structs.asdict(listed))))


def test_a_stage_hangs_from_the_keystone_or_from_the_filter():
    from suspension_cli.equilibrium.nominal import expand

    for above, number in ((None, 2), ("ip-keystone", 2), ("ip", 1)):
        more = () if above is None else (f"stage.f.hangs_from={above}",)
        scene = expand(reader.parse_with_overrides(GOOD, more))
        assert scene.wires.upper.tolist() == [number]
