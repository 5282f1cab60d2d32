"""Links, dampers, inverted pendulums and filters: their faults, CSV files of tables, keystones."""

from __future__ import annotations

import tomllib
from pathlib import Path

import msgspec
import pytest

from suspension_cli.design import reader
from suspension_cli.design.derive import add_keystones, com_positions, drop_keystones
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.errors import InputError
from tests.support.commandline import assert_refused, edited, run, written
from tests.support.faulty_designs import parse

STAGES = """[design]
name = "bad"
[[stage]]
name = "test"
position = [0.0, 0.0, -0.5]
body = { mass = 1.0, inertia = [0.01, 0.01, 0.01] }
[[stage.spring]]
stiffness = [1.0, 1.0, 1.0, 1.0, 1.0, 1.0]
preload = [0.0, 0.0, 9.81, 0.0, 0.0, 0.0]
"""
LINKS = """
[[link]]
name = "a"
between = ["test", "ground"]
stiffness = [1, 1, 1, 0, 0, 0]
[[link]]
name = "s"
between = ["test", "ground"]
[link.strands]
to = [0.1, 0.0, -0.5]
material = "aluminium"
diameter = 1e-3
shape = "u"
length = 0.4
[[link]]
name = "t"
between = ["test", "ground"]
table = { axis = "x", frequency = [1.0, 2.0], real = [[1.0, 2.0]], imaginary = [[0.1, 0.2]] }
[[damper]]
name = "d"
between = ["test", "support"]
[damper.eddy_current]
shape = "plate"
axis = "z"
moment = 1.0
conductivity = 5.8e7
thickness = 5e-3
gap = 1e-2
"""
TOWER = """
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
BASES = {"links": tomllib.loads(STAGES + LINKS), "tower": tomllib.loads(TOWER)}
FAULTY = parse(Path(__file__).parent / "faulty_parts.txt", BASES, "links")["faults"]


@pytest.mark.parametrize("base", BASES)
def test_without_faults_they_are_good(base, tmp_path):
    assert run("check", written(tmp_path, BASES[base])).exit_code == 0


@pytest.mark.parametrize("case", FAULTY, ids=lambda case: case.name)
def test_a_fault_is_one_line_with_a_remedy(case, tmp_path):
    file = written(tmp_path, edited(BASES[case.base], case.edits))
    first, *_ = assert_refused(run("check", file), file)
    assert case.says in first


def test_table_from_a_file(tmp_path: Path) -> None:
    (tmp_path / "cable.csv").write_text(
        "frequency, modulus, angle\n1.0, 2.0, 0.1  # first\n\n10.0, 3.0, 0.2\n"
    )
    link = '[[link]]\nname = "a"\nbetween = ["test", "ground"]\n'
    table = '[link.table]\naxis = "y"\nfile = "cable.csv"\nform = "modulus-loss"\n'
    design = written(tmp_path, STAGES + link + table)
    with pytest.raises(InputError, match="is read only with a design file"):
        reader.parse(design.read_text())
    source = reader.read(design)
    found = source.design.link[0].table
    assert found is not None and found.frequency == [1.0, 10.0]
    assert found.real[0][0] == pytest.approx(2 * 0.9950041652780258)
    assert found.imaginary[0][1] == pytest.approx(3 * 0.19866933079506122)
    assert reader.parse(source.text).link == source.design.link  # results embed the columns
    for text, expected in (
        (None, "cannot be read (No such file or directory); give its path from the folder"),
        ("1, 2\n3, 4\n", "has 2 columns"),
        ("1, 2, 3\n3, x, 4\n", 'line 2: "x" is not a number'),
        ("1, 2, 3\n3, 4\n", "line 2: has 2 columns, but line 1 has 3"),
    ):
        (tmp_path / "cable.csv").unlink(missing_ok=True)
        if text is not None:
            (tmp_path / "cable.csv").write_text(text)
        [line] = assert_refused(run("check", design), design)
        assert expected in line and "link.a.table.file" in line


def test_wires_below_a_keystone_end_where_it_hangs():
    """A stage that names the keystone from which it hangs, joined to the support by a wire."""
    tower = reader.example("tower")
    hung = reader.replaced(tower, {"stage.filter.hangs_from": "platform-keystone"}).text
    strap = (
        '[[link]]\nname = "a"\nbetween = ["filter", "support"]\n[link.strands]\n'
        'to = [0.1, 0.0, 0.0]\nmaterial = "aluminium"\ndiameter = 1e-3\nshape = "catenary"\n'
        "length = {}\n"
    )
    height = -com_positions(tower.design)["filter"][2]
    reader.parse(hung + strap.format(height + 0.1))
    with pytest.raises(InputError, match="is too short"):
        reader.parse(hung + strap.format(height))


def test_keystones_are_stages_that_the_file_does_not_list():
    design = reader.parse(TOWER)
    assert [stage.name for stage in design.stage] == ["ip", "ip-keystone", "f"]
    listed = drop_keystones(design)
    assert [stage.name for stage in listed.stage] == ["ip", "f"]
    assert add_keystones(listed) == design
    assert msgspec.structs.asdict(add_keystones(design.__class__(**msgspec.structs.asdict(listed))))


def test_a_stage_hangs_from_the_keystone_or_from_the_filter():
    for above, number in ((None, 2), ("ip-keystone", 2), ("ip", 1)):
        more = () if above is None else (f"stage.f.hangs_from={above}",)
        scene = expand(reader.parse_with_overrides(TOWER, more))
        assert scene.wires.upper.tolist() == [number]
