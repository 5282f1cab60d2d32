"""`pendsus xcouple`: cross-coupling of imperfect builds."""

from __future__ import annotations

import math
import sys
from typing import TYPE_CHECKING, Any

import click

from suspension_cli.cli import options

if TYPE_CHECKING:
    from suspension_cli.analysis.asked import Transfer
    from suspension_cli.analysis.axes import Axis
    from suspension_cli.analysis.coupling import Question
    from suspension_cli.models.fidelity import Choice

DEFAULT_GRID = {"k": "0.6:1.4:41", "mass": "0.9:1.1:41", "inertia": "0.9:1.1:41"}
OTHER_GRID = "-2e-3:2e-3:5"
LEVELS = ("string", "beam", "violin")
"""Rungs that imperfect builds have; the first unless another is asked for."""


@click.command("xcouple")
@options.design
@click.option(
    "--sweep",
    default="k,offset",
    show_default=True,
    metavar="NAME[=GRID],...",
    help="Imperfections (k, offset, lower_offset, length, mass, com, ...) or dotted paths.",
)
@click.option("--wire", metavar="STAGE.N", help="The imperfect wire.  [default: the first of the last stage]")
@click.option("--body", metavar="STAGE", help="The imperfect body.  [default: the wire's]")
@click.option(
    "--hold", type=click.Choice(["loaded-length", "natural-length"]), default="loaded-length", show_default=True, help="What stays as the wire changes."
)
@options.question
@click.option(
    "--tolerance",
    type=options.Finite(1e-12, 1.0),
    metavar="SHARE",
    help="Of the largest coupling: what strings may leave out before auto takes beam or violin.  [default: strings, with a warning from 1 %]",
)
@click.option("--matrix", is_flag=True, help="The six-by-six table of couplings of this one design instead of a sweep.")
@options.batch
@options.allow_unstable
@options.analysis
@click.pass_context
def command(ctx: click.Context, design: str, overrides: tuple[str, ...], out: str, as_json: bool, quiet: bool, verbose: bool, **_: Any) -> None:
    """How much of one motion becomes another in imperfect builds.

    Sweeps the product of any number of imperfections; writes DIR/NAME-xcouple.h5 and .png.
    """
    from suspension_cli.analysis import signals
    from suspension_cli.cli import analyses, rung

    voice = options.Voice(quiet, verbose)
    source, setting = analyses.prepared(ctx, design, overrides, extra=swept_names())
    with source.faults():
        choice = rung.imperfect(source, setting["fidelity"], LEVELS)
        model = rung.stood(source, choice, setting["allow_unstable"], voice, bends=True)
        question = analyses.question(model, setting)
    if setting["matrix"]:
        _matrix(source, choice, signals.bodies(model), question, setting, out, as_json, voice)
        return
    _sweep(source, choice, question, setting, out, as_json, voice)


def swept_names() -> tuple[str, ...]:
    """Keys of `[analysis.xcouple]` that are no options: imperfections, whose grids stand there."""
    from suspension_cli.analysis.coupling import PARAMETERS

    return tuple(PARAMETERS)


def axes(text: str, table: dict[str, Any]) -> tuple[Axis, ...]:
    """The axes that `--sweep` asks for; grids left out come from the design's table, then from the defaults."""
    from suspension_cli.analysis.axes import Axis
    from suspension_cli.analysis.coupling import PARAMETERS, UNITS
    from suspension_cli.design.faults import suggestion
    from suspension_cli.errors import Fault, InputError, shown
    from suspension_cli.grids import grid

    parts: list[str] = []
    for piece in text.split(","):
        if parts and _is_number(piece):
            parts[-1] += f",{piece}"  # one more value of a list
        else:
            parts.append(piece)
    result = []
    for part in parts:
        name, equals, values = (piece.strip() for piece in part.partition("="))
        if name not in PARAMETERS and "." not in name:
            raise InputError([Fault("--sweep", f"there is no imperfection {name!r}", suggestion(name, list(PARAMETERS)) + " or a dotted path", shown(text))])
        if "." in name and not equals:
            raise InputError([Fault("--sweep", f"{name} has no grid", f"write {name}=start:stop:count", shown(text))])
        given = values or _grid_text(table.get(name, DEFAULT_GRID.get(name, OTHER_GRID)))
        lowest = 0.0 if UNITS.get(name) == "1" else -math.inf  # factors
        result.append(Axis(name, tuple(grid(given, f"--sweep {name}", lowest=lowest))))
    if len({axis.name for axis in result}) < len(result):
        raise InputError([Fault("--sweep", "names a parameter twice", "give each once", shown(text))])
    return tuple(result)


