"""The group `fit/responses` of a results file."""

from __future__ import annotations

from dataclasses import astuple

import h5py
import numpy as np

from suspension_cli.analyses.fit.channels import TABLES
from suspension_cli.analyses.fit.response_fit import Candidate, ResponseFit, SingleChange
from suspension_cli.analyses.fit.wrong_channels import Correction
from suspension_cli.files.hdf5 import Stored, add_dataset, add_scale

VALUES = ("measured", "uncertainty", "before", "after")
NUISANCE = ("value", "sigma", "prior")
RESONANCE = ("measured", "sigma", "before", "after", "q", "functions")


def fill(group: h5py.Group, found: ResponseFit) -> None:
    """Write a fit of transfer functions."""
    function = add_scale(group, "function", list(found.function), "name")
    for name in ("input", "output"):
        add_dataset(group, name, list(getattr(found, name)), "name", function)
    value = add_scale(group, "number", np.arange(1, len(found.of) + 1), "1")
    add_dataset(group, "of", found.of, "1", value)
    add_dataset(group, "frequency", found.frequency, "Hz", value)
    unit = "SI, reading over drive"
    for name in VALUES:
        add_dataset(group, f"response_{name}", getattr(found, name), unit, value)
    nuisance = add_scale(group, "nuisance", list(found.nuisance), "name")
    for name in NUISANCE:
        values = getattr(found, f"nuisance_{name}")
        add_dataset(group, f"nuisance_{name}", values, "1, s or SI", nuisance)
    mode = add_scale(group, "resonance_mode", list(found.mode), "name")
    column = add_scale(group, "resonance_column", list(RESONANCE), "name")
    add_dataset(group, "resonance", found.resonance, "Hz; 1 for q and functions", mode, column)
    group.attrs["chi_squared_before"] = found.chi_squared_before
    group.attrs["least_known"] = found.least
    corrections = (
        (
            one.kind,
            TABLES[one.side],
            ",".join(one.channel),
            float(one.factor),
            int(one.known),
            one.also,
            float(one.chi_squared),
        )
        for one in found.corrections
    )
    candidates = ((one.input, one.output, *one.band, one.sigma) for one in found.candidates)
    for name, rows in (
        ("sentence", ((text,) for text in found.sentences)),
        ("correction", corrections),
        ("stiffened", found.stiffened),
        ("single_change", map(astuple, found.changes)),
        ("candidate", candidates),
    ):
        group.attrs[name] = "\n".join("\t".join(map(_word, row)) for row in rows)


def _word(part: object) -> str:
    return repr(float(part)) if isinstance(part, float) else str(part)


def read_names(dataset: Stored) -> tuple[str, ...]:
    """Read a list of texts, which may be empty."""
    return tuple(dataset.asstr()[:]) if len(dataset) else ()


def load(group: Stored) -> ResponseFit:
    """Read what `fill` wrote."""

    def rows(name: str) -> list[list[str]]:
        text = str(group.attrs[name])
        return [line.split("\t") for line in text.split("\n")] if text else []

    texts = {
        name: read_names(group[dataset])
        for name, dataset in (
            *((name, name) for name in ("function", "input", "output", "nuisance")),
            ("mode", "resonance_mode"),
        )
    }
    nuisances = [f"nuisance_{name}" for name in NUISANCE]
    arrays = ("of", "frequency", "resonance", *nuisances)
    return ResponseFit(
        **texts,
        **{name: group[name][:] for name in arrays},
        **{name: group[f"response_{name}"][:] for name in VALUES},
        corrections=tuple(
            Correction(
                kind,
                TABLES.index(side),
                tuple(channels.split(",")),
                float(factor),
                known == "1",
                also,
                float(chi_squared),
            )
            for kind, side, channels, factor, known, also, chi_squared in rows("correction")
        ),
        stiffened=tuple((name, float(a), float(b)) for name, a, b in rows("stiffened")),
        chi_squared_before=float(group.attrs["chi_squared_before"]),
        changes=tuple(SingleChange(row[0], *map(float, row[1:])) for row in rows("single_change")),
        sentences=tuple(row[0] for row in rows("sentence")),
        least=str(group.attrs["least_known"]),
        candidates=tuple(
            Candidate(drive, sensor, (float(a), float(b)), float(sigma))
            for drive, sensor, a, b, sigma in rows("candidate")
        ),
    )
