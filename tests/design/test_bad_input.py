"""Faults of the input: every one a line with file, key, value and remedy, exit code 2, nothing
written."""

from __future__ import annotations

import errno
import os
import re
import tomllib
from pathlib import Path

import pytest

from suspension_cli.design import reader
from suspension_cli.errors import InputError
from tests.support.commandline import assert_refused, edited, from_template, process, run, written
from tests.support.designs import RAW, TEXTS
from tests.support.faulty_designs import CASES, NO_DESIGNS, explicit, plumb


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_faulty_design(case, tmp_path):
    file, out = written(tmp_path, edited(RAW[case.base], case.edits)), tmp_path / "out"
    lines = assert_refused(run("modes", file, "--json", "--out", out), file, out)
    if (
        "slack in equilibrium" in case.says and len(lines) > 1
    ):  # one wire far too long leaves others slack, too
        assert all("is slack in equilibrium" in line for line in lines), lines
    else:
        assert len(lines) == 1, lines
    assert lines[0].startswith(case.says)
    assert case.remedy in lines[0].removeprefix(case.says).partition("; ")[2]
    assert not out.exists()


@pytest.mark.parametrize("name", NO_DESIGNS)
def test_no_design(name, tmp_path):
    content, says = NO_DESIGNS[name]
    file, out = written(tmp_path, content), tmp_path / "out"
    lines = assert_refused(run("modes", file, "--out", out), file, out)
    assert lines[0].startswith(says)
    assert not out.exists()


@pytest.mark.parametrize(
    ("x", "y", "left_over"),
    [(0.1, 0.0, r"-5\.4\d N m of pitch torque"), (0.0, 0.1, r"5\.4\d N m of roll torque")],
)
def test_what_is_left_over_is_named(x, y, left_over, tmp_path):
    """5.6 kg on one wire, 0.1 m from the COM."""
    file, out = written(tmp_path, edited(RAW["single"], explicit(plumb(x, y)))), tmp_path / "out"
    [line] = assert_refused(run("modes", file, "--out", out), file, out)
    assert re.search(
        rf"^stage\.test: cannot balance in the nominal pose: {left_over}.* left over; ", line
    )


def test_all_slack_wires_are_reported(tmp_path):
    """A wire that is 5 mm too long leaves its load, and that of the wire across, to the other
    two."""
    spoilt = edited(RAW["single"], {("perturbation",): [{"wire": "test.1", "length_change": 5e-3}]})
    file = written(tmp_path, spoilt)
    lines = assert_refused(run("modes", file), file)
    assert [line.split(" (")[0] for line in lines] == [
        f"stage.test.wire: wire test.{n} is slack in equilibrium" for n in (1, 4)
    ]


def test_a_syntax_error_names_its_line(tmp_path):
    file = written(tmp_path, "[design]\nname = 'x'\n\ntitle = \n")
    [line] = assert_refused(run("check", file), file)
    assert "line 4" in line


FIVE = """\
[design]
name = "five"
titel = "A typo"
[constants]
gravity = -9.81
[[stage]]
name = "test"
body = { mass = "heavy", inertia = [1.0, nan, 1.0] }
[stage.wires]
count = 0
l = 0.3
"""


def test_all_faults_at_once(tmp_path):
    file, out = written(tmp_path, FIVE), tmp_path / "out"
    lines = assert_refused(run("modes", file, "--out", out), file, out)
    keys = [line.split(" = ")[0] for line in lines]
    assert sorted(keys) == [
        "constants.gravity",
        "design.titel",
        "stage.test.body.inertia.2",
        "stage.test.body.mass",
        "stage.test.wires.count",
    ]


def test_all_contradictions_at_once(tmp_path):
    spoilt = edited(
        RAW["rich"],
        {
            ("stage", 1, "name"): "upper",
            ("stage", 2, "hangs_from"): "nowhere",
            ("stage", 0, "blade", 0, "uncoupled_frequency"): 3.0,
            ("stage", 2, "wires", "t1"): 7.0,
            ("stage", 2, "body", "radius"): 1.0,
            ("analysis", "mode"): {},
        },
    )
    file = written(tmp_path, spoilt)
    assert len(assert_refused(run("modes", file), file)) == 8


def test_check_reports_the_faults_of_all_files(tmp_path):
    one, two = written(tmp_path, b"", "one.toml"), written(tmp_path, FIVE, "two.toml")
    result = run("check", one, from_template(tmp_path), two)
    assert result.exit_code == 2
    files = [line.split(": ")[0] for line in result.stderr.splitlines()]
    assert files == [str(one)] + 5 * [str(two)]


def test_unreadable_file(tmp_path, monkeypatch):
    file = from_template(tmp_path)
    opened = Path.open

    def refuse(self, *args, **kwargs):
        if self == file:
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(self))
        return opened(self, *args, **kwargs)

    monkeypatch.setattr(Path, "open", refuse)
    [line] = assert_refused(run("modes", file), file)
    assert line == "cannot be read (Permission denied); check the path and its permissions"


def test_paths_that_are_no_design(tmp_path):
    big = written(tmp_path, "#" * 5_000_000)
    for path, problem in (
        (tmp_path / "nowhere.toml", "cannot be read (No such file"),
        (tmp_path, "is a directory; "),
        (big, "has more than"),
        (Path("/dev/zero"), "has more than"),
    ):
        [line] = assert_refused(run("modes", path), path)
        assert line.startswith(problem), line


