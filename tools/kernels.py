"""Run the tests under each OpenBLAS kernel of this processor, with one and two threads.

Kernels add in different orders, so their results differ in the last digits; no test may depend on
these. Run by `make test-kernels`.
"""

from __future__ import annotations

import os
import subprocess
import sys

KERNELS = ("Prescott", "Nehalem", "Haswell", "SkylakeX", "Zen")
THREADS = (1, 2)
PROBE = "import numpy; numpy.linalg.solve(numpy.eye(64) + numpy.ones((64, 64)), numpy.ones(64))"


def environment(kernel: str, threads: int) -> dict[str, str]:
    """Environment variables for one kernel and number of threads."""
    return os.environ | {
        "OPENBLAS_CORETYPE": kernel,
        "OPENBLAS_NUM_THREADS": str(threads),
        "OMP_NUM_THREADS": str(threads),
    }


def runs(kernel: str) -> bool:
    """Whether the library has a kernel and this processor supports it."""
    probe = subprocess.run(
        [sys.executable, "-c", PROBE],
        env=environment(kernel, 1) | {"OPENBLAS_VERBOSE": "2"},
        capture_output=True,
        text=True,
        check=False,
    )
    return probe.returncode == 0 and "Core not found" not in probe.stdout + probe.stderr


def main() -> None:
    """Run the tests under each kernel in turn; arguments are passed to pytest."""
    failed = []
    for kernel in KERNELS:
        if not runs(kernel):
            print(f"{kernel}: not on this processor", flush=True)
            continue
        for threads in THREADS:
            print(f"{kernel}, {threads} thread{'s' * (threads > 1)}", flush=True)
            done = subprocess.run(
                [sys.executable, "-m", "pytest", "-n", "auto", "--dist", "loadfile", *sys.argv[1:]],
                env=environment(kernel, threads),
                check=False,
            )
            if done.returncode:
                failed.append(f"{kernel} with {threads}")
    if failed:
        sys.exit("failed: " + "; ".join(failed))


if __name__ == "__main__":
    main()
