"""Sections of a report: each runs an analysis and captions its pictures."""

from __future__ import annotations

import base64
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.analyses import tables
from suspension_cli.analyses.report import html
from suspension_cli.analyses.report.composition import Composition, Omitted
from suspension_cli.conventions import DOFS
from suspension_cli.design import reader
from suspension_cli.design.derive import mirror
from suspension_cli.design.imperfections import perturbed_part
from suspension_cli.design.wires import cross_sections
from suspension_cli.errors import InputError
from suspension_cli.version import __version__

if TYPE_CHECKING:
    from suspension_cli.analyses.analysis import Result
    from suspension_cli.design.reader import Source
    from suspension_cli.design.wires import Wire, WireSet

FLOW = (("x", ("x", "pitch")), ("y", ("y", "roll")), ("z", ("z",)), ("yaw", ("yaw",)))
"""Motions of the support and of the mirror in the default responses."""

Build = Callable[[Composition], Iterator[str]]
"""Yields the HTML of a section, part by part."""


def header(report: Composition) -> str:
    """Return the title of a design, its file and its reference."""
    source = report.source
    about = source.design.design
    rows = [("File", html.text(report.file))]
    if source.overrides:
        rows.append(("Changed", "<br>".join(map(html.text, source.overrides))))
    if about.reference:
        rows.append(("Reference", html.text(about.reference)))
    rows.append(("Computed by", f"pendsus {html.text(__version__)}"))
    listed = "".join(f"<dt>{name}</dt><dd>{value}</dd>\n" for name, value in rows)
    name = html.paragraph(html.text(about.name), "name") if about.title else ""
    return f"<h1>{html.text(about.title or about.name)}</h1>\n{name}<dl>\n{listed}</dl>\n"


def drawing(report: Composition) -> Iterator[str]:
    """Drawing to scale."""
    from suspension_cli.drawing import draw

    design, scene = report.source.design, report.scene
    figure = draw.draw(design, scene, tabulate=False)
    stages = len(design.stage)
    mass = float(scene.bodies.mass.sum())
    depth = -float(scene.bodies.position[1:, 2].min())
    what = f"{_count(stages, 'stage')} and {_count(len(scene.wires.label), 'wire')}"
    caption = (
        f"{what} to scale, from the side and from the front: {html.number(mass, 4)} kg in all; the"
        f" lowest centre of mass lies {html.number(depth, 4)} m below the suspension point."
    )
    if design.perturbation:
        names = dict.fromkeys(perturbed_part(item)[1] for item in design.perturbation)
        caption += f" With imperfections of {html.text(', '.join(names))}."
    yield html.picture(figure, caption, f"Drawing of {design.design.name} to scale")
    report.list(report.command("draw"))


def numbers(report: Composition) -> Iterator[str]:
    """Dimensions of the stages, in the tables of the drawing."""
    from suspension_cli.drawing import tables as drawn

    for one in drawn.listed(report.source.design, report.scene):
        heads = [re.sub(r"^(.*?) \((.*)\)$", "\\1\n\\2", _symbol(head)) for head in one.heads]
        columns = {head: " " if "\n" in head or head == "wires" else "" for head in heads}
        rows = [[cell.replace("−", "-") for cell in row] for row in one.rows]
        yield html.table(tables.Table(columns, rows), html.text(one.title))
    keys = " ".join(_symbol(line) for line in drawn.key(report.scene)[: len(drawn.KEY)])
    yield html.paragraph(html.text(keys), "model")
    yield from _materials(report)


def _symbol(text: str) -> str:
    """Write symbols of formulas, ``$t_1$``, as plain text."""
    return re.sub(
        r"\$(\w)(?:_(\w))?\$",
        lambda m: m[1] + {"1": "₁", "2": "₂", "u": "ᵤ", None: ""}[m[2]],
        text,
    )


