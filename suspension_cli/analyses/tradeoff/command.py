"""`pendsus tradeoff`: time and error of every model and method for a design."""

from __future__ import annotations

import time
from dataclasses import asdict
from typing import TYPE_CHECKING

import click

from suspension_cli.analyses import options, tables
from suspension_cli.analyses.analysis import (
    Analysis,
    Document,
    Result,
    Run,
    Settings,
    as_number,
    plain,
)
from suspension_cli.analyses.options import option
from suspension_cli.errors import Fault, InputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from suspension_cli.analyses.tradeoff.result import Entry, Panel, ResponseTimes, Tradeoff
    from suspension_cli.analyses.tradeoff.summary import Answer
    from suspension_cli.design.schema import Design

NAMES = ("modes", "response", "thermal", "coupling", "equilibrium")
"""Copy of `comparisons.QUANTITIES`, whose import would delay the help."""
REPEAT = 7


class TradeoffAnalysis(Analysis):
    """Measure speed and accuracy of every model and every method, for one design.

    Models are compared with the most complete valid one, methods with 50-digit arithmetic in the
    same model. Times are processor times, measured in turns. Prints for each question the fastest
    model or method that is accurate enough; with -v all times and errors. Writes
    DIR/NAME-tradeoff.h5, .png (which model to use), -models.png, -methods-once.png and
    -methods-batch.png (all comparisons).

    Example: pendsus tradeoff my.toml --quantity modes

    Returns
    -------
    Result
        With the attributes of `analyses.tradeoff.result.Tradeoff`: `panels`, `waits`, ...

    Raises
    ------
    InputError
        If the equilibrium is unstable.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> found = sus.tradeoff(sus.template("single"), quantities="modes", repeat=2)
    >>> [(panel.quantity, panel.compares) for panel in found.panels]
    [('modes', 'models'), ('modes', 'methods')]
    """

    name = "tradeoff"
    has_model = False
    arguments = (options.DESIGN,)
    parameters = (
        option(
            "--quantity",
            "quantities",
            multiple=True,
            type=click.Choice(NAMES),
            help="Compare only for this quantity (repeatable).  [default: all]",
        ),
        option(
            "--repeat",
            type=click.IntRange(2, 1000),
            default=REPEAT,
            show_default=True,
            metavar="N",
            help="Samples of each time (fewer for slow methods).",
        ),
        options.OVERRIDES,
        options.OUT,
        options.NAME,
        options.AS_JSON,
        options.CSV,
        options.PLOT,
        options.FORMAT,
        options.QUIET,
        options.VERBOSE,
    )

    def solve(self, run: Run) -> Result:
        """Measure every model and method."""
        from suspension_cli.analyses.check import warnings
        from suspension_cli.analyses.tradeoff import solve as tradeoff
        from suspension_cli.models.registry import Choice

        _demand_references(run.design)
        with run.log.progress() as bar:
            _demand_stable(run.design)
            began = time.monotonic()
            found = tradeoff.measure(
                run.design,
                run.setting["quantities"],
                run.setting["repeat"],
                lambda done, count: bar(done, count, done / max(time.monotonic() - began, 1e-9)),
            )
        warnings.warn_implausible(run.design, run.log)
        for line in [*table(found).split("\n"), ""]:
            run.log.detail(line)
        choice = Choice("all", "every valid model is compared")
        return Result(self, run.source, choice, found, command=run.command)

    def document(self, result: Result) -> Document:
        """Return all comparisons and answers."""
        from suspension_cli.analyses.tradeoff import summary

        found: Tradeoff = result.data
        return {
            "repeat": found.repeat,
            "threads": found.threads,
            "comparisons": [_comparison(panel) for panel in found.panels],
            "response_times": [_waits(each) for each in found.waits],
            "answers": [_answer(answer) for answer in summary.answers(found)],
        }

    def text(self, result: Result) -> str:
        """Return the headline and one line per question."""
        from suspension_cli.analyses.tradeoff import summary

        return summary.text(result.data)

    def figures(self, result: Result, setting: Settings) -> dict[str, Figure]:
        """Draw advice on the models, and all errors against times."""
        from suspension_cli.analyses.tradeoff import headline, picture

        pages = picture.draw(result.data, result.title)
        if not any(panel.compares == "models" and panel.entries for panel in result.data.panels):
            return pages
        return {"": headline.draw(result.data, result.title), **pages}


def _demand_references(design: Design) -> None:
    from suspension_cli.design.derive import beyond_symmetric_chains

    if reason := beyond_symmetric_chains(design):
        problem = f"the references in 50 digits do not cover this design: {reason}"
        key, remedy = "stage", "use pendsus info, which computes the error of each model"
        if "weight" in reason or "gravity" in reason:
            key = "constants"
            remedy = "remove gravity_gradient and wire_weight, and give gravity as a number"
        raise InputError([Fault(key, problem, remedy)])


