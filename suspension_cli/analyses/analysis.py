"""One record per analysis, from which the command line, the Python API and results files follow."""

from __future__ import annotations

import contextlib
import dataclasses
import importlib
import json
import math
import os
import sys
import warnings
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from suspension_cli.analyses import options
from suspension_cli.analyses.options import Input, Option, Settings
from suspension_cli.errors import (
    Fault,
    InputError,
    PendsusWarning,
    attribute_faults_to,
    suggest,
)

if TYPE_CHECKING:
    import click
    import h5py
    import xarray
    from matplotlib.figure import Figure

    from suspension_cli.design.reader import Source
    from suspension_cli.design.schema import Design
    from suspension_cli.files.hdf5 import Provenance
    from suspension_cli.linear.system import LinearSystem
    from suspension_cli.models.registry import Choice

Document = dict[str, Any]
"""A JSON document."""
Progress = Callable[[int, int, float], None]
"""Called with (points done, points in all, points per second)."""
PACKAGE = os.path.join(Path(__file__).parents[1], "")
"""Folder of the package."""


class Log:
    """Messages of a run: silent except warnings, which become Python warnings.

    `parameters` are those of the command, whose options warnings call by the names of arguments.
    """

    def __init__(self, parameters: Sequence[Option] = ()) -> None:
        self.parameters = parameters

    def say(self, text: str) -> None:
        """Report a step that was done."""

    def detail(self, text: str) -> None:
        """Report a detail."""

    def warn(self, text: str) -> None:
        """Report a warning, at the line that called the package."""
        from suspension_cli.analyses.python_functions import translate

        frame, level = sys._getframe(), 0
        while frame is not None and frame.f_code.co_filename.startswith(PACKAGE):
            frame, level = frame.f_back, level + 1
        warnings.warn(translate(text, self.parameters), PendsusWarning, stacklevel=level + 1)

    def progress(self) -> contextlib.AbstractContextManager[Progress]:
        """Show the progress of a long computation."""
        return contextlib.nullcontext(lambda _done, _count, _rate: None)


class RelayedLog(Log):
    """Log of an analysis that another one runs: passes each warning on once, and keeps them."""

    def __init__(self, outer: Log) -> None:
        self.outer = outer
        self.lines: list[str] = []
        self.passed: set[str] = set()
        self.detail, self.progress = outer.detail, outer.progress

    def warn(self, text: str) -> None:
        """Keep a warning."""
        if text not in self.lines:
            self.lines.append(text)
        if text not in self.passed:
            self.passed.add(text)
            self.outer.warn(text)

    def take(self) -> list[str]:
        """Return the warnings since the last call."""
        lines, self.lines = self.lines, []
        return lines


@dataclasses.dataclass(frozen=True)
class Run:
    """One analysis of one design, before it is computed.

    `source` has the design, its TOML text and the name of its file. `setting` has a value for every
    parameter of the analysis, `inputs` what `Analysis.read` read besides the design, by name. An
    analysis that writes while it computes does so in `folder`. Results record `command`.
    """

    source: Source
    setting: Settings
    log: Log
    folder: Path
    command: str
    inputs: Settings = dataclasses.field(default_factory=dict)

    @property
    def design(self) -> Design:
        """The design."""
        return self.source.design

    @property
    def name(self) -> str:
        """Name of the design."""
        return self.source.name

    def faults(self) -> contextlib.AbstractContextManager[None]:
        """Attribute faults found while solving to the design's file."""
        return attribute_faults_to(self.source.file)


