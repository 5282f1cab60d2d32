"""Text of sensing and driving matrices from measurements."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from suspension_cli.analyses import tables
from suspension_cli.analyses.fit.osem_matrices import OsemFit
from suspension_cli.analyses.fit.result import Fitted
from suspension_cli.scene.arrays import Array


def first_lines(found: Fitted, matrices: OsemFit) -> list[str]:
    """Return a line on a misfit, and one on channels with a wrong sign."""
    lines = []
    if found.unlikely:
        lines.append(
            f"MISFIT: chi^2 is {found.chi_squared:.4g} for {found.freedom} degrees of freedom, so"
            f" the model explains the measurements with no matrices; uncertainties are given"
            f" {found.scale:.3g} times as large: fit the design to its modes first, leave out"
            ' frequencies with a "band", or check uncertainties'
        )
    for what, names in (
        ("sensor", matrices.reversed_sensors),
        ("coil", matrices.reversed_coils),
    ):
        if names:
            plural = "s" * (len(names) > 1)
            lines.append(
                f"CHANNEL: the sign of the {what}{plural} {', '.join(names)} is the opposite of"
                " the design's; the matrices include this"
            )
    return lines


def report(found: Fitted, matrices: OsemFit) -> Iterator[str]:
    """Yield the parts of the text below the line on the model."""
    lines = first_lines(found, matrices)
    if lines:
        yield "\n".join(lines)
    one = matrices
    low, high = one.frequency[[0, -1]]
    yield (
        f"{one.stage}: {len(one.sensor)} sensors, {len(one.coil)} coils, {len(one.frequency)}"
        f" frequencies from {low:.4g} to {high:.4g} Hz\n"
        "Each motion has the scale at which the nominal sensing matrix reads it: what errors the"
        " gains of all its sensors share is in the coils"
    )
    yield _table(
        "motions (m, rad) from readings (m)",
        one.motion,
        one.sensor,
        (one.sensing_nominal, one.sensing, one.sensing_sigma),
    )
    yield _table(
        "forces of coils (N) from forces along the motions (N, N m)",
        one.coil,
        one.motion,
        (one.driving_nominal, one.driving, one.driving_sigma),
    )
    yield _couplings(one)
    yield _modes(one)
    yield (
        f"delay {1e3 * one.delay:.4g} +- {1e3 * one.delay_sigma:.2g} ms; chi^2"
        f" {found.chi_squared:.4g} for {found.freedom} degrees of freedom"
    )


def _table(
    title: str, rows: Sequence[str], columns: Sequence[str], values: tuple[Array, Array, Array]
) -> str:
    """Table of a matrix: for each row the nominal and the found elements and their errors."""
    lines = []
    for n, name in enumerate(rows):
        nominal, found, sigma = (part[n].tolist() for part in values)
        lines += [(name, "nominal", *nominal), ("", "found", *found), ("", "+-", *sigma)]
    return f"{title}\n" + tables.render({"": "", " ": ""} | dict.fromkeys(columns, ".4g"), lines)


def _couplings(one: OsemFit) -> str:
    """Table of the couplings of pairs of motions, the strongest first."""
    columns = {"before": ".2g", "after": ".2g", "noise of\nthe data": ".2g"}
    columns |= {"of the\nsuspension": ".2g", "motions": ""}
    rows = zip(
        one.median_before,
        one.median_after,
        one.median_noise,
        one.median_suspension,
        one.pair,
        strict=True,
    )
    ordered = sorted(rows, key=lambda row: -row[0])
    head = "Couplings: median over frequencies of off-diagonal over diagonal responses"
    return f"{head}\n{tables.render(columns, ordered)}"


def _modes(one: OsemFit) -> str:
    """Table of the frequencies of modes, in the model and as fitted."""
    columns = {"model\nHz": "#.5g", "fitted\nHz": "#.5g", "+-\nHz": ".2g", "mode": ""}
    frequencies = one.mode_nominal, one.mode_frequency, one.mode_sigma
    known = np.isfinite(one.mode_frequency)
    rows = zip(*(part[known] for part in frequencies), np.array(one.mode)[known], strict=True)
    return tables.render(columns, [(*row[:3], str(row[3])) for row in rows])
