"""Parameters that follow from others: `[[tie]]` and ``--tie``."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.design import ties
from suspension_cli.design.typed_tables import Raw
from suspension_cli.errors import InputError
from tests.support.commandline import document, run

UPPER = "stage.test.wires.t1"
LOWER = "stage.test.wires.t2"
TIE = f"{LOWER} = {UPPER} + 5e-3"
TABLE = f'\n[[tie]]\nname = "{LOWER}"\nequals = "{UPPER} + 5e-3"\n'


@pytest.fixture
def file(tmp_path):
    """A double pendulum."""
    path = tmp_path / "mine.toml"
    path.write_text(sus.template("double").text)
    return str(path)


@pytest.mark.parametrize(
    ("expression", "expected"),
    [
        ("a.x + 1", 3.0),
        ("2*a.x - a.y/4", 2.75),
        ("-(a.x**3) + 1e1", 2.0),
        ("sqrt(2 * a.x) / pi", 2.0 / np.pi),
        ("materials.fused-silica.e-1", 6.0),
        ("a.list.2-.5", 7.5),
    ],
)
def test_expressions_have_the_values_of_arithmetic(expression, expected):
    """Paths may have numbers and hyphens; a number may follow a minus without a space."""
    numbers = {"x": 2.0, "y": 5.0, "list": [7.0, 8.0]}
    known: Raw = {"a": numbers, "materials": {"fused-silica": {"e": 7.0}}}
    known["tie"] = [{"name": "b.z", "equals": expression}]
    tied = ties.apply(known)
    assert tied["b"]["z"] == pytest.approx(expected, rel=1e-15)


def test_ties_are_applied_in_their_order():
    """A tie may use one before it."""
    chain = [{"name": "a.y", "equals": "2 * a.x"}, {"name": "a.z", "equals": "a.y + a.x"}]
    assert ties.apply({"a": {"x": 1.0}, "tie": chain})["a"] == {"x": 1.0, "y": 2.0, "z": 3.0}


@pytest.mark.parametrize(
    "circle",
    [
        [("a.x", "a.x + 1")],
        [("a.y", "a.z + 1"), ("a.z", "2 * a.x")],
        [("a.y", "a.z + 1"), ("a.z", "a.y + 1")],
        [("a.y", "a.x"), ("a.y", "2 * a.x")],
        [("list.one.x", "list.1.x + 1")],
    ],
)
def test_ties_that_depend_on_themselves_are_refused(circle):
    """Each reading of the design would change it again; a member has a name and a number."""
    tied = [{"name": name, "equals": equals} for name, equals in circle]
    known: Raw = {"a": {"x": 1.0, "y": 0.0, "z": 0.0}, "list": [{"name": "one", "x": 1.0}]}
    with pytest.raises(InputError, match="depends on itself, on a tie behind it, or is tied twice"):
        ties.apply(known | {"tie": tied})


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (LOWER, "is not of the form PATH = EXPRESSION"),
        (f"{LOWER} = {UPPER} +", "is no expression"),
        (f"{LOWER} = __import__('os')", "is no expression"),
        (f"{LOWER} = _0 + {UPPER}", "is no expression"),
        (f"{LOWER} = {'(' * 300}1{')' * 300}", "is no expression"),
        (f"{LOWER} = {'-' * 300}1", "is no expression"),
        (f"{LOWER} = {UPPER} // 2", "is no expression"),
        (f"{LOWER} = stage.test.wires.t11", "did you mean 'stage.test.wires.t1'?"),
        (f"{LOWER} = stage.test.name", "gives no number at stage.test.name"),
        (f"{LOWER} = 1 / ({UPPER} - {UPPER})", "has no value (float division by zero)"),
        (f"{LOWER} = 10 ** 1000", "has no value"),
        (f"stage.other.wires.t2 = {UPPER}", "there is no 'other' here"),
        (f"stage.test.wires.q2 = {UPPER}", "did you mean 't2'?"),
        (f"{LOWER} = 1000 * {UPPER}", "longer than its horizontal span"),
    ],
)
def test_faults_are_one_clear_line(file, given, message):
    """Nothing is computed, exit code 2."""
    result = run("check", file, "--tie", given)
    assert result.exit_code == 2
    assert message in result.stderr
    assert len(result.stderr.splitlines()) == 1


def test_a_tied_parameter_cannot_be_given_or_varied(file):
    """By --set, as an axis, as a free number of an optimisation."""
    for words in (["check", "--set", f"{LOWER}=0.1"], ["sweep", "--vary", f"{LOWER}=0.1:0.2:3"]):
        result = run(words[0], file, "--tie", TIE, *words[1:])
        assert result.exit_code == 2
        assert "follows from others: it is tied to" in result.stderr
    with pytest.raises(InputError, match="follows from others"):
        sus.read(file, ties=TIE).replace({LOWER: 0.1})
    goals = Path(file).with_name("goals.toml")
    limit = '[[requirement]]\nquantity = "lowest roll"\nat_most = 3.0\n'
    goals.write_text(f'[[free]]\nname = "{LOWER}"\nlower = 0.01\nupper = 0.2\n{limit}')
    with pytest.raises(InputError, match="follows from others"):
        sus.optimise(sus.read(file, ties=TIE), goals)


def test_a_sweep_keeps_ties(file):
    """Each point is the design with both values, whether tied in the file or by the option."""
    values = [0.08, 0.1]
    plain = sus.read(file)
    by_option = sus.read(file, ties=TIE)
    by_table = sus.parse(plain.text + TABLE)
    for design in (by_option, by_table):
        found = sus.sweep(design, vary={UPPER: values}, results=["modes"], fidelity="string")
        untied = [plain.replace({UPPER: x, LOWER: x + 5e-3}) for x in values]
        expected = [sus.modes(one, fidelity="string").frequency for one in untied]
        assert found.value == pytest.approx(np.array(expected), rel=1e-6)


def test_derivatives_keep_ties(file):
    """By the chain rule: the slope of a tied design is the sum of those of both parameters."""
    free = sus.read(file)
    whole = {}
    for name, design in (("free", free), ("tied", sus.read(file, ties=f"{LOWER} = 2 * {UPPER}"))):
        start = (
            design.replace({UPPER: 0.05})
            if name == "tied"
            else free.replace({UPPER: 0.05, LOWER: 0.1})
        )
        found = sus.sensitivity(start, results="lowest roll", fidelity="string")
        whole[name] = dict(zip(found.parameter, found.derivative[:, 0], strict=True))
    assert LOWER not in whole["tied"]
    expected = whole["free"][UPPER] + 2 * whole["free"][LOWER]
    assert whole["tied"][UPPER] == pytest.approx(expected, rel=1e-5)


def test_the_design_in_a_result_has_the_values(file, tmp_path):
    """Reading it again needs no option, and changes nothing."""
    out = str(tmp_path / "out")
    words = ["modes", file, "--tie", TIE, "--set", f"{UPPER}=0.1", "--out", out, "--no-plot"]
    assert run(*words).exit_code == 0
    [path] = (tmp_path / "out").glob("*.h5")
    kept = sus.load(path).run.design
    wires = kept.design.stage[-1].wires
    assert wires.t2 == wires.t1 + 5e-3
    assert wires.t1 == 0.1
    assert "tied" not in kept.name
    assert [tie.name for tie in kept.design.tie] == [LOWER]


def test_check_lists_ties(file):
    """With their expressions and values."""
    found = document("check", file, "--tie", TIE, "--set", f"{UPPER}=0.1")
    assert found["ties"] == [{"name": LOWER, "equals": f"{UPPER} + 5e-3", "value": 0.1 + 5e-3}]
    shown = run("check", file, "--tie", TIE, "--set", f"{UPPER}=0.1").stdout
    assert f"{LOWER} = {UPPER} + 5e-3 = 105 mm" in shown
