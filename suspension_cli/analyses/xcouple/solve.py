"""Cross-coupling of imperfect builds, and the matrix of couplings of one design: the records."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from suspension_cli.analyses.record import Record
from suspension_cli.analyses.xcouple.imperfect_builds import ImperfectBuilds
from suspension_cli.files import stored
from suspension_cli.files.declared import ATTRIBUTE, AXES, in_unit
from suspension_cli.files.documents import Layout
from suspension_cli.linear import response
from suspension_cli.quantities.kinds.responses import quotient_unit
from suspension_cli.studies import builds
from suspension_cli.studies.job import Axis
from suspension_cli.studies.run import Columns

if TYPE_CHECKING:
    import h5py
    from jaxtyping import Complex, Float, Int

    from suspension_cli.analyses.record import Origin


@dataclass(frozen=True, eq=False, repr=False)
class Coupling(Record):
    """Cross-coupling over imperfections.

    Attributes
    ----------
    frequency
        Hz.
    ratio
        Motion `over` per motion `under`; NaN where a build failed.
    status
        See `status_meaning`.
    wire, hold
        Label of the imperfect wire, and what is kept when it changes.
    over_input, under_input
        Both motions per `input`.
    residual, slack_wire
        As in `studies.builds.Builds`; the residual is NaN in interpolated maps.
    interpolation
        At how many points a map was computed, and how well it was checked; None if every point was
        solved.
    """

    in_json: ClassVar = Layout(
        without="status status_meaning over_input under_input residual slack_wire",
        also="failures",
        sparse="interpolation",
    )
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
    over_input: Complex[np.ndarray, "*axes frequency"] | None = field(
        default=None, metadata=in_unit("", name="over")
    )
    under_input: Complex[np.ndarray, "*axes frequency"] | None = field(
        default=None, metadata=in_unit("", name="under")
    )
    residual: Float[np.ndarray, "*axes"] | None = None
    interpolation: str | None = field(default=None, metadata=ATTRIBUTE)
    slack_wire: Int[np.ndarray, "*axes"] | None = None

    @property
    def failures(self) -> dict[str, int]:
        """Number of failed builds by reason."""
        return builds.count_failures(self.status)

    @property
    def worst(self) -> tuple[int, ...]:
        """Place of the largest ratio; empty if no build has one."""
        size = np.abs(self.ratio)
        if not np.isfinite(size).any():
            return ()
        return tuple(int(n) for n in np.unravel_index(np.nanargmax(size), size.shape))


@dataclass(frozen=True, eq=False, repr=False)
class CouplingMatrix(Record, response.Response):
    """Couplings of every motion of the support to every motion of one body.

    Attributes
    ----------
    frequency
        Hz.
    input, output
        Motions of the support, and of the body.
    unit
        Unit of each output over each input, [output][input].
    value
        Complex, SI.
    """

    in_json: ClassVar = Layout(names={"value": "matrix"}, without="closed_loop largest")


def write(group: h5py.Group, columns: Columns, job: ImperfectBuilds, run: Origin) -> Coupling:
    """Write the couplings of all builds of a job, and return the record."""
    ask = job.question
    wires = job.scene.wires
    known = job.on_grid(columns)
    motions = {f"{name}_input": known.pop(name) for name in ("over", "under")}
    record = Coupling(
        axes=job.axes,
        frequency=np.array(ask.frequency),
        wire=wires.label[ask.wire] if ask.wire >= 0 else "",
        hold=ask.hold,
        input=ask.input.text,
        over=ask.over.text,
        under=ask.under.text,
        **motions,
        **known,
        run=run,
    )
    stored.write(group, record)
    pairs = {"ratio": (ask.over, ask.under)}
    pairs |= {"over": (ask.over, ask.input), "under": (ask.under, ask.input)}
    for name, (over, under) in pairs.items():
        group[name].attrs["units"] = quotient_unit(over, under)
    return record
