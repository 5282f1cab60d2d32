"""What the command promises: help, JSON, results files, options and where they come from."""

from __future__ import annotations

import math
import os
import re
import shlex
import string
import subprocess
import sys
import tomllib

import click
import h5py
import pytest

import suspension_cli as sus
from suspension_cli.cli.main import COMMANDS, main, summary
from suspension_cli.conventions import DOFS
from suspension_cli.design import reader
from suspension_cli.version import __version__
from tests.support.commandline import (
    edited,
    from_template,
    modes_json,
    process,
    python,
    run,
    strict_json,
    written,
)
from tests.support.designs import RAW, TEXTS
from tests.support.golden import CONFIGS, ROOT

HEAVY = ("numpy", "scipy", "h5py", "matplotlib", "msgspec", "rich")
UNSTABLE = ("--set", "stage.test.wires.d=-0.05", "--set", "stage.test.wires.s=0.0")
"""Hangs the single pendulum from below its centre of mass, free to topple over."""


def test_help_lists_every_command():
    result = run("--help")
    assert result.exit_code == 0
    for name in COMMANDS:
        assert result.stdout.count(f"\n  {name} ") == 1
        assert summary(name).rstrip(".").split(":")[0] in " ".join(result.stdout.split())


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_help(name):
    result = run(name, "--help")
    assert result.exit_code == 0
    assert result.stdout.startswith(f"Usage: pendsus {name} ")
    for param in main.get_command(None, name).params:
        assert isinstance(param, click.Argument) or param.help, (
            f"--{param.name} of {name} says nothing"
        )


def test_help_imports_nothing_heavy():
    requested = [["--help"], ["--version"], *([name, "--help"] for name in COMMANDS)]
    code = f"""
import contextlib, io, sys
from suspension_cli.cli.main import main
for args in {requested!r}:
    with contextlib.redirect_stdout(io.StringIO()):
        main(args, standalone_mode=False)
    print(args, sorted(set({HEAVY!r}) & set(sys.modules)))
"""
    result = python(code)
    lines = result.stdout.splitlines()
    assert len(lines) == len(requested), result.stderr
    for line, args in zip(lines, requested, strict=True):
        assert line == f"{args} []"


SINGLE = (
    ("modes", "double.toml"),
    ("response", "double.toml", "--input", "support.x", "--output", "test.x", "--frequency", "1"),
    ("thermal", "geo-silica-triple.toml", "--output", "test.x", "--frequency", "10"),
)


def test_single_designs_need_no_compiled_loops_and_pictures_no_pyplot(tmp_path):
    """Their import takes half a second."""
    requested = [
        [name, str(ROOT / "configs" / file), *words, "--no-plot", "-q", "--out", str(tmp_path)]
        for name, file, *words in SINGLE
    ]
    code = f"""
import sys
from suspension_cli.cli.main import main
for args in {requested!r}:
    main(args, standalone_mode=False)
from suspension_cli.analyses.modes import picture
from suspension_cli.drawing import draw
sys.exit(bool({{"matplotlib.pyplot"}} & {{*sys.modules}}))
"""
    assert python(code).returncode == 0


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("mods",), "No such command 'mods'; did you mean 'modes'?"),
        (("modes",), "Missing argument"),
        (("optimise", "x.toml"), "free = [{ name = "),
        (("modes", "--fidelity", "best", "x.toml"), "--fidelity"),
        (("modes", "--sett", "x.toml"), "--sett"),
    ],
)
def test_wrong_words(words, says):
    result = run(*words)
    assert result.exit_code == 2 and says in result.stderr


