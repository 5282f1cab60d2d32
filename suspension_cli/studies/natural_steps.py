"""Changes of a practical size: a millimetre, a milliradian, or one per cent."""

from __future__ import annotations

from suspension_cli.design.path_units import DISPLAYED, unit_of

CROSS_SECTION = ("radius", "width", "thickness", "surface_depth", "diameter")
"""Lengths across a wire or blade, which are made to a fraction of their size."""
WIRES = ("wires", "wire", "sections", "section")
"""Tables in which a radius is that of a wire; elsewhere it is that of a body."""
STEPS = {unit: (1 / factor, name) for unit, (name, factor) in DISPLAYED.items() if unit != "Pa"}
"""Step of a length or an angle, by SI unit, and the step's name."""


def natural_step(path: str, value: float) -> tuple[float, str]:
    """Choose the step of a number of a design (by dotted path), in SI, and name it.

    1 mm for a length and 1 mrad for an angle; 1 % for everything else, including the thickness of
    wires and blades, and loss angles.

    >>> natural_step("stage.test.wires.d", 0.001), natural_step("stage.test.body.mass", 5.0)
    ((0.001, 'mm'), (0.05, '%'))
    """
    keys = path.split(".")
    # after the name of a stage or material
    names = [key for key in keys[2:] if not key.isdigit()] or keys[-1:]
    thin = names[-1] in CROSS_SECTION and (
        names[-1] in CROSS_SECTION[2:] or any(key in WIRES for key in names)
    )
    lossy = "loss" in names or "loss" in names[-1]
    step = None if thin or lossy else STEPS.get(unit_of(path))
    return step or (value / 100, "%")