def _grid_text(value: Any) -> str:
    """A grid of the design's table as it would have come from the command line."""
    return ",".join(map(str, value)) if isinstance(value, list) else str(value)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _sweep(source: Any, choice: Any, question: Question, setting: dict[str, Any], out: str, as_json: bool, voice: options.Voice) -> None:
    from suspension_cli.analysis import rungs
    from suspension_cli.analysis.coupling import Sweep
    from suspension_cli.cli import analyses, rung
    from suspension_cli.results import coupling as files

    table = source.design.analysis.get("xcouple", {})
    with source.faults():
        job = Sweep(source.text, axes(setting["sweep"], table), question, setting["allow_unstable"], choice.level)
        job.check()
        higher = ""
        if choice.level == "string" and setting["fidelity"] == "auto":
            job, choice, higher = rungs.weighed(job, choice, setting["tolerance"])
    path = options.folder(out) / f"{source.design.design.name}-xcouple.h5"
    analyses.swept(job, path, "xcouple", source, choice, setting, voice, lambda group: files.fill(group, job))
    answer = files.load(path)
    bad = {reason: count for reason, count in answer.failures.items() if count}
    if bad:
        voice.warn("; ".join(f"{count} of {job.count} builds failed: {reason}" for reason, count in bad.items()))
    if choice.level == "string" and higher and not choice.error <= rung.TOLD:
        voice.warn(f"{_changed(higher, choice.error)}: --fidelity {higher} has {'it' if higher == 'beam' else 'them'}")
    _warn_of_faint(question, answer, voice)
    if setting["plot"] or (setting["plot"] is None and not as_json):
        from suspension_cli.plots import coupling as picture

        analyses.draw(picture.draw(answer, source.design.design.title or source.design.design.name), path.with_suffix(".png"), voice)
    if as_json:
        import json

        click.echo(json.dumps(document(source.design.design.name, choice, answer)))
    else:
        options.put(summary(answer))


def _changed(higher: str, error: float) -> str:
    """What a higher rung changes of the couplings."""
    from suspension_cli.analysis.rungs import MORE

    if math.isnan(error):
        return f"what the {MORE[higher]} would change of these couplings is not known, as not all builds at the ends of the axes hang on both rungs"
    return f"{MORE[higher]} change{'s' if higher == 'beam' else ''} these couplings by {float(f'{100 * error:.2g}'):g} % of the largest"


def _warn_of_faint(question: Question, answer: Any, voice: options.Voice) -> None:
    """Say with a number where couplings are so faint that rounding of the attachments' coordinates shows."""
    import numpy as np

    from suspension_cli.analysis.coupling import FAINT

    size = np.abs(answer.ratio)
    faint = (size > 0) & (size < FAINT)
    if question.over.unit == question.under.unit and faint.any():
        voice.warn(
            f"{int(faint.sum())} of {size.size} couplings are below {FAINT:g} (down to {size[faint].min():.1e}), where rounding takes all but two digits"
        )


def document(name: str, choice: Choice, answer: Any) -> dict[str, Any]:
    """The JSON document: first axis first; a failed build is null."""
    from suspension_cli.cli import analyses, rung

    single = len(answer.frequency) == 1
    ratio = answer.ratio[..., 0] if single else answer.ratio
    return {
        "command": "xcouple",
        "design": name,
        "fidelity": choice.level,
        "estimated_error": rung.estimate(choice),
        "axes": [{"name": axis.name, "values": list(axis.values)} for axis in answer.axes],
        "ratio_real": analyses.plain(ratio.real),
        "ratio_imag": analyses.plain(ratio.imag),
        "frequency_hz": answer.frequency[0] if single else answer.frequency.tolist(),
        "input": answer.input,
        "over": answer.over,
        "under": answer.under,
        "hold": answer.hold,
        "failures": answer.failures,
    }


