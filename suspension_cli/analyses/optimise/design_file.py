"""The optimised design as TOML."""

from __future__ import annotations

from pathlib import Path

from suspension_cli.analyses.optimise.optimum import Optimum
from suspension_cli.errors import escape_unprintable
from suspension_cli.files.atomic import write_bytes
from suspension_cli.version import __version__


def save_design(path: Path, found: Optimum, file: str, goals: str, command: str) -> None:
    """Write the optimised design, headed by comments on its origin and limits not met."""
    limits, numbers = found.limits, found.numbers
    colon = "" if limits.met.all() else ":"
    head = [
        f"{file}, optimised for {goals} by pendsus {__version__}:",
        f"  {command}",
        f"{int(limits.met.sum())} of {len(limits.name)} limits are met, {found.checked}{colon}",
        *(
            f"  NOT MET: {name}: {value:.6g}"
            for name, value, met in zip(limits.name, limits.value, limits.met, strict=True)
            if not met
        ),
        *(f"  UNKNOWN: {what}" for what in found.unknown),
        *(
            f"  {name} = {float(after)!r}, from {before:.6g}"
            for name, before, after in zip(numbers.name, numbers.before, numbers.after, strict=True)
        ),
    ]
    text = "".join(f"# {escape_unprintable(line)}\n" for line in head) + "\n" + found.design
    write_bytes(path, text.encode())
