"""Sweeps on a Dask cluster: the same file, and one line where there is no cluster."""

from __future__ import annotations

import contextlib
import os
import re
import shlex
import shutil
import socket
import subprocess
import sys
import time

import numpy as np
import pytest

from suspension_cli.errors import PendsusError
from suspension_cli.studies import run as batch
from tests.support import counting_sweep
from tests.support.commandline import process, run
from tests.support.couplings import FILE
from tests.support.paths import ROOT

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
    noted = counting_sweep.finished(counting_sweep.part(tmp_path / "toy.h5"), job.count)
    before = job.computed()
    healthy = counting_sweep.Toy(job.count, job.log)
    counting_sweep.run(healthy, tmp_path / "toy.h5", chunk=64, scheduler=scheduler, resume=True)
    assert np.array_equal(healthy.computed()[noted], before[noted])
    assert healthy.computed().min() == 1


def test_a_scheduler_without_workers(monkeypatch, tmp_path):
    monkeypatch.setattr(batch, "PATIENCE", 0.5)
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
    assert (
        counting_sweep.finished(counting_sweep.part(tmp_path / "toy.h5"), job.count).sum()
        >= 64 * 50
    )
    counting_sweep.run(job, tmp_path / "toy.h5", resume=True)
    assert job.computed().min() == 1


def test_all_workers_are_lost(monkeypatch, tmp_path):
    """The scheduler stays, and would wait for others for ever."""
    monkeypatch.setattr(batch, "PATIENCE", 1.0)
    monkeypatch.setattr(batch, "EVERY", 0.1)
    job = counting_sweep.Toy(64 * 2000, str(tmp_path / "log"))
    path = tmp_path / "toy.h5"
    with local(1) as made:

        def close(done, _all, _rate):
            if done == 64 * 50:
                made.loop.add_callback(made.workers[0].close)

        # or results on their way from the worker are, if it ends just then
        words = r"^(all workers of the cluster were lost|.*lost results).* --resume$"
        with pytest.raises(PendsusError, match=words):
            counting_sweep.run(
                job, path, chunk=64, scheduler=made.scheduler_address, progress=close
            )
    assert counting_sweep.finished(counting_sweep.part(path), job.count).sum() >= 64 * 50
    counting_sweep.run(job, path, resume=True)
    assert job.computed().min() == 1


def test_a_slow_cluster_is_not_lost(monkeypatch, tmp_path):
    """Chunks may take longer than it is waited for workers."""
    path, job = tmp_path / "toy.h5", Slow(3, str(tmp_path / "log"))

    def hurry(_done, _all, _rate):
        monkeypatch.setattr(batch, "PATIENCE", 0.05)
        monkeypatch.setattr(batch, "EVERY", 0.02)

    with local(1) as made:
        address = made.scheduler_address
        counting_sweep.run(job, path, chunk=1, scheduler=address, progress=hurry)
    assert (job.computed() == 1).all()


class Slow(counting_sweep.Toy):
    """Points that take longer than it is waited for workers."""

    def compute(self, start, stop):
        time.sleep(0.2)
        return super().compute(start, stop)


def quoted():
    """Commands of docs/examples/cluster.md: certificate, scheduler, worker; keys; and pendsus."""
    page = (ROOT / "docs" / "examples" / "cluster.md").read_text()
    lines = "".join(re.findall(r"^```bash\n(.*?)^```", page, re.MULTILINE | re.DOTALL)).splitlines()
    *commands, _ = (shlex.split(line) for line in lines if not line.startswith("export "))
    keys = dict(line.removeprefix("export ").split("=") for line in lines if "export " in line)
    return commands, keys, shlex.split(lines[-1])


