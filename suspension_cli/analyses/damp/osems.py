"""How loops in the six coordinates of a stage share its OSEMs.

An OSEM at the point p of a body reads s = d . (x + t x p) = d . x + (p x d) . t along its direction
d if the body moves by x and turns by t: a row of the sensing matrix S, s = S q. Its coil acts by
the same row, F = S^T f (virtual work). So a loop that reads g . q, or pushes by F = g u, gives the
OSEMs the weights g S^+ with the pseudo-inverse S^+. They touch no other coordinate if g S^+ S = g,
and of all such weights have the least sum of squares: the least noise of equal OSEMs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.conventions import DOFS
from suspension_cli.design.schema import Loop
from suspension_cli.design.sensors import Osem
from suspension_cli.errors import Fault, InputError, format_value
from suspension_cli.files.declared import derived, in_unit
from suspension_cli.linear.signals import Signal

if TYPE_CHECKING:
    from jaxtyping import Float

TINY = 1e-11
"""Relative size of singular values, errors of g S^+ S and weights that are rounding errors of 0."""


@dataclass(frozen=True)
class OsemMatrices:
    """Matrices of the OSEMs of one stage.

    `to_euler` gives the coordinates that they resolve (m, rad) from readings (m), `to_coil` forces
    of coils (N) from forces and torques on the coordinates (N, N m).
    """

    stage: str
    reference: str
    osem: tuple[str, ...]
    coordinate: tuple[str, ...]
    to_euler: Float[np.ndarray, "coordinate osem"] = field(metadata=in_unit("SI"))

    @property
    @derived("SI")
    def to_coil(self) -> Float[np.ndarray, "osem coordinate"]:
        """The transpose of `to_euler`."""
        return self.to_euler.T


def compute_weights(
    form: Float[np.ndarray, "*form 6"], osems: Sequence[Osem]
) -> tuple[Float[np.ndarray, "*form osem"], np.ndarray]:
    """Compute weights g S^+ of linear forms g, and whether the OSEMs of a body resolve each."""
    along = np.array([one.vector for one in osems])
    sensing = np.hstack([along, np.cross([one.at for one in osems], along)])
    size = np.linalg.norm(sensing, axis=0)  # rotations to the scale of displacements
    size[size == 0] = 1.0
    weights = (form / size) @ np.linalg.pinv(sensing / size, rcond=TINY)
    largest = np.abs(weights).max(-1, keepdims=True)
    weights = np.where(np.abs(weights) > TINY * largest, weights, 0.0)
    return weights, (np.abs(weights @ sensing - form) <= TINY * size).all(-1)


def compute_matrices(osems: Sequence[Osem]) -> tuple[OsemMatrices, ...]:
    """Compute the matrices of each stage with OSEMs (of each reference, if there are two)."""
    found = []
    for place in dict.fromkeys((one.stage, one.reference) for one in osems):
        some = _select(osems, *place)
        weights, known = compute_weights(np.eye(6), some)
        names = tuple(dof for dof, one in zip(DOFS, known, strict=True) if one)
        found.append(OsemMatrices(*place, tuple(one.name for one in some), names, weights[known]))
    return tuple(found)


def _select(osems: Sequence[Osem], stage: str, reference: str) -> list[Osem]:
    return [one for one in osems if (one.stage, one.reference) == (stage, reference)]


def weigh(osems: Sequence[Osem], loop: Loop, signal: Signal) -> Float[np.ndarray, " osem"]:
    """Compute the weights of all OSEMs in a signal of a loop; 0 for those of other stages.

    Raises `InputError` if the OSEMs do not resolve it, or the loop gives noise of its own.
    """
    own = _select(osems, signal.body, signal.against or loop.reference)
    if not own:
        return np.zeros(len(osems))
    key = f"control.loop.{loop.name}.{'actuator' if signal.acts else 'sensor'}"
    if loop.actuator_noise if signal.acts else loop.sensor_noise:
        problem = f"conflicts with the OSEMs of {signal.body}, whose noise enters the loop"
        raise InputError([Fault(f"{key}_noise", problem, "give the noise of each OSEM alone")])
    form = np.eye(6)[signal.dof]
    if signal.dof < 3:
        form[3:] = np.cross(signal.point, form[:3])
    some, resolved = compute_weights(form, own)
    if not resolved:
        names = compute_matrices(own)[0].coordinate
        remedy = f"add OSEMs: these resolve {', '.join(names) or 'no coordinate alone'}"
        problem = f"is not resolved by the OSEMs of {signal.body}"
        raise InputError([Fault(key, problem, remedy, format_value(signal.text))])
    return np.array([some[own.index(one)] if one in own else 0.0 for one in osems])