@pytest.mark.parametrize("base", RAW)
def test_json_of_modes(base, tmp_path):
    answer = modes_json(written(tmp_path, RAW[base]), "--out", tmp_path / "out")
    keys = "command design fidelity stable modes damping without_loss estimated_error"
    assert {*answer} - {"error_unknown"} == {*keys.split()}
    assert ("error_unknown" in answer) == (answer["estimated_error"] is None)
    assert (answer["command"], answer["design"], answer["stable"]) == ("modes", base, True)
    assert answer["fidelity"] in ("force", "string", "beam", "violin")
    stages = ["frame", *(stage["name"] for stage in RAW[base]["stage"])]
    for mode in answer["modes"]:
        assert {"frequency_hz", "dof", "stage", "q"} <= set(mode)
        assert "growth_rate_per_s" not in mode
        assert mode["dof"] in DOFS and mode["stage"].split(".")[0] in stages
        assert mode["q"] is None or mode["q"] > 0
    frequencies = [mode["frequency_hz"] for mode in answer["modes"]]
    assert frequencies == sorted(frequencies) and min(frequencies) >= 0
    assert len(frequencies) >= 6 * len(RAW[base]["stage"])


def test_json_of_an_unstable_design(tmp_path):
    file, out = from_template(tmp_path), tmp_path / "out"
    result = run("modes", file, "--json", "--out", out, *UNSTABLE)
    assert result.exit_code == 0
    answer = strict_json(result.stdout)
    assert answer["stable"] is False
    first, *rest = answer["modes"]
    assert first["frequency_hz"] is None
    assert first["growth_rate_per_s"] > 0
    assert first["dof"] == "pitch"
    assert all(mode["frequency_hz"] > 0 for mode in rest)
    assert "warning: single is unstable: test pitch grows at " in result.stderr
    assert len(list(out.glob("single-*-modes.h5"))) == 1


def test_json_of_two_designs_is_a_list(tmp_path):
    files = [from_template(tmp_path, kind) for kind in ("triple", "single")]
    answer = modes_json(*files, "--out", tmp_path / "out")
    assert [part["design"] for part in answer] == ["triple", "single"]
    assert answer[1] == modes_json(files[1], "--out", tmp_path / "out")


def test_quiet(tmp_path):
    file = from_template(tmp_path)
    loud = run("modes", file, "--no-plot", "--out", tmp_path / "out")
    quiet = run("modes", file, "--no-plot", "--out", tmp_path / "out", "-q")
    assert loud.stderr and quiet.stderr == ""
    assert loud.stdout == quiet.stdout
    assert "test pitch" in quiet.stdout
    unstable = run("modes", file, "--no-plot", "--out", tmp_path / "unstable", "-q", *UNSTABLE)
    assert unstable.stderr.startswith("warning: ")
    assert unstable.stderr.count("\n") == 1


def test_results_file(tmp_path):
    """Where it comes from, the design with its overrides, and what JSON says; the command is a
    process of its own here, whose stdout is the document alone."""
    title = ("--set", "design.title=Another title")
    args = ["modes", str(written(tmp_path, TEXTS["rich"])), "--json", "--out", f"{tmp_path}/a b"]
    args += ["--set", "stage.test.wires.d=0.0015", *title]
    made = process(*args)
    assert made.returncode == 0 and made.stdout.count("\n") == 1, made.stderr
    answer = strict_json(made.stdout)
    with h5py.File(tmp_path / "a b" / "rich-test.wires.d=0.0015-modes.h5") as file:
        assert file.attrs["format"] == "pendsus" and file.attrs["format_version"] == 3
        assert file.attrs["pendsus_version"] == __version__
        assert file.attrs["fidelity"] == answer["fidelity"] == "string"
        program, *rest = shlex.split(file.attrs["command"])
        text = file.attrs["design"]
        frequency, square = file["modes/frequency"][:], file["modes/omega_squared"][:]
        energy = file["modes/energy"][:].sum((1, 2)) + file["modes/tip_energy"][:].sum(1)
    assert (program, rest[0]) == ("pendsus", "modes") and all(arg in rest for arg in args)
    edits = {("stage", 1, "wires", "d"): 0.0015, ("design", "title"): "Another title"}
    expected = edited(RAW["rich"], edits)
    assert tomllib.loads(text) == expected and reader.parse(text) == reader.convert(expected)
    assert frequency.tolist() == [mode["frequency_hz"] for mode in answer["modes"]]
    assert square == pytest.approx((2 * math.pi * frequency) ** 2, rel=1e-14)
    assert energy == pytest.approx(1, rel=1e-12)


