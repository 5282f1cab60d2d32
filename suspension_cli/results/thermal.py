"""The group `thermal` of a results file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np

from suspension_cli.analysis.thermal import Thermal, strongest_first
from suspension_cli.results import Provenance, dataset, scale, write

UNITS = "SI/sqrt(Hz), see unit"


def save(path: Path, noises: list[Thermal], origin: Provenance) -> None:
    """Write the thermal noise of one or more motions, at the same frequencies."""
    write(path, origin, lambda file: fill(file.create_group("thermal"), noises))


def fill(group: h5py.Group, noises: list[Thermal]) -> None:
    """Put noises into a group; a source that has no part in one of them is 0 there."""
    sources = list(dict.fromkeys(name for noise in noises for name in noise.source))
    parts = np.zeros((len(noises[0].frequency), len(noises), len(sources)))
    for n, noise in enumerate(noises):
        parts[:, n, [sources.index(name) for name in noise.source]] = np.sqrt(noise.density).T
    frequency = scale(group, "frequency", noises[0].frequency, "Hz")
    output = scale(group, "output", [noise.output for noise in noises], "name")
    source = scale(group, "source", sources, "name")
    dataset(group, "unit", [f"{noise.unit}/sqrt(Hz)" for noise in noises], "name", output)
    dataset(group, "tilt", [noise.tilt for noise in noises], "rad", output)
    dataset(group, "amplitude", np.stack([noise.amplitude for noise in noises], axis=1), UNITS, frequency, output)
    dataset(group, "contribution", parts, UNITS, frequency, output, source)


def load(group: Any) -> list[Thermal]:
    """The noises that a group holds."""
    frequency, source, parts = group["frequency"][:], group["source"].asstr()[:], group["contribution"][:]
    noises = []
    for n, (output, unit, tilt) in enumerate(zip(group["output"].asstr()[:], group["unit"].asstr()[:], group["tilt"][:], strict=True)):
        densities = {str(name): part**2 for name, part in zip(source, parts[:, n].T, strict=True) if part.any()}
        order = strongest_first(densities)
        noises.append(Thermal(frequency, output, unit.split("/")[0], tuple(order), np.array([densities[name] for name in order]), float(tilt)))
    return noises
