"""Groups of arrays that compiled loops read and fill: pose, derivatives and wires of a build."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from jaxtyping import Float, Int


class PoseArrays(NamedTuple):
    """Pose of one build, or of many with the builds as first axis; see `Pose` for the fields."""

    shift: Float[np.ndarray, "*build 1+body 3"]
    turn: Float[np.ndarray, "*build 1+body 3 3"]
    deflection: Float[np.ndarray, "*build blade 3"]


class Derivatives(NamedTuple):
    """Derivatives of the energy of one build, to which each element adds its own.

    Attributes
    ----------
    gradient
        N and N m.
    hessian
        Tangent stiffness, N/m, N and N m; only its lower triangle is filled.
    on_tips
        Gradient with respect to the places of the blade tips, global axes, N.
    """

    gradient: Float[np.ndarray, " coordinate"]
    hessian: Float[np.ndarray, "coordinate coordinate"]
    on_tips: Float[np.ndarray, "blade 3"]


class WireRows(NamedTuple):
    """Wires or struts of one build.

    Attributes
    ----------
    ends
        Upper and lower body, and blade at the upper end or -1.
    sections
        See `compiled_wire`; (0, 0, 10) for strings.
    numbers
        Rows of `compiled.WIRE`.
    flex
        Rows of `compiled.FLEX`; (0, 19) for wires that resist neither bending nor twisting.
    """

    ends: Int[np.ndarray, "wire 3"]
    sections: Float[np.ndarray, "_ section 10"]
    numbers: Float[np.ndarray, "wire 13"]
    flex: Float[np.ndarray, "_ 19"]
