"""`pendsus xcouple`: cross-coupling of imperfect builds."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from suspension_cli.analyses import options, tables
from suspension_cli.analyses.analysis import Analysis, Document, Run, Settings
from suspension_cli.analyses.options import option
from suspension_cli.conventions import DOFS, SUPPORT
from suspension_cli.errors import InputError, format_value

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from suspension_cli.analyses.xcouple.imperfect_builds import ImperfectBuilds
    from suspension_cli.analyses.xcouple.solve import Coupling, CouplingMatrix
    from suspension_cli.design.schema import Design
    from suspension_cli.linear.system import LinearSystem
    from suspension_cli.physics.couplings import CouplingRequest
    from suspension_cli.studies.job import Axis

DEFAULT_GRID = {"k": "0.6:1.4:41"}
FACTOR_GRID = "0.9:1.1:41"
LARGEST = 1e6
"""Largest imperfection, a factor (or its inverse) or in SI units; far larger ones overflow."""
OTHER_GRID = "-2e-3:2e-3:5"


class CouplingAnalysis(Analysis):
    """Compute the cross-coupling of imperfect builds: the ratio of two motions.

    Sweeps the product of any number of imperfections; writes DIR/NAME-xcouple.h5 and .png.

    Example: pendsus xcouple my.toml --sweep k=0.9:1.1:21,offset=-1e-3,0,1e-3

    Returns
    -------
    Coupling or CouplingMatrix
        With `axes`, `ratio` (axis 1, axis 2, ..., f), complex; with `matrix` a matrix `value`
        (f, outputs, inputs).

    Raises
    ------
    InputError
        If a wire, body or imperfection does not exist.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> stage = sus.example("husman2000/figure6")
    >>> found = sus.xcouple(stage, sweep={"k": [0.9, 1.1]}, fidelity="string")
    >>> found.ratio.shape
    (2, 1)
    """

    name = "xcouple"
    result_type = "analyses.xcouple.solve.Coupling"
    fills_file = True
    draws_neglected = True
    arguments = (options.DESIGN,)
    parameters = (
        option(
            "--sweep",
            default="k,offset",
            metavar="NAME[=GRID],...",
            help="Imperfections (k, offset, lower_offset, length, mass, com, ...) or dotted paths.",
        ),
        option(
            "--wire",
            metavar="STAGE.N",
            help="The imperfect wire.  [default: the first of the mirror]",
        ),
        option("--body", metavar="STAGE", help="The imperfect body.  [default: the wire's]"),
        option(
            "--hold",
            type=click.Choice(["loaded-length", "natural-length"]),
            default="loaded-length",
            help="Length that stays the same when the wire changes.",
        ),
        *options.COUPLING,
        option(
            "--matrix",
            is_flag=True,
            help="The six-by-six table of couplings of this one design instead of a sweep.",
        ),
        options.EVERY_POINT,
        *options.SWEEP,
        options.ACCURACY,
        options.ALLOW_UNSTABLE,
        *options.WRITING,
    )

    def returned_type(self) -> Any:
        """What the Python function returns: a sweep, or with `matrix` the matrix of one design."""
        from suspension_cli.analyses.xcouple.solve import Coupling, CouplingMatrix

        return Coupling | CouplingMatrix

    def swept_names(self) -> tuple[str, ...]:
        """Imperfections, whose grids may stand in `[analysis.xcouple]`."""
        from suspension_cli.analyses.xcouple.imperfect_builds import PARAMETERS

        return tuple(PARAMETERS)

    def solve(self, run: Run) -> Coupling | CouplingMatrix:
        """Compute the coupling of all builds, or the matrix of one design."""
        from suspension_cli.analyses import sweeping
        from suspension_cli.analyses.xcouple import compared_builds
        from suspension_cli.analyses.xcouple.imperfect_builds import ImperfectBuilds
        from suspension_cli.analyses.xcouple.solve import write
        from suspension_cli.design.derive import mirror
        from suspension_cli.models import registry
        from suspension_cli.physics import model_choice
        from suspension_cli.physics.couplings import parse_request

        setting = run.setting
        source = run.source
        unstable = setting["allow_unstable"]
        strings = registry.STRING.system(run.design)
        requested = parse_request(strings, setting, mirror(run.design))
        if setting["matrix"]:
            return MATRIX.of(run, requested)
        over = axes(setting["sweep"], run.design.analysis.get("xcouple", {}))
        job = ImperfectBuilds(source.text, over, requested, unstable)
        job.check()
        study = sweeping.Study(
            lambda level: dataclasses.replace(job, level=level),
            registry.SCENE_MODELS,
            partial(compared_builds.coupling_change, job),
            compared_builds.first_points(job),
            compared_builds.extreme_points,
            write,
            _warnings,
        )
        choice = study.choose(source, setting)
        model_choice.stable_system(source, choice, unstable, run.log, bends=True)
        return sweeping.fill(run, self, study, choice)

    def document(self, result: Coupling) -> Document:
        """Leave out the dimension of a single frequency."""
        document = super().document(result)
        if len(result.frequency) == 1:
            single = {"frequency_hz": result.frequency[0]}
            single |= {key: document[key][..., 0] for key in ("ratio_real", "ratio_imag")}
            document |= single
        return document

    def text(self, result: Coupling) -> str:
        """Return the largest coupling and where it is."""
        import numpy as np

        if not (worst := result.worst):
            return f"{result.run.choice.line}\nno build has an equilibrium on taut wires"
        size = np.abs(result.ratio)
        at = ", ".join(
            f"{axis.name} = {axis.values[n]:.6g} {axis.unit}".removesuffix(" 1")
            for axis, n in zip(result.axes, worst[:-1], strict=True)
        )
        kept = result.hold.replace("-", " ")
        of = f": wire {result.wire} changes, its {kept} is kept" if result.wire else ""
        note = f"{result.interpolation}\n" if result.interpolation else ""
        return (
            f"{result.run.choice.line}\n{note}{result.status.size} builds{of}\n"
            f"|{result.over} / {result.under}| for {result.input}: largest {size[worst]:.4g} at"
            f" {at}, {result.frequency[worst[-1]]:.4g} Hz; median {np.nanmedian(size):.3g}"
        )

    def figures(self, result: Coupling, setting: Settings) -> dict[str, Figure]:
        """Draw the coupling against the imperfections, or against frequency."""
        from suspension_cli.analyses.xcouple import picture

        over, under = (name.partition("@")[0][-2:] for name in (result.over, result.under))
        limit = _limit(result.run.design.design) if (over, under) == (".x", ".z") else None
        return {"": picture.draw(result, result.subtitle, limit)}


class MatrixAnalysis(Analysis):
    """Coupling of every motion of the support to every motion of one body."""

    name = "matrix"
    result_type = "analyses.xcouple.solve.CouplingMatrix"
    draws_neglected = True

    @property
    def command_name(self) -> str:
        """Name of the command that has the option --matrix."""
        return "xcouple"

    @property
    def stem(self) -> str:
        """End of the stem of the results file."""
        return "xcouple-matrix"

    def solve(self, run: Run) -> CouplingMatrix:
        """Refuse: the matrix is an option of `xcouple`."""
        raise NotImplementedError

    def of(self, run: Run, requested: CouplingRequest) -> CouplingMatrix:
        """Compute the matrix of one design, for the point that a request observes."""
        import numpy as np

        from suspension_cli.analyses.xcouple.solve import CouplingMatrix
        from suspension_cli.linear import response, signals
        from suspension_cli.models.choice import Transfer
        from suspension_cli.physics import model_choice

        setting = run.setting
        frequency = np.array(requested.frequency)
        body, at, point = (setting["observe"] or requested.over.body).partition("@")

        def request(system: LinearSystem) -> Transfer:
            known = signals.bodies_with_signals(system)
            inputs = [signals.parse_input(f"{SUPPORT}.{dof}", known) for dof in DOFS]
            moves = [f"{body}.{dof}{(at + point) * (dof in 'xyz')}" for dof in DOFS]
            outputs = [signals.parse_output(text, known) for text in moves]
            return Transfer(inputs, outputs, frequency)

        choice, model = model_choice.choose(run.source, setting["fidelity"], request)
        model = model_choice.stable_system(
            run.source, choice, setting["allow_unstable"], run.log, model, bends=True
        )
        motions = request(model)
        found = response.solve(model, frequency, motions.inputs, motions.outputs)
        return CouplingMatrix.extending(found, run=run.origin(self, choice))

    def text(self, result: CouplingMatrix) -> str:
        """Return a table for each frequency."""
        body, _, point = result.output[0].partition(".x")
        lines = [result.run.choice.line]
        for frequency, matrix in zip(result.frequency, result.value, strict=True):
            rows = [
                (dof, *("0" if value == 0 else abs(value) for value in row))
                for dof, row in zip(DOFS, matrix, strict=True)
            ]
            motions = f"|motion of {body}{point} for motion of the support|"
            lines += [
                f"{motions} at {frequency:.4g} Hz (m, rad)",
                tables.render({"": "", **dict.fromkeys(DOFS, ".3e")}, rows),
            ]
        return "\n".join(lines)

    def figures(self, result: CouplingMatrix, setting: Settings) -> dict[str, Figure]:
        """Draw the table."""
        from suspension_cli.analyses.xcouple import picture

        return {"": picture.draw_matrix(result, result.subtitle)}


def _warnings(found: Coupling, job: ImperfectBuilds) -> Iterator[str]:
    """Say how many builds failed, and why."""
    failed = [f"{n} of {job.count} builds failed: {why}" for why, n in found.failures.items()]
    if failed:
        yield f"{'; '.join(failed)}; they have no result: sweep smaller imperfections"


def _limit(design: Design) -> float:
    """Limit on the coupling: that of the design's `[analysis.tolerance]`, or the usual one."""
    return float(design.analysis.get("tolerance", {}).get("limit", options.COUPLING_LIMIT))


