"""How far two rungs of the ladder are apart for one design."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from suspension_cli.analysis import modes
from suspension_cli.analysis.modes import Modes
from suspension_cli.design.schema import Design
from suspension_cli.models import fidelity, force


@dataclass(frozen=True)
class Apart:
    """The mode that two rungs differ most in: its label, and its frequency (Hz) on either."""

    label: str
    quick: float
    general: float

    @property
    def share(self) -> float:
        """Relative difference."""
        return self.quick / self.general - 1


def series_error(design: Design, quick: Modes) -> Apart | None:
    """What taking blades in series with angled wires costs, for a design on the force rung.

    Parameters
    ----------
    design : Design
    quick : Modes
        On the force rung.

    Returns
    -------
    Apart or None
        The worst mode against the string rung, modes paired by their shapes; None where the series is exact.
    """
    if not force.series_is_approximate(design):
        return None
    model = fidelity.linear_model(design, "string")
    general = modes.solve(model)
    count = quick.energy.shape[1] * 6
    mass = model.mass[6 : 6 + count, 6 : 6 + count]
    overlap = np.abs(quick.shape[:, :count] @ mass @ general.shape[:, :count].T)
    pair = overlap.argmax(1)
    pairs = [Apart(quick.label[n], float(quick.frequency[n]), float(general.frequency[pair[n]])) for n in range(len(pair))]
    finite = [item for item in pairs if np.isfinite(item.share) and item.general > 0]
    return max(finite, key=lambda item: abs(item.share), default=None)
