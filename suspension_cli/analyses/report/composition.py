"""State of a report during its composition."""

from __future__ import annotations

import shlex
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from suspension_cli.analyses import options, registry, settings, tables
from suspension_cli.analyses.analysis import RelayedLog, Result, Run
from suspension_cli.analyses.report import html
from suspension_cli.analyses.settings import default_values

if TYPE_CHECKING:
    from suspension_cli.design.reader import Source
    from suspension_cli.models.registry import Choice
    from suspension_cli.scene.scene import Scene

SHARED = (options.FIDELITY, options.ACCURACY, *options.BEAM)
"""Options of a report for each of its analyses that has them."""


class Omitted(Exception):
    """Raised by a section that does not apply, with the reason."""


@dataclass(frozen=True)
class Part:
    """An analysis of a report: its section, command line and model."""

    title: str
    command: str
    choice: Choice | None = None


@dataclass
class Composition:
    """State of a report during its composition.

    `request` is the run of the report itself, `scene` the design without imperfections; `folder` is
    for analyses that write files, and `title` is that of the current section.
    """

    request: Run
    scene: Scene
    log: RelayedLog
    folder: Path
    parts: list[Part] = field(default_factory=list)
    title: str = ""

    @property
    def source(self) -> Source:
        """The design and its text."""
        return self.request.source

    def list(self, command: str, choice: Choice | None = None) -> None:
        """Add an analysis of the current section to the parts."""
        self.parts.append(Part(self.title, command, choice))

    def command(self, name: str, *words: str) -> str:
        """Return the command line of a command with options as `words`."""
        changes = (word for override in self.source.overrides for word in ("--set", override))
        return shlex.join(["pendsus", name, self.file, *words, *changes])

    @property
    def file(self) -> str:
        """File of the design in command lines."""
        return self.source.file or f"{self.source.design.design.name}.toml"

    def run(self, name: str, *words: str, **given: object) -> Result:
        """Run an analysis, and list it with its settings as words of a command line (`words`)."""
        analysis, own = registry.get(name), self.request.setting
        names = {param.name for param in analysis.parameters}
        for key, default in default_values(SHARED).items():
            if key in names and (value := own[key]) != default:
                given[key] = value
                words = (*words, f"--{key}", str(value))
        command = self.command(name, *words)
        setting = settings.merge(analysis, self.source, given | {"as_json": True})
        one = Run(self.source, setting, self.log, self.folder, command)
        with one.faults():
            result = analysis.solve(one)
        self.list(command, result.choice if analysis.has_model else None)
        return result

    def answer(self, result: Result) -> str:
        """Return the printed text of a result as HTML."""
        with tables.collecting() as found:
            answer = str(result)
        first, _, rest = answer.partition("\n")
        if first in (f"{result.title}  [{result.name}]", result.title):
            answer = rest
        return html.prose(answer, found, result.choice.line)

    def pictures(self, result: Result, caption: str) -> str:
        """Return the pictures of a result with one caption."""
        alternative, figures = f"{self.title}: picture", result.figures().values()
        return "".join(html.picture(figure, caption, alternative) for figure in figures)