def summary(answer: Any) -> str:
    """A few lines for people."""
    import numpy as np

    size = np.abs(answer.ratio)
    if not np.isfinite(size).any():
        return "no build has an equilibrium on taut wires"
    where = np.unravel_index(int(np.nanargmax(size)), size.shape)
    at = ", ".join(f"{axis.name} = {axis.values[n]:.6g}" for axis, n in zip(answer.axes, where[:-1], strict=True))
    return (
        f"{size[..., 0].size} builds{f' of wire {answer.wire}, {answer.hold} held' if answer.wire else ''}\n"
        f"|{answer.over} / {answer.under}| for {answer.input}: largest {np.nanmax(size):.4g} at {at}, {answer.frequency[where[-1]]:.4g} Hz; "
        f"median {np.nanmedian(size):.3g}"
    )


def _matrix(
    source: Any, choice: Choice, known: tuple[str, ...], question: Question, setting: dict[str, Any], out: str, as_json: bool, voice: options.Voice
) -> None:
    import numpy as np

    from suspension_cli.analysis import auto, response
    from suspension_cli.cli import analyses, rung
    from suspension_cli.conventions import DOFS
    from suspension_cli.results import response as files

    asked, watched = _all_motions(known, question, setting)
    with source.faults():
        if setting["fidelity"] == "auto" and setting["tolerance"] is not None:
            decision = auto.decide(source.design, lambda _: asked, setting["tolerance"])
        else:
            decision = auto.left_out(source.design, choice, lambda _: asked)
        choice = decision.choice
        answer = response.solve(decision.model, np.array(question.frequency), asked.inputs, asked.outputs)
    path = options.folder(out) / f"{source.design.design.name}-xcouple-matrix.h5"
    with analyses.written(path, source, voice):
        files.save(path, answer, analyses.provenance(source, choice, sys.argv), "matrix")
    if setting["plot"] or (setting["plot"] is None and not as_json):
        from suspension_cli.plots import matrix as picture

        analyses.draw(picture.draw(answer, source.design.design.title or source.design.design.name), path.with_suffix(".png"), voice)
    if as_json:
        import json

        head = {
            "command": "xcouple",
            "design": source.design.design.name,
            "fidelity": choice.level,
            "estimated_error": rung.estimate(choice),
            "frequency_hz": list(question.frequency),
            "input": answer.input,
            "output": answer.output,
        }
        click.echo(json.dumps(head | {"matrix_real": answer.value.real.tolist(), "matrix_imag": answer.value.imag.tolist()}))
        return
    for frequency, matrix in zip(answer.frequency, answer.value, strict=True):
        options.put(f"|motion of {watched} for motion of the support| at {frequency:.4g} Hz (SI)")
        options.put(" " * 8 + "".join(f"{dof:>11}" for dof in DOFS))
        for dof, row in zip(DOFS, matrix, strict=True):
            options.put(f"{dof:>8}" + "".join(f"{'0' if value == 0 else f'{abs(value):.3e}':>11}" for value in row))


def _all_motions(known: tuple[str, ...], question: Question, setting: dict[str, Any]) -> tuple[Transfer, str]:
    """Every motion of the support to every motion of the point watched, and that point."""
    import numpy as np

    from suspension_cli.analysis import signals
    from suspension_cli.analysis.asked import Transfer
    from suspension_cli.conventions import DOFS

    body, _, point = (setting["observe"] or question.over.body).partition("@")
    at = f"@{point}" if point else ""
    inputs = [signals.drive(f"support.{dof}", known) for dof in DOFS]
    outputs = [signals.motion(f"{body}.{dof}{at if dof in 'xyz' else ''}", known) for dof in DOFS]
    return Transfer(inputs, outputs, np.array(question.frequency)), f"{body}{at}"
