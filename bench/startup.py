"""Start-up time of the command."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

TRIPLE = Path(__file__).parent.parent / "configs" / "husman2000" / "table2.toml"


def run(ratio: Callable[..., None], shell: Callable[..., Callable[[], object]]) -> None:
    """Time the start-up against the bare imports."""
    pendsus = str(Path(sys.executable).parent / "pendsus")
    ratio(
        "pendsus --help / python -c 'import click'",
        shell(pendsus, "--help"),
        shell(sys.executable, "-c", "import click"),
        1.5,
        15,
    )
    with tempfile.TemporaryDirectory() as folder:
        ours = shell(pendsus, "modes", str(TRIPLE), "--json", "--out", folder)
        ratio(
            "pendsus modes --json / import numpy, scipy.linalg, h5py, msgspec",
            ours,
            shell(sys.executable, "-c", "import numpy, scipy.linalg, h5py, msgspec"),
            1.6,
            15,
        )
