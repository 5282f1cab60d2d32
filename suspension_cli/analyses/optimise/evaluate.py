"""Quantities of designs, as `pendsus modes`, `response` and `check` compute them, in batches.

Their derivatives are central differences between neighbours in every free number.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import islice
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from suspension_cli.analyses.optimise.requirements import (
    FOLLOWED,
    LABELLED,
    Families,
    FreeDesign,
    Quantity,
    Requirements,
    interpret,
)
from suspension_cli.design import checks
from suspension_cli.design.derive import com_positions
from suspension_cli.design.schema import Design, Perturbation
from suspension_cli.equilibrium import solve as equilibrium
from suspension_cli.equilibrium.nominal import expand_nominal
from suspension_cli.equilibrium.solve import Equilibrium
from suspension_cli.errors import InputError
from suspension_cli.linear import batch_modes, eigenmodes, mode_content, mode_pairing, signals
from suspension_cli.linear.eigenmodes import Modes, find_top_masses
from suspension_cli.linear.mode_pairing import pair_bodies, pair_by_overlap
from suspension_cli.linear.named_results import Ratio
from suspension_cli.linear.symmetry import is_mirror_symmetric
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import registry
from suspension_cli.models.spectrum_error import has_wire_mass
from suspension_cli.physics import statics, wire_modes
from suspension_cli.scene.arrays import Array
from suspension_cli.scene.scene import Scene, select_scenes
from suspension_cli.studies import builds, variants
from suspension_cli.studies.builds import Builds

if TYPE_CHECKING:
    from jaxtyping import Float, Int

STRING = registry.STRING.name
HIGHEST = 1.05
"""Highest frequency of the search for modes of bodies with wire mass, over the highest without;
wire mass lowers frequencies, except next to a violin mode."""
TINY = 1e-30
"""Smallest energy fraction or response, in place of 0, which has no logarithm."""
STEP = 2e-5
"""Step of derivatives, in fractions of the ranges; energy fractions of close modes vary fast."""
LINEAR_BELOW = 0.1
"""Frequency, over the lowest limit on it (0.01 Hz without limits), below which its logarithm
continues linearly in omega^2, to unstable modes."""
PATH_STEPS = 24
"""Steps between two designs at which shapes are compared."""


def solve_modes(model: LinearSystem) -> Modes:
    """Solve for the modes of the bodies; with wire mass, those most like the modes without."""
    static = eigenmodes.solve(model.constant)
    if not has_wire_mass(model):
        return static
    found = wire_modes.solve(model, HIGHEST * float(np.nanmax(static.frequency)))
    pairs = pair_bodies(static, found, model)
    return found.select(np.sort(pairs[pairs >= 0]))


def with_imperfections(design: Design, perturbation: Sequence[Perturbation]) -> Design:
    """Add imperfections to those of a design."""
    return msgspec.structs.replace(design, perturbation=[*design.perturbation, *perturbation])


@dataclass(frozen=True)
class Evaluator:
    """Quantities of a design as functions of its free numbers.

    `families` and `system` (string model) are those of the starting design, `modes` and `responses`
    the names of the models of these.
    """

    freed: FreeDesign
    requirements: Requirements
    families: Families
    system: LinearSystem
    modes: str = STRING
    responses: str = STRING

    @staticmethod
    def of(freed: FreeDesign) -> Evaluator:
        """Interpret the goals for the starting design.

        Raises `InputError` if the design lacks something that a goal refers to.
        """
        design = freed.design(freed.begin)
        for n, goal in enumerate(freed.goals.goal, 1):
            imperfect = with_imperfections(design, goal.perturbation or ())
            faults = checks.check_design(imperfect) if goal.perturbation else []
            if faults:
                raise InputError([replace(one, key=f"goal.{n}.{one.key}") for one in faults])
        system = registry.STRING.system(design)
        modes = eigenmodes.solve(system.constant)
        families = Families.of(is_mirror_symmetric(expand_nominal(design)), modes.energy)
        known = signals.bodies_with_signals(system)
        wanted = interpret(freed.goals, design, modes, families, known)
        return Evaluator(freed, wanted, families, system)

    def at(self, fraction: Float[np.ndarray, " number"]) -> Float[np.ndarray, " value"]:
        """Evaluate one design, as `logs`."""
        return self.logs(fraction[None], self.follow(fraction))[0]

    def logs(
        self,
        fractions: Float[np.ndarray, "design number"],
        shapes: Array | None,
        *,
        around: bool = False,
    ) -> Float[np.ndarray, "design value"]:
        """Logarithms of quantities, then margins of the bounds of dependent numbers.

        Twice those of quantities: as lower limits take them, then as upper ones (`Results.ends`).
        Below a floor logarithms are continued linearly in the square, to unstable modes. `shapes`
        and `around` are as in `Results`; NaN for an invalid design.
        """
        designs = [self.freed.design_if_valid(one) for one in fractions]
        value = np.hstack(Results(self, designs, shapes, around).ends(smooth=True))
        squared = value * np.abs(value)
        least = np.maximum(squared, self._floors)
        with np.errstate(invalid="ignore"):  # infinite ratios of responses
            log = np.log(least) / 2 + (squared - least) / (2 * self._floors)
        margins = [self.freed.margins(one)[self.freed.bounded] for one in fractions]
        return np.hstack([log, np.array(margins)])

    @cached_property
    def _floors(self) -> Float[np.ndarray, " value"]:
        """Squares of quantities, twice, below which their logarithms continue linearly."""
        items, limits = self.requirements.quantities, self.requirements.limits
        lowest = np.full(len(items), np.inf)
        np.minimum.at(lowest, limits.quantity, limits.asked)
        lowest[np.isinf(lowest)] = 0.01
        hertz = np.array([item.unit == "Hz" for item in items])
        return np.tile(np.where(hertz, LINEAR_BELOW * lowest, TINY) ** 2, 2)

    def follow(self, fraction: Float[np.ndarray, " number"]) -> Array | None:
        """Shapes in a design of all modes of the starting design; None if no goal follows one.

        They are followed on the string model along the straight line between the two. NaN if the
        design has no equilibrium.
        """
        if all(FOLLOWED not in item.key for item in self.requirements.quantities):
            return None
        line = np.linspace(self.freed.begin, fraction, PATH_STEPS + 1)
        designs = [self.freed.design_if_valid(one) for one in line]
        squared, shape, _ = Results(replace(self, modes=STRING), designs).modes
        good = np.isfinite(squared[:, 0])
        rank, _ = mode_pairing.follow(squared, shape, good, (0,), shape[0])
        return shape[-1][rank[-1]] * (1.0 if good[-1] else np.nan)

    def slopes(self, fraction: Float[np.ndarray, " number"]) -> Float[np.ndarray, "value number"]:
        """Differentiate the values of `logs` by the fractions.

        One-sided where a neighbour has no equilibrium. Changes of modes by wire mass are neglected.
        Raises `InputError` if a number cannot change alone.
        """
        steps = STEP * np.eye(len(fraction))
        line = np.array([*(fraction + steps), *(fraction - steps), fraction])
        *sides, middle = self.logs(line, self.follow(fraction), around=True)
        above, below = np.array(sides).reshape(2, len(steps), -1)
        above = np.where(np.isnan(above), 2 * middle - below, above)
        below = np.where(np.isnan(below), 2 * middle - above, below)
        for item, own in zip(self.freed.goals.free, above, strict=True):
            if np.isnan(own).any():
                problem = "a change of this number alone unbalances the suspension"
                remedy = "let other numbers depend on it by [[equal]]"
                raise InputError.of(f"free.{item.name}", f"{problem} in its nominal pose", remedy)
        return (above - below).T / (2 * STEP)


@dataclass(frozen=True)
class Results:
    """Modes, responses and loads of designs that differ in their numbers, on demand.

    Without a value (NaN) for a design that is None or has no equilibrium. `shapes` are those of
    modes that are followed (`Evaluator.follow`). If `around`, the designs are neighbours of the
    last one, and changes by wire mass are neglected.
    """

    evaluator: Evaluator
    designs: Sequence[Design | None]
    shapes: Float[np.ndarray, "mode coordinate"] | None = None
    around: bool = False
    _builds: dict[object, list[tuple[list[int], Builds]]] = field(default_factory=dict)

    @cached_property
    def values(self) -> Float[np.ndarray, "design quantity"]:
        """All quantities, each in its unit; minus the growth rate over 2 pi of unstable modes."""
        items = self.evaluator.requirements.quantities
        return np.stack([getattr(self, item.method)(*item.key) for item in items], axis=1)

    def ends(
        self, *, smooth: bool
    ) -> tuple[Float[np.ndarray, "design quantity"], Float[np.ndarray, "design quantity"]]:
        """Smallest and largest value of all quantities: they differ where modes share a motion.

        There a label means both modes, and a limit takes the one that violates it more. If
        `smooth`, the other mode gains influence gradually (`mode_content.weights`), for the search.
        """
        low, high = self.values.copy(), self.values.copy()
        for n, item in enumerate(self.evaluator.requirements.quantities):
            if LABELLED in item.key:
                values, weight = self._choices(item, smooth)
                low[:, n] = -mode_content.largest(-values, weight)
                high[:, n] = mode_content.largest(values, weight)
        return low, high

    def _choices(
        self, item: Quantity, smooth: bool
    ) -> tuple[Float[np.ndarray, "design choice"], Float[np.ndarray, "design choice"]]:
        """Values of a quantity for all modes, or pairs of these, and the weights of these."""
        if item.method == "of_mode":
            what, *key = item.key
            return getattr(self, what), self._weights(*key, smooth=smooth)
        hertz, *keys = item.key
        first, second = (
            self._weights(*keys[:2], smooth=smooth),
            self._weights(*keys[2:], smooth=smooth),
        )
        count = first.shape[1]
        one, other = np.nonzero(~np.eye(count, dtype=bool))  # a mode is not apart from itself
        weight = np.minimum(first[:, one], second[:, other])
        most = weight.max(1, keepdims=True)
        frequency = np.abs(self.frequency)
        values = self._apart(hertz, frequency[:, one], frequency[:, other])
        return values, weight / np.where(most > 0, most, 1.0)

    def _weights(
        self, family: int, number: Any, *, smooth: bool
    ) -> Float[np.ndarray, "design mode"]:
        """Weight with which each mode counts as the one of a quantity."""
        if family == LABELLED:
            return mode_content.weights(self.fractions, number, smooth=smooth)
        place = self._place(family, number)
        return (np.arange(self.frequency.shape[1]) == place[:, None]) * 1.0

    def _place(self, family: int, number: Any) -> Int[np.ndarray, " design"]:
        """Number of the mode of a quantity, from 0; -1 if unknown."""
        if family == LABELLED:
            return mode_content.find(self.fractions, number).mode
        return self.numbers[family][:, number]

    def of_mode(self, what: str, family: int, number: Any) -> Float[np.ndarray, " design"]:
        """``frequency`` or ``top_fraction`` of a mode by family and rank, shape or motion."""
        place = self._place(family, number)
        value = np.take_along_axis(getattr(self, what), np.maximum(place, 0)[:, None], 1)[:, 0]
        return np.where(place < 0, np.nan, value)

    def separation(self, hertz: bool, *modes: Any) -> Float[np.ndarray, " design"]:
        """Ratio or difference (Hz) of the frequencies of two modes, the higher one first."""
        one, other = (np.abs(self.of_mode("frequency", *key)) for key in (modes[:2], modes[2:]))
        return self._apart(hertz, one, other)

    def _apart(
        self, hertz: bool, one: Float[np.ndarray, "design *"], other: Float[np.ndarray, "design *"]
    ) -> Float[np.ndarray, "design *"]:
        """Ratios or differences of frequencies (Hz), the higher one first."""
        swap = one < other
        if self.around:  # smooth where two modes cross
            swap = swap[-1:]
        high, low = np.where(swap, other, one), np.where(swap, one, other)
        return high - low if hertz else high / low

    def number_of(self, item: Quantity) -> int:
        """Number of the mode of a quantity in the first design, from 0; -1 for other quantities."""
        return int(self._place(*item.key[1:])[0]) if item.method == "of_mode" else -1

    def remarks(self) -> Iterator[str]:
        """Say which modes share a motion of a goal in the first design, or that there is none."""
        keys = dict.fromkeys(
            item.key[start : start + 2]
            for item in self.evaluator.requirements.quantities
            for start in (1, 3)
            if item.method in ("of_mode", "separation")
        )
        for motion in (key[1] for key in keys if key and key[0] == LABELLED):
            found = mode_content.find(self.fractions[:1], motion)
            name = eigenmodes.describe(self.evaluator.system.coordinate[6 + motion.place])
            if found.mode[0] < 0:
                yield f"no mode is {name}#{motion.number} in this design"
            elif found.shared[0]:
                numbers = (int(found.mode[0]), int(found.other[0]))
                first, second = (f"{self.frequency[0, number]:.5g}" for number in numbers)
                parts = 100 * found.fraction[0], 100 * found.other_fraction[0]
                yield (
                    f"two modes share {name} in this design: {first} and {second} Hz, with"
                    f" {parts[0]:.0f} and {parts[1]:.0f} % of their kinetic energy in it; of both,"
                    " limits take the one that violates them more"
                )

    def response(
        self, ratio: Ratio, perturbation: tuple[Perturbation, ...]
    ) -> Float[np.ndarray, " design"]:
        """Magnitude of a response, or of a ratio of two, with further imperfections."""
        value = np.full(len(self.designs), np.nan)
        for places, found in self._balanced(perturbation, self.evaluator.responses):
            value[places] = np.abs(builds.responses(found, [ratio])[:, 0])
        return value

    def stress(self, part: str, place: int) -> Float[np.ndarray, " design"]:
        """Stress over tensile strength of one of the ``wires`` or ``blades``."""
        loads = statics.wire_loads if part == "wires" else statics.blade_loads
        value = np.full(len(self.designs), np.nan)
        for n, design, scene, found in self._equilibria:
            value[n] = next(islice(loads(design, scene, found), place, None)).fraction
        return value

    def depth(self, stage: str) -> Float[np.ndarray, " design"]:
        """Depth, m, of the COM of a stage below the suspension point."""
        value = np.full(len(self.designs), np.nan)
        for n, design, scene, found in self._equilibria:
            shift = found.pose.shift[1 + scene.bodies.name.index(stage)]
            value[n] = -(com_positions(design)[stage][2] + shift[2])
        return value

    @cached_property
    def numbers(self) -> list[Int[np.ndarray, "design _"]]:
        """Numbers of the modes of each family, and last of those with `shapes`; -1 if unknown."""
        families = self.evaluator.families
        shapes = np.zeros((0, 0)) if self.shapes is None else self.shapes
        sizes = [*families.size, len(shapes)]
        found = [np.full((len(self.designs), size), -1) for size in sizes]
        for n in np.flatnonzero(np.isfinite(self.modes[0]).all(1)):
            for numbers, own in zip(found, families.ranked(self.energy[n]), strict=False):
                numbers[n] = own
            if shapes.size and np.isfinite(shapes).all():
                found[-1][n] = pair_by_overlap((shapes @ self.modes[1][n].T) ** 2)
        return found

    @cached_property
    def modes(
        self,
    ) -> tuple[
        Float[np.ndarray, "design mode"],
        Float[np.ndarray, "design mode _"],
        Float[np.ndarray, "design mode place"],
    ]:
        """omega^2, (rad/s)^2, ascending, shapes of bodies, and fractions of the kinetic energy.

        Shapes are as in `batch_modes.Spectrum`; NaN without an equilibrium. A design with another
        number of modes cannot be compared, and has none.
        """
        bodies, count = 6 * len(self.evaluator.system.body), self.evaluator.families.size.sum()
        squared = np.full((len(self.designs), count), np.nan)
        shape = np.full((len(self.designs), count, bodies), np.nan)
        fractions = np.full((len(self.designs), count, self.evaluator.system.size - 6), np.nan)
        level = registry.by_name(self.evaluator.modes)
        if level.has_wire_mass and not self.around:
            for n, design in enumerate(self.designs):
                with contextlib.suppress(InputError):
                    model = level.system(design) if design else None
                    found = solve_modes(model) if model else None
                    if model and found and len(found.shape) == count:
                        own = slice(6, 6 + bodies)
                        root = np.linalg.cholesky(model.mass[own, own])
                        squared[n], shape[n] = found.omega_squared, found.shape[:, :bodies] @ root
                        fractions[n] = found.fractions[:, : fractions.shape[-1]]
            return squared, shape, fractions
        for places, batch in self._balanced((), level.name):
            solved, good = batch_modes.solve(batch.model), batch.status == builds.GOOD
            if solved.omega_squared.shape[1] == count:
                here = np.array(places)[good]
                squared[here] = solved.omega_squared[good]
                shape[here] = solved.shape[good, :, :bodies]
                fractions[here] = mode_content.of_spectrum(batch.model, solved)[good]
        return squared, shape, fractions

    @property
    def fractions(self) -> Float[np.ndarray, "design mode place"]:
        """Fractions of the kinetic energy of each mode in each motion."""
        return self.modes[2]

    @cached_property
    def energy(self) -> Float[np.ndarray, "design mode body 6"]:
        """Fractions of the kinetic energy of each mode."""
        shape = self.modes[1]
        return (shape**2).reshape(*shape.shape[:2], -1, 6)

    @cached_property
    def top_fraction(self) -> Float[np.ndarray, "design mode"]:
        """Fraction of the kinetic energy of each mode in the top mass."""
        energy = self.energy.reshape(-1, *self.energy.shape[2:])
        top = find_top_masses(energy, self.evaluator.system.top)
        return energy[np.arange(len(energy)), top].sum(-1).reshape(self.energy.shape[:2])

    @cached_property
    def frequency(self) -> Float[np.ndarray, "design mode"]:
        """Frequency of each mode, Hz; minus the growth rate over 2 pi of an unstable one."""
        squared = self.modes[0]
        return np.sign(squared) * np.sqrt(np.abs(squared)) / (2 * np.pi)

    def _balanced(
        self, perturbation: tuple[Perturbation, ...], level: str
    ) -> list[tuple[list[int], Builds]]:
        """Balance all designs in batches, with their places."""
        key = (perturbation, level)
        if key not in self._builds:
            imperfect = [one and with_imperfections(one, perturbation) for one in self.designs]
            self._builds[key] = [*variants.solved(imperfect, level)]
        return self._builds[key]

    @cached_property
    def _equilibria(self) -> list[tuple[int, Design, Scene, Equilibrium]]:
        """Numbers, scenes and equilibria of the designs that hang on taut wires."""
        known = []
        for places, scene, one in variants.alike(self.designs, STRING):
            found = equilibrium.solve(registry.STRING.completed(scene, one))
            for n in np.flatnonzero(found.converged & (found.tension > 0).all(-1)).tolist():
                design = self.designs[places[n]]
                assert design is not None
                known.append((places[n], design, select_scenes(scene, n), found.select(n)))
        return known
