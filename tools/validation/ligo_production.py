"""LIGO's quadruple pendulum against the state space of its production model."""

from __future__ import annotations

from tools.validation.comparison import HEAD, Comparison, compare, details, row
from tools.validation.page import table

TITLE = "Quadruple pendulum"
WHY = (
    "What is left are the digits to which the numbers of the design file are rounded. `beam`"
    " differs by the bending of wires and fibres, which the production model includes only by"
    " measuring lengths between bending points."
)
SHOWN = ("test.x / support.x", "test.z / support.z", "test.pitch / top.torque_pitch")


def compare_with_production_model() -> Comparison:
    """Compute modes and responses."""
    return compare("ligo-quad", TITLE, WHY, peer="LIGO", folder="ligo")


def lines(one: Comparison) -> list[str]:
    """Lines of the page, with the picture."""
    return [
        "The parameters of the model that the observatories use are not public, but finesse-ligo "
        "ships its state space (48 states, 20140304TMproductionTM). From this follow the mass and"
        " the stiffness matrix of the four bodies, 24 x 24 each; all lengths and stiffnesses of "
        "`configs/built/ligo-quad.toml` are inferred from these "
        "(`tools/validation/quad_references.py`). The upper triangle of the stiffness has 62 "
        "numbers that are not 0; 32 lengths and stiffnesses, many of them round, reproduce each "
        "within 2e-5 in the string model, so LIGO's model has the same mechanics. Its blades are "
        "also compliant along x (100, 100 and 80 kN/m each). The design of 2005 "
        "(`configs/ligo-quad-2005.toml`) has other masses, blades and heights of the wires' ends.",
        *table(HEAD, [row(one)]),
        *details(one, SHOWN),
    ]
