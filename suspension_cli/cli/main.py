"""The `pendsus` command.  Each subcommand is a module of its own, imported only when it runs."""

from __future__ import annotations

import importlib
from typing import Any

import click

from suspension_cli import __version__
from suspension_cli.cli.ending import guard_streams, in_one_line

COMMANDS = {
    "modes": "Frequencies and shapes of the normal modes.",
    "response": "Transfer functions from the support or a force to any motion.",
    "thermal": "Thermal noise of any motion, split by what dissipates.",
    "sweep": "Modes, responses and couplings over any parameters.",
    "sensitivity": "What 1 % of every number of a design moves.",
    "fit": "Learn numbers of a design from measured modes.",
    "optimise": "Choose numbers of a design so that it meets goals.",
    "xcouple": "Cross-coupling of imperfect builds, over any imperfections.",
    "tolerance": "Random builds: scatter of modes and cross-coupling, what matters most.",
    "tradeoff": "Speed against accuracy of every rung and method.",
    "damp": "Local control: closed-loop poles, margins, impulse response, sensor noise.",
    "export": "State space for control: mat, npz, hdf5, zpk, python-control.",
    "info": "How much model a design needs, and which rung auto takes.",
    "check": "Check designs and show what their wires carry.",
    "draw": "Draw a design to scale, side on and face on.",
    "new": "Start a design: a commented, valid file to edit.",
    "schema": "Print the JSON Schema of the design file.",
    "plot": "Redraw the plot of a results file.",
}
"""Name and one line of help of every subcommand; each lives in ``suspension_cli.cli.NAME`` as ``command``."""


class LazyGroup(click.Group):
    """A group whose commands are imported when they are called, and whose errors are one line each."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names in the order in which a user meets them."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import one command."""
        if cmd_name not in COMMANDS:
            return None
        return importlib.import_module(f"suspension_cli.cli.{cmd_name}").command

    def resolve_command(self, ctx: click.Context, args: list[str]) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command, or say which one may have been meant."""
        if args and args[0] not in COMMANDS and not args[0].startswith("-"):
            from suspension_cli.design.faults import suggestion

            ctx.fail(f"No such command {args[0]!r}; {suggestion(args[0], list(COMMANDS))}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands without importing them."""
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))

    def make_context(self, info_name: str | None, args: list[str], parent: click.Context | None = None, **extra: Any) -> click.Context:
        """Parse the options before the command; `--help` and `--version` print here."""
        guard_streams()
        with in_one_line():
            return super().make_context(info_name, args, parent, **extra)

    def invoke(self, ctx: click.Context) -> object:
        """Run a command; what stops it becomes lines on stderr and an exit code."""
        with in_one_line(lambda: self.get_command(ctx, ctx.invoked_subcommand or "")):
            return super().invoke(ctx)


@click.group(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="pendsus")
def main() -> None:
    """Linear models of the pendulums that hang mirrors, from one TOML file a design.

    Start with `pendsus new triple my.toml`, then `pendsus modes my.toml`.
    """
