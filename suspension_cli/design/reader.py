"""Reading of design files: TOML, overrides and checks, to a frozen `Design`."""

from __future__ import annotations

import contextlib
import copy
import functools
import hashlib
import os
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date, time
from decimal import Decimal
from pathlib import Path
from typing import TypeVar

from suspension_cli.design import DETECTORS, checks, faults, foton_file, paths
from suspension_cli.design.derive import add_keystones, drop_keystones
from suspension_cli.design.schema import Design, Stage
from suspension_cli.design.tables import Raw, Table
from suspension_cli.errors import Fault, InputError, attribute_faults_to, format_value, suggest
from suspension_cli.files import bounded, columns

T = TypeVar("T", bound=Table)
LONGEST_STEM = 150
"""Letters of the start of a file's name; systems take 255 bytes for the whole name."""
EXAMPLES = Path(__file__).parents[1] / "examples"
TEMPLATES = ("single", "double", "triple", "quad", "blades")
"""Starting designs of `pendsus new`."""
KINDS = {
    "design": ("stage",),
    "file of measurements": ("mode", "transfer_function", "experiment"),
    "file of goals": ("goal",),
}
"""Tables that TOML files of each kind have."""

_TOO_DEEP = Fault("", "tables or arrays are nested too deeply", "use fewer levels")
_PART = r"""(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')"""
_LONG_KEY = re.compile(rf"{_PART}(?:[ \t]*+\.[ \t]*+{_PART}){{50}}")
"""Dotted keys whose tables take much memory: as the square of their parts."""


@dataclass(frozen=True)
class Source:
    """A design and its source.

    Attributes
    ----------
    text
        The whole design as TOML with overrides, as results embed it.
    file
        The path as the user gave it.
    given_stem, overrides
        Start of the names of written files, if the user gave one, and the overrides that they name.
    """

    design: Design
    text: str
    file: str
    given_stem: str | None = None
    overrides: tuple[str, ...] = ()

    def stem(self, name: str = "") -> str:
        """Start of the names of written files: as given, else a name with the overrides.

        `name` is that of the design by default.
        """
        return self.given_stem or _with_overrides(name or self.design.design.name, self.overrides)


def _with_overrides(name: str, overrides: tuple[str, ...]) -> str:
    """Add overrides to a name, and a digest of them where letters had to be replaced or left out.

    A name that is itself an override (of `design.name`) suffices.

    >>> _with_overrides("my", ("stage.test.wires.d=0.002", "design.title=Stiffer"))
    'my-test.wires.d=0.002'
    """
    plain = [re.sub(r"\s+", "", text).removeprefix("stage.") for text in overrides]
    if any(text.startswith("design.name=") for text in plain):
        return name
    whole = "-".join([name, *(text for text in plain if not text.startswith("design."))])
    short = re.sub(r"[^A-Za-z0-9._=+-]+", "_", whole)[:LONGEST_STEM]
    return short if short == whole else f"{short}-{hashlib.sha256(whole.encode()).hexdigest()[:8]}"


def read(file: str | Path, overrides: tuple[str, ...] = ()) -> Source:
    """Read and check one design file, with `overrides` as for `apply_overrides`.

    Raises `InputError` with every fault of the file.
    """
    name, folder = str(file), Path(file).parent
    try:
        raw = _parse(_text(Path(file)))
        apply_overrides(raw, overrides)
        _check_kind(raw, "design")
        insert_files(raw, folder)
        return Source(convert(raw), write_toml(raw), name)
    except InputError as error:
        raise error.in_file(name) from None


def _check_kind(raw: Raw, wanted: str) -> None:
    """Raise `InputError` for a TOML file of another kind."""
    for kind, keys in KINDS.items():
        found = [key for key in keys if key in raw]
        if found and kind != wanted and not any(key in raw for key in KINDS[wanted]):
            remedy = f"name a TOML file with {' or '.join(f'[[{key}]]' for key in KINDS[wanted])}"
            raise InputError.of("", f"is a {kind} (it has [[{found[0]}]]), not a {wanted}", remedy)


def read_text(file: str | Path) -> str:
    """Read the text of a file, which may be a pipe; raises `InputError` if it cannot be read."""
    with attribute_faults_to(str(file)):
        return _text(Path(file))


def read_toml(file: str | Path, text: str | None = None) -> Raw:
    """Parse a TOML file, or its text if given; raises `InputError` if it is not TOML."""
    with attribute_faults_to(str(file)):
        whole = _text(Path(file)) if text is None else text
        return _parse(whole, "write tables into it, as docs/ shows")