def _materials(report: Composition) -> Iterator[str]:
    rows = []
    for stage in report.source.design.stage:
        for part in (stage.wires, *stage.wire):
            if part is not None:
                row = (stage.name, part.material or "-", _diameter(part))
                rows += [row] if row not in rows else []
    if rows:
        columns = {"wires of": "", "material": "", "diameter\nµm": ".4g"}
        yield html.table(tables.Table(columns, rows), "Materials")


def _diameter(part: WireSet | Wire) -> float | str | None:
    """Diameter in µm, or its range; the sizes of another cross-section."""
    if part.radius is not None:
        return 2e6 * part.radius
    for shape in cross_sections(part):
        return " × ".join(f"{1e6 * size:.4g}" for size in reversed(shape.depth))
    radii = [np.ravel(one.radius) for one in getattr(part, "sections", None) or ()]
    if not radii or any(None in one for one in radii):
        return None
    low, high = (2e6 * size for size in (np.min(np.hstack(radii)), np.max(np.hstack(radii))))
    return low if low == high else f"{low:.4g} to {high:.4g}"


def check(report: Composition) -> Iterator[str]:
    """Loads of wires and blades, and warnings."""
    found = report.run("check")
    if not found.warnings:
        yield html.paragraph("No warnings: every number is plausible.", "good")
    with tables.collecting() as collected:
        answer = str(found)
    yield html.prose(answer.partition("\n")[2], collected)


def modes(report: Composition) -> Iterator[str]:
    """Table and pictures of the modes."""
    from suspension_cli.analyses.modes import picture
    from suspension_cli.equilibrium.nominal import expand

    result = report.run("modes")
    yield report.answer(result)
    found = result.data
    scene = expand(result.design)
    pages = picture.draw_pages(found, result.design, scene, result.subtitle)
    for page in pages:
        named = [(n, float(found.frequency[n])) for n in page.numbers if found.frequency[n] > 0]
        kind = page.kind.capitalize() or "Modes"
        span = ""
        if named:
            (low, least), (high, most) = named[0], named[-1]
            span = (
                f" from {html.number(least)} Hz ({found.label[low]}) to {html.number(most)} Hz"
                f" ({found.label[high]})"
            )
        caption = (
            f"{kind}{html.text(span)}: at rest in grey, displaced in the colours of the stages,"
            " with exaggerated motion."
        )
        yield html.picture(page.figure, caption, f"{kind}, drawn")
    if found.wire:
        caption = "Q of all modes, those of the wires included."
        figure = picture.draw_quality(found, result.design, result.subtitle)
        yield html.picture(figure, caption, "Q of the modes")


def response(report: Composition) -> Iterator[str]:
    """Responses of the mirror to the support, with all loops closed."""
    setting, last = report.request.setting, mirror(report.source.design)
    into, out = setting["inputs"], setting["outputs"]
    closed = report.source.design.control is not None
    chosen: Sequence[tuple[tuple[str, ...], tuple[str, ...]]]
    if into or out:
        chosen = [(into or ("support.x",), out or (f"{last}.x",))]
    elif {"input", "output"} & {*report.source.design.analysis.get("response", {})}:
        chosen = [((), ())]  # the design chooses
    else:
        chosen = [((f"support.{i}",), tuple(f"{last}.{o}" for o in moved)) for i, moved in FLOW]
    line, more, flags = "", {}, ()
    if closed:
        yield html.paragraph("The loops of the design's [control] table are closed.")
        more, flags = {"closed_loop": True}, ("--closed-loop",)
    for inputs, outputs in chosen:
        options = [word for name in inputs for word in ("--input", name)]
        options += [word for name in outputs for word in ("--output", name)]
        result = report.run("response", *options, *flags, inputs=inputs, outputs=outputs, **more)
        if result.choice.line != line:
            line = result.choice.line
            yield html.paragraph(html.text(line), "model")
        yield report.pictures(result, _response_caption(result))


