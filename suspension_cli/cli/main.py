"""The `pendsus` command; each subcommand is imported only when it runs."""

from __future__ import annotations

import atexit
import gc
import importlib
import os

import click

from suspension_cli.cli.terminal import guard_streams, in_one_line, raising_signals
from suspension_cli.conventions import ANALYSES
from suspension_cli.errors import suggest
from suspension_cli.version import __version__

MANY = 100_000
"""Objects made between two collections of garbage: a run imports many, and none is garbage."""

ONE_THREAD = "1"
"""Threads of linear algebra, unless the environment gives their number: matrices are small, and on
a machine with other work a second thread that waits for a core makes some commands ten times
slower."""


OTHERS = {
    "new": ("new", "Start a design from a template or an example."),
    "import": ("convert", "Convert a file of SUMCON (KAGRA) or gwinc (LIGO) into a design."),
    "schema": ("schema", "Print the JSON Schema of the design file."),
    "plot": ("plot", "Redraw the pictures of results files, alone or together."),
}
"""Commands that are no analyses: their function in `file_commands`, and one line of help."""
COMMANDS = (*ANALYSES, *OTHERS)
"""Names of all commands."""
ANALYSE = "Analyse, as in pendsus response my.toml --output test.x"
PURPOSES = {
    "Design, as in pendsus new triple my.toml": "new import check draw sweep sensitivity optimise"
    " schema",
    ANALYSE: "modes response thermal budget damp simulate compare tradeoff",
    "Build and measure, as in pendsus fit my.toml measured.toml": "tolerance xcouple fit",
    "Hand over, as in pendsus report my.toml": "report export plot",
}
"""Commands by purpose with an example, as help lists them; analyses that stand nowhere else are
listed under `ANALYSE`."""


def summary(name: str) -> str:
    """Return one line of help; for an analysis the docstring of its folder."""
    if name in OTHERS:
        return OTHERS[name][1]
    text = importlib.import_module(f"suspension_cli.analyses.{name}").__doc__ or ""
    return " ".join(text.split("\n\n")[0].split())


def get(name: str) -> click.Command:
    """Import a command: that of an analysis, or another."""
    if name in ANALYSES:
        from suspension_cli.analyses import known_analyses
        from suspension_cli.cli.runner import command

        return command(known_analyses.get(name))
    from suspension_cli.cli import file_commands

    return getattr(file_commands, OTHERS[name][0])


class LazyGroup(click.Group):
    """Commands that are imported when they are called, and whose errors are one line each."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """List the names."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import one command."""
        return get(cmd_name) if cmd_name in COMMANDS else None

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command, or suggest a similar one."""
        if args and args[0] not in COMMANDS and not args[0].startswith("-"):
            ctx.fail(f"No such command {args[0]!r}; {suggest(args[0], list(COMMANDS))}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands by purpose, without importing them."""
        listed = {purpose: names.split() for purpose, names in PURPOSES.items()}
        known = " ".join(PURPOSES.values()).split()
        listed[ANALYSE] += [name for name in ANALYSES if name not in known]
        for purpose, names in listed.items():
            with formatter.section(purpose):
                formatter.write_dl([(name, summary(name)) for name in names])

    def make_context(
        self,
        info_name: str | None,
        args: list[str],
        parent: click.Context | None = None,
        **extra: object,
    ) -> click.Context:
        """Parse the options before the command; `--help` and `--version` print here."""
        for library in ("OPENBLAS", "OMP", "MKL"):  # read when numpy is imported
            os.environ.setdefault(f"{library}_NUM_THREADS", ONE_THREAD)
        gc.set_threshold(MANY, 20, 20)
        # the end gives back all memory; a search for garbage there takes a tenth of a short run
        atexit.register(gc.freeze)
        guard_streams()
        with in_one_line():
            return super().make_context(info_name, args, parent, **extra)

    def invoke(self, ctx: click.Context) -> object:
        """Run a command; errors become lines on stderr and an exit code."""
        command = lambda: self.get_command(ctx, ctx.invoked_subcommand or "")  # noqa: E731
        with in_one_line(command), raising_signals():
            return super().invoke(ctx)


@click.group(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="pendsus")
def main() -> None:
    """Linear models of the pendulums that hang mirrors, from one TOML file per design.

    Start with `pendsus new triple my.toml`, then `pendsus modes my.toml`.
    """
