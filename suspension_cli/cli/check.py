"""`pendsus check`: is a design sound, and what do its wires carry?"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from suspension_cli.cli import limits as warnings
from suspension_cli.cli import options

if TYPE_CHECKING:
    from suspension_cli.analysis.statics import Carried


@click.command("check")
@options.designs
@options.overrides
@options.as_json_only
def command(designs: tuple[str, ...], overrides: tuple[str, ...], as_json: bool) -> None:
    """Check each DESIGN and show what its wires and blades carry; writes nothing.

    All faults of all designs are told, each on a line with file, key, value and remedy.
    """
    from suspension_cli.analysis import limits, statics
    from suspension_cli.design.reader import read
    from suspension_cli.errors import InputError, joined, printable
    from suspension_cli.models import fidelity

    good, bad, documents = [], [], []
    for file in designs:
        try:
            source = read(file, overrides)
            options.check_tables(source.design.analysis, file)
            good.append((source, fidelity.choose(source.design), statics.solve(source.design)))
        except InputError as error:
            bad.append(error if error.file else error.in_file(file))
    for source, choice, carried in good:
        name = source.design.design.name
        if as_json:
            documents.append(_document(name, source.file, carried))
        else:
            options.put(f"{printable(source.file)}: good; {choice.level}: {choice.reason}\n{_table(carried)}")
        near = limits.slackest(source.design, carried)
        if near is not None:
            options.tell(f"warning: {name}: {warnings.slack(near)}")
    if bad:
        raise joined(bad)
    if as_json:
        import json

        click.echo(json.dumps(documents[0] if len(documents) == 1 else documents))


def _document(name: str, file: str, carried: Carried) -> dict[str, Any]:
    return {
        "command": "check",
        "design": name,
        "file": file,
        "residual": carried.residual,
        "wires": [{"wire": w.label, "tension_n": w.tension, "stretch_m": w.stretch, "stress_pa": w.stress} for w in carried.wires],
        "bodies": [{"stage": b.name, "shift_m": list(b.shift), "rotation_rad": list(b.rotation)} for b in carried.bodies],
    }


def _table(carried: Carried) -> str:
    lines = ["  wire            tension   stretch    stress"]
    for wire in carried.wires:
        stress = "" if wire.stress is None else f"{wire.stress / 1e6:6.0f} MPa"
        lines.append(f"  {wire.label:12} {wire.tension:8.2f} N {wire.stretch * 1e3:6.3f} mm {stress}")
    for body in carried.bodies:
        if any(body.shift) or any(body.rotation):
            shift = ", ".join(f"{1e3 * value:.4f}" for value in body.shift)
            turn = ", ".join(f"{1e3 * value:.4f}" for value in body.rotation)
            lines.append(f"  {body.name} hangs ({shift}) mm and ({turn}) mrad from its nominal pose")
    lines.append(f"  balanced to {carried.residual:.0e} of the weight")
    return "\n".join(lines)
