"""Quantities of designs, as `pendsus modes`, `response` and `check` compute them, in batches.

Their derivatives are central differences between neighbours in every free number.
"""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from suspension_cli.analyses.check import statics
from suspension_cli.analyses.check.statics import Statics
from suspension_cli.analyses.optimise.free_parameters import FreeDesign
from suspension_cli.analyses.optimise.mode_families import Families, solve_modes
from suspension_cli.analyses.optimise.quantities import Requirements, interpret
from suspension_cli.analyses.sweep.solve import evaluate_ratio
from suspension_cli.design import checks
from suspension_cli.design.derive import com_positions
from suspension_cli.design.schema import Design, Perturbation
from suspension_cli.equilibrium.nominal import expand_nominal
from suspension_cli.errors import InputError
from suspension_cli.linear import batch_modes, eigenmodes, signals
from suspension_cli.linear.eigenmodes import find_top_masses
from suspension_cli.linear.mode_pairing import pair_by_overlap
from suspension_cli.linear.named_results import Ratio
from suspension_cli.linear.symmetry import is_mirror_symmetric
from suspension_cli.models import registry
from suspension_cli.scene import stack
from suspension_cli.scene.arrays import Array
from suspension_cli.studies import builds, mode_tracking, variants
from suspension_cli.studies.builds import Builds
from suspension_cli.studies.derivatives import neighbours

if TYPE_CHECKING:
    from jaxtyping import Float, Int

TINY = 1e-30
"""Smallest energy fraction or response, in place of 0, which has no logarithm."""
STEP = 2e-5
"""Step of derivatives, as energy fractions of close modes vary fast (see `studies.derivatives`)."""
LINEAR_BELOW = 0.1
"""Frequency, over the lowest limit on it, below which its logarithm continues linearly in omega^2,
to unstable modes."""
LINEAR_BELOW_HZ = 1e-3
"""The same for a mode without limits, Hz."""
PATH_STEPS = 24
"""Steps between two designs at which shapes are compared."""


