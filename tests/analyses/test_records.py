"""Results stand alone: pictures and texts follow from the record alone, also of a file, and records
are typed."""

from __future__ import annotations

import dataclasses
import inspect
import pickle
import tempfile
import typing
from pathlib import Path

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.analyses import known_analyses, record
from suspension_cli.analyses.analysis import Analysis
from suspension_cli.drawing import style
from suspension_cli.equilibrium import solve as equilibrium
from suspension_cli.linear import response
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import registry
from tests.support import plants
from tests.support.paths import ROOT

pytestmark = pytest.mark.filterwarnings("ignore::suspension_cli.errors.PendsusWarning")

MEASURED = ROOT / "measured" / "triple"
HANGING = (
    f"{plants.FIVE}\n[[perturbation]]\nwire = 'test.3'\nk_factor = 1.2\n"
    "upper_offset = [0.002, 0.0, 0.001]\n"
)
"""A design whose pose, blade load and trimmed wire are found by balancing it."""
GOALS = """
requirement = [{ quantity = "test longitudinal", equals = 0.8 }]
objective = [{ minimise = "stress test wires" }]
free = [
    { name = "stage.test.wires.l", lower = 0.1, upper = 1.0 },
    { name = "stage.test.wires.radius", lower = 1e-4, upper = 3e-4 },
]
"""
FEW = np.geomspace(0.3, 30, 40)
PICTURES = {
    "budget": lambda: sus.budget(
        sus.example("triple-damped"), ground=["nlnm"], frequency=FEW, arm=4000.0, mirrors=4.0
    ),
    "fit of several designs": lambda: sus.fit(
        ROOT / "measured" / "husman2000" / "table1.toml", fidelity="string"
    ),
    "fit of transfer functions": lambda: sus.fit(
        MEASURED / "measured.toml", sus.read(MEASURED / "triple.toml"), explain=False
    ),
    "modes": lambda: sus.modes(sus.example("quadruple"), fidelity="beam"),
    "modes of an imperfect design": lambda: sus.modes(sus.example("imperfect"), fidelity="string"),
    "modes of a design with natural lengths": lambda: sus.modes(
        sus.parse(HANGING), fidelity="string"
    ),
    "modes of wires": lambda: sus.modes(sus.example("husman2000/figure6"), max_frequency=300.0),
    "compare": lambda: sus.compare(
        sus.example("double"),
        sus.example("double").replace({"stage.test.wires.d": 0.0005}),
        inputs="support.x",
        outputs="test.x",
        noises="test.x",
        results="stress test wires",
        frequency=FEW,
    ),
    "damp": lambda: sus.damp(
        sus.example("triple-damped"), frequency=FEW, duration=5.0, fidelity="string"
    ),
    "damp with a filter that is found": lambda: sus.damp(
        sus.example("triple-damped"),
        method="lqg",
        redesigned=["yaw"],
        frequency=FEW,
        duration=5.0,
        fidelity="string",
    ),
    "simulate": lambda: sus.simulate(
        sus.example("triple-damped"),
        rate=256.0,
        duration=2.0,
        ground=["nlnm"],
        fidelity="string",
    ),
    "optimise": lambda: sus.optimise(sus.template("single"), written(GOALS), starts=2),
    "response": lambda: sus.response(
        sus.example("double"), inputs=["support.x", "upper.force_x"], frequency=FEW
    ),
    "response with loops closed": lambda: sus.response(
        sus.example("triple-damped"), frequency=FEW, closed_loop=True, fidelity="string"
    ),
    "response measured": lambda: sus.response(
        sus.read(MEASURED / "triple.toml"), measured=MEASURED / "measured.toml"
    ),
    "sensitivity": lambda: sus.sensitivity(
        sus.example("imperfect"),
        results=["modes", "test.x/test.z/support.z:50"],
        fidelity="string",
    ),
    "sweep": lambda: sus.sweep(
        sus.example("double"),
        vary={"stage.test.wires.l": [0.2, 0.3, 0.4]},
        results=["modes", "test yaw", "thermal test.x:10", "test.x/support.x:10"],
        require=["test yaw < 1"],
        fidelity="string",
    ),
    "sweep with a point without results": lambda: sus.sweep(
        sus.example("imperfect"),
        vary={"perturbation.2.length_change": [0, -0.002, 0.0002]},
        fidelity="string",
    ),
    "sweep over two parameters": lambda: sus.sweep(
        sus.example("double"),
        vary={"stage.test.wires.l": [0.2, 0.3, 0.4], "stage.upper.wires.l": [0.2, 0.3]},
        results=["test yaw", "test pitch"],
        require=["test yaw < 1"],
        fidelity="string",
    ),
    "thermal": lambda: sus.thermal(
        sus.example("geo-silica-triple"), outputs=["test.x", "test.pitch"], frequency=FEW
    ),
    "tolerance": lambda: sus.tolerance(
        sus.example("triple-tolerance"),
        builds=30,
        results=["Q of test pitch"],
        require=["test pitch in 0.5:0.7"],
        fidelity="string",
    ),
    "xcouple": lambda: sus.xcouple(
        sus.example("husman2000/figure6"),
        sweep={"k": [0.9, 1.0, 1.1, 9.0], "offset": [-1e-3, 1e-3]},
        fidelity="string",
    ),
    "xcouple over frequency": lambda: sus.xcouple(
        sus.example("husman2000/figure6"),
        sweep={"k": [0.9, 1.1]},
        frequency=FEW,
        fidelity="string",
    ),
    "matrix of couplings": lambda: sus.xcouple(
        sus.example("imperfect"), matrix=True, fidelity="string"
    ),
    "tradeoff": lambda: sus.tradeoff(sus.template("single"), quantities="modes"),
}
"""A result of each analysis that returns a record with pictures."""
RECORDS = [getattr(sus, name) for name in sus.__all__ if name in sus.RECORDS]


