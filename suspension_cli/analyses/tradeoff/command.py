"""`pendsus tradeoff`: time and error of each model for a design, and which one to use."""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING

import click

from suspension_cli.analyses import options, tables
from suspension_cli.analyses.analysis import Analysis, Run, Settings
from suspension_cli.analyses.options import option

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from suspension_cli.analyses.tradeoff.measure import Tradeoff

QUANTITIES = ("modes", "response", "thermal", "coupling")


class TradeoffAnalysis(Analysis):
    """Measure time and error of each model for one design, and advise on a model.

    Asks for modes, responses, thermal noise and cross-coupling. The error of a model is its largest
    relative difference to the most complete one that is valid; times are processor times, measured
    in turns. Prints which model to use for each question, and which one `--fidelity auto` takes
    and what that neglects; writes DIR/NAME-tradeoff.h5 and .png.

    Example: pendsus tradeoff my.toml --quantity modes

    Returns
    -------
    Tradeoff
        With `answers`, `entries`, `choices`, `first_violin`.

    Raises
    ------
    InputError
        If the equilibrium is unstable.

    Notes
    -----
    Provisional: the questions that it asks, and so its results, may change.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> found = sus.tradeoff(sus.template("single"), quantities="modes")
    >>> [entry.model for entry in found.answers[0].options]
    ['closed-form', 'force', 'string', 'beam', 'violin']
    """

    name = "tradeoff"
    result_type = "analyses.tradeoff.measure.Tradeoff"
    has_model = False
    arguments = (options.DESIGN,)
    parameters = (
        option(
            "--quantity",
            "quantities",
            multiple=True,
            type=click.Choice(QUANTITIES),
            help="Compare only for this quantity (repeatable).  [default: all]",
        ),
        *(one for one in options.WRITING if one is not options.FIDELITY),
    )

    def solve(self, run: Run) -> Tradeoff:
        """Measure every model."""
        from suspension_cli.analyses.tradeoff.measure import Tradeoff, measure
        from suspension_cli.models.registry import Choice
        from suspension_cli.physics import near_limits

        began = time.monotonic()
        with run.log.progress() as bar:
            found = measure(
                run.source,
                run.setting["quantities"],
                lambda done, count: bar(done, count, done / max(time.monotonic() - began, 1e-9)),
            )
        near_limits.warn_implausible(run.design, run.log)
        choice = Choice("all", "every valid model is compared")
        return Tradeoff.extending(found, run=run.origin(self, choice))

    def text(self, result: Tradeoff) -> str:
        """Return the advice for each question, all times and errors, and what ``auto`` takes."""
        heads = {"question": "", f"fastest model {result.within}": ""}
        advice = [(answer.question, answer.advice) for answer in result.answers]
        reasons = (
            f"{one.model} left out: {one.left_out}" for one in result.entries if one.left_out
        )
        parts = [
            tables.render(heads, advice),
            _times_and_errors(result),
            "\n".join(dict.fromkeys(reasons)),
            _choices(result),
        ]
        return "\n\n".join(part for part in parts if part)

    def figures(self, result: Tradeoff, setting: Settings) -> dict[str, Figure]:
        """Draw error against time, a chart per question."""
        from suspension_cli.analyses.tradeoff import measure

        return {"": measure.draw(result, result.run.title)}


def _times_and_errors(found: Tradeoff) -> str:
    """Return the table of all models, a row per question."""
    from suspension_cli.analyses.tradeoff.measure import format_time
    from suspension_cli.models.choice import percent

    names = dict.fromkeys(one.model for answer in found.answers for one in answer.options)
    rows = []
    for answer in found.answers:
        cells = dict.fromkeys(names, "-")
        for one in answer.options:
            error = "reference" if one.model == answer.reference else percent(one.error)
            cells[one.model] = f"{format_time(one.time)}, {error}"
        rows.append((answer.question, *cells.values()))
    return tables.render(dict.fromkeys(("processor time and error", *names), ""), rows)


def _choices(found: Tradeoff) -> str:
    """Return the models that ``auto`` takes, and the lowest violin mode."""
    lines = []
    if found.choices:
        lines.append("Models that --fidelity auto takes:")
    for one in found.choices:
        lines += [f"  {one.question}", f"    {one.line}"]
    if math.isfinite(found.first_violin):
        lines.append(f"lowest first violin mode: {found.first_violin:.4g} Hz")
    return "\n".join(lines)


ANALYSIS = TradeoffAnalysis()
