"""HDF5 group `compare` of a results file."""

from __future__ import annotations

import h5py

from suspension_cli.analyses.compare.design_changes import Change
from suspension_cli.analyses.compare.solve import Comparison, Curve, Overlay, PairedModes
from suspension_cli.files.hdf5 import Stored, add_dataset, add_scale

SHORT = ("frequency", "value", "uncertainty", "ratio_frequency", "ratio")
"""Arrays of a curve."""


def fill(group: h5py.Group, found: Comparison) -> None:
    """Write a comparison into a group, with a group per curve."""
    item = add_scale(group, "item", list(found.name), "name")
    for name in ("kind", "model"):
        add_dataset(group, name, list(getattr(found, name)), "name", item)
    rows = [(n, change) for n, changes in enumerate(found.change) for change in changes]
    if rows:
        changes = group.create_group("design_changes")
        number = add_scale(changes, "change", range(len(rows)), "1")
        add_dataset(changes, "item", [n for n, _ in rows], "1", number)
        for name in ("path", "before", "after"):
            texts = [getattr(change, name) for _, change in rows]
            add_dataset(changes, name, texts, "name", number)
    if found.modes is not None:
        modes = group.create_group("modes")
        mode = add_scale(modes, "mode", list(found.modes.label), "name")
        for name, unit in (("frequency", "Hz"), ("q", "1"), ("overlap", "1")):
            add_dataset(modes, name, getattr(found.modes, name), unit, mode, item)
    for n, overlay in enumerate(found.overlay, 1):
        part = group.create_group(f"overlay_{n}")
        for name in ("kind", "output", "input", "unit"):
            part.attrs[name] = getattr(overlay, name)
        for m, curve in enumerate(overlay.curves, 1):
            own = part.create_group(f"curve_{m}")
            own.attrs["item"] = curve.item
            frequency = add_scale(own, "frequency", curve.frequency, "Hz")
            for name in ("value", "uncertainty"):
                add_dataset(own, name, getattr(curve, name), overlay.unit, frequency)
            ratios = add_scale(own, "ratio_frequency", curve.ratio_frequency, "Hz")
            add_dataset(own, "ratio", curve.ratio, "1", ratios)


def load(group: Stored) -> Comparison:
    """Read a comparison from a group."""
    names = tuple(group["item"].asstr()[:])
    changes: list[list[Change]] = [[] for _ in names]
    if "design_changes" in group:
        part = group["design_changes"]
        texts = (part[name].asstr()[:] for name in ("path", "before", "after"))
        for n, *words in zip(part["item"][:], *texts, strict=True):
            changes[n].append(Change(*words))
    modes = None
    if "modes" in group:
        part = group["modes"]
        arrays = (part[name][:] for name in ("frequency", "q", "overlap"))
        modes = PairedModes(tuple(part["mode"].asstr()[:]), *arrays)
    overlays = []
    for n in range(1, 1 + sum(name.startswith("overlay_") for name in group)):
        part = group[f"overlay_{n}"]
        curves = []
        for m in range(1, 1 + len(part)):
            own = part[f"curve_{m}"]
            curves.append(Curve(int(own.attrs["item"]), *(own[name][:] for name in SHORT)))
        about = [str(part.attrs[name]) for name in ("kind", "output", "input", "unit")]
        overlays.append(Overlay(*about, curves=tuple(curves)))
    return Comparison(
        names,
        tuple(group["kind"].asstr()[:]),
        tuple(group["model"].asstr()[:]),
        tuple(tuple(row) for row in changes),
        modes,
        tuple(overlays),
    )
