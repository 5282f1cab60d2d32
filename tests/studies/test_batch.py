"""The engine of sweeps: the same bits however a sweep is cut up, every point once, and nothing lost
when it is interrupted."""

from __future__ import annotations

import gc
import io
import os
import pickle
import shutil
import tempfile
import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import suspension_cli as sus
from suspension_cli.analyses.named_quantities import names_of
from suspension_cli.analyses.sweep.parameter_sweep import ParameterSweep
from suspension_cli.analyses.tolerance import solve as random_builds
from suspension_cli.analyses.tolerance.solve import RandomBuilds
from suspension_cli.analyses.xcouple.imperfect_builds import ImperfectBuilds
from suspension_cli.design import reader
from suspension_cli.errors import InputError, PendsusError
from suspension_cli.linear.system import LinearSystem
from suspension_cli.quantities.nominal_results import find_results
from suspension_cli.studies import chunks
from suspension_cli.studies import run as batch
from suspension_cli.studies.job import Axis
from tests.support import counting_sweep, scenes
from tests.support.commandline import edited, run
from tests.support.couplings import FILE, TRIPLE, TRIPLE_FILE, question
from tests.support.files import numbers_of
from tests.support.golden import CONFIGS

GRID = ("--sweep", "k=0.6:1.4:23,offset=-2e-3:2e-3:19")
RANDOM = CONFIGS / "triple-tolerance.toml"


def written_by(out, workers, chunk, *command):
    result = run(
        *command, "--out", out, "--workers", str(workers), "--chunk", str(chunk), "--no-plot", "-q"
    )
    assert result.exit_code == 0, result.stderr
    [file] = out.iterdir()
    return file.read_bytes()


@pytest.fixture(scope="module", autouse=True)
def few():
    """What strings leave out is estimated from few builds: here it only has to be the same."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(random_builds, "EXTREME", 3)
        yield


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Files written in one go."""
    commands = {
        "xcouple": ("xcouple", FILE, *GRID),
        "tolerance": (
            *("tolerance", RANDOM, "--fidelity", "string", "--builds", "150"),
            *("--frequency", "10,50", "--result", "Q of test pitch"),
            *("--require", "test.x/support.x:10 < 1", "--require", "coupling < 1e-3"),
        ),
    }
    return {
        name: (command, written_by(tmp_path_factory.mktemp(name), 1, 8192, *command))
        for name, command in commands.items()
    }


@pytest.mark.parametrize("name", ["xcouple", "tolerance"])
def test_chunks_change_results_by_rounding_alone(name, whole, tmp_path):
    """`xcouple` on several processes is in `test_batch_interrupted.py`."""
    command, expected = whole[name]
    found, expected = (
        numbers_of(content) for content in (written_by(tmp_path, 1, 100, *command), expected)
    )
    assert found.keys() == expected.keys()
    for key, values in expected.items():
        size = np.abs(np.nan_to_num(values)).max(initial=0.0)
        if "residual" not in key:
            np.testing.assert_allclose(found[key], values, rtol=1e-8, atol=1e-10 * size)


AXES = (
    Axis("k", tuple(np.linspace(0.8, 1.2, 9))),
    Axis("com_y", tuple(np.linspace(-3e-4, 3e-4, 9))),
)


def on_blades():
    rng = np.random.default_rng(51)
    bladed = scenes.plain(scenes.bladed_chain(rng, 3, tip_mass=True, lateral=True))
    design = reader.convert(bladed)
    wire = f"{design.stage[-1].name}.1"
    return ImperfectBuilds(
        reader.write_toml(bladed), AXES, question(design, wire, "natural-length")
    )


def lossy_at_high_frequencies():
    raw = edited(
        tomllib.loads(TEXT),
        {("materials", "fused-silica", "loss_angle"): 1e-3, ("stage", 0, "damping"): {"x": 1.0}},
    )
    return ImperfectBuilds(
        reader.write_toml(raw), AXES, question(frequency=(10.0, 400.0)), level="violin"
    )


def over_designs():
    axis = Axis("stage.test.wires.d", tuple(np.linspace(1e-3, 2e-3, 81)))
    design = sus.parse(TEXT)
    results = find_results(["test yaw", "2"], names_of(design), TEXT, "beam")
    return ParameterSweep(TEXT, (axis,), "beam", results)


def builds_at_random(count, **how):
    text = RANDOM.read_text()
    return RandomBuilds(text, count, 3, question(reader.parse(text)), **how)


