"""Comparison of modes, responses and noises.

Modes of two designs are paired one to one by the overlap of their shapes in the motion of bodies
of the same name, u^T L_a L_b^T v with M = L L^T the mass matrix of each design: 1 for equal
shapes of equal bodies. Violin modes are paired by their labels.
"""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses import registry, settings
from suspension_cli.analyses.analysis import Document, RelayedLog, Result, Run
from suspension_cli.analyses.compare.items import Curve, Item, Quantity, curves_of
from suspension_cli.design.derive import mirror
from suspension_cli.design.measured import Mode
from suspension_cli.design.paths import format_with_unit
from suspension_cli.design.schema import Design
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.errors import InputError
from suspension_cli.files.declared import NOT_STORED, along, in_unit, scale_of
from suspension_cli.grids import parse_frequencies
from suspension_cli.linear import named_results
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.mode_pairing import pair_by_overlap
from suspension_cli.models.registry import AUTO, MODELS, Choice

if TYPE_CHECKING:
    from jaxtyping import Complex, Float

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

    label: tuple[str, ...] = field(metadata=scale_of("mode"))
    frequency: Float[np.ndarray, "mode item"] = field(metadata=in_unit("Hz"))
    q: Float[np.ndarray, "mode item"]
    overlap: Float[np.ndarray, "mode item"]


@dataclass(frozen=True)
class Overlay:
    """Curves of one quantity; the first is the reference. A noise has no input.

    `source` are the results of the curves by item, to draw these between their points; empty for
    stored comparisons.
    """

    kind: str
    output: str
    input: str
    unit: str
    curves: tuple[Curve, ...]
    source: dict[int, Result] = field(
        default_factory=dict, repr=False, compare=False, metadata=NOT_STORED
    )

    @property
    def name(self) -> str:
        """Name: ``test.x / support.x``."""
        return f"{self.output} / {self.input}" if self.input else f"noise of {self.output}"


@dataclass(frozen=True)
class Comparison:
    """Differences between items.

    Each has a name, a kind ("design", "result" or "measurement"), a model ("" for measurements) and
    the keys in which its design differs from the first design.
    """

    name: tuple[str, ...] = field(metadata=scale_of("item"))
    kind: tuple[str, ...] = field(metadata=along("item"))
    model: tuple[str, ...] = field(metadata=along("item"))
    changes: tuple[Change, ...] = field(metadata=along("change"))
    modes: PairedModes | None
    overlay: tuple[Overlay, ...]

    @property
    def change(self) -> tuple[tuple[Change, ...], ...]:
        """Changes of each item."""
        return tuple(
            tuple(one for one in self.changes if one.item == n) for n in range(len(self.name))
        )


class _Analyses:
    """Results of analyses by item: those read from files, and those computed for designs.

    `choices` are the models of each item.
    """

    def __init__(self, items: Sequence[Item], run: Run) -> None:
        self.items, self.setting, self.log = items, run.setting, RelayedLog(run.log)
        self.choices = [[item.result.choice] if item.result else [] for item in items]

    def compute(self, name: str, **given: object) -> dict[int, Result]:
        """Run an analysis for all designs with the most complete model that one needs."""
        analysis = registry.get(name)

        def one(run: Run, level: str) -> Result:
            own = dict(fidelity=level, tolerance=self.setting["tolerance"], as_json=True, **given)
            setting = settings.defaults(analysis, own)
            with run.faults():
                return analysis.solve(dataclasses.replace(run, setting=setting, log=self.log))

        runs = {n: item.run for n, item in enumerate(self.items) if item.run is not None}
        found = {n: one(run, self.setting["fidelity"]) for n, run in runs.items()}
        top = max(
            (result.choice.model for result in found.values()), key=MODELS.index, default=None
        )
        for n, run in runs.items():
            if top and found[n].choice.model is not top and not top.unsuitable(run.design):
                found[n] = one(run, top.name)
            self.choices[n].append(found[n].choice)
        return found

    @property
    def models(self) -> list[str]:
        """Most complete of the models of each item; "" of measurements."""
        order = [model.name for model in MODELS]
        levels = ([choice.level for choice in own] for own in self.choices)
        return [max(own, key=order.index, default="") for own in levels]

    @property
    def choice(self) -> Choice:
        """All models, with the largest error and the physics neglected there."""
        reason, error = "as the designs need it", np.nan
        choices = [choice for own in self.choices for choice in own]
        if choices:
            worst = max(choices, key=lambda one: np.inf if np.isnan(one.error) else one.error)
            reason, error = "; ".join(filter(None, (reason, worst.neglected))), worst.error
        return Choice(", ".join(sorted({*self.models} - {""})), reason, error)


