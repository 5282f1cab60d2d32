"""`pendsus tradeoff`: errors against the commands' own results, advice, files, refusals."""

from __future__ import annotations

import numpy as np
import pytest
import tomli_w

import suspension_cli as sus
from suspension_cli.analyses.tradeoff.measure import Answer, Entry, ask, draw, format_time
from suspension_cli.drawing.panels import COLUMN
from suspension_cli.errors import InputError
from suspension_cli.models import registry
from tests.support import scenes
from tests.support.commandline import python
from tests.support.legible import assert_legible, said
from tests.support.paths import CONFIGS
from tests.support.quick_tradeoff import hurry

CASE = CONFIGS / "husman2000" / "table1-case3.toml"
MODELS = ["closed-form", "force", "string", "beam", "violin"]


@pytest.fixture(scope="module")
def found():
    with pytest.MonkeyPatch.context() as patch:
        hurry(patch)
        return sus.tradeoff(sus.read(CASE))


@pytest.fixture(scope="module")
def answers(found):
    names = ("modes", "sweep", "low", "high", "noise", "coupling")
    return dict(zip(names, found.answers, strict=True))


def errors(answer):
    return {entry.model: entry.error for entry in answer.entries if np.isfinite(entry.error)}


# Errors, against the results of the other commands.


def test_errors_of_modes(answers):
    """Each mode has its own label in every model of a single pendulum."""
    design = sus.read(str(CASE))
    modes = {name: sus.modes(design, fidelity=name, max_frequency=20.0) for name in MODELS[2:4]}
    modes["violin"] = sus.modes(design, fidelity="violin", max_frequency=20.0)
    frequency = {name: dict(zip(m.label, m.frequency, strict=True)) for name, m in modes.items()}
    exact = frequency["violin"]
    for name in ("string", "beam"):
        wanted = {label: abs(f / exact[label] - 1) for label, f in frequency[name].items()}
        (entry,) = (one for one in answers["modes"].entries if one.model == name)
        assert entry.error == pytest.approx(max(wanted.values()), rel=1e-3)
        assert wanted[entry.where] == max(wanted.values())
    assert errors(answers["sweep"]) == errors(answers["modes"])
    assert "wires without mass" in answers["sweep"].entries[-1].left_out


@pytest.mark.parametrize("band", ["low", "high"])
def test_errors_of_responses(answers, band):
    """At the frequency that is given."""
    design = sus.read(str(CASE))
    for entry in answers[band].options[:-1]:
        at = float(entry.where.split()[1])
        values = [
            sus.response(design, inputs="support.x", outputs="test.x", frequency=at, fidelity=name)
            for name in (entry.model, "violin")
        ]
        one, exact = (complex(found.value.ravel()[0]) for found in values)
        assert entry.error == pytest.approx(abs(one / exact - 1), rel=0.02)
    low, high = errors(answers["low"]), errors(answers["high"])
    assert low["beam"] < low["string"] < 0.05 and min(high["beam"], high["string"]) > 0.5


def hanging(stage):
    return sus.parse(tomli_w.dumps(scenes.raw_of(stage)))


def test_models_that_are_left_out(monkeypatch):
    """Wires known by k alone: no bending, no noise. Bodies on springs: no imperfect wire."""
    hurry(monkeypatch)
    body = {"mass": 2.0, "inertia": [0.014, 0.011, 0.012]}
    wires = {"count": 2, "l": 0.3, "t1": 0.05, "t2": 0.05, "d": 0.01, "k": 1e4}
    bare = hanging({"name": "test", "body": body, "wires": wires})
    modes, _, noise = sus.tradeoff(bare, quantities=["modes", "thermal"]).answers
    assert [entry.model for entry in modes.options] == ["force", "string"]
    reasons = {entry.model: entry.left_out for entry in modes.entries if entry.left_out}
    assert reasons.pop("closed-form") == "it does not hang on four wires"
    assert set(reasons.values()) == {"wire test.1 has no cross-section"}
    assert noise.best is None and "no cross-section" in noise.advice and noise.reference is None
    spring = {
        "stiffness": [100.0, 200.0, 300.0, 1.0, 2.0, 3.0],
        "preload": [0.0, 0.0, 19.62, 0.0, 0.0, 0.0],
    }
    stage = {"name": "test", "position": [0.0, 0.0, -0.1], "body": body, "spring": [spring]}
    found = sus.tradeoff(hanging(stage))
    assert [entry.model for entry in found.answers[0].options] == MODELS[2:]
    assert max(entry.error for entry in found.answers[0].options) < 1e-12
    assert found.answers[4].advice == "left out: nothing dissipates"
    assert found.answers[5].advice == "left out: the mirror hangs on no wire"
    assert_legible(draw(found, "Springs"))


