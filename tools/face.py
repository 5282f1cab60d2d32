"""The picture at the top of README.md: a triple pendulum, drawn, and its modes.

Runs `pendsus new triple`, `pendsus draw` and `pendsus modes`, and writes `docs/images/face.png`
with both pictures side by side. Run by `make face`.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

from suspension_cli.drawing.style import DPI
from tools.tables import ROOT

PICTURE = ROOT / "docs" / "images" / "face.png"
HEIGHT = 1000
"""Pixels."""


def main() -> None:
    """Write the picture."""
    with tempfile.TemporaryDirectory() as folder:
        for words in (["new", "triple", "triple.toml"], ["draw", "triple.toml"]):
            _pendsus(folder, *words)
        _pendsus(folder, "modes", "triple.toml")
        both = [
            _scaled(Image.open(Path(folder) / "results" / f"triple-{name}.png"))
            for name in ("draw", "modes")
        ]
    whole = Image.new("RGB", (sum(one.width for one in both), HEIGHT), "white")
    place = 0
    for one in both:
        whole.paste(one, (place, 0))
        place += one.width
    whole.quantize(64).save(PICTURE, optimize=True, dpi=(DPI, DPI))
    print(PICTURE.relative_to(ROOT))


def _pendsus(folder: str, *words: str) -> None:
    command = [sys.executable, "-m", "suspension_cli", *words]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)


def _scaled(picture: Image.Image) -> Image.Image:
    return picture.convert("RGB").resize((picture.width * HEIGHT // picture.height, HEIGHT))


if __name__ == "__main__":
    main()
