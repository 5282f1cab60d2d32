"""`pendsus optimise`: numbers of a design chosen so that it meets goals."""

from __future__ import annotations

import math
import sys
from typing import TYPE_CHECKING, Any

import click

from suspension_cli.cli import limits as warnings
from suspension_cli.cli import options

if TYPE_CHECKING:
    from suspension_cli.analysis.optimise.optimum import Optimum
    from suspension_cli.design.goals import Goals

STARTS, SEED = 6, 1
"""As `analysis.optimise` has them, which is not imported just to print help."""
NEAREST = 3
"""Limits of each goal that are printed where all are met and none is active: those with the least margin."""


@click.command("optimise")
@options.design
@click.argument("goals", metavar="GOALS")
@click.option("--starts", type=click.IntRange(1, 64), default=STARTS, show_default=True, help="Designs to search from; the first is the design itself.")
@click.option("--seed", type=click.IntRange(0), default=SEED, show_default=True, help="Of the other starts.")
@options.analysis
@click.pass_context
def command(ctx: click.Context, design: str, goals: str, overrides: tuple[str, ...], out: str, as_json: bool, quiet: bool, verbose: bool, **_: Any) -> None:
    """Choose numbers of a design so that it meets goals.

    GOALS is a TOML file of goals, and of the numbers that are free with their bounds.  Writes the design as DIR/NAME-optimised.toml, and
    DIR/NAME-optimise.h5 and .png.  Every goal is checked on what was written, by the ordinary analyses; exit code 1 if a limit is not met.
    """
    from pathlib import Path

    from suspension_cli.analysis.optimise import run
    from suspension_cli.cli import analyses
    from suspension_cli.cli.progress import Bar
    from suspension_cli.design import goals as wishes
    from suspension_cli.design import reader
    from suspension_cli.errors import Fault, InputError, shown
    from suspension_cli.models.fidelity import Choice
    from suspension_cli.results import optimise as files

    voice = options.Voice(quiet, verbose)
    source, setting = analyses.prepared(ctx, design, overrides)
    if setting["fidelity"] == "violin":
        raise InputError([Fault("--fidelity", "lists the modes of wires too", "take auto, string or beam", shown("violin"))], source.file)
    wanted = reader.text_of(goals)
    given = wishes.read(goals, wanted)
    with Bar(enabled=not voice.quiet) as bar:
        try:
            found = run.solve(source.text, given, level=setting["fidelity"], starts=setting["starts"], seed=setting["seed"], report=bar)
        except InputError as error:
            ours = error.faults[0].key.split(".")[0] in ("goal", "free", "equal")
            raise error.in_file(goals if ours else source.file) from None
    name, folder = source.design.design.name, options.folder(out)
    path, made = folder / f"{name}-optimise.h5", folder / f"{name}-optimised.toml"
    choice = Choice("string", "general string model, whose derivatives are exact")
    with analyses.written(path, source, voice):
        files.save(path, found, analyses.provenance(source, choice, sys.argv), wanted)
    files.save_design(made, found, Path(design).name, Path(goals).name, options.command_line(sys.argv))
    voice.say(f"wrote {made}")
    voice.detail(f"checked on {found.fidelity}: {found.reason}; {found.rounds} corrections of the search for it")
    if setting["plot"] or (setting["plot"] is None and not as_json):
        from suspension_cli.plots import optimise as picture

        analyses.draw(picture.draw(found, source.design.design.title or name), path.with_suffix(".png"), voice)
    warnings.implausible(reader.read(made).design, voice)
    for what in found.unknown:
        voice.warn(f"not known, so not met: {what}")
    for name, value in zip(found.quantities.name, found.quantities.after, strict=True):
        if value == 0:
            voice.warn(f"{name} is 0: the design's symmetry forbids it whatever its numbers are; give the goal a perturbation")
    unstable = [label for label, after in zip(found.modes.label, found.modes.after, strict=True) if math.isnan(after)]
    if unstable:
        voice.warn(f"the design found is unstable: {', '.join(unstable)}; no goal forbids it but a band of these modes")
    if found.rounds >= run.ROUNDS:
        voice.warn(f"after {found.rounds} corrections search and check may still differ: limits are told as checked, but a better design may be near")
    if as_json:
        import json

        click.echo(json.dumps(document(name, found, given)))
    else:
        options.put("\n".join(table(found, given)))
    if not found.met:
        ctx.exit(1)


