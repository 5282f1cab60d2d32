"""Built-in materials. `[materials.NAME]` of a design overrides some values, or adds a material."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import msgspec

from suspension_cli.design.losses import MaterialLoss
from suspension_cli.design.schema import Design, Material

BUILT_IN = msgspec.convert(
    tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8")),
    dict[str, Material],
)
"""Built-in materials by name; the file has their sources."""


def resolve(design: Design, name: str) -> Material:
    """Look up a material: values of the design, then built-in ones, with all losses in `loss`.

    A surface depth is relative to the loss angle of the bulk, so both built-in ones are dropped if
    the design gives a bulk loss.
    """
    own, base = design.materials.get(name, Material()), BUILT_IN.get(name, Material())
    loss, own_loss = _given(base.loss), _given(own.loss)
    if own.loss_angle is not None:
        own_loss = {"angle": own.loss_angle, **own_loss}
    if {"angle", "table"} & own_loss.keys():
        loss = {key: loss[key] for key in loss.keys() - {"angle", "table", "surface_depth"}}
    return msgspec.structs.replace(base, **_given(own) | {"loss": MaterialLoss(**loss | own_loss)})


def _given(table: Material | MaterialLoss | None) -> dict[str, Any]:
    """Values that a table gives."""
    values = {} if table is None else msgspec.structs.asdict(table)
    return {key: value for key, value in values.items() if value not in (None, "")}


def constant_angle(design: Design, name: str) -> float:
    """Look up the constant loss angle that the design itself gives a material, rad; 0 if none.

    It is the only loss of a material in the string model.
    """
    own = design.materials.get(name, Material())
    return getattr(own.loss, "angle", None) or own.loss_angle or 0.0


def known(design: Design) -> list[str]:
    """List the names of materials that a design may use."""
    return sorted({*BUILT_IN, *design.materials})
