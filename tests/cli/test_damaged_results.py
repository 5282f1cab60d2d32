"""Damaged results files are refused in one line by every command and function that reads them."""

from __future__ import annotations

import json
import random

import h5py
import numpy as np
import pytest

import suspension_cli as sus
from tests.support.commandline import assert_refused, run, written
from tests.support.designs import TEXTS


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    folder = tmp_path_factory.mktemp("results")
    design = written(folder, TEXTS["double"])
    for name in ("modes", "response"):
        words = ("--frequency", "1:10:20") if name == "response" else ()
        assert run(name, design, *words, "--no-plot", "--out", folder).exit_code == 0
    return folder


def reshaped(file, group, name):
    data = file[group][name][...]
    del file[group][name]
    file[group][name] = np.ravel(data)[:-1]


def flip(data, seed, count):
    draw = random.Random(seed)
    for place in draw.sample(range(8, len(data)), count):
        data[place] ^= 1 << draw.randrange(8)


def replaced(name, **what):
    def change(file):
        del file[name]
        file.create_dataset(name, **what)

    return change


def linked(link):
    def change(file):
        del file["response/value"]
        file["response/value"] = link

    return change


def as_group(file):
    del file["response/value"]
    file["response"].create_group("value")


def attribute(name, value):
    return lambda file: file.attrs.__setitem__(name, value)


DAMAGE = {
    "no dataset": ("modes", lambda file: file["modes"].pop("shape"), "is incomplete"),
    "fewer modes": ("modes", lambda file: reshaped(file, "modes", "frequency"), ""),
    "other shape": ("modes", lambda file: reshaped(file, "modes", "shape"), ""),
    "no design": ("response", lambda file: file.attrs.pop("design"), "is incomplete"),
    "error as text": ("response", attribute("estimated_error", "small"), ""),
    "scales": ("modes", lambda file: file["modes/q"].attrs.__setitem__("DIMENSION_LIST", 1.0), ""),
    "other notes": ("response", attribute("extra", "-1"), ""),
    "fewer frequencies": ("response", lambda file: reshaped(file, "response", "frequency"), ""),
}
"""What is damaged, how, and how the message begins; every reader meets these."""
SPOILT = {
    "foreign": ("modes", attribute("format", "other"), "is not in a known format"),
    "format as number": ("response", attribute("format", 3.0), ""),
    "newer": ("modes", attribute("format_version", 99), "is not in a known format (version 99)"),
    "version as text": ("response", attribute("format_version", "1"), ""),
    "version 0": ("response", attribute("format_version", 0), ""),
    "nothing": ("modes", lambda file: file.pop("modes"), "holds no result of an analysis"),
    "bad design": (
        "modes",
        attribute("design", TEXTS["double"].replace('name = "double"', "name = 1", 1)),
        "design.name = 1: must be a string",
    ),
    "design as numbers": ("response", attribute("design", np.zeros(3)), ""),
    "dataset for the group": ("response", replaced("response", data=3.0), ""),
    "group for a dataset": ("response", as_group, ""),
    "circular link": ("response", linked(h5py.SoftLink("/response/value")), ""),
    "external link": ("response", linked(h5py.ExternalLink("/dev/null", "/x")), ""),
    "external storage": (
        "response",
        replaced("response/value", shape=(4,), dtype="f8", external=[("/dev/null", 0, 32)]),
        "",
    ),
    "other shape": ("response", replaced("response/value", data=np.zeros((20, 3))), ""),
    "no rows": ("response", replaced("response/frequency", data=np.zeros(0)), ""),
    "scalar": ("response", replaced("response/frequency", data=1.0), ""),
    "huge": (
        "response",
        replaced("response/value", shape=(10**12, 1, 1), dtype="c16", chunks=(1000, 1, 1)),
        "",
    ),
    "text": (
        "response",
        replaced("response/value", data=np.array(["x"] * 20, dtype=h5py.string_dtype())),
        "",
    ),
}
READERS = {
    "compare": lambda file, good: ("compare", file, good, "--no-plot"),
    "plot": lambda file, good: ("plot", file),
    "together": lambda file, good: ("plot", file, good, "--together"),
    "csv": lambda file, good: ("plot", file, "--csv"),
}


@pytest.mark.parametrize(
    ("damage", "reader"),
    [
        *(pytest.param(DAMAGE[kind], r, id=f"{kind}-{r}") for kind in DAMAGE for r in READERS),
        *(pytest.param(SPOILT[kind], "plot", id=f"spoilt: {kind}") for kind in SPOILT),
    ],
)
def test_damaged_results(damage, reader, results, tmp_path):
    stem, change, problem = damage
    good = results / f"double-{stem}.h5"
    file = written(tmp_path, good.read_bytes(), "x.h5")
    with h5py.File(file, "r+") as opened:
        change(opened)
    words = READERS[reader](file, good)
    lines = assert_refused(run(*words, "--out", tmp_path / "out"), file, tmp_path / "out")
    assert lines[0].startswith(problem)
    with pytest.raises(sus.InputError, match="^" + str(file)) as raised:
        sus.load(file)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("seed", range(6))
def test_flipped_bytes(seed, results, tmp_path):
    data = bytearray((results / "double-response.h5").read_bytes())
    flip(data, seed, 300)
    file = written(tmp_path, bytes(data), "x.h5")
    for words in (READERS["compare"], READERS["csv"]):
        result = run(*words(file, results / "double-response.h5"), "--out", tmp_path / "out")
        assert_refused(result, file, tmp_path / "out")


def test_results_that_cannot_be_compared(results, tmp_path):
    """What only a comparison reads is found there, in one of its files."""
    good = results / "double-modes.h5"
    file = written(tmp_path, good.read_bytes(), "x.h5")
    with h5py.File(file, "r+") as opened:
        opened.attrs["fidelity"] = "nan"
    result = run("compare", file, good, "--no-plot", "--out", tmp_path / "out")
    assert_refused(result, f"{file} or {good}", tmp_path / "out")


def test_no_finite_number_is_no_traceback(results, tmp_path):
    file = written(tmp_path, (results / "double-response.h5").read_bytes(), "x.h5")
    with h5py.File(file, "r+") as opened:
        for name in ("frequency", "value"):
            opened[f"response/{name}"][...] = np.nan
    result = run("plot", file, "--out", tmp_path / "out")
    assert result.exit_code in (0, 2)
    assert result.stderr.count("\n") == 1


def test_numbers_that_became_nan_are_null_in_json(tmp_path):
    sus.response(sus.example("double"), frequency=[1.0, 2.0]).save(tmp_path / "r.h5")
    with h5py.File(tmp_path / "r.h5", "a") as file:
        value = file["response/value"][...]
        value[0] = complex("nan")
        file["response/value"][...] = value
    document = sus.load(tmp_path / "r.h5").document()
    assert document["real"][0] is None and document["real"][1] is not None
    json.dumps(document, allow_nan=False)
