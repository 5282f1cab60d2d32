"""`pendsus fit`: numbers of a design learned from measured modes."""

from __future__ import annotations

import math
import sys
from typing import TYPE_CHECKING, Any

import click

from suspension_cli.cli import options

if TYPE_CHECKING:
    from suspension_cli.analysis.fit import Fit


@click.command("fit")
@options.design
@click.argument("measured", metavar="MEASURED")
@options.analysis
@click.pass_context
def command(ctx: click.Context, design: str, measured: str, overrides: tuple[str, ...], out: str, as_json: bool, quiet: bool, verbose: bool, **_: Any) -> None:
    """Learn numbers of a design from measured modes.

    MEASURED is a TOML file of frequencies with uncertainties and of the numbers that are free.  Writes DIR/NAME-fit.h5 and .png, and the fitted design
    as DIR/NAME-fitted.toml.
    """
    from pathlib import Path

    from suspension_cli.analysis import fit
    from suspension_cli.cli import analyses
    from suspension_cli.design import measured as measurements
    from suspension_cli.errors import Fault, InputError, shown
    from suspension_cli.models.fidelity import Choice
    from suspension_cli.results import fit as files

    voice = options.Voice(quiet, verbose)
    source, setting = analyses.prepared(ctx, design, overrides)
    given = measurements.read(measured)
    if setting["fidelity"] not in ("auto", "string"):
        fault = Fault("--fidelity", "has no derivatives", "take auto or string", shown(setting["fidelity"]))
        raise InputError([fault], source.file)
    with source.faults():
        found = fit.solve(source.text, given)
    name, folder = source.design.design.name, options.folder(out)
    path = folder / f"{name}-fit.h5"
    choice = Choice("string", "general string model, whose derivatives are exact")
    files.save(path, found, analyses.provenance(source, choice, sys.argv), Path(measured).read_text(encoding="utf-8-sig"))
    files.save_design(folder / f"{name}-fitted.toml", found, Path(design).name, Path(measured).name, options.command_line(sys.argv))
    voice.say(f"wrote {path}\nwrote {folder / f'{name}-fitted.toml'}")
    for label, bound in zip(found.name, found.at_bound, strict=True):
        if bound:
            voice.warn(f"{label} ends at its bound")
    if setting["plot"] or (setting["plot"] is None and not as_json):
        from suspension_cli.plots import fit as picture

        analyses.draw(picture.draw(found, source.design.design.title or name), path.with_suffix(".png"), voice)
    if as_json:
        import json

        click.echo(json.dumps(document(name, found)))
    else:
        click.echo("\n".join(table(found)))


def document(name: str, found: Fit) -> dict[str, Any]:
    """The JSON document; null for an uncertainty that is infinite or that of a number at its bound."""

    def plain(value: float) -> float | None:
        return float(value) if math.isfinite(value) else None

    learned = [
        {"name": label, "start": float(start), "value": float(value), "sigma": plain(sigma), "at_bound": bool(bound)}
        for label, start, value, sigma, bound in zip(found.name, found.start, found.value, found.sigma, found.at_bound, strict=True)
    ]
    modes = [
        {"label": label, "measured_hz": float(m), "uncertainty_hz": float(u), "before_hz": plain(b), "after_hz": plain(a), "residual": plain(r)}
        for label, m, u, b, a, r in zip(found.label, found.measured, found.uncertainty, found.before, found.after, found.residual, strict=True)
    ]
    return {
        "command": "fit",
        "design": name,
        "fidelity": "string",
        "parameters": learned,
        "covariance": [[plain(value) for value in row] for row in found.covariance],
        "modes": modes,
        "chi_squared": found.chi_squared,
        "degrees_of_freedom": found.freedom,
        "singular_values": found.singular.tolist(),
        "directions": found.direction.tolist(),
    }


def table(found: Fit) -> list[str]:
    """What was learned, how modes lie, and what the data cannot tell apart."""
    wide = max(len(name) for name in found.name)
    lines = [
        f"{name:{wide}}  {start:#.6g} -> {value:#.6g} +- {sigma:.2g}"
        for name, start, value, sigma in zip(found.name, found.start, found.value, found.sigma, strict=True)
    ]
    lines += ["", "   measured        before    after Hz  residual  mode"]
    for n, label in enumerate(found.label):
        known = f"{found.measured[n]:#9.5g} +- {found.uncertainty[n]:.2g}"
        lines.append(f"{known:18} {found.before[n]:#9.5g} {found.after[n]:#9.5g}  {found.residual[n]:+8.2f}  {label}")
    lines += ["", f"chi^2 {found.chi_squared:.4g} for {found.freedom} degrees of freedom"]
    lines += ["", "what the modes by themselves say, from best to worst known combination of relative changes:"]
    for value, row in zip(found.singular, found.direction, strict=True):
        parts = " ".join(f"{share:+.2f} {name}" for share, name in zip(row, found.name, strict=True) if abs(share) >= 0.05)
        lines.append(f"  {f'to {100 / value:.2g} %' if value > 1e-9 * found.singular[0] else 'not at all'}: {parts}")
    if len(found.singular) < len(found.name):
        lines.append(f"  and {len(found.name) - len(found.singular)} not at all: there are more numbers than modes")
    return lines
