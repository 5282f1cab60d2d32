"""Spoilt designs: whatever stands in a file, the command computes or says what is wrong with it."""

from __future__ import annotations

import copy
import math
import tempfile
from datetime import date, datetime, time
from pathlib import Path
from typing import Any

import tomli_w
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.support.commandline import assert_refused, run, strict_json, written
from tests.support.designs import RAW, TEXTS

EXTREMES = [
    0,
    1,
    -1,
    3,
    0.0,
    -0.0,
    0.5,
    1e-320,
    1e-12,
    1e-9,
    1e-6,
    1e5,
    1e9,
    1e12,
    1e15,
    1e20,
    1e300,
    -1e300,
    math.nan,
    math.inf,
    -math.inf,
]
INTEGERS = [2**31, 2**53 + 1, 2**63, -(2**63) - 1, 10**399]
WORDS = [
    "",
    " ",
    "test",
    "upper",
    "support",
    "steel302",
    "test.1",
    "string",
    "x" * 200,
    "é",
    "\u202e",
    "\0",
    "a\nb",
    'a"b\\',
    "nan",
    "1.0",
    "\x7f",
    "🜨",
]
OTHERS: list[Any] = [
    True,
    False,
    [],
    {},
    [[]],
    [{}],
    [[[[1.0]]]],
    [1.0],
    [0.0] * 3,
    [1.0] * 6,
    [[1.0] * 3] * 3,
    [[0.0] * 6] * 6,
    {"": 1},
    {"name": "x"},
]
MOMENTS = [date(2026, 1, 2), datetime(2026, 1, 2, 3, 4, 5), time(3, 4, 5)]
VALUES = (
    st.sampled_from([*EXTREMES, *INTEGERS, *WORDS, *OTHERS, *MOMENTS])
    | st.floats()
    | st.text(st.characters(exclude_categories=["Cs"]), max_size=8)
)
FACTORS = st.sampled_from(
    [-1.0, 0.0, 1e-12, 1e-9, 1e-6, 1e-3, 0.1, 0.5, 0.9, 1.1, 2.0, 10.0, 1e3, 1e6, 1e9, 1e12]
)

FUZZ = settings(
    max_examples=15,
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=list(HealthCheck),
)


def places(node: Any) -> list[tuple[Any, Any]]:
    """Every container and key of a document."""
    keys = (
        list(node) if isinstance(node, dict) else range(len(node)) if isinstance(node, list) else []
    )
    return [place for key in keys for place in [(node, key), *places(node[key])]]


def drop(draw: Any, node: Any, key: Any) -> None:
    del node[key]


def repeat(draw: Any, node: Any, key: Any) -> None:
    """A list's member twice, a table's value under a second name."""
    if isinstance(node, list):
        node.append(copy.deepcopy(node[key]))
    else:
        node[key + draw(st.sampled_from(["s", "_upper", " ", "é", "\n"]))] = copy.deepcopy(
            node[key]
        )


def rename(draw: Any, node: Any, key: Any) -> None:
    if isinstance(node, dict):
        node[
            draw(st.sampled_from([key[1:], key[::-1], key.upper(), "natural_length", "blade"]))
        ] = node.pop(key)


def replace(draw: Any, node: Any, key: Any) -> None:
    node[key] = copy.deepcopy(draw(VALUES))


def rescale(draw: Any, node: Any, key: Any) -> None:
    if isinstance(node[key], float):
        node[key] *= draw(FACTORS)


CHANGES = [drop, repeat, rename, replace, replace, rescale, rescale, rescale]


@st.composite
def spoilt_tables(draw: Any) -> str:
    """A valid design with one to three changes to its keys and values."""
    raw = copy.deepcopy(RAW[draw(st.sampled_from(list(RAW)))])
    for _ in range(draw(st.integers(1, 3))):
        found = places(raw)
        if found:
            draw(st.sampled_from(CHANGES))(draw, *found[draw(st.integers(0, len(found) - 1))])
    return tomli_w.dumps(raw)