@dataclasses.dataclass(frozen=True, eq=False)
class Result:
    """Result of an analysis, with its design and its model.

    A result is equal to itself alone; compare two by their arrays or by `document`.

    Fields of `data` are attributes of the result too: ``result.frequency``. Their units and shapes
    are in ``help(type(result.data))``; of `thermal` and `budget`, whose `data` is a list with an
    item per motion, in ``help(type(result.data[0]))``. Of one motion, these are attributes. Where
    the result has an attribute of the same name (`name`, `title`, `model`, `source`), that of
    `data` takes its place: ``sus.compare(a, b).name`` are the names of both.

    Attributes
    ----------
    given : Source
        The design that was analysed, its TOML text (overrides applied) and the name of its file.
    choice : Choice
        The model, why it was chosen, and its estimated error.
    data : object
        The arrays: the result type of the analysis.
    extra : dict
        What text, JSON and names of files report beyond the arrays, in types of JSON.
    file : Path or None
        The results file that the analysis filled while it ran, or that the result was read from.
    command : str
        The command line, or the function, that computed it.
    linear_system : LinearSystem or None
        The system that curves of pictures are solved with; None to build it from the design.
    holder : object
        Deletes the temporary file of a sweep when no result refers to it any more.
    """

    analysis: Analysis
    given: Source
    choice: Choice
    data: Any
    extra: Document = dataclasses.field(default_factory=dict)
    file: Path | None = None
    command: str = ""
    linear_system: LinearSystem | None = None
    holder: object = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "_stamp", _stamp(self.file))

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_") or name == "data":
            raise AttributeError(name)
        return getattr(self._only, name)

    @property
    def _only(self) -> Any:
        """The data; of a list of one, as of the noise of one motion, that one."""
        data = self.data
        return data[0] if isinstance(data, list) and len(data) == 1 else data

    def __getstate__(self) -> dict[str, Any]:
        """Contents to copy or pickle: without the linear system, which holds functions."""
        own = vars(self) | {"linear_system": None}
        own.pop("completed", None)
        return own

    @cached_property
    def completed(self) -> Result:
        """The result with all that its pictures need, as it is saved: drawing it solves nothing."""
        return self.analysis.completed(self)

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *(n for n in dir(self._only) if n[0] != "_")})

    def _of_data(self, name: str, otherwise: Any) -> Any:
        """An attribute that the data may have, else that of the result."""
        data = self.data[0] if isinstance(self.data, list) and self.data else self.data
        return getattr(data, name, otherwise)

    @property
    def design(self) -> Any:
        """The design; of `optimise` and `fit` the one that was found (of several, a list)."""
        return self.analysis.design_of(self)

    @property
    def source(self) -> Any:
        """The design that was analysed; of `thermal` and `budget` the sources of the noise."""
        return self._of_data("source", self.given)

    @property
    def name(self) -> Any:
        """Name of the design; of `compare` those of its items, of `fit` those of parameters."""
        return self._of_data("name", self.given.name)

    @property
    def title(self) -> Any:
        """Title of the design, or its name."""
        return self._of_data("title", self.given.title)

    @property
    def model(self) -> Any:
        """Name of the model; of `compare` those of its items."""
        return self._of_data("model", self.choice.level)

    @property
    def subtitle(self) -> str:
        """Title of the design and name of the model, for the second line of a picture."""
        title = self.given.title
        return f"{title} · {self.choice.level} model" if self.analysis.has_model else title

    @property
    def estimated_error(self) -> float:
        """Relative error of the model, estimated; NaN where it cannot be."""
        return self.choice.error

    def document(self) -> Document:
        """Return the JSON document that ``pendsus ... --json`` prints."""
        head: Document = {"command": self.analysis.command_name, "design": self.given.name}
        if not self.analysis.has_model:
            return as_json(head | self.analysis.document(self))
        error: Document = {"estimated_error": self.estimated_error}
        if self.choice.error_unknown:
            error["error_unknown"] = self.choice.error_unknown
        return as_json(
            head | {"fidelity": self.choice.level} | self.analysis.document(self) | error
        )

    def figures(self, **setting: object) -> dict[str, Figure]:
        """Draw all pictures: the end of each file name, and the figure; settings as of `plot`."""
        from suspension_cli.analyses.python_functions import python_names

        name, parameters = self.analysis.command_name, self.analysis.drawn_with
        known = options.default_values(parameters)
        for key in setting.keys() - known.keys():
            problem = f"is no argument of plot() of {name}"
            raise InputError.of(key, problem, suggest(key, list(known)))
        with python_names():
            given = options.from_arguments(name, parameters, setting)
        drawn = self.analysis.figures(self.completed, known | given)
        if self.analysis.draws_neglected:
            from suspension_cli.drawing.style import name_neglected

            for figure in drawn.values():
                name_neglected(figure, self.choice)
        return drawn

    def plot(self, **setting: object) -> Figure:
        """Draw the picture that the command writes.

        Parameters
        ----------
        **setting
            For responses ``scale``, ``"db"`` (the default) or ``"absolute"``; others have none.

        Raises
        ------
        InputError
            If there is no picture (`export`), or no such argument.
        """
        for figure in self.figures(**setting).values():
            return figure
        raise InputError.of("", f"{self.analysis.name} has no picture", "print the result")

    def save(self, path: str | Path) -> None:
        """Write the results file (HDF5, see docs/format.md), whole or not at all.

        A path that ends in .csv gets the numbers as CSV, as ``--csv`` writes them: a row per
        frequency, mode or point. Arrays with other rows go into files beside it, NAME-ROWS.csv.
        The file of `export` has the format of its ending: .mat, .npz, .h5, .json (python-control);
        a noise budget of gwinc is a folder.

        Raises
        ------
        InputError
            If the file cannot be written, or the ending is that of another format.
        """
        from suspension_cli.analyses.python_functions import python_names

        target = Path(options.path(path, "path"))
        with python_names(out="path"):
            self.analysis.save(target, self.completed)

    def to_xarray(self) -> xarray.Dataset:
        """Return the contents of the results file as an `xarray.Dataset` (needs xarray).

        Raises
        ------
        InputError
            If there are no labelled arrays (`export`).
        """
        from suspension_cli.analyses.labelled import to_xarray

        return to_xarray(self)

    def stored_file(self) -> Path | None:
        """Path of the file that has more than `data`: of a sweep; None for other analyses.

        Raises `InputError` if the file was deleted or replaced since this result was read from it.
        """
        if self.file is None or not self.analysis.fills_file:
            return None
        stamp = _stamp(self.file)
        if not stamp or stamp != vars(self)["_stamp"]:
            problem = "was replaced by another file" if stamp else "was deleted"
            problem += "; this result is read from there"
            fault = Fault("", problem, "compute the result again, or load its copy")
            raise InputError([fault], str(self.file))
        return self.file

    @property
    def provenance(self) -> Provenance:
        """Origin that a results file records."""
        from suspension_cli.files.hdf5 import Provenance

        choice = self.choice
        return Provenance(
            self.given.text, self.command, choice.level, choice.reason, error=choice.error
        )

    def __str__(self) -> str:
        return self.analysis.text(self)

    def __repr__(self) -> str:
        model = f", {self.choice.level} model" if self.analysis.has_model else ""
        return f"<pendsus {self.analysis.name} of {self.given.name}{model}>"

    def _repr_html_(self) -> str:
        import html

        return f"<pre>{html.escape(str(self))}</pre>"


