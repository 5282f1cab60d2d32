"""What holds for all tests."""

from __future__ import annotations

from suspension_cli.plots import style

style.DPI = 60
"""Pictures are compared with each other and measured in inches: a third of the dots shows the same."""
