"""Gradient and tangent stiffness of the potential energy of a scene, in closed form."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.elements.configuration import Configuration, batch_of, configuration
from suspension_cli.elements.element import Contribution, Element
from suspension_cli.elements.energy_derivatives import Derivatives
from suspension_cli.elements.known_elements import elements_of
from suspension_cli.scene.pose import Layout, Pose
from suspension_cli.scene.scene import Scene

if TYPE_CHECKING:
    from jaxtyping import Inexact


def gradient_and_stiffness(
    scene: Scene, numbering: Layout, pose: Pose, elements: Sequence[Element] | None = None
) -> tuple[
    Inexact[np.ndarray, "*batch coordinate"], Inexact[np.ndarray, "*batch coordinate coordinate"]
]:
    """Gradient (N and N m) and tangent stiffness of some elements of a scene, by default all.

    The gradient is 0 at an equilibrium, except for the support's six.
    """
    batch = batch_of(scene, pose)
    found = derivatives(configuration(scene, numbering, pose), elements)
    gradient = np.ascontiguousarray(found.gradient[:-1].T)
    return gradient.reshape(*batch, -1), found.symmetric().reshape(*batch, *(numbering.size,) * 2)


def derivatives(
    now: Configuration,
    elements: Sequence[Element] | None = None,
    *,
    curved: bool = True,
    stretching: bool = True,
) -> Derivatives:
    """Derivatives of the energy of builds, see `Derivatives`."""
    result = Derivatives(now, curved=curved, stretching=stretching)
    for element in elements_of(now.arrays.scene) if elements is None else elements:
        element.add_derivatives(now, result)
    return result.finish()


def sum_forms(
    scene: Scene, numbering: Layout, pose: Pose, parts: Sequence[Contribution | None]
) -> Inexact[np.ndarray, "*batch coordinate coordinate"]:
    """Sum quadratic forms of elements, exactly symmetric; without batch axes if all are 0."""
    return sum_in_pose(configuration(scene, numbering, pose), batch_of(scene, pose), parts)


def sum_in_pose(
    now: Configuration, batch: tuple[int, ...], parts: Sequence[Contribution | None]
) -> Inexact[np.ndarray, "*batch coordinate coordinate"]:
    """Sum quadratic forms of elements as `sum_forms`, of builds with the axes `batch`."""
    result = Derivatives(now)
    for part in parts:
        if part is not None:
            part(now, result)
    result.finish()
    size = now.arrays.numbering.size
    if not result.linked.any():
        return np.zeros((size, size))
    return result.symmetric().reshape(*batch, size, size)