def axes(text: str, table: Document) -> tuple[Axis, ...]:
    """Parse the axes of `--sweep`; missing grids come from the design's table or the defaults."""
    from suspension_cli.analyses.xcouple.imperfect_builds import PARAMETERS
    from suspension_cli.design.faults import suggest
    from suspension_cli.grids import parse_grid
    from suspension_cli.studies.job import Axis, distinct

    result = []
    for part in re.split(r",(?!\s*[-+.\d])", text):  # numbers are further values of a list
        name, equals, values = (piece.strip() for piece in part.partition("="))
        if name not in PARAMETERS and "." not in name:
            remedy = suggest(name, list(PARAMETERS)) + " or a dotted path"
            problem = f"there is no imperfection {name!r}"
            raise InputError.of("--sweep", problem, remedy, format_value(text))
        if "." in name and not equals:
            remedy = f"write {name}=start:stop:count"
            raise InputError.of("--sweep", f"{name} has no grid", remedy, format_value(text))
        factor = name in PARAMETERS and PARAMETERS[name][0].relative
        given = values or _default_grid(name, table, is_factor=factor)
        lowest = 1 / LARGEST if factor else -LARGEST
        grid = parse_grid(given, f"--sweep {name}", lowest=lowest, highest=LARGEST)
        result.append(Axis(name, tuple(grid)))
    return distinct(result, "--sweep", text)


def _default_grid(name: str, table: Document, *, is_factor: bool) -> str:
    """Grid of a parameter in the design's table, or the usual one, as text."""
    usual = DEFAULT_GRID.get(name, FACTOR_GRID if is_factor else OTHER_GRID)
    given = table.get(name, usual)
    return ",".join(map(str, given)) if isinstance(given, list) else str(given)


ANALYSIS = CouplingAnalysis()
MATRIX = MatrixAnalysis()
