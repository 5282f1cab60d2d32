"""Motions and forces of a design with its loops closed, sample by sample.

>>> import suspension_cli as sus
>>> design = sus.example("triple-damped")
>>> how = {"step": ["upper.force_x=1e-3"], "noise": False, "rate": 512.0, "duration": 2.0}
>>> found = sus.simulate(design, outputs=["test.x"], fidelity="string", **how)
>>> found.value.shape
(1024, 1)

The physics is that of `physics.time_domain`. The results file is written block by block while the
run is computed, and the arrays of a result are read from there where they are used.
"""

from __future__ import annotations

import shutil
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from suspension_cli.analyses.record import Record
from suspension_cli.analyses.replaced_results import replacing
from suspension_cli.analyses.simulate.causes import Causes, Inputs
from suspension_cli.design.bodies import body_mass
from suspension_cli.design.derive import gravity_strength, mirror
from suspension_cli.errors import InputError
from suspension_cli.files import hdf5, stored
from suspension_cli.files.declared import along, in_unit
from suspension_cli.files.documents import Layout
from suspension_cli.files.hdf5 import Reserved
from suspension_cli.files.whole_files import target, writing_to
from suspension_cli.linear import signals
from suspension_cli.linear.solver import Solver
from suspension_cli.physics import local_control, model_choice, sampled_filters, time_domain
from suspension_cli.physics.running_statistics import Statistics, WelchAverage

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    import h5py
    from jaxtyping import Bool, Float

    from suspension_cli.analyses.analysis import Analysis, Run
    from suspension_cli.design.schema import Design
    from suspension_cli.linear.signals import Signal
    from suspension_cli.physics.local_control import Plant
    from suspension_cli.physics.time_domain import Sampled

