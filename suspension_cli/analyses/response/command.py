"""`pendsus response`: transfer functions, solved frequency by frequency."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import click

from suspension_cli.analyses import options
from suspension_cli.analyses.analysis import (
    Analysis,
    Document,
    Result,
    Run,
    Settings,
    only_one,
    table,
)
from suspension_cli.analyses.options import option
from suspension_cli.grids import end_points

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from suspension_cli.analyses.response.solve import ComparedResponse, Comparison
    from suspension_cli.scene.arrays import Array

FREQUENCY = "0.1:100:2000"
"""Default frequencies, Hz; with measured transfer functions, these cover them instead."""
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
    Result
        With the attributes of `linear.response.Response`: `frequency` (f,) in Hz, `value`
        (f, outputs, inputs), complex, in SI units. With `measured`, the attribute `measured` is a
        tuple of `analyses.response.solve.Comparison`.

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
    result_type = "analyses.response.solve.ComparedResponse"
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

    def solve(self, run: Run) -> Result:
        """Solve for every input at every frequency."""
        from suspension_cli.analyses.response import solve as responses
        from suspension_cli.linear.response import units
        from suspension_cli.linear.solver import Solver
        from suspension_cli.physics import model_choice, near_limits
        from suspension_cli.physics.closed_loop import find_steady_poles

        setting = run.setting
        ends = setting["inputs"], setting["outputs"]
        items = responses.read_files(setting["measured"] or (), ends)
        default = setting["frequency"] == FREQUENCY
        about = {"setting": setting, "items": items, "design": run.design, "default": default}
        request = partial(responses.request, **about)
        unstable = setting["allow_unstable"]
        choice, model = model_choice.choose(run.source, setting["fidelity"], request)
        allowed = unstable or setting["closed_loop"]
        model = model_choice.stable_system(run.source, choice, allowed, run.log, model, bends=True)
        wanted, closed = request(model), None
        solver = Solver(model)
        near_limits.warn_of_tables(run.design, wanted.frequency, run.log)
        if isinstance(wanted, responses.ClosedTransfer):
            poles = find_steady_poles(
                run.design, model, choice.model, "response", run.log, unstable
            )
            resonances, closed = poles.frequency, (wanted, poles)
        else:
            resonances = solver.constant.modes.frequency
        found = responses.ComparedResponse(
            wanted.frequency,
            tuple(signal.text for signal in wanted.inputs),
            tuple(signal.text for signal in wanted.outputs),
            units(wanted.inputs, wanted.outputs),
            wanted.values(solver, wanted.frequency),
            closed_loop=closed is not None,
        )
        if not items:
            largest = responses.find_peaks(found, partial(wanted.values, solver), resonances)
            found = replace(found, largest=largest)
            return Result(self, run.source, choice, found, command=run.command, linear_system=model)
        found = replace(found, measured=responses.compare(model, items, found, closed))
        for text in filter(None, map(responses.slip, found.measured)):
            run.log.warn(text)
        return Result(self, run.source, choice, found, command=run.command)

    def document(self, result: Result) -> Document:
        """Return one response flat, several in a list."""
        data: ComparedResponse = result.data
        pairs = [
            {"input": into, "output": out, "unit": data.unit[o][i]}
            | _real_and_imaginary(data.value[:, o, i])
            for o, out in enumerate(data.output)
            for i, into in enumerate(data.input)
        ]
        closed = {"closed_loop": True} if data.closed_loop else {}
        answer = closed | {"frequency_hz": data.frequency.tolist()} | only_one(pairs, "responses")
        measured = [*map(_document, data.measured)]
        return answer | ({"measured": measured} if measured else {})

    def text(self, result: Result) -> str:
        """Return the ends of every response, and its peak even between the points of the grid.

        Of a few frequencies all are returned. One that symmetry makes exactly 0 has a remark
        instead.
        """
        import numpy as np

        data: ComparedResponse = result.data
        if data.measured:
            return f"{result.choice.line}\n\n{_table(data.measured)}"
        lines, largest = [result.choice.line], data.largest
        if data.closed_loop and result.given.design.control is not None:
            names = ", ".join(loop.name for loop in result.given.design.control.loop)
            lines.append(f"loops closed: {names}")
        shown = end_points(data.frequency)
        for o, out in enumerate(data.output):
            for i, into in enumerate(data.input):
                size = np.abs(data.value[:, o, i])
                if not size.any():
                    lines.append(f"{into} -> {out}: 0 by symmetry")
                    continue
                values = (f"{size[n]:.4g} at {data.frequency[n]:.4g} Hz" for n in shown)
                line = f"{out} / {into} ({data.unit[o][i]}): {', '.join(values)}"
                if largest is not None:
                    peak = largest.size[o, i]
                    top = f"{peak:.4g}" if np.isfinite(peak) else "infinite (no loss there)"
                    line += f", largest {top} at {largest.frequency[o, i]:.6g} Hz"
                lines.append(line)
        return "\n".join(lines)

    def completed(self, result: Result) -> Result:
        """Add the curve that resolves resonances."""
        data: ComparedResponse = result.data
        if data.measured or data.fine is not None:
            return result
        from suspension_cli.analyses.response import picture

        curve = picture.refine(result)
        data = replace(data, fine_frequency=curve.frequency, fine=curve.value)
        return replace(result, data=data)

    def figures(self, result: Result, setting: Settings) -> dict[str, Figure]:
        """Draw magnitude and phase, with the points that resolve resonances added."""
        from suspension_cli.analyses.response import picture

        scale = setting.get("scale", "db")
        stages = [stage.name for stage in result.given.design.stage]
        data: ComparedResponse = result.data
        if data.measured:
            title = result.subtitle + ", loops closed" * data.closed_loop
            return {"": picture.draw_measured(data.measured, title, scale, stages)}
        return {"": picture.draw(picture.refine(result), result.subtitle, scale, stages)}


def _document(one: Comparison) -> Document:
    data = one.data
    extreme, at = one.extreme
    return {
        "name": data.name,
        "file": data.file,
        "input": data.input,
        "output": data.output,
        "unit": data.unit,
        "points": len(data.frequency),
        "median_ratio": one.median,
        "extreme_ratio": extreme,
        "extreme_ratio_at_hz": at,
        "chi_squared_per_number": one.chi_squared,
        "resonances": table(one, "measured_hz=peak model_hz=pole mode shift"),
        "frequency_hz": data.frequency.tolist(),
        **_real_and_imaginary(data.value),
        "uncertainty": data.uncertainty,
        "coherence": data.coherence,
        **_real_and_imaginary(one.predicted, "model_"),
    }


def _real_and_imaginary(value: Array, prefix: str = "") -> Document:
    return {f"{prefix}real": value.real.tolist(), f"{prefix}imag": value.imag.tolist()}


def _table(measured: Sequence[Comparison]) -> str:
    """Tables of the ratios, and of measured and modelled resonances."""
    from suspension_cli.analyses import tables

    columns = {"points": ".0f", "|measured/model|\nmedian": "#.4g", "farthest\nfrom 1": "#.4g"}
    columns |= {"at\nHz": "#.5g", "chi^2 per\nnumber": "#.3g", "measured": ""}
    rows = []
    for one in measured:
        data = one.data
        label = f"{data.name}: {data.output} / {data.input}"
        label += f" ({data.unit})" if data.unit else ""
        rows.append((len(data.frequency), one.median, *one.extreme, one.chi_squared, label))
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
