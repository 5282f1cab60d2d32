"""Trials of `pendsus fit` on suspensions of high Q with one or two faults.

    python -m tools.fit_trials --trials 50

Each trial builds a triple or a quadruple with one or two numbers 1.5 to 3 standard deviations of
their usual errors wrong, in every other trial with small errors of all other numbers, and inverts a
sensor in two of three. It measures functions at the upper mass with 3 % noise, at Q of 1e3 to 1e5.
Every third fit starts from random numbers. A line per trial says whether the fit ends at the truth:
its chi^2 is no larger than that of the true numbers but for chance, and every fault lies within
three standard deviations of its fitted value.
"""

from __future__ import annotations

import argparse
import time
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.fit import solve, start
from suspension_cli.analyses.fit.printed_parameters import change_unit, short
from suspension_cli.analyses.fit.result import Fitted
from suspension_cli.conventions import DOFS
from suspension_cli.design import paths, reader
from suspension_cli.design.measured import Free, Measured, Transducer
from suspension_cli.errors import InputError
from suspension_cli.linear import signals
from suspension_cli.measurements.transfer_function import MeasuredResponse
from suspension_cli.models.registry import BEAM
from suspension_cli.studies.response_matrix import Plant
from tools.tables import ROOT

if TYPE_CHECKING:
    pass

DESIGNS = (
    "configs/geo-silica-triple.toml",
    "measured/diagnosis/triple.toml",
    "configs/quadruple.toml",
    "configs/husman2000/table2.toml",
    "configs/ligo-quad-2005.toml",
)
HEIGHTS = ("d", "d_upper")
FAULTY = (*HEIGHTS, "l", "s", "t1", "t2", "stiffness", "uncoupled_frequency")
"""Keys whose numbers may be wrong."""
OFTEN = 0.7
"""Fraction of faults in heights, which move resonances of pitch and roll most."""
SCATTER = 0.2
"""Small errors of all other numbers, over their usual ones."""
FUNCTIONS = (
    ("x", "x"),
    ("pitch", "pitch"),
    ("z", "z"),
    ("yaw", "yaw"),
    ("pitch", "x"),
    ("x", "pitch"),
)
"""Sensor and drive of each measured function."""
FREQUENCY = np.geomspace(0.2, 8.0, 240)
NOISE = 0.03
CALIBRATION = 0.03
SIGMAS = 3.0
"""Distance from the truth within which a number is found, in standard deviations of the fit."""


@dataclass(frozen=True)
class Trial:
    """A build with faults (SI, by dotted path), its numbers, and what was measured."""

    text: str
    faults: dict[str, float]
    true: dict[str, float]
    inverted: str
    measured: Measured
    functions: tuple[MeasuredResponse, ...]

    def fit(self, *, explain: bool = True) -> Fitted:
        """Fit its measurements in the beam model."""
        return solve.solve(
            [self.text], self.measured, (), self.functions, level=BEAM.name, explain=explain
        )

    @property
    def what(self) -> str:
        """The faults in words."""
        words = []
        for name, by in self.faults.items():
            unit, factor = change_unit(name, self.true[name] - by)
            words.append(f"{short(name)} {by * factor:+.3g} {unit}")
        return ", ".join(words) + (f", sensor of {self.inverted} inverted" * bool(self.inverted))


