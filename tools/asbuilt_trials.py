"""Trials of `pendsus fit` on simulated transfer functions of imperfect builds.

    python -m tools.asbuilt_trials --first 7000 --trials 200

Each trial builds a pendulum whose numbers differ from the design by draws from their priors, and
measures functions at its upper mass with noise and wrong calibrations. A quadruple is built as
designed or with a cable that the fit does not know; of a double pendulum channels are inverted,
scaled or exchanged.
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from suspension_cli.analyses.fit import solve
from suspension_cli.analyses.fit.result import Fitted
from suspension_cli.conventions import DOFS
from suspension_cli.design import paths, reader
from suspension_cli.design.measured import Free, Measured, Transducer
from suspension_cli.linear import signals
from suspension_cli.measurements.transfer_function import MeasuredResponse
from suspension_cli.models import registry
from suspension_cli.studies import parameters
from suspension_cli.studies.response_matrix import Plant
from tools.tables import ROOT

DOUBLE = {
    "stage.upper.wires.d": 1e-3,
    "stage.upper.wires.l": 3e-3,
    "stage.test.wires.l": 3e-3,
    "stage.test.wires.t2": 0.5e-3,
    "stage.test.wires.d": 0.5e-3,
    "stage.upper.body.mass": 0.03,
}
"""Free numbers of the double pendulum and the standard deviations of their priors."""
LEAST = {"stage.upper.wires.d": 3e-4, "stage.test.wires.d": 1e-4}
"""Smallest values, below which the double pendulum would be nearly unstable."""
KINDS = ("sign", "factor", "exchange")
CABLE = """
[[link]]
name = "cable"
between = ["top", "upper"]
stiffness = [60.0, 60.0, 60.0, 0.0, 0.0, 0.0]
"""
"""A spring of 60 N/m between two stages."""


@dataclass(frozen=True)
class Simulation:
    """A build, measured at one of its masses.

    Attributes
    ----------
    text : str
        The design as TOML.
    measured : Measured
    functions : tuple of MeasuredResponse
    """

    text: str
    measured: Measured
    functions: tuple[MeasuredResponse, ...]

    def fit(self, **how: Any) -> Fitted:
        """Fit its measurements, on strings."""
        return solve.solve([self.text], self.measured, (), self.functions, explain=False, **how)


def simulate(
    text: str,
    true: dict[str, float],
    free: list[Free],
    random: np.random.Generator,
    *,
    stage: str,
    dofs: Sequence[str] = DOFS,
    frequency: Any,
    noise: float = 0.03,
    floor: float = 1e-3,
    calibration: float = 0.05,
    q: float = 200.0,
    level: str = registry.STRING.name,
) -> Simulation:
    """Measure all functions from forces on a stage to its motions, with noise.

    Parameters
    ----------
    text : str
        The design as TOML.
    true : dict
        Numbers of the build that differ from the design.
    free : list of Free
    random : Generator
    stage : str
    dofs : sequence of str
        Degrees of freedom with a sensor (``s-x``) and an actuator (``a-x``).
    frequency : (f,) array
        Hz.
    noise, floor : float
        Standard deviation of real and imaginary part: relative to the value, and to the typical
        value of its sensor and actuator.
    calibration : float
        Standard deviation of the gains.
    q : float
        Of all modes.
    level : str
    """
    plant = Plant.of(reader.parse_with_overrides(text, paths.settings(true)), level)
    known = signals.bodies_with_signals(plant.system)
    forces = [f"{stage}.{signals.FORCES[DOFS.index(dof)]}" for dof in dofs]
    response = plant.respond(
        frequency,
        [signals.parse_input(name, known) for name in forces],
        [signals.parse_output(f"{stage}.{dof}", known) for dof in dofs],
        np.full(len(plant.modes.omega_squared), 1 / q),
    ).value
    typical = np.median(np.abs(np.einsum("fnn->fn", response)), axis=0)
    gains = 1 + calibration * random.standard_normal((2, len(dofs)))
    functions = []
    for o, output in enumerate(dofs):
        for i, into in enumerate(dofs):
            value = response[:, o, i]
            sigma = noise * np.abs(value) + floor * np.sqrt(typical[o] * typical[i])
            scatter = random.standard_normal((2, len(value)))
            gain = gains[0, o] * gains[1, i]
            functions.append(
                MeasuredResponse(
                    f"{output} over {into}",
                    f"a-{into}",
                    f"s-{output}",
                    np.asarray(frequency),
                    gain * (value + sigma * (scatter[0] + 1j * scatter[1])),
                    abs(gain) * sigma,
                    np.full(len(value), np.nan),
                )
            )
    tables = [
        [
            Transducer(name=f"{letter}-{dof}", signal=signal, gain_uncertainty=calibration)
            for dof, signal in zip(dofs, names, strict=True)
        ]
        for letter, names in (("s", [f"{stage}.{dof}" for dof in dofs]), ("a", forces))
    ]
    measured = Measured(parameter=free, sensor=tables[0], actuator=tables[1])
    return Simulation(text, measured, tuple(functions))


def double(seed: int, **how: Any) -> tuple[Simulation, dict[str, float]]:
    """An imperfect double pendulum of `configs/double.toml`, and its true numbers."""
    text, random = (ROOT / "configs" / "double.toml").read_text(), np.random.default_rng(seed)
    values = {item.name: item.value for item in parameters.every(text)}
    while True:
        true = {
            name: float(values[name] + sigma * random.standard_normal())
            for name, sigma in DOUBLE.items()
        }
        if all(true[name] > least for name, least in LEAST.items()):
            break
    free = [
        Free(name=name, prior=values[name], uncertainty=sigma) for name, sigma in DOUBLE.items()
    ]
    settings: dict[str, Any] = {"frequency": np.geomspace(0.2, 30.0, 200)}
    return simulate(text, true, free, random, stage="upper", **settings | how), true


def quadruple(seed: int, unknown: str = "", **how: Any) -> tuple[Simulation, dict[str, float]]:
    """An imperfect quadruple with d of its second stage 2 mm too large, and its true numbers.

    It is built with tables that the fit does not know, `unknown`.
    """
    text, random = (ROOT / "configs" / "quadruple.toml").read_text(), np.random.default_rng(seed)
    values = {item.name: item.value for item in parameters.every(text)}
    sigmas = {f"stage.{name}.wires.l": 2e-3 for name in ("top", "upper", "penultimate", "test")}
    heights = [f"stage.{name}.wires.d" for name in ("top", "upper", "penultimate", "test")]
    heights += [f"stage.{name}.wires.d_upper" for name in ("upper", "penultimate", "test")]
    sigmas |= dict.fromkeys(heights, 2e-3)
    others = [f"stage.{name}.body.inertia.{n}" for name in ("top", "upper") for n in (1, 2, 3)]
    others += [
        "stage.upper.blades.uncoupled_frequency",
        "stage.penultimate.blades.stiffness",
        "stage.top.blades.geometry.thickness",
    ]
    sigmas |= {name: 0.02 * values[name] for name in others}
    true = {
        name: float(
            values[name] + (0.2 if name in heights else 0.7) * sigma * random.standard_normal()
        )
        for name, sigma in sigmas.items()
    }
    true["stage.upper.wires.d"] = values["stage.upper.wires.d"] + 2e-3
    free = [Free(name=name, prior=values[name], uncertainty=s) for name, s in sigmas.items()]
    settings: dict[str, Any] = {"frequency": np.geomspace(0.2, 10.0, 300)}
    made = simulate(text + unknown, true, free, random, stage="top", **settings | how)
    return replace(made, text=text), true


def spoil(
    given: Simulation, kind: str, side: int, names: tuple[str, str], factor: float = 3.15
) -> Simulation:
    """Invert or scale the first channel of a simulation, or exchange two.

    Parameters
    ----------
    given : Simulation
    kind : str
        One of `KINDS`.
    side : int
        0 for sensors, 1 for actuators.
    names : pair of str
        Channels.
    factor : float
    """
    key, made = ("output", "input")[side], []
    exchange = {names[0]: names[1], names[1]: names[0]}
    for item in given.functions:
        name = getattr(item, key)
        if kind == "exchange":
            made.append(replace(item, **{key: exchange.get(name, name)}))
            continue
        gain = 1.0 if name != names[0] else -1.0 if kind == "sign" else factor
        made.append(
            replace(item, value=gain * item.value, uncertainty=abs(gain) * item.uncertainty)
        )
    return replace(given, functions=tuple(made))


def distance(found: Fitted, true: dict[str, float]) -> float:
    """Squared distance of true from fitted parameters, in the metric of the covariance."""
    off = found.value - np.array(list(true.values()))
    return float(off @ np.linalg.solve(found.covariance, off))


def is_found(corrections: Sequence[Any], kind: str, side: int, names: tuple[str, str]) -> bool:
    """Whether the one wrong channel is reported, alone or as an equivalent alternative."""
    if len(corrections) != 1 or corrections[0].kind != kind:
        return False
    wanted = set(names if kind == "exchange" else names[:1])
    one = corrections[0]
    return (one.side == side and set(one.channel) == wanted) or wanted <= set(one.also.split())


def main() -> None:
    """Run trials, and print in how many the truth is found."""
    from scipy.stats import chi2

    options = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    options.add_argument("--trials", type=int, default=200)
    options.add_argument("--first", type=int, default=0, help="seed of the first trial")
    given = options.parse_args()
    warnings.simplefilter("ignore")
    inside = told = located = near = named = 0
    for seed in range(given.first, given.first + given.trials):
        simulated, true = quadruple(seed)
        inside += distance(simulated.fit(), true) < chi2(len(true)).ppf(0.95)
        lacking = quadruple(seed, CABLE)[0].fit()
        told += lacking.misfit
        assert lacking.responses is not None
        located += [one.between for one in lacking.responses.links[:1]] == [("top", "upper")]
        simulated, true = double(seed)
        side, random = seed // 3 % 2, np.random.default_rng([seed, 1])
        one, other = (f"{'sa'[side]}-{dof}" for dof in random.choice(DOFS, 2, replace=False))
        found = spoil(simulated, KINDS[seed % 3], side, (one, other)).fit()
        near += distance(found, true) < chi2(len(true)).ppf(0.95)
        assert found.responses is not None
        named += is_found(found.responses.corrections, KINDS[seed % 3], side, (one, other))
    print(f"quadruples with the true numbers in the 95 % region: {inside} of {given.trials}")
    print(f"quadruples with a cable that are misfits: {told} of {given.trials}")
    print(f"cables that are suggested between their bodies: {located} of {given.trials}")
    print(f"doubles with the true numbers in the 95 % region: {near} of {given.trials}")
    print(f"wrong channels of doubles that are found: {named} of {given.trials}")


if __name__ == "__main__":
    main()
