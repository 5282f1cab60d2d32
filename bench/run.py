"""What things cost, each as a ratio to a floor measured in the same run: `make bench`.

Machines are shared and noisy, so every line is a ratio of medians over interleaved repetitions, with the
spread of that ratio, beside the limit that we hold ourselves to.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

Work = Callable[[], object]


def interleaved(works: list[Work], repetitions: int) -> list[list[float]]:
    """Seconds of every repetition of each work, taking turns so that drifts hit all alike; each runs once untimed before."""
    times: list[list[float]] = [[] for _ in works]
    for _ in range(repetitions):
        for work, row in zip(works, times, strict=True):
            work()
            start = time.perf_counter()
            work()
            row.append(time.perf_counter() - start)
    return times


over: list[str] = []
"""What was over its limit."""


def ratio(name: str, work: Work, floor: Work, limit: float, repetitions: int = 7) -> None:
    """Print the ratio of a work to its floor."""
    ours, base = interleaved([work, floor], repetitions)
    ratios = sorted(a / b for a, b in zip(ours, base, strict=True))
    middle = statistics.median(ours) / statistics.median(base)
    verdict = judged(name, middle, limit)
    print(f"{verdict}  {name:62} {middle:6.3f} x  (limit {limit:g}, range {ratios[0]:.2f} to {ratios[-1]:.2f}; {statistics.median(ours) * 1e3:.3g} ms)")


def absolute(name: str, work: Work, limit: float, repetitions: int = 51) -> None:
    """Print the median time of a work in ms."""
    (ours,) = interleaved([work], repetitions)
    middle = statistics.median(ours) * 1e3
    print(f"{judged(name, middle, limit)}  {name:62} {middle:6.2f} ms (limit {limit:g}, fastest {min(ours) * 1e3:.2f})")


def judged(name: str, value: float, limit: float) -> str:
    """Good or over, and remembered."""
    if value <= limit:
        return "good"
    over.append(name)
    return "OVER"


def shell(*command: str) -> Work:
    """A work that runs a process."""
    return lambda: subprocess.run(command, check=True, capture_output=True)


def main() -> None:
    """Run every benchmark."""
    import responses
    import startup
    import stiffness
    import sweeps
    import thermal

    stiffness.run(ratio, absolute)
    responses.run(ratio, absolute)
    thermal.run(ratio, absolute)
    startup.run(ratio, shell)
    sweeps.run(ratio, absolute, judged)
    if over:
        sys.exit("over: " + "; ".join(over))


if __name__ == "__main__":
    main()
