"""Sweeps on a Dask cluster: the same file, and one line where there is no cluster."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from suspension_cli.errors import PendsusError
from suspension_cli.studies import cluster
from tests.support import counting_sweep
from tests.support.commandline import run
from tests.support.couplings import FILE

distributed = pytest.importorskip("distributed")

GRID = ("--sweep", "k=0.6:1.4:31,offset=-2e-3:2e-3:21", "--no-plot", "-q", "--chunk", "64")


def local(workers):
    """A scheduler and workers as threads of this process, spoken to by TCP."""
    return distributed.LocalCluster(
        n_workers=workers,
        threads_per_worker=1,
        processes=False,
        protocol="tcp://",
        host="127.0.0.1",
        dashboard_address="127.0.0.1:0",
        silence_logs=60,
    )


@pytest.fixture(scope="module")
def scheduler():
    """Two workers on this machine."""
    with local(2) as made:
        yield made.scheduler_address


@pytest.mark.parametrize(
    "command",
    [("xcouple", *GRID), ("tolerance", "--builds", "200", "--no-plot", "-q", "--chunk", "64")],
    ids=lambda words: words[0],
)
def test_the_same_file_byte_for_byte(command, scheduler, tmp_path):
    name, *options = command
    file = FILE if name == "xcouple" else FILE.parent.parent / "triple-tolerance.toml"
    for out, how in (("one", ("--workers", "1")), ("many", ("--scheduler", scheduler))):
        result = run(name, file, *options, *how, "--out", tmp_path / out)
        assert result.exit_code == 0, result.stderr
    [one], [many] = ((tmp_path / out).iterdir() for out in ("one", "many"))
    assert one.read_bytes() == many.read_bytes()


@pytest.mark.parametrize("chunks", [1, 7, 8, 9, 30])
def test_every_point_once(chunks, scheduler, tmp_path):
    job = counting_sweep.Toy(64 * chunks - 3, str(tmp_path / "log"))
    counting_sweep.run(job, tmp_path / "toy.h5", chunk=64, scheduler=scheduler)
    assert (job.computed() == 1).all()
    whole = counting_sweep.Toy(job.count, str(tmp_path / "other"))
    counting_sweep.run(whole, tmp_path / "whole.h5")
    assert (tmp_path / "toy.h5").read_bytes() == (tmp_path / "whole.h5").read_bytes()


def test_a_failure_on_the_cluster_is_taken_up(scheduler, tmp_path):
    job = counting_sweep.Toy(64 * 20, str(tmp_path / "log"), 64 * 15)
    with pytest.raises(RuntimeError, match="failure on request"):
        counting_sweep.run(job, tmp_path / "toy.h5", chunk=64, scheduler=scheduler)
    noted = counting_sweep.marked(tmp_path / "toy.h5", job.count)
    before = job.computed()
    healthy = counting_sweep.Toy(job.count, job.log)
    counting_sweep.run(healthy, tmp_path / "toy.h5", chunk=64, scheduler=scheduler, resume=True)
    assert np.array_equal(healthy.computed()[noted], before[noted])
    assert healthy.computed().min() == 1


@pytest.mark.parametrize(
    "address",
    [
        "tcp://127.0.0.1:9",
        "127.0.0.1:9",
        "nonsense",
        "http://127.0.0.1:9",
        "tcp://256.1.1.1:8786",
        "",
    ],
)
def test_nobody_answers(address, monkeypatch, tmp_path):
    monkeypatch.setattr(cluster, "PATIENCE", 0.5)
    result = run("xcouple", FILE, *GRID, "--scheduler", address, "--out", tmp_path)
    assert result.exit_code == 2
    assert result.stderr.count("\n") == 1
    assert result.stderr.startswith(f'--scheduler = "{address}": does not answer (')
    assert result.stderr.endswith(
        "; start `dask scheduler` and `dask worker`, and give its address\n"
    )
    assert list(tmp_path.iterdir()) == []


def test_a_scheduler_without_workers(monkeypatch, tmp_path):
    monkeypatch.setattr(cluster, "PATIENCE", 0.5)
    with local(0) as made:
        result = run(
            "xcouple", FILE, *GRID, "--scheduler", made.scheduler_address, "--out", tmp_path
        )
    assert result.exit_code == 2
    assert result.stderr.endswith("has no workers; start `dask worker` with its address\n")
    assert list(tmp_path.iterdir()) == []


def test_a_scheduler_that_goes_away(tmp_path):
    job = counting_sweep.Toy(64 * 2000, str(tmp_path / "log"))
    import dask

    with dask.config.set({"distributed.comm.timeouts.connect": "1s"}), local(1) as made:

        def close(done, _all, _rate):
            if done == 64 * 50:
                made.loop.add_callback(made.scheduler.close)

        with pytest.raises(
            PendsusError,
            match=r"the connection to the scheduler was lost .* continue with --resume",
        ):
            counting_sweep.run(
                job, tmp_path / "toy.h5", chunk=64, scheduler=made.scheduler_address, progress=close
            )
    assert counting_sweep.marked(tmp_path / "toy.h5", job.count).sum() >= 64 * 50
    counting_sweep.run(job, tmp_path / "toy.h5", resume=True)
    assert job.computed().min() == 1


def test_without_dask(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "distributed", None)
    result = run("xcouple", FILE, *GRID, "--scheduler", "tcp://127.0.0.1:9", "--out", tmp_path)
    assert result.exit_code == 2
    assert (
        result.stderr
        == "--scheduler = \"tcp://127.0.0.1:9\": needs Dask; pip install 'pendsus[cluster]'\n"
    )
