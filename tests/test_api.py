"""The public API: documented, typed, exampled, and the same results as the commands and their
files."""

from __future__ import annotations

import doctest
import inspect
import runpy
import subprocess
import sys
import typing
import warnings

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli import api
from suspension_cli.conventions import ANALYSES
from tests.models.test_golden import assert_close
from tests.support.commandline import run, strict_json
from tests.support.paths import CONFIGS, ROOT

FUNCTIONS = [name for name in sus.__all__ if inspect.isfunction(getattr(sus, name))]
DOUBLE = CONFIGS / "double.toml"


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_function_is_documented_and_typed(name):
    function = getattr(sus, name)
    text = inspect.getdoc(function)
    assert text is not None and text.split("\n")[0].endswith(".")
    hints = typing.get_type_hints(function)
    assert set(inspect.signature(function).parameters) | {"return"} == set(hints)
    words = text.replace(",", " ").replace("*", "").split()
    assert set(inspect.signature(function).parameters) <= set(words), "an argument is not described"
    if name not in ("examples", "load"):
        assert ">>> " in text


def test_examples_in_docstrings():
    found = doctest.testmod(api, optionflags=doctest.NORMALIZE_WHITESPACE)
    assert found.attempted > 40 and found.failed == 0


def test_every_analysis_has_its_function():
    assert set(ANALYSES) <= set(FUNCTIONS)


def test_importing_imports_nothing_heavy():
    code = (
        "import suspension_cli, sys; print([n for n in ('click', 'numpy', 'scipy', 'h5py',"
        " 'msgspec', 'matplotlib', 'rich') if n in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


CASES = {
    "modes": (lambda design: sus.modes(design, model="string"), ("--fidelity", "string")),
    "response": (
        lambda design: sus.response(design, inputs=["support.z"], frequency=np.array([0.3, 7.0])),
        ("--input", "support.z", "--frequency", "0.3,7.0"),
    ),
    "thermal": (
        lambda design: sus.thermal(design, frequency="1:100:3"),
        ("--frequency", "1:100:3"),
    ),
    "budget": (
        lambda design: sus.budget(design, ground=["nlnm"], frequency=np.array([1.0, 3.0])),
        ("--ground", "nlnm", "--frequency", "1.0,3.0"),
    ),
    "xcouple": (
        lambda design: sus.xcouple(design, sweep={"k": [0.9, 1.1]}, model="string"),
        ("--sweep", "k=0.9,1.1", "--fidelity", "string"),
    ),
    "sweep": (
        lambda design: sus.sweep(
            design, vary={"stage.test.wires.d": [1e-3, 2e-3]}, result=["test yaw"], model="string"
        ),
        ("--vary", "stage.test.wires.d=1e-3,2e-3", "--result", "test yaw", "--fidelity", "string"),
    ),
    "sensitivity": (
        lambda design: sus.sensitivity(design, result=["test yaw"], model="string"),
        ("--result", "test yaw", "--fidelity", "string"),
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_results_are_those_of_the_command(name, tmp_path):
    function, options = CASES[name]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sus.PendsusWarning)
        found = function(sus.read(DOUBLE))
    done = run(name, DOUBLE, *options, "--json", "--out", tmp_path)
    assert found.document() == strict_json(done.stdout)
    assert found.model in str(found) or name == "xcouple"
    found.save(tmp_path / "again.h5")
    again = sus.load(tmp_path / "again.h5")
    assert_close(
        again.document(), {k: v for k, v in found.document().items() if k != "without_loss"}
    )
    again.save(tmp_path / "once-more.h5")
    assert (tmp_path / "once-more.h5").read_bytes() == (tmp_path / "again.h5").read_bytes()
    assert again.to_xarray().identical(found.to_xarray())
    table = found.to_xarray()
    assert table.attrs["model"] == found.model and table.data_vars
    assert "<pre>" in found._repr_html_()


REPORTS = {
    "check": (lambda design: sus.check(design), ()),
    "info": (
        lambda design: sus.info(design, output="test.pitch", frequency=[1.0, 30.0], tolerance=0.01),
        ("--output", "test.pitch", "--frequency", "1.0,30.0", "--tolerance", "0.01"),
    ),
}


@pytest.mark.parametrize("name", REPORTS)
def test_reports_are_those_of_the_command(name):
    function, options = REPORTS[name]
    found = function(sus.read(str(DOUBLE)))
    assert found.document() == strict_json(run(name, DOUBLE, *options, "--json").stdout)
    assert f"{found}\n" == run(name, DOUBLE, *options).stdout
    assert found._repr_html_().startswith("<pre>")
    assert repr(found) == f"<pendsus {name} of double>"


def test_checks_warn_and_refuse():
    design = sus.example("triple-damped").replace({"control.loop.x.sensor": "tset.x"})
    with pytest.warns(sus.PendsusWarning, match="names no body"):
        found = sus.check(design)
    assert [item.fault.key for item in found.warnings] == ["control.loop.x.sensor"]
    with pytest.raises(sus.InputError, match=r'output = "tset\.x": names no body'):
        sus.info(sus.read(DOUBLE), output="tset.x")


def test_info_takes_the_analysis_table():
    design = sus.read(DOUBLE).replace({"analysis.info.output": "upper.y"})
    assert any("upper.y" in quantity for quantity in sus.info(design).choices)
    assert any("test.x" in quantity for quantity in sus.info(design, output="test.x").choices)


def test_faults_name_arguments():
    design = sus.read(DOUBLE)
    with pytest.raises(sus.InputError, match=r'output = "tset\.x": names no body') as caught:
        sus.response(design, outputs=["tset.x"])
    assert "--" not in str(caught.value)
    with pytest.raises(sus.InputError, match="no template"):
        sus.template("quintuple")
    with pytest.raises(sus.InputError, match="did you mean 'double'"):
        sus.example("duble")
    with pytest.raises(sus.InputError, match=r"is not HDF5"):
        sus.load(DOUBLE)


def test_designs_are_frozen_and_replaced():
    design = sus.read(DOUBLE)
    changed = design.replace({"stage.test.wires.d": 0.0025})
    assert design.stage[-1].wires.d != changed.stage[-1].wires.d == 0.0025
    assert sus.parse(changed.text).design == changed.design
    with pytest.raises(AttributeError):
        design.text = ""


def test_warnings_are_python_warnings():
    with pytest.warns(sus.PendsusWarning, match="unstable"):
        sus.modes(sus.read(DOUBLE).replace({"stage.test.wires.d": -0.05}), model="string")


@pytest.mark.parametrize(
    ("name", "said"), [("table1", "4  vertical"), ("figure6", "largest ratio: 5.901e-04")]
)
def test_notebooks(name, said, capsys, monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "agg")
    path = ROOT / "docs" / "notebooks" / f"{name}.py"
    assert len(path.read_text().splitlines()) < 30
    runpy.run_path(str(path))
    assert said in capsys.readouterr().out


def test_defaults_are_those_of_the_analysis_table():
    """Of the design's [analysis.xcouple]: its grids and its point; an argument wins."""
    stage = sus.example("husman2000/figure6")
    other = stage.replace({"analysis.xcouple.frequency": 20.0, "analysis.xcouple.k": "0.9:1.1:3"})
    found = sus.xcouple(other, sweep="k", model="string")
    assert found.frequency.tolist() == [20.0] and found.ratio.shape == (3, 1)
    assert sus.xcouple(other, sweep="k", frequency=30.0, model="string").frequency[0] == 30.0