def solve(items: Sequence[Item], run: Run) -> tuple[Comparison, Choice]:
    """Analyse the designs among the items, and compare all items.

    Modes are compared if designs or measured modes are given, responses and noises if a result, a
    measurement or the setting names them. All designs have the most complete model that one of them
    needs.

    Returns
    -------
    comparison : Comparison
    choice : Choice
        The models of all items, with the largest of their estimated errors.

    Raises
    ------
    InputError
        With the faults of a design or of a setting.
    """
    texts = [item.source.text if item.source else None for item in items]
    first = next(text for text in texts if text is not None)
    analyses = _Analyses(items, run)
    modes = _modes(items, analyses)
    overlay = tuple(_overlays(items, analyses))
    found = Comparison(
        name=tuple(item.name for item in items),
        kind=tuple(item.kind for item in items),
        model=tuple(analyses.models),
        changes=tuple(
            dataclasses.replace(change, item=n)
            for n, text in enumerate(texts)
            if text is not None and text is not first
            for change in find_changes(first, text)
        ),
        modes=modes,
        overlay=overlay,
    )
    return found, analyses.choice


def find_changes(before: str, after: str) -> list[Change]:
    """List the keys in which two designs (TOML) differ; a stage in only one of them is one change.

    >>> find_changes("constants.gravity = 9.81", "constants.gravity = 9.8")
    [Change(path='constants.gravity', before='9.81 m/s^2', after='9.8 m/s^2')]
    """
    documents = [tomllib.loads(text) for text in (before, after)]
    names = [{stage["name"] for stage in one.get("stage", ())} for one in documents]
    first, second = (_flatten(document, names[0] ^ names[1]) for document in documents)
    return [
        Change(path, _format_value(path, first.get(path)), _format_value(path, second.get(path)))
        for path in dict.fromkeys((*first, *second))
        if first.get(path) != second.get(path)
    ]


def _flatten(document: Document, alone: set[str]) -> dict[str, object]:
    """Collect values by dotted path; stages that are `alone` are one value."""
    kept = {key: value for key, value in document.items() if key not in OTHER_TABLES}
    values = dict(_values(kept))
    whole = {
        path: f"stage.{name}"
        for path in values
        for name in alone
        if path.startswith(f"stage.{name}.")
    }
    return {whole.get(path, path): "a stage" if path in whole else values[path] for path in values}


def _values(value: object, path: str = "") -> Iterator[tuple[str, object]]:
    """List dotted paths and values; tables in lists by name or number."""
    if isinstance(value, dict):
        for key, item in value.items():
            yield from _values(item, f"{path}.{key}".strip("."))
    elif isinstance(value, list) and any(isinstance(item, dict) for item in value):
        for n, item in enumerate(value, 1):
            yield from _values(item, f"{path}.{item.get('name', n)}")
    else:
        yield path, value


def _format_value(path: str, value: object) -> str:
    if value is None:
        return MISSING
    if isinstance(value, list):
        return ", ".join(_format_value(path, item) for item in value)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return str(value).lower() if isinstance(value, bool) else str(value)
    return format_with_unit(path, value, digits=10)


