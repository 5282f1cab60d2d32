"""Runs that are written while they are computed: blocks, memory, disk, interruptions, overflow."""

from __future__ import annotations

import csv
import shutil
import tracemalloc
from collections import namedtuple

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.analyses.simulate import solve
from suspension_cli.errors import InputError, PendsusWarning
from suspension_cli.files import stored
from suspension_cli.models import registry
from suspension_cli.physics import local_control, time_domain
from suspension_cli.physics.time_domain import Sampled
from tests.analyses.simulate.test_simulate import DAMPED, QUIET, of_loop, run_all
from tests.support import plants
from tests.support.commandline import run

NOISY = {"rate": 128.0, "fidelity": "string", "ground": ["nlnm"]}
WRONG_SIGN = {"damper": -20.0}
GROWS = {"rate": 256.0, "outputs": ["upper.x"], "step": ["upper.force_x=1e-6"]} | QUIET


def sampled_triple():
    """The damped triple at 128 Hz, with a force and a motion."""
    design = sus.read(DAMPED)
    model = registry.STRING.system(design.design)
    plant = local_control.build_plant(design.design, model)
    pushed = plants.drives(model, "upper.force_x")
    return time_domain.sample(plant, 128.0, pushed, [], plants.motions(model, "test.x"))


def test_the_length_of_blocks_does_not_matter():
    """Groups of samples that are advanced together give what one sample after the other gives."""
    sampled = sampled_triple()
    whole = sampled.linear()
    given = np.random.default_rng(1).standard_normal((3000, whole.b.shape[1]))
    state = np.zeros(len(whole.a))
    expected = np.empty((len(given), len(whole.c)))
    for n, row in enumerate(given):
        expected[n] = whole.c @ state + whole.d @ row
        state = whole.a @ state + whole.b @ row
    for block in (1, 40, 1024, 4096):
        found, _ = run_all(sampled, given, block=block)
        np.testing.assert_allclose(found, expected, atol=1e-11 * np.abs(expected).max())


def test_the_length_of_a_run_does_not_change_its_start():
    short, long = (sus.simulate(DAMPED, duration=end, seed=4, **NOISY) for end in (20.0, 50.0))
    np.testing.assert_allclose(long.value[: len(short.value)], short.value, rtol=1e-9)


def test_statistics_and_spectra_are_those_of_the_arrays():
    found = sus.simulate(DAMPED, duration=60.0, outputs=["test.x", "upper.yaw"], **NOISY)
    np.testing.assert_allclose(found.rms, np.sqrt((found.value**2).mean(0)), rtol=1e-12)
    np.testing.assert_array_equal(found.largest, np.abs(found.value).max(0))
    np.testing.assert_array_equal(found.largest_force, np.abs(found.force).max(0))
    # Parseval, but for what is slower than a piece
    step = found.frequency[1] - found.frequency[0]
    total = np.sqrt((found.force_density**2).sum(0) * step)
    np.testing.assert_allclose(total, found.force_rms, rtol=0.1)
    assert sus.simulate(DAMPED, duration=60.0, rate=128.0, **QUIET).density is None


@pytest.mark.filterwarnings("ignore:.*so little damping")
def test_memory_does_not_grow_with_the_run(monkeypatch, tmp_path):
    """Nor do arrays of the result take any: they stay in the file."""
    peaks = []

    def watched(*given):
        tracemalloc.start()
        record(*given)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()

    record = solve._Recorder.record
    monkeypatch.setattr(solve._Recorder, "record", watched)
    monkeypatch.setattr(stored, "LARGE", 0)
    monkeypatch.setattr(solve, "LONGEST_PIECE", 1024)
    monkeypatch.setattr(solve, "MOST_BEFORE", 100)
    for duration in (200.0, 800.0):
        found = sus.simulate(DAMPED, duration=duration, folder=tmp_path, **NOISY | {"ground": []})
    assert found.value.nbytes + found.force.nbytes + found.time.nbytes > 6.5e6
    assert isinstance(found.value, np.memmap)
    assert peaks[1] < peaks[0] + 5e5


