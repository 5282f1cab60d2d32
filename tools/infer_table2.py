"""Infer a set of parameters for Table II of Husman et al. (2000), the prototype GEO 600 triple pendulum.

The paper prints 18 theoretical frequencies of this suspension but not its parameters.  It does say what the test mass is,
what the stage above it looks like (figures 3, 4 and 6) and where the blades sit.  Around those hints this script looks for
parameters that a builder would believe and that give all the frequencies:

1. random chains within bounds, judged by the force model, thousands at once;
2. least squares from the best of them, with the force model and weak priors that pull towards the hints;
3. least squares on both the force and the string model (they differ where blades carry angled wires);
4. lengths are rounded to what one can build, the rest is refitted, and so on down to the inertias.

There are more parameters than frequencies, so the outcome is one believable set, not the one that was built.
Prints the stages as TOML and what remains:

    python tools/infer_table2.py [paper.toml]
"""

from __future__ import annotations

import argparse
import math
import tomllib
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import tomli_w
from scipy.optimize import least_squares

from suspension_cli.analysis import modes
from suspension_cli.design import reader
from suspension_cli.models import fidelity, force

FAMILIES = {
    "tilt_longitudinal": ("longitudinal-pitch", "x", "pitch"),
    "sideways_roll": ("transverse-roll", "y", "roll"),
    "rotation": ("yaw", "yaw"),
    "vertical": ("vertical", "z"),
}
"""The paper's families of modes: the force model's block, and the degrees of freedom that modes of the family live in."""

MODULUS = 1.7e11
"""Young's modulus that the authors measured on steel wire, Pa; that of `steel302`."""

TEST = {"mass": 5.6, "shape": "cylinder", "axis": "x", "radius": 0.09, "length": 0.10}
RADIUS = {"upper": 250e-6, "middle": 198e-6}
"""Wire radii of the stages on blades, m; they hardly matter, as the blades are far softer (198 um: figure 3)."""


class Free(NamedTuple):
    """A parameter to find: what is likely (expected, spread), what is allowed (low, high), and how finely it is built."""

    expected: float
    spread: float
    low: float
    high: float
    step: float


MM = 1e-3
PARAMETERS = {
    # the top mass: size of the homogeneous box with its inertia
    "upper.mass": Free(5.6, 0.3, 5.0, 6.5, 0.01),
    "upper.size_x": Free(100 * MM, 40 * MM, 40 * MM, 200 * MM, 0.1 * MM),
    "upper.size_y": Free(300 * MM, 50 * MM, 150 * MM, 420 * MM, 0.1 * MM),
    "upper.size_z": Free(70 * MM, 30 * MM, 20 * MM, 150 * MM, 0.1 * MM),
    "upper.l": Free(300 * MM, 100 * MM, 150 * MM, 500 * MM, 1 * MM),
    "upper.t1": Free(30 * MM, 30 * MM, 10 * MM, 100 * MM, 1 * MM),
    "upper.t2": Free(50 * MM, 30 * MM, 10 * MM, 100 * MM, 1 * MM),
    "upper.d": Free(1 * MM, 1.5 * MM, -3 * MM, 3 * MM, 0.1 * MM),
    "upper.blade": Free(420, 100, 300, 4000, 1),
    # the middle mass: likewise; the test mass's cylinder has the inertia of a box of 0.100 x 0.156 x 0.156 m
    "middle.mass": Free(5.6, 0.3, 5.0, 6.5, 0.01),
    "middle.size_x": Free(100 * MM, 20 * MM, 70 * MM, 160 * MM, 0.1 * MM),
    "middle.size_y": Free(156 * MM, 10 * MM, 120 * MM, 190 * MM, 0.1 * MM),
    "middle.size_z": Free(156 * MM, 10 * MM, 120 * MM, 190 * MM, 0.1 * MM),
    "middle.l": Free(180 * MM, 15 * MM, 150 * MM, 250 * MM, 1 * MM),
    "middle.s": Free(30 * MM, 3 * MM, 20 * MM, 40 * MM, 0.5 * MM),
    "middle.t1": Free(80 * MM, 20 * MM, 20 * MM, 105 * MM, 0.5 * MM),
    "middle.t2": Free(95 * MM, 3 * MM, 85 * MM, 105 * MM, 0.5 * MM),
    "middle.d": Free(1 * MM, 0.5 * MM, -1 * MM, 3 * MM, 0.1 * MM),
    "middle.d_upper": Free(1 * MM, 1 * MM, -3 * MM, 3 * MM, 0.1 * MM),
    "middle.blade": Free(430, 100, 300, 4000, 1),
    "test.l": Free(280 * MM, 30 * MM, 200 * MM, 350 * MM, 1 * MM),
    "test.s_upper": Free(5 * MM, 1.5 * MM, 2 * MM, 12 * MM, 0.1 * MM),
    "test.s_lower": Free(5 * MM, 1.5 * MM, 2 * MM, 12 * MM, 0.1 * MM),
    "test.t1": Free(96.5 * MM, 3 * MM, 85 * MM, 100 * MM, 0.1 * MM),
    "test.t2": Free(96.5 * MM, 3 * MM, 85 * MM, 100 * MM, 0.1 * MM),
    "test.d": Free(1 * MM, 0.5 * MM, -1 * MM, 3 * MM, 0.1 * MM),
    "test.d_upper": Free(1 * MM, 1 * MM, -3 * MM, 3 * MM, 0.1 * MM),
    "test.radius": Free(130e-6, 20e-6, 90e-6, 200e-6, 1e-6),
}
NAMES = list(PARAMETERS)
EXPECTED, SPREAD, LOW, HIGH, STEP = np.array(list(PARAMETERS.values())).T
SIZES = [n for n, name in enumerate(NAMES) if "size" in name]
COARSE = [n for n in range(len(NAMES)) if STEP[n] in (1 * MM, 0.5 * MM, 0.01)]
ROUNDS = [COARSE, [n for n in range(len(NAMES)) if n not in COARSE and n not in SIZES]]
"""What is rounded one after the other; the inertias (sizes) take up the rest."""

