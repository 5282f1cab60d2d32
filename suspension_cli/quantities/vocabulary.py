"""The names of all quantities: which kinds there are, and what a name means in a design."""

from __future__ import annotations

import importlib
import pkgutil
import re
from collections.abc import Sequence
from functools import cache

from suspension_cli.design.derive import mirror
from suspension_cli.design.faults import suggest
from suspension_cli.errors import InputError, format_value, gather
from suspension_cli.quantities import kinds
from suspension_cli.quantities.kind import Kind
from suspension_cli.quantities.kinds.modes import ALL
from suspension_cli.quantities.names import Names
from suspension_cli.quantities.quantity import Quantity


@cache
def every_kind() -> tuple[Kind, ...]:
    """List the kinds of all files of `quantities/kinds`, in the order of their names."""
    names = sorted(module.name for module in pkgutil.iter_modules(kinds.__path__))
    modules = [importlib.import_module(f"{kinds.__name__}.{name}") for name in names]
    return tuple(kind for module in modules for kind in module.KINDS)


def parse(text: str, names: Names, option: str = "--result") -> Quantity:
    """Parse a name of a quantity of a design.

    Raises `InputError`, which names the `option`, if the design has no such quantity.
    """
    plain = " ".join(text.split())
    for kind in every_kind():
        found = kind.parse(plain, names, option)
        if found is not None:
            return found
    if plain == ALL:
        remedy = f"name one, such as {names.labels[0]!r} or 'lowest pitch'"
        raise InputError.of(
            option, "means every mode, not one quantity", remedy, format_value(text)
        )
    written = [_in_design(kind.example, names) for kind in every_kind()]
    examples = [example for example in written if example != plain]
    remedy = suggest(plain, list(dict.fromkeys([*names.labels, *examples])))
    raise InputError.of(option, "is no quantity of this design", remedy, format_value(text))


def demand_derivative(quantity: Quantity, option: str) -> None:
    """Raise `InputError`, which names the `option`, if a quantity jumps between values."""
    if quantity.jumps:
        remedy = "take 'margin loops.distance', which is 0 at the limit of stability"
        problem = "is 0 or 1, so that it has no derivative"
        raise InputError.of(option, problem, remedy, format_value(quantity.text))


def _in_design(example: str, names: Names) -> str:
    """Write an example of a name with the first stage and the mirror of a design."""
    own = {"upper": names.design.stage[0].name, "test": mirror(names.design)}
    return re.sub(r"\b(upper|test)\b", lambda found: own[found[0]], example)


def parse_all(texts: Sequence[str], names: Names, option: str = "--result") -> tuple[Quantity, ...]:
    """Parse names of quantities, each quantity once; raises `InputError` with all faults."""
    found = gather(lambda text: parse(text, names, option), texts)
    return tuple(dict.fromkeys(found))
