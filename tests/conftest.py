"""Settings of all tests."""

from __future__ import annotations

import functools
import gc
import sys

import pytest
from matplotlib.backends.backend_agg import RendererAgg
from matplotlib.mathtext import MathTextParser

from suspension_cli.drawing import style

SHIPPED_DPI = style.DPI
style.DPI = 60
"""Pictures are compared with each other and measured in inches: a third of the dots shows the
same."""

MathTextParser._parse_cached = functools.lru_cache(4096)(MathTextParser._parse_cached.__wrapped__)
"""Labels are much the same in all pictures: parsed once, not once for every 50."""

_measure = RendererAgg.get_text_width_height_descent
_sizes: dict[tuple[object, ...], tuple[float, float, float]] = {}


def _size_of_text(self, s, prop, ismath):
    key = (s, hash(prop), ismath, self.dpi)
    if key not in _sizes:
        _sizes[key] = _measure(self, s, prop, ismath)
    return _sizes[key]


RendererAgg.get_text_width_height_descent = _size_of_text
"""So are their sizes."""

vars(sys.modules["__main__"]).update(__spec__=None, __file__=None)
"""Workers of sweeps are started anew and would import the main module of this process: pytest,
which they have no use for."""


def pytest_collection_finish():
    """What the tests import stays for good, so the collector of garbage need not look through it
    again and again: a seventh of all time."""
    gc.freeze()
    gc.set_threshold(100_000, 20, 50)


@pytest.fixture
def full_resolution(monkeypatch):
    """Draw pictures as they are shipped: at few pixels, boxes of text differ by their rounding."""
    monkeypatch.setattr(style, "DPI", SHIPPED_DPI)
