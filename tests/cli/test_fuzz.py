"""Spoilt designs and mutated runs: whatever stands in a file, commands compute or refuse it in
words."""

from __future__ import annotations

import math
import random
from pathlib import Path
from typing import Any

import pytest

from tests.support.commandline import assert_refused, run, strict_json, written
from tests.support.designs import TEXTS
from tools import mutations


def spoil(seed: int, kind: str) -> bytes:
    """Mutate a valid design: one to three keys and values, or bytes."""
    draw = random.Random(f"{kind}-{seed}")
    text = TEXTS[draw.choice(list(TEXTS))]
    if kind == "bytes":
        return mutations.mutate_bytes(draw, text.encode())
    return mutations.mutate_document(draw, text)


def refused_or(command: str, file: Path, out: Path, *options: str) -> Any:
    """The JSON document of a command; None if it refused the file, in words."""
    result = run(command, file, "--json", *options)
    if result.exit_code == 0:
        return strict_json(result.stdout)
    assert_refused(result, file, out)
    return None


@pytest.mark.parametrize("kind", ["keys", "bytes"])
@pytest.mark.parametrize(("seed", "fidelity"), [(n, ("auto", "string")[n % 2]) for n in range(16)])
def test_modes_are_finite_or_the_design_is_refused(tmp_path, kind, fidelity, seed):
    file, out = written(tmp_path, spoil(seed, kind)), tmp_path / "out"
    answer = refused_or("modes", file, out, "--out", str(out), "--fidelity", fidelity)
    if answer is None:
        return
    assert [path.name for path in out.iterdir()] == [f"{answer['design']}-modes.h5"]
    for mode in answer["modes"]:
        rate = mode.get("growth_rate_per_s", mode.get("decay_rate_per_s"))
        number = rate if mode["frequency_hz"] is None else mode["frequency_hz"]
        assert math.isfinite(number) and number >= 0


@pytest.mark.parametrize("seed", range(15))
def test_check_refuses_what_modes_refuses(tmp_path, seed):
    """On the string model, which needs the equilibrium that `check` finds."""
    file, out = written(tmp_path, spoil(seed, "keys, checked")), tmp_path / "out"
    checked = refused_or("check", file, out)
    found = refused_or("modes", file, out, "--out", str(out), "--fidelity", "string")
    assert (checked is None) == (found is None)
    if checked is not None:
        assert all(wire["tension_n"] > 0 for wire in checked["wires"])


@pytest.fixture(scope="module")
def valid(tmp_path_factory):
    return mutations.valid_files(tmp_path_factory.mktemp("valid"), ("modes", "response", "thermal"))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", mutations.KINDS)
def test_a_mutation_is_computed_or_refused(kind, seed, valid):
    code, problem = mutations.run(kind, f"{kind}-test-{seed}", valid)
    assert code in (0, 1, 2) and not problem


@pytest.mark.parametrize(
    ("code", "out", "err", "says"),
    [
        (1, "", "Traceback (most recent call last):", "traceback"),
        (-11, "", "", "crash"),
        (-14, "", "", "no end"),
        (2, "", "", "without a word"),
        (0, '{"q": NaN}', "", "NaN"),
        (0, "", "x.py:1: RuntimeWarning: overflow", "raw warning"),
    ],
)
def test_what_is_wrong_is_found(code, out, err, says, tmp_path):
    assert says in mutations.judge(code, out, err, tmp_path)


def test_a_file_written_in_spite_of_an_error_is_found(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "x.h5").touch()
    assert "wrote" in mutations.judge(2, "", "x: is wrong; correct it", tmp_path)
