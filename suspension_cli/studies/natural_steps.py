"""Changes in which builders think: a millimetre, a milliradian, or one per cent."""

from __future__ import annotations

from functools import cache
from types import UnionType
from typing import Union, get_args, get_origin, get_type_hints

import msgspec

from suspension_cli.design.schema import Design
from suspension_cli.design.units import unit

CROSS_SECTION = ("radius", "width", "thickness", "surface_depth")
"""Lengths across a wire or blade, which are made to a fraction of their size."""
WIRES = ("wires", "wire", "sections", "section")
"""Tables in which such a length is that of a wire; elsewhere a radius is that of a body."""
STEPS = {"m": (1e-3, "mm"), "rad": (1e-3, "mrad")}
"""Step of a number of a unit (SI), and the step's name."""


def natural_step(path: str, value: float) -> tuple[float, str]:
    """Choose the step of a number of a design, in its own unit, and name it.

    1 mm of a length and 1 mrad of an angle; 1 % of everything else, with the thickness of wires
    and blades and loss angles.

    Parameters
    ----------
    path : str
        Dotted path.
    value : float
        SI.

    Examples
    --------
    >>> natural_step("stage.test.wires.d", 0.001), natural_step("stage.test.body.mass", 5.6)
    ((0.001, 'mm'), (0.056, '%'))
    """
    keys = path.split(".")
    # after the name of a stage or material
    names = [key for key in keys[2:] if not key.isdigit()] or keys[-1:]
    thin = names[-1] in CROSS_SECTION and (
        names[-1] in CROSS_SECTION[2:] or any(key in WIRES for key in names)
    )
    lossy = "loss" in names or "loss" in names[-1]
    step = None if thin or lossy else STEPS.get(unit_at(Design, tuple(keys)))
    return step or (value / 100, "%")


@cache
def unit_at(kind: object, keys: tuple[str, ...]) -> str:
    """Read the unit of the number at a path below a type of the design file; "" if it has none.

    >>> unit_at(Design, ("stage", "test", "wires", "l"))
    'm'
    """
    origin, inner = get_origin(kind), get_args(kind)
    if not keys and unit(kind):
        return unit(kind)
    if hasattr(kind, "__metadata__"):
        return unit_at(inner[0], keys)
    if origin in (Union, UnionType):
        return next(filter(None, (unit_at(one, keys) for one in inner)), "")
    if not keys:
        return ""
    if origin is dict:
        return unit_at(inner[1], keys[1:])
    if origin in (list, tuple):
        return unit_at(inner[0], keys[1:])
    if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
        hints = get_type_hints(kind, include_extras=True)
        return unit_at(hints[keys[0]], keys[1:]) if keys[0] in hints else ""
    return ""
