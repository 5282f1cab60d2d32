"""`pendsus check`: is a design sound, what do its wires and blades carry, and can its numbers be meant?"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click

from suspension_cli.cli import limits as warnings
from suspension_cli.cli import options

if TYPE_CHECKING:
    from suspension_cli.analysis.statics import BladeLoad, Carried, WireLoad
    from suspension_cli.design.plausible import Doubt
    from suspension_cli.design.reader import Source
    from suspension_cli.models.fidelity import Choice


@dataclass(frozen=True)
class Checked:
    """A design without faults: its simplest model, what it carries, the model in which its stability was looked at, and what is hard to believe of it."""

    source: Source
    choice: Choice
    carried: Carried
    stable: bool | None
    level: str | None
    doubts: list[Doubt]


@click.command("check")
@options.designs
@options.overrides
@click.option("--strict", is_flag=True, help="Exit with 1 if there are warnings.")
@options.as_json_only
def command(designs: tuple[str, ...], overrides: tuple[str, ...], strict: bool, as_json: bool) -> None:
    """Check each DESIGN and show what its wires and blades carry; writes nothing.

    All faults of all designs are listed, each on a line with file, key, value and remedy.  What is valid but hard to believe is a warning:
    a wire that would break, a mass denser than osmium, an unstable pendulum, a sensor on a stage that does not exist.
    """
    from suspension_cli.errors import InputError, joined

    good: list[Checked] = []
    bad: list[InputError] = []
    for file in designs:
        try:
            good.append(_checked(file, overrides))
        except InputError as error:
            bad.append(error if error.file else error.in_file(file))
    for one in good:
        if not as_json:
            options.put(_text(one))
        for doubt in one.doubts:
            options.tell(f"warning: {one.source.design.design.name}: {doubt.line}")
    if bad:
        raise joined(bad)
    if as_json:
        import json

        documents = [_document(one) for one in good]
        click.echo(json.dumps(documents[0] if len(documents) == 1 else documents))
    if strict and any(one.doubts for one in good):
        sys.exit(1)


def _checked(file: str, overrides: tuple[str, ...]) -> Checked:
    """Read and check one design; raises `InputError`."""
    import tomllib

    from suspension_cli.analysis import limits, names, plausible, statics
    from suspension_cli.design import plausible as numbers
    from suspension_cli.design.plausible import Doubt
    from suspension_cli.design.reader import read, value_at
    from suspension_cli.errors import Fault, InputError
    from suspension_cli.models import fidelity

    source = read(file, overrides)
    design = source.design
    options.check_tables(design.analysis, file)
    doubts = numbers.of_design(design)
    try:
        choice, carried = fidelity.choose(design), statics.solve(design)
    except InputError as error:  # it may be one of these numbers that keeps it from balancing
        raise InputError([*error.faults, *(doubt.fault for doubt in doubts)], file) from None
    doubts += plausible.of_loads(design, carried)
    stability = plausible.stability(design)
    if stability is not None:
        doubts += plausible.of_modes(*stability)
    near = limits.slackest(design, carried)
    if near is not None:
        doubts.append(Doubt(Fault("", warnings.slack(near), "move its ends, or give it its share of the load")))
    raw = tomllib.loads(source.text)
    doubts += names.of_design(design, None if stability is None else stability[1], lambda path: value_at(raw, path) is not None)
    stable, level = (None, None) if stability is None else (bool(stability[1].stable), stability[0].level)
    return Checked(source, choice, carried, stable, level, doubts)


def _document(one: Checked) -> dict[str, Any]:
    carried = one.carried
    return {
        "command": "check",
        "design": one.source.design.design.name,
        "file": one.source.file,
        "stable": one.stable,
        "stability_model": one.level,
        "residual": carried.residual,
        "height_m": carried.height,
        "lowest": [{"stage": low.name, "z_m": low.z, "point": low.point} for low in carried.lowest],
        "wires": [
            {"wire": w.label, "tension_n": w.tension, "stretch_m": w.stretch, "stretch_share": w.stretch / w.length} | _stressed(w) for w in carried.wires
        ],
        "blades": [{"blade": b.label, "load_n": b.load, "sag_m": b.sag} | _stressed(b) for b in carried.blades],
        "bodies": [{"stage": b.name, "shift_m": list(b.shift), "rotation_rad": list(b.rotation)} for b in carried.bodies],
        "warnings": [
            {"key": d.fault.key, "value": d.fault.value, "problem": d.fault.problem, "remedy": d.fault.remedy, "serious": d.serious} for d in one.doubts
        ],
    }


def _stressed(part: WireLoad | BladeLoad) -> dict[str, Any]:
    return {"stress_pa": part.stress, "strength_pa": part.strength, "strength_share": part.share}


def _text(one: Checked) -> str:
    """What a design carries, for people."""
    from suspension_cli.errors import printable

    carried, count = one.carried, len(one.doubts)
    verdict = "good" if not count else f"{count} warning{'s' * (count > 1)}"
    lines = [f"{printable(one.source.file)}: {verdict}; {one.choice.level}: {one.choice.reason}", *_tables(carried)]
    for body in carried.bodies:
        if any(body.shift) or any(body.rotation):
            shift = ", ".join(f"{1e3 * value:.4f}" for value in body.shift)
            turn = ", ".join(f"{1e3 * value:.4f}" for value in body.rotation)
            lines.append(f"  {body.name} hangs ({shift}) mm and ({turn}) mrad from its nominal pose")
    lines.append(f"  height {carried.height:.4g} m; lowest points: {', '.join(f'{low.name} {low.z:.4g} m ({low.point})' for low in carried.lowest)}")
    if one.stable is not None:
        lines.append(f"  {'stable' if one.stable else 'UNSTABLE'} in the {one.level} model")
    lines.append(f"  balanced to {carried.residual:.0e} of the weight")
    return "\n".join(lines)


def _tables(carried: Carried) -> list[str]:
    """A line for each wire and each blade."""
    width = max([12, *(len(part.label) for part in (*carried.wires, *carried.blades))])
    lines = []
    if carried.wires:
        lines.append(f"  {'wire':{width}}    tension    stretch      stress  of strength")
    lines += [f"  {wire.label:{width}} {wire.tension:8.2f} N {_millimetres(wire.stretch)} mm {_stress(wire)}".rstrip() for wire in carried.wires]
    if carried.blades:
        lines.append(f"  {'blade':{width}}       load        sag      stress  of strength")
    lines += [f"  {blade.label:{width}} {blade.load:8.2f} N {_millimetres(blade.sag)} mm {_stress(blade)}".rstrip() for blade in carried.blades]
    return lines


def _stress(part: WireLoad | BladeLoad) -> str:
    """Stress and its share of the strength; a dash where that is not known."""
    stress = f"{part.stress / 1e6:7.0f} MPa" if part.stress is not None else f"{'-':>11}"
    return f"{stress}  {f'{100 * part.share:.3g} %' if part.share is not None else '-':>11}"


def _millimetres(length: float) -> str:
    return f"{1e3 * length:7.3f}" if abs(length) < 1 else f"{1e3 * length:7.4g}"
