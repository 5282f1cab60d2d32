"""Protocol of the models: the physics that one omits, where it is valid, its linear system.

A model is one object, listed in `registry.FILES`. Code outside this folder asks its properties,
never its name.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar

from suspension_cli.models.surroundings import surrounded

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import Inexact

    from suspension_cli.design.schema import Design
    from suspension_cli.linear.system import LinearSystem

    Numbers = complex | Inexact[np.ndarray, "*batch"]
    """A number of a closed formula: real, complex, or an array of many designs."""

BLADE_TIPS = "blade tip motion"
BENDING = "wire bending"
MASS = "wire mass"
"""Physics that a model may omit: blade tips as coordinates (else blades act in series with the
stretching of their wires); bending, torsion and frequency-dependent loss of wires; their
distributed mass."""


class Model(ABC):
    """A model of a suspension, from one design to its linear equations of motion."""

    name: ClassVar[str]  # as ``--fidelity`` takes it
    description: ClassVar[str]
    valid_for: ClassVar[str]  # the geometries that it models, in words
    omits: ClassVar[tuple[str, ...]]  # of `BLADE_TIPS`, `BENDING`, `MASS`
    cost: ClassVar[float]
    """Time from a design to its modes, relative to the closed forms (a single pendulum)."""
    automatic: ClassVar[bool] = True
    """Whether ``auto`` may take it."""
    supports_builds: ClassVar[bool] = False
    """Whether it models imperfect builds, which balance away from the nominal pose, by the methods
    of `string.SceneModel`."""

    @property
    def bends_wires(self) -> bool:
        """Whether wires bend and twist, so that their losses act where they bend."""
        return BENDING not in self.omits

    @property
    def has_wire_mass(self) -> bool:
        """Whether wires have mass, so that there are violin modes and no finite state space."""
        return MASS not in self.omits

    @abstractmethod
    def unsuitable(self, design: Design) -> str:
        """Why the model is not valid for a design; "" if it is."""

    @abstractmethod
    def suspension(self, design: Design) -> LinearSystem:
        """The linear model of the bodies on a rigid support, without dampers."""

    def system(self, design: Design) -> LinearSystem:
        """The linear model of a design, with its dampers and its support structure.

        Raises `InputError` if there is no equilibrium, or a wire is slack in it.
        """
        return surrounded(self.suspension(design), design)

    def refined(self, design: Design, built: Mapping[str, LinearSystem]) -> LinearSystem:
        """`system`, from the systems `built` of simpler models, by name, where that saves time."""
        del built
        return self.system(design)

    def approximated_stages(self, design: Design) -> tuple[str, ...]:
        """Stages that the model approximates because it omits `BLADE_TIPS`."""
        del design
        return ()

    def batch_key(self, design: Design) -> Hashable:
        """Key that designs of one batch share; None if each design is solved alone."""
        del design

    def batch(self, designs: Sequence[Design]) -> LinearSystem:
        """Suspensions of designs of one `batch_key` as one linear model, designs as first axis."""
        (design,) = designs
        model = self.suspension(design)
        return replace(model, mass=model.mass[None], soft=model.soft[None])
