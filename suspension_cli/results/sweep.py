"""The group `sweep` of a results file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from suspension_cli.analysis import builds, following, signals
from suspension_cli.analysis.axes import Axis, scale_name
from suspension_cli.analysis.response import solve
from suspension_cli.analysis.scalars import Mode, Ratio, Scalar, labels
from suspension_cli.analysis.sweep import STATUS, ParameterSweep, scalar
from suspension_cli.design.scene import Array
from suspension_cli.mechanics.model import LinearModel
from suspension_cli.results import dataset, open_results, scale

AT_ONCE = 1 << 28
"""Bytes of shapes that are read at once; of more, one point after the other."""


@dataclass(frozen=True)
class Swept:
    """A finished sweep.

    Attributes
    ----------
    axes : tuple of Axis
        Named by dotted paths.
    drawn : tuple of float
        Value of each parameter in the design as drawn; NaN where it gives none.
    start : tuple of int
        The grid point next to it.
    result, unit : tuple of str
        What was asked for; ``Hz`` for modes.
    degree : tuple of str
        Where each mode lives in the design as drawn, ``test.pitch``; empty for responses.
    nominal : (r,) array
        Of the design as drawn.
    value : (axis 1, axis 2, ..., r) array
        NaN where there is none.
    status : (axis 1, axis 2, ...) array
    overlap : float
        The least with which a mode among the results was followed from one point to the next; 1 if none was.
    """

    axes: tuple[Axis, ...]
    drawn: tuple[float, ...]
    start: tuple[int, ...]
    result: tuple[str, ...]
    unit: tuple[str, ...]
    degree: tuple[str, ...]
    nominal: Array
    value: Array
    status: Any
    overlap: float

    @property
    def failures(self) -> dict[str, int]:
        """How many points failed, by reason."""
        return {reason: int((self.status == code).sum()) for code, reason in enumerate(STATUS) if code != builds.GOOD and (self.status == code).any()}

    @property
    def change(self) -> Array:
        """By how many times its smallest value each result rises to its largest, less 1, (r,); 0 where it has none."""
        flat = self.value.reshape(-1, len(self.result))
        low, high = np.fmin.reduce(flat, axis=0), np.fmax.reduce(flat, axis=0)
        return np.where(np.isfinite(low), (high - low) / np.where(low > 0, low, 1.0), 0.0)


def drawn(job: ParameterSweep) -> tuple[float, ...]:
    """Value of each swept parameter in the design as drawn; NaN where the file does not give it."""
    import tomllib

    from suspension_cli.design.reader import value_at

    raw = tomllib.loads(job.text)
    given = [value_at(raw, axis.name) for axis in job.axes]
    return tuple(float(value) if isinstance(value, (int, float)) and not isinstance(value, bool) else np.nan for value in given)


def start(job: ParameterSweep) -> tuple[int, ...]:
    """The grid point that is nearest to the design as drawn; the first where that says nothing."""
    return tuple(0 if np.isnan(at) else int(np.abs(np.array(axis.values) - at).argmin()) for axis, at in zip(job.axes, drawn(job), strict=True))


def fill(group: h5py.Group, job: ParameterSweep, model: LinearModel) -> None:
    """What stands beside the columns: axes, names and the design as drawn."""
    for axis in job.axes:
        scale(group, scale_name(axis.name), np.array(axis.values), "SI, or its own")
    result = scale(group, "result", [item.text for item in job.results], "name")
    dataset(group, "result_unit", [item.unit for item in job.results], "name", result)
    dataset(group, "result_home", [_home(job, item) for item in job.results], "name", result)
    dataset(group, "nominal", nominal(job, model), "SI, see result_unit; Hz for modes", result)
    if job.ratios:
        scale(group, "response_name", [item.text for item in job.ratios], "name")
    if len(job.ratios) < len(job.results):
        scale(group, "mode", labels(job.nominal), "name")
        scale(group, "mode_number", np.arange(1, len(job.nominal.omega_squared) + 1), "1")
        scale(group, "coordinate", list(job.nominal.coordinate), "name")
    group.attrs["axis_order"] = [axis.name for axis in job.axes]
    group.attrs["drawn"] = drawn(job)
    group.attrs["start"] = start(job)
    group.attrs["status_meaning"] = list(STATUS)


def _home(job: ParameterSweep, item: Scalar) -> str:
    return ".".join(job.nominal.home[item.number]) if isinstance(item, Mode) else ""


def nominal(job: ParameterSweep, model: LinearModel) -> Array:
    """The results of the design as drawn."""
    found = []
    for item in job.results:
        if isinstance(item, Mode):
            found.append(job.nominal.frequency[item.number])
        else:
            found.append(_size(model, item))
    return np.array(found)


def _size(model: LinearModel, item: Ratio) -> float:
    outputs = [signals.motion(signal.text, signals.bodies(model)) for signal in (item.over, item.under) if signal is not None]
    value = solve(model, np.array([item.frequency]), [item.input], outputs).value[0, :, 0]
    with np.errstate(all="ignore"):
        return float(np.abs(value[0] if len(value) == 1 else value[0] / value[1]))


def complete(part: Path, job: ParameterSweep) -> None:
    """Follow the modes over a file whose points are all there, and put the results in place."""
    with h5py.File(part, "r+") as file:
        group: Any = file["sweep"]
        squared = rank = None
        if "shape" in group:
            status, stored = group["status"][:], group["shape"]
            well = (status == builds.GOOD) | (status == builds.UNSTABLE)
            shapes = stored[:] if stored.size * 4 <= AT_ONCE else stored
            squared = group["omega_squared"][:]
            rank, overlap = following.follow(squared, shapes, well, start(job), job.nominal_shape)
            group["rank"][...], group["overlap"][...] = rank, overlap
        group["value"][...] = scalar(job.results, squared, rank, group["response"][:] if "response" in group else None)


def load(path: Path | str) -> Swept:
    """A finished sweep from its file."""
    with open_results(path) as file:
        return read(file["sweep"])


def read(group: Any) -> Swept:
    """A finished sweep from its group."""
    names = [str(name) for name in group.attrs["axis_order"]]
    result = tuple(group["result"].asstr()[:])
    overlap = 1.0
    if "overlap" in group:
        asked = [n for n, name in enumerate(group["mode"].asstr()[:]) if name in result]
        overlap = float(np.fmin.reduce(group["overlap"][:][..., asked], axis=None))
    return Swept(
        axes=tuple(Axis(name, tuple(group[scale_name(name)][:].tolist())) for name in names),
        drawn=tuple(float(value) for value in group.attrs["drawn"]),
        start=tuple(int(value) for value in group.attrs["start"]),
        result=result,
        unit=tuple(group["result_unit"].asstr()[:]),
        degree=tuple(group["result_home"].asstr()[:]),
        nominal=group["nominal"][:],
        value=group["value"][:],
        status=group["status"][:],
        overlap=1.0 if np.isnan(overlap) else overlap,
    )
