"""Run the benchmarks: times as ratios to a floor measured in the same run (`make bench`).

Machines are shared and noisy, so each line is a ratio of medians over interleaved repetitions, with
the range of that ratio and its limit. Times are processor times, of finished child processes too.
"""

from __future__ import annotations

import os
import resource
import statistics
import subprocess
import sys
import time
from collections.abc import Callable

Work = Callable[[], object]


def interleaved(works: list[Work], repetitions: int) -> list[list[float]]:
    """Time works in turns, so that drifts affect all equally: seconds of each repetition.

    Each repetition is preceded by an untimed run.
    """
    times: list[list[float]] = [[] for _ in works]
    for _ in range(repetitions):
        for work, row in zip(works, times, strict=True):
            work()
            start = processor_time()
            work()
            row.append(processor_time() - start)
    return times


def processor_time() -> float:
    """Processor time of this process and of its finished children, s."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


over: list[str] = []
"""Names of the works over their limits."""


def ratio(name: str, work: Work, floor: Work, limit: float, repetitions: int = 7) -> None:
    """Print the ratio of the time of a work to that of its floor."""
    ours, base = interleaved([work, floor], repetitions)
    ratios = sorted(a / b for a, b in zip(ours, base, strict=True))
    middle = statistics.median(ours) / statistics.median(base)
    verdict = judge(name, middle, limit)
    print(
        f"{verdict}  {name:62} {middle:6.3f} x  (limit {limit:g}, range {ratios[0]:.2f} to"
        f" {ratios[-1]:.2f}; {statistics.median(ours) * 1e3:.3g} ms)"
    )


def absolute(name: str, work: Work, limit: float, repetitions: int = 51) -> None:
    """Print the median time of a work in ms."""
    (ours,) = interleaved([work], repetitions)
    middle = statistics.median(ours) * 1e3
    print(
        f"{judge(name, middle, limit)}  {name:62} {middle:6.2f} ms (limit {limit:g}, fastest"
        f" {min(ours) * 1e3:.2f})"
    )


def judge(name: str, value: float, limit: float) -> str:
    """Compare a value with its limit; record the name if it is over."""
    if value <= limit:
        return "good"
    over.append(name)
    return "OVER"


def shell(*command: str) -> Work:
    """Make a work that runs a process, with compiled modules kept as pip leaves them."""
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    return lambda: subprocess.run(command, check=True, capture_output=True, env=environment)


def main() -> None:
    """Run every benchmark."""
    from bench import large, responses, startup, stiffness, sweeps, thermal

    stiffness.run(ratio)
    responses.run(ratio, absolute)
    thermal.run(ratio, absolute)
    large.run(ratio)
    startup.run(ratio, shell)
    sweeps.run(ratio, absolute, judge)
    if over:
        sys.exit("over: " + "; ".join(over))


if __name__ == "__main__":
    main()
