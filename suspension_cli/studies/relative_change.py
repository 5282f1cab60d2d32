"""Relative changes of results from one model to another."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact


def relative_change(
    old: Inexact[np.ndarray, "*build"], new: Inexact[np.ndarray, "*build"]
) -> float:
    """Compute the largest change over the largest coupling; NaN if no build is known in both."""
    known = np.isfinite(old) & np.isfinite(new)
    if not known.any():
        return float("nan")
    largest, change = (float(np.abs(ratio[known]).max()) for ratio in (new, old - new))
    return change / largest if largest > 0 else 0.0 if change == 0 else float("inf")


def largest_relative_change(
    old: Float[np.ndarray, " build"], new: Float[np.ndarray, " build"]
) -> float:
    """Compute the largest change of a frequency or magnitude over its new value, without NaN."""
    with np.errstate(all="ignore"):
        changes = np.abs(old - new) / new
    return float(np.where(np.isnan(changes), 0.0, changes).max(initial=0.0))
