"""Text and JSON of the statistics of builds."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from suspension_cli.analyses import tables
from suspension_cli.analyses.analysis import Document, as_number, plain, table
from suspension_cli.analyses.tolerance.statistics import QUANTILES, Yield, strongest
from suspension_cli.analyses.tolerance.summary import Spread, Summary
from suspension_cli.studies.parameters import STEPS

NEGLIGIBLE = 1e-7
"""Standard deviation of statics (m or rad) below which they are not printed."""
LEADING = 5
"""Number of causes in the JSON document."""
LOW, MEDIAN, HIGH = (QUANTILES.index(level) for level in (0.05, 0.5, 0.95))


def document(summary: Summary) -> Document:
    """Return the JSON document but for its head."""

    def leading(one: Spread) -> list[tuple[str, float]]:
        factors = summary.job.factors
        return [(factors[n].label, float(one.rank[n])) for n in strongest(one.rank, LEADING)]

    modes = table(
        summary.modes, "mean_hz=mean mean_error_hz=error std_hz=deviation quantiles_hz=quantiles"
    )
    nominal = zip(summary.label, plain(summary.nominal), modes, summary.modes, strict=True)
    statics = table(
        summary.static, "quantity=name unit mean mean_error=error std=deviation quantiles"
    )
    under = summary.under
    found: Document = {
        "builds": summary.job.count,
        "good": summary.good,
        "failures": summary.failures,
        "seed": summary.job.seed,
        "sampling": summary.job.method,
        "independent": summary.independent,
        "levels": list(QUANTILES),
        "significant_correlation": as_number(summary.significant),
        "modes": [
            {"label": label, "nominal_hz": frequency, **row, "leading": leading(one)}
            for label, frequency, row, one in nominal
        ],
        "coupling": {
            "ratio": summary.ratio,
            "frequency_hz": summary.frequency,
            "limit": summary.limit,
            "fraction_under_limit": as_number(under.fraction),
            "fraction_under_limit_interval": plain(under.interval),
            "quantiles": plain(summary.coupling.quantiles),
            "leading": leading(summary.coupling),
            "leading_signed": leading(summary.signed),
        },
        "statics": [
            row | {"leading": leading(one)}
            for row, one in zip(statics, summary.static, strict=True)
        ],
        "requirements": [],
        "all_requirements": None,
    }
    if summary.joint is not None:
        yields = table((*summary.yields, summary.joint), "requirement=name yield=fraction interval")
        *found["requirements"], found["all_requirements"] = yields
    if summary.indices:
        found["sobol_indices"] = {
            "tolerances": list(summary.job.groups),
            "results": [one.name for one in summary.job.quantities],
            **{name: plain(values) for name, values in summary.indices.items()},
        }
    return found


def text(summary: Summary) -> str:
    """Return the printed tables, without the line of the model."""
    lines = [f"{summary.good:,} of {summary.job.count:,} builds hang on taut wires"]
    if summary.independent < summary.job.count:
        lines.append(
            f"statistics are those of {summary.independent:,} independent builds; the others are"
            " for the Sobol indices"
        )
    lines += ["", _modes(summary), "", *_coupling(summary), "", *_statics(summary)]
    if summary.joint is not None:
        rows = [
            (100 * one.fraction, "{:.2f} to {:.2f}".format(*_percent(one)), one.name)
            for one in (*summary.yields, summary.joint)
        ]
        columns = {"yield\n%": ".2f", "95 % confidence\n%": " ", "requirement": ""}
        lines += ["", tables.render(columns, rows)]
        for one in summary.required:
            if one.quantity.column in ("static", "response"):
                what = _causes(summary, one, 3) or "no number significantly"
                lines.append(f"  {one.name} depends most on: {what}")
    if summary.indices:
        lines += ["", *_indices(summary)]
    return "\n".join(lines)


def _percent(one: Yield) -> tuple[float, float]:
    low, high = one.interval
    return 100 * low, 100 * high


def _modes(summary: Summary) -> str:
    rows = []
    for label, nominal, one in zip(summary.label, summary.nominal, summary.modes, strict=True):
        spread = 100 * one.deviation / nominal if nominal else None
        low, high = one.quantiles[[LOW, HIGH]]
        rows.append((nominal, low, high, spread, label, _causes(summary, one, 2)))
    columns = dict.fromkeys(("nominal\nHz", "5 %\nHz", "95 %\nHz"), "#.5g")
    columns |= {"std\n%": ".2f", "mode": "", "depends most on (rank correlation, change)": ""}
    return tables.render(columns, rows)


def _coupling(summary: Summary) -> Iterator[str]:
    quantiles, under = summary.coupling.quantiles, summary.under
    yield (
        f"|{summary.ratio}| at {summary.frequency:g} Hz: median {quantiles[MEDIAN]:.3g}, 95 % below"
        f" {quantiles[HIGH]:.3g}"
    )
    low, high = _percent(under)
    yield (
        f"{100 * under.fraction:.4g} % of builds lie below {summary.limit:g} (95 % confidence:"
        f" {low:.3g} to {high:.3g} %)"
    )
    yield f"depends most on: {_causes(summary, summary.signed, 5) or 'no number significantly'}"


def _statics(summary: Summary) -> Iterator[str]:
    rows = []
    for one in summary.static:
        if one.deviation > NEGLIGIBLE:
            unit, per = one.quantity.displayed
            values = per * np.array([one.mean, one.error, one.deviation, *one.quantiles])
            shown = (*values[:3], *values[3:][[LOW, HIGH]])
            rows.append((*shown, unit, one.name, _causes(summary, one, 1)))
    if not rows:
        return
    columns = dict.fromkeys(("mean", "error\nof mean", "std", "5 %", "95 %"), "#.3g")
    columns |= {"unit": "", "displacement from the nominal pose": "", "depends most on": ""}
    yield tables.render(columns, rows)


def _causes(summary: Summary, one: Spread, count: int) -> str:
    """List numbers with the strongest significant correlations, and the change by each."""
    unit, per = one.quantity.displayed
    found = []
    for n in strongest(one.rank, count, summary.significant):
        factor = summary.job.factors[n]
        step, name = STEPS.get(factor.unit, (1.0, factor.unit))
        if factor.unit == "1":
            step, name = 0.01, "%"
        change = f"{per * one.slope[n] * step:+.3g} {unit}".rstrip()
        found.append(f"{factor.label} {one.rank[n]:+.2f} ({change} per {name})")
    return ", ".join(found)


def _indices(summary: Summary) -> Iterator[str]:
    yield (
        "Sobol indices: fraction of the variance that a tolerance causes alone (first), or alone"
        " and together with others (total)"
    )
    for one in dict.fromkeys((summary.coupling, *summary.required)):
        found = one.sobol
        assert found is not None
        rows = [
            (float(total), error, float(first), first_error, name)
            for total, error, first, first_error, name in zip(
                found.total,
                found.total_error,
                found.first,
                found.first_error,
                summary.job.groups,
                strict=True,
            )
            if total > max(0.005, 2 * error)
        ]
        columns = dict.fromkeys(("total", "std error", "first", "std error "), ".3f")
        rows.sort(key=lambda row: -row[0])
        listed = "\n" + tables.render(columns | {"tolerance": ""}, rows)
        yield f"  {one.name}" + (listed if rows else ": does not vary")
