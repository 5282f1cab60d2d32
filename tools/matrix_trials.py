"""Coverage of the uncertainties of `pendsus fit --matrices` on simulated measurements.

    python -m tools.matrix_trials [COUNT]

Three sensors and three coils along x on the upper mass of a double pendulum, with gains off by 10 %
and places by 2 mm, at 40 frequencies with 2 % noise. The suspension is that of the design, or built
with clamps off by 0.1 or 0.3 mm and wires by 0.3 or 1 mm.
"""

from __future__ import annotations

import sys

import numpy as np
from scipy import stats

import suspension_cli as sus
from suspension_cli.analyses.fit import matrix_fit
from suspension_cli.errors import InputError
from suspension_cli.studies.response_matrix import Plant
from tests.analyses.fit.test_matrix_fit import exact_responses, simulate, true_matrices

NOISE = 0.02
CLAMPS = {
    "stage.upper.wires.d": 0.002,
    "stage.test.wires.d": 0.001,
    "stage.test.wires.d_upper": 0.001,
}
"""Heights of clamps in the design, m."""
LENGTHS = {"stage.upper.wires.l": 0.30, "stage.test.wires.l": 0.28}
CASES = {"as designed": (0.0, 0.0), "0.1 mm, 0.3 mm": (1e-4, 3e-4), "0.3 mm, 1 mm": (3e-4, 1e-3)}
"""Standard deviations of clamps and lengths, m."""


def main(count: int) -> None:
    """Print a line for each case."""
    design = sus.example("double")
    plant = Plant.of(design.design, "string")
    print("| built with errors | elements in their 95 % | region of all | misfits | refused |")
    print("|---|---|---|---|---|")
    for name, (clamp, length) in CASES.items():
        elements, regions, misfits, refused = [], [], 0, 0
        for seed in range(count):
            random = np.random.default_rng(10_000 + seed)
            change = {key: at + clamp * random.normal() for key, at in CLAMPS.items()}
            change |= {key: at + length * random.normal() for key, at in LENGTHS.items()}
            a, b, data = simulate(seed, NOISE, exact_responses(design.replace(change).design))
            try:
                found = matrix_fit.solve(data, plant)
            except InputError:
                refused += 1
                continue
            record = found.matrices
            pairs = zip((record.sensing, record.driving), true_matrices(a, b), strict=True)
            off = np.concatenate([(one - other).ravel() for one, other in pairs])
            elements.append(np.abs(off) < 1.959964 * np.sqrt(np.diag(record.covariance)))
            unknowns = found.problem.parts[1].stop
            error = (found.z - found.problem.pack(a, b))[:unknowns]
            spread = found.covariance[:unknowns, :unknowns]
            distance = error @ np.linalg.solve(spread, error)
            regions.append(distance < stats.chi2.ppf(0.95, unknowns))
            misfits += found.scale > 1
        print(
            f"| {name} | {100 * np.mean(elements):.1f} % | {sum(regions)} of {len(regions)} |"
            f" {misfits} | {refused} |",
            flush=True,
        )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 200)
