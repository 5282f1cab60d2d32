"""Comparison of modes, responses and noises.

Modes of two designs are paired one to one by the overlap of their shapes in the motion of bodies
of the same name, u^T L_a L_b^T v with M = L L^T the mass matrix of each design: 1 for equal
shapes of equal bodies. Violin modes are paired by their labels.
"""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses import registry, settings
from suspension_cli.analyses.analysis import Log, Result, Run
from suspension_cli.analyses.compare.design_changes import Change, find_changes
from suspension_cli.analyses.compare.items import Item
from suspension_cli.design.derive import mirror
from suspension_cli.design.measured import Mode
from suspension_cli.design.schema import Design
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.errors import InputError
from suspension_cli.files.declared import NOT_STORED, along, in_unit, scale_of
from suspension_cli.grids import parse_frequencies
from suspension_cli.linear import named_results
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.mode_pairing import pair_by_overlap
from suspension_cli.models.registry import AUTO, FILES, Choice

if TYPE_CHECKING:
    from jaxtyping import Complex, Float

_Quantity = tuple[str, str, str]
"""Kind ("response" or "noise"), output, and input ("" of a noise)."""
LEAST_OVERLAP = 0.1
"""Overlap of two shapes below which modes are not paired."""


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
class Curve:
    """A response, or amplitude spectral density of a noise, and its ratio to the reference.

    `item` is the number of the item, from 0. Uncertainties are those of measured real and imaginary
    parts; NaN where unknown. The ratio of the reference is empty.
    """

    item: int
    frequency: Float[np.ndarray, " frequency"] = field(metadata=in_unit("Hz"))
    value: Complex[np.ndarray, " frequency"] = field(metadata=in_unit("{unit}"))
    uncertainty: Float[np.ndarray, " frequency"] = field(metadata=in_unit("{unit}"))
    ratio_frequency: Float[np.ndarray, " ratio_frequency"] = field(
        default_factory=lambda: np.zeros(0), metadata=in_unit("Hz")
    )
    ratio: Complex[np.ndarray, " ratio_frequency"] = field(
        default_factory=lambda: np.zeros(0, dtype=complex)
    )