def read_as(kind: type[T], wanted: str, file: str | Path, text: str | None = None) -> T:
    """Read a file of measurements or goals, or its text if given; raises `InputError`."""
    raw = read_toml(file, text)
    with attribute_faults_to(str(file)):
        _check_kind(raw, wanted)
        return faults.convert(raw, kind)


def parse(text: str) -> Design:
    """Parse and check a design from TOML text."""
    return parse_with_overrides(text, ())


def parse_with_overrides(text: str, overrides: tuple[str, ...]) -> Design:
    """Parse and check a design from TOML text with overrides applied."""
    raw = _parse(text)
    apply_overrides(raw, overrides)
    insert_files(raw, Path(), of_links=False)
    return convert(raw)


@dataclass(frozen=True)
class VariedDesign:
    """A design whose numbers are varied, as a parsed document, and its stages, which are valid.

    A stage without a change is not checked again.
    """

    raw: Raw
    stages: list[Stage]

    @staticmethod
    def of(text: str) -> VariedDesign:
        """Parse and check a design from TOML text."""
        raw = _parse(text)
        insert_files(raw, Path(), of_links=False)
        return VariedDesign(raw, drop_keystones(convert(raw)).stage)

    def at(self, values: Mapping[str, float]) -> Design:
        """The design with other numbers at dotted paths; raises `InputError`."""
        raw = self.raw
        for path, value in values.items():
            keys = path.split(".")
            raw = paths.copied(raw, keys)
            paths.assign(raw, keys, float(value), f"{path}={value!r}")
        return convert(raw, self.stages)


def convert(raw: Raw, sound: Sequence[Stage] = ()) -> Design:
    """Check a parsed document and convert it to a design; raises `InputError` with all faults.

    Stages that equal one of the `sound` ones are not checked again.
    """
    try:
        design = faults.convert(raw, Design, rules=False)
    except RecursionError:
        raise InputError([_TOO_DEEP]) from None
    found = checks.check_design(design, sound)
    if found:
        raise InputError(found)
    return add_keystones(design)


def insert_files(raw: Raw, folder: Path, *, of_links: bool = True) -> None:
    """Replace files that fibres, links and filters name by their numbers, in a parsed document.

    So its text, which results embed, is complete. Names are from `folder`, that of the design;
    profiles may also be among the program's examples. Raises `InputError` for files that cannot be
    read or have another form.
    """
    found: list[Fault] = []
    for path, link in _members(raw, "link", "link") if of_links else ():
        table = link.get("table")
        if isinstance(table, dict) and isinstance(table.get("file"), str):
            if given := [name for name in ("frequency", "real", "imaginary") if name in table]:
                key = f"{path}.table.{given[0]}"
                found.append(Fault(key, "is also in the file", "remove it, or file"))
                continue
            name, form = table.pop("file"), table.pop("form", "real-imaginary")
            with _reported(found, f"{path}.table.file", name):
                table |= _stiffness(folder / name, form)
    control = raw.get("control") if of_links else None
    for path, loop in _members(
        control if isinstance(control, dict) else {}, "loop", "control.loop"
    ):
        for key in ("filter", "sensor_response"):
            table = loop.get(key)
            if isinstance(table, dict):
                with _reported(found, f"{path}.{key}.file", str(table.get("file"))):
                    _insert_sections(table, folder)
    for where, stage in _members(raw, "stage", "stage"):
        wires = [(f"{where}.wires", stage.get("wires")), *_members(stage, "wire", f"{where}.wire")]
        for path, wire in wires:
            own = wire.get("profile") if isinstance(wire, dict) else None
            own = {"file": own} if isinstance(own, str) else own
            if not isinstance(own, dict) or "position" in own or "diameter" in own:
                continue
            if isinstance(name := own.get("file"), str):
                shipped = EXAMPLES / Path(name).name
                local = os.path.exists(folder / name) or not shipped.exists()
                with _reported(found, f"{path}.profile", name):
                    wire["profile"] = own | _diameters(folder / name if local else shipped)
    if found:
        raise InputError(found)


def _members(raw: Raw, key: str, path: str) -> Iterator[tuple[str, Raw]]:
    """List the tables of an array, each behind its path."""
    rows = raw.get(key)
    for number, row in enumerate(rows if isinstance(rows, list) else [], 1):
        if isinstance(row, dict):
            yield f"{path}.{row.get('name', number)}", row