@dataclass(frozen=True)
class Evaluator:
    """Quantities of a design as functions of its free numbers.

    Attributes
    ----------
    families : Families
        Mode families of the starting design.
    modes, responses : str
        Names of the models of the modes and of the responses.
    """

    freed: FreeDesign
    requirements: Requirements
    families: Families
    modes: str
    responses: str

    @staticmethod
    def of(freed: FreeDesign) -> Evaluator:
        """Interpret the goals for the starting design, on the string model.

        Raises `InputError` if the design lacks something that a goal refers to.
        """
        design, string = freed.design(freed.begin), registry.STRING
        for n, goal in enumerate(freed.goals.goal, 1):
            imperfect = with_imperfections(design, goal.perturbation or ())
            faults = checks.check_design(imperfect) if goal.perturbation else []
            if faults:
                raise InputError([replace(one, key=f"goal.{n}.{one.key}") for one in faults])
        model = string.system(design)
        modes = eigenmodes.solve(model.constant)
        families = Families.of(is_mirror_symmetric(expand_nominal(design)), modes.energy)
        known = signals.bodies_with_signals(model)
        wanted = interpret(freed.goals, design, modes, families, known)
        return Evaluator(freed, wanted, families, string.name, string.name)

    def results(self, designs: Sequence[Design | None], shapes: Array | None = None) -> Results:
        """Results of some designs; modes with a label have the `shapes` (`follow`)."""
        return Results(designs, self.modes, self.responses, self.families, shapes)

    def values(self, found: Results) -> Float[np.ndarray, "design quantity"]:
        """Evaluate the quantities, each in its unit; minus the growth rate over 2 pi if unstable.

        NaN for a design without equilibrium.
        """
        items = self.requirements.quantities
        return np.stack([getattr(found, item.method)(*item.key) for item in items], axis=1)

    def at(self, fraction: Float[np.ndarray, " number"]) -> Float[np.ndarray, " quantity"]:
        """Logarithms of the quantities; raises `InputError` if the design is invalid."""
        design = self.freed.design(fraction)
        return self.logs(self.values(self.results([design], self.follow(fraction))))[0]

    def logs(self, value: Float[np.ndarray, "*design quantity"]) -> Array:
        """Logarithms of quantities; below a floor linear in their squares, to unstable modes."""
        squared = value * np.abs(value)
        least = np.maximum(squared, self._floors)
        return np.log(least) / 2 + (squared - least) / (2 * self._floors)

    @cached_property
    def _floors(self) -> Float[np.ndarray, " quantity"]:
        """Squares of quantities below which their logarithms continue linearly."""
        lowest = np.full(len(self.requirements.quantities), LINEAR_BELOW_HZ / LINEAR_BELOW)
        for n, item in enumerate(self.requirements.quantities):
            asked = [one.value for one in self.requirements.limits if one.quantity == n]
            lowest[n] = min(asked, default=lowest[n])
            if item.method != "frequency":
                lowest[n] = TINY
        return (LINEAR_BELOW * lowest) ** 2

    def follow(
        self, fraction: Float[np.ndarray, " number"], steps: int = PATH_STEPS
    ) -> Array | None:
        """Shapes in a design of all modes of the starting design; None if no goal has a label.

        They are followed on the string model along the straight line between the two. NaN if the
        design has no equilibrium.
        """
        if all(item.key[0] != -1 for item in self.requirements.quantities):
            return None
        freed = self.freed
        ends = (freed.values(one) for one in (freed.begin, fraction))
        begin, end = (np.array(list(values.values())) for values in ends)
        rows = np.linspace(begin, end, steps + 1)
        squared, shape = np.zeros((2, steps + 1, 0)), np.zeros((steps + 1, 0, 0))
        good = np.zeros(steps + 1, dtype=bool)
        path = dict(zip(freed.values(fraction), rows.T, strict=True))
        for found, here in variants.balanced(
            freed.text, path, registry.STRING.name, allow_unstable=True
        ):
            solved = batch_modes.solve(found.model)
            if not shape.size:
                squared = np.zeros((len(good), *solved.omega_squared.shape[1:]))
                shape = np.zeros((len(good), *solved.shape.shape[1:]))
            if solved.shape.shape[1:] == shape.shape[1:]:
                squared[here], shape[here] = solved.omega_squared, solved.shape
                good[here] = found.status == builds.GOOD
        if not (good[0] and good[-1]):
            return np.full(shape.shape[1:], np.nan)
        rank, _ = mode_tracking.follow(squared, shape, good, (0,), shape[0])
        return shape[-1][rank[-1]]

    def neighbours(
        self, fraction: Float[np.ndarray, " number"]
    ) -> tuple[Float[np.ndarray, "side quantity"], Float[np.ndarray, " number"]]:
        """Logarithms of quantities of the neighbours above and below in each free number.

        Also returns the factors from their differences to derivatives by the fractions. Raises
        `InputError` if a number cannot change alone.
        """
        directions = self.freed.directions(fraction)
        step, designs = neighbours(self.freed.design(fraction), directions, STEP)
        shapes = self.follow(fraction)
        found = self.values(self.results([*designs, self.freed.design(fraction)], shapes))
        sides, middle = self.logs(found[:-1]), self.logs(found[-1])
        for item, both in zip(directions, np.isnan(sides).reshape(len(step), -1), strict=True):
            if both.all():
                problem = "a change of this number alone unbalances the suspension"
                remedy = "let other numbers depend on it by [[equal]]"
                raise InputError.of(f"free.{item.name}", f"{problem} in its nominal pose", remedy)
        return np.where(np.isnan(sides), middle, sides), self.freed.rate(fraction) / (2 * step)