TEXT = FILE.read_text()
JOBS = {
    "wires and designs": lambda: ImperfectBuilds(
        TEXT, (Axis("stage.test.wires.d", (0.001, 0.002, 0.004)), *AXES), question()
    ),
    "blades": on_blades,
    "beam": lambda: ImperfectBuilds(TRIPLE_FILE.read_text(), AXES, question(TRIPLE), level="beam"),
    "violin": lossy_at_high_frequencies,
    "designs": over_designs,
    "random": lambda: builds_at_random(81),
}
"""Sweeps of every kind of matrix."""


@pytest.mark.parametrize("kind", JOBS)
def test_a_build_alone_gives_the_same_result(kind):
    """But for rounding; in this process and, as far as that takes a pickled job, in another."""
    job = JOBS[kind]()
    sent = pickle.loads(pickle.dumps(job))
    found = job.compute(0, job.count)
    for start, stop in [(0, 1), (1, 3), (25, 64), (job.count - 1, job.count)]:
        alone = sent.compute(start, stop)
        for name, values in found.items():
            if name == "residual":
                assert np.abs(alone[name] - values[start:stop]).max() < 1e-11
            elif values.dtype.kind in "fc":
                size = np.abs(np.nan_to_num(values)).max(initial=0.0)
                expected = values[start:stop]
                np.testing.assert_allclose(alone[name], expected, rtol=1e-9, atol=1e-12 * size)
            else:
                assert np.array_equal(alone[name], values[start:stop]), name
    again = sent.compute(0, job.count)
    assert all(again[name].tobytes() == values.tobytes() for name, values in found.items())


def reference(folder, count):
    """The file that an uninterrupted run writes."""
    path = folder / "whole.h5"
    counting_sweep.run(counting_sweep.Toy(count, str(folder / "whole.log")), path)
    return path.read_bytes()


def keep(path, folder):
    """Copy the folder of an unfinished run."""
    part = counting_sweep.part(path)
    shutil.copytree(part, folder / part.name)


@settings(deadline=None, max_examples=25)
@given(st.integers(1, 900), st.integers(0, 899), st.sampled_from([64, 100]), st.booleans())
def test_resume_after_a_kill(count, fails, chunk, power_cut):
    """What lies on the disk at any moment can be taken up; points that a power cut damaged are
    computed again."""
    with tempfile.TemporaryDirectory() as name:
        folder, fails = Path(name), fails % count
        path, left = folder / "toy.h5", folder / "left"

        class Killed(counting_sweep.Toy):
            def compute(self, start, stop):
                if start <= self.fails < stop:
                    left.mkdir()
                    keep(path, left)
                    if Path(self.log).exists():
                        shutil.copy(self.log, left)
                return super().compute(start, stop)

        with pytest.raises(RuntimeError):
            counting_sweep.run(Killed(count, str(folder / "log"), fails), path, chunk=chunk)
        job = counting_sweep.Toy(count, str(left / "log"))
        done = job.computed() == 1
        part = counting_sweep.part(left / "toy.h5")
        assert np.array_equal(counting_sweep.finished(part, count), done)
        lost = np.zeros(count, dtype=bool)
        if power_cut and done.any():
            counting_sweep.damage(part)
            lost[:chunk] = True
        counting_sweep.run(job, left / "toy.h5", chunk=chunk, resume=True)
        assert np.array_equal(job.computed() == 2, done & lost)
        assert job.computed().min() == 1
        assert (left / "toy.h5").read_bytes() == reference(folder, count)


@pytest.mark.parametrize("pays", [False, True])
def test_processes_start_where_they_pay(pays, tmp_path, monkeypatch):
    """The same bytes either way; a short sweep starts none, however many cores there are."""
    started, on_processes = [], batch._on_processes
    monkeypatch.setattr(batch, "_on_processes", lambda *a: started.append(a) or on_processes(*a))
    monkeypatch.setattr(batch.os, "cpu_count", lambda: 2)
    if pays:
        monkeypatch.setattr(batch, "STARTUP", 0.0)
    job = counting_sweep.Toy(64 * 11 - 10, str(tmp_path / "log"))
    counting_sweep.run(job, tmp_path / "toy.h5", chunk=64, workers=None)
    assert len(started) == pays
    assert (job.computed() == 1).all()
    assert (tmp_path / "toy.h5").read_bytes() == reference(tmp_path, job.count)


@pytest.mark.parametrize("dies", [False, True])
def test_a_worker_that_fails(dies, tmp_path):
    path = tmp_path / "toy.h5"
    job = counting_sweep.Toy(64 * 12, str(tmp_path / "log"), 64 * 7, dies)
    words = "a worker was killed, perhaps out of memory" if dies else "failure on request"
    with pytest.raises(PendsusError if dies else RuntimeError, match=words):
        counting_sweep.run(job, path, chunk=64, workers=2)
    noted = counting_sweep.finished(counting_sweep.part(path), job.count)
    healthy = counting_sweep.Toy(job.count, job.log)
    assert not (noted & (healthy.computed() == 0)).any()
    counting_sweep.run(healthy, path, chunk=64, resume=True)
    assert (healthy.computed()[noted] == 1).all()
    assert healthy.computed().min() == 1
    assert path.read_bytes() == reference(tmp_path, job.count)


