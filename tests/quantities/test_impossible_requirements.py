"""Requirements that no design can meet are refused by every command, before anything is solved."""

from __future__ import annotations

import pytest

import suspension_cli as sus
from tests.support.commandline import run, written

LENGTH = "stage.test.wires.l"
FRACTION = 'quantity = "top fraction of test pitch"'
BEYOND = f"\n[[requirement]]\n{FRACTION}\nat_least = 1.5\n"
FREE = f'[[free]]\nname = "{LENGTH}"\nlower = 0.2\nupper = 0.4\n'
PITCH = '\n[[requirement]]\nquantity = "test pitch"\n'
SCATTER = '\n[[tolerance.wire]]\nstage = "test"\nlength = { normal = 1e-5 }\n'
SWEEP = ("--vary", f"{LENGTH}=0.27:0.29:3")
CASES = {
    "check": ("check", BEYOND, (), "requirement.1.at_least = 1.5: "),
    "compare": ("compare", BEYOND, (), "requirement.1.at_least = 1.5: "),
    "map": ("sweep", BEYOND, (*SWEEP, "--vary", "stage.test.wires.d=1e-3:2e-3:3"), "at_least"),
    "line": ("sweep", "", (*SWEEP, "--require", "top fraction of 1 in 1.5:2"), "--require = 1.5: "),
    "builds": ("tolerance", BEYOND + SCATTER, (), "requirement.1.at_least = 1.5: "),
    "yield": (
        "tolerance",
        f"{SCATTER}\n[[tolerance.require]]\n{FRACTION}\nabove = 1.5\n",
        (),
        "tolerance.require.1.above = 1.5: ",
    ),
    "a design's own goal": ("optimise", BEYOND, FREE, "requirement.1.at_least = 1.5: "),
    "a goal": ("optimise", "", FREE + BEYOND, "requirement.1.at_least = 1.5: "),
    "a value": ("optimise", "", f"{FREE}{PITCH}equals = -1.0", "requirement.1.equals = -1: "),
    "two goals": (
        "optimise",
        "",
        f"{FREE}{PITCH}at_least = 5.0\n{PITCH}at_most = 2.0",
        "requirement.1.at_least = 5: contradicts requirement.2.at_most = 2",
    ),
    "a goal against the design": (
        "optimise",
        f"{PITCH}at_most = 2.0",
        f"{FREE}{PITCH}at_least = 5.0",
        "requirement.1.at_least = 5: contradicts requirement.1.at_most of the design = 2",
    ),
    "magnitudes": (
        "sweep",
        "",
        (*SWEEP, "--require", "test static x > 2", "--require", "test static x < 1"),
        "--require = 2: contradicts --require = 1",
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_a_requirement_that_no_design_meets_is_refused(name, tmp_path):
    command, tables, more, said = CASES[name]
    design = written(tmp_path, sus.template("single").text + tables)
    words = [command, design]
    if command == "compare":
        words.append(design)
    if command == "optimise":
        goals = tmp_path / "goals.toml"
        goals.write_text(more)
        more = (goals,)
    if command != "check":
        more = (*more, "--out", tmp_path / "out")
    result = run(*words, *more)
    assert result.exit_code == 2
    [line] = result.stderr.splitlines()
    assert said in line
    assert "no design can meet both; correct" in line or "is never" in line
    assert not (tmp_path / "out").exists()


def test_magnitudes_on_both_sides_are_possible(tmp_path):
    """A value below -2 is above a magnitude of 1."""
    tables = '\n[[requirement]]\nquantity = "test static x"\nat_most = -2.0\n'
    design = sus.parse(sus.template("single").text + tables)
    found = sus.sweep(design, vary={LENGTH: [0.28]}, require=["test static x > 1"])
    assert not found.met.any()
