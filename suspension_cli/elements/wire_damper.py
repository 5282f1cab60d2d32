"""Dynamic stiffness of a damper on a wire: a mass on a lossy spring at a point of it.

In the directions of its spring, a damper of mass m on the spring k (1 + i phi) pulls at its point
with D times the motion of that point (Den Hartog, Mechanical Vibrations, section 3.2),

    D = -m omega^2 k (1 + i phi) / (k (1 + i phi) - m omega^2),

in the other directions with D = -m omega^2. It does not resist rotations.

>>> from suspension_cli.design.wires import WireDamper
>>> damper = WireDamper(mass=1e-3, stiffness=1e3, loss_angle=0.1)  # 159 Hz
>>> stiffness(damper, "bend-1", np.array([100.0]), lossy=False)  # below its resonance: a mass
array([-10.1010101])
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.elements.joined_sections import EPS

if TYPE_CHECKING:
    from jaxtyping import Inexact, Int

    from suspension_cli.design.wires import WireDamper


def stiffness(
    damper: WireDamper | None, part: str, omega: Inexact[np.ndarray, " frequency"], *, lossy: bool
) -> Inexact[np.ndarray, " frequency"]:
    """Dynamic stiffness (N/m) at frequencies in rad/s, for a part of the motion of the wire."""
    if damper is None:
        return np.zeros_like(omega)
    inertia = -damper.mass * omega**2
    if part not in sprung_parts(damper):
        return inertia
    spring = damper.spring * (1 + 1j * damper.loss_angle if lossy else 1.0)
    total = spring + inertia
    # just beside the resonance of the damper
    total = np.where(total == 0, EPS * damper.spring, total)
    return spring * inertia / total


def resonances_below(
    damper: WireDamper | None, part: str, omega: Inexact[np.ndarray, " frequency"]
) -> Int[np.ndarray, " frequency"]:
    """Whether the damper, with its point at rest, resonates below each omega (rad/s): 0 or 1."""
    if damper is None or part not in sprung_parts(damper):
        return np.zeros(np.shape(omega), dtype=int)
    return (omega**2 * damper.mass > damper.spring).astype(int)


def sprung_parts(damper: WireDamper | None) -> tuple[str, ...]:
    """Parts of the motion of the wire in which the spring of a damper acts."""
    if damper is None:
        return ()
    across = ("bend-1", "bend-2") if damper.acts != "along" else ()
    along = ("stretch",) if damper.acts != "across" else ()
    return (*across, *along)
