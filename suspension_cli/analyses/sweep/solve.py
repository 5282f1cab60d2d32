"""Modes, responses and couplings of a design over grids of any of its parameters."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.design import reader
from suspension_cli.design.paths import value_at
from suspension_cli.design.schema import Design
from suspension_cli.errors import InputError
from suspension_cli.files import stored
from suspension_cli.files.declared import ATTRIBUTE, AXES, along, dim_name, in_unit
from suspension_cli.files.hdf5 import Stored, add_dataset
from suspension_cli.linear import batch_modes, eigenmodes, mode_content, mode_pairing
from suspension_cli.linear.batch_modes import Spectrum
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.mode_content import Content
from suspension_cli.linear.mode_pairing import pair_bodies
from suspension_cli.linear.named_results import Mode, Ratio, Scalar, labels
from suspension_cli.linear.system import LinearSystem
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

    @cached_property
    def labelled(self) -> tuple[Mode, ...]:
        """Modes among the results that are asked for by their labels."""
        modes = (one for one in self.results if isinstance(one, Mode))
        return tuple(one for one in modes if one.motion is not None)

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
        if self.labelled:
            one = (len(self.labelled),)
            columns |= {"label_mode": ("i2", one), "other_mode": ("i2", one)}
            columns |= {"label_fraction": ("f8", one), "other_fraction": ("f8", one)}
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
                model = found.model.constant.select(np.flatnonzero(solvable))
                solved = batch_modes.solve(model)
                result["omega_squared"][here[solvable]] = solved.omega_squared
                result["shape"][here[solvable]] = solved.shape
                for name, values in self._find_labelled(model, solved).items():
                    result[name][here[solvable]] = values
            if same and self.ratios:
                result["response"][here] = builds.responses(found, self.ratios)
        return result

    def _find_labelled(self, model: LinearSystem, solved: Spectrum) -> dict[str, np.ndarray]:
        """Find the modes that labels mean at each point, and those that share their motions."""
        if not self.labelled:
            return {}
        fractions = mode_content.of_spectrum(model, solved)
        motions = [one.motion for one in self.labelled if one.motion is not None]
        found = [mode_content.find(fractions, motion) for motion in motions]
        return {
            "label_mode": np.stack([one.mode for one in found], axis=-1),
            "other_mode": np.stack([one.other for one in found], axis=-1),
            "label_fraction": np.stack([one.fraction for one in found], axis=-1),
            "other_fraction": np.stack([one.other_fraction for one in found], axis=-1),
        }


def has_modes(status: Int[np.ndarray, "*build"]) -> Bool[np.ndarray, "*build"]:
    """Whether builds have an equilibrium on taut wires, stable or not, from their status."""
    return (status == builds.GOOD) | (status == builds.UNSTABLE)


def evaluate_results(
    results: tuple[Scalar, ...],
    omega_squared: Float[np.ndarray, "*point mode"] | None,
    rank: Int[np.ndarray, "*point nominal"] | None,
    response: Complex[np.ndarray, "*point response"] | None,
    label_mode: Int[np.ndarray, "*point labelled"] | None = None,
) -> Float[np.ndarray, "*point result"]:
    """Evaluate results: frequencies in Hz and magnitudes of responses in SI units.

    NaN for an unstable mode. `omega_squared`, (rad/s)^2, is ascending; `rank` is the position there
    of each nominal mode, `label_mode` that of each mode asked for by its label, or -1. `response`
    are the responses among the results. Both are in the order of the results.
    """
    sizes = iter(() if response is None else np.moveaxis(np.abs(response), -1, 0))
    by_label = iter(() if label_mode is None else np.moveaxis(label_mode, -1, 0))
    columns = []
    for result in results:
        if not isinstance(result, Mode):
            columns.append(next(sizes))
            continue
        assert rank is not None and omega_squared is not None
        place = rank[..., result.number] if result.motion is None else next(by_label)
        columns.append(mode_content.frequencies(omega_squared, place.astype(np.intp)))
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
    labelled
        Results that are modes asked for by their labels; None without these. At each point a label
        means the mode that is mostly this motion, see `linear.mode_content`.
    label_mode, other_mode
        Places of that mode among those of a point, and of the one with most of the motion beside
        it; -1 where there is none.
    label_fraction, other_fraction
        Fractions of the kinetic energy of these two modes in the motion.
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
    labelled: tuple[str, ...] | None = None
    label_mode: Int[np.ndarray, "*axes labelled"] | None = None
    other_mode: Int[np.ndarray, "*axes labelled"] | None = None
    label_fraction: Float[np.ndarray, "*axes labelled"] | None = None
    other_fraction: Float[np.ndarray, "*axes labelled"] | None = None

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
    labelled = np.array([one.number for one in job.labelled], dtype=int)
    return evaluate_results(
        job.results, modes.omega_squared[None], rank[None], found.get("response"), labelled[None]
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
        modes_asked = [one for one in job.results if isinstance(one, Mode)]
        tracked = [one.number for one in modes_asked if one.motion is None]
        least = float(np.fmin.reduce(overlap[..., tracked], axis=None, initial=np.nan))
        described |= {
            "mode": tuple(labels(modes)),
            "mode_number": np.arange(1, len(modes.omega_squared) + 1),
            "coordinate": modes.coordinate,
        }
    if job.ratios:
        described["response_name"] = tuple(item.text for item in job.ratios)
        described["response_unit"] = tuple(item.unit for item in job.ratios)
    if job.labelled:
        described["labelled"] = tuple(one.text for one in job.labelled)
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
        value=evaluate_results(job.results, squared, rank, response, known.get("label_mode")),
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
        evaluate_results(
            job.results,
            known.get("omega_squared"),
            rank,
            known.get("response"),
            known.get("label_mode"),
        )
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
    most similar shape here or, if that changes it less, the one that the nominal mode becomes, or
    that its label means in both.
    """
    old, new = systems(simple), systems(refined)
    modes, partners = (eigenmodes.solve(system.constant) for system in (old, new))
    here, there = (_numbers(job, one, system) for one, system in ((modes, old), (partners, new)))
    known = [one for one in job.results if not isinstance(one, Mode) or here[one] >= 0]
    items = tuple(Mode(one.text, here[one]) if isinstance(one, Mode) else one for one in known)
    found = Several(items, modes).changes(old, new)
    if refined.has_wire_mass:
        return found
    changes = []
    for one, (change, text) in zip(known, found, strict=True):
        direct = change
        if isinstance(one, Mode) and there[one] >= 0:
            before, after = modes.frequency[here[one]], partners.frequency[there[one]]
            direct = float(np.abs(before / after - 1)) if before > 0 and after > 0 else change
        changes.append((min(change, direct), text))
    return changes


def _numbers(job: ParameterSweep, modes: Modes, system: LinearSystem) -> dict[Scalar, int]:
    """Number of each mode among the results in another design; -1 if it has none."""
    paired = pair_bodies(job.nominal, modes, system)
    return {
        one: int(paired[one.number])
        if one.motion is None
        else int(mode_content.find(modes.fractions, one.motion).mode)
        for one in job.results
        if isinstance(one, Mode)
    }
