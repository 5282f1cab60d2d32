"""Files of goals: limits and objectives of a design for `pendsus optimise`.

`[[requirement]]` limits any quantity, `[[objective]]` minimises or maximises one. `[[goal]]` is a
short form for limits on several quantities at once, such as the frequencies of a family of modes.
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from suspension_cli.design import key_rules, reader
from suspension_cli.design.faults import suggest
from suspension_cli.design.schema import Perturbation
from suspension_cli.design.typed_tables import Problems, Table, given, key
from suspension_cli.design.units import Name, NamedDof, Number, Positive

Kind = Literal["band", "separation", "coupling", "isolation", "cross-coupling", "stress", "height"]


LIMITS = ["at_least", "at_most", "equals"]
MODAL = ["dof", "lowest", "modes"]
TAKES: dict[object, tuple[list[str], list[str]]] = {
    "band": ([], [*LIMITS, *MODAL]),
    "separation": ([], ["at_least", "apart", *MODAL]),
    "coupling": ([], ["at_least", *MODAL]),
    "isolation": (["response"], ["at_most", "perturbation"]),
    "cross-coupling": (["response"], ["at_most", "perturbation"]),
    "stress": ([], ["at_most", "wires", "blades"]),
    "height": ([], [*LIMITS, "stage"]),
}
"""Keys that each kind of goal needs, and takes, beside those that all take."""
PARTS = {
    "isolation": (1, "OUTPUT/INPUT:FREQUENCY, test.x/support.x:10"),
    "cross-coupling": (2, "OVER/UNDER/INPUT:FREQUENCY, test.x/test.z/support.z:50"),
}
"""Number of slashes in the response of a kind of goal, and an example."""


class Free(Table, frozen=True):
    """One number of the design that may change, within bounds."""

    name: str = key("dotted path, as --set takes it")
    lower: Number
    upper: Number
    start: Number | None = key("where to begin; default: the design's value")
    scale: Literal["linear", "log"] = key('"log": steps of equal ratio', "linear")

    def check(self) -> Problems:
        """Check the bounds of a logarithmic scale."""
        if self.scale == "log" and self.lower <= 0:
            remedy = 'give a positive bound, or scale = "linear"'
            yield "lower", "must be positive on a logarithmic scale", remedy

    rules = (key_rules.bounded,)


class Equal(Table, frozen=True):
    """A number that follows from others: offset plus the sum of coefficient times number."""

    name: str = key("dotted path of the number that follows")
    terms: dict[str, Number] = key('{ "dotted.path" = coefficient, ... }')
    offset: Number = 0.0
    lower: Number | None = None
    upper: Number | None = None

    rules = (key_rules.bounded,)

    def check(self) -> Problems:
        """Check that there are terms."""
        if not self.terms:
            yield "terms", "is empty", 'give { "dotted.path" = coefficient }'


class Goal(Table, frozen=True):
    """A limit on a quantity, or a quantity to minimise or maximise."""

    kind: Kind
    name: str = key("name in the report", "", max_length=100)
    at_least: Positive | None = None
    at_most: Positive | None = None
    equals: Positive | None = None
    minimise: bool = False
    maximise: bool = False
    weight: Positive | None = None
    dof: list[NamedDof] | None = key("coordinates whose families of modes are meant", min_length=1)
    lowest: int | None = key("of each family, this many of the lowest modes", ge=1, le=1000)
    modes: list[str] | None = key(
        "names of modes, such as 'test pitch' or 'yaw 3', or 'modes' for all", min_length=1
    )
    apart: Literal["ratio", "hertz"] | None = key("measure of a separation")
    response: str | None = key(
        "OUTPUT/INPUT:FREQUENCY, or, of a cross-coupling, OVER/UNDER/INPUT:FREQUENCY"
    )
    perturbation: list[Perturbation] | None = key(
        "imperfections of the build that responds", min_length=1
    )
    wires: list[Name] | None = key("stages whose wires are meant", min_length=1)
    blades: list[Name] | None = key("stages whose blades are meant", min_length=1)
    stage: Name | None = key("stage whose depth below the suspension point is meant")

    def check(self) -> Problems:
        """Check that it has one limit or direction, which suits its kind."""
        if self.weight is not None and not (self.minimise or self.maximise):
            yield "weight", "has no effect on a limit", "give minimise or maximise too"
        if (self.minimise and self.maximise) or not (
            given(self, *LIMITS) or self.minimise or self.maximise
        ):
            ways = " or ".join(key for key in TAKES[self.kind][1] if key in LIMITS)
            problem = "sets no limit" if not self.minimise else "has both minimise and maximise"
            yield "", problem, f"give {ways}, or one of minimise and maximise = true"
        if self.kind == "coupling" and (self.at_least or 0) > 1:
            remedy = "give a fraction from 0 to 1, such as 0.01"
            yield "at_least", "is more than the whole kinetic energy", remedy
        if self.kind == "separation" and (self.minimise or self.maximise):
            yield "", "a separation cannot be minimised or maximised", "give at_least alone"
        if self.kind == "separation" and self.apart != "hertz" and (self.at_least or 2) <= 1:
            remedy = 'give 1.1 for 10 % apart, or apart = "hertz"'
            yield "at_least", "must be a ratio above 1", remedy
        slashes, example = PARTS.get(self.kind, (0, ""))
        if self.response and example and self.response.partition(":")[0].count("/") != slashes:
            yield "response", f"has the wrong form for {self.kind}", f"write {example}"

    rules = (
        key_rules.by_kind("kind", TAKES),
        key_rules.excludes("equals", "at_least", "at_most"),
        key_rules.needs("lowest", "dof"),
        key_rules.ordered("at_least", "at_most"),
        key_rules.exactly_one("dof", "modes", when=lambda goal: "dof" in TAKES[goal.kind][1]),
    )


class QuantityRequirement(Table, frozen=True):
    """A limit on a quantity."""

    quantity: str = key("name of a quantity, such as 'lowest pitch'", max_length=200)
    at_least: Number | None = key("smallest value, in the quantity's unit")
    at_most: Number | None = key(
        "largest value, in the quantity's unit; alone and positive, that of the magnitude"
    )
    equals: Number | None = key("the value itself")
    perturbation: list[Perturbation] | None = key(
        "imperfections of the build that it is computed for", min_length=1
    )
    note: str = key("where the requirement comes from, for the report", "", max_length=200)

    rules = (
        key_rules.any_of("at_least", "at_most", "equals"),
        key_rules.excludes("equals", "at_least", "at_most"),
        key_rules.ordered("at_least", "at_most"),
    )


class Objective(Table, frozen=True):
    """A quantity to minimise or maximise."""

    minimise: str | None = key("name of a quantity, such as 'thermal test.x:10'", max_length=200)
    maximise: str | None = key("name of a quantity", max_length=200)
    weight: Positive = key("of its logarithm in the sum of all objectives", 1.0)
    perturbation: list[Perturbation] | None = key(
        "imperfections of the build that it is computed for", min_length=1
    )

    rules = (key_rules.exactly_one("minimise", "maximise"),)


class Goals(Table, frozen=True):
    """A file of goals."""

    free: list[Free] = key(min_length=1)
    requirement: list[QuantityRequirement] = []
    objective: list[Objective] = []
    goal: list[Goal] = []
    equal: list[Equal] = []
    design_requirements: bool = key(
        "whether the design's own [[requirement]] tables are goals too", True
    )
    title: str = ""
    reference: str = ""
    prefer: Literal["near", "margin"] = key("nearest design, or largest margins", "near")
    margin: float = key("distance kept from each limit, as a fraction of it", 1e-6, ge=1e-7, le=1)

    def check(self) -> Problems:
        """Check that each number is free, or follows from free ones."""
        free = [item.name for item in self.free]
        tied = [item.name for item in self.equal]
        for kind, own, others in (("free", free, []), ("equal", tied, free)):
            for n, name in enumerate(own):
                if name in own[:n] + others:
                    remedy = "give each number once, as free or equal"
                    yield f"{kind}.{n + 1}.name", "is named twice", remedy
        for n, item in enumerate(self.equal, 1):
            for term in [term for term in item.terms if term in tied]:
                remedy = f"express it by free numbers; {suggest(term, free)}"
                yield f"equal.{n}.terms", f"{term} is itself given by [[equal]]", remedy


def read(file: str | Path, text: str | None = None) -> Goals:
    """Read and check a file of goals, or its text if given; raises `InputError` with all faults."""
    return reader.read_as(Goals, "file of goals", file, text)
