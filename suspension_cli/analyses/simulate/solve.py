"""Motions and forces of a design with its loops closed, sample by sample.

>>> import suspension_cli as sus
>>> design = sus.example("triple-damped")
>>> how = {"step": ["upper.force_x=1e-3"], "noise": False, "rate": 512.0, "duration": 2.0}
>>> found = sus.simulate(design, outputs=["test.x"], fidelity="string", **how)
>>> found.value.shape
(1024, 1)

The physics is that of `physics.time_domain`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from suspension_cli.analyses.record import Record
from suspension_cli.design.derive import mirror
from suspension_cli.errors import InputError, format_value
from suspension_cli.files.declared import along, in_unit
from suspension_cli.files.documents import Layout
from suspension_cli.linear import signals
from suspension_cli.linear.solver import Solver
from suspension_cli.physics import ground, local_control, model_choice, time_domain
from suspension_cli.physics.closed_loop import find_steady_poles

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from jaxtyping import Float

    from suspension_cli.analyses.analysis import Analysis, Run
    from suspension_cli.design.control import Loop
    from suspension_cli.linear.signals import Signal
    from suspension_cli.physics.ground import Spectrum
    from suspension_cli.physics.local_control import Plant
    from suspension_cli.scene.arrays import Array

MOST_SAMPLES = 20_000_000
"""Most samples of a run: each takes some ten numbers."""
ROUNDING = 1e-9
"""Excess of |z| over 1 of a motion without loss, by rounding errors."""
SETTLED = 5.0
"""Times in which the slowest motion falls to 1/e that noise acts before the run begins."""
MOST_BEFORE = 500_000
"""Most samples for that."""
RISING = 0.4
"""Part of that time in which noise grows from 0 to its size: a jump would excite all modes."""


@dataclass(frozen=True, eq=False, repr=False)
class Simulation(Record):
    """Motions and forces in time.

    Attributes
    ----------
    time
        s.
    output, unit
        Motions, and the unit of each.
    value
        Motions, SI.
    actuator, actuator_unit
        Coils of OSEMs, and loops without these, and the unit of each force.
    force
        Forces of actuators, within their limits and without their noise.
    limit
        Largest force of each; infinite where none is given.
    at_limit
        Fraction of the samples at which it was reached.
    """

    in_json: ClassVar = Layout(
        rows={"output": "outputs", "actuator": "actuators"},
        without="time value force",
        also="rms largest force_rms largest_force",
    )
    time: Float[np.ndarray, " time"] = field(metadata=in_unit("s"))
    output: tuple[str, ...]
    unit: tuple[str, ...] = field(metadata=along("output"))
    value: Float[np.ndarray, "time output"] = field(metadata=in_unit("{unit}"))
    actuator: tuple[str, ...]
    actuator_unit: tuple[str, ...] = field(metadata=along("actuator"))
    force: Float[np.ndarray, "time actuator"] = field(metadata=in_unit("{actuator_unit}"))
    limit: Float[np.ndarray, " actuator"] = field(metadata=in_unit("{actuator_unit}"))
    at_limit: Float[np.ndarray, " actuator"]

    @property
    def rms(self) -> Float[np.ndarray, " output"]:
        """Root of the mean square of each motion."""
        return np.sqrt((self.value**2).mean(0))

    @property
    def largest(self) -> Float[np.ndarray, " output"]:
        """Largest magnitude of each motion."""
        return np.abs(self.value).max(0)

    @property
    def force_rms(self) -> Float[np.ndarray, " actuator"]:
        """Root of the mean square of each force."""
        return np.sqrt((self.force**2).mean(0))

    @property
    def largest_force(self) -> Float[np.ndarray, " actuator"]:
        """Largest magnitude of each force."""
        return np.abs(self.force).max(0, initial=0.0)


@dataclass(frozen=True)
class _Causes:
    """What acts on a run: steps and impulses with their sizes, motions of the support, noise."""

    steps: Sequence[tuple[Signal, float]]
    impulses: Sequence[tuple[Signal, float]]
    motions: dict[str, Spectrum]
    noise: bool
    seed: int

    @staticmethod
    def of(run: Run, known: tuple[str, ...]) -> _Causes:
        """Parse what the settings of a run say; raises `InputError`."""
        setting = run.setting
        folder = Path(run.source.file).parent
        return _Causes(
            [_parse_push(text, known, "--step") for text in setting["step"]],
            [_parse_push(text, known, "--impulse") for text in setting["impulse"]],
            ground.parse(setting["ground"], (), folder),
            setting["noise"],
            setting["seed"],
        )

    @property
    def forces(self) -> list[Signal]:
        """Forces from outside: of steps, then of impulses."""
        return [signal for signal, _ in (*self.steps, *self.impulses)]

    @property
    def is_random(self) -> bool:
        """Whether anything is drawn."""
        return self.noise or bool(self.motions)

    def act(self, plant: Plant, before: int, count: int, rate: float) -> Any:
        """Inputs of `Sampled.run`: noise grows in some samples `before`, then the rest acts."""
        total = before + count
        pushes = np.zeros((total, len(self.forces)))
        for n, (_, size) in enumerate(self.steps):
            pushes[before:, n] = size
        for n, (_, size) in enumerate(self.impulses, len(self.steps)):
            pushes[before, n] = size * rate
        random = self._draw(plant, total, rate)
        rising = int(RISING * before)
        random[:rising] *= np.sin(np.pi / 2 * np.arange(rising)[:, None] / max(rising, 1)) ** 2
        return np.concatenate([pushes, random], axis=1)

    def _draw(self, plant: Plant, total: int, rate: float) -> Any:
        """Draw the motions of the support, then noise of channels and of actuators."""
        generator = np.random.default_rng(self.seed)

        def draw(density: Callable[[Array], Array]) -> Array:
            return time_domain.draw_noise(density, total, rate, generator)

        parts: list[Array] = [draw(spectrum.at)[:, None] for spectrum in self.motions.values()]
        sensing = np.zeros((total, len(plant.channels)))
        pushing = np.zeros((total, len(plant.osems) + len(_loops_alone(plant))))
        if self.noise:
            readings = np.hstack([np.eye(len(plant.channels)), plant.reading])
            for sensor, weights in zip(plant.sensors, readings.T, strict=True):
                if local_control.evaluate_noise(sensor, np.ones(1)).any():
                    own = draw(lambda f, one=sensor: local_control.evaluate_noise(one, f))
                    sensing += np.outer(own, weights)
            for n, part in enumerate([*plant.osems, *_loops_alone(plant)]):
                if local_control.evaluate_actuator_noise(part, np.ones(1)).any():
                    pushing[:, n] = draw(
                        lambda f, one=part: local_control.evaluate_actuator_noise(one, f)
                    )
        return np.concatenate([*parts, sensing, pushing], axis=1)


def solve(analysis: Analysis, run: Run) -> Simulation:
    """Run the loops of a design."""
    setting = run.setting
    design = run.design
    rate = setting["rate"]
    count = _count_samples(setting["duration"], rate)
    choice, model = model_choice.for_modes(
        run.source, setting["fidelity"], setting["tolerance"], massless=True
    )
    growing = setting["allow_unstable"]
    model = model_choice.stable_system(run.source, choice, growing, run.log, model, bends=True)
    solver = Solver(model)
    find_steady_poles(design, solver, choice.model, "motion", run.log, growing)
    known = signals.bodies_with_signals(model)
    texts = setting["outputs"] or (f"{mirror(design)}.x",)
    outputs = [signals.parse_output(text, known) for text in texts]
    causes = _Causes.of(run, known)
    moved = [signals.parse_input(f"support.{dof}", known) for dof in causes.motions]
    plant = local_control.build_plant(design, solver)
    sampled = time_domain.sample(plant, rate, causes.forces, moved, outputs)
    growth = time_domain.largest_growth(sampled.linear())
    if growth > 1 + ROUNDING and not growing:
        problem = f"the sampled loops are unstable at {rate:g} Hz (|z| = {growth:.6g})"
        remedy = "give a higher --rate, less delay or gain, or --allow-unstable"
        raise InputError.of("--rate", problem, remedy, f"{rate:g}")
    for line in time_domain.rounded_delays(plant, rate):
        run.log.warn(f"{line} at {rate:g} Hz")
    before = _run_in(run, growth, rate) if causes.is_random else 0
    given = causes.act(plant, before, count, rate)
    with run.log.progress() as bar:
        found, limited = sampled.run(given, lambda done: bar(done, len(given), 0.0))
    return Simulation(
        time=np.arange(count) / rate,
        output=tuple(signal.text for signal in outputs),
        unit=tuple(signal.unit for signal in outputs),
        value=found[before:, : len(outputs)],
        actuator=tuple(one.name for one in sampled.actuators),
        actuator_unit=tuple(one.unit for one in sampled.actuators),
        force=found[before:, len(outputs) :],
        limit=sampled.limits,
        at_limit=limited[before:].mean(0),
        run=run.origin(analysis, choice),
    )


def _count_samples(duration: float, rate: float) -> int:
    """Number of samples; raises `InputError` if there are too many, or none."""
    count = round(duration * rate)
    if not 1 <= count <= MOST_SAMPLES:
        problem = f"makes {count:,} samples at {rate:g} Hz"
        remedy = f"give from one to {MOST_SAMPLES:,} samples"
        raise InputError.of("--duration", problem, remedy, f"{duration:g}")
    return count


def _parse_push(text: str, known: tuple[str, ...], option: str) -> tuple[Signal, float]:
    """Parse ``upper.force_x=1e-3``: a force or torque on a body, and its size."""
    name, equals, size = text.partition("=")
    remedy = "write for example upper.force_x=1e-3"
    try:
        value = float(size)
    except ValueError:
        value = np.nan
    if not equals or not np.isfinite(value):
        raise InputError.of(option, "gives no size", remedy, format_value(text))
    signal = signals.parse(name.strip(), option, known)
    if not signal.acts:
        raise InputError.of(option, "is not a force or torque", remedy, format_value(text))
    return signal, value


def _run_in(run: Run, growth: float, rate: float) -> int:
    """Number of samples that noise acts before the run, so that motions are steady.

    Warns if that takes too many. `growth` is the largest modulus of a pole z.
    """
    needed = np.inf if growth >= 1 else -SETTLED / np.log(growth)
    if needed > MOST_BEFORE:
        slowest = "has no damping"
        if growth < 1:
            slowest = f"takes {needed / rate / SETTLED:.3g} s to fall to 1/e"
        run.log.warn(
            f"{run.name}: the slowest motion {slowest}, and noise acts {MOST_BEFORE / rate:.3g} s"
            " before the run: resonances with so little damping are smaller than in budget;"
            " damp them, or look at motions in which they do not matter"
        )
    return int(min(needed, MOST_BEFORE))


def _loops_alone(plant: Plant) -> list[Loop]:
    """Loops without coils."""
    has_coils = np.abs(plant.driving).sum(0) > 0
    return [plant.loops[n] for n in np.flatnonzero(~has_coils).tolist()]