LARGE = 4e9
"""Size of a results file from which on it is warned of before the run, bytes."""
SETTLED = 5.0
"""Times in which the slowest motion falls to 1/e that noise acts before the run begins."""
MOST_BEFORE = 500_000
"""Most samples for that."""
LONGEST_PIECE = 1 << 17
"""Most samples of a piece of which the spectrum is averaged: 64 s at 2048 Hz."""
LEAST_PIECE = 64
"""Least samples of a piece; a run of less than four has no spectrum."""
SMALL = 1.0
"""Motion, m or rad, beyond which the linear model does not apply."""


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
        Motions, SI. Like all arrays above 16 MB it stays in the results file, and takes memory
        only while it is used.
    rms, largest
        Root of the mean square, and largest magnitude, of each motion.
    actuator, actuator_unit
        Coils of OSEMs, and loops without these, and the unit of each force.
    force
        Forces of actuators, within their limits and without their noise.
    limit
        Largest force of each; infinite where none is given.
    at_limit
        Fraction of the samples at which it was reached.
    force_rms, largest_force
        Root of the mean square, and largest magnitude, of each force.
    averages
        Number of pieces of the run, which overlap by half, of which spectra are averaged. Without
        noise, and in runs of less than 256 samples, it is 0, and there are no spectra.
    frequency
        Hz; None without spectra.
    density, force_density
        One-sided amplitude spectral densities, by the method of Welch; None without spectra.
    """

    in_json: ClassVar = Layout(
        rows={"output": "outputs", "actuator": "actuators"},
        without="time value force frequency density force_density",
    )
    time: Float[np.ndarray, " time"] = field(metadata=in_unit("s"))
    output: tuple[str, ...]
    unit: tuple[str, ...] = field(metadata=along("output"))
    value: Float[np.ndarray, "time output"] = field(metadata=in_unit("{unit}"))
    rms: Float[np.ndarray, " output"] = field(metadata=in_unit("{unit}"))
    largest: Float[np.ndarray, " output"] = field(metadata=in_unit("{unit}"))
    actuator: tuple[str, ...]
    actuator_unit: tuple[str, ...] = field(metadata=along("actuator"))
    force: Float[np.ndarray, "time actuator"] = field(metadata=in_unit("{actuator_unit}"))
    limit: Float[np.ndarray, " actuator"] = field(metadata=in_unit("{actuator_unit}"))
    at_limit: Float[np.ndarray, " actuator"]
    force_rms: Float[np.ndarray, " actuator"] = field(metadata=in_unit("{actuator_unit}"))
    largest_force: Float[np.ndarray, " actuator"] = field(metadata=in_unit("{actuator_unit}"))
    averages: int
    frequency: Float[np.ndarray, " frequency"] | None = field(metadata=in_unit("Hz"))
    density: Float[np.ndarray, "frequency output"] | None = field(metadata=in_unit("{unit}/Hz^0.5"))
    force_density: Float[np.ndarray, "frequency actuator"] | None = field(
        metadata=in_unit("{actuator_unit}/Hz^0.5")
    )


@dataclass(frozen=True)
class _Plan:
    """A run before it is computed: `count` samples after some `before` in which noise grows.

    Attributes
    ----------
    bounds
        Motions and forces beyond which the linear model does not apply.
    growing
        Names of the loops that make the system unstable.
    """

    sampled: Sampled
    inputs: Inputs
    outputs: Sequence[Signal]
    before: int
    count: int
    piece: int
    bounds: Float[np.ndarray, " signal"]
    growing: Sequence[str]

    @property
    def size(self) -> float:
        """Size of the results file, bytes."""
        return 8.0 * self.count * (1 + len(self.bounds))

    def describe_excess(self, statistics: Statistics) -> tuple[str, float]:
        """Describe the signal that exceeds its bound first, and when it does, s; "" for none."""
        beyond = np.flatnonzero(statistics.first_beyond >= 0)
        if not len(beyond):
            return "", np.inf
        first = int(beyond[statistics.first_beyond[beyond].argmin()])
        actuators = self.sampled.actuators
        names = [signal.text for signal in self.outputs]
        names += [f"the actuator of {one.name}" for one in actuators]
        units = [*(signal.unit for signal in self.outputs), *(one.unit for one in actuators)]
        time = int(statistics.first_beyond[first]) / self.sampled.rate
        bound = f"{self.bounds[first]:.3g} {units[first]}"
        loops = f" (unstable: {', '.join(self.growing)})" if self.growing else ""
        return f"{names[first]} exceeds {bound} from {time:.4g} s on{loops}", time


def solve(analysis: Analysis, run: Run) -> Simulation:
    """Run the loops of a design, and write the results file."""
    setting = run.setting
    design = run.design
    choice, model = model_choice.for_modes(
        run.source, setting["fidelity"], setting["tolerance"], massless=True
    )
    growing = setting["allow_unstable"]
    model = model_choice.stable_system(run.source, choice, growing, run.log, model, bends=True)
    known = signals.bodies_with_signals(model)
    texts = setting["outputs"] or (f"{mirror(design)}.x",)
    outputs = [signals.parse_output(text, known) for text in texts]
    causes = Causes.of(run, known)
    plan = _plan(run, Solver(model), outputs, causes, known)
    path = target(run.folder / f"{run.source.stem()}-{analysis.stem}.h5")
    with writing_to(run.folder):
        run.folder.mkdir(parents=True, exist_ok=True)
    _check_space(run, path, plan.size)
    origin = run.origin(analysis, choice).provenance

    def fill(file: h5py.File) -> None:
        _Recorder(file.create_group(analysis.name), plan).record(run)
        hdf5.write_warnings(file, run.origin(analysis, choice).warnings)

    with replacing(path, run.source, run.log.say):
        hdf5.write_large(path, origin, fill)
    with hdf5.open_results(path) as file:
        return analysis.read_result(file, replace(run.origin(analysis, choice), file=path), {})


def _plan(
    run: Run, solver: Solver, outputs: Sequence[Signal], causes: Causes, known: tuple[str, ...]
) -> _Plan:
    """Sample the loops; raises `InputError` or warns if they are unstable."""
    rate = run.setting["rate"]
    count = _count_samples(run.setting["duration"], rate)
    moved = [signals.parse_input(f"support.{dof}", known) for dof in causes.motions]
    plant = local_control.build_plant(run.design, solver)
    sampled = time_domain.sample(plant, rate, causes.forces, moved, outputs)
    for line in (
        *sampled_filters.rounded_delays(plant, rate),
        *sampled_filters.aliasing_filters(plant.network, rate),
    ):
        run.log.warn(line)
    growth = time_domain.largest_growth(sampled)
    growing = _check_stability(run, plant, sampled, growth)
    before = 0
    if causes.is_random and growth <= 1 + time_domain.ROUNDING:
        before = -(-_run_in(run, growth, rate) // sampled.period) * sampled.period
    longest = min(count // 4, LONGEST_PIECE)
    has_spectrum = causes.is_random and longest >= LEAST_PIECE
    weight = _weigh(run.design)
    bounds = np.append(np.full(len(outputs), SMALL), np.full(len(sampled.actuators), weight))
    return _Plan(
        sampled=sampled,
        inputs=Inputs(causes, plant, before, rate),
        outputs=outputs,
        before=before,
        count=count,
        piece=1 << int(np.log2(longest)) if has_spectrum else 0,
        bounds=bounds,
        growing=growing,
    )


def _weigh(design: Design) -> float:
    """Weight of all bodies, N: no actuator pushes more, nor turns more at a distance of 1 m."""
    return gravity_strength(design) * sum(body_mass(stage.body) for stage in design.stage)


def _check_stability(run: Run, plant: Plant, sampled: Sampled, growth: float) -> list[str]:
    """Names of the loops that make a system unstable.

    Raises `InputError` if there are any, or warns with `--allow-unstable`. `growth` is the largest
    modulus of a pole z.
    """
    if growth <= 1 + time_domain.ROUNDING:
        return []
    rate = sampled.rate
    numbers = time_domain.find_growing_loops(sampled, len(plant.loops))
    names = [plant.loops[n].name for n in numbers]
    key = f"control.loop.{names[0]}" if len(names) == 1 else "control"
    which = f", and are stable without {' or '.join(names)}" if len(names) > 1 else ""
    time = 1 / (rate * np.log(growth))
    problem = (
        f"the sampled loops are unstable at {rate:g} Hz: they grow by e in {time:.3g} s{which}"
    )
    remedy = "check the sign, lower gain, delay or phase lag, or give a higher --rate"
    if not run.setting["allow_unstable"]:
        raise InputError.of(key, problem, f"{remedy}, or --allow-unstable")
    run.log.warn(f"{key}: {problem}; {remedy}")
    return names


class _Recorder:
    """Writes the group of a run block by block, with statistics and spectra."""

    def __init__(self, group: h5py.Group, plan: _Plan) -> None:
        self.group = group
        self.plan = plan
        self.motions = len(plan.outputs)
        sampled = plan.sampled
        actuators = len(sampled.actuators)
        self.statistics = Statistics(plan.bounds)
        self.at_limit = np.zeros(actuators, dtype=int)
        given = {
            "time": Reserved((plan.count,)),
            "output": tuple(signal.text for signal in plan.outputs),
            "unit": tuple(signal.unit for signal in plan.outputs),
            "value": Reserved((plan.count, self.motions)),
            "rms": Reserved((self.motions,)),
            "largest": Reserved((self.motions,)),
            "actuator": tuple(one.name for one in sampled.actuators),
            "actuator_unit": tuple(one.unit for one in sampled.actuators),
            "force": Reserved((plan.count, actuators)),
            "limit": sampled.limits,
            "at_limit": Reserved((actuators,)),
            "force_rms": Reserved((actuators,)),
            "largest_force": Reserved((actuators,)),
            "averages": 0,
        }
        self.spectra = None
        if plan.piece:
            self.spectra = WelchAverage(plan.piece, sampled.rate, self.motions + actuators)
            frequency = self.spectra.frequency
            given["frequency"] = frequency
            given["density"] = Reserved((len(frequency), self.motions))
            given["force_density"] = Reserved((len(frequency), actuators))
        stored.write_fields(group, Simulation, given)

    def record(self, run: Run) -> None:
        """Run the loops; raises `InputError` if numbers overflow, warns if they are large."""
        plan = self.plan
        total = plan.before + plan.count
        done = 0
        with run.log.progress() as bar, np.errstate(over="ignore", invalid="ignore"):
            for found, limited in plan.sampled.run(plan.inputs.take, total):
                ahead = max(plan.before - done, 0)
                start = max(done - plan.before, 0)
                self._add(start, found[ahead:], limited[ahead:])
                done += len(found)
                bar(done, total, 0.0)
        self._finish()
        excess, time = plan.describe_excess(self.statistics)
        if excess:
            remedy = f"give a --duration below {time:.4g} s"
            run.log.warn(f"{run.name}: {excess}, where a linear model does not apply; {remedy}")

    def _add(
        self,
        start: int,
        found: Float[np.ndarray, "sample signal"],
        limited: Bool[np.ndarray, "sample actuator"],
    ) -> None:
        """Write samples from a number on."""
        if not len(found):
            return
        self.statistics.add(found)
        if not np.isfinite(found).all():
            excess, time = self.plan.describe_excess(self.statistics)
            problem = f"is too long for an unstable system, whose motions overflow: {excess}"
            raise InputError.of("--duration", problem, f"give less than {time:.4g} s")
        some = slice(start, start + len(found))
        group = self.group
        rate = self.plan.sampled.rate
        _dataset(group, "time")[some] = np.arange(some.start, some.stop) / rate
        _dataset(group, "value")[some] = found[:, : self.motions]
        _dataset(group, "force")[some] = found[:, self.motions :]
        self.at_limit += limited.sum(0)
        if self.spectra is not None:
            self.spectra.add(found)

    def _finish(self) -> None:
        """Write what is known at the end."""
        group = self.group
        rms = self.statistics.rms
        largest = self.statistics.largest
        motions = self.motions
        _dataset(group, "rms")[...] = rms[:motions]
        _dataset(group, "largest")[...] = largest[:motions]
        _dataset(group, "force_rms")[...] = rms[motions:]
        _dataset(group, "largest_force")[...] = largest[motions:]
        _dataset(group, "at_limit")[...] = self.at_limit / self.plan.count
        if self.spectra is not None:
            density = self.spectra.density
            _dataset(group, "density")[...] = density[:, :motions]
            _dataset(group, "force_density")[...] = density[:, motions:]
            group.attrs["averages"] = self.spectra.averages


def _dataset(group: h5py.Group, name: str) -> Any:
    """Dataset of a group; the types of h5py do not distinguish items."""
    return group[name]


def _count_samples(duration: float, rate: float) -> int:
    """Number of samples; raises `InputError` if there are none."""
    count = round(duration * rate)
    if not count:
        problem = f"is less than a sample at {rate:g} Hz"
        raise InputError.of("--duration", problem, f"give at least {1 / rate:g}", f"{duration:g}")
    return count


def _check_space(run: Run, path: Path, size: float) -> None:
    """Warn of a large results file; raises `InputError` if the disk has no space for it."""
    free = shutil.disk_usage(path.parent).free
    if size > free:
        problem = f"makes a results file of {size / 1e9:.3g} GB, where {free / 1e9:.3g} GB are free"
        remedy = "give less, a lower --rate, or another --out"
        duration = run.setting["duration"]
        raise InputError.of("--duration", problem, remedy, f"{duration:g}")
    if size > LARGE:
        run.log.warn(f"{run.name}: the results file {path} takes {size / 1e9:.3g} GB")


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
