"""What holds for every analysis: command, file and Python function give one result; options may
stand in the design; pictures and CSV follow from the file; and faults are one line."""

from __future__ import annotations

import csv
import inspect
import json
from pathlib import Path

import pytest

import suspension_cli as sus
from suspension_cli.conventions import ANALYSES
from suspension_cli.models.registry import MODELS
from tests.support.commandline import assert_refused, document, run, strict_json, written
from tests.support.paths import CONFIGS, ROOT
from tests.support.quick_tradeoff import hurry

pytestmark = pytest.mark.filterwarnings("ignore::suspension_cli.errors.PendsusWarning")

STRING = {"fidelity": "string"}
FEW = {"frequency": "0.5:5:12"}
VARY = ["stage.test.wires.l=0.3:0.5:3:log", "stage.test.wires.d=1e-3,2e-3"]
CASES = {
    "modes": ("double", STRING | {"damping": {"band": [0.7, 3], "at": "test"}}),
    "modes with losses": ("geo-silica-triple", {"tolerance": 0.01}),
    "modes of wires": ("husman2000/figure6", {"max_frequency": 500.0}),
    "response": ("double", FEW | {"input": ["support.z", "upper.force_x"], "output": "test.z"}),
    "response closed": ("triple-damped", STRING | FEW | {"closed_loop": True}),
    "thermal": ("double", FEW | {"output": ["test.x", "test.pitch"], "mirrors": 4.0}),
    "budget": ("double", FEW | {"output": "test.z", "ground": ["nlnm", "z=nhnm"]}),
    "xcouple": (
        "husman2000/figure6",
        STRING
        | {"sweep": "offset,k", "k": [0.9, 1.1], "offset": 1e-3, "wire": "test.3"}
        | {"frequency": "10:40:3", "observe": "test@0,0,0.002", "hold": "natural-length"},
    ),
    "xcouple matrix": ("imperfect", STRING | {"matrix": True, "observe": "test"}),
    "sweep": ("double", STRING | {"vary": VARY, "result": ["test yaw", "test pitch"]}),
    "sensitivity": ("double", STRING | {"result": ["test yaw", "test.x/test.z/support.z:50"]}),
    "tolerance": (
        "triple-tolerance",
        STRING | {"builds": 12, "seed": 4, "limit": 1e-5, "frequency": "20", "workers": 1},
    ),
    "fit": ("husman2000/table1-case4", STRING | {"starts": 2}),
    "optimise": ("husman2000/table1-case1", STRING | {"starts": 1}),
    "damp": (
        "triple-damped",
        STRING | FEW | {"duration": 5.0, "output": "test.z", "impulse": "support.z"},
    ),
    "simulate": (
        "triple-damped",
        STRING | {"rate": 256.0, "duration": 1.0, "output": "test.z", "ground": ["nlnm"]},
    ),
    "compare": ("double", {"fidelity": "beam"} | FEW | {"input": "support.x", "noise": "test.x"}),
    "tradeoff": ("husman2000/table1-case3", {"quantity": "modes"}),
    "check": ("double", {}),
}
"""Analysis (and a word), design, options as `[analysis.NAME]` has them."""
GOALS = {
    "goal": [{"kind": "band", "modes": ["test longitudinal"], "equals": 0.8}],
    "free": [{"name": "stage.test.wires.l", "lower": 0.1, "upper": 1.0}],
}
WITHOUT_FILE = ("check",)
PLACES = {"experiments": None}
"""What names the file of the design."""


def other_inputs(name: str, folder: Path) -> list[Path]:
    """Files that a command needs beside a design."""
    if name == "optimise":
        return [written(folder, GOALS, "goals.toml")]
    return {
        "fit": [ROOT / "measured" / "husman2000" / "table1-case4.toml"],
        "compare": [CONFIGS / "husman2000" / "table2.toml"],
    }.get(name, [])


