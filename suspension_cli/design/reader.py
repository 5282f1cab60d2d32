"""Reading of design files: TOML, overrides and checks, to a frozen `Design`."""

from __future__ import annotations

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
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from suspension_cli.design import DETECTORS, checks, faults, foton_file, paths, ties
from suspension_cli.design.locked_stages import spell_out, title_of, undo
from suspension_cli.design.schema import Design, Stage
from suspension_cli.design.toml_edits import rewritten, same
from suspension_cli.design.typed_tables import Raw, Table
from suspension_cli.errors import Fault, InputError, attribute_faults_to, format_value, suggest
from suspension_cli.files import columns, whole_files

T = TypeVar("T", bound=Table)
LONGEST_STEM = 150
"""Letters of the start of a file's name; systems take 255 bytes for the whole name."""
EXAMPLES = Path(__file__).parents[1] / "examples"
TEMPLATES = (
    "single",
    "double",
    "triple",
    "quad",
    "blades",
    "two-wires",
    "torsion",
    "payload",
)
"""Starting designs of `pendsus new`."""
KINDS = {
    "design": ("stage",),
    "file of measurements": ("mode", "transfer_function", "experiment"),
    "file of goals": ("free", "goal"),
}
"""Tables that TOML files of each kind have."""

_TOO_DEEP = Fault("", "tables or arrays are nested too deeply", "use fewer levels")
_PART = r"""(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')"""
_LONG_KEY = re.compile(rf"(?<![\w-]){_PART}(?:[ \t]*+\.[ \t]*+{_PART}){{50}}")
"""Dotted keys whose tables take much memory: as the square of their parts.

Looked for from the starts of words alone, so that the time grows as the length of the text.
"""
_LONG_NUMBER = re.compile(r"(?<![\d_])[\d_]{4300}")
"""Integers that Python refuses to read."""


