"""Bad input of links and dampers, with remedies, and the CSV files of their tables."""

from __future__ import annotations

from pathlib import Path

import pytest

from suspension_cli.design import reader
from suspension_cli.design.derive import com_positions
from suspension_cli.errors import InputError

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
LINK = '[[link]]\nname = "a"\nbetween = ["test", "ground"]\n'
SIX = "stiffness = [1, 1, 1, 0, 0, 0]\n"
STRANDS = """[link.strands]
to = [0.1, 0.0, -0.5]
material = "aluminium"
diameter = 1e-3
shape = "u"
length = 0.4
"""
TABLE = """[link.table]
axis = "x"
frequency = [1.0, 2.0]
real = [[1.0, 2.0]]
imaginary = [[0.1, 0.2]]
"""
DAMPER = '[[damper]]\nname = "d"\nbetween = ["test", "support"]\n'
MAGNET = """[damper.eddy_current]
shape = "plate"
axis = "z"
moment = 1.0
conductivity = 5.8e7
thickness = 5e-3
gap = 1e-2
"""


def _faults(text: str) -> str:
    with pytest.raises(InputError) as raised:
        reader.parse(STAGES + text)
    return str(raised.value)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (LINK, "link.a: none of stiffness, table, strands; give exactly one"),
        (LINK + SIX + STRANDS, "link.a: stiffness and strands are both given"),
        (
            LINK.replace("ground", "grund") + SIX,
            "ends with grund, which is not a body; did you mean 'ground'",
        ),
        (
            LINK.replace("ground", "frame") + SIX,
            "ends with frame, which is not a body; known here: test",
        ),
        (LINK.replace("ground", "test") + SIX, "joins a body to itself"),
        (
            LINK.replace('["test", "ground"]', '["support", "test"]') + SIX,
            'must begin with a stage; swap them: ["test", "support"]',
        ),
        (LINK.replace('["test", "ground"]', '["test"]') + SIX, "link.a.between"),
        (LINK.replace('"a"', '"test"') + SIX, "name of another link, damper, cavity or stage"),
        (LINK + SIX + LINK + SIX, "name of another link, damper, cavity or stage"),
        (LINK + "stiffness = [1, 1]\n", "link.a.stiffness"),
        (LINK + "stiffness = [1, 1, 1, 0, 0, [0, 0, 0, 0, 0, 1]]\n", "mixes numbers and rows"),
        (LINK + SIX + "loss = 0.1\n", "link.a.loss = 0.1: unknown key"),
        (LINK + STRANDS.replace("0.4", "0.15"), "is too short for ends 0.1 m apart"),
        (LINK + STRANDS.replace("length = 0.4\n", ""), "link.a.strands.length: missing"),
        (LINK + STRANDS.replace("[0.1,", "[0.0,"), "lies above or below the point at"),
        (
            LINK + STRANDS.replace("aluminium", "alumnium"),
            "names no material; did you mean 'aluminium'",
        ),
        (
            LINK + STRANDS.replace('"u"', '"points"'),
            'goes with shape = "u" or "catenary"; remove it',
        ),
        (LINK + "loss_angle = 0.1\n" + TABLE, "link.a.loss_angle = 0.1: conflicts with table"),
        (LINK + TABLE.replace("[1.0, 2.0]\nreal", "[2.0, 1.0]\nreal"), "is not in ascending order"),
        (
            LINK + TABLE.replace('axis = "x"\n', ""),
            "has 1 axes instead of 6; give a list per axis",
        ),
        (
            LINK + TABLE.replace("[[1.0, 2.0]]", "[[1.0, 2.0, 3.0]]"),
            "has an axis without exactly 2 values",
        ),
        (
            LINK + TABLE.replace("[[1.0, 2.0]]", "[[1.0], [2.0]]"),
            "has 1 elements; give one number per frequency, at least 2",
        ),
        (LINK + TABLE.replace("[[1.0, 2.0]]", "[[0.0, 2.0]]"), "static stiffness along x is 0"),
        (LINK + '[link.table]\nfile = "a.csv"\n', "is read only with a design file"),
        (DAMPER, "damper.d: none of damping, eddy_current; give exactly one"),
        (DAMPER + MAGNET.replace("moment = 1.0\n", ""), "none of moment, remanence"),
        (DAMPER + MAGNET.replace("moment", "remanence"), "volume go together; give both"),
        (DAMPER + MAGNET.replace("5.8e7", "58"), "conductivity = 58: must be at least 10000"),
    ],
)
def test_faults_have_remedies(text: str, expected: str) -> None:
    assert expected in _faults(text)


def test_table_from_a_file(tmp_path: Path) -> None:
    (tmp_path / "cable.csv").write_text(
        "frequency, modulus, angle\n1.0, 2.0, 0.1  # first\n\n10.0, 3.0, 0.2\n"
    )
    design = tmp_path / "design.toml"
    table = '[link.table]\naxis = "y"\nfile = "cable.csv"\nform = "modulus-loss"\n'
    design.write_text(STAGES + LINK + table)
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
        with pytest.raises(InputError) as raised:
            reader.read(design)
        assert expected in str(raised.value) and "link.a.table.file" in str(raised.value)


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
