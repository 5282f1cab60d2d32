"""Pytest plugin that compares arrays with the shapes in annotations, at every call of the tests.

    .venv/bin/python -m pytest -p tests.support.shapes tests/elements

Axes of one name must be equally long within one call, or within one object of a dataclass or named
tuple. A number counts as an array without axes.
"""

from __future__ import annotations

import ast
import collections
import dataclasses
import functools
import importlib
import inspect
import pkgutil
from collections.abc import Callable
from typing import Any

import numpy as np

import suspension_cli

Check = Callable[[Any, dict[str, Any]], str]
"""From a value and the known lengths of axes to what is wrong; "" if nothing is."""

KINDS = {"Float": "f", "Complex": "c", "Inexact": "fc", "Int": "iu", "Bool": "b"}
NUMBERS = {"float": (float, int), "complex": (complex, float, int), "bool": (bool,)}
wrong: collections.Counter[str] = collections.Counter()
seen: collections.Counter[str] = collections.Counter()


def compare(value: Any, kind: str, axes: list[str], known: dict[str, Any]) -> str:
    """Compare an array with its axes: numbers, names, expressions of names, and *several."""
    if not isinstance(value, np.ndarray | np.generic):
        return f"{type(value).__name__} is no array"
    if value.dtype.kind not in KINDS[kind]:
        return f"{value.dtype} is not {kind}"
    shape, text = value.shape, f"shape {value.shape} is not ({' '.join(axes)}), {known}"
    many = [n for n, axis in enumerate(axes) if axis.startswith(("*", "..."))]
    if len(shape) < len(axes) - len(many) or (not many and len(shape) > len(axes)):
        return text
    if many:
        first, last = many[0], len(shape) - (len(axes) - many[0] - 1)
        name = axes[first]
        if (
            name[:2] not in ("..", "*#")
            and known.setdefault(name, shape[first:last]) != (shape[first:last])
        ):
            return text
        axes, shape = axes[:first] + axes[first + 1 :], shape[:first] + shape[last:]
    for axis, length in zip(axes, shape, strict=True):
        if axis.isidentifier():
            expected = known.setdefault(axis, length)
        else:
            try:
                expected = eval(axis, {}, dict(known))
            except NameError:  # an expression of an axis that is not known yet
                continue
        if axis != "_" and expected != length:
            return text
    return ""


def check_of(node: ast.expr) -> Check | None:
    """Make the check of an annotation; None if it has no arrays."""
    if isinstance(node, ast.BinOp):
        return _union([node.left, node.right])
    if not isinstance(node, ast.Subscript):
        return None
    head, parts = ast.unparse(node.value), getattr(node.slice, "elts", [node.slice])
    if head in KINDS:
        axes = parts[1].value.split()
        return lambda value, known: compare(value, head, axes, known)
    if head == "tuple" and not (isinstance(parts[-1], ast.Constant) and parts[-1].value is ...):
        checks = [check_of(part) for part in parts]
        if not any(checks):
            return None
        return lambda value, known: next(
            (text for v, c in zip(value, checks, strict=True) if c and (text := c(v, known))), ""
        )
    if head in ("tuple", "list", "Sequence", "dict"):
        one = check_of(parts[1] if head == "dict" else parts[0])
        values = dict.values if head == "dict" else iter
        return one and (
            lambda value, known: next((t for v in values(value) if (t := one(v, known))), "")
        )
    return None


def _union(sides: list[ast.expr]) -> Check | None:
    checks = [check_of(side) for side in sides]
    if not any(checks):
        return None
    plain = [ast.unparse(s) for s, check in zip(sides, checks, strict=True) if check is None]

    def check(value: Any, known: dict[str, Any]) -> str:
        for name in plain:
            if isinstance(value, NUMBERS.get(name, type(None) if name == "None" else object)):
                return ""
        text = ""
        for one in checks:
            trial = dict(known)
            if one and not (text := one(value, trial)):
                known.update(trial)
                return ""
        return text

    return check


