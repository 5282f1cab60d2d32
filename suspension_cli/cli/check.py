"""`pendsus check`: validity and plausibility of designs, loads of their wires and blades."""

from __future__ import annotations

import sys

import click

from suspension_cli.analyses import options
from suspension_cli.cli import terminal
from suspension_cli.cli.runner import Command

STRICT = options.option("--strict", is_flag=True, help="Exit with 1 if there are warnings.")


@click.command(
    "check",
    cls=Command,
    params=[options.DESIGNS, STRICT, options.OVERRIDES, options.AS_JSON_ONLY],
)
def command(
    designs: tuple[str, ...], overrides: tuple[str, ...], strict: bool, as_json: bool
) -> None:
    """Check each DESIGN and list what its wires and blades carry; writes nothing.

    Errors of all designs are listed, one per line with file, key, value and remedy. Values that are
    valid but implausible are warnings: a wire that would break, a body denser than osmium, an
    unstable pendulum, a sensor on a stage that does not exist.

    Example: pendsus check my.toml --strict
    """
    from suspension_cli.analyses.check.solve import solve
    from suspension_cli.design.reader import read
    from suspension_cli.errors import InputError, join_errors

    good, bad = [], []
    for file in designs:
        try:
            good.append(solve(read(file, overrides)))
        except InputError as error:
            bad.append(error if error.file else error.in_file(file))
    for found in good:
        if not as_json:
            terminal.put(str(found))
        found.warn(terminal.Voice())
    if bad:
        raise join_errors(bad)
    if as_json:
        terminal.put_documents(good)
    if strict and any(found.warnings for found in good):
        sys.exit(1)
