"""Cost and error of many designs at once: maps, random builds, and how cost grows."""

from __future__ import annotations

import platform
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import scipy

import suspension_cli as sus
from bench.sweeps import BUILDS, RANDOM, SINGLE, TRIPLE, coupling_question, sweep
from suspension_cli.analyses.tolerance.solve import RandomBuilds
from suspension_cli.analyses.tradeoff.measure import median_times
from suspension_cli.analyses.xcouple.imperfect_builds import ImperfectBuilds
from suspension_cli.conventions import BUILDS_AT_ONCE
from suspension_cli.design.derive import mirror
from suspension_cli.design.reader import parse, read
from suspension_cli.linear import eigenmodes, response, signals
from suspension_cli.models import registry
from suspension_cli.studies.chebyshev import Surface
from suspension_cli.studies.job import Axis
from tests.support.paths import ROOT
from tools.chebyshev_grid import surface_of
from tools.tradeoff.measurement import Measurement

MILLION = 1_000_000
MAP = "map of a million points"
INTERPOLATED, EVERY_POINT, ALONE = "interpolated", "every point", "one design at a time"
INTERVALS = (2, 4, 8, 16, 32)
"""Intervals between Chebyshev points along each axis of a map."""
COMPARED = 64
"""Random points of a map at which it is compared with full solutions."""
K = (0.6, 1.4)
OFFSET = (-2e-3, 2e-3)
"""Ranges of a map: factor on the stiffness of a wire, and offset of its end, m."""
DESIGNS_ALONE = 20
"""Designs of the loop that solves one at a time."""
MEAN = "mean coupling of random builds"
PLAIN, CONTROLLED = "solved builds alone", "with control variates"
RANDOM_BUILDS = (512, 2_048, 8_192, 32_768)
GROWTH = "growth of cost"
CHAINS = (5, 10, 20, 50, 100)
"""Numbers of stages of a chain."""
FREQUENCIES = (100, 1_000, 10_000, 100_000)
POINTS = (1_000, 10_000, 100_000, MILLION)
START = "start of the program"


def elapsed(work: Callable[[], Any]) -> float:
    """Measure the processor time of a function once, s."""
    begin = time.process_time()
    work()
    return time.process_time() - begin


def map_of(source: Any, points: int) -> ImperfectBuilds:
    """Builds over a square grid of k and offset of a wire."""
    side = round(points**0.5)
    axes = (
        Axis("k", tuple(np.linspace(*K, side))),
        Axis("offset", tuple(np.linspace(*OFFSET, side))),
    )
    return replace(sweep(source), axes=axes)


def interpolate(job: ImperfectBuilds, intervals: int) -> Surface:
    """Interpolate a map from so many intervals along each axis."""
    return surface_of(job.axes, job.sample, intervals)


def evaluate(job: ImperfectBuilds, surface: Surface) -> None:
    """Evaluate a map at all its points, by rows."""
    first, second = (np.array(axis.values) for axis in job.axes)
    for start in range(0, len(first), 50):
        grid = surface.on_grid([first[start : start + 50], second])
        job.columns_of(grid.reshape(-1, grid.shape[-1]))


def solve_all(job: Any) -> None:
    """Compute all builds or points of a job, in chunks."""
    for start in range(0, job.count, BUILDS_AT_ONCE):
        job.compute(start, min(start + BUILDS_AT_ONCE, job.count))


def measure_map(file: Path) -> list[Measurement]:
    """Measure time and error of a map of a million points from few of them.

    The times of a million full solutions are in proportion to those of some thousand, and of some
    twenty, one design at a time.
    """
    job = map_of(file, MILLION)
    name = read(file).design.design.name
    rng = np.random.default_rng(3)
    k, offset = rng.uniform(*K, COMPARED), rng.uniform(*OFFSET, COMPARED)
    exact = job.compute_at({"k": k, "offset": offset})["ratio"]
    size = np.maximum(np.abs(exact), 1e-4 * np.abs(exact).max())
    rows: list[Measurement] = []
    for intervals in INTERVALS:
        surface = interpolate(job, intervals)
        mine = job.columns_of(surface.at(np.stack([k, offset], axis=1)))["ratio"]
        error = float((np.abs(mine - exact) / size).max())
        taken = elapsed(lambda n=intervals: evaluate(job, interpolate(job, n)))
        rows.append(Measurement(MAP, name, INTERPOLATED, surface.points, taken, error))
    chunk = map_of(file, BUILDS)
    full = elapsed(lambda: chunk.compute(0, chunk.count)) / chunk.count
    one = elapsed(lambda: [chunk.compute(n, n + 1) for n in range(DESIGNS_ALONE)]) / DESIGNS_ALONE
    rows.append(Measurement(MAP, name, EVERY_POINT, MILLION, full * MILLION, None))
    rows.append(Measurement(MAP, name, ALONE, MILLION, one * MILLION, None))
    return rows


