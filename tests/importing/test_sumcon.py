"""Saves of SUMCON: what a design takes from them, and one line for damaged ones."""

from __future__ import annotations

import math
import random
from pathlib import Path

import numpy as np
import pytest

from suspension_cli.errors import InputError
from suspension_cli.importing import convert
from tests.support.commandline import run
from tools.validation import undamped

SAVE = Path(__file__).parents[1] / "data" / "tower-sumcon.m"
TEXT = SAVE.read_text()
TABLES = '{{"k", "", "", "", "", ""}, {"", "k", "", "", "", ""}, {"", "", "k", "", "", ""}'


def changed(folder, *pairs):
    """Convert the save with some texts replaced."""
    text = TEXT
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new)
    (folder / "save.m").write_text(text)
    return convert.read(folder / "save.m", "mine")


def modes(text, model="string"):
    return undamped.frequencies(undamped.system(undamped.parse(text), model))


def test_parts_of_a_tower(tmp_path):
    found = changed(tmp_path)
    design = found.source().design
    by_name = {stage.name: stage for stage in design.stage}
    platform, first, im, tm = (by_name[name] for name in ("F0", "F-1", "IM", "TM"))
    assert (first.hangs_from, im.hangs_from, tm.mirror) == (None, None, True)
    assert first.body.inertia == [[4.3, 0.2, 0.0], [0.2, 4.1, 0.0], [0.0, 0.0, 7.0]]
    legs = platform.inverted_pendulum
    assert (legs.count, legs.radius, legs.q, legs.yaw_stiffness) == (3, 0.6, 20.0, 0.0)
    assert platform.spring[0].stiffness[5] == 30.0 and platform.spring[0].loss_angle == 1 / 500
    blades = first.filter
    assert (blades.stiffness, blades.q, blades.at) == (500.0, 6.0, (0.0, 0.0, -0.02))
    assert blades.mass_coupling == pytest.approx(1e-3 * 490.5 / 9.81)
    assert tm.wires.l == pytest.approx(0.5 + 49.05 / 29122, rel=1e-9)
    assert (tm.wires.s, tm.wires.t1, tm.wires.d, tm.wires.d_upper) == (0.01, 0.15, -0.002, -0.001)
    assert (tm.wires.radius, tm.wires.bending, tm.wires.k) == (1.5e-4, "hinged", 29122.0)
    assert [piece.radius for piece in first.wires.sections] == [0.0015, 0.002, 0.0015]
    assert design.materials["maraging-steel"].youngs_modulus == 184e9
    (damper,), (link,) = design.damper, design.link
    assert damper.damping == [3.0, 2.0, 1.0, 0.0, 0.0, 0.1]
    assert damper.between == ["IM", "support"] and damper.at == (0.0, 0.0, 0.05)
    assert link.stiffness == [0.2, 0.4, 0.3, 0.0, 0.0, 0.0] and link.loss_angle == 0.02
    assert "body F 1 is F-1 here" in found.notes
    assert not any(note.startswith("wire") for note in found.notes)


def test_lateral_stiffness_of_the_legs_is_that_of_the_save(tmp_path):
    """The load of all bodies, keystones included, is in the frequency of the legs."""
    design = changed(tmp_path).source().design
    weights = [stage.body.mass for stage in design.stage]
    legs = design.stage[0].inverted_pendulum
    ballast = 3 * legs.counterweight.mass / 4
    mass = sum(weights) + ballast
    assert mass * (math.tau * legs.frequency) ** 2 == pytest.approx(120.0, rel=1e-6)


def test_sets_and_single_wires_have_the_same_modes(tmp_path):
    """One wire, stiffer by 3e-6, makes the wires single ones, and takes the blades' inertia."""
    whole, _ = modes(changed(tmp_path).text)
    old = '"IM-TM-3", 29122.'
    single = changed(tmp_path, (old, old + "1"))
    assert "[[stage.wire]]" in single.text and "natural_length" in single.text
    assert "spring GAS1: its inertia (-60 dB) is left out" in single.notes
    np.testing.assert_allclose(modes(single.text)[0][:21], whole[:21], rtol=1e-3)


def test_bending_points_are_the_hinges(tmp_path):
    """But for the tension of the keystone, of which SUMCON does not know."""
    whole, _ = modes(changed(tmp_path).text)
    ends = convert.read(SAVE, "mine", bending_points=True)
    assert 'clamp = "bending-point"' in ends.text and "hinged" not in ends.text
    np.testing.assert_allclose(modes(ends.text)[0][:21], whole[:21], rtol=2e-4)


def test_what_differs_is_said(tmp_path):
    found = changed(tmp_path, ("\n      49.05,", "\n      25.,"))
    (note,) = (note for note in found.notes if note.startswith("wire"))
    assert note == (
        "wire IM-TM-1 to IM-TM-4: SUMCON puts its hinges for 25 N, it carries about 49.05 N"
    )
    assert f"#   {note}" in found.text


def test_stiff_wires_end_at_their_bending_points(tmp_path):
    found = changed(tmp_path, ("2, 0.5, 0.0003, 0, 0.0003,", "2, 0.05, 0.0013, 0, 0.0013,"))
    (note,) = (note for note in found.notes if "bends take" in note)
    assert "IM-TM-1 to IM-TM-4" in note and found.text.count('"bending-point"') == 1
    assert len(modes(found.text)[0]) >= 21


