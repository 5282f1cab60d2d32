"""Names of modes as tables print them, and of motions in both forms, mean the same everywhere."""

from __future__ import annotations

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
    found = frequencies(*modes.numbered_label)
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


def test_given_frequencies_are_rows(tmp_path):
    file = written(tmp_path, DESIGN.text, "double.toml")
    given = ("--frequency", "1.25,2.5,31.75", "--out", tmp_path, "--no-plot")
    rows = run("response", file, *given).stdout.splitlines()
    first = [line.split()[0] for line in rows if len(line.split()) == 3]
    assert [row for row in first if row[0].isdigit()] == ["1.25", "2.5", "31.75"]
