"""The group `xcouple` of a results file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import h5py
import numpy as np

from suspension_cli.analyses.sweep.solve import count_failures
from suspension_cli.analyses.xcouple.solve import UNITS, Sweep
from suspension_cli.files.hdf5 import Stored, add_scale
from suspension_cli.studies import builds
from suspension_cli.studies.axes import Axis, scale_name

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

    axes: tuple[Axis, ...]
    frequency: Float[np.ndarray, " frequency"]
    ratio: Complex[np.ndarray, "*axes frequency"]
    status: Int[np.ndarray, "*axes"]
    wire: str
    hold: str
    input: str
    over: str
    under: str

    @property
    def failures(self) -> dict[str, int]:
        """Number of failed builds by reason."""
        return count_failures(self.status)


def fill(group: h5py.Group, job: Sweep) -> None:
    """Write everything but the columns: axes, frequencies, wire and signals.

    The columns have the axes in `axis_order`, then frequency.
    """
    for axis in job.axes:
        add_scale(group, scale_name(axis.name), np.array(axis.values), UNITS.get(axis.name, "SI"))
    add_scale(group, "frequency", np.array(job.question.frequency), "Hz")
    group.attrs["axis_order"] = [axis.name for axis in job.axes]
    group.attrs["status_meaning"] = list(builds.STATUS)
    group.attrs["wire"] = job.wire_label
    group.attrs["hold"] = job.question.hold
    for name in ("input", "over", "under"):
        group.attrs[name] = getattr(job.question, name).text


def load(group: Stored) -> Coupling:
    """Read a finished sweep from the group `xcouple`."""
    names = [str(name) for name in group.attrs["axis_order"]]
    axes = tuple(Axis(name, tuple(group[scale_name(name)][:].tolist())) for name in names)
    return Coupling(
        axes=axes,
        frequency=group["frequency"][:],
        ratio=group["ratio"][:],
        status=group["status"][:],
        **{name: str(group.attrs[name]) for name in ("wire", "hold", "input", "over", "under")},
    )
