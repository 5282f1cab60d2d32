"""LIGO's quadruple pendulum against the state space of its production model."""

from __future__ import annotations

from tools.validation.comparison import Comparison, compare, details, row

TITLE = "Quadruple pendulum, fitted"
WHY = (
    "`beam` bends wires and fibres, where the production model has lengths between bending points."
)
SHOWN = ("test.x / support.x", "test.z / support.z", "test.pitch / top.torque_pitch")


def compare_with_production_model() -> Comparison:
    """Compute modes and responses."""
    return compare("ligo-quad", TITLE, WHY, peer="LIGO", folder="ligo")


def lines(one: Comparison) -> list[str]:
    """Lines of the page, with the picture."""
    _, modes, within, median, worst, beam, responses, middle = row(one)
    return [
        "### Quadruple pendulum of today",
        "",
        "The parameters of the observatories' model are not public; finesse-ligo ships its state"
        " space (20140304TMproductionTM). **Every number of `configs/built/ligo-quad.toml` is fitted"
        " to its mass and stiffness matrices**, so equal modes are no test. Independent: 32 lengths and"
        " stiffnesses reproduce 62 elements of the stiffness within 2e-5"
        " (`tools/validation/quad_references.py`), so LIGO's model has the mechanics of the string"
        f" model. {within} of {modes} modes are within 0.1 % (median {median} %, worst in % {worst},"
        f" `beam` {beam}), and {responses} % of the responses within 1 % (median {middle} %; `ligo-quad`).",
        *details(one, SHOWN),
    ]
