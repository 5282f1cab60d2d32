"""Sweeps of imperfect builds: time per build, gain by a second process, and memory."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from suspension_cli.analyses.tolerance.solve import RandomBuilds
from suspension_cli.analyses.xcouple.imperfect_builds import ImperfectBuilds
from suspension_cli.conventions import BUILDS_AT_ONCE
from suspension_cli.design.reader import read
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.linear import signals
from suspension_cli.physics.couplings import CouplingRequest
from suspension_cli.studies.job import Axis

CONFIGS = Path(__file__).parent.parent / "configs"
SINGLE, TRIPLE, RANDOM = (
    CONFIGS / "husman2000" / "figure6.toml",
    CONFIGS / "husman2000" / "table2.toml",
    CONFIGS / "triple-tolerance.toml",
)
BUILDS = 4 * BUILDS_AT_ONCE
GRID = {
    10_000: "k=0.6:1.4:100,offset=-2e-3:2e-3:100",
    200_000: "k=0.6:1.4:500,offset=-2e-3:2e-3:400",
    1_000_000: "k=0.6:1.4:1000,offset=-2e-3:2e-3:1000",
}
TIMED = 200_000
"""Builds of the runs that are timed."""
MAIN = "from suspension_cli.cli.main import main; main(prog_name='pendsus', standalone_mode=False)"
MEMORY = (
    f"{MAIN}; import resource as r; print('peak', *(r.getrusage(who).ru_maxrss // 1024 for who in"
    " (r.RUSAGE_SELF, r.RUSAGE_CHILDREN)))"
)
FLAT = 100
"""Largest growth of peak memory from ten thousand points to a million, MB."""


def coupling_question(names: tuple[str, ...], wire: int) -> CouplingRequest:
    """Coupling x over z of the last stage at 50 Hz."""
    known = ("support", *names)
    over, under = (signals.parse_output(f"{known[-1]}.{dof}@0,0,-0.001", known) for dof in "xz")
    return CouplingRequest(
        wire,
        len(names),
        "loaded-length",
        signals.parse_input("support.z", known),
        over,
        under,
        (50.0,),
    )


def sweep(file: Path) -> ImperfectBuilds:
    """Builds over k and offset of the first wire of the last stage."""
    source = read(file)
    scene = expand(source.design)
    wire = scene.wires.label.index(f"{scene.bodies.name[-1]}.1")
    axes = (
        Axis("k", tuple(np.linspace(0.6, 1.4, 60))),
        Axis("offset", tuple(np.linspace(-2e-3, 2e-3, BUILDS // 60))),
    )
    return ImperfectBuilds(source.text, axes, coupling_question(scene.bodies.name, wire))


def compute_all(job: Any) -> Callable[[], object]:
    """Make a work that computes all builds of a job in this process, in chunks."""
    starts = range(0, job.count, BUILDS_AT_ONCE)
    return lambda: [job.compute(start, start + BUILDS_AT_ONCE) for start in starts]


def eigenvalue_floor(size: int, function: Callable[[Any], Any]) -> Callable[[], object]:
    """Build the floor: eigenvalues of as many random symmetric matrices as there are builds."""
    root = np.random.default_rng(0).normal(size=(BUILDS, size, size))
    matrices = root @ np.swapaxes(root, -1, -2)
    return lambda: function(matrices)


def command(folder: str, count: int, workers: int, *, every_point: bool) -> list[str]:
    """List the words of `pendsus xcouple` on the single stage."""
    words = ["xcouple", str(SINGLE), "--sweep", GRID[count], "--no-plot", "-q", "--out", folder]
    words += ["--workers", str(workers)]
    return [*words, "--every-point"] if every_point else words


def seconds(folder: str, workers: int) -> float:
    """Time a whole run of `pendsus xcouple` that solves every point."""
    words = command(folder, TIMED, workers, every_point=True)
    start = time.perf_counter()
    subprocess.run([sys.executable, "-c", MAIN, *words], check=True, capture_output=True)
    return time.perf_counter() - start


def peak(folder: str, count: int, workers: int) -> int:
    """Measure the peak memory of a run, MB: main process plus workers.

    One process interpolates the map; several solve every point, which is what they are for.
    """
    words = command(folder, count, workers, every_point=workers > 1)
    # through a small shell: a process counts the memory of the one that it is forked from
    result = subprocess.run(
        ["sh", "-c", '"$@"; exit $?', "sh", sys.executable, "-c", MEMORY, *words],
        check=True,
        capture_output=True,
        text=True,
    )
    own, worker = map(int, result.stdout.split("peak")[1].split())
    return own + (workers * worker if workers > 1 else 0)


def run(
    ratio: Callable[..., None], absolute: Callable[..., None], judge: Callable[..., str]
) -> None:
    """Time builds on one core and two processes against one; compare the memory of long sweeps."""
    string = sweep(TRIPLE)
    beam, violin = replace(string, level="beam"), replace(string, level="violin")
    single = sweep(SINGLE)
    ratio(
        f"xcouple, single stage, {BUILDS} builds / numpy.linalg.eigvalsh of 6 x 6",
        compute_all(single),
        eigenvalue_floor(6, np.linalg.eigvalsh),
        20.0,
    )
    ratio(
        f"xcouple, triple, string, {BUILDS} builds / numpy.linalg.eigvalsh of 18 x 18",
        compute_all(string),
        eigenvalue_floor(18, np.linalg.eigvalsh),
        5.5,
    )
    ratio(
        f"xcouple, triple, beam, {BUILDS} builds / numpy.linalg.eigvalsh of 18 x 18",
        compute_all(beam),
        eigenvalue_floor(18, np.linalg.eigvalsh),
        12.0,
    )
    ratio(
        f"xcouple, triple, {BUILDS} builds, violin / string",
        compute_all(violin),
        compute_all(string),
        4.0,
    )
    source = read(RANDOM)
    names = tuple(stage.name for stage in source.design.stage)
    for level, limit in (("string", 6.0), ("beam", 9.5)):
        random = RandomBuilds(source.text, BUILDS, 7, coupling_question(names, 0), level=level)
        size = len(random.nominal.omega_squared)
        ratio(
            f"tolerance, triple, {level}, all modes / numpy.linalg.eigh of {size} x {size}",
            compute_all(random),
            eigenvalue_floor(size, np.linalg.eigh),
            limit,
            3,
        )
    with tempfile.TemporaryDirectory() as folder:
        times = [(seconds(folder, 1), seconds(folder, 2)) for _ in range(3)]
        one, two = (min(column) for column in zip(*times, strict=True))
        name = f"pendsus xcouple, {TIMED:,} builds, two processes / one"
        verdict = judge(name, two / one, 1 / 1.7)
        print(
            f"{verdict}  {name:62} {two / one:6.3f} x  (limit 1/1.7; {one / two:.2f} times as fast;"
            f" best of three: {one:.1f} s and {two:.1f} s)"
        )
        for workers in (1, 2):
            small, large = (peak(folder, count, workers) for count in (10_000, 1_000_000))
            name = (
                "pendsus xcouple, peak memory of a million builds less that of ten thousand,"
                f" workers: {workers}"
            )
            print(
                f"{judge(name, large - small, FLAT)}  {name} {large - small:4d} MB (limit {FLAT};"
                f" {small} to {large} MB)"
            )
