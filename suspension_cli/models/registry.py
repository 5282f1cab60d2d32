"""The models from the cheapest to the most complete, and which of them a design needs.

Adding a model takes its file and an entry in `FILES`. Models are imported when first needed, so
that options and help can list them at once.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from suspension_cli.design.schema import Design
    from suspension_cli.models.base import Model
    from suspension_cli.models.beam import BEAM as BEAM
    from suspension_cli.models.beam import VIOLIN as VIOLIN
    from suspension_cli.models.closed_form import CLOSED_FORM as CLOSED_FORM
    from suspension_cli.models.force import FORCE as FORCE
    from suspension_cli.models.string import STRING as STRING
    from suspension_cli.models.string import SceneModel

    MODELS: tuple[Model, ...]
    MOST_COMPLETE: Model
    SCENE_MODELS: tuple[SceneModel, ...]

FILES = {
    "closed-form": "closed_form",
    "force": "force",
    "string": "string",
    "beam": "beam",
    "violin": "beam",
}
"""File in this folder of each model, by name, from the cheapest to the most complete; its object
has the name of the model in capitals."""
AUTO = "auto"
LEVELS = (AUTO, *FILES)
"""Values of ``--fidelity``."""
NOTHING = "neglected: nothing that pendsus can model"
"""What follows a model with all physics."""


def __getattr__(name: str) -> Any:
    """`MODELS`, `SCENE_MODELS` (general, with imperfect builds), `MOST_COMPLETE`, `STRING`, ..."""
    if name == "MODELS":
        return tuple(map(by_name, FILES))
    if name == "MOST_COMPLETE":
        return by_name([*FILES][-1])
    if name == "SCENE_MODELS":
        return tuple(model for model in map(by_name, FILES) if model.supports_builds)
    if name.isupper() and (level := name.lower().replace("_", "-")) in FILES:
        return by_name(level)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


@dataclass(frozen=True)
class Choice:
    """A model and why it was chosen.

    `reason` says why, then (after a semicolon) what is neglected, for the user.
    """

    level: str
    reason: str
    error: float = math.nan  # of the result, computed at a few points; NaN if unknown
    physics: str = ""  # that the model neglects,
    what: str = ""  # and the result that changes most with it; "" if none

    @property
    def model(self) -> Model:
        """The model."""
        return by_name(self.level)

    @property
    def line(self) -> str:
        """The choice in one line: ``model: beam (as requested); neglected: wire mass, 0.01 %``."""
        why, _, rest = self.reason.partition("; ")
        if not rest:
            omitted = " and ".join(self.model.omits) if self.error != 0 else ""
            rest = f"neglected: {omitted}, of unknown effect" if omitted else NOTHING
        return f"model: {self.level} ({why}); {rest}"

    @property
    def neglected(self) -> str:
        """The end of the reason: the neglected and the unknown physics; "" if there is none."""
        return self.reason.partition("; ")[2]

    @property
    def error_unknown(self) -> str:
        """Why there is no finite error; "" if there is one."""
        return "" if math.isfinite(self.error) else self.neglected or "not estimated"


def by_name(name: str) -> Model:
    """The model of a name, as ``--fidelity`` takes it (not ``auto``).

    >>> by_name("beam").bends_wires
    True
    """
    module = import_module(f"suspension_cli.models.{FILES[name]}")
    return getattr(module, name.upper().replace("-", "_"))


def scene_model(name: str) -> SceneModel:
    """The model of a name that supports imperfect builds."""
    from suspension_cli.models.string import SceneModel

    model = by_name(name)
    assert isinstance(model, SceneModel)
    return model


def most_complete(design: Design, *, massless: bool = False) -> Model:
    """The most complete model that is valid for a design, of all or of those without wire mass."""
    return next(
        model
        for model in map(by_name, reversed(FILES))
        if not (massless and model.has_wire_mass) and not model.unsuitable(design)
    )


def adds(refined: Model, simple: Model) -> str:
    """Physics in one model that another omits, in words: "wire bending and wire mass"."""
    return " and ".join(item for item in simple.omits if item not in refined.omits)


def choose(design: Design, wanted: str = AUTO) -> Choice:
    """The simplest model that is valid for a design, or the one `wanted` (of `LEVELS`).

    ``auto`` looks only at the structure of the design; `choice.choose` also at the result.

    Raises `InputError` if the requested model is not valid for the design.
    """
    if wanted == AUTO:
        return _simplest(design)
    model = by_name(wanted)
    if why := model.unsuitable(design):
        from suspension_cli.errors import Fault, InputError, format_value

        problem = f"is not valid for {design.design.name}: {why}"
        remedy = f"use {AUTO} or string"
        raise InputError([Fault("--fidelity", problem, remedy, format_value(wanted))])
    return Choice(wanted, "as requested" + _approximation(model, design))


def _simplest(design: Design) -> Choice:
    """The cheapest model that is valid for a design, of those that ``auto`` takes."""
    refused = ""
    for model in map(by_name, FILES):
        if model.automatic:
            why = model.unsuitable(design)
            if not why:
                return Choice(model.name, model.valid_for + refused + _approximation(model, design))
            refused = f", as {why}"
    raise AssertionError("the general models are valid for every design")


def _approximation(model: Model, design: Design) -> str:
    stages = model.approximated_stages(design)
    if not stages:
        return ""
    return (
        f", with blades in series with the angled wires of {', '.join(stages)}, an approximation"
        " that --fidelity string avoids"
    )