def measure_builds() -> list[Measurement]:
    """Measure times, and standard errors relative to the mean, of random builds."""
    source = read(RANDOM)
    names = tuple(stage.name for stage in source.design.stage)
    name = source.design.design.name
    rows: list[Measurement] = []
    for count in RANDOM_BUILDS:
        job = RandomBuilds(source.text, count, 7, coupling_question(names, 0), level="string")
        plain = elapsed(lambda job=job: solve_all(job))
        begin = time.process_time()
        found = sus.tolerance(str(RANDOM), builds=count, seed=7, fidelity="string").coupling
        controlled = time.process_time() - begin
        plain_error = float(found.deviation / count**0.5 / found.mean)
        rows.append(Measurement(MEAN, name, PLAIN, count, plain, plain_error))
        error = float(found.error / found.mean)
        rows.append(Measurement(MEAN, name, CONTROLLED, count, controlled, error))
    return rows


def chain(stages: int) -> str:
    """Write the design file of a chain of equal bodies, on four wires each."""
    text = ['[design]\nname = "chain"\n']
    for n in range(stages):
        radius = 2e-4 * (stages - n) ** 0.5  # equal stress
        text.append(
            f'[[stage]]\nname = "s{n}"\n'
            'body = { shape = "box", size = [0.2, 0.2, 0.1], mass = 10.0 }\n'
            "wires = { count = 4, l = 0.4, s = 0.04, t1 = 0.06, t2 = 0.06, d = 0.002,"
            f' material = "c70steel", radius = {radius!r} }}\n'
        )
    return "\n".join(text)


def measure_growth() -> list[Measurement]:
    """Measure how the cost of work grows with its size; `design` is the unit of the size."""
    source = read(RANDOM)
    names = tuple(stage.name for stage in source.design.stage)
    question = coupling_question(names, 0)

    def maps(count: int) -> Callable[[], Any]:
        job = map_of(TRIPLE, count)
        return lambda: evaluate(job, interpolate(job, 16))

    def every_point(count: int) -> Callable[[], Any]:
        job = map_of(TRIPLE, count)
        return lambda: solve_all(job)

    def random(count: int) -> Callable[[], Any]:
        job = RandomBuilds(source.text, count, 7, question, level="string")
        return lambda: solve_all(job)

    def modes(stages: int) -> Callable[[], Any]:
        design = parse(chain(stages))
        return lambda: eigenmodes.solve(registry.STRING.system(design))

    def spectrum(count: int) -> Callable[[], Any]:
        design = read(ROOT / "configs" / "quadruple.toml").design
        model = registry.VIOLIN.system(design)
        known = signals.bodies_with_signals(model)
        ends = (
            [signals.parse_input("support.x", known)],
            [signals.parse_output(f"{mirror(design)}.x", known)],
        )
        return lambda: response.solve(model, np.geomspace(0.1, 1000.0, count), *ends)

    rows: list[Measurement] = []
    for name, unit, sizes, make in (
        ("map", "points", POINTS, maps),
        ("map, each point", "points", POINTS[:2], every_point),
        ("random builds", "builds", RANDOM_BUILDS, random),
        ("modes of a chain", "stages", CHAINS, modes),
        ("response", "frequencies", FREQUENCIES, spectrum),
    ):
        print(name, file=sys.stderr)
        for size in sizes:
            [taken] = median_times([make(size)])
            rows.append(Measurement(GROWTH, unit, name, size, taken, None))
    return rows


def measure_start() -> Measurement:
    """Measure the processor time of the program's start; `method` says on what."""
    words = "import time; import suspension_cli.cli.main, numpy, scipy.linalg, h5py"
    line = f"{words}; print(time.process_time())"
    times = []
    for _ in range(3):
        done = subprocess.run(
            [sys.executable, "-c", line], check=True, capture_output=True, text=True
        )
        times.append(float(done.stdout))
    machine = f"{platform.machine()}, Python {platform.python_version()}"
    versions = f"{machine}, numpy {np.__version__}, scipy {scipy.__version__}"
    return Measurement(START, "", versions, 0, min(times), None)


def measure_all() -> list[Measurement]:
    """Measure maps, random builds, growth of cost and the start of the program."""
    maps = [row for file in (SINGLE, TRIPLE) for row in measure_map(file)]
    return [*maps, *measure_builds(), *measure_growth(), measure_start()]