UNIT = {"force": 6e-3, "string": 9e-3}
"""Relative error on each rung that begins to hurt: beyond it the cost grows as its sixth power, which keeps the worst small."""
PRIOR = 0.5
"""Residual that a parameter one spread from its expected value counts as."""


def box(values: Any, name: str) -> tuple[Any, Any, Any]:
    """Moments of inertia of a mass, kg m^2."""
    x, y, z = (values[f"{name}.size_{axis}"] ** 2 for axis in "xyz")
    factor = values[f"{name}.mass"] / 12
    return factor * (y + z), factor * (x + z), factor * (x + y)


def chain(values: Any) -> force.Chain:
    """The chain of the force model; every value may be an array."""

    def k(radius: Any, length: Any) -> Any:
        return MODULUS * math.pi * radius**2 / length

    def lengths(stage: str, *keys: str) -> dict[str, Any]:
        return {key: values[f"{stage}.{key}"] for key in keys}

    along, across = TEST["mass"] * TEST["radius"] ** 2 / 2, TEST["mass"] * (3 * TEST["radius"] ** 2 + TEST["length"] ** 2) / 12
    upper = force.Stage(
        values["upper.mass"],
        box(values, "upper"),
        2,
        **lengths("upper", "l", "t1", "t2", "d"),
        k=k(RADIUS["upper"], values["upper.l"]),
        blades=2,
        blade_stiffness=values["upper.blade"],
    )
    middle = force.Stage(
        values["middle.mass"],
        box(values, "middle"),
        4,
        **lengths("middle", "l", "t1", "t2", "d", "d_upper"),
        s_upper=values["middle.s"],
        s_lower=values["middle.s"],
        k=k(RADIUS["middle"], values["middle.l"]),
        blades=4,
        blade_stiffness=values["middle.blade"],
    )
    stage = lengths("test", "l", "s_upper", "s_lower", "t1", "t2", "d", "d_upper")
    test = force.Stage(TEST["mass"], (along, across, across), 4, **stage, k=k(values["test.radius"], values["test.l"]))
    return force.Chain((upper, middle, test))


def document(values: dict[str, float]) -> dict[str, Any]:
    """The design file of one set of parameters, inertias rounded to four digits."""

    def stage(name: str, count: int, blades: int) -> dict[str, Any]:
        body = TEST if name == "test" else {"mass": values[f"{name}.mass"], "inertia": [float(f"{moment:.4g}") for moment in box(values, name)]}
        keys = [key.partition(".")[2] for key in NAMES if key.startswith(f"{name}.")]
        wires: dict[str, Any] = {"count": count, "material": "steel302", "radius": RADIUS.get(name, 0.0)}
        wires |= {key: float(f"{values[f'{name}.{key}']:.10g}") for key in keys if key not in ("mass", "blade") and "size" not in key}
        hung = {"name": name, "body": body, "wires": wires}
        return hung | ({"blades": {"count": blades, "stiffness": values[f"{name}.blade"]}} if blades else {})

    return {"design": {"name": "husman2000-table2"}, "stage": [stage("upper", 2, 2), stage("middle", 4, 4), stage("test", 4, 0)]}


