"""Modes of the design as drawn, followed from point to point of a sweep by their shapes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.analyses.sweep.parameter_sweep import ParameterSweep
from suspension_cli.linear import mode_content, mode_pairing
from suspension_cli.quantities.kinds.modes import FollowedMode
from suspension_cli.studies import builds
from suspension_cli.studies.run import Columns

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int


def has_modes(status: Int[np.ndarray, "*build"]) -> Bool[np.ndarray, "*build"]:
    """Whether builds have an equilibrium on taut wires, stable or not, from their status."""
    return (status == builds.GOOD) | (status == builds.UNSTABLE)


def nearest_point(job: ParameterSweep) -> tuple[int, ...]:
    """Find the grid point nearest to the nominal design; 0 along axes without a nominal value."""
    return tuple(
        0 if np.isnan(at) else int(np.abs(np.array(axis.values) - at).argmin())
        for axis, at in zip(job.axes, job.drawn, strict=True)
    )


class Follower:
    """Follows the modes of a finished sweep once, though its model and its file need them."""

    def __init__(self) -> None:
        self._columns: Columns | None = None
        self._found: tuple[np.ndarray, np.ndarray] | None = None

    def __call__(
        self, job: ParameterSweep, columns: Columns
    ) -> tuple[Int[np.ndarray, "*grid mode"], Float[np.ndarray, "*grid mode"]]:
        """Follow the modes over the grid from the nominal design, see `mode_pairing.follow`."""
        if self._found is None or self._columns is not columns:
            known = job.on_grid(columns)
            self._found = mode_pairing.follow(
                known["omega_squared"],
                known["shape"],
                has_modes(known["status"]),
                nearest_point(job),
                job.nominal_shape,
            )
            self._columns = columns
        return self._found


def complete(
    job: ParameterSweep, known: dict[str, Any], rank: Int[np.ndarray, "*grid mode"] | None
) -> Float[np.ndarray, "*grid result"]:
    """Values of all results; those of followed modes by the places of these at each point."""
    value = known["value"].copy()
    for n, one in enumerate(job.results):
        if isinstance(one, FollowedMode):
            assert rank is not None
            place = rank[..., one.place].astype(np.intp)
            value[..., n] = mode_content.frequencies(known["omega_squared"], place)
    return value
