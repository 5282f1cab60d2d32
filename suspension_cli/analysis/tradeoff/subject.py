"""What all methods start from: a design, its model on every rung, and the questions asked of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import msgspec
import numpy as np

from suspension_cli.analysis import signals
from suspension_cli.design.scene import Array, Scene
from suspension_cli.design.schema import Design, Perturbation
from suspension_cli.mechanics.model import LinearModel
from suspension_cli.mechanics.nominal import expand
from suspension_cli.models import fidelity

Answer = Callable[[Array], Any]
"""What gives a response (f,) at any frequencies (f,) in rad/s."""
Prepare = Callable[[LinearModel, Array, Array], Answer]
"""What finds it, from a model and the forms (N,) of what drives and what is watched."""

RUNGS = tuple(level for level in fidelity.LEVELS if level != "auto")
FREQUENCIES = (1.0, 10.0, 50.0, 100.0, 1000.0)
"""Hz, at which responses are compared."""
NOISE = (10.0, 100.0)
"""Hz, for thermal noise."""
COUPLING = 50.0
"""Hz (Husman et al. 2000, section 6)."""
K_FACTOR, OFFSET = 1.2, 1e-3
"""The imperfect wire: stiffer by a fifth, its upper end 1 mm off along x (in the middle of what figure 6 of the paper sweeps)."""
POINT = "0,0,-0.001"
"""Where the beam hits, from the last COM."""


@dataclass(frozen=True)
class Subject:
    """One design, as methods take it."""

    design: Design

    @cached_property
    def unsuited(self) -> dict[str, str]:
        """Why each rung does not hold; empty if it does."""
        return {rung: fidelity.unsuited(self.design, rung) for rung in RUNGS}

    @cached_property
    def top(self) -> str:
        """The highest rung that holds."""
        return next(rung for rung in reversed(RUNGS) if not self.unsuited[rung])

    @cached_property
    def _models(self) -> dict[str, LinearModel]:
        return {}

    def model(self, rung: str) -> LinearModel:
        """The model on a rung, built once."""
        if rung not in self._models:
            self._models[rung] = fidelity.linear_model(self.design, rung)
        return self._models[rung]

    def fresh(self, rung: str) -> LinearModel:
        """The same with nothing worked out yet, so that every method pays for what it needs."""
        return replace(self.model(rung))

    @cached_property
    def _answers(self) -> dict[Prepare, Answer]:
        return {}

    def kept(self, prepare: Prepare) -> Answer:
        """What a method works out of the string rung's matrices before it knows the frequencies, worked out once."""
        if prepare not in self._answers:
            model = self.model("string")
            self._answers[prepare] = prepare(model, *self.forms(model))
        return self._answers[prepare]

    @property
    def last(self) -> str:
        """The last stage."""
        return self.design.stage[-1].name

    def forms(self, model: LinearModel) -> tuple[Array, Array]:
        """Motion of the support along x and of the last stage along x, as linear forms (N,)."""
        known = signals.bodies(model)
        return signals.row(signals.drive("support.x", known), model), signals.row(signals.motion(f"{self.last}.x", known), model)

    def coupled(self, model: LinearModel) -> tuple[signals.Signal, list[signals.Signal]]:
        """Vertical motion of the support; motion along x and z of the point where the beam hits."""
        known = signals.bodies(model)
        return signals.drive("support.z", known), [signals.motion(f"{self.last}.{dof}@{POINT}", known) for dof in "xz"]

    @cached_property
    def scene(self) -> Scene:
        """The design as drawn."""
        return expand(self.design)

    @cached_property
    def wire(self) -> int:
        """The first wire of the last stage; -1 if it hangs on none."""
        return next((n for n, label in enumerate(self.scene.wires.label) if label.startswith(f"{self.last}.")), -1)

    @cached_property
    def imperfect(self) -> Subject:
        """The design with that wire spoilt."""
        item = Perturbation(wire=self.scene.wires.label[self.wire], k_factor=K_FACTOR, upper_offset=(OFFSET, 0.0, 0.0))
        return Subject(msgspec.structs.replace(self.design, perturbation=[*self.design.perturbation, item]))

    @property
    def temperature(self) -> float:
        """Of everything that has none of its own, K."""
        return self.design.constants.temperature

    @property
    def omega(self) -> Array:
        """The frequencies of responses, rad/s."""
        return 2 * np.pi * np.array(FREQUENCIES)
