"""The model of thermal noise, which must know where along a wire its loss acts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses import model_choice
from suspension_cli.analyses.thermal import solve as thermal
from suspension_cli.errors import Fault, InputError
from suspension_cli.models import registry
from suspension_cli.models.choice import away_from_modes, spectrum_change

if TYPE_CHECKING:
    from jaxtyping import Float

    from suspension_cli.design.reader import Source
    from suspension_cli.linear.system import LinearSystem
    from suspension_cli.models.registry import Choice


@dataclass(frozen=True)
class Noise:
    """Thermal noise of some motions at frequencies in Hz, as a result that decides on the model."""

    outputs: Sequence[str]
    frequency: Float[np.ndarray, " frequency"]

    def change(self, simple: LinearSystem, refined: LinearSystem) -> tuple[float, str]:
        """Compute the largest relative change at sampled frequencies away from all modes."""
        some = away_from_modes(self.frequency, simple, refined)
        old, new = (self._amplitude(model, some) for model in (simple, refined))
        changes = spectrum_change(old, new)
        most = np.unravel_index(int(np.argmax(changes)), changes.shape)[1]
        return float(changes.max()), f"the noise of {self.outputs[int(most)]}"

    def _amplitude(
        self, model: LinearSystem, frequency: Float[np.ndarray, " sample"]
    ) -> Float[np.ndarray, "sample output"]:
        motions = [thermal.parse_motion(model, text) for text in self.outputs]
        noises = thermal.solve_all(model, frequency, motions, 1.0)
        return np.stack([noise.amplitude for noise in noises], axis=1)


def choose(
    source: Source, wanted: str, frequency: Float[np.ndarray, " frequency"], outputs: Sequence[str]
) -> tuple[Choice, LinearSystem]:
    """Choose the model of thermal noise, and build its linear system.

    Raises `InputError` if the requested model does not resolve wires, or the design lacks their
    properties.
    """
    models = [model for model in registry.SCENE_MODELS if model.bends_wires]
    problem = f"the {wanted} model does not know where along a wire its loss acts"
    model_choice.demand_one_of(wanted, models, problem)
    if why := models[0].unsuitable(source.design):
        remedy = "give its material and radius or section, for its loss"
        raise InputError([Fault("stage", why, remedy)])
    return model_choice.choose(source, wanted, lambda _: Noise(outputs, frequency))
