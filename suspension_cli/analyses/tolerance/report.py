"""Text and JSON of the statistics of builds."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from suspension_cli.analyses import tables
from suspension_cli.analyses.analysis import Document, as_number, plain
from suspension_cli.analyses.tolerance.statistics import (
    QUANTILES,
    Spread,
    Yield,
    leading,
    strongest,
)
from suspension_cli.analyses.tolerance.summary import Summary
from suspension_cli.design.paths import DISPLAYED
from suspension_cli.scene.arrays import Array
from suspension_cli.studies.parameters import STEPS

NEGLIGIBLE = 1e-7
"""Standard deviation of statics (m or rad) below which they are not printed."""
LOW, MEDIAN, HIGH = (QUANTILES.index(level) for level in (0.05, 0.5, 0.95))


def document(summary: Summary) -> Document:
    """Return the JSON document but for its head."""
    modes = [
        {"label": label, "nominal_hz": as_number(summary.nominal[n])}
        | {f"{key}_hz": plain(value[n]) for key, value in _columns(summary.modes).items()}
        | {"leading": leading(summary.modes.rank[n], summary.factor)}
        for n, label in enumerate(summary.label)
    ]
    coupling = {
        "ratio": summary.ratio,
        "frequency_hz": summary.frequency,
        "limit": summary.limit,
        "fraction_under_limit": as_number(summary.under.fraction),
        "fraction_under_limit_interval": plain((summary.under.low, summary.under.high)),
        "quantiles": plain(summary.coupling.quantiles[0]),
        "leading": leading(summary.coupling.rank[0], summary.factor),
        "leading_signed": leading(summary.signed.rank[0], summary.factor),
    }
    static = summary.static
    statics = [
        {"quantity": name, "unit": static.unit[n]}
        | {key: plain(value[n]) for key, value in _columns(static).items()}
        | {"leading": leading(static.rank[n], summary.factor)}
        for n, name in enumerate(static.name)
    ]
    found: Document = {
        "builds": summary.builds,
        "good": summary.good,
        "failures": summary.failures,
        "seed": summary.job.seed,
        "sampling": summary.job.method,
        "independent": summary.independent,
        "levels": list(QUANTILES),
        "significant_correlation": as_number(summary.significant),
        "modes": modes,
        "coupling": coupling,
        "statics": statics,
        "requirements": [_yield(one) for one in summary.yields],
        "all_requirements": None if summary.joint is None else _yield(summary.joint),
    }
    if summary.indices is not None:
        found["sobol_indices"] = {"tolerances": list(summary.job.groups)} | {
            "results": list(summary.indexed),
            **{name: plain(values) for name, values in vars(summary.indices).items()},
        }
    return found


def _columns(one: Spread) -> dict[str, Array]:
    values = one.mean, one.error, one.deviation, one.quantiles
    return dict(zip(("mean", "mean_error", "std", "quantiles"), values, strict=True))


def _yield(one: Yield) -> Document:
    return {
        "requirement": one.name,
        "yield": as_number(one.fraction),
        "interval": [as_number(one.low), as_number(one.high)],
    }


def text(summary: Summary) -> str:
    """Return the printed tables, without the line of the model."""
    lines = [f"{summary.good:,} of {summary.builds:,} builds hang on taut wires"]
    if summary.independent < summary.builds:
        lines.append(
            f"statistics are those of {summary.independent:,} independent builds; the others are"
            " for the Sobol indices"
        )
    lines += ["", _modes(summary), "", *_coupling(summary), "", *_statics(summary)]
    if summary.joint is not None:
        rows = [
            (100 * one.fraction, f"{100 * one.low:.2f} to {100 * one.high:.2f}", one.name)
            for one in (*summary.yields, summary.joint)
        ]
        columns = {"yield\n%": ".2f", "95 % confidence\n%": " ", "requirement": ""}
        lines += ["", tables.render(columns, rows)]
        lines += _required_causes(summary.required, summary)
    if summary.indices is not None:
        lines += ["", *_indices(summary)]
    return "\n".join(lines)


def _modes(summary: Summary) -> str:
    rows = []
    for n, label in enumerate(summary.label):
        nominal, quantiles = summary.nominal[n], summary.quantiles[n]
        spread = 100 * summary.spread[n] / nominal if nominal else None
        what = _causes(summary, summary.modes, n, "Hz", 2)
        rows.append((nominal, quantiles[LOW], quantiles[HIGH], spread, label, what))
    columns = dict.fromkeys(("nominal\nHz", "5 %\nHz", "95 %\nHz"), "#.5g")
    columns |= {"std\n%": ".2f", "mode": "", "depends most on (rank correlation, change)": ""}
    return tables.render(columns, rows)


def _coupling(summary: Summary) -> Iterator[str]:
    yield (
        f"|{summary.ratio}| at {summary.frequency:g} Hz: median"
        f" {summary.coupling.quantiles[0, MEDIAN]:.3g}, 95 % below"
        f" {summary.coupling.quantiles[0, HIGH]:.3g}"
    )
    under = summary.under
    yield (
        f"{100 * under.fraction:.4g} % of builds lie below {summary.limit:g} (95 % confidence:"
        f" {100 * under.low:.3g} to {100 * under.high:.3g} %)"
    )
    what = _causes(summary, summary.signed, 0, "", 5)
    yield f"depends most on: {what or 'no number significantly'}"


def _statics(summary: Summary) -> Iterator[str]:
    static, rows = summary.static, []
    for n, name in enumerate(static.name):
        if static.deviation[n] > NEGLIGIBLE:
            unit, per = DISPLAYED[static.unit[n]]
            what = _causes(summary, static, n, unit, 1, per)
            values = (
                static.mean[n],
                static.error[n],
                static.deviation[n],
                *static.quantiles[n][[LOW, HIGH]],
            )
            rows.append((*(per * value for value in values), unit, name, what))
    if not rows:
        return
    columns = dict.fromkeys(("mean", "error\nof mean", "std", "5 %", "95 %"), "#.3g")
    columns |= {"unit": "", "displacement from the nominal pose": "", "depends most on": ""}
    yield tables.render(columns, rows)


def _required_causes(required: Spread, summary: Summary) -> Iterator[str]:
    """Describe the causes of required quantities other than modes and coupling."""
    for n, name in enumerate(required.name):
        unit, per = DISPLAYED.get(required.unit[n], (required.unit[n], 1.0))
        end = "" if unit == "1" else unit
        if name not in (*summary.label, "coupling"):
            what = _causes(summary, required, n, end, 3, per)
            yield f"  {name} depends most on: {what or 'no number significantly'}"


def _causes(
    summary: Summary, results: Spread, number: int, unit: str, count: int, per: float = 1.0
) -> str:
    """List numbers with the strongest significant correlations, and the change by each.

    `unit` is `per` SI units.
    """
    found, rank = [], results.rank[number]
    for n in strongest(rank, count, summary.significant):
        own = summary.job.factors[n]
        step, name = (0.01, "%") if own.unit == "1" else STEPS.get(own.unit, (1.0, own.unit))
        change = f"{per * results.slope[number, n] * step:+.3g} {unit}".rstrip()
        found.append(f"{own.label} {rank[n]:+.2f} ({change} per {name})")
    return ", ".join(found)


def _indices(summary: Summary) -> Iterator[str]:
    assert summary.indices is not None
    wanted = ["coupling", *summary.required.name]
    places = [summary.indexed.index(name) for name in dict.fromkeys(wanted)]
    yield (
        "Sobol indices: fraction of the variance that a tolerance causes alone (first), or alone"
        " and together with others (total)"
    )
    for place in places:
        total, first = summary.indices.total[:, place], summary.indices.first[:, place]
        rows = [
            (
                float(total[n]),
                summary.indices.total_error[n, place],
                float(first[n]),
                summary.indices.first_error[n, place],
                summary.job.groups[n],
            )
            for n in np.argsort(-total, kind="stable")
            if total[n] > max(0.005, 2 * summary.indices.total_error[n, place])
        ]
        columns = dict.fromkeys(("total", "std error", "first", "std error "), ".3f")
        heading = f"  {summary.indexed[place]}"
        if rows:
            yield f"{heading}\n" + tables.render(columns | {"tolerance": ""}, rows)
        else:
            yield f"{heading}: does not vary"
