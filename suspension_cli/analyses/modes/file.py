"""HDF5 group `modes` of a results file."""

from __future__ import annotations

import h5py
import numpy as np

from suspension_cli.conventions import DOFS
from suspension_cli.files.hdf5 import Stored, add_dataset, add_scale
from suspension_cli.linear.eigenmodes import Modes


def fill(group: h5py.Group, modes: Modes) -> None:
    """Write the modes of one design into a group."""
    group.attrs["stable"] = modes.stable
    group.attrs["top"] = modes.top or (0,) * len(modes.body)
    mode = add_scale(group, "mode", np.arange(1, len(modes.omega_squared) + 1), "1")
    coordinate = add_scale(group, "coordinate", list(modes.coordinate), "name")
    body = add_scale(group, "body", list(modes.body), "name")
    dof = add_scale(group, "degree_of_freedom", list(DOFS), "name")
    add_dataset(group, "omega_squared", modes.omega_squared, "rad^2/s^2", mode)
    add_dataset(group, "frequency", modes.frequency, "Hz", mode)
    add_dataset(group, "growth_rate", modes.growth_rate, "1/s", mode)
    units = "kg^-1/2 (displacements), kg^-1/2 m^-1 (rotations)"
    add_dataset(group, "shape", modes.shape, units, mode, coordinate)
    add_dataset(group, "energy", modes.energy, "1", mode, body, dof)
    tip = add_scale(group, "tip", list(modes.coordinate[6 * len(modes.body) :]), "name")
    add_dataset(group, "tip_energy", modes.tip_energy, "1", mode, tip)
    for name in ("block", "q", "top_fraction", "dilution", "order"):
        add_dataset(group, name, getattr(modes, name), "1", mode)
    add_dataset(group, "decay_rate", modes.decay_rate, "1/s", mode)
    if modes.wire:
        wire = add_scale(group, "wire", list(modes.wire), "name")
        add_dataset(group, "wire_energy", modes.wire_energy, "1", mode, wire)
    add_dataset(group, "verdict", modes.verdict, "name", mode)
    add_dataset(group, "label", modes.label, "name", mode)


def load(group: Stored) -> Modes:
    """Read the modes of one design from a group."""
    some = "wire" in group
    return Modes(
        body=tuple(group["body"].asstr()[:]),
        coordinate=tuple(group["coordinate"].asstr()[:]),
        omega_squared=group["omega_squared"][:],
        shape=group["shape"][:],
        energy=group["energy"][:],
        tip_energy=group["tip_energy"][:],
        block=group["block"][:],
        q=group["q"][:],
        dilution=group["dilution"][:],
        wire=tuple(group["wire"].asstr()[:]) if some else (),
        wire_energy=group["wire_energy"][:] if some else np.zeros((len(group["q"]), 0)),
        order=group["order"][:],
        decay_rate=group["decay_rate"][:],
        top=tuple(map(int, group.attrs.get("top", ()))),
    )
