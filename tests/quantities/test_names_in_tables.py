"""Names of modes as tables print them, and of motions in both forms, mean the same everywhere."""

from __future__ import annotations

import re

import numpy as np
import pytest

import suspension_cli as sus
from tests.support.commandline import run, written

DESIGN = sus.example("double")


def frequencies(*names: str) -> np.ndarray:
    return sus.sweep(
        DESIGN, vary={"stage.test.wires.l": [0.28]}, results=list(names), fidelity="string"
    ).value


def test_every_label_of_the_modes_table_is_a_result():
    modes = sus.modes(DESIGN, fidelity="string")
    found = frequencies(*modes.label)
    np.testing.assert_allclose(found.ravel(), modes.frequency, rtol=1e-6)


@pytest.mark.parametrize(
    ("letter", "name"),
    [
        ("test x", "test longitudinal"),
        ("upper y", "upper transverse"),
        ("lowest z", "lowest vertical"),
        ("x-pitch 2", "longitudinal-pitch 2"),
        ("test x#1", "test longitudinal#1"),
    ],
)
def test_both_names_of_a_motion_mean_the_same(letter, name):
    one, other = frequencies(letter, name).ravel()
    assert one == other


@pytest.mark.parametrize("dof", ["x", "longitudinal"])
def test_goals_take_both_names(dof, tmp_path):
    goals = written(
        tmp_path,
        f"""
        goal = [{{ kind = "band", dof = ["{dof}"], at_least = 0.5 }}]
        free = [{{ name = "stage.test.wires.l", lower = 0.2, upper = 0.5 }}]
        """,
        "goals.toml",
    )
    found = sus.optimise(DESIGN, goals, starts=1, fidelity="string")
    assert "longitudinal-pitch 1" in str(found)


@pytest.mark.parametrize("command", ["response", "thermal", "budget"])
def test_given_frequencies_are_rows(command, tmp_path):
    file = written(tmp_path, DESIGN.text, "double.toml")
    given = ("--frequency", "1.25,10,10.00001", "--output", "test.x", "--fidelity", "beam")
    text = run(command, file, *given, "--out", tmp_path, "--no-plot").stdout
    if command == "budget":
        (head,) = [line for line in text.splitlines() if line.split()[:2] == ["cause", "RMS"]]
        assert re.findall(r"\S+(?= Hz)", head) == ["1.25", "10", "10.00001"]
        return
    rows = [line.split() for line in text.splitlines()]
    assert [row[0] for row in rows if row and row[0][0].isdigit()] == ["1.25", "10", "10.00001"]


@pytest.mark.parametrize("name", ["quadruple", "husman2000/triple-vertical"])
def test_optimise_names_modes_as_their_table_does(name, tmp_path):
    goals = written(
        tmp_path,
        """
        goal = [{ kind = "height", at_most = 2.0 }]
        free = [{ name = "stage.test.wires.d", lower = 1e-3, upper = 2e-3 }]
        """,
        "goals.toml",
    )
    found = sus.optimise(f"configs/{name}.toml", goals, starts=1, fidelity="beam")
    modes = sus.modes(found.design, fidelity="beam")
    assert any("#2" in label for label in modes.label)
    named = dict(zip(found.modes.label, found.modes.after, strict=True))
    assert named == pytest.approx(dict(zip(modes.label, modes.frequency, strict=True)), rel=1e-6)
