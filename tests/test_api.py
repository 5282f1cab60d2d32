"""The public API: documented, typed, exampled, and the same results as the commands and their
files."""

from __future__ import annotations

import doctest
import gc
import inspect
import re
import runpy
import subprocess
import sys
import tempfile
import typing
import warnings

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli import api
from suspension_cli.analyses import known_analyses, python_functions
from suspension_cli.analyses.modes import picture
from suspension_cli.conventions import ANALYSES
from tests.support.paths import CONFIGS, ROOT
from tests.support.quick_tradeoff import hurry

FUNCTIONS = [name for name in sus.__all__ if inspect.isfunction(getattr(sus, name))]
DOUBLE = CONFIGS / "double.toml"
FITTED = ROOT / "measured" / "husman2000" / "table1-case4.toml"


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_function_is_documented_and_typed(name):
    function = getattr(sus, name)
    text = inspect.getdoc(function)
    assert text is not None and text.split("\n")[0].endswith(".")
    hints = typing.get_type_hints(function)
    assert set(inspect.signature(function).parameters) | {"return"} == set(hints)
    words = text.replace(",", " ").replace("*", "").split()
    assert set(inspect.signature(function).parameters) <= set(words), "an argument is not described"
    assert ">>> " in text and "+SKIP" not in text


def test_examples_in_docstrings(tmp_path, monkeypatch):
    hurry(monkeypatch)
    monkeypatch.setattr(picture, "FRAMES", 4)
    (tmp_path / "measured").symlink_to(ROOT / "measured")
    monkeypatch.chdir(tmp_path)
    assert all(getattr(api, name) for name in ANALYSES)  # makes them
    found = doctest.testmod(api, optionflags=doctest.NORMALIZE_WHITESPACE)
    assert found.attempted > 80 and found.failed == 0
    assert doctest.testmod(python_functions).failed == 0


@pytest.mark.parametrize("name", ANALYSES)
def test_every_option_has_its_argument_or_a_reason(name):
    """Options without an argument are listed in docs/api.md."""
    page = (ROOT / "docs" / "api.md").read_text()
    arguments = inspect.signature(getattr(sus, name)).parameters
    for param in known_analyses.get(name).parameters:
        assert param.name in arguments or f"`{param.opts[-1]}`" in page, param.opts


