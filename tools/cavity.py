"""Optical spring of an arm, by pendsus and by finesse: docs/notebooks/cavity.py in the house style.

Writes `results/cavity.png`. Run by `make cavity`.
"""

from __future__ import annotations

import os
import runpy
import warnings

import matplotlib
from cycler import cycler

from suspension_cli.drawing.style import PALETTE, house_style
from tools.tables import ROOT


def main() -> None:
    """Run the script in the folder of results."""
    os.environ["MPLBACKEND"] = "agg"
    os.chdir(ROOT / "results")
    warnings.simplefilter("ignore")
    with house_style():
        matplotlib.rcParams["axes.prop_cycle"] = cycler(color=PALETTE)
        runpy.run_path(str(ROOT / "docs" / "notebooks" / "cavity.py"))


if __name__ == "__main__":
    main()
