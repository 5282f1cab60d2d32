"""The report of a design: its page, what is in it, and how it is composed.

>>> import suspension_cli as sus
>>> made = sus.report(sus.example("double"), "double.html", sections="check,tolerance")
>>> made.path.name, [one.title for one in made.sections if not one.missing]
('double.html', ['Check'])
"""

from __future__ import annotations

import os
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from suspension_cli.analyses.logs import RelayedLog
from suspension_cli.analyses.record import Record
from suspension_cli.analyses.report import page
from suspension_cli.analyses.report.page import Block, Paragraph
from suspension_cli.analyses.report.sections import (
    REQUIREMENTS,
    SECTIONS,
    UNSTABLE,
    Build,
    Composition,
    Omitted,
    Part,
    models,
    optimised,
    parse_sections,
    requirements,
    yields,
)
from suspension_cli.drawing.panels import page_width
from suspension_cli.errors import InputError
from suspension_cli.files.documents import Layout
from suspension_cli.quantities.requirements import Verdict
from suspension_cli.version import __version__

if TYPE_CHECKING:
    from suspension_cli.analyses.analysis import Analysis, Run


@dataclass(frozen=True)
class Section:
    """A section of a report: its name, as of `sections`, its title, and why it has no results.

    `missing` is empty where it has some.
    """

    name: str
    title: str
    missing: str


@dataclass(frozen=True, eq=False, repr=False)
class Report(Record):
    """One HTML page of a design with all its analyses.

    Attributes
    ----------
    page : str
        The page (HTML), which needs no other file.
    sections : tuple of Section
        Its sections in order: name, title, and why one has no results.
    parts : tuple of Part
        The analyses in it: title of the section, command, model, and what that neglects.
    verdicts : tuple of Verdict
        Values of what `[[requirement]]` limits, as the page begins with them.
    """

    in_json: ClassVar = Layout(without="page verdicts")
    page: str
    sections: tuple[Section, ...]
    parts: tuple[Part, ...]
    verdicts: tuple[Verdict, ...]

    @property
    def title(self) -> str:
        """Title of the page."""
        return self.run.title

    @property
    def path(self) -> Path | None:
        """Path of the page; None before it is written."""
        return self.run.file


def solve(analysis: Analysis, run: Run) -> Report:
    """Compute the sections of a report and compose its page.

    Raises `InputError` if a signal does not exist, or the design does not balance. Other errors in
    one section are written in its place.
    """
    from markupsafe import escape

    from suspension_cli.equilibrium.nominal import expand, expand_nominal
    from suspension_cli.models.registry import Choice

    wanted = parse_sections(run.setting["sections"])
    log = run.log
    scene = expand_nominal(run.design)
    expand(run.design)
    _check_signals(run)
    sections = []
    listed = []
    judged: list[Block] = []
    verdicts: tuple[Verdict, ...] = ()
    with tempfile.TemporaryDirectory(prefix="pendsus-") as folder, log.progress() as bar:
        report = Composition(run, scene, RelayedLog(log), Path(folder))
        if run.design.requirement:
            report.title = REQUIREMENTS
            judged, missing = _contents(report, requirements)
            verdicts = () if missing else report.check().verdicts
        for number, name in enumerate(wanted):
            bar(number, len(wanted), 0.0)
            report.title, build = SECTIONS[name]
            log.detail(f"report: {name}")
            contents, missing = _contents(report, build)
            sections.append((name, report.title, contents))
            listed.append(Section(name, report.title, missing))
        bar(len(wanted), len(wanted), 0.0)
        report.title = "First page"
        summary = [block for build in (yields, optimised) for block in build(report)]
    drawn = [block for name, _, blocks in sections if name == "drawing" for block in blocks]
    text = run.source.text
    made = page.environment().get_template("page.html").render(
        about=run.design.design, file=report.file, date=_today(), version=__version__,
        changes=(*run.source.overrides, *run.source.ties),
        requirements=judged, summary=summary, drawing=drawn, models=[*models(report)],
        sections=[one for one in sections if one[0] != "drawing"], parts=report.parts,
        text=escape(page.printable(text)),
        encoded=page.encode_text(text.encode()),
    )  # fmt: skip
    origin = run.origin(analysis, Choice("all", ""))
    return Report(made, tuple(listed), tuple(report.parts), verdicts, run=origin)


def _contents(report: Composition, build: Build) -> tuple[list[Block], str]:
    """Return the contents of a section, warnings first, and why it has no results, or ""."""
    contents = list[Block]()
    missing = ""
    try:
        with page_width(page.WIDTH):
            contents += build(report)
    except Omitted as reason:
        missing = str(reason)
    except InputError as error:
        lines = "; ".join(fault.line("").removesuffix(UNSTABLE) for fault in error.faults)
        missing = f"Not computed: {lines}."
        report.log.outer.warn(f"{report.title} not computed: {lines}")
    if missing:
        contents.append(Paragraph([missing], "none"))
    name = f"{report.source.design.design.name}: "
    lines = [line.removeprefix(name) for line in report.log.take()]
    return [*(Paragraph([line], "warning") for line in lines), *contents], missing


def _check_signals(run: Run) -> None:
    """Raise `InputError` if a signal does not exist."""
    inputs = run.setting["inputs"]
    outputs = run.setting["outputs"]
    if inputs or outputs:
        from suspension_cli.linear import signals
        from suspension_cli.models.registry import STRING

        known = signals.bodies_with_signals(STRING.system(run.design))
        for name in inputs:
            signals.parse_input(name, known)
        for name in outputs:
            signals.parse_output(name, known)


def _today() -> str:
    """Date for the page, UTC; that of SOURCE_DATE_EPOCH where pages must come out the same."""
    given = os.environ.get("SOURCE_DATE_EPOCH", "")
    seconds = int(given) if given.isdecimal() else time.time()
    return time.strftime("%-d %B %Y", time.gmtime(seconds))
