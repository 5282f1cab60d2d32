"""Loss angles of wires and blades against frequency: bulk, surface, thermoelastic.

Surface and thermoelastic loss depend on the cross-section: `design.cross_sections` derives both.
The strength of the thermoelastic one is Delta = E T a^2/(rho C).

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
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from suspension_cli.design.cross_sections.relaxation import FLAT, relaxation
from suspension_cli.scene.composition import BladeLoss, Losses, Section


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
    losses, shape = section.losses, section.shape
    bulk = _bulk_and_surface(losses, omega, shape.bending_ratio(plane))
    depth, relax = shape.depth[plane], shape.relaxation
    strength = _thermoelastic(losses, depth, relax, omega, temperature)
    slope = losses.modulus_slope / (losses.youngs_modulus * shape.area)
    return bulk, strength, losses.expansion, slope


def stretching_angle(section: Section, omega: Any) -> Any:
    """Loss angle of the stretching of a wire, rad, of the shape of omega (rad/s)."""
    return _bulk_and_surface(section.losses, omega, section.shape.stretching_ratio)


def twisting_angle(section: Section, omega: Any) -> Any:
    """Loss angle of the twisting of a wire, rad, of the shape of omega (rad/s)."""
    return _bulk_and_surface(section.losses, omega, section.shape.twisting_ratio)


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
    relax = partial(relaxation, order=FLAT)
    strength = _thermoelastic(losses, thickness, relax, omega, blade.temperature)
    return _bulk_and_surface(losses, omega, ratio) + strength * losses.expansion**2


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
    losses: Losses, depth: float, relax: Callable[[Any], Any], omega: Any, temperature: Any
) -> Any:
    """Thermoelastic loss angle over a^2, K^2; 0 where heat capacity, conductivity or depth is
    unknown.
    """
    if not (losses.heat_capacity > 0 and losses.conductivity > 0 and depth > 0):
        return 0.0 * (np.asarray(omega) + temperature)
    capacity = losses.density * losses.heat_capacity
    strength = losses.youngs_modulus * temperature / capacity
    phase = np.asarray(omega) * (capacity * (depth / 2) ** 2 / losses.conductivity)
    return strength * relax(phase)
