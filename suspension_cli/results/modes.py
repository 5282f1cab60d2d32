"""The group `modes` of a results file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np

from suspension_cli.analysis.modes import Modes, decay
from suspension_cli.conventions import DOFS
from suspension_cli.results import Provenance, dataset, scale, write


def save(path: Path, modes: Modes, origin: Provenance) -> None:
    """Write the modes of one design: group `modes`."""

    def fill(file: h5py.File) -> None:
        group = file.create_group("modes")
        group.attrs["stable"] = modes.stable
        mode = scale(group, "mode", np.arange(1, len(modes.omega_squared) + 1), "1")
        coordinate = scale(group, "coordinate", list(modes.coordinate), "name")
        body = scale(group, "body", list(modes.body), "name")
        dof = scale(group, "degree_of_freedom", list(DOFS), "name")
        dataset(group, "omega_squared", modes.omega_squared, "rad^2/s^2", mode)
        dataset(group, "frequency", modes.frequency, "Hz", mode)
        dataset(group, "growth_rate", modes.growth_rate, "1/s", mode)
        dataset(group, "shape", modes.shape, "kg^-1/2 (displacements), kg^-1/2 m^-1 (rotations)", mode, coordinate)
        dataset(group, "energy", modes.energy, "1", mode, body, dof)
        dataset(group, "tip_energy", modes.tip_energy, "1", mode, scale(group, "tip", list(modes.coordinate[6 * len(modes.body) :]), "name"))
        dataset(group, "block", modes.block, "1", mode)
        dataset(group, "q", modes.q, "1", mode)
        dataset(group, "decay_rate", modes.decay_rate, "1/s", mode)
        dataset(group, "top_share", modes.top_share, "1", mode)
        dataset(group, "verdict", modes.verdict, "name", mode)
        dataset(group, "dilution", modes.dilution, "1", mode)
        dataset(group, "order", modes.order, "1", mode)
        if modes.wire:
            dataset(group, "wire_energy", modes.wire_energy, "1", mode, scale(group, "wire", list(modes.wire), "name"))
        dataset(group, "label", modes.label, "name", mode)

    write(path, origin, fill)


def load(file: h5py.File) -> Modes:
    """The modes that a results file holds."""
    group: Any = file["modes"]
    count = len(group["q"])
    squared, q = group["omega_squared"][:], group["q"][:]
    return Modes(
        body=tuple(group["body"].asstr()[:]),
        coordinate=tuple(group["coordinate"].asstr()[:]),
        omega_squared=squared,
        shape=group["shape"][:],
        energy=group["energy"][:],
        tip_energy=group["tip_energy"][:],
        block=group["block"][:],
        q=q,
        dilution=group["dilution"][:] if "dilution" in group else np.full(count, np.nan),
        wire=tuple(group["wire"].asstr()[:]) if "wire" in group else (),
        wire_energy=group["wire_energy"][:] if "wire_energy" in group else np.zeros((count, 0)),
        order=group["order"][:] if "order" in group else np.zeros(count, dtype=np.intp),
        decay_rate=group["decay_rate"][:] if "decay_rate" in group else decay(squared, q),
    )
