"""Random builds, their results, and requirements on these by name.

A quantity is the frequency of a mode (by label or number), ``coupling`` (the magnitude of the
analysis' cross-coupling at its last frequency), a static displacement or rotation such as ``test
static pitch``, or the magnitude of a named response (`linear.named_results`). A requirement is
``QUANTITY in LEAST:LARGEST``, or ``QUANTITY < LIMIT`` or ``QUANTITY > LIMIT`` for magnitudes.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.design.faults import suggest
from suspension_cli.design.paths import DISPLAYED
from suspension_cli.design.schema import Design
from suspension_cli.errors import InputError, format_value, gather
from suspension_cli.linear import batch_modes, eigenmodes, mode_content, named_results, signals
from suspension_cli.linear.batch_modes import Spectrum
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.mode_content import Motion
from suspension_cli.linear.mode_pairing import pair_bodies, pair_by_overlap
from suspension_cli.linear.named_results import Mode, Ratio
from suspension_cli.models import registry
from suspension_cli.models.base import Model
from suspension_cli.models.choice import Frequencies, Systems, compare_builds
from suspension_cli.physics.couplings import CouplingRequest, couplings
from suspension_cli.studies import builds, sampling
from suspension_cli.studies.builds import Builds
from suspension_cli.studies.extremes import find_largest
from suspension_cli.studies.job import Job, nominal_system
from suspension_cli.studies.run import Columns
from suspension_cli.studies.sampling import RANDOM, SamplePoints

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float

    from suspension_cli.models.choice import Comparison

    Deviations = Float[np.ndarray, "build factor"]
    """Random deviations of builds."""

COUPLING = "coupling"
"""Name of the cross-coupling of the analysis."""
STATIC = {"x": "m", "y": "m", "height": "m", "roll": "rad", "pitch": "rad", "yaw": "rad"}
"""Units of the static displacements and rotations of a body, in the order of its coordinates."""
SYNTAX = "write 'QUANTITY in LEAST:LARGEST', 'QUANTITY < LIMIT' or 'QUANTITY > LIMIT', in SI units"
SEARCHED = 1000
"""First builds from which the extreme ones are taken."""
EXTREME = 15
"""Number of builds with the largest deviations, at which models are compared."""


@dataclass(frozen=True)
class Quantity:
    """One result of every build, in SI units; Hz for modes.

    Its values are at a `place` in the rows of a `column`. A complex result is taken with its sign
    (see `with_sign`), or by its magnitude.
    """

    name: str
    unit: str
    column: str
    place: tuple[int, ...]
    ratio: Ratio | None = None
    signed: bool = False

    @property
    def displayed(self) -> tuple[str, float]:
        """Unit in which values are shown, "" for ratios, and the factor from SI to it."""
        name, factor = DISPLAYED.get(self.unit, (self.unit, 1.0))
        return ("" if name == "1" else name), factor

    def read(
        self, columns: Mapping[str, Any], some: slice = slice(None)
    ) -> Float[np.ndarray, " build"]:
        """Read the values in some builds; NaN where a build failed."""
        values = columns[self.column][(some, *self.place)]
        if self.signed:
            return with_sign(values)
        return np.abs(values) if np.iscomplexobj(values) else values


RATIO = Quantity(COUPLING, "1", "ratio", (-1,))
SIGNED = Quantity("coupling with its sign", "1", "ratio", (-1,), signed=True)


def with_sign(ratio: Complex[np.ndarray, " build"]) -> Float[np.ndarray, " build"]:
    """Parts of complex numbers along the phase in which they vary most; NaN of NaN.

    Small imperfections add up with their signs, which magnitudes hide. Real ratios are unchanged.

    >>> with_sign(np.array([2.0, -1.0, 0.5]) * (1 + 0j))
    array([ 2. , -1. ,  0.5])
    """
    known = ratio[np.isfinite(ratio)]
    if not len(known):
        return np.full(len(ratio), np.nan)
    phase = np.angle(((known - known.mean()) ** 2).sum()) / 2
    return (ratio * np.exp(-1j * phase)).real


@dataclass(frozen=True)
class Requirement:
    """A requirement on a quantity, by name: least and largest value, SI, or infinite.

    A limit on the magnitude must not be equalled. `key` gave it, for error messages.
    """

    quantity: str
    low: float
    high: float
    magnitude: bool
    key: str = field(default="--require", compare=False)

    @property
    def text(self) -> str:
        """Text for ``--require``, exact to the last digit."""
        low, high = self.low, self.high
        if not self.magnitude:
            return f"{self.quantity} in {low!r}:{high!r}"
        return f"{self.quantity} " + (f"< {high!r}" if high < math.inf else f"> {low!r}")

    def describe(self, quantity: Quantity) -> str:
        """Describe it in usual units, with the unique name of its quantity."""
        unit, per = quantity.displayed
        low, high = self.low * per, self.high * per
        if not self.magnitude:
            return f"{quantity.name} in {low:g} to {high:g} {unit}".rstrip()
        name = f"|{quantity.name}|" if quantity.column == "static" else quantity.name
        limit = f"< {high:g}" if high < math.inf else f"> {low:g}"
        return f"{name} {limit} {unit}".rstrip()

    def is_met(self, values: Float[np.ndarray, " build"]) -> Bool[np.ndarray, " build"]:
        """Whether builds with these values meet it; failed builds (NaN) do not."""
        if self.magnitude:
            size = np.abs(values)
            return (size > self.low) & (size < self.high)
        return (values >= self.low) & (values <= self.high)


def requirements(design: Design, options: Sequence[str]) -> tuple[Requirement, ...]:
    """Parse the requirements of a design and of ``--require``, without looking up quantities."""
    found = []
    for n, one in enumerate(design.tolerance.require if design.tolerance else (), 1):
        low, high = one.band or (one.above or -math.inf, one.below or math.inf)
        key = f"tolerance.require.{n}.quantity"
        found.append(Requirement(one.quantity, low, high, one.band is None, key))
    return tuple(dict.fromkeys((*found, *gather(parse, options))))


def parse(text: str) -> Requirement:
    """Parse one requirement as ``--require`` takes it."""

    def refused(problem: str, remedy: str = SYNTAX) -> InputError:
        return InputError.of("--require", problem, remedy, format_value(text))

    words = " ".join(text.split())  # single blanks: patterns of runs of them take long
    found = re.fullmatch(r"(.+?) (in) ([^: ]+) ?: ?([^: ]+)", words)
    found = found or re.fullmatch(r"([^<>]+?) ?([<>]) ?([^ <>]+)", words)
    if found is None:
        raise refused("is no requirement")
    name, sign, *limits = found.groups()
    try:
        numbers = [float(limit) for limit in limits]
    except ValueError:
        raise refused("has a limit that is no number") from None
    if not np.isfinite(numbers).all():
        raise refused("has a limit that is not finite")
    if sign == "in":
        low, high = numbers
        if not low < high:
            raise refused("is a reversed or empty band", "give LEAST:LARGEST")
        return Requirement(name, low, high, magnitude=False)
    [limit] = numbers
    if not limit > 0:
        problem = "limits a magnitude to a value that is not positive"
        raise refused(problem, "give a positive limit")
    low, high = (-math.inf, limit) if sign == "<" else (limit, math.inf)
    return Requirement(name, low, high, magnitude=True)


def every_quantity(modes: Modes, stages: Sequence[str]) -> dict[str, Quantity]:
    """List frequencies of modes, the coupling, static displacements and rotations, by name."""
    names = named_results.labels(modes)
    found = [Quantity(name, "Hz", "frequency", (n,)) for n, name in enumerate(names)]
    found.append(RATIO)
    for n, stage in enumerate(stages):
        for i, (dof, unit) in enumerate(STATIC.items()):
            found.append(Quantity(f"{stage} static {dof}", unit, "static", (n, i)))
    return {one.name: one for one in found}


def find(
    name: str, key: str, modes: Modes, stages: Sequence[str], known: tuple[str, ...]
) -> Quantity:
    """Find a quantity by name; that of a response has no place yet.

    `known` are the bodies with signals; `key` is named in error messages.
    """
    name = " ".join(name.split())
    if name.endswith(" static z"):
        name = f"{name[:-1]}height"
    every = every_quantity(modes, stages)
    if name in every:
        return every[name]
    if "/" in name or name.isdigit() or name in modes.label:
        [found] = named_results.parse([name], modes, known if "/" in name else (), key)
        if isinstance(found, Mode):
            return every[found.text]
        return Quantity(found.text, found.unit, "response", (), found)
    remedy = suggest(name, [*every])
    if not remedy.startswith("did you mean"):
        remedy = (
            "give a mode's label (pendsus modes lists them), coupling, STAGE static"
            f" {'|'.join(STATIC)}, or a response OUTPUT/INPUT:FREQUENCY"
        )
    raise InputError.of(key, "is no quantity of builds", remedy, format_value(name))


@dataclass(frozen=True)
class RandomBuilds(Job):
    """Random builds of one design with a `[tolerance]` table.

    Wire and body of the `question` are ignored. Responses that requirements name are computed too.
    `method` is that of `studies.sampling`; builds may be drawn for Sobol indices.
    """

    count: int
    seed: int
    question: CouplingRequest
    allow_unstable: bool = False
    level: str = registry.STRING.name
    requirements: tuple[Requirement, ...] = ()
    method: str = RANDOM
    with_indices: bool = False

    @cached_property
    def factors(self) -> tuple[sampling.ScatteredNumber, ...]:
        """Numbers of the design that vary between builds."""
        return sampling.factors(self.design, self.scene)

    @cached_property
    def groups(self) -> tuple[str, ...]:
        """Names of the tolerances, each of one number or several."""
        return tuple(dict.fromkeys(factor.group for factor in self.factors))

    @cached_property
    def points(self) -> SamplePoints:
        """Points of the unit cube from which deviations follow."""
        groups = [self.groups.index(factor.group) for factor in self.factors]
        given = tuple(groups) if self.with_indices else ()
        return SamplePoints(self.method, self.seed, self.count, given)

    @cached_property
    def nominal(self) -> Modes:
        """Modes without random deviations, but with the design's own perturbations."""
        return eigenmodes.solve(nominal_system(self.text, self.level))

    @cached_property
    def ratios(self) -> tuple[Ratio, ...]:
        """Named responses and couplings that requirements limit."""
        named = [one for one in self.requirements if "/" in one.quantity]
        found = [one.ratio for one in gather(self._find, named)]
        return tuple(dict.fromkeys(ratio for ratio in found if ratio is not None))

    @cached_property
    def required(self) -> tuple[Quantity, ...]:
        """Quantity of each requirement; raises `InputError` if the model has none of that name."""
        return tuple(
            replace(one, place=(self.ratios.index(one.ratio),)) if one.ratio else one
            for one in gather(self._find, self.requirements)
        )

    def _find(self, one: Requirement) -> Quantity:
        known = signals.bodies_with_signals(nominal_system(self.text, registry.STRING.name))
        return find(one.quantity, one.key, self.nominal, self.scene.bodies.name, known)

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """Quantities whose statistics are computed, each once."""
        every = every_quantity(self.nominal, self.scene.bodies.name)
        return tuple(dict.fromkeys((*every.values(), *self.required)))

    def check(self) -> None:
        """Raise `InputError` if there is no table of tolerances, or a signal is invalid."""
        self.compute(0, 1)

    def deviations(self, start: int, stop: int) -> Float[np.ndarray, "stop-start factor"]:
        """Draw the random deviations of builds start to stop - 1."""
        return sampling.deviations(self.factors, self.points.of(start, stop, len(self.factors)))

    def compute(self, start: int, stop: int) -> Columns:
        """Compute the results of builds start to stop - 1."""
        return self.compute_with(self.deviations(start, stop))

    def compute_with(self, deviations: Float[np.ndarray, "build factor"]) -> Columns:
        """Compute frequencies, statics, couplings and responses of builds with these deviations."""
        scene = sampling.imperfect(self.scene, self.factors, deviations)
        found = builds.balance(
            scene, self.design, level=self.level, allow_unstable=self.allow_unstable
        )
        with np.errstate(all="ignore"):
            nominal = eigenmodes.spectrum(nominal_system(self.text, self.level))
            solved = batch_modes.solve(found.model)
            squared = follow_modes(solved, nominal.shape)
            shared = self._by_label(found, solved, squared)
            squared = squared if self.allow_unstable else np.maximum(squared, 0.0)
            result = couplings(found, self.question)
            result |= {"frequency": np.sqrt(squared) / (2 * np.pi), "static": found.static}
            if self.ratios:
                result["response"] = builds.responses(found, self.ratios)
            if self.motions:
                result["shared"] = shared & (found.status == builds.GOOD)[:, None]
        for name in ("frequency", "static"):
            result[name][found.status != builds.GOOD] = np.nan
        del result["over"], result["under"]
        return result

    @cached_property
    def motions(self) -> dict[int, Motion]:
        """Motions of the modes that requirements name, by the number of the nominal mode."""
        places = {one.place[0] for one in self.required if one.column == "frequency"}
        names = named_results.labels(self.nominal)
        modes = named_results.parse([names[n] for n in sorted(places)], self.nominal, ())
        return {one.number: one.motion for one in modes if isinstance(one, Mode) and one.motion}

    def _by_label(
        self, found: Builds, solved: Spectrum, squared: Float[np.ndarray, "build mode"]
    ) -> Bool[np.ndarray, "build mode"]:
        """Take modes that requirements name by their labels, in place of those followed by shape.

        Returns whether another mode shares their motion in each build.
        """
        shared = np.zeros(squared.shape, dtype=bool)
        if not self.motions:
            return shared
        fractions = mode_content.of_spectrum(found.model, solved)
        for number, motion in self.motions.items():
            content = mode_content.find(fractions, motion)
            place = np.maximum(content.mode, 0)[:, None]
            own = np.take_along_axis(solved.omega_squared, place, axis=1)[:, 0]
            squared[:, number] = np.where(content.mode < 0, squared[:, number], own)
            shared[:, number] = content.shared
        return shared


