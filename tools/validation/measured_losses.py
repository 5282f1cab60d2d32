"""Q of measured modes, against the losses that pygwinc gives for the materials."""

from __future__ import annotations

import tomllib
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment

import suspension_cli as sus
from tools.tables import ROOT
from tools.validation.page import Section, number_of_percent, percent, table

BUILT = ROOT / "configs" / "built"
FURTHEST_PAIR = 0.2
"""Largest distance of a second violin mode from twice the first one of the same wire, Hz.

The wire of steel below has 0.08 Hz; second modes further away have no first mode in the list.
"""
NO_LOSS = 1e-15
"""Loss angle that no mode notices: a loss of exactly 0 would be warned of as forgotten."""


def section() -> Section:
    """Compare bounce and roll of LIGO's quadruple and violin modes of initial LIGO."""
    numbers = tomllib.loads((ROOT / "measured" / "ligo" / "published.toml").read_text("utf-8"))
    result = Section("Measured losses")
    result.lines += [
        "Losses are those of pygwinc for silica, C70 steel and maraging steel; none is fitted"
        " (`measured-losses`).",
    ]
    _quadruple(result, numbers["quadruple"])
    _violin(result, numbers["initial"])
    result.lines += [
        "",
        "### Not compared",
        "",
        "Of arXiv:1606.09159 (HAUX), arXiv:0908.3227 (thermal noise of a pendulum), LIGO-T0900103 (Q"
        " of pitch), LIGO-T1200418 (violin modes), gr-qc/0009035 (Q of a silica rod), the theses of"
        " Torrie and Husman, and Plissi et al. on GEO 600 only an abstract or a first page could be"
        " read; arXiv:1901.03053 and klog 17956 could not be had. Parameters of BSFM, HTTS and BBSS and"
        " profiles of single fibres are not public.",
    ]
    return result


def _quadruple(result: Section, known: dict[str, Any]) -> None:
    design = sus.read(str(BUILT / "ligo-quad.toml"))
    bounce, bounce_q = _last(design, "vertical")
    roll, _ = _last(design, "roll")
    silica_q = _last(design.replace(_without_steel(design)), "vertical")[1]
    measured = known["undamped_bounce"]
    rows = [
        [
            "bounce, ITMX without dampers",
            f"{bounce:.3f}",
            f"{measured['frequency_hz']:.3f}",
            number_of_percent(bounce / measured["frequency_hz"] - 1),
        ]
    ]
    for mirror, frequency in known["measured_roll_hz"].items():
        rows.append(
            [
                f"roll, {mirror} with dampers",
                f"{roll:.3f}",
                f"{frequency:.3f}",
                number_of_percent(roll / frequency - 1),
            ]
        )
    values = [f"{value:,} ({channel})" for channel, value in measured["q"].items()]
    low, high = sorted(measured["q"].values())
    result.lines += [
        "",
        "### Bounce and roll of Advanced LIGO's quadruple",
        "",
        "By `pendsus modes configs/built/ligo-quad.toml`, with the fibres' stiffness of the production"
        " model:",
        *table(["mode", "computed (Hz)", "measured (Hz)", "off (%)"], rows),
        f"Q of the bounce mode: computed {bounce_q:,.0f}; measured {' and '.join(values)}, two"
        f" readings of one decay ({measured['source']}): {percent(bounce_q / high - 1)} and"
        f" {percent(bounce_q / low - 1)}. Without the losses of steel wires and blades Q would be"
        f" {silica_q:,.0f}: this measures the loss of steel ({100 * (1 - bounce_q / silica_q):.0f} %).",
    ]


def _last(design: sus.Design, motion: str) -> tuple[float, float]:
    """Frequency (Hz) and Q of the highest mode of bodies that is mostly a motion."""
    found = sus.modes(design, fidelity="beam")
    n = max(n for n, label in enumerate(found.label) if motion in label)
    return float(found.frequency[n]), float(found.q[n])


def _without_steel(design: sus.Design) -> dict[str, Any]:
    """Changes that take away the losses of steel wires and of blades."""
    blades = {
        f"stage.{name}.blades.loss_angle": NO_LOSS for name in ("top", "upper", "penultimate")
    }
    wires = {
        "materials.wire.loss_angle": NO_LOSS,
        "materials.wire.thermal_expansion": 0.0,
        "materials.wire.modulus_slope": 0.0,
    }
    return blades | wires


def _violin(result: Section, known: dict[str, Any]) -> None:
    design = sus.read(str(BUILT / "ligo-initial.toml"))
    found = sus.modes(design, fidelity="violin", max_frequency=750.0)
    frequency, q = np.asarray(found.frequency), np.asarray(found.q)
    is_first = (frequency > 100) & (frequency < 500)
    first, first_q = frequency[is_first].mean(), q[is_first].mean()
    second = frequency[frequency > 500].mean()
    rows = []
    splitting: list[float] = []
    for name, line in known["lines"].items():
        violin = np.array(line["violin_hz"])
        widths_q = violin / np.array(line["width_hz"])
        splitting += _stretching(violin, np.array(line["second_hz"]))
        rows.append(
            [
                name,
                str(len(violin)),
                f"{widths_q.min():,.0f}",
                f"{np.median(widths_q):,.0f}",
                f"{widths_q.max():,.0f}",
            ]
        )
    result.lines += [
        "",
        "### Violin modes of initial LIGO",
        "",
        f"Computed: Q {first_q:,.0f} at {first:.1f} Hz (`pendsus modes"
        " configs/built/ligo-initial.toml --fidelity violin --max-frequency 750`). Measured: frequency"
        " over width of lines in the S1 data, a lower limit of Q, as the resolution of 1 mHz and drifts"
        " widen lines:",
        *table(["interferometer", "lines", "least", "median", "largest"], rows),
        "A stiff wire puts the second mode above twice the first: computed f2/f1 - 2 ="
        f" {second / first - 2:.1e}, measured {np.median(splitting):.1e} (median of"
        f" {len(splitting)} pairs of nearest lines within {FURTHEST_PAIR} Hz, {min(splitting):.1e} to"
        f" {max(splitting):.1e}; single pairs may be of different wires).",
    ]


def _stretching(first: np.ndarray, second: np.ndarray) -> list[float]:
    """Differences f2/f1 - 2 of second modes and the first ones that they are paired with."""
    distance = abs(second[:, None] - 2 * first)
    pairs = zip(*linear_sum_assignment(np.minimum(distance, FURTHEST_PAIR)), strict=True)
    return [float(second[i] / first[j] - 2) for i, j in pairs if distance[i, j] < FURTHEST_PAIR]