def test_starting_anew_forgets_the_interrupted_run(tmp_path):
    """Killed when the first chunk of the new run is computed: no old mark speaks for it."""
    path, left = tmp_path / "toy.h5", tmp_path / "left"
    with pytest.raises(RuntimeError):
        counting_sweep.run(counting_sweep.Toy(500, str(tmp_path / "log"), 400), path, chunk=64)
    assert counting_sweep.finished(counting_sweep.part(path), 500).any()

    class Snapshot(counting_sweep.Toy):
        def compute(self, start, stop):
            if not left.exists():
                left.mkdir()
                keep(path, left)
            return super().compute(start, stop)

    counting_sweep.run(Snapshot(500, str(tmp_path / "again")), path, chunk=64)
    job = counting_sweep.Toy(500, str(left / "log"))
    counting_sweep.run(job, left / "toy.h5", resume=True)
    assert job.computed().min() == 1
    assert (left / "toy.h5").read_bytes() == path.read_bytes() == reference(tmp_path, 500)


def chunks_of_another(part):
    """Chunks of another run, whose job is not known."""
    (part / "job").write_text("prose")


SPOILT = {
    "another design": {"design": "a = 2"},
    "another sweep": {"identity": "another"},
    "another count": {"count": 501},
    "another key": chunks_of_another,
    "a file": lambda part: (shutil.rmtree(part), part.write_text("")),
    "a pipe": lambda part: (shutil.rmtree(part), os.mkfifo(part)),
}


@pytest.mark.parametrize("kind", SPOILT)
def test_resume_of_something_else_is_refused(kind, tmp_path):
    """In one line, and it is left as it is; so it starts only anew."""
    path, log, how = tmp_path / "toy.h5", str(tmp_path / "log"), SPOILT[kind]
    with pytest.raises(RuntimeError):
        counting_sweep.run(counting_sweep.Toy(500, log, 400), path, chunk=64)
    part = counting_sweep.part(path)
    other = dict(how) if isinstance(how, dict) else {}
    if callable(how):
        how(part)
    before = contents(part)
    identity = other.pop("identity", "toy")
    job = counting_sweep.Toy(other.pop("count", 500), log, identity=identity)
    with pytest.raises(InputError) as caught:
        counting_sweep.run(job, path, resume=True, **other)
    (line,) = str(caught.value).splitlines()
    assert contents(part) == before
    if not part.is_dir():
        assert "is no folder of an unfinished run" in line
        return
    assert part.name in line and line.endswith("start anew without --resume")
    counting_sweep.run(counting_sweep.Toy(500, log), path)
    assert path.read_bytes() == reference(tmp_path, 500)


def contents(part):
    """All bytes of a folder; the kind of another path."""
    if not part.is_dir():
        return part.stat().st_mode
    return {file.name: file.read_bytes() for file in part.iterdir()}


