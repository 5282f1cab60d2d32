"""Quantities of builds that some lack, and what is printed and drawn of them."""

from __future__ import annotations

import tomllib

import suspension_cli as sus
from suspension_cli.equilibrium import nominal
from suspension_cli.models import registry
from tests.support.commandline import run, written
from tests.support.golden import CONFIGS

DAMPED = tomllib.loads((CONFIGS / "triple-damped.toml").read_text())
SCATTER = {
    "wire": [{"stage": "test", "lower": {"normal": 1e-4}, "length": {"normal": 1e-5}}],
    "body": [{"stage": "test", "com": {"normal": 1e-4}}],
}


def test_builds_without_a_value_are_counted(tmp_path):
    """A loop whose gain is so large that it is unstable in each build has no margins: no build
    meets a requirement on these."""
    raw = tomllib.loads((CONFIGS / "triple-damped.toml").read_text()) | {"tolerance": SCATTER}
    raw["control"]["loop"][4]["gain"] *= 1e6
    file = written(tmp_path, raw)
    words = ("tolerance", file, "--builds", "3", "--workers", "1", "--out", tmp_path, "--no-plot")
    done = run(*words, "--fidelity", "string", "--require", "margin pitch.gain > 3")
    assert done.exit_code == 0, done.stderr
    assert (
        "3 of 3 builds have no margin pitch.gain: each has no margin: the closed loop is unstable"
        in done.stdout
    )
    document = sus.load(next(tmp_path.glob("*.h5"))).document()
    [found] = document["results"]
    assert (found["missing"], found["mean"]) == (3, None)
    assert document["all_requirements"]["yield"] == 0.0


def test_text_and_picture_follow_from_the_file_alone(tmp_path, monkeypatch):
    """Nothing is balanced or solved for them."""
    raw = DAMPED | {"tolerance": SCATTER}
    words = ("--builds", "4", "--workers", "1", "--fidelity", "string", "--no-plot", "-q")
    more = ("--require", "test pitch > 0.1", "--result", "test height", "--out", tmp_path)
    done = run("tolerance", written(tmp_path, raw), *words, *more)
    assert done.exit_code == 0, done.stderr

    def refuse(*_):
        raise AssertionError

    monkeypatch.setattr(registry, "by_name", refuse)
    monkeypatch.setattr(nominal, "expand", refuse)
    found = sus.load(next(tmp_path.glob("*.h5")))
    assert str(found).strip() == done.stdout.strip()
    assert len(found.plot().axes) > 3
