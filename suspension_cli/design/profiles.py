"""Measured profiles of fibres: diameter against length, reduced to uniform sections."""

from __future__ import annotations

import math
from itertools import pairwise

from suspension_cli.design.wires import Profile, WireSection


def reduced(profile: Profile, error: float | None = None) -> list[WireSection]:
    """Reduce a profile to uniform sections, from the upper end.

    Between two places the diameter is linear. Stretches in which it changes by a fraction of at
    most sqrt(error) become one section of the same volume: mass is exact, and means of other powers
    of the radius (compliance, bending stiffness) are wrong by a third to all of `error`.

    Parameters
    ----------
    error
        Instead of that of the profile; 0: one section per pair of places.
    """
    wanted = profile.error if error is None else error
    limit = math.sqrt(wanted)
    sections: list[WireSection] = []
    length = volume = 0.0
    low, high = math.inf, 0.0
    points = zip(profile.position, profile.diameter, strict=True)
    for (top, above), (bottom, below) in pairwise(points):
        # a steep stretch is divided, so that none exceeds the limit
        parts = max(1, math.ceil(abs(math.log(below / above)) / limit)) if wanted else 1
        span = (bottom - top) / parts
        for n in range(parts):
            ends = [above + (below - above) * k / parts for k in (n, n + 1)]
            low, high = min(*ends, low), max(*ends, high)
            if length and (not wanted or high > low * (1 + limit)):
                sections.append(_section(length, volume))
                length = volume = 0.0
                low, high = min(ends), max(ends)
            length += span
            volume += span * (ends[0] ** 2 + ends[0] * ends[1] + ends[1] ** 2) / 3
    return [*sections, _section(length, volume)]


def _section(length: float, volume: float) -> WireSection:
    return WireSection(length=length, radius=math.sqrt(volume / length) / 2)
