"""The numbers of a design by dotted path, and designs with one of them changed."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import msgspec

from suspension_cli.design import materials, paths, reader, ties
from suspension_cli.design.locked_stages import spell_out, undo
from suspension_cli.design.materials import AgainstTemperature, Material
from suspension_cli.design.paths import DISPLAYED, is_loss_angle, twins, unit_of
from suspension_cli.design.schema import Design
from suspension_cli.design.wires import CROSS_SECTIONS, stretches
from suspension_cli.errors import InputError, format_value, gather, suggest
from suspension_cli.models import registry

OTHER_TABLES = ("design", "analysis", "tolerance", "tie", "requirement")
"""Tables that do not describe the suspension and its control."""
NOT_CONTINUOUS = (
    "count",
    "steps",
    "temperature_range",
    "values",
    "profile",
    "real",
    "imaginary",
    "static",
)
"""Keys of numbers that are not varied: integers, ranges of temperatures, properties against them,
profiles of wires, and tables of links (which have a factor)."""
FIXED = re.compile(
    r"link\.[^.]+\.table\.frequency\.|control\..+(_noise\.|\.sections\.|\.rate$|\.range$)"
    r"|materials\..+\.temperature\.|.+\.temperature\.\d+\.1$"
)
"""Frequencies of a link's table; of control noise at several frequencies, sections of filters,
sample rates and ranges of drivers; temperatures of a material's properties, and places along a wire
of its temperatures."""
TWIST = "poisson_ratio"
"""Matters only where wires twist."""


class Parameter(NamedTuple):
    """One number of a design.

    `name` is a dotted path as ``--set`` takes it: ``stage.test.body.inertia.2``.
    """

    name: str
    value: float


def every(text: str, level: str = registry.STRING.name) -> tuple[Parameter, ...]:
    """List every number of a design that can change a little, with implied gravity and moduli.

    Those that are tied to others are left out.

    `text` is the design as TOML. In a model (`level`) where wires bend, the materials of all wires
    matter, including Poisson's ratio.
    """
    design = reader.parse(text)
    raw = tomllib.loads(text)
    tied = {path for name in ties.names(raw) for path in twins(name)}
    bends = registry.by_name(level).bends_wires
    found = [
        Parameter(name, number)
        for key, value in raw.items()
        if key not in OTHER_TABLES
        for name, number in paths.numbers(key, value, NOT_CONTINUOUS)
        if (bends or not name.endswith(TWIST)) and not FIXED.match(name)
        if name not in tied
    ]
    known = {item.name for item in found}
    gravity = design.constants.gravity
    implied = [Parameter("constants.gravity", gravity)] if isinstance(gravity, float) else []
    bent = _bent(design) if bends else set[str]()
    for name in sorted(_used(design) | bent):
        made = materials.resolve(design, name)
        assert made.youngs_modulus is not None
        implied.append(Parameter(f"materials.{name}.youngs_modulus", made.youngs_modulus))
        if name in bent and made.poisson_ratio is not None:
            implied.append(Parameter(f"materials.{name}.{TWIST}", made.poisson_ratio))
    return (*found, *(item for item in implied if item.name not in known))


def why_unknown(text: str, name: str, known: Iterable[str]) -> tuple[str, str]:
    """Say why a design (TOML) gives no number of a name that could vary, and what to do."""
    for tied in ties.names(tomllib.loads(text)):
        if name in twins(tied):
            return "follows from others, to which it is tied", "let one of those vary"
    return "the design gives no such number", f"add it to the design; {suggest(name, list(known))}"


def choose(numbers: Sequence[Parameter], vary: Sequence[str]) -> tuple[Parameter, ...]:
    """Take the numbers that dotted paths name, or that are below them; all if none is given.

    Raises `InputError`, which names ``--vary``, if a path names no number.

    >>> numbers = Parameter("stage.test.wires.l", 0.3), Parameter("constants.gravity", 9.8)
    >>> [one.name for one in choose(numbers, ["stage.test"])]
    ['stage.test.wires.l']
    """

    def find(path: str) -> list[Parameter]:
        found = [one for one in numbers if f"{one.name}.".startswith(f"{path}.")]
        if not found:
            remedy = suggest(path, [one.name for one in numbers])
            problem = "names no number of the design that can vary"
            raise InputError.of("--vary", problem, remedy, format_value(path))
        return found

    wanted = {one for some in gather(find, vary) for one in some}
    return tuple(one for one in numbers if not vary or one in wanted)


def _bent(design: Design) -> set[str]:
    """Materials of the wires, where these bend."""
    wires = (wire for stage in design.stage for wire in stage.wire_tables)
    pieces = (piece for wire in wires for piece in stretches(wire, 1.0))
    return {piece.material for piece in pieces if piece.material is not None}


def _used(design: Design) -> set[str]:
    """Materials whose Young's modulus matters in the string model."""
    wires = (wire for stage in design.stage for wire in stage.wire_tables)
    blades = (blade for stage in design.stage for blade in stage.blade_tables)
    named = {wire.material for wire in wires if wire.k is None and wire.material is not None}
    named |= {link.made_of for link in design.link if link.made_of is not None}
    return named | {blade.geometry.material for blade in blades if blade.geometry is not None}


