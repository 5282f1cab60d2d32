"""Motion of a design's mirror by cause: ground, sensors, actuators, thermal noise.

>>> import suspension_cli as sus
>>> found = sus.budget(sus.example("double"), frequency=[1.0, 10.0], ground=["nlnm"])
>>> found.cause
('ground.x', 'ground.y', 'ground.z', 'thermal')

The physics is that of `physics.noise_budget`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from suspension_cli.analyses.record import Record
from suspension_cli.conventions import DOFS, SUPPORT
from suspension_cli.design.derive import mirror
from suspension_cli.errors import InputError, attribute_faults_to, format_value
from suspension_cli.files.declared import ADDED, ATTRIBUTE, along, derived, in_unit
from suspension_cli.files.documents import Layout
from suspension_cli.grids import decade_points, parse_frequencies, write_grid
from suspension_cli.linear import signals
from suspension_cli.linear.solver import Solver
from suspension_cli.models import registry
from suspension_cli.models.choice import Transfer
from suspension_cli.physics import ground, local_control, model_choice, noise_budget, thermal_noise
from suspension_cli.physics.closed_loop import find_steady_poles
from suspension_cli.physics.ground import Spectrum
from suspension_cli.physics.lossless import describe_lossless, find_lossless
from suspension_cli.physics.missing_losses import state_missing_losses
from suspension_cli.physics.near_limits import describe_falsified_losses
from suspension_cli.physics.noise_budget import Drive, MotionBudget, Requirement

if TYPE_CHECKING:
    from jaxtyping import Float

    from suspension_cli.analyses.analysis import Analysis, Run, Settings
    from suspension_cli.design.schema import Design
    from suspension_cli.linear.system import LinearSystem
    from suspension_cli.models.registry import Choice
    from suspension_cli.scene.arrays import Array

CREST = 4.0
"""Peak over RMS of a drive: Gaussian noise exceeds it for 6e-5 of the time."""


@dataclass(frozen=True, eq=False, repr=False)
class Budget(Record):
    """Motions by cause.

    Attributes
    ----------
    frequency
        Hz.
    output, unit
        Motions, and the unit of each.
    cause
        ``ground.x``, ``sensor.LOOP``, ``actuator.LOOP``, ``thermal``.
    source
        Name of the model or file of each cause; "" for those in the design.
    contribution
        One-sided amplitude spectral density by cause.
    mean_square, mean_square_velocity
        Mean squares from each frequency up by cause; infinite where a resonance without loss is
        driven.
    requirement
        What is required of each motion; may end before the last motion.
    drive
        RMS of the drive of each coil; None without OSEMs.
    mirrors
        Number of equal, independent suspensions whose powers are added.
    tilt
        Angle by which the direction of each motion rises above x, rad; None in files of earlier
        versions.
    by
        Lines of its tables and pictures: ``part`` or ``stage``.
    """

    in_json: ClassVar = Layout(
        only="frequency first drive others ground mirrors largest_tilt",
        names={"drive": "drive_rms", "others": "other_outputs", "largest_tilt": "tilt_rad"},
        sparse="drive largest_tilt",
        flat="first",
    )
    frequency: Float[np.ndarray, " frequency"] = field(metadata=in_unit("Hz"))
    output: tuple[str, ...]
    unit: tuple[str, ...] = field(metadata=along("output"))
    cause: tuple[str, ...]
    source: tuple[str, ...] = field(metadata=along("cause"))
    contribution: Float[np.ndarray, "frequency output cause"] = field(
        metadata=in_unit("{unit}/Hz^0.5")
    )
    mean_square: Float[np.ndarray, "frequency output cause"] = field(metadata=in_unit("{unit}^2"))
    mean_square_velocity: Float[np.ndarray, "frequency output cause"] = field(
        metadata=in_unit("{unit}^2/s^2")
    )
    requirement: tuple[Requirement | None, ...] = ()
    drive: tuple[Drive, ...] | None = field(default=None, metadata=along("coil"))
    mirrors: float = field(default=1.0, metadata=ADDED)
    by: str = field(default="part", metadata=ATTRIBUTE | ADDED)
    tilt: Float[np.ndarray, " output"] | None = field(default=None, metadata=in_unit("rad"))

    @property
    @derived("{unit}/Hz^0.5")
    def amplitude(self) -> Float[np.ndarray, "frequency output"]:
        """Amplitude spectral density of the sum over causes."""
        return np.sqrt((self.contribution**2).sum(-1))

    @property
    @derived("{unit}")
    def rms(self) -> Float[np.ndarray, "frequency output"]:
        """RMS of the motion from each frequency up."""
        return np.sqrt(self.mean_square.sum(-1))

    @property
    @derived("{unit}/s")
    def rms_velocity(self) -> Float[np.ndarray, "frequency output"]:
        """RMS of the velocity from each frequency up."""
        return np.sqrt(self.mean_square_velocity.sum(-1))

    @property
    def largest_tilt(self) -> float:
        """Largest angle of a motion to x, rad."""
        return 0.0 if self.tilt is None else float(self.tilt.max())

    @property
    def motions(self) -> tuple[MotionBudget, ...]:
        """Budget of each motion: its `amplitude` (f,), `parts` by cause, and `requirement`."""
        required = dict(enumerate(self.requirement))
        return tuple(
            MotionBudget(
                self.frequency,
                output,
                self.unit[n],
                self.cause,
                self.source,
                self.contribution[:, n],
                self.mean_square[:, n],
                self.mean_square_velocity[:, n],
                required.get(n),
                self.drive,
            )
            for n, output in enumerate(self.output)
        )

    @property
    def first(self) -> MotionBudget:
        """Budget of the first motion."""
        return self.motions[0]

    @property
    def others(self) -> tuple[MotionBudget, ...]:
        """Budgets of the other motions."""
        return self.motions[1:]

    @property
    def ground(self) -> dict[str, str]:
        """Names of models and files of the motion of the support, by coordinate."""
        return self.first.ground


def solve(analysis: Analysis, run: Run) -> Budget:
    """Compute the budget of every output."""
    setting = run.setting
    design = run.design
    folder = Path(run.source.file).parent
    motions, grid, notes = _ground(setting, folder)
    usual = [f"{mirror(design)}.{dof}" for dof in ("x", "pitch", "yaw")]
    outputs = list(setting["outputs"]) or usual
    requirements = _requirements(setting, outputs, folder, grid)
    choice, model, warm = _model(run, grid, outputs, notes)
    parsed = thermal_noise.parse_outputs(model, outputs, setting["arm"])
    solver = Solver(model)
    poles = find_steady_poles(design, solver, choice.model, "motion").value
    if choice.model.has_wire_mass:
        poles = np.append(poles, noise_budget.find_wire_modes(solver, float(grid[-1])))
    temperature = design.constants.temperature if warm else None
    plant = local_control.build_plant(design, solver)
    noises = noise_budget.Noises(plant, parsed, motions, temperature, setting["mirrors"])
    if not noises.cause:
        problem = "leaves no cause of motion"
        remedy = "give a ground, or loss angles"
        raise InputError.of("--ground", problem, remedy)
    added = ":" in setting["frequency"]
    found = noise_budget.solve(noises, grid, poles, requirements, added=added)
    for note in (*notes, *_findings(found)):
        run.log.warn(note)
    first = found[0]
    return Budget(
        frequency=first.frequency,
        output=tuple(one.output for one in found),
        unit=tuple(one.unit for one in found),
        cause=first.cause,
        source=first.source,
        contribution=np.stack([one.contribution for one in found], axis=1),
        mean_square=np.stack([one.mean_square for one in found], axis=1),
        mean_square_velocity=np.stack([one.mean_square_velocity for one in found], axis=1),
        requirement=tuple(one.requirement for one in found),
        drive=first.drive,
        mirrors=setting["mirrors"],
        by=setting["by"],
        tilt=np.array([signal.tilt for signal in parsed]),
        run=run.origin(analysis, choice),
    )


def _findings(found: Sequence[MotionBudget]) -> list[str]:
    """Warn of an infinite RMS, and of drives near the end of their range."""
    infinite = [
        f"{one.output}: the RMS is infinite, as a resonance without loss is driven;"
        " give loss angles or dampers"
        for one in found
        if np.isinf(one.rms).any()
    ]
    driven = [
        f"coil {one.coil}: {CREST:g} times the RMS of its drive (an assumed crest factor) is"
        f" {CREST * one.part:.3g} times its range, mostly due to {one.cause}"
        for one in found[0].drive or ()
        if CREST * one.part > 1
    ]
    return infinite + driven


def _ground(setting: Settings, folder: Path) -> tuple[dict[str, Spectrum], Array, list[str]]:
    """Return the motions of the support, the grid within their ranges, and warnings."""
    motions = ground.parse(setting["ground"], setting["isolation"], folder)
    grid = np.unique(parse_frequencies(setting["frequency"]))
    low = max((one.frequency[0] for one in motions.values()), default=0.0)
    high = min((one.frequency[-1] for one in motions.values()), default=math.inf)
    within = grid[(grid >= low) & (grid <= high)]
    if len(within) == len(grid):
        return motions, grid, []
    if not len(within):
        problem = f"has no frequency from {low:g} to {high:g} Hz, where the ground is known"
        remedy = "move it, or give a table of the ground there"
        shown = format_value(write_grid(setting["frequency"]))
        raise InputError.of("--frequency", problem, remedy, shown)
    if ":" in setting["frequency"]:
        within = np.union1d(within, [end for end in (low, high) if grid[0] < end < grid[-1]])
    cause = next(
        one.name
        for one in motions.values()
        if one.frequency[0] > grid[0] or one.frequency[-1] < grid[-1]
    )
    span = f"{within[0]:.4g} to {within[-1]:.4g} Hz"
    return motions, within, [f"frequencies are cut to {span}, the range of {cause}"]


def _requirements(
    setting: Settings, outputs: Sequence[str], folder: Path, grid: Array
) -> dict[int, Spectrum]:
    """Read the required spectra by number of the output."""
    result: dict[int, Spectrum] = {}
    for text in setting["requirements"]:
        name, equals, source = (part.strip() for part in text.rpartition("="))
        if equals and name not in outputs:
            remedy = f"give one of {', '.join(outputs)}, or add --output {name}"
            raise InputError.of("--requirement", "names no output", remedy, format_value(text))
        number = outputs.index(name) if equals else 0
        unit = "rad" if outputs[number].partition("@")[0].endswith(DOFS[3:]) else "m"
        path = ground.find(source, folder, "--requirement")
        with attribute_faults_to(str(path)):
            [found, *others] = ground.read(path, unit, setting["arm"]).values()
            if others:
                problem = f"has {1 + len(others)} columns of values instead of one"
                remedy = "write two columns, frequency and asd, and a file per output"
                raise InputError.of("", problem, remedy)
            first, last = found.frequency[[0, -1]]
            if first > grid[-1] or last < grid[0]:
                problem = (
                    f"is from {first:g} to {last:g} Hz, outside {grid[0]:g} to {grid[-1]:g} Hz of"
                    " the budget"
                )
                raise InputError.of("", problem, "move --frequency there")
        result[number] = found
    return result


def _model(
    run: Run, grid: Array, outputs: Sequence[str], notes: list[str]
) -> tuple[Choice, LinearSystem, bool]:
    """Choose the model; tell whether it has thermal noise. Warnings are added to `notes`."""
    source = run.source
    wanted = run.setting["fidelity"]
    arm = run.setting["arm"]
    try:
        choice, model = thermal_noise.choose(source, wanted, grid, outputs, arm)
        warm = True
        lossless = find_lossless(run.design, choice.level)
        notes += [f"{run.name}: {line}" for line in describe_lossless(lossless, choice.level)]
        notes += describe_falsified_losses(run.design, choice.level)
        few = grid[decade_points(grid)]
        level = choice

        def compute(design: Design) -> tuple[Array, str]:
            return thermal_noise.amplitudes(design, level, few, outputs, arm)

        lacking = state_missing_losses(run.design, choice, compute, run.setting["tolerance"])
        choice = lacking.choice
        notes += lacking.warnings
    except InputError as error:
        warm = False

        def request(system: LinearSystem) -> Transfer:
            known = signals.bodies_with_signals(system)
            inputs = [signals.parse_input(f"{SUPPORT}.{dof}", known) for dof in "xz"]
            return Transfer(inputs, thermal_noise.parse_outputs(system, outputs, arm), grid)

        choice, model = model_choice.choose(source, wanted, request)
        why = error.faults[0].problem
        if wanted != registry.AUTO:
            why = f"the {choice.level} model does not know where along a wire its loss acts"
        notes.append(f"{run.name}: thermal noise is left out, as {why}")
    controlled = run.design.control is not None
    model = model_choice.stable_system(source, choice, controlled, run.log, model, bends=True)
    return choice, model, warm
