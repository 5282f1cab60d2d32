"""Derivatives of modes whose stiffness depends on frequency.

A mode is (K(lambda) - lambda M) v = 0 with lambda = omega^2. If a number of the design changes,

    (K - lambda M) dv - T v dlambda = -(dK - lambda dM) v,      T = M - dK/dlambda,

with v T dv = 0, as the size of v is arbitrary (Nelson, AIAA Journal 14, 1201 (1976), for constant
K). This is solved in the mode's block, as modes of one symmetry do not share a frequency. The
fraction of kinetic energy in the top mass is

    s = (v D v / v E v) (v M v / v T v)

with the blocks D and E of M of the top mass and of all bodies; v T v is the energy of bodies and
wires.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.linear.system import LinearSystem
from suspension_cli.scene.arrays import Array
from suspension_cli.studies import differences
from suspension_cli.studies.derivatives import Linear

if TYPE_CHECKING:
    from jaxtyping import Float

APART = 0.01
"""Relative step of omega^2 between the frequencies around a mode at which K is evaluated."""
NODES = APART * np.array([-2, -1, 1, 2])
"""Relative distances of omega^2 of these frequencies from that of the mode."""


def frequencies_around(squared: float) -> Float[np.ndarray, " 4"]:
    """Frequencies, rad/s, at which `Stiffness.of` needs matrices; 0 for an unstable mode."""
    return np.sqrt(np.maximum(squared * (1 + NODES), 0.0))


@dataclass(frozen=True)
class Stiffness:
    """Stiffness at a mode, and its first two derivatives by omega^2."""

    value: Array
    first: Array | float = 0.0
    second: Array | float = 0.0

    @staticmethod
    def of(linear: Linear, squared: float, start: int) -> Stiffness:
        """Interpolate matrices at `frequencies_around` a mode, numbered from `start`."""
        low, near, after, high = (
            differences.at(linear, start + n).stiffness[6:, 6:] for n in range(4)
        )
        if squared <= 0:
            return Stiffness(near)
        step, one, two = APART * squared, near + after, low + high
        return Stiffness(
            (4 * one - two) / 6,
            (8 * (after - near) - (high - low)) / (12 * step),
            (two - one) / (3 * step**2),
        )


@dataclass(frozen=True)
class ModeDerivatives:
    """Derivatives of one mode by the free numbers.

    `squared` are those of omega^2, `fraction` those of ln of the energy fraction in the top mass.
    """

    squared: Float[np.ndarray, " number"]
    fraction: Float[np.ndarray, " number"]


def differentiate(
    model: LinearSystem,
    block: int,
    top: int,
    shape: Float[np.ndarray, " coordinate"],
    squared: float,
    here: tuple[Stiffness, Array],
    changes: list[tuple[Stiffness, Array]],
) -> ModeDerivatives:
    """Differentiate a mode of a model.

    Parameters
    ----------
    model : LinearSystem
    block : int
        Number of the mode's block.
    top : int
        Number of its top mass.
    shape : array
        In the named coordinates.
    squared : float
        omega^2, (rad/s)^2.
    here : (Stiffness, array)
        Stiffness and mass, without the coordinates of the support.
    changes : list of (Stiffness, array)
        Their derivatives by each number.
    """
    stiffness, mass = here
    inertia = mass - stiffness.first
    own = model.basis[6:, model.blocks[block]]
    pushed = np.stack([(dk.value - squared * dm) @ shape for dk, dm in changes], axis=1)
    edge = -(own.T @ inertia @ shape)[:, None]
    matrix = np.block(
        [[own.T @ (stiffness.value - squared * mass) @ own, edge], [edge.T, np.zeros((1, 1))]]
    )
    scale = np.sqrt(np.append(np.diag(own.T @ (np.abs(stiffness.value) + mass) @ own), 1.0))
    scale[-1] = np.abs(edge[:, 0] / scale[:-1]).max()
    right = np.vstack([-own.T @ pushed, np.zeros((1, len(changes)))])
    solution = np.linalg.lstsq(matrix / np.outer(scale, scale), right / scale[:, None], rcond=1e-14)
    solved = solution[0] / scale[:, None]
    moved, rates = own @ solved[:-1], solved[-1]
    dm = [change for _, change in changes]
    dt = [
        change - dk.first - stiffness.second * rate
        for (dk, change), rate in zip(changes, rates, strict=True)
    ]

    def logarithm_rates(of: Array, changed: list[Array]) -> Array:
        """Derivatives of ln(v A v)."""
        products = [
            2 * move @ of @ shape + shape @ change @ shape
            for move, change in zip(moved.T, changed, strict=True)
        ]
        return np.array(products) / (shape @ of @ shape)

    def of_blocks(bodies: range) -> Array:
        own = _blocks(mass.shape, bodies)
        return logarithm_rates(own * mass, [own * one for one in dm])

    bodies = len(model.body)
    with np.errstate(invalid="ignore", divide="ignore"):
        fraction = of_blocks(range(top, top + 1)) - of_blocks(range(bodies))
        fraction += logarithm_rates(mass, dm) - logarithm_rates(inertia, dt)
    return ModeDerivatives(rates, fraction)


def _blocks(shape: tuple[int, ...], bodies: range) -> Float[np.ndarray, "coordinate coordinate"]:
    """Ones in the blocks of some bodies of a mass matrix; of several also on its diagonal."""
    body = np.arange(shape[0]) // 6
    result = (body[:, None] == body) & np.isin(body, bodies)
    return (result | (len(bodies) > 1) & np.eye(*shape, dtype=bool)).astype(float)