def _modes(items: Sequence[Item], analyses: _Analyses) -> PairedModes | None:
    results = {n: item.result for n, item in enumerate(items) if item.result is not None}
    stored = {n: result for n, result in results.items() if result.analysis.name == "modes"}
    alone = not stored and not any(item.modes for item in items)
    if alone and sum(item.run is not None for item in items) < 2:
        return None
    found = stored | analyses.compute("modes")
    if not found:
        return None
    wires = bool(stored) or analyses.setting["fidelity"] != AUTO
    pairs = {n: (result.data, result.design) for n, result in sorted(found.items())}
    return pair_modes(pairs, items, wires=wires)


def pair_modes(
    found: dict[int, tuple[Modes, Design]], items: Sequence[Item], *, wires: bool = True
) -> PairedModes:
    """Pair the modes of designs by shape, and measured modes by label or frequency.

    `found` are the modes and the design of each item with a design; `wires` is whether to list
    modes of wires.
    """
    names = {n: named_results.labels(modes) for n, (modes, _) in found.items()}
    listed = {
        n: np.flatnonzero(wires | (modes.order == 0)).tolist() for n, (modes, _) in found.items()
    }
    reference = next(iter(found))
    # rows of modes of the reference by their number there, then further ones: (mode, overlap)
    rows: dict[int, dict[int, tuple[int, float]]] = {
        m: {reference: (m, 1.0)} for m in listed[reference]
    }
    further: list[dict[int, tuple[int, float]]] = []
    for n in [n for n in found if n != reference]:
        overlap = _shape_overlap(*found[reference], *found[n])
        partner = pair_by_overlap(overlap).tolist()
        free = {*listed[n]}
        for m, row in rows.items():
            if partner[m] in free and overlap[m, partner[m]] > LEAST_OVERLAP:
                row[n] = partner[m], float(overlap[m, partner[m]])
                free.discard(partner[m])
        by_name = {names[reference][m]: row for m, row in rows.items()}
        for k in sorted(free):
            row = by_name.get(names[n][k]) if found[n][0].order[k] else None
            if row is None or n in row:
                further.append(row := {})
            row[n] = k, np.nan
    labels, every = [], [*rows.values(), *further]
    values = np.full((3, len(every), len(items)), np.nan)
    for place, row in enumerate(every):
        n, (m, _) = next(iter(row.items()))
        labels.append(names[n][m])
        for i, (k, overlap) in row.items():
            modes = found[i][0]
            values[:, place, i] = modes.frequency[k], modes.q[k], overlap
    table = PairedModes(tuple(labels), *values)
    for n, item in enumerate(items):
        for mode in item.modes:
            row = _measured_row(table, mode, n, reference, found[reference][0])
            table.frequency[row, n] = mode.frequency
    # by the first frequency; unstable modes have none
    first = [next((f for f in row if np.isfinite(f)), -np.inf) for row in table.frequency]
    order = np.argsort(first, kind="stable")
    return PairedModes(tuple(labels[i] for i in order), *values[:, order])


def _measured_row(table: PairedModes, mode: Mode, n: int, reference: int, base: Modes) -> int:
    """Find the row of a measured mode, by label, else the free row nearest in frequency."""
    free = np.isnan(table.frequency[:, n])
    alike = [mode.label in (label, label.partition("#")[0]) for label in table.label]
    labelled = np.array(alike) & free
    if mode.dof and not mode.label:
        wanted = {dof for _, dof in base.home} & set(mode.dof)
        suited = np.array([any(dof in label for dof in wanted) for label in table.label]) & free
        free = suited if suited.any() else free
    allowed = labelled if labelled.any() else free
    away = np.abs(table.frequency[:, reference] - mode.frequency)
    return int(np.nanargmin(np.where(allowed & np.isfinite(away), away, np.inf)))


