"""`pendsus response`: transfer functions, solved frequency by frequency."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import click

from suspension_cli.analyses import options, tables
from suspension_cli.analyses.analysis import Analysis, Run, Settings
from suspension_cli.analyses.options import option
from suspension_cli.grids import are_few

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from suspension_cli.analyses.response.solve import Comparison, Response

FREQUENCY = "0.1:100:2000"
"""Default frequencies, Hz; with measured transfer functions, these cover them instead."""
ROWS = {"frequency\nHz": tables.AS_GIVEN, "magnitude": ".4e", "phase\ndegrees": ".2f"}
"""Columns of the table of a response at a few frequencies."""
SCALE = option(
    "--scale",
    type=click.Choice(["db", "absolute"]),
    default="db",
    help="Magnitude axis of the plot.",
    group=options.FILES,
)


class ResponseAnalysis(Analysis):
    """Compute frequency responses of motions to motions of the support and to forces.

    Several inputs and outputs give a matrix. Writes DIR/NAME-response.h5 and .png. With --measured,
    measured transfer functions are drawn over those of the model, with their ratio, deviations and
    shifts of resonances; signals and frequencies are then those of the measurements.

    Example: pendsus response my.toml --input support.x --output test.pitch

    Returns
    -------
    Response
        With `frequency` (f,) in Hz and `value` (f, outputs, inputs), complex, in SI units. With
        `measured`, the attribute `measured` is a tuple of `analyses.response.solve.Comparison`.

    Raises
    ------
    InputError
        If a signal does not exist, the equilibrium or closed loop is unstable, or there are no
        loops to close.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> found = sus.response(sus.example("double"), frequency=[1.0, 10.0], fidelity="string")
    >>> found.value.shape
    (2, 1, 1)
    """

    name = "response"
    result_type = "analyses.response.solve.Response"
    arguments = (options.DESIGN,)
    parameters = (
        options.signals(
            "input", "Input: support.x, upper.force_x, upper.torque_pitch, ...", "support.x"
        ),
        options.signals("output", options.MOTIONS, "x of the mirror"),
        options.frequencies(FREQUENCY),
        option(
            "--measured",
            multiple=True,
            metavar="FILE",
            help=(
                "Measured transfer functions to compare with: TOML (docs/measurements.md), or CSV,"
                " HDF5 or DTT XML with --input and --output (repeatable)."
            ),
        ),
        SCALE,
        option(
            "--closed-loop",
            is_flag=True,
            help="Close the loops of the design's [control] table.",
        ),
        options.ALLOW_UNSTABLE,
        options.ACCURACY,
        *options.WRITING,
    )
    drawn_with = (SCALE,)

    def solve(self, run: Run) -> Response:
        """Solve for every input at every frequency."""
        from suspension_cli.analyses.response import solve

        return solve.solve(self, run, default=run.setting["frequency"] == FREQUENCY)

    def text(self, result: Response) -> str:
        """Return the ends of every response, and its peak even between the points of the grid.

        A few frequencies have a row each. A response that symmetry makes exactly 0 has a remark
        instead.
        """
        import numpy as np

        if result.measured:
            return f"{result.run.choice.line}\n\n{_table(result.measured)}"
        lines = [result.run.choice.line]
        largest = result.largest
        if result.closed_loop and result.run.design.design.control is not None:
            names = ", ".join(loop.name for loop in result.run.design.design.control.loop)
            lines.append(f"loops closed: {names}")
        few = are_few(result.frequency)
        for o, out in enumerate(result.output):
            for i, into in enumerate(result.input):
                size = np.abs(result.value[:, o, i])
                if not size.any():
                    lines.append(f"{into} -> {out}: 0 by symmetry")
                    continue
                ends = [] if few else [0, -1]
                parts = [f"{size[n]:.4g} at {result.frequency[n]:.5g} Hz" for n in ends]
                if largest is not None:
                    peak = largest.size[o, i]
                    top = f"{peak:.4g}" if np.isfinite(peak) else "infinite (no loss there)"
                    parts.append(f"largest {top} at {largest.frequency[o, i]:.6g} Hz")
                name = f"{out} / {into} ({result.unit[o][i]})"
                lines.append(f"{name}: {', '.join(parts)}" if parts else name)
                if few:
                    phase = np.degrees(np.angle(result.value[:, o, i]))
                    rows = [*zip(result.frequency, size, phase, strict=True)]
                    lines.append(tables.render(ROWS, rows))
        return "\n".join(lines)

    def figures(self, result: Response, setting: Settings) -> dict[str, Figure]:
        """Draw magnitude and phase, at the frequencies that resolve resonances."""
        from suspension_cli.analyses.response import picture

        scale = setting.get("scale", "db")
        stages = [stage.name for stage in result.run.design.design.stage]
        if result.measured:
            title = result.subtitle + ", loops closed" * result.closed_loop
            return {"": picture.draw_measured(result.measured, title, scale, stages)}
        frequency, value = result.curve
        drawn = replace(result, frequency=frequency, value=value)
        return {"": picture.draw(drawn, result.subtitle, scale, stages)}


def _table(measured: Sequence[Comparison]) -> str:
    """Tables of the ratios, and of measured and modelled resonances."""
    columns = {"points": ".0f", "|measured/model|\nmedian": "#.4g", "farthest\nfrom 1": "#.4g"}
    columns |= {"at\nHz": "#.5g", "chi^2 per\nnumber": "#.3g", "measured": ""}
    rows = []
    for one in measured:
        data = one.data
        label = f"{data.name}: {data.output} / {data.input}"
        label += f" ({data.unit})" if data.unit else ""
        rows.append((one.points, one.median, *one.extreme, one.chi_squared, label))
    lines = [tables.render(columns, rows)]
    columns = {"measured\nHz": "#.5g", "model\nHz": "#.5g", "shift\n%": "+.2f", "mode": ""}
    columns |= {"seen in": ""} if len(measured) > 1 else {}
    rows = [
        (peak, pole, 100 * shift, mode, one.data.name)[: len(columns)]
        for one in measured
        for peak, pole, mode, shift in zip(one.peak, one.pole, one.mode, one.shift, strict=True)
        if mode
    ]
    alone = [f"{f:.5g}" for one in measured for f in one.peak[[not mode for mode in one.mode]]]
    lines += ["", tables.render(columns, rows)] if rows else []
    lines += ["", f"measured resonances of no mode: {', '.join(alone)} Hz"] if alone else []
    lines += [] if rows or alone else ["", "no measured resonances"]
    return "\n".join(lines)


ANALYSIS = ResponseAnalysis()