@dataclass(frozen=True)
class Source:
    """A design and its source."""

    design: Design
    text: str  # the whole design as TOML with overrides and comments, as results embed it
    file: str  # the path as the user gave it
    given_stem: str | None = None  # start of the names of written files, if the user gave one
    overrides: tuple[str, ...] = ()  # that these names tell, as are ties
    ties: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Name of the design."""
        return self.design.design.name

    @property
    def title(self) -> str:
        """Title of the design, or its name, and which stages do not move."""
        return title_of(self.design)

    def stem(self, name: str = "") -> str:
        """Start of the names of written files: as given, else a name with the overrides.

        `name` is that of the design by default. An override of `design.name` suffices; a digest
        follows where letters had to be replaced or left out: ``my-test.wires.d=0.002``.
        """
        name = name or self.name
        changes = (*self.overrides, *self.ties)
        plain = [re.sub(r"\s+", "", text).removeprefix("stage.") for text in changes]
        if self.given_stem or any(text.startswith("design.name=") for text in plain):
            return self.given_stem or name
        whole = "-".join([name, *(text for text in plain if not text.startswith("design."))])
        short = re.sub(r"[^A-Za-z0-9._=+-]+", "_", whole)[:LONGEST_STEM]
        digest = hashlib.sha256(whole.encode()).hexdigest()[:8]
        return short if short == whole else f"{short}-{digest}"


def read(
    file: str | Path, overrides: tuple[str, ...] = (), more_ties: tuple[str, ...] = ()
) -> Source:
    """Read and check one design file, with `overrides` as for `apply_overrides`.

    `more_ties` are ties beside those of the file, for `ties.parse`.

    Raises `InputError` with every fault of the file.
    """
    own_ties = 0
    try:
        text = _text(Path(file))
        raw = _parse(text)
        if more_ties:
            own = raw.get("tie", [])
            own_ties = len(own)
            raw["tie"] = [*own, *map(ties.parse, more_ties)]
        apply_overrides(raw, overrides)
        _check_kind(raw, "design")
        insert_files(raw, Path(file).parent)
        return Source(convert(raw), write_toml(raw, text), str(file))
    except InputError as error:
        raise ties.name_option(error, own_ties, more_ties).in_file(str(file)) from None


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


def edit(text: str, overrides: tuple[str, ...]) -> str:
    """Change values in the TOML text of a design, which keeps comments, order and layout.

    Raises `InputError` with every fault of the design.
    """
    parse_with_overrides(text, overrides)
    raw = _parse(text)
    apply_overrides(raw, overrides)
    return write_toml(raw, text)


def with_text(source: Source, text: str) -> Source:
    """Return a design of another text, without a file; of the same class as `source`."""
    return replace(source, design=parse(text), text=text, file="", given_stem=None, overrides=())


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
    """A design whose numbers are varied: a stage without a change is not checked again."""

    raw: Raw
    stages: list[Stage]  # as they are in the parsed document, valid

    @staticmethod
    def of(text: str) -> VariedDesign:
        """Parse and check a design from TOML text."""
        raw = ties.apply(_parse(text))
        insert_files(raw, Path(), of_links=False)
        return VariedDesign(raw, undo(convert(raw)).stage)

    def at(self, values: Mapping[str, float]) -> Design:
        """The design with other numbers at dotted paths; raises `InputError`."""
        raw = self.raw
        for path, value in values.items():
            keys = path.split(".")
            number = paths.number_for(path, value)
            raw = paths.changed(raw, keys, lambda _, new=number: new, f"{path}={value!r}")
        return convert(ties.apply(raw), self.stages)


def convert(raw: Raw, sound: Sequence[Stage] = ()) -> Design:
    """Check a parsed document and convert it to a design; raises `InputError` with all faults.

    Stages that equal one of the `sound` ones are not checked again.
    """
    try:
        design = faults.convert(raw, Design, rules=False)
    except RecursionError:
        raise InputError([_TOO_DEEP]) from None
    if found := checks.check_design(design, sound):
        raise InputError(found)
    return spell_out(design)


def insert_files(raw: Raw, folder: Path, *, of_links: bool = True) -> None:
    """Replace files that fibres, links and filters name by their numbers, in a parsed document.

    So its text, which results embed, is complete. Names are from `folder`, that of the design;
    profiles may also be among the program's examples. Raises `InputError` for files that cannot be
    read or have another form.
    """
    found: list[Fault] = []
    for pattern, insert in FILES.items():
        of_wire = insert is _insert_profile
        for path, holder, key in _find(raw, pattern.split(".")) if of_links or of_wire else ():
            value = holder[key]
            of_noise = pattern.endswith("_noise")
            named = (of_wire or of_noise) and isinstance(value, str)
            if named and of_noise and not os.path.isfile(folder / value):
                continue  # a known sensor, or a name that the checks refuse
            table: Any = {"file": value} if named else value
            name = table.get("file") if isinstance(table, dict) else None
            if not isinstance(name, str):
                continue
            try:
                holder[key] = insert(table, folder / name)
            except InputError as error:
                for fault in error.faults:
                    problem = ": ".join(filter(None, (fault.key, fault.problem)))
                    lost = "give its path from the folder of the design file"
                    remedy = lost if problem.startswith("cannot be read") else fault.remedy
                    where = f"{path}.file" if table is value else path
                    found.append(Fault(where, problem, remedy, format_value(name)))
    if found:
        raise InputError(found)


def _find(node: object, keys: Sequence[str], path: str = "") -> Iterator[tuple[str, Raw, str]]:
    """List the places in a document that fit some keys: key path, table and last key."""
    key, *rest = keys
    if key == "*":
        for n, item in enumerate(node if isinstance(node, list) else ()):
            yield from _find(item, rest, faults.step(path, n, item))
    elif isinstance(node, dict) and key in node:
        place = faults.step(path, key)
        yield from _find(node[key], rest, place) if rest else [(place, node, key)]


def _columns(file: Path, counts: tuple[int, ...], remedy: str) -> columns.Columns:
    """Read a CSV file with one of some numbers of columns."""
    found = columns.read(file, whole_files.TOML, "a CSV file")
    if len(found.names) not in counts:
        raise InputError.of("", f"has {len(found.names)} columns", remedy)
    return found


def _insert_profile(table: Raw, file: Path) -> Raw:
    """Read positions and diameters (m) of a profile from a CSV file of two columns."""
    if table.keys() & {"position", "diameter"}:
        return table
    shipped = EXAMPLES / file.name
    own = shipped if os.path.exists(shipped) and not os.path.exists(file) else file
    found = _columns(own, (2,), "write position,diameter in each line")
    for n, key in enumerate(("position", "diameter")):
        scale = columns.split_unit(found.names[n], columns.PER_M)[1] if found.headed else 1.0
        table = table | {key: (found.numbers(n, key) / scale).tolist()}
    return table


def _insert_sections(table: Raw, file: Path) -> Raw:
    """Read sections of a Foton filter file as a design, if the table is sound."""
    module = table.get("module")
    numbers = table.get("sections")
    if not isinstance(numbers, list) or not numbers or not isinstance(module, str):
        return table
    known = range(1, foton_file.SECTIONS + 1)
    if any(n not in known for n in numbers) or table.keys() & {"design", "rate"}:
        return table
    text, rate = foton_file.read(file, module, numbers)
    rest = {key: table[key] for key in table if key not in ("file", "module", "sections")}
    source = f"{table['file']}, {module}, sections {', '.join(map(str, numbers))}"
    return {**rest, "design": text, "rate": rate, "source": rest.get("source", source)}


def _insert_noise(table: Raw, file: Path, kind: str) -> Raw:
    """Read a spectrum of noise as frequencies and densities; `kind` is that of `spectra.UNITS`."""
    from suspension_cli.files import spectra

    if table.keys() & {"asd", "frequency", "corner"}:
        return table
    found = spectra.read(file, kind)
    wanted = table.get("column")
    name = next(iter(found)) if wanted is None and len(found) == 1 else str(wanted or "").lower()
    if name not in found:
        columns_here = ", ".join(found)
        problem = f"has the spectra {columns_here}" if wanted is None else "has no such column"
        close = suggest(name, list(found)) if wanted else f"name one of them: {columns_here}"
        remedy = f'{{ file = "{table["file"]}", column = "..." }}; {close}'
        raise InputError.of("", problem, f"write {remedy}", None if wanted is None else wanted)
    frequency, density = found[name]
    read_from = f"{table['file']}, {name}".removesuffix(", ")
    return {
        "frequency": frequency.tolist(),
        "asd": density.tolist(),
        "source": table.get("source", read_from),
    }


def _insert_stiffness(table: Raw, file: Path) -> Raw:
    """Read frequency, real and imaginary parts per axis from a CSV file."""
    import numpy as np

    for name in ("frequency", "real", "imaginary"):
        if name in table:
            raise InputError.of(name, "is also in the file", "remove it, or file")
    remedy = "give frequency and two columns per axis: 3 columns for one axis, 13 for six"
    found = _columns(file, (3, 13), remedy)
    frequency, *rows = [found.numbers(n, "number") for n in range(len(found.names))]
    real = np.array(rows[::2])
    imaginary = np.array(rows[1::2])
    if table.get("form") == "modulus-loss":
        modulus = real
        loss_angle = imaginary
        real = modulus * np.cos(loss_angle)
        imaginary = modulus * np.sin(loss_angle)
    parts = {"frequency": frequency, "real": real, "imaginary": imaginary}
    rest = {key: table[key] for key in table if key not in ("file", "form")}
    return rest | {key: part.tolist() for key, part in parts.items()}


FILES = {
    "link.*.table": _insert_stiffness,
    "control.loop.*.filter": _insert_sections,
    "control.loop.*.sensor_response": _insert_sections,
    "control.loop.*.sensor_noise": partial(_insert_noise, kind="motion"),
    "control.loop.*.actuator_noise": partial(_insert_noise, kind="force"),
    "control.sensor.*.response": _insert_sections,
    "control.sensor.*.sensor_noise": partial(_insert_noise, kind="motion"),
    "control.sensor.*.inputs.*.filter": _insert_sections,
    "control.osem.*.driver_response": _insert_sections,
    "control.osem.*.sensor_noise": partial(_insert_noise, kind="motion"),
    "control.osem.*.force_noise": partial(_insert_noise, kind="force"),
    "control.osem.*.driver_noise": partial(_insert_noise, kind="voltage"),
    "stage.*.wires.profile": _insert_profile,
    "stage.*.wire.*.profile": _insert_profile,
}
"""Tables whose numbers may stand in a file, by key path."""


def write_toml(raw: Raw, text: str = "") -> str:
    """Write a parsed document as TOML; raises `InputError` if it is nested too deeply.

    `text` is TOML of which the document is a changed copy: its comments, order and layout stay.
    """
    try:
        if text:
            return text if same(_loads(text), raw) else rewritten(text, raw)
        import tomli_w

        return tomli_w.dumps(raw)
    except RecursionError:
        raise InputError([_TOO_DEEP]) from None


def _text(path: Path) -> str:
    return whole_files.read_text(path, whole_files.TOML, "a design or another TOML file", pipe=True)


def _parse(text: str, remedy: str = "start a design with `pendsus new`") -> Raw:
    try:
        raw = copy.deepcopy(_loads(text))
    except tomllib.TOMLDecodeError as error:
        raise InputError.of("", f"is not TOML: {error}", "correct that line") from None
    except RecursionError:
        raise InputError([_TOO_DEEP]) from None
    except ValueError:  # numbers of TOML that Python refuses
        place = _line(text, _LONG_NUMBER.search(text))
        problem = "is not TOML: a number has thousands of digits"
        raise InputError.of(place, problem, "write it shorter") from None
    if not raw:
        raise InputError.of("", "is empty", remedy)
    return raw


@functools.lru_cache(maxsize=8)
def _loads(text: str) -> Raw:
    """Parse TOML text; cached, as searches read one text with many overrides."""
    if len(text) > whole_files.TOML:
        problem = f"has more than {whole_files.TOML / 1e6:g} million characters, too many for TOML"
        raise InputError.of("", problem, "give fewer tables and numbers")
    if long := _LONG_KEY.search(text):
        raise InputError([replace(_TOO_DEEP, key=_line(text, long))])
    return tomllib.loads(text)


def _line(text: str, found: re.Match[str] | None) -> str:
    """Name the line of a text in which a pattern was found, for a message; "" if it was not."""
    return "" if found is None else f"line {text.count(chr(10), 0, found.start()) + 1}"


def apply_overrides(raw: Raw, overrides: tuple[str, ...]) -> None:
    """Set values in a parsed document, and compute those that are tied to others, in place.

    An override ``stage.test.wires.d=0.002`` is a dotted path (members of lists by name or number
    from 1) and a TOML value (a bare word is a string). Missing tables are added; a missing member
    of a list is a fault.
    """
    for override in overrides:
        shown = format_value(override)
        if not _is_text(override):
            problem = "contains bytes that are not text"
            remedy = "write it in UTF-8"
            raise InputError.of("--set", problem, remedy, shown)
        path, equals, value = override.partition("=")
        keys = [key.strip() for key in path.split(".")]
        if not equals or not all(keys):
            remedy = "write for example --set stage.test.wires.d=0.002"
            raise InputError.of("--set", "is not of the form path=value", remedy, shown)
        try:
            parsed = copy.deepcopy(_loads(f"value = {value}")["value"])
        except (tomllib.TOMLDecodeError, RecursionError, ValueError):
            parsed = value.strip()
        ties.refuse(raw, [".".join(keys)], "--set")
        paths.assign(raw, keys, parsed, override)
    raw |= ties.apply(raw)


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
        problem = "must be a dictionary of paths"
        remedy = '{"stage.test.wires.d": 0.002}'
        shown = format_value(changes)
        raise InputError.of("changes", problem, f"write for example {remedy}", shown)
    raw = _parse(source.text)
    for path, value in changes.items():
        if not isinstance(path, str):
            remedy = "write it as a text: stage.test.wires.d"
            raise InputError.of("changes", "is no path", remedy, format_value(path))
        try:
            new = _as_toml(value)
        except RecursionError:
            raise InputError([replace(_TOO_DEEP, key=path)]) from None
        except Exception as error:  # whatever an object of others cannot do
            remedy = "give a number, a text, or a list or dictionary of these"
            what = error if isinstance(error, TypeError) else type(value).__name__
            raise InputError.of(path, f"cannot be {what}", remedy) from None
        ties.refuse(raw, [path], "changes")
        paths.assign(raw, path.split("."), new, path)
    raw = ties.apply(raw)
    insert_files(raw, Path(source.file).parent, of_links=False)
    return Source(convert(raw), write_toml(raw, source.text), source.file)


def _as_toml(value: paths.Value) -> paths.Value:
    """Convert tuples, paths, and numbers and arrays of numpy or xarray, to types of TOML.

    Raises `TypeError` with what is not one of them.
    """
    if hasattr(value, "__array__"):
        value = value.__array__().tolist()
    if isinstance(value, Mapping):
        return {str(key): _as_toml(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_as_toml(item) for item in value]
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, Decimal):
        return float(value)
    if isinstance(value, str) and not _is_text(value):
        raise TypeError("bytes that are not text")
    if not isinstance(value, (str, int, float, date, time)):
        raise TypeError(f"{type(value).__name__} ({format_value(value)})")
    return value


def _is_text(value: str) -> bool:
    """Whether a string can be written: it has no halves of characters."""
    return not any("\ud800" <= letter <= "\udfff" for letter in value)