def test_file_names_that_are_no_text(tmp_path):
    folder = os.fsencode(tmp_path) + b"/\xff"
    os.mkdir(folder)
    file = os.fsdecode(folder + b"/single.toml")
    with open(file, "w") as stream:
        stream.write(TEXTS["single"])
    result = process("modes", file, "--json", "--out", os.fsdecode(folder))
    assert result.returncode == 0, result.stderr
    assert os.path.exists(folder + b"/single-modes.h5")
    [line] = process("modes", file + "x").stderr.splitlines()
    assert "No such file" in line
    [line] = process(
        "modes", file, "--set", "design.title=" + os.fsdecode(b"\xff")
    ).stderr.splitlines()
    assert "not text" in line


def test_the_package_runs_as_a_module(tmp_path):
    """As the command does: the same name in help, the same exit code and line for a bad input."""
    done = [
        subprocess.run(
            [sys.executable, "-m", "suspension_cli", *words], capture_output=True, text=True
        )
        for words in (["--version"], ["modes", "--help"], ["modes", str(tmp_path / "x.toml")])
    ]
    assert done[0].stdout == f"pendsus, version {__version__}\n"
    assert done[1].stdout.startswith("Usage: pendsus modes ")
    assert done[2].returncode == 2 and done[2].stderr.count("\n") == 1


def test_overrides(tmp_path):
    file, out = from_template(tmp_path), tmp_path / "out"
    nominal = modes_json(file, "--out", out)
    heavy = modes_json(
        file, "--out", out, "--set", "constants.gravity=98.1", "--set", "design.name=heavy"
    )
    assert heavy["design"] == "heavy"
    ratio = heavy["modes"][0]["frequency_hz"] / nominal["modes"][0]["frequency_hz"]
    assert ratio == pytest.approx(math.sqrt(10), rel=0.02)
    by_number = modes_json(file, "--out", out, "--set", "stage.1.wires.l=0.5")
    assert by_number == modes_json(file, "--out", out, "--set", "stage.test.wires.l = 0.5")
    assert sorted(path.name for path in out.iterdir()) == [
        "heavy-modes.h5",
        "single-1.wires.l=0.5-modes.h5",
        "single-modes.h5",
        "single-test.wires.l=0.5-modes.h5",
    ]


@pytest.mark.parametrize(
    ("command", "files"),
    [
        (("modes", "--fidelity", "string"), ["-modes.h5", "-modes.png"]),
        (
            ("response", "--no-plot", "--csv"),
            ["-response-largest-output.csv", "-response.csv", "-response.h5"],
        ),
        (("sweep", "--vary", "stage.test.wires.s=0.01,0.02", "--no-plot"), ["-sweep.h5"]),
        (("export", "--format", "npz"), ["-statespace.npz"]),
        (("draw",), ["-draw.png"]),
        (("report", "--sections", "drawing"), ["-report.html"]),
    ],
    ids=lambda words: words[0],
)
def test_overrides_and_name_give_files_of_their_own(command, files, tmp_path):
    """Runs of one design that differ in one override leave each other's files as they are."""
    file, out = from_template(tmp_path), tmp_path / "out"
    depth, other = (
        ("--set", "stage.test.wires.d=0.002"),
        ("--set", "stage.test.wires.d_upper=0.002"),
    )
    stems = {"single": (), "single-test.wires.d=0.002": depth, "mine": (*depth, "--name", "mine")}
    stems["single-test.wires.d_upper=0.002"] = other
    name, *options = command
    for words in stems.values():
        result = run(name, file, *options, *words, "--out", out)
        assert result.exit_code == 0 and "replaced" not in result.stderr, result.stderr
    assert {path.name for path in out.iterdir()} == {f"{s}{end}" for s in stems for end in files}
    assert run(name, file, *options, "--name", "a/b", "--out", out).stderr.startswith("--name = ")


