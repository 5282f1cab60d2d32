"""Names of all commands, one line of help for each, and the command itself."""

from __future__ import annotations

import importlib

import click

from suspension_cli.conventions import ANALYSES

OTHERS = {
    "new": ("design_files.new", "Start a design from a template or an example."),
    "import": (
        "design_files.convert",
        "Convert a save of SUMCON (KAGRA's modeller) into a design.",
    ),
    "schema": ("design_files.schema", "Print the JSON Schema of the design file."),
    "plot": ("plot.command", "Redraw the pictures of results files, alone or together."),
}
"""Commands that are no analyses: where they are, and one line of help."""
COMMANDS = (*ANALYSES, *OTHERS)
"""Names of all commands."""
_ANALYSE = "Analyse, as in pendsus response my.toml --output test.x"
_PURPOSES = {
    "Design, as in pendsus new triple my.toml": "new import check draw sweep sensitivity optimise"
    " info schema",
    _ANALYSE: "modes response thermal budget damp compare tradeoff",
    "Build and measure, as in pendsus fit my.toml measured.toml": "tolerance xcouple fit",
    "Hand over, as in pendsus report my.toml": "report export plot",
}
PURPOSES = {purpose: names.split() for purpose, names in _PURPOSES.items()}
"""Commands by purpose with an example, as help lists them; others are analyses."""
PURPOSES[_ANALYSE] += [
    name for name in ANALYSES if name not in " ".join(_PURPOSES.values()).split()
]


def summary(name: str) -> str:
    """Return one line of help; for an analysis the docstring of its folder."""
    if name in OTHERS:
        return OTHERS[name][1]
    text = importlib.import_module(f"suspension_cli.analyses.{name}").__doc__ or ""
    return " ".join(text.split("\n\n")[0].split())


def get(name: str) -> click.Command:
    """Import a command: that of an analysis, or another."""
    if name in ANALYSES:
        from suspension_cli.analyses import registry
        from suspension_cli.cli.runner import command

        return command(registry.get(name))
    module, _, function = OTHERS[name][0].partition(".")
    return getattr(importlib.import_module(f"suspension_cli.cli.{module}"), function)
