"""Potential energy of a scene, its gradient and its tangent stiffness, in closed form."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from suspension_cli.elements.element import Derivatives, Element
from suspension_cli.elements.registry import elements_of
from suspension_cli.scene.pose import Layout, Pose
from suspension_cli.scene.scene import Scene

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import Inexact


def energy(scene: Scene, pose: Pose) -> Inexact[np.ndarray, "*batch"]:
    """Elastic and gravitational energy (...) relative to the nominal pose, J."""
    first, *others = (element.energy(scene, pose) for element in elements_of(scene))
    return sum(others, first)


def gradient_and_stiffness(
    scene: Scene, numbering: Layout, pose: Pose, elements: Sequence[Element] | None = None
) -> tuple[
    Inexact[np.ndarray, "*batch coordinate"], Inexact[np.ndarray, "*batch coordinate coordinate"]
]:
    """Gradient and tangent stiffness of a scene in the generalised coordinates.

    Only `elements` count; default: all of the scene.

    Returns
    -------
    gradient
        Of the potential energy, N and N m; 0 at an equilibrium, except for the support's six.
    hessian
        Tangent stiffness, exactly symmetric, N/m, N and N m.
    """
    derivatives = Derivatives.zeros(scene, numbering)
    for element in elements_of(scene) if elements is None else elements:
        element.add_derivatives(scene, numbering, pose, derivatives)
    return derivatives.sums()
