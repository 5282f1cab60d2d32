"""Built-in materials with their sources, and the values that a design overrides.

A `[materials.NAME]` table in a design overrides single values of a built-in material or adds a new
one. Values are for room temperature.
"""

from __future__ import annotations

from typing import Any

import msgspec

from suspension_cli.design.losses.registry import MECHANISMS
from suspension_cli.design.schema import Design, Material, MaterialLoss

PYGWINC = "pygwinc (LIGO Laboratory, parameters of Advanced LIGO)"

BUILT_IN: dict[str, Material] = {
    "steel302": Material(
        youngs_modulus=1.7e11,
        poisson_ratio=0.3,
        density=7900.0,
        thermal_expansion=17.2e-6,
        specific_heat=500.0,
        thermal_conductivity=16.2,
        tensile_strength=2.07e9,
        source=(
            "E: Husman et al., Rev. Sci. Instrum. 71, 2546 (2000), section 4c, measured on an 8 m"
            " wire; others: ASM Metals Handbook, AISI 302; strength: ASTM A313, spring wire of type"
            " 302 up to 0.5 mm thick (at least 300 ksi; annealed or thicker wire breaks earlier)"
        ),
    ),
    "c70steel": Material(
        youngs_modulus=2.12e11,
        poisson_ratio=0.29,
        density=7800.0,
        thermal_expansion=12e-6,
        modulus_slope=-2.5e-4,
        specific_heat=486.0,
        thermal_conductivity=49.0,
        tensile_strength=1.98e9,
        loss=MaterialLoss(angle=2e-4),
        source=(
            f"{PYGWINC}, C70 steel wire; strength: EN 10270-1, patented cold drawn spring wire of"
            " class SM, the least of 1 mm thick wire (2.37 GPa at 0.3 mm; thicker wire breaks"
            " earlier)"
        ),
    ),
    "maraging": Material(
        youngs_modulus=1.87e11,
        poisson_ratio=0.3,
        density=7800.0,
        thermal_expansion=11e-6,
        specific_heat=460.0,
        thermal_conductivity=20.0,
        tensile_strength=1.7e9,
        loss=MaterialLoss(angle=1e-4),
        source=(
            f"{PYGWINC}, maraging steel blades; strength: the least 0.2 % proof stress of 18 %"
            " nickel steel as most commonly used, Rao and Sivasubramanian, Mater. Sci. Appl. 2,"
            " 1116 (2011), above which blades yield"
        ),
    ),
    "fused-silica": Material(
        youngs_modulus=7.2e10,
        poisson_ratio=0.17,
        density=2200.0,
        thermal_expansion=3.9e-7,
        modulus_slope=1.52e-4,
        specific_heat=772.0,
        thermal_conductivity=1.38,
        tensile_strength=3.7e9,
        loss=MaterialLoss(angle=4.1e-10, surface_depth=1.5e-2),
        source=(
            f"{PYGWINC}, fused silica fibres; strength: the best of the ribbons of Heptonstall et"
            " al., Phys. Lett. A 354, 353 (2006), a scratched fibre has far less; losses after"
            " Gretarsson and Harry, Rev. Sci. Instrum. 70, 4081 (1999), and Penn et al., Phys."
            " Lett. A 352, 3 (2006)"
        ),
    ),
    "silicon": Material(
        youngs_modulus=1.558e11,
        poisson_ratio=0.27,
        density=2330.0,
        thermal_expansion=2.6e-6,
        modulus_slope=-6.7e-5,
        specific_heat=712.0,
        thermal_conductivity=148.0,
        source=(
            "pygwinc (LIGO Laboratory), silicon ribbons; specific heat and conductivity: Kutz"
            " (ed.), Mechanical Engineers' Handbook, vol. 4, at 300 K; expansion: Ioffe Institute,"
            " NSM archive; slope: Gysin et al., Phys. Rev. B 69, 045403 (2004), E = E0 - B T"
            " exp(-T0/T) at 290 K"
        ),
    ),
    "sapphire": Material(
        youngs_modulus=4.0e11,
        poisson_ratio=0.29,
        density=3980.0,
        thermal_expansion=5.0e-6,
        specific_heat=790.0,
        thermal_conductivity=40.0,
        source=(
            "Uchiyama et al., Phys. Lett. A 273, 310 (2000) and the handbook values quoted there; "
            "thermal values: Braginsky et al., Phys. Lett. A 264, 1 (1999)"
        ),
    ),
    "tungsten": Material(
        youngs_modulus=4.11e11,
        poisson_ratio=0.28,
        density=19300.0,
        thermal_expansion=4.5e-6,
        specific_heat=132.0,
        thermal_conductivity=174.0,
        source="CRC Handbook of Chemistry and Physics, elements",
    ),
    "aluminium": Material(
        youngs_modulus=6.9e10,
        poisson_ratio=0.33,
        density=2700.0,
        thermal_expansion=23.1e-6,
        specific_heat=897.0,
        thermal_conductivity=237.0,
        source="CRC Handbook of Chemistry and Physics, elements",
    ),
}
"""Values that are not well known are left out. Loss angles are in `loss` alone, which acts where
wires bend (`beam`, `violin`): strings have no loss unless a design gives one."""


def resolve(design: Design, name: str) -> Material:
    """Look up a material: the design's own values, then built-in ones, all losses in `loss`."""
    own = design.materials.get(name, Material())
    base = BUILT_IN.get(name, Material())
    given = {
        key: value for key, value in msgspec.structs.asdict(own).items() if value not in (None, "")
    }
    return msgspec.structs.replace(base, **given | {"loss": _loss(own, base)})


def _loss(own: Material, base: Material) -> MaterialLoss:
    """Merge the design's own losses with the built-in ones."""
    built_in = msgspec.structs.replace(base, loss=base.loss or MaterialLoss())
    values: dict[str, Any] = {}
    for mechanism in MECHANISMS:
        values |= mechanism.merge(own, built_in)
    return MaterialLoss(**values)


def constant_angle(design: Design, name: str) -> float:
    """Look up the constant loss angle that the design itself gives a material, rad; 0 if none.

    It is the only loss of a material in the string model.
    """
    own = design.materials.get(name, Material())
    given = (
        own.loss.angle if own.loss is not None and own.loss.angle is not None else own.loss_angle
    )
    return given or 0.0


def known(design: Design) -> list[str]:
    """List the names of materials that a design may use."""
    return sorted({*BUILT_IN, *design.materials})
