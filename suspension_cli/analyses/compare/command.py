"""`pendsus compare`: differences between designs, results and measurements."""

from __future__ import annotations

import contextlib
import math
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from suspension_cli.analyses import options, tables
from suspension_cli.analyses.analysis import Analysis, Document, Run, Settings
from suspension_cli.analyses.options import argument
from suspension_cli.grids import are_few

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from suspension_cli.analyses.compare.compared_quantities import (
        ComparedQuantities,
        ItemVerdict,
    )
    from suspension_cli.analyses.compare.solve import Comparison, Overlay, PairedModes

MIXED = 0.9
"""Overlap of two shapes below which the table notes a difference."""
MANY = 20
"""Most printed changes of a design."""
ROUNDED = 5e-4
"""Change of a frequency, %, below which it is printed as 0: the five digits of the frequencies
beside it do not show it. JSON and files have all digits."""
RATIO_ROWS = {"frequency\nHz": tables.AS_GIVEN, "ratio": "#.4g"}
"""Columns of the table of a ratio at a few frequencies."""


class CompareAnalysis(Analysis):
    """Compare designs, results and measurements: modes, quantities, responses, noises.

    Each ITEM is a design (.toml), a results file (.h5) of modes, response or thermal, or a
    measurement (.toml with [[transfer_function]], [[mode]] or [[quantity]], .csv, DTT .xml, HDF5).
    Prints the numbers in which the designs differ, their modes paired by shape, the quantities of
    --result and of the designs' requirements with verdicts, and the ratios of responses and noises
    to those of the first design or result. A --variant is the first design with some values
    changed. Control loops of designs are open in responses and noises. Writes
    DIR/NAME-and-NAME-compare.h5 and .png.

    Example: pendsus compare my.toml new.toml --input support.x --output test.x

    Example: pendsus compare my.toml new.toml --result "thermal test.x:10"

    Example: pendsus compare my.toml --variant "d = 3 mm: stage.test.wires.d=3e-3"

    Returns
    -------
    Comparison
        With `name`, `kind` and `models` of each item, `change`, `modes`, `quantities`, `overlay`.

    Raises
    ------
    InputError
        If fewer than two things are given, or a file is at fault.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> design = sus.example("double")
    >>> lower = design.replace({"stage.test.wires.d": 0.0005})
    >>> found = sus.compare(design, lower, fidelity="string")
    >>> [change.words for change in found.change[1]], found.modes.frequency.shape
    (['test wires d'], (12, 2))
    """

    name = "compare"
    result_type = "analyses.compare.solve.Comparison"
    arguments = (argument("items", nargs=-1, required=True, metavar="ITEM ITEM..."),)
    inputs = (
        options.Input(
            "*items",
            "Design | Record | PathLike",
            "Two or more with the variants; files as of ``pendsus compare``. At least one has a"
            " design.",
        ),
    )
    parameters = (
        options.option(
            "--variant",
            "variants",
            multiple=True,
            metavar="NAME: PATH=VALUE; ...",
            help="Add the first design with other values, under a name (repeatable).",
        ),
        options.option(
            "--result",
            "results",
            multiple=True,
            metavar="QUANTITY",
            help=(
                "Compare this quantity (docs/quantities.md): test pitch, Q of test pitch, stress"
                " test wires, thermal test.x:10, ... (repeatable).  [default: those of the designs'"
                " requirements]"
            ),
        ),
        options.signals("input", "Compare responses to this input, e.g. support.x"),
        options.signals("output", "Compare responses of this output, e.g. test.x"),
        options.signals("noise", "Compare the thermal noise of this motion, e.g. test.x"),
        options.frequencies("0.1:100:2000", "Frequencies of responses and noises of designs, Hz."),
        options.ACCURACY,
        *options.WRITING,
    )

    def read(self, ask: Callable[..., Run], files: Settings) -> Run:
        """Read all items for one run, whose options come from the first design."""
        from suspension_cli.analyses.compare import items

        return items.read(ask, files["items"])

    def solve(self, run: Run) -> Comparison:
        """Analyse the designs and compare all items."""
        from suspension_cli.analyses.compare import solve as compare
        from suspension_cli.files.hdf5 import reporting_damage

        items = run.inputs["items"]
        damage = contextlib.nullcontext()
        if stored := " or ".join(item.result.run.design.file for item in items if item.result):
            # whose numbers, unlike those of designs, nobody has checked
            damage = reporting_damage(stored, "run the analysis again")
        with damage:
            found = compare.solve(self, items, run)
        opened = [i.name for i in items if i.run and i.source and i.source.design.control]
        if found.overlay and opened:
            run.log.say(
                f"control loops of {', '.join(opened)} are open; for closed loops compare results"
                " of pendsus response --closed-loop"
            )
        return found

    def document(self, result: Comparison) -> Document:
        """Add changed numbers, verdicts and reasons by design, and curves with their ratios."""
        from suspension_cli.files import documents

        document: Document = super().document(result) | {"designs": list(result.name)}
        for row in document["items"]:
            row["fidelity"] = row["fidelity"] or None
        document["changes"] = {
            name: [documents.document(one) for one in changes]
            for name, changes in zip(result.name, result.change, strict=True)
            if changes
        }
        if result.quantities is not None:
            for number, row in enumerate(document["quantities"]):
                row |= _judge(result, result.quantities, number)
        for key, kind in (("responses", "response"), ("noises", "noise")):
            document[key] = [_overlay(result, one) for one in result.overlay if one.kind == kind]
        return document

    def text(self, result: Comparison) -> str:
        """Return models and what they neglect, changed numbers, modes, quantities and ratios."""
        from suspension_cli.models.registry import NOTHING

        choice = result.run.choice
        kinds = zip(result.name, result.kind, result.models, strict=True)
        items = [f"{n}: {k}" + (f", {m} model" if m else "") for n, k, m in kinds]
        neglected = choice.neglected or NOTHING * (choice.error == 0)
        lines = ["; ".join(filter(None, (*items, neglected))), *_changes(result)]
        if result.modes is not None:
            lines += _pairs(result, result.modes)
        if result.quantities is not None:
            lines += _tabulate(result, result.quantities)
        return "\n".join([*lines, *(row for one in result.overlay for row in _ratios(result, one))])

    def figures(self, result: Comparison, setting: Settings) -> dict[str, Figure]:
        """Draw changes of modes and of quantities, and responses and noises with their ratios."""
        import numpy as np

        from suspension_cli.analyses.compare import picture

        figures = {}
        if result.modes is not None:
            figures[""] = picture.draw_modes(result, result.modes)
        if result.quantities is not None and np.isfinite(result.quantities.change).any():
            figures["-quantities" if figures else ""] = picture.draw_quantities(
                result, result.quantities
            )
        for overlay in result.overlay:
            stem = "-" + re.sub(r"[^A-Za-z0-9.]+", "-", overlay.name).strip("-")
            figures[stem if figures else ""] = picture.draw_overlay(result, overlay)
        return figures

    def path(self, result: Comparison, folder: Path) -> Path:
        """Path of the results file, named after the first two items."""
        names = [re.sub(r"[^A-Za-z0-9._-]+", "-", name).strip("-") for name in result.name]
        more = f"-and-{len(names) - 2}-more" if len(names) > 2 else ""
        stem = result.run.design.stem(f"{names[0]}-and-{names[1]}{more}")
        return folder / f"{stem}-{self.stem}.h5"


