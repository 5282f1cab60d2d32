"""Text and JSON of the statistics of builds."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from suspension_cli.analyses import tables
from suspension_cli.analyses.analysis import Document, as_number, plain
from suspension_cli.analyses.tolerance.statistics import (
    QUANTILES,
    Spread,
    Summary,
    Yield,
    leading,
    strongest,
)
from suspension_cli.design.paths import DISPLAYED
from suspension_cli.scene.arrays import Array
from suspension_cli.studies.natural_steps import STEPS

NEGLIGIBLE = 1e-7
"""Standard deviation of statics (m or rad) below which they are not printed."""
LOW, MEDIAN, HIGH = (QUANTILES.index(level) for level in (0.05, 0.5, 0.95))


def document(summary: Summary) -> Document:
    """Return the JSON document but for its head."""
    frequencies = _columns(summary.mean, summary.mean_error, summary.spread, summary.quantiles)
    modes = [
        {"label": label, "nominal_hz": as_number(summary.nominal[n])}
        | {f"{key}_hz": plain(value[n]) for key, value in frequencies.items()}
        | {"leading": leading(summary.mode_rank[n], summary.factor)}
        for n, label in enumerate(summary.label)
    ]
    coupling = {
        "ratio": summary.ratio,
        "frequency_hz": summary.frequency,
        "limit": summary.limit,
        "fraction_under_limit": as_number(summary.under),
        "fraction_under_limit_interval": plain(summary.under_interval),
        "quantiles": plain(summary.ratio_quantiles),
        "leading": leading(summary.ratio_rank, summary.factor),
        "leading_signed": leading(summary.signed_rank, summary.factor),
    }
    static = summary.static
    columns = _columns(static.mean, static.error, static.deviation, static.quantiles)
    statics = [
        {"quantity": name, "unit": static.unit[n]}
        | {key: plain(value[n]) for key, value in columns.items()}
        | {"leading": leading(static.rank[n], summary.factor)}
        for n, name in enumerate(static.name)
    ]
    found: Document = {
        "builds": summary.builds,
        "good": summary.good,
        "failures": summary.failures,
        "seed": summary.seed,
        "sampling": summary.sampling,
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
        found["sobol_indices"] = {"tolerances": list(summary.group)} | {
            "results": list(summary.indexed),
            **{name: plain(values) for name, values in vars(summary.indices).items()},
        }
    return found


def _columns(*values: Array) -> dict[str, Array]:
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
        what = _causes(summary, summary.mode_rank[n], summary.mode_slope[n], "Hz", 2)
        rows.append((nominal, quantiles[LOW], quantiles[HIGH], spread, label, what))
    columns = dict.fromkeys(("nominal\nHz", "5 %\nHz", "95 %\nHz"), "#.5g")
    columns |= {"std\n%": ".2f", "mode": "", "depends most on (rank correlation, change)": ""}
    return tables.render(columns, rows)


def _coupling(summary: Summary) -> Iterator[str]:
    yield (
        f"|{summary.ratio}| at {summary.frequency:g} Hz: median"
        f" {summary.ratio_quantiles[MEDIAN]:.3g}, 95 % below"
        f" {summary.ratio_quantiles[HIGH]:.3g}"
    )
    low, high = (100 * end for end in summary.under_interval)
    yield (
        f"{100 * summary.under:.4g} % of builds lie below {summary.limit:g} (95 % confidence:"
        f" {low:.3g} to {high:.3g} %)"
    )
    what = _causes(summary, summary.signed_rank, summary.signed_slope, "", 5)
    yield f"depends most on: {what or 'no number significantly'}"


def _statics(summary: Summary) -> Iterator[str]:
    static, rows = summary.static, []
    for n, name in enumerate(static.name):
        if static.deviation[n] > NEGLIGIBLE:
            unit, per = DISPLAYED[static.unit[n]]
            what = _causes(summary, static.rank[n], per * static.slope[n], unit, 1)
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
            what = _causes(summary, required.rank[n], per * required.slope[n], end, 3)
            yield f"  {name} depends most on: {what or 'no number significantly'}"


def _causes(summary: Summary, rank: Array, slope: Array, unit: str, count: int) -> str:
    """List numbers with the strongest significant correlations, and the change by each."""
    found = []
    for n in strongest(rank, count, summary.significant):
        own = summary.factor_unit[n]
        step, name = (0.01, "%") if own == "1" else STEPS.get(own, (1.0, own))
        change = f"{slope[n] * step:+.3g} {unit}".rstrip()
        found.append(f"{summary.factor[n]} {rank[n]:+.2f} ({change} per {name})")
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
                summary.group[n],
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
