"""Sections of a report: each runs an analysis and captions its pictures."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.analyses import known_analyses, options, settings, tables, verdicts
from suspension_cli.analyses.analysis import Run
from suspension_cli.analyses.logs import RelayedLog
from suspension_cli.analyses.options import default_values
from suspension_cli.analyses.report import page
from suspension_cli.analyses.report.page import Block, Paragraph
from suspension_cli.design.derive import mirror
from suspension_cli.design.imperfections import perturbed_part
from suspension_cli.design.wires import cross_sections
from suspension_cli.errors import Fault, InputError, format_value

if TYPE_CHECKING:
    from suspension_cli.analyses.record import Record
    from suspension_cli.design.reader import Source
    from suspension_cli.design.wires import Wire, WireSet
    from suspension_cli.models.registry import Choice
    from suspension_cli.quantities.requirements import Verdict
    from suspension_cli.scene.scene import Scene

SHARED = (options.FIDELITY, options.ACCURACY, *options.BEAM)
"""Options of a report for each of its analyses that has them."""
FLOW = (("x", ("x", "pitch")), ("y", ("y", "roll")), ("z", ("z",)), ("yaw", ("yaw",)))
"""Motions of the support and of the mirror in the default responses."""
UNSTABLE = ", or give --allow-unstable"
"""End of messages that recommend an option that `report` lacks."""


REQUIREMENTS = "Requirements"
"""Title of the verdicts on the first page."""


class Omitted(Exception):
    """Raised by a section that does not apply, with the reason."""


@dataclass(frozen=True)
class Part:
    """An analysis of a report: its section, command line, model, and what that neglects."""

    title: str
    command: str
    model: str
    neglected: str


@dataclass
class Composition:
    """State of a report during its composition.

    `request` is the run of the report itself, `scene` the design without imperfections; `folder` is
    for analyses that write files, and `title` is that of the current section. `results` are those
    of the analyses that were run, the last of each, by the names of the commands.
    """

    request: Run
    scene: Scene
    log: RelayedLog
    folder: Path
    parts: list[Part] = field(default_factory=list)
    title: str = ""
    results: dict[str, Any] = field(default_factory=dict)

    @property
    def source(self) -> Source:
        """The design and its text."""
        return self.request.source

    @property
    def file(self) -> str:
        """File of the design in command lines."""
        return self.source.file or f"{self.source.design.design.name}.toml"

    def list(self, command: str, choice: Choice | None = None) -> None:
        """Add an analysis of the current section to the parts."""
        model = left = ""
        if choice is not None:
            model = choice.level
            left = choice.neglected.partition(" (tolerance")[0]
        part = Part(self.title, command, model, left.removeprefix("neglected: ") or "-")
        self.parts.append(part)

    def command(self, name: str, *words: str) -> str:
        """Return the command line of a command with options as `words`."""
        given = {"--set": self.source.overrides, "--tie": self.source.ties}
        changes = (
            word for option, texts in given.items() for text in texts for word in (option, text)
        )
        return shlex.join(["pendsus", name, self.file, *words, *changes])

    def run(self, name: str, *words: str, **given: object) -> Any:
        """Run an analysis, and list it with its settings as words of a command line (`words`)."""
        analysis = known_analyses.get(name)
        own = self.request.setting
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
        self.list(command, result.run.choice if analysis.has_model else None)
        self.results[name] = result
        return result

    def check(self) -> Any:
        """Run `check`, once for the requirements on the first page and its own section."""
        return self.results.get("check") or self.run("check")

    def answer(self, result: Record) -> Iterator[Block]:
        """Return the printed text of a result."""
        run = result.run
        with tables.collecting() as found:
            answer = str(result)
        first, _, rest = answer.partition("\n")
        if first in (f"{run.title}  [{run.name}]", run.title):
            answer = rest
        yield from page.prose(answer, found, run.choice.line)

    def pictures(self, result: Record, caption: str) -> Iterator[Block]:
        """Return the pictures of a result with one caption."""
        yield from page.pictures(result.figures().values(), caption)


def requirements(report: Composition) -> Iterator[Block]:
    """Verdicts on the requirements of the design, as `check` prints them."""
    found: Sequence[Verdict] = report.check().verdicts
    if not found:
        raise Omitted("Not judged: no model of the design is stable or valid.")
    yield Paragraph([verdicts.summarise(found)], "verdict")
    with tables.collecting() as tabulated:
        verdicts.tabulate(found)
    yield page.table(tabulated[0])
    noted = [one.requirement for one in found if one.requirement.limits.note]
    for one in noted:
        yield Paragraph([f"{one.quantity.text}: {one.limits.note}"], "model")


def yields(report: Composition) -> Iterator[Block]:
    """Fractions of random builds that meet the requirements, if the report has tolerances."""
    found = report.results.get("tolerance")
    if found is None or found.joint is None:
        return
    *single, joint = (
        f"{tables.with_error(100 * one.fraction, 100 * one.error)} % {one.name}"
        for one in (*found.yields, found.joint)
    )
    text = f"Yield of {found.good:,} random builds: {joint}"
    yield Paragraph([f"{text} ({'; '.join(single)})." if single else f"{text}."])


def models(report: Composition) -> Iterator[Block]:
    """Models of the modes and of the thermal noise, and what they neglect."""
    lines = {}
    for name, title in (("modes", "Modes"), ("thermal", "Thermal noise")):
        if name in report.results:
            line = report.results[name].run.choice.line
            lines[line] = [*lines.get(line, []), title]
    for line, titles in lines.items():
        yield Paragraph([f"{' and '.join(titles)}: {line}"], "model")


def optimised(report: Composition) -> Iterator[Block]:
    """Parameters that `optimise` found, if a results file beside the report has this design."""
    import msgspec

    design = report.source.design
    for path in sorted(report.request.folder.glob("*-optimise.h5")):
        result = _loaded(path)
        if result is None or result.run.analysis.name != "optimise":
            continue
        reached = result.design.design
        if msgspec.structs.replace(reached, design=design.design) != design:
            continue
        report.list(result.run.command, result.run.choice)
        numbers = result.numbers
        rows = zip(numbers.name, numbers.unit, numbers.before, numbers.after, strict=True)
        columns = {"parameter": "", "unit": "", "before": "#.6g", "after": "#.6g"}
        caption = f"Optimised for {Path(result.goals_file).name or 'goals'}"
        yield page.table(tables.Table(columns, [*rows]), caption)
        return


def check(report: Composition) -> Iterator[Block]:
    """Loads, stability and requirements."""
    yield from report.answer(report.check())


def drawing(report: Composition) -> Iterator[Block]:
    """Drawing to scale."""
    from suspension_cli.drawing import draw

    design = report.source.design
    scene = report.scene
    mass = page.number(float(scene.bodies.mass.sum()), 4)
    caption = f"To scale, from the side and from the front: {mass} kg in all."
    if design.perturbation:
        names = dict.fromkeys(perturbed_part(item)[1] for item in design.perturbation)
        caption += f" With imperfections of {', '.join(names)}."
    yield page.picture(draw.draw(design, scene, tabulate=False), caption)
    report.list(report.command("draw"))


def numbers(report: Composition) -> Iterator[Block]:
    """Dimensions of the stages, in the tables of the drawing; materials of the wires."""
    from suspension_cli.drawing import dimension_tables as drawn

    for one in drawn.listed(report.source.design, report.scene):
        heads = [re.sub(r"^(.*?) \((.*)\)$", "\\1\n\\2", _symbol(head)) for head in one.heads]
        columns = {head: " " if "\n" in head or head == "wires" else "" for head in heads}
        rows = [[cell.replace("−", "-") for cell in row] for row in one.rows]
        yield page.table(tables.Table(columns, rows), one.title)
    keys = drawn.key(report.source.design, report.scene)[: len(drawn.KEY)]
    yield Paragraph([" ".join(map(_symbol, keys))], "model")
    parts = [
        (stage.name, part.material or "-", _diameter(part))
        for stage in report.source.design.stage
        for part in (stage.wires, *stage.wire)
        if part is not None
    ]
    if parts:
        columns = {"wires of": "", "material": "", "diameter\nµm": ".4g"}
        yield page.table(tables.Table(columns, [*dict.fromkeys(parts)]), "Materials")


def _symbol(text: str) -> str:
    """Write symbols of formulas, ``$t_1$``, as plain text."""
    below = {"1": "₁", "2": "₂", "u": "ᵤ", None: ""}
    return re.sub(r"\$(\w)(?:_(\w))?\$", lambda m: m[1] + below[m[2]], text)


def _diameter(part: WireSet | Wire) -> float | str | None:
    """Diameter in µm, or its range; the sizes of another cross-section."""
    if part.radius is not None:
        return 2e6 * part.radius
    for shape in cross_sections(part):
        return " × ".join(f"{1e6 * size:.4g}" for size in reversed(shape.depth))
    pieces = getattr(part, "sections", None) or ()
    radii = [size for one in pieces for size in np.ravel(one.radius)]
    if not radii or None in radii:
        return None
    low = 2e6 * min(radii)
    high = 2e6 * max(radii)
    return low if low == high else f"{low:.4g} to {high:.4g}"


def response(report: Composition) -> Iterator[Block]:
    """Responses of the mirror to the support, with all loops closed."""
    setting = report.request.setting
    design = report.source.design
    into = setting["inputs"]
    out = setting["outputs"]
    last = mirror(design)
    chosen: Sequence[tuple[tuple[str, ...], tuple[str, ...]]]
    if into or out:
        chosen = [(into or ("support.x",), out or (f"{last}.x",))]
    elif {"input", "output"} & {*design.analysis.get("response", {})}:
        chosen = [((), ())]  # the design chooses
    else:
        chosen = [((f"support.{i}",), tuple(f"{last}.{o}" for o in moved)) for i, moved in FLOW]
    line = ""
    more = {}
    flags = ()
    if design.control is not None:
        yield Paragraph(["The loops of the design's [control] table are closed."])
        more = {"closed_loop": True}
        flags = ("--closed-loop",)
    for inputs, outputs in chosen:
        words = [word for name in inputs for word in ("--input", name)]
        words += [word for name in outputs for word in ("--output", name)]
        result = report.run("response", *words, *flags, inputs=inputs, outputs=outputs, **more)
        if result.run.choice.line != line:
            line = result.run.choice.line
            yield Paragraph([line], "model")
        yield from report.pictures(result, _describe_response(result))


def _describe_response(result: Any) -> str:
    largest = result.largest
    words = []
    first = result.frequency[0]
    last = result.frequency[-1]
    for o, out in enumerate(result.output):
        for i, into in enumerate(result.input):
            size = np.abs(result.value[:, o, i])
            unit = result.unit[o][i]
            name = f"{out} per {into}"
            if not size.any():
                words.append(f"{name} is 0")
                continue
            peak = float(largest.size[o, i])
            top = page.number(peak) if np.isfinite(peak) else "without limit (no loss)"
            words.append(
                f"{name} is {page.number(size[0])} {unit} at {page.number(first)} Hz, at most"
                f" {top} (at {page.number(largest.frequency[o, i], 4)} Hz) and"
                f" {page.number(size[-1])} at {page.number(last)} Hz"
            )
    return "; ".join(words) + "."


def tolerance(report: Composition) -> Iterator[Block]:
    """Statistics of random builds, from a results file of this design or computed."""
    if report.source.design.tolerance is None:
        raise Omitted("Left out, as the design has no [tolerance] table.")
    result = _stored(report, "tolerance")
    count = report.request.setting["builds"]
    if result is None:
        result = report.run("tolerance", "--builds", str(count), builds=count)
    else:
        what = f"Read from {result.run.file.name}, the results of an earlier run of this design"
        yield Paragraph([f"{what}: {result.run.command}."])
    yield from report.answer(result)
    yield from report.pictures(result, "Results of random builds.")


def _stored(report: Composition, name: str) -> Any:
    """Return a result of an earlier run of this design; None if there is none."""
    from suspension_cli.files.hdf5 import read_design, reads_alike

    path = report.request.folder / f"{report.source.stem()}-{name}.h5"
    before = read_design(path)
    if before is None or not reads_alike(before, report.source.text):
        return None
    result = _loaded(path)
    if result is None:
        return None
    report.list(result.run.command, result.run.choice)
    report.results[name] = result
    return result


def _loaded(path: Path) -> Any:
    """Read a results file; None if it is of another version, or incomplete."""
    from suspension_cli.files.hdf5 import open_results

    try:
        with open_results(path) as file:
            return known_analyses.loaded(file, str(path))
    except InputError:
        return None


def budget(report: Composition) -> Iterator[Block]:
    """Motion of the mirror by cause."""
    design = report.source.design
    requested = report.request.setting["sections"] or "budget" in design.analysis
    if design.control is None and not requested:
        raise Omitted(
            "Left out, as the design has neither damping loops ([control]) nor an"
            " [analysis.budget] table: the RMS would be that of its free resonances."
            " --sections budget computes it."
        )
    yield from _printed("budget", "Motion of the mirror by cause.")(report)


def damping(report: Composition) -> Iterator[Block]:
    """Poles and margins of the loops."""
    if report.source.design.control is None:
        raise Omitted("Left out, as the design has no damping loops ([control]).")
    yield from _printed("damp", "Poles and margins of the damping loops.")(report)


Build = Callable[[Composition], Iterator[Block]]
"""Yields the contents of a section, part by part."""


def _printed(name: str, caption: str, *words: str, **given: object) -> Build:
    """Make a section of what a command prints and draws."""

    def build(report: Composition) -> Iterator[Block]:
        result = report.run(name, *words, **given)
        yield from report.answer(result)
        yield from report.pictures(result, caption)

    return build


SHAPES = "At rest in grey, displaced in the colours of the stages, with exaggerated motion."
COUPLINGS = "Motion of the mirror per motion of the support."
SECTIONS: dict[str, tuple[str, Build]] = {
    "drawing": ("Drawing", drawing),
    "numbers": ("Main numbers", numbers),
    "check": ("Check", check),
    "modes": ("Modes", _printed("modes", SHAPES)),
    "response": ("Responses", response),
    "coupling": ("Couplings", _printed("xcouple", COUPLINGS, "--matrix", matrix=True)),
    "thermal": ("Thermal noise", _printed("thermal", "Thermal noise of the mirror by cause.")),
    "budget": ("Motion by cause", budget),
    "tolerance": ("Tolerances", tolerance),
    "damping": ("Damping loops", damping),
}
"""Titles and functions of sections, in order, by the names of `--sections`."""


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
