"""Stated errors of models beside the true ones, on random designs and sweeps.

    .venv/bin/python -m tools.stated_errors [responses|modes|couplings|sweeps] [COUNT]

True errors are differences to the most complete model at every frequency, mode or point of a grid.
The smallest ratio of stated to true error should be above 1/3.
"""

from __future__ import annotations

import sys

import numpy as np
import tomli_w
from numpy.random import Generator

import suspension_cli as sus
from suspension_cli.analyses.named_quantities import names_of
from suspension_cli.analyses.sweep.parameter_sweep import ParameterSweep
from suspension_cli.analyses.sweep.point_errors import PointErrors
from suspension_cli.design.reader import Source
from suspension_cli.design.schema import Design
from suspension_cli.linear import eigenmodes
from suspension_cli.linear.mode_pairing import body_overlap, pair_by_overlap
from suspension_cli.linear.signals import bodies_with_signals, parse_input, parse_output
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import registry
from suspension_cli.models.choice import Transfer, choose, relative_change
from suspension_cli.models.spectrum_error import NEAR, away_from_modes
from suspension_cli.physics import model_choice, wire_modes
from suspension_cli.quantities.nominal_results import find_results
from suspension_cli.scene.arrays import Array
from suspension_cli.studies.job import Axis
from tests.support import scenes

NOTHING = 1e-9
"""True errors below this are rounding errors and differences of solvers."""


def random_raw(seed: int) -> scenes.Raw:
    """One to four stages, symmetric or (every fourth) on blades, on wires from hairs to rods."""
    rng = np.random.default_rng([31, seed])
    count = 1 + seed % 4 if seed % 8 < 6 else 2
    raw = (
        scenes.bladed_chain(rng, min(count, 2), tip_mass=False, lateral=False)
        if seed % 4 == 3
        else scenes.chain(rng, count)
    )
    return scenes.fibred(raw, float(10 ** rng.uniform(6.5, 9)), ribbons=bool(rng.random() < 0.2))


def random_design(seed: int) -> Design:
    """`random_raw` as a design."""
    return scenes.design_of(random_raw(seed))


def source_of(design: Design) -> Source:
    """A design as the commands have it."""
    return Source(design, "", "design.toml")


def random_transfer(rng: Generator, design: Design) -> Transfer:
    """A response of any body to the support or a force, at 2000 frequencies."""
    known = bodies_with_signals(registry.STRING.system(design))
    names = [stage.name for stage in design.stage]
    into, out = [
        ("support.x", "x"), ("support.x", "pitch"), ("support.z", "z"), ("support.y", "y"),
        (f"{names[0]}.force_x", "x"), (f"{names[0]}.torque_yaw", "yaw"),
    ][rng.integers(6)]  # fmt: skip
    top = float(rng.choice([10.0, 30.0, 100.0]))
    return Transfer(
        [parse_input(into, known)],
        [parse_output(f"{names[-1]}.{out}", known)],
        np.geomspace(0.05, top, 2000),
    )


def true_error(wanted: Transfer, simple: LinearSystem, refined: LinearSystem) -> float:
    """Largest relative change of a response at all frequencies away from modes.

    Next to a zero a change is relative to a tenth of the magnitude around.
    """
    at = away_from_modes(wanted.frequency, simple, refined)

    def values(model: LinearSystem, factor: float = 1.0) -> Array:
        return wanted.values(model, at * factor)[:, 0, 0]

    old, new = values(simple), values(refined)
    around = np.sqrt(np.abs(values(refined, 1 / (1 + NEAR)) * values(refined, 1 + NEAR)))
    return float((np.abs(old - new) / np.maximum(np.abs(new), 0.1 * around)).max())


def of_response(seed: int, level: str) -> tuple[float, float]:
    """Stated and true error of a random response in a model."""
    design = random_design(seed)
    wanted = random_transfer(np.random.default_rng([32, seed]), design)
    found, simple = model_choice.choose(source_of(design), level, lambda _: wanted)
    return found.error, true_error(wanted, simple, registry.VIOLIN.system(design))


