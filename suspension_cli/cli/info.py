"""`pendsus info`: how complete a model a design needs, and why."""

from __future__ import annotations

import click

from suspension_cli.analyses import options, settings
from suspension_cli.cli import terminal
from suspension_cli.cli.runner import Command


@click.command("info", cls=Command, params=[options.DESIGN, *options.INFO])
@click.pass_context
def command(
    ctx: click.Context, design: str, overrides: tuple[str, ...], as_json: bool, **_: object
) -> None:
    """Compute the errors of the models of a design, and name the model that `auto` takes.

    Prints both for the modes, one response and its thermal noise. Writes no file.

    Example: pendsus info my.toml --output test.pitch
    """
    from suspension_cli.analyses.info.solve import solve

    found = solve(*settings.prepared(ctx, design, overrides), terminal.Voice())
    if as_json:
        terminal.put_documents([found])
    else:
        terminal.put(str(found))
