"""`pendsus check`: validity and plausibility of designs, loads of their wires and blades."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click

from suspension_cli.analyses import options, settings
from suspension_cli.analyses.check import warnings
from suspension_cli.cli import terminal
from suspension_cli.cli.runner import Command

if TYPE_CHECKING:
    from suspension_cli.analyses.check.statics import BladeLoad, Statics, WireLoad
    from suspension_cli.design.plausibility import ImplausibleNumber
    from suspension_cli.design.reader import Source
    from suspension_cli.models.registry import Choice


@dataclass(frozen=True)
class Checked:
    """A valid design: its simplest model, the loads of its wires and blades, whether it is stable
    and in which model (`level`), and its implausible numbers.
    """

    source: Source
    choice: Choice
    carried: Statics
    stable: bool | None
    level: str | None
    implausible: list[ImplausibleNumber]


STRICT = options.option("--strict", is_flag=True, help="Exit with 1 if there are warnings.")


@click.command(
    "check",
    cls=Command,
    params=[options.DESIGNS, STRICT, options.OVERRIDES, options.AS_JSON_ONLY],
)
def command(
    designs: tuple[str, ...], overrides: tuple[str, ...], strict: bool, as_json: bool
) -> None:
    """Check each DESIGN and list what its wires and blades carry; writes nothing.

    Errors of all designs are listed, one per line with file, key, value and remedy. Values that are
    valid but implausible are warnings: a wire that would break, a body denser than osmium, an
    unstable pendulum, a sensor on a stage that does not exist.

    Example: pendsus check my.toml --strict
    """
    from suspension_cli.errors import InputError, join_errors

    good: list[Checked] = []
    bad: list[InputError] = []
    for file in designs:
        try:
            good.append(_checked(file, overrides))
        except InputError as error:
            bad.append(error if error.file else error.in_file(file))
    for one in good:
        if not as_json:
            terminal.put(_text(one))
        for item in one.implausible:
            terminal.tell(f"warning: {one.source.design.design.name}: {item.line}")
    if bad:
        raise join_errors(bad)
    if as_json:
        import json

        documents = [_document(one) for one in good]
        click.echo(json.dumps(documents[0] if len(documents) == 1 else documents))
    if strict and any(one.implausible for one in good):
        sys.exit(1)


def _checked(file: str, overrides: tuple[str, ...]) -> Checked:
    """Read and check one design; raises `InputError`."""
    import tomllib

    from suspension_cli.analyses.check import limits, plausible, statics
    from suspension_cli.cli import name_checks
    from suspension_cli.design import plausibility as numbers
    from suspension_cli.design.paths import value_at
    from suspension_cli.design.plausibility import ImplausibleNumber
    from suspension_cli.design.reader import read
    from suspension_cli.errors import Fault, InputError
    from suspension_cli.models import registry

    source = read(file, overrides)
    design = source.design
    settings.check_tables(design.analysis, file)
    implausible = numbers.find_implausible(design)
    try:
        choice, carried = registry.choose(design), statics.solve(design)
    except InputError as error:  # it may be one of these numbers that keeps it from balancing
        raise InputError([*error.faults, *(item.fault for item in implausible)], file) from None
    implausible += plausible.find_implausible_loads(design, carried)
    stability = plausible.solve_stability(design)
    if stability is not None:
        implausible += plausible.find_instability(*stability)
    near = limits.find_slackest(design, carried)
    if near is not None:
        implausible.append(
            ImplausibleNumber(
                Fault(
                    "",
                    warnings.describe_slack(near),
                    "move its ends, or give it its share of the load",
                )
            )
        )
    raw = tomllib.loads(source.text)
    implausible += name_checks.find_unknown_names(
        design,
        None if stability is None else stability[1],
        lambda path: value_at(raw, path) is not None,
    )
    stable, level = (
        (None, None) if stability is None else (bool(stability[1].stable), stability[0].level)
    )
    return Checked(source, choice, carried, stable, level, implausible)


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
            {
                "wire": w.label,
                "tension_n": w.tension,
                "stretch_m": w.stretch,
                "stretch_share": w.stretch / w.length,
            }
            | _stressed(w)
            for w in carried.wires
        ],
        "blades": [
            {"blade": b.label, "load_n": b.load, "sag_m": b.sag} | _stressed(b)
            for b in carried.blades
        ],
        "bodies": [
            {"stage": b.name, "shift_m": list(b.shift), "rotation_rad": list(b.rotation)}
            for b in carried.bodies
        ],
        "warnings": [
            {
                "key": d.fault.key,
                "value": d.fault.value,
                "problem": d.fault.problem,
                "remedy": d.fault.remedy,
                "serious": d.serious,
            }
            for d in one.implausible
        ],
    }


def _stressed(part: WireLoad | BladeLoad) -> dict[str, Any]:
    return {"stress_pa": part.stress, "strength_pa": part.strength, "strength_share": part.share}


def _text(one: Checked) -> str:
    """Format the loads, heights and stability of a design."""
    from suspension_cli.errors import escape_unprintable

    carried, count = one.carried, len(one.implausible)
    verdict = "good" if not count else f"{count} warning{'s' * (count > 1)}"
    lines = [
        f"{escape_unprintable(one.source.file)}: {verdict}; {one.choice.line}",
        *_tables(carried),
    ]
    for body in carried.bodies:
        if any(body.shift) or any(body.rotation):
            shift = ", ".join(f"{1e3 * value:.4f}" for value in body.shift)
            turn = ", ".join(f"{1e3 * value:.4f}" for value in body.rotation)
            lines.append(
                f"  {body.name} hangs ({shift}) mm and ({turn}) mrad from its nominal pose"
            )
    lines.append(
        f"  height {carried.height:.4g} m; lowest points:"
        f" {', '.join(f'{low.name} {low.z:.4g} m ({low.point})' for low in carried.lowest)}"
    )
    if one.stable is not None:
        lines.append(f"  {'stable' if one.stable else 'UNSTABLE'} in the {one.level} model")
    lines.append(f"  balanced to {carried.residual:.0e} of the weight")
    return "\n".join(lines)


def _tables(carried: Statics) -> list[str]:
    """Format one line per wire and per blade."""
    width = max([12, *(len(part.label) for part in (*carried.wires, *carried.blades))])
    lines = []
    if carried.wires:
        lines.append(f"  {'wire':{width}}    tension    stretch      stress  of strength")
    lines += [
        f"  {wire.label:{width}} {wire.tension:8.2f} N {_millimetres(wire.stretch)} mm"
        f" {_stress(wire)}".rstrip()
        for wire in carried.wires
    ]
    if carried.blades:
        lines.append(f"  {'blade':{width}}       load        sag      stress  of strength")
    lines += [
        f"  {blade.label:{width}} {blade.load:8.2f} N {_millimetres(blade.sag)} mm"
        f" {_stress(blade)}".rstrip()
        for blade in carried.blades
    ]
    return lines


def _stress(part: WireLoad | BladeLoad) -> str:
    """Format a stress and its fraction of the strength; a dash where it is unknown."""
    stress = f"{part.stress / 1e6:7.0f} MPa" if part.stress is not None else f"{'-':>11}"
    return f"{stress}  {f'{100 * part.share:.3g} %' if part.share is not None else '-':>11}"


def _millimetres(length: float) -> str:
    return f"{1e3 * length:7.3f}" if abs(length) < 1 else f"{1e3 * length:7.4g}"
