"""Validity and plausibility of a design, and loads of its wires and blades."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

from suspension_cli.analyses import tables
from suspension_cli.analyses.analysis import Document, Log, Report
from suspension_cli.errors import Fault, InputError, escape_unprintable

if TYPE_CHECKING:
    from suspension_cli.analyses.check.profiles import ReducedProfile
    from suspension_cli.analyses.check.statics import LinkLoad, Statics, Stress
    from suspension_cli.analyses.check.wire_weights import WireWeights
    from suspension_cli.design.plausibility import ImplausibleNumber
    from suspension_cli.design.reader import Source
    from suspension_cli.models.registry import Choice

MANY_WIRES = 40
"""Number of wires above which equal wires of a stage share a row."""
MANY_BODIES = 12
"""Number of bodies above which only three lowest points are printed."""


@dataclass(frozen=True, repr=False)
class Check(Report):
    """A valid design: loads of its wires and blades, and implausible numbers.

    Attributes
    ----------
    choice : Choice
        The simplest valid model.
    stable, stability_model : bool, str or None
        Whether it is stable, and in which model; None if not computed.
    weights : WireWeights or None
        Weight of the wires; None if no density is known.
    profiles : list of ReducedProfile
        Measured profiles of fibres.
    """

    source: Source
    choice: Choice
    statics: Statics
    stable: bool | None
    stability_model: str | None
    warnings: list[ImplausibleNumber]
    weights: WireWeights | None
    profiles: list[ReducedProfile]

    def warn(self, log: Log) -> None:
        """Report the warnings."""
        for item in self.warnings:
            log.warn(f"{self.name}: {item.line}")

    def document(self) -> Document:
        """Return the JSON document that ``pendsus check --json`` prints."""
        from suspension_cli.analyses.check import towers

        found = self.statics
        return {
            "command": "check",
            "design": self.name,
            "file": self.source.file,
            "stable": self.stable,
            "stability_model": self.stability_model,
            "residual": found.residual,
            "height_m": found.height,
            "lowest": [
                {"stage": low.name, "z_m": low.z, "point": low.point} for low in found.lowest
            ],
            "wires": [
                {"wire": w.label, "tension_n": w.tension, "stretch_m": w.stretch}
                | {"stretch_fraction": w.stretch / w.length, **_stressed(w)}
                for w in found.wires
            ],
            "blades": [
                {"blade": b.label, "load_n": b.load, "sag_m": b.sag} | _stressed(b)
                for b in found.blades
            ],
            "bodies": [
                {"stage": b.name, "shift_m": list(b.shift), "rotation_rad": list(b.rotation)}
                for b in found.bodies
            ],
            **({"links": [asdict(link) for link in found.links]} if found.links else {}),
            **towers.documents(found.legs, found.filters),
            "warnings": [
                {name: getattr(item.fault, name) for name in ("key", "value", "problem", "remedy")}
                | {"serious": item.serious}
                for item in self.warnings
            ],
            **self._wire_details(),
        }

    def _wire_details(self) -> Document:
        """Weight of wires if it is included, and measured profiles if there are any."""
        result: Document = {}
        own = self.weights
        if own is not None and own.included:
            result["wire_weight"] = {
                "total_n": own.total,
                "largest_over_tension": own.ratio,
                "sag_m": own.sag,
                "error": own.error,
            }
        if self.profiles:
            result["profiles"] = [asdict(one) for one in self.profiles]
        return result

    def __str__(self) -> str:
        from suspension_cli.analyses.check import towers

        found, count = self.statics, len(self.warnings)
        verdict = "good" if not count else f"{count} warning{'s' * (count > 1)}"
        lines = [
            f"{escape_unprintable(self.source.file) or self.name}: {verdict}; simplest valid model:"
            f" {self.choice.level} ({self.choice.reason})"
        ]
        if found.wires:
            rows = [(w.label, w.tension, 1e3 * w.stretch, *_strength(w)) for w in found.wires]
            if len(rows) > MANY_WIRES:
                rows = _merge_equal(rows)
            lines.append(_table("wire", "tension", "stretch", rows))
        if found.blades:
            rows = ((b.label, b.load, 1e3 * b.sag, *_strength(b)) for b in found.blades)
            lines.append(_table("blade", "load", "sag", rows))
        if found.links:
            lines.append(_link_table(found.links))
        if self.weights is not None and self.weights.line:
            lines.append(f"  {self.weights.line}")
        lines += [f"  {one.line}" for one in self.profiles]
        lines += towers.lines(found.legs, found.filters)
        for body in found.bodies:
            shift, turn = map(_milli, (body.shift, body.rotation))
            if {shift, turn} != {_milli((0.0, 0.0, 0.0))}:
                lines.append(
                    f"  {body.name} hangs ({shift}) mm and ({turn}) mrad from its nominal pose"
                )
        lines += [
            f"  the table of link {link.label} covers {link.table[0]:g} to {link.table[1]:g} Hz;"
            " outside, its stiffness is constant"
            for link in found.links
            if link.table is not None
        ]
        lowest = found.lowest
        if len(lowest) > MANY_BODIES:
            lowest = sorted(lowest, key=lambda low: low.z)[:3]
        lines.append(
            f"  height {found.height:.4g} m; lowest points:"
            f" {', '.join(f'{low.name} {low.z:.4g} m ({low.point})' for low in lowest)}"
        )
        if self.stable is not None:
            word = "stable" if self.stable else "UNSTABLE"
            lines.append(f"  {word} in the {self.stability_model} model")
        lines.append(f"  largest residual force: {found.residual:.0e} of the weight")
        return "\n".join(lines)


def solve(source: Source) -> Check:
    """Check a design.

    Raises
    ------
    InputError
        With the faults of its `[analysis]` tables, or if it does not balance.
    """
    import tomllib

    from suspension_cli.analyses import settings
    from suspension_cli.analyses.check import (
        limits,
        names,
        plausible,
        profiles,
        statics,
        towers,
        warnings,
        wire_weights,
    )
    from suspension_cli.design import plausibility
    from suspension_cli.design.paths import value_at
    from suspension_cli.models import registry

    design = source.design
    settings.check_tables(design.analysis, source.file)
    found = plausibility.find_implausible(design)
    try:
        choice, loads = registry.choose(design), statics.solve(design)
    except InputError as error:  # implausible numbers may be the reason
        raise InputError([*error.faults, *(item.fault for item in found)], source.file) from None
    found += plausible.find_implausible_loads(design, loads)
    found += towers.find_implausible_towers(design, loads.legs, loads.filters)
    stable = level = modes = None
    if stability := plausible.solve_stability(design):
        level, modes, grows = stability
        found += plausible.find_instability(level, grows)
        stable = grows is None
    near = limits.find_slackest(design, loads)
    if near is not None:
        fault = Fault("", warnings.describe_slack(near), warnings.SHARE)
        found.append(plausibility.ImplausibleNumber(fault))
    raw = tomllib.loads(source.text)
    found += names.find_unknown_names(design, modes, lambda path: value_at(raw, path) is not None)
    weights, reduced = wire_weights.solve(design, loads), profiles.solve(design, loads)
    return Check(source, choice, loads, stable, level, found, weights, reduced)


def _stressed(part: Stress) -> Document:
    return {
        "stress_pa": part.stress,
        "strength_pa": part.strength,
        "strength_fraction": part.fraction,
    }


def _strength(part: Stress) -> tuple[float | None, float | None]:
    """Stress in MPa and its fraction of the strength in %; None where unknown."""
    return (
        None if part.stress is None else part.stress / 1e6,
        None if part.fraction is None else 100 * part.fraction,
    )


def _link_table(links: tuple[LinkLoad, ...]) -> str:
    """Format links and dampers: stiffness or damping along x, y, z, and sag."""
    from suspension_cli.analyses.check.plausible import hangs_freely

    heads = {"link": "", "between": "", "x\nN/m": ".4g", "y\nN/m": ".4g", "z\nN/m": ".4g"}
    heads |= {"length\nm": ".4g", "sag\nmm": ".3g", "weight\nN": ".3g"}
    damped = {"damper": "", "between": "", "x\nN s/m": ".4g", "y\nN s/m": ".4g", "z\nN s/m": ".4g"}
    elastic = [link for link in links if any(link.stiffness) or not any(link.damping)]
    viscous = [link for link in links if any(link.damping)]
    rows = [
        (
            link.label,
            " - ".join(link.between),
            *link.stiffness,
            link.length,
            None if link.sag is None or hangs_freely(link) else 1e3 * link.sag,
            link.weight,
        )
        for link in elastic
    ]
    found = [tables.render(heads, rows)] if rows else []
    if viscous:
        between = ((v.label, " - ".join(v.between), *v.damping) for v in viscous)
        found.append(tables.render(damped, between))
    return "\n".join(found)


def _milli(vector: tuple[float, ...]) -> str:
    """Write components in thousandths, without minus signs of zeros."""
    return ", ".join(f"{round(1e3 * value, 4) + 0.0:.4f}" for value in vector)


def _merge_equal(
    rows: list[tuple[str, float, float, float | None, float | None]],
) -> list[tuple[str, float, float, float | None, float | None]]:
    """Merge rows of a stage's wires that are equal as printed: ``test.1 to 4``."""
    result, last = [], None
    for label, *values in rows:
        stage, _, number = label.rpartition(".")
        key = (stage, *(None if value is None else f"{value:.3f}" for value in values))
        if key == last and number.isdecimal():
            first = result[-1][0].split(" ")[0]
            result[-1] = (f"{first} to {number}", *result[-1][1:])
        else:
            result.append((label, *values))
        last = key
    return result


def _table(part: str, load: str, change: str, rows: Iterable[Sequence[float | str | None]]) -> str:
    columns = {part: "", f"{load}\nN": ".2f", f"{change}\nmm": ".3f"}
    return tables.render(columns | {"stress\nMPa": ".0f", "of strength\n%": ".3g"}, rows)
