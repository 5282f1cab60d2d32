"""`pendsus schema`: the JSON Schema of the design file, or of files of measurements."""

from __future__ import annotations

import click


@click.command("schema")
@click.option(
    "--measured",
    is_flag=True,
    help="Print the schema of files of measurements (docs/measurements.md).",
)
def command(measured: bool) -> None:
    """Print the JSON Schema of the design file, for editors that complete and check TOML."""
    import json

    if measured:
        from suspension_cli.design.measured import json_schema
    else:
        from suspension_cli.design.schema import json_schema

    click.echo(json.dumps(json_schema(), indent=2))