def _response_caption(result: Result) -> str:
    data, largest, words = result.data, result.data.largest, []
    first, last = data.frequency[0], data.frequency[-1]
    for o, out in enumerate(data.output):
        for i, into in enumerate(data.input):
            size, unit = np.abs(data.value[:, o, i]), data.unit[o][i]
            name = f"{html.text(out)} per {html.text(into)}"
            if not size.any():
                words.append(f"{name} is 0")
                continue
            peak = float(largest.size[o, i])
            top = html.number(peak) if np.isfinite(peak) else "without limit (no loss)"
            words.append(
                f"{name} is {html.number(size[0])} {unit} at {html.number(first)} Hz, at most"
                f" {top} (at {html.number(largest.frequency[o, i], 4)} Hz) and"
                f" {html.number(size[-1])} at {html.number(last)} Hz"
            )
    return "; ".join(words) + "."


def coupling(report: Composition) -> Iterator[str]:
    """Couplings of every motion of the support to every motion of the mirror."""
    result = report.run("xcouple", "--matrix", matrix=True)
    yield report.answer(result)
    data = result.data
    size = np.abs(data.value[0]) * ~np.eye(len(DOFS), dtype=bool)
    o, i = np.unravel_index(int(size.argmax()), size.shape)
    name = f"{data.input[i]} to {data.output[o]}"
    most = (
        f"the largest to another coordinate, from {html.text(name)}, is"
        f" {html.number(size[o, i])} {data.unit[o][i]}"
        if size.any()
        else "none leads to another coordinate"
    )
    caption = f"Motion of the mirror per motion of the support at {data.frequency[0]:g} Hz: "
    yield report.pictures(result, f"{caption}{most}.")


def thermal(report: Composition) -> Iterator[str]:
    """Thermal noise of the mirror along the beam."""
    result = report.run("thermal")
    yield report.answer(result)
    one = result.data[0]
    at = int(np.abs(one.frequency - 10.0).argmin())
    lead = int(one.density[:, at].argmax())
    part = 100 * one.density[lead, at] / one.density[:, at].sum()
    caption = (
        f"Thermal noise of {html.text(one.output)}: {html.number(one.amplitude[at])}"
        f" {one.unit}/√Hz at {html.number(one.frequency[at])} Hz, {part:.0f} % of its power from"
        f" {html.text(one.source[lead])}."
    )
    yield report.pictures(result, caption)


def budget(report: Composition) -> Iterator[str]:
    """Motion of the mirror by cause."""
    design = report.source.design
    requested = report.request.setting["sections"] or "budget" in design.analysis
    if design.control is None and not requested:
        raise Omitted(
            "Left out, as the design has neither damping loops ([control]) nor an"
            " [analysis.budget] table: the RMS would be that of its free resonances."
            " --sections budget computes it."
        )
    result = report.run("budget")
    yield report.answer(result)
    words = [
        f"{html.text(one.output)} moves by {html.number(float(one.rms[0]))} {one.unit} RMS,"
        f" mostly due to {html.text(one.cause[int(one.mean_square[0].argmax())])}"
        for one in result.data
    ]
    low, high = result.data[0].frequency[[0, -1]]
    caption = f"Between {low:g} and {high:g} Hz " + "; ".join(words) + "."
    yield report.pictures(result, caption)


def tolerance(report: Composition) -> Iterator[str]:
    """Statistics of random builds, from a results file of this design or computed."""
    if report.source.design.tolerance is None:
        raise Omitted("Left out, as the design has no [tolerance] table.")
    result = _stored(report, "tolerance")
    if result is not None:
        yield html.paragraph(
            f"Read from {html.text(result.file.name)}, the results of an earlier run of this"
            f" design: {html.text(result.command)}."
        )
    else:
        count = report.request.setting["builds"]
        result = report.run("tolerance", "--builds", str(count), builds=count)
    yield report.answer(result)
    one = result.data
    found, what = one.joint, "meet all limits"
    if found is None:
        found = one.under
        what = (
            f"have a coupling |{html.text(one.ratio)}| below {html.number(one.limit)} at"
            f" {html.number(one.frequency)} Hz"
        )
    low, high = found.interval
    yield report.pictures(
        result,
        f"Of {one.good:,} random builds, {100 * found.fraction:.3g} % (95 % confidence:"
        f" {100 * low:.3g} to {100 * high:.3g} %) {what}.",
    )


