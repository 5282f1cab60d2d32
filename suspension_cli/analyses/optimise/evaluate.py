"""Quantities of a design, as `pendsus modes`, `response` and `check` compute them.

Their derivatives by free numbers are central differences (`studies.derivatives`): of responses and
loads themselves, and of the matrix R of the modes s_j,

    R_jk = s_j (K(omega_k) - omega_k^2 M) s_k,

whose diagonal changes as omega_j^2 does, and which changes their shapes to first order by

    sum of s_j R_jk / (omega_k^2 - omega_j^2)    over the other modes j of the same symmetry

(Rayleigh; Courant & Hilbert, Methoden der mathematischen Physik I, section V.13). Fractions of
kinetic energy are those of the changed shapes. With wire mass, to which violin modes contribute,
their derivatives are exact but for the fraction of the energy in the wires.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from suspension_cli.analyses import model_choice
from suspension_cli.analyses.check import statics
from suspension_cli.analyses.optimise import mode_families
from suspension_cli.analyses.optimise.free_parameters import FreeDesign
from suspension_cli.analyses.optimise.mode_families import Families
from suspension_cli.analyses.optimise.quantities import (
    OfMode,
    OfResponse,
    OfStatics,
    Quantity,
    Requirements,
    interpret,
)
from suspension_cli.analyses.sweep.solve import evaluate_ratio
from suspension_cli.design import checks
from suspension_cli.design.schema import Design, Perturbation
from suspension_cli.equilibrium.nominal import expand_nominal
from suspension_cli.errors import InputError
from suspension_cli.linear import batch_modes, eigenmodes, response, signals
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.named_results import Ratio
from suspension_cli.linear.signals import Signal
from suspension_cli.linear.symmetry import is_mirror_symmetric
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import choice, registry
from suspension_cli.models.choice import Frequencies, Results, Systems, Transfer
from suspension_cli.models.registry import Choice
from suspension_cli.scene.arrays import Array
from suspension_cli.studies.builds import Builds
from suspension_cli.studies.derivatives import Differences, differentiate, mode_matrix, neighbours
from suspension_cli.studies.parameters import Parameter

if TYPE_CHECKING:
    from jaxtyping import Float, Int

    Imperfections = tuple[Perturbation, ...]

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
class Values:
    """Quantities of one design.

    Attributes
    ----------
    value, log : arrays
        In their units, NaN for a mode that is unstable or cannot be followed; and logarithms, with
        a continuation for unstable modes.
    place : array
        Number of the mode of each, from 0; -1 for other quantities.
    ranked : list of int arrays
        Numbers of the modes of each family, ascending in frequency.
    massive : bool
        Whether the modes include the mass of wires.
    """

    design: Design
    value: Float[np.ndarray, " quantity"]
    log: Float[np.ndarray, " quantity"]
    place: Int[np.ndarray, " quantity"]
    modes: Modes
    ranked: list[Int[np.ndarray, " _"]]
    massive: bool


@dataclass(frozen=True)
class Evaluator:
    """Quantities of a design as functions of its free numbers.

    Attributes
    ----------
    families : Families
        Mode families of the starting design.
    modes : Choice
        The model of all modes.
    responses : dict of Choice
        The model of each response.
    """

    freed: FreeDesign
    requirements: Requirements
    families: Families
    modes: Choice
    responses: dict[Quantity, Choice]

    @staticmethod
    def of(
        freed: FreeDesign,
        level: str,
        tolerance: float,
        fraction: Float[np.ndarray, " number"],
        least: Evaluator | None = None,
    ) -> Evaluator:
        """Interpret the goals, and choose the cheapest models that are accurate at a design.

        Parameters
        ----------
        freed : FreeDesign
        level : str
            Name of a model for all, or ``auto``.
        tolerance : float
            Relative error that ``auto`` may leave.
        fraction : array
            Free numbers of the design.
        least : Evaluator, optional
            Whose models are the cheapest to take, as other designs need them.

        Raises
        ------
        InputError
            If the requested model is not valid, or the design lacks what a goal refers to.
        """

        def choose(request: Results, perturbation: Imperfections, least: Choice | None) -> Choice:
            here = with_imperfections(freed.design(fraction), perturbation)
            models, compare = registry.SCENE_MODELS, Systems(here).compare(lambda _: request)
            model_choice.demand_one_of(level, models, "cannot compute derivatives")
            found = choice.choose(here, level, models, compare, tolerance)
            if level != registry.AUTO or least is None or found.model.cost >= least.model.cost:
                return found
            kept = choice.choose(here, least.level, (), compare)
            reason = kept.reason.replace("as requested", "other designs of the search need it", 1)
            return replace(kept, reason=reason)

        modes = choose(Frequencies(), (), least and least.modes)
        design = freed.design(freed.begin)
        for n, goal in enumerate(freed.goals.goal, 1):
            imperfect = with_imperfections(design, tuple(goal.perturbation or ()))
            faults = checks.check_design(imperfect) if goal.perturbation else []
            if faults:
                raise InputError([replace(one, key=f"goal.{n}.{one.key}") for one in faults])
        model = modes.model.system(design)
        found = eigenmodes.solve(model.constant)
        families = Families.of(is_mirror_symmetric(expand_nominal(design)), found.energy)
        known = signals.bodies_with_signals(model)
        wanted = interpret(freed.goals, design, found, families, known, modes.level)
        responses: dict[Quantity, Choice] = {}
        for item in wanted.quantities:
            if isinstance(item, OfResponse):
                at = np.array([item.ratio.frequency])
                request = Transfer([item.ratio.input], outputs_of(item.ratio), at)
                known_least = least and least.responses.get(item)
                responses[item] = choose(request, item.perturbation, known_least)
        return Evaluator(freed, wanted, families, modes, responses)

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """Quantities in the order of all arrays."""
        return self.requirements.quantities

    def level(self, item: Quantity) -> str:
        """Name of the model of a quantity; "" for loads (straight wires)."""
        if isinstance(item, OfStatics):
            return ""
        return self.responses.get(item, self.modes).level

    @property
    def levels(self) -> list[str]:
        """Names of all models, that of the modes first."""
        return [one.level for one in (self.modes, *self.responses.values())]

    @cached_property
    def _nominal(self) -> Float[np.ndarray, "mode coordinate"]:
        """Shapes of the modes of the starting design, as in `batch_modes.Spectrum`."""
        model = self.modes.model.system(self.freed.design(self.freed.begin))
        return batch_modes.solve(model.constant).shape

    @cached_property
    def _floors(self) -> Float[np.ndarray, " quantity"]:
        """omega^2, (rad/s)^2, below which logarithms of frequencies continue linearly."""
        lowest = np.full(len(self.quantities), np.inf)
        for limit in self.requirements.limits:
            lowest[limit.quantity] = min(lowest[limit.quantity], limit.value)
        return (2 * np.pi * np.where(np.isinf(lowest), LINEAR_BELOW_HZ, LINEAR_BELOW * lowest)) ** 2

    def values(self, fraction: Float[np.ndarray, " number"], steps: int = PATH_STEPS) -> Values:
        """Evaluate the quantities; raises `InputError` if the design is invalid.

        `steps` are those of the path along which modes with a label are followed.
        """
        design = self.freed.design(fraction)
        systems: dict[Imperfections, Systems] = {(): Systems(design)}
        model = systems[()](self.modes.model)
        modes = mode_families.solve_modes(model)
        ranked, followed = self.families.ranked(modes.energy), np.zeros(0, dtype=int)
        if any(isinstance(item, OfMode) and item.number >= 0 for item in self.quantities):
            values = zip(
                self.freed.values(self.freed.begin).items(),
                self.freed.values(fraction).values(),
                strict=True,
            )
            path = {name: np.linspace(start, end, steps + 1) for (name, start), end in values}
            followed = mode_families.follow_modes(
                self.freed.text, path, self.modes.level, self._nominal, modes, model
            )
        value, place = self._loads(design), np.full(len(self.quantities), -1)
        for n, item in enumerate(self.quantities):
            if isinstance(item, OfMode):
                rows = followed if item.number >= 0 else ranked[item.family]
                number = max(item.number, item.rank)
                place[n] = rows[number] if number < len(rows) else -1
                if place[n] < 0:
                    problem = "modes named by label cannot be followed to this design"
                    raise InputError.of("goal", problem, "name them by dof instead")
                value[n] = (modes.top_fraction if item.fraction else modes.frequency)[place[n]]
            elif isinstance(item, OfResponse):
                own = item.perturbation
                if own not in systems:
                    systems[own] = Systems(with_imperfections(design, own))
                value[n] = _magnitude(
                    systems[own](self.responses.get(item, self.modes).model), item.ratio
                )
        log = np.log(np.maximum(value, TINY))
        for n in self._frequencies:
            squared = max(float(modes.omega_squared[place[n]]), self._floors[n])
            beyond = (modes.omega_squared[place[n]] - squared) / (2 * self._floors[n])
            log[n] = np.log(squared) / 2 - np.log(2 * np.pi) + beyond
        massive = mode_families.has_wire_mass(model)
        return Values(design, value, log, place, modes, ranked, massive)

    @property
    def _frequencies(self) -> list[int]:
        """Numbers of the quantities that are frequencies of modes."""
        return [
            n
            for n, item in enumerate(self.quantities)
            if isinstance(item, OfMode) and not item.fraction
        ]

    def slopes(
        self, at: Values, fraction: Float[np.ndarray, " number"]
    ) -> Float[np.ndarray, "quantity number"]:
        """Differentiate logarithms of the quantities by the free numbers."""
        design, directions = at.design, self.freed.directions(fraction)
        slope = np.zeros((len(self.quantities), len(directions)))
        groups: dict[tuple[Imperfections, str], dict[int, Ratio]] = {}
        for n, item in enumerate(self.quantities):
            if isinstance(item, OfMode):
                groups.setdefault(((), self.modes.level), {})
            elif isinstance(item, OfResponse):
                groups.setdefault((item.perturbation, self.level(item)), {})[n] = item.ratio
        for key, ratios in groups.items():
            modal = key == ((), self.modes.level)

            def evaluate(
                found: Builds, modal: bool = modal, ratios: dict[int, Ratio] = ratios
            ) -> Array:
                columns = [evaluate_ratio(found, ratio) for ratio in ratios.values()]
                return np.column_stack([*columns, *(_mode_changes(found, at) if modal else ())])

            imperfect = with_imperfections(design, key[0])
            around = differentiate(imperfect, directions, key[1], evaluate, relative=STEP)
            _demand_balance(around, directions)
            sizes, rates = np.abs(around.nominal), around.of_magnitudes
            for k, n in enumerate(ratios):
                slope[n] = rates[:, k] / sizes[k] if sizes[k] > TINY else 0.0
            if modal:
                changes = np.real(around.central[:, len(ratios) :]).reshape(len(directions), 2, -1)
                for n, item in enumerate(self.quantities):
                    if isinstance(item, OfMode):
                        slope[n] = changes[:, int(item.fraction), at.place[n]]
        for n in self._frequencies:
            slope[n] /= 2 * max(float(at.modes.omega_squared[at.place[n]]), self._floors[n])
        loads = [n for n, item in enumerate(self.quantities) if isinstance(item, OfStatics)]
        if loads:
            step, designs = neighbours(design, directions, STEP)
            log = np.log([self._loads(one)[loads] for one in designs])
            slope[loads] = (log[::2] - log[1::2]).T / (2 * step)
        return slope

    def _loads(self, design: Design) -> Float[np.ndarray, " quantity"]:
        """Stresses and depths, as in `pendsus check`; NaN for other quantities."""
        found = np.full(len(self.quantities), np.nan)
        if any(isinstance(item, OfStatics) for item in self.quantities):
            solved = statics.solve(design)
            for n, item in enumerate(self.quantities):
                if isinstance(item, OfStatics):
                    found[n] = item.value(design, solved)
        return found


def with_imperfections(design: Design, perturbation: Imperfections) -> Design:
    """Add imperfections to those of a design."""
    return msgspec.structs.replace(design, perturbation=[*design.perturbation, *perturbation])


def outputs_of(ratio: Ratio) -> list[Signal]:
    """Outputs of a response, or of a ratio of two."""
    return [ratio.over] + ([] if ratio.under is None else [ratio.under])


def _magnitude(model: LinearSystem, ratio: Ratio) -> float:
    """Magnitude of a response, or of a ratio of two, of one design."""
    found = response.solve(model, np.array([ratio.frequency]), [ratio.input], outputs_of(ratio))
    size = np.abs(found.value[0, :, 0])
    with np.errstate(divide="ignore"):
        return float(size[0] if len(size) == 1 else size[0] / size[1] if size[0] else 0.0)


def _mode_changes(found: Builds, at: Values) -> Float[np.ndarray, "change*mode build"]:
    """Compute changes of omega^2 of all modes, then logarithms of energy fractions in the top mass.

    Of builds that are neighbours of a design with values `at`.
    """
    modes = at.modes
    matrix = mode_matrix(found, modes, massive=at.massive)
    squared, count = modes.omega_squared, len(found.model.body)
    apart = squared - squared[:, None]
    mixing = (modes.block == modes.block[:, None]) & (apart != 0)
    mix = np.where(mixing, matrix / np.where(mixing, apart, 1.0), 0.0)
    shape = modes.shape + mix.swapaxes(1, 2) @ modes.shape
    moved = shape[..., : 6 * count].reshape(*shape.shape[:2], count, 6)
    mass = np.broadcast_to(found.model.mass, (len(shape), *found.model.mass.shape[-2:]))
    own = np.stack([mass[:, 6 * n : 6 * n + 6, 6 * n : 6 * n + 6] for n in range(1, count + 1)], 1)
    energy = np.einsum("bmni,bnij,bmnj->bmn", moved, own, moved)
    top = energy[:, np.arange(len(squared)), modes.top_mass] / energy.sum(-1)
    squares = np.einsum("bkk->kb", matrix)
    return np.concatenate([squares, np.log(np.maximum(top, TINY)).T])


def _demand_balance(around: Differences, directions: Sequence[Parameter]) -> None:
    """Raise `InputError` if a number cannot change alone."""
    for item, good in zip(directions, around.balanced, strict=True):
        if not good:
            problem = "a change of this number alone unbalances the suspension in its nominal pose"
            remedy = "let other numbers depend on it by [[equal]]"
            raise InputError.of(f"free.{item.name}", problem, remedy)
