"""Built-in materials. `[materials.NAME]` of a design overrides some values, or adds a material."""

from __future__ import annotations

import tomllib
from pathlib import Path

import msgspec

from suspension_cli.design.losses.registry import MECHANISMS
from suspension_cli.design.schema import Design, Material, MaterialLoss

BUILT_IN = msgspec.convert(
    tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8")),
    dict[str, Material],
)
"""Built-in materials by name; the file has their sources."""


def resolve(design: Design, name: str) -> Material:
    """Look up a material: values of the design, then built-in ones, with all losses in `loss`."""
    own = design.materials.get(name, Material())
    base = BUILT_IN.get(name, Material())
    given = {
        key: value for key, value in msgspec.structs.asdict(own).items() if value not in (None, "")
    }
    return msgspec.structs.replace(base, **given | {"loss": _loss(own, base)})


def _loss(own: Material, base: Material) -> MaterialLoss:
    built_in = msgspec.structs.replace(base, loss=base.loss or MaterialLoss())
    values: dict[str, object] = {}
    for mechanism in MECHANISMS:
        values |= mechanism.merge(own, built_in)
    return MaterialLoss(**values)


def constant_angle(design: Design, name: str) -> float:
    """Look up the constant loss angle that the design itself gives a material, rad; 0 if none.

    It is the only loss of a material in the string model.
    """
    own = design.materials.get(name, Material())
    return getattr(own.loss, "angle", None) or own.loss_angle or 0.0


def known(design: Design) -> list[str]:
    """List the names of materials that a design may use."""
    return sorted({*BUILT_IN, *design.materials})
