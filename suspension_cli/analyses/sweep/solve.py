"""Modes, responses and couplings of a design over grids of any of its parameters."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.design.paths import value_at
from suspension_cli.design.schema import Design
from suspension_cli.errors import InputError
from suspension_cli.files import stored
from suspension_cli.files.declared import ATTRIBUTE, AXES, along, dim_name, in_unit
from suspension_cli.files.hdf5 import Stored, add_dataset
from suspension_cli.linear import batch_modes, eigenmodes, mode_pairing
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.mode_pairing import pair_bodies
from suspension_cli.linear.named_results import Mode, Ratio, Scalar, labels
from suspension_cli.models import registry
from suspension_cli.models.base import Model
from suspension_cli.models.choice import Several, Systems
from suspension_cli.studies import builds, variants
from suspension_cli.studies.extremes import find_extremes
from suspension_cli.studies.job import Axis, Grid, nominal_system
from suspension_cli.studies.run import Columns

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Int

    from suspension_cli.models.choice import Comparison

OTHER_COORDINATES = len(builds.STATUS)
STATUS = (*builds.STATUS, "the design has other coordinates than the one swept")
"""Meaning of the status of a point."""
POINTS = 9
"""Largest number of points at which models are compared before the sweep."""
ONE_MODEL_ONLY = "some points have an equilibrium in only one of the models"


@dataclass(frozen=True)
class ParameterSweep(Grid):
    """Grid of designs, whose axes are named by dotted paths.

    If `allow_unstable`, responses about an unstable equilibrium are valid.
    """

    level: str
    results: tuple[Scalar, ...]
    allow_unstable: bool = False

    @cached_property
    def ratios(self) -> tuple[Ratio, ...]:
        """Responses and couplings among the results."""
        return tuple(result for result in self.results if isinstance(result, Ratio))

    @property
    def has_modes(self) -> bool:
        """Whether modes are among the results."""
        return len(self.ratios) < len(self.results)

    @cached_property
    def nominal(self) -> Modes:
        """Modes of the nominal design; results are named by their labels."""
        return eigenmodes.solve(nominal_system(self.text, self.level))

    @property
    def nominal_shape(self) -> Float[np.ndarray, "mode coordinate"]:
        """Shapes of the nominal modes, as in `batch_modes.Spectrum`."""
        return eigenmodes.spectrum(nominal_system(self.text, self.level)).shape

    @property
    def drawn(self) -> tuple[float, ...]:
        """Nominal value of each parameter; NaN where the design does not give it."""
        raw = tomllib.loads(self.text)
        given = [value_at(raw, axis.name) for axis in self.axes]
        return tuple(float(one) if type(one) in (int, float) else np.nan for one in given)

    def check(self) -> None:
        """Raise `InputError` if a path does not exist or its values give no valid design."""
        self.check_designs("--vary", self.axes, lambda one: registry.choose(one, self.level))

    def compute(self, start: int, stop: int) -> Columns:
        """Compute status, modes and responses of points start to stop - 1."""
        designs = variants.designs_at(self.text, self.values(start, stop))
        return self.compute_designs(designs, stop - start)

    def compute_designs(self, designs: Iterable[Design | None], count: int) -> Columns:
        """Compute status, modes in ascending order, and responses of `count` designs."""
        columns: dict[str, tuple[str, tuple[int, ...]]] = {"status": ("u1", ())}
        if self.ratios:
            columns["response"] = ("c16", (len(self.ratios),))
        if self.has_modes:
            shape = self.nominal_shape.shape
            columns |= {"omega_squared": ("f8", shape[:1]), "shape": ("f4", shape)}
        result = builds.blank(count, **columns)
        nominal, unstable = nominal_system(self.text, self.level), self.allow_unstable
        for found, here in variants.balanced(designs, self.level, allow_unstable=unstable):
            same = (
                found.model.coordinate == nominal.coordinate
                and (found.model.massless == nominal.massless).all()
            )
            result["status"][here] = found.status if same else OTHER_COORDINATES
            if same and self.has_modes:
                solvable = has_modes(found.status)
                solved = batch_modes.solve(found.model.constant.select(np.flatnonzero(solvable)))
                result["omega_squared"][here[solvable]] = solved.omega_squared
                result["shape"][here[solvable]] = solved.shape
            if same and self.ratios:
                result["response"][here] = builds.responses(found, self.ratios)
        return result


def has_modes(status: Int[np.ndarray, "*build"]) -> Bool[np.ndarray, "*build"]:
    """Whether builds have an equilibrium on taut wires, stable or not, from their status."""
    return (status == builds.GOOD) | (status == builds.UNSTABLE)


def evaluate_results(
    results: tuple[Scalar, ...],
    omega_squared: Float[np.ndarray, "*point mode"] | None,
    rank: Int[np.ndarray, "*point nominal"] | None,
    response: Complex[np.ndarray, "*point response"] | None,
) -> Float[np.ndarray, "*point result"]:
    """Evaluate results: frequencies in Hz and magnitudes of responses in SI units.

    NaN for an unstable mode. `omega_squared`, (rad/s)^2, is ascending, and `rank` the position
    there of each nominal mode, or -1. `response` are the responses among the results, in their
    order.
    """
    sizes = iter(() if response is None else np.moveaxis(np.abs(response), -1, 0))
    columns = []
    for result in results:
        if isinstance(result, Mode):
            assert rank is not None and omega_squared is not None
            place = rank[..., result.number, None].astype(np.intp)
            squared = np.take_along_axis(omega_squared, np.maximum(place, 0), -1)
            known = (place >= 0) & (squared >= 0)
            frequency = np.sqrt(np.where(known, squared, np.nan)) / (2 * np.pi)
            columns.append(frequency[..., 0])
        else:
            columns.append(next(sizes))
    return np.stack(columns, axis=-1)


@dataclass(frozen=True)
class SweepResult:
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
        Dominant motion of each mode in the nominal design, ``test.pitch``; empty for responses.
    nominal
        Results of the nominal design.
    value
        Results; NaN where there is none.
    status
        See `status_meaning`.
    overlap
        Smallest overlap of shapes by which a mode among the results was followed from one point to
        the next; 1 without modes.
    mode, mode_number, coordinate
        Labels of the nominal modes, numbers of the modes of each point, and coordinates of shapes;
        None without modes.
    response_name, response_unit, response
        Responses and couplings among the results; None without these.
    omega_squared, shape
        Modes of each point in ascending order, with shapes as in `batch_modes.Spectrum`.
    rank
        Place of each nominal mode among those of a point.
    """

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

    @property
    def failures(self) -> dict[str, int]:
        """Number of failed points by reason."""
        return builds.count_failures(self.status, STATUS)

    @property
    def change(self) -> Float[np.ndarray, " result"]:
        """Relative change of each result over the grid, largest over smallest less 1.

        0 where a result has no value; the largest value where the smallest is 0.
        """
        flat = self.value.reshape(-1, len(self.result))
        low, high = np.fmin.reduce(flat, axis=0), np.fmax.reduce(flat, axis=0)
        return np.where(np.isfinite(low), (high - low) / np.where(low > 0, low, 1.0), 0.0)


