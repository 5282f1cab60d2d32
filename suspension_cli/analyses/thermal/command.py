"""`pendsus thermal`: thermal noise, split by what dissipates."""

from __future__ import annotations

from typing import TYPE_CHECKING

from suspension_cli.analyses import options, tables
from suspension_cli.analyses.analysis import (
    Analysis,
    Document,
    Result,
    Run,
    Settings,
    describe_mirrors,
    name_mirrors,
    only_one,
)
from suspension_cli.conventions import SUPPORT
from suspension_cli.errors import InputError, format_value
from suspension_cli.grids import decade_points, parse_frequencies, table_points

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from suspension_cli.design.schema import Design
    from suspension_cli.physics.thermal_noise import Thermal
    from suspension_cli.scene.arrays import Array

LEADING = 0.01
"""Fraction of the power from which a cause is named in the summary."""
NAMED = 3
"""Causes named at each frequency, at most."""


class ThermalAnalysis(Analysis):
    """Compute thermal noise of motions, split by cause.

    The beam of a long arm is not level where it meets the mirrors, so it sees a little of their
    vertical motion: --arm. Several mirrors make one degree of freedom: --mirrors. Writes
    DIR/NAME-thermal.h5 and .png.

    Example: pendsus thermal my.toml --arm 4000 --mirrors 4

    Returns
    -------
    Result
        Its `data` is a list of `physics.thermal_noise.Thermal`, one for each output, with
        `amplitude` (f,) in m/sqrt(Hz) or rad/sqrt(Hz) and `parts` by cause.

    Raises
    ------
    InputError
        If an output moves nothing that dissipates.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> found = sus.thermal(sus.example("geo-silica-triple"), frequency=[10.0, 100.0])
    >>> found.data[0].amplitude.shape
    (2,)
    """

    name = "thermal"
    result_type = "physics.thermal_noise.Thermal"
    arguments = (options.DESIGN,)
    parameters = (
        options.signals("output", options.MOTIONS, "x of the mirror"),
        options.frequencies("0.1:1000:2000"),
        *options.BEAM,
        options.ALLOW_UNSTABLE,
        options.ACCURACY,
        *options.WRITING,
    )

    def solve(self, run: Run) -> Result:
        """Compute the noise of every output."""
        from dataclasses import replace

        import numpy as np

        from suspension_cli.design.derive import mirror
        from suspension_cli.physics import model_choice, near_limits, thermal_noise
        from suspension_cli.physics.lossless import describe_lossless, find_lossless
        from suspension_cli.physics.missing_losses import state_missing_losses

        setting = run.setting
        frequency, arm = np.array(parse_frequencies(setting["frequency"])), setting["arm"]
        outputs = setting["outputs"] or (f"{mirror(run.design)}.x",)
        choice, model = thermal_noise.choose(
            run.source, setting["fidelity"], frequency, outputs, arm
        )
        model = model_choice.stable_system(
            run.source, choice, setting["allow_unstable"], run.log, model
        )
        motions = thermal_noise.parse_outputs(model, outputs, arm)
        for signal in motions:
            if signal.body == SUPPORT:
                problem = "the support is at rest and has no thermal noise"
                remedy = "name a stage, for example test.x"
                raise InputError.of("--output", problem, remedy, format_value(signal.text))
        noises = thermal_noise.solve(model, frequency, motions, run.design.constants.temperature)
        for noise in noises:
            if not noise.contribution.any():
                problem = "nothing that moves with it dissipates, so it has no thermal noise"
                remedy = (
                    "give the materials of its wires a loss (--set materials.NAME.loss_angle=1e-4),"
                    " or blades a loss_angle, [gas] or [stage.damping]"
                )
                raise InputError.of("--output", problem, remedy, format_value(noise.output))
        root = setting["mirrors"] ** 0.5
        noises = [replace(one, contribution=root * one.contribution) for one in noises]
        lossless = find_lossless(run.design, choice.level)
        few = frequency[decade_points(frequency)]

        def compute(design: Design) -> tuple[Array, str]:
            return thermal_noise.amplitudes(design, choice, few, outputs, arm)

        lacking = state_missing_losses(run.design, choice, compute, setting["tolerance"])
        choice = lacking.choice
        for line in (
            *(f"{run.name}: {line}" for line in describe_lossless(lossless, choice.level)),
            *near_limits.describe_falsified_losses(run.design, choice.level),
            *lacking.warnings,
        ):
            run.log.warn(line)
        near_limits.warn_of_tables(run.design, noises[0].frequency, run.log)
        extra: Document = {"without_loss": [part.part for part in lossless]}
        extra["missing_losses"] = lacking.losses
        extra |= describe_mirrors(run.setting)
        return Result(
            self, run.source, choice, noises, extra, command=run.command, linear_system=model
        )

    def document(self, result: Result) -> Document:
        """Return the noise of one output flat, that of several in a list."""
        noises: list[Thermal] = result.data
        each = [
            {
                "output": noise.output,
                "unit": f"{noise.unit}/sqrt(Hz)",
                "tilt_rad": noise.tilt,
                "displacement_asd": noise.amplitude.tolist(),
                "contributions": {source: part.tolist() for source, part in noise.parts.items()},
            }
            for noise in noises
        ]
        head = {"frequency_hz": noises[0].frequency.tolist()}
        return head | only_one(each, "noises") | result.extra

    def text(self, result: Result) -> str:
        """Return the noise at a few frequencies, and its leading causes there."""
        lines = [result.choice.line]
        for noise in result.data:
            lines.append(f"{noise.output}{name_mirrors(result, noise.tilt)}: thermal noise")
            rows = []
            for n in table_points(noise.frequency):
                power = noise.density[:, n]
                order = sorted(range(len(power)), key=lambda s: -power[s])[:NAMED]
                fractions = (
                    f"{noise.source[s]} {_percent(power[s] / power.sum())}"
                    for s in order
                    if power[s] >= LEADING * power.sum()
                )
                rows.append((noise.frequency[n], noise.amplitude[n], ", ".join(fractions)))
            columns = {
                "frequency\nHz": ".4g",
                f"noise\n{noise.unit}/sqrt(Hz)": ".3e",
                "fractions of its power": "",
            }
            lines.append(tables.render(columns, rows))
        return "\n".join(lines)

    def completed(self, result: Result) -> Result:
        """Add the curves that resolve resonances."""
        from dataclasses import replace

        if result.data[0].fine is not None:
            return result
        from suspension_cli.analyses.thermal import picture

        pairs = zip(result.data, picture.refine(result), strict=True)
        data = [
            replace(noise, fine_frequency=curve.frequency, fine=curve.contribution)
            for noise, curve in pairs
        ]
        return replace(result, data=data)

    def figures(self, result: Result, setting: Settings) -> dict[str, Figure]:
        """Draw amplitude spectral densities, with the points that resolve resonances added."""
        from suspension_cli.analyses.thermal import picture

        stages = [stage.name for stage in result.given.design.stage]
        subtitle = result.subtitle + name_mirrors(result)
        return {"": picture.draw(picture.refine(result), subtitle, stages)}


def _percent(fraction: float) -> str:
    return f"{100 * fraction:.{0 if fraction >= 0.1 else 1}f} %"


ANALYSIS = ThermalAnalysis()
