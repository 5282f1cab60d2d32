"""The numbers of a design, by dotted path, and the same design with one of them moved into the complex plane.

A function of real numbers that is analytic takes f(p + ih) = f(p) + ih f'(p) + O(h^2); with h = 1e-30 the imaginary part is the derivative to
rounding, as nothing is subtracted (Squire and Trapp, SIAM Review 40, 110 (1998)).  So the whole way from a design to its matrices is
differentiated by the code that computes it.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import msgspec

from suspension_cli.design import materials, reader
from suspension_cli.design.schema import Design, Material
from suspension_cli.design.sections import stretches
from suspension_cli.design.wires import Wire, WireSet

STEP = 1e-30
"""Imaginary step in a parameter's own unit; its square is far below rounding for any number that a design may hold."""
ELSEWHERE = ("design", "analysis", "control", "tolerance")
"""Tables that say nothing of the suspension itself."""
NOT = ("count", "steps", "temperature")
"""Keys whose numbers are no lengths, masses, ... that could change a little and matter to any model here."""
TWIST = "poisson_ratio"
"""What counts where wires twist, and there alone."""


@dataclass(frozen=True)
class Parameter:
    """One number of a design.

    Attributes
    ----------
    name : str
        Dotted path as ``--set`` takes it: ``stage.test.wires.s``, ``stage.test.body.inertia.2``.
    value : float
    """

    name: str
    value: float


def every(text: str, level: str = "string") -> tuple[Parameter, ...]:
    """Every number of a design that may change a little, and the gravity and moduli it takes for granted.

    Parameters
    ----------
    text : str
        The design as TOML.
    level : str
        ``string``, or ``beam``, on which every wire's material counts, Poisson's ratio too.
    """
    design, raw = reader.parse(text), tomllib.loads(text)
    bends = level == "beam"
    found = [item for key, value in raw.items() if key not in ELSEWHERE for item in _numbers(key, value) if bends or not item.name.endswith(TWIST)]
    known = {item.name for item in found}
    implied = [Parameter("constants.gravity", design.constants.gravity)]
    bent = _bent(design) if bends else set[str]()
    for name in sorted(_used(design) | bent):
        made = materials.resolve(design, name)
        assert made.youngs_modulus is not None
        implied.append(Parameter(f"materials.{name}.youngs_modulus", made.youngs_modulus))
        if name in bent and made.poisson_ratio is not None:
            implied.append(Parameter(f"materials.{name}.{TWIST}", made.poisson_ratio))
    return (*found, *(item for item in implied if item.name not in known))


def _numbers(path: str, value: Any) -> Iterator[Parameter]:
    if isinstance(value, dict):
        for key, item in value.items():
            if key not in NOT:
                yield from _numbers(f"{path}.{key}", item)
    elif isinstance(value, list):
        square = len(value) in (3, 6) and all(isinstance(row, list) for row in value)
        for n, item in enumerate(value, 1):
            if square:  # a symmetric matrix: an element moves together with its mirror image
                yield from (Parameter(f"{path}.{n}.{m}", float(item[m - 1])) for m in range(n, len(value) + 1))
            else:
                yield from _numbers(f"{path}.{item['name'] if isinstance(item, dict) and 'name' in item else n}", item)
    elif isinstance(value, (int, float)) and not isinstance(value, bool):
        yield Parameter(path, float(value))


def _wires(design: Design) -> list[WireSet | Wire]:
    return [wire for stage in design.stage for wire in (*([stage.wires] if stage.wires else []), *stage.wire)]


def _bent(design: Design) -> set[str]:
    """Materials of wires that bend."""
    return {piece.material for wire in _wires(design) for piece in stretches(wire, 1.0) if piece.material is not None}


def _used(design: Design) -> set[str]:
    """Materials whose Young's modulus matters to strings."""
    blades = [blade for stage in design.stage for blade in (*([stage.blades] if stage.blades else []), *stage.blade)]
    named = {wire.material for wire in _wires(design) if wire.k is None and wire.material is not None}
    return named | {blade.geometry.material for blade in blades if blade.geometry is not None}


def twins(name: str) -> tuple[str, ...]:
    """The path of a number, and that of its mirror image where it is an element of a symmetric matrix."""
    *head, row, column = name.split(".") if name.count(".") > 1 else ("", "", name)
    return (name, ".".join([*head, column, row])) if row.isdigit() and column.isdigit() and row != column else (name,)


def stepped(design: Design, name: str, rate: float = 1.0) -> Design:
    """A design with `STEP` i (times a rate) added to one of its numbers."""
    return shifted(design, name, STEP * rate * 1j)


def shifted(design: Design, name: str, by: complex) -> Design:
    """A design with something added to one of its numbers, whether or not the reader would take it then."""
    keys = name.split(".")
    if keys[0] == "materials":  # what is built in may be moved too
        given = design.materials.get(keys[1], Material())  # what is not moved stays as it was, and only losses that are given count for strings
        own = msgspec.structs.replace(materials.resolve(design, keys[1]), loss=given.loss, loss_angle=given.loss_angle)
        return msgspec.structs.replace(design, materials=design.materials | {keys[1]: _moved(own, keys[2:], by)})
    for path in twins(name):
        design = _moved(design, path.split("."), by)
    return design


def _place(items: Any, key: str) -> int:
    named = [n for n, item in enumerate(items) if getattr(item, "name", None) == key]
    return named[0] if named else int(key) - 1


def _moved(node: Any, keys: list[str], by: complex) -> Any:
    """The same tree with the number at a path moved; nothing of the old one changes."""
    if not keys:
        return node + by
    key, rest = keys[0], keys[1:]
    if isinstance(node, (list, tuple)):
        place = _place(node, key)
        return type(node)(_moved(item, rest, by) if n == place else item for n, item in enumerate(node))
    return msgspec.structs.replace(node, **{key: _moved(getattr(node, key), rest, by)})
