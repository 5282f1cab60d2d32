"""Validity and plausibility of a design, and loads of its wires and blades."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from suspension_cli.analyses import tables
from suspension_cli.analyses.analysis import Document, Log, Report
from suspension_cli.errors import InputError, escape_unprintable

if TYPE_CHECKING:
    from suspension_cli.analyses.check.statics import LinkLoad, Statics, WireWeights
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
    """

    source: Source
    choice: Choice
    statics: Statics
    stable: bool | None
    stability_model: str | None
    warnings: list[ImplausibleNumber]

    @property
    def weights(self) -> WireWeights | None:
        """Weight of the wires; None if no density is known."""
        return self.statics.weights

    def warn(self, log: Log) -> None:
        """Report the warnings."""
        for item in self.warnings:
            log.warn(f"{self.name}: {item.line('')}")

    def document(self) -> Document:
        """Return the JSON document that ``pendsus check --json`` prints."""
        from suspension_cli.analyses.check.columns import list_documents

        loads, own = self.statics, self.weights
        result = {
            "command": "check",
            "design": self.name,
            "file": self.source.file,
            "stable": self.stable,
            "stability_model": self.stability_model,
            "residual": loads.residual,
            "height_m": loads.height,
            "lowest": list_documents(loads.lowest),
            "wires": list_documents(loads.wires),
            "blades": list_documents(loads.blades),
            "bodies": list_documents(loads.bodies),
        }
        rare = {
            "links": list_documents(loads.links),
            "inverted_pendulums": list_documents(loads.legs),
            "filters": list_documents(loads.filters),
            "profiles": list_documents(loads.profiles),
        }
        result |= {name: rows for name, rows in rare.items() if rows}
        result["warnings"] = [
            {name: getattr(item, name) for name in ("key", "value", "problem", "remedy", "serious")}
            for item in self.warnings
        ]
        if own is not None and own.included:
            [result["wire_weight"]] = list_documents([own])
        return result

    def __str__(self) -> str:
        from suspension_cli.analyses.check.columns import render

        loads, count = self.statics, len(self.warnings)
        verdict = "good" if not count else f"{count} warning{'s' * (count > 1)}"
        lines = [
            f"{escape_unprintable(self.source.file) or self.name}: {verdict}; simplest valid model:"
            f" {self.choice.level} ({self.choice.reason})"
        ]
        for parts in (loads.wires, loads.blades, loads.legs, loads.filters):
            if parts:
                lines.append(render(parts, _merge_equal))
        lines += _link_tables(loads.links)
        if self.weights is not None and self.weights.line:
            lines.append(f"  {self.weights.line}")
        lines += [
            f"  profile of {one.wire}: {one.places} places in {one.sections} uniform sections"
            for one in loads.profiles
        ]
        for body in loads.bodies:
            shift, turn = map(_milli, (body.shift, body.rotation))
            if {shift, turn} != {_milli((0.0, 0.0, 0.0))}:
                lines.append(
                    f"  {body.name} hangs ({shift}) mm and ({turn}) mrad from its nominal pose"
                )
        lines += [
            f"  the table of link {link.label} covers {link.table[0]:g} to {link.table[1]:g} Hz;"
            " outside, its stiffness is constant"
            for link in loads.links
            if link.table is not None
        ]
        lowest = loads.lowest
        if len(lowest) > MANY_BODIES:
            lowest = sorted(lowest, key=lambda low: low.z)[:3]
        lines.append(
            f"  height {loads.height:.4g} m; lowest points:"
            f" {', '.join(f'{low.name} {low.z:.4g} m ({low.point})' for low in lowest)}"
        )
        if self.stable is not None:
            word = "stable" if self.stable else "UNSTABLE"
            lines.append(f"  {word} in the {self.stability_model} model")
        lines.append(f"  largest residual force: {loads.residual:.0e} of the weight")
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
    from suspension_cli.analyses.check import statics, warnings
    from suspension_cli.design import plausibility
    from suspension_cli.design.paths import value_at
    from suspension_cli.models import registry

    design = source.design
    settings.from_tables(source)
    found = plausibility.find_implausible(design)
    try:
        choice, loads = registry.choose(design), statics.solve(design)
    except InputError as error:  # implausible numbers may be the reason
        raise InputError([*error.faults, *found], source.file) from None
    found += warnings.find_implausible_loads(design, loads)
    model, modes, unstable = warnings.find_stability(design)
    found += [*unstable, *warnings.find_slackest(loads)]
    raw = tomllib.loads(source.text)
    leads = lambda path: value_at(raw, path) is not None  # noqa: E731
    found += warnings.find_unknown_names(design, modes, leads)
    stable = None if model is None else not unstable
    return Check(source, choice, loads, stable, model, found)


def _link_tables(links: Sequence[LinkLoad]) -> list[str]:
    """Tables of links and of dampers: stiffness or damping along x, y, z, and sag."""
    made = []
    elastic = [link for link in links if any(link.stiffness) or not any(link.damping)]
    if elastic:
        heads = {"link": "", "between": "", "x\nN/m": ".4g", "y\nN/m": ".4g", "z\nN/m": ".4g"}
        heads |= {"length\nm": ".4g", "sag\nmm": ".3g", "weight\nN": ".3g"}
        rows = [
            (
                *(link.label, " - ".join(link.between), *link.stiffness, link.length),
                *(None if link.hangs_freely else link.sag and 1e3 * link.sag, link.weight),
            )
            for link in elastic
        ]
        made.append(tables.render(heads, rows))
    viscous = [link for link in links if any(link.damping)]
    if viscous:
        per = {f"{axis}\nN s/m": ".4g" for axis in "xyz"}
        rows = [(link.label, " - ".join(link.between), *link.damping) for link in viscous]
        made.append(tables.render({"damper": "", "between": ""} | per, rows))
    return made


def _milli(vector: tuple[float, ...]) -> str:
    """Write components in thousandths, without minus signs of zeros."""
    return ", ".join(f"{round(1e3 * value, 4) + 0.0:.4f}" for value in vector)


def _merge_equal(rows: list[list[float | str | None]]) -> list[list[float | str | None]]:
    """Merge rows of a stage's wires, if there are many, that are equal as printed: test.1 to 4."""
    result, last = [], None
    for label, *values in rows:
        stage, _, number = str(label).rpartition(".")
        key = (stage, *(None if value is None else f"{value:.3f}" for value in values))
        if len(rows) > MANY_WIRES and key == last and number.isdecimal():
            result[-1][0] = f"{str(result[-1][0]).split(' ')[0]} to {number}"
        else:
            result.append([label, *values])
        last = key
    return result
