"""One class per analysis, from which the command line, the Python API and results files follow.

`record` has the class of what analyses return.
"""

from __future__ import annotations

import contextlib
import dataclasses
import importlib
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from suspension_cli.analyses import options
from suspension_cli.analyses.logs import Log, RunLog
from suspension_cli.analyses.options import Input, Option, Settings
from suspension_cli.analyses.record import Origin
from suspension_cli.errors import InputError, attribute_faults_to
from suspension_cli.files.documents import Document as Document

if TYPE_CHECKING:
    import click
    import h5py
    from matplotlib.figure import Figure

    from suspension_cli.design.reader import Source
    from suspension_cli.design.schema import Design
    from suspension_cli.models.registry import Choice


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

    def __post_init__(self) -> None:
        object.__setattr__(self, "log", RunLog(self.log))

    def origin(self, analysis: Analysis, choice: Choice) -> Origin:
        """Describe this run to its record, when all warnings have been given."""
        assert isinstance(self.log, RunLog)
        warned = tuple(dict.fromkeys(self.log.warnings))
        return Origin(analysis, self.source, choice, self.command, warned, self.setting)

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


class Analysis(ABC):
    """An analysis of a design: its parameters, its physics, its file, its picture, its text.

    The docstring of its class is the help of the command; sections of it (Returns, Raises,
    Examples) are for the Python function alone.
    """

    name: ClassVar[str]  # of the HDF5 group, the function and the command (see `command_name`)
    result_type: ClassVar[str] = ""  # path of the class of its results, whose fields are stored
    fills_file: ClassVar[bool] = False  # while it runs; the file has more than the record
    has_model: ClassVar[bool] = True  # results come from one, which JSON names with its error
    has_file: ClassVar[bool] = True
    draws_neglected: ClassVar[bool] = False  # pictures say at the bottom what the model neglects
    arguments: ClassVar[tuple[click.Argument, ...]] = ()
    inputs: ClassVar[tuple[Input, ...]] = (Input(),)  # of the Python function, for `arguments`
    returns: ClassVar[str] = ""  # type of what the Python function returns, if not `result_type`
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
    def solve(self, run: Run) -> Any:
        """Compute the result; raises `InputError` for faults of the design or of a setting."""

    def document(self, result: Any) -> Document:
        """JSON document without its head (command, design, model, estimated error).

        It follows from the fields of the record and its `in_json`; an analysis adds what is none.
        """
        from suspension_cli.files import documents

        return documents.document(result)

    def text(self, result: Any) -> str:
        """Table or summary that the command prints; empty for a page or drawing."""
        return ""

    def returned_type(self) -> Any:
        """What the Python function returns: the class of the record, or a name."""
        path = self.returns or self.result_type
        return _imported(path) if "." in path else path

    def record_type(self) -> Any:
        """Import the class whose fields declare what is stored."""
        return _imported(self.result_type)

    def fill(self, file: h5py.File, result: Any) -> None:
        """Write the result into a group of the open results file."""
        from suspension_cli.files import stored

        if not self.has_file:
            remedy = "print it, or take document()"
            raise InputError.of("", f"{self.name} has no results file", remedy)
        stored.write(file.create_group(self.name), result.complete())

    def read_result(self, file: h5py.File, run: Origin, extra: Document) -> Any:
        """Read a result from an open results file; `extra` has fields that older files lack."""
        from suspension_cli.files import stored

        given = {key: tuple(one) if isinstance(one, list) else one for key, one in extra.items()}
        return stored.read(file[self.name], self.record_type(), **(given | {"run": run}))

    def figures(self, result: Any, setting: Settings) -> dict[str, Figure]:
        """Draw the pictures: the end of each file name (before its ending), and the figure."""
        return {}

    def animations(self, result: Any, setting: Settings) -> Iterator[tuple[str, bytes]]:
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

    def path(self, result: Any, folder: Path) -> Path:
        """Path of the results file."""
        return folder / f"{result.run.design.stem()}-{self.stem}.h5"

    def save(self, path: Path, result: Any) -> None:
        """Write the results file."""
        from suspension_cli.files import hdf5, whole_files

        stored = result.stored_file()
        if path.suffix.lower() == ".csv":
            from suspension_cli.analyses import labelled

            labelled.write_csv(result, path)
        elif path.suffix.lower() in set(options.ENDINGS) - set(options.RESULTS_ENDINGS):
            remedy = "end it in .h5 or .csv; pictures: plot().savefig(...), JSON: document()"
            problem = "ends like a file of another kind"
            raise InputError.of("--out", problem, remedy, str(path))
        elif stored is None:
            hdf5.write(path, result.provenance, partial(self.fill, result=result))
        elif not (path.exists() and path.samefile(stored)):
            whole_files.copy_file(stored, path)

    def others(self, result: Any, path: Path) -> list[Path]:
        """Write files beside the results file at `path`, and return their paths."""
        return []

    def exit_code(self, result: Any) -> int:
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

    def returned(self, result: Any, files: Settings) -> Any:
        """What the Python function returns."""
        return result


def _imported(path: str) -> Any:
    """Import a class by its path in the package."""
    module, _, name = path.rpartition(".")
    return getattr(importlib.import_module(f"suspension_cli.{module}"), name)


def name_mirrors(mirrors: float, tilt: float = 0.0) -> str:
    """End of a title, ``", 4 mirrors"``, and along a beam that rises by an angle in rad."""
    along = f" along a beam that rises by {1e6 * tilt:.3g} urad" if tilt else ""
    return along + (f", {mirrors:g} mirrors" if mirrors != 1 else "")
