"""The stated error of a map of couplings, where a resonance lies between its corners; and a run in
a more complete model that follows from it, interrupted."""

from __future__ import annotations

import json

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.studies import chunks
from tests.support.commandline import run
from tests.support.paths import CONFIGS

TABLE2 = CONFIGS / "husman2000" / "table2.toml"
MAP = ("--sweep", "k=0.6:1.4:41,offset=-2e-3:2e-3:5", "--frequency", "50", "--tolerance", "0.01")
WORDS = ("xcouple", TABLE2, *MAP, "--no-plot")
NAME = "husman2000-table2-xcouple.h5"


@pytest.fixture(scope="module")
def exact(tmp_path_factory):
    found = json.loads(answer(tmp_path_factory.mktemp("violin"), "--fidelity", "violin").stdout)
    return couplings(found)


def answer(out, *options):
    done = run(*WORDS, "--json", "--out", out, *options)
    assert done.exit_code == 0, done.stderr
    return done


def couplings(found):
    return np.array(found["ratio_real"]) + 1j * np.array(found["ratio_imag"])


def test_a_resonance_between_the_corners_is_in_the_stated_error(exact, tmp_path):
    """The roll mode passes 50 Hz; wire mass shifts it."""
    found = json.loads(answer(tmp_path, "--fidelity", "beam").stdout)
    true = np.abs(couplings(found) - exact).max() / np.abs(exact).max()
    assert true > 4
    assert found["estimated_error"] == pytest.approx(true, rel=1e-6)


def test_auto_then_takes_the_more_complete_model(exact, tmp_path):
    done = answer(tmp_path)
    found = json.loads(done.stdout)
    assert (found["fidelity"], found["estimated_error"]) == ("violin", 0.0)
    np.testing.assert_allclose(couplings(found), exact, rtol=1e-9)
    assert "computed again in the violin model: wire mass changes couplings by up to" in done.stderr


@pytest.mark.parametrize("level", ["string", "beam"])
def test_the_stated_error_is_that_of_tradeoff(level):
    design = sus.example("double")
    stated = sus.xcouple(design, fidelity=level).estimated_error
    [measured] = sus.tradeoff(design, quantities=["coupling"]).answers
    [entry] = [one for one in measured.options if one.model == level]
    assert entry.error / 1.5 < stated < 3 * entry.error


@pytest.mark.parametrize("writes", [1, 2, 4])
def test_an_interruption_in_either_model_leaves_the_same_file(writes, monkeypatch, tmp_path):
    """Four chunks on `beam`, then four on `violin`."""
    options = ("--chunk", "64", "-q")
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    assert run(*WORDS, *options, "--out", whole).exit_code == 0
    with monkeypatch.context() as patch:
        original, done = chunks.write, list[str]()

        def write(file, key, start, values):
            if len(done) == 3 + writes:
                raise KeyboardInterrupt
            done.append(file.name)
            original(file, key, start, values)

        patch.setattr(chunks, "write", write)
        stopped = run(*WORDS, *options, "--out", broken)
    assert stopped.exit_code == 130
    again = run(*WORDS, *options, "--out", broken, "--resume")
    assert again.exit_code == 0, again.stderr
    assert [path.name for path in broken.iterdir()] == [NAME]
    assert (whole / NAME).read_bytes() == (broken / NAME).read_bytes()


def test_what_an_abandoned_run_left_in_the_second_model_is_not_taken(monkeypatch, tmp_path):
    """Without --resume all is computed anew."""
    with monkeypatch.context() as patch:
        original, done = chunks.write, list[str]()

        def write(file, key, start, values):
            if len(done) == 6:
                raise KeyboardInterrupt
            done.append(file.name)
            original(file, key, start, values)

        patch.setattr(chunks, "write", write)
        run(*WORDS, "--chunk", "64", "--out", tmp_path)
    [inner] = [path for path in (tmp_path / f"{NAME}.part").iterdir() if path.is_dir()]
    (inner / "0.chunk").write_bytes(b"")
    assert run(*WORDS, "--chunk", "64", "--out", tmp_path).exit_code == 0
    assert [path.name for path in tmp_path.iterdir()] == [NAME]
