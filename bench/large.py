"""Time of the modes of a tower of 33 bodies, 22 links against `numpy.linalg.eigh` on 198x198."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from suspension_cli.design.reader import parse
from suspension_cli.linear import damped
from suspension_cli.models import registry
from tests.support.large_tower import large_tower

LIMITS = {
    ("string", False): 250,
    ("beam", False): 600,
    ("string", True): 90,
    ("beam", True): 250,
}
"""Limits by model and symmetry."""


def modes(name: str, *, symmetric: bool) -> Callable[[], object]:
    """Build the work: the linear system, its undamped modes and its poles."""
    design, model = parse(large_tower(9, 6, 22, symmetric=symmetric)), registry.by_name(name)

    def work() -> object:
        system = model.system(design)
        return damped.solve(system)

    return work


def run(ratio: Callable[..., None]) -> None:
    """Time towers with and without symmetry, in models without and with bending wires."""
    matrix = np.random.default_rng(0).standard_normal((198, 198))
    for (name, symmetric), limit in LIMITS.items():
        ratio(
            f"modes of a {'symmetric ' * symmetric}tower of 33 bodies, {name} / eigh",
            modes(name, symmetric=symmetric),
            lambda: np.linalg.eigh(matrix + matrix.T),
            limit,
            3,
        )
