"""Stability row: blades far softer than the wires that hang from them."""

from __future__ import annotations

from typing import Any

import numpy as np

from suspension_cli.linear import response, signals
from suspension_cli.models import registry
from tools.stability import naive
from tools.stability.references import column, design
from tools.stability.row import SHIPPED, Row, sample

RATIO = 10.0 ** np.arange(0, 15)
FREQUENCY = np.array([0.3, 1.0, 10.0])
MODELS = (registry.STRING, registry.BEAM, registry.VIOLIN)


def row(ratio: Any = RATIO) -> Row:
    """Compute errors of the vertical response of two masses on blades and vertical wires."""
    error: dict[str, Any] = {}
    for kind in MODELS:

        def compute(value: float, kind: Any = kind) -> Any:
            massive, lossy = kind.has_wire_mass, kind.bends_wires
            raw, exact = column(value, massive=massive, lossy=lossy)
            model = kind.system(design(raw))
            reference = np.array([exact.response(f) for f in FREQUENCY])
            known = signals.bodies_with_signals(model)
            into, out = (
                signals.parse_input("support.z", known),
                signals.parse_output("test.z", known),
            )
            found = {
                f"{SHIPPED}: {kind.name}": (
                    response.solve(model, FREQUENCY, [into], [out]).value[:, 0, 0]
                )
            }
            if not lossy:
                found |= {
                    "tips with the stage below": naive.upward(model, FREQUENCY, into, out),
                    "tips eliminated first": naive.dense(model, FREQUENCY, into, out),
                }
            return reference, found

        error |= sample(ratio, compute)
    return Row(
        title="Blades softer than their wires",
        driver="stiffness ratio k_wire / k_blade",
        quantity="support.z to test.z at 0.3, 1 and 10 Hz, two stages",
        value=np.asarray(ratio, dtype=float),
        error=error,
        finding=(
            "A nearly rigid wire on a soft blade leaves k − k²/(k + k_b) of its stiffness, which"
            " has lost k_b; eliminating the tip with the body below squares the loss. The program"
            " has the wires' tensions as coordinates."
        ),
        limit="none found; of builds whose blades have a tip mass, modes lose 10⁻¹⁵ × ratio",
    )