@contextlib.contextmanager
def _reported(found: list[Fault], key: str, name: str) -> Iterator[None]:
    """Collect the faults of a file that is read inside."""
    try:
        yield
    except InputError as error:
        for fault in error.faults:
            problem = ": ".join(filter(None, (fault.key, fault.problem)))
            lost = "give its path from the folder of the design file"
            remedy = lost if problem.startswith("cannot be read") else fault.remedy
            found.append(Fault(key, problem, remedy, format_value(name)))


def _columns(file: Path, counts: tuple[int, ...], remedy: str) -> columns.Columns:
    """Read a CSV file with one of some numbers of columns."""
    found = columns.read(file, bounded.TOML, "a CSV file")
    if len(found.names) not in counts:
        raise InputError.of("", f"has {len(found.names)} columns", remedy)
    return found


def _diameters(file: Path) -> Raw:
    """Read positions and diameters (m) from a CSV file of two columns."""
    found = _columns(file, (2,), "write position,diameter in each line")
    scales = [columns.split_unit(name, columns.PER_M)[1] for name in found.names]
    return {
        key: (found.numbers(n, key) / (scales[n] if found.headed else 1.0)).tolist()
        for n, key in enumerate(("position", "diameter"))
    }


def _insert_sections(table: Raw, folder: Path) -> None:
    """Replace the sections of a Foton filter file in a table, if sound, by a design."""
    match table:
        case {"file": str(file), "module": str(module), "sections": [*numbers]} if (
            all(isinstance(n, int) and 1 <= n <= foton_file.SECTIONS for n in numbers)
            and numbers
            and not table.keys() & {"design", "rate"}
        ):
            text, rate = foton_file.read(folder / file, module, numbers)
            for key in ("file", "module", "sections"):
                del table[key]
            listed = ", ".join(map(str, numbers))
            table |= {"design": text, "rate": rate}
            table.setdefault("source", f"{file}, {module}, sections {listed}")
        case _:
            pass


def _stiffness(file: Path, form: str) -> Raw:
    """Frequency, real and imaginary parts per axis of a CSV file."""
    import numpy as np

    remedy = "give frequency and two columns per axis: 3 columns for one axis, 13 for six"
    found = _columns(file, (3, 13), remedy)
    frequency, *rows = [found.numbers(n, "number") for n in range(len(found.names))]
    first, second = np.array(rows[::2]), np.array(rows[1::2])
    if form == "modulus-loss":
        first, second = first * np.cos(second), first * np.sin(second)
    parts = {"frequency": frequency, "real": first, "imaginary": second}
    return {key: part.tolist() for key, part in parts.items()}


def write_toml(raw: Raw) -> str:
    """Write a parsed document as TOML text; raises `InputError` if it is nested too deeply."""
    import tomli_w

    try:
        return tomli_w.dumps(raw)
    except RecursionError:
        raise InputError([_TOO_DEEP]) from None


def _text(path: Path) -> str:
    return bounded.read_text(path, bounded.TOML, "a design or another TOML file", pipe=True)


def _parse(text: str, remedy: str = "start a design with `pendsus new`") -> Raw:
    try:
        raw = copy.deepcopy(_parsed(text))
    except tomllib.TOMLDecodeError as error:
        raise InputError.of("", f"is not TOML: {error}", "correct that line") from None
    except RecursionError:
        raise InputError([_TOO_DEEP]) from None
    except ValueError:  # numbers of TOML that Python refuses
        problem = "is not TOML: a number has thousands of digits"
        raise InputError.of("", problem, "write it shorter") from None
    if not raw:
        raise InputError.of("", "is empty", remedy)
    return raw


@functools.lru_cache(maxsize=8)
def _parsed(text: str) -> Raw:
    """Parse TOML text; cached, as searches read one text with many overrides."""
    return _loads(text)


def _loads(text: str) -> Raw:
    if long := _LONG_KEY.search(text):
        line = text.count("\n", 0, long.start()) + 1
        raise InputError([replace(_TOO_DEEP, key=f"line {line}")])
    return tomllib.loads(text)


