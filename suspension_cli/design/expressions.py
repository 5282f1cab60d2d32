"""Arithmetic expressions of a design file: numbers, dotted paths, operators, sqrt and pi.

>>> value("sqrt(a.x) / 2 + 1e-3", {"a.x": 9.0}.__getitem__)
1.501
"""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Any

from suspension_cli.errors import InputError

EXAMPLE = "stage.test.wires.t1 + 5e-3"
OPERATORS: Mapping[type[ast.AST], Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: math.pow,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}
LONGEST = 1000
"""Characters of an expression."""
DEEPEST = 50
"""Operations within each other."""
_NUMBER = re.compile(r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
_PART = r"\w+(?:-[A-Za-z]\w*)*"
PATH = re.compile(rf"(?!\d)(?:{_PART}\.)+\w+")
"""Parts may be numbers (``inertia.2``); all but the last may have hyphens, before letters."""


def terms(expression: str) -> tuple[str, ...]:
    """List the paths in an expression; raises `InputError` if it is none."""
    return _parsed(expression)[1]


def value(expression: str, known: Callable[[str], float]) -> float:
    """Evaluate an expression, with the values of its paths.

    Raises `ArithmeticError` or `ValueError` where it has no value.

    >>> value("2 * a.x ** 2", {"a.x": 3.0}.__getitem__)
    18.0
    """
    tree, names = _parsed(expression)
    return _evaluate(tree, [known(name) for name in names])


@lru_cache(maxsize=256)
def _parsed(expression: str) -> tuple[ast.expr, tuple[str, ...]]:
    """Parse an expression; return its tree, and the paths that are ``_0``, ``_1``, ... in it."""
    found: list[str] = []

    def number_path(match: re.Match[str]) -> str:
        text = match.group()
        if text not in found:
            found.append(text)
        return f"_{found.index(text)}"

    if len(expression) > LONGEST:
        raise InputError.of("equals", f"has more than {LONGEST} characters", "write it shorter")
    plain = _spelled(expression, number_path)
    try:
        tree = ast.parse(plain, mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise InputError.of("equals", "is no expression", _REMEDY, expression) from None
    _demand_simple(tree, expression, DEEPEST)
    return tree, tuple(found)


_REMEDY = f"write numbers, paths, + - * / ** and parentheses: '{EXAMPLE}'"


def _spelled(expression: str, number_path: Callable[[re.Match[str]], str]) -> str:
    """Replace the paths of an expression by names; numbers stay, as a path may look like one."""
    parts: list[str] = []
    position = 0
    while position < len(expression):
        path = PATH.match(expression, position)
        number = _NUMBER.match(expression, position)
        if path:
            parts.append(number_path(path))
            position = path.end()
        elif number:
            parts.append(number.group())
            position = number.end()
        elif expression[position] == "_":  # not a name that stands for a path
            raise InputError.of("equals", "is no expression", _REMEDY, expression)
        else:
            parts.append(expression[position])
            position += 1
    return "".join(parts)


def _demand_simple(node: ast.AST, expression: str, levels: int) -> None:
    """Raise `InputError` for anything but numbers, paths, the operators, sqrt and pi."""
    below: list[ast.expr] = []
    good = levels > 0
    match node:
        case ast.BinOp(left=left, op=op, right=right):
            good &= type(op) in OPERATORS
            below = [left, right]
        case ast.UnaryOp(op=op, operand=operand):
            good &= type(op) in OPERATORS
            below = [operand]
        case ast.Call(func=ast.Name(id="sqrt"), args=[argument], keywords=[]):
            below = [argument]
        case ast.Name(id=name):
            good &= name == "pi" or name.startswith("_")
        case ast.Constant(value=number):
            good &= isinstance(number, (int, float)) and not isinstance(number, bool)
        case _:
            good = False
    if not good:
        raise InputError.of("equals", "is no expression", _REMEDY, expression)
    for one in below:
        _demand_simple(one, expression, levels - 1)


def _evaluate(node: ast.AST, known: Sequence[float]) -> float:
    """Evaluate the tree of an expression, see `_parsed`."""
    match node:
        case ast.BinOp(left=left, op=op, right=right):
            return OPERATORS[type(op)](_evaluate(left, known), _evaluate(right, known))
        case ast.UnaryOp(op=op, operand=operand):
            return OPERATORS[type(op)](_evaluate(operand, known))
        case ast.Call(args=[argument]):
            return math.sqrt(_evaluate(argument, known))
        case ast.Name(id="pi"):
            return math.pi
        case ast.Name(id=name):
            return known[int(name.removeprefix("_"))]
        case ast.Constant(value=number):
            return float(number)  # pyright: ignore[reportArgumentType]
        case _:
            raise TypeError(ast.dump(node))  # _demand_simple has refused it
