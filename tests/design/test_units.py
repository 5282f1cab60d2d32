"""Every number of a design file has its unit in its type, but for those whose unit depends on a
direction or a quantity."""

from __future__ import annotations

from typing import Any, get_args, get_origin, get_type_hints

import msgspec

from suspension_cli.design.schema import Design

DEPENDS = {
    "Spring.stiffness",
    "Spring.damping",
    "Spring.preload",
    "Link.stiffness",
    "Link.damping",
    "Link.preload",
    "StiffnessTable.real",
    "StiffnessTable.imaginary",
    "StiffnessTable.static",
    "Damper.damping",
    "Loop.damper",
    "Loop.gain",
    "Loop.actuator_noise",
    "Loop.sensor_noise",
    "GainAt.magnitude",
    "NoiseSpectrum.asd",
    "Loop.zeros",
    "Loop.poles",
}
DEPENDS |= {
    f"{table}.{dof}"
    for table in ("Damping", "FrameDamping")
    for dof in ("x", "y", "z", "roll", "pitch", "yaw")
}
DEPENDS |= {f"Requirement.{key}" for key in ("band", "below", "above")}
DEPENDS |= {f"Distribution.{key}" for key in ("normal", "uniform", "truncate")}


def unit(kind: object) -> str:
    """SI unit of a type of the design file; "" if it has none."""
    facts = [
        one.extra for one in getattr(kind, "__metadata__", ()) if isinstance(one, msgspec.Meta)
    ]
    return next((extra["unit"] for extra in facts if extra and "unit" in extra), "")


def without_unit(kind: Any, name: str, found: set[str]) -> set[str]:
    """Names of the fields below a type that hold a float without a unit."""
    if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
        for key, hint in get_type_hints(kind, include_extras=True).items():
            without_unit(hint, f"{kind.__name__}.{key}", found)
    elif unit(kind):
        pass
    elif hasattr(kind, "__metadata__"):
        without_unit(kind.__origin__, name, found)
    elif kind is float:
        found.add(name)
    elif get_origin(kind) is not None:
        for part in get_args(kind):
            without_unit(part, name, found)
    return found


def test_numbers_have_units():
    assert without_unit(Design, "", set()) == DEPENDS
