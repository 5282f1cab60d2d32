"""Requirements that no design can meet: beyond what a quantity can be, or contradictory."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import TYPE_CHECKING

from suspension_cli.errors import Fault, InputError

if TYPE_CHECKING:
    from suspension_cli.quantities.requirements import Requirement


def demand_possible(required: Sequence[Requirement]) -> None:
    """Raise `InputError` with the requirements, of one design, that no design can meet."""
    faults: list[Fault] = []
    possible: list[Requirement] = []
    for one in required:
        beyond = _find_beyond(one)
        if beyond is None:
            possible.append(one)
        else:
            faults.append(beyond)
    for first, second in itertools.permutations(possible, 2):
        if first.quantity == second.quantity and _are_apart(first, second):
            faults.append(_describe_contradiction(first, second))
    if faults:
        raise InputError(faults)


def _least(required: Requirement) -> float:
    """Least value that meets a requirement."""
    limits = required.limits
    if required.limits_magnitude and required.quantity.signed:
        return -limits.high
    return limits.low


def _are_apart(above: Requirement, below: Requirement) -> bool:
    """Whether one requirement demands more than another allows, of values or of magnitudes."""
    if above.limits_magnitude and below.limits_magnitude:
        return above.limits.low > below.limits.high
    return _least(above) > below.limits.high


def _find_beyond(required: Requirement) -> Fault | None:
    """Find a limit beyond all values that the quantity can have."""
    low, high = required.quantity.bounds
    limits = required.limits
    name = required.quantity.text
    remedy = "correct the limit"
    if limits.high < low:
        problem = f"can never be met: {name} is never below {low:g}"
        return Fault(limits.high_key, problem, remedy, f"{limits.high:g}")
    if _least(required) > high:
        problem = f"can never be met: {name} is never above {high:g}"
        return Fault(limits.low_key, problem, remedy, f"{limits.low:g}")
    return None


def _describe_contradiction(above: Requirement, below: Requirement) -> Fault:
    """Say that one requirement demands more than another allows."""
    problem = (
        f"contradicts {below.limits.high_key} = {below.limits.high:g}, on the same quantity"
        f" ({above.quantity.text}), so no design can meet both"
    )
    remedy = "correct one of the two limits"
    return Fault(above.limits.low_key, problem, remedy, f"{above.limits.low:g}")
