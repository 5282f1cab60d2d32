"""Contributions of a kind of element to the energy and the matrices of a scene."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.elements.geometric_stiffness import rotation_hessian, sum_by, torques
from suspension_cli.scene.pose import Layout, Pose
from suspension_cli.scene.scene import Scene

if TYPE_CHECKING:
    from jaxtyping import Inexact, Int

    from suspension_cli.design.schema import Design

    Matrix = Callable[
        [Scene, Layout, Pose], Inexact[np.ndarray, "*batch coordinate coordinate"] | float
    ]


@dataclass(frozen=True)
class Derivatives:
    """Derivatives of the potential energy in one pose, to which each element adds its own.

    Attributes
    ----------
    gradient
        N and N m. Blades add the part of the forces on their tips.
    hessian
        Tangent stiffness, N/m, N and N m; the last row and column are for rigid directions of
        blades.
    outer
        Sum of F w^T of the forces on each body (see `geometric_stiffness`), N m.
    on_tips
        Gradient with respect to the places of blade tips, global axes, N.
    """

    gradient: Inexact[np.ndarray, "*batch coordinate"]
    hessian: Inexact[np.ndarray, "*batch 1+coordinate 1+coordinate"]
    outer: Inexact[np.ndarray, "*batch 1+body 3 3"]
    on_tips: Inexact[np.ndarray, "*batch blade 3"]

    @classmethod
    def zeros(cls, scene: Scene, numbering: Layout) -> Derivatives:
        """Derivatives of a scene without any element."""
        size, bodies, tips = numbering.size, len(scene.bodies.name) + 1, len(scene.blades.label)
        shapes = ((size,), (size + 1, size + 1), (bodies, 3, 3), (tips, 3))
        return cls(*(np.zeros((*scene.batch, *shape)) for shape in shapes))

    def add_forces(
        self,
        body: Int[np.ndarray, " point"],
        force: Inexact[np.ndarray, "*#batch point 3"],
        arm: Inexact[np.ndarray, "*#batch point 3"],
        blade: Int[np.ndarray, " point"] | None = None,
    ) -> None:
        """Add the gradient with respect to points of bodies, or of blade tips.

        Parameters
        ----------
        force
            Gradient of the energy with respect to the place of each point, N.
        arm
            From the COM of its body to the point, global axes, m.
        blade
            The blade whose tip carries the point, or -1.
        """
        bodies, products = self.outer.shape[-3], force[..., :, None] * arm[..., None, :]
        flat = products.reshape(*products.shape[:-2], 9)
        both = np.concatenate([np.broadcast_to(force, products.shape[:-1]), flat], axis=-1)
        total = sum_by(body, both, bodies)
        of_bodies = self.gradient[..., : 6 * bodies]
        of_bodies.reshape(*of_bodies.shape[:-1], bodies, 6)[..., :3] += total[..., :3]
        self.outer[...] += total[..., 3:].reshape(*total.shape[:-1], 3, 3)
        if blade is not None:
            self.on_tips[...] += sum_by(blade, force, self.on_tips.shape[-2])

    def sums(
        self,
    ) -> tuple[
        Inexact[np.ndarray, "*batch coordinate"],
        Inexact[np.ndarray, "*batch coordinate coordinate"],
    ]:
        """Gradient, and tangent stiffness, exactly symmetric."""
        rows = 6 * np.arange(self.outer.shape[-3])[:, None] + np.arange(3, 6)
        self.gradient[..., rows] += torques(self.outer)
        blocks = rotation_hessian(self.outer)
        self.hessian[..., rows[:, :, None], rows[:, None, :]] += blocks
        whole = self.hessian[..., :-1, :-1]
        return self.gradient, (whole + np.swapaxes(whole, -1, -2)) / 2


@dataclass(frozen=True)
class Element:
    """One kind of element.

    Attributes
    ----------
    energy
        Potential energy (...) relative to the nominal pose, J.
    add_derivatives
        Adds the derivatives of that energy in a pose.
    mass, damping, loss
        Mass, viscous damping, and imaginary part of the stiffness, (..., N, N), or 0; None if
        absent.
    make
        Makes its arrays from the design and the scene of all else; None for an element on arrays
        that every scene has. It acts only in scenes in which they have a `label`.
    name
        Of these arrays in `Scene.added`.
    compiled
        Whether the loops for batches have its formulas, see `equilibrium.compiled`. Batches with an
        element that they lack are solved by arrays, which takes longer.
    """

    energy: Callable[[Scene, Pose], Inexact[np.ndarray, "*batch"]]
    add_derivatives: Callable[[Scene, Layout, Pose, Derivatives], None]
    mass: Matrix | None = None
    damping: Matrix | None = None
    loss: Matrix | None = None
    make: Callable[[Design, Scene], Any] | None = None
    name: str = ""
    compiled: bool = False