def with_force(points: Any, target: Any) -> Any:
    """Relative errors (n, 18) of the force model at the points (n, parameters); an unstable mode counts as negative."""
    found = force.eigenvalues(chain(dict(zip(NAMES, points.T, strict=True))))
    squares = np.concatenate([found[family[0]] for family in FAMILIES.values()], axis=-1)
    return np.sign(squares) * np.sqrt(np.abs(squares)) / (2 * math.pi) / target - 1


def with_model(raw: dict[str, Any], level: str, target: Any) -> Any:
    """Relative errors (18,) of a design file on any rung, sorted within each family."""
    found = modes.solve(fidelity.linear_model(reader.convert(raw), level))
    signed = np.sign(found.omega_squared) * np.sqrt(np.abs(found.omega_squared)) / (2 * math.pi)
    home = np.array([dof for _, dof in found.home])
    return np.concatenate([np.sort(signed[np.isin(home, family[1:])]) for family in FAMILIES.values()]) / target - 1


def polished(points: Any, free: Any, target: Any, *, string: bool) -> Any:
    """Least squares over the free parameters from one point.

    Parameters
    ----------
    points : (parameters,) array
    free : (f,) int array
        Which parameters may move.
    target : (18,) array
        Frequencies, Hz.
    string : bool
        Whether the string model counts beside the force model (slow).

    Returns
    -------
    point : (parameters,) array
    cost : float
    """
    free = np.asarray(free)

    def cost(moved: Any) -> Any:
        errors = with_force(moved, target) / UNIT["force"]
        if string:
            slow = [with_model(document(dict(zip(NAMES, map(float, one), strict=True))), "string", target) for one in moved]
            errors = np.concatenate([errors, np.array(slow) / UNIT["string"]], axis=-1)
        return np.concatenate([errors * (1 + errors**2), PRIOR * (moved - EXPECTED) / SPREAD], axis=-1)

    def at(shares: Any) -> Any:
        moved = np.tile(points, (len(shares), 1))
        moved[:, free] = LOW[free] + shares * (HIGH - LOW)[free]
        return cost(moved)

    def slopes(share: Any) -> Any:
        # forward differences inside the bounds; the string model rounds inertias, so the step must not be tiny
        step = np.where(share > 0.5, -1e-3, 1e-3)
        return ((at(share + np.diag(step)) - at(share[None])) / step[:, None]).T

    start = np.clip((points - LOW)[free] / (HIGH - LOW)[free], 1e-3, 1 - 1e-3)
    fit = least_squares(lambda share: at(share[None])[0], start, slopes, bounds=(0, 1), max_nfev=40 if string else 150)
    result = points.copy()
    result[free] = LOW[free] + fit.x * (HIGH - LOW)[free]
    return result, fit.cost


def infer(target: Any, seed: int = 3) -> dict[str, float]:
    """One believable set of parameters, rounded."""
    every = np.arange(len(NAMES))
    samples = LOW + np.random.default_rng(seed).random((40000, len(NAMES))) * (HIGH - LOW)
    best = samples[np.argsort(np.abs(with_force(samples, target)).sum(-1))[:60]]
    fits = sorted((polished(point, every, target, string=False) for point in best), key=lambda fit: fit[1])
    point = min((polished(point, every, target, string=True) for point, _ in fits[:24:3]), key=lambda fit: fit[1])[0]
    for done, group in enumerate(ROUNDS, 1):
        point[group] = np.round(point[group] / STEP[group]) * STEP[group]
        left = [n for n in every if not any(n in earlier for earlier in ROUNDS[:done])]
        point = polished(point, left, target, string=True)[0]
    return dict(zip(NAMES, (float(f"{value:.10g}") for value in point), strict=True))


def main() -> None:
    """Print the inferred set as TOML, and its errors on both rungs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tables", nargs="?", type=Path, default=Path(__file__).with_name("paper.toml"), help="the paper's tables as TOML")
    theory = tomllib.loads(parser.parse_args().tables.read_text(encoding="utf-8"))["table2"]["theory"]
    target = np.concatenate([np.sort(theory[family]) for family in FAMILIES])
    raw = document(infer(target))
    print(tomli_w.dumps(raw))
    errors = {level: with_model(raw, level, target) for level in ("force", "string")}
    print("# Hz      force  string, relative errors in per cent")
    for frequency, one, other in zip(target, *errors.values(), strict=True):
        print(f"# {frequency:5.2f}  {100 * one:6.2f}  {100 * other:6.2f}")
    for level, error in errors.items():
        print(f"# {level}: worst {100 * np.abs(error).max():.2f} %, median {100 * np.median(np.abs(error)):.2f} %")


if __name__ == "__main__":
    main()