def _stored(report: Composition, name: str) -> Any:
    """Return a result of an earlier run of this design; None if there is none."""
    from suspension_cli.analyses import registry
    from suspension_cli.files.existing import read_design
    from suspension_cli.files.hdf5 import open_results

    source = report.source
    path = report.request.folder / f"{source.stem()}-{name}.h5"
    if read_design(path) != source.text:
        return None
    try:
        with open_results(path) as file:
            result = registry.loaded(file, str(path))
    except InputError:  # of another version, or incomplete
        return None
    report.list(result.command, result.choice)
    return result


def damping(report: Composition) -> Iterator[str]:
    """Poles and margins of the loops."""
    if report.source.design.control is None:
        raise Omitted("Left out, as the design has no damping loops ([control]).")
    result = report.run("damp")
    yield report.answer(result)
    found = result.data
    if not found.stable:
        caption = "The closed loop is unstable: its poles in the right half plane grow."
    else:
        poles = found.closed
        oscillating = (poles.q > 0.5) & np.isfinite(poles.q)
        low = oscillating & (poles.frequency < 5.0)
        largest = float(poles.q[low if low.any() else oscillating].max(initial=0.5))
        caption = (
            f"{_count(len(found.loop), 'loop')}: of the poles below 5 Hz the least damped has Q"
            f" {html.number(largest)}"
        )
        if found.sensitivity is not None:
            caption += (
                f"; the sensitivity of all loops at once is at most"
                f" {html.number(found.sensitivity.size)}, at"
                f" {html.number(found.sensitivity.frequency)} Hz"
            )
        caption += "."
    yield report.pictures(result, caption)


def provenance(report: Composition) -> list[str]:
    """Return the last sections: command and model of each part, and the design file."""
    rows = []
    for part in report.parts:
        model = left = ""
        if part.choice is not None:
            model, left = part.choice.level, part.choice.neglected.partition(" (tolerance")[0]
        left = left.removeprefix("neglected: ") or "-"
        cells = [*map(html.text, (part.title, model, left)), html.text(part.command)]
        cells[3] = f"<code>{cells[3]}</code>"
        rows.append([("t", cell) for cell in cells])
    heads = [("t", name) for name in ("part", "model", "neglected", "command")]
    text, name = _as_written(report.source), html.text(report.source.design.design.name)
    data = base64.b64encode(text.encode()).decode()
    link = f'<a download="{name}.toml" href="data:application/toml;base64,{data}">{name}.toml</a>'
    about = html.paragraph(
        f"Computed by pendsus {html.text(__version__)}. The same file, options and version give"
        " this report again; each command computes one part, and writes its numbers."
    )
    whole = html.paragraph(f"The whole design as computed: {link}.")
    return [
        html.section("provenance", "Provenance", about + html.grid(heads, rows)),
        html.section("design", "The design file", f"{whole}<pre>{html.lines(text)}</pre>\n"),
    ]


def _as_written(source: Source) -> str:
    """Return the text of a design with the comments of its file, unless that says something else.

    It does if values were overridden, or tables of numbers were read from other files.
    """
    if Path(source.file).is_file():
        try:
            text = reader.read_text(source.file)
            if reader.write_toml(reader.read_toml(source.file, text)) == source.text:
                return text
        except InputError:
            pass
    return source.text


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}{'s' * (number != 1)}"


SECTIONS: dict[str, tuple[str, Build]] = {
    "drawing": ("Drawing", drawing),
    "numbers": ("Main numbers", numbers),
    "check": ("Check", check),
    "modes": ("Modes", modes),
    "response": ("Responses", response),
    "coupling": ("Couplings", coupling),
    "thermal": ("Thermal noise", thermal),
    "budget": ("Motion by cause", budget),
    "tolerance": ("Tolerances", tolerance),
    "damping": ("Damping loops", damping),
}
"""Titles and functions of sections, in order, by the names of `--sections`."""
