"""Materials built in, with their sources, and what a design makes of them.

A `[materials.NAME]` table in a design overrides single values of a built-in material or adds a new one.
Values are for room temperature.
"""

from __future__ import annotations

import msgspec

from suspension_cli.design.schema import Design, Material

BUILT_IN: dict[str, Material] = {
    "steel302": Material(
        youngs_modulus=1.7e11,
        poisson_ratio=0.3,
        density=7900.0,
        source="E: Husman et al., Rev. Sci. Instrum. 71, 2546 (2000), section 4c, measured on an 8 m wire; others: ASM Metals Handbook, AISI 302",
    ),
    "c70steel": Material(
        youngs_modulus=2.12e11,
        poisson_ratio=0.29,
        density=7800.0,
        source="pygwinc (LIGO Laboratory), C70 steel wire of the Advanced LIGO suspensions",
    ),
    "maraging": Material(
        youngs_modulus=1.87e11,
        poisson_ratio=0.3,
        density=7800.0,
        source="pygwinc (LIGO Laboratory), maraging steel blades of the Advanced LIGO suspensions",
    ),
    "fused-silica": Material(
        youngs_modulus=7.2e10,
        poisson_ratio=0.17,
        density=2200.0,
        source="pygwinc (LIGO Laboratory), fused silica fibres",
    ),
    "silicon": Material(
        youngs_modulus=1.558e11,
        poisson_ratio=0.27,
        density=2330.0,
        source="pygwinc (LIGO Laboratory), silicon ribbons",
    ),
    "sapphire": Material(
        youngs_modulus=4.0e11,
        poisson_ratio=0.29,
        density=3980.0,
        source="Uchiyama et al., Phys. Lett. A 273, 310 (2000) and the handbook values quoted there",
    ),
    "tungsten": Material(
        youngs_modulus=4.11e11,
        poisson_ratio=0.28,
        density=19300.0,
        source="CRC Handbook of Chemistry and Physics, elements",
    ),
    "aluminium": Material(
        youngs_modulus=6.9e10,
        poisson_ratio=0.33,
        density=2700.0,
        source="CRC Handbook of Chemistry and Physics, elements",
    ),
}


def resolve(design: Design, name: str) -> Material:
    """The material called `name` in this design: the design's own values over the built-in ones."""
    own = design.materials.get(name, Material())
    base = BUILT_IN.get(name, Material())
    given = {key: value for key, value in msgspec.structs.asdict(own).items() if value not in (None, "")}
    return msgspec.structs.replace(base, **given)


def known(design: Design) -> list[str]:
    """Names that wires and blades of this design may use."""
    return sorted({*BUILT_IN, *design.materials})
