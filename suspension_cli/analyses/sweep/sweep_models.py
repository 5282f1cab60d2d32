"""What a sweep is asked for, and the models in which it can be computed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from suspension_cli.analyses.named_quantities import names_of
from suspension_cli.analyses.sweep.parameter_sweep import ParameterSweep
from suspension_cli.errors import InputError, format_value, gather
from suspension_cli.models import registry
from suspension_cli.quantities import requirements
from suspension_cli.quantities.nominal_results import find_results
from suspension_cli.quantities.quantity import Quantity
from suspension_cli.quantities.requirements import Requirement

if TYPE_CHECKING:
    from suspension_cli.analyses.analysis import Run
    from suspension_cli.design.reader import Source
    from suspension_cli.models.base import Model
    from suspension_cli.physics.log import Log
    from suspension_cli.quantities.names import Names
    from suspension_cli.studies.job import Axis


WHY = {
    "beam": "as losses act where wires bend",
    "violin": "as it is about wires with mass",
}
"""Why quantities are computed in these models, if a simpler one is wanted."""


@dataclass(frozen=True)
class Asked:
    """Axes and names of results as given, with which the sweep is made in any model."""

    source: Source
    axes: tuple[Axis, ...]
    results: tuple[str, ...]
    require: tuple[str, ...]
    allow_unstable: bool
    log: Log

    @staticmethod
    def of(run: Run, axes: tuple[Axis, ...]) -> Asked:
        """Take it from the settings of the command."""
        setting = run.setting
        results = tuple(setting["results"])
        require = tuple(setting["require"])
        return Asked(run.source, axes, results, require, setting["allow_unstable"], run.log)

    @cached_property
    def names(self) -> Names:
        """What names refer to in the design."""
        return names_of(self.source, log=self.log)

    def job(self, level: str) -> ParameterSweep:
        """Make the sweep in a model; modes that are followed are those of the design in it."""
        results = find_results(self.results, self.names, self.source.text, level)
        return ParameterSweep(
            self.source.text, self.axes, level, results, self.allow_unstable, self._judged(results)
        )

    def _judged(self, results: Sequence[Quantity]) -> tuple[Requirement, ...]:
        """Requirements that are judged: of the design on lines those on what is swept, on maps all.

        Those given for this sweep are always judged.
        """
        own = requirements.of_design(self.source.design)
        given = gather(requirements.parse, self.require)
        found = requirements.find([*own, *given], self.names)
        if len(self.axes) > 1:
            return found
        swept = {one.text for one in results}
        return tuple(one for one in found if one.quantity.text in swept or one.limits in given)

    @cached_property
    def _quantities(self) -> tuple[Quantity, ...]:
        """Quantities that are computed; those that are followed are followed in every model."""
        return self.job(registry.STRING.name).quantities

    def _bends(self, quantity: Quantity) -> bool:
        """Whether a quantity needs wires that bend, in this design."""
        return quantity.bends and not registry.BEAM.unsuitable(self.source.design)

    def settle_model(self, wanted: str, say: Callable[[str], None]) -> str:
        """Return the model to compute in: the one wanted, or the simplest that the results allow.

        Says so, if quantities are computed in a more complete model than the one wanted. Raises
        `InputError` if undamped modes are wanted of wires with mass.
        """
        if wanted == registry.AUTO:
            return wanted
        model = registry.choose(self.source.design, wanted).model
        if model.has_wire_mass and any(one.undamped for one in self._quantities):
            remedy = "take beam, or leave out frequencies of undamped modes"
            problem = "has no modes that could be followed"
            raise InputError.of("--fidelity", problem, remedy, format_value(model.name))
        raised = {one.text: one.level(wanted, self.source.design) for one in self._quantities}
        for level in dict.fromkeys(raised.values()):
            if level != wanted:
                names = ", ".join(name for name, own in raised.items() if own == level)
                say(f"{names}: computed in the {level} model, {WHY[level]}")
        if wanted in raised.values():
            return wanted
        return max(raised.values(), key=[*registry.FILES].index)

    def usable(self, wanted: str) -> list[Model]:
        """Models in which the sweep can be computed, from the cheapest to the most complete."""
        models = list(registry.MODELS)
        if any(one.undamped for one in self._quantities):
            models = [model for model in models if not model.has_wire_mass]
        elif all(one.wire_mass for one in self._quantities):
            models = [model for model in models if model.has_wire_mass]
        bends = any(self._bends(one) for one in self._quantities)
        if bends and (wanted == registry.AUTO or registry.by_name(wanted).bends_wires):
            models = [model for model in models if model.bends_wires]
        return models

    def simplest(self, wanted: str) -> str:
        """Name of the wanted model, or of the simplest that the design and the results allow."""
        if wanted != registry.AUTO:
            return wanted
        design = self.source.design
        valid = [model for model in self.usable(wanted) if not model.unsuitable(design)]
        automatic = [model.name for model in valid if model.automatic]
        return automatic[0] if automatic else registry.choose(design, wanted).level
