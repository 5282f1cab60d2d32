"""Coverage of the uncertainties of `pendsus fit --matrices` on simulated measurements.

    python -m tools.matrix_trials [COUNT [COUNT_OF_SIX]]

Three sensors and coils along x on the upper mass of a double pendulum, and six of each on that of a
triple (`measured/matrices/`), with gains off by 10 % and places by 2 mm, at 40 frequencies with 2 %
noise. The suspension is that of the design, or built with clamps off by 0.1 or 0.3 mm and wires by
0.3 or 1 mm.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

import suspension_cli as sus
from suspension_cli.analyses.fit import matrix_fit
from suspension_cli.analyses.fit.matrix_fit import OsemData
from suspension_cli.errors import InputError
from suspension_cli.studies.response_matrix import Plant
from tests.analyses.fit import test_matrix_fit as three
from tools.simulated import MATRICES, wrong_rows

if TYPE_CHECKING:
    from jaxtyping import Float

    from suspension_cli.api import Design

    Matrix = Float[np.ndarray, "row column"]
    Simulated = tuple[Matrix, Matrix, Matrix, Matrix, OsemData]
    """Readings A per motion, forces B per coil, the matrices S and D that follow, and the data."""

NOISE = 0.02
CASES = {"as designed": (0.0, 0.0), "0.1 mm, 0.3 mm": (1e-4, 3e-4), "0.3 mm, 1 mm": (3e-4, 1e-3)}
"""Standard deviations of clamps and lengths, m."""


@dataclass(frozen=True)
class Trials:
    """A suspension whose heights of clamps and lengths of wires (m) vary, and its measurement."""

    title: str
    design: Design
    clamps: dict[str, float]
    lengths: dict[str, float]
    simulate: Callable[[int, Design], Simulated]

    def built(self, seed: int, clamp: float, length: float) -> Design:
        """Draw a suspension with the standard deviations `clamp` and `length`, m."""
        random = np.random.default_rng(10_000 + seed)
        change = {key: at + clamp * random.normal() for key, at in self.clamps.items()}
        change |= {key: at + length * random.normal() for key, at in self.lengths.items()}
        return self.design.replace(change)

    def run(self, count: int) -> None:
        """Print a row for each of the `CASES`."""
        plant = Plant.of(self.design.design, "string")
        for name, (clamp, length) in CASES.items():
            elements, regions, misfits, refused = [], [], 0, 0
            for seed in range(count):
                a, b, sensing, driving, data = self.simulate(seed, self.built(seed, clamp, length))
                try:
                    found = matrix_fit.solve(data, plant)
                except InputError:
                    refused += 1
                    continue
                record = found.matrices
                off = np.concatenate(
                    [(record.sensing - sensing).ravel(), (record.driving - driving).ravel()]
                )
                elements.append(np.abs(off) < 1.959964 * np.sqrt(np.diag(record.covariance)))
                unknowns = found.problem.parts[1].stop
                error = (found.z - found.problem.pack(a, b))[:unknowns]
                spread = found.covariance[:unknowns, :unknowns]
                distance = error @ np.linalg.solve(spread, error)
                regions.append(distance < stats.chi2.ppf(0.95, unknowns))
                misfits += found.scale > 1
            print(
                f"| {self.title} | {name} | {100 * np.mean(elements):.1f} % |"
                f" {sum(regions)} of {len(regions)} | {misfits} | {refused} |",
                flush=True,
            )


def simulate_three(seed: int, built: Design) -> Simulated:
    """Measure three sensors and coils on a double pendulum."""
    a, b, data = three.simulate(seed, NOISE, three.exact_responses(built.design))
    return (a, b, *three.true_matrices(a, b), data)


def simulate_six(seed: int, built: Design) -> Simulated:
    """Measure six sensors and coils on the triple pendulum of `measured/matrices/`."""
    control = built.design.control
    assert control is not None
    osems = tuple(control.osem)
    random = np.random.default_rng(20_000 + seed)
    a = wrong_rows(list(osems), random)
    b = wrong_rows(list(osems), random).T
    exact = a @ three.exact_responses(built.design) @ b
    sigma = NOISE * np.abs(exact)
    scatter = random.normal(size=(2, *exact.shape))
    noisy = exact + sigma * (scatter[0] + 1j * scatter[1])
    data = OsemData(osems, osems, three.GRID, noisy, sigma)
    nominal = np.array([np.append(one.vector, np.cross(one.at, one.vector)) for one in osems])
    scale = np.diag(np.linalg.inv(nominal) @ a)
    return a, b, scale[:, None] * np.linalg.inv(a), np.linalg.inv(b) / scale, data


def main(count: int, count_of_six: int) -> None:
    """Print a line for each case."""
    print(
        "| OSEMs | built with errors | elements in their 95 % | region of all | misfits | refused |"
    )
    print("|---|---|---|---|---|---|")
    Trials(
        "three",
        sus.example("double"),
        {"stage.upper.wires.d": 2e-3, "stage.test.wires.d": 1e-3, "stage.test.wires.d_upper": 1e-3},
        {"stage.upper.wires.l": 0.30, "stage.test.wires.l": 0.28},
        simulate_three,
    ).run(count)
    triple = sus.read(MATRICES / "triple.toml")
    wires = {stage.name: stage.wires for stage in triple.design.stage}
    clamps = {"stage.upper.wires.d": wires["upper"].d}
    for stage in ("middle", "test"):
        clamps[f"stage.{stage}.wires.d"] = wires[stage].d
        clamps[f"stage.{stage}.wires.d_upper"] = wires[stage].d_upper
    lengths = {f"stage.{stage}.wires.l": one.l for stage, one in wires.items()}
    Trials("six", triple, clamps, lengths, simulate_six).run(count_of_six)


if __name__ == "__main__":
    counts = [int(text) for text in sys.argv[1:]]
    main(*counts, *(200, 60)[len(counts) :])