def written(text: str) -> Path:
    """A file with this text."""
    path = Path(tempfile.mkdtemp()) / "goals.toml"
    path.write_text(text)
    return path


def refuse(*_: object, **__: object) -> None:
    raise AssertionError("a stored result is solved for again")


def forbid_models(monkeypatch) -> None:
    """Let nothing build, balance or solve a model."""
    monkeypatch.setattr(registry, "by_name", refuse)
    monkeypatch.setattr(LinearSystem, "__post_init__", refuse, raising=False)
    monkeypatch.setattr(response, "solve", refuse)
    monkeypatch.setattr(response, "transfer", refuse)
    monkeypatch.setattr(equilibrium, "solve", refuse)


def test_each_analysis_with_pictures_is_here():
    """One that is added gets a result in `PICTURES`, whose first word is its name."""
    drawing = {
        name
        for name in known_analyses.GROUPS
        if type(known_analyses.get(name)).figures is not Analysis.figures
    }
    missing = drawing - {name.partition(" ")[0] for name in PICTURES}
    assert not missing, f"add a result of {missing} to PICTURES"


@pytest.mark.parametrize("name", PICTURES)
def test_pictures_and_texts_follow_from_the_file_alone(name, tmp_path, monkeypatch):
    found = PICTURES[name]()
    drawn = {end: style.encode(figure, "png") for end, figure in found.figures().items()}
    found.save(tmp_path / "a.h5")
    (tmp_path / "a.h5").rename(tmp_path / "b.h5")
    assert drawn
    with monkeypatch.context() as without:
        forbid_models(without)
        again = sus.load(tmp_path / "b.h5")
        stored = again.figures()
        assert {end: style.encode(figure, "png") for end, figure in stored.items()} == drawn
        assert type(again) is type(found) and isinstance(again, record.Record)
        assert str(again) == str(found)
        assert again.document() == found.document()
        assert again.run.warnings == found.run.warnings
        assert pickle.loads(pickle.dumps(found)).document() == found.document()
    assert again.run.file == tmp_path / "b.h5"
    assert (found.run.file is None) != found.run.analysis.fills_file
    assert again.design.text == found.design.text


@pytest.mark.parametrize("kind", RECORDS, ids=[kind.__name__ for kind in RECORDS])
def test_records_are_typed_and_documented(kind):
    """No field hides an attribute that all records have; editors know the type of each."""
    common = {name for name in dir(record.Record) if name[0] != "_"}
    fields = {one.name for one in dataclasses.fields(kind)} - {"run"}
    assert not fields & common
    assert kind.__doc__ and not kind.__dataclass_params__.eq
    assert all(one.type != "Any" for one in dataclasses.fields(kind))
    assert "__getattr__" not in {name for base in kind.__mro__ for name in vars(base)}


def test_functions_name_their_records():
    for kind in RECORDS:
        name = sus.RECORDS[kind.__name__].partition(".")[0]
        function = getattr(sus, name)
        returned = inspect.signature(function).return_annotation
        assert kind in (typing.get_args(returned) or (returned,))
        assert typing.get_type_hints(function)["return"] == returned
