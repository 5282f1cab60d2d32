"""Materials used at temperatures at which their properties are not known."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from suspension_cli.design import heat_flow, materials
from suspension_cli.design.locked_stages import as_in_file
from suspension_cli.design.materials import Bulk, Thermoelastic
from suspension_cli.design.schema import Design, Stage
from suspension_cli.design.wires import WireSet, list_temperatures, stretches
from suspension_cli.errors import Fault
from suspension_cli.models import registry

THERMAL = ("thermal_expansion", "modulus_slope", "specific_heat", "thermal_conductivity")
"""Properties that thermoelastic loss needs."""


@dataclass(frozen=True)
class Use:
    """A material in a part of a design, at a temperature (K).

    Attributes
    ----------
    bulk
        Whether the material's loss of bulk and surface counts there; a part may have a loss angle
        of its own.
    stiffness
        Whether its Young's modulus counts there.
    conducts
        Whether all that counts there is the heat that it conducts, with `[heat]`.
    """

    material: str
    temperature: float
    part: str
    bulk: bool = True
    stiffness: bool = True
    conducts: bool = False


def list_uses(design: Design) -> Iterator[Use]:
    """List the materials of wires, blades, springs and links, and where these are used."""
    ambient = design.constants.temperature
    for stage in design.stage:
        yield from _wires(design, stage)
        for blade in stage.blade_tables:
            if blade.made_of is not None:
                part = f"{stage.name}.{getattr(blade, 'name', 'blades')}"
                temperature = blade.temperature or ambient
                by_itself = blade.loss_angle is None
                shaped = blade.geometry is not None
                yield Use(blade.made_of, temperature, part, by_itself, stiffness=shaped)
        for spring in stage.spring:
            if spring.made_of is not None:
                temperature = spring.temperature or ambient
                by_itself = spring.loss_angle is None
                part = f"{stage.name}.springs"
                yield Use(spring.made_of, temperature, part, by_itself, stiffness=False)
    for link in design.link:
        if link.made_of is not None:
            by_itself = link.loss_angle is None
            yield Use(link.made_of, ambient, f"{link.name}.link", by_itself)


def _wires(design: Design, stage: Stage) -> Iterator[Use]:
    """List the materials of the wires of a stage, where coldest and where warmest."""
    for number, wire in enumerate(stage.wire_tables, 1):
        part = f"{stage.name}.{'wires' if isinstance(wire, WireSet) else number}"
        along = [kelvin for _, kelvin in list_temperatures(wire)]
        along = along or [design.constants.temperature]
        names = [wire.material, *(piece.material for piece in stretches(wire, 1.0))]
        for name in dict.fromkeys(name for name in names if name is not None):
            for temperature in sorted({min(along), max(along)}):
                yield Use(name, temperature, part)


def _conductors(design: Design) -> Iterator[Use]:
    """List the materials that conduct heat, at locked stages too, where coldest and warmest."""
    flow = heat_flow.solve(as_in_file(design))
    if flow is None:
        return
    for one in flow.conductors:
        profile = flow.profile(one)
        along = [kelvin for _, kelvin in profile] if isinstance(profile, list) else [profile]
        for name in dict.fromkeys(piece.material for piece in one.pieces):
            for temperature in sorted({min(along), max(along)}):
                yield Use(name, temperature, one.label, conducts=True)


def find_unknown_temperatures(design: Design, level: str) -> list[Fault]:
    """Find materials at temperatures at which properties are unknown that the model `level` needs.

    One fault per material: where it is used at which of these temperatures, the properties, the
    losses that are wrong, the remedy.
    """
    bends = registry.by_name(level).bends_wires
    uses: dict[tuple[str, float], list[Use]] = {}
    for use in [*list_uses(design), *_conductors(design)]:
        uses.setdefault((use.material, use.temperature), []).append(use)
    unknown: dict[str, _Unknown] = {}
    for (name, temperature), own in uses.items():
        needed = _needed(design, name, own, bends)
        for key, problem in materials.find_unknown(design, name, temperature):
            if key in needed:
                one = unknown.setdefault(name, _Unknown())
                one.uses.update(dict.fromkeys(own))
                one.keys.setdefault(problem, {})[key] = None
                one.effects.update(dict.fromkeys(needed[key]))
    return [one.fault(name) for name, one in unknown.items()]


@dataclass(frozen=True)
class _Unknown:
    """What is unknown of a material: its uses, properties by problem, and what is wrong then."""

    uses: dict[Use, None] = field(default_factory=dict)
    keys: dict[str, dict[str, None]] = field(default_factory=dict)
    effects: dict[str, None] = field(default_factory=dict)

    def fault(self, name: str) -> Fault:
        """Describe it."""
        parts = ", ".join(dict.fromkeys(use.part for use in self.uses))
        ends = sorted({use.temperature for use in self.uses})
        at = " to ".join(dict.fromkeys([f"{ends[0]:g}", f"{ends[-1]:g}"]))
        ranges = "; ".join(f"{', '.join(own)} {problem}" for problem, own in self.keys.items())
        *others, last = self.effects
        wrong = ", ".join(others) + " and " * bool(others) + last
        size = "some per cent" if wrong == "stiffness" else "orders of magnitude"
        problem = (
            f"used at {at} K ({parts}), but {ranges}; the nearest known values are used, so its"
            f" {wrong} may be wrong by {size}"
        )
        listed = {key for own in self.keys.values() for key in own}
        first = next(iter(next(iter(self.keys.values()))))
        example = f"{first} = {{ temperature = [...], values = [...] }}"
        if listed == {"loss"}:
            example = "loss_angle = ..."
        remedy = f"give values for {at} K in [materials.{name}], for example {example}"
        return Fault(f"materials.{name}", problem, remedy)


def _needed(design: Design, name: str, uses: list[Use], bends: bool) -> dict[str, tuple[str, ...]]:
    """List the properties of a material that matter, and for what: key and effects."""
    material = materials.look_up(design, name)
    moving = [use for use in uses if not use.conducts]
    needed = dict[str, tuple[str, ...]]()
    if any(use.stiffness for use in moving):
        needed["youngs_modulus"] = ("stiffness",)
    if bends and moving and Thermoelastic.of(material, None) is not None:
        needed |= dict.fromkeys(THERMAL, ("thermoelastic loss",))
    if bends and Bulk.of(material, None) is not None and any(use.bulk for use in moving):
        has_surface = material.loss is not None and material.loss.surface_depth
        needed["loss"] = ("bulk and surface loss" if has_surface else "bulk loss",)
    if len(moving) < len(uses):
        others = needed.get("thermal_conductivity", ())
        needed["thermal_conductivity"] = (*others, "conducted heat")
    return needed
