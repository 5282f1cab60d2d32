"""Radiation pressure of the light between two mirrors: a stiffness, and a term in frequency.

**Geometry.** Light of the power P pushes each mirror with F = 2P/c along the axis of the cavity,
the line through both centres of curvature, on which the path between the mirrors is stationary. So
the forces and torques at constant P are the derivatives of the energy -F l, with the length

    l = R_1 + R_2 - |C_1 - C_2|

of the path between two mirrors that face each other. The centres C_1 = (R_1, 0) and
C_2 = (L - R_2, 0) in the plane of x and y, for bodies at 0 and L, move by y_1 + R_1 t_1 and
y_2 - R_2 t_2 across the axis for displacements y and yaws t, both right-handed about z, and by
R (1 - cos t) along it. To second order, with D = R_1 + R_2 - L, the energy is

    F (y_2 - y_1 - R_2 t_2 - R_1 t_1)^2 / 2D - F (R_1 t_1^2 + R_2 t_2^2) / 2.

With g_n = 1 - L/R_n, D = R_1 R_2 (1 - g_1 g_2) / L, so that the second derivatives among y_1, y_2,
t_1, t_2 stay finite for flat mirrors, in units of F L / (1 - g_1 g_2) and with c_n = 1/R_n,

     c_1 c_2  -c_1 c_2   c_2    c_1
    -c_1 c_2   c_1 c_2  -c_2   -c_1
     c_2      -c_2      -g_2    1
     c_1      -c_1       1     -g_1.

The lower right is the stiffness of Sidles and Sigg, Phys. Lett. A 354, 167 (2006): torques
2PL / (c (1 - g_1 g_2)) (g_2, -1; -1, g_1) (t_1, t_2). Its negative eigenvalue is the soft mode, the
positive one the hard mode. For pitch, z takes the place of y and -pitch that of t, since a
right-handed pitch lowers what lies at +x. Both mirrors have the axes of the design, so that the
signs do not depend on where they face.

**Static force.** F and its moments are taken as balanced by control, which pushes at the centres of
mass in directions that do not change: no body moves from its pose without light.

**Optical spring.** In a cavity of the pole gamma, detuned by Delta (rad/s; laser less resonance), a
slow change of the length l changes F as P ~ 1 / (gamma^2 + Delta^2), with dDelta/dl =
2 pi c / (lambda L). The light follows by two sidebands, so that the stiffness of l is

    K(s) = K_0 (gamma^2 + Delta^2) / ((s + gamma)^2 + Delta^2),
    K_0 = 8 pi P Delta / (lambda L (gamma^2 + Delta^2)),

(Buonanno and Chen, Phys. Rev. D 65, 042001 (2002); Sheard et al., Phys. Rev. A 69, 051801 (2004);
Corbitt et al., Phys. Rev. Lett. 98, 150802 (2007)) for frequencies far below the free spectral
range. Its delay damps as -2 gamma K_0 / (gamma^2 + Delta^2), in N s/m, at low frequencies.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from suspension_cli.conventions import DOFS, SUPPORT
from suspension_cli.design.links import LIGHT, Cavity
from suspension_cli.linear.coordinates import AddedCoordinates
from suspension_cli.linear.matrix_terms import MatrixTerm
from suspension_cli.linear.system import LinearSystem
from suspension_cli.linear.terms import LIGHT_ENDING, TermWithStates, quadratic_form

if TYPE_CHECKING:
    from jaxtyping import Complex, Float, Inexact

BESIDE = 1e-5
"""Relative step of central differences in frequency."""


def angular_stiffness(cavity: Cavity) -> Float[np.ndarray, "4 4"]:
    """Stiffness at constant power among y and yaw of both mirrors, N/m, N and N m.

    In the order y_1, y_2, yaw_1, yaw_2. With the signs of yaw reversed it is that of z and pitch.

    >>> cavity = Cavity(name="a", between=["itm", "etm"], length=1.0, radii=[2.0, 2.0], power=1e6)
    >>> np.round(angular_stiffness(cavity)[2:, 2:], 4)  # g = 1/2: -F L (g_2, -1; -1, g_1) / 0.75
    array([[-0.0044,  0.0089],
           [ 0.0089, -0.0044]])
    """
    (g, h) = cavity.g
    (a, b) = 1 / np.array(cavity.radii)
    unit = 2 * cavity.power / LIGHT * cavity.length / (1 - g * h)
    across = a * b * np.array([[1, -1], [-1, 1]])
    mixed = np.array([[b, a], [-b, -a]])
    return unit * np.block([[across, mixed], [mixed.T, np.array([[-h, 1], [1, -g]])]])


def optical_spring(cavity: Cavity) -> tuple[float, float, float]:
    """Stiffness K_0 (N/m) of the optical spring, and pole and detuning of its cavity (rad/s).

    >>> cavity = Cavity(
    ...     name="a", between=["itm", "etm"], length=1.0, radii=[2.0, 2.0], power=1e3,
    ...     finesse=1e4, detuning=3e3,
    ... )
    >>> round(optical_spring(cavity)[0])
    173052
    """
    pole = 2 * np.pi * cavity.half_width
    detuning = 2 * np.pi * cavity.detuning
    if not detuning:
        return 0.0, pole, 0.0
    slope = 8 * np.pi * cavity.power / (cavity.wavelength * cavity.length)
    return slope * detuning / (pole**2 + detuning**2), pole, detuning


@dataclass(frozen=True)
class Light(MatrixTerm, TermWithStates):
    """The light of a detuned cavity: how far its force lags behind the motion.

    The static optical spring K_0 is in the stiffness of the system. The `matrix` is the damping
    C = -2 gamma K_0 / (gamma^2 + Delta^2) at low frequencies (N s/m) along the cavity, and
    f = (K - K_0) / C. Light at room temperature has no thermal photons: it causes no thermal noise.

    Attributes
    ----------
    cavity
        Its name.
    pole, detuning
        gamma and Delta, rad/s.
    """

    is_viscous: ClassVar[bool] = True

    cavity: str
    pole: float
    detuning: float

    @staticmethod
    def of(cavity: Cavity, along: Float[np.ndarray, "coordinate coordinate"]) -> Light:
        """Light of a cavity whose elongation squared is x^T `along` x."""
        spring, pole, detuning = optical_spring(cavity)
        damping = -2 * pole * spring / (pole**2 + detuning**2)
        name = f"{cavity.name}.cavity"
        return Light(name, 0.0, damping * along, cavity.name, pole, detuning)

    def _lag(self, omega: Inexact[np.ndarray, " frequency"]) -> Complex[np.ndarray, " frequency"]:
        """Compute (K - K_0) / (i C), which is omega at low frequencies; it may be complex."""
        s = 1j * omega
        squared = self.pole**2 + self.detuning**2
        resonance = (s + self.pole) ** 2 + self.detuning**2
        return omega * (1 + s / (2 * self.pole)) * squared / resonance

    def inertia(
        self,
        omega: Float[np.ndarray, " mode"],
        motion: Inexact[np.ndarray, "coordinate mode"],
    ) -> Float[np.ndarray, " mode"]:
        """Compute -x^H d Re(K) / d(omega^2) x, kg m^2, by central differences."""
        below = np.real(self.at(omega * (1 - BESIDE)).value)
        above = np.real(self.at(omega * (1 + BESIDE)).value)
        slope = (above - below) / (4 * BESIDE * omega**2)
        return -slope * quadratic_form(self.matrix, motion)

    @property
    def motion_name(self) -> str:
        """``arm.light``."""
        return f"{self.cavity}{LIGHT_ENDING}"

    def states(self) -> AddedCoordinates:
        """The two sidebands, which have no mass.

        With the optical spring K_0 r r^T, r the row of its elongation, the equations

            (s + gamma) u + Delta v = h r . x,    Delta u - (s + gamma) v = h r . x,

        which are symmetric, give the force h (u + v) r = 2 h^2 Delta / ((s + gamma)^2 + Delta^2)
        r r.x; h^2 = (gamma^2 + Delta^2) |K_0 / 2 Delta| makes it K(s).
        """
        size = len(self.matrix)
        squared = self.pole**2 + self.detuning**2
        spring = self.matrix * (squared / (-2 * self.pole))
        lead = int(np.abs(np.diag(spring)).argmax())
        row = spring[lead] / np.sqrt(np.abs(spring[lead, lead]))
        force = np.sqrt(squared / np.abs(2 * self.detuning)) * row
        both = np.stack([force, force])
        follow = np.array([[self.pole, self.detuning], [self.detuning, -self.pole]])
        damping = np.diag([*np.zeros(size), -1.0, 1.0])
        return AddedCoordinates(
            name=(f"light-1.{self.cavity}", f"light-2.{self.cavity}"),
            unit=("sqrt(J s)", "sqrt(J s)"),
            momentum_unit=("sqrt(J s)", "sqrt(J s)"),
            mass=np.zeros_like(damping),
            stiffness=np.block([[-spring, both.T], [both, -follow]]),
            damping=damping,
        )


def with_cavity(model: LinearSystem, cavity: Cavity) -> LinearSystem:
    """Add the radiation pressure of one cavity to a linear system, which may have batch axes."""
    first, second = (
        0 if name == SUPPORT else 6 * (1 + model.body.index(name)) for name in cavity.between
    )
    own = np.zeros((model.size, model.size))
    angular = angular_stiffness(cavity)
    for shift, turn, sign in (("y", "yaw", 1), ("z", "pitch", -1)):
        place = [body + DOFS.index(dof) for dof in (shift, turn) for body in (first, second)]
        signs = np.array([1, 1, sign, sign])
        own[np.ix_(place, place)] += angular * np.outer(signs, signs)
    stretch = np.zeros(model.size)
    stretch[first] = -1.0
    stretch[second] = 1.0
    along = np.outer(stretch, stretch)
    spring, _, _ = optical_spring(cavity)
    terms = (*model.terms, Light.of(cavity, along)) if spring else model.terms
    own = own + spring * along
    return replace(model, soft=model.soft + own, allowed=model.allowed | (own != 0), terms=terms)
