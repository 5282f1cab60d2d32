"""The one way in which every analysis command runs: read, solve, save, draw, print."""

from __future__ import annotations

import inspect
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from suspension_cli.analyses import settings
from suspension_cli.analyses.analysis import Analysis, Result, Run
from suspension_cli.cli import terminal

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from suspension_cli.design.reader import Source


class Command(click.Command):
    """A command whose help lists options in groups."""

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the options group by group."""
        groups: dict[str, list[tuple[str, str]]] = {}
        for param in self.get_params(ctx):
            record = param.get_help_record(ctx)
            if isinstance(param, click.Option) and record is not None:
                groups.setdefault(getattr(param, "group", "Options"), []).append(record)
        for title in sorted(groups, key=lambda name: name != "Options"):
            with formatter.section(title):
                formatter.write_dl(groups[title])


def command(analysis: Analysis) -> click.Command:
    """Make the command of an analysis; its help is the docstring of the class, without sections."""
    text = inspect.getdoc(type(analysis)) or ""
    return Command(
        analysis.name,
        params=[*analysis.arguments, *analysis.parameters],
        callback=click.pass_context(lambda ctx, **_: run(analysis, ctx)),
        help=text.split("\n\nReturns\n")[0],
    )


def run(analysis: Analysis, ctx: click.Context) -> None:
    """Run an analysis with the options of its command."""
    from suspension_cli.files.atomic import write_bytes

    given = ctx.params
    voice = terminal.Voice(quiet=given["quiet"], verbose=given["verbose"])
    files = {param.name: given[param.name] for param in analysis.arguments}

    def ask(file: str | Source, overrides: tuple[str, ...] = ()) -> Run:
        source, setting = settings.prepared(
            ctx, file, (*overrides, *given["overrides"]), analysis.swept_names()
        )
        return Run(source, setting, voice, Path(given["out"]), settings.command_line(sys.argv))

    results: list[Result] = []
    runs = analysis.read(ask, files)
    for one in runs:
        with one.faults():
            results.append(analysis.solve(one))
    for number, (one, result) in enumerate(zip(runs, results, strict=True)):
        path = write(result, settings.folder(given["out"]), voice, given.get("as_csv", False))
        if one.setting.get("plot") or (
            one.setting.get("plot", False) is None and not given["as_json"]
        ):
            from suspension_cli.drawing.quick_import import import_matplotlib

            import_matplotlib()
            drawn = {str(param.name): one.setting[param.name] for param in analysis.drawn_with}
            for end, figure in result.figures(**drawn).items():
                form = one.setting.get("picture_format", "png")
                draw(figure, path.with_name(f"{path.stem}{end}.{form}"), voice)
        for end, data in result.analysis.animations(result, one.setting):
            moving = path.with_name(f"{path.stem}{end}")
            write_bytes(moving, data)
            voice.say(f"wrote {moving}")
        if not given["as_json"]:
            terminal.put(("\n" if number else "") + str(result))
    if given["as_json"]:
        terminal.put_documents(results)
    ctx.exit(max(result.analysis.exit_code(result) for result in results))


def write(result: Result, folder: Path, voice: terminal.Voice, as_csv: bool) -> Path:
    """Write the files of a result; return the path of the results file."""
    from suspension_cli.files.existing import replacing

    path = result.analysis.path(result, folder)
    if result.file is None:
        with replacing(path, result.source.text, voice.say):
            result.analysis.save(path, result)
    others = result.analysis.others(result, path)
    if as_csv:
        from suspension_cli.analyses import csv_files

        others += csv_files.write(result, path)
    for other in others:
        voice.say(f"wrote {other}")
    return path


def draw(figure: Figure, path: Path, voice: terminal.Voice) -> None:
    """Write a picture."""
    from suspension_cli.drawing.style import save
    from suspension_cli.files.atomic import writing_to

    with writing_to(path):
        save(figure, path)
    voice.say(f"wrote {path}")