def _demand_stable(design: Design) -> None:
    from suspension_cli.analyses.growth import find_growth
    from suspension_cli.models import registry

    grows = find_growth(design, registry.STRING, registry.STRING.system(design))
    if grows is not None:
        problem = grows.fault.problem.replace(":", " in the string model:", 1)
        remedy = f"{grows.fault.remedy}; responses of an unstable design are not compared"
        raise InputError([Fault(grows.fault.key, problem, remedy)])


def _comparison(panel: Panel) -> Document:
    from suspension_cli.analyses.tradeoff.result import KINDS

    labels = [entry.label for entry in panel.entries]
    fronts = [
        {"title": view.title}
        | {kind: [labels[n] for n in panel.front(kind, view)] for kind in KINDS}
        for view in panel.views
    ]
    return {
        "quantity": panel.quantity,
        "compares": panel.compares,
        "time": panel.start,
        "item": panel.item,
        "count": panel.count,
        "reference": panel.reference,
        "entries": [_entry(panel, entry) for entry in panel.entries],
        "left_out": [asdict(item) for item in panel.left],
        "fronts": fronts,
    }


def _waits(each: ResponseTimes) -> Document:
    from suspension_cli.analyses.tradeoff.result import COUNTS, OCCASIONS

    entries = [
        {"model": e.model, "method": e.method, "error": as_number(e.error), "time_s": plain(e.time)}
        for e in each.entries
    ]
    return {
        "compares": each.compares,
        "time": each.start,
        "occasions": list(OCCASIONS),
        "frequencies": list(COUNTS),
        "entries": entries,
    }


def _answer(answer: Answer) -> Document:
    found: Document = {"compares": answer.compares, "question": answer.question}
    for key, one in (("best", answer.best), ("other", answer.other)):
        found[key] = one and {"name": one.name, "time_s": one.time, "error": one.error}
    return found


def _entry(panel: Panel, entry: Entry) -> Document:
    return {
        "model": entry.model,
        "method": entry.method,
        "error": dict(zip(panel.component, plain(entry.error), strict=True)),
        "once_s": entry.once.tolist(),
        "batch_s": entry.batch.tolist(),
        "once_relative": entry.time("once") / panel.fastest("once"),
        "batch_relative": entry.time("batch") / panel.fastest("batch"),
        "vectorised": entry.vectorised,
    }


def table(found: Tradeoff) -> str:
    """Return all times and errors, one part per comparison."""
    from suspension_cli.analyses.tradeoff import summary

    threads = f" on {found.threads} thread" + "s" * (found.threads > 1) if found.threads else ""
    head = (
        f"median times of up to {found.repeat} samples{threads}, relative to the fastest;"
        " quartiles in brackets\n*: no other is both faster and more accurate    o: not vectorised,"
        " so a batch is a loop    kept: prepared beforehand\nerrors are relative; below 1e-12 they"
        " are rounding errors"
    )
    waits = [summary.response_table(found)] if found.waits else []
    return "\n\n".join([head, *map(_table, found.panels), *waits])


def _table(panel: Panel) -> str:
    from suspension_cli.analyses.tradeoff.result import KINDS, format_error, format_time

    lines = [f"{panel.title}: {'models' if panel.compares == 'models' else 'methods'}"]
    if panel.entries:
        fastest = {kind: panel.fastest(kind) for kind in KINDS}
        fronts = {
            kind: {n for view in panel.views for n in panel.front(kind, view)} for kind in KINDS
        }
        lines.append(f"  error against {panel.reference}")
        lines.append(
            f"  time {panel.start}: 1 is {format_time(fastest['once'])} once, and"
            f" {format_time(fastest['batch'])} per {panel.item} in a batch of {panel.count}"
        )
        rows = []
        for n, entry in enumerate(panel.entries):
            times = (_time(entry, kind, fastest[kind], n in fronts[kind]) for kind in KINDS)
            rows.append((entry.label, *times, *map(format_error, entry.error)))
        columns = {"": "", "once": "", "in a batch": "", **dict.fromkeys(panel.component, ".1e")}
        lines.append(tables.render(columns, rows))
    for reason, names in panel.left_out.items():
        lines.append(f"  left out: {', '.join(names)}: {reason}")
    return "\n".join(lines)


def _time(entry: Entry, kind: str, fastest: float, best: bool) -> str:
    """``1.88 (1.82 to 1.93) *``."""
    low, middle, high = (
        f"{value:.3g}" if value < 999.5 else f"{float(f'{value:.3g}'):,.0f}"
        for value in getattr(entry, kind) / fastest
    )
    marks = ("*" if best else "") + ("o" if kind == "batch" and not entry.vectorised else "")
    return f"{middle} ({low} to {high}) {marks}"


ANALYSIS = TradeoffAnalysis()
