"""A loss angle phi at all frequencies needs a stiffness that goes as f^(2 phi/pi).

A constant stiffness with the phase phi over the band f_1 to f_2 is off by phi/pi ln(f_2/f_1).
"""

from __future__ import annotations

import math

import suspension_cli as sus

THROUGH_THE_CABLE = {"inputs": ["reaction.force_z"], "outputs": ["reaction.x"]}
"""Without the cable of the reaction chain, which is clamped off its axis, it is 0."""


def export(loss_angle: float, band: str):
    links = {f"link.cable-{one}.loss_angle": loss_angle for one in ("top", "bottom")}
    design = sus.example("reaction-chain").replace(links)
    return sus.export(design, **THROUGH_THE_CABLE, loss=True, band=band)


def test_a_response_through_a_link_of_constant_loss_angle_says_what_limits_it():
    made = export(0.05, "0.1:100")
    deviation = 0.05 / math.pi * math.log(1000)
    assert 0.01 < made.worst < deviation
    assert f"changes by {100 * deviation:.2g} % to either side" in str(made)


def test_a_small_loss_angle_reaches_the_accuracy():
    made = export(0.002, "0.1:100")
    assert made.worst < 0.01
    assert "to either side" not in str(made)