def document(name: str, found: Optimum, goals: Goals) -> dict[str, Any]:
    """The JSON document; null for what there is none of."""

    def plain(value: float) -> float | None:
        return float(value) if math.isfinite(value) else None

    numbers, limits, quantities, modes = found.numbers, found.limits, found.quantities, found.modes
    return {
        "command": "optimise",
        "design": name,
        "fidelity": "string",
        "checked_on": found.fidelity,
        "estimated_error": plain(found.error),
        "goals_met": found.met,
        "parameters": [
            {
                "name": label,
                "follows": bool(numbers.tied[n]),
                "before": float(numbers.before[n]),
                "after": float(numbers.after[n]),
                "lower": plain(numbers.lower[n]),
                "upper": plain(numbers.upper[n]),
                "at_bound": {-1: "lower", 0: None, 1: "upper"}[int(numbers.bound[n])],
                "multiplier": plain(numbers.multiplier[n]),
            }
            for n, label in enumerate(numbers.name)
        ],
        "limits": [
            {
                "goal": goals.goal[limits.goal[n] - 1].name or goals.goal[limits.goal[n] - 1].kind,
                "limit": text,
                "value": plain(limits.value[n]),
                "margin": plain(limits.margin[n]),
                "room": plain(limits.room[n]),
                "met": bool(limits.met[n]),
                "active": bool(limits.active[n]),
                "multiplier": plain(limits.multiplier[n]),
            }
            for n, text in enumerate(limits.name)
        ],
        "quantities": [
            {"name": text, "unit": quantities.unit[n], "before": plain(quantities.before[n]), "after": plain(quantities.after[n])}
            for n, text in enumerate(quantities.name)
        ],
        "unknown": list(found.unknown),
        "modes": [
            {"name": text, "label": modes.label[n], "before_hz": plain(modes.before[n]), "after_hz": plain(modes.after[n])}
            | {"top_mass_share_before": plain(modes.share_before[n]), "top_mass_share_after": plain(modes.share_after[n])}
            for n, text in enumerate(modes.name)
        ],
        "starts": [
            {"violation_before": plain(a), "violation_after": plain(b), "arrived_at": int(place)}
            for a, b, place in zip(found.starts.before, found.starts.after, found.starts.place, strict=True)
        ],
        "objective": found.objective,
        "stationarity": plain(found.stationarity),
    }


def table(found: Optimum, goals: Goals) -> list[str]:
    """What changed, what each goal got, and where the starts arrived."""
    numbers, wide = found.numbers, max(len(name) for name in found.numbers.name)
    lines = []
    for n, name in enumerate(numbers.name):
        remark = "  follows" if numbers.tied[n] else ""
        remark += {-1: "  at its lower bound", 0: "", 1: "  at its upper bound"}[int(numbers.bound[n])]
        lines.append(f"{name:{wide}}  {numbers.before[n]:#.6g} -> {numbers.after[n]:#.6g}{remark}")
    lines.append("")
    names = [goal.name or goal.kind for goal in goals.goal]
    for name in dict.fromkeys(names):
        lines += _goal(found, [n for n, other in enumerate(names, 1) if other == name], name)
    for n in [n for n, weight in enumerate(found.quantities.weight) if weight]:
        word = "small" if found.quantities.weight[n] > 0 else "large"
        unit = "" if found.quantities.unit[n] == "1" else f" {found.quantities.unit[n]}"
        lines.append(f"{word:7}  {found.quantities.name[n]}: {found.quantities.after[n]:.6g}{unit}, was {found.quantities.before[n]:.6g}{unit}")
    lines += [f"UNKNOWN  {what}" for what in found.unknown]
    return [*lines, "", _verdict(found), *_starts(found)]


def _goal(found: Optimum, numbers: list[int], name: str) -> list[str]:
    """The goals of one name: what is not met and what is active, or the limits with the least margin."""
    limits, quantities = found.limits, found.quantities
    mine = [n for n, goal in enumerate(limits.goal) if goal in numbers]
    if not mine:
        return []
    order = sorted(mine, key=lambda n: limits.margin[n] if math.isfinite(limits.margin[n]) else -math.inf)
    told = [n for n in order if not limits.met[n] or limits.active[n]]
    told += [n for n in order if n not in told][: max(NEAREST - len(told), 0)]
    word = "met" if all(limits.met[n] for n in mine) else "NOT MET"
    lines = [f"{word:7}  {name}" + (f", {len(mine)} limits" if len(mine) > 1 else "")]
    for n in told:
        state = "NOT MET" if not limits.met[n] else "active" if limits.active[n] else ""
        was = f", was {_size(float(quantities.before[limits.quantity[n]]))}" if limits.other[n] < 0 else ""
        room = [_share(limits.room[n])] if math.isfinite(limits.room[n]) else []
        lines.append(f"         {limits.name[n]}: {_size(limits.value[n])}{was} ({', '.join([*room, *([state] if state else [])])})")
    if len(told) < len(mine):
        lines.append(f"         and {len(mine) - len(told)} with more room")
    return lines


def _size(value: float) -> str:
    """A value; there is none of a mode that is unstable, or has no counterpart."""
    return f"{value:.4g}" if math.isfinite(value) else "none"


def _share(value: float) -> str:
    """Room in %, without a minus before a zero."""
    percent = 100 * value
    return f"{percent:+.0f} %" if abs(percent) >= 10 else f"{round(percent, 2) + 0.0:+.2f} %"


def _verdict(found: Optimum) -> str:
    """How many limits there are and whether they are met; what is not known is not."""
    count, missed, unknown = len(found.limits.name), int((~found.limits.met).sum()), len(found.unknown)
    said = [f"{missed} NOT MET" if missed else "all are met" if count != 1 else "met"] if count else []
    said += [f"{unknown} NOT KNOWN"] if unknown else []
    return ", ".join([f"{count or 'no'} limit{'' if count == 1 else 's'}", *said, f"checked on {found.fidelity}"])


def _starts(found: Optimum) -> list[str]:
    """How many starts arrived where."""
    place, kept = found.starts.place, found.starts.after <= 1e-8
    if len(place) == 1:
        return []
    text = f"{int((place == 1).sum())} of {len(place)} starts arrived at this design"
    if not kept[place == 1].any():
        return [text + ", and none keeps to all limits"]
    others, failed = int(((place > 1) & kept).sum()), int((~kept).sum())
    text += f", {others} at others that keep to all limits" if others else ""
    return [text + (f", {failed} at none that does" if failed else "")]
