"""Loss angles of wires and blades against frequency: sums over the mechanisms of `design.losses`.

All are finite at zero frequency. `omega` is in rad/s, not negative, or complex (of a damped mode).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design.cross_sections import plate
from suspension_cli.scene.composition import BladeLoss, Section

if TYPE_CHECKING:
    from jaxtyping import Inexact


def bending_angle(
    section: Section,
    plane: int,
    omega: Inexact[np.ndarray, "*#frequency"] | complex,
    tension: Inexact[np.ndarray, "*#frequency"] | complex,
    temperature: float,
) -> Inexact[np.ndarray, "*frequency"]:
    """Loss angle of the bending of a wire, rad.

    Parameters
    ----------
    plane : {0, 1}
        As in `section.rigidity`.
    tension
        N; sets the static strain for the thermoelastic loss.
    temperature
        K.
    """
    plain, strained, free, slope = bending_angle_parts(section, plane, omega, temperature)
    return plain + strained * (free - slope * np.asarray(tension)) ** 2


def bending_angle_parts(
    section: Section,
    plane: int,
    omega: Inexact[np.ndarray, "*frequency"] | complex,
    temperature: float,
) -> tuple[Inexact[np.ndarray, "*frequency"], Inexact[np.ndarray, "*frequency"], float, float]:
    """Parts of the loss angle of the bending of a wire, plain + strained a^2.

    Returns
    -------
    plain
        Loss angle of mechanisms that do not depend on tension, rad.
    strained
        That of the mechanism with a coefficient a (thermoelastic, 1/K), over a^2.
    free, slope : float
        a = free - slope * tension (N).
    """
    plain = 0.0 * np.asarray(omega)
    strained, free, slope = 0.0 * (np.asarray(omega) + temperature), 0.0, 0.0
    for own in section.losses:
        angle = own.bending(section.shape, plane, omega, temperature)
        coefficient = own.coefficient(section.shape.area)
        if coefficient is None:
            plain = plain + angle
        else:
            strained, (free, slope) = angle, coefficient
    return plain, strained, free, slope


def bending_causes(
    section: Section,
    plane: int,
    omega: Inexact[np.ndarray, "*frequency"] | complex,
    temperature: float,
) -> dict[str, Inexact[np.ndarray, "*frequency"]]:
    """Loss angles of bending, rad, of the mechanisms that are listed under their own causes."""
    return {
        own.cause: own.bending(section.shape, plane, omega, temperature)
        for own in section.losses
        if own.cause
    }


def stretching_angle(
    section: Section, omega: Inexact[np.ndarray, "*frequency"] | complex
) -> Inexact[np.ndarray, "*frequency"]:
    """Loss angle of the stretching of a wire, rad."""
    zero = 0.0 * np.asarray(omega)
    return sum((own.stretching(section.shape, omega) for own in section.losses), zero)


def twisting_angle(
    section: Section, omega: Inexact[np.ndarray, "*frequency"] | complex
) -> Inexact[np.ndarray, "*frequency"]:
    """Loss angle of the twisting of a wire, rad."""
    zero = 0.0 * np.asarray(omega)
    return sum((own.twisting(section.shape, omega) for own in section.losses), zero)


def blade_angle(
    blade: BladeLoss, omega: Inexact[np.ndarray, "*frequency"] | complex
) -> Inexact[np.ndarray, "*frequency"]:
    """Loss angle of the bending of a blade or of the wires of a link, rad.

    The static stress averages to zero across the thickness, so the tension does not enter.
    """
    if blade.losses is None:
        return blade.angle + 0.0 * np.asarray(omega)
    shape, result = blade.shape or plate(blade.thickness), 0.0 * np.asarray(omega)
    for own in blade.losses:
        angle, coefficient = own.bending(shape, 0, omega, blade.temperature), own.coefficient(1.0)
        result = result + (angle if coefficient is None else angle * coefficient[0] ** 2)
    return result
