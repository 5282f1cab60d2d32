"""Logarithms of quantities of a design and their derivatives by its free numbers.

Quantities include losses and wire mass if their model does. Matrices are differentiated exactly
where they do not depend on frequency (`studies.derivatives`), else by differences of fourth order
(`studies.differences`); modes as in `mode_derivatives`, responses as in `response_derivatives`.
Stresses and heights, of straight wires, take one complex step with the change of the equilibrium
(`derivatives.moved`).
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, TypeVar

import msgspec
import numpy as np

from suspension_cli.analyses.optimise import loads, mode_families
from suspension_cli.analyses.optimise.chosen_models import Models
from suspension_cli.analyses.optimise.free_parameters import FreeDesign
from suspension_cli.analyses.optimise.mode_derivatives import (
    NODES,
    ModeDerivatives,
    Stiffness,
    differentiate,
    frequencies_around,
)
from suspension_cli.analyses.optimise.mode_families import Families, has_wire_mass
from suspension_cli.analyses.optimise.quantities import (
    OfDepth,
    OfMode,
    OfPart,
    OfResponse,
    Quantity,
    Requirements,
    with_imperfections,
)
from suspension_cli.analyses.sweep.solve import evaluate_ratio, select_models
from suspension_cli.design import reader
from suspension_cli.design.schema import Design, Perturbation
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.errors import Fault, InputError
from suspension_cli.linear import batch_modes, mode_pairing
from suspension_cli.linear.eigenmodes import Modes, find_top_masses
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import registry
from suspension_cli.scene.arrays import Array, Index
from suspension_cli.scene.pose import Pose, nominal_pose
from suspension_cli.scene.scene import Scene
from suspension_cli.studies import builds, derivatives, differences, variants
from suspension_cli.studies.builds import Builds
from suspension_cli.studies.derivatives import Linear
from suspension_cli.studies.parameters import STEP
from suspension_cli.studies.response_derivatives import Slope

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int

Change = TypeVar("Change")
TINY = 1e-30
"""Smallest energy fraction or response, in place of 0, which has no logarithm."""
LINEAR_BELOW = 0.1
"""Frequency, over the lowest limit on it, below which its logarithm continues linearly in omega^2,
to unstable modes."""
LINEAR_BELOW_HZ = 1e-3
"""The same for a mode without limits, Hz."""


@dataclass(frozen=True)
class Evaluation:
    """Logarithms of quantities, and their derivatives by the free numbers."""

    log: Float[np.ndarray, " quantity"]
    slope: Float[np.ndarray, "quantity number"]


@dataclass(frozen=True)
class Evaluator:
    """Quantities of a design as functions of its free numbers."""

    freed: FreeDesign
    requirements: Requirements
    families: Families
    models: Models

    @cached_property
    def nominal(self) -> Float[np.ndarray, "mode coordinate"]:
        """Shapes of the modes of the starting design, as in `batch_modes.Spectrum`."""
        model = self.models.modes.model.system(self.freed.design(self.freed.start))
        return batch_modes.solve_one(model.constant).shape[0]

    @cached_property
    def floors(self) -> Float[np.ndarray, " quantity"]:
        """omega^2, (rad/s)^2, below which logarithms of frequencies continue linearly."""
        lowest = np.full(len(self.requirements.quantities), np.inf)
        for limit in self.requirements.limits:
            lowest[limit.quantity] = min(lowest[limit.quantity], limit.value)
        return (2 * np.pi * np.where(np.isinf(lowest), LINEAR_BELOW_HZ, LINEAR_BELOW * lowest)) ** 2

    @cached_property
    def _groups(self) -> dict[tuple[tuple[Perturbation, ...], str], list[int]]:
        """Modes and responses by their imperfections and their model."""
        result: dict[tuple[tuple[Perturbation, ...], str], list[int]] = {}
        for n, item in enumerate(self.requirements.quantities):
            if isinstance(item, OfMode | OfResponse):
                key = (getattr(item, "perturbation", ()), self.models.of(item))
                result.setdefault(key, []).append(n)
        return result

    def at(self, number: Float[np.ndarray, " number"]) -> Evaluation:
        """Evaluate logarithms and derivatives; raises `InputError` if the design is invalid."""
        design, quantities = self.freed.design(number), self.requirements.quantities
        directions = self.freed.directions(number)
        log, slope = np.empty(len(quantities)), np.zeros((len(quantities), len(directions)))
        for (perturbation, level), some in self._groups.items():
            imperfect = with_imperfections(design, perturbation)
            model = registry.by_name(level).system(imperfect)
            modes = [n for n in some if isinstance(quantities[n], OfMode)]
            found = mode_families.solve_modes(model) if modes else None
            places = {} if found is None else self._places(modes, found, model, number)
            omega = [] if found is None else _around(model, found, places.values())
            first = len(omega)
            ratios = [item for n in some if isinstance(item := quantities[n], OfResponse)]
            omega += [2 * np.pi * item.ratio.frequency for item in ratios]
            base, by_name = differences.changes(imperfect, directions, level, omega)
            changes = [_demanded(name, change) for name, change in by_name.items()]
            if found is not None:
                solved = _Modes(model, found, base.linear, changes, list(places.values()))
                for n, place in places.items():
                    item = quantities[n]
                    assert isinstance(item, OfMode)
                    log[n], slope[n] = solved.evaluate(
                        place, self.floors[n], fraction=item.fraction
                    )
            for k, item in enumerate(ratios, first):
                n = quantities.index(item)
                own = replace(base, linear=differences.at(base.linear, k))
                response = Slope.of(own, model, item.ratio)
                log[n] = np.log(max(response.size, TINY))
                if response.size > TINY:
                    rates = [response.of_size(differences.at(change, k)) for change in changes]
                    slope[n] = np.array(rates) / response.size
        loads = [n for n, item in enumerate(quantities) if isinstance(item, OfPart | OfDepth)]
        if loads:
            base = derivatives.prepared(design)
            moves = [
                _demanded(item.name, derivatives.moved(base, item.rates)) for item in directions
            ]
            for n in loads:
                value = _load(quantities[n], base.design, base.scene, base.pose).real
                rates = [_load(quantities[n], now.design, now.scene, now.pose) for now in moves]
                log[n], slope[n] = np.log(value), np.imag(rates) / STEP / value
        return Evaluation(log, slope)

    def _places(
        self,
        some: list[int],
        found: Modes,
        model: LinearSystem,
        number: Float[np.ndarray, " number"],
    ) -> dict[int, int]:
        """Find the modes of some quantities, by the number of the quantity."""
        chosen = [self.requirements.quantities[n] for n in some]
        places = find_places(
            chosen, self.families.ranked(found.energy), lambda: self.follow(found, model, number)
        )
        if min(places) < 0:
            problem = "modes named by label cannot be followed to this design"
            raise InputError([Fault("goal", problem, "name them by dof instead")])
        return dict(zip(some, places, strict=True))

    def follow(
        self, found: Modes, model: LinearSystem, number: Float[np.ndarray, " number"]
    ) -> Int[np.ndarray, " mode"]:
        """Find the number among `found` of each mode of the starting design; -1 if unknown.

        `found` are the modes with the free numbers, `model` the linear system.
        """
        start, end = self.freed.values(self.freed.start), self.freed.values(number)
        return mode_families.follow_modes(
            self.freed.text, start, end, self.nominal, found, model, self.models.modes.level
        )

    def batch(
        self, numbers: Float[np.ndarray, "start number"]
    ) -> Float[np.ndarray, "start quantity"]:
        """Approximate logarithms for a batch of free numbers; NaN for invalid designs.

        Modes with a label are those that overlap most with the modes of the starting design; loads
        are those of the nominal pose.
        """
        columns = [self.freed.values(number) for number in numbers]
        values = {name: np.array([one[name] for one in columns]) for name in columns[0]}
        result = np.full((len(numbers), len(self.requirements.quantities)), np.nan)
        for (imperfect, level), some in self._groups.items():
            text = _with_imperfections_toml(self.freed.text, imperfect)
            for found, here in variants.balanced(text, values, level, allow_unstable=True):
                good = found.status == builds.GOOD
                result[np.ix_(here[good], np.array(some))] = self._of_batch(found, good, some)
        for row, number in zip(result, numbers, strict=True):
            if np.isfinite(row).any() or not self._groups:
                self._add_loads(number, row)
        return result

    def _of_batch(
        self, found: Builds, good: Bool[np.ndarray, " point"], some: list[int]
    ) -> Float[np.ndarray, "build some"]:
        """Logarithms of some quantities of the valid designs of a batch."""
        quantities = [self.requirements.quantities[n] for n in some]
        result = np.zeros((int(good.sum()), len(some)))
        solved = batch_modes.solve(select_models(found.model, good))
        energy = mode_families.energy_fractions(solved, len(found.model.body))
        for p in range(len(result)):
            ranked = self.families.ranked(energy[p])
            body = find_top_masses(energy[p], found.model.top)
            places = find_places(
                quantities,
                ranked,
                lambda p=p: mode_pairing.pair_by_shape(self.nominal, solved.shape[p])[0],
            )
            for k, (item, place) in enumerate(zip(quantities, places, strict=True)):
                if isinstance(item, OfMode):
                    top, squared = (
                        energy[p, place, body[place]].sum(),
                        solved.omega_squared[p, place],
                    )
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

    def _add_loads(
        self, number: Float[np.ndarray, " number"], row: Float[np.ndarray, " quantity"]
    ) -> None:
        """Fill in the logarithms of stresses and heights of a row."""
        try:
            design = self.freed.design(number)
        except InputError:
            return
        scene = expand(design)
        pose = nominal_pose(scene)
        for n, item in enumerate(self.requirements.quantities):
            if isinstance(item, OfPart | OfDepth):
                row[n] = np.log(np.real(_load(item, design, scene, pose)))


@dataclass(frozen=True)
class _Modes:
    """Modes of a design, with matrices and their changes at the frequencies `_around` them."""

    model: LinearSystem
    found: Modes
    linear: Linear
    changes: list[Linear]
    places: list[int]

    def evaluate(
        self, place: int, floor: float, *, fraction: bool
    ) -> tuple[float, Float[np.ndarray, " number"]]:
        """Logarithm of a frequency or an energy fraction, and its derivatives."""
        squared, rates = self.found.omega_squared[place], self._derivatives(place)
        if not fraction:
            value, slope = _of_square(squared, rates.squared, floor)
            return value, np.asarray(slope)
        top = self.found.top_fraction[place]
        return np.log(max(top, TINY)), rates.fraction if top > TINY else np.zeros(len(self.changes))

    def _derivatives(self, place: int) -> ModeDerivatives:
        cache = self.model.prepared
        if ("derivatives", place) not in cache:
            squared = float(self.found.omega_squared[place])

            def stiffness(linear: Linear) -> Stiffness:
                if has_wire_mass(self.model):
                    start = len(NODES) * sorted(set(self.places)).index(place)
                    return Stiffness.of(linear, squared, start)
                return Stiffness(linear.stiffness[6:, 6:])

            cache["derivatives", place] = differentiate(
                self.model,
                int(self.found.block[place]),
                int(self.found.top_mass[place]),
                self.found.shape[place],
                squared,
                (stiffness(self.linear), self.linear.mass[6:, 6:]),
                [(stiffness(change), change.mass[6:, 6:]) for change in self.changes],
            )
        return cache["derivatives", place]


def _around(model: LinearSystem, found: Modes, places: Iterable[int]) -> list[float]:
    """Frequencies, rad/s, at which derivatives of modes need matrices; [] without wire mass."""
    if not has_wire_mass(model):
        return []
    squared = found.omega_squared[sorted(set(places))]
    return [float(one) for each in squared for one in frequencies_around(each)]


def _demanded(name: str, change: Change | None) -> Change:
    """Return the change by a number; raise `InputError` if it cannot change alone."""
    if change is None:
        problem = "a change of this number alone unbalances the suspension in its nominal pose"
        remedy = "let other numbers depend on it by [[equal]]"
        raise InputError([Fault(f"free.{name}", problem, remedy)])
    return change


def find_places(
    quantities: Sequence[Quantity], ranked: list[Index], follow: Callable[[], Index]
) -> list[int]:
    """Find the modes of quantities; -1 for unknown modes and other quantities."""
    modes = [item for item in quantities if isinstance(item, OfMode)]
    followed = follow() if any(item.number >= 0 for item in modes) else np.zeros(0, dtype=int)

    def place(item: Quantity) -> int:
        if not isinstance(item, OfMode):
            return -1
        if item.number >= 0:
            return int(followed[item.number])
        own = ranked[item.family]
        return int(own[item.rank]) if item.rank < len(own) else -1

    return [place(item) for item in quantities]


def _of_square(squared: float, rate: Array | float, floor: float) -> tuple[float, Array | float]:
    """Logarithm of the frequency (Hz) of omega^2, linear below `floor`, and its rate."""
    size = max(squared, floor)
    return np.log(size) / 2 - np.log(2 * np.pi) + (squared - size) / (2 * floor), rate / (2 * size)


def _load(item: Quantity, design: Design, scene: Scene, pose: Pose) -> complex:
    if isinstance(item, OfPart):
        return loads.stress(design, scene, pose, item.part)
    assert isinstance(item, OfDepth)
    return loads.depth(scene, pose, item.stage)


def _with_imperfections_toml(text: str, perturbation: tuple[Perturbation, ...]) -> str:
    """Add imperfections to those of a design as TOML."""
    raw = tomllib.loads(text)
    if perturbation:
        known = raw.get("perturbation", [])
        raw["perturbation"] = [*known, *map(msgspec.to_builtins, perturbation)]
    return reader.write_toml(raw)
