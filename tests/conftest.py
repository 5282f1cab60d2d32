"""What holds for all tests."""

from __future__ import annotations

from suspension_cli.plots import style

SHIPPED_DPI = style.DPI
style.DPI = 60
"""Pictures are compared with each other and measured in inches: a third of the dots shows the same."""
