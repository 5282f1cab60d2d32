"""Quantities of a design by name, with the settings that some of them take from its file.

``coupling`` is that of `[analysis.xcouple]`, or of the options of the command; ``noise`` and
``rms`` are those of the budget with the motion of the support of `[analysis.budget]`.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from suspension_cli.analyses import known_analyses, settings
from suspension_cli.design.derive import mirror
from suspension_cli.grids import parse_frequencies
from suspension_cli.physics import couplings, ground
from suspension_cli.physics.noise_budget import Surroundings
from suspension_cli.quantities.kinds.responses import COUPLING, Ratio, quotient_unit
from suspension_cli.quantities.names import Names

if TYPE_CHECKING:
    from suspension_cli.analyses.options import Settings
    from suspension_cli.design.reader import Source
    from suspension_cli.physics.log import Log
    from suspension_cli.quantities.quantity import Quantity


def names_of(source: Source, coupling: Settings | None = None, log: Log | None = None) -> Names:
    """Make what the names of quantities refer to in a design.

    `coupling` are options of the command that define the cross-coupling; without them it is that of
    the design's `[analysis.xcouple]`. `log` is warned of a ground that the design does not give.
    """

    def find_coupling(names: Names) -> Quantity:
        own = coupling
        if own is None:
            own = settings.merge(known_analyses.get("xcouple"), source, {})
        asked = couplings.parse_request(names.system, own, mirror(source.design))
        unit = quotient_unit(asked.over, asked.under)
        last = asked.frequency[-1]
        return Ratio(COUPLING, unit, asked.over, asked.under, asked.input, last)

    def find_surroundings() -> Surroundings:
        own = settings.merge(known_analyses.get("budget"), source, {})
        if log is not None and "ground" not in source.design.analysis.get("budget", {}):
            [assumed] = own["ground"]
            log.warn(
                f"{source.name}: noise and rms are those on the ground {assumed}, as the design"
                f' gives none; give it, for example [analysis.budget] ground = ["{assumed}"]'
            )
        motion = ground.parse(own["ground"], own["isolation"], Path(source.file).parent)
        frequency = parse_frequencies(own["frequency"])
        low = max([min(frequency), *(one.frequency[0] for one in motion.values())])
        high = min([max(frequency), *(one.frequency[-1] for one in motion.values())])
        return Surroundings(motion, (float(low), float(high)), own["mirrors"])

    return Names(source.design, find_coupling, find_surroundings)