# Advice.


def made_up(*points):
    return Answer(
        tuple(Entry("modes", "modes", f"m{n}", *point, "yaw", "") for n, point in enumerate(points))
    )


def test_advice():
    fine, coarse = (0.037, 9e-5), (0.007, 0.15)
    assert made_up(coarse, fine, (0.3, 0.0)).advice == (
        "Use m1: m0 is 5.3 times faster, but off by 15 % (yaw)."
    )
    assert made_up(fine).advice == "Use m0: no other model is faster."
    assert made_up((0.036, 0.1), fine).advice == "Use m1: simpler models save hardly any time."
    assert (
        made_up(coarse, (0.1, 0.02)).advice == "Use m1: it is off by 2 % (yaw), the others by more."
    )


def test_words():
    assert [format_time(value) for value in (2.0, 0.0123, 83e-6)] == ["2 s", "12 ms", "83 µs"]


def test_choices_of_auto_are_those_of_the_commands(found, answers):
    """Model, reason and error as in the header of `modes` and `response`."""
    design = sus.read(CASE)
    modes = sus.modes(design)
    low = np.geomspace(0.1, 10.0, 200)
    into = {"inputs": "support.x", "outputs": "test.x"}
    response = sus.response(design, **into, frequency=low)
    for name, result in (("modes", modes), ("low", response)):
        chosen = answers[name].automatic
        assert (chosen.model, chosen.line) == (result.model, result.run.choice.line)
        assert chosen.error == pytest.approx(result.estimated_error)
        assert chosen.line in str(found)
    assert answers["sweep"].automatic is None and answers["coupling"].automatic is None
    document = found.document()
    assert document["questions"][0]["auto"]["fidelity"] == modes.model
    violin = sus.modes(design, fidelity="violin", max_frequency=1000.0)
    lowest = violin.frequency[violin.order > 0].min()
    assert document["first_violin_hz"] == pytest.approx(lowest, rel=0.02)


# Text, files, pictures.


def test_picture(found):
    """One column wide, one chart per question, with its advice."""
    figure = found.plot()
    words = said(figure)
    assert_legible(figure)
    assert figure.get_figwidth() == COLUMN and len(figure.axes) == len(found.answers)
    for axes, answer in zip(figure.axes, found.answers, strict=True):
        assert {one.model for one in answer.options} <= {text.get_text() for text in axes.texts}
        assert answer.advice in " ".join(words) and answer.advice in str(found)
        (best,) = [line for line in axes.lines if line.get_markersize() > 8]
        unit = {"processor time (ms)": 1e-3, "processor time (µs)": 1e-6}[axes.get_xlabel()]
        assert best.get_xdata()[0] * unit == pytest.approx(answer.best.time)
    for part in found.document()["questions"]:
        assert [one["model"] for one in part["models"]] == MODELS
        assert (part["reference"], part["models"][-1]["error"]) == ("violin", 0.0)
        assert part["advice"].startswith(f"Use {part['best']}")


def test_numpy_reads_the_number_of_threads():
    """It is set before numpy is imported."""
    code = (
        "import os, sys; [os.environ.pop(f'{name}_NUM_THREADS', None) for name in ('OPENBLAS',"
        " 'OMP', 'MKL')];from suspension_cli.analyses.tradeoff.command import TradeoffAnalysis as"
        " T;T.read = lambda *_: sys.exit(f\"{'numpy' in sys.modules}"
        " {os.environ['OPENBLAS_NUM_THREADS']}\");from suspension_cli.cli.main import main;"
        " main(['tradeoff', 'x.toml'])"
    )
    assert python(code).stderr == "False 1\n"


def test_modes_of_wires_that_would_take_minutes_are_left_out():
    """KAGRA's beam splitter: its stiff parts vibrate among 44,000 modes of wires."""
    modes, *_ = ask(sus.example("built/kagra-bs-2019"))
    with pytest.raises(InputError, match=r"modes up to .* Hz, which would take minutes"):
        modes.solve(registry.VIOLIN)
