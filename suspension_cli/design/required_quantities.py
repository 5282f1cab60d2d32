"""What a design must meet: limits on quantities, in the table `[[requirement]]`."""

from __future__ import annotations

from suspension_cli.design import key_rules
from suspension_cli.design.typed_tables import Table, key
from suspension_cli.design.units import Number


class RequiredQuantity(Table, frozen=True):
    """A limit on a quantity of the design."""

    quantity: str = key("name of a quantity, such as 'thermal test.x:10'", max_length=200)
    at_least: Number | None = key("smallest value, in the quantity's unit")
    at_most: Number | None = key(
        "largest value, in the quantity's unit; alone and positive, of the magnitude"
    )
    note: str = key("origin of the requirement, for reports", "", max_length=200)

    rules = (key_rules.any_of("at_least", "at_most"), key_rules.ordered("at_least", "at_most"))
