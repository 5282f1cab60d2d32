"""Result of a sweep of imperfections."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.sweep.solve import count_failures
from suspension_cli.analyses.xcouple.solve import Sweep
from suspension_cli.files.declared import ATTRIBUTE, AXES, Contents, in_unit, pack_fields
from suspension_cli.studies import builds
from suspension_cli.studies.axes import Axis

if TYPE_CHECKING:
    from jaxtyping import Complex, Float, Int


@dataclass(frozen=True)
class Coupling:
    """Cross-coupling over imperfections.

    Attributes
    ----------
    frequency
        Hz.
    ratio
        Motion `over` per motion `under`; NaN where a build failed.
    status
        See `builds.STATUS`.
    wire, hold
        Label of the imperfect wire, and what is kept when it changes.
    """

    axes: tuple[Axis, ...] = field(metadata=AXES)
    frequency: Float[np.ndarray, " frequency"] = field(metadata=in_unit("Hz"))
    ratio: Complex[np.ndarray, "*axes frequency"]
    status: Int[np.ndarray, "*axes"]
    wire: str
    hold: str
    input: str
    over: str
    under: str
    status_meaning: tuple[str, ...] = field(default=builds.STATUS, metadata=ATTRIBUTE)

    @property
    def failures(self) -> dict[str, int]:
        """Number of failed builds by reason."""
        return count_failures(self.status)


def describe(job: Sweep) -> Contents:
    """Return what a results file has besides the columns: axes, frequencies, wire and signals."""
    question = job.question
    return pack_fields(
        Coupling,
        {
            "axes": job.axes,
            "frequency": np.array(question.frequency),
            "wire": job.wire_label,
            "hold": question.hold,
            **{name: getattr(question, name).text for name in ("input", "over", "under")},
            "status_meaning": builds.STATUS,
        },
    )
