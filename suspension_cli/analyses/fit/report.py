"""Text and JSON of a fit: numbers, modes, misfit, undetermined combinations."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from suspension_cli.analyses import tables
from suspension_cli.analyses.analysis import Document, plain

if TYPE_CHECKING:
    from suspension_cli.analyses.fit.solve import Fit

SAME = 1e-3
"""Relative difference of chi^2 below which two searches found the same minimum."""

LARGEST = 6
"""Numbers of a combination that are printed."""


def learned_numbers(found: Fit) -> list[Document]:
    """Return the JSON rows of the fitted numbers."""
    return [
        {
            "name": label,
            "start": plain(found.start[n]),
            "value": plain(found.value[n]),
            "sigma": plain(found.scale * found.sigma[n]),
            "at_bound": bool(found.at_bound[n]),
            "experiments": [
                name for name, here in zip(found.experiment, found.shared[n], strict=True) if here
            ],
        }
        for n, label in enumerate(found.name)
    ]


def mode_rows(found: Fit) -> list[Document]:
    """Return the JSON rows of the measured modes, in Hz."""
    columns = {
        "measured_hz": found.measured,
        "uncertainty_hz": found.uncertainty,
        "before_hz": found.before,
        "after_hz": found.after,
        "residual": found.residual,
    }
    return [
        {"experiment": found.experiment[found.of[n]], "label": label}
        | {key: plain(values[n]) for key, values in columns.items()}
        for n, label in enumerate(found.label)
    ]


def exchanged_labels(found: Fit) -> Document | None:
    """Return the JSON entry of two labels that seem exchanged; None if none do."""
    if found.exchange is None:
        return None
    return {
        "experiment": found.experiment[found.exchange.experiment],
        "labels": list(found.exchange.labels),
        "chi_squared": found.exchange.chi_squared,
    }


def _misfit(found: Fit) -> list[str]:
    """Return lines on the size of a misfit and its remedy; none if there is none."""
    if not found.misfit:
        return []
    lines = [
        f"MISFIT: chi^2 is {found.chi_squared:.4g} for {found.freedom} degrees of freedom, so these"
        f" numbers do not explain the measurements; uncertainties are given {found.scale:.3g} times"
        " as large"
    ]
    if found.responses is not None:
        lines.append(
            "no exchange or sign of channels removes the misfit: free more numbers, give sensors"
            " and actuators gain_uncertainty or mix_uncertainty, or check uncertainties"
        )
    elif found.exchange is None:
        lines.append(
            "no exchange of two labels removes the misfit: free more numbers, or check designs,"
            " labels and uncertainties"
        )
    else:
        first, second = found.exchange.labels
        where = (
            f" in {found.experiment[found.exchange.experiment]}"
            if len(found.experiment) > 1
            else ""
        )
        lines.append(
            f'two labels may be exchanged: with "{first}" and "{second}" exchanged{where}, chi^2 is'
            f" {found.exchange.chi_squared:.4g}"
        )
    return lines


def numbers(found: Fit) -> str:
    """Return a table of the numbers."""
    from suspension_cli.analyses.fit.file import format_uncertainty
    from suspension_cli.design.path_units import unit_of

    rows = [
        (
            label,
            unit_of(found.name[n]),
            found.start[n],
            found.value[n],
            format_uncertainty(found, n).strip(", "),
        )
        for n, label in enumerate(found.parameters)
    ]
    columns = {"number": "", "unit": "", "start": "#.6g", "fitted": "#.6g", "uncertainty": ""}
    return tables.render(columns, rows)


def residuals(found: Fit) -> str:
    """Return a table of the measured modes."""
    modelled = (
        [value if math.isfinite(value) else "unstable" for value in values]
        for values in (found.before, found.after)
    )
    columns = dict.fromkeys(("measured\nHz", "+-\nHz", "before\nHz", "after\nHz"), "#.5g")
    columns |= {"+-\nHz": ".2g", "residual": "+.2f", "mode": ""}
    rows = zip(
        found.measured, found.uncertainty, *modelled, found.residual, found.modes, strict=True
    )
    return tables.render(columns, rows)


def first_lines(found: Fit) -> list[str]:
    """Return lines on a misfit and on wrong channels."""
    lines = _misfit(found)
    if found.responses is not None:
        from suspension_cli.analyses.fit import response_text

        lines += response_text.corrections(found.responses)
    return lines


def search_ends(found: Fit) -> list[str]:
    """Return chi^2, and the ends of several searches."""
    lines = [f"chi^2 {found.chi_squared:.4g} for {found.freedom} degrees of freedom"]
    if len(found.ends) > 1:
        same = int((found.ends <= (1 + SAME) * found.ends[0]).sum())
        rest = f", the next best at {found.ends[same]:.4g}" if same < len(found.ends) else ""
        lines.append(f"{same} of {len(found.ends)} searches ended there{rest}")
    return lines


def known_combinations(found: Fit) -> list[str]:
    """Return chi^2, and the uncertainties of combinations of numbers."""
    lines = [
        *search_ends(found),
        "",
        "uncertainties of combinations of relative changes, from the modes without priors:",
    ]
    for value, row in zip(found.singular, found.direction, strict=True):
        largest = sorted(zip(row, found.parameters, strict=True), key=lambda item: -abs(item[0]))[
            :LARGEST
        ]
        parts = " ".join(f"{part:+.2f} {name}" for part, name in largest if abs(part) >= 0.05)
        lines.append(
            f"  {f'{100 / value:.2g} %' if value > 1e-9 * found.singular[0] else 'undetermined'}:"
            f" {parts}"
        )
    if len(found.singular) < len(found.name):
        lines.append(
            f"  {len(found.name) - len(found.singular)} more are not determined, as there are more"
            " numbers than modes"
        )
    return lines
