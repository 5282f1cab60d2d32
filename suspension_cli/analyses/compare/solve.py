"""Comparison of modes, quantities, responses and noises.

    comparison = solve(analysis, items, run)
    comparison.modes.frequency  # a row per mode, a column per item
    comparison.quantities.value  # the same of quantities

Modes of two designs are paired one to one by the overlap of their shapes in the motion of bodies
of the same name, u^T L_a L_b^T v with M = L L^T the mass matrix of each design: 1 for equal
shapes of equal bodies. Violin modes are paired by their labels.
"""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from suspension_cli.analyses import known_analyses, settings
from suspension_cli.analyses.analysis import Analysis, Run
from suspension_cli.analyses.compare import compared_quantities
from suspension_cli.analyses.compare.compared_quantities import ComparedQuantities
from suspension_cli.analyses.compare.items import Curve, CurveName, Item, curves_of
from suspension_cli.analyses.logs import RelayedLog
from suspension_cli.analyses.record import Record
from suspension_cli.conventions import DOF_BY_NAME, DOF_NAMES
from suspension_cli.design.derive import mirror
from suspension_cli.design.measured import Mode
from suspension_cli.design.paths import format_with_unit
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.errors import InputError
from suspension_cli.files.declared import along, in_unit, scale_of
from suspension_cli.files.documents import Layout
from suspension_cli.grids import parse_frequencies
from suspension_cli.linear.mode_pairing import pair_by_overlap
from suspension_cli.models.registry import AUTO, MODELS, Choice

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float

LEAST_OVERLAP = 0.1
"""Overlap of two shapes below which modes are not paired."""
OTHER_TABLES = ("design", "analysis")
"""Tables that do not describe a suspension."""
MISSING = "not given"


@dataclass(frozen=True)
class Change:
    """A key that differs, and its values with units; ``"not given"`` where missing.

    `item` is the number, from 0, of the design that differs from the first.
    """

    in_json: ClassVar = Layout(without="item")
    path: str
    before: str
    after: str
    item: int = field(default=0, repr=False)

    @property
    def words(self) -> str:
        """Short path: ``test wires d``."""
        return " ".join(part for part in self.path.split(".") if part != "stage").replace("_", " ")


@dataclass(frozen=True)
class PairedModes:
    """Modes of several items, a row per mode.

    Frequencies (Hz) and quality factors are NaN where an item has no such mode, or it is unstable.
    `overlap` is that of the shape with that of the first design; NaN without shape.
    """

    in_json: ClassVar = Layout(rows={"mode": ""}, names={"label": "label"})
    label: tuple[str, ...] = field(metadata=scale_of("mode"))
    frequency: Float[np.ndarray, "mode item"] = field(metadata=in_unit("Hz"))
    q: Float[np.ndarray, "mode item"]
    overlap: Float[np.ndarray, "mode item"]


@dataclass(frozen=True)
class Overlay:
    """Curves of one quantity; the first is the reference. A noise has no input."""

    kind: str
    output: str
    input: str
    unit: str
    curves: tuple[Curve, ...]

    @property
    def name(self) -> str:
        """Name: ``test.x / support.x``."""
        return f"{self.output} / {self.input}" if self.input else f"noise of {self.output}"


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Record):
    """Differences between items: designs, results and measurements.

    Attributes
    ----------
    name, kind, models
        Of each item: its name, ``"design"``, ``"result"`` or ``"measurement"``, and its model, ""
        for measurements.
    changes
        Keys in which designs differ from the first one.
    modes, quantities
        Tables with a column per item; None without any.
    overlay
        Responses and noises, each with a curve per item that has it.
    """

    in_json: ClassVar = Layout(
        rows={"item": "items"},
        names={"name": "name", "models": "fidelity"},
        without="changes overlay",
        sparse="modes quantities",
    )
    name: tuple[str, ...] = field(metadata=scale_of("item"))
    kind: tuple[str, ...] = field(metadata=along("item"))
    models: tuple[str, ...] = field(metadata=along("item", name="model"))
    changes: tuple[Change, ...] = field(metadata=along("change"))
    modes: PairedModes | None
    overlay: tuple[Overlay, ...]
    quantities: ComparedQuantities | None = None

    @property
    def change(self) -> tuple[tuple[Change, ...], ...]:
        """Changes of each item."""
        return tuple(
            tuple(one for one in self.changes if one.item == n) for n in range(len(self.name))
        )


