"""Optimisation of section 5a of Husman et al. (2000): a triple whose modes can all be damped.

It starts from vertical wires, whose rotation is too fast. `pendsus optimise` finds the design,
`pendsus modes` checks it from its file. Writes
`results/optimise.md`, `.png`, its modes as `optimise_modes.csv` and the design as `optimise.toml`.
Run by `make optimise`.
"""

from __future__ import annotations

import csv
import io
import json
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from suspension_cli.files.whole_files import write_bytes
from tools.tables import ROOT

DESIGN, GOALS = "configs/husman2000/triple-vertical.toml", "goals/geo600.toml"
NAME = "husman2000-triple-vertical"
BAND = (0.5, 5.0)
"""Hz (section 5a)."""
DAMPED = "can be damped"
"""Verdict of `pendsus modes`."""


def pendsus(*words: str, out: Path) -> Any:
    """Run a command and return its JSON."""
    code = "from suspension_cli.cli.main import main; main(prog_name='pendsus')"
    ran = subprocess.run(
        [sys.executable, "-c", code, *words, "--out", str(out), "--json"],
        capture_output=True,
        text=True,
        check=True,
        cwd=ROOT,
    )
    return json.loads(ran.stdout)


def listed(found: dict[str, Any], before: dict[str, Any], after: dict[str, Any]) -> list[list[str]]:
    """List all modes by family, before and after, with the criterion by `pendsus modes` alone."""
    rows = [["mode", "before_hz", "after_hz", "top_mass_percent", "not_damped_because", "mostly"]]
    fresh = {mode["frequency_hz"]: mode for mode in after["modes"]}
    drawn = {mode["frequency_hz"] for mode in before["modes"]}
    for mode in found["modes"]:
        mine = fresh[min(fresh, key=lambda f: abs(f - mode["after_hz"]))]
        was = min(drawn, key=lambda f: abs(f - mode["before_hz"]))
        share = 100 * mode["top_mass_fraction_after"]
        reason = "" if mine["verdict"] == DAMPED else mine["verdict"]
        numbers = f"{was:.3f}", f"{mine['frequency_hz']:.3f}", f"{share:.1f}"
        rows.append([mode["name"], *numbers, reason, mine["label"]])
    return rows


def main() -> None:
    """Optimise, check and write the page."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        found = pendsus("optimise", DESIGN, GOALS, "--plot", out=out)
        made = out / f"{NAME}-optimised.toml"
        before, after = (pendsus("modes", file, out=out / "modes") for file in (DESIGN, str(made)))
        shutil.copyfile(out / f"{NAME}-optimise.png", ROOT / "results" / "optimise.png")
        text = made.read_text(encoding="utf-8").replace(str(out), "results")
    inside = [mode for mode in after["modes"] if mode["verdict"] == DAMPED]
    arrived = sum(start["arrived_at"] == 1 for start in found["starts"])
    met = (
        f"{sum(row['met'] for row in found['limits'])} of {len(found['limits'])} limits are met,"
        f" checked on `{found['checked_on']}`"
    )
    lines = [
        "# From vertical wires to a triple that can be damped",
        "",
        (
            f"`pendsus optimise {DESIGN} {GOALS}`: {met}; {arrived} of {len(found['starts'])}"
            " starts arrived at this design."
        ),
        (
            f"`pendsus modes` of `results/optimise.toml`, which it wrote, finds {len(inside)} of"
            f" {len(after['modes'])} modes from {BAND[0]:g} to {BAND[1]:g} Hz"
        ),
        (
            "and coupled to the top mass. Not to be damped are the highest vertical and roll modes,"
            " in which the bare wires of the last stage stretch."
        ),
        "",
        "[Every mode](optimise_modes.csv); parameters and limits are comments of"
        " [optimise.toml](optimise.toml).",
        "",
    ]
    stream = io.StringIO()
    csv.writer(stream, lineterminator="\n").writerows(listed(found, before, after))
    write_bytes(ROOT / "results" / "optimise_modes.csv", stream.getvalue().encode())
    page = "\n".join(lines)
    write_bytes(ROOT / "results" / "optimise.md", page.encode())
    write_bytes(ROOT / "results" / "optimise.toml", text.encode())
    print(page)


if __name__ == "__main__":
    main()
