"""Ground noise against published values, tables of the user, and what is wrong with them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from suspension_cli.errors import InputError
from suspension_cli.physics import ground

CORNERS = {
    "nlnm": """
0.10 -168.0   0.17 -166.7   0.40 -166.7   0.80 -169.2   1.24 -163.7   2.40 -148.6
4.30 -141.1   5.00 -141.1   6.00 -149.0   10.0 -163.8   12.0 -166.2   15.6 -162.1
21.9 -177.5   31.6 -185.0   45.0 -187.5   70.0 -187.5   101.0 -185.0   154.0 -185.0
328.0 -187.5   600.0 -184.4   1e4 -151.9   1e5 -103.1""",
    "nhnm": """
0.10 -91.5   0.22 -97.4   0.32 -110.5   0.80 -120.0   3.80 -98.0   4.60 -96.5
6.30 -101.0   7.90 -113.5   15.4 -120.0   20.0 -138.5   354.8 -126.0   1e4 -80.1
1e5 -48.5""",
}
"""Peterson's models at the corners of the curves (period in s, level in dB), as published beside
the coefficients."""


@pytest.mark.parametrize("model", CORNERS)
def test_models_at_their_corners(model):
    """From either side: the curves have no steps but those of rounded coefficients."""
    period, level = np.array(CORNERS[model].split(), dtype=float).reshape(-1, 2).T
    for beside in (1 - 1e-9, 1 + 1e-9):
        at = 1 / (period * beside)
        acceleration = ground.parse([model], [], Path())["x"].at(at) * (2 * np.pi * at) ** 2
        np.testing.assert_allclose(20 * np.log10(acceleration), level, atol=0.11)


def test_displacement_of_the_ground():
    """As the acceleration over the square of the frequency, which is flat above 10 Hz."""
    motion = ground.parse(["nlnm"], [], Path())["x"]
    ten, hundred = motion.at(np.array([10.0, 100.0]))
    assert ten / hundred == pytest.approx(100.0, rel=1e-12)
    assert ten == pytest.approx(10 ** (-168.0 / 20) / (20 * np.pi) ** 2, rel=1e-12)


def test_platforms_move_in_six_coordinates():
    found = ground.parse(["aligo-ham", "yaw=aligo-isi"], [], Path())
    at = np.array([0.1, 1.0, 10.0])
    for name, expected in (
        ("x", (1e-6, 3e-10, 3e-11)),
        ("y", (1e-6, 3e-10, 3e-11)),
        ("z", (4e-7, 4e-10, 6e-11)),
        ("roll", (4e-8, 8e-11, 3e-12)),
        ("pitch", (4e-8, 8e-11, 3e-12)),
        ("yaw", (2e-8, 1e-11, 3e-13)),
    ):
        np.testing.assert_allclose(found[name].at(at), expected, rtol=1e-12)
    assert found["x"].frequency[[0, -1]].tolist() == [1e-3, 1e3]
    same, other = (ground.parse([name], [], Path()) for name in ("aligo-bsc", "aligo-isi"))
    for dof, motion in same.items():
        assert motion.at(at).tolist() == other[dof].at(at).tolist()


def csv(folder, text, name="site.csv"):
    path = folder / name
    path.write_text(text)
    return str(path)


def test_tables_and_coordinates(tmp_path):
    file = csv(
        tmp_path, "# site\nfrequency (Hz), x [m/sqrt(Hz)], pitch\n0.1,1e-6,1e-9\n10,1e-8,0\n"
    )
    stop = csv(tmp_path, "1 0.1\n100 0.001\n", "stop.csv")
    found = ground.parse(["nhnm", file, "z=none", "yaw=aligo-isi"], [f"x={stop}"], tmp_path)
    assert [*found] == ["x", "y", "pitch", "yaw"]
    assert found["x"].frequency[[0, -1]].tolist() == [1.0, 10.0]
    # log-log: 1e-7 at 1 Hz, and 0.1 sqrt(0.1)... of it gets through
    assert found["x"].at(np.array([1.0]))[0] == pytest.approx(1e-8)
    assert found["y"].name == "nhnm"
    assert found["yaw"].at(np.array([0.1, 1.0])) == pytest.approx([2e-8, 1e-11])
    # next to a value of 0 there is no logarithm
    assert found["pitch"].at(np.array([5.05]))[0] == pytest.approx(0.5e-9)
    bare = ground.parse([csv(tmp_path, "1 2\n2 3\n")], [], tmp_path)
    assert [*bare] == ["x", "y", "z"]


def test_files_beside_the_design(tmp_path):
    """Here with the frequency last."""
    csv(tmp_path, "z,freq (Hz)\n2,1\n3,2\n", "beside.csv")
    assert [*ground.parse(["z=beside.csv"], [], tmp_path)] == ["z"]


@pytest.mark.parametrize(
    ("heading", "at", "scale"),
    [
        ("f,{0}", 1.0, 1.0),
        ("f (Hz),{0} (um)", 1.0, 1e-6),
        ("frequency [mHz],{0} [nm/sqrt(Hz)]", 1e-3, 1e-9),
        ("f_kHz,{0}_mm", 1e3, 1e-3),
        ("Hz,{0} (\u00b5m/\u221aHz)", 1.0, 1e-6),
        ("f,{0} (pm Hz^-1/2)", 1.0, 1e-12),
        ("f,{0} (cm/rtHz)", 1.0, 1e-2),
    ],
)
def test_units_in_headings(heading, at, scale, tmp_path):
    """Of a coordinate, and of the only column of a file without one."""
    for name, given in (("x", "{}"), ("motion", "x={}")):
        file = csv(tmp_path, f"{heading.format(name)}\n2,3\n20,3\n")
        found = ground.parse([given.format(file)], [], tmp_path)["x"]
        assert found.frequency[[0, -1]].tolist() == [2 * at, 20 * at]
        assert found.at(np.array([4 * at]))[0] == pytest.approx(3 * scale, rel=1e-14, abs=0)


def test_units_of_rotations_and_ratios(tmp_path):
    file = csv(tmp_path, "f,yaw (urad),x (um)\n1,3,1\n2,3,1\n")
    ratio = csv(tmp_path, "f,yaw (%),x (1)\n1,10,1\n2,10,1\n", "ratio.csv")
    found = ground.parse([file], [ratio], tmp_path)
    assert found["yaw"].at(np.array([1.0]))[0] == pytest.approx(3e-7, rel=1e-14, abs=0)
    alone = csv(tmp_path, "f,asd (nrad)\n1,3\n2,3\n", "alone.csv")
    found = ground.parse([f"roll={alone}"], [], tmp_path)
    assert found["roll"].at(np.array([1.0]))[0] == pytest.approx(3e-9, rel=1e-14, abs=0)
    csv(tmp_path, "f,yaw (um)\n1,10\n2,10\n", "ratio.csv")
    with pytest.raises(InputError, match=r'ratio.csv: has the column "yaw .um.", whose unit'):
        ground.parse([file], [ratio], tmp_path)


FAULTS = {
    "unit": ("f,x (furlong)\n1,1\n", '"x .furlong.", whose unit is not known; give it in m, cm'),
    "power": ("f,x (m^2/Hz)\n1,1\n", "whose unit is not known; give it in .* per sqrt"),
    "unit of rotation": ("f,roll (um)\n1,1\n", '"roll .um.", whose unit .* give it in rad'),
    "unit of frequency": ("f (1/day),x\n1,1\n", '"f .1/day.", whose unit .* give it in Hz'),
    "text": ("1,2\n2,three\n", 'line 2: "three" is not a number'),
    "descending": ("2,1\n1,1\n", "line 2: the frequency 1 follows 2; sort by ascending"),
    "twice": ("1,1\n1,1\n", "line 2: the frequency 1 is given twice"),
    "negative": ("f,x\n1,1\n2,-3e-9\n", "line 3: the x -3e-09 is below 0; give amplitude spectral"),
    "ragged": ("1,2\n2\n", "line 2: has 1 columns, but line 1 has 2"),
    "infinite": ("1,2\n2,inf\n", 'line 2: column "2" holds inf, which is not a number'),
    "zero": ("0,2\n2,1\n", "line 1: the frequency 0 is below 1e-09; give frequencies in Hz"),
    "empty": ("# nothing\n", "has no numbers"),
    "one column": ("1\n2\n", "has one column"),
    "unnamed": ("1,2,3\n", "has 3 columns without headings"),
    "same name": ("f,x,x\n1,2,3\n", "has two columns of one name"),
    "coordinate": ("f,x,pich\n1,2,3\n", '"pich": names no motion .*did you mean'),
}


@pytest.mark.parametrize("kind", FAULTS)
def test_faults_of_tables(kind, tmp_path):
    text, message = FAULTS[kind]
    file = csv(tmp_path, text)
    with pytest.raises(InputError, match=message) as caught:
        ground.parse([file], [], tmp_path)
    assert str(caught.value).startswith(f"{file}: ")
