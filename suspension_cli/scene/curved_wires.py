"""Stiffness and sag of curved wires.

A curved wire is clamped at its end B and loaded at its end A by a force F and a moment
M. Its cross-section at r, with unit tangent t, carries the force F and the moment m = M + (r_A - r)
x F. With the strain energy per length

    (F . t)^2 / 2 EA + (m . t)^2 / 2 GJ + |m - (m . t) t|^2 / 2 EI,

Castigliano's theorem gives the displacement and rotation of A, and so its compliance C, as
integrals along the wire (Timoshenko, Strength of Materials, part II, chapter on curved bars: thin
bars, whose curvature does not change their bending stiffness; shear neglected). The stiffness at A
is C^-1. B takes the opposite force, and the opposite moment about A. Deflections are small: the
stiffness is that of the unloaded shape, without tension.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.rotations import cross, cross_matrix

if TYPE_CHECKING:
    from jaxtyping import Float

NODES = 24
"""Gauss nodes on each smooth piece of a curved wire, exact to rounding for half a turn."""
PIECES = 8
"""Pieces of a catenary."""
DOWN = np.array([0.0, 0.0, -1.0])


@dataclass(frozen=True)
class Curve:
    """Nodes along the centre line of a wire, from A."""

    point: Float[np.ndarray, "node 3"]  # from A, m
    tangent: Float[np.ndarray, "node 3"]
    weight: Float[np.ndarray, " node"]  # Gauss weight times the length of the piece, m
    end: Float[np.ndarray, " 3"]  # B from A, m

    @property
    def length(self) -> float:
        """Length of the wire, m."""
        return float(self.weight.sum())


@dataclass(frozen=True)
class RoundWire:
    """Stiffness of a round wire: EA (N), EI, GJ (N m^2), and weight per length (N/m)."""

    stretching: float
    bending: float
    twisting: float
    weight: float

    @staticmethod
    def of(diameter: float, modulus: float, poisson: float, weight_density: float) -> RoundWire:
        """From diameter (m), Young's modulus (Pa), Poisson's ratio, weight per volume (N/m^3)."""
        area = np.pi * diameter**2 / 4
        second_moment = np.pi * diameter**4 / 64
        shear_modulus = modulus / (2 * (1 + poisson))
        return RoundWire(
            stretching=modulus * area,
            bending=modulus * second_moment,
            twisting=shear_modulus * 2 * second_moment,
            weight=weight_density * area,
        )


def u_shape(end: Float[np.ndarray, " 3"], length: float) -> Curve:
    """Curve of two vertical legs, down from A and up to B, joined by a half circle."""
    radius = np.hypot(end[0], end[1]) / 2
    across = np.array([end[0], end[1], 0.0]) / (2 * radius)
    first = (length - np.pi * radius - end[2]) / 2
    bottom = first * DOWN
    far_bottom = end + (first + end[2]) * DOWN
    s, w = _gauss()
    cosine = np.cos(np.pi * s)[:, None]
    sine = np.sin(np.pi * s)[:, None]
    points = bottom + radius * ((1 - cosine) * across + sine * DOWN)
    tangents = sine * across + cosine * DOWN
    half_circle = (points, tangents, w * np.pi * radius)
    first_leg = _straight(np.zeros(3), bottom)
    second_leg = _straight(far_bottom, end)
    return _joined([first_leg, half_circle, second_leg], end)


def catenary(end: Float[np.ndarray, " 3"], length: float) -> Curve:
    """Curve of a hanging chain of given length L (m) between A and B.

    z = a cosh((x - b) / a) + c with u = w / 2a from sinh(u) / u = sqrt(L^2 - h^2) / w, w and h
    being the width and the height of B from A (any text on the calculus of variations).
    """
    from scipy.optimize import brentq

    width = np.hypot(end[0], end[1])
    across = np.array([end[0], end[1], 0.0]) / width
    ratio = np.sqrt(length**2 - end[2] ** 2) / width
    u = brentq(lambda u: np.sinh(u) - ratio * u, 1e-9, 3 + 2 * np.log(ratio), xtol=1e-15)
    a = width / (2 * u)
    lowest = width / 2 - a * np.arctanh(end[2] / length)
    start = -lowest / a
    s, w = _gauss()
    pieces = []
    for piece in range(PIECES):
        slope = np.sinh(start) + length * (piece + s[:, None]) / PIECES / a
        root = np.sqrt(1 + slope**2)
        x = a * (np.arcsinh(slope) - start)
        z = a * (root - np.cosh(start))
        points = x * across - z * DOWN
        tangents = (across - slope * DOWN) / root
        pieces.append((points, tangents, w * length / PIECES))
    return _joined(pieces, end)


def polyline(points: Float[np.ndarray, "point 3"]) -> Curve:
    """Straight pieces through points (p, 3), the first at A and the last at B."""
    return _joined([_straight(*pair) for pair in pairwise(points)], points[-1])


def _straight(start: np.ndarray, end: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nodes, tangents and weights of a straight piece."""
    s, w = _gauss()
    span = end - start
    length = np.sqrt(span @ span)
    points = start + s[:, None] * span
    tangents = np.tile(span / length, (NODES, 1))
    return points, tangents, w * length


