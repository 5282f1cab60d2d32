"""`pendsus export`: the model as state space for control tools."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import click

from suspension_cli.analyses import options, tables
from suspension_cli.analyses.analysis import Analysis, Document, Run
from suspension_cli.analyses.export.file import FORMATS
from suspension_cli.analyses.options import option

if TYPE_CHECKING:
    import h5py

    from suspension_cli.analyses.export.front_end import FrontEndFiles
    from suspension_cli.analyses.export.gwinc_tables import GwincTables
    from suspension_cli.analyses.export.solve import Export, Exported

MOST = 12
"""Largest number of responses that are all printed."""


class ExportAnalysis(Analysis):
    """Export the state space of the model as DIR/NAME-statespace.*, or a noise budget of gwinc.

    States, inputs and outputs have names and units. The band in which the export agrees with its
    own model, and those in which it agrees with the violin model to 1 % and 10 %, are measured and
    recorded in the file.

    Example: pendsus export my.toml --format control

    Returns
    -------
    Export
        With `system` (matrices `a`, `b`, `c`, `d`), `band` in Hz, and `agreement` with the violin
        model; for gwinc `analyses.export.gwinc_tables.GwincTables`, with `table` and the
        `accuracy` of interpolation.

    Raises
    ------
    InputError
        If a signal does not exist.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> sus.export(sus.example("double"), fidelity="string").system.a.shape
    (24, 24)
    """

    name = "export"
    returns = "analyses.export.solve.Export"
    arguments = (options.DESIGN,)
    parameters = (
        option(
            "--format",
            type=click.Choice(list(FORMATS)),
            default="mat",
            help="; ".join(f"{name}: {form.about}" for name, form in FORMATS.items()) + ".",
        ),
        options.signals(
            "input",
            "An input",
            "the support's six motions and six forces on the first stage; for finesse x, pitch and"
            " yaw of the support and of all stages of the main chain",
        ),
        options.signals(
            "output",
            "An output",
            "the six motions of the first stage and of the mirror; for finesse x, pitch and yaw "
            "of all stages of the main chain; for gwinc x of the mirror",
        ),
        option(
            "--closed-loop",
            is_flag=True,
            help="Close the loops of the design's [control] table. Inputs are also sensor.NAME,"
            " noise of a sensor, and actuator.NAME, a force added to that of a loop or coil;"
            " outputs also sensor.NAME, its reading, and drive.NAME, the force demanded. All are"
            " exported by default.",
        ),
        option(
            "--loss/--no-loss",
            default=False,
            show_default=True,
            help="Include losses and the mass of wires, with the right Q and the right isolation.",
        ),
        option(
            "--band",
            metavar="FROM:TO",
            help="Band in which losses are right, and filters of foton, Hz; for gwinc that of the"
            " table.  [default: 0.1:100; for gwinc 5:3000]",
        ),
        option(
            "--accuracy",
            type=click.FloatRange(1e-4, 0.5),
            default=0.01,
            help="Largest relative error of responses off resonance with losses, and of filters of"
            " foton; of Q twice that; for gwinc of interpolation.",
        ),
        option(
            "--order",
            type=click.IntRange(1, 6000),
            help="Most states with losses: the most accurate system of up to so many.  [default: "
            "as many as --accuracy needs]",
        ),
        option(
            "--rate",
            type=click.FloatRange(1.0, 1e7),
            default=16384.0,
            help="Sample rate of foton and of front-end, Hz.",
        ),
        option(
            "--interferometer",
            default="aLIGO",
            metavar="NAME",
            help="For gwinc: the one whose budget gets the suspension, aLIGO, Aplus, Voyager, CE1,"
            " ... or the path of a budget.",
        ),
        options.ALLOW_UNSTABLE,
        options.OVERRIDES,
        options.TIES,
        options.OUT,
        options.NAME,
        options.FIDELITY,
        options.ACCURACY,
        options.AS_JSON_ONLY,
        options.NO_PICTURE,
        options.QUIET,
        options.VERBOSE,
    )

    def solve(self, run: Run) -> Export | GwincTables | FrontEndFiles:
        """Build the state space and measure its band."""
        _check_options(run.setting)
        if run.setting["format"] == "gwinc":
            from suspension_cli.analyses.export import gwinc_tables

            return gwinc_tables.solve(self, run)
        if run.setting["format"] == "front-end":
            from suspension_cli.analyses.export import front_end

            return front_end.solve(self, run)
        from suspension_cli.analyses.export import state_space

        return state_space.solve(self, run)

    def text(self, result: Export | GwincTables | FrontEndFiles) -> str:
        """Return the size of the system and the band of agreement."""
        run = result.run
        if result.format == "gwinc":
            summary = cast("GwincTables", result).describe(run.file)
            return f"{run.choice.line}\n{summary}"
        if result.format == "front-end":
            return "\n".join(_describe_front_end(cast("FrontEndFiles", result)))
        made = cast("Export", result)
        own = f"the {run.model} model to {made.tolerance:g}"
        low, high = made.tried
        tried = f"({low:.3g} to {high:.4g} Hz tried)"
        agrees = f"there is no band in which it agrees with {own} {tried}"
        if made.band is not None:
            agrees = "agrees with {} from {:.3g} to {:.4g} Hz".format(own, *made.band)
        error = f"(worst {made.worst:.1e}, up to 100 times the highest mode)"
        if made.q_error is not None:
            sizes = f"{100 * made.worst:.2g} % of a response off resonance"
            error = f"worst error from {low:g} to {high:g} Hz: {sizes}"
            error += f", {100 * made.q_error:.2g} % of a Q"
        counts = [len(getattr(made.system, key)) for key in ("state", "input", "output")]
        size = "states: {}, inputs: {}, outputs: {}".format(*counts)
        lines = [run.choice.line, f"{size}; {agrees}", error]
        lines += [*_describe_loops(made), *_describe_causality(made)]
        if (orders := made.orders) is not None:
            rows = zip(orders.states, 100 * orders.worst, 100 * orders.q_error, strict=True)
            columns = {"states": "d", "off resonance\n%": ".2g", "Q\n%": ".2g"}
            lines += ["\nlargest error by number of states:\n", tables.render(columns, list(rows))]
        if (filters := made.filters) is not None:
            low, high = made.tried if filters.band is None else filters.band
            head = f"filter modules at {filters.rate:g} Hz, with the largest error from {low:g} to"
            columns = dict.fromkeys(("module", "output", "input", "sections", "poles"), "")
            rows = [
                (one.name, one.output, one.input, one.sections, one.poles, one.error)
                for one in filters.module
            ]
            lines += [f"\n{head} {high:g} Hz off resonance:\n"]
            lines += [tables.render(columns | {"error": ".2g"}, rows)]
        return "\n".join([*lines, _table(made)])

    def path(self, result: Export | GwincTables | FrontEndFiles, folder: Path) -> Path:
        """Return the path of the exported file."""
        stem = result.run.design.stem()
        form = result.format
        # gwinc takes a dot for the start of a file's ending
        if form == "gwinc":
            stem = stem.replace(".", "_")
        elif form != "front-end":
            stem = f"{stem}-statespace"
        return folder / f"{stem}{FORMATS[form].suffix}"

    def save(self, path: Path, result: Export | GwincTables | FrontEndFiles) -> None:
        """Write the exported file, in the format of its ending."""
        from suspension_cli.analyses.export.file import format_of

        FORMATS[format_of(path, result)].write(path, result, result.provenance)

    def others(self, result: Export | GwincTables | FrontEndFiles, path: Path) -> list[Path]:
        """Write the matrices of a front end beside its filters."""
        if result.format != "front-end":
            return []
        from suspension_cli.analyses.export import front_end

        beside = path.with_suffix(".snap")
        front_end.write_matrices(beside, cast("FrontEndFiles", result), result.provenance)
        return [beside]

    def fill(self, file: h5py.File, result: Export | GwincTables | FrontEndFiles) -> None:
        """Refuse: a state space has no labelled arrays."""
        from suspension_cli.errors import InputError

        remedy = "take system.a, b, c and d, or save it as .mat, .npz, .h5 or .json"
        raise InputError.of("", "a state space has no labelled arrays", remedy)


def _check_options(setting: Mapping[str, Any]) -> None:
    """Raise `InputError` for options that do not go together."""
    from suspension_cli.errors import InputError

    if setting["closed_loop"] and setting["format"] == "gwinc":
        remedy = "leave it out, or take another format"
        raise InputError.of("--closed-loop", "gwinc has no loops of suspensions", remedy)
    order = setting["order"]
    if order is None:
        return
    if setting["format"] == "gwinc":
        raise InputError.of("--order", "gwinc has no states", "leave it out", f"{order}")
    if not setting["loss"]:
        problem = "without losses the number of states is that of the bodies"
        raise InputError.of("--order", problem, "add --loss, or leave it out", f"{order}")


def _describe_front_end(made: FrontEndFiles) -> Iterator[str]:
    """Tabulate the modules and matrices of a front end."""
    import numpy as np

    columns: dict[str, str] = dict.fromkeys(("module", "sections", "poles"), "")
    rows = [(one.name, one.sections, one.poles) for one in made.filters.module]
    yield f"filter modules at {made.filters.rate:g} Hz:\n"
    yield tables.render(columns, rows)
    elements = [
        (matrix.name, row + 1, column + 1, matrix.row[row], matrix.column[column], value)
        for matrix in made.matrix
        for (row, column), value in np.ndenumerate(matrix.value)
        if value
    ]
    columns = dict.fromkeys(("matrix", "row", "column", "makes", "of"), "")
    yield "\nelements of matrices that are not 0:\n"
    yield tables.render(columns | {"value": ".4g"}, elements)
    yield "\nin m, rad, N and N m; not included: responses of sensors and drivers, and delays"


def _describe_loops(made: Export) -> Iterator[str]:
    """Describe closed loops: their poles beside those of the complete equations, and filters."""
    from suspension_cli.analyses.export.state_space import describe_filters

    poles = made.poles
    if poles is None:
        return
    if len(poles.state):
        highest = made.tried[1]
        most, n = poles.largest(highest)
        where = f"{poles.state[n]}, {poles.frequency[n]:.4g} Hz" if most else "all"
        q = poles.q_error(made.tried)
        yield (
            f"closed-loop poles up to {highest:.4g} Hz agree with the complete equations within"
            f" {100 * most:.2g} % ({where}), their Q within {100 * q:.2g} %"
        )
    yield from describe_filters(made.run.design.design)


def _table(made: Exported) -> str:
    """Tabulate the bands of agreement with the most complete model.

    Of more than `MOST` responses, only those of equal coordinates.
    """
    from suspension_cli.analyses.export.solve import AGREEMENT

    found = made.agreement
    assert found is not None
    name = f"agreement with the {found.model} model"
    pairs = found.pairs
    if pairs is None:
        why = f"{found.unknown}; give the material and radius of wires"
        return f"{name} (wires that bend and have mass) is not known: {why}"

    def coordinate(signal: str) -> str:
        return signal.partition("@")[0].rpartition(".")[2].rpartition("_")[2]

    def is_of_loop(pair: Document) -> bool:
        ends = pair["output"], pair["input"]
        return any(name.startswith(("sensor.", "actuator.", "drive.")) for name in ends)

    equal = [pair for pair in pairs if coordinate(pair["output"]) == coordinate(pair["input"])]
    shown = pairs
    if len(pairs) > MOST:
        shown = [pair for pair in equal or pairs if not is_of_loop(pair)] or pairs
    columns = {"output": "", "input": ""}
    for error in AGREEMENT:
        columns |= {f"{100 * error:g} % from\nHz": ".3g", f"{100 * error:g} % to\nHz": ".4g"}
    rows = [
        (out, into, *(end for band in bands for end in band or (None, None)))
        for out, into, *bands in (pair.values() for pair in shown)
    ]
    rest = "" if shown is pairs else "; all responses are in --json and in the file"
    return f"\nbands of {name}, off resonance{rest}:\n\n" + tables.render(columns, rows)


def _describe_causality(made: Export) -> list[str]:
    """Say which link's loss angle no system can have over the whole band, if it limits the errors.

    A response that is proportional to a stiffness with the loss angle phi at all frequencies has
    the phase phi. Its magnitude then goes as f^(2 phi/pi) (Bode; Kramers and Kronig), which over
    the band is a deviation of phi/pi ln(f_2/f_1) to either side of a constant.
    """
    design = made.run.design.design
    angles = {one.name: one.loss_angle for one in design.link if isinstance(one.loss_angle, float)}
    if made.q_error is None or made.worst <= made.tolerance or not angles:
        return []
    name = max(angles, key=lambda name: angles[name])
    low, high = made.tried
    deviation = angles[name] / math.pi * math.log(high / low)
    if deviation <= made.tolerance:
        return []
    return [
        f"link {name} has the loss angle {angles[name]:g} at all frequencies, for which constant"
        f" matrices need a stiffness that changes by {100 * deviation:.2g} % to either side in this"
        " band; responses that pass through the link alone err by about as much; narrow --band"
    ]


ANALYSIS = ExportAnalysis()