def follow_modes(
    solved: Spectrum, shapes: Float[np.ndarray, "mode coordinate"]
) -> Float[np.ndarray, "build mode"]:
    """Find omega^2, (rad/s)^2, of every build in the order of nominal modes of these shapes.

    Each is paired with the mode of the build that overlaps it most.
    """
    overlap = (shapes @ np.swapaxes(solved.shape, -1, -2)) ** 2  # (p, m, m): nominal, build
    choice = overlap.argmax(-1)
    clash = (np.sort(choice, axis=-1) != np.arange(choice.shape[-1])).any(-1)
    for n in np.flatnonzero(clash).tolist():
        choice[n] = pair_by_overlap(overlap[n])
    return np.take_along_axis(solved.omega_squared, choice, axis=-1)


def build_change(job: RandomBuilds) -> Callable[[Deviations], Comparison]:
    """The change of the results of builds of given deviations, for `model_choice.for_builds`.

    Frequencies, couplings, statics and responses are compared. The effect of wire mass on
    frequencies is estimated for the nominal build.
    """
    systems = Systems(job.design)

    def at(deviations: Deviations) -> Comparison:
        def solve(model: Model) -> list[tuple[str, np.ndarray]]:
            one = replace(job, level=model.name)
            found = one.compute_with(deviations)
            values = [
                ("the cross-coupling", found["ratio"]),
                ("static displacements", found["static"][..., :3]),
                ("static rotations", found["static"][..., 3:]),
                *((ratio.text, found["response"][:, n]) for n, ratio in enumerate(job.ratios)),
            ]
            if not model.has_wire_mass:
                places = pair_bodies(job.nominal, one.nominal, systems(model))
                names = named_results.labels(job.nominal)
                values += zip(names, found["frequency"].T[places], strict=True)
            return values

        compared = compare_builds(solve)

        def change(simple: Model, refined: Model) -> tuple[float, str]:
            found = compared(simple, refined)
            if refined.has_wire_mass and math.isfinite(found[0]):
                found = max(found, Frequencies().change(systems(simple), systems(refined)))
            return found

        return change

    return at


def first_points(job: RandomBuilds) -> Deviations:
    """Deviations of the nominal build, 0, and of the most extreme ones."""
    job = replace(job, method=RANDOM, with_indices=False)
    every = job.deviations(0, min(SEARCHED, job.count))
    scale = every.std(0)
    size = ((every / np.where(scale > 0, scale, 1.0)) ** 2).sum(1)
    most = np.argsort(-size, kind="stable")[:EXTREME]
    return np.concatenate([np.zeros_like(every[:1]), every[most]])


def extreme_points(job: RandomBuilds, columns: Columns) -> Deviations:
    """Deviations of the builds whose results turned out largest and smallest."""
    count = len(columns["ratio"])
    names = [name for name in ("ratio", "response", "frequency", "static") if name in columns]
    value = np.hstack([np.abs(columns[name]).reshape(count, -1) for name in names])
    chosen = find_largest(value).tolist()
    return np.concatenate([job.deviations(0, 0), *(job.deviations(n, n + 1) for n in chosen)])
