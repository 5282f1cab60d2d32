"""The group `fit` of a results file, and the fitted designs as TOML."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import astuple
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from suspension_cli.analyses.fit.channels import TABLES
from suspension_cli.analyses.fit.result import Candidate, Exchange, Fit, ResponseFit, SingleChange
from suspension_cli.analyses.fit.text import format_uncertainty
from suspension_cli.analyses.fit.wrong_channels import Correction
from suspension_cli.errors import escape_unprintable
from suspension_cli.files.atomic import write_bytes
from suspension_cli.files.hdf5 import Stored, add_dataset, add_scale
from suspension_cli.version import __version__

HZ, SI, READING = "Hz", "SI", "SI, reading over drive"
DATASETS = {
    "design_before": ("design", "TOML", "experiment"),
    "design": ("fitted_design", "TOML", "experiment"),
    "start": ("start", SI, "parameter"),
    "value": ("value", SI, "parameter"),
    "prior": ("prior", SI, "parameter"),
    "prior_sigma": ("prior_sigma", SI, "parameter"),
    "shared": ("shared", "1", "parameter experiment"),
    "at_bound": ("at_bound", "1", "parameter"),
    "of": ("measured_in", "1", "mode"),
    "label": ("label", "name", "mode"),
    "measured": ("measured", HZ, "mode"),
    "uncertainty": ("uncertainty", HZ, "mode"),
    "before": ("before", HZ, "mode"),
    "after": ("after", HZ, "mode"),
    "ends": ("ends", "1", "search"),
    "singular": ("singular_value", "1", "combination"),
    "direction": ("direction", "1", "combination parameter"),
}
"""Datasets of a fit by attribute: name, units, axes."""
RESPONSES = {
    "input": ("input", "name", "function"),
    "output": ("output", "name", "function"),
    "of": ("of", "1", "number"),
    "frequency": ("frequency", HZ, "number"),
    "measured": ("response_measured", READING, "number"),
    "uncertainty": ("response_uncertainty", READING, "number"),
    "before": ("response_before", READING, "number"),
    "after": ("response_after", READING, "number"),
    "nuisance_value": ("nuisance_value", "1, s or SI", "nuisance"),
    "nuisance_sigma": ("nuisance_sigma", "1, s or SI", "nuisance"),
    "nuisance_prior": ("nuisance_prior", "1, s or SI", "nuisance"),
    "resonance": ("resonance", "Hz; 1 for q and functions", "resonance_mode resonance_column"),
}
"""Datasets of its transfer functions."""
RESONANCE = ("measured", "sigma", "before", "after", "q", "functions")


def _rows_of_correction(one: Correction) -> tuple[object, ...]:
    known, factor = int(one.known), float(one.factor)
    channel = ",".join(one.channel)
    return one.kind, TABLES[one.side], channel, factor, known, one.also, float(one.chi_squared)


def _correction(
    kind: str, side: str, channels: str, factor: str, known: str, also: str, chi_squared: str
) -> Correction:
    names = tuple(channels.split(","))
    number = TABLES.index(side)
    return Correction(kind, number, names, float(factor), known == "1", also, float(chi_squared))


TEXTS: dict[str, tuple[str, Callable[[Any], Iterable[object]], Callable[..., object]]] = {
    "sentence": ("sentences", lambda text: (text,), str),
    "correction": ("corrections", _rows_of_correction, _correction),
    "stiffened": ("stiffened", tuple, lambda name, a, b: (name, float(a), float(b))),
    "single_change": (
        "changes",
        astuple,
        lambda name, *values: SingleChange(name, *map(float, values)),
    ),
    "candidate": (
        "candidates",
        lambda one: (one.input, one.output, *one.band, one.sigma),
        lambda i, o, a, b, sigma: Candidate(i, o, (float(a), float(b)), float(sigma)),
    ),
}
"""Findings kept as text: name, attribute, and how one item becomes fields and is made from them."""


def fill(group: h5py.Group, found: Fit) -> None:
    """Write a fit into the group `fit`."""
    group.attrs["measured"], group.attrs["title"] = found.measurements, found.title
    group.attrs["chi_squared"] = found.chi_squared
    group.attrs["degrees_of_freedom"] = found.freedom
    scales = {
        "experiment": (list(found.experiment), "name"),
        "parameter": (list(found.name), "name"),
        "other_parameter": (list(found.name), "name"),
        "mode": (np.arange(1, len(found.label) + 1), "1"),
        "combination": (np.arange(1, len(found.singular) + 1), "1"),
        "search": (np.arange(1, len(found.ends) + 1), "1"),
    }
    axes = {name: add_scale(group, name, *scale) for name, scale in scales.items()}
    group.attrs["misfit"], group.attrs["sigma_scale"] = found.misfit, found.scale
    if found.exchange is not None:
        for name, value in vars(found.exchange).items():
            group.attrs[f"exchange_{name}"] = list(value) if name == "labels" else value
    _fill(group, found, DATASETS, axes)
    add_dataset(group, "sigma", found.scale * found.sigma, SI, axes["parameter"])
    both = axes["parameter"], axes["other_parameter"]
    unit = "SI, product of both parameters' units"
    add_dataset(group, "covariance", found.scale**2 * found.covariance, unit, *both)
    add_dataset(group, "residual", found.residual, "1", axes["mode"])
    if found.responses is not None:
        _fill_responses(group.create_group("responses"), found.responses)


def _fill(
    group: h5py.Group, found: object, datasets: dict[str, tuple[str, str, str]], axes: dict
) -> None:
    for attribute, (name, unit, of) in datasets.items():
        value = getattr(found, attribute)
        value = list(value) if isinstance(value, tuple) else value
        add_dataset(group, name, value, unit, *(axes[axis] for axis in of.split()))


def _fill_responses(group: h5py.Group, found: ResponseFit) -> None:
    scales = {
        "function": (list(found.function), "name"),
        "number": (np.arange(1, len(found.of) + 1), "1"),
        "nuisance": (list(found.nuisance), "name"),
        "resonance_mode": (list(found.mode), "name"),
        "resonance_column": (list(RESONANCE), "name"),
    }
    axes = {name: add_scale(group, name, *scale) for name, scale in scales.items()}
    _fill(group, found, RESPONSES, axes)
    group.attrs["chi_squared_before"] = found.chi_squared_before
    group.attrs["least_known"] = found.least
    for name, (attribute, fields, _) in TEXTS.items():
        rows = (map(_word, fields(item)) for item in getattr(found, attribute))
        group.attrs[name] = "\n".join("\t".join(row) for row in rows)


def _word(part: object) -> str:
    return repr(float(part)) if isinstance(part, float) else str(part)


def _read(group: Stored, datasets: dict[str, tuple[str, str, str]]) -> dict[str, Any]:
    """Read datasets by attribute; lists of texts may be empty."""
    texts = ("name", "TOML")
    return {
        attribute: _read_names(group[name]) if unit in texts else group[name][:]
        for attribute, (name, unit, _) in datasets.items()
    }


def _read_names(dataset: Stored) -> tuple[str, ...]:
    return tuple(dataset.asstr()[:]) if len(dataset) else ()


def load(group: Stored) -> Fit:
    """Read a fit from the group `fit`."""
    attrs, exchange = group.attrs, None
    scale = float(attrs["sigma_scale"])
    if "exchange_labels" in attrs:
        first, second = map(str, attrs["exchange_labels"])
        chi_squared = float(attrs["exchange_chi_squared"])
        exchange = Exchange(int(attrs["exchange_experiment"]), (first, second), chi_squared)
    return Fit(
        **_read(group, DATASETS),
        experiment=_read_names(group["experiment"]),
        name=_read_names(group["parameter"]),
        responses=_load_responses(group["responses"]) if "responses" in group else None,
        exchange=exchange,
        sigma=group["sigma"][:] / scale,
        covariance=group["covariance"][:] / scale**2,
        chi_squared=float(attrs["chi_squared"]),
        freedom=int(attrs["degrees_of_freedom"]),
        measurements=str(attrs["measured"]),
        title=str(attrs["title"]),
    )


def _load_responses(group: Stored) -> ResponseFit:
    found: dict[str, Any] = {}
    for name, (attribute, _, make) in TEXTS.items():
        lines = str(group.attrs[name]).split("\n")
        found[attribute] = tuple(make(*line.split("\t")) for line in lines if line)
    return ResponseFit(
        **_read(group, RESPONSES),
        **found,
        function=_read_names(group["function"]),
        nuisance=_read_names(group["nuisance"]),
        mode=_read_names(group["resonance_mode"]),
        chi_squared_before=float(group.attrs["chi_squared_before"]),
        least=str(group.attrs["least_known"]),
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
