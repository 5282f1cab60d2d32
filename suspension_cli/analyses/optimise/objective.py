"""Logarithms of quantities of a design and their derivatives by its free numbers.

Quantities include losses and wire mass if their model does. Derivatives are central differences
(`studies.derivatives`). Stresses and heights are those of straight wires.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from suspension_cli.analyses.optimise import loads, mode_families
from suspension_cli.analyses.optimise.chosen_models import Models
from suspension_cli.analyses.optimise.free_parameters import FreeDesign
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
from suspension_cli.design.schema import Perturbation
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.errors import Fault, InputError
from suspension_cli.linear import batch_modes, mode_pairing
from suspension_cli.linear.eigenmodes import Modes, find_top_masses
from suspension_cli.linear.named_results import Ratio
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import registry
from suspension_cli.scene.arrays import Array, Index
from suspension_cli.scene.pose import nominal_pose
from suspension_cli.studies import builds, variants
from suspension_cli.studies.builds import Builds
from suspension_cli.studies.derivatives import (
    Differences,
    differentiate,
    dynamic_stiffness,
    mode_matrix,
    neighbours,
)
from suspension_cli.studies.parameters import Parameter

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int

TINY = 1e-30
"""Smallest energy fraction or response, in place of 0, which has no logarithm."""
STEP = 2e-5
"""Step of derivatives, as energy fractions of close modes vary fast (see `studies.derivatives`)."""
APART = 0.1
"""Relative step of omega^2 in the derivative of the stiffness of wires with mass, which is nearly
linear in omega^2."""
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
            modes = {n: item for n in some if isinstance(item := quantities[n], OfMode)}
            ratios = {n: item.ratio for n in some if isinstance(item := quantities[n], OfResponse)}
            found = mode_families.solve_modes(model) if modes else None
            places = [] if found is None else self._places(list(modes), found, model, number)

            def evaluate(
                builds: Builds,
                model: LinearSystem = model,
                found: Modes | None = found,
                places: list[int] = places,
                ratios: dict[int, Ratio] = ratios,
            ) -> Array:
                columns = [evaluate_ratio(builds, ratio) for ratio in ratios.values()]
                return np.column_stack([*_of_modes(builds, model, found, places), *columns])

            around = differentiate(imperfect, directions, level, evaluate, relative=STEP)
            _demand_balance(around, directions)
            if found is not None:
                for k, (n, item) in enumerate(modes.items()):
                    place = places[k]
                    squared, rate = np.real(around.central[:, [k, len(modes) + k]].T)
                    top = found.top_fraction[place]
                    log[n], slope[n] = (
                        (np.log(max(top, TINY)), rate if top > TINY else 0.0)
                        if item.fraction
                        else _of_square(found.omega_squared[place], squared, self.floors[n])
                    )
            for n, value, rate in zip(
                ratios,
                np.abs(around.nominal[2 * len(modes) :]),
                around.of_magnitudes[:, 2 * len(modes) :].T,
                strict=True,
            ):
                log[n] = np.log(max(value, TINY))
                slope[n] = rate / value if value > TINY else 0.0
        of_loads = [n for n, item in enumerate(quantities) if isinstance(item, OfPart | OfDepth)]
        if of_loads:
            some = [quantities[n] for n in of_loads]
            around = differentiate(
                design,
                directions,
                registry.STRING.name,
                lambda builds: np.log([_force_or_depth(item, builds) for item in some]).T,
            )
            _demand_balance(around, directions)
            log[of_loads], slope[of_loads] = around.nominal, around.central.T
            step, designs = neighbours(design, directions)
            for n, item in zip(of_loads, some, strict=True):
                if isinstance(item, OfPart):
                    factor = np.log([loads.stress_per_force(one, item.part) for one in designs])
                    log[n] += np.log(loads.stress_per_force(design, item.part))
                    slope[n] += (factor[::2] - factor[1::2]) / (2 * step)
        return Evaluation(log, slope)

    def _places(
        self,
        some: list[int],
        found: Modes,
        model: LinearSystem,
        number: Float[np.ndarray, " number"],
    ) -> list[int]:
        """Find the modes of some quantities."""
        chosen = [self.requirements.quantities[n] for n in some]
        places = find_places(
            chosen, self.families.ranked(found.energy), lambda: self.follow(found, model, number)
        )
        if min(places) < 0:
            problem = "modes named by label cannot be followed to this design"
            raise InputError([Fault("goal", problem, "name them by dof instead")])
        return places

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
            if isinstance(item, OfPart):
                row[n] = np.log(loads.stress(design, scene, pose, item.part))
            elif isinstance(item, OfDepth):
                row[n] = np.log(loads.depth(scene, pose, item.stage))


def _of_modes(
    found: Builds, model: LinearSystem, modes: Modes | None, places: list[int]
) -> list[Float[np.ndarray, " build"]]:
    """Compute changes of omega^2, then logarithms of the energy fractions in the top mass.

    Of some modes of the design whose neighbours are the builds, by their places among all.
    """
    if modes is None:
        return []
    massive = has_wire_mass(model)
    squares = np.einsum("bkk->kb", mode_matrix(found, modes, massive=massive))[places]
    each = {
        k: np.log(np.maximum(_top_fraction(found, model, modes, k, massive=massive), TINY))
        for k in set(places)
    }
    fractions = [each[k] for k in places]
    return [*squares, *fractions]


def _top_fraction(
    found: Builds, model: LinearSystem, modes: Modes, number: int, *, massive: bool
) -> Float[np.ndarray, " build"]:
    """Fraction of the kinetic energy of a mode in the top mass.

    Of bodies (with the blocks E of their mass matrix M, and D of the top mass), wires and tips:
    (v D v / v E v)(v M v / v T v), with T = M - dK/d(omega^2). The shape v is that of the design's
    own mode s after one step of inverse iteration, Z v = mu T s with s T v = 1. Within the mode's
    block: modes of one symmetry do not share a frequency.
    """
    squared, bodies = float(modes.omega_squared[number]), len(found.model.body)
    dynamic = dynamic_stiffness(found, squared, massive=massive)
    mass = found.model.mass[..., 6:, 6:] + np.zeros_like(dynamic)
    inertia = mass
    if massive and squared > 0:
        above, below = (
            dynamic_stiffness(found, squared * (1 + side * APART), massive=True) for side in (1, -1)
        )
        inertia = (below - above) / (2 * APART * squared)
    own = model.basis[6:, model.blocks[modes.block[number]]]
    edge = (inertia @ modes.shape[number]) @ own
    inner, zero = own.T @ dynamic @ own, np.zeros((len(edge), 1, 1))
    matrix = np.block([[inner, -edge[..., None]], [-edge[:, None], zero]])
    size = np.sqrt(np.abs(np.einsum("bnn->bn", own.T @ (dynamic + squared * mass) @ own)))
    size = np.append(size, (np.abs(edge) / size).max(1)[:, None], axis=1)
    right = np.zeros((*size.shape, 1))
    right[:, -1] = -1.0
    matrix = matrix / (size[:, None] * size[..., None])
    shape = (np.linalg.solve(matrix, right / size[..., None])[:, :-1, 0] / size[:, :-1]) @ own.T

    def of(form: Array) -> Array:
        return np.einsum("bx,bxy,by->b", shape, form, shape)

    body = np.arange(mass.shape[-1]) // 6
    alike = body[:, None] == body
    each = alike & (body < bodies) | np.eye(len(body), dtype=bool)
    return (
        of(mass * (alike & (body == modes.top_mass[number])))
        / of(mass * each)
        * of(mass)
        / of(inertia)
    )


def _demand_balance(around: Differences, directions: Sequence[Parameter]) -> None:
    """Raise `InputError` if a number cannot change alone."""
    for item, good in zip(directions, around.balanced, strict=True):
        if not good:
            problem = "a change of this number alone unbalances the suspension in its nominal pose"
            remedy = "let other numbers depend on it by [[equal]]"
            raise InputError([Fault(f"free.{item.name}", problem, remedy)])


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


def _force_or_depth(item: Quantity, found: Builds) -> Float[np.ndarray, " build"]:
    scene, pose = found.scene, found.pose
    assert scene is not None and pose is not None
    if isinstance(item, OfPart):
        return loads.force(scene, pose, item.part)
    assert isinstance(item, OfDepth)
    return loads.depth(scene, pose, item.stage)


def _with_imperfections_toml(text: str, perturbation: tuple[Perturbation, ...]) -> str:
    """Add imperfections to those of a design as TOML."""
    raw = tomllib.loads(text)
    if perturbation:
        known = raw.get("perturbation", [])
        raw["perturbation"] = [*known, *map(msgspec.to_builtins, perturbation)]
    return reader.write_toml(raw)
