"""Arguments of the public API, of unusual kinds and wrong ones; results that are copied, pickled,
compared, and independent of changed files."""

from __future__ import annotations

import copy
import gc
import itertools
import pickle
import tempfile
from pathlib import Path

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.analyses.labelled import write_csv

FILE = Path(__file__).parents[1] / "configs" / "double.toml"
SINGLE = sus.template("single")
MODES = sus.modes(SINGLE, fidelity="string")
DEPTH = "stage.test.wires.d"
VARY = {DEPTH: [1e-3, 2e-3]}


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: sus.modes(None), r"design = None: is no design; give one of sus\.read"),
        (lambda: sus.response(MODES), r"design = .*: is no design; give the attribute design"),
        (lambda: sus.modes(MODES.run.design.design), r"design = .*: is no design"),
        (lambda: sus.check(None), r"design = None: is no design"),
        (lambda: sus.draw(None), r"design = None: is no design"),
        (lambda: sus.report(None, "x.html"), r"design = None: is no design"),
        (lambda: sus.compare(SINGLE, None), r"items = None: cannot be compared"),
        (lambda: sus.animate(SINGLE, 1, "x.gif"), r"result = .*: is no result"),
        (lambda: sus.animate(MODES, "all", "x.gif"), r'mode = "all": names several modes'),
        (lambda: sus.animate(MODES, "1,2", "x.gif"), r'mode = "1,2": names several modes'),
        (lambda: sus.modes(SINGLE, fidelity=None), r"fidelity = None: is not one of 'auto'"),
        (lambda: sus.modes(SINGLE, tolerance=None), r"tolerance = None: must be a number"),
        (lambda: sus.modes(SINGLE, tolerance=[0.1]), r"tolerance = \[0\.1\]: must be a number"),
        (lambda: sus.modes(SINGLE, max_frequency="x"), r'max_frequency = "x": must be a number'),
        (lambda: sus.modes(SINGLE, every=None), r"every = None: must be True or False"),
        (lambda: sus.tolerance(SINGLE, builds=2.5), r"builds = 2\.5: must be a whole number"),
        (lambda: sus.xcouple(SINGLE, wire=1), r"wire = 1: must be a text"),
        (lambda: sus.xcouple(SINGLE, folder=3), r"folder = 3: must be a path"),
        (lambda: sus.xcouple(SINGLE, sweep=["k"]), r"sweep = \['k'\]: must be a dictionary"),
        (lambda: sus.xcouple(SINGLE, sweep={"k": []}), r"sweep k: is empty"),
        (lambda: sus.sweep(SINGLE, vary=f"{DEPTH}=1"), r'vary = "stage.*": must be a dictionary'),
        (lambda: sus.sweep(SINGLE, vary={DEPTH: ["a"]}), r"vary stage\.test\.wires\.d = \['a'\]"),
        (lambda: sus.response(SINGLE, inputs=None), r"inputs = None: must be texts"),
        (lambda: sus.response(SINGLE, frequency=None), r"frequency = None: must be real numbers"),
        (lambda: sus.response(SINGLE, frequency=[]), r"frequency: is empty"),
        (lambda: sus.response(SINGLE, frequency=[1 + 1j]), r"frequency = \[\(1\+1j\)\]: must be"),
        (
            lambda: sus.response(SINGLE, input="support.x"),
            r"input: is no .*; did you mean 'inputs'",
        ),
        (lambda: sus.modes(SINGLE, all=True), r"all: is no .* of modes\(\); did you mean 'every'"),
        (lambda: sus.modes(SINGLE, tolerence=0.1), r"tolerence: is no .* mean 'tolerance'"),
        (lambda: sus.modes(SINGLE, out="x"), r"out: is no argument .* option of the command alone"),
        (lambda: sus.modes(SINGLE, colour=1), r"colour: is no argument of modes\(\); known here"),
        (lambda: sus.fit(SINGLE, "x.toml"), r"measured = .*: must be a path"),
        (lambda: sus.optimise(SINGLE, None), r"goals = None: must be a path"),
        (lambda: sus.read(None), r"file = None: must be a path"),
        (lambda: sus.read("x.toml", overrides=2.0), r"overrides = 2\.0: must be texts"),
        (lambda: sus.load(SINGLE), r"file = <Design single: test>: must be a path"),
        (lambda: sus.load(__file__), r".*is not HDF5"),
        (lambda: sus.parse(b"x"), r"text = .*: must be a text; give TOML"),
        (lambda: sus.template(3), r"kind = 3: must be a text; give one of single"),
        (lambda: sus.example(None), r"name = None: must be a text"),
        (lambda: MODES.save(None), r"path = None: must be a path"),
        (lambda: SINGLE.replace([]), r"changes = \[\]: must be a dictionary"),
        (lambda: SINGLE.replace({3: 1}), r"changes = 3: is no path"),
        *[
            (
                lambda value=value: SINGLE.replace({"analysis.modes.tolerance": value}),
                r"^analysis\.modes\.tolerance: cannot be .*; give a number",
            )
            for value in ([None], None, {"a": None}, 1j, {1}, b"x", object(), "\ud800")
        ],
        *[
            (
                lambda value=value: sus.modes(SINGLE, tolerance=value),
                r"^tolerance: .*(finite|range)",
            )
            for value in (np.nan, np.inf)
        ],
        (lambda: SINGLE.replace({DEPTH: {1: 1}}), r"stage\.test\.wires\.d = \{1\}: must be a"),
    ],
)
def test_wrong_arguments_are_input_errors(call, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(sus.InputError, match=f"^{message}") as caught:
        call()
    assert "\n" not in str(caught.value) and not list(tmp_path.iterdir())


class Huge:
    """An object that claims 2^62 members."""

    def __init__(self, member):
        self.member = member

    def __len__(self):
        return 2**62

    def __getitem__(self, _place):
        return self.member


class Failing:
    """An object that can do nothing."""

    def __repr__(self):
        raise RuntimeError("a bug")

    __iter__ = __array__ = __float__ = __repr__


def closed():
    with tempfile.TemporaryFile("w+") as stream:
        return stream


def containing_itself():
    result = []
    result.append(result)
    return result


STRANGE = {
    "a closed file": closed,
    "an iterator of texts": lambda: (text for text in ("a", "b")),
    "a list that contains itself": containing_itself,
    "2^62 texts": lambda: Huge("a"),
    "2^62 numbers": lambda: Huge(1.0),
    "a range of 2^62": lambda: range(2**62),
    "texts without end": lambda: itertools.repeat("a"),
    "numbers without end": itertools.count,
    "an object that fails": Failing,
    "an integer of 5000 digits": lambda: 10**5000,
    "half a character": lambda: "\ud800",
    "a text with a null": lambda: "a\0b",
}
ARGUMENTS = {
    "design": sus.modes,
    "a number": lambda value: sus.modes(SINGLE, max_frequency=value),
    "a flag": lambda value: sus.modes(SINGLE, every=value),
    "a choice": lambda value: sus.modes(SINGLE, fidelity=value),
    "texts": lambda value: sus.response(SINGLE, inputs=value),
    "overrides": lambda value: sus.read(FILE, value),
    "a grid": lambda value: sus.response(SINGLE, frequency=value),
    "a grid of a parameter": lambda value: sus.sweep(SINGLE, vary={DEPTH: value}),
    "grids": lambda value: sus.sweep(SINGLE, vary=value),
    "folder": lambda value: sus.xcouple(SINGLE, sweep={"k": [1.0]}, folder=value),
    "items": lambda value: sus.compare(SINGLE, value),
    "a path": lambda value: MODES.save(value),
    "a text": sus.parse,
    "a mode": lambda value: sus.animate(MODES, value, "x.gif"),
    "a value": lambda value: SINGLE.replace({DEPTH: value}),
    "a free value": lambda value: SINGLE.replace({"analysis.modes.x": [value]}),
    "changes": SINGLE.replace,
    "a key": lambda value: SINGLE[value],
}


@pytest.mark.parametrize("kind", STRANGE)
@pytest.mark.parametrize("argument", ARGUMENTS)
def test_strange_objects_are_input_errors(argument, kind, tmp_path, monkeypatch):
    """What objects of others cannot do is no fault of the program."""
    monkeypatch.chdir(tmp_path)
    if (argument, kind) == ("a flag", "an integer of 5000 digits"):
        return  # true
    if (argument, kind) == ("a grid", "an iterator of texts"):
        kind = "a closed file"
    if (argument, kind) == ("a free value", "a text with a null"):
        return  # which TOML can write
    with pytest.raises(sus.InputError) as caught:
        ARGUMENTS[argument](STRANGE[kind]())
    assert len(str(caught.value)) < 1000 and not list(tmp_path.iterdir())


def test_iterators_of_texts_are_taken_once():
    found = sus.response(
        SINGLE,
        inputs=(text for text in ["support.x", "support.y"]),
        outputs=iter(["test.x"]),
        frequency=map(str, (1, 2)),
        fidelity="string",
    )
    assert found.value.shape == (2, 1, 2)


@pytest.mark.parametrize(
    "function", [sus.sensitivity, lambda *a, **k: sus.sweep(*a, vary=VARY, **k)]
)
def test_results_in_any_form(function):
    """A text or a list."""
    found = [
        function(SINGLE, fidelity="string", results=value).document()["results"]
        for value in ("test yaw", ["test yaw"])
    ]
    assert len(found[0]) == 1 and found == 2 * found[:1]
    with pytest.raises(sus.InputError, match=r"^results"):
        function(SINGLE, results="test yow")


@pytest.mark.parametrize(
    "frequency",
    [
        (n for n in (1, 2)),
        range(1, 3),
        (1, 2.0),
        np.array([[1], [2]]),
        np.array([1, 2], dtype=np.float32),
        ["1", "2"],
        "1,2",
    ],
)
def test_grids_are_taken_in_any_form(frequency):
    found = sus.response(SINGLE, frequency=frequency, fidelity="string")
    assert found.frequency.tolist() == [1.0, 2.0]


def test_numbers_and_flags_are_taken_in_any_form():
    coupling = {"k": np.float64(1.1)}
    found = sus.xcouple(SINGLE, sweep=coupling, workers=np.int64(1), chunk=64.0, fidelity="string")
    assert found.ratio.shape == (1, 1)
    assert sus.modes(SINGLE, every=1, tolerance="1e-3").model == sus.modes(SINGLE).model
    found = sus.sweep(SINGLE, vary={DEPTH: [1e-3]}, results=1, fidelity="string")
    assert len(found.result) == 1


def test_arrays_of_xarray_replace_numbers_of_designs():
    frequency = MODES.to_xarray().frequency
    changed = SINGLE.replace({DEPTH: frequency[0] * 1e-3})
    assert changed.stage[0].wires.d == float(MODES.frequency[0]) * 1e-3


def test_designs_are_keys_of_dictionaries():
    other = SINGLE.replace({DEPTH: 0.002})
    assert {SINGLE: 1, other: 2}[sus.template("single")] == 1


def test_paths_stand_for_designs_in_every_function(tmp_path):
    path = tmp_path / "single.toml"
    path.write_text(SINGLE.text)
    assert sus.check(path).run.name == sus.check(str(path)).run.name == "single"
    assert sus.report(path, tmp_path / "x.html", sections="numbers").path == tmp_path / "x.html"


LONGER = SINGLE.replace({"stage.test.wires.l": 1.0})


def coupling(design=SINGLE):
    return sus.xcouple(design, sweep={"k": [0.9, 1.1]}, fidelity="string")


def test_results_are_compared_by_identity():
    one, other = (sus.modes(SINGLE, fidelity="string") for _ in range(2))
    assert one == one and one != other and len({one, other}) == 2


def test_results_with_losses_are_pickled():
    design = sus.example("geo-silica-triple")
    found = sus.response(design, frequency=[1.0, 10.0], fidelity="beam")
    again = pickle.loads(pickle.dumps(found))
    assert again.document() == found.document() and str(again) == str(found)
    assert again.plot() is not None


def test_a_loaded_result_does_not_change_with_its_file(tmp_path):
    path = tmp_path / "r.h5"
    found = sus.modes(SINGLE, fidelity="string")
    found.save(path)
    again = sus.load(path)
    sus.modes(LONGER, fidelity="string").save(path)
    assert again.to_xarray().identical(found.to_xarray())
    again.save(tmp_path / "copy.h5")
    assert sus.load(tmp_path / "copy.h5").document() == found.document()
    path.unlink()
    assert again.to_xarray().identical(found.to_xarray())


def test_a_loaded_design_is_replaced(tmp_path):
    sus.modes(SINGLE, fidelity="string").save(tmp_path / "r.h5")
    source = sus.load(tmp_path / "r.h5").design
    assert source.replace({"stage.test.wires.l": 1.0}).design == LONGER.design


def test_a_sweep_refuses_a_file_that_is_not_its_own(tmp_path):
    path = tmp_path / "r.h5"
    coupling().save(path)
    again = sus.load(path)
    assert again.to_xarray().sizes["k"] == 2
    coupling(LONGER).save(path)
    with pytest.raises(sus.InputError, match=r"r\.h5: was replaced by another file"):
        again.to_xarray()
    path.unlink()
    with pytest.raises(sus.InputError, match=r"r\.h5: was deleted"):
        again.save(tmp_path / "copy.h5")
    assert again.document() and again.plot() is not None


@pytest.mark.parametrize("duplicate", [copy.copy, copy.deepcopy])
def test_copies_of_a_sweep_keep_its_temporary_file(duplicate):
    found = coupling()
    again, path = duplicate(found), found.run.file
    del found
    gc.collect()
    assert again.to_xarray().sizes["k"] == 2
    del again
    gc.collect()
    assert not path.parent.exists()


def test_csv_is_that_of_the_command(tmp_path):
    found = sus.modes(SINGLE, fidelity="string")
    found.save(tmp_path / "found.csv")
    (expected,) = write_csv(found, tmp_path / "command.h5")
    text = (tmp_path / "found.csv").read_text()
    assert text == expected.read_text()
    assert len(text.splitlines()) == 1 + len(found.frequency)


def test_pictures_are_no_results_files(tmp_path):
    with pytest.raises(sus.InputError, match=r"path = .*m\.png: .*plot\(\)\.savefig"):
        sus.modes(SINGLE, fidelity="string").save(tmp_path / "m.png")
    assert not list(tmp_path.iterdir())
