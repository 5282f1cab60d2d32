"""Curves of a comparison between their points, for drawing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from suspension_cli.analyses.compare.solve import Curve, Overlay


def refine(overlay: Overlay) -> list[Curve]:
    """Add frequencies that resolve resonances and zeros to computed curves.

    Ratios are those of the refined curves, interpolated. Other curves are unchanged.
    """
    drawn = [_refined(overlay, curve) for curve in overlay.curves]
    first = drawn[0]
    return [
        first,
        *(_with_ratio(one, first) if one.item in overlay.source else one for one in drawn[1:]),
    ]


def _refined(overlay: Overlay, curve: Curve) -> Curve:
    result = overlay.source.get(curve.item)
    if result is None:
        return curve
    if overlay.kind == "response":
        from suspension_cli.analyses.response import fine

        data = fine.refine(result)
        pair = data.output.index(overlay.output), data.input.index(overlay.input)
        frequency, value = data.frequency, data.value[(slice(None), *pair)]
    else:
        from suspension_cli.analyses.thermal import fine

        noise = next(one for one in fine.refine(result) if one.output == overlay.output)
        frequency, value = noise.frequency, noise.amplitude.astype(complex)
    unknown = np.full(len(frequency), np.nan)
    return replace(curve, frequency=frequency, value=value, uncertainty=unknown)


def _with_ratio(curve: Curve, first: Curve) -> Curve:
    """Recompute the ratio of a curve to the first at the points of both."""
    at = np.union1d(curve.frequency, first.frequency)
    ends = [(one.frequency[0], one.frequency[-1]) for one in (curve, first)]
    at = at[(at >= max(low for low, _ in ends)) & (at <= min(high for _, high in ends))]
    with np.errstate(divide="ignore", invalid="ignore"):
        logs = ((np.log(one.frequency), np.log(np.abs(one.value))) for one in (curve, first))
        over, under = (np.exp(np.interp(np.log(at), *log)) for log in logs)
        return replace(curve, ratio_frequency=at, ratio=over / under + 0j)