class _Analyses:
    """Results by item: read from files, or computed for designs.

    `choices` are the analyses of each item and their models.
    """

    def __init__(self, items: Sequence[Item], run: Run) -> None:
        self.items = items
        self.setting = run.setting
        self.log = RelayedLog(run.log)
        self.choices: list[list[tuple[str, Choice]]] = [
            [(item.result.run.analysis.name, item.result.run.choice)] if item.result else []
            for item in items
        ]

    def compute(self, name: str, **given: object) -> dict[int, Any]:
        """Run an analysis for all designs with the most complete model that one needs."""
        analysis = known_analyses.get(name)

        def one(run: Run, level: str) -> Any:
            own = dict(fidelity=level, tolerance=self.setting["tolerance"], as_json=True, **given)
            setting = settings.defaults(analysis, own)
            with run.faults():
                return analysis.solve(dataclasses.replace(run, setting=setting, log=self.log))

        runs = {n: item.run for n, item in enumerate(self.items) if item.run is not None}
        found = {n: one(run, self.setting["fidelity"]) for n, run in runs.items()}
        top = max((own.run.choice.model for own in found.values()), key=MODELS.index, default=None)
        for n, run in runs.items():
            if top and found[n].run.choice.model is not top and not top.unsuitable(run.design):
                found[n] = one(run, top.name)
            self.choices[n].append((name, found[n].run.choice))
        return found

    def quantities(self) -> ComparedQuantities | None:
        """Compute the quantities of all designs; None if there are none."""

        def report(n: int, choice: Choice) -> None:
            self.choices[n].append(("quantities", choice))

        texts = self.setting["results"]
        level = self.setting["fidelity"]
        tolerance = self.setting["tolerance"]
        return compared_quantities.compare(self.items, texts, level, tolerance, report)

    def models(self) -> tuple[str, ...]:
        """Most complete of the models of each item; "" of measurements."""
        levels = [[choice.model for _, choice in own] for own in self.choices]
        return tuple(max(own, key=MODELS.index).name if own else "" for own in levels)

    def choice(self) -> Choice:
        """All models, with the largest error and the physics neglected there, and in what."""
        choices = [one for own in self.choices for one in own]
        name, worst = max(choices, key=lambda one: np.nan_to_num(one[1].error, nan=np.inf))
        left = worst.neglected
        if any(choice.level != worst.level for _, choice in choices):
            own = f"neglected in {name} ({worst.level} model): "
            left = left.replace("neglected: ", own, 1)
        reason = "; ".join(filter(None, ("as the designs need it", left)))
        return Choice(", ".join(sorted({*self.models()} - {""})), reason, worst.error)


def solve(analysis: Analysis, items: Sequence[Item], run: Run) -> Comparison:
    """Analyse the designs among the items, and compare all items.

    Modes are compared if designs or measured modes are given; responses and noises if a result, a
    measurement or the setting names them; quantities if the setting, a requirement of a design or a
    measurement does. The model is that of all items, with the largest of their estimated errors.
    Raises `InputError` with the faults of a design or of a setting.
    """
    texts = {n: item.source.text for n, item in enumerate(items) if item.source is not None}
    first, *others = texts
    changes = [
        dataclasses.replace(change, item=n)
        for n in others
        for change in find_changes(texts[first], texts[n])
    ]
    analyses = _Analyses(items, run)
    modes = _modes(items, analyses)
    quantities = analyses.quantities()
    overlay = tuple(_overlays(items, analyses))
    return Comparison(
        name=tuple(item.name for item in items),
        kind=tuple(item.kind for item in items),
        models=analyses.models(),
        changes=tuple(changes),
        modes=modes,
        overlay=overlay,
        quantities=quantities,
        run=run.origin(analysis, analyses.choice()),
    )


def find_changes(before: str, after: str) -> list[Change]:
    """List the keys in which two designs (TOML) differ; a stage in only one of them is one change.

    >>> find_changes("constants.gravity = 9.81", "constants.gravity = 9.8")
    [Change(path='constants.gravity', before='9.81 m/s^2', after='9.8 m/s^2')]
    """
    raw = [tomllib.loads(text) for text in (before, after)]
    names = [{stage["name"] for stage in one.get("stage", ())} for one in raw]
    first, second = (dict(_values(one, alone=names[0] ^ names[1])) for one in raw)
    return [
        Change(path, _format_value(path, first.get(path)), _format_value(path, second.get(path)))
        for path in dict.fromkeys((*first, *second))
        if first.get(path) != second.get(path)
    ]