def test_tables_of_heat_links_become_csv(tmp_path):
    (tmp_path / "HeatLink").mkdir()
    table = "0.1\t2.0\t0.1\n1.0\t3.0\t-0.5\n10\t4.0\t0.3\n"
    (tmp_path / "HeatLink" / "k.txt").write_text(table)
    empty = '{{"", "", "", "", "", ""}, {"", "", "", "", "", ""}, {"", "", "", "", "", ""}'
    found = changed(tmp_path, (empty, TABLES))
    (file,) = found.files
    assert file == "strap.csv" and 'file = "strap.csv"' in found.text
    (link,) = found.source().design.link
    assert link.table.real[0] == [2.0, 3.0, 4.0] and link.table.imaginary[2] == [0.1, 0.0, 0.3]
    assert any("negative imaginary" in note for note in found.notes)
    done = run("import", tmp_path / "save.m", tmp_path / "out.toml")
    assert done.exit_code == 0 and (tmp_path / "strap.csv").exists()
    assert run("modes", tmp_path / "out.toml", "--fidelity", "string").exit_code == 0
    assert run("import", tmp_path / "save.m").exit_code == 2
    (tmp_path / "HeatLink" / "k.txt").write_text("1 2\n")
    done = run("import", tmp_path / "save.m", "--force", tmp_path / "out.toml")
    assert done.exit_code == 2 and "stiffness table k: is not a table" in done.stderr


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ("save$wire", "save$wires", "has no save$wire"),
        ("{30., {{0.25", "{30. + 1, {{0.25", 'save$mass = "+ 1, {{0.25'),
        ("30., {{0.25", '"30", {{0.25', 'save$mass.4.1 = "30": is not a number'),
        ('{False, "TM"}', '{False, "TM"}, {False, "X"}', "save$mass: has 5 rows for 6 bodies"),
        ("{{2, {0, -0.1", "{{9, {0, -0.1", "save$wire.1.1 = 9: is not a whole number from 1 to 5"),
        ("{{2, {0, -0.1", "{{2.5, {0, -0.1", "save$wire.1.1 = 2.5: is not a whole number"),
        ("{3, {0, -0.02, 0}, 4", "{5, {0, -0.02, 0}, 4", "does not hold IM, TM"),
        ("1.8*^6, 1.9", "1.8*^999, 1.9", "save$wire = inf: has a number too large"),
        ("1471.5, {0", "-1., {0", "has no tension, length or k"),
        ("{40., 40., 40.,", "{-40., 0., 0.,", "save$IP: has no stiffness or length (IP)"),
        ("{30., {{0.25", "{-30., {{0.25", "stage.IM.body.mass = -30.0"),
        ("8., 184, 0.32", "8., 184", "save$mat.1 = a list of 6: is not a list of 7"),
        ("1.9},", "Run[x]},", "save$wire"),
    ],
)
def test_faults_are_one_line(old, new, problem, tmp_path):
    with pytest.raises(InputError, match=r"save\.m") as caught:
        changed(tmp_path, (old, new))
    assert problem in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize("part", [0, 0.3, 0.6, 0.9, 0.995])
def test_truncated_saves(part, tmp_path):
    file = tmp_path / "cut.m"
    file.write_text(TEXT[: int(len(TEXT) * part)])
    done = run("import", file, tmp_path / "out.toml")
    assert done.exit_code == 2 and len(done.stderr.splitlines()) == 1
    assert not (tmp_path / "out.toml").exists()


def test_damaged_saves_never_end_in_a_traceback(tmp_path):
    """Random bytes changed: a design, or faults."""
    generator, file, refused = random.Random(7), tmp_path / "bad.m", 0
    for _ in range(60):
        letters = list(TEXT)
        for _ in range(generator.choice((1, 3, 10))):
            letters[generator.randrange(len(letters))] = generator.choice('{}",0-9e*^.$\\xF\n\0')
        file.write_text("".join(letters))
        try:
            convert.read(file, "bad")
        except InputError:
            refused += 1
    assert refused > 30


def test_what_is_no_save(tmp_path):
    for data in (b"", b"\xff\xfe\x00", b"save$bdn = " + b"{" * 100000, b"ssA = [1 2 3];\n"):
        (tmp_path / "other.m").write_bytes(data)
        with pytest.raises(InputError) as caught:
            convert.read(tmp_path / "other.m", "mine")
        assert len(str(caught.value).splitlines()) == 1


def test_names_cannot_leave_their_place(tmp_path):
    """Names of bodies and materials are no TOML; those of tables no paths."""
    evil = ('"Maraging Steel"', '"M]\n[stage"'), ('{False, "F 1"}', '{False, "F1\\"\n[x]"}')
    design = changed(tmp_path, *evil).source().design
    assert {stage.name for stage in design.stage} == {"F0", "F1-x", "F1-x-keystone", "IM", "TM"}
    empty = '{{"", "", "", "", "", ""}, {"", "", "", "", "", ""}, {"", "", "", "", "", ""}'
    with pytest.raises(InputError, match="stiffness table"):
        changed(tmp_path, (empty, TABLES.replace('"k"', '"../k"')))


def test_the_command(tmp_path):
    done = run("import", SAVE)
    assert done.exit_code == 0 and done.stdout.startswith("# Converted by `pendsus import`")
    file = tmp_path / "tower.toml"
    assert run("import", SAVE, file).exit_code == 0
    assert 'name = "tower"' in file.read_text() and "reference" in file.read_text()
    again = run("import", SAVE, file)
    assert again.exit_code == 2 and "exists already" in again.stderr
    assert run("import", SAVE, file, "--force", "--name", "x").exit_code == 0
    assert 'name = "x"' in file.read_text()
    assert run("import", SAVE, file, "--force", "--name", "no good").exit_code == 2
    assert run("import", tmp_path / "none.m").exit_code == 2
