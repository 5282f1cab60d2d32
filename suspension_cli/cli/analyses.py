"""What every analysis command does before and after its own work."""

from __future__ import annotations

import contextlib
import dataclasses
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from suspension_cli.cli import options

if TYPE_CHECKING:
    from suspension_cli.analysis.coupling import Question
    from suspension_cli.design.reader import Source
    from suspension_cli.design.schema import Design
    from suspension_cli.mechanics.model import LinearModel
    from suspension_cli.models.fidelity import Choice
    from suspension_cli.results import Provenance


@dataclasses.dataclass(frozen=True)
class Read:
    """A design that was read: the design, its TOML text with overrides, and the file's name."""

    design: Design
    text: str
    file: str

    def faults(self) -> contextlib.AbstractContextManager[None]:
        """Tell faults found while solving as faults of this file."""
        from suspension_cli.errors import faults_of

        return faults_of(self.file)


def prepared(ctx: click.Context, file: str, overrides: tuple[str, ...], extra: tuple[str, ...] = ()) -> tuple[Read, dict[str, Any]]:
    """Read a design, and the command's options with the defaults that its `[analysis]` table gives."""
    from suspension_cli.design.reader import read

    source = read(file, overrides)
    options.check_tables(source.design.analysis, source.file)
    table = source.design.analysis.get(str(ctx.command.name), {})
    return Read(source.design, source.text, source.file), options.with_analysis_table(ctx, table, source.file, extra)


def provenance(source: Read, choice: Choice, argv: list[str]) -> Provenance:
    """What a results file says of where it comes from."""
    from suspension_cli.results import Provenance

    return Provenance(source.text, options.command_line(argv), choice.level, choice.reason, error=choice.error)


def plain(values: Any) -> Any:
    """Numbers for JSON, as lists like their arrays: null for those that are not finite."""
    import numpy as np

    return np.where(np.isfinite(values), values, None).tolist()  # pyright: ignore[reportAttributeAccessIssue]


def draw(figure: Any, path: Path, voice: options.Voice) -> None:
    """Write a figure."""
    from suspension_cli.plots.style import save
    from suspension_cli.results import writing_to

    with writing_to(path):
        save(figure, path)
    voice.say(f"wrote {path}")


@contextlib.contextmanager
def written(path: Path, source: Read | Source, voice: options.Voice) -> Iterator[None]:
    """Say that a file of results was written in the meantime, and if it took the place of another design's."""
    from suspension_cli.results.held import design_in

    before = design_in(path)
    yield
    replaced = before is not None and before != source.text
    voice.say(f"wrote {path}" + (", in place of the result of another design of this name (--out or design.name keeps both)" if replaced else ""))


HOW = {
    "--workers": 1,
    "--scheduler": 1,
    "--chunk": 1,
    "--out": 1,
    "--resume": 0,
    "--json": 0,
    "--plot": 0,
    "--no-plot": 0,
    "-q": 0,
    "--quiet": 0,
    "-v": 0,
    "--verbose": 0,
}
"""Options (and how many words follow each) that say how to run a sweep, not what it finds: they are not recorded."""


def what(argv: list[str]) -> str:
    """The command line without the options in `HOW`, so that the same sweep writes the same file however it was run."""
    kept: list[str] = []
    words = iter(argv[1:])
    for word in words:
        name, equals, _ = word.partition("=")
        if name in HOW:
            for _skipped in range(0 if equals else HOW[name]):
                next(words, None)
        else:
            kept.append(word)
    return options.command_line(["pendsus", *kept])


def swept(job: Any, path: Path, group: str, source: Read, choice: Choice, setting: dict[str, Any], voice: options.Voice, fill: Any, after: Any = None) -> None:
    """Run a sweep into its file, with a progress bar on stderr if it takes more than a second."""
    from suspension_cli.batch import Plan, run
    from suspension_cli.cli.progress import Bar
    from suspension_cli.errors import Interrupted, printable
    from suspension_cli.results import Provenance

    origin = Provenance(source.text, what(sys.argv), choice.level, choice.reason, sweep=job.identity, error=choice.error)
    try:
        with written(path, source, voice), Bar(enabled=not voice.quiet) as bar:
            run(job, path, group, origin, Plan(setting["workers"], setting["scheduler"], setting["chunk"], setting["resume"], bar), fill, after)
    except KeyboardInterrupt:
        part = path.with_name(f"{path.name}.part")
        kept = f"; what is done is in {part}, and the same command with --resume goes on" if part.exists() else ""
        raise Interrupted(printable(f"interrupted{kept}")) from None


def question(model: LinearModel, setting: dict[str, Any]) -> Question:
    """What a sweep asks of every build: the ratio of two outputs for one input, and which wire and body are imperfect."""
    from suspension_cli.analysis import signals
    from suspension_cli.analysis.coupling import Question
    from suspension_cli.design.faults import suggestion
    from suspension_cli.errors import Fault, InputError, shown
    from suspension_cli.grids import grid

    known, labels = signals.bodies(model), list(model.wire)
    wire = setting.get("wire") or next((label for label in labels if label.startswith(f"{model.body[-1]}.")), None)
    if wire is not None and wire not in labels:
        raise InputError([Fault("--wire", "names no wire", suggestion(wire, labels), shown(wire))])
    body = setting.get("body") or (model.body[-1] if wire is None else wire.rsplit(".", 1)[0])
    if body not in model.body:
        raise InputError([Fault("--body", "names no stage", suggestion(body, list(model.body)), shown(body))])
    watched, _, point = (setting["observe"] or f"{model.body[-1]}@0,0,-0.001").partition("@")
    at = f"@{point}" if point else ""
    return Question(
        wire=-1 if wire is None else labels.index(wire),
        body=model.body.index(body) + 1,
        hold=setting.get("hold", ""),
        input=signals.drive(setting["drive"], known),
        over=signals.motion(setting["over"] or f"{watched}.x{at}", known),
        under=signals.motion(setting["under"] or f"{watched}.z{at}", known),
        frequency=tuple(grid(setting["frequency"], "--frequency", "log", lowest=0.0)),
    )