def test_importing_imports_nothing_heavy():
    code = (
        "import suspension_cli, sys; print([n for n in ('click', 'numpy', 'scipy', 'h5py',"
        " 'msgspec', 'matplotlib', 'rich') if n in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_checks_warn_and_refuse():
    design = sus.example("triple-damped").replace({"control.loop.x.sensor": "tset.x"})
    with pytest.warns(sus.PendsusWarning, match="names no body"):
        found = sus.check(design)
    assert [item.key for item in found.warnings] == ["control.loop.x.sensor"]
    with pytest.raises(sus.InputError, match=r'outputs = "tset\.x": names no body'):
        sus.response(sus.read(DOUBLE), outputs="tset.x")


@pytest.mark.filterwarnings("ignore::suspension_cli.errors.PendsusWarning")
@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda d: sus.modes(d, fidelity="foo"),
            r"fidelity: 'foo' is not .*see help\(sus.modes",
        ),
        (lambda d: sus.response(d, outputs=["tset.x"]), r'outputs = "tset\.x": names no body'),
        (lambda d: sus.template("quintuple"), "is not a template"),
        (lambda d: sus.example("duble"), "did you mean 'double'"),
        (lambda d: sus.report(d, "x.html", fidelity="foo"), r"fidelity: 'foo' is not"),
        (lambda d: sus.report(d, "x.html", builds=3), r"builds: 3 is not in the range 100<=x"),
        (lambda d: sus.report(d, "x.html", sections="foo"), r'sections = "foo": a report has no'),
        (lambda d: sus.export(d, format="xyz"), r"format: 'xyz' is not one of"),
        (lambda d: sus.sweep(d, vary={}), r'vary: is missing; write for example vary={"stage\.'),
        (lambda d: sus.sweep(d, vary={"k": 1}, resume=True), r"folder: is missing, but resume"),
        (lambda d: sus.xcouple(d, input="support.a"), r'input = "support.a": '),
        (lambda d: sus.read(DOUBLE, "stage.tset.d=1"), r'overrides = "stage.tset.d=1": there is'),
        (lambda d: d.replace({"stage.tset.d": 1}), r'changes = "stage.tset.d": there is no'),
        (
            lambda d: sus.modes(d, fidelity="string").save("/nope/x.h5"),
            r"^path = /nope/x.h5: cannot",
        ),
        (
            lambda d: sus.modes(d, fidelity="string").plot(scale="db"),
            r"scale: is no argument of plot",
        ),
        (
            lambda d: sus.response(d, frequency=1.0).plot(scale="x"),
            r"scale: 'x' is not one of",
        ),
        (lambda d: sus.animate(sus.response(d, frequency=1.0), 1, "x.gif"), r"result = response: "),
        (
            lambda d: sus.export(d).save("x.doc"),
            r'path = "x.doc": is of no .*mat, .npz, .h5, .js',
        ),
        (lambda d: sus.export(d, format="zpk").save("x.mat"), r'path = "x.mat": .*; end it in .h5'),
        (lambda d: sus.export(d).to_xarray(), r"a state space has no labelled arrays; take system"),
        (lambda d: sus.export(d).plot(), r"export has no picture"),
        (lambda d: sus.fit(FITTED), r"write sus.fit\(measured, design\), or name designs"),
        (
            lambda d: sus.modes(d, fidelity="violin", max_frequency=1e6),
            r"max_frequency, or every=",
        ),
    ],
)
def test_messages_name_arguments(call, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(sus.InputError, match=message) as caught:
        call(sus.read(DOUBLE))
    assert not re.search(r"--|pendsus ", str(caught.value)) and not list(tmp_path.iterdir())


def test_warnings_name_arguments_and_the_line_of_the_caller():
    with pytest.warns(sus.PendsusWarning, match=r"loss=True gives Q too") as caught:
        sus.export(sus.read(DOUBLE))
    assert caught[0].filename == __file__


def test_exports_have_the_format_of_their_ending(tmp_path):
    with pytest.warns(sus.PendsusWarning):
        found = sus.export(sus.read(DOUBLE))
    begin = {".mat": b"MATLAB", ".npz": b"PK", ".h5": b"\x89HDF", ".json": b"{"}
    for ending, start in begin.items():
        path = tmp_path / f"x{ending}"
        found.save(path)
        assert path.read_bytes().startswith(start)
    assert found.document()["file"] is None
    with pytest.raises(sus.InputError, match="no result of an analysis"):
        sus.load(tmp_path / "x.h5")


def test_sweeps_leave_no_folder_and_continue(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    how = {"vary": {"stage.test.wires.d": [1e-3, 2e-3]}, "results": "test yaw"}
    how["fidelity"] = "string"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sus.modes(sus.read(DOUBLE), fidelity="string")
        assert not list(tmp_path.iterdir())
        found = sus.sweep(sus.read(DOUBLE), **how)
        assert found.run.file.exists()
        del found
        gc.collect()
    assert not list(tmp_path.iterdir())
    found = sus.sweep(sus.read(DOUBLE), folder=tmp_path / "kept", chunk=1, resume=True, **how)
    assert found.run.file == tmp_path / "kept" / "double-sweep.h5" and found.run.file.exists()


def test_notebooks_complete_the_values_of_designs(tmp_path):
    design = sus.example("triple-damped")
    for path in design._ipython_key_completions_():
        if not re.search(r"\.\d+$", path):  # members of lists
            assert isinstance(design[path], float | int), path
    assert "stage" in dir(design)
    table = design._repr_html_()
    assert all(f"<td>{stage.name}</td>" in table for stage in design.stage)
    design.save(tmp_path / "mine.toml")
    assert sus.read(tmp_path / "mine.toml").design == design.design
    with pytest.raises(sus.InputError, match="did you mean"):
        design["stage.test.wires.dd"]


def test_the_noise_of_each_motion():
    how = {"outputs": ["test.x", "test.z"], "frequency": [1.0, 10.0]}
    found = sus.thermal(sus.template("single"), **how)
    assert found.amplitude.shape == (2, 2)
    for n, motion in enumerate(found.motions):
        assert motion.output == how["outputs"][n]
        np.testing.assert_array_equal(motion.amplitude, found.amplitude[:, n])
        assert set(motion.parts) == set(found.source)


def test_designs_are_frozen_and_replaced():
    design = sus.read(DOUBLE)
    changed = design.replace({"stage.test.wires.d": 0.0025})
    assert design.stage[-1].wires.d != changed.stage[-1].wires.d == 0.0025
    assert sus.parse(changed.text).design == changed.design
    with pytest.raises(AttributeError):
        design.text = ""


@pytest.mark.parametrize(
    ("path", "value", "plain"),
    [
        ("stage.test.wires.d", np.float64(0.002), 0.002),
        ("stage.test.wires.d", np.linspace(0.001, 0.002, 2)[1], 0.002),
        ("stage.test.wires.count", np.int64(4), 4),
        ("stage.test.body.inertia", np.array([0.15, 0.12, 0.11]), [0.15, 0.12, 0.11]),
        ("stage.test.body.inertia", (np.float32(0.5), 0.5, 0.5), [0.5, 0.5, 0.5]),
    ],
)
def test_values_of_numpy_replace_those_of_designs(path, value, plain):
    design = sus.example("husman2000/table1-case3")
    assert design.replace({path: value}).text == design.replace({path: plain}).text


@pytest.mark.parametrize(
    ("name", "said"), [("table1", "4  vertical"), ("figure6", "largest ratio: 5.901e-04")]
)
def test_notebooks(name, said, capsys, monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "agg")
    path = ROOT / "docs" / "notebooks" / f"{name}.py"
    assert len(path.read_text().splitlines()) < 30
    runpy.run_path(str(path))
    assert said in capsys.readouterr().out


def test_notebook_with_finesse(tmp_path, capsys, monkeypatch):
    """Lines and dots are compared by tests/analyses/export/test_finesse_cavity.py."""
    pytest.importorskip("finesse")
    monkeypatch.setenv("MPLBACKEND", "agg")
    monkeypatch.chdir(tmp_path)
    path = ROOT / "docs" / "notebooks" / "cavity.py"
    assert len(path.read_text().splitlines()) <= 60
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sus.PendsusWarning)
        runpy.run_path(str(path))
    assert "   2 Hz: 1.36e-05 m/N at 10 Hz" in capsys.readouterr().out
    assert (tmp_path / "cavity.png").stat().st_size > 1e4


@pytest.mark.parametrize("name", ["compare", "fit", "optimise"])
def test_a_result_has_the_design_that_was_analysed(name, tmp_path):
    """Also after it was stored, and where it has another that was found."""
    design = sus.template("single").replace({"analysis": {name: {"fidelity": "beam"}}})
    goals = tmp_path / "goals.toml"
    goals.write_text(
        'goal = [{ kind = "band", modes = ["test longitudinal"], equals = 0.8 }]\n'
        'free = [{ name = "stage.test.wires.l", lower = 0.1, upper = 1.0 }]\n'
    )
    found = {
        "compare": lambda: sus.compare(design, design.replace({"design.name": "other"})),
        "fit": lambda: sus.fit(FITTED, CONFIGS / "husman2000" / "table1-case4.toml", starts=1),
        "optimise": lambda: sus.optimise(design, goals, starts=1),
    }[name]()
    found.save(tmp_path / "stored.h5")
    for one in (found, sus.load(tmp_path / "stored.h5")):
        assert one.document()["design"] == one.run.name
        assert isinstance(one.design, sus.Design) and isinstance(one.run.design, sus.Design)


def test_the_design_of_an_optimisation_or_a_fit_is_the_one_found(tmp_path):
    design = sus.template("single")
    goals = tmp_path / "goals.toml"
    goals.write_text(
        'goal = [{ kind = "band", modes = ["test longitudinal"], equals = 0.8 }]\n'
        'free = [{ name = "stage.test.wires.l", lower = 0.1, upper = 1.0 }]\n'
    )
    found = sus.optimise(design, goals, starts=1, fidelity="string")
    assert found.design["stage.test.wires.l"] == found.numbers.after[0] != found.numbers.before[0]
    assert found.run.design == design
    again = sus.modes(found.design, fidelity="string")
    frequency = dict(zip(again.label, again.frequency, strict=True))
    assert frequency["test longitudinal"] == pytest.approx(0.8, rel=1e-6)

    fitted = sus.fit(FITTED, CONFIGS / "husman2000" / "table1-case4.toml", starts=1)
    rounded = np.array([fitted.design[path] for path in fitted.name])
    assert (np.abs(rounded - fitted.value) <= 0.1 * fitted.sigma).all()
    assert [f"{one:.{fitted.digits}g}" for one in fitted.value] == [f"{one:g}" for one in rounded]
