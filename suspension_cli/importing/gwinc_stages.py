"""What gwinc's parameters say of each stage of a suspension, with the defaults that gwinc takes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from suspension_cli.errors import InputError, format_value
from suspension_cli.importing.yaml_blocks import Block

GRAVITY = 9.80665
"""Acceleration that gwinc takes, m/s^2."""
NAMES = ("test", "penultimate", "upper", "top")
"""Names of stages from the mirror up; further ones are numbered."""
MOST = 100
"""Most stages, and most wires of one."""
FIBRES = ("Round", "Tapered", "Ribbon")
MATERIAL = "the name of a material"
CONSTANTS = "the constants of this material"
RADIUS = "the radius of the wires in m"


@dataclass(frozen=True)
class Blades:
    """All blades of a stage, which carry its wires."""

    stiffness: float  # N/m
    thickness: float  # m
    material: str


@dataclass(frozen=True)
class Stage:
    """A stage, in SI units."""

    name: str
    mass: float
    length: float  # of its wires, as gwinc has it
    count: int  # of wires
    pieces: list[dict[str, Any]]  # sections of a wire from the top; the middle one is the longest
    materials: tuple[str, str]  # of the upper and the lower half of a wire
    temperature: tuple[float, float]  # of the upper and the lower end of a wire
    bending_length: float  # sqrt(E I / T) of a wire at its ends
    blades: Blades | None
    dilution: float  # nan if it is not given
    path: str  # of its block in the file
    is_mirror: bool


def read_stages(suspension: Block) -> list[Stage]:
    """Read the stages from the top to the mirror; raises `InputError`."""
    blocks = [*suspension.blocks("Stage", "the stages, from the mirror up", MOST)]
    masses = [block.number("Mass", "the mass in kg") for block in blocks]
    temperatures = _temperatures(suspension, blocks)
    stages = []
    for place, block in enumerate(blocks):
        weight = sum(masses[: place + 1]) * GRAVITY
        stages.append(_stage(suspension, block, place, weight, temperatures[place]))
    return stages[::-1]


def _stage(
    suspension: Block, block: Block, place: int, weight: float, temperature: tuple[float, float]
) -> Stage:
    """Read the stage at a place from the mirror up, whose wires carry a weight in N."""
    is_mirror = place == 0
    radius = block.number_or_nan("WireRadius", f"{RADIUS}, or .nan for that of FiberType")
    if is_mirror:
        pieces = _fibre(suspension, radius)
    else:
        pieces = [{"radius": block.number("WireRadius", RADIUS)}]
    count = _wire_count(block)
    materials = _wire_materials(block, "Silica" if is_mirror else "C70Steel")
    constants = suspension.block(materials[0], CONSTANTS)
    modulus = constants.number("Y", "Young's modulus in Pa")
    bending_stiffness = modulus * _second_moment(pieces[0])
    return Stage(
        name=NAMES[place] if place < len(NAMES) else f"stage{place + 1}",
        mass=block.number("Mass", "the mass in kg"),
        length=block.number("Length", "the length of the wires in m"),
        count=count,
        pieces=pieces,
        materials=materials,
        temperature=temperature,
        bending_length=math.sqrt(bending_stiffness * count / weight),
        blades=_blades(block),
        dilution=_dilution(block),
        path=block.path,
        is_mirror=is_mirror,
    )


def _temperatures(suspension: Block, blocks: list[Block]) -> list[tuple[float, float]]:
    """Temperatures of the upper and lower ends of wires, from the mirror up.

    All ends at a body have the temperature of its stage. That of the whole suspension is the one of
    the support, and of stages without one.
    """
    wanted = "a temperature in K, here or in the block Suspension"
    general = suspension.number("Temp", wanted) if "Temp" in suspension else None
    bodies = [
        general if general and "Temp" not in block else block.number("Temp", wanted)
        for block in blocks
    ]
    above = [*bodies[1:], general or bodies[-1]]
    return list(zip(above, bodies, strict=True))


def _wire_count(block: Block) -> int:
    wanted = f"the number of wires, 1 to {MOST}"
    count = block.number("NWires", wanted)
    if count != int(count) or count > MOST:
        problem = f"is not a whole number up to {MOST}"
        raise InputError.of(block.at("NWires"), problem, f"give {wanted}", format_value(count))
    return int(count)


def _wire_materials(block: Block, default: str) -> tuple[str, str]:
    ends = ("WireMaterialUpper", "WireMaterialLower")
    if all(end in block for end in ends):
        upper, lower = (block.text(end, MATERIAL) for end in ends)
        return upper, lower
    both = block.text("WireMaterial", MATERIAL) if "WireMaterial" in block else default
    return both, both


def _fibre(suspension: Block, own_size: float) -> list[dict[str, Any]]:
    """Sections of the fibres of the mirror; `own_size` is the radius or width of its stage."""
    kinds = f"one of {', '.join(FIBRES)}"
    kind = suspension.text("FiberType", kinds)
    if kind not in FIBRES:
        path = suspension.at("FiberType")
        raise InputError.of(path, "is no kind of fibre", f"give {kinds}", format_value(kind))
    if kind == "Ribbon":
        ribbon = suspension.block("Ribbon", "the width and thickness of the ribbons")
        thickness = ribbon.number("Thickness", "the thickness of the ribbons in m")
        width = own_size
        if math.isnan(width):
            width = ribbon.number("Width", "the width of the ribbons in m")
        return [{"section": {"width": width, "thickness": thickness}}]
    fibre = suspension.block("Fiber", "the radius of the fibres")
    radius = own_size
    if math.isnan(radius):
        radius = fibre.number("Radius", "the radius of the fibres in m")
    if kind == "Round":
        return [{"radius": radius}]
    end = {
        "length": fibre.number("EndLength", "the length of the thick ends in m"),
        "radius": fibre.number("EndRadius", "the radius of the thick ends in m"),
    }
    return [end, {"radius": radius}, end]


def _second_moment(piece: dict[str, Any]) -> float:
    """Second moment of area of a cross-section, for bending along the beam, m^4."""
    if "section" in piece:
        return piece["section"]["width"] * piece["section"]["thickness"] ** 3 / 12
    return math.pi / 4 * piece["radius"] ** 4


def _blades(block: Block) -> Blades | None:
    stiffness = block.number_or_nan("K", "the stiffness of all blades in N/m, or .nan")
    if math.isnan(stiffness):
        return None
    thickness = block.number("Blade", "the thickness of the blades in m")
    material = "MaragingSteel"
    if "BladeMaterial" in block:
        material = block.text("BladeMaterial", MATERIAL)
    return Blades(stiffness, thickness, material)


def _dilution(block: Block) -> float:
    wanted = "the dilution, or .nan"
    return block.number_or_nan("Dilution", wanted) if "Dilution" in block else math.nan
