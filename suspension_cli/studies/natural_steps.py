"""Changes of a practical size: a millimetre, a milliradian, or one per cent."""

from __future__ import annotations

from suspension_cli.design.paths import DISPLAYED, unit_of
from suspension_cli.design.wires import CROSS_SECTIONS

ACROSS = ("width", "thickness", "surface_depth", "diameter")
"""Lengths across a wire or blade, which are made to a fraction of their size."""
SECTIONS = tuple(kind.key for kind in CROSS_SECTIONS)
"""Keys of cross-sections: all numbers below them are such lengths, in a table of wires."""
WIRES = ("wires", "wire", "sections")
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
    of_wire = any(key in WIRES for key in names) and any(key in SECTIONS for key in names)
    thin = names[-1] in ACROSS or of_wire
    lossy = "loss" in names or "loss" in names[-1]
    step = None if thin or lossy else STEPS.get(unit_of(path))
    return step or (value / 100, "%")
