"""Requirements that no design can meet: beyond what a quantity can be, or contradictory."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

from suspension_cli.errors import Fault, InputError
from suspension_cli.quantities.requirements import Requirement


def demand_possible(required: Sequence[Requirement]) -> None:
    """Raise `InputError` with the requirements, tables of a design, that no design can meet."""
    faults: list[Fault] = []
    possible: list[Requirement] = []
    for one in required:
        beyond = _find_beyond(one)
        if beyond is None:
            possible.append(one)
        else:
            faults.append(beyond)
    for first, second in itertools.permutations(possible, 2):
        if first.quantity == second.quantity and _least(first) > _most(second):
            faults.append(_describe_contradiction(first, second))
    if faults:
        raise InputError(faults)


def _least(required: Requirement) -> float:
    """Least value that meets a requirement."""
    limits = required.limits
    return -limits.high if required.limits_magnitude else limits.low


def _most(required: Requirement) -> float:
    """Largest value that meets a requirement."""
    return required.limits.high


def _find_beyond(required: Requirement) -> Fault | None:
    """Find a limit beyond all values that the quantity can have."""
    low, high = required.quantity.bounds
    name = required.quantity.text
    table = required.limits.key.removesuffix(".quantity")
    remedy = "correct the limit"
    if _most(required) < low:
        problem = f"can never be met: {name} is never below {low:g}"
        return Fault(f"{table}.at_most", problem, remedy, f"{_most(required):g}")
    if _least(required) > high:
        problem = f"can never be met: {name} is never above {high:g}"
        return Fault(f"{table}.at_least", problem, remedy, f"{_least(required):g}")
    return None


def _describe_contradiction(above: Requirement, below: Requirement) -> Fault:
    """Say that one requirement demands more than another allows."""
    tables = [one.limits.key.removesuffix(".quantity") for one in (above, below)]
    problem = (
        f"contradicts {tables[1]}.at_most = {_most(below):g}, on the same quantity"
        f" ({above.quantity.text}), so no design can meet both"
    )
    remedy = "correct one of the two limits"
    return Fault(f"{tables[0]}.at_least", problem, remedy, f"{_least(above):g}")