def words(table: dict) -> list[str]:
    """A table as options of the command."""
    found = []
    table = dict(table)
    if "k" in table:
        sweep = (f"{key}={table.pop(key)}".replace(" ", "") for key in ("offset", "k"))
        table["sweep"] = ",".join(sweep).replace("[", "").replace("]", "")
    for key, value in table.items():
        if isinstance(value, dict):
            low, high = value["band"]
            value = f"band={low}:{high},at={value['at']}"
        for one in value if isinstance(value, list) else [value]:
            found += [f"--{key.replace('_', '-')}", *([] if one is True else [str(one)])]
    return found


def arguments(name: str, table: dict) -> dict:
    """A table as arguments of the Python function, where names of lists are plural."""
    known = inspect.signature(getattr(sus, name)).parameters
    table = {key if key in known else key + "s": value for key, value in table.items()}
    if "ks" in table:
        table["sweep"] = {key: table.pop(key + "s") for key in ("offset", "k")}
    if "vary" in table:
        table["vary"] = dict(item.split("=") for item in table["vary"])
    if "quantitys" in table:
        table["quantities"] = table.pop("quantitys")
    return table


@pytest.mark.parametrize("case", CASES)
def test_command_file_and_function_give_one_result(case, tmp_path, monkeypatch):
    hurry(monkeypatch)
    name, (design, table) = case.split()[0], CASES[case]
    file, more = CONFIGS / f"{design}.toml", other_inputs(name, tmp_path)
    options = words(table)
    out = ("--out", tmp_path / "a", "--plot", "--csv") if name not in WITHOUT_FILE else ()
    printed = document(name, file, *more, *options, *out)
    given = [more[0], sus.read(file)] if name == "fit" else [sus.read(file), *more]
    found = getattr(sus, name)(*given, **arguments(name, table))
    assert strict_json(json.dumps(found.document())) == printed
    assert found._repr_html_().startswith("<pre>") and repr(found).startswith("<pendsus ")

    # the same options in the design
    mine = sus.read(file)
    if name != "compare":
        mine, options = mine.replace({f"analysis.{name}": table}), []
    mine.save(tmp_path / "mine.toml")
    out = ("--out", tmp_path / "b", "--no-plot", "-q") if name not in WITHOUT_FILE else ()
    done = run(name, tmp_path / "mine.toml", *more, *options, *out)
    assert done.exit_code == 0, done.stderr
    if name in WITHOUT_FILE:
        assert f"{found}\n".rpartition(".toml")[2] == done.stdout.rpartition(".toml")[2]
        return
    [file] = (tmp_path / "b").glob("*.h5")
    assert not list((tmp_path / "b").glob("*.png"))
    loaded = sus.load(file)
    assert f"{loaded}\n" == done.stdout
    stored = strict_json(json.dumps(loaded.document()))
    assert stored | PLACES == printed | PLACES
    with monkeypatch.context() as without:
        forbid_solving(without)
        check_other_forms(sus.load(next((tmp_path / "a").glob("*.h5"))), tmp_path)


def forbid_solving(monkeypatch) -> None:
    """Let no model be built: what is stored is enough."""

    def refuse(*_: object) -> None:
        raise AssertionError("a stored result is solved for again")

    for model in MODELS:
        monkeypatch.setattr(type(model), "system", refuse)


def check_other_forms(loaded: sus.Record, folder: Path) -> None:
    """Picture, CSV, arrays and copies of a result, from its file in a/ alone."""
    picture = loaded.run.file.with_suffix(".png")
    drawn = picture.read_bytes()
    picture.unlink()
    assert run("plot", loaded.run.file).exit_code == 0
    assert picture.read_bytes() == drawn
    for name in ("again.h5", "once-more.h5"):
        loaded.save(folder / name)
        copied = sus.load(folder / name)
        assert str(copied) == str(loaded)
        assert copied.to_xarray().identical(loaded.to_xarray())
        loaded = copied
    assert (folder / "again.h5").read_bytes() == (folder / "once-more.h5").read_bytes()
    table = loaded.to_xarray()
    assert table.data_vars and table.attrs["model"] == loaded.run.model
    loaded.save(folder / "c.csv")
    text = (folder / "c.csv").read_text()
    assert text in {path.read_text() for path in (folder / "a").glob("*.csv")}
    head, *rows = csv.reader(text.splitlines())
    assert len(set(head)) == len(head) and rows and {len(row) for row in rows} == {len(head)}


