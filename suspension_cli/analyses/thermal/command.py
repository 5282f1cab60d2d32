"""`pendsus thermal`: thermal noise, split by what dissipates."""

from __future__ import annotations

from typing import TYPE_CHECKING

from suspension_cli.analyses import options, tables
from suspension_cli.analyses.analysis import Analysis, Run, Settings, name_mirrors
from suspension_cli.grids import table_points

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from suspension_cli.analyses.thermal.solve import Thermal

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
    Thermal
        With `frequency` (f,) in Hz, `amplitude` (f, outputs) in m/sqrt(Hz) or rad/sqrt(Hz) and
        `contribution` (f, outputs, sources); `motions` has an item per output, with `parts` by
        source.

    Raises
    ------
    InputError
        If an output moves nothing that dissipates.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> found = sus.thermal(sus.example("geo-silica-triple"), frequency=[10.0, 100.0])
    >>> found.amplitude.shape
    (2, 1)
    """

    name = "thermal"
    result_type = "analyses.thermal.solve.Thermal"
    arguments = (options.DESIGN,)
    parameters = (
        options.signals("output", options.MOTIONS, "x of the mirror"),
        options.frequencies("0.1:1000:2000"),
        *options.BEAM,
        options.ALLOW_UNSTABLE,
        options.ACCURACY,
        *options.WRITING,
    )

    def solve(self, run: Run) -> Thermal:
        """Compute the noise of every output."""
        from suspension_cli.analyses.thermal import solve

        return solve.solve(self, run)

    def text(self, result: Thermal) -> str:
        """Return the noise at a few frequencies, and its leading causes there."""
        lines = [result.run.choice.line]
        for noise in result.motions:
            lines.append(f"{noise.output}{name_mirrors(result.mirrors, noise.tilt)}: thermal noise")
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
                "frequency\nHz": tables.AS_GIVEN,
                f"noise\n{noise.unit}/sqrt(Hz)": ".3e",
                "fractions of its power": "",
            }
            lines.append(tables.render(columns, rows))
        return "\n".join(lines)

    def figures(self, result: Thermal, setting: Settings) -> dict[str, Figure]:
        """Draw amplitude spectral densities, at the frequencies that resolve resonances."""
        from suspension_cli.analyses.thermal import picture

        stages = [stage.name for stage in result.run.design.design.stage]
        subtitle = result.subtitle + name_mirrors(result.mirrors)
        return {"": picture.draw(result.curves, subtitle, stages)}


def _percent(fraction: float) -> str:
    return f"{100 * fraction:.{0 if fraction >= 0.1 else 1}f} %"


ANALYSIS = ThermalAnalysis()
