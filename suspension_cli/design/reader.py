"""TOML in and out: read a file, apply overrides, check it, give a frozen `Design`."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec

from suspension_cli.design import checks, faults
from suspension_cli.design.schema import Design
from suspension_cli.errors import Fault, InputError, shown

MAX_BYTES = 4_000_000
"""A design file larger than this is a mistake (a results file, a picture)."""

_TOO_DEEP = Fault("", "tables or arrays are nested too deeply", "write it flatter")


@dataclass(frozen=True)
class Source:
    """A design and where it came from.

    Attributes
    ----------
    design : Design
    text : str
        The whole design as TOML, overrides applied; what results embed.
    file : str
        The path as the user gave it.
    """

    design: Design
    text: str
    file: str


def read(file: str | Path, overrides: tuple[str, ...] = ()) -> Source:
    """Read and check one design file.

    Parameters
    ----------
    file : path
    overrides : tuple of str
        ``path=value`` settings, as `apply_overrides` takes them.

    Raises
    ------
    InputError
        With every fault of the file.
    """
    name = str(file)
    try:
        raw = _parse(_text(Path(file)))
        apply_overrides(raw, overrides)
        design = convert(raw)
    except InputError as error:
        raise error.in_file(name) from None
    try:
        return Source(design, dump(raw), name)
    except RecursionError:
        raise InputError([_TOO_DEEP], name) from None


def text_of(file: str | Path) -> str:
    """The text of a file, which may be a pipe and is read once; raises `InputError` if it cannot be read."""
    try:
        return _text(Path(file))
    except InputError as error:
        raise error.in_file(str(file)) from None


def document(file: str | Path, text: str | None = None) -> dict[str, Any]:
    """A TOML file (or its text, if that was read before) as it stands, whatever it should hold; raises `InputError` if it is none."""
    try:
        return _parse(_text(Path(file)) if text is None else text, "write tables into it, as docs/ shows")
    except InputError as error:
        raise error.in_file(str(file)) from None


def parse(text: str) -> Design:
    """A checked design from TOML text."""
    return convert(_parse(text))


def overridden(text: str, overrides: tuple[str, ...]) -> Design:
    """A checked design from TOML text with overrides applied."""
    raw = _parse(text)
    apply_overrides(raw, overrides)
    return convert(raw)


def convert(raw: dict[str, Any]) -> Design:
    """A checked design from a parsed document; raises `InputError` with all its faults."""
    try:
        found = faults.of_table(raw)
    except RecursionError:
        found = [_TOO_DEEP]
    if found:
        raise InputError(found)
    design = msgspec.convert(raw, Design)
    found = checks.of_design(design)
    if found:
        raise InputError(found)
    return design


def dump(raw: dict[str, Any]) -> str:
    """A parsed document as TOML text."""
    import tomli_w

    return tomli_w.dumps(raw)


def _text(path: Path) -> str:
    try:
        if path.is_dir():
            raise InputError([Fault("", "is a directory", "name a TOML file in it")])
        with path.open("rb") as stream:
            data = stream.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError([Fault("", f"cannot be read ({reason})", "check the path and its permissions")]) from None
    if len(data) > MAX_BYTES:
        raise InputError([Fault("", f"has more than {MAX_BYTES} bytes, too many for a design", "name a TOML design file")])
    try:
        text = data.decode("utf-8-sig")  # some editors begin a file with a byte-order mark
    except UnicodeDecodeError:
        raise InputError([Fault("", "is not text (UTF-8)", "name a TOML design file")]) from None
    return text


def _parse(text: str, remedy: str = "start a design with `pendsus new`") -> dict[str, Any]:
    try:
        raw = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError([Fault("", f"is not TOML: {error}", "mend the line named")]) from None
    except RecursionError:
        raise InputError([_TOO_DEEP]) from None
    except ValueError:  # all that Python does not read of TOML's numbers
        raise InputError([Fault("", "is not TOML: a number has thousands of digits", "write it shorter")]) from None
    if not raw:
        raise InputError([Fault("", "is empty", remedy)])
    return raw


def apply_overrides(raw: dict[str, Any], overrides: tuple[str, ...]) -> None:
    """Set values in a parsed document, in place.

    Parameters
    ----------
    raw : dict
    overrides : tuple of str
        ``stage.test.wires.d=0.002``: a dotted path, members of lists by their name or their number
        from 1, then a TOML value (a bare word is taken as a string).  Tables on the way are made
        where they are missing; a missing member of a list is a fault.
    """
    for override in overrides:
        if any("\ud800" <= letter <= "\udfff" for letter in override):
            raise InputError([Fault("--set", "holds bytes that are no text", "write it in UTF-8", shown(override))])
        path, equals, value = override.partition("=")
        keys = [key.strip() for key in path.split(".")]
        if not equals or not all(keys):
            raise InputError([Fault("--set", "is not of the form path=value", "write for example --set stage.test.wires.d=0.002", shown(override))])
        try:
            parsed = tomllib.loads(f"value = {value}")["value"]
        except (tomllib.TOMLDecodeError, RecursionError, ValueError):
            parsed = value.strip()
        _assign(raw, keys, parsed, override)


def _assign(node: Any, keys: list[str], value: Any, override: str) -> None:
    place: Any = ""
    for depth, key in enumerate(keys):
        last = depth == len(keys) - 1
        place = key
        if isinstance(node, list):
            place = _member(node, key, override)
        elif not isinstance(node, dict):
            raise InputError([Fault("--set", f"{'.'.join(keys[:depth])} is a value, not a table", "shorten the path", shown(override))])
        elif not last and key not in node:
            node[key] = {}
        if not last:
            node = node[place]
    node[place] = value


def _member(items: list[Any], key: str, override: str) -> int:
    """Position of the member of a list that goes by this name or number."""
    for position, item in enumerate(items):
        if isinstance(item, dict) and item.get("name") == key:
            return position
    if key.isascii() and key.isdigit() and 1 <= int(key) <= len(items):
        return int(key) - 1
    names = [str(item.get("name", n)) if isinstance(item, dict) else str(n) for n, item in enumerate(items, 1)]
    raise InputError([Fault("--set", f"there is no {key!r} here", faults.suggestion(key, names), shown(override))])


def value_at(raw: dict[str, Any], path: str) -> Any:
    """What a parsed document holds at a dotted path (as `apply_overrides` takes it); None if it holds nothing there."""
    node: Any = raw
    for key in path.split("."):
        if isinstance(node, list):
            place = next((n for n, item in enumerate(node) if isinstance(item, dict) and item.get("name") == key), None)
            if place is None and key.isascii() and key.isdigit() and 1 <= int(key) <= len(node):
                place = int(key) - 1
            node = None if place is None else node[place]
        else:
            node = node.get(key) if isinstance(node, dict) else None
    return node


def template(kind: str, name: str) -> str:
    """A starting design as TOML text, under its own name."""
    path = Path(__file__).parent / "templates" / f"{kind}.toml"
    return path.read_text(encoding="utf-8").replace('name = "NAME"', f'name = "{name}"', 1)
