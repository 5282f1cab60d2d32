"""Designs and reference results in 50 digits and more, which share no code with the program.

They are those of the tests: the energy of a stage in 60 digits
(`tests/support/imperfect_stage_mp.py`), the solution of given matrices in 50
(`tests/support/responses_mp.py`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from suspension_cli.design import reader
from suspension_cli.design.schema import Design
from tests.support import imperfect_stage_mp, responses_mp, soft_blades_mp

MP = imperfect_stage_mp.MP
MASS = 5.6
INERTIA = (0.0227, 0.016, 0.016)
"""kg and kg m^2: a mirror as large as that of Figure 6 of Husman et al. (2000)."""
SHAPE = {"l": 0.28, "s": 0.005, "t1": 0.0965, "t2": 0.0965, "d": 0.001, "k": 1.227e4}
"""Wires of this mirror, m and N/m."""

compare = responses_mp.compare
column = soft_blades_mp.column


def document(
    mass: float = MASS, inertia: Sequence[float] = INERTIA, **shape: float
) -> dict[str, Any]:
    """One stage on four wires as parsed TOML; `shape` replaces values of `SHAPE`."""
    body = {"mass": float(mass), "inertia": [float(moment) for moment in inertia]}
    wires = {"count": 4, **{name: float(value) for name, value in (SHAPE | shape).items()}}
    return {
        "design": {"name": "one-stage"},
        "stage": [{"name": "test", "body": body, "wires": wires}],
    }


def design(raw: dict[str, Any]) -> Design:
    """Convert parsed TOML to a checked design."""
    return reader.convert(raw)


def stage(
    mass: float = MASS,
    inertia: Sequence[float] = INERTIA,
    shape: dict[str, float] | None = None,
    **imperfection: Any,
) -> imperfect_stage_mp.Stage:
    """Build the stage of `document` from its energy, in 60 digits."""
    return imperfect_stage_mp.Stage(mass, inertia, SHAPE | (shape or {}), **imperfection)


def omega_squared(one: imperfect_stage_mp.Stage) -> list[Any]:
    """All omega^2 of a stage in its current pose, ascending, in 60 digits.

    Its inertia must be diagonal and not rotated.
    """
    root = [MP.sqrt(one.mass)] * 3 + [MP.sqrt(one.inertia[i, i]) for i in range(3)]
    stiffness = one.stiffness()
    scaled = MP.matrix(6, 6)
    for i in range(6):
        for j in range(6):
            scaled[i, j] = (stiffness[i, j] + stiffness[j, i]) / (2 * root[i] * root[j])
    return sorted(MP.eigsy(scaled, eigvals_only=True))
