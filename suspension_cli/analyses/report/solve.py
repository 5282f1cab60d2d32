"""Composition of a report from its sections."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from suspension_cli.analyses.analysis import RelayedLog
from suspension_cli.analyses.report import html
from suspension_cli.analyses.report.composition import Composition, Omitted
from suspension_cli.analyses.report.sections import SECTIONS, Build, header, provenance
from suspension_cli.drawing.panels import page_width
from suspension_cli.errors import Fault, InputError, format_value

if TYPE_CHECKING:
    from suspension_cli.analyses.analysis import Run

UNSTABLE = ", or give --allow-unstable"
"""End of messages that recommend an option that `report` lacks."""


def compose(run: Run) -> str:
    """Compute the sections of a report and return its HTML.

    Raises
    ------
    InputError
        If a signal does not exist, or the design does not balance. Other errors in one section are
        written in its place.
    """
    from suspension_cli.equilibrium.nominal import expand, expand_nominal

    wanted, log = parse_sections(run.setting["sections"]), run.log
    scene = expand_nominal(run.design)
    expand(run.design)
    _check_signals(run)
    with tempfile.TemporaryDirectory(prefix="pendsus-") as folder, log.progress() as bar:
        report = Composition(run, scene, RelayedLog(log), Path(folder))
        body = []
        for number, name in enumerate(wanted):
            bar(number, len(wanted), 0.0)
            report.title, build = SECTIONS[name]
            log.detail(f"report: {name}")
            body.append(html.section(name, report.title, _content(report, build)))
        bar(len(wanted), len(wanted), 0.0)
    body += provenance(report)
    listed = [(name, SECTIONS[name][0]) for name in wanted]
    listed += [("provenance", "Provenance"), ("design", "The design file")]
    design = run.design.design
    return html.page(
        design.title or design.name, header(report), html.contents(listed) + "".join(body)
    )


def _content(report: Composition, build: Build) -> str:
    """Return the contents of a section: warnings, and results or why there are none."""
    content = []
    try:
        with page_width(html.WIDTH):
            content += build(report)
    except Omitted as reason:
        content.append(html.paragraph(html.text(reason), "none"))
    except InputError as error:
        lines = [fault.line("").removesuffix(UNSTABLE) for fault in error.faults]
        content.append(html.paragraph(f"Not computed: {html.text('; '.join(lines))}.", "none"))
        report.log.outer.warn(f"{report.title} not computed: {'; '.join(lines)}")
    name = f"{report.source.design.design.name}: "
    lines = [line.removeprefix(name) for line in report.log.take()]
    warnings = [html.paragraph(html.text(line), "warning") for line in lines]
    return "".join([*warnings, *content])


def parse_sections(text: str | None) -> tuple[str, ...]:
    """Return the named sections in order, or all if none are given; raises `InputError`."""
    from suspension_cli.design.faults import suggest

    names = [*filter(None, (name.strip() for name in (text or "").split(",")))]
    for name in names:
        if name not in SECTIONS:
            remedy = suggest(name, [*SECTIONS])
            fault = Fault("--sections", "a report has no such section", remedy, format_value(name))
            raise InputError([fault])
    return tuple(name for name in SECTIONS if name in names or not names)


def _check_signals(run: Run) -> None:
    inputs, outputs = run.setting["inputs"], run.setting["outputs"]
    if not inputs and not outputs:
        return
    from suspension_cli.linear import signals
    from suspension_cli.models import registry as models

    known = signals.bodies_with_signals(models.STRING.system(run.design))
    for name in inputs:
        signals.parse_input(name, known)
    for name in outputs:
        signals.parse_output(name, known)
