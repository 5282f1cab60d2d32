"""`pendsus schema`: the JSON Schema of the design file."""

from __future__ import annotations

import click


@click.command("schema")
def command() -> None:
    """Print the JSON Schema of the design file, for editors that complete and check TOML."""
    import json

    from suspension_cli.design.schema import json_schema

    click.echo(json.dumps(json_schema(), indent=2))
