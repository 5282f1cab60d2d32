"""`pendsus response`: transfer functions, solved frequency by frequency."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import click

from suspension_cli.analyses import options
from suspension_cli.analyses.analysis import Analysis, Result, Run, only_one
from suspension_cli.analyses.options import option

if TYPE_CHECKING:
    import h5py
    from matplotlib.figure import Figure

    from suspension_cli.design.schema import Design
    from suspension_cli.linear.response import Response
    from suspension_cli.linear.system import LinearSystem
    from suspension_cli.models.quantity_of_interest import Transfer


class ResponseAnalysis(Analysis):
    """Compute frequency responses of motions to motions of the support and to forces.

    Several inputs and outputs give a matrix. Writes DIR/NAME-response.h5 and .png.

    Example: pendsus response my.toml --input support.z --output test.x
    """

    name = "response"
    arguments = (options.DESIGN,)
    parameters = (
        option(
            "--input",
            "inputs",
            multiple=True,
            metavar="SIGNAL",
            help=(
                "Input: support.x, upper.force_x, upper.torque_pitch, ... (repeatable)."
                "  [default: support.x]"
            ),
        ),
        option(
            "--output",
            "outputs",
            multiple=True,
            metavar="SIGNAL",
            help=(
                "Output: test.x, test.pitch, test.x@0,0,0.001, ... (repeatable)."
                "  [default: x of the last stage]"
            ),
        ),
        option(
            "--frequency",
            default="0.1:100:2000",
            show_default=True,
            metavar="GRID",
            help="Frequencies, Hz: start:stop:count[:log|lin], a comma list or a number.",
        ),
        option(
            "--scale",
            type=click.Choice(["db", "absolute"]),
            default="db",
            show_default=True,
            help="Magnitude axis of the plot.",
        ),
        option(
            "--closed-loop",
            is_flag=True,
            help="Close the loops of the design's [control] table.",
        ),
        options.ALLOW_UNSTABLE,
        options.ACCURACY,
        *options.WRITING,
    )

    def solve(self, run: Run) -> Result:
        """Solve for every input at every frequency."""
        from suspension_cli.analyses import model_choice
        from suspension_cli.analyses.response import closed_loop, peaks
        from suspension_cli.analyses.response.closed_loop import ClosedTransfer
        from suspension_cli.linear import response

        setting = run.setting
        request = partial(_request, setting=setting, design=run.design)
        decision = model_choice.choose(
            run.source, setting["fidelity"], request, setting["tolerance"]
        )
        choice = decision.choice
        model = model_choice.stable_system(
            run.source,
            choice,
            setting["allow_unstable"] or setting["closed_loop"],
            run.log,
            decision.model,
            bends=True,
        )
        wanted = request(model)
        if isinstance(wanted, ClosedTransfer):
            poles = closed_loop.find_stable_poles(
                run.design, model, choice.model, setting["allow_unstable"], run.log
            )
            found, solve = closed_loop.solve(wanted, model), partial(wanted.values, model)
            resonances = poles.frequency
        else:
            found = response.solve(model, wanted.frequency, wanted.inputs, wanted.outputs)
            solve = resonances = None
        largest = peaks.find_peaks(model, found, wanted.inputs, wanted.outputs, solve, resonances)
        return Result(self, run.source, choice, found, {"largest": largest}, command=run.command)

    def document(self, result: Result) -> dict[str, Any]:
        """Return one response flat, several in a list."""
        data: Response = result.data
        pairs = [
            {
                "input": into,
                "output": out,
                "unit": data.unit[o][i],
                "real": data.value[:, o, i].real.tolist(),
                "imag": data.value[:, o, i].imag.tolist(),
            }
            for o, out in enumerate(data.output)
            for i, into in enumerate(data.input)
        ]
        closed = {"closed_loop": True} if data.closed_loop else {}
        return closed | {"frequency_hz": data.frequency.tolist()} | only_one(pairs, "responses")

    def text(self, result: Result) -> str:
        """Return the ends of every response, and its peak even between the points of the grid."""
        import numpy as np

        data: Response = result.data
        largest = result.extra.get("largest")
        lines = [result.choice.line]
        if data.closed_loop and result.design.control is not None:
            names = ", ".join(loop.name for loop in result.design.control.loop)
            lines.append(f"loops closed: {names}")
        first, last = data.frequency[0], data.frequency[-1]
        for o, out in enumerate(data.output):
            for i, into in enumerate(data.input):
                size = np.abs(data.value[:, o, i])
                line = (
                    f"{out} / {into} ({data.unit[o][i]}): {size[0]:.4g} at {first:.4g} Hz,"
                    f" {size[-1]:.4g} at {last:.4g} Hz"
                )
                if largest is not None:
                    peak = largest.size[o, i]
                    top = f"{peak:.4g}" if np.isfinite(peak) else "infinite (no loss there)"
                    line += f", largest {top} at {largest.frequency[o, i]:.6g} Hz"
                lines.append(line)
        return "\n".join(lines)

    def fill(self, file: h5py.File, result: Result) -> None:
        """Write the group `response`."""
        from suspension_cli.analyses.response import file as stored

        stored.fill(file.create_group("response"), result.data)

    def load(self, file: h5py.File) -> Response:
        """Read the group `response`."""
        from suspension_cli.analyses.response import file as stored

        return stored.load(file["response"])

    def figures(self, result: Result, setting: dict[str, Any]) -> dict[str, Figure]:
        """Draw magnitude and phase."""
        from suspension_cli.analyses.response import picture

        title = result.title + (", loops closed" if result.data.closed_loop else "")
        return {"": picture.draw(result.data, title, setting.get("scale", "db"))}


def _request(model: LinearSystem, setting: dict[str, Any], design: Design) -> Transfer:
    """Inputs, outputs and frequencies in terms of a model of the design."""
    import numpy as np

    from suspension_cli.grids import parse_grid
    from suspension_cli.linear import signals
    from suspension_cli.models.quantity_of_interest import Transfer

    bodies = (*signals.bodies_with_signals(model),)
    inputs = [signals.parse_input(text, bodies) for text in setting["inputs"] or ("support.x",)]
    outputs = [
        signals.parse_output(text, bodies)
        for text in setting["outputs"] or (f"{model.body[-1]}.x",)
    ]
    frequency = np.array(parse_grid(setting["frequency"], "--frequency", "log", lowest=0.0))
    wanted = Transfer(inputs, outputs, frequency)
    if not setting["closed_loop"]:
        return wanted
    from suspension_cli.analyses.response import closed_loop

    return closed_loop.close(wanted, design, model)


ANALYSIS = ResponseAnalysis()
