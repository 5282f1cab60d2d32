"""Stiffness and sag of curved wires that join two bodies: heat links and cables.

A wire is clamped at its end B and loaded at its end A by a force F and a moment M. Its
cross-section at r, with unit tangent t, carries the force F and the moment

    m = M + (r_A - r) x F.

With the strain energy per length (F . t)^2 / 2 EA + (m . t)^2 / 2 GJ + |m - (m . t) t|^2 / 2 EI,
Castigliano's theorem gives the displacement and rotation of A, and so its compliance C, as
integrals along the wire (Timoshenko, Strength of Materials, part II, chapter on curved bars: thin
bars, whose curvature does not change their bending stiffness; shear neglected). The stiffness at
A is C^-1. B takes the opposite force, and the opposite moment about A. Deflections are small: the
stiffness is that of the unloaded shape, without tension.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.rotations import cross, cross_matrix

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact

NODES = 24
"""Gauss nodes on each smooth piece, exact to rounding for half a turn."""
PIECES = 8
"""Pieces of a catenary."""
NEWTON = 60
"""Largest number of Newton steps for the parameter of a catenary."""


@dataclass(frozen=True)
class Curve:
    """Nodes along the centre line of a wire, from A.

    Attributes
    ----------
    point, tangent : (n, 3) arrays
        Places from A, m, and unit vectors.
    weight : (n,) array
        Gauss weight of each node times the length of its piece, m.
    end : (3,) array
        B from A, m.
    """

    point: Inexact[np.ndarray, "node 3"]
    tangent: Inexact[np.ndarray, "node 3"]
    weight: Inexact[np.ndarray, " node"]
    end: Inexact[np.ndarray, " 3"]

    @property
    def length(self) -> float:
        """Length of the wire, m."""
        return self.weight.sum()


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
        area, second = np.pi * diameter**2 / 4, np.pi * diameter**4 / 64
        twisting = modulus / (2 * (1 + poisson)) * 2 * second
        return RoundWire(modulus * area, modulus * second, twisting, weight_density * area)


def u_shape(end: Inexact[np.ndarray, " 3"], length: float) -> Curve:
    """Curve of two vertical legs, down from A and up to B, joined by a half circle."""
    width = np.sqrt(end[0] ** 2 + end[1] ** 2)
    across, down = np.array([end[0], end[1], 0.0 * width]) / width, np.array([0.0, 0.0, -1.0])
    radius = width / 2
    first = (length - np.pi * radius - end[2]) / 2
    s, w = _gauss()
    angle = np.pi * s
    rows = [
        (first * s[:, None] * down, 0 * s[:, None] + down, w * first),
        (
            first * down
            + radius * (1 - np.cos(angle))[:, None] * across
            + radius * np.sin(angle)[:, None] * down,
            np.sin(angle)[:, None] * across + np.cos(angle)[:, None] * down,
            w * np.pi * radius,
        ),
        (
            end + (first + end[2]) * (1 - s)[:, None] * down,
            0 * s[:, None] - down,
            w * (first + end[2]),
        ),
    ]
    return _joined(rows, end)


def catenary(end: Inexact[np.ndarray, " 3"], length: float) -> Curve:
    """Curve of a hanging chain of given length L (m) between A and B.

    z = a cosh((x - b) / a) + c with u = w / 2a from sinh(u) / u = sqrt(L^2 - h^2) / w, w and h
    being the width and the height of B from A (any text on the calculus of variations).
    """
    width = np.sqrt(end[0] ** 2 + end[1] ** 2)
    across = np.array([end[0], end[1], 0.0 * width]) / width
    ratio = np.sqrt(length**2 - end[2] ** 2) / width
    u = np.sqrt(6 * (ratio - 1)) if np.real(ratio) < 3 else np.log(2 * ratio) + 1
    for _ in range(NEWTON):
        step = (np.sinh(u) - ratio * u) / (np.cosh(u) - ratio)
        u = u - step
        if abs(step) <= 1e-15 * abs(u):
            break
    u = u - (np.sinh(u) - ratio * u) / (np.cosh(u) - ratio)  # the last digit
    a = width / (2 * u)
    lowest = width / 2 - a * np.arctanh(end[2] / length)
    start, begin = -lowest / a, a * np.sinh(-lowest / a)
    s, w = _gauss()
    rows = []
    for piece in range(PIECES):
        along = length * (piece + s) / PIECES
        slope = (begin + along) / a
        x = a * (np.arcsinh(slope) - start)
        root = np.sqrt(1 + slope**2)
        z = a * (root - np.cosh(start))
        rows.append(
            (
                x[:, None] * across + z[:, None] * np.array([0.0, 0.0, 1.0]),
                (across + slope[:, None] * np.array([0.0, 0.0, 1.0])) / root[:, None],
                w * length / PIECES,
            )
        )
    return _joined(rows, end)


def polyline(points: Inexact[np.ndarray, "point 3"]) -> Curve:
    """Straight pieces through points (p, 3), the first at A and the last at B."""
    s, w = _gauss()
    rows = []
    for one, other in itertools.pairwise(points):
        span = other - one
        length = np.sqrt((span**2).sum())
        rows.append((one + s[:, None] * span, 0 * s[:, None] + span / length, w * length))
    return _joined(rows, points[-1] - points[0])


def _gauss() -> tuple[Float[np.ndarray, " node"], Float[np.ndarray, " node"]]:
    """Gauss-Legendre nodes and weights on 0 to 1."""
    x, w = np.polynomial.legendre.leggauss(NODES)
    return (1 + x) / 2, w / 2


def _joined(rows: Sequence[Sequence[np.ndarray]], end: Inexact[np.ndarray, " 3"]) -> Curve:
    point, tangent, weight = (np.concatenate(parts) for parts in zip(*rows, strict=True))
    return Curve(point, tangent, weight, end)


def compliance(curve: Curve, wire: RoundWire) -> Inexact[np.ndarray, "6 6"]:
    """Displacement and rotation of A per force and moment there, B clamped: (6, 6)."""
    return _compliance_of(curve, wire, *_internal(curve))


def stiffness(curve: Curve, wire: RoundWire) -> Inexact[np.ndarray, "6 6"]:
    """Force and moment on A per displacement and rotation, B clamped: (6, 6), symmetric."""
    matrix = np.linalg.inv(compliance(curve, wire))
    return (matrix + matrix.T) / 2


def _internal(
    curve: Curve,
) -> tuple[Inexact[np.ndarray, "node 3 6"], Inexact[np.ndarray, "node 3 6"]]:
    """Internal force and moment (n, 3, 6) per force and moment at A."""
    kind = np.result_type(curve.point, float)
    force = np.zeros((len(curve.weight), 3, 6), dtype=kind)
    force[:, :, :3] = np.eye(3)
    moment = np.zeros_like(force)
    moment[:, :, :3], moment[:, :, 3:] = -cross_matrix(curve.point), np.eye(3)
    return force, moment


def _compliance_of(
    curve: Curve,
    wire: RoundWire,
    force: Inexact[np.ndarray, "node 3 load"],
    moment: Inexact[np.ndarray, "node 3 load"],
) -> Inexact[np.ndarray, "load load"]:
    t = curve.tangent
    along, turned = np.einsum("ni,nik->nk", t, force), np.einsum("ni,nik->nk", t, moment)
    across = moment - t[:, :, None] * turned[:, None, :]
    w = curve.weight
    return (
        np.einsum("n,nk,nl->kl", w / wire.stretching, along, along)
        + np.einsum("n,nk,nl->kl", w / wire.twisting, turned, turned)
        + np.einsum("n,nik,nil->kl", w / wire.bending, across, across)
    )


def sag(curve: Curve, wire: RoundWire) -> tuple[float, Float[np.ndarray, " 6"]]:
    """Largest descent (m) of a wire, clamped at both ends, under its weight.

    For small deflections: a descent that is not small beside the length shows only that the wire
    does not hang in its unloaded shape.

    Returns
    -------
    descent : float
        m.
    wrench : (6,) array
        Force (N) and moment (N m) of the wire on A.
    """
    count = len(curve.weight)
    point, weight = np.real(curve.point), np.real(curve.weight)
    real = Curve(point, np.real(curve.tangent), weight, np.real(curve.end))
    before = np.tri(count, k=-1) + 0.5 * np.eye(count)
    load = before * weight * np.real(wire.weight)  # weight of each node that hangs on A's side
    force = np.zeros((count, 3, 1))
    force[:, 2, 0] = -load.sum(1)
    arms = point[None, :, :] - point[:, None, :]
    down = np.array([0.0, 0.0, -1.0])
    moment = (load[..., None] * cross(arms, down)).sum(1)[..., None]
    both = [
        np.concatenate(parts, axis=2)
        for parts in zip(_internal(real), (force, moment), strict=True)
    ]
    whole = _compliance_of(real, wire, *both)
    reaction = -np.linalg.solve(np.real(whole[:6, :6]), np.real(whole[:6, 6]))
    force, moment = (part @ np.append(reaction, 1.0) for part in both)
    descent = 0.0
    for n in range(0, count, max(count // 48, 1)):
        # unit load test: a force of 1 N down at the node, carried by the part towards B
        unit_force = np.outer(before[:, n], down)
        unit_moment = before[:, n, None] * cross(point[n] - point, down)
        virtual = _compliance_of(
            real,
            wire,
            np.stack([unit_force, force], axis=2),
            np.stack([unit_moment, moment], axis=2),
        )
        descent = max(descent, float(np.real(virtual[0, 1])))
    return descent, -reaction
