"""The group `fit` of a results file, and the fitted designs as TOML."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from suspension_cli import __version__
from suspension_cli.analysis.exchange import Exchange
from suspension_cli.analysis.fit import Fit
from suspension_cli.errors import printable
from suspension_cli.results import Provenance, dataset, scale, write, write_bytes


def save(path: Path, found: Fit, origin: Provenance, designs: list[str], measured: str, title: str) -> None:
    """Write a fit: group `fit`; the designs as they were before, the text of the measurements, and the figure's title."""

    def fill(file: h5py.File) -> None:
        group = file.create_group("fit")
        group.attrs["measured"], group.attrs["title"] = measured, title
        group.attrs["chi_squared"], group.attrs["degrees_of_freedom"] = found.chi_squared, found.freedom
        experiment = scale(group, "experiment", list(found.experiment), "name")
        dataset(group, "design", designs, "TOML", experiment)
        dataset(group, "fitted_design", list(found.design), "TOML", experiment)
        parameter = scale(group, "parameter", list(found.name), "name")
        other = scale(group, "other_parameter", list(found.name), "name")
        mode = scale(group, "mode", np.arange(1, len(found.label) + 1), "1")
        combination = scale(group, "combination", np.arange(1, len(found.singular) + 1), "1")
        group.attrs["misfit"], group.attrs["sigma_scale"] = found.misfit, found.scale
        if found.exchange is not None:
            group.attrs["exchange_experiment"], group.attrs["exchange_labels"] = found.exchange.experiment, list(found.exchange.labels)
            group.attrs["exchange_chi_squared"] = found.exchange.chi_squared
        for name in ("start", "value"):
            dataset(group, name, getattr(found, name), "SI", parameter)
        dataset(group, "sigma", found.scale * found.sigma, "SI", parameter)
        dataset(group, "shared", found.shared, "1", parameter, experiment)
        dataset(group, "at_bound", found.at_bound, "1", parameter)
        dataset(group, "covariance", found.scale**2 * found.covariance, "SI, product of both parameters' units", parameter, other)
        dataset(group, "measured_in", found.of, "1", mode)
        dataset(group, "label", list(found.label), "name", mode)
        for name in ("measured", "uncertainty", "before", "after"):
            dataset(group, name, getattr(found, name), "Hz", mode)
        dataset(group, "residual", found.residual, "1", mode)
        dataset(group, "ends", found.ends, "1", scale(group, "search", np.arange(1, len(found.ends) + 1), "1"))
        dataset(group, "singular_value", found.singular, "1", combination)
        dataset(group, "direction", found.direction, "1", combination, parameter)

    write(path, origin, fill)


def load(group: Any) -> Fit:
    """A fit from its group."""
    experiments, names, labels, designs = (tuple(group[name].asstr()[:]) for name in ("experiment", "parameter", "label", "fitted_design"))
    arrays = ("shared", "start", "value", "at_bound", "measured", "uncertainty", "before", "after", "direction", "ends")
    attrs, scaled = group.attrs, float(group.attrs.get("sigma_scale", 1.0))
    exchanged = None
    if "exchange_labels" in attrs:
        first, second = (str(name) for name in attrs["exchange_labels"])
        exchanged = Exchange(int(attrs["exchange_experiment"]), (first, second), float(attrs["exchange_chi_squared"]))
    return Fit(
        exchange=exchanged,
        sigma=group["sigma"][:] / scaled,
        covariance=group["covariance"][:] / scaled**2,
        experiment=experiments,
        name=names,
        of=group["measured_in"][:],
        label=labels,
        chi_squared=float(group.attrs["chi_squared"]),
        freedom=int(group.attrs["degrees_of_freedom"]),
        singular=group["singular_value"][:],
        design=designs,
        **{name: group[name][:] for name in arrays},
    )


def spread(found: Fit, n: int) -> str:
    """The standard deviation of a number in words to put behind it, a misfit in it; or why there is none."""
    if found.at_bound[n]:
        return " at its bound"
    sigma = found.scale * found.sigma[n]
    return f" +- {sigma:.2g}" if math.isfinite(sigma) else ", not known from these modes"


def save_design(path: Path, found: Fit, number: int, file: str, measured: str, command: str) -> None:
    """Write a fitted design, headed by where it comes from; `number` is that of its experiment."""
    together = f" together with {', '.join(name for n, name in enumerate(found.experiment) if n != number)}" if len(found.experiment) > 1 else ""
    head = [f"{file}, fitted to {measured}{together} by pendsus {__version__}:"]
    head += ["MISFIT: these numbers do not explain the measurements"] * found.misfit
    head += [f"  {command}", f"chi^2 = {found.chi_squared:.4g}, {found.freedom} degrees of freedom"]
    for n, name in enumerate(found.name):
        if found.shared[n, number]:
            head.append(f"  {name} = {float(found.value[n])!r}{spread(found, n)}, from {found.start[n]:.6g}")
    text = "".join(f"# {printable(line)}\n" for line in head) + "\n" + found.design[number]
    write_bytes(path, text.encode())