def nearest_point(job: ParameterSweep) -> tuple[int, ...]:
    """Find the grid point nearest to the nominal design; 0 along axes without a nominal value."""
    return tuple(
        0 if np.isnan(at) else int(np.abs(np.array(axis.values) - at).argmin())
        for axis, at in zip(job.axes, job.drawn, strict=True)
    )


def nominal_results(job: ParameterSweep) -> Float[np.ndarray, " result"]:
    """Evaluate the results of the nominal design.

    Without a steady state, responses are NaN unless the job allows it.
    """
    modes, found = job.nominal, job.compute_designs([job.design], 1)
    rank = np.arange(len(modes.omega_squared))
    return evaluate_results(
        job.results, modes.omega_squared[None], rank[None], found.get("response")
    )[0]


def _follow(
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


def write(group: Stored, columns: Columns, job: ParameterSweep) -> None:
    """Follow the modes over the grid, evaluate the results, and write them."""
    known, modes = job.on_grid(columns), job.nominal
    described: dict[str, Any] = {}
    rank, overlap, least, start = None, None, np.nan, nearest_point(job)
    if job.has_modes:
        rank, overlap = _follow(job, known)
        tracked = [one.number for one in job.results if isinstance(one, Mode)]
        least = float(np.fmin.reduce(overlap[..., tracked], axis=None))
        described |= {
            "mode": tuple(labels(modes)),
            "mode_number": np.arange(1, len(modes.omega_squared) + 1),
            "coordinate": modes.coordinate,
        }
    if job.ratios:
        described["response_name"] = tuple(item.text for item in job.ratios)
        described["response_unit"] = tuple(item.unit for item in job.ratios)
    squared, response = known.get("omega_squared"), known.get("response")
    homes = [modes.home[one.number] if isinstance(one, Mode) else () for one in job.results]
    record = SweepResult(
        axes=job.axes,
        drawn=job.drawn,
        start=start,
        result=tuple(item.text for item in job.results),
        unit=tuple(item.unit for item in job.results),
        degree=tuple(".".join(home) for home in homes),
        nominal=nominal_results(job),
        value=evaluate_results(job.results, squared, rank, response),
        overlap=1.0 if np.isnan(least) else least,
        rank=rank,
        **described,
        **known,
    )
    stored.write(group, record)
    if overlap is not None:
        scales = [group[dim_name(axis.name)] for axis in job.axes]
        add_dataset(group, "overlap", overlap, "1", *scales, group["mode"])


def first_points(job: ParameterSweep) -> Int[np.ndarray, " point"]:
    """Points at which models are compared before the sweep, at corners and middles of the grid."""
    corners = job.corners
    return corners[np.unique(np.linspace(0, len(corners) - 1, POINTS).astype(int))]


def extreme_points(job: ParameterSweep, columns: Columns) -> Int[np.ndarray, " point"]:
    """Points at which the results of a finished sweep are extreme, or change fastest."""
    known = job.on_grid(columns)
    rank = None
    if job.has_modes:
        rank, _ = _follow(job, known)
    return find_extremes(
        evaluate_results(job.results, known.get("omega_squared"), rank, known.get("response"))
    )


def result_change(job: ParameterSweep) -> Callable[[Int[np.ndarray, " point"]], Comparison]:
    """The change of a sweep's results at some points, as `model_choice.for_builds` takes it.

    Modes are paired by their shapes. The change is infinite where a point has an equilibrium, or
    for responses a stable one, in only one of the models. The `job` is in the simplest model.
    """
    known: dict[int, Systems | None] = {}
    stable = bool(job.ratios) and not job.allow_unstable

    def at(points: Int[np.ndarray, " point"]) -> Comparison:
        new = np.array([n for n in points.tolist() if n not in known], dtype=int)
        designs = variants.designs_at(job.text, job.values_at(new))
        known.update(
            (n, one and Systems(one)) for n, one in zip(new.tolist(), designs, strict=True)
        )
        some = [systems for n in points.tolist() if (systems := known[n]) is not None]

        def change(simple: Model, refined: Model) -> tuple[float, str]:
            changes = [(0.0, "the results")]
            for systems in some:
                has = {_has_result(systems, model, stable=stable) for model in (simple, refined)}
                if len(has) > 1:
                    return float("inf"), ONE_MODEL_ONLY
                if has == {True}:
                    changes += _changes(job, systems, simple, refined)
            return max(changes, key=lambda one: one[0])

        return change

    return at


def _has_result(systems: Systems, model: Model, *, stable: bool) -> bool:
    """Whether a design has an equilibrium in a model, and a stable one if that is needed."""
    try:
        system = systems(model)
    except InputError:
        return False
    return not stable or eigenmodes.solve(system.constant).stable


def _changes(
    job: ParameterSweep, systems: Systems, simple: Model, refined: Model
) -> list[tuple[float, str]]:
    """Change of each result at one point.

    Where frequencies meet, shapes mix differently in both models. So a mode's partner is the one of
    most similar shape here or, if that changes it less, the one that the nominal mode becomes.
    """
    old, new = systems(simple), systems(refined)
    modes, partners = (eigenmodes.solve(system.constant) for system in (old, new))
    here, there = (
        pair_bodies(job.nominal, one, system) for one, system in ((modes, old), (partners, new))
    )
    items = tuple(
        Mode(one.text, int(here[one.number])) if isinstance(one, Mode) else one
        for one in job.results
    )
    found = Several(items, modes).changes(old, new)
    if refined.has_wire_mass:
        return found
    with np.errstate(invalid="ignore"):
        direct = np.abs(modes.frequency[here] / partners.frequency[there] - 1)
    return [
        (min(change, float(direct[one.number])) if isinstance(one, Mode) else change, text)
        for one, (change, text) in zip(job.results, found, strict=True)
    ]
