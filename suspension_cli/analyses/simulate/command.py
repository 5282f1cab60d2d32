"""`pendsus simulate`: closed loops in time."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import click

from suspension_cli.analyses import options, tables
from suspension_cli.analyses.analysis import Analysis, Run, Settings
from suspension_cli.analyses.options import option

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from suspension_cli.analyses.simulate.solve import Simulation


class SimulateAnalysis(Analysis):
    """Run the loops of a design in time.

    Between samples the mechanics moves exactly under forces that are held; filters are those of a
    front end at this rate (continuous ones made digital as Foton does). Motions of the support, and
    noise of sensors and actuators, are drawn from their spectra; coils have the limits of their
    range. Loops at a divisor of the rate hold their forces in between. The run is written while it
    is computed, so its length is limited by the disk alone. Writes DIR/NAME-simulate.h5 and .png.

    Example: pendsus simulate my.toml --ground nlnm --duration 60

    Example: pendsus simulate my.toml --step upper.force_x=1e-3 --no-noise

    Returns
    -------
    Simulation
        With `time` (t,) in s, `value` (t, outputs), `force` (t, actuators), `limit`, `at_limit`,
        `frequency` (f,) in Hz, `density` (f, outputs). Arrays above 16 MB are read from the results
        file where they are used.

    Raises
    ------
    InputError
        If a loop is unstable, a filter does not fit the rate, or the disk has no space.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> design = sus.example("triple-damped")
    >>> how = {"rate": 512.0, "duration": 1.0, "fidelity": "string"}
    >>> sus.simulate(design, outputs=["upper.yaw"], step=["upper.torque_yaw=1e-6"], **how).unit
    ('rad',)
    """

    name = "simulate"
    result_type = "analyses.simulate.solve.Simulation"
    fills_file = True
    arguments = (options.DESIGN,)
    parameters = (
        options.signals("output", options.MOTIONS, "x of the mirror"),
        option(
            "--rate",
            type=click.FloatRange(1.0, 1e6),
            default=2048.0,
            help="Sample rate of the loops, Hz.",
        ),
        option(
            "--duration",
            type=click.FloatRange(1e-6, 1e6),
            default=10.0,
            help="Length of the run, s.",
        ),
        option(
            "--ground",
            multiple=True,
            metavar="[COORDINATES=]SOURCE",
            help="Motion of the support, as in budget: nlnm, aligo-isi, a file, ... (repeatable)."
            "  [default: none]",
        ),
        option(
            "--step",
            multiple=True,
            metavar="SIGNAL=SIZE",
            help="Constant force in N or torque in N m from 0 s on: upper.force_x=1e-3"
            " (repeatable).",
        ),
        option(
            "--impulse",
            multiple=True,
            metavar="SIGNAL=SIZE",
            help="Impulse in N s or N m s at 0 s: upper.torque_yaw=1e-4 (repeatable).",
        ),
        option(
            "--noise/--no-noise",
            default=True,
            help="Whether sensors and actuators have noise.",
        ),
        option(
            "--seed",
            type=click.IntRange(0, 2**31),
            default=0,
            help="Start of the random numbers; the same gives the same run.",
        ),
        options.ALLOW_UNSTABLE,
        options.ACCURACY,
        *options.WRITING,
    )

    def solve(self, run: Run) -> Simulation:
        """Run the loops."""
        from suspension_cli.analyses.simulate import solve

        return solve.solve(self, run)

    def text(self, result: Simulation) -> str:
        """Return tables of motions and of forces."""
        motions = zip(result.output, result.unit, result.rms, result.largest, strict=True)
        columns = {"motion": "", "unit": "", "RMS": ".4g", "largest": ".4g"}
        count = len(result.time)
        lines = [result.run.choice.line, f"{count:,} samples, to {result.time[-1]:.4g} s", ""]
        lines.append(tables.render(columns, [*motions]))
        if not result.actuator:
            return "\n".join(lines)
        limits = ["-" if math.isinf(limit) else f"{limit:.4g}" for limit in result.limit]
        forces = zip(
            result.actuator,
            result.actuator_unit,
            result.force_rms,
            result.largest_force,
            limits,
            100 * result.at_limit,
            strict=True,
        )
        columns = {"actuator": "", "unit": "", "RMS": ".4g", "largest": ".4g"}
        columns |= {"limit": "", "at limit\n% of time": ".3g"}
        return "\n".join([*lines, "", tables.render(columns, [*forces])])

    def figures(self, result: Simulation, setting: Settings) -> dict[str, Figure]:
        """Draw motions and forces, and spectra."""
        from suspension_cli.analyses.simulate import picture

        return {"": picture.draw(result)}


ANALYSIS = SimulateAnalysis()
