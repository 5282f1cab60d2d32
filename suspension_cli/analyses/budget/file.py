"""HDF5 group `budget` of a results file."""

from __future__ import annotations

import h5py
import numpy as np

from suspension_cli.analyses.budget.solve import Budget, Requirement
from suspension_cli.files.hdf5 import Stored, add_dataset, add_scale

ASD = "SI/sqrt(Hz), see unit"


def fill(group: h5py.Group, budgets: list[Budget]) -> None:
    """Write budgets into a group."""
    first = budgets[0]
    frequency = add_scale(group, "frequency", first.frequency, "Hz")
    output = add_scale(group, "output", [one.output for one in budgets], "name")
    cause = add_scale(group, "cause", list(first.cause), "name")
    add_dataset(group, "source", list(first.source), "name", cause)
    add_dataset(group, "unit", [f"{one.unit}/sqrt(Hz)" for one in budgets], "name", output)
    for name, units in (
        ("amplitude", ASD),
        ("rms", "SI, see unit"),
        ("rms_velocity", "SI/s, see unit"),
    ):
        values = np.array([getattr(one, name) for one in budgets])
        add_dataset(group, name, values.T, units, frequency, output)
    for name, values, units in (
        ("contribution", [np.sqrt(one.density) for one in budgets], ASD),
        ("mean_square", [one.square for one in budgets], "SI^2, see unit"),
        ("mean_square_velocity", [one.square_velocity for one in budgets], "SI^2/s^2, see unit"),
    ):
        add_dataset(group, name, np.transpose(values, (2, 0, 1)), units, frequency, output, cause)
    for n, one in enumerate(budgets):
        if one.requirement is not None:
            _fill_requirement(group.create_group(f"requirement {n}"), one.requirement)


def _fill_requirement(group: h5py.Group, required: Requirement) -> None:
    group.attrs["name"] = required.name
    group.attrs["margin"] = required.margin
    group.attrs["at"] = required.at
    frequency = add_scale(group, "frequency", required.frequency, "Hz")
    add_dataset(group, "required", required.density, ASD, frequency)
    number = add_scale(group, "interval", np.arange(len(required.exceeded)), "1")
    end = add_scale(group, "end", ["from", "to"], "name")
    add_dataset(group, "exceeded", np.reshape(required.exceeded, (-1, 2)), "Hz", number, end)


def load(group: Stored) -> list[Budget]:
    """Read budgets from a group."""
    cause = tuple(str(name) for name in group["cause"].asstr()[:])
    outputs = zip(group["output"].asstr()[:], group["unit"].asstr()[:], strict=True)
    return [
        Budget(
            group["frequency"][:],
            str(output),
            str(unit).split("/")[0],
            cause,
            tuple(str(name) for name in group["source"].asstr()[:]),
            group["contribution"][:, n].T ** 2,
            group["mean_square"][:, n].T,
            group["mean_square_velocity"][:, n].T,
            _load_requirement(group[f"requirement {n}"]) if f"requirement {n}" in group else None,
        )
        for n, (output, unit) in enumerate(outputs)
    ]


def _load_requirement(group: Stored) -> Requirement:
    return Requirement(
        str(group.attrs["name"]),
        group["frequency"][:],
        group["required"][:],
        float(group.attrs["margin"]),
        float(group.attrs["at"]),
        tuple((float(low), float(high)) for low, high in group["exceeded"][:]),
    )