def _stamp(file: Path | None) -> tuple[int, ...]:
    """Identify a file as it is now; empty if there is none."""
    try:
        found = os.stat(file) if file is not None else None
    except OSError:
        found = None
    return () if found is None else (found.st_ino, found.st_mtime_ns, found.st_size)


class Analysis(ABC):
    """An analysis of a design: its parameters, its physics, its file, its picture, its text.

    The docstring of its class is the help of the command; sections of it (Returns, Raises,
    Examples) are for the Python function alone.

    If the class of the result has fields of each output (`declared.EACH`), `Result.data` is a list.
    """

    name: ClassVar[str]  # of the HDF5 group, the function and the command (see `command_name`)
    result_type: ClassVar[str] = ""  # path of the class whose fields declare what is stored
    fills_file: ClassVar[bool] = False  # while it runs; the file has more than `Result.data`
    has_model: ClassVar[bool] = True  # results come from one, which JSON names with its error
    has_file: ClassVar[bool] = True
    draws_neglected: ClassVar[bool] = False  # pictures say at the bottom what the model neglects
    arguments: ClassVar[tuple[click.Argument, ...]] = ()
    inputs: ClassVar[tuple[Input, ...]] = (Input(),)  # of the Python function, for `arguments`
    returns: ClassVar[str] = "Result"  # type of what the Python function returns
    parameters: ClassVar[tuple[Option, ...]] = ()  # arguments of the Python function too
    drawn_with: ClassVar[tuple[Option, ...]] = ()  # options that pictures depend on

    @property
    def command_name(self) -> str:
        """Name of the command, and ``command`` of its JSON document."""
        return self.name

    @property
    def stem(self) -> str:
        """End of the stem of the results file: ``NAME-modes.h5``."""
        return self.name

    @abstractmethod
    def solve(self, run: Run) -> Result:
        """Compute the result; raises `InputError` for faults of the design or of a setting."""

    def design_of(self, result: Result) -> Source | list[Source]:
        """The design of a result, or designs: those that were found where some are."""
        return result.given

    def document(self, result: Result) -> Document:
        """JSON document without its head (command, design, model, estimated error)."""
        return {}

    def text(self, result: Result) -> str:
        """Table or summary that the command prints; empty for a page or drawing."""
        return ""

    def record_type(self) -> Any:
        """Import the class whose fields declare what is stored."""
        module, _, name = self.result_type.rpartition(".")
        return getattr(importlib.import_module(f"suspension_cli.{module}"), name)

    def fill(self, file: h5py.File, result: Result) -> None:
        """Write the result into a group of the open results file."""
        from suspension_cli.files import stored

        if not self.has_file:
            remedy = "print it, or take document()"
            raise InputError.of("", f"{self.name} has no results file", remedy)
        stored.write(file.create_group(self.name), result.data)

    def load(self, file: h5py.File) -> object:
        """Read `Result.data` from an open results file."""
        from suspension_cli.files import declared, stored

        kind = self.record_type()
        is_list = any(item.each for item in declared.items(kind))
        return (stored.read_list if is_list else stored.read)(file[self.name], kind)

    def completed(self, result: Result) -> Result:
        """Add what pictures have to solve for, so that it is stored; see `Result.completed`."""
        return result

    def figures(self, result: Result, setting: Settings) -> dict[str, Figure]:
        """Draw the pictures: the end of each file name (before its ending), and the figure."""
        return {}

    def animations(self, result: Result, setting: Settings) -> Iterator[tuple[str, bytes]]:
        """Yield the end of each file name and the bytes of moving pictures (GIF)."""
        return iter(())

    def swept_names(self) -> tuple[str, ...]:
        """Keys of `[analysis.NAME]` that are no options: swept parameters, with their grids."""
        return ()

    def parse_names(
        self, design: Design, stages: tuple[str, ...], known: tuple[str, ...]
    ) -> Iterable[Callable[[], object]]:
        """Calls that parse names in tables of a design that only this analysis reads.

        Each raises `InputError` for an unknown name, of which `pendsus check` warns. `known` are
        the bodies with signals.
        """
        return ()

    def path(self, result: Result, folder: Path) -> Path:
        """Path of the results file."""
        return folder / f"{result.given.stem()}-{self.stem}.h5"

    def save(self, path: Path, result: Result) -> None:
        """Write the results file."""
        from suspension_cli.files import hdf5, whole_files

        def fill(file: h5py.File) -> None:
            self.fill(file, result)
            if result.extra:
                file.attrs["extra"] = json.dumps(as_json(result.extra))

        stored = result.stored_file()
        if path.suffix.lower() == ".csv":
            from suspension_cli.analyses import labelled

            labelled.write_csv(result, path)
        elif path.suffix.lower() in set(options.ENDINGS) - set(options.RESULTS_ENDINGS):
            remedy = "end it in .h5 or .csv; pictures: plot().savefig(...), JSON: document()"
            problem = "ends like a file of another kind"
            raise InputError.of("--out", problem, remedy, str(path))
        elif stored is None:
            hdf5.write(path, result.provenance, fill)
        elif not (path.exists() and path.samefile(stored)):
            whole_files.write_bytes(path, stored.read_bytes())

    def others(self, result: Result, path: Path) -> list[Path]:
        """Write files beside the results file at `path`, and return their paths."""
        return []

    def exit_code(self, result: Result) -> int:
        """1 where the findings must stop a script; else 0."""
        return 0

    def files(self, inputs: Settings) -> Settings:
        """Values of `arguments` for those of `inputs`."""
        return inputs

    def read(self, ask: Callable[..., Run], files: Settings) -> Run:
        """Read the files that the arguments name, each design by ``ask(file, overrides=())``.

        Of several designs each is read, and computed, alone.
        """
        return ask(files["design"])

    def returned(self, result: Result, files: Settings) -> Any:
        """What the Python function returns."""
        return result


