"""Heat in a design: table `[heat]`."""

from __future__ import annotations

from typing import Annotated

from suspension_cli.design.typed_tables import Problems, Table, doc, key

HOTTEST = 1000.0
"""Highest temperature of a body, K."""
Power = Annotated[float, doc("power in W", "W", ge=0, le=1e6)]
Held = Annotated[float, doc("temperature in K", "K", gt=0, le=0.9 * HOTTEST)]


class Heat(Table, frozen=True):
    """Heat that bodies absorb and wires and links conduct, for the temperatures of a design."""

    held: dict[str, Held] = key('known temperatures, K, of stages, "support" or "ground"')
    absorbed: dict[str, Power] = key("power that stages absorb, W", {})

    def check(self) -> Problems:
        """Check that something is held, and that heat matters where it is absorbed."""
        if not self.held:
            yield "held", "is empty", "give a temperature: { support = 16.0 }"
        for name in self.absorbed.keys() & self.held.keys():
            problem = f"has no effect, as {name} is held at {self.held[name]:g} K"
            yield f"absorbed.{name}", problem, "remove one of the two"
