"""Logarithms of quantities of a design and their exact derivatives by its free numbers.

All are those of the string model, or of the beam model without its losses. Derivatives of
frequencies: `sensitivity.solve.differentiate_omega_squared`; of responses: `response_derivatives`;
of stresses and heights: one complex step with the change of the equilibrium (`derivatives.moved`).
The energy fraction s = v D v / v E v of a mode v in the top mass (D: its block of the mass matrix,
E: all blocks) changes with the shape. For v_k M v_k = 1 and distinct lambda = omega^2,

    dv_k = sum over j != k of v_j (v_j dK v_k - lambda_k v_j dM v_k) / (lambda_k - lambda_j)
           - v_k (v_k dM v_k) / 2

on all coordinates with inertia (Fox and Kapoor, AIAA Journal 6, 2426 (1968)); the others do not
contribute to D and E.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from suspension_cli.analyses.optimise import loads, mode_families
from suspension_cli.analyses.optimise.free_parameters import FreeDesign
from suspension_cli.analyses.optimise.mode_families import Families
from suspension_cli.analyses.optimise.quantities import (
    OfDepth,
    OfMode,
    OfPart,
    OfResponse,
    Quantity,
    Requirements,
)
from suspension_cli.analyses.sensitivity.solve import differentiate_omega_squared
from suspension_cli.analyses.sweep.solve import evaluate_ratio, select_models
from suspension_cli.design import reader
from suspension_cli.design.schema import Design, Perturbation
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.errors import Fault, InputError
from suspension_cli.linear import batch_modes, eigenmodes, mode_pairing
from suspension_cli.linear.eigenmodes import DEGENERATE, Modes
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import registry
from suspension_cli.scene.arrays import Array, Index
from suspension_cli.scene.pose import Pose, nominal_pose
from suspension_cli.scene.scene import Scene
from suspension_cli.studies import builds, derivatives, variants
from suspension_cli.studies.builds import Builds
from suspension_cli.studies.derivatives import Differentiable, Linear, Moved
from suspension_cli.studies.parameters import STEP
from suspension_cli.studies.response_derivatives import Slope

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int

TINY = 1e-30
"""Smallest energy fraction or response; it replaces 0, which has no logarithm."""
LINEAR_BELOW = 0.1
"""Fraction of the lowest limit of a frequency below which its logarithm is continued linearly in
omega^2, to unstable modes."""
LINEAR_BELOW_HZ = 1e-3
"""Frequency below which the logarithm is continued linearly for a mode without limits, Hz."""


@dataclass(frozen=True)
class Evaluation:
    """Logarithms of quantities, and their derivatives by the free numbers."""

    log: Float[np.ndarray, " quantity"]
    slope: Float[np.ndarray, "quantity number"]


@dataclass(frozen=True)
class Evaluator:
    """Quantities of a design as a function of its free numbers.

    Attributes
    ----------
    freed : Freed
    requirements : Requirements
    families : Families
    level : str
        Name of a model that supports derivatives.
    """

    freed: FreeDesign
    requirements: Requirements
    families: Families
    level: str = registry.STRING.name

    @cached_property
    def nominal(self) -> Float[np.ndarray, "mode coordinate"]:
        """Shapes of the modes of the starting design, as in `batch_modes.Spectrum`."""
        return batch_modes.solve_one(
            static_system(self.freed.design(self.freed.start), self.level)
        ).shape[0]

    @cached_property
    def floors(self) -> Float[np.ndarray, " quantity"]:
        """omega^2, (rad/s)^2, below which logarithms of frequencies continue linearly."""
        lowest = np.full(len(self.requirements.quantities), np.inf)
        for limit in self.requirements.limits:
            lowest[limit.quantity] = min(lowest[limit.quantity], limit.value)
        return (2 * np.pi * np.where(np.isinf(lowest), LINEAR_BELOW_HZ, LINEAR_BELOW * lowest)) ** 2

    def at(self, number: Float[np.ndarray, " number"]) -> Evaluation:
        """Evaluate logarithms and derivatives for free numbers.

        Raises `InputError` if the design is invalid.
        """
        design = self.freed.design(number)
        own = _Built.of(design, self.freed, self.level)
        imperfect: dict[tuple[Perturbation, ...], _Built] = {(): own}
        found = eigenmodes.solve(own.model)
        places = self.places(found, own.base.linear.mass, number)
        rates = np.stack(
            [differentiate_omega_squared(found, change) for change in own.changes], axis=1
        )
        fractions = _TopFractions(found, own.base.linear)
        log, slope = np.empty(len(places)), np.zeros((len(places), len(own.changes)))
        for n, (item, place) in enumerate(zip(self.requirements.quantities, places, strict=True)):
            if isinstance(item, OfMode) and item.fraction:
                log[n], slope[n] = fractions.logarithm(place, own.changes)
            elif isinstance(item, OfMode):
                log[n], slope[n] = _of_square(
                    found.omega_squared[place], rates[place], self.floors[n]
                )
            elif isinstance(item, OfResponse):
                if item.perturbation not in imperfect:
                    imperfect[item.perturbation] = _Built.of(
                        with_imperfections(design, item.perturbation), self.freed, self.level
                    )
                log[n], slope[n] = imperfect[item.perturbation].response(item)
            else:
                log[n], slope[n] = own.load(item)
        return Evaluation(log, slope)

    def places(
        self,
        found: Modes,
        mass: Float[np.ndarray, "coordinate coordinate"],
        number: Float[np.ndarray, " number"],
    ) -> list[int]:
        """Find the modes that the quantities refer to; -1 for other quantities.

        `found` are the modes of the design with the free numbers, `mass` its mass matrix.
        """
        ranked = self.families.ranked(found.energy)
        return _places(
            self.requirements.quantities, ranked, lambda: self._follow(found, mass, number)
        )

    def _follow(
        self,
        found: Modes,
        mass: Float[np.ndarray, "coordinate coordinate"],
        number: Float[np.ndarray, " number"],
    ) -> Int[np.ndarray, " mode"]:
        """Find the modes that those of the starting design become."""
        start, end = self.freed.values(self.freed.start), self.freed.values(number)
        place = mode_families.follow_modes(
            self.freed.text, start, end, self.nominal, found, mass, self.level
        )
        if (place < 0).any():
            raise InputError(
                [Fault("goal", "modes cannot be followed to this design", "name them by dof")]
            )
        return place

    def batch(
        self, numbers: Float[np.ndarray, "start number"]
    ) -> Float[np.ndarray, "start quantity"]:
        """Compute the logarithms for a batch of free numbers; NaN for invalid designs.

        Approximate, to choose starts: modes that are followed by shape are those that overlap
        most with the modes of the starting design, and loads are those of the nominal pose.
        """
        columns = [self.freed.values(number) for number in numbers]
        values = {name: np.array([one[name] for one in columns]) for name in columns[0]}
        result = np.full((len(numbers), len(self.requirements.quantities)), np.nan)
        for imperfect in dict.fromkeys(
            getattr(item, "perturbation", ()) for item in self.requirements.quantities
        ):
            text = self.freed.text
            if imperfect:
                text = _with_imperfections_toml(text, imperfect)
            some = [
                n
                for n, item in enumerate(self.requirements.quantities)
                if getattr(item, "perturbation", ()) == imperfect
            ]
            for found, here in variants.balanced(text, values, self.level, allow_unstable=True):
                good = found.status == builds.GOOD
                result[np.ix_(here[good], np.array(some))] = self._of_batch(found, good, some)
        for n, row in enumerate(numbers):
            if np.isfinite(result[n]).any():
                result[n] = self._with_loads(row, result[n])
        return result

    def _of_batch(
        self, found: Builds, good: Bool[np.ndarray, " point"], some: list[int]
    ) -> Float[np.ndarray, "build some"]:
        """Compute the logarithms of some quantities of the valid designs of a batch."""
        quantities = [self.requirements.quantities[n] for n in some]
        result = np.zeros((int(good.sum()), len(some)))
        solved = batch_modes.solve(select_models(found.model, good))
        energy = mode_families.energy_fractions(solved, len(found.model.body))
        for p in range(len(result)):
            ranked = self.families.ranked(energy[p])
            places = _places(
                quantities,
                ranked,
                lambda p=p: mode_pairing.pair_by_shape(self.nominal, solved.shape[p])[0],
            )
            for k, (item, place) in enumerate(zip(quantities, places, strict=True)):
                if isinstance(item, OfMode):
                    top, squared = energy[p, place, 0].sum(), solved.omega_squared[p, place]
                    result[p, k] = (
                        np.log(max(top, TINY))
                        if item.fraction
                        else _of_square(squared, 0.0, self.floors[some[k]])[0]
                    )
        for k, item in enumerate(quantities):
            if isinstance(item, OfResponse):
                result[:, k] = np.log(
                    np.maximum(np.abs(evaluate_ratio(found, item.ratio)[good]), TINY)
                )
        return result

    def _with_loads(
        self, number: Float[np.ndarray, " number"], row: Float[np.ndarray, " quantity"]
    ) -> Float[np.ndarray, " quantity"]:
        """Fill in the logarithms of stresses and heights of a row."""
        design = self.freed.design(number)
        scene = expand(design)
        pose = nominal_pose(scene)
        for n, item in enumerate(self.requirements.quantities):
            if isinstance(item, OfPart | OfDepth):
                row[n] = np.log(np.real(_load(item, design, scene, pose)))
        return row


def static_system(design: Design, level: str) -> LinearSystem:
    """Return the linear system of a model without its terms that depend on frequency."""
    return replace(registry.by_name(level).system(design), terms=())


@dataclass(frozen=True)
class _Built:
    """A design, its system, and their derivatives by each free number."""

    base: Differentiable
    model: LinearSystem
    moves: list[Moved]
    changes: list[Linear]

    @staticmethod
    def of(design: Design, freed: FreeDesign, level: str) -> _Built:
        base, moves = derivatives.prepared(design, level), []
        for rates in freed.directions():
            now = derivatives.moved(base, rates)
            if now is None:
                remedy = "let other numbers change with it by [[equal]]"
                raise InputError(
                    [
                        Fault(
                            f"free.{next(iter(rates))}",
                            "changing it unbalances the nominal suspension",
                            remedy,
                        )
                    ]
                )
            moves.append(now)
        return _Built(
            base,
            static_system(design, level),
            moves,
            [derivatives.linear(base, now) for now in moves],
        )

    def response(self, item: OfResponse) -> tuple[float, Float[np.ndarray, " number"]]:
        """Compute the logarithm of the magnitude of a response, and its derivatives."""
        slope = Slope.of(self.base, self.model, item.ratio)
        if slope.size <= TINY:
            return np.log(TINY), np.zeros(len(self.changes))
        return (
            np.log(slope.size),
            np.array([slope.of_size(change) for change in self.changes]) / slope.size,
        )

    def load(self, item: OfPart | OfDepth) -> tuple[float, Float[np.ndarray, " number"]]:
        """Compute the logarithm of a stress or a height, and its derivatives."""
        value = float(np.real(_load(item, self.base.design, self.base.scene, self.base.pose)))
        rates = [np.imag(_load(item, now.design, now.scene, now.pose)) / STEP for now in self.moves]
        return np.log(value), np.array(rates) / value


@dataclass(frozen=True)
class _TopFractions:
    """Fractions of the kinetic energy of modes in the top mass, and their derivatives."""

    found: Modes
    linear: Linear

    def _parts(
        self, mass: Array, shape: Float[np.ndarray, " coordinate"]
    ) -> tuple[Float[np.ndarray, " coordinate"], Float[np.ndarray, " coordinate"]]:
        """Multiply a shape by the top mass's block of a mass matrix and by all blocks."""
        result, bodies = np.zeros(len(shape)), 6 * len(self.found.body)
        for n in range(0, bodies, 6):
            own = slice(n, n + 6)
            result[own] = mass[6:, 6:][own, own] @ shape[own]
        result[bodies:] = np.diag(mass)[6 + bodies :] * shape[bodies:]
        top = np.zeros(len(shape))
        top[:6] = result[:6]
        return top, result

    def logarithm(
        self, place: int, changes: list[Linear]
    ) -> tuple[float, Float[np.ndarray, " number"]]:
        """Compute the logarithm of the fraction of one mode, and its derivatives."""
        shape, squared = self.found.shape, self.found.omega_squared
        own = shape[place]
        top, every = self._parts(self.linear.mass, own)
        a, b = float(own @ top), float(own @ every)
        if a <= TINY * b:
            return np.log(TINY), np.zeros(len(changes))
        apart = squared[place] - squared
        apart[np.abs(apart) <= DEGENERATE * np.abs(squared[place])] = np.inf
        rates = np.empty(len(changes))
        for n, change in enumerate(changes):
            inertial = change.mass[6:, 6:] @ own
            mixing = (shape @ (change.stiffness[6:, 6:] @ own - squared[place] * inertial)) / apart
            rate = mixing @ shape - own * (own @ inertial) / 2  # dv_k
            top_rate, every_rate = self._parts(change.mass, own)
            rates[n] = (2 * (rate @ top) + own @ top_rate) / a - (
                2 * (rate @ every) + own @ every_rate
            ) / b
        return np.log(a / b), rates


