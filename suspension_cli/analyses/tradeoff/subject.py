"""A design with its models, the input of all comparisons."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from suspension_cli.design.derive import mirror
from suspension_cli.design.schema import Design, Perturbation
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.linear import signals
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import registry
from suspension_cli.scene.arrays import Array
from suspension_cli.scene.scene import Scene

if TYPE_CHECKING:
    from jaxtyping import Float

Answer = Callable[[Array], np.ndarray]
"""Response (f,) as a function of frequency (f,), rad/s."""
Prepare = Callable[[LinearSystem, Array, Array], Answer]
"""Prepares an answer from a model and the linear forms (N,) of input and output."""

MODEL_NAMES = tuple(model.name for model in registry.MODELS)
STRING = registry.STRING.name
FREQUENCIES = (1.0, 10.0, 50.0, 100.0, 1000.0)
"""Frequencies of responses, Hz."""
NOISE = (10.0, 100.0)
"""Frequencies of thermal noise, Hz."""
COUPLING = 50.0
"""Frequency of the cross-coupling, Hz (Husman et al. 2000, section 6)."""
K_FACTOR, OFFSET = 1.2, 1e-3
"""Imperfection of a wire: stiffness factor, and offset of the upper end along x, m (mid-range in
Figure 6 of Husman et al.)."""
POINT = "0,0,-0.001"
"""Point of the laser beam, from the COM of the mirror, m."""


@dataclass(frozen=True)
class Subject:
    """A design with its models and scene, each built once."""

    design: Design
    modes: dict[str, Modes] = field(default_factory=dict)
    """By the name of the model, as far as computed."""
    _models: dict[str, LinearSystem] = field(default_factory=dict)
    _answers: dict[Prepare, Answer] = field(default_factory=dict)

    @cached_property
    def unsuited(self) -> dict[str, str]:
        """Reason why each model is not valid; "" if it is."""
        return {level: registry.by_name(level).unsuitable(self.design) for level in MODEL_NAMES}

    @cached_property
    def top(self) -> str:
        """Name of the most complete valid model."""
        return next(level for level in reversed(MODEL_NAMES) if not self.unsuited[level])

    def model(self, level: str) -> LinearSystem:
        """Return the linear system of a model, built once."""
        if level not in self._models:
            self._models[level] = registry.by_name(level).system(self.design)
        return self._models[level]

    def fresh(self, level: str) -> LinearSystem:
        """Return the linear system of a model without cached properties, for timing."""
        return replace(self.model(level))

    def prepared(self, prepare: Prepare) -> Answer:
        """Return the string model's response by a method, prepared once."""
        if prepare not in self._answers:
            model = self.model(STRING)
            self._answers[prepare] = prepare(model, *self.forms(model))
        return self._answers[prepare]

    @property
    def last(self) -> str:
        """Name of the mirror."""
        return mirror(self.design)

    def forms(
        self, model: LinearSystem
    ) -> tuple[Float[np.ndarray, " coordinate"], Float[np.ndarray, " coordinate"]]:
        """Linear forms of the motions along x of the support and of the mirror."""
        known = signals.bodies_with_signals(model)
        into = signals.parse_input("support.x", known)
        out = signals.parse_output(f"{self.last}.x", known)
        return signals.linear_form(into, model), signals.linear_form(out, model)

    def coupled(self, model: LinearSystem) -> tuple[signals.Signal, list[signals.Signal]]:
        """Signals of the cross-coupling: z of the support; x and z of `POINT` of the mirror."""
        known = signals.bodies_with_signals(model)
        return signals.parse_input("support.z", known), [
            signals.parse_output(f"{self.last}.{dof}@{POINT}", known) for dof in "xz"
        ]

    @cached_property
    def scene(self) -> Scene:
        """Nominal scene."""
        return expand(self.design)

    @cached_property
    def wire(self) -> int:
        """Number of the first wire of the mirror; -1 if it hangs on none."""
        labels = enumerate(self.scene.wires.label)
        return next((n for n, label in labels if label.startswith(f"{self.last}.")), -1)

    @cached_property
    def imperfect(self) -> Subject:
        """Subject with `wire` imperfect."""
        wire, offset = self.scene.wires.label[self.wire], (OFFSET, 0.0, 0.0)
        item = Perturbation(wire=wire, k_factor=K_FACTOR, upper_offset=offset)
        every = [*self.design.perturbation, item]
        return Subject(msgspec.structs.replace(self.design, perturbation=every))

    @property
    def temperature(self) -> float:
        """Temperature of parts without their own, K."""
        return self.design.constants.temperature

    @property
    def omega(self) -> Float[np.ndarray, " frequency"]:
        """Frequencies of responses, rad/s."""
        return 2 * np.pi * np.array(FREQUENCIES)
