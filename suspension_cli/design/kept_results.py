"""Results that are kept because several analyses of a command ask for them in turn.

>>> @keep_last
... def count_stages(design: Design) -> int:
...     print("counts")
...     return len(design.stage)
>>> import suspension_cli as sus
>>> design = sus.example("double").design
>>> count_stages(design) + count_stages(design)
counts
4
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import TypeVar

from suspension_cli.design.schema import Design

Result = TypeVar("Result")


def keep_last(function: Callable[[Design], Result]) -> Callable[[Design], Result]:
    """Keep the last result of a function of a design, for the next call with the same object."""
    last: list[tuple[Design, Result]] = []

    @wraps(function)
    def kept(design: Design) -> Result:
        for known, result in last:
            if known is design:
                return result
        result = function(design)
        last[:] = [(design, result)]
        return result

    return kept