@dataclass(frozen=True)
class Overlay:
    """Curves of one quantity; the first is the reference.

    A noise has no input. `source` are the results of the curves by item, to draw these between
    their points; empty for stored comparisons.
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


class _Silent(Log):
    """Log that prints only warnings, each once."""

    def __init__(self, log: Log) -> None:
        self.log, self.seen = log, set[str]()

    def warn(self, text: str) -> None:
        if text not in self.seen:
            self.seen.add(text)
            self.log.warn(text)


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
    quiet = dataclasses.replace(run, log=_Silent(run.log))
    texts = [item.source.text if item.source else None for item in items]
    first = next(text for text in texts if text is not None)
    choices = [[item.result.choice] if item.result else [] for item in items]
    listed = _modes(items, quiet, choices)
    overlays = tuple(_overlays(items, quiet, choices))
    models = [_most_complete(own) for own in choices]
    found = Comparison(
        name=tuple(item.name for item in items),
        kind=tuple(item.kind for item in items),
        model=tuple(models),
        changes=tuple(
            dataclasses.replace(change, item=n)
            for n, text in enumerate(texts)
            if text is not None and text is not first
            for change in find_changes(first, text)
        ),
        modes=listed,
        overlay=overlays,
    )
    return found, _common_choice(models, [choice for own in choices for choice in own])


def _most_complete(choices: Sequence[Choice]) -> str:
    """Name the most complete of the models; "" if there is none."""
    return max((choice.level for choice in choices), key=[*FILES].index, default="")


def _common_choice(models: Sequence[str], choices: Sequence[Choice]) -> Choice:
    """Name all models, with the largest error and the physics neglected there."""
    reason, error = "as the designs need it", np.nan
    if choices:
        worst = max(choices, key=lambda one: np.inf if np.isnan(one.error) else one.error)
        reason, error = "; ".join(filter(None, (reason, worst.neglected))), worst.error
    return Choice(", ".join(sorted({*models} - {""})), reason, error)


def _results(
    name: str, items: Sequence[Item], run: Run, choices: list[list[Choice]], **given: object
) -> dict[int, Result]:
    """Run an analysis for all designs with the most complete model that one needs."""
    from suspension_cli.models import registry as known

    def one(item: Item, level: str) -> Result:
        assert item.run is not None
        own = dict(fidelity=level, tolerance=run.setting["tolerance"], as_json=True, **given)
        setting = settings.defaults(analysis, own)
        with item.run.faults():
            return analysis.solve(dataclasses.replace(item.run, setting=setting, log=run.log))

    analysis, wanted = registry.get(name), run.setting["fidelity"]
    found = {n: one(item, wanted) for n, item in enumerate(items) if item.run is not None}
    chosen = {result.choice.model for result in found.values()}
    top = max(chosen, key=known.MODELS.index, default=None)
    for n, result in found.items():
        item = items[n]
        assert item.source is not None
        assert top is not None
        if result.choice.model is not top and not top.unsuitable(item.source.design):
            found[n] = one(item, top.name)
        choices[n].append(found[n].choice)
    return found


def _modes(items: Sequence[Item], run: Run, choices: list[list[Choice]]) -> PairedModes | None:
    results = {n: item.result for n, item in enumerate(items) if item.result is not None}
    stored = {n: result for n, result in results.items() if result.analysis.name == "modes"}
    alone = not stored and not any(item.modes for item in items)
    if alone and sum(item.run is not None for item in items) < 2:
        return None
    found = stored | _results("modes", items, run, choices)
    if not found:
        return None
    wires = bool(stored) or run.setting["fidelity"] != AUTO
    pairs = {n: (result.data, result.design) for n, result in sorted(found.items())}
    return pair_modes(pairs, items, wires=wires)


def pair_modes(
    found: dict[int, tuple[Modes, Design]], items: Sequence[Item], *, wires: bool = True
) -> PairedModes:
    """Pair the modes of designs by shape, and measured modes by label or frequency.

    `found` are the modes and the design of each item with a design; `wires` is whether to list
    modes of wires.
    """
    (reference, (base, _)), *others = found.items()
    shapes = {n: _Bodies(modes, design) for n, (modes, design) in found.items()}

    def listed(modes: Modes) -> list[int]:
        return np.flatnonzero(wires | (modes.order == 0)).tolist()

    rows: list[dict[int, tuple[int, float]]] = [{reference: (m, 1.0)} for m in listed(base)]
    for n, (modes, _) in others:
        overlap = shapes[reference].overlap(shapes[n])
        free, partners = set(listed(modes)), pair_by_overlap(overlap)
        for row in rows:
            if reference not in row:
                continue
            m = row[reference][0]
            partner = int(partners[m])
            if partner in free and overlap[m, partner] > LEAST_OVERLAP:
                row[n] = (partner, float(overlap[m, partner]))
                free.discard(partner)
        for k in sorted(free):
            alike = (
                row
                for row in rows
                if n not in row
                and reference in row
                and base.label[row[reference][0]] == modes.label[k]
            )
            row = next(alike, None) if modes.order[k] else None
            if row is None:
                rows.append(row := {})
            row[n] = (k, np.nan)
    labels, values = [], np.full((3, len(rows), len(items)), np.nan)
    for place, row in enumerate(rows):
        n, (m, _) = next(iter(row.items()))
        labels.append(named_results.labels(found[n][0])[m])
        for i, (k, shape) in row.items():
            modes = found[i][0]
            values[:, place, i] = modes.frequency[k], modes.q[k], shape
    table = PairedModes(tuple(labels), *values)
    for n, item in enumerate(items):
        for mode in item.modes:
            table.frequency[_measured_row(table, mode, n, reference, base), n] = mode.frequency
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
        names = {(body, dof) for body, dof in base.home}
        wanted = {dof for _, dof in names} & set(mode.dof)
        suited = np.array([any(dof in label for dof in wanted) for label in table.label]) & free
        free = suited if suited.any() else free
    allowed = labelled if labelled.any() else free
    away = np.abs(table.frequency[:, reference] - mode.frequency)
    return int(np.nanargmin(np.where(allowed & np.isfinite(away), away, np.inf)))


class _Bodies:
    """Shapes of modes in the motion of bodies, of unit norm if only bodies move."""

    def __init__(self, modes: Modes, design: Design) -> None:
        bodies = expand(design).bodies
        self.names = modes.body
        self.shape = np.zeros((len(modes.q), len(self.names), 6))
        for b in range(len(self.names)):
            part = modes.shape[:, 6 * b : 6 * b + 6]
            root = np.linalg.cholesky(bodies.inertia[b])
            self.shape[:, b, :3] = np.sqrt(bodies.mass[b]) * part[:, :3]
            self.shape[:, b, 3:] = part[:, 3:] @ root

    def overlap(self, other: _Bodies) -> Float[np.ndarray, "mode other"]:
        """Compute overlaps in bodies of the same name, or of the same number if there is none."""
        common = [name for name in self.names if name in other.names]
        if common:
            mine = [self.names.index(name) for name in common]
            theirs = [other.names.index(name) for name in common]
        else:
            mine = theirs = list(range(min(len(self.names), len(other.names))))
        count = 6 * len(mine)
        rows = self.shape[:, mine].reshape(-1, count)
        columns = other.shape[:, theirs].reshape(-1, count)
        return np.abs(rows @ columns.T)


def _collect_curves(
    items: Sequence[Item],
) -> tuple[dict[_Quantity, dict[int, Curve]], dict[_Quantity, str]]:
    """Collect the curves of measurements and results by quantity and item, and units."""
    data: dict[_Quantity, dict[int, Curve]] = {}
    units: dict[_Quantity, str] = {}
    for n, item in enumerate(items):
        for one in item.responses:
            key = ("response", one.output, one.input)
            data.setdefault(key, {})[n] = Curve(n, one.frequency, one.value, one.uncertainty)
            units.setdefault(key, one.unit)
        if item.result is not None:
            for key, curve, unit in _computed_curves(n, item.result):
                data.setdefault(key, {})[n] = curve
                units[key] = unit
    return data, units


def _computed_curves(n: int, result: Result) -> Iterator[tuple[_Quantity, Curve, str]]:
    """List the curves of a result, which have no uncertainty."""
    found, name = result.data, result.analysis.name
    if name == "response":
        unknown = np.full(len(found.frequency), np.nan)
        for o, out in enumerate(found.output):
            for i, into in enumerate(found.input):
                curve = Curve(n, found.frequency, found.value[:, o, i], unknown)
                yield (name, out, into), curve, found.unit[o][i]
    elif name == "thermal":
        for noise in found:
            unknown, value = np.full(len(noise.frequency), np.nan), noise.amplitude.astype(complex)
            curve = Curve(n, noise.frequency, value, unknown)
            yield ("noise", noise.output, ""), curve, f"{noise.unit}/sqrt(Hz)"


def _overlays(items: Sequence[Item], run: Run, choices: list[list[Choice]]) -> Iterator[Overlay]:
    """Compare the responses, then the noises, of items and of the setting."""
    (data, units), setting = _collect_curves(items), run.setting
    if setting["inputs"] or setting["outputs"]:
        first = next(item.source for item in items if item.source is not None)
        for out in setting["outputs"] or (f"{mirror(first.design)}.x",):
            for into in setting["inputs"] or ("support.x",):
                data.setdefault(("response", out, into), {})
    for out in setting["noises"]:
        data.setdefault(("noise", out, ""), {})
    for (kind, out, into), curves in sorted(data.items(), key=lambda one: one[0][0] == "noise"):
        name, option, inputs = "response", "--output", {"inputs": (into,)}
        if kind == "noise":
            name, option, inputs = "thermal", "--noise", {}
        with _option_named(option):
            grid = _grid(items, curves, run)
            given = inputs | {"outputs": (out,), "frequency": grid}
            solved = _results(name, items, run, choices, **given)
        for n, result in solved.items():
            _, curves[n], units[kind, out, into] = next(_computed_curves(n, result))
        if curves:
            stored = {n: items[n].result for n in curves}
            source = {n: one for n, one in stored.items() if one and one.analysis.name == name}
            unit, ordered = units.get((kind, out, into), ""), _with_ratios(items, curves)
            yield Overlay(kind, out, into, unit, ordered, source | solved)


@contextlib.contextmanager
def _option_named(option: str) -> Iterator[None]:
    """Attribute faults of `--output` to the option that gave the signal."""
    try:
        yield
    except InputError as error:
        named = {"--output": option}
        faults = [
            dataclasses.replace(fault, key=named.get(fault.key, fault.key))
            for fault in error.faults
        ]
        raise InputError(faults, error.file) from None


def _grid(items: Sequence[Item], curves: dict[int, Curve], run: Run) -> str:
    """List the frequencies of all data, at which designs are computed.

    Measured data are drawn with curves on the grid of the command between them.
    """
    points = [curve.frequency for curve in curves.values()]
    if all(items[n].kind == "measurement" for n in curves):
        points.append(np.array(parse_frequencies(run.setting["frequency"])))
    return ",".join(repr(float(x)) for x in np.unique(np.concatenate(points)))


def _with_ratios(items: Sequence[Item], curves: dict[int, Curve]) -> tuple[Curve, ...]:
    """Order curves; the first, of a design or result if there is one, is the reference."""
    order = sorted(curves, key=lambda n: (items[n].kind == "measurement", n))
    reference = curves[order[0]]
    return (
        reference,
        *(dataclasses.replace(curves[n], **_ratio(curves[n], reference)) for n in order[1:]),
    )


def _ratio(curve: Curve, reference: Curve) -> dict[str, np.ndarray]:
    """Compute the ratio at common frequencies; if these are few, interpolate the reference."""
    common, mine, theirs = np.intersect1d(curve.frequency, reference.frequency, return_indices=True)
    if 2 * len(common) >= min(len(curve.frequency), len(reference.frequency)):
        frequency, value, below = common, curve.value[mine], reference.value[theirs]
    else:
        inside = (curve.frequency >= reference.frequency[0]) & (
            curve.frequency <= reference.frequency[-1]
        )
        frequency, value = curve.frequency[inside], curve.value[inside]
        below = interpolate(frequency, reference)
    with np.errstate(divide="ignore", invalid="ignore"):
        return {"ratio_frequency": frequency, "ratio": value / below}


def interpolate(
    frequency: Float[np.ndarray, " point"], curve: Curve
) -> Complex[np.ndarray, " point"]:
    """Interpolate ln magnitude, and phase, over ln frequency."""
    with np.errstate(divide="ignore"):
        x, at = np.log(curve.frequency), np.log(frequency)
        size = np.interp(at, x, np.log(np.abs(curve.value)))
    phase = np.interp(at, x, np.unwrap(np.angle(curve.value)))
    return np.exp(size + 1j * phase)
