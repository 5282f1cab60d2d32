"""The trade-off with made-up times: every model is solved once."""

from __future__ import annotations

from typing import Any

from suspension_cli.analyses.tradeoff import measure


def hurry(monkeypatch: Any) -> None:
    """Times grow from model to model; the first is the fastest."""
    monkeypatch.setattr(
        measure, "median_times", lambda works: [1e-3 * 1.5**n for n in range(len(works))]
    )
