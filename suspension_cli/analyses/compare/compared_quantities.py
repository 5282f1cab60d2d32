"""Quantities of several designs side by side, with measured values and verdicts on requirements.

    pendsus compare a.toml b.toml --result "thermal test.x:10" --result "stress test wires"

A quantity is named as everywhere (`quantities.vocabulary`). Each design computes those of
``--result``, those that the `[[requirement]]` tables of any of the designs limit, and those that
were measured; all in one model, the most complete one that a design needs for them. A design is
judged by its own requirements.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from suspension_cli.analyses import verdicts
from suspension_cli.analyses.named_quantities import names_of
from suspension_cli.errors import InputError, join_errors
from suspension_cli.files.declared import along, in_unit, scale_of
from suspension_cli.files.documents import Layout
from suspension_cli.models.choice import choose
from suspension_cli.models.registry import MODELS, Choice
from suspension_cli.physics import model_choice
from suspension_cli.quantities import vocabulary
from suspension_cli.quantities.differences import compare_designs
from suspension_cli.quantities.needs import Needs
from suspension_cli.quantities.quantity import Quantity, evaluate
from suspension_cli.quantities.requirements import Requirement
from suspension_cli.quantities.solved import of_designs

if TYPE_CHECKING:
    from jaxtyping import Float

    from suspension_cli.analyses.compare.items import Item
    from suspension_cli.design.reader import Source


@dataclass(frozen=True)
class ItemVerdict:
    """Whether an item meets a requirement of its design.

    `quantity` and `item` are numbers, from 0; `description` is the requirement in usual units. The
    margin is the distance from the nearer limit, relative to it; NaN without a value.
    """

    quantity: int
    item: int
    description: str
    note: str
    met: bool
    margin: float


@dataclass(frozen=True)
class Missing:
    """Why an item has no value of a quantity; both are numbers, from 0."""

    quantity: int
    item: int
    reason: str


@dataclass(frozen=True)
class ComparedQuantities:
    """Quantities of several items, a row per quantity; NaN where an item has no value, SI."""

    in_json: ClassVar = Layout(
        rows={"quantity": ""},
        names={"name": "name", "quantity_unit": "unit", "change": "change_percent"},
        without="verdict missing",
        also="change",
    )
    name: tuple[str, ...] = field(metadata=scale_of("quantity"))
    quantity_unit: tuple[str, ...] = field(metadata=along("quantity"))
    value: Float[np.ndarray, "quantity item"] = field(metadata=in_unit("{quantity_unit}"))
    verdict: tuple[ItemVerdict, ...] = field(default=(), metadata=along("verdict"))
    missing: tuple[Missing, ...] = field(default=(), metadata=along("missing"))

    @property
    def change(self) -> Float[np.ndarray, "quantity item"]:
        """Changes from the first item that has a value, in per cent of that; NaN of the first.

        NaN also where the first value is 0 and the other is not.
        """
        rows = np.arange(len(self.name))
        first = np.isfinite(self.value).argmax(1)
        base = self.value[rows, first]
        with np.errstate(divide="ignore", invalid="ignore"):
            change = 100 * (self.value - base[:, None]) / np.abs(base)[:, None]
        change = np.where(self.value == base[:, None], 0.0, change)
        change[rows, first] = np.nan
        return np.where(np.isfinite(change), change, np.nan)

    def verdicts_on(self, quantity: int, item: int) -> list[ItemVerdict]:
        """Verdicts on one quantity of one item."""
        return [one for one in self.verdict if (one.quantity, one.item) == (quantity, item)]


@dataclass(frozen=True)
class Request:
    """Quantities of one design by name, its requirements, and names that it does not have."""

    source: Source
    quantities: dict[str, Quantity]
    requirements: tuple[Requirement, ...]
    missing: dict[str, InputError]

    def choose(self, level: str, tolerance: float) -> Choice:
        """Choose the model, by its name or ``"auto"``."""
        design = self.source.design
        candidates = model_choice.with_and_without_wire_mass(self.source)
        comparison = compare_designs([*self.quantities.values()], [design])
        return choose(design, level, candidates, comparison, tolerance)

    def evaluate(self, level: str) -> dict[str, float]:
        """Compute the quantities in a model, SI; NaN without a value."""
        wanted = [*self.quantities.values()]
        values = [np.nan] * len(wanted)
        for _, batch in of_designs([self.source.design], level, Needs.of(wanted)):
            values = evaluate(wanted, batch)[0].tolist()
        return dict(zip(self.quantities, values, strict=True))

    def reason(self, name: str) -> str:
        """Say why the design has no value of a quantity."""
        if name in self.quantities:
            return self.quantities[name].missing
        return self.missing[name].faults[0].problem


def request(source: Source, texts: Sequence[str], required: Sequence[Requirement]) -> Request:
    """Look up quantities of a design by name."""
    names = names_of(source)
    quantities: dict[str, Quantity] = {}
    missing: dict[str, InputError] = {}
    for text in texts:
        try:
            found = vocabulary.parse(text, names)
        except InputError as error:
            missing[text] = error
        else:
            quantities[found.text] = found
    return Request(source, quantities, tuple(required), missing)


def compare(
    items: Sequence[Item],
    texts: Sequence[str],
    level: str,
    tolerance: float,
    report: Callable[[int, Choice], None],
) -> ComparedQuantities | None:
    """Compare quantities of items by name, and those that requirements or measurements name.

    `report` is called with the number of each design and the choice of its model. None if there
    are no quantities. Raises `InputError` if no design has a quantity, or a requirement names none.
    """
    sources = {n: item.source for n, item in enumerate(items) if item.source is not None}
    required = {n: verdicts.find_requirements(source) for n, source in sources.items()}
    limited = [one.quantity.text for each in required.values() for one in each]
    measured = [name for item in items for name in item.values]
    wanted = list(dict.fromkeys([*texts, *limited, *measured]))
    requests = {n: request(source, wanted, required[n]) for n, source in sources.items()}
    _demand_known(list(requests.values()), texts)
    asked = {n: one for n, one in requests.items() if one.quantities}
    if not asked:
        return None
    values = _evaluate(asked, level, tolerance, report)
    return _collect(items, requests, values)


def _demand_known(requests: Sequence[Request], texts: Sequence[str]) -> None:
    """Raise `InputError` with the names that no design has."""
    nowhere = [
        requests[0].missing[text]
        for text in dict.fromkeys(texts)
        if all(text in one.missing for one in requests)
    ]
    if nowhere:
        raise join_errors(nowhere)


def _evaluate(
    asked: dict[int, Request],
    level: str,
    tolerance: float,
    report: Callable[[int, Choice], None],
) -> dict[int, dict[str, float]]:
    """Compute the quantities of all designs in the most complete model that one needs."""
    choices = {n: one.choose(level, tolerance) for n, one in asked.items()}
    top = max((choice.model for choice in choices.values()), key=MODELS.index)
    values = {}
    for n, one in asked.items():
        design = one.source.design
        if choices[n].model is not top and not top.unsuitable(design):
            choices[n] = one.choose(top.name, tolerance)
        report(n, choices[n])
        values[n] = one.evaluate(choices[n].level)
    return values


def _collect(
    items: Sequence[Item], requests: dict[int, Request], values: dict[int, dict[str, float]]
) -> ComparedQuantities:
    """Collect values, verdicts, and reasons why there is no value."""
    known: dict[str, Quantity] = {}
    for one in requests.values():
        known |= {name: found for name, found in one.quantities.items() if name not in known}
    names = list(known)
    table = np.full((len(names), len(items)), np.nan)
    judged: list[ItemVerdict] = []
    missing: list[Missing] = []
    for n, item in enumerate(items):
        own = values.get(n, {})
        for row, name in enumerate(names):
            if name in own:
                table[row, n] = own[name]
            elif n not in requests:
                table[row, n] = item.values.get(name, _measured_frequency(item, name))
            if n in requests and np.isnan(table[row, n]):
                missing.append(Missing(row, n, requests[n].reason(name)))
        if n in requests:
            judged += _judge(requests[n], names, n, table[:, n])
    units = tuple(one.unit for one in known.values())
    return ComparedQuantities(tuple(names), units, table, tuple(judged), tuple(missing))


def _measured_frequency(item: Item, name: str) -> float:
    """Measured frequency of the mode of a label, Hz; NaN without one."""
    found = [mode.frequency for mode in item.modes if mode.label == name]
    return found[0] if found else np.nan


def _judge(
    request: Request, names: Sequence[str], item: int, values: Float[np.ndarray, " quantity"]
) -> list[ItemVerdict]:
    """Compare the values of one design with its requirements."""
    found = []
    for one in request.requirements:
        row = names.index(one.quantity.text)
        met = bool(one.is_met(values[row]))
        margin = float(one.margin(values[row]))
        found.append(ItemVerdict(row, item, one.description, one.limits.note, met, margin))
    return found
