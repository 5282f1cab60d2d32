"""Logarithms of a design's quantities and their exact derivatives with respect to its free numbers, on the `string` rung.

Derivatives of frequencies: `sensitivity.squares`; of responses: `slope`; of stresses and heights: one complex step with the equilibrium's change
(`derivatives.moved`).  The share s = v D v / v E v of a mode v in the top mass (D its block of the mass matrix, E all blocks) changes with the
shape.  For v_k M v_k = 1, and modes without a common omega^2,

    dv_k = sum over j != k of v_j (v_j dK v_k - lambda_k v_j dM v_k) / (lambda_k - lambda_j)  -  v_k (v_k dM v_k) / 2

on all coordinates that have inertia (Fox and Kapoor, AIAA Journal 6, 2426 (1968)); the others have no part in D and E.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import msgspec
import numpy as np

from suspension_cli.analysis import builds, derivatives, modes, spectrum, variants
from suspension_cli.analysis.builds import Builds
from suspension_cli.analysis.derivatives import Differentiable, Linear, Moved
from suspension_cli.analysis.modes import DEGENERATE, Modes
from suspension_cli.analysis.optimise import families, loads
from suspension_cli.analysis.optimise.families import Families
from suspension_cli.analysis.optimise.freed import Freed
from suspension_cli.analysis.optimise.quantities import OfDepth, OfMode, OfPart, OfResponse, Wanted
from suspension_cli.analysis.parameters import STEP
from suspension_cli.analysis.sensitivity import squares
from suspension_cli.analysis.slope import Slope
from suspension_cli.analysis.sweep import picked, ratio_of
from suspension_cli.design import reader
from suspension_cli.design.scene import Array, Scene
from suspension_cli.design.schema import Design, Perturbation
from suspension_cli.errors import Fault, InputError
from suspension_cli.mechanics.model import LinearModel
from suspension_cli.mechanics.nominal import expand
from suspension_cli.mechanics.pose import Pose, nominal_pose
from suspension_cli.models import fidelity

TINY = 1e-30
"""What stands for a share or response of 0, whose logarithm there is none of."""
SOFT = 0.1
"""Share of its lowest limit below which a frequency's logarithm goes on as a straight line in omega^2, to negative ones."""
SLOWEST = 1e-3
"""Hz; the same for a frequency without limits."""


@dataclass(frozen=True)
class Valued:
    """Logarithms (q,) of quantities, and their derivatives (q, p) with respect to the free numbers."""

    log: Array
    slope: Array


