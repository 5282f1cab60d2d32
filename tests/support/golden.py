"""Golden files: the modes and responses of every design in `configs/` on every model, and what
commands give out of some.

`make golden` regenerates them; a value that moves needs its reason under "Numbers changed" in
CHANGELOG.md.
"""

from __future__ import annotations

import json
import shlex
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from suspension_cli.design.reader import read
from suspension_cli.linear import eigenmodes, response, roots, signals
from suspension_cli.models import registry
from tests.support.paths import CONFIGS, GOLDEN, ROOT

COMMANDS_FOLDER = GOLDEN / "commands"

FREQUENCY = np.array([0.05, 7.3, 311.0])
"""Hz, at which responses of wires with mass are kept: far below the modes, among them, among violin
modes."""
COUNTED = np.array([20.0, 700.0])
"""Hz, below which their modes are counted."""

LOOP = (
    "{name='yaw', sensor='upper.yaw', actuator='upper.torque_yaw', gain=30.0, zeros=[0.0],"
    " poles=[20.0, [10.0, 17.3]], sensor_noise=1e-9}"
)
COM = "{stage='test', com={normal=1e-4}, mass={uniform=1e-2}}"
COMMANDS = {
    "modes-double": "modes double",
    "modes-figure6": "modes husman2000/figure6 --max-frequency 500",
    "response-quadruple": (
        "response quadruple --input top.force_x --input support.z --output test.x --output"
        " test.pitch --frequency 0.1:100:7"
    ),
    "response-table2": (
        "response husman2000/table2 --fidelity string --input support.x --output test.x@0,0,0.001"
        " --frequency 0.1:1000:9"
    ),
    "thermal-geo-silica-triple": "thermal geo-silica-triple --arm 600 --frequency 0.1:3000:7",
    "thermal-figure6": (
        "thermal husman2000/figure6 --output test.x --output test.pitch --frequency 1,10,100"
    ),
    "xcouple-figure6": (
        "xcouple husman2000/figure6 --sweep k=0.8:1.2:3,offset=-1e-3:1e-3:3 --frequency 20,50"
    ),
    "xcouple-geo-silica-triple": (
        "xcouple geo-silica-triple --sweep k=0.9,1.1,com_y=0,1e-4 --fidelity violin --hold"
        " natural-length"
    ),
    "tolerance-triple": "tolerance triple-tolerance --builds 20 --seed 3 --fidelity beam",
    "tolerance-figure6": (
        f'tolerance husman2000/figure6 --set "tolerance.body=[{COM}]" --builds 60 --frequency 20'
        " --limit 1e-5"
    ),
    "damp-triple": "damp triple-damped --frequency 0.3,1,5,30 --duration 5",
    "damp-double": (
        f'damp double --set "control.loop=[{LOOP}]" --output test.yaw --impulse test.torque_yaw'
        " --frequency 0.3,1,5,30 --duration 5"
    ),
}
"""File to what is run; the design by its place in `configs/`."""


def configs() -> list[Path]:
    """Every design file that we ship but built ones, which `tests/models/test_built.py` checks."""
    return sorted(file for file in CONFIGS.rglob("*.toml") if file.parent.name != "built")


def golden_path(config: Path) -> Path:
    """Where the golden file of a design lives."""
    return GOLDEN / config.relative_to(CONFIGS).with_suffix(".json")


def command_path(name: str) -> Path:
    """Where that of a command lives."""
    return COMMANDS_FOLDER / f"{name}.json"


def every_path() -> set[Path]:
    """All golden files that there are to be."""
    return {golden_path(config) for config in configs()} | {command_path(name) for name in COMMANDS}


def computed(config: Path) -> dict[str, Any]:
    """Contents of a golden file: omega^2 in (rad/s)^2 and the home of every mode, on each valid
    model; of wires with mass, responses and counts."""
    design = read(config).design
    result: dict[str, Any] = {"auto": registry.choose(design).level}
    for level in ("force", "string", "beam"):
        if (
            result["auto"] == "force"
            if level == "force"
            else not registry.by_name(level).unsuitable(design)
        ):
            found = eigenmodes.solve(replace(registry.by_name(level).system(design), terms=()))
            result[level] = {
                "omega_squared": found.omega_squared.tolist(),
                "home": [list(home) for home in found.home],
            }
    if not registry.VIOLIN.unsuitable(design):
        result["violin"] = _with_mass(registry.VIOLIN.system(design))
    return result


def _with_mass(model: Any) -> dict[str, Any]:
    known = signals.bodies_with_signals(model)
    inputs = [
        signals.parse_input(name, known) for name in ("support.x", "support.z", "support.yaw")
    ]
    outputs = [
        signals.parse_output(f"{model.body[-1]}.{dof}", known)
        for dof in ("x", "y", "z", "pitch", "yaw")
    ]
    value = response.solve(model, FREQUENCY, inputs, outputs).value
    return {
        "real": value.real.tolist(),
        "imag": value.imag.tolist(),
        "below": roots.modes_below(model, 2 * np.pi * COUNTED).tolist(),
    }


def given_out(name: str) -> Any:
    """The JSON document of a command."""
    from tests.support.commandline import run, strict_json

    command, config, *words = shlex.split(COMMANDS[name])
    workers = ["--workers", "1"] if command in ("xcouple", "tolerance") else []
    with tempfile.TemporaryDirectory() as out:
        result = run(command, CONFIGS / f"{config}.toml", *words, *workers, "--json", "--out", out)
    assert result.exit_code == 0, result.stderr
    return strict_json(result.stdout)


def main() -> None:
    """Regenerate all golden files; those of designs and commands that are gone are removed."""
    for old in set(GOLDEN.rglob("*.json")) - every_path():
        old.unlink()
    wanted = [(golden_path(config), computed, config) for config in configs()] + [
        (command_path(name), given_out, name) for name in COMMANDS
    ]
    for path, make, of in wanted:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(make(of), indent=1) + "\n")
        print(path.relative_to(ROOT))


if __name__ == "__main__":
    main()