@pytest.mark.parametrize(
    "text",
    [
        "a" + ".a" * 20_000 + " = 1",
        "x = 1\n[" + '"a.b" . ' * 5_000 + "c]",
        't = { x = """\nit\'s""", a' + ".'a'" * 5_000 + " = 1 }",
        "x = " + "[" * 20_000,
    ],
)
def test_deep_tables(text, tmp_path):
    """Of a dotted key, too, whose tables take memory as the square of its parts."""
    file = written(tmp_path, text)
    [line] = assert_refused(run("modes", file), file)
    assert "nested too deeply" in line


def test_marks_and_line_ends_of_windows_are_no_fault(tmp_path):
    text = TEXTS["single"].replace("\n", "\r\n")
    assert run("check", written(tmp_path, b"\xef\xbb\xbf" + text.encode())).exit_code == 0


def test_two_designs_of_one_name(tmp_path):
    one, two = (
        written(tmp_path, RAW["single"], "one.toml"),
        written(tmp_path, RAW["single"], "two.toml"),
    )
    [line] = assert_refused(run("modes", one, two, "--out", tmp_path / "out"), two)
    assert line.startswith('design.name = "single": is the name of another design of this run')


def test_one_bad_design_of_two_writes_nothing(tmp_path):
    good, bad, out = from_template(tmp_path), written(tmp_path, FIVE, "bad.toml"), tmp_path / "out"
    assert_refused(run("modes", good, bad, "--out", out), bad, out)


def error_about_out(result, out):
    """What is said of a folder that takes no results."""
    assert (result.exit_code if hasattr(result, "exit_code") else result.returncode) == 2
    assert result.stdout == ""
    [line] = result.stderr.splitlines()
    assert line.startswith(f"--out = {out}")
    assert "; name a folder" in line
    return line


def test_out_is_a_file(tmp_path):
    file, out = from_template(tmp_path), tmp_path / "out"
    out.write_text("mine")
    assert "names a file" in error_about_out(run("modes", file, "--json", "--out", out), out)
    assert out.read_text() == "mine"


@pytest.mark.parametrize("call", ["fsync", "replace"])
def test_no_space_for_results(call, tmp_path, monkeypatch):
    file, out = from_template(tmp_path), tmp_path / "out"

    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, call, full)
    assert "No space left on device" in error_about_out(
        run("modes", file, "--json", "--out", out), out
    )
    assert list(out.iterdir()) == []


def test_no_space_for_results_in_earnest(tmp_path):
    file, out = from_template(tmp_path), tmp_path / "out"
    result = process("modes", file, "--json", "--out", out, limit=4096)
    assert "File too large" in error_about_out(result, out)
    assert list(out.iterdir()) == []


def test_defaults_of_every_command_are_checked_by_any(tmp_path):
    out = tmp_path / "out"
    text = (
        TEXTS["single"]
        + '\n[analysis.response]\nbogus = 1\n[analysis.xcouple]\nk = "abc"\noffset = "0:1:3"\n'
    )
    for command in ("check", "modes", "response"):
        file = written(tmp_path, text)
        lines = assert_refused(
            run(command, file, *(() if command == "check" else ("--out", out))), file, out
        )
        assert [line.split(":")[0] for line in lines] == [
            "analysis.response.bogus = 1",
            'analysis.xcouple.k = "abc"',
        ]


LONG = {
    "a text": lambda n: f'x = "{"a" * n}"',
    "an integer": lambda n: f"constants.gravity = {'1' * n}",
    "a hexadecimal integer": lambda n: f"constants.gravity = 0x{'1' * n}",
    "digits of a float": lambda n: f"constants.gravity = 9.{'1' * n}",
    "a key": lambda n: f"{'a' * n} = 1",
    "a comment": lambda n: f"# {'a-' * (n // 2)}",
    "blanks": lambda n: f"x = 1{' ' * n}",
    "quotes": lambda n: f"x = '''{chr(34) * n}'''",
    "words": lambda n: f"x = '''{'a ' * (n // 2)}'''",
    "keys": lambda n: "\n".join(f"k{i} = 1" for i in range(n // 12)),
    "tables": lambda n: "\n".join(f"[[stage]]\nname = 's{i}'" for i in range(n // 50)),
}


@pytest.mark.parametrize("kind", LONG)
def test_the_time_to_read_grows_as_the_length(kind):
    """Three million letters: if it grew as their square, this would take hours."""
    text = f"{LONG[kind](3_000_000)}\n{reader.template('single', 'single')}"
    if kind == "digits of a float":
        assert reader.parse(text).constants.gravity == pytest.approx(9 + 1 / 9)
    elif kind == "a comment":
        assert reader.parse(text).design.name == "single"
    else:
        with pytest.raises(InputError) as caught:
            reader.parse(text)
        assert len(str(caught.value)) < 1e6


@pytest.mark.parametrize(
    ("edits", "words"),
    [
        ({("design", "title"): "a" * 200_000}, "design.title = .*: is longer than"),
        ({("analysis", "modes"): {"x": "a" * 200_000}}, "analysis.modes.x = .*: is longer than"),
        ({("stage", 0, "wires", "profile"): "a" * 5000}, r"profile = .*: cannot be read"),
    ],
)
def test_texts_have_a_longest_length(edits, words, tmp_path):
    file = written(tmp_path, edited(tomllib.loads(reader.template("single", "single")), edits))
    (line,) = assert_refused(run("check", file), file)
    assert re.search(words, line)


def test_a_long_integer_is_refused_with_its_line():
    with pytest.raises(InputError, match=r"^line 2: is not TOML: a number has thousands of digits"):
        reader.parse(f"[constants]\ngravity = {'1' * 100_000}")


def test_a_text_is_no_longer_than_a_file():
    with pytest.raises(InputError, match=r"has more than 4 million characters"):
        reader.parse("#" * 5_000_000)