@st.composite
def spoilt_bytes(draw: Any) -> bytes:
    """A valid design with one to three changes to its bytes."""
    text = TEXTS[draw(st.sampled_from(list(TEXTS)))].encode()
    for _ in range(draw(st.integers(1, 3))):
        start = draw(st.integers(0, len(text)))
        stop = start + draw(st.sampled_from([0, 1, 1, 1, 2, 30, 1000]))
        middle = draw(
            st.sampled_from(
                [
                    b"",
                    b"0",
                    b"9",
                    b"e9",
                    b"-",
                    b".",
                    b"=",
                    b"[",
                    b"]",
                    b'"',
                    b"#",
                    b"\n",
                    b"\r",
                    b"\t",
                    b"\0",
                    b"\xff",
                    b"\xc3\xa9",
                    text[start:stop] * 2,
                ]
            )
        )
        text = text[:start] + middle + text[stop:]
    return text


@st.composite
def strained(draw: Any) -> str:
    """A design whose keys and types are good, with one to four numbers far from what they were."""
    raw = copy.deepcopy(RAW[draw(st.sampled_from(list(RAW)))])
    numbers = [(node, key) for node, key in places(raw) if isinstance(node[key], float)]
    for _ in range(draw(st.integers(1, 4))):
        node, key = numbers[draw(st.integers(0, len(numbers) - 1))]
        bound = draw(st.sampled_from([0.0, 1e-12, 1e-9, 1e-6, 1e5, 1e6, 1e9, 1e12, 1e15, 1e20]))
        node[key] = (
            draw(st.sampled_from([1.0, -1.0])) * bound
            if draw(st.booleans())
            else node[key] * 10.0 ** draw(st.integers(-15, 15))
        )
    return tomli_w.dumps(raw)


def refused_or(answer_of: str, file: Path, out: Path, *options: str) -> Any:
    """The JSON that a command gives for a file; None if it refused the file, as it should, in
    words."""
    result = run(answer_of, file, "--json", *options)
    if result.exit_code == 0:
        return strict_json(result.stdout)
    assert_refused(result, file, out)
    return None


def assert_done_or_refused(content: str | bytes, *options: str) -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        file, out = written(folder, content), folder / "out"
        answer = refused_or("modes", file, out, "--out", str(out), *options)
        if answer is None:
            return
        assert [path.name for path in out.iterdir()] == [f"{answer['design']}-modes.h5"]
        for mode in answer["modes"]:
            number = (
                mode.get("growth_rate_per_s", mode.get("decay_rate_per_s"))
                if mode["frequency_hz"] is None
                else mode["frequency_hz"]
            )
            assert math.isfinite(number) and number >= 0


@FUZZ
@given(spoilt_tables())
def test_spoilt_tables(text):
    assert_done_or_refused(text)


@FUZZ
@given(spoilt_tables())
def test_spoilt_tables_on_the_general_model(text):
    assert_done_or_refused(text, "--fidelity", "string")


@FUZZ
@given(strained())
def test_check_agrees_with_modes(text):
    """What `check` calls good has modes, on the general model, which needs the equilibrium that
    `check` finds."""
    with tempfile.TemporaryDirectory() as name:
        file, out = written(Path(name), text), Path(name) / "out"
        checked = refused_or("check", file, out)
        found = refused_or("modes", file, out, "--out", str(out), "--fidelity", "string")
        assert (checked is None) == (found is None)
        if checked is not None:
            assert all(wire["tension_n"] > 0 for wire in checked["wires"])


@FUZZ
@given(spoilt_bytes())
def test_spoilt_bytes(text):
    assert_done_or_refused(text)


@FUZZ
@given(strained(), st.sampled_from(["auto", "string"]))
def test_strained_designs(text, fidelity):
    assert_done_or_refused(text, "--fidelity", fidelity)
