"""`--watch`: compute again when a file is saved, and say what that changed.

The process stays, with all that it has imported, so that a run takes as long as its computation. A
fault of a file is one line; the watch goes on.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from suspension_cli.cli.terminal import tell
from suspension_cli.errors import PendsusError
from suspension_cli.files.documents import ENDINGS, Document

Wait = Callable[[list[Path]], Iterator[object]]
"""Makes an iterator that yields after each save of one of some files."""

NAMES = (
    *("label", "name", "wire", "blade", "body", "cavity", "between", "stage", "limit"),
    *("quantity", "output", "state", "path", "loop", "mode", "text"),
)
"""Keys of a document whose text names an item of a list, in the order of preference."""
UNITS = {end.removeprefix("_"): unit for unit, end in ENDINGS.items()}
UNITS |= {"m": "m", "mm": "mm", "n": "N", "pa": "Pa", "kg": "kg", "k": "K", "w": "W"}
UNITS |= {"db": "dB", "deg": "deg", "n_per_m": "N/m", "n_m_per_rad": "N m/rad"}
UNITS |= {"m_per_rad": "m/rad", "n_per_k": "N/K", "m_per_k": "m/K"}
"""Units by the ends of the names of keys."""
NOISE = ("residual", "time_s")
"""Keys of numbers that differ from run to run: rounding errors, times of computations."""
NOTABLE = 1e-4
"""Relative change from which a number is listed: one in the fourth digit."""
MOST = 24
"""Number of items that are listed."""
SHOWN = 2
"""Number of changes that are listed of each item: documents give what matters first."""
DATA = (".csv", ".h5", ".hdf5", ".mat", ".toml", ".txt", ".xml")
"""Endings of files that a design may name before they exist."""
QUIET_TIME = 100
"""Time, ms, without a further change after which files are read: editors save in steps."""


def watch(
    files: Sequence[str],
    compute: Callable[[], list[Document]],
    wait: Wait,
    put: Callable[[str], None],
) -> None:
    """Compute, and again after each save of a file, until Ctrl-C.

    Parameters
    ----------
    files
        The files of the command; those that they name are watched, too.
    compute
        Computes, prints, and returns the documents of the results.
    wait
        Waits for a save of one of the paths of a list; see `changed_files`.
    put
        Prints a line of what changed.
    """
    last: dict[str, Document] = {}
    watched = list_files(files)
    saves = wait(watched)
    try:
        while True:
            last = _compute_once(compute, last, put)
            watched[:] = list_files(files)
            names = ", ".join(path.name for path in watched)
            tell(f"watching {names}; Ctrl-C ends it")
            next(saves)
    except KeyboardInterrupt:
        return


def _compute_once(
    compute: Callable[[], list[Document]],
    last: dict[str, Document],
    put: Callable[[str], None],
) -> dict[str, Document]:
    """Compute and print what changed; after a fault the last results stay."""
    try:
        documents = compute()
    except PendsusError as error:
        tell(str(error))
        return last
    found = {document["design"]: document for document in documents}
    for name, document in found.items():
        if name in last:
            for line in describe_changes(last[name], document).splitlines():
                put(line)
    return found


def changed_files(watched: list[Path]) -> Iterator[object]:
    """Watch files, whose list may change meanwhile; yields after each save.

    Folders are watched, since most editors replace a file instead of writing into it.
    """
    folders = {path.parent for path in watched}
    saves = _saves_in(folders, watched)  # from here on no change is missed

    def changes() -> Iterator[object]:
        nonlocal folders, saves
        while True:
            if more := {path.parent for path in watched} - folders:
                folders |= more
                saves = _saves_in(folders, watched)
            if found := next(saves):
                yield found

    return changes()


def _saves_in(folders: Set[Path], watched: list[Path]) -> Iterator[object]:
    """Watch some folders for changes of files; yields empty sets while nothing changes."""
    import watchfiles

    def is_watched(_change: object, path: str) -> bool:
        return Path(path) in watched

    saves = watchfiles.watch(
        *folders,
        watch_filter=is_watched,
        debounce=QUIET_TIME,
        rust_timeout=QUIET_TIME,
        yield_on_timeout=True,
        recursive=False,
    )
    next(saves)
    return saves


def list_files(files: Sequence[str]) -> list[Path]:
    """List files and those that they name, as absolute paths; missing ones are waited for."""
    found: list[Path] = []
    waiting = [Path(file).resolve() for file in files]
    while waiting:
        path = waiting.pop(0)
        if path in found:
            continue
        found.append(path)
        if path.suffix == ".toml":
            waiting += [one for one in _named_in(path) if one.is_file() or _may_come(one)]
    return found


def _may_come(path: Path) -> bool:
    """Whether a missing file can be waited for: it has the name of data, in a folder."""
    return path.suffix.lower() in DATA and path.parent.is_dir()


def _named_in(file: Path) -> Iterator[Path]:
    """Paths that texts of a TOML file could name, from its folder."""
    try:
        raw = tomllib.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return
    for text in _texts(raw):
        if 0 < len(text) < 256 and "\n" not in text and "\0" not in text:
            yield (file.parent / text).resolve()


def _texts(value: object) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        for one in value.values():
            yield from _texts(one)
    elif isinstance(value, list):
        for one in value:
            yield from _texts(one)


Key = tuple[str, str, str]
"""Item of a document, words of a number of it, its unit."""


@dataclass(frozen=True)
class Change:
    """A number of a result before and after a save; NaN where it has none."""

    key: Key
    before: float
    after: float

    @property
    def relative(self) -> float:
        """Relative change; infinite from or to 0, or where there is no number."""
        if self.before == self.after or (math.isnan(self.before) and math.isnan(self.after)):
            return 0.0
        if not math.isfinite(self.before) or not math.isfinite(self.after) or self.before == 0:
            return math.inf
        return self.after / self.before - 1

    @property
    def text(self) -> str:
        """The change in words: ``frequency 0.512 -> 0.498 Hz, -2.7 %``."""
        _, words, unit = self.key
        text = f"{words} {_digits(self.before)} -> {_digits(self.after)} {unit}".rstrip()
        if math.isfinite(self.relative):
            text += f", {100 * self.relative:+.2g} %"
        return text


def _digits(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.5g}"


def describe_changes(before: Document, after: Document) -> str:
    """List what changed in the document of a result, a line for each item of it.

    >>> old = {"modes": [{"label": "test pitch", "frequency_hz": 0.512}]}
    >>> new = {"modes": [{"label": "test pitch", "frequency_hz": 0.498}]}
    >>> print(describe_changes(old, new))
    changed: test pitch: frequency 0.512 -> 0.498 Hz, -2.7 %
    """
    old = dict(_numbers(before))
    new = dict(_numbers(after))
    by_item: dict[str, list[str]] = {item: [] for item, _, _ in new}
    for key in sorted(new, key=lambda key: not key[2]):  # numbers with a unit first
        change = Change(key, old.get(key, new[key]), new[key])
        if abs(change.relative) > NOTABLE:
            by_item[key[0]].append(change.text)
    lines = [
        "; ".join([f"{item}: {texts[0]}" if item else texts[0], *texts[1:SHOWN]])
        for item, texts in by_item.items()
        if texts
    ]
    if len(lines) > MOST:
        lines[MOST:] = [f"and {len(lines) - MOST} more"]
    lines += _describe_arrays(before, after)
    lines += _list_items("new", new.keys() - old.keys(), new)
    lines += _list_items("gone", old.keys() - new.keys(), old)
    if not lines:
        lines = [f"nothing by more than {100 * NOTABLE:g} %"]
    return "\n".join(f"changed: {line}" for line in lines)


def _list_items(verb: str, keys: Set[Key], order: Mapping[Key, float]) -> list[str]:
    """List items that a document has more than another, in its order."""
    names = list(dict.fromkeys(key[0] or key[1] for key in order if key in keys))
    if not names:
        return []
    return [f"{verb}: {', '.join(names[:MOST])}" + (" ..." if len(names) > MOST else "")]


def _describe_arrays(before: Document, after: Document) -> list[str]:
    """Say by how much lists of numbers changed, relative to their largest ones."""
    old = dict(_arrays(before))
    lines: list[str] = []
    for name, values in _arrays(after):
        own = old.get(name, [])
        if len(own) != len(values):
            continue
        largest = max(map(abs, values), default=0.0)
        change = max((abs(a - b) for a, b in zip(values, own, strict=True)), default=0.0)
        if largest > 0 and change > NOTABLE * largest:
            lines.append(f"{name} by up to {100 * change / largest:.2g} % of the largest")
    return lines


def _numbers(value: Any, item: str = "", key: str = "") -> Iterator[tuple[Key, float]]:
    """Numbers of a document."""
    if isinstance(value, dict):
        for inner, one in value.items():
            if inner not in NOISE:
                yield from _numbers(one, item, inner)
    elif isinstance(value, list):
        if not _is_array(value):
            for name, one in _named_items(value):
                yield from _numbers(one, f"{item} {name}".strip(), key)
    elif _is_number(value):
        yield (item, *_split_unit(key)), float(value)


def _arrays(value: Any, name: str = "") -> Iterator[tuple[str, list[float]]]:
    """Lists of numbers of a document by name; numbers that are missing are 0."""
    if isinstance(value, dict):
        for key, one in value.items():
            words, _ = _split_unit(key)
            yield from _arrays(one, f"{name} {words}".strip())
    elif isinstance(value, list):
        if _is_array(value):
            yield name, [float(one) if _is_number(one) else 0.0 for one in value]
        else:
            for own, one in _named_items(value):
                yield from _arrays(one, f"{name} {own}".strip())


def _named_items(values: list[Any]) -> Iterator[tuple[str, Any]]:
    """Items of a list with their names, numbered where several have one: ``test yaw#2``."""
    counts: dict[str, int] = {}
    for number, one in enumerate(values):
        name = _name_of(one) or str(number + 1)
        counts[name] = counts.get(name, 0) + 1
        yield (name if counts[name] == 1 else f"{name}#{counts[name]}"), one


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _is_array(value: list[Any]) -> bool:
    return any(map(_is_number, value)) and all(one is None or _is_number(one) for one in value)


def _name_of(value: object) -> str:
    """Text by which an item of a list is known, "" if it has none."""
    if isinstance(value, dict):
        for key in NAMES:
            if isinstance(value.get(key), str):
                return value[key]
    return ""


def _split_unit(key: str) -> tuple[str, str]:
    """Words and unit of a key: ``frequency_hz`` is a frequency in Hz."""
    for end in sorted(UNITS, key=len, reverse=True):
        if key.endswith(f"_{end}"):
            return key.removesuffix(f"_{end}").replace("_", " "), UNITS[end]
    return key.replace("_", " "), ""
