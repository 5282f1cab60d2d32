"""Cross-sections of wires: the properties that each has, of the circle and of the rectangle.

Nothing else depends on the shape. Bending in plane 0 moves the wire along the thickness of a ribbon
(its soft plane), in plane 1 along its width.

**Surface loss.**  A layer at the surface is lossier than the bulk. It adds phi_bulk d_s mu S/V to
the loss angle phi_bulk of the bulk, where the dissipation depth d_s is a property of the finish and

    mu S/V = (integral of e^2 over the surface) / (integral of e^2 over the volume)

for the strain e of the deformation (Gretarsson and Harry, Rev. Sci. Instrum. 70, 4081 (1999)). The
properties `..._ratio` give it for each deformation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import Inexact

    Spectrum = Inexact[np.ndarray, "*frequency"]
    Frequencies = Spectrum | complex
    """Angular frequencies or phases: real, or complex for the analytic continuation."""


@dataclass(frozen=True)
class CrossSection:
    """Cross-section of a uniform stretch of wire.

    The drag of a thin gas per length of wire is `faces` times that of a surface which moves along
    its normal plus `sides` times that of one which slides, per area and velocity: of motion in the
    two planes of bending and along the wire, m, and of rotation about its axis, m^3.
    """

    depth: tuple[float, float]  # size across the wire in the two planes of bending, m
    area: float = math.nan  # for stretching, m^2
    moments: tuple[float, float] = (math.nan, math.nan)  # second ones of area, of bending, m^4
    torsion: float = math.nan  # torsion constant J, m^4
    polar_area: float = math.nan  # I_p / A, m^2, by which tension resists torsion
    bulk: tuple[float, float] = (math.nan, math.nan)  # volume per length (m^2), polar moment
    twisting_ratio: float = math.nan  # mu S/V of twisting, 1/m
    faces: tuple[float, ...] = (math.nan,) * 4
    sides: tuple[float, ...] = (math.nan,) * 4
    least_area: float = math.nan  # smallest along the wire, where stress is largest, m^2
    round: bool = False  # the same in all directions across the wire
    order: float = 0.5  # n of `relaxation`

    def bending_ratio(self, plane: int) -> float:
        """mu S/V of bending in one plane, 1/m.

        e ~ y, the distance from the neutral line. Of a ribbon with the depth d in the plane and the
        breadth b: two faces b (d/2)^2 each and two edges d^3/12 each, over b d^3/12: 6/d + 2/b. Of
        a round wire (pi r^3)/(pi r^4/4) = 8/d, the same for b = d.
        """
        return 6 / self.depth[plane] + 2 / self.depth[1 - plane]

    @property
    def stretching_ratio(self) -> float:
        """mu S/V of stretching, 1/m: circumference over area, as the strain is uniform."""
        return 2 / self.depth[0] + 2 / self.depth[1]

    def relaxation(self, phase: Frequencies) -> Spectrum:
        """Thermoelastic loss angle of bending in a plane over its strength Delta."""
        return relaxation(phase, self.order)

    def drag(self, normal: float, along: float) -> tuple[float, ...]:
        """Drag of a thin gas per length: in the two planes and along, N s/m^2, of rotation, N s.

        `normal` and `along` are that of a surface per area and velocity, N s/m^3.
        """
        pairs = zip(self.faces, self.sides, strict=True)
        return tuple(normal * face + along * side for face, side in pairs)


def circle(upper: float, lower: float) -> CrossSection:
    """Cross-section of a round wire: of its radii at both ends, m, as of a cone.

    It has the exact properties of the cone: the compliances of stretching, bending and twisting
    (each strained alone), and the mass with its polar moment. With r going linearly from a to b,

        mean of 1/r^2 = 1/(a b),    mean of 1/r^4 = (a^2 + a b + b^2)/(3 a^3 b^3),

    so its area is pi a b, its moments of area are those of the radius (mean of 1/r^4)^(-1/4), and
    its mass is that of the frustum. For twisting e ~ r', so mu S/V = (2 pi r^3)/(pi r^4/2) = 4/r.
    In a gas, half of the circumference counts as normal, half as tangential.
    """
    a = upper
    b = lower
    d = 2 * a if a == b else 2 * (3 * a**3 * b**3 / (a * a + a * b + b * b)) ** 0.25
    moment = math.pi * d**4 / 64
    across = math.pi / 2 * d
    powers = sum(a**n * b ** (4 - n) for n in range(5))
    return CrossSection(
        depth=(d, d),
        area=math.pi * a * b,
        moments=(moment, moment),
        torsion=2 * moment,
        polar_area=d**2 / 8,
        bulk=(math.pi * (a * a + a * b + b * b) / 3, math.pi / 10 * powers),
        twisting_ratio=8 / d,
        faces=(across, across, 0.0, 0.0),
        sides=(across, across, math.pi * d, math.pi / 4 * d**3),
        least_area=math.pi * min(a, b) ** 2,
        round=True,
        order=1.0,
    )


def taper(upper: float, lower: float, count: int) -> list[CrossSection]:
    """Cut a cone into steps of equal length, from the upper end.

    The spring constant is exact for any number of steps; the stiffness of bending under tension,
    which weights the places within a step differently, converges with the square of the step.
    """
    radii = [upper + (lower - upper) * n / count for n in range(count + 1)]
    return [circle(radii[n], radii[n + 1]) for n in range(count)]


def rectangle(width: float, thickness: float) -> CrossSection:
    """Cross-section of a ribbon: width along y, thickness along x, m.

    For twisting and w >= t: the shear is the gradient of Prandtl's function f (f_xx + f_yy = -2, f
    = 0 on the boundary), whose square integrates to J over the area. On the two short edges
    together the series of St Venant's problem gives S = 64 t^3/pi^4 times the sum over odd n of
    tanh^2(n pi w/2t)/n^4. For the long edges (L) Rellich's identity, here: the integral of (x.n)
    f_n^2 along the boundary is 4 J, gives w S/2 + t L/2 = 4 J. The ratio mu S/V = (S + L)/J tends
    to 6/t for a thin ribbon.
    """
    b = width
    d = thickness
    w = max(b, d)
    t = min(b, d)
    constant = rectangle_torsion(w, t)
    # tanh^2 = 1 - sech^2, and the sum of 1/n^4 over odd n is pi^4/96
    sech2 = sum(4 * e / ((1 + e) ** 2 * n**4) for n, e in _decays(w / t))
    short = 64 * t**3 / math.pi**4 * (math.pi**4 / 96 - sech2)
    return CrossSection(
        depth=(d, b),
        area=b * d,
        moments=(b * d**3 / 12, d * b**3 / 12),
        torsion=constant,
        polar_area=(b**2 + d**2) / 12,
        bulk=(b * d, b * d**3 / 12 + d * b**3 / 12),
        twisting_ratio=(short + (8 * constant - w * short) / t) / constant,
        faces=(2 * b, 2 * d, 0.0, (b**3 + d**3) / 6),
        sides=(2 * d, 2 * b, 2 * (b + d), b * d * (b + d) / 2),
        least_area=b * d,
    )


def plate(thickness: float) -> CrossSection:
    """Cross-section of a blade, much wider than thick, for its losses in bending.

    The strain e ~ y at its surface is that of its two faces: mu S/V = 2 (t/2)^2/(t^3/12) = 6/t. A
    thickness that is unknown, 0, stands for an infinite one: the loss is that of the bulk.
    """
    return CrossSection(depth=(thickness or math.inf, math.inf))


def rectangle_torsion(width: float, thickness: float) -> float:
    """Compute St Venant's torsion constant of a rectangle, m^4.

    J = w t^3/3 (1 - 192 t/(pi^5 w) sum over odd n of tanh(n pi w/2t)/n^5) for w >= t (Timoshenko
    and Goodier, Theory of Elasticity, section 109). The sum is 31 zeta(5)/32 minus that of (1 -
    tanh)/n^5, which converges to rounding in a few terms.
    """
    t, w = sorted((width, thickness))
    total = ODD_FIFTH - sum(2 * e / ((1 + e) * n**5) for n, e in _decays(w / t))
    return w * t**3 / 3 * (1 - 192 * t / (math.pi**5 * w) * total)


ODD_FIFTH = 31 * 1.0369277551433699 / 32
"""Sum of 1/n^5 over odd n: 31 zeta(5)/32."""


def _decays(ratio: float) -> list[tuple[int, float]]:
    """List odd n and exp(-2 x), x = n pi w/2t: 1 - tanh x and sech^2 x in small numbers."""
    return [(n, math.exp(-n * math.pi * ratio)) for n in range(1, 16, 2)]


def relaxation(phase: Frequencies, order: float) -> Spectrum:
    """Thermoelastic loss angle of bending over its strength Delta (see `materials`).

    Stretched material cools and compressed material warms; in a bent wire, heat flows from the
    compressed to the stretched side and back (Zener, Phys. Rev. 53, 90 (1938)). With theta the
    change of temperature across a wire that bends in y (scaled to be y where no heat flows), its
    surface insulated, and the diffusivity D = conductivity/(rho C),

        i w theta = D (theta_xx + theta_yy) + i w y,
        E (1 + Delta g),   g = (integral of y theta)/(integral of y^2),

    so the loss angle is Delta Im g. With h half the depth in y (the radius, or half the thickness)
    and x = h sqrt(i w/D) the solution is, for both shapes,

        g = v/(v + 2 (n + 1)),   v = x^2 + x I_(n+2)(x)/I_(n+1)(x),
        n = 1 (round), n = 1/2 (ribbon or blade),

    that is 1 - 4 J2(z)/(z^2 J1'(z)) with z = i x for a round wire, and 1 + (12/z^2)(1 - (2/z)
    tan(z/2)) with z = 2 i x for a ribbon (Lifshitz and Roukes, Phys. Rev. B 61, 5600 (2000)).
    Zener's single relaxation Delta w tau/(1 + w^2 tau^2), with tau = R^2/(1.8412^2 D) or t^2/(pi^2
    D), is 1 % more at low frequencies; far above its peak Im g exceeds it by 18 or 22 %.

    `phase` is w h^2/D, complex for the analytic continuation, and `order` n.
    """
    import numpy as np

    above = _moment(1j * np.asarray(phase), order)
    if not np.iscomplexobj(phase):
        return np.imag(above)
    below = _moment(-1j * np.asarray(phase), order)
    return (above - below) / 2j  # as Im g = (g(i p) - g(-i p))/2i for real p


FAST = 700.0
"""|x^2| beyond which the asymptotic series has all digits, and is quicker."""
TERMS = 24
"""Terms of that series: the next is below 1e-16."""
MIDDLE = 2.0
"""|x| below which g, and above which g - 1, is free of cancellation."""


@cache
def _asymptotic(order: float) -> tuple[float, ...]:
    """Coefficients of the series r = sum a_k/x^k of r = x q, see `_moment`, for large x.

    They follow from r' = 1 - r^2 - (2 n + 3) r/x.
    """
    a = [1.0]
    for k in range(1, TERMS):
        mixed = sum(a[i] * a[k - i] for i in range(1, k))
        a.append(-(mixed + (2 * order + 4 - k) * a[-1]) / 2)
    return tuple(a)


def _moment(x2: Spectrum, order: float) -> Spectrum:
    """g = v/(v + c) up to |x| = `MIDDLE`, g - 1 = -c/(v + c) beyond, with c = 2 (n + 1).

    v = x^2 (1 + q_(n+1)), by the continued fraction of the Bessel functions,
    q_m = I_(m+1)(x)/(x I_m(x)) = 1/(2 (m + 1) + x^2 q_(m+1)); for large x with the series of
    `_asymptotic`.
    """
    import numpy as np

    x2 = np.asarray(x2)
    fast = np.abs(x2) > FAST
    slow = np.where(fast, 0.0, x2)
    q = 0.0
    steps = 14 + int(1.5 * math.sqrt(np.abs(slow).max(initial=0.0)))  # for all digits
    for n in range(steps, 0, -1):
        q = 1 / (2 * (order + 1 + n) + slow * q)
    v = np.asarray(x2 * (1 + q))
    if fast.any():
        x = np.sqrt(x2[fast])
        v[fast] = x2[fast] + x * np.polynomial.polynomial.polyval(1 / x, _asymptotic(order))
    c = 2 * (order + 1)
    return np.where(np.abs(x2) < MIDDLE**2, v, -c) / (v + c)
