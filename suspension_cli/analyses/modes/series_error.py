"""Error of the modes of the force model where its blades act in series with angled wires."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from suspension_cli.design.schema import Design
from suspension_cli.linear import eigenmodes
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.mode_pairing import body_overlap, pair_by_overlap
from suspension_cli.models.registry import STRING


@dataclass(frozen=True)
class ModeDifference:
    """Frequencies (Hz) of one mode in a quick and in a general model."""

    label: str
    quick: float
    general: float

    @property
    def relative(self) -> float:
        """Relative difference of the frequencies."""
        return self.quick / self.general - 1


def estimate_series_error(design: Design, quick: Modes) -> ModeDifference | None:
    """Find the mode of the force model that differs most from the string model, paired by shape."""
    model = STRING.system(design)
    general = eigenmodes.solve(model)
    count = quick.energy.shape[1] * 6
    mass = model.mass[6 : 6 + count, 6 : 6 + count]
    pair = pair_by_overlap(body_overlap(quick.shape, general.shape, mass))
    pairs = [
        ModeDifference(quick.label[n], float(quick.frequency[n]), float(general.frequency[pair[n]]))
        for n in range(len(pair))
    ]
    finite = [item for item in pairs if np.isfinite(item.relative) and item.general > 0]
    return max(finite, key=lambda item: abs(item.relative), default=None)
