"""Where bodies hang: displacements and rotations from the nominal pose, and heights."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from suspension_cli.conventions import SUPPORT
from suspension_cli.errors import InputError, format_value, suggest
from suspension_cli.quantities.kind import Kind
from suspension_cli.quantities.names import Names
from suspension_cli.quantities.quantity import Quantity
from suspension_cli.quantities.solved import Solved

if TYPE_CHECKING:
    from jaxtyping import Float

STATIC = {"x": "m", "y": "m", "height": "m", "roll": "rad", "pitch": "rad", "yaw": "rad"}
"""Units of static displacements and rotations of a body, in the order of its coordinates."""


@dataclass(frozen=True)
class StaticPose(Quantity):
    """Displacement (m) or rotation (rad) of a body from its nominal pose.

    The displacement is that of the point of the body where its COM is nominally
    (`studies.builds.Builds.static`).
    """

    body: int
    dof: int

    signed: ClassVar[bool] = True
    steady: ClassVar[bool] = False
    analytic: ClassVar[bool] = True
    negligible: ClassVar[float] = 1e-5
    zero = "by symmetry or balance"
    missing = "does not hang on taut wires"

    def read(self, solved: Solved) -> Float[np.ndarray, " design"]:
        """Read it of all designs."""
        return solved.on_strings(lambda hung: hung.found.static[:, self.body, self.dof])

    def scale(self, solved: Solved, values: Float[np.ndarray, " design"]) -> float:
        """Size of the largest displacement, or rotation, of all bodies of the batch.

        A displacement that a symmetry forbids is a rounding error, whose own size means nothing.
        """
        del values
        alike = slice(0, 3) if self.dof < 3 else slice(3, 6)
        every = solved.on_strings(lambda hung: hung.found.static[:, :, alike])
        return float(np.fmax.reduce(np.abs(every[solved.hangs]), axis=None, initial=0.0))


@dataclass(frozen=True)
class Height(Quantity):
    """How far the COM of a body hangs below the suspension point, m."""

    body: int

    steady: ClassVar[bool] = False
    analytic: ClassVar[bool] = True
    missing = "does not hang on taut wires"

    def read(self, solved: Solved) -> Float[np.ndarray, " design"]:
        """Read it of all designs."""
        return solved.on_strings(self._read)

    def _read(self, solved: Solved) -> Float[np.ndarray, " design"]:
        place = solved.scene.bodies.position[..., 1 + self.body, 2]
        shift = solved.equilibrium.pose.shift[..., 1 + self.body, 2]
        return -np.broadcast_to(place + shift, (solved.count,))


def _find_body(name: str, names: Names, text: str, option: str) -> int:
    if name not in names.stages:
        known = list(names.stages)
        remedy = suggest(name, known)
        raise InputError.of(option, "names no stage", remedy, format_value(text))
    return names.stages.index(name)


def parse_static(text: str, names: Names, option: str) -> Quantity | None:
    """Parse ``test static pitch``; z is called height."""
    body, static, dof = text.partition(" static ")
    if not static:
        return None
    dof = "height" if dof == "z" else dof
    if dof not in STATIC:
        remedy = f"write {body} static {'|'.join(STATIC)}"
        raise InputError.of(option, "is no static motion", remedy, format_value(text))
    number = _find_body(body, names, text, option)
    return StaticPose(f"{body} static {dof}", STATIC[dof], number, list(STATIC).index(dof))


def parse_height(text: str, names: Names, option: str) -> Quantity | None:
    """Parse ``test height``."""
    body, space, word = text.rpartition(" ")
    if word != "height" or body == SUPPORT or not space:
        return None
    return Height(text, "m", _find_body(body, names, text, option))


KINDS = (
    Kind(
        "STAGE static x|y|height|roll|pitch|yaw",
        "test static pitch",
        "m, rad",
        "static displacement or rotation from the nominal pose, with its sign",
        parse_static,
    ),
    Kind(
        "STAGE height",
        "test height",
        "m",
        "distance by which the centre of mass hangs below the suspension point",
        parse_height,
    ),
)