@pytest.fixture(scope="module")
def encrypted(tmp_path_factory):
    """A cluster with TLS on the loopback address, made by the commands that the page shows."""
    (certificate, scheduler, worker), keys, _ = quoted()
    folder = tmp_path_factory.mktemp("tls")
    with socket.create_server(("127.0.0.1", 0)) as free:
        address = f"tls://127.0.0.1:{free.getsockname()[1]}"
    if shutil.which(certificate[0]) is None:
        pytest.skip("openssl is not installed")
    subprocess.run(certificate, cwd=folder, check=True, capture_output=True)
    scheduler[:1] = worker[:1] = [sys.executable, "-m", "dask"]
    scheduler += ["--host", address, "--dashboard-address", "127.0.0.1:0"]
    worker = [word.replace("tls://that-machine:8786", address) for word in worker]
    worker[worker.index("auto")] = "1"
    worker += ["--host", "127.0.0.1", "--no-dashboard", "--death-timeout", "60"]
    with contextlib.ExitStack() as stack:
        log = folder / "log"
        stream = stack.enter_context(log.open("w"))
        for words in (scheduler, worker):
            made = subprocess.Popen(words, cwd=folder, stdout=stream, stderr=stream)
            stack.callback(made.wait, 30)
            stack.callback(made.terminate)
        for _ in range(600):
            if "Registered to" in log.read_text():
                break
            time.sleep(0.1)
        else:
            pytest.fail(log.read_text())
        yield address, {name: str(folder / file) for name, file in keys.items()}


def test_the_tls_commands_of_the_page_work(encrypted, tmp_path):
    address, keys = encrypted
    assert quoted()[2][-2:] == ["--scheduler", "tls://that-machine:8786"]
    alone = process("xcouple", FILE, *GRID, "--workers", "1", "--out", tmp_path / "one")
    assert alone.returncode == 0
    words = ("xcouple", str(FILE), *GRID, "--scheduler", address, "--out", str(tmp_path / "many"))
    command = [sys.executable, "-m", "suspension_cli", *words]
    done = subprocess.run(command, env=os.environ | keys, capture_output=True, timeout=120)
    assert (done.returncode, done.stderr) == (0, b"")
    [one], [many] = ((tmp_path / out).iterdir() for out in ("one", "many"))
    assert one.read_bytes() == many.read_bytes()


@pytest.mark.parametrize("scheme", ["tls", "tcp"])
def test_nobody_without_the_key_is_let_in(scheme, encrypted, monkeypatch, tmp_path):
    monkeypatch.setattr(batch, "PATIENCE", 2.0)
    address = encrypted[0].replace("tls", scheme)
    done = run("xcouple", FILE, *GRID, "--scheduler", address, "--out", tmp_path)
    assert done.exit_code == 2 and not list(tmp_path.iterdir())
    [line] = done.stderr.splitlines()
    assert line.startswith(f'{FILE}: --scheduler = "{address}": does not answer (')
    assert ("docs/examples/cluster.md" in line) == (scheme == "tls")


SILENT = {
    "tcp://127.0.0.1:9": False,
    "nonsense": False,
    "": False,
    "tcp://192.0.2.1:8786": True,  # an address for documentation, of no machine
    "tcp://[2001:db8::1]:8786": True,
    "tls://192.0.2.1:8786": False,
    "tcp://localhost:9": False,
    f"tcp://{socket.gethostname()}:9": False,
}
"""Addresses at which nobody answers; whether what is sent there could be read by others."""


@pytest.mark.parametrize("address", SILENT)
def test_nobody_answers(address, monkeypatch, tmp_path):
    """One line, after a warning of a scheduler elsewhere without TLS."""
    monkeypatch.setattr(batch, "PATIENCE", 0.2)
    done = run("xcouple", FILE, *GRID, "--scheduler", address, "--out", tmp_path)
    assert done.exit_code == 2 and list(tmp_path.iterdir()) == []
    *warned, line = done.stderr.splitlines()
    assert line.startswith(f'{FILE}: --scheduler = "{address}": does not answer (')
    if not address.startswith("tls"):
        assert line.endswith("; start `dask scheduler` and `dask worker`, and give its address")
    warning = f"warning: --scheduler {address} has no TLS: "
    assert [warning in one for one in warned] == [True] * SILENT[address]


def test_without_dask(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "distributed", None)
    result = run("xcouple", FILE, *GRID, "--scheduler", "tcp://127.0.0.1:9", "--out", tmp_path)
    assert result.exit_code == 2
    assert (
        result.stderr == f'{FILE}: --scheduler = "tcp://127.0.0.1:9": needs Dask;'
        " pip install 'pendsus[cluster]'\n"
    )