@dataclass(frozen=True)
class Values:
    """Quantities of a freed design.

    Attributes
    ----------
    freed : Freed
    wanted : Wanted
    families : Families
    """

    freed: Freed
    wanted: Wanted
    families: Families

    @cached_property
    def nominal(self) -> Array:
        """Shapes of the starting design's modes, as `spectrum.Spectrum` has them."""
        return spectrum.of_one(fidelity.linear_model(self.freed.design(self.freed.start), "string")).shape[0]

    @cached_property
    def floors(self) -> Array:
        """omega^2 (q,) below which logarithms of frequencies go on as straight lines."""
        lowest = np.full(len(self.wanted.quantities), np.inf)
        for limit in self.wanted.limits:
            lowest[limit.quantity] = min(lowest[limit.quantity], limit.value)
        return (2 * np.pi * np.where(np.isinf(lowest), SLOWEST, SOFT * lowest)) ** 2

    def at(self, number: Array) -> Valued:
        """Values and derivatives for the free numbers (p,); raises `InputError` if there is no such design."""
        design = self.freed.design(number)
        own = _Built.of(design, self.freed)
        imperfect: dict[tuple[Perturbation, ...], _Built] = {(): own}
        found = modes.solve(own.model)
        places = self.places(found, own.base.linear.mass, number)
        rates = np.stack([squares(found, change) for change in own.changes], axis=1)
        shares = _Shares.of(found, own.base.linear)
        log, slope = np.empty(len(places)), np.zeros((len(places), len(own.changes)))
        for n, (item, place) in enumerate(zip(self.wanted.quantities, places, strict=True)):
            if isinstance(item, OfMode) and item.share:
                log[n], slope[n] = shares.logarithm(place, own.changes)
            elif isinstance(item, OfMode):
                log[n], slope[n] = _of_square(found.omega_squared[place], rates[place], self.floors[n])
            elif isinstance(item, OfResponse):
                if item.perturbation not in imperfect:
                    imperfect[item.perturbation] = _Built.of(with_imperfections(design, item.perturbation), self.freed)
                log[n], slope[n] = imperfect[item.perturbation].response(item)
            else:
                log[n], slope[n] = own.load(item)
        return Valued(log, slope)

    def places(self, found: Modes, mass: Array, number: Array) -> list[int]:
        """The mode that each quantity is about, among those of the design for the free numbers (p,); -1 for other quantities."""
        ranked = self.families.ranked(found.energy)
        return _places(self.wanted.quantities, ranked, lambda: self._became(found, mass, number))

    def _became(self, found: Modes, mass: Array, number: Array) -> Any:
        """Which mode each mode of the starting design has become."""
        start, end = self.freed.values(self.freed.start), self.freed.values(number)
        place = families.became(self.freed.text, start, end, self.nominal, found, mass)
        if (place < 0).any():
            raise InputError([Fault("goal", "modes cannot be followed there", "name them by dof and rank")])
        return place

    def batch(self, numbers: Array) -> Array:
        """Logarithms (s, q) for many values (s, p) of the free numbers, all designs together; NaN where there is no design.

        Modes followed by shape are those that overlap the starting design's most, and loads those of the designs as drawn: good enough to choose from.
        """
        columns = [self.freed.values(number) for number in numbers]
        values = {name: np.array([one[name] for one in columns]) for name in columns[0]}
        result = np.full((len(numbers), len(self.wanted.quantities)), np.nan)
        for imperfect in dict.fromkeys(getattr(item, "perturbation", ()) for item in self.wanted.quantities):
            text = self.freed.text if not imperfect else perturbed_text(self.freed.text, imperfect)
            some = [n for n, item in enumerate(self.wanted.quantities) if getattr(item, "perturbation", ()) == imperfect]
            for found, here in variants.balanced(text, values, "string", allow_unstable=True):
                good = found.status == builds.GOOD
                result[np.ix_(here[good], some)] = self._of_batch(found, good, some)
        for n, row in enumerate(numbers):
            if np.isfinite(result[n]).any():
                result[n] = self._loaded(row, result[n])
        return result

    def _of_batch(self, found: Builds, good: Any, some: list[int]) -> Array:
        """Logarithms (g, k) of some quantities of the models that are good."""
        quantities = [self.wanted.quantities[n] for n in some]
        result = np.zeros((int(good.sum()), len(some)))
        solved = spectrum.solve(picked(found.model, good))
        energy = families.batched(solved, len(found.model.body))
        for p in range(len(result)):
            ranked = self.families.ranked(energy[p])
            places = _places(quantities, ranked, lambda p=p: spectrum.matched(self.nominal, solved.shape[p])[0])
            for k, (item, place) in enumerate(zip(quantities, places, strict=True)):
                if isinstance(item, OfMode):
                    top, squared = energy[p, place, 0].sum(), solved.omega_squared[p, place]
                    result[p, k] = np.log(max(top, TINY)) if item.share else _of_square(squared, 0.0, self.floors[some[k]])[0]
        for k, item in enumerate(quantities):
            if isinstance(item, OfResponse):
                result[:, k] = np.log(np.maximum(np.abs(ratio_of(found, item.ratio)[good]), TINY))
        return result

    def _loaded(self, number: Array, row: Array) -> Array:
        """A row with the logarithms of stresses and heights put in."""
        design = self.freed.design(number)
        scene = expand(design)
        pose = nominal_pose(scene)
        for n, item in enumerate(self.wanted.quantities):
            if isinstance(item, OfPart | OfDepth):
                row[n] = np.log(np.real(_load(item, design, scene, pose)))
        return row


