"""Contributions of a kind of element to the energy and the matrices of a scene."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from suspension_cli.elements.configuration import Configuration
from suspension_cli.elements.energy_derivatives import Derivatives
from suspension_cli.scene.scene import Scene

if TYPE_CHECKING:
    from suspension_cli.design.schema import Design

Contribution = Callable[[Configuration, Derivatives], None]
"""Adds derivatives, or a form that stands for a tangent stiffness, of builds in one pose each."""


@dataclass(frozen=True)
class Element:
    """One kind of element.

    `add_derivatives` adds those of its energy; mass, damping and loss (the imaginary part of the
    stiffness) are added as second derivatives of a quadratic energy. `make`
    makes arrays of its own from the design and the scene of all else, which are known by `name` in
    `Scene.added`; it is None for an element on arrays that every scene has. It acts only in scenes
    in which they have a `label`.
    """

    add_derivatives: Contribution
    add_mass: Contribution | None = None
    add_damping: Contribution | None = None
    add_loss: Contribution | None = None
    make: Callable[[Design, Scene], Any] | None = None
    name: str = ""
