"""Parameters of a design that follow from others, in the table `[[tie]]` or by ``--tie``.

>>> apply({"a": {"x": 1.0}, "tie": [{"name": "a.y", "equals": "2 * a.x + 1e-3"}]})["a"]
{'x': 1.0, 'y': 2.001}

Ties are computed in their order: each may use those before it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, TypeVar

from suspension_cli.design import expressions, paths
from suspension_cli.design.schema import Tie
from suspension_cli.design.typed_tables import Raw, Table
from suspension_cli.errors import Fault, InputError, format_value, suggest

Tree = TypeVar("Tree", bound="Raw | Table")


def parse(text: str) -> Raw:
    """Return the table of a tie that is given as ``PATH = EXPRESSION``; raises `InputError`."""
    name, equals, expression = (part.strip() for part in text.partition("="))
    if not equals or not expressions.PATH.fullmatch(name):
        remedy = f"write for example --tie 'stage.test.wires.t2 = {expressions.EXAMPLE}'"
        problem = "is not of the form PATH = EXPRESSION"
        raise InputError.of("--tie", problem, remedy, format_value(text))
    try:
        expressions.terms(expression)
    except InputError as error:
        fault = error.faults[0]
        raise InputError.of("--tie", fault.problem, fault.remedy, format_value(text)) from None
    return {"name": name, "equals": expression}


def name_option(error: InputError, before: int, given: Sequence[str]) -> InputError:
    """Let faults of the ties after the first `before` name ``--tie``, by which they are `given`."""
    faults: list[Fault] = []
    for fault in error.faults:
        table, number, *_ = [*fault.key.split("."), ""]
        place = int(number) - before - 1 if table == "tie" and number.isdigit() else -1
        if place >= 0:
            fault = replace(fault, key="--tie", value=format_value(given[place]))
        faults.append(fault)
    return InputError(faults, error.file)


def apply(tree: Tree) -> Tree:
    """Compute the tied parameters of a parsed document or a design; raises `InputError`.

    In a document that has faults elsewhere, ties that cannot be applied are left to its checks.
    """
    listed = [*_listed(tree)]
    faults: list[Fault] = []
    for place, (name, expression) in enumerate(listed, 1):
        try:
            tree = _with_one(tree, name, expression)
        except InputError as error:
            faults += [replace(one, key=f"tie.{place}.{one.key}") for one in error.faults]
    if faults:
        raise InputError(faults)
    for place, (name, expression) in enumerate(listed, 1):
        # else each reading of the design would change it again
        if expressions.value(expression, partial(_number_at, tree)) != paths.value_at(tree, name):
            problem = f"{name} depends on itself, on a tie behind it, or is tied twice"
            remedy = "tie each parameter once, to parameters that are given or tied before it"
            raise InputError.of(f"tie.{place}.equals", problem, remedy, format_value(expression))
    return tree


def _number_at(tree: Raw | Table, path: str) -> float:
    return float(paths.value_at(tree, path))


def names(tree: Raw | Table) -> list[str]:
    """List the paths of the tied parameters of a parsed document or a design."""
    return [name for name, _ in _listed(tree)]


def refuse(tree: Raw | Table, changed: Sequence[str], option: str) -> None:
    """Raise `InputError` where a parameter is given or varied that follows from others."""
    for name, expression in _listed(tree):
        for path in changed:
            if path in paths.twins(name):
                problem = f"follows from others: it is tied to {expression}"
                remedy = "change one of those, or remove the tie"
                raise InputError.of(option, problem, remedy, format_value(path))


def _listed(tree: Raw | Table) -> Iterator[tuple[str, str]]:
    """Names and expressions of the ties that have a valid form; checks report the others."""
    found: Any = tree.get("tie", []) if isinstance(tree, dict) else getattr(tree, "tie", [])
    for item in found if isinstance(found, (list, tuple)) else ():
        if isinstance(item, Tie):
            yield item.name, item.equals
        elif isinstance(item, dict):
            name = item.get("name")
            expression = item.get("equals")
            if not isinstance(name, str) or not isinstance(expression, str):
                continue
            if expressions.PATH.fullmatch(name) and _is_expression(expression):
                yield name, expression


def _is_expression(text: str) -> bool:
    try:
        expressions.terms(text)
    except InputError:
        return False
    return True


def _with_one(tree: Tree, name: str, expression: str) -> Tree:
    """Set one tied parameter; raises `InputError` with the key ``name`` or ``equals``."""

    def known(path: str) -> float:
        found = paths.value_at(tree, path)
        if isinstance(found, bool) or not isinstance(found, (int, float)):
            what = "no such number" if found is None else "no number"
            remedy = f"give it in the design; {suggest(path, _numbers_near(tree, path))}"
            problem = f"the design gives {what} at {path}"
            raise InputError.of("equals", problem, remedy, format_value(expression))
        return float(found)

    try:
        number = expressions.value(expression, known)
    except (ArithmeticError, ValueError) as error:
        reason = str(error) or type(error).__name__
        remedy = "correct the expression, or the parameters in it"
        raise InputError.of(
            "equals", f"has no value ({reason})", remedy, format_value(expression)
        ) from None
    for path in paths.twins(name):
        try:
            tree = paths.changed(tree, path.split("."), lambda _: number, f"{path}={number!r}")
        except (InputError, AttributeError, TypeError) as error:
            fault = error.faults[0] if isinstance(error, InputError) else None
            problem = fault.problem if fault else "leads to no parameter of the design"
            remedy = fault.remedy if fault else "take a path that --set takes"
            raise InputError.of("name", problem, remedy, format_value(name)) from None
    return tree


def _numbers_near(tree: Raw | Table, path: str) -> list[str]:
    """Paths of the numbers of a parsed document, for suggestions."""
    if not isinstance(tree, dict):
        return []
    head = path.partition(".")[0]
    return [
        name for key, item in tree.items() if key == head for name, _ in paths.numbers(key, item)
    ]
