"""`--watch`: computed again after a save, what changed is said, faults do not end it."""

from __future__ import annotations

import json
import threading

import pytest

from suspension_cli.cli import watching
from tests.support.commandline import run
from tests.support.paths import CONFIGS

LENGTH = "l = 0.30 "


@pytest.fixture
def design(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text((CONFIGS / "double.toml").read_text())
    return file


def saving(monkeypatch, file, *texts):
    """Replace the watcher by one that writes the next text into the file, and then Ctrl-C."""

    def wait(watched):
        assert file.resolve() in watched
        for text in texts:
            file.write_text(text)
            yield True
        raise KeyboardInterrupt

    monkeypatch.setattr(watching, "changed_files", wait)


def test_a_save_is_computed_and_its_changes_are_said(design, tmp_path, monkeypatch):
    before = design.read_text()
    longer = before.replace(LENGTH, "l = 0.35 ")
    faulty = before.replace(LENGTH, "l = -0.35 ")
    saving(monkeypatch, design, longer, faulty, before)
    result = run("modes", design, "--watch", "--no-plot", "--fidelity", "string", "--out", tmp_path)
    assert result.exit_code == 0, result.stderr
    [fault] = [line for line in result.stderr.splitlines() if "0.35" in line]
    assert fault.startswith(f"{design}: ") and "wires.l" in fault
    assert result.stderr.count("watching mine.toml") == 4
    assert result.stdout.count("model: string") == 3
    there, back = (
        line.split()
        for line in result.stdout.splitlines()
        if line.startswith("changed: upper yaw:")
    )
    assert there[3:5] == ["frequency", back[6]]
    assert back[3:5] == ["frequency", there[6]]
    assert 0.9 < float(there[6]) / float(there[4]) < 1  # longer wires turn more slowly


def test_nothing_changed(design, tmp_path, monkeypatch):
    saving(monkeypatch, design, design.read_text() + "\n# a remark\n")
    result = run("check", design, "--watch")
    assert result.exit_code == 0, result.stderr
    assert "changed: nothing by more than 0.01 %" in result.stdout


def test_json_stays_alone_on_stdout(design, monkeypatch):
    longer = design.read_text().replace(LENGTH, "l = 0.35 ")
    saving(monkeypatch, design, longer)
    result = run("check", design, "--watch", "--json")
    assert result.exit_code == 0, result.stderr
    documents = [json.loads(line) for line in result.stdout.splitlines()]
    assert [one["command"] for one in documents] == ["check", "check"]
    assert "\nchanged: upper.1: tension" in result.stderr


def test_real_saves_are_seen(design):
    """Those of editors that write a new file and rename it, and what is saved before the wait."""
    watched = watching.list_files([str(design)])
    saves = watching.changed_files(watched)
    design.write_text(design.read_text() + "# one\n")
    assert next(saves)

    def replace():
        new = design.with_suffix(".new")
        new.write_text("# two\n")
        new.replace(design)

    timer = threading.Timer(0.3, replace)
    timer.start()
    assert next(saves)


def test_files_that_a_file_names_are_watched(tmp_path):
    (tmp_path / "table.csv").write_text("1,2\n")
    goals = tmp_path / "goals.toml"
    goals.write_text('[[link]]\nfile = "table.csv"\ntitle = "nowhere"\nother = "late.csv"\n')
    missing = tmp_path / "missing.toml"
    found = watching.list_files([str(goals), str(missing)])
    expected = ["goals.toml", "missing.toml", "table.csv", "late.csv"]
    assert [path.name for path in found] == expected


def test_a_file_in_a_folder_that_is_named_later_is_seen(design, tmp_path):
    """As the list of files grows while they are watched."""
    watched = watching.list_files([str(design)])
    saves = watching.changed_files(watched)
    later = tmp_path / "sub" / "noise.csv"
    later.parent.mkdir()
    watched.append(later)
    timer = threading.Timer(0.5, lambda: later.write_text("1,2\n"))
    timer.start()
    assert next(saves)


def test_changes_of_documents():
    old = {
        "q": 2.0,
        "residual": 1e-16,
        "modes": [{"label": "a", "frequency_hz": 1.0}, {"label": "b", "frequency_hz": None}],
        "real": [1.0, -2.0, None],
    }
    new = {
        "q": 2.00001,
        "residual": 3e-16,
        "modes": [{"label": "a", "frequency_hz": 1.1}, {"label": "c", "frequency_hz": 3.0}],
        "real": [1.1, -2.0, None],
    }
    assert watching.describe_changes(old, new).splitlines() == [
        "changed: a: frequency 1 -> 1.1 Hz, +10 %",
        "changed: real by up to 5 % of the largest",
        "changed: new: c",
    ]
    assert watching.describe_changes(new, old).splitlines()[-1] == "changed: gone: c"


@pytest.mark.parametrize(
    ("key", "text"),
    [
        ("decay_rate_per_s", "decay rate 1 -> 2 1/s"),
        ("temperature_k", "temperature 1 -> 2 K"),
        ("soft_n_m_per_rad", "soft 1 -> 2 N m/rad"),
        ("mass", "mass 1 -> 2"),
    ],
)
def test_units_of_changes(key, text):
    assert watching.describe_changes({key: 1.0}, {key: 2.0}) == f"changed: {text}, +1e+02 %"


def test_a_missing_file_is_not_waited_for(tmp_path):
    result = run("modes", tmp_path / "missing.toml", "--watch")
    assert result.exit_code == 2
    assert result.stderr.startswith("--watch = ")
    assert "waits for files that are saved, and this is none; name a file" in result.stderr