def _overlay(found: Comparison, overlay: Overlay) -> Document:
    import numpy as np

    response = overlay.kind == "response"

    def columns(value: Any) -> Document:
        return {"imag": np.imag(value)} if response else {}

    curves = [
        {
            "name": found.name[curve.item],
            "frequency_hz": curve.frequency,
            "real" if response else "displacement_asd": np.real(curve.value),
            **columns(curve.value),
            "ratio": {
                "frequency_hz": curve.ratio_frequency,
                "real": np.real(curve.ratio),
                **columns(curve.ratio),
            },
        }
        for curve in overlay.curves
    ]
    head = {"output": overlay.output} | ({"input": overlay.input} if response else {})
    reference = found.name[overlay.curves[0].item]
    return head | {"unit": overlay.unit, "reference": reference, "curves": curves}


def _judge(found: Comparison, quantities: ComparedQuantities, row: int) -> Document:
    """Return the verdicts on a quantity, and reasons of missing values, if there are any."""
    judged = [
        {"design": found.name[one.item], "requirement": one.description}
        | {"note": one.note, "met": one.met, "margin": one.margin}
        for one in quantities.verdict
        if one.quantity == row
    ]
    missing = {
        found.name[one.item]: one.reason for one in quantities.missing if one.quantity == row
    }
    return ({"requirements": judged} if judged else {}) | ({"missing": missing} if missing else {})


