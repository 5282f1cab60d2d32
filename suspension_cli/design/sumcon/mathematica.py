"""Lists that Mathematica saved: ``save$mass = {{26.6, {1.99, 0, 0}}, ...}``, read as data.

Only lists, numbers, texts, and names without a value are read; nothing is evaluated.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from suspension_cli.errors import Fault, InputError, format_value

Value = float | bool | str | list["Value"]
"""What a list contains; names other than True and False are texts."""
DEEPEST, MOST = 12, 200_000
"""Levels and members of one list: far more than those of any suspension."""

_STATEMENT = r"^{}[ \t]*=(?!=)"
_TOKEN = re.compile(
    r"""\s*+(?:(?P<mark>[{},])
    |"(?P<text>(?:[^"\\]|\\.)*+)"
    |(?P<number>[-+]?+(?:\d++\.?+\d*+|\.\d++))(?:``?+[-+.\d]*+)?+(?:\*\^(?P<power>[-+]?+\d{1,4}))?+
    |(?P<name>[A-Za-z$][\w$]*+))\s*+""",
    re.VERBOSE | re.DOTALL,
)


def read_list(text: str, name: str) -> list[Value] | None:
    """Read the list that the last statement of a name assigns; None without such a statement.

    Raises `InputError` if the statement ends too early or assigns an expression.
    """
    found = [match.end() for match in re.finditer(_STATEMENT.format(re.escape(name)), text, re.M)]
    if not found:
        return None
    at, stack, members, separated = found[-1], [[]], 0, True
    while len(stack) > 1 or not stack[0]:
        token = _TOKEN.match(text, at)
        mark = token["mark"] if token else None
        fits = mark in (",", "}")
        if separated:  # a member is due, or the end of an empty list
            fits = mark != "," and not (mark == "}" and stack[-1])
        if token is None or not fits:
            if text[at:].strip():
                start = format_value(text[at : at + 30].strip())
                problem = "is not a list of numbers and texts"
                raise InputError.of(name, problem, "save the model in SUMCON again", start)
            raise InputError.of(name, "ends too early", "the file is truncated: copy it again")
        at, members, separated = token.end(), members + 1, mark in ("{", ",")
        if mark == "{":
            stack.append([])
        elif mark == "}":
            value = stack.pop()
            stack[-1].append(value)
        elif mark is None:
            stack[-1].append(_value(token, name))
        if members > MOST or len(stack) > DEEPEST or (len(stack) == 1 and mark != "}"):
            problem, remedy = "is no list of a suspension", "name a save of SUMCON"
            raise InputError.of(name, problem, remedy)
    (result,) = stack[0]
    assert isinstance(result, list)
    return result


def _value(token: re.Match[str], name: str) -> Value:
    if token["number"] is None:
        word = token["name"]
        return token["text"] if word is None else {"True": True, "False": False}.get(word, word)
    value = float(f"{token['number']}e{token['power'] or 0}")
    if not abs(value) < 1e150:
        remedy = "correct it in SUMCON"
        raise InputError.of(name, "has a number too large", remedy, format_value(value))
    return value


Form = type | Sequence["Form"]
"""Form of a value: float, bool or str, or the forms of a list's members."""


def find_fault(value: Value, form: Form, path: str) -> Fault | None:
    """Find the first place where a value has another form; lists may have further members."""
    if isinstance(form, type):
        if isinstance(value, form):
            return None
        wanted = {float: "a number", bool: "True or False", str: "a text"}[form]
        return Fault(path, f"is not {wanted}", "save the model in SUMCON again", _shown(value))
    if not isinstance(value, list) or len(value) < len(form):
        problem = f"is not a list of {len(form)}"
        return Fault(path, problem, "save the model in SUMCON 1.3 again", _shown(value))
    pairs = enumerate(zip(value, form, strict=False), 1)
    found = (find_fault(one, own, f"{path}.{n}") for n, (one, own) in pairs)
    return next(filter(None, found), None)


def _shown(value: Value) -> str:
    return f"a list of {len(value)}" if isinstance(value, list) else format_value(value)