def _gauss() -> tuple[Float[np.ndarray, " node"], Float[np.ndarray, " node"]]:
    """Gauss-Legendre nodes and weights on 0 to 1."""
    x, w = np.polynomial.legendre.leggauss(NODES)
    return (1 + x) / 2, w / 2


def _joined(pieces: Sequence[Sequence[np.ndarray]], end: Float[np.ndarray, " 3"]) -> Curve:
    """Curve of pieces: points, tangents and weights of each."""
    point, tangent, weight = (np.concatenate(parts) for parts in zip(*pieces, strict=True))
    return Curve(point, tangent, weight, end)


def curve_compliance(curve: Curve, wire: RoundWire) -> Float[np.ndarray, "6 6"]:
    """Displacement and rotation of A per force and moment there, B clamped: (6, 6)."""
    unit = _unit_loads(curve)
    return _work(curve, wire, unit, unit)


def curve_stiffness(curve: Curve, wire: RoundWire) -> Float[np.ndarray, "6 6"]:
    """Force and moment on A per displacement and rotation, B clamped: (6, 6), symmetric."""
    matrix = np.linalg.inv(curve_compliance(curve, wire))
    return (matrix + matrix.T) / 2


def _unit_loads(curve: Curve) -> Float[np.ndarray, "2 node 3 6"]:
    """Internal force and moment at each node per force and moment at A."""
    result = np.zeros((2, len(curve.weight), 3, 6))
    result[0, :, :, :3] = np.eye(3)
    result[1, :, :, 3:] = np.eye(3)
    result[1, :, :, :3] = -cross_matrix(curve.point)
    return result


def _work(
    curve: Curve,
    wire: RoundWire,
    one: Float[np.ndarray, "2 node 3 load"],
    other: Float[np.ndarray, "2 node 3 more"],
) -> Float[np.ndarray, "load more"]:
    """Work of internal forces and moments on the strains of others, m and rad per unit of both."""
    along = curve.tangent[:, :, None] * curve.tangent[:, None, :]
    bent = along / wire.twisting + (np.eye(3) - along) / wire.bending
    flexibility = np.stack([along / wire.stretching, bent]) * curve.weight[:, None, None]
    return np.einsum("anik,anij,anjl->kl", one, flexibility, other, optimize=True)


def sag(curve: Curve, wire: RoundWire) -> tuple[float, Float[np.ndarray, " 6"]]:
    """Largest descent (m) of a wire, clamped at both ends, under its weight.

    By the unit load method. For small deflections: a descent that is not small beside the length
    shows only that the wire does not hang in its unloaded shape. Also returns force (N) and moment
    (N m) of the wire on A.
    """
    count = len(curve.weight)
    # a force of 1 N down at each node (the last axis) is carried by the part towards B
    carried = (np.tri(count, k=-1) + 0.5 * np.eye(count))[..., None]
    moment = cross(curve.point - curve.point[:, None], DOWN)
    single = np.moveaxis(np.stack([carried * DOWN, carried * moment]), -1, -2)
    dead_load = single @ (curve.weight * wire.weight)[:, None]
    unit = _unit_loads(curve)
    # the wrench at A that keeps A, too, from moving
    compliance = _work(curve, wire, unit, unit)
    free_motion = _work(curve, wire, unit, dead_load)[:, 0]
    wrench = np.linalg.solve(compliance, free_motion)
    loaded = dead_load - unit @ wrench[:, None]
    descent = _work(curve, wire, single, loaded)
    return float(descent.max()), wrench