def draw(seed: int, file: str = "") -> Trial:
    """Build and measure the suspension of one seed."""
    random = np.random.default_rng(seed)
    text = (ROOT / (file or DESIGNS[seed % len(DESIGNS)])).read_text()
    free = start.default_parameters(text, BEAM.name)
    given = {item.name: float(item.prior or 0.0) for item in free}
    sigma = {item.name: float(item.uncertainty or 0.0) for item in free}
    candidates = [name for name in given if name.rpartition(".")[2] in FAULTY]
    heights = np.array([name.rpartition(".")[2] in HEIGHTS for name in candidates])
    share = np.where(heights, OFTEN / heights.sum(), (1 - OFTEN) / (~heights).sum())
    while True:
        wrong = random.choice(candidates, 1 + seed % 2, replace=False, p=share)
        size = random.uniform(1.5, 3.0, len(wrong)) * random.choice([-1.0, 1.0], len(wrong))
        faults = {str(name): float(by * sigma[name]) for name, by in zip(wrong, size, strict=True)}
        scatter = SCATTER * (seed // 2 % 2) * random.standard_normal(len(given))
        errors = dict(zip(given, scatter * np.array([*sigma.values()]), strict=True))
        true = {name: value + faults.get(name, errors[name]) for name, value in given.items()}
        try:
            plant = Plant.of(reader.parse_with_overrides(text, paths.settings(true)), BEAM.name)
        except InputError:
            continue
        if (plant.modes.omega_squared > 0).all():
            break
    if seed % 3 == 0:
        begin = random.standard_normal(len(free)) * 0.5
        free = [
            Free(
                name=item.name,
                prior=item.prior,
                uncertainty=item.uncertainty,
                start=float(given[item.name] + by * sigma[item.name]),
            )
            for item, by in zip(free, begin, strict=True)
        ]
    inverted = ("", "pitch", "x")[seed % 3]
    functions = _measure(plant, random, inverted)
    stage = plant.system.body[0]
    sensors = [
        Transducer(name=f"osem-{dof}", signal=f"{stage}.{dof}", gain_uncertainty=CALIBRATION)
        for dof in dict.fromkeys(dof for dof, _ in FUNCTIONS)
    ]
    return Trial(text, faults, true, inverted, Measured(parameter=free, sensor=sensors), functions)


def _measure(
    plant: Plant, random: np.random.Generator, inverted: str
) -> tuple[MeasuredResponse, ...]:
    """Measure all functions at the upper mass, with noise and calibration errors."""
    stage, known = plant.system.body[0], signals.bodies_with_signals(plant.system)
    dofs = [*dict.fromkeys(dof for dof, _ in FUNCTIONS)]
    forces = [f"{stage}.{signals.FORCES[DOFS.index(dof)]}" for dof in dofs]
    value = plant.respond(
        FREQUENCY,
        [signals.parse_input(name, known) for name in forces],
        [signals.parse_output(f"{stage}.{dof}", known) for dof in dofs],
        10 ** -random.uniform(3.0, 5.0, len(plant.modes.omega_squared)),
    ).value
    gain = {dof: 1 + CALIBRATION * random.standard_normal() for dof in dofs}
    if inverted:
        gain[inverted] *= -1
    made = []
    for sensor, drive in FUNCTIONS:
        exact = gain[sensor] * value[:, dofs.index(sensor), dofs.index(drive)]
        scatter = random.standard_normal((2, len(exact)))
        noisy = exact * (1 + NOISE * (scatter[0] + 1j * scatter[1]))
        name, force = f"{sensor} over {drive}", forces[dofs.index(drive)]
        unknown = np.full(len(exact), np.nan)
        made.append(
            MeasuredResponse(
                name, force, f"osem-{sensor}", FREQUENCY, noisy, NOISE * np.abs(noisy), unknown
            )
        )
    return tuple(made)


def misses(trial: Trial, found: Fitted) -> list[str]:
    """List the faults that are not within `SIGMAS` of their fitted values."""
    lines = []
    for name in trial.faults:
        n = found.name.index(name)
        off = (found.value[n] - trial.true[name]) / found.sigma[n]
        if not abs(off) < SIGMAS:
            lines.append(f"{short(name)} {off:+.1f} sigma from the truth")
    return lines


def main() -> None:
    """Run trials, and print in how many the truth is found."""
    options = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    options.add_argument("--trials", type=int, default=50)
    options.add_argument("--first", type=int, default=0, help="seed of the first trial")
    given = options.parse_args()
    warnings.simplefilter("ignore")
    good, seconds = 0, list[float]()
    for seed in range(given.first, given.first + given.trials):
        trial, begun = draw(seed), time.process_time()
        found = trial.fit(explain=False)
        seconds.append(time.process_time() - begun)
        wrong = misses(trial, found)
        if found.chi_squared > 1.3 * found.freedom:
            wrong.insert(0, f"chi^2 {found.chi_squared:.4g} for {found.freedom}")
        good += not wrong
        verdict = "; ".join(wrong) if wrong else "found"
        name = reader.parse(trial.text).design.name
        print(f"{seed:4d} {seconds[-1]:6.1f} s  {name}: {trial.what}: {verdict}", flush=True)
    print(f"fits that end at the truth: {good} of {given.trials}")
    print(f"processor time: median {np.median(seconds):.3g} s, most {max(seconds):.3g} s")


if __name__ == "__main__":
    main()
