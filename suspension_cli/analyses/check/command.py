"""`pendsus check`: validity and plausibility of designs, loads of their wires and blades."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from suspension_cli.analyses import options, tables
from suspension_cli.analyses.analysis import Analysis, Document, Run
from suspension_cli.errors import escape_unprintable

if TYPE_CHECKING:
    from suspension_cli.analyses.check.solve import Check
    from suspension_cli.design.bodies import Point
    from suspension_cli.design.schema import Tie
    from suspension_cli.physics.loads import ConductedHeat, LinkLoad


class CheckAnalysis(Analysis):
    """Check a design, and list what its wires and blades carry.

    Writes no file. Errors of all designs are listed, one per line with file, key, value and remedy.
    Values that are valid but implausible are warnings: a wire that would break, a body denser than
    osmium, an unstable pendulum, a sensor on a stage that does not exist.

    Example: pendsus check my.toml --strict

    Returns
    -------
    Check
        With `stable`, `statics`, `verdicts`, and `warnings`, which are Python warnings too.

    Raises
    ------
    InputError
        If the design does not balance, or an ``[analysis]`` table has faults.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> found = sus.check(sus.template("single"))
    >>> found.stable, len(found.warnings), round(found.statics.wires[0].tension, 2)
    (True, 0, 13.75)
    """

    name = "check"
    returns = "analyses.check.solve.Check"
    has_model = False
    has_file = False
    arguments = (options.DESIGNS,)
    parameters = (
        options.option(
            "--strict",
            is_flag=True,
            help="Exit with 1 if there are warnings, or a requirement is not met.",
            group=options.FILES,
        ),
        options.OVERRIDES,
        options.TIES,
        options.AS_JSON_ONLY,
    )

    def solve(self, run: Run) -> Check:
        """Check a design, and warn of what is implausible."""
        from suspension_cli.analyses.check.solve import check

        return check(self, run)

    def exit_code(self, result: Check) -> int:
        """Return 1 with --strict if there are warnings, or requirements that are not met."""
        failed = [verdict for verdict in result.verdicts if not verdict.met]
        return int(result.run.options["strict"] and bool(result.warnings or failed))

    def document(self, result: Check) -> Document:
        """Return loads, warnings and stability."""
        from suspension_cli.analyses import verdicts
        from suspension_cli.analyses.check.load_tables import list_documents
        from suspension_cli.design.locked_stages import locked_names

        loads = result.statics
        own = result.weights
        document: Document = {
            "file": result.run.design.file,
            "stable": result.stable,
            "stability_model": result.stability_model,
            "residual": loads.residual,
            "height_m": loads.height,
        }
        for name in ("lowest", "wires", "blades", "bodies"):
            document[name] = list_documents(getattr(loads, name))
        for name in ("links", "legs", "filters", "cavities", "profiles", "temperatures", "heat"):
            if parts := getattr(loads, name):
                key = "inverted_pendulums" if name == "legs" else name
                document[key] = list_documents(parts)
        if parts := _bodies_of_parts(result):
            keys = ("stage", "mass_kg", "com_m")
            document["bodies_of_parts"] = [dict(zip(keys, one, strict=True)) for one in parts]
        if held := locked_names(result.run.design.design):
            document["locked"] = held
        if tied := _tied(result):
            document["ties"] = [
                {"name": tie.name, "equals": tie.equals, "value": number} for tie, number in tied
            ]
        document["warnings"] = [
            {name: getattr(item, name) for name in ("key", "value", "problem", "remedy", "serious")}
            for item in result.warnings
        ]
        if result.verdicts:
            document["requirements"] = [verdicts.document(one) for one in result.verdicts]
        if own is not None and own.included:
            [document["wire_weight"]] = list_documents([own])
        return document

    def text(self, result: Check) -> str:
        """Return tables of loads, the lowest points, the pose and the stability."""
        from suspension_cli.analyses import verdicts
        from suspension_cli.analyses.check.load_tables import render
        from suspension_cli.design import paths
        from suspension_cli.design.locked_stages import locked_names, requirements_at_rest

        loads = result.statics
        count = len(result.warnings)
        verdict = "good" if not count else f"{count} warning{'s' * (count > 1)}"
        choice = result.run.choice
        file = escape_unprintable(result.run.design.file) or result.run.name
        lines = [f"{file}: {verdict}; simplest valid model: {choice.level} ({choice.reason})"]
        tabulated = (loads.wires, loads.blades, loads.legs, loads.filters, loads.cavities)
        lines += [render(parts) for parts in tabulated if parts]
        lines += _link_tables(loads.links)
        if loads.temperatures:
            lines += [render(loads.temperatures), _heat_table(loads.heat)]
        if result.weights is not None and result.weights.line:
            lines.append(f"  {result.weights.line}")
        lines += [
            f"  profile of {one.wire}: {one.places} places in {one.sections} uniform sections"
            for one in loads.profiles
        ]
        lines += [
            f"  {tie.name} = {tie.equals} = {paths.format_with_unit(tie.name, number, 6)}"
            for tie, number in _tied(result)
        ]
        for body in loads.bodies:
            shift, turn = map(_milli, (body.shift, body.rotation))
            if {shift, turn} != {_milli((0.0, 0.0, 0.0))}:
                lines.append(
                    f"  {body.name} hangs ({shift}) mm and ({turn}) mrad from its nominal pose"
                    " (string model)"
                )
        lines += [
            f"  the table of link {link.label} covers {link.table[0]:g} to {link.table[1]:g} Hz;"
            " outside, its stiffness is constant"
            for link in loads.links
            if link.table is not None
        ]
        lines += [
            f"  {name}: {mass:.6g} kg in parts, COM at ({_milli(centre)}) mm from their origin"
            for name, mass, centre in _bodies_of_parts(result)
        ]
        if held := locked_names(result.run.design.design):
            lines.append(f"  locked, so at rest with the support: {', '.join(held)}")
        if idle := requirements_at_rest(result.run.design.design):
            lines.append(f"  requirements without effect, of stages at rest: {', '.join(idle)}")
        lowest = sorted(loads.lowest, key=lambda low: low.z)[:3]
        points = ", ".join(f"{low.name} {low.z:.4g} m ({low.point})" for low in lowest)
        lines.append(f"  height {loads.height:.4g} m; lowest points: {points}")
        if result.stable is not None:
            word = "stable" if result.stable else "UNSTABLE"
            lines.append(f"  {word} in the {result.stability_model} model")
        residual = f"largest residual force: {loads.residual:.0e} of the weight"
        lines.append(f"  {residual}; loads and poses are those of the string model")
        if result.verdicts:
            lines.append(verdicts.tabulate(result.verdicts))
        return "\n".join(lines)


def _bodies_of_parts(result: Check) -> list[tuple[str, float, Point]]:
    """List stages whose body consists of parts, with its mass, kg, and COM from its origin, m."""
    from suspension_cli.design.bodies import body_mass, centre_of_mass

    bodies = {stage.name: stage.body for stage in result.run.design.design.stage}
    return [
        (name, body_mass(body), centre_of_mass(body)) for name, body in bodies.items() if body.parts
    ]


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


def _heat_table(conducted: Sequence[ConductedHeat]) -> str:
    """Table of the heat that wires and links conduct."""
    heads = {"conductor": "", "from": "", "to": "", "heat\nW": ".4g", "from\nK": ".3f"}
    heads |= {"to\nK": ".3f"}
    rows = [(one.label, one.warm, one.cold, one.power, one.high, one.low) for one in conducted]
    return tables.render(heads, rows)


def _milli(vector: tuple[float, ...]) -> str:
    """Write components in thousandths, without minus signs of zeros."""
    return ", ".join(f"{round(1e3 * value, 4) + 0.0:.4f}" for value in vector)


def _tied(result: Check) -> list[tuple[Tie, float]]:
    """List the tied parameters of a design with their values."""
    from suspension_cli.studies import parameters

    design = result.run.design.design
    return [(tie, parameters.value_of(design, tie.name)) for tie in design.tie]


ANALYSIS = CheckAnalysis()
