"""Relative change of couplings from one model to another."""

from __future__ import annotations

from typing import Any

import numpy as np


def relative_change(old: Any, new: Any) -> float:
    """Largest change of the couplings over the largest; NaN if no build is known in both models."""
    known = np.isfinite(old) & np.isfinite(new)
    if not known.any():
        return float("nan")
    largest, change = (float(np.abs(ratio[known]).max()) for ratio in (new, old - new))
    return change / largest if largest > 0 else 0.0 if change == 0 else float("inf")
