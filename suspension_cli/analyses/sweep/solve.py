"""Quantities of a design over grids of any of its parameters::

    results = find_results(["test pitch", "thermal test.x:10"], names, source.text, "beam")
    job = ParameterSweep(source.text, axes, "beam", results)
    columns = job.compute(0, job.count)

Each point of the grid is a design of its own. Designs of one topology are balanced together, and
all quantities read what they need from this batch (`quantities.solved`). What a name means in each
design does not depend on its neighbours, with one exception: modes of the design as drawn are
followed from point to neighbouring point by their shapes once all points are known
(`mode_pairing.follow`). Spectra and shapes of all points are kept for these, and for modes by
label, whose motion may pass from one mode to another (`sharing`).
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from suspension_cli.analyses.record import Record
from suspension_cli.design import reader
from suspension_cli.design.paths import value_at
from suspension_cli.design.schema import Design
from suspension_cli.errors import InputError
from suspension_cli.files import stored
from suspension_cli.files.declared import ATTRIBUTE, AXES, along, dim_name, in_unit
from suspension_cli.files.documents import Layout
from suspension_cli.files.hdf5 import Stored, add_dataset
from suspension_cli.linear import batch_modes, eigenmodes, mode_content, mode_pairing
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.mode_content import Content
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import registry
from suspension_cli.quantities.kinds.modes import FollowedMode, Frequency
from suspension_cli.quantities.kinds.responses import Ratio
from suspension_cli.quantities.needs import Needs
from suspension_cli.quantities.quantity import Quantity
from suspension_cli.quantities.requirements import Requirement
from suspension_cli.quantities.solved import Solved, of_designs
from suspension_cli.studies import builds, system_functions, variants
from suspension_cli.studies.extremes import MOST, find_extremes
from suspension_cli.studies.job import Axis, Grid, nominal_system
from suspension_cli.studies.run import Columns

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Inexact, Int

    from suspension_cli.analyses.record import Origin

OTHER_COORDINATES = len(builds.STATUS)
STATUS = (*builds.STATUS, "the design has other coordinates than the one swept")
"""Meaning of the status of a point."""
POINTS = 9
"""Largest number of points at which models are compared before the sweep."""
FEW = 3
"""The same, if a quantity is computed design by design."""
FEW_EXTREMES = 6
"""Largest number of points at which models are compared after such a sweep."""
TOGETHER = 16
"""Points computed at once, if a quantity is computed design by design: progress is seen then."""


@dataclass(frozen=True)
class ParameterSweep(Grid):
    """Grid of designs, whose axes are named by dotted paths.

    If `allow_unstable`, an unstable equilibrium has all results. `requirements` are judged at each
    point.
    """

    level: str
    results: tuple[Quantity, ...]
    allow_unstable: bool = False
    requirements: tuple[Requirement, ...] = ()

    @property
    def identity(self) -> str:
        """Text that differs between jobs of one design, with all numbers of its quantities."""
        with np.printoptions(threshold=10**9, floatmode="unique"):
            return super().identity

    @cached_property
    def quantities(self) -> tuple[Quantity, ...]:
        """Results, and quantities of requirements, each once."""
        required = [one.quantity for one in self.requirements]
        return tuple(dict.fromkeys([*self.results, *required]))

    @cached_property
    def needs(self) -> Needs:
        """What the quantities need."""
        return Needs.of(self.quantities)

    @cached_property
    def ratios(self) -> tuple[Ratio, ...]:
        """Responses and couplings among the results."""
        return tuple(one for one in self.results if isinstance(one, Ratio))

    @cached_property
    def followed(self) -> tuple[FollowedMode, ...]:
        """Modes among the results that are followed by their shapes."""
        return tuple(one for one in self.results if isinstance(one, FollowedMode))

    @cached_property
    def labelled(self) -> tuple[Frequency, ...]:
        """Modes among the results that are asked for by their labels."""
        return tuple(one for one in self.results if isinstance(one, Frequency))

    @property
    def has_modes(self) -> bool:
        """Whether modes are followed, or may share a motion."""
        return bool(self.followed or self.labelled)

    @property
    def is_slow(self) -> bool:
        """Whether a quantity is computed design by design."""
        return any(one.slow for one in self.quantities)

    @cached_property
    def nominal(self) -> Modes:
        """Modes of the nominal design; results are named by their labels."""
        return eigenmodes.solve(nominal_system(self.text, self.level))

    @property
    def nominal_shape(self) -> Float[np.ndarray, "mode coordinate"]:
        """Shapes of the nominal modes, as in `batch_modes.Spectrum`."""
        return batch_modes.solve(nominal_system(self.text, self.level)).shape

    @property
    def drawn(self) -> tuple[float, ...]:
        """Nominal value of each parameter; NaN where the design does not give it."""
        raw = tomllib.loads(self.text)
        given = [value_at(raw, axis.name) for axis in self.axes]
        return tuple(float(one) if type(one) in (int, float) else np.nan for one in given)

    def check(self) -> None:
        """Raise `InputError` if a path does not exist or its values give no valid design."""
        self.check_designs("--vary", self.axes, lambda one: registry.choose(one, self.level))

    def first_fault(self, status: Int[np.ndarray, "*axes"]) -> str:
        """Say what is wrong with the first point whose design is not possible."""
        [first, *_] = np.flatnonzero(status.ravel() == builds.IMPOSSIBLE).tolist()
        values = {name: float(one[0]) for name, one in self.values(first, first + 1).items()}
        at = ", ".join(f"{name} = {value:.4g}" for name, value in values.items())
        try:
            registry.by_name(self.level).system(reader.VariedDesign.of(self.text).at(values))
        except InputError as error:
            return f"at {at}: {error.faults[0].line('')}"
        return ""

    @property
    def compared(self) -> dict[str, Any]:
        """Columns by which an interpolated map is compared with full solutions.

        And the sizes below which their differences are relative to these.
        """
        columns: dict[str, Any] = {"value": np.array([one.negligible for one in self.results])}
        if self.has_modes:
            columns["omega_squared"] = 0.0
        return columns

    @property
    def is_analytic(self) -> bool:
        """Whether `sample` gives functions from which all results follow."""
        return all(one.analytic or one.undamped for one in self.quantities)

    @cached_property
    def _analytic(self) -> tuple[Quantity, ...]:
        """Results that have analytic functions of their own; others follow from the modes."""
        return tuple(one for one in self.quantities if one.analytic)

    @cached_property
    def _matrices(self) -> system_functions.Layout | None:
        """Elements of the linear system, if modes are asked for."""
        if all(one.analytic for one in self.quantities):
            return None
        return system_functions.Layout(nominal_system(self.text, self.level))

    @property
    def least(self) -> Float[np.ndarray, " function"]:
        """Sizes of the functions of `sample` below which they are rounding errors."""
        sizes = [np.full(one.function_count, one.negligible) for one in self._analytic]
        if self._matrices is not None:
            sizes.append(self._matrices.least)
        return np.concatenate(sizes)

    def sample(
        self, values: dict[str, Float[np.ndarray, " point"]]
    ) -> Inexact[np.ndarray, "point function"]:
        """Functions of all results, then the elements of the linear system if modes need them.

        NaN where a design has no result, or other coordinates.
        """
        count = len(next(iter(values.values())))
        result = np.full((count, len(self.least)), np.nan, complex if self.ratios else float)
        nominal = nominal_system(self.text, self.level)
        designs = variants.designs_at(self.text, values)
        for places, batch in of_designs(
            designs, self.level, self.needs, allow_unstable=self.allow_unstable
        ):
            if not _are_alike(batch.found.model, nominal):
                continue
            parts = [one.functions(batch) for one in self._analytic]
            if self._matrices is not None:
                parts.append(self._matrices.functions(batch.found.model))
            found = np.hstack(parts)
            result[places] = np.where(batch.is_steady[:, None], found, np.nan)
        return result

    def columns_of(self, functions: Inexact[np.ndarray, "point function"]) -> Columns:
        """Results that follow from the functions of `sample`."""
        count = len(functions)
        ends = np.cumsum([one.function_count for one in self._analytic], dtype=int)
        *parts, rest = np.split(functions, ends, axis=1)
        found = {one: one.of_functions(own) for one, own in zip(self._analytic, parts, strict=True)}
        batch = None
        if self._matrices is not None:
            batch = Solved.of_systems(self._matrices.system(np.real(rest)), self.design, self.level)
            others = set(self.quantities) - set(self._analytic) - set(self.followed)
            found |= {one: one.values(batch) for one in others}
        status = np.full(count, builds.GOOD, dtype=np.uint8)
        return {"status": status, **self._columns_of(found, batch)}

    def compute(self, start: int, stop: int) -> Columns:
        """Compute status and quantities of points start to stop - 1."""
        designs = variants.designs_at(self.text, self.values(start, stop))
        return self.compute_designs(designs, stop - start)

    def compute_designs(self, designs: Iterable[Design | None], count: int) -> Columns:
        """Compute status, quantities, and modes in ascending order of `count` designs."""
        result = builds.blank(count, **self._columns())
        nominal = nominal_system(self.text, self.level)
        for places, batch in of_designs(
            designs, self.level, self.needs, allow_unstable=self.allow_unstable
        ):
            model = batch.found.model
            alike = model.coordinate == nominal.coordinate
            if not (alike and (model.massless == nominal.massless).all()):
                result["status"][places] = OTHER_COORDINATES
                continue
            result["status"][places] = batch.found.status
            for name, values in self._evaluate(batch).items():
                result[name][places] = values
        return result

    def _columns(self) -> dict[str, tuple[str, tuple[int, ...]]]:
        """Type and shape per point of each column."""
        columns: dict[str, tuple[str, tuple[int, ...]]] = {
            "status": ("u1", ()),
            "value": ("f8", (len(self.results),)),
        }
        if self.requirements:
            columns["limited"] = ("f8", (len(self.requirements),))
        if self.ratios:
            columns["response"] = ("c16", (len(self.ratios),))
        if self.has_modes:
            shape = self.nominal_shape.shape
            columns["omega_squared"] = ("f8", shape[:1])
            columns["shape"] = ("f4", shape)
        if self.labelled:
            each = (len(self.labelled),)
            columns["label_mode"] = ("i2", each)
            columns["other_mode"] = ("i2", each)
            columns["label_fraction"] = ("f8", each)
            columns["other_fraction"] = ("f8", each)
        return columns

    def _evaluate(self, batch: Solved) -> dict[str, np.ndarray]:
        """Evaluate all columns but the status; modes that are followed are NaN until they are."""
        found = {}
        for one in self.quantities:
            if isinstance(one, Ratio):
                found[one] = np.where(batch.is_steady, one.read(batch), builds.NOTHING)
            elif one not in self.followed:
                found[one] = one.values(batch)
        return self._columns_of(found, batch)

    def _columns_of(
        self, found: dict[Quantity, np.ndarray], batch: Solved | None
    ) -> dict[str, np.ndarray]:
        """All columns but the status, from the values of quantities, complex of responses.

        Modes are read from the batch.
        """
        size = {one: np.abs(own) if np.iscomplexobj(own) else own for one, own in found.items()}
        if batch is not None:
            size |= dict.fromkeys(self.followed, np.full(batch.count, np.nan))
        columns = {"value": np.stack([size[one] for one in self.results], axis=-1)}
        if self.requirements:
            limited = [size[one.quantity] for one in self.requirements]
            columns["limited"] = np.stack(limited, axis=-1)
        if self.ratios:
            columns["response"] = np.stack([found[one] for one in self.ratios], axis=-1)
        if self.has_modes and batch is not None:
            columns["omega_squared"] = batch.spectrum.omega_squared
            columns["shape"] = batch.spectrum.shape.astype("f4")
            columns |= self._find_labelled(batch)
        return columns

    def _find_labelled(self, batch: Solved) -> dict[str, np.ndarray]:
        """Find the modes that labels mean at each point, and those that share their motions."""
        if not self.labelled:
            return {}
        found = [mode_content.find(batch.fractions, one.motion) for one in self.labelled]
        return {
            "label_mode": np.stack([one.mode for one in found], axis=-1).astype("i2"),
            "other_mode": np.stack([one.other for one in found], axis=-1).astype("i2"),
            "label_fraction": np.stack([one.fraction for one in found], axis=-1),
            "other_fraction": np.stack([one.other_fraction for one in found], axis=-1),
        }


def _are_alike(model: LinearSystem, nominal: LinearSystem) -> bool:
    """Whether systems have the same coordinates, in the same combinations."""
    same = model.coordinate == nominal.coordinate and model.k.shape[-1] == nominal.k.shape[-1]
    return same and bool(
        (model.massless == nominal.massless).all() and (model.basis == nominal.basis).all()
    )


def has_modes(status: Int[np.ndarray, "*build"]) -> Bool[np.ndarray, "*build"]:
    """Whether builds have an equilibrium on taut wires, stable or not, from their status."""
    return (status == builds.GOOD) | (status == builds.UNSTABLE)


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


def nearest_point(job: ParameterSweep) -> tuple[int, ...]:
    """Find the grid point nearest to the nominal design; 0 along axes without a nominal value."""
    return tuple(
        0 if np.isnan(at) else int(np.abs(np.array(axis.values) - at).argmin())
        for axis, at in zip(job.axes, job.drawn, strict=True)
    )


def nominal_results(job: ParameterSweep) -> Float[np.ndarray, " result"]:
    """Evaluate the results of the nominal design.

    Without a steady state, only those that do not need one have values, unless the job allows it.
    """
    found = job.compute_designs([job.design], 1)["value"][0]
    for n, one in enumerate(job.results):
        if isinstance(one, FollowedMode):
            found[n] = job.nominal.frequency[one.place]
    return found


def follow(
    job: ParameterSweep, known: dict[str, Any]
) -> tuple[Int[np.ndarray, "*grid mode"], Float[np.ndarray, "*grid mode"]]:
    """Follow the modes over the grid from the nominal design, see `mode_pairing.follow`."""
    return mode_pairing.follow(
        known["omega_squared"],
        known["shape"],
        has_modes(known["status"]),
        nearest_point(job),
        job.nominal_shape,
    )


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


def write(group: Stored, columns: Columns, job: ParameterSweep, run: Origin) -> Sweep:
    """Follow the modes over the grid, complete the results, and write them; return the record."""
    known = job.on_grid(columns)
    described: dict[str, Any] = {}
    rank = None
    overlap = None
    least = 1.0
    if job.has_modes:
        rank, overlap = follow(job, known)
        if job.followed:
            tracked = overlap[..., [one.place for one in job.followed]]
            found = float(np.fmin.reduce(tracked, axis=None, initial=np.nan))
            least = 1.0 if np.isnan(found) else found
        described["mode"] = tuple(job.nominal.numbered_label)
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


def first_points(job: ParameterSweep) -> Int[np.ndarray, " point"]:
    """Points at which models are compared before the sweep, at corners and middles of the grid."""
    corners = job.corners
    most = FEW if job.is_slow else POINTS
    return corners[np.unique(np.linspace(0, len(corners) - 1, most).astype(int))]


def extreme_points(job: ParameterSweep, columns: Columns) -> Int[np.ndarray, " point"]:
    """Points at which the results of a finished sweep are extreme, or change fastest."""
    known = job.on_grid(columns)
    rank = None
    if job.followed:
        rank, _ = follow(job, known)
    most = FEW_EXTREMES if job.is_slow else MOST
    return find_extremes(complete(job, known, rank), most)