def apply_overrides(raw: Raw, overrides: tuple[str, ...]) -> None:
    """Set values in a parsed document, in place.

    Parameters
    ----------
    overrides
        ``stage.test.wires.d=0.002``: a dotted path (members of lists by name or number from 1) and
        a TOML value (a bare word is a string). Missing tables are added; a missing member of a list
        is a fault.
    """
    for override in overrides:
        shown = format_value(override)
        if not _is_text(override):
            problem, remedy = "contains bytes that are not text", "write it in UTF-8"
            raise InputError.of("--set", problem, remedy, shown)
        path, equals, value = override.partition("=")
        keys = [key.strip() for key in path.split(".")]
        if not equals or not all(keys):
            remedy = "write for example --set stage.test.wires.d=0.002"
            raise InputError.of("--set", "is not of the form path=value", remedy, shown)
        try:
            parsed = _loads(f"value = {value}")["value"]
        except (tomllib.TOMLDecodeError, RecursionError, ValueError):
            parsed = value.strip()
        paths.assign(raw, keys, parsed, override)


def template(kind: str, name: str) -> str:
    """Return a starting design as TOML text, under a name; raises `InputError` if there is none."""
    if kind not in TEMPLATES:
        remedy = suggest(kind, list(TEMPLATES))
        raise InputError.of("kind", "is not a template", remedy, format_value(kind))
    return _renamed(Path(__file__).parent / "templates" / f"{kind}.toml", name)


def make_name(stem: str, default: str = "imported") -> str:
    """Make a name of a design from the stem of a file."""
    return re.sub(r"[^A-Za-z0-9._-]+", "-", stem).strip("-._")[:100] or default


def examples() -> list[str]:
    """List the designs that come with the program, by name."""
    files = EXAMPLES.rglob("*.toml")
    found = (file.relative_to(EXAMPLES).with_suffix("").as_posix() for file in files)
    return sorted({*found, *DETECTORS})


def example(name: str) -> Source:
    """Read a design that comes with the program; raises `InputError` if there is none."""
    return read(_example(name))


def example_text(name: str, new_name: str) -> str:
    """Return a design of the program as TOML text, under a new name."""
    return _renamed(_example(name), new_name)


def _renamed(file: Path, name: str) -> str:
    text = file.read_text(encoding="utf-8")
    return re.sub(r'(?m)^name = ".*"', f'name = "{name}"', text, count=1)


def _example(name: str) -> Path:
    known = examples()
    if name not in known:
        remedy = suggest(name, known)
        raise InputError.of("example", "is not an example design", remedy, format_value(name))
    return EXAMPLES / f"{DETECTORS.get(name, (name,))[0]}.toml"


def replaced(source: Source, changes: Mapping[str, object]) -> Source:
    """Read a design again with other values at dotted paths.

    Raises `InputError` if a path leads nowhere or the new design has faults.
    """
    if not hasattr(changes, "items"):
        remedy = 'write for example {"stage.test.wires.d": 0.002}'
        problem = "must be a dictionary of paths"
        raise InputError.of("changes", problem, remedy, format_value(changes))
    raw = tomllib.loads(source.text)
    for path, value in changes.items():
        if not isinstance(path, str):
            remedy = "write it as a text: stage.test.wires.d"
            raise InputError.of("changes", "is no path", remedy, format_value(path))
        try:
            new = _as_toml(value)
        except RecursionError:
            raise InputError([replace(_TOO_DEEP, key=path)]) from None
        except TypeError as error:
            remedy = "give a number, a text, or a list or dictionary of these"
            raise InputError.of(path, f"cannot be {error}", remedy) from None
        paths.assign(raw, path.split("."), new, path)
    insert_files(raw, Path(source.file).parent, of_links=False)
    return Source(convert(raw), write_toml(raw), source.file)


def _as_toml(value: paths.Value) -> paths.Value:
    """Convert tuples, paths, and numbers and arrays of numpy or xarray, to types of TOML.

    Raises `TypeError` with what is not one of them.
    """
    if isinstance(value, Mapping):
        return {str(key): _as_toml(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_as_toml(item) for item in value]
    if isinstance(value, Path):
        return str(value)
    if hasattr(value, "__array__") and not hasattr(value, "tolist"):  # arrays of xarray
        value = value.__array__()
    if hasattr(value, "tolist"):
        value = value.tolist()
        return _as_toml(value) if isinstance(value, list) else value
    if isinstance(value, str) and not _is_text(value):
        raise TypeError("bytes that are not text")
    if not isinstance(value, (str, int, float, Decimal, date, time)):
        raise TypeError(f"{type(value).__name__} ({format_value(value)})")
    return value


def _is_text(value: str) -> bool:
    """Whether a string can be written: it has no halves of characters."""
    return not any("\ud800" <= letter <= "\udfff" for letter in value)