@dataclass(frozen=True)
class _Built:
    """One design, its model, how it moves along each free number, and the derivatives of its matrices."""

    base: Differentiable
    model: LinearModel
    moves: list[Moved]
    changes: list[Linear]

    @staticmethod
    def of(design: Design, freed: Freed) -> _Built:
        base, moves = derivatives.prepared(design), []
        for rates in freed.directions():
            now = derivatives.moved(base, rates)
            if now is None:
                remedy = "tie what has to change with it by [[equal]]"
                raise InputError([Fault(f"free.{next(iter(rates))}", "cannot change like this: the suspension would not balance as it is drawn", remedy)])
            moves.append(now)
        return _Built(base, fidelity.linear_model(design, "string"), moves, [derivatives.linear(base, now) for now in moves])

    def response(self, item: OfResponse) -> tuple[float, Array]:
        """Logarithm of the size of a response, and its derivatives."""
        slope = Slope.of(self.base, self.model, item.ratio)
        if slope.size <= TINY:
            return np.log(TINY), np.zeros(len(self.changes))
        return np.log(slope.size), np.array([slope.of_size(change) for change in self.changes]) / slope.size

    def load(self, item: OfPart | OfDepth) -> tuple[float, Array]:
        """Logarithm of a stress or a height, and its derivatives."""
        value = float(np.real(_load(item, self.base.design, self.base.scene, self.base.pose)))
        rates = [np.imag(_load(item, now.design, now.scene, now.pose)) / STEP for now in self.moves]
        return np.log(value), np.array(rates) / value


@dataclass(frozen=True)
class _Shares:
    """Shares of the modes' kinetic energy in the top mass, and what their derivatives need."""

    found: Modes
    linear: Linear

    @staticmethod
    def of(found: Modes, linear: Linear) -> _Shares:
        return _Shares(found, linear)

    def _parts(self, mass: Array, shape: Array) -> tuple[Array, Array]:
        """The blocks' products with a shape (c,): of the top mass, and of all parts."""
        result, bodies = np.zeros(len(shape)), 6 * len(self.found.body)
        for n in range(0, bodies, 6):
            own = slice(n, n + 6)
            result[own] = mass[6:, 6:][own, own] @ shape[own]
        result[bodies:] = np.diag(mass)[6 + bodies :] * shape[bodies:]
        top = np.zeros(len(shape))
        top[:6] = result[:6]
        return top, result

    def logarithm(self, place: int, changes: list[Linear]) -> tuple[float, Array]:
        """Logarithm of one mode's share, and its derivatives."""
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
            dragged = change.mass[6:, 6:] @ own
            turn = (shape @ (change.stiffness[6:, 6:] @ own - squared[place] * dragged)) / apart
            moved = turn @ shape - own * (own @ dragged) / 2
            more_top, more = self._parts(change.mass, own)
            rates[n] = (2 * (moved @ top) + own @ more_top) / a - (2 * (moved @ every) + own @ more) / b
        return np.log(a / b), rates


def _places(quantities: Any, ranked: list[Any], became: Any) -> list[int]:
    """The mode that each quantity is about; -1 for other quantities."""
    followed = became() if any(isinstance(item, OfMode) and item.number >= 0 for item in quantities) else None
    return [
        -1 if not isinstance(item, OfMode) else int(ranked[item.family][item.rank] if followed is None or item.number < 0 else followed[item.number])
        for item in quantities
    ]


def _of_square(squared: Any, rate: Any, floor: float) -> tuple[Any, Any]:
    """Logarithm of the frequency (Hz) of an omega^2, and its derivative; a straight line below the floor."""
    size = max(squared, floor)
    return np.log(size) / 2 - np.log(2 * np.pi) + (squared - size) / (2 * floor), rate / (2 * size)


def _load(item: OfPart | OfDepth, design: Design, scene: Scene, pose: Pose) -> Any:
    return loads.stress(design, scene, pose, item.part) if isinstance(item, OfPart) else loads.depth(scene, pose, item.stage)


def with_imperfections(design: Design, perturbation: tuple[Perturbation, ...]) -> Design:
    """A design built less well."""
    return msgspec.structs.replace(design, perturbation=[*design.perturbation, *perturbation])


def perturbed_text(text: str, perturbation: tuple[Perturbation, ...]) -> str:
    """The same as TOML."""
    raw = tomllib.loads(text)
    raw["perturbation"] = [*raw.get("perturbation", []), *(msgspec.to_builtins(item) for item in perturbation)]
    return reader.dump(raw)