def of_modes(seed: int) -> tuple[float, float]:
    """Stated and true error of frequencies of bodies without wire mass.

    Modes that share their energy with a wire have no partner.
    """
    design = random_design(seed)
    found, model = model_choice.for_modes(source_of(design), "beam", 1e-3)
    quick, heavy = eigenmodes.solve(model), registry.VIOLIN.system(design)
    slow = wire_modes.solve(heavy, 1.2 * float(np.nanmax(quick.frequency)))
    bodies = slice(6, 6 + 6 * len(model.body))
    overlap = body_overlap(quick.shape, slow.shape, heavy.mass[bodies, bodies])
    pair = pair_by_overlap(overlap)
    rows = np.flatnonzero((pair >= 0) & (quick.frequency > 0))
    rows = rows[overlap[rows, pair[rows]] > 0.7]
    error = np.abs(quick.frequency[rows] / slow.frequency[pair[rows]] - 1)
    return found.error, float(error.max())


def of_couplings(seed: int) -> tuple[float, float]:
    """Stated and true error of a random map of couplings."""
    rng = np.random.default_rng([33, seed])
    design = sus.parse(tomli_w.dumps(scenes.plain(random_raw(seed))))
    how = {
        "sweep": {"k": np.linspace(0.7, 1.3, 25), "offset": [-2e-3, -1e-3, 0.0, 1e-3, 2e-3]},
        "frequency": float(rng.choice([3.0, 10.0, 30.0])),
    }
    simple = sus.xcouple(design, fidelity=str(rng.choice(["string", "beam"])), **how)
    exact = sus.xcouple(design, fidelity="violin", **how)
    return simple.estimated_error, relative_change(simple.ratio, exact.ratio)


def of_sweep(seed: int) -> tuple[float, float]:
    """Stated and true error of a random sweep: modes on strings, or one response on either model.

    The true one follows from the same comparison at every point.
    """
    rng = np.random.default_rng([34, seed])
    text = tomli_w.dumps(scenes.plain(random_raw(seed)))
    design, level = sus.parse(text), str(rng.choice(["string", "beam"]))
    body = design.stage[-1]
    path, values = [
        (f"stage.{body.name}.wires.l", body.wires.l * np.linspace(0.7, 1.3, 25)),
        (f"stage.{body.name}.wires.d", np.linspace(5e-4, 0.03, 25)),
        (f"stage.{body.name}.body.mass", body.body.mass * np.linspace(0.9, 1.1, 25)),
    ][rng.integers(3)]
    results = [f"{body.name}.x/support.x:{rng.choice([2.0, 8.0, 20.0])}"] if seed % 2 else []
    how = {"vary": {path: values}, "fidelity": level, "allow_unstable": True}
    found = sus.sweep(design, results=results, **how)
    quantities = find_results(results, names_of(design), text, level)
    axis = Axis(path, tuple(values.tolist()))
    job = ParameterSweep(text, (axis,), level, quantities, allow_unstable=True)
    compare = PointErrors(job)(np.arange(job.count))
    true = choose(design.design, level, (), compare)
    return found.estimated_error, true.error


def survey(name: str, cases: list[tuple[float, float]]) -> None:
    """Print how stated errors compare with true ones."""
    stated, true = np.array(cases).T
    known = np.isfinite(stated)
    clear = known & (true > NOTHING)
    ratio = stated[clear] / true[clear]
    print(
        f"{name}: {len(cases)} cases, {int((~known).sum())} without a finite error; stated/true"
        f" smallest {ratio.min():.3g}, median {np.median(ratio):.3g}, largest {ratio.max():.3g};"
        f" {int((ratio < 1 / 3).sum())} below 1/3"
    )
    for n in np.flatnonzero(~known | (true > NOTHING) & (stated < true / 3)):
        print(f"    case {n}: stated {stated[n]:.3g}, true {true[n]:.3g}")


def main() -> None:
    """Run the surveys."""
    chosen = sys.argv[1] if len(sys.argv) > 1 else ""
    count = int(sys.argv[2]) if len(sys.argv) > 2 else 60
    if chosen in ("", "responses"):
        for level in ("string", "beam"):
            survey(f"response {level}", [of_response(seed, level) for seed in range(count)])
    if chosen in ("", "modes"):
        survey("modes beam", [of_modes(seed) for seed in range(count)])
    if chosen in ("", "couplings"):
        survey("couplings", [case for n in range(count) if (case := of_couplings(n))])
    if chosen in ("", "sweeps"):
        survey("sweeps", [of_sweep(seed) for seed in range(count)])


if __name__ == "__main__":
    main()
