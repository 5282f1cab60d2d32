"""Filters of local control: continuous ones as Foton strings, and digital ones of front ends.

>>> abs(make_response('zpk([],[1],5,"n")').at(0.0))
5.0
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated

from msgspec import Meta

from suspension_cli.design import foton, key_rules
from suspension_cli.design.typed_tables import Problems, Table, doc, key

FOTON = 'a Foton string: zpk([z;z],[p;p],k,"n"), gain(k), pole(f,"n"), ... and products of these'
Hertz = Annotated[float, doc("", "Hz", ge=-1e9, le=1e9)]
Root = Annotated[
    list[Hertz | Annotated[list[Hertz], doc(count=2)]],
    doc("roots in Hz, positive for the left half plane, or [re, im] for a conjugate pair"),
]


class DigitalFilter(Table, frozen=True):
    """A digital filter: sections of a Foton filter file, or a design with a sample rate."""

    file: str | None = key("Foton filter file (.txt) of a front end, from this file's folder")
    module: str | None = key("name of the filter module in the file: M0_DAMP_L")
    sections: list[Annotated[int, Meta(ge=1, le=10)]] = key("sections that are on: 1 is FM1", [])
    design: str | None = key(f"{FOTON}, made digital as Foton does; of a file, its sections")
    rate: float | None = key("sample rate in Hz of the design", unit="Hz", gt=0, le=1e9)
    gain: float = key("factor on the filter", 1.0, unit="1", ge=-1e12, le=1e12)
    source: str = key("origin of the design; filled in for a file", "")

    rules = (
        key_rules.exactly_one("file", "design"),
        key_rules.needs("file", "module"),
        key_rules.needs("file", "sections"),
        key_rules.together("design", "rate"),
    )

    def check(self) -> Problems:
        """Check that a file was read."""
        if self.file is not None:
            remedy = "read the design from its file, or give design and rate"
            yield "file", "is read only with a design file, not with its text alone", remedy


def make_response(given: str | DigitalFilter) -> foton.Filter:
    """Make the filter that a key gives; raises `FotonError`."""
    if isinstance(given, str):
        return foton.parse(given)
    made = foton.parse(given.design or "gain(1)", given.rate or 0.0)
    return replace(made, gain=made.gain * given.gain)


def expand_roots(given: Sequence[float | list[float]]) -> tuple[complex, ...]:
    """List roots in Hz as complex numbers; a pair [re, im] stands for both conjugates."""
    pairs = ((one, [one[0], -one[1]]) if isinstance(one, list) else ([one],) for one in given)
    return tuple(complex(*root) for pair in pairs for root in pair)
