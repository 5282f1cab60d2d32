"""A kind of quantity: the pattern of its names, and how these are parsed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from suspension_cli.quantities.names import Names
from suspension_cli.quantities.quantity import Quantity


@dataclass(frozen=True)
class Kind:
    """A kind of quantity, as help and the docs list it.

    `parse` returns the quantity that a name means in a design, or None if it is a name of another
    kind. It raises `InputError`, which names the option (its third argument), if the name is of
    this kind but wrong.
    """

    pattern: str
    example: str
    unit: str
    summary: str
    parse: Callable[[str, Names, str], Quantity | None]