def test_csv_has_all_rows(tmp_path):
    """More than are made together; spectra stand in a file of their own."""
    found = sus.simulate(DAMPED, duration=100.0, **NOISY)
    found.save(tmp_path / "run.csv")
    head, *rows = csv.reader((tmp_path / "run.csv").read_text().splitlines())
    column = head.index("value [test.x] (m)")
    assert [float(row[column]) for row in rows] == found.value[:, 0].tolist()
    assert [float(row[0]) for row in rows] == found.time.tolist()
    _, *rows = csv.reader((tmp_path / "run-frequency.csv").read_text().splitlines())
    assert [float(row[0]) for row in rows] == found.frequency.tolist()


def test_an_interrupted_run_leaves_no_file(monkeypatch, tmp_path):
    def interrupted(self, take, count):
        yield next(original(self, take, count))
        raise KeyboardInterrupt

    original = Sampled.run
    before = run("simulate", DAMPED, "--duration", 1, "--no-noise", "--out", tmp_path, "-q")
    assert before.exit_code == 0
    [file] = tmp_path.glob("*.h5")
    content = file.read_bytes()
    monkeypatch.setattr(Sampled, "run", interrupted)
    stopped = run("simulate", DAMPED, "--duration", 60, "--no-noise", "--out", tmp_path)
    assert stopped.exit_code == 130
    assert file.read_bytes() == content
    assert {path.suffix for path in tmp_path.iterdir()} == {".h5", ".png"}


def test_a_large_file_is_warned_of_and_one_too_large_refused(monkeypatch, tmp_path):
    Usage = namedtuple("Usage", "total used free")
    monkeypatch.setattr(shutil, "disk_usage", lambda _: Usage(1, 1, 1e5))
    with pytest.raises(InputError, match=r"of 0\.00131 GB, where 0\.0001 GB are free"):
        sus.simulate(DAMPED, duration=160.0, rate=128.0, **QUIET, folder=tmp_path)
    assert not list(tmp_path.iterdir())
    monkeypatch.setattr(solve, "LARGE", 1e4)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: Usage(1, 1, 1e7))
    with pytest.warns(PendsusWarning, match="-simulate.h5 takes 0.00131 GB"):
        sus.simulate(DAMPED, duration=160.0, rate=128.0, **QUIET, folder=tmp_path)


def test_a_loop_that_is_unstable_is_named_with_the_time():
    """A damper of the wrong sign among five sound ones, which at last would push more than the
    suspension weighs."""
    design = sus.read(DAMPED).replace({"control.loop.x.gain": -1.0e6})
    with pytest.raises(InputError, match=r"control\.loop\.x: the sampled loops are unstable"):
        sus.simulate(design, duration=1.0, **GROWS)
    with pytest.warns(PendsusWarning) as warned:
        found = sus.simulate(design, duration=60.0, allow_unstable=True, **GROWS)
    [line] = [str(one.message) for one in warned if "exceeds" in str(one.message)]
    weight = 9.81 * (5.86 + 5.26 + 5.6)
    first = np.flatnonzero(np.abs(found.force[:, 0]) > weight)[0] / 256.0
    assert f"the actuator of x exceeds 164 N from {first:.4g} s on (unstable: x)" in line
    assert np.isfinite(found.value).all()


def test_a_run_that_overflows_writes_nothing(tmp_path):
    design = of_loop(WRONG_SIGN)
    with (
        pytest.warns(PendsusWarning, match="unstable"),
        pytest.raises(
            InputError, match=r"overflow: the actuator of x exceeds 164 N from .* \(unstable: x\)"
        ),
    ):
        sus.simulate(design, duration=2000.0, allow_unstable=True, folder=tmp_path, **GROWS)
    assert not list(tmp_path.iterdir())


def test_loops_that_are_unstable_together_are_named():
    """Dampers of -3, -3 and 5 N s/m: without either of the first two their sum is 2."""
    ends = {"sensor": "upper.x", "actuator": "upper.force_x"}
    loops = [{"name": name, "damper": b} | ends for name, b in [("a", -3), ("b", -3), ("c", 5)]]
    design = sus.example("triple-damped").replace({"control": {"loop": loops}})
    with pytest.raises(InputError, match="and are stable without a or b"):
        sus.simulate(design, duration=1.0, **GROWS)