def _places(
    quantities: Sequence[Quantity], ranked: list[Index], follow: Callable[[], Index]
) -> list[int]:
    """Find the modes that the quantities refer to; -1 for other quantities."""
    followed = (
        follow()
        if any(isinstance(item, OfMode) and item.number >= 0 for item in quantities)
        else None
    )
    return [
        (
            -1
            if not isinstance(item, OfMode)
            else int(
                ranked[item.family][item.rank]
                if followed is None or item.number < 0
                else followed[item.number]
            )
        )
        for item in quantities
    ]


def _of_square(squared: float, rate: Array | float, floor: float) -> tuple[float, Array | float]:
    """Compute the log of the frequency (Hz) of an omega^2, linear below `floor`, and its rate."""
    size = max(squared, floor)
    return np.log(size) / 2 - np.log(2 * np.pi) + (squared - size) / (2 * floor), rate / (2 * size)


def _load(item: OfPart | OfDepth, design: Design, scene: Scene, pose: Pose) -> complex:
    return (
        loads.stress(design, scene, pose, item.part)
        if isinstance(item, OfPart)
        else loads.depth(scene, pose, item.stage)
    )


def with_imperfections(design: Design, perturbation: tuple[Perturbation, ...]) -> Design:
    """Add imperfections to those of a design."""
    return msgspec.structs.replace(design, perturbation=[*design.perturbation, *perturbation])


def _with_imperfections_toml(text: str, perturbation: tuple[Perturbation, ...]) -> str:
    """Add imperfections to those of a design as TOML."""
    raw = tomllib.loads(text)
    raw["perturbation"] = [
        *raw.get("perturbation", []),
        *(msgspec.to_builtins(item) for item in perturbation),
    ]
    return reader.write_toml(raw)
