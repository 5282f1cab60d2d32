"""Measured profiles of fibres: what reducing them to sections changes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.check.statics import Statics
from suspension_cli.design import materials
from suspension_cli.design.schema import Design
from suspension_cli.design.sections import stretches
from suspension_cli.design.wires import Profile, Wire, WireSet
from suspension_cli.elements import joined_sections
from suspension_cli.elements.dynamic_wire import TautWire
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.models import registry

if TYPE_CHECKING:
    from jaxtyping import Float

ELEMENTS = 6000
"""Elements of the unreduced fibre, and twice as many: their error goes with the square."""


@dataclass(frozen=True)
class ReducedProfile:
    """One measured profile and its sections: their numbers and the relative changes of stiffness.

    The change in bending is the largest one of the static stiffness (displacement and rotation
    of either end). `allowed` is what the design allows.
    """

    wire: str
    places: int
    sections: int
    stretching_change: float
    bending_change: float
    allowed: float

    @property
    def line(self) -> str:
        """The reduction in a line."""
        worst = max(self.stretching_change, self.bending_change)
        verdict = "within" if worst <= self.allowed else "ABOVE"
        return (
            f"profile of {self.wire}: {self.places} places in {self.sections} sections; stretching"
            f" changes by {self.stretching_change:.0e}, bending by {self.bending_change:.0e},"
            f" {verdict} the {self.allowed:g} allowed"
        )


def solve(design: Design, statics: Statics) -> list[ReducedProfile]:
    """Compare every measured profile with its sections."""
    found: list[ReducedProfile] = []
    measured = [item for item in _tables(design) if isinstance(item[1].profile, Profile)]
    if not measured:
        return found
    scene = registry.BEAM.completed(expand(design), design)
    assert scene.fibres is not None
    for name, table, number in measured:
        own = table.profile
        assert isinstance(own, Profile)
        length, tension = float(scene.wires.length[number]), statics.wires[number].tension
        fibre = scene.fibres.wire[number]
        modulus = materials.resolve(design, table.material or "").youngs_modulus
        assert modulus is not None
        z = np.array(own.position) - own.position[0]
        z *= length / z[-1]
        d = np.array(own.diameter)
        exact = _converged(z, d, modulus, tension)
        wire = TautWire(fibre, tension, massive=False, lossy=False)
        ends = joined_sections.to_ends(wire.resting("bend-1"))[..., 0]
        change = np.abs(ends[np.ix_([1, 3, 2], [1, 3, 2])] - exact)
        root = np.sqrt(np.diag(exact))
        compliance = (np.diff(z) / (d[1:] * d[:-1])).sum() * 4 / np.pi / modulus
        pieces = stretches(table, length)
        reduced = sum(piece.length / (modulus * piece.shape.area) for piece in pieces)
        found.append(
            ReducedProfile(
                name,
                len(own.position),
                len(pieces),
                abs(compliance / reduced - 1),
                float((change / np.outer(root, root)).max()),
                own.error,
            )
        )
    return found


def _tables(design: Design) -> list[tuple[str, WireSet | Wire, int]]:
    """Name, table and number of the (first) wire of every table."""
    result: list[tuple[str, WireSet | Wire, int]] = []
    first = 0
    for stage in design.stage:
        if stage.wires is not None:
            result.append((f"{stage.name}.wires", stage.wires, first))
            first += stage.wires.count
        for n, wire in enumerate(stage.wire, 1):
            result.append((f"{stage.name}.{n}", wire, first))
            first += 1
    return result


def _converged(
    z: Sequence[float] | Float[np.ndarray, " node"],
    d: Sequence[float] | Float[np.ndarray, " node"],
    modulus: float,
    tension: float,
) -> Float[np.ndarray, "3 3"]:
    """Static stiffness from two meshes, extrapolated (Richardson)."""
    coarse, fine = (bending_stiffness(z, d, modulus, tension, n * ELEMENTS) for n in (1, 2))
    return fine + (fine - coarse) / 3


def bending_stiffness(
    z: Sequence[float] | Float[np.ndarray, " node"],
    d: Sequence[float] | Float[np.ndarray, " node"],
    modulus: float,
    tension: float,
    count: int,
) -> Float[np.ndarray, "3 3"]:
    """Static stiffness (3, 3) of a fibre against the slopes of its ends and the shift of one.

    By linear finite elements of the slope f = w', for which E I f'' - T f = const is of second
    order; the mean of f is given by the shift. Unlike elements of w this loses no digits.

    Parameters
    ----------
    z, d : (n,) arrays
        Places and diameters, linear in between, m.
    modulus, tension : float
        Pa and N.
    count : int
        Number of elements.
    """
    from scipy.linalg import solve_banded

    x = np.linspace(z[0], z[-1], count + 1)
    h = x[1] - x[0]
    rigid = modulus * np.pi / 64 * np.interp((x[1:] + x[:-1]) / 2, z, d) ** 4
    diagonal, beside = np.zeros(count + 1), -rigid / h + tension * h / 6
    diagonal[1:] += rigid / h + tension * h / 3
    diagonal[:-1] += rigid / h + tension * h / 3
    band = np.zeros((3, count - 1))
    band[0, 1:], band[1], band[2, :-1] = beside[1:-1], diagonal[1:-1], beside[1:-1]
    weight = np.full(count + 1, h)
    weight[[0, -1]] = h / 2
    right = np.zeros((count - 1, 3))
    right[0, 0], right[-1, 1], right[:, 2] = beside[0], beside[-1], weight[1:-1]
    inner = solve_banded((1, 1), band, right)
    ends = np.diag(diagonal[[0, -1]]) - right[:, :2].T @ inner[:, :2]
    moved = weight[[0, -1]] - right[:, :2].T @ inner[:, 2]
    give = weight[1:-1] @ inner[:, 2]
    result = np.zeros((3, 3))
    result[:2, :2] = ends + np.outer(moved, moved) / give
    result[:2, 2] = result[2, :2] = -moved / give
    result[2, 2] = 1 / give
    return result
