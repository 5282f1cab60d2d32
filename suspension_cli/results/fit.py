"""The group `fit` of a results file, and the fitted design as TOML."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np

from suspension_cli import __version__
from suspension_cli.analysis.fit import Fit
from suspension_cli.errors import printable
from suspension_cli.results import Provenance, dataset, scale, write, write_bytes


def save(path: Path, found: Fit, origin: Provenance, measured: str) -> None:
    """Write a fit: group `fit`; `measured` is the text of the measurements."""

    def fill(file: h5py.File) -> None:
        group = file.create_group("fit")
        group.attrs["measured"] = measured
        group.attrs["fitted_design"] = found.design
        group.attrs["chi_squared"], group.attrs["degrees_of_freedom"] = found.chi_squared, found.freedom
        parameter = scale(group, "parameter", list(found.name), "name")
        other = scale(group, "other_parameter", list(found.name), "name")
        mode = scale(group, "mode", np.arange(1, len(found.label) + 1), "1")
        combination = scale(group, "combination", np.arange(1, len(found.singular) + 1), "1")
        for name in ("start", "value", "sigma"):
            dataset(group, name, getattr(found, name), "SI", parameter)
        dataset(group, "at_bound", found.at_bound, "1", parameter)
        dataset(group, "covariance", found.covariance, "SI, product of both parameters' units", parameter, other)
        dataset(group, "label", list(found.label), "name", mode)
        for name in ("measured", "uncertainty", "before", "after"):
            dataset(group, name, getattr(found, name), "Hz", mode)
        dataset(group, "residual", found.residual, "1", mode)
        dataset(group, "singular_value", found.singular, "1", combination)
        dataset(group, "direction", found.direction, "1", combination, parameter)

    write(path, origin, fill)


def load(group: Any) -> Fit:
    """A fit from its group."""
    text = ("parameter", "label")
    names, labels = (tuple(group[name].asstr()[:]) for name in text)
    arrays = {name: group[name][:] for name in ("start", "value", "sigma", "covariance", "at_bound", "measured", "uncertainty", "before", "after", "direction")}
    return Fit(
        name=names,
        label=labels,
        chi_squared=float(group.attrs["chi_squared"]),
        freedom=int(group.attrs["degrees_of_freedom"]),
        singular=group["singular_value"][:],
        design=str(group.attrs["fitted_design"]),
        **arrays,
    )


def save_design(path: Path, found: Fit, file: str, measured: str, command: str) -> None:
    """Write the fitted design, headed by where it comes from."""
    head = [f"{file}, fitted to {measured} by pendsus {__version__}:", f"  {command}", f"chi^2 = {found.chi_squared:.4g}, {found.freedom} degrees of freedom"]
    for name, start, value, sigma in zip(found.name, found.start, found.value, found.sigma, strict=True):
        head.append(f"  {name} = {float(value)!r} +- {sigma:.2g}, from {start:.6g}")
    text = "".join(f"# {printable(line)}\n" for line in head) + "\n" + found.design
    write_bytes(path, text.encode())