class Results:
    """Modes, responses and loads of designs that differ in their numbers, on demand.

    Without a value (NaN) for a design that is None or has no equilibrium.

    Parameters
    ----------
    designs : sequence of Design or None
    modes, responses : str
        Names of models.
    families : Families
    shapes : array, optional
        Shapes of modes by which these are known, as in `batch_modes.Spectrum`.
    """

    def __init__(
        self,
        designs: Sequence[Design | None],
        modes: str,
        responses: str,
        families: Families,
        shapes: Float[np.ndarray, "mode coordinate"] | None,
    ) -> None:
        self.designs, self.families, self.shapes = designs, families, shapes
        self.level_of_modes, self.level_of_responses = modes, responses
        self._builds: dict[object, list[tuple[list[int], Builds]]] = {}

    def frequency(self, family: int, number: int) -> Float[np.ndarray, " design"]:
        """Frequency, Hz, of a mode by family and rank, or of family -1 by its shape."""
        value = np.full(len(self.designs), np.nan)
        for n, place in self.numbers(family, number).items():
            squared = self._modes[n].squared[place]
            value[n] = np.sign(squared) * np.sqrt(np.abs(squared)) / (2 * np.pi)
        return value

    def top_fraction(self, family: int, number: int) -> Float[np.ndarray, " design"]:
        """Fraction of the kinetic energy of a mode in its top mass."""
        value = np.full(len(self.designs), np.nan)
        for n, place in self.numbers(family, number).items():
            value[n] = self._modes[n].fraction[place]
        return value

    def response(
        self, ratio: Ratio, perturbation: tuple[Perturbation, ...]
    ) -> Float[np.ndarray, " design"]:
        """Magnitude of a response, or of a ratio of two, with further imperfections."""
        value = np.full(len(self.designs), np.nan)
        for places, found in self._balanced(perturbation, self.level_of_responses):
            value[places] = np.abs(evaluate_ratio(found, ratio))
        return value

    def stress(self, part: str, place: int) -> Float[np.ndarray, " design"]:
        """Stress over tensile strength of a wire or blade, by its number."""
        return np.array(
            [one and getattr(one, part)[place].fraction for one in self._statics], dtype=float
        )

    def depth(self, stage: str) -> Float[np.ndarray, " design"]:
        """Depth, m, of the COM of a stage below the suspension point."""
        value = np.full(len(self.designs), np.nan)
        for n, (design, found) in enumerate(zip(self.designs, self._statics, strict=True)):
            if design is not None and found is not None:
                (shift,) = (body.shift for body in found.bodies if body.name == stage)
                value[n] = -(com_positions(design)[stage][2] + shift[2])
        return value

    def numbers(self, family: int, number: int) -> dict[int, int]:
        """Number of a mode, from 0, in every design with an equilibrium."""
        if family >= 0:
            return {n: int(modes.ranked[family][number]) for n, modes in self._modes.items()}
        return {n: int(modes.followed[number]) for n, modes in self._modes.items()}

    @cached_property
    def _modes(self) -> dict[int, BodyModes]:
        """Modes of every design with an equilibrium, by its place."""
        found: dict[int, BodyModes] = {}
        if registry.by_name(self.level_of_modes).has_wire_mass:
            for n, design in enumerate(self.designs):
                with contextlib.suppress(InputError):
                    if design is not None:
                        model = registry.by_name(self.level_of_modes).system(design)
                        modes, own = solve_modes(model), slice(6, 6 + 6 * len(model.body))
                        shape = modes.shape[:, : own.stop - 6]
                        shape = shape @ np.linalg.cholesky(model.mass[own, own])
                        found[n] = self._body_modes(modes.omega_squared, shape, model.top)
            return found
        for places, batch in self._balanced((), self.level_of_modes):
            solved, size = batch_modes.solve(batch.model), 6 * len(batch.model.body)
            for k in np.flatnonzero(batch.status == builds.GOOD):
                shape = solved.shape[k, :, :size]
                found[places[k]] = self._body_modes(solved.omega_squared[k], shape, batch.model.top)
        return found

    def _body_modes(self, squared: Array, shape: Array, top: tuple[int, ...]) -> BodyModes:
        energy = (shape**2).reshape(len(shape), -1, 6)
        fraction = energy[np.arange(len(energy)), find_top_masses(energy, top)].sum(-1)
        followed = np.zeros(0, dtype=int)
        if self.shapes is not None:
            overlap = (self.shapes[:, : shape.shape[1]] @ shape.T) ** 2
            followed = pair_by_overlap(np.nan_to_num(overlap))
        return BodyModes(squared, fraction, self.families.ranked(energy), followed)

    def _balanced(
        self, perturbation: tuple[Perturbation, ...], level: str
    ) -> list[tuple[list[int], Builds]]:
        """Balance all designs in batches, with their places."""
        key = (perturbation, level)
        if key not in self._builds:
            imperfect = [one and with_imperfections(one, perturbation) for one in self.designs]
            self._builds[key] = [
                (
                    places,
                    builds.balance(
                        stack.stack_scenes(scenes), one, level=level, allow_unstable=True
                    ),
                )
                for places, scenes, one in variants.alike(imperfect, level)
            ]
        return self._builds[key]

    @cached_property
    def _statics(self) -> list[Statics | None]:
        return [one and _solve_statics(one) for one in self.designs]


@dataclass(frozen=True)
class BodyModes:
    """Modes of one design.

    Attributes
    ----------
    squared, fraction : arrays
        omega^2, (rad/s)^2, ascending; fraction of the kinetic energy in the top mass.
    ranked : list of int arrays
        Numbers of the modes of each family, ascending in frequency.
    followed : array
        Number of each mode of the starting design; empty if not asked for.
    """

    squared: Float[np.ndarray, " mode"]
    fraction: Float[np.ndarray, " mode"]
    ranked: list[Int[np.ndarray, " _"]]
    followed: Int[np.ndarray, " mode"]


def with_imperfections(design: Design, perturbation: Sequence[Perturbation]) -> Design:
    """Add imperfections to those of a design."""
    return msgspec.structs.replace(design, perturbation=[*design.perturbation, *perturbation])


def _solve_statics(design: Design) -> Statics | None:
    with contextlib.suppress(InputError):
        return statics.solve(design)
    return None