def value_of(design: Design, name: str) -> Any:
    """Get a number of a design, or a list of them, by dotted path."""
    keys = name.split(".")
    if keys[0] == "materials":
        node = materials.resolve(design, keys[1])
        keys = keys[2:]
    else:
        node = undo(design)
    seen: list[Any] = []
    paths.changed(node, keys, lambda value: seen.append(value) or value)
    return seen[0]


def shifted(design: Design, name: str, by: float) -> Design:
    """Add a constant to one number of a design, without the reader's checks."""
    keys = name.split(".")
    design = undo(design)

    def add(number: float) -> float:
        return number + by

    if keys[0] == "materials":  # of the built-in ones too
        # losses stay as given: only given ones matter to strings
        given = design.materials.get(keys[1], Material())
        own = msgspec.structs.replace(
            materials.look_up(design, keys[1]), loss=given.loss, loss_angle=given.loss_angle
        )
        table = getattr(own, keys[2])
        if isinstance(table, AgainstTemperature):
            values = tuple(add(value) for value in table.values)
            table = msgspec.structs.replace(table, values=values)
            own = msgspec.structs.replace(own, **{keys[2]: table})
        else:
            own = paths.changed(own, keys[2:], add)
        design = msgspec.structs.replace(design, materials=design.materials | {keys[1]: own})
        return spell_out(ties.apply(design))
    for path in twins(name):
        design = paths.changed(design, path.split("."), add)
    return spell_out(ties.apply(design))


ACROSS = ("width", "thickness", "surface_depth", "diameter")
"""Lengths across a wire or blade, which are made to a fraction of their size; so are all numbers
below `CROSS_SECTIONS`, in a table of wires."""
WIRES = ("wires", "wire", "sections")
"""Tables in which a radius is that of a wire; elsewhere it is that of a body."""
STEPS = {unit: (1 / factor, name) for unit, (name, factor) in DISPLAYED.items() if unit != "Pa"}
"""Step of a length or an angle, by SI unit, and the step's name."""


def natural_step(path: str, value: float) -> tuple[float, str]:
    """Choose the step of a number of a design (by dotted path), in SI, and name it.

    1 mm for a length and 1 mrad for an angle; 1 % for everything else, including the thickness of
    wires and blades, and loss angles.

    >>> natural_step("stage.test.wires.d", 0.001), natural_step("stage.test.body.mass", 5.0)
    ((0.001, 'mm'), (0.05, '%'))
    """
    keys = path.split(".")
    # after the name of a stage or material
    names = [key for key in keys[2:] if not key.isdigit()] or keys[-1:]
    of_wire = any(key in WIRES for key in names) and any(key in CROSS_SECTIONS for key in names)
    thin = names[-1] in ACROSS or of_wire
    step = None if thin or is_loss_angle(path) else STEPS.get(unit_of(path))
    return step or (value / 100, "%")
