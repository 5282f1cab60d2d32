"""Cantilever blades, whose tips are coordinates of their own.

A tip moves along one to three axes of the body that carries the blade. At a deflection q from the
nominal, loaded position the blade pulls its tip with load - k q, so it stores
-load . q + k q^2 / 2; a tip mass adds weight and inertia. Husman et al. (2000), section 3b: "the
cantilever positions are included as additional state variables".
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.elements.configuration import Configuration
from suspension_cli.elements.derivatives import Derivatives
from suspension_cli.elements.element import Element

if TYPE_CHECKING:
    from jaxtyping import Inexact


def energy(now: Configuration) -> Inexact[np.ndarray, " build"]:
    """Elastic energy of all blades relative to the nominal pose, J."""
    q, blades = now.deflection, now.arrays.blades
    return (blades.stiffness * q**2 / 2 - blades.load * q).sum((0, 1))


def add_derivatives(now: Configuration, derivatives: Derivatives) -> None:
    """Add the derivatives of the energy of all blades."""
    blades, axes = now.arrays.blades, now.arrays.blades.axes.T
    if not blades.label:
        return
    rows = now.arrays.numbering.blade.T[axes]
    derivatives.gradient[rows] += (blades.stiffness * now.deflection - blades.load)[axes]
    if derivatives.curved:
        derivatives.add_diagonal(rows, blades.stiffness[axes])


def add_loss(now: Configuration, derivatives: Derivatives) -> None:
    """Add the imaginary part of the stiffness of all blades."""
    blades, axes = now.arrays.blades, now.arrays.blades.axes.T
    if blades.loss.any():
        rows = now.arrays.numbering.blade.T[axes]
        derivatives.add_diagonal(rows, (blades.stiffness * blades.loss[:, None])[axes])


ELEMENT = Element(energy, add_derivatives, add_loss=add_loss)
