"""Relative change of couplings from one model to another."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from jaxtyping import Inexact


def relative_change(
    old: Inexact[np.ndarray, "*build"], new: Inexact[np.ndarray, "*build"]
) -> float:
    """Compute the largest change over the largest coupling; NaN if no build is known in both."""
    known = np.isfinite(old) & np.isfinite(new)
    if not known.any():
        return float("nan")
    largest, change = (float(np.abs(ratio[known]).max()) for ratio in (new, old - new))
    return change / largest if largest > 0 else 0.0 if change == 0 else float("inf")
