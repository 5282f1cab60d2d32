"""HDF5 group `thermal` of a results file."""

from __future__ import annotations

import h5py
import numpy as np

from suspension_cli.analyses.thermal.solve import Thermal, sort_sources
from suspension_cli.files.hdf5 import Stored, add_dataset, add_scale

UNITS = "SI/sqrt(Hz), see unit"


def fill(group: h5py.Group, noises: list[Thermal]) -> None:
    """Write the noise of several motions into a group; sources without part in a motion are 0."""
    sources = list(dict.fromkeys(name for noise in noises for name in noise.source))
    parts = np.zeros((len(noises[0].frequency), len(noises), len(sources)))
    for n, noise in enumerate(noises):
        parts[:, n, [sources.index(name) for name in noise.source]] = np.sqrt(noise.density).T
    frequency = add_scale(group, "frequency", noises[0].frequency, "Hz")
    output = add_scale(group, "output", [noise.output for noise in noises], "name")
    source = add_scale(group, "source", sources, "name")
    add_dataset(group, "unit", [f"{noise.unit}/sqrt(Hz)" for noise in noises], "name", output)
    add_dataset(group, "tilt", [noise.tilt for noise in noises], "rad", output)
    amplitude = np.stack([noise.amplitude for noise in noises], axis=1)
    add_dataset(group, "amplitude", amplitude, UNITS, frequency, output)
    add_dataset(group, "contribution", parts, UNITS, frequency, output, source)


def load(group: Stored) -> list[Thermal]:
    """Read the noise of each motion from a group."""
    frequency, source = group["frequency"][:], group["source"].asstr()[:]
    parts = np.moveaxis(group["contribution"][:], 0, -1)
    outputs = (group["output"].asstr()[:], group["unit"].asstr()[:], group["tilt"][:], parts)
    noises = []
    for output, unit, tilt, own in zip(*outputs, strict=True):
        pairs = zip(source, own, strict=True)
        densities = {str(name): part**2 for name, part in pairs if part.any()}
        order = sort_sources(densities)
        density = np.array([densities[name] for name in order])
        unit = unit.split("/")[0]
        noises.append(Thermal(frequency, output, unit, tuple(order), density, float(tilt)))
    return noises
