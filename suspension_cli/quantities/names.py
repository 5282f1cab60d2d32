"""What the names of quantities may refer to in a design: its bodies, signals, wires, loops."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

from suspension_cli.design.schema import Design
from suspension_cli.equilibrium.nominal import expand, expand_nominal
from suspension_cli.linear import signals
from suspension_cli.linear.mode_families import Families
from suspension_cli.linear.symmetry import is_mirror_symmetric
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import registry
from suspension_cli.physics import statics
from suspension_cli.physics.loads import Statics
from suspension_cli.scene.scene import Scene

if TYPE_CHECKING:
    from suspension_cli.linear.eigenmodes import Modes
    from suspension_cli.physics.noise_budget import Surroundings
    from suspension_cli.quantities.quantity import Quantity


@dataclass(frozen=True)
class Names:
    """A design, and the settings that some quantities take from it.

    Attributes
    ----------
    find_coupling
        Finds the ratio that ``coupling`` means.
    find_surroundings
        Reads what moves the support, for ``noise`` and ``rms``.
    """

    design: Design
    find_coupling: Callable[[Names], Quantity] = field(compare=False)
    find_surroundings: Callable[[], Surroundings] = field(compare=False)

    @cached_property
    def coupling(self) -> Quantity:
        """The ratio that ``coupling`` means."""
        return self.find_coupling(self)

    @cached_property
    def surroundings(self) -> Surroundings:
        """What moves the support."""
        return self.find_surroundings()

    @cached_property
    def system(self) -> LinearSystem:
        """The design on strings, whose model is cheapest."""
        return registry.STRING.system(self.design)

    @cached_property
    def modes(self) -> Modes:
        """Undamped modes on strings, for messages."""
        from suspension_cli.linear import eigenmodes

        return eigenmodes.solve(self.system.constant)

    @cached_property
    def families(self) -> Families:
        """Families of modes that do not couple in the design without its imperfections."""
        return Families.of(is_mirror_symmetric(expand_nominal(self.design)), self.modes.energy)

    @cached_property
    def signals(self) -> tuple[str, ...]:
        """Bodies with signals."""
        return signals.bodies_with_signals(self.system)

    @property
    def stages(self) -> tuple[str, ...]:
        """Names of the bodies."""
        return self.system.body

    @cached_property
    def blades(self) -> list[str]:
        """Labels of the blades."""
        return list(self.scene.blades.label)

    @cached_property
    def scene(self) -> Scene:
        """The design as arrays."""
        return expand(self.design)

    @cached_property
    def statics(self) -> Statics:
        """Loads of the design."""
        return statics.solve(self.design)

    @property
    def labels(self) -> list[str]:
        """Motions of the modes, for suggestions."""
        return list(dict.fromkeys(self.modes.motion))
