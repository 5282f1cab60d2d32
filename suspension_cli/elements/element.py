"""Contributions of a kind of element to the energy and the matrices of a scene."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.elements.configuration import Configuration
from suspension_cli.elements.derivatives import Derivatives
from suspension_cli.scene.scene import Scene

if TYPE_CHECKING:
    from jaxtyping import Inexact

    from suspension_cli.design.schema import Design

Contribution = Callable[[Configuration, Derivatives], None]
"""Adds derivatives, or a form that stands for a tangent stiffness, of builds in one pose each."""


@dataclass(frozen=True)
class Element:
    """One kind of element.

    Attributes
    ----------
    energy
        Potential energy of each build relative to the nominal pose, J.
    add_derivatives
        Adds the derivatives of that energy.
    add_mass, add_damping, add_loss
        Add the mass matrix, viscous damping and imaginary part of the stiffness, all as the second
        derivatives of a quadratic energy; None if absent.
    make
        Makes its arrays from the design and the scene of all else; None for an element on arrays
        that every scene has. It acts only in scenes in which they have a `label`.
    name
        Of these arrays in `Scene.added`.
    """

    energy: Callable[[Configuration], Inexact[np.ndarray, " build"]]
    add_derivatives: Contribution
    add_mass: Contribution | None = None
    add_damping: Contribution | None = None
    add_loss: Contribution | None = None
    make: Callable[[Design, Scene], Any] | None = None
    name: str = ""
