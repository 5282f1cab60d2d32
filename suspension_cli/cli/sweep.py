"""`pendsus sweep`: modes, responses and couplings over any parameters of a design."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from suspension_cli.cli import limits, options

if TYPE_CHECKING:
    from suspension_cli.analysis.axes import Axis
    from suspension_cli.models.fidelity import Choice
    from suspension_cli.results.sweep import Swept

ALIKE = 0.4
"""Overlap below which a mode may have become any other; two that mix half and half have 0.5."""


@click.command("sweep")
@options.design
@click.option("--vary", multiple=True, metavar="PATH=GRID", help="A parameter and its values: stage.test.wires.s=1e-3:0.05:50:log (repeatable).  [required]")
@options.results
@options.batch
@options.allow_unstable
@options.analysis
@click.pass_context
def command(ctx: click.Context, design: str, overrides: tuple[str, ...], out: str, as_json: bool, quiet: bool, verbose: bool, **_: Any) -> None:
    """How modes, responses and couplings change with a design's parameters.

    Over one parameter lines, over two maps.  Modes are followed through crossings by their shapes.  Writes DIR/NAME-sweep.h5 and .png.
    """
    from suspension_cli.analysis import modes, scalars, signals
    from suspension_cli.analysis.sweep import ParameterSweep
    from suspension_cli.cli import analyses, rung
    from suspension_cli.errors import Fault, InputError, shown
    from suspension_cli.results import sweep as files

    voice = options.Voice(quiet, verbose)
    source, setting = analyses.prepared(ctx, design, overrides)
    with source.faults():
        over = axes(list(setting["vary"]))
        decision = rung.weighed(source, setting["fidelity"], rung.several(setting["result"]), top="string")
        choice, model = decision.choice, decision.model
        asked = scalars.parse(list(setting["result"]) or [scalars.ALL], modes.solve(model), signals.bodies(model))
        if choice.level == "violin" and any(isinstance(item, scalars.Mode) for item in asked):
            raise InputError([Fault("--fidelity", "has no modes that could be followed", "take beam, or ask for responses alone", shown("violin"))])
        job = ParameterSweep(source.text, over, choice.level, asked, setting["allow_unstable"])
        job.check()
    voice.detail(f"{source.design.design.name}: {choice.level}: {choice.reason}")
    limits.implausible(source.design, voice)
    if setting["fidelity"] == "auto":
        rung.tell(source, decision, voice, ("beam", "violin"))
    path = options.folder(out) / f"{source.design.design.name}-sweep.h5"
    fill, after = lambda group: files.fill(group, job, model), lambda part: files.complete(part, job)
    with source.faults():
        analyses.swept(job, path, "sweep", source, choice, setting, voice, fill, after)
    answer = files.load(path)
    for reason, count in answer.failures.items():
        voice.warn(f"{count} of {job.count} points: {reason}")
    if answer.overlap < ALIKE:
        voice.warn(f"a mode changes its shape from one point to the next (overlap {answer.overlap:.2f}), so which is which is a guess there; take a finer grid")
    if setting["plot"] or (setting["plot"] is None and not as_json):
        from suspension_cli.plots import sweep as picture

        analyses.draw(picture.draw(answer, source.design.design.title or source.design.design.name), path.with_suffix(".png"), voice)
    if as_json:
        import json

        click.echo(json.dumps(document(source.design.design.name, choice, answer)))
    else:
        options.put("\n".join([f"{choice.level}: {choice.reason}", *table(answer)]))


def axes(vary: list[str]) -> tuple[Axis, ...]:
    """The axes that `--vary` asks for."""
    from suspension_cli.analysis.axes import Axis
    from suspension_cli.errors import Fault, InputError, shown
    from suspension_cli.grids import grid

    example = "write for example --vary stage.test.wires.s=1e-3:0.05:50:log"
    if not vary:
        raise InputError([Fault("--vary", "is missing", example)])
    result = []
    for text in vary:
        path, equals, values = (part.strip() for part in text.partition("="))
        if not equals or not all(part.strip() for part in path.split(".")) or "." not in path:
            raise InputError([Fault("--vary", "is not of the form PATH=GRID", example, shown(text))])
        result.append(Axis(path, tuple(grid(values, f"--vary {path}"))))
    if len({axis.name for axis in result}) < len(result):
        raise InputError([Fault("--vary", "names a parameter twice", "give each once", shown(" ".join(vary)))])
    return tuple(result)


def document(name: str, choice: Choice, answer: Swept) -> dict[str, Any]:
    """The JSON document: first axis first; what is not there (an unstable mode, a failed point) is null."""
    from suspension_cli.cli import rung
    from suspension_cli.cli.analyses import plain

    results = [
        {"name": result, "unit": answer.unit[n], "nominal": plain(answer.nominal[n]), "values": plain(answer.value[..., n])}
        for n, result in enumerate(answer.result)
    ]
    swept = [{"name": axis.name, "values": list(axis.values)} for axis in answer.axes]
    head = {"command": "sweep", "design": name, "fidelity": choice.level}
    return head | {"axes": swept, "results": results, "failures": answer.failures, "estimated_error": rung.estimate(choice)}


def table(answer: Swept) -> list[str]:
    """As drawn, smallest and largest value of every result, and where."""
    import numpy as np

    lines = ["", "  as drawn   smallest    largest        result, and where it is largest"]
    for n, name in enumerate(answer.result):
        value = answer.value[..., n]
        if not np.isfinite(value).any():
            lines.append(f"{answer.nominal[n]:#10.5g}          -          -        {name}: nowhere on the grid")
            continue
        top = np.unravel_index(int(np.nanargmax(value)), value.shape)
        where = ", ".join(f"{axis.name} = {axis.values[k]:.4g}" for axis, k in zip(answer.axes, top, strict=True))
        lines.append(f"{answer.nominal[n]:#10.5g} {np.nanmin(value):#10.5g} {np.nanmax(value):#10.5g} {answer.unit[n]:6} {name}: {where}")
    return lines
