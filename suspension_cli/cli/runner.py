"""The one way in which every analysis command runs: read, solve, save, draw, print."""

from __future__ import annotations

import contextlib
import inspect
import json
import shlex
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from suspension_cli.analyses import settings
from suspension_cli.analyses.analysis import Analysis, Run
from suspension_cli.cli import terminal
from suspension_cli.errors import Fault, InputError, collect, format_value, join_errors

if TYPE_CHECKING:
    from suspension_cli.design.reader import Source

WATCH = click.Option(
    ["--watch"],
    is_flag=True,
    help="Compute again when a file is saved, and say what changed; Ctrl-C ends it.",
)
"""Option of every analysis that is no setting of it."""


class Command(click.Command):
    """A command whose help lists options in groups."""

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the options group by group."""
        groups: dict[str, list[tuple[str, str]]] = {"Options": []}
        for param in self.get_params(ctx):
            record = param.get_help_record(ctx)
            if isinstance(param, click.Option) and record is not None:
                groups.setdefault(getattr(param, "group", "Options"), []).append(record)
        for title, records in groups.items():
            with formatter.section(title):
                formatter.write_dl(records)


def command(analysis: Analysis) -> click.Command:
    """Make the command of an analysis; its help is the docstring of the class, without sections."""
    text = inspect.getdoc(type(analysis)) or ""
    return Command(
        analysis.name,
        params=[*analysis.arguments, *analysis.parameters, WATCH],
        callback=click.pass_context(lambda ctx, **_: start(analysis, ctx)),
        help=text.split("\n\nReturns\n")[0],
    )


def start(analysis: Analysis, ctx: click.Context) -> None:
    """Run an analysis with the options of its command, once or after each save of its files."""
    if not ctx.params["watch"]:
        results = run(analysis, ctx)
        ctx.exit(max(map(analysis.exit_code, results)))
    from suspension_cli.cli import watching

    given = [ctx.params[str(param.name)] for param in analysis.arguments]
    files = [name for one in given for name in ([one] if isinstance(one, str) else one or ())]
    for file in files:
        if not Path(file).is_file():
            problem = "waits for files that are saved, and this is none"
            raise InputError.of("--watch", problem, "name a file", format_value(file))

    def compute() -> list[dict[str, Any]]:
        results = run(analysis, ctx)
        ctx.params["quiet"] = True  # which files are written is known from now on
        return [result.document() for result in results]

    # JSON alone is on stdout
    put = terminal.tell if ctx.params.get("as_json") else terminal.put
    watching.watch(files, compute, watching.changed_files, put)


def run(analysis: Analysis, ctx: click.Context) -> list[Any]:
    """Run an analysis with the options of its command; return its results.

    Several designs are computed one by one, and the faults of all are reported at once. If there
    are any, no file is written; an analysis without files still prints its other findings.
    """
    from suspension_cli.design.reader import Source, read

    given = ctx.params
    voice = terminal.Voice(quiet=given.get("quiet", False), verbose=given.get("verbose", False))
    names = (param.name for param in analysis.parameters)
    command_line = click.core.ParameterSource.COMMANDLINE
    typed = {n: given[n] for n in names if ctx.get_parameter_source(n) is command_line}
    files = {param.name: given[param.name] for param in analysis.arguments}
    words = shlex.join(["pendsus", *sys.argv[1:]]).encode("utf-8", "backslashreplace").decode()

    def ask(file: str | Source, overrides: tuple[str, ...] = ()) -> Run:
        changes = given["overrides"]
        tied = given["ties"]
        source = file if isinstance(file, Source) else read(file, (*overrides, *changes), tied)
        stem = given.get("stem")
        source = replace(source, given_stem=stem, overrides=changes, ties=tied)
        setting = settings.merge(analysis, source, typed)
        folder = Path(given.get("out", ""))
        return Run(source, setting, voice, folder, words)

    def solve(one: Run) -> tuple[Run, Any]:
        with one.faults(), _timed(voice, f"{one.name}: computed"):
            return one, analysis.solve(one)

    errors: list[InputError] = []
    as_json = given.get("as_json", False)
    each = [{"design": file} for file in files["designs"]] if "designs" in files else [files]
    runs = collect(partial(analysis.read, ask), each, errors)
    if analysis.has_file and not errors:
        _demand_distinct_names([one.source for one in runs])
    solved = [] if errors and analysis.has_file else collect(solve, runs, errors)
    if errors and (analysis.has_file or as_json):
        raise join_errors(errors)
    for number, (one, result) in enumerate(solved):
        if analysis.has_file:
            with _timed(voice, f"{one.name}: files written"):
                result = _write(one, result, voice)
                solved[number] = one, result
        if not as_json and (text := str(result)):
            terminal.put("\n" * (number > 0 and analysis.has_file) + text)
    if errors:
        raise join_errors(errors)
    if as_json:
        documents = [result.document() for _, result in solved]
        click.echo(json.dumps(documents[0] if len(documents) == 1 else documents))
    return [result for _, result in solved]


@contextlib.contextmanager
def _timed(voice: terminal.Voice, what: str) -> Iterator[None]:
    """Report the time that a step takes, for --verbose."""
    start = time.perf_counter()
    start_of_processor = time.process_time()
    yield
    passed = time.perf_counter() - start
    used = time.process_time() - start_of_processor
    voice.detail(f"{what} in {passed:.2f} s ({used:.2f} s of processor time)")


def _demand_distinct_names(sources: Sequence[Source]) -> None:
    """Raise `InputError` if files of two designs of a run would have the same names."""
    names = [source.stem() for source in sources]
    for n, (source, name) in enumerate(zip(sources, names, strict=True)):
        if name in names[:n]:
            key = "design.name"
            own = source.design.design.name
            problem = "is the name of another design of this run"
            remedy = "give each its own name"
            if source.given_stem:
                key = "--name"
                own = name
                remedy = "leave it out, or give one design"
                problem = "would name the files of several designs"
            raise InputError([Fault(key, problem, remedy, format_value(own))], source.file)


def _write(run: Run, result: Any, voice: terminal.Voice) -> Any:
    """Write the files of a result: HDF5, CSV and pictures; return it with its file."""
    from suspension_cli.analyses.replaced_results import remove_old_pictures, replacing
    from suspension_cli.files.whole_files import write_bytes

    result = result.complete()
    analysis = result.run.analysis
    setting = run.setting
    path = analysis.path(result, settings.folder(str(run.folder)))
    if result.run.file is None:
        with replacing(path, result.run.design, voice.say):
            analysis.save(path, result)
    result = result.in_file(path)

    written = {path}

    def write(end: str, data: bytes) -> None:
        target = path.with_name(f"{path.stem}{end}")
        write_bytes(target, data)
        written.add(target)
        voice.say(f"wrote {target}")

    with _results_complete(path):
        others = analysis.others(result, path)
        if setting.get("as_csv"):
            from suspension_cli.analyses import labelled

            others += labelled.write_csv(result, path)
        for other in others:
            voice.say(f"wrote {other}")
        pictures = setting.get("plot", False)
        form = setting.get("picture_format", "png")
        if pictures or (pictures is None and not setting["as_json"]):
            from suspension_cli.drawing.style import encode

            drawn = {str(param.name): setting[param.name] for param in analysis.drawn_with}
            for end, figure in result.figures(**drawn).items():
                write(f"{end}.{form}", encode(figure, form))
        for end, data in analysis.animations(result, setting):
            write(end, data)
    if path.suffix == ".h5" and (form == "png" or written == {path}):
        remove_old_pictures(path, written, voice.say)
    return result


@contextlib.contextmanager
def _results_complete(path: Path) -> Iterator[None]:
    """Say that the results file is complete where a file that follows it cannot be written."""
    try:
        yield
    except InputError as error:
        if not path.is_file() or not all(fault.key == "--out" for fault in error.faults):
            raise
        note = f"the results file {path} is complete"
        if path.suffix == ".h5":
            note += f", `pendsus plot {path}` draws its pictures"
        faults = [replace(one, remedy=f"{one.remedy}; {note}") for one in error.faults]
        raise InputError(faults, error.file) from None
