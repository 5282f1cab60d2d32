"""The kinds of elements of a scene."""

from __future__ import annotations

from dataclasses import replace

from suspension_cli.design.schema import Design
from suspension_cli.elements import bending, spring, taut_string, weight
from suspension_cli.elements.element import Element
from suspension_cli.scene.scene import Scene

ELEMENTS: tuple[Element, ...] = (
    weight.ELEMENT,
    taut_string.ELEMENT,
    bending.ELEMENT,
    spring.ELEMENT,
    spring.BLADES,
)


def with_added(scene: Scene, design: Design) -> Scene:
    """Add the arrays of elements that make their own to a scene without them."""
    made = {item.name: item.make(design, scene) for item in ELEMENTS if item.make is not None}
    return replace(scene, added={name: part for name, part in made.items() if part.label})


def have_own_arrays() -> bool:
    """Whether any kind makes arrays of its own."""
    return any(item.make is not None for item in ELEMENTS)


def elements_of(scene: Scene) -> list[Element]:
    """List the kinds of elements that a scene has."""
    return [item for item in ELEMENTS if item.make is None or item.name in scene.added]
