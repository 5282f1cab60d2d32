"""`pendsus new`: templates and examples that are valid designs under their own names."""

from __future__ import annotations

import inspect
import shlex

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.analyses import known_analyses
from suspension_cli.cli import file_commands
from suspension_cli.design import reader
from suspension_cli.design.bodies import body_inertia, body_mass
from tests.support.commandline import assert_refused, run, written
from tests.support.designs import TEXTS


def test_kinds_are_the_templates():
    assert file_commands.KINDS == reader.TEMPLATES


@pytest.mark.parametrize("kind", file_commands.KINDS)
def test_templates_raise_no_warning(kind, tmp_path):
    file = tmp_path / "mine.toml"
    assert run("new", kind, file).exit_code == 0
    assert reader.read(file).design.design.name == "mine"
    assert run("new", kind).stdout == file.read_text().replace('name = "mine"', f'name = "{kind}"')
    checked = run("check", file, "--strict")
    assert checked.exit_code == 0 and checked.stdout.startswith(f"{file}: good; ")


def test_replaces_only_by_force(tmp_path):
    file = written(tmp_path, "precious", "mine.toml")
    [line] = assert_refused(run("new", "single", file), file)
    assert line == "exists already; name another file, or give --force"
    assert file.read_text() == "precious"
    assert run("new", "single", file, "--force").exit_code == 0
    assert file.read_text() == TEXTS["single"].replace('name = "single"', 'name = "mine"')
    assert [path.name for path in tmp_path.iterdir()] == ["mine.toml"]


def test_values_that_are_set_keep_the_comments(tmp_path):
    """All other lines are those of the template."""
    file = tmp_path / "mine.toml"
    words = ("--set", "stage.test.wires.d=0.002", "--set", "design.author=me")
    assert run("new", "single", file, *words).exit_code == 0
    lines = file.read_text().splitlines()
    old = TEXTS["single"].replace('name = "single"', 'name = "mine"').splitlines()
    assert [line for line in lines if line not in old] == [
        'author = "me"',
        "d = 0.002                  # height of the lower ends above the centre of mass",
    ]
    assert len(lines) == len(old) + 1
    refused = run("new", "single", file, "--force", "--set", "stage.test.wires.q=1")
    assert refused.exit_code == 2
    assert "stage.test.wires.q = 1: unknown key" in refused.stderr
    assert file.read_text().splitlines() == lines


def test_examples(tmp_path):
    rows = run("new", "--examples").stdout.splitlines()[1:]
    assert [row.split()[0] for row in rows] == reader.examples()
    assert "  husman2000/table2           Prototype GEO 600 triple pendulum" in rows
    file = tmp_path / "mirror.toml"
    assert run("new", "--from", "husman2000/figure6", file).exit_code == 0
    design = reader.read(file).design
    assert (design.design.name, design.stage[0].body.mass) == ("mirror", 5.6)
    assert "did you mean 'quadruple'" in run("new", "--from", "quadrupel").stderr


@pytest.mark.parametrize("name", file_commands.DETECTORS)
def test_suspensions_of_detectors(name, tmp_path):
    file = tmp_path / "mine.toml"
    assert run("new", "--from", name, file).exit_code == 0
    assert reader.read(file).design.design.name == "mine"
    assert f"  {name} " in run("new", "--help").stdout


@pytest.mark.parametrize(
    "words", [(), ("triple", "a.toml", "b.toml"), ("--from", "double", "a.toml", "b.toml")]
)
def test_what_it_takes_is_said(words):
    done = run("new", *words)
    assert done.exit_code == 2 and "pendsus new triple my.toml" in done.stderr


def test_a_kind_is_no_file_beside_from(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = run("new", "single", "--from", "tower")
    assert done.exit_code == 2 and not list(tmp_path.iterdir())
    assert done.stderr.startswith('new = "single": is a kind of design, beside --from; ')
    assert run("new", "./single", "--from", "tower").exit_code == 0


@pytest.mark.parametrize("name", ["response", "sensitivity"])
def test_examples_of_help_run_on_a_new_triple(name, tmp_path):
    file = tmp_path / "my.toml"
    assert run("new", "triple", file).exit_code == 0
    text = inspect.cleandoc(known_analyses.get(name).__doc__ or "")
    (line,) = (line for line in text.splitlines() if line.startswith("Example: "))
    words = shlex.split(line.removeprefix("Example: pendsus "))
    words = [str(file) if word == "my.toml" else word for word in words]
    done = run(*words, "--no-plot", "--out", tmp_path)
    assert done.exit_code == 0, done.stderr


def test_torsion_pendulum_swings_as_in_the_textbook():
    """omega^2 I = (G J + T I_p / A) / l, with J = pi r^4 / 2 and I_p / A = r^2 / 2 (round wire)."""
    design = sus.template("torsion")
    body = design.stage[0].body
    wire = design.stage[0].wires
    shear = 4.11e11 / (2 * 1.28)
    twist = shear * np.pi * wire.radius**4 / 2 + body_mass(body) * 9.81 * wire.radius**2 / 2
    found = sus.modes(design)
    yaw = found.frequency[found.label.index("bar yaw")]
    omega = np.sqrt(twist / wire.l / body_inertia(body)[2][2])
    assert yaw == pytest.approx(omega / (2 * np.pi), rel=1e-6)
