"""Designs from the block `Suspension` of gwinc's parameters, the noise budgets of LIGO.

gwinc has two chains of masses on springs, one along the beam and one vertical, without rotations.
Along the beam the mirror hangs on wires with mass that are clamped at both ends, `Length` apart,
and a stage above it on a pendulum of the length `Length` whose loss is that of wires that bend over
sqrt(E I / T) at both ends. Vertical springs are the blades `K` (of all wires of a stage together),
at the mirror in series with the wires. Stages are listed from the mirror up.

So here the wires of the mirror end at their clamps, and those above it at their bending points.
Sizes of bodies and places of wires are not in the file and are chosen: all bending points are close
to the centres of mass, so that a motion along the beam turns the bodies little.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from suspension_cli.errors import InputError, attribute_faults_to
from suspension_cli.importing import yaml_blocks
from suspension_cli.importing.gwinc_stages import CONSTANTS, GRAVITY, Stage, read_stages
from suspension_cli.importing.imported import Imported, plain, table, with_notes, word
from suspension_cli.importing.yaml_blocks import Block

GWINC_EARTH = 6.3781e6
"""Radius of the Earth by which gwinc divides the length of an arm, m."""
EARTH = 6.371e6
"""Radius of the Earth with which `--arm` makes an angle of a length, m."""
HEIGHT = 0.001
"""Distance of bending points from the centres of mass, towards the other end of the wire, m."""
NARROW = 0.1
"""Half separation of wires along the beam over the radius of the body that they carry."""
PROPERTIES = {
    "youngs_modulus": ("Y", "Young's modulus in Pa"),
    "density": ("Rho", "the density in kg/m^3"),
    "thermal_expansion": ("Alpha", "the thermal expansion in 1/K"),
    "modulus_slope": ("dlnEdT", "the slope of Young's modulus in 1/K"),
    "specific_heat": ("C", "the specific heat in J/(kg K)"),
    "thermal_conductivity": ("K", "the thermal conductivity in W/(m K)"),
}
"""Keys of materials here and in gwinc, both in SI units, and what they are."""
SIGNED = ("Alpha", "dlnEdT")
"""Those that may be below 0."""


def read(file: Path, name: str, reference: str = "") -> Imported:
    """Read parameters of gwinc and convert their suspension into a design of the given name.

    `reference` says where the file comes from (default its name). Raises `InputError` if the file
    is no YAML, has no suspension, lacks a key, or gives no valid design.
    """
    with attribute_faults_to(str(file)):
        parameters = yaml_blocks.read(file, "parameters of gwinc (ifo.yaml)")
        if "+inherit" in parameters:
            problem = "makes gwinc take the rest from another budget"
            remedy = f"write all in one file: gwinc --yaml {file} > whole.yaml"
            raise InputError.of("+inherit", problem, remedy)
        head = {
            "name": name,
            "title": f"Suspension {name} of gwinc",
            "reference": plain(reference or file.name, 300),
        }
        found = _convert(parameters, head)
        found.source()
    return found


def _convert(parameters: Block, head: dict[str, str]) -> Imported:
    suspension = parameters.block("Suspension", "the suspension, as in gwinc's ifo.yaml")
    stages = read_stages(suspension)
    mirror = stages[-1]
    radius, length, origin_of_size = _mirror_size(parameters, suspension, mirror)
    default = stages[0].temperature[0]
    lines = table("design", head)
    lines += table("constants", {"gravity": GRAVITY, "temperature": default})
    for material in _materials(stages):
        lines += _material(suspension.block(material, CONSTANTS), material)
    for stage in stages:
        scale = (stage.mass / mirror.mass) ** (1 / 3)
        lines += _stage(stage, _rounded(radius * scale), _rounded(length * scale), default)
    notes = [
        f"bodies: cylinders; the mirror's size is {origin_of_size}, and the others have its density"
        " and proportions, though they may overlap",
        "places of wires: vertical; t1 and t2 are the radius of the body that hangs on them, s is"
        f" {NARROW:g} of it; bending points are {HEIGHT * 1e3:g} mm from the centres of mass",
        "number of blades: one for each wire, with K / NWires",
        "Poisson's ratio of all materials: 0.3, for twisting alone",
        *_differences(stages, suspension),
    ]
    command = "thermal {file}"
    if angle := _beam_angle(parameters, suspension):
        command += f" --arm {2 * EARTH * angle:.0f}"
        notes.append(
            f"angle between the beam and the horizontal: {angle:.4g} rad in gwinc; a design has"
            f" none, so give it as an option: pendsus {command.format(file='FILE')}"
        )
    origin = "from parameters of gwinc, whose bodies do not rotate."
    heading = "Chosen here, as it is not in the file, or otherwise than in gwinc:"
    return Imported(with_notes(origin, heading, notes, lines), notes, {}, command)


def _materials(stages: list[Stage]) -> list[str]:
    """Names of the materials of all wires and blades, each once."""
    wires = [material for stage in stages for material in stage.materials]
    blades = [stage.blades.material for stage in stages if stage.blades]
    return [*dict.fromkeys(wires + blades)]


def _material(block: Block, name: str) -> list[str]:
    keys: dict[str, Any] = {
        key: block.number(own, wanted, signed=own in SIGNED)
        for key, (own, wanted) in PROPERTIES.items()
    }
    keys["loss"] = {
        "angle": block.number("Phi", "the loss angle", signed=True),
        "surface_depth": _surface_depth(block),
    }
    return table(f"materials.{word(name, 'material')}", keys)


def _surface_depth(block: Block) -> float:
    """Depth that would dissipate as much as the surface, m; 0 if it is not given, as in gwinc."""
    if "Dissdepth" not in block:
        return 0.0
    return block.number("Dissdepth", "the depth of surface loss in m", signed=True)


def _mirror_size(parameters: Block, suspension: Block, mirror: Stage) -> tuple[float, float, str]:
    """Radius and length of the mirror in m, and where they are from."""
    optics = parameters.values.get("Materials")
    if isinstance(optics, dict) and "MassRadius" in optics:
        block = parameters.block("Materials", "the size of the mirror")
        radius = block.number("MassRadius", "the radius of the mirror in m")
        length = block.number("MassThickness", "the thickness of the mirror in m")
        return radius, length, "that of the block Materials"
    material = mirror.materials[0]
    density = suspension.block(material, CONSTANTS).number("Rho", "the density in kg/m^3")
    radius = (mirror.mass / (math.pi * density)) ** (1 / 3)
    return radius, radius, f"that of solid {plain(material)}, as long as its radius"


def _stage(stage: Stage, radius: float, length: float, default: float) -> list[str]:
    """Tables of a stage; its body has a radius and length, `default` is the usual temperature."""
    body = {"shape": "cylinder", "axis": "x", "radius": radius, "length": length}
    lines = table("[stage]", {"name": stage.name, "body": body | {"mass": stage.mass}})
    height = HEIGHT - stage.bending_length if stage.is_mirror else HEIGHT
    wires = {"count": stage.count, "l": stage.length} | _places(stage.count, radius)
    wires |= {"d": height, "d_upper": height} | _composition(stage)
    wires |= {} if stage.is_mirror else {"clamp": "bending-point"}
    upper, lower = stage.temperature
    if upper != lower:
        wires["temperature"] = {"upper": upper, "lower": lower}
    elif upper != default:
        wires["temperature"] = upper
    lines += table("stage.wires", wires)
    if stage.blades:
        keys: dict[str, Any] = {
            "count": stage.count,
            "stiffness": stage.blades.stiffness / stage.count,
            "material": word(stage.blades.material, "material"),
            "thickness": stage.blades.thickness,
        }
        keys |= {} if upper == default else {"temperature": upper}
        lines += table("stage.blades", keys)
    return lines


def _places(count: int, radius: float) -> dict[str, float]:
    """Places of the ends of wires, on a body of this radius."""
    across = {"t1": radius, "t2": radius}
    along = {"s": _rounded(NARROW * radius)}
    grids: dict[int, dict[str, float]] = {1: {}, 2: across, 4: along | across}
    return grids.get(count, {"ring": radius})


def _composition(stage: Stage) -> dict[str, Any]:
    """Materials and sections of the wires of a stage."""
    upper, lower = (word(material, "material") for material in stage.materials)
    pieces = stage.pieces
    if upper == lower:
        return {"material": upper} | (pieces[0] if len(pieces) == 1 else {"sections": pieces})
    middle = len(pieces) // 2
    ends = sum(piece.get("length", 0.0) for piece in pieces)
    half = {"length": (stage.length - ends) / 2} | pieces[middle]
    above = [piece | {"material": upper} for piece in [*pieces[:middle], half]]
    below = [piece | {"material": lower} for piece in pieces[middle:]]
    return {"sections": above + below}


def _differences(stages: list[Stage], suspension: Block) -> Iterator[str]:
    """Say what gwinc has otherwise."""
    for stage in stages:
        if not (stage.is_mirror or math.isnan(stage.dilution)):  # gwinc has none for the mirror
            yield (
                f"{stage.path}.Dilution = {stage.dilution:g} is left out: these wires, which bend"
                f" over sqrt(E I / T), have {stage.length / stage.bending_length:.3g}"
            )
    for material in dict.fromkeys(stage.blades.material for stage in stages if stage.blades):
        if _surface_depth(suspension.block(material, CONSTANTS)):
            yield f"blades of {plain(material)} have its surface loss, which gwinc leaves out"


def _beam_angle(parameters: Block, suspension: Block) -> float:
    """Angle in rad between the beam and the horizontal that gwinc takes; 0 if it has none."""
    if "VHCoupling" in suspension:
        coupling = suspension.block("VHCoupling", "the angle theta of the beam")
        return abs(coupling.number("theta", "the angle of the beam in rad", signed=True))
    if "Infrastructure" in parameters:
        arm = parameters.block("Infrastructure", "the length of the arms")
        return arm.number("Length", "the length of the arms in m") / GWINC_EARTH
    return 0.0


def _rounded(value: float) -> float:
    """Round a chosen number to three digits."""
    return float(f"{value:.3g}")