def test_names_of_texts_and_long_overrides(tmp_path):
    """Overrides that differ in letters no name has, or beyond its length, have files apart."""
    file, out = from_template(tmp_path), tmp_path / "out"
    for k in ("0.8", "0.9"):
        line = f"perturbation=[{{wire='test.1', k_factor=1.1}}, {{wire='test.2', k_factor={k}}}]"
        for words in (("--set", line), ("--set", f"stage.test.wires.d=0.00{'1' * 150}{k[2]}")):
            assert run("modes", file, "--no-plot", *words, "--out", out).exit_code == 0
    names = {path.name for path in out.iterdir()}
    assert len(names) == 4 and max(map(len, names)) < 180
    assert all(set(name) < set(string.ascii_letters + string.digits + "._=+-") for name in names)


@pytest.mark.parametrize("command", ["modes", "draw"])
def test_one_name_for_several_designs(command, tmp_path):
    files = [from_template(tmp_path, kind) for kind in ("single", "double")]
    result = run(command, *files, "--name", "mine", "--out", tmp_path / "out")
    assert result.exit_code == 2 and not (tmp_path / "out").exists()
    assert '--name = "mine": would name the files of several designs; ' in result.stderr


def test_the_api_names_files_after_the_design(tmp_path):
    """Overrides of `sus.read` do not change the name of a file that a sweep fills."""
    design = sus.read(from_template(tmp_path), overrides=["stage.test.wires.d=0.002"])
    sus.sweep(
        design, vary={"stage.test.wires.s": [0.01]}, fidelity="string", folder=tmp_path / "out"
    )
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["single-sweep.h5"]


def test_new_makes_a_name_of_any_file_name(tmp_path):
    file = tmp_path / 'my "first" design.toml'
    assert run("new", "single", file).exit_code == 0
    assert tomllib.loads(file.read_text())["design"]["name"] == "my-first-design"
    result = run("new", "single", "--name", 'a"b')
    assert result.exit_code == 2
    assert (
        result.stderr
        == '--name = "a\\"b": is no name of a design; give letters, digits, . _ and -\n'
    )


def test_check_prints_good_designs_beside_faults(tmp_path):
    good, bad = from_template(tmp_path, "blades"), tmp_path / "bad.toml"
    bad.write_text("[design]\n")
    done = run("check", bad, good, tmp_path / "missing.toml")
    assert done.exit_code == 2 and done.stdout.startswith(f"{good}: good; ")
    assert [line.split(": ")[0] for line in done.stderr.splitlines()][-1].endswith("missing.toml")
    assert str(bad) in done.stderr
    assert run("check", bad, good, "--json").stdout == ""


def test_linear_algebra_has_one_thread_unless_told_otherwise(monkeypatch):
    names = [f"{library}_NUM_THREADS" for library in ("OPENBLAS", "OMP", "MKL")]
    for name in names:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    run("--version")
    assert [os.environ[name] for name in names] == ["1", "3", "1"]


@pytest.mark.parametrize("name", ["modes", "response", "thermal", "sensitivity", "export", "damp"])
def test_verbose_says_more(name, tmp_path):
    """The model with its size and balance, and the time that each step takes."""
    file = CONFIGS / ("triple-damped.toml" if name == "damp" else "double.toml")
    words = (name, file, "--out", tmp_path, "--no-plot", "--fidelity", "string")
    if name == "thermal":
        words = (*words[:-1], "beam")
    plain, found = run(*words), run(*words, "--verbose")
    assert found.exit_code == 0, found.stderr
    more = found.stderr.replace(plain.stderr, "")
    design = file.stem
    assert f"{design}: model: " in more and " coordinates, residual force " in more
    for what in ("computed", "files written"):
        assert re.search(rf"{design}: {what} in \d+\.\d\d s \(\d+\.\d\d s of processor", more)
    assert found.stdout == plain.stdout
