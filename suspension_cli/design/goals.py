"""Files of goals: limits and objectives of a design for `pendsus optimise`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Literal

from msgspec import Meta

from suspension_cli.conventions import DOFS
from suspension_cli.design import faults, reader
from suspension_cli.design.faults import fault_of, suggest
from suspension_cli.design.measured import Number, Positive, check_bounds
from suspension_cli.design.schema import Perturbation
from suspension_cli.design.units import Name, Table, doc
from suspension_cli.errors import Fault, InputError, attribute_faults_to, format_value

Kind = Literal["band", "separation", "coupling", "isolation", "cross-coupling", "stress", "height"]
Dof = Literal["x", "y", "z", "roll", "pitch", "yaw"]


class Free(Table, frozen=True):
    """One number of the design that may change, within bounds."""

    name: Annotated[str, doc("dotted path, as --set takes it")]
    lower: Number
    upper: Number
    start: Annotated[Number, doc("where to begin; default: the design's value")] | None = None
    scale: Annotated[Literal["linear", "log"], doc('"log": steps of equal ratio')] = "linear"


class Equal(Table, frozen=True):
    """A number that follows from others: offset plus the sum of coefficient times number."""

    name: Annotated[str, doc("dotted path of the number that follows")]
    terms: Annotated[dict[str, Number], doc('{ "dotted.path" = coefficient, ... }')]
    offset: Number = 0.0
    lower: Number | None = None
    upper: Number | None = None


class Goal(Table, frozen=True):
    """A limit on a quantity, or a quantity to minimise or maximise."""

    kind: Kind
    name: Annotated[str, doc("name in the report", max_length=100)] = ""
    at_least: Positive | None = None
    at_most: Positive | None = None
    equals: Positive | None = None
    minimise: bool = False
    maximise: bool = False
    weight: Positive | None = None
    dof: (
        Annotated[
            list[Dof],
            doc(f"modes of the families that these belong to: {', '.join(DOFS)}", min_length=1),
        ]
        | None
    ) = None
    lowest: (
        Annotated[int, doc("of each family, this many of the lowest modes", ge=1, le=1000)] | None
    ) = None
    modes: (
        Annotated[
            list[str],
            doc("labels in pendsus modes --fidelity string; shapes identify them", min_length=1),
        ]
        | None
    ) = None
    apart: Annotated[Literal["ratio", "hertz"], doc("measure of a separation")] | None = None
    response: (
        Annotated[
            str,
            doc("OUTPUT/INPUT:FREQUENCY, or OVER/UNDER/INPUT:FREQUENCY of a cross-coupling"),
        ]
        | None
    ) = None
    perturbation: (
        Annotated[
            list[Perturbation],
            doc("imperfections with which the response is computed", min_length=1),
        ]
        | None
    ) = None
    wires: Annotated[list[Name], doc("stages whose wires are meant", min_length=1)] | None = None
    blades: Annotated[list[Name], doc("stages whose blades are meant", min_length=1)] | None = None
    stage: Annotated[Name, doc("stage whose depth below the suspension point is meant")] | None = (
        None
    )


class Goals(Table, frozen=True):
    """A file of goals."""

    goal: Annotated[list[Goal], Meta(min_length=1)]
    free: Annotated[list[Free], Meta(min_length=1)]
    equal: list[Equal] = []
    title: str = ""
    reference: str = ""
    prefer: Annotated[
        Literal["near", "margin"],
        doc("without minimise and maximise: the nearest design, or the largest margins"),
    ] = "near"
    margin: Annotated[
        float,
        doc("distance that the search keeps from each limit, as a fraction of it", ge=1e-7, le=1),
    ] = 1e-6


LIMITS = ("at_least", "at_most", "equals")
MODAL = ("dof", "lowest", "modes")
TAKES: dict[str, tuple[str, ...]] = {
    "band": ("at_least", "at_most", "equals", *MODAL),
    "separation": ("at_least", "apart", *MODAL),
    "coupling": ("at_least", *MODAL),
    "isolation": ("at_most", "response", "perturbation"),
    "cross-coupling": ("at_most", "response", "perturbation"),
    "stress": ("at_most", "wires", "blades"),
    "height": ("at_least", "at_most", "equals", "stage"),
}
"""Keys that each kind of goal takes beside `kind`, `name`, `minimise`, `maximise` and `weight`."""
COMMON = ("kind", "name", "minimise", "maximise", "weight")
PARTS = {
    "isolation": (1, "OUTPUT/INPUT:FREQUENCY, test.x/support.x:10"),
    "cross-coupling": (2, "OVER/UNDER/INPUT:FREQUENCY, test.x/test.z/support.z:50"),
}
"""Number of slashes in the response of a kind of goal, and an example."""


def read(file: str | Path, text: str | None = None) -> Goals:
    """Read and check a file of goals, or its text if given; raises `InputError` with all faults."""
    raw = reader.read_toml(file, text)
    with attribute_faults_to(str(file)):
        goals = faults.convert(raw, Goals)
        found = [
            *(
                fault
                for n, item in enumerate(goals.goal, 1)
                for fault in _check_goal(item, f"goal.{n}")
            ),
            *(
                fault
                for n, item in enumerate(goals.free, 1)
                for fault in _check_free(item, f"free.{n}")
            ),
            *_check_ties(goals),
        ]
        if found:
            raise InputError(found)
    return goals


def _check_goal(item: Goal, path: str) -> Iterator[Fault]:
    takes = TAKES[item.kind]
    given = [
        key
        for key in item.__struct_fields__
        if getattr(item, key) not in (None, False, "") and key not in COMMON
    ]
    for key in given:
        if key not in takes:
            yield fault_of(
                item,
                path,
                key,
                f"is not for a goal of kind {item.kind}",
                f"known here: {', '.join(takes)}",
            )
    limits = [key for key in LIMITS if key in given]
    if item.minimise and item.maximise:
        yield Fault(path, "has both minimise and maximise", "keep one of the two")
    elif not limits and not item.minimise and not item.maximise:
        yield Fault(
            path,
            "sets no limit",
            f"give {' or '.join(key for key in takes if key in LIMITS)}, or minimise or maximise ="
            " true",
        )
    if item.weight is not None and not (item.minimise or item.maximise):
        yield fault_of(
            item, path, "weight", "has no effect on a limit", "give minimise or maximise too"
        )
    if item.equals is not None and len(limits) > 1:
        yield fault_of(item, path, "equals", "conflicts with another limit", "give equals alone")
    if item.at_least is not None and item.at_most is not None and item.at_least >= item.at_most:
        yield fault_of(
            item, path, "at_least", f"is not below at_most = {item.at_most:g}", "exchange them"
        )
    yield from _check_kind(item, path)


def _check_kind(item: Goal, path: str) -> Iterator[Fault]:
    if "dof" in TAKES[item.kind]:
        if (item.dof is None) == (item.modes is None):
            yield Fault(
                path,
                "must say which modes",
                'give dof = ["yaw"] or modes = ["test pitch"], one of the two',
            )
        if item.lowest is not None and item.dof is None:
            yield fault_of(item, path, "lowest", "goes with dof", "give dof too, or name the modes")
    if item.kind == "coupling" and (item.at_least or 0) > 1:
        yield fault_of(
            item,
            path,
            "at_least",
            "is more than the whole kinetic energy",
            "give a fraction from 0 to 1, such as 0.01",
        )
    if item.kind == "separation":
        if item.minimise or item.maximise:
            yield Fault(
                path, "a separation cannot be minimised or maximised", "give at_least alone"
            )
        if item.apart != "hertz" and item.at_least is not None and item.at_least <= 1:
            yield fault_of(
                item,
                path,
                "at_least",
                "must be a ratio above 1",
                'give 1.1 for 10 % apart, or apart = "hertz"',
            )
    if item.kind in PARTS:
        slashes, example = PARTS[item.kind]
        if item.response is None:
            yield Fault(f"{path}.response", "missing", f"give {example}")
        elif item.response.partition(":")[0].count("/") != slashes:
            yield fault_of(
                item, path, "response", f"has the wrong form for {item.kind}", f"write {example}"
            )


def _check_free(item: Free, path: str) -> Iterator[Fault]:
    yield from check_bounds(item, path, item.start)
    if item.scale == "log" and item.lower <= 0:
        problem = "must be positive on a logarithmic scale"
        remedy = 'give a positive bound, or scale = "linear"'
        yield fault_of(item, path, "lower", problem, remedy)


def _check_ties(goals: Goals) -> Iterator[Fault]:
    free, tied = [item.name for item in goals.free], [item.name for item in goals.equal]
    names = free + tied
    for n, name in enumerate(names):
        if name in names[:n]:
            path = f"free.{n + 1}" if n < len(free) else f"equal.{n + 1 - len(free)}"
            remedy = "give each number once, as free or equal"
            yield Fault(f"{path}.name", "is named twice", remedy, format_value(name))
    for n, item in enumerate(goals.equal, 1):
        path = f"equal.{n}"
        for term in [term for term in item.terms if term in tied]:
            remedy = f"express it by free numbers; {suggest(term, free)}"
            yield Fault(f"{path}.terms", f"{term} is itself given by [[equal]]", remedy)
        if not item.terms:
            yield Fault(f"{path}.terms", "is empty", 'give { "dotted.path" = coefficient }')
        yield from check_bounds(item, path)