def _shape_overlap(
    first: Modes, design: Design, second: Modes, other: Design
) -> Float[np.ndarray, "first second"]:
    """Overlaps in bodies of the same name, or of the same number if there is none."""
    one, two = _weighted_shapes(first, design), _weighted_shapes(second, other)
    common = [name for name in first.body if name in second.body]
    mine, theirs = ([modes.body.index(name) for name in common] for modes in (first, second))
    if not common:
        mine = theirs = list(range(min(len(first.body), len(second.body))))
    return np.abs(np.einsum("mbi,nbi->mn", one[:, mine], two[:, theirs]))


def _weighted_shapes(modes: Modes, design: Design) -> Float[np.ndarray, "mode body 6"]:
    """Shapes in the motion of bodies, times L^T of each; of unit norm if only bodies move."""
    bodies, count = expand(design).bodies, len(modes.body)
    shape = modes.shape[:, : 6 * count].reshape(-1, count, 6).copy()
    shape[..., :3] *= np.sqrt(bodies.mass)[:, None]
    shape[..., 3:] = np.einsum("mbi,bij->mbj", shape[..., 3:], np.linalg.cholesky(bodies.inertia))
    return shape


def _overlays(items: Sequence[Item], analyses: _Analyses) -> Iterator[Overlay]:
    """Compare the responses, then the noises, of items and of the setting."""
    setting, wanted = analyses.setting, [what for item in items for what in item.curves]
    if setting["inputs"] or setting["outputs"]:
        first = next(item.source for item in items if item.source is not None)
        outputs = setting["outputs"] or (f"{mirror(first.design)}.x",)
        inputs = setting["inputs"] or ("support.x",)
        wanted += [Quantity("response", out, into) for out in outputs for into in inputs]
    wanted += [Quantity("noise", out, "") for out in setting["noises"]]
    for what in sorted(dict.fromkeys(wanted), key=lambda one: one.kind == "noise"):
        curves = {n: item.curves[what] for n, item in enumerate(items) if what in item.curves}
        given = {"outputs": (what.output,), "frequency": _grid(items, curves, setting["frequency"])}
        try:
            if what.kind == "response":
                solved = analyses.compute("response", inputs=(what.input,), **given)
            else:
                solved = analyses.compute("thermal", **given)
        except InputError as error:
            option = "--noise" if what.kind == "noise" else "--output"
            faults = [
                dataclasses.replace(fault, key=option) if fault.key == "--output" else fault
                for fault in error.faults
            ]
            raise InputError(faults, error.file) from None
        curves |= {n: next(iter(curves_of(result).values())) for n, result in solved.items()}
        if curves:
            unit = next(reversed(curves.values()))[1]
            own = {n: dataclasses.replace(curve, item=n) for n, (curve, _) in curves.items()}
            stored = {n: result for n in curves if (result := items[n].result) is not None}
            yield Overlay(*what, unit, _with_ratios(items, own), stored | solved)


def _grid(items: Sequence[Item], curves: dict[int, tuple[Curve, str]], frequency: str) -> str:
    """List the frequencies of all data, at which designs are computed.

    Measured data are drawn with curves on the grid of the command between them.
    """
    points = [curve.frequency for curve, _ in curves.values()]
    if all(items[n].kind == "measurement" for n in curves):
        points.append(np.array(parse_frequencies(frequency)))
    return ",".join(repr(float(x)) for x in np.unique(np.concatenate(points)))


def _with_ratios(items: Sequence[Item], curves: dict[int, Curve]) -> tuple[Curve, ...]:
    """Order curves; the first, of a design or result if there is one, is the reference."""
    order = sorted(curves, key=lambda n: (items[n].kind == "measurement", n))
    reference, *others = (curves[n] for n in order)
    return (reference, *(with_ratio(curve, reference) for curve in others))


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
    known, value = np.log(curve.frequency), curve.value
    with np.errstate(divide="ignore"):
        size = np.interp(np.log(frequency), known, np.log(np.abs(value)))
    phase = np.interp(np.log(frequency), known, np.unwrap(np.angle(value)))
    result = np.exp(size + 1j * phase)
    _, mine, theirs = np.intersect1d(frequency, curve.frequency, return_indices=True)
    result[mine] = value[theirs]
    return result