def table(source: Any, columns: str) -> list[Document]:
    """Rows of JSON from the columns of a record, or from a sequence of records.

    Columns are ``KEY``, or ``KEY=ATTRIBUTE`` where the names differ.
    """
    pairs = [word.partition("=") for word in columns.split()]
    keys, names = [key for key, *_ in pairs], [name or key for key, _, name in pairs]
    rows = (
        ([getattr(one, name) for name in names] for one in source)
        if isinstance(source, Sequence)
        else zip(*(getattr(source, name) for name in names), strict=True)
    )
    return [dict(zip(keys, row, strict=True)) for row in rows]


def as_json(part: Any) -> Any:
    """Convert a document: arrays and tuples to lists, numbers that are not finite to null."""
    if isinstance(part, dict):
        return {key: as_json(value) for key, value in part.items()}
    if hasattr(part, "tolist"):  # an array or a number of numpy
        part = part.tolist()
    if isinstance(part, list | tuple):
        return [as_json(value) for value in part]
    return None if isinstance(part, float) and not math.isfinite(part) else part


def describe_mirrors(setting: Settings) -> Document:
    """Extra of a result that --mirrors changed: their number."""
    return {"mirrors": setting["mirrors"]} if setting["mirrors"] != 1 else {}


def name_mirrors(result: Result, tilt: float = 0.0) -> str:
    """End of a title, ``", 4 mirrors"``, and along a beam that rises by an angle in rad."""
    along = f" along a beam that rises by {1e6 * tilt:.3g} urad" if tilt else ""
    mirrors = f", {result.extra['mirrors']:g} mirrors" if "mirrors" in result.extra else ""
    return along + mirrors


def only_one(values: list[Document], name: str) -> Document:
    """The only one of several documents, or all of them under `name`."""
    return values[0] if len(values) == 1 else {name: values}
