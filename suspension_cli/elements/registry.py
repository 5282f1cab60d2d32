"""The kinds of elements of a scene, in the order in which their derivatives are added."""

from __future__ import annotations

from suspension_cli.elements import bending, blade, spring, string, weight
from suspension_cli.elements.element import Element

ELEMENTS: tuple[Element, ...] = (
    weight.ELEMENT,
    string.ELEMENT,
    bending.ELEMENT,
    spring.ELEMENT,
    blade.ELEMENT,
)
"""Blades come last: they take the forces of all others on their tips."""
