"""Motion of a suspension by cause: spectra, cumulative RMS, comparison with a requirement.

The mean square of a motion x of power spectral density S(f) is the integral of S, that of its
velocity the integral of (2 pi f)^2 S; cumulative from the highest frequency f_max down,

    RMS(f)^2 = integral of S from f to f_max.

Between the points of the grid spectra are power laws. Points are added around each resonance, and
where the estimated error of an interval exceeds `ACCURACY` of the integral above its lower end.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from suspension_cli.conventions import GROUND, SUPPORT
from suspension_cli.design.control import Osem
from suspension_cli.files.declared import derived, in_unit
from suspension_cli.files.documents import Layout
from suspension_cli.linear import signals
from suspension_cli.linear.signals import Signal
from suspension_cli.linear.solver import Solvable, Solver
from suspension_cli.physics import local_control, wire_modes
from suspension_cli.physics.ground import Spectrum
from suspension_cli.physics.local_control import Plant
from suspension_cli.physics.thermal_noise import compute_densities
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Complex, Float

MOST = 2000
"""Most wire modes whose widths are computed."""
ACCURACY = 3e-5
"""Largest estimated error of an interval over the integral from its lower end up."""
NARROWEST = 1e-13
"""Relative width at which intervals are not divided any more: enough for a Q of about 1e11."""
FRACTION = 0.47
"""Where an interval is divided: not in the middle, which may be a pole without loss."""
EQUAL = 1e-6
"""Logarithm of a ratio below which two values are equal."""
ROUNDS = 60
"""Most divisions of an interval."""
RANGE = 0.05
"""Relative distance from a resonance up to which points are placed around it."""
STEP = 1.0
"""Step in u of the points f + w sinh(u) around a resonance of half width w."""


@dataclass(frozen=True)
class Surroundings:
    """What moves the support, and how many mirrors count.

    Attributes
    ----------
    motion
        Of the support, by coordinate.
    band
        Lowest and highest frequency, Hz, over which an RMS is taken by default.
    mirrors
        Number of equal, independent mirrors whose motions add up.
    """

    motion: dict[str, Spectrum]
    band: tuple[float, float]
    mirrors: float = 1.0


@dataclass(frozen=True)
class Noises:
    """Causes that move a suspension with or without loops.

    `motion` is that of the support by coordinate. `temperature` (K) is that of dampers and of the
    support's loss; None leaves thermal noise out. Densities are those of one suspension times
    `mirrors`, the number of equal, independent ones.
    """

    plant: Plant
    output: list[Signal]
    motion: dict[str, Spectrum]
    temperature: float | None
    mirrors: float = 1.0

    @property
    def cause(self) -> tuple[str, ...]:
        """Names of the causes (c)."""
        sensing, pushing = self._noisy
        return (
            *(f"ground.{dof}" for dof in self.motion),
            *(f"sensor.{self.plant.sensors[n].name}" for n in sensing),
            *(f"actuator.{self.plant.actuators[n].name}" for n in pushing),
            *(["thermal"] if self.temperature is not None else []),
        )

    @property
    def source(self) -> tuple[str, ...]:
        """Name of the model or file of each cause (c); "" for those in the design."""
        names = [motion.name for motion in self.motion.values()]
        return (*names, *[""] * (len(self.cause) - len(names)))

    @property
    def _noisy(self) -> tuple[list[int], list[int]]:
        """Numbers of the sensors and actuators with noise."""
        plant = self.plant
        at = np.ones(1)
        sensing = [local_control.evaluate_noise(one, at).any() for one in plant.sensors]
        pushing = [local_control.evaluate_actuator_noise(one, at).any() for one in plant.actuators]
        return np.flatnonzero(sensing).tolist(), np.flatnonzero(pushing).tolist()

    def density(
        self, frequency: Float[np.ndarray, " frequency"]
    ) -> Float[np.ndarray, "output cause frequency"]:
        """Compute power spectral densities, m^2/Hz or rad^2/Hz, at frequencies in Hz.

        Behind those of the outputs are those of the forces that loops demand of coils, N^2/Hz.
        """
        plant = self.plant
        count = len(self.motion)
        known = signals.bodies_with_signals(plant.model)
        # the ground under the support and beside it moves as one
        moved = (SUPPORT,) if plant.model.ground is None else (SUPPORT, GROUND)
        texts = [f"{body}.{dof}" for body in moved for dof in self.motion]
        inputs = [signals.parse_input(text, known) for text in texts]
        both = local_control.solve_loops(plant, frequency, inputs, self.output)
        external = np.concatenate([one.external for one in both], axis=1)
        value = external.reshape(*external.shape[:2], len(moved), count).sum(2)
        asd = np.array([motion.at(frequency) for motion in self.motion.values()])
        sensing, pushing = self._noisy
        parts = [np.abs(value) * asd.reshape(count, len(frequency)).T[:, None]]
        parts.append(np.concatenate([one.sensor_noise for one in both], axis=1)[..., sensing])
        parts.append(np.concatenate([one.actuator_noise for one in both], axis=1)[..., pushing])
        if self.temperature is not None:
            # thermal motion of what is observed, and of what sensors read with the loops open
            rows = [signals.linear_form(signal, plant.model) for signal in self.output]
            direct = np.eye(value.shape[1], len(rows))
            closed = np.concatenate([one.sensing for one in both], axis=1)
            weights = [np.broadcast_to(direct, (len(frequency), *direct.shape)), closed]
            powers = compute_densities(
                plant.solver,
                frequency,
                np.concatenate([rows, plant.sensed]),
                self.temperature,
                np.concatenate(weights, axis=2),
            )
            none = np.zeros(len(frequency))
            warm = np.array([sum(one.values(), none) for one in powers])
            parts.append(np.sqrt(warm).T[..., None])
        result = np.moveaxis(np.concatenate(parts, axis=2) ** 2, 0, -1)
        result[: len(self.output)] *= self.mirrors
        return result


def find_wire_modes(system: Solvable, highest: float) -> Complex[np.ndarray, " pole"]:
    """Poles (rad/s) of modes up to a frequency in Hz, of a model with wire mass."""
    solver = Solver.of(system)
    if not 0 < wire_modes.count_modes(solver, highest) <= MOST:
        return np.zeros(0, dtype=complex)
    found = wire_modes.solve(solver, highest)
    return -found.decay_rate + 1j * np.sqrt(np.maximum(found.omega_squared, 0.0))


@dataclass(frozen=True)
class Requirement:
    """A required amplitude spectral density (unit/sqrt(Hz)), and the margin to it.

    `margin` is the smallest ratio of requirement to motion, `at` its frequency, and `exceeded` are
    intervals in which the motion is above the requirement, Hz. `unit` is that of the motion.
    """

    in_json: ClassVar = Layout(
        only="name met margin at exceeded",
        names={"name": "file", "at": "at_hz"},
    )
    name: str
    frequency: Float[np.ndarray, " frequency"] = field(metadata=in_unit("Hz"))
    density: Float[np.ndarray, " frequency"] = field(metadata=in_unit("{unit}/Hz^0.5"))
    margin: float
    at: float
    exceeded: tuple[tuple[float, float], ...] = field(metadata=in_unit("Hz", "interval end"))
    unit: str

    @property
    @derived()
    def end(self) -> tuple[str, ...]:
        """Ends of the intervals."""
        return "from", "to"

    @property
    def met(self) -> bool:
        """Whether the motion nowhere exceeds it."""
        return self.margin >= 1

    @property
    def outcome(self) -> str:
        """Describe whether it is met, and by how much."""
        if self.met:
            size = f"{self.margin:.3g}" if np.isfinite(self.margin) else "infinite"
            return f"met, smallest margin {size} at {self.at:.4g} Hz"
        excess = 1 / self.margin if self.margin else np.inf
        return f"NOT met, exceeded by a factor of {excess:.3g} at {self.at:.4g} Hz"


@dataclass(frozen=True)
class Drive:
    """RMS of what the loops demand of one coil, and the cause of the largest part.

    `voltage` is at the driver's input, `part` the RMS over the range; NaN where factors are not
    given.
    """

    in_json: ClassVar = Layout(names={"part": "part_of_range"})
    coil: str
    force: float = field(metadata=in_unit("N"))
    current: float = field(metadata=in_unit("A"))
    voltage: float = field(metadata=in_unit("V"))
    counts: float
    part: float
    cause: str


@dataclass(frozen=True)
class MotionBudget:
    """One motion by cause.

    Attributes
    ----------
    frequency
        Hz.
    cause
        ``ground.x``, ``sensor.LOOP``, ``actuator.LOOP``, ``thermal``.
    source
        Name of the model or file of each cause; "" for those in the design.
    contribution
        One-sided amplitude spectral density by cause, unit/sqrt(Hz).
    mean_square, mean_square_velocity
        Mean squares from each frequency up by cause, unit^2 and unit^2/s^2; infinite where a
        resonance without loss is driven.
    drive
        RMS of the drive of each coil, the same for all outputs; None without OSEMs.
    """

    in_json: ClassVar = Layout(
        only="output density_unit amplitude parts total_rms total_rms_velocity rms_by_cause"
        " rms_velocity_by_cause rms rms_velocity requirement",
        names={
            "density_unit": "unit",
            "amplitude": "displacement_asd",
            "parts": "contributions",
            "total_rms": "rms",
            "total_rms_velocity": "rms_velocity",
            "rms": "cumulative_rms",
            "rms_velocity": "cumulative_rms_velocity",
        },
        sparse="requirement",
    )
    frequency: Float[np.ndarray, " frequency"]
    output: str
    unit: str
    cause: tuple[str, ...]
    source: tuple[str, ...]
    contribution: Float[np.ndarray, "frequency cause"]
    mean_square: Float[np.ndarray, "frequency cause"]
    mean_square_velocity: Float[np.ndarray, "frequency cause"]
    requirement: Requirement | None = None
    drive: tuple[Drive, ...] | None = None

    @property
    def amplitude(self) -> Float[np.ndarray, " frequency"]:
        """Amplitude spectral density of the sum."""
        return np.sqrt((self.contribution**2).sum(-1))

    @property
    def rms(self) -> Float[np.ndarray, " frequency"]:
        """RMS of the motion from each frequency up."""
        return np.sqrt(self.mean_square.sum(-1))

    @property
    def rms_velocity(self) -> Float[np.ndarray, " frequency"]:
        """RMS of the velocity from each frequency up."""
        return np.sqrt(self.mean_square_velocity.sum(-1))

    @property
    def density_unit(self) -> str:
        """Unit of amplitude spectral densities."""
        return f"{self.unit}/sqrt(Hz)"

    @property
    def parts(self) -> dict[str, Float[np.ndarray, " frequency"]]:
        """Amplitude spectral density by cause."""
        return dict(zip(self.cause, self.contribution.T, strict=True))

    @property
    def total_rms(self) -> float:
        """RMS of the motion."""
        return float(self.rms[0])

    @property
    def total_rms_velocity(self) -> float:
        """RMS of the velocity."""
        return float(self.rms_velocity[0])

    @property
    def rms_by_cause(self) -> dict[str, float]:
        """RMS of the motion due to each cause."""
        return dict(zip(self.cause, self.mean_square[0] ** 0.5, strict=True))

    @property
    def rms_velocity_by_cause(self) -> dict[str, float]:
        """RMS of the velocity due to each cause."""
        return dict(zip(self.cause, self.mean_square_velocity[0] ** 0.5, strict=True))

    @property
    def ground(self) -> dict[str, str]:
        """Names of models and files of the motion of the support, by coordinate."""
        pairs = zip(self.cause, self.source, strict=True)
        return {cause.partition(".")[2]: source for cause, source in pairs if source}


def solve(
    noises: Noises,
    grid: Float[np.ndarray, " frequency"],
    resonance: Complex[np.ndarray, " pole"],
    requirements: dict[int, Spectrum],
    *,
    added: bool,
) -> list[MotionBudget]:
    """Compute the budget of every output, on an ascending grid in Hz.

    Points are added around resonances (poles, rad/s); the spectra include them if `added`.
    `requirements` are those of outputs, by their number.
    """
    decades = 10.0 ** np.arange(np.ceil(np.log10(grid[0])), np.log10(grid[-1]))
    corners = [one.frequency for one in (*noises.motion.values(), *requirements.values())]
    seeds = np.concatenate([points_around(resonance), decades, *corners])
    within = seeds[(seeds > grid[0]) & (seeds < grid[-1])]
    frequency, density = refine(noises.density, np.union1d(grid, within))
    square = integrate_down(frequency, density)
    velocity = integrate_down(frequency, density * (2 * np.pi * frequency) ** 2)
    if len(grid) == 1:
        square = np.full_like(square, np.nan)
        velocity = np.full_like(velocity, np.nan)
    drive = _find_drives(noises, frequency, density[len(noises.output) :])
    shown = slice(None) if added else np.isin(frequency, grid)
    met = {
        n: compare(frequency, np.sqrt(density[n].sum(0)), required, noises.output[n].unit)
        for n, required in requirements.items()
    }
    return [
        MotionBudget(
            frequency[shown],
            signal.text,
            signal.unit,
            noises.cause,
            noises.source,
            np.sqrt(density[n][:, shown]).T,
            square[n][:, shown].T,
            velocity[n][:, shown].T,
            met.get(n),
            drive or None,
        )
        for n, signal in enumerate(noises.output)
    ]


def _find_drives(
    noises: Noises,
    frequency: Float[np.ndarray, " frequency"],
    density: Float[np.ndarray, "osem cause frequency"],
) -> tuple[Drive, ...]:
    """Find what drives each coil from the densities of its force by cause, N^2/Hz.

    RMS values of a single frequency are not known: NaN.
    """
    found = []
    for osem, force in zip(noises.plant.osems, density, strict=True):
        power = np.full(len(force), np.nan)
        input_power = power
        if len(frequency) > 1:
            power = integrate_down(frequency, force)[:, 0]
            through = osem.driver_size(frequency)
            with np.errstate(divide="ignore"):
                input_power = integrate_down(frequency, force / through**2)[:, 0]
        found.append(_drive(osem, power, input_power, noises.cause))
    return tuple(found)


def _drive(
    osem: Osem,
    power: Float[np.ndarray, " cause"],
    input_power: Float[np.ndarray, " cause"],
    cause: tuple[str, ...],
) -> Drive:
    """Convert the mean square of the force of a coil by cause, N^2, to what drives it.

    `input_power` is that over the square of the driver's response.
    """
    force = float(np.sqrt(power.sum()))
    current = force / (osem.coil or np.nan)
    of_input = float(np.sqrt(input_power.sum())) / (osem.coil or np.nan)
    voltage = of_input / (osem.transconductance or np.nan)
    counts = voltage * (osem.counts_per_volt or np.nan)
    part = (voltage if osem.transconductance else current) / (osem.range or np.nan)
    return Drive(osem.name, force, current, voltage, counts, part, cause[int(power.argmax())])


def points_around(resonance: Complex[np.ndarray, " pole"]) -> Float[np.ndarray, " point"]:
    """Place frequencies in Hz around poles in rad/s, denser towards them."""
    centre = np.abs(np.imag(resonance)) / (2 * np.pi)
    width = np.maximum(np.abs(np.real(resonance)) / (2 * np.pi), NARROWEST * centre)
    u = STEP * np.arange(np.arcsinh(RANGE / NARROWEST) / STEP)
    some = np.sinh(u) * width[:, None] <= RANGE * centre[:, None]
    some &= (centre > 0)[:, None] & (width < RANGE * centre)[:, None]
    # half a step aside, as the motion may be infinite at the resonance
    offset = width[:, None] * np.sinh(u + STEP / 2)
    return np.concatenate([(centre[:, None] + side * offset)[some] for side in (-1, 1)])


def refine(
    density: Callable[[Array], Array], grid: Float[np.ndarray, " given"]
) -> tuple[Float[np.ndarray, " frequency"], Float[np.ndarray, "output cause frequency"]]:
    """Add points to a grid (Hz) until the integrals over spectra, and of velocity, are accurate.

    Returns the refined grid and the densities there.
    """
    value = density(grid)
    for _ in range(ROUNDS):
        total = value.sum(1)
        weighted = np.stack([total, total * (2 * np.pi * grid) ** 2])
        area = _areas(grid, weighted)
        above = np.cumsum(area[..., ::-1], axis=-1)[..., ::-1]
        # two intervals taken as one have four times the error
        error = np.abs(_areas(grid, weighted, 2) - area[..., :-1] - area[..., 1:]) / 3
        around = np.zeros_like(area)
        around[..., :-1] = error
        around[..., 1:] = np.maximum(around[..., 1:], error)
        low = grid[:-1]
        width = np.diff(grid)
        rough = (around > ACCURACY * above).any((0, 1)) & (width > NARROWEST * grid[1:])
        at = np.flatnonzero(rough)
        if not len(at):
            break
        middle = low[at] + FRACTION * width[at]
        value = np.insert(value, at + 1, density(middle), axis=-1)
        grid = np.insert(grid, at + 1, middle)
    return grid, value


def integrate_down(
    frequency: Float[np.ndarray, " frequency"], value: Float[np.ndarray, "*batch frequency"]
) -> Float[np.ndarray, "*batch frequency"]:
    """Integrate (..., f) from the highest frequency down to each one; power laws are exact.

    Infinite from a pole without loss down, beside which even the narrowest intervals matter.
    """
    area = _areas(frequency, value)
    above = np.cumsum(area[..., ::-1], axis=-1)[..., ::-1]
    narrow = np.diff(frequency) <= NARROWEST * frequency[1:]
    area = np.where(narrow & (area > ACCURACY * above), np.inf, area)
    result = np.zeros_like(value)
    result[..., :-1] = np.cumsum(area[..., ::-1], axis=-1)[..., ::-1]
    return result


def _areas(
    frequency: Float[np.ndarray, " frequency"],
    value: Float[np.ndarray, "*batch frequency"],
    step: int = 1,
) -> Float[np.ndarray, "*batch interval"]:
    """Integrate from each frequency to that `step` places on.

    S is a power law, so the integral of f S over ln f is the width in ln f times the logarithmic
    mean of f S, (b - a) / ln(b / a). Next to a 0, S is linear.
    """
    first = value[..., :-step]
    last = value[..., step:]
    low = frequency[:-step]
    a = low * first
    b = frequency[step:] * last
    width = frequency[step:] - low
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.log(b / a)
        mean = np.where(np.abs(ratio) > EQUAL, (b - a) / ratio, (a + b) / 2)
    power = np.log1p(width / low) * mean
    return np.where((first > 0) & (last > 0), power, (first + last) / 2 * width)


def compare(
    frequency: Float[np.ndarray, " frequency"],
    total: Float[np.ndarray, " frequency"],
    required: Spectrum,
    unit: str,
) -> Requirement | None:
    """Compare an amplitude spectral density (f,) with a required one; None if none is known."""
    known = (frequency >= required.frequency[0]) & (frequency <= required.frequency[-1])
    if not known.any():
        return None
    where = frequency[known]
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = required.at(where) / total[known]
    ratio = np.where(np.isnan(ratio), np.inf, ratio)
    least = int(ratio.argmin())
    edges = np.flatnonzero(np.diff(ratio < 1, prepend=False, append=False))
    spans = where[edges.reshape(-1, 2) - [0, 1]]
    return Requirement(
        required.name,
        required.frequency,
        required.value,
        float(ratio[least]),
        float(where[least]),
        tuple(map(tuple, spans.tolist())),
        unit,
    )
