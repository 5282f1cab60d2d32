"""The group `xcouple` of a results file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from suspension_cli.analysis import builds
from suspension_cli.analysis.axes import Axis, scale_name
from suspension_cli.analysis.coupling import UNITS, Sweep
from suspension_cli.design.scene import Array
from suspension_cli.results import open_results, scale


@dataclass(frozen=True)
class Coupling:
    """A finished sweep.

    Attributes
    ----------
    axes : tuple of Axis
    frequency : (f,) array
        Hz.
    ratio : (axis 1, axis 2, ..., f) complex array
        NaN where a build failed.
    status : (axis 1, axis 2, ...) array
    wire, hold, input, over, under : str
    """

    axes: tuple[Axis, ...]
    frequency: Array
    ratio: Any
    status: Any
    wire: str
    hold: str
    input: str
    over: str
    under: str

    @property
    def failures(self) -> dict[str, int]:
        """How many builds failed, by reason."""
        return {reason: int((self.status == code).sum()) for code, reason in enumerate(builds.STATUS) if code != builds.GOOD and (self.status == code).any()}


def fill(group: h5py.Group, job: Sweep) -> None:
    """What stands beside the columns: axes, frequencies and the question.

    The columns have the axes that `axis_order` names, then that of frequency.
    """
    for axis in job.axes:
        scale(group, scale_name(axis.name), np.array(axis.values), UNITS.get(axis.name, "SI"))
    scale(group, "frequency", np.array(job.question.frequency), "Hz")
    group.attrs["axis_order"] = [axis.name for axis in job.axes]
    group.attrs["status_meaning"] = list(builds.STATUS)
    group.attrs["wire"] = job.wire_label
    group.attrs["hold"] = job.question.hold
    for name in ("input", "over", "under"):
        group.attrs[name] = getattr(job.question, name).text


def load(path: Path | str) -> Coupling:
    """A finished sweep from its file."""
    with open_results(path) as file:
        return read(file["xcouple"])


def read(group: Any) -> Coupling:
    """A finished sweep from its group."""
    names = [str(name) for name in group.attrs["axis_order"]]
    axes = tuple(Axis(name, tuple(group[scale_name(name)][:].tolist())) for name in names)
    return Coupling(
        axes=axes,
        frequency=group["frequency"][:],
        ratio=group["ratio"][:],
        status=group["status"][:],
        **{name: str(group.attrs[name]) for name in ("wire", "hold", "input", "over", "under")},
    )
