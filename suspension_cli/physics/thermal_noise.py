"""Thermal noise of any motion, from the power dissipated in each part.

The fluctuation-dissipation theorem (Callen and Welton, Phys. Rev. 83, 34 (1951)) in the form of
Levin, Phys. Rev. D 57, 659 (1998): let a force F cos(omega t) act on the observed motion r . x, and
let W be the mean power dissipated. Then

    S(omega) = 8 k T W / (F^2 omega^2),    W = (omega / 2) x^H Im(Z) x  with  Z x = F r,

one-sided, in m^2/Hz. Im(Z) is a sum over lossy parts j, each with its own temperature, and x^H
Im(Z_j) x a sum of squares, in which nothing cancels. The imaginary part of the susceptibility r .
Z^-1 r, in contrast, loses the digits of a high Q.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from suspension_cli.conventions import BOLTZMANN, DOFS
from suspension_cli.errors import InputError, format_value
from suspension_cli.files.declared import in_unit
from suspension_cli.files.documents import Layout
from suspension_cli.linear import signals
from suspension_cli.linear.pencil import FREQUENCIES
from suspension_cli.linear.signals import Signal
from suspension_cli.linear.solver import Solvable, Solver
from suspension_cli.linear.system import LinearSystem
from suspension_cli.linear.terms import quadratic_form
from suspension_cli.models import registry
from suspension_cli.models.spectrum_error import largest_error
from suspension_cli.physics import model_choice
from suspension_cli.scene.arrays import Array
from suspension_cli.studies.freed_memory import keep_freed_memory

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact

    from suspension_cli.design.reader import Source
    from suspension_cli.design.schema import Design
    from suspension_cli.models.registry import Choice

EARTH = 6.371e6
"""Mean radius of the Earth, m (Moritz, J. Geodesy 74, 128 (2000))."""
ROUNDING = 1e-9
"""Fraction of the sum below which a negative density is a rounding error."""


@dataclass(frozen=True)
class MotionNoise:
    """Thermal noise of one motion.

    Attributes
    ----------
    tilt
        Angle (rad) by which the observed direction rises above x.
    source
        Sources of dissipation: ``test.bending-upper`` and so on, the strongest (over all
        frequencies) first; of several motions, those of the first one come first.
    contribution
        One-sided amplitude spectral density by source, 0 where a source does not contribute.
    """

    in_json: ClassVar = Layout(
        only="output tilt amplitude density_unit parts",
        names={"amplitude": "displacement_asd", "density_unit": "unit", "parts": "contributions"},
    )
    frequency: Float[np.ndarray, " frequency"]
    output: str
    unit: str
    tilt: float = field(metadata=in_unit("rad"))
    source: tuple[str, ...]
    contribution: Float[np.ndarray, "frequency source"]

    @property
    def amplitude(self) -> Float[np.ndarray, " frequency"]:
        """Amplitude spectral density of the sum, unit/sqrt(Hz)."""
        return np.sqrt((self.contribution**2).sum(-1))

    @property
    def density(self) -> Float[np.ndarray, "source frequency"]:
        """One-sided power spectral density by source, unit^2/Hz."""
        return self.contribution.T**2

    @property
    def density_unit(self) -> str:
        """Unit of amplitude spectral densities."""
        return f"{self.unit}/sqrt(Hz)"

    @property
    def parts(self) -> dict[str, Float[np.ndarray, " frequency"]]:
        """Amplitude spectral density by source, unit/sqrt(Hz)."""
        return dict(zip(self.source, self.contribution.T, strict=True))


def solve(
    system: Solvable,
    frequency: Float[np.ndarray, " frequency"],
    outputs: Sequence[Signal],
    temperature: float,
) -> list[MotionNoise]:
    """Compute the thermal noise of motions at frequencies in Hz, above 0.

    Only sources that contribute to one of them are listed; without loss there are none. The support
    is at rest. `temperature` (K) is that of dampers and of the support's loss; other sources have
    their own.
    Raises `InputError` at a resonance without loss, and if a part gives power back (a spring or
    damper whose matrix is not positive).

    >>> from suspension_cli.design import reader
    >>> from suspension_cli.models import registry
    >>> model = registry.BEAM.system(reader.parse(reader.template("single", "single")))
    >>> [noise] = solve(model, np.array([10.0]), [parse_motion(model, "test.x")], 290.0)
    >>> noise.unit, noise.density.shape[1]
    ('m', 1)
    """
    solver = Solver.of(system)
    frequency = np.asarray(frequency, dtype=float)
    rows = np.array([signals.linear_form(signal, solver.system) for signal in outputs])
    found = compute_densities(solver, frequency, rows, temperature)
    names: list[str] = []
    for powers in found:
        _check_powers(powers, frequency)
        # the mean logarithm, strongest first
        order = sorted(powers, key=lambda name: -np.log(powers[name].clip(1e-300)).mean())
        names += [name for name in order if name not in names]
    parts = np.zeros((len(outputs), len(frequency), len(names)))
    for own, powers in zip(parts, found, strict=True):
        for name, power in powers.items():
            own[:, names.index(name)] = np.sqrt(power.clip(0))
    return [
        MotionNoise(frequency, signal.text, signal.unit, signal.tilt, tuple(names), own)
        for signal, own in zip(outputs, parts, strict=True)
    ]


def compute_densities(
    system: Solvable,
    frequency: Float[np.ndarray, " frequency"],
    rows: Float[np.ndarray, "output coordinate"],
    temperature: float,
    weights: Inexact[np.ndarray, "frequency sum output"] | None = None,
) -> list[dict[str, Float[np.ndarray, " frequency"]]]:
    """Compute power spectral densities (unit^2/Hz) of linear forms by source, as `solve` does.

    With `weights`, those of sums of the forms.
    """
    keep_freed_memory()
    solver = Solver.of(system)
    omega = 2 * np.pi * frequency
    found: list[dict[str, Array]] = [{} for _ in (rows if weights is None else weights[0])]
    blocks = [block for block in solver.blocks if rows[:, block.keep].any()]
    for start in range(0, len(omega), FREQUENCIES):
        now = slice(start, start + FREQUENCIES)
        there = solver.pencil.at(omega[now])
        for block in blocks:
            here = block.at(there)
            forces = rows[:, block.keep].T
            driven = np.flatnonzero(forces.any(0))
            moved = np.zeros((len(forces), len(rows), len(omega[now])), dtype=complex)
            still = np.zeros((6, len(driven)))
            moved[:, driven] = here.respond(np.eye(len(forces)), still, forces[:, driven])
            if weights is not None:
                moved = np.einsum("fso,cof->csf", weights[now], moved)
            for number in np.flatnonzero(moved.any((0, 2))):
                motion = moved[:, number]
                lost = [(cause, w, power) for (cause, w), power in here.dissipated(motion).items()]
                viscous = here.omega * quadratic_form(block.damping, motion)
                structural = quadratic_form(block.loss, motion)
                lost += [("damping", temperature, viscous), ("support", temperature, structural)]
                for cause, warmth, power in lost:
                    total = found[number].setdefault(cause, np.zeros(len(omega)))
                    total[now] += 4 * BOLTZMANN * warmth * power / omega[now]
    return [{name: power for name, power in one.items() if power.any()} for one in found]


def _check_powers(
    powers: dict[str, Float[np.ndarray, " frequency"]], frequency: Float[np.ndarray, " frequency"]
) -> None:
    """Raise `InputError` where a density is infinite or negative."""
    total = sum(powers.values(), np.zeros(len(frequency)))
    if not np.isfinite(total).all():
        at = format_value(float(frequency[~np.isfinite(total)][0]))
        problem = "is a resonance without loss, where the noise is infinite"
        remedy = "move it, or give loss_angle or damping"
        raise InputError.of("--frequency", problem, remedy, at)
    for name, power in powers.items():
        if (power < -ROUNDING * total).any():
            problem = "gives power back instead of dissipating it, so it has no thermal noise"
            remedy = "make its stiffness and damping matrices positive, or its loss angle 0"
            raise InputError.of(name, problem, remedy)


def amplitudes(
    design: Design, choice: Choice, frequency: Array, outputs: Sequence[str], arm: float
) -> tuple[Array, str]:
    """Compute the noise of all motions at a few frequencies, one after the other, and name it.

    In the model that was chosen for a design that differs in its losses.
    """
    system = choice.model.system(design)
    motions = parse_outputs(system, outputs, arm)
    noises = solve(system, frequency, motions, design.constants.temperature)
    return np.concatenate([one.amplitude for one in noises]), f"the thermal noise of {outputs[0]}"


def parse_motion(model: LinearSystem, text: str, tilt: float = 0.0) -> Signal:
    """Parse a motion; that along x is taken along a beam that rises by `tilt` (rad) instead."""
    signal = signals.parse_output(text, signals.bodies_with_signals(model))
    return replace(signal, tilt=tilt) if DOFS[signal.dof] == "x" else signal


def parse_outputs(model: LinearSystem, texts: Sequence[str], arm: float) -> list[Signal]:
    """Parse motions; those along x are taken along the beam of an arm of a length in m.

    Raises `InputError` if there is an arm and none is along x, or one is along y or z.
    """
    found = [parse_motion(model, text, compute_arm_tilt(arm)) for text in texts]
    along = [DOFS[signal.dof] for signal in found]
    for signal, dof in zip(found, along, strict=True):
        if arm and dof != "x" and (dof in "yz" or "x" not in along):
            problem = f"is for motion along x, not {signal.text}"
            raise InputError.of("--arm", problem, "leave it out, or give outputs along x")
    return found


def compute_arm_tilt(length: float) -> float:
    """Angle (rad) of a beam of some length (m) to the horizontal at its mirrors.

    The verticals at its two ends meet at the centre of the Earth.
    """
    return length / (2 * EARTH)


@dataclass(frozen=True)
class Noise:
    """Thermal noise of some motions at frequencies in Hz, as a result that decides on the model."""

    outputs: Sequence[str]
    frequency: Float[np.ndarray, " frequency"]
    arm: float = 0.0

    def change(self, simple: Solver, refined: Solver) -> tuple[float, str]:
        """Compute the largest relative change, see `models.spectrum_error`."""
        found = largest_error(self.frequency, simple, refined, self.amplitude)
        (output,) = found.place
        return found.value, f"the noise of {self.outputs[output]}"

    def amplitude(
        self, solver: Solver, frequency: Float[np.ndarray, " sample"]
    ) -> Float[np.ndarray, "sample output"]:
        """Solve for the noise of all outputs at frequencies in Hz."""
        motions = parse_outputs(solver.system, self.outputs, self.arm)
        noises = solve(solver, frequency, motions, 1.0)
        return np.stack([noise.amplitude for noise in noises], axis=1)


def choose(
    source: Source,
    wanted: str,
    frequency: Float[np.ndarray, " frequency"],
    outputs: Sequence[str],
    arm: float = 0.0,
) -> tuple[Choice, LinearSystem]:
    """Choose the model of thermal noise, and build its linear system.

    It must know where along a wire its loss acts.

    Raises `InputError` if the requested model does not resolve wires, or the design lacks their
    properties.
    """
    models = [model for model in registry.SCENE_MODELS if model.bends_wires]
    problem = f"the {wanted} model does not know where along a wire its loss acts"
    model_choice.demand_one_of(wanted, models, problem)
    if why := models[0].unsuitable(source.design):
        raise InputError.of("stage", why, "give its material and radius or section, for its loss")
    return model_choice.choose(source, wanted, lambda _: Noise(outputs, frequency, arm))
