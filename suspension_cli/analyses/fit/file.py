"""The group `fit` of a results file, and the fitted designs as TOML."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import h5py
import msgspec
import numpy as np

from suspension_cli.analyses.fit.result import Exchange, Findings, Fit, ResponseFit
from suspension_cli.analyses.fit.text import format_uncertainty
from suspension_cli.errors import escape_unprintable
from suspension_cli.files.atomic import write_bytes
from suspension_cli.files.hdf5 import Stored, add_dataset, add_scale
from suspension_cli.version import __version__

RESONANCE = ("measured", "sigma", "before", "after", "q", "functions")


def fill(group: h5py.Group, found: Fit) -> None:
    """Write a fit into the group `fit`."""
    for name in ("chi_squared", "title", "misfit"):
        group.attrs[name] = getattr(found, name)
    group.attrs["measured"], group.attrs["degrees_of_freedom"] = found.measurements, found.freedom
    group.attrs["sigma_scale"] = found.scale
    if found.exchange is not None:
        for name, value in vars(found.exchange).items():
            group.attrs[f"exchange_{name}"] = list(value) if name == "labels" else value
    axes = _add_scales(
        group,
        experiment=found.experiment,
        parameter=found.name,
        other_parameter=found.name,
        mode=len(found.label),
        combination=len(found.singular),
        search=len(found.ends),
    )
    _add_datasets(group, found, axes)
    add_dataset(group, "sigma", found.scale * found.sigma, "SI", axes["parameter"])
    both = axes["parameter"], axes["other_parameter"]
    unit = "SI, product of both parameters' units"
    add_dataset(group, "covariance", found.scale**2 * found.covariance, unit, *both)
    add_dataset(group, "residual", found.residual, "1", axes["mode"])
    if found.responses is not None:
        part, responses = group.create_group("responses"), found.responses
        axes = _add_scales(
            part,
            function=responses.function,
            number=len(responses.of),
            nuisance=responses.nuisance,
            resonance_mode=responses.mode,
            resonance_column=RESONANCE,
        )
        _add_datasets(part, responses, axes)
        part.attrs["chi_squared_before"] = responses.chi_squared_before
        names = [item.name for item in dataclasses.fields(Findings)]
        said = Findings(**{name: getattr(responses, name) for name in names})
        part.attrs["findings"] = msgspec.json.encode(said, enc_hook=float).decode()


def _add_scales(group: h5py.Group, **scales: tuple[str, ...] | int) -> dict[str, h5py.Dataset]:
    """Add axes by names, or numbered from 1."""
    return {
        name: add_scale(group, name, np.arange(1, of + 1), "1")
        if isinstance(of, int)
        else add_scale(group, name, list(of), "name")
        for name, of in scales.items()
    }


def _add_datasets(group: h5py.Group, found: Any, axes: dict[str, h5py.Dataset]) -> None:
    """Add the datasets that the fields of a result declare."""
    for item in dataclasses.fields(found):
        if item.metadata:
            value = getattr(found, item.name)
            value = list(value) if isinstance(value, tuple) else value
            of = [axes[axis] for axis in item.metadata["axes"]]
            name, unit = item.metadata["name"].format(item.name), item.metadata["unit"]
            add_dataset(group, name, value, unit, *of)


def _read(group: Stored, kind: type) -> dict[str, Any]:
    """Read the datasets that the fields of a result declare."""
    found = {}
    for item in dataclasses.fields(kind):
        if item.metadata:
            dataset = group[item.metadata["name"].format(item.name)]
            named = item.metadata["unit"] in ("name", "TOML")
            found[item.name] = _names(dataset) if named else dataset[:]
    return found


def _names(dataset: Stored) -> tuple[str, ...]:
    """Read a list of texts, which may be empty."""
    return tuple(dataset.asstr()[:]) if len(dataset) else ()


def load(group: Stored) -> Fit:
    """Read a fit from the group `fit`."""
    attrs, exchange, responses = group.attrs, None, None
    scale = float(attrs["sigma_scale"])
    if "exchange_labels" in attrs:
        first, second = map(str, attrs["exchange_labels"])
        chi_squared = float(attrs["exchange_chi_squared"])
        exchange = Exchange(int(attrs["exchange_experiment"]), (first, second), chi_squared)
    if "responses" in group:
        part = group["responses"]
        said = msgspec.json.decode(str(part.attrs["findings"]), type=Findings)
        responses = ResponseFit(
            **_read(part, ResponseFit),
            **vars(said),
            function=_names(part["function"]),
            nuisance=_names(part["nuisance"]),
            mode=_names(part["resonance_mode"]),
            chi_squared_before=float(part.attrs["chi_squared_before"]),
        )
    return Fit(
        **_read(group, Fit),
        experiment=_names(group["experiment"]),
        name=_names(group["parameter"]),
        responses=responses,
        exchange=exchange,
        sigma=group["sigma"][:] / scale,
        covariance=group["covariance"][:] / scale**2,
        chi_squared=float(attrs["chi_squared"]),
        freedom=int(attrs["degrees_of_freedom"]),
        measurements=str(attrs["measured"]),
        title=str(attrs["title"]),
    )


def save_design(
    path: Path, found: Fit, number: int, file: str, measured: str, command: str
) -> None:
    """Write the fitted design of an experiment (from 0), headed by comments on its origin."""
    others = ", ".join(name for n, name in enumerate(found.experiment) if n != number)
    together = f" together with {others}" if others else ""
    head = [f"{file}, fitted to {measured}{together} by pendsus {__version__}:"]
    head += ["MISFIT: these parameters do not explain the measurements"] * found.unlikely
    head += ["MISFIT: these parameters contradict their priors"] * found.unlikely_priors
    if found.responses is not None:
        head += [one.text for one in found.responses.corrections]
    head += [f"  {command}", f"chi^2 = {found.chi_squared:.4g}, {found.freedom} degrees of freedom"]
    for n, name in enumerate(found.name):
        if found.shared[n, number]:
            sigma = format_uncertainty(found, n)
            value = f"{float(found.value[n])!r}{', ' if sigma.startswith('not') else ' '}{sigma}"
            head.append(f"  {name} = {value}, from {found.start[n]:.6g}")
    text = "".join(f"# {escape_unprintable(line)}\n" for line in head) + "\n" + found.design[number]
    write_bytes(path, text.encode())
