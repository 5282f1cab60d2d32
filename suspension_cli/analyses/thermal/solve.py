"""Thermal noise of the motions of a design, split by what dissipates.

>>> import suspension_cli as sus
>>> noise = sus.thermal(sus.example("geo-silica-triple"), frequency=[10.0, 100.0])
>>> noise.output, noise.amplitude.shape
(('test.x',), (2, 1))

The physics is that of `physics.thermal_noise`. Near resonances the curves of the picture have more
frequencies than are asked for (`Thermal.fine`).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np

from suspension_cli.analyses.record import Record
from suspension_cli.conventions import SUPPORT
from suspension_cli.design.derive import mirror
from suspension_cli.drawing.added_points import add_from_model
from suspension_cli.errors import InputError, format_value
from suspension_cli.files.declared import ADDED, ATTRIBUTE, NOT_STORED, along, derived, in_unit
from suspension_cli.files.documents import Layout
from suspension_cli.grids import decade_points, parse_frequencies
from suspension_cli.linear.solver import Solver
from suspension_cli.models.choice import estimate_resonances
from suspension_cli.physics import model_choice, near_limits, thermal_noise
from suspension_cli.physics.lossless import describe_lossless, find_lossless
from suspension_cli.physics.missing_losses import Neglected, state_missing_losses
from suspension_cli.physics.thermal_noise import MotionNoise
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from collections.abc import Sequence

    from jaxtyping import Float

    from suspension_cli.analyses.analysis import Analysis, Run
    from suspension_cli.design.schema import Design
    from suspension_cli.drawing.added_points import Curve, Solve
    from suspension_cli.linear.signals import Signal
    from suspension_cli.models.registry import Choice


@dataclass(frozen=True)
class _Curve:
    """Contributions at any frequencies, for points that resolve resonances."""

    solver: Solver
    motions: Sequence[Signal]
    source: tuple[str, ...]
    temperature: float
    root: float

    def refine(self, frequency: Array, contribution: Array) -> Curve:
        """Add frequencies (Hz) to those of contributions until resonances are resolved."""
        return add_from_model(self.build, frequency, contribution, sums=True)

    def build(self) -> tuple[Solve, Array]:
        """The function of frequency, and frequencies of modes (Hz)."""
        return self.solve, estimate_resonances(self.solver)

    def solve(self, at: Array) -> Float[np.ndarray, "frequency output source"]:
        """Solve at frequencies in Hz."""
        noises = thermal_noise.solve(self.solver, at, self.motions, self.temperature)
        parts = [noise.parts for noise in noises]
        every = [[own.get(name, 0 * at) for name in self.source] for own in parts]
        return self.root * np.moveaxis(np.array(every), -1, 0)


@dataclass(frozen=True, eq=False, repr=False)
class Thermal(Record):
    """Thermal noise of motions.

    Attributes
    ----------
    frequency
        Hz.
    output, unit
        Motions, and the unit of each.
    tilt
        Angle by which the direction of each motion rises above x, rad.
    source
        Sources of dissipation: ``test.bending-upper`` and so on, the strongest (over all
        frequencies) first; of several motions, those of the first one come first.
    contribution
        One-sided amplitude spectral density by source, 0 where a source does not contribute.
    fine_frequency, fine
        Contributions at more frequencies, which resolve resonances, for the picture. They are
        computed when the result is first drawn or saved: of a result of `sus.thermal` itself they
        are None, `complete()` has them. None in files of earlier versions, too.
    mirrors
        Number of equal, independent suspensions whose powers are added.
    without_loss
        Parts that have no loss.
    missing_losses
        Losses that materials lack, and how large they are.
    """

    in_json: ClassVar = Layout(
        only="frequency mirrors without_loss missing_losses motions",
        names={"motions": "noises"},
        flat="motions",
    )
    frequency: Float[np.ndarray, " frequency"] = field(metadata=in_unit("Hz"))
    output: tuple[str, ...]
    unit: tuple[str, ...] = field(metadata=along("output"))
    tilt: Float[np.ndarray, " output"] = field(metadata=in_unit("rad"))
    source: tuple[str, ...]
    contribution: Float[np.ndarray, "frequency output source"] = field(
        metadata=in_unit("{unit}/Hz^0.5")
    )
    fine_frequency: Float[np.ndarray, " fine_frequency"] | None = field(
        default=None, metadata=in_unit("Hz")
    )
    fine: Float[np.ndarray, "fine_frequency output source"] | None = field(
        default=None, metadata=in_unit("{unit}/Hz^0.5")
    )
    mirrors: float = field(default=1.0, metadata=ADDED)
    without_loss: tuple[str, ...] = field(default=(), metadata=ATTRIBUTE | ADDED)
    missing_losses: tuple[str, ...] = field(default=(), metadata=ATTRIBUTE | ADDED)
    curve: _Curve | None = field(default=None, metadata=NOT_STORED)

    def complete(self) -> Self:
        """Return the record with the curve of its picture (`fine`), computed the first time."""
        return self._completed

    @cached_property
    def _completed(self) -> Self:
        if self.curve is None or self.fine is not None:
            return self
        fine_frequency, fine = self.curve.refine(self.frequency, self.contribution)
        return replace(self, fine_frequency=fine_frequency, fine=fine, curve=None)

    @property
    @derived("{unit}/Hz^0.5")
    def amplitude(self) -> Float[np.ndarray, "frequency output"]:
        """Amplitude spectral density of the sum over sources."""
        return np.sqrt((self.contribution**2).sum(-1))

    @property
    def motions(self) -> tuple[MotionNoise, ...]:
        """Noise of each motion: its `amplitude` (f,), and `parts` by source."""
        return self._split(self.frequency, self.contribution)

    @property
    def curves(self) -> tuple[MotionNoise, ...]:
        """Noise of each motion at the frequencies of the picture, computed the first time."""
        drawn = self.complete()
        if drawn.fine_frequency is None or drawn.fine is None:
            return self.motions
        return self._split(drawn.fine_frequency, drawn.fine)

    def _split(self, frequency: Array, contribution: Array) -> tuple[MotionNoise, ...]:
        return tuple(
            MotionNoise(
                frequency,
                output,
                self.unit[n],
                float(self.tilt[n]),
                self.source,
                contribution[:, n],
            )
            for n, output in enumerate(self.output)
        )


def solve(analysis: Analysis, run: Run) -> Thermal:
    """Compute the noise of every output; raises `InputError` if nothing dissipates."""
    setting = run.setting
    frequency = np.array(parse_frequencies(setting["frequency"]))
    arm = setting["arm"]
    outputs = setting["outputs"] or (f"{mirror(run.design)}.x",)
    choice, model = thermal_noise.choose(run.source, setting["fidelity"], frequency, outputs, arm)
    solver = Solver(model)
    model_choice.stable_system(run.source, choice, setting["allow_unstable"], run.log, solver)
    motions = thermal_noise.parse_outputs(model, outputs, arm)
    _demand_bodies(motions)
    temperature = run.design.constants.temperature
    noises = thermal_noise.solve(solver, frequency, motions, temperature)
    _demand_loss(noises)
    root = setting["mirrors"] ** 0.5
    contribution = root * np.stack([noise.contribution for noise in noises], axis=1)
    source = noises[0].source
    lacking = _state_losses(run, choice, frequency, outputs)
    near_limits.warn_of_tables(run.design, frequency, run.log)
    lossless = find_lossless(run.design, choice.level)
    return Thermal(
        frequency=frequency,
        output=tuple(noise.output for noise in noises),
        unit=tuple(noise.unit for noise in noises),
        tilt=np.array([noise.tilt for noise in noises]),
        source=source,
        contribution=contribution,
        mirrors=setting["mirrors"],
        without_loss=tuple(part.part for part in lossless),
        missing_losses=tuple(lacking.losses),
        curve=_Curve(solver, motions, source, temperature, root),
        run=run.origin(analysis, lacking.choice),
    )


def _demand_bodies(motions: Sequence[Signal]) -> None:
    """Raise `InputError` for a motion of the support."""
    for signal in motions:
        if signal.body == SUPPORT:
            problem = "the support is at rest and has no thermal noise"
            remedy = "name a stage, for example test.x"
            raise InputError.of("--output", problem, remedy, format_value(signal.text))


def _demand_loss(noises: Sequence[MotionNoise]) -> None:
    """Raise `InputError` for a motion that moves nothing that dissipates."""
    for noise in noises:
        if not noise.contribution.any():
            problem = "nothing that moves with it dissipates, so it has no thermal noise"
            remedy = (
                "give the materials of its wires a loss (--set materials.NAME.loss_angle=1e-4),"
                " or blades a loss_angle, [gas] or [stage.damping]"
            )
            raise InputError.of("--output", problem, remedy, format_value(noise.output))


def _state_losses(run: Run, choice: Choice, frequency: Array, outputs: Sequence[str]) -> Neglected:
    """Add losses that materials lack to what is neglected, and warn of parts without loss."""
    few = frequency[decade_points(frequency)]

    def compute(design: Design) -> tuple[Array, str]:
        return thermal_noise.amplitudes(design, choice, few, outputs, run.setting["arm"])

    lossless = find_lossless(run.design, choice.level)
    lacking = state_missing_losses(run.design, choice, compute, run.setting["tolerance"])
    level = lacking.choice.level
    for line in describe_lossless(lossless, level):
        run.log.warn(f"{run.name}: {line}")
    for line in (*near_limits.describe_falsified_losses(run.design, level), *lacking.warnings):
        run.log.warn(line)
    return lacking
