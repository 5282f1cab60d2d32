"""Quantities of a design over grids of any of its parameters: the record, and how it is written.

job = ParameterSweep(source.text, axes, "beam", results)
found = write(Follower(), group, job.compute(0, job.count), job, run)
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from suspension_cli.analyses.record import Record
from suspension_cli.analyses.sweep.followed_modes import Follower, complete, nearest_point
from suspension_cli.analyses.sweep.parameter_sweep import STATUS, ParameterSweep
from suspension_cli.files import stored
from suspension_cli.files.declared import ATTRIBUTE, AXES, along, dim_name, in_unit
from suspension_cli.files.documents import Layout
from suspension_cli.files.hdf5 import Stored, add_dataset
from suspension_cli.linear import mode_content
from suspension_cli.linear.mode_content import Content
from suspension_cli.quantities.kinds.modes import FollowedMode, Frequency
from suspension_cli.quantities.quantity import Quantity
from suspension_cli.studies import builds
from suspension_cli.studies.job import Axis
from suspension_cli.studies.run import Columns

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Int

    from suspension_cli.analyses.record import Origin


@dataclass(frozen=True, eq=False, repr=False)
class Sweep(Record):
    """A finished sweep.

    Attributes
    ----------
    axes
        Parameters, named by dotted paths, with their values in SI.
    drawn
        Nominal value of each parameter; NaN where the design does not give it.
    start
        Grid point nearest to the nominal design.
    result, unit
        Names and units of the results; ``Hz`` for modes.
    degree
        Dominant motion of each mode in the nominal design, ``test.pitch``; empty for other results.
    nominal
        Results of the nominal design.
    value
        Results; NaN where there is none.
    status
        See `status_meaning`.
    overlap
        Smallest overlap of shapes by which a mode among the results was followed from one point to
        the next; 1 without modes.
    missing
        Why a point that hangs may have no value of each result.
    mode, mode_number, coordinate
        Labels of the nominal modes, numbers of the modes of each point, and coordinates of shapes;
        None without modes.
    response_name, response_unit, response
        Responses and couplings among the results; None without these.
    omega_squared, shape
        Modes of each point in ascending order, with shapes as in `batch_modes.Spectrum`.
    rank
        Place of each nominal mode among those of a point.
    labelled
        Results that are modes asked for by their labels; None without these. At each point a label
        means the mode that is mostly this motion, see `linear.mode_content`.
    label_mode, other_mode
        Places of that mode among those of a point, and of the one with most of the motion beside
        it; -1 where there is none.
    label_fraction, other_fraction
        Fractions of the kinetic energy of these two modes in the motion.
    required, required_quantity, required_unit
        Requirements that are judged at each point, in words, and the names and units of their
        quantities; None without any.
    at_least, at_most, of_magnitude
        Their limits, infinite where there is none, and whether these are limits of the magnitude.
    interpolation
        At how many points a map was computed, and how well it was checked; None if every point was
        solved.
    margin, met
        Distance of each point from the nearer limit (`requirements.Requirement.margin`), and
        whether it meets it; points without a value do not.
    """

    in_json: ClassVar = Layout(
        rows={"result": "results", "required": "requirements"},
        names={
            "result": "name",
            "value": "values",
            "required": "requirement",
            "required_quantity": "quantity",
            "required_unit": "unit",
        },
        without=(
            "drawn start degree status status_meaning overlap mode mode_number coordinate"
            " response_name response_unit response omega_squared shape rank labelled label_mode"
            " other_mode label_fraction other_fraction"
        ),
        also="failures",
        sparse="interpolation",
    )
    axes: tuple[Axis, ...] = field(metadata=AXES)
    drawn: tuple[float, ...]
    start: tuple[int, ...]
    result: tuple[str, ...]
    unit: tuple[str, ...] = field(metadata=along("result"))
    degree: tuple[str, ...] = field(metadata=along("result"))
    nominal: Float[np.ndarray, " result"] = field(metadata=in_unit("{unit}"))
    value: Float[np.ndarray, "*axes result"] = field(metadata=in_unit("{unit}"))
    status: Int[np.ndarray, "*axes"]
    overlap: float
    mode: tuple[str, ...] | None = None
    mode_number: Int[np.ndarray, " mode_number"] | None = None
    coordinate: tuple[str, ...] | None = None
    response_name: tuple[str, ...] | None = None
    response_unit: tuple[str, ...] | None = field(default=None, metadata=along("response_name"))
    status_meaning: tuple[str, ...] = field(default=STATUS, metadata=ATTRIBUTE)
    omega_squared: Float[np.ndarray, "*axes mode_number"] | None = field(
        default=None, metadata=in_unit("rad^2/s^2")
    )
    shape: Float[np.ndarray, "*axes mode_number coordinate"] | None = None
    rank: Int[np.ndarray, "*axes mode"] | None = None
    response: Complex[np.ndarray, "*axes response_name"] | None = field(
        default=None, metadata=in_unit("{response_unit}")
    )
    labelled: tuple[str, ...] | None = None
    label_mode: Int[np.ndarray, "*axes labelled"] | None = None
    other_mode: Int[np.ndarray, "*axes labelled"] | None = None
    label_fraction: Float[np.ndarray, "*axes labelled"] | None = None
    other_fraction: Float[np.ndarray, "*axes labelled"] | None = None
    missing: tuple[str, ...] | None = field(default=None, metadata=along("result"))
    required: tuple[str, ...] | None = None
    required_quantity: tuple[str, ...] | None = field(default=None, metadata=along("required"))
    required_unit: tuple[str, ...] | None = field(default=None, metadata=along("required"))
    at_least: Float[np.ndarray, " required"] | None = field(
        default=None, metadata=in_unit("{required_unit}")
    )
    at_most: Float[np.ndarray, " required"] | None = field(
        default=None, metadata=in_unit("{required_unit}")
    )
    of_magnitude: Bool[np.ndarray, " required"] | None = None
    margin: Float[np.ndarray, "*axes required"] | None = None
    interpolation: str | None = field(default=None, metadata=ATTRIBUTE)
    met: Bool[np.ndarray, "*axes required"] | None = None

    def content(self, name: str) -> Content | None:
        """Modes that a label means at the points; None for another result."""
        if self.labelled is None or name not in self.labelled:
            return None
        columns = self.label_mode, self.other_mode, self.label_fraction, self.other_fraction
        place = self.labelled.index(name)
        return Content(*(column[..., place] for column in columns if column is not None))

    @property
    def failures(self) -> dict[str, int]:
        """Number of failed points by reason."""
        return builds.count_failures(self.status, STATUS)

    @property
    def change(self) -> Float[np.ndarray, " result"]:
        """Relative change of each result over the grid, largest over smallest less 1.

        0 where a result has no value; the largest value where the smallest is 0. The change of a
        result that may be negative is relative to its largest magnitude.
        """
        flat = self.value.reshape(-1, len(self.result))
        flat = np.where(np.isfinite(flat), flat, np.nan)
        low = np.fmin.reduce(flat, axis=0)
        high = np.fmax.reduce(flat, axis=0)
        size = np.where(low > 0, low, 1.0)
        size = np.where(low < 0, np.fmax(np.abs(low), np.abs(high)), size)
        return np.where(np.isfinite(low), (high - low) / size, 0.0)

    @property
    def all_met(self) -> Bool[np.ndarray, "*axes"] | None:
        """Whether each point meets all requirements; None without any."""
        return None if self.met is None else np.asarray(self.met.all(-1))

    @property
    def worst_margin(self) -> Float[np.ndarray, "*axes"] | None:
        """Smallest margin at each point; NaN where one is unknown, None without requirements."""
        return None if self.margin is None else np.asarray(self.margin.min(-1))


def write(
    follow: Follower, group: Stored, columns: Columns, job: ParameterSweep, run: Origin
) -> Sweep:
    """Follow the modes over the grid, complete the results, and write them; return the record."""
    known = job.on_grid(columns)
    described: dict[str, Any] = {}
    rank = None
    overlap = None
    least = 1.0
    if job.has_modes:
        rank, overlap = follow(job, columns)
        if job.followed:
            tracked = overlap[..., [one.place for one in job.followed]]
            found = float(np.fmin.reduce(tracked, axis=None, initial=np.nan))
            least = 1.0 if np.isnan(found) else found
        described["mode"] = tuple(job.nominal.label)
        described["mode_number"] = np.arange(1, len(job.nominal.omega_squared) + 1)
        described["coordinate"] = job.nominal.coordinate
    if job.ratios:
        described["response_name"] = tuple(one.text for one in job.ratios)
        described["response_unit"] = tuple(one.unit for one in job.ratios)
    if job.labelled:
        described["labelled"] = tuple(one.text for one in job.labelled)
    if job.requirements:
        described |= _judge(job, known.pop("limited"))
    value = complete(job, known, rank)
    del known["value"]
    record = Sweep(
        axes=job.axes,
        drawn=job.drawn,
        start=nearest_point(job),
        result=tuple(one.text for one in job.results),
        unit=tuple(one.unit for one in job.results),
        degree=tuple(_degree(job, one) for one in job.results),
        nominal=nominal_results(job),
        value=value,
        overlap=least,
        missing=tuple(one.missing for one in job.results),
        rank=rank,
        **described,
        **known,
        run=run,
    )
    stored.write(group, record)
    if overlap is not None:
        scales = [group[dim_name(axis.name)] for axis in job.axes]
        add_dataset(group, "overlap", overlap, "1", *scales, group["mode"])
    return record


def nominal_results(job: ParameterSweep) -> Float[np.ndarray, " result"]:
    """Evaluate the results of the nominal design.

    Without a steady state, only those that do not need one have values, unless the job allows it.
    """
    found = job.compute_designs([job.design], 1)["value"][0]
    for n, one in enumerate(job.results):
        if isinstance(one, FollowedMode):
            found[n] = job.nominal.frequency[one.place]
    return found


def _degree(job: ParameterSweep, quantity: Quantity) -> str:
    """Dominant motion of a mode in the nominal design; "" for other quantities."""
    number = -1
    if isinstance(quantity, FollowedMode):
        number = quantity.place
    elif isinstance(quantity, Frequency):
        number = int(mode_content.find(job.nominal.fractions, quantity.motion).mode)
    return "" if number < 0 else ".".join(job.nominal.home[number])


def _judge(job: ParameterSweep, limited: Float[np.ndarray, "*grid required"]) -> dict[str, Any]:
    """Judge the requirements at each point, from the values of their quantities."""
    pairs = [(one, limited[..., n]) for n, one in enumerate(job.requirements)]
    return {
        "required": tuple(one.description for one in job.requirements),
        "required_quantity": tuple(one.quantity.text for one in job.requirements),
        "required_unit": tuple(one.quantity.unit for one in job.requirements),
        "at_least": np.array([one.limits.low for one in job.requirements]),
        "at_most": np.array([one.limits.high for one in job.requirements]),
        "of_magnitude": np.array([one.limits_magnitude for one in job.requirements]),
        "margin": np.stack([one.margin(values) for one, values in pairs], axis=-1),
        "met": np.stack([one.is_met(values) for one, values in pairs], axis=-1),
    }
