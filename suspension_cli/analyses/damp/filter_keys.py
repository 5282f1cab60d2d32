"""Filters that were found, as the keys of a `[[control.loop]]`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from suspension_cli.design.foton import Filter

Roots = list[float | list[float]]


def as_keys(made: Filter) -> dict[str, Roots]:
    """Write zeros and poles in Hz as in a design."""
    return {"zeros": _write(made.zeros), "poles": _write(made.poles)}


def _write(roots: Sequence[complex]) -> Roots:
    """Write roots in Hz: numbers, and [re, im] for conjugate pairs."""
    upper = [root for root in roots if root.imag >= 0]
    return [[root.real, root.imag] if root.imag else root.real for root in upper]