def test_every_analysis_is_walked():
    walked = {case.split()[0] for case in CASES}
    assert {*ANALYSES} - walked == {"draw", "export", "report"}


WITHOUT_MODEL = ("check", "draw", "tradeoff")
BAD_TABLES = {
    "bogus": ("1", "no option of this command"),
    "fidelity": ('"guess"', "'guess' is not one of 'auto'"),
    "allow-unstable": ("true", "no option of this command"),
}


@pytest.mark.parametrize(
    ("name", "key"),
    [
        (name, key)
        for name in ANALYSES
        for key in BAD_TABLES
        if name != "compare" and (key != "fidelity" or name not in WITHOUT_MODEL)
    ],
)
def test_bad_tables_are_refused(name, key, tmp_path):
    """By every command, in one line, before anything is written."""
    value, problem = BAD_TABLES[key]
    text = (CONFIGS / "double.toml").read_text() + f"\n[analysis.{name}]\n{key} = {value}\n"
    file, out = written(tmp_path, text), tmp_path / "out"
    for command in ("check", "modes"):
        words = ("--out", out) if command == "modes" else ()
        [line] = assert_refused(run(command, file, "--json", *words), file, out)
        assert line.startswith(f"analysis.{name}.{key} = {value}: {problem}")
    assert not out.exists()


TOPPLING = ("--set", "stage.test.wires.d=-0.3")


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("response", ("--frequency", "1,2")),
        ("thermal", ("--frequency", "1,2")),
        ("xcouple", ("--sweep", "k=1.01,1.1")),
        ("sensitivity", ()),
        ("damp", ("--frequency", "1,2", "--duration", "1")),
        ("tradeoff", None),
    ],
)
def test_an_unstable_design_must_be_requested(name, options, tmp_path):
    file = CONFIGS / ("triple-damped.toml" if name == "damp" else "husman2000/figure6.toml")
    out = tmp_path / "out"
    result = run(name, file, *TOPPLING, "--json", "--out", out)
    [line] = assert_refused(result, file, out)
    assert "unstable" in line and ("--allow-unstable" in line) == (options is not None)
    if options is not None:
        words = (*TOPPLING, *options, "--allow-unstable", "--json", "--out", out, "-q")
        result = run(name, file, *words)
        assert result.exit_code == 0 and "unstable" in result.stderr
        assert result.stderr.startswith("warning: ")
        strict_json(result.stdout)


def test_what_is_given_has_precedence_over_the_design(tmp_path):
    """On the command line and in Python; `plot = false` is a key as others are."""
    table = {"fidelity": "string", "output": "test.pitch", "frequency": [1, 2.5], "plot": False}
    design = sus.example("double").replace({"analysis.response": table})
    design.save(tmp_path / "mine.toml")
    out = tmp_path / "out"
    words = ("--frequency", "3", "--fidelity", "force", "--json", "--out", out)
    answer = strict_json(run("response", tmp_path / "mine.toml", *words).stdout)
    assert (answer["fidelity"], answer["frequency_hz"]) == ("force", [3.0])
    assert answer["output"] == "test.pitch"
    found = sus.response(design, outputs="test.z")
    assert found.output == ("test.z",) and found.model == "string"
    assert run("response", tmp_path / "mine.toml", "--out", out).exit_code == 0
    assert [path.name for path in out.iterdir()] == ["double-response.h5"]