def _values(value: object, path: str = "", *, alone: set[str]) -> Iterator[tuple[str, object]]:
    """List dotted paths and values; tables in lists by name or number, stages `alone` as one."""
    if path.startswith("stage.") and path.removeprefix("stage.") in alone:
        yield path, "a stage"
    elif isinstance(value, list) and any(isinstance(item, dict) for item in value):
        for n, item in enumerate(value, 1):
            yield from _values(item, f"{path}.{item.get('name', n)}", alone=alone)
    elif isinstance(value, dict):
        for key, item in value.items():
            if path or key not in OTHER_TABLES:
                yield from _values(item, f"{path}.{key}".strip("."), alone=alone)
    else:
        yield path, value


def _format_value(path: str, value: object) -> str:
    if value is None:
        return MISSING
    if isinstance(value, list):
        return ", ".join(_format_value(path, item) for item in value)
    if isinstance(value, bool):
        return str(value).lower()
    if not isinstance(value, (int, float)):
        return str(value)
    return format_with_unit(path, value, digits=10)


def _modes(items: Sequence[Item], analyses: _Analyses) -> PairedModes | None:
    """Pair the modes of all items; None if only one design has modes."""
    results = {n: item.result for n, item in enumerate(items) if item.result is not None}
    stored = {n: result for n, result in results.items() if result.run.analysis.name == "modes"}
    alone = not stored and not any(item.modes for item in items)
    if alone and sum(item.run is not None for item in items) < 2:
        return None
    found = stored | analyses.compute("modes")
    if not found:
        return None
    wires = bool(stored) or analyses.setting["fidelity"] != AUTO
    return pair_modes(dict(sorted(found.items())), items, wires=wires)


def pair_modes(found: dict[int, Any], items: Sequence[Item], *, wires: bool = True) -> PairedModes:
    """Pair the modes of designs by shape, and measured modes by label or frequency.

    `found` are the modes of each item with a design. If `wires`, also those of wires, by label.
    """
    names = {n: np.array(one.label) for n, one in found.items()}
    listed = {n: np.flatnonzero(wires | (one.order == 0)) for n, one in found.items()}
    reference, *others = found
    first = listed[reference]
    # a row has the number of the mode, and the overlap, of each item
    rows = [{reference: (m, 1.0)} for m in first.tolist()]
    further: list[dict[int, tuple[int, float]]] = []
    for n in others:
        overlap = _shape_overlap(found[reference], found[n])[np.ix_(first, listed[n])]
        of_wire = found[n].order[listed[n]] > 0
        alike = (names[reference][first][:, None] == names[n][listed[n]]) & of_wire
        overlap = np.where(alike, np.inf, np.where(of_wire, 0.0, overlap))
        partner = pair_by_overlap(np.minimum(overlap, 2.0))
        left = dict(enumerate(listed[n].tolist()))
        for row, known, k in zip(rows, overlap, partner, strict=True):
            if k >= 0 and known[k] > LEAST_OVERLAP:
                row[n] = left.pop(k), float(known[k]) if np.isfinite(known[k]) else np.nan
        further += [{n: (k, np.nan)} for k in left.values()]
    every = rows + further
    labels = [str(names[n][m]) for n, (m, _) in (next(iter(row.items())) for row in every)]
    values = np.full((3, len(every), len(items)), np.nan)
    for place, row in enumerate(every):
        for n, (m, overlap) in row.items():
            values[:, place, n] = found[n].frequency[m], found[n].q[m], overlap
    for n, item in enumerate(items):
        for mode in item.modes:
            free = np.isnan(values[0, :, n])
            away = np.abs(values[0, :, reference] - mode.frequency)
            row = _measured_row(labels, mode, free & np.isfinite(away), away)
            values[0, row, n] = mode.frequency
    # by the first frequency; unstable modes have none
    known = np.isfinite(values[0])
    lowest = values[0][np.arange(len(every)), known.argmax(1)]
    order = np.argsort(np.where(known.any(1), lowest, -np.inf), kind="stable")
    return PairedModes(tuple(labels[i] for i in order), *values[:, order])


def _measured_row(
    labels: Sequence[str],
    mode: Mode,
    free: Bool[np.ndarray, " row"],
    away: Float[np.ndarray, " row"],
) -> int:
    """Find the row of a measured mode: of its label, else of its motions, nearest in frequency."""
    named = [mode.label in (label, label.partition("#")[0]) for label in labels]
    motions = [DOF_NAMES[DOF_BY_NAME[name]] for name in mode.dof or ()]
    suited = [any(motion in label for motion in motions) for label in labels]
    for allowed in (named, suited):
        if (allowed & free).any():
            free = allowed & free
            break
    return int(np.argmin(np.where(free, away, np.inf)))