@pytest.mark.parametrize("size", [0, 100, -1000])
def test_chunks_that_are_cut_off_are_computed_again(size, tmp_path):
    path, log = tmp_path / "toy.h5", str(tmp_path / "log")
    with pytest.raises(RuntimeError):
        counting_sweep.run(counting_sweep.Toy(500, log, 400), path, chunk=64)
    file = counting_sweep.part(path) / "64.chunk"
    os.truncate(file, size if size >= 0 else file.stat().st_size + size)
    job = counting_sweep.Toy(500, log)
    counting_sweep.run(job, path, chunk=64, resume=True)
    assert (job.computed() == 1 + (np.arange(500) // 64 == 1)).all()
    assert path.read_bytes() == reference(tmp_path, 500)


@pytest.fixture(scope="module")
def broken_off(tmp_path_factory):
    """An unfinished run of 150 points with two chunks, and the file of the whole run."""
    folder = tmp_path_factory.mktemp("broken-off")
    path = folder / "toy.h5"
    with pytest.raises(RuntimeError):
        counting_sweep.run(counting_sweep.Toy(150, str(folder / "log"), 140), path, chunk=64)
    return path, reference(folder, 150)


def test_no_bit_of_a_chunk_may_change(broken_off):
    """Every single bit, in the head and in the numbers, is noticed."""
    part = counting_sweep.part(broken_off[0])
    key, content = (part / batch.KEY).read_text(), (part / "0.chunk").read_bytes()
    assert chunks.decode(content, key, 0, 150) is not None
    spoilt = bytearray(content)
    for bit in range(8 * len(content)):
        spoilt[bit // 8] ^= 1 << bit % 8
        assert chunks.decode(bytes(spoilt), key, 0, 150) is None, bit
        spoilt[bit // 8] ^= 1 << bit % 8


def saved(array):
    """Bytes of a file of numpy."""
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


CHUNKS = {
    "empty": lambda _: b"",
    "cut off": lambda content: content[:-1],
    "longer": lambda content: content + b"\0",
    "a file of numpy": lambda _: saved(np.arange(64)),
    "a pickle": lambda _: pickle.dumps(np.arange(64)),
}


@pytest.mark.parametrize("kind", [*CHUNKS, *range(0, 30_000, 613)])
def test_resume_with_a_damaged_chunk_gives_the_same_file(kind, broken_off, tmp_path):
    """Its points are computed again, and no others."""
    keep(broken_off[0], tmp_path)
    path, job = tmp_path / "toy.h5", counting_sweep.Toy(150, str(tmp_path / "log"))
    file = counting_sweep.part(path) / "0.chunk"
    if isinstance(kind, str):
        file.write_bytes(CHUNKS[kind](file.read_bytes()))
    else:
        counting_sweep.flip(file, kind % (8 * file.stat().st_size))
    counting_sweep.run(job, path, chunk=64, resume=True)
    assert path.read_bytes() == broken_off[1]
    assert (job.computed() == ~(np.arange(150) // 64 == 1)).all()


@pytest.mark.parametrize("name", ["64.chunk", "128.chunk", "00.chunk", "x.chunk", "-1.chunk"])
def test_a_chunk_under_another_name_is_not_taken(name, broken_off, tmp_path):
    keep(broken_off[0], tmp_path)
    path = tmp_path / "toy.h5"
    part = counting_sweep.part(path)
    (part / "0.chunk").rename(part / name)
    counting_sweep.run(counting_sweep.Toy(150, str(tmp_path / "log")), path, resume=True)
    assert path.read_bytes() == broken_off[1]


@pytest.mark.parametrize(
    ("head", "numbers"),
    [
        (b"[]", b""),
        (b"prose", b""),
        (b'[{"name":"x","dtype":"O","shape":[1]}]', bytes(8)),
        (b'[{"name":"x","dtype":"<f8","shape":[]}]', bytes(8)),
        (b'[{"name":"x","dtype":"<f8","shape":[-1]}]', bytes(8)),
        (b'[{"name":"x","dtype":"<f8","shape":[4611686018427387904]}]', bytes(8)),
        (b'[{"name":"x","dtype":"<f8","shape":[2]}]', bytes(8)),
        (b'[{"name":"x","dtype":"<f8","shape":[1]}]', bytes(16)),
        (b'[{"name":"x","dtype":"prose","shape":[1]}]', bytes(8)),
        (b'[{"name":"x","dtype":"<f8","shape":[151]}]', bytes(8 * 151)),
    ],
)
def test_a_layout_that_does_not_fit_is_not_taken(head, numbers, broken_off, tmp_path):
    """Also where the digest is right: its points are computed again."""
    keep(broken_off[0], tmp_path)
    path = tmp_path / "toy.h5"
    part = counting_sweep.part(path)
    content = head + b"\n" + numbers
    digest = chunks._digest((part / batch.KEY).read_text(), 0, content)
    (part / "0.chunk").write_bytes(digest + content)
    counting_sweep.run(counting_sweep.Toy(150, str(tmp_path / "log")), path, resume=True)
    assert path.read_bytes() == broken_off[1]


def test_chunks_hold_numbers_alone(tmp_path):
    with pytest.raises(TypeError, match="text holds no numbers"):
        chunks.write(tmp_path / "0.chunk", "", 0, {"text": np.array(["a"])})


def test_two_runs_do_not_write_one_file(tmp_path):
    path = tmp_path / "toy.h5"

    class Rival(counting_sweep.Toy):
        def compute(self, start, stop):
            with pytest.raises(InputError, match="another run is writing this file"):
                counting_sweep.run(counting_sweep.Toy(100, self.log), path)
            return super().compute(start, stop)

    counting_sweep.run(Rival(300, str(tmp_path / "log")), path, chunk=64)
    assert path.read_bytes() == reference(tmp_path, 300)


def test_chunks_leave_no_systems_behind(tmp_path):
    """Their matrices would fill the memory: a million builds took gigabytes."""

    def alive():
        return sum(isinstance(one, LinearSystem) for one in gc.get_objects())

    gc.collect()
    before = alive()
    gc.disable()  # the collector comes when it has counted enough objects, large or small
    try:
        written_by(tmp_path, 1, 64, "xcouple", FILE, *GRID, "--fidelity", "string")
        assert alive() - before < 7  # chunks
    finally:
        gc.enable()