def _tabulate(found: Comparison, quantities: ComparedQuantities) -> list[str]:
    """Return the table of quantities, a row each, and why some designs have none."""
    from suspension_cli.quantities.requirements import displayed_unit

    first, *others = _columns(quantities)
    judged = {one.item for one in quantities.verdict}
    columns: dict[str, str] = {"quantity": "", "unit": ""}
    for n in (first, *others):
        columns[f"{found.name[n]}\n"] = ".5g"
        if n in others:
            columns[f"{found.name[n]}\nchange %"] = "+.3g"
        if n in judged:
            columns[f"{found.name[n]}\nverdict"] = ""
    if judged:
        columns["requirement"] = ""
    rows = []
    for row, name in enumerate(quantities.name):
        unit, factor = displayed_unit(quantities.quantity_unit[row])
        cells: list[float | str | None] = [name, unit]
        for n in (first, *others):
            cells.append(factor * quantities.value[row, n])
            if n in others:
                change = quantities.change[row, n]
                cells.append("0" if abs(change) < ROUNDED else change)
            if n in judged:
                cells.append(_verdict(quantities.verdicts_on(row, n)))
        if judged:
            texts = [one.description for one in quantities.verdict if one.quantity == row]
            cells.append("; ".join(dict.fromkeys(texts)))
        rows.append(cells)
    lines = ["", "quantities", tables.render(columns, rows)]
    for one in quantities.missing:
        name = quantities.name[one.quantity]
        lines.append(f"  {found.name[one.item]} has no value of {name}: {one.reason}")
    return lines


def _columns(quantities: ComparedQuantities) -> list[int]:
    """Numbers of the items that have a value, or a reason why not."""
    import numpy as np

    known = set(np.flatnonzero(np.isfinite(quantities.value).any(0)).tolist())
    return sorted(known | {one.item for one in quantities.missing})


def _verdict(judged: Sequence[ItemVerdict]) -> str:
    """Return ``met`` or ``NOT met``, with the smallest margin; "" without a requirement."""
    if not judged:
        return ""
    outcome = "met" if all(one.met for one in judged) else "NOT met"
    margin = min(one.margin for one in judged)
    return outcome if math.isnan(margin) else f"{outcome} ({100 * margin:+.3g} %)"


def _changes(found: Comparison) -> Iterator[str]:
    first, *others = (n for n, kind in enumerate(found.kind) if kind != "measurement")
    for n in others:
        heads = [found.name[first], found.name[n]]
        changes = found.change[n]
        none = "" if changes else ": none"
        yield from ("", f"numbers that differ between {' and '.join(heads)}{none}")
        if changes:
            rows = [(change.words, change.before, change.after) for change in changes[:MANY]]
            yield tables.render(dict.fromkeys(["", *heads], ""), rows)
        if len(changes) > MANY:
            yield f"  and {len(changes) - MANY} more, which --json lists"


def _pairs(found: Comparison, modes: PairedModes) -> list[str]:
    import numpy as np

    first, *others = np.flatnonzero(np.isfinite(modes.frequency).any(0)).tolist()
    columns = {f"{found.name[first]}\nHz": "#.5g"}
    for n in others:
        columns |= {f"{found.name[n]}\nHz": "#.5g", f"{found.name[n]}\nchange %": "+.3g"}
    rows = []
    for m, label in enumerate(modes.label):
        row: list[float | str | None] = [modes.frequency[m, first]]
        for n in others:
            change = 100 * (modes.frequency[m, n] / modes.frequency[m, first] - 1)
            row += [modes.frequency[m, n], "0" if abs(change) < ROUNDED else change]
        poor = ", ".join(found.name[n] for n in others if modes.overlap[m, n] < MIXED)
        rows.append((*row, f"{label}; shape differs in {poor}" if poor else label))
    return ["", "modes, paired by shape", tables.render(columns | {"mode": ""}, rows)]


def _ratios(found: Comparison, overlay: Overlay) -> Iterator[str]:
    import numpy as np

    kind = "thermal " if overlay.kind == "noise" else ""
    yield from ("", f"{kind}{overlay.name} ({overlay.unit})")
    reference = found.name[overlay.curves[0].item]
    if zero := ", ".join(found.name[one.item] for one in overlay.curves if not one.value.any()):
        yield f"  0 by symmetry: {zero}"
        return
    if len(overlay.curves) == 1:
        yield f"  only {reference} has it: nothing to compare with"
    for curve in overlay.curves[1:]:
        size = np.abs(curve.ratio)
        known = np.isfinite(size) & (size > 0)
        f = curve.ratio_frequency[known]
        size = size[known]
        text = "no frequency in common"
        if len(f):
            worst = int(np.argmax(np.abs(np.log(size))))
            ends = [] if are_few(f) else [f"{size[n]:.4g} at {f[n]:.4g} Hz, " for n in (0, -1)]
            text = (
                f"median {np.median(size):.4g}, {''.join(ends)}"
                f"farthest from 1: {size[worst]:.4g} at {f[worst]:.5g} Hz"
            )
        yield f"  {found.name[curve.item]} / {reference}: {text}"
        if len(f) and are_few(f):
            yield tables.render(RATIO_ROWS, [*zip(f, size, strict=True)])


ANALYSIS = CompareAnalysis()