def _shape_overlap(one: Any, other: Any) -> Float[np.ndarray, "one other"]:
    """Overlaps in bodies of the same name, or of the same number if there is none."""
    bodies = one.body
    others = other.body
    common = [name for name in bodies if name in others]
    mine = [bodies.index(name) for name in common]
    theirs = [others.index(name) for name in common]
    if not common:
        mine = list(range(min(len(bodies), len(others))))
        theirs = mine
    first = _weighted_shapes(one)[:, mine]
    second = _weighted_shapes(other)[:, theirs]
    return np.abs(np.einsum("mbi,nbi->mn", first, second))


def _weighted_shapes(result: Any) -> Float[np.ndarray, "mode body 6"]:
    """Shapes in the motion of bodies, times L^T of each; of unit norm if only bodies move."""
    bodies = expand(result.run.design.design).bodies
    count = len(result.body)
    shape = result.shape[:, : 6 * count].reshape(-1, count, 6).copy()
    shape[..., :3] *= np.sqrt(bodies.mass)[:, None]
    shape[..., 3:] = np.einsum("mbi,bij->mbj", shape[..., 3:], np.linalg.cholesky(bodies.inertia))
    return shape


def _overlays(items: Sequence[Item], analyses: _Analyses) -> Iterator[Overlay]:
    """Compare the responses, then the noises, of items and of the setting."""
    setting = analyses.setting
    wanted = [what for item in items for what in item.curves]
    if setting["inputs"] or setting["outputs"]:
        first = next(item.source for item in items if item.source is not None)
        outputs = setting["outputs"] or (f"{mirror(first.design)}.x",)
        inputs = setting["inputs"] or ("support.x",)
        wanted += [CurveName("response", out, into) for out in outputs for into in inputs]
    wanted += [CurveName("noise", out, "") for out in setting["noises"]]
    for what in sorted(dict.fromkeys(wanted), key=lambda one: one.kind == "noise"):
        stored = {n: item for n, item in enumerate(items) if what in item.curves}
        grid = [item.curves[what][0].frequency for item in stored.values()]
        if all(item.kind == "measurement" for item in stored.values()):  # on curves in between
            grid.append(np.array(parse_frequencies(setting["frequency"])))
        points = tuple(np.unique(np.concatenate(grid)).tolist())
        given = {"outputs": (what.output,), "frequency": points}
        try:
            if what.kind == "response":
                solved = analyses.compute("response", inputs=(what.input,), **given)
            else:
                solved = analyses.compute("thermal", **given)
        except InputError as error:
            if what.kind == "response":
                raise
            option = {"--output": "--noise"}
            faults = [dataclasses.replace(f, key=option.get(f.key, f.key)) for f in error.faults]
            raise InputError(faults, error.file) from None
        found = {n: item.curves[what] for n, item in stored.items()}
        found |= {n: curves_of(result)[what] for n, result in solved.items()}
        if found:
            # the first curve is the reference: that of a design or result, if there is one
            order = sorted(found, key=lambda n: (items[n].kind == "measurement", n))
            first, *others = (dataclasses.replace(found[n][0], item=n) for n in order)
            curves = (first, *(with_ratio(curve, first) for curve in others))
            yield Overlay(*what, next(reversed(found.values()))[1], curves)


def with_ratio(curve: Curve, reference: Curve) -> Curve:
    """Compute the ratio within the range of the reference, interpolated between its points."""
    known = reference.frequency
    inside = (curve.frequency >= known[0]) & (curve.frequency <= known[-1])
    frequency = curve.frequency[inside]
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = curve.value[inside] / interpolate(frequency, reference)
    return dataclasses.replace(curve, ratio_frequency=frequency, ratio=ratio)


def interpolate(
    frequency: Float[np.ndarray, " point"], curve: Curve
) -> Complex[np.ndarray, " point"]:
    """Interpolate ln magnitude, and phase, over ln frequency; exact at the points of the curve."""
    known = np.log(curve.frequency)
    value = curve.value
    with np.errstate(divide="ignore"):
        size = np.interp(np.log(frequency), known, np.log(np.abs(value)))
    phase = np.interp(np.log(frequency), known, np.unwrap(np.angle(value)))
    result = np.exp(size + 1j * phase)
    _, mine, theirs = np.intersect1d(frequency, curve.frequency, return_indices=True)
    result[mine] = value[theirs]
    return result
