"""LIGO's quadruple pendulum against the state space of its production model."""

from __future__ import annotations

from tools.validation.comparison import HEAD, Comparison, compare, details, row
from tools.validation.page import table

TITLE = "Quadruple pendulum"
WHY = (
    "What is left is rounding of the design file. `beam` bends wires and fibres; the production"
    " model measures lengths between bending points instead."
)
SHOWN = ("test.x / support.x", "test.z / support.z", "test.pitch / top.torque_pitch")


def compare_with_production_model() -> Comparison:
    """Compute modes and responses."""
    return compare("ligo-quad", TITLE, WHY, peer="LIGO", folder="ligo")


def lines(one: Comparison) -> list[str]:
    """Lines of the page, with the picture."""
    return [
        "The parameters of the observatories' model are not public, but finesse-ligo ships its state"
        " space (20140304TMproductionTM), from which the mass and stiffness matrices of the four"
        " bodies follow. **Every number of `configs/built/ligo-quad.toml` is fitted to these**"
        " (`tools/validation/quad_references.py`), so equal modes are no test. What is independent:"
        " the stiffness has 62 numbers that are not 0, and 32 lengths and stiffnesses reproduce each"
        " within 2e-5, so LIGO's model has the same mechanics as the string model. A comparison with"
        " known parameters is that of the [design of 2005](#quadruple-pendulum-of-2005).",
        *table(HEAD, [row(one)]),
        *details(one, SHOWN),
    ]
