"""The group `fit` of a results file, and the fitted designs as TOML."""

from __future__ import annotations

import math
from pathlib import Path

import h5py
import numpy as np

from suspension_cli.analyses.fit import response_file
from suspension_cli.analyses.fit.solve import Fit
from suspension_cli.analyses.fit.swapped_labels import Exchange
from suspension_cli.errors import escape_unprintable
from suspension_cli.files.atomic import write_bytes
from suspension_cli.files.hdf5 import Stored, add_dataset, add_scale
from suspension_cli.version import __version__

MODES = ("measured", "uncertainty", "before", "after")
"""Fields of `Fit` with a frequency per measured mode."""


def fill(group: h5py.Group, found: Fit) -> None:
    """Write a fit into the group `fit`."""
    group.attrs["measured"], group.attrs["title"] = found.measurements, found.title
    group.attrs["chi_squared"] = found.chi_squared
    group.attrs["degrees_of_freedom"] = found.freedom
    experiment = add_scale(group, "experiment", list(found.experiment), "name")
    add_dataset(group, "design", list(found.design_before), "TOML", experiment)
    add_dataset(group, "fitted_design", list(found.design), "TOML", experiment)
    parameter = add_scale(group, "parameter", list(found.name), "name")
    other = add_scale(group, "other_parameter", list(found.name), "name")
    mode = add_scale(group, "mode", np.arange(1, len(found.label) + 1), "1")
    combination = add_scale(group, "combination", np.arange(1, len(found.singular) + 1), "1")
    group.attrs["misfit"], group.attrs["sigma_scale"] = found.misfit, found.scale
    if found.exchange is not None:
        group.attrs["exchange_experiment"] = found.exchange.experiment
        group.attrs["exchange_labels"] = list(found.exchange.labels)
        group.attrs["exchange_chi_squared"] = found.exchange.chi_squared
    for name in ("start", "value"):
        add_dataset(group, name, getattr(found, name), "SI", parameter)
    add_dataset(group, "sigma", found.scale * found.sigma, "SI", parameter)
    add_dataset(group, "shared", found.shared, "1", parameter, experiment)
    add_dataset(group, "at_bound", found.at_bound, "1", parameter)
    add_dataset(
        group,
        "covariance",
        found.scale**2 * found.covariance,
        "SI, product of both parameters' units",
        parameter,
        other,
    )
    add_dataset(group, "measured_in", found.of, "1", mode)
    add_dataset(group, "label", list(found.label), "name", mode)
    for name in MODES:
        add_dataset(group, name, getattr(found, name), "Hz", mode)
    add_dataset(group, "residual", found.residual, "1", mode)
    searches = add_scale(group, "search", np.arange(1, len(found.ends) + 1), "1")
    add_dataset(group, "ends", found.ends, "1", searches)
    add_dataset(group, "singular_value", found.singular, "1", combination)
    add_dataset(group, "direction", found.direction, "1", combination, parameter)
    if found.responses is not None:
        response_file.fill(group.create_group("responses"), found.responses)


def load(group: Stored) -> Fit:
    """Read a fit from the group `fit`."""
    experiments, names, labels, before, designs = (
        response_file.read_names(group[name])
        for name in ("experiment", "parameter", "label", "design", "fitted_design")
    )
    attrs = group.attrs
    scale = float(attrs["sigma_scale"])
    exchange = None
    if "exchange_labels" in attrs:
        first, second = map(str, attrs["exchange_labels"])
        chi_squared = float(attrs["exchange_chi_squared"])
        exchange = Exchange(int(attrs["exchange_experiment"]), (first, second), chi_squared)
    arrays = ("shared", "start", "value", "at_bound", *MODES, "direction", "ends")
    return Fit(
        responses=response_file.load(group["responses"]) if "responses" in group else None,
        exchange=exchange,
        sigma=group["sigma"][:] / scale,
        covariance=group["covariance"][:] / scale**2,
        experiment=experiments,
        name=names,
        of=group["measured_in"][:],
        label=labels,
        chi_squared=float(attrs["chi_squared"]),
        freedom=int(attrs["degrees_of_freedom"]),
        singular=group["singular_value"][:],
        design=designs,
        design_before=before,
        measurements=str(attrs["measured"]),
        title=str(attrs["title"]),
        **{name: group[name][:] for name in arrays},
    )


def format_uncertainty(found: Fit, n: int) -> str:
    """Format the standard deviation of number n, or say why there is none."""
    if found.at_bound[n]:
        return " at its bound"
    sigma = found.scale * found.sigma[n]
    return f" +- {sigma:.2g}" if math.isfinite(sigma) else ", not determined by these data"


def save_design(
    path: Path, found: Fit, number: int, file: str, measured: str, command: str
) -> None:
    """Write the fitted design of an experiment (from 0), headed by comments on its origin."""
    others = ", ".join(name for n, name in enumerate(found.experiment) if n != number)
    together = f" together with {others}" if others else ""
    head = [f"{file}, fitted to {measured}{together} by pendsus {__version__}:"]
    head += ["MISFIT: these numbers do not explain the measurements"] * found.misfit
    if found.responses is not None:
        head += [one.text for one in found.responses.corrections]
    head += [f"  {command}", f"chi^2 = {found.chi_squared:.4g}, {found.freedom} degrees of freedom"]
    for n, name in enumerate(found.name):
        if found.shared[n, number]:
            head.append(
                f"  {name} = {float(found.value[n])!r}{format_uncertainty(found, n)}, from"
                f" {found.start[n]:.6g}"
            )
    text = "".join(f"# {escape_unprintable(line)}\n" for line in head) + "\n" + found.design[number]
    write_bytes(path, text.encode())
