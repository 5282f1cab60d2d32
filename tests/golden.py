"""Golden files: the modes of every design in `configs/`, to be compared at 1e-9.

`make golden` regenerates them; a value that moves needs its reason under "Numbers changed" in CHANGELOG.md.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from suspension_cli.analysis import modes
from suspension_cli.design.reader import read
from suspension_cli.models import fidelity

ROOT = Path(__file__).parent.parent
CONFIGS = ROOT / "configs"
GOLDEN = ROOT / "tests" / "golden"


def configs() -> list[Path]:
    """Every design file that we ship."""
    return sorted(CONFIGS.rglob("*.toml"))


def golden_path(config: Path) -> Path:
    """Where the golden file of a design lives."""
    return GOLDEN / config.relative_to(CONFIGS).with_suffix(".json")


def computed(config: Path) -> dict[str, Any]:
    """What a golden file holds: omega^2 in (rad/s)^2 and the home of every mode, on each rung that holds."""
    design = read(config).design
    result: dict[str, Any] = {"auto": fidelity.choose(design).level}
    for level in ("force", "string"):
        if level == "string" or result["auto"] == "force":
            found = modes.solve(fidelity.linear_model(design, level))
            result[level] = {"omega_squared": found.omega_squared.tolist(), "home": [list(home) for home in found.home]}
    return result


def main() -> None:
    """Regenerate all golden files; those of designs that are gone are removed."""
    wanted = {golden_path(config): config for config in configs()}
    for old in set(GOLDEN.rglob("*.json")) - set(wanted):
        old.unlink()
    for path, config in wanted.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(computed(config), indent=1) + "\n")
        print(path.relative_to(ROOT))


if __name__ == "__main__":
    main()
