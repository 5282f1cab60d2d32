"""Places of the bodies of a design, and which hangs from which."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.conventions import GROUND
from suspension_cli.design import derive
from suspension_cli.design.bodies import centre_of_mass
from suspension_cli.design.schema import Design

if TYPE_CHECKING:
    from jaxtyping import Float


@dataclass(frozen=True)
class Places:
    """Tree of the bodies; number 0 is the support, n the n-th stage.

    The origin of a body is its COM unless it has parts. Points of a design are from origins, those
    of a scene from COMs.
    """

    number: dict[str, int]  # of each body by name, 0 also for the ground
    parent: list[int]  # the body above each, 0 for the support itself
    offset: Float[np.ndarray, "1+body 3"]  # origin from that above (or the suspension point), m
    position: Float[np.ndarray, "1+body 3"]  # origin from the suspension point, m
    centre: Float[np.ndarray, "1+body 3"]  # COM from the origin, m

    @classmethod
    def of(cls, design: Design) -> Places:
        """The places of the bodies of a design."""
        position = derive.origin_positions(design)
        number = {name: n for n, name in enumerate(position)} | {GROUND: 0}
        parent = [0, *(number[above] for _, above in derive.with_bodies_above(design))]
        offset = np.array([(0.0, 0.0, 0.0), *map(derive.origin_offset, design.stage)])
        centre = np.array([(0.0, 0.0, 0.0), *(centre_of_mass(one.body) for one in design.stage)])
        return cls(number, parent, offset, np.array([*position.values()]), centre)

    def between(self, upper: int, lower: int) -> Float[np.ndarray, " 3"]:
        """Origin of one body from that of another, m."""
        if lower and self.parent[lower] == upper:
            return self.offset[lower]  # exact where a difference of positions is rounded
        return self.position[lower] - self.position[upper]
