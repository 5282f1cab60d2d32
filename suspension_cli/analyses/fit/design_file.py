"""The fitted designs as TOML."""

from __future__ import annotations

from pathlib import Path

from suspension_cli.analyses.fit.result import Fit
from suspension_cli.analyses.fit.text import format_uncertainty
from suspension_cli.errors import escape_unprintable
from suspension_cli.files.atomic import write_bytes
from suspension_cli.version import __version__


def save_design(
    path: Path, found: Fit, number: int, file: str, measured: str, command: str
) -> None:
    """Write the fitted design of an experiment (from 0), headed by comments on its origin."""
    others = ", ".join(name for n, name in enumerate(found.experiment) if n != number)
    together = f" together with {others}" if others else ""
    head = [f"{file}, fitted to {measured}{together} by pendsus {__version__}:"]
    head += ["MISFIT: these parameters do not explain the measurements"] * found.unlikely
    head += ["MISFIT: these parameters contradict their priors"] * found.unlikely_priors
    if found.responses is not None:
        head += [one.text for one in found.responses.corrections]
    head += [f"  {command}", f"chi^2 = {found.chi_squared:.4g}, {found.freedom} degrees of freedom"]
    for n, name in enumerate(found.name):
        if found.shared[n, number]:
            sigma = format_uncertainty(found, n)
            value = f"{float(found.value[n])!r}{', ' if sigma.startswith('not') else ' '}{sigma}"
            head.append(f"  {name} = {value}, from {found.start[n]:.6g}")
    text = "".join(f"# {escape_unprintable(line)}\n" for line in head) + "\n" + found.design[number]
    write_bytes(path, text.encode())