def checks_of(annotations: dict[str, Any]) -> dict[str, Check]:
    """Checks of the annotations of a function or class that have arrays."""
    found = {
        name: check_of(ast.parse(text, mode="eval").body)
        for name, text in annotations.items()
        if isinstance(text, str) and "np.ndarray, " in text
    }
    return {name: check for name, check in found.items() if check}


def checked(function: Callable[..., Any], label: str) -> Callable[..., Any]:
    """Wrap a function whose annotations have arrays."""
    checks = checks_of(getattr(function, "__annotations__", {}))
    if not checks:
        return function
    signature = inspect.signature(function)
    rest = [p.name for p in signature.parameters.values() if p.kind == p.VAR_POSITIONAL]

    @functools.wraps(function)
    def wrapped(*args: Any, **named: Any) -> Any:
        seen[label] += 1
        known: dict[str, Any] = {}
        for name, value in signature.bind(*args, **named).arguments.items():
            if name in checks:
                for one in value if name in rest else [value]:
                    _note(f"{label}.{name}", checks[name](one, known))
        result = function(*args, **named)
        if "return" in checks:
            _note(f"{label} ->", checks["return"](result, known))
        return result

    return wrapped


def _note(place: str, text: str) -> None:
    if text:
        wrong[f"{place}: {text}"] += 1


def _check_class(kind: type, label: str) -> None:
    checks = checks_of(inspect.get_annotations(kind))
    if checks and dataclasses.is_dataclass(kind):
        make = kind.__init__

        @functools.wraps(make)
        def init(self: Any, *args: Any, **named: Any) -> None:
            make(self, *args, **named)
            seen[label] += 1
            known: dict[str, Any] = {}
            for name, check in checks.items():
                _note(f"{label}.{name}", check(getattr(self, name), known))

        kind.__init__ = init
    if checks and issubclass(kind, tuple):
        build = kind.__new__

        @functools.wraps(build)
        def new(cls: type, *args: Any, **named: Any) -> Any:
            made = build(cls, *args, **named)
            seen[label] += 1
            known: dict[str, Any] = {}
            for name, check in checks.items():
                _note(f"{label}.{name}", check(getattr(made, name), known))
            return made

        kind.__new__ = new
    for name, member in list(vars(kind).items()):
        own = f"{label}.{name}"
        if inspect.isfunction(member) and name != "__init__":
            setattr(kind, name, checked(member, own))
        elif isinstance(member, property) and member.fget is not None:
            setattr(kind, name, property(checked(member.fget, own)))
        elif isinstance(member, functools.cached_property):
            member.func = checked(member.func, own)


def pytest_configure() -> None:
    """Wrap every function and class of the program, in all modules that import it."""
    modules = [
        importlib.import_module(found.name)
        for found in pkgutil.walk_packages(suspension_cli.__path__, "suspension_cli.")
        if not found.name.endswith("__main__")
    ]
    replaced: dict[int, tuple[Any, Any]] = {}
    for module in modules:
        for name, member in list(vars(module).items()):
            if getattr(member, "__module__", "") != module.__name__:
                continue
            label = f"{module.__name__.removeprefix('suspension_cli.')}.{name}"
            if inspect.isclass(member):
                _check_class(member, label)
            elif hasattr(member, "__annotations__"):
                replaced[id(member)] = (member, checked(member, label))
    for module in modules:
        for name, member in list(vars(module).items()):
            if id(member) in replaced and replaced[id(member)][0] is member:
                setattr(module, name, replaced[id(member)][1])


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """List what differs, once per place."""
    places: dict[str, list[str]] = {}
    for text in wrong:
        places.setdefault(text.partition(": ")[0], []).append(text)
    for texts in places.values():
        terminalreporter.write_line(
            f"SHAPE {texts[0]} ({sum(wrong[text] for text in texts)} times)"
        )
    terminalreporter.write_line(
        f"shapes of {len(seen)} functions and classes checked in {sum(seen.values())} calls,"
        f" {len(places)} wrong"
    )
