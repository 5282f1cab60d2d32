"""Closed forms for one stage on four wires, symmetric in x and y: the paper's equations 1 to 14.

Husman et al., Rev. Sci. Instrum. 71, 2546 (2000): l the loaded length, s the half separation in x,
t1 and t2 those in y at the upper and lower end, d the height of the lower ends above the COM,
Omega the angle of the wires from the vertical, sin(Omega) = (t2 - t1) / l.

The paper does not print sideways and roll ("the terms for the other degrees of freedom follow in a
similar fashion"); `sideways_roll` derives them in the same way. The paper's tilt is positive
against the right-hand rule; the right-handed one here changes the sign of A12 and A21 and no
frequency.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design.derive import origin_offset, set_geometry
from suspension_cli.design.schema import Design
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import force
from suspension_cli.models.base import BENDING, BLADE_TIPS, MASS, Model
from suspension_cli.rotations import cross_matrix

if TYPE_CHECKING:
    from jaxtyping import Inexact

    from suspension_cli.models.base import Numbers


@dataclass(frozen=True)
class FourWires:
    """Parameters of one mass on four wires; every number may be an array. SI units."""

    mass: Numbers
    inertia: tuple[Numbers, Numbers, Numbers]  # IX, IY, IZ
    l: Numbers
    s: Numbers
    t1: Numbers
    t2: Numbers
    d: Numbers
    k: Numbers  # spring constant of one wire
    gravity: Numbers = 9.81

    @property
    def sin(self) -> Numbers:
        """sin(Omega)."""
        return (self.t2 - self.t1) / self.l

    @property
    def cos(self) -> Numbers:
        """cos(Omega)."""
        return np.sqrt((1.0 - self.sin) * (1.0 + self.sin))


def vertical(p: FourWires) -> Numbers:
    """omega^2 of the vertical mode, (rad/s)^2; equation 6 (equation 1 for vertical wires)."""
    return 4 * p.k * p.cos**2 / p.mass + p.gravity * p.sin**2 / (p.l * p.cos)


def rotation(p: FourWires) -> Numbers:
    """omega^2 of the yaw mode, (rad/s)^2; equation 9 (equation 4 for vertical wires)."""
    inertia = p.inertia[2]
    pendulum = p.mass * p.gravity * (p.s**2 * p.cos**2 + p.t1 * p.t2) / (p.l * inertia * p.cos)
    return pendulum + 4 * p.k * p.s**2 * (p.t2 - p.t1) ** 2 / (p.l**2 * inertia)


def longitudinal_tilt(p: FourWires) -> Inexact[np.ndarray, "*batch 2 2"]:
    """Matrix A of equations 10 to 14 with right-handed pitch, (x, pitch)'' = A (x, pitch).

    (..., 2, 2), 1/s^2. For d = 0 its diagonal is that of equations 7 and 8 (2 and 3 for vertical
    wires).
    """
    inertia = p.inertia[1]
    over = p.gravity / (p.l * p.cos)
    a12 = -over * p.d
    a21 = -p.mass * over * p.d / inertia
    stretch = 4 * p.k * p.s**2 * p.cos**2 + p.mass * over * p.s**2 * p.sin**2
    a22 = -(stretch + p.mass * p.gravity * p.d + p.mass * over * p.d**2) / inertia
    return _matrix(-over, a12, a21, a22)


def sideways_roll(p: FourWires) -> Inexact[np.ndarray, "*batch 2 2"]:
    """Matrix A with (y, roll)'' = A (y, roll); (..., 2, 2), 1/s^2.

    When the mass moves by y and rolls by p, a wire at (+-s, +-t2, d) below is lengthened by e and
    swung by w,

        e = +-(sin(Omega) (y - d p) - cos(Omega) t2 p),
        w = cos(Omega) (y - d p) + sin(Omega) t2 p.

    Its tension T = m g / (4 cos(Omega)) works on the second-order lift of its lower end, so the
    energy is

        4 [k e^2 / 2 + (T / l) w^2 / 2 + T p^2 (d cos - t2 sin) / 2].
    """
    tension = p.mass * p.gravity / (4 * p.cos)
    e = (p.sin, -p.d * p.sin - p.t2 * p.cos)
    w = (p.cos, -p.d * p.cos + p.t2 * p.sin)
    k = [[4 * (p.k * e[i] * e[j] + tension / p.l * w[i] * w[j]) for j in (0, 1)] for i in (0, 1)]
    k[1][1] = k[1][1] + 4 * tension * (p.d * p.cos - p.t2 * p.sin)
    return _matrix(
        -k[0][0] / p.mass, -k[0][1] / p.mass, -k[1][0] / p.inertia[0], -k[1][1] / p.inertia[0]
    )


def _matrix(
    a11: Numbers, a12: Numbers, a21: Numbers, a22: Numbers
) -> Inexact[np.ndarray, "*batch 2 2"]:
    rows = np.broadcast_arrays(a11, a12, a21, a22)
    return np.stack([np.stack(rows[:2], -1), np.stack(rows[2:], -1)], -2)


def four_wires(design: Design, *, lossy: bool = False) -> FourWires:
    """Parameters of a design for which the closed forms are valid; with complex k if `lossy`."""
    chain = force.chain(design, lossy=lossy)
    p = chain.stages[0]
    return FourWires(
        p.mass, p.inertia, p.l, p.s_upper, p.t1, p.t2, p.d, k=p.k, gravity=chain.gravity
    )


def _stiffness(p: FourWires, offset: tuple[float, float, float]) -> Inexact[np.ndarray, "12 12"]:
    """Stiffness of support and body.

    The coupling to the support follows from the body's own stiffness: moving both as one rigid body
    costs no elastic energy, and turns the force that the wires exert.
    """
    masses = np.array([p.mass, p.mass, p.mass, *p.inertia])
    own = np.zeros((6, 6), dtype=np.result_type(float, np.asarray(p.k)))
    for dofs, matrix in (((0, 4), longitudinal_tilt(p)), ((1, 3), sideways_roll(p))):
        block = -masses[list(dofs), None] * matrix
        own[np.ix_(dofs, dofs)] = (block + block.T) / 2
    own[2, 2] = p.mass * vertical(p)
    own[5, 5] = p.inertia[2] * rotation(p)
    rigid = np.eye(6)
    turned = np.zeros((6, 6))
    rigid[:3, 3:] = -cross_matrix(np.array(offset))
    turned[:3, 3:] = -cross_matrix(np.array([0.0, 0.0, -p.mass * p.gravity]))
    across = turned - own @ rigid
    support = -turned - across.T @ rigid
    return np.block([[(support + support.T) / 2, across.T], [across, own]])


class ClosedForm(Model):
    """The closed forms: one stage, one design at a time."""

    name = "closed-form"
    description = "the paper's equations for a single pendulum on four wires"
    valid_for = "one stage on four symmetric wires"
    omits = (BLADE_TIPS, BENDING, MASS)
    cost = 1.0
    automatic = False

    def unsuitable(self, design: Design) -> str:
        """Why the closed forms are not valid for a design; "" if they are."""
        if len(design.stage) > 1:
            return "it has more than one stage"
        if reason := force.FORCE.unsuitable(design):
            return reason
        wires = design.stage[0].wires
        if wires is None or wires.count != 4:
            return "it does not hang on four wires"
        shape = set_geometry(wires)
        if shape.s_upper != shape.s_lower:
            return "its wires are angled in x"
        if design.stage[0].blades is not None:
            return "it has blades"
        return "its wires resist twisting" if wires.torsion is not None else ""

    def suspension(self, design: Design) -> LinearSystem:
        """Linear model of one stage on four wires, from the closed forms."""
        p = four_wires(design)
        offset = origin_offset(design.stage[0])
        lossy = _stiffness(four_wires(design, lossy=True), offset) if force.lossy(design) else None
        masses = [p.mass, p.mass, p.mass, *p.inertia]
        return force.assembled(design, masses, _stiffness(p, offset), lossy)


CLOSED_FORM = ClosedForm()
