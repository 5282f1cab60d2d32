"""Loss angles of wires and blades against frequency: bulk, surface, thermoelastic.

**Surface.**  A layer at the surface is lossier than the bulk. It adds phi_bulk d_s mu S/V to the
loss angle phi_bulk of the bulk, where the dissipation depth d_s is a property of the finish and

    mu S/V = (integral of e^2 over the surface) / (integral of e^2 over the volume)

for the strain e of the deformation (Gretarsson and Harry, Rev. Sci. Instrum. 70, 4081 (1999)). The
functions named `..._ratio` give it for each deformation.

**Thermoelastic.**  Stretched material cools and compressed material warms; in a bent wire, heat
flows from the compressed to the stretched side and back (Zener, Phys. Rev. 53, 90 (1938)). With
theta the change of temperature across a wire that bends in y (scaled to be y where no heat flows),
its surface insulated, and the diffusivity D = conductivity/(rho C),

    i w theta = D (theta_xx + theta_yy) + i w y,
    E (1 + Delta g),   g = (integral of y theta)/(integral of y^2),   Delta = E T a^2/(rho C),

so the loss angle is Delta Im g. With h half the depth in y (the radius, or half the thickness) and
x = h sqrt(i w/D) the solution is, for both shapes,

    g = v/(v + 2 (n + 1)),   v = x^2 + x I_(n+2)(x)/I_(n+1)(x),
    n = 1 (round), n = 1/2 (ribbon or blade),

that is 1 - 4 J2(z)/(z^2 J1'(z)) with z = i x for a round wire, and 1 + (12/z^2)(1 - (2/z) tan(z/2))
with z = 2 i x for a ribbon (Lifshitz and Roukes, Phys. Rev. B 61, 5600 (2000)). It is a sum of
relaxations w tau/(1 + w^2 tau^2), of which the slowest, with tau = R^2/(1.8412^2 D) or
t^2/(pi^2 D), gives all but 1 % of the loss at low frequencies; far above its peak the sum exceeds
it by 18 or 22 %.

The coefficient a is the slope of strain against temperature at constant stress s. With the strain
s/E(T) + alpha T it is a = alpha - s E'/E^2 = alpha - u beta, u = s/E the static strain and
beta = E'/E: in a material that stiffens with temperature the loss vanishes at one tension (Cagnoli
and Willems, Phys. Rev. B 65, 174111 (2002)). Stretching and twisting drive no heat across a wire.

All angles are finite at zero frequency. `omega` is in rad/s, not negative, of any shape; or complex
(of a damped mode): the angles are continued analytically, except those of a table, which are taken
at the real part.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from suspension_cli.design.sections import rectangle_torsion
from suspension_cli.scene.composition import BladeLoss, Losses, Section

LEAST, MOST = 1e-8, 1e6
"""|x| outside which the ratios of Bessel functions equal their limits to the last digit."""
MIDDLE = 2.0
"""|x| below which g, and above which g - 1, is computed without cancellation."""


def bending_angle(section: Section, plane: int, omega: Any, tension: Any, temperature: Any) -> Any:
    """Loss angle of the bending of a wire, rad.

    Parameters
    ----------
    section : Section
    plane : {0, 1}
        Plane of the bending, as in `section.rigidity`.
    omega : array
        rad/s.
    tension : array
        N; sets the static strain for the thermoelastic loss.
    temperature : array
        K.

    Returns
    -------
    array
        Of the shape to which the arguments broadcast.
    """
    bulk, thermoelastic, expansion, slope = bending_angle_parts(section, plane, omega, temperature)
    return bulk + thermoelastic * (expansion - slope * np.asarray(tension)) ** 2


def bending_angle_parts(
    section: Section, plane: int, omega: Any, temperature: Any
) -> tuple[Any, Any, float, float]:
    """Parts of the loss angle of the bending of a wire.

    Returns
    -------
    bulk : array
        Loss angle of bulk and surface, rad.
    thermoelastic : array
        Thermoelastic loss angle if the coefficient a were 1/K, K^2.
    expansion, slope : float
        a = expansion - slope * tension; 1/K and 1/(K N).
    """
    losses = section.losses
    bulk = _bulk_and_surface(losses, omega, bending_ratio(section, plane))
    strength = _thermoelastic(losses, section.depth[plane], section.round, omega, temperature)
    slope = losses.modulus_slope / (losses.youngs_modulus * section.area)
    return bulk, strength, losses.expansion, slope


def stretching_angle(section: Section, omega: Any) -> Any:
    """Loss angle of the stretching of a wire, rad, of the shape of omega (rad/s)."""
    return _bulk_and_surface(section.losses, omega, stretching_ratio(section))


def twisting_angle(section: Section, omega: Any) -> Any:
    """Loss angle of the twisting of a wire, rad, of the shape of omega (rad/s)."""
    return _bulk_and_surface(section.losses, omega, twisting_ratio(section))


def blade_angle(blade: BladeLoss, omega: Any) -> Any:
    """Loss angle of the bending of a blade, rad, of the shape of omega (rad/s).

    A blade is much wider than its thickness t, so the strain e ~ y at its surface is that of its
    two faces: mu S/V = 2 (t/2)^2/(t^3/12) = 6/t. The static stress averages to zero across the
    thickness, so the tension does not enter.
    """
    losses, thickness = blade.losses, blade.thickness
    if losses is None:
        return blade.angle + 0.0 * np.asarray(omega)
    ratio = 6 / thickness if thickness > 0 else 0.0
    strength = _thermoelastic(losses, thickness, False, omega, blade.temperature)
    return _bulk_and_surface(losses, omega, ratio) + strength * losses.expansion**2


def bending_ratio(section: Section, plane: int) -> float:
    """mu S/V of bending, 1/m.

    e ~ y, the distance from the neutral line. Round: (pi r^3)/(pi r^4/4) = 4/r. Ribbon of depth d
    in the plane and breadth b: two faces b (d/2)^2 each and two edges d^3/12 each, over b d^3/12:
    6/d + 2/b.
    """
    depth, breadth = section.depth[plane], section.depth[1 - plane]
    return 8 / depth if section.round else 6 / depth + 2 / breadth


def stretching_ratio(section: Section) -> float:
    """mu S/V of stretching, 1/m: circumference over area, 2/r or 2/w + 2/t, as e is uniform."""
    return 4 / section.depth[0] if section.round else 2 / section.depth[0] + 2 / section.depth[1]


def twisting_ratio(section: Section) -> float:
    """mu S/V of twisting, 1/m.

    Round: e ~ r', so (2 pi r^3)/(pi r^4/2) = 4/r. Rectangle w x t, w >= t: the shear is the
    gradient of Prandtl's function f (f_xx + f_yy = -2, f = 0 on the boundary), whose square
    integrates to J over the area. On the two short edges together the series of St Venant's problem
    gives S = 64 t^3/pi^4 times the sum over odd n of tanh^2(n pi w/2t)/n^4. For the long edges (L)
    Rellich's identity, here: the integral of (x.n) f_n^2 along the boundary is 4 J, gives
    w S/2 + t L/2 = 4 J. The ratio (S + L)/J tends to 6/t for a thin ribbon.
    """
    if section.round:
        return 8 / section.depth[0]
    w, t = max(section.depth), min(section.depth)
    # tanh^2 = 1 - sech^2: the sum of 1/n^4 over odd n is pi^4/96, the rest decays as exp(-n pi w/t)
    sech2 = sum(
        math.cosh(min(n * math.pi * w / (2 * t), 300.0)) ** -2 / n**4 for n in range(1, 16, 2)
    )
    short = 64 * t**3 / math.pi**4 * (math.pi**4 / 96 - sech2)
    constant = rectangle_torsion(w, t)
    return (short + (8 * constant - w * short) / t) / constant


def relaxation(phase: Any, order: float) -> Any:
    """Im g: thermoelastic loss angle over its strength Delta.

    Parameters
    ----------
    phase : array
        w h^2/D, with h half the depth of the section and D its diffusivity; complex for the
        analytic continuation.
    order : float
        n: 1 for a round wire, 1/2 for a ribbon or blade.
    """
    if np.iscomplexobj(phase):  # Im g = (g(i p) - g(-i p))/2i for real p, and so for all
        return (_moment(1j * phase, order) - _moment(-1j * phase, order)) / 2j
    return _moment(1j * phase, order).imag


def _moment(x2: Any, order: float) -> Any:
    """g = v/(v + c) up to |x| = `MIDDLE`, g - 1 = -c/(v + c) beyond, with c = 2 (n + 1)."""
    from scipy import special  # 0.1 s, which designs without thermoelastic loss do not need

    x = np.sqrt(x2)
    size = np.abs(x)
    near = np.where((size < LEAST) | (size > MOST), np.where(size < LEAST, LEAST, MOST), x)
    # both Bessel functions scaled by exp(-Re x): nothing overflows
    ratio = special.ive(order + 2, near) / special.ive(order + 1, near)
    ratio = np.where(size > MOST, 1 - (order + 1.5) / np.where(size > MOST, x, 1.0), ratio)
    c, v = 2 * (order + 1), x2 + np.where(size < LEAST, x2 / LEAST, x) * ratio
    return np.where(size < MIDDLE, v, -c) / (v + c)


def _bulk_and_surface(losses: Losses, omega: Any, ratio: float) -> Any:
    """Loss angle of bulk and surface for mu S/V = `ratio` in 1/m."""
    return _bulk(losses, omega) * (1 + losses.surface_depth * ratio)


def _bulk(losses: Losses, omega: Any) -> Any:
    """Loss angle of the bulk: a constant, or a table, linear in log f and log angle, constant
    beyond its ends.
    """
    if losses.table is None:
        return losses.angle + 0.0 * np.asarray(omega)
    frequency, angle = losses.table
    inside = np.clip(np.real(omega) / (2 * math.pi), frequency[0], frequency[-1])
    return np.exp(np.interp(np.log(inside), np.log(frequency), np.log(angle)))


def _thermoelastic(
    losses: Losses, depth: float, is_round: bool, omega: Any, temperature: Any
) -> Any:
    """Thermoelastic loss angle over a^2, K^2; 0 where heat capacity, conductivity or depth is
    unknown.
    """
    if not (losses.heat_capacity > 0 and losses.conductivity > 0 and depth > 0):
        return 0.0 * (np.asarray(omega) + temperature)
    capacity = losses.density * losses.heat_capacity
    strength = losses.youngs_modulus * temperature / capacity
    phase = np.asarray(omega) * (capacity * (depth / 2) ** 2 / losses.conductivity)
    return strength * relaxation(phase, 1.0 if is_round else 0.5)
