"""What analyses return: a frozen record of arrays, which stands alone, and the run it comes from.

>>> import suspension_cli as sus
>>> found = sus.modes(sus.example("double"), fidelity="string")
>>> found.frequency.shape, found.run.model
((12,), 'string')

The record of an analysis is a dataclass on `Record` in its `solve.py`::

    @dataclass(frozen=True, eq=False)
    class Thermal(Record):
        frequency: Float[np.ndarray, " frequency"] = field(metadata=in_unit("Hz"))
        output: tuple[str, ...]
        ...

Its fields declare kinds of numbers, dimensions and units (`files.declared`), from which HDF5, CSV,
xarray, JSON (`files.documents`), the check of what is loaded, and the annotations that editors
complete follow. It has all that its text and its pictures need: these solve nothing, and do not
build the model again. Curves that only pictures need have the dimension `declared.FINE`; one that
takes long is computed when the record is first drawn or saved (`Record.complete`), never for a
record that was loaded. The field `run` comes by keyword, ``Thermal(frequency, ...,
run=run.origin(self, choice))``, and is not stored with the others: a results file has its contents
as root attributes. A record may extend a class of `physics/` or `linear/` that has its fields,
``class Modes(Record, eigenmodes.Modes)``, and is made from an object of that class by
`Record.extending`. No field may have the name of an attribute of `Record`.
"""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, Self

from suspension_cli.analyses import options
from suspension_cli.analyses.options import Option, Settings
from suspension_cli.errors import Fault, InputError, suggest
from suspension_cli.files.declared import NOT_STORED
from suspension_cli.files.documents import Document, as_json
from suspension_cli.grids import is_numbers, write_grid

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

    from suspension_cli.design.reader import Source
    from suspension_cli.files.hdf5 import Provenance
    from suspension_cli.models.registry import Choice


class Presenter(Protocol):
    """The forms that an analysis gives its results; see `analysis.Analysis`."""

    name: ClassVar[str]
    has_model: ClassVar[bool]
    draws_neglected: ClassVar[bool]
    fills_file: ClassVar[bool]
    drawn_with: ClassVar[tuple[Option, ...]]

    @property
    def command_name(self) -> str:
        """Name of the command."""
        ...

    def document(self, result: Any) -> Document:
        """JSON document without its head."""
        ...

    def text(self, result: Any) -> str:
        """Text that the command prints."""
        ...

    def figures(self, result: Any, setting: Settings) -> dict[str, Figure]:
        """Pictures by the ends of the names of their files."""
        ...

    def save(self, path: Path, result: Any) -> None:
        """Write the results file."""
        ...


@dataclasses.dataclass(frozen=True, eq=False)
class Origin:
    """Where a result comes from: the field `run` of its record.

    Attributes
    ----------
    analysis : Analysis
        The analysis, which has the text and the pictures of its results.
    design : Source
        The design that was analysed (in Python a `Design`), its TOML text with overrides applied
        and the name of its file.
    choice : Choice
        The model, why it was chosen, and its estimated error.
    command : str
        The command line, or the function, that computed it.
    warnings : tuple of str
        What was warned of.
    setting : dict
        Values of all options, grids as texts or numbers; empty if the result was read from a file.
    file : Path or None
        The results file that the analysis filled while it ran, or that the result was read from.
    stamp : tuple of int
        Identity of that file when the result was made.
    holder : object
        Deletes a temporary file when no result refers to it any more.
    """

    analysis: Presenter
    design: Source
    choice: Choice
    command: str = ""
    warnings: tuple[str, ...] = ()
    setting: Settings = dataclasses.field(default_factory=dict)
    file: Path | None = None
    stamp: tuple[int, ...] = dataclasses.field(init=False, default=())
    holder: object = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "stamp", _stamp(self.file))

    @property
    def options(self) -> Settings:
        """Values of all options, grids as texts; empty if the result was read from a file."""
        return {
            name: write_grid(value) if is_numbers(value) else value
            for name, value in self.setting.items()
        }

    @property
    def name(self) -> str:
        """Name of the design."""
        return self.design.name

    @property
    def title(self) -> str:
        """Title of the design, or its name."""
        return self.design.title

    @property
    def model(self) -> str:
        """Name of the model."""
        return self.choice.level

    @property
    def error(self) -> float:
        """Relative error of the model, estimated; NaN where it cannot be."""
        return self.choice.error

    @property
    def provenance(self) -> Provenance:
        """Origin that a results file records."""
        from suspension_cli.files.hdf5 import Provenance

        return Provenance(
            self.design.text,
            self.command,
            self.model,
            self.choice.reason,
            self.error,
            self.warnings,
        )


def _stamp(file: Path | None) -> tuple[int, ...]:
    """Identify a file as it is now; empty if there is none."""
    try:
        found = os.stat(file) if file is not None else None
    except OSError:
        found = None
    return () if found is None else (found.st_ino, found.st_mtime_ns, found.st_size)


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Record:
    """Result of an analysis: arrays and numbers with units, and the run that they come from.

    A record is equal to itself alone; compare two by their arrays or by `document`.

    Attributes
    ----------
    run : Origin
        The design, the model with its error, the warnings, the command and the file.
    """

    run: Origin = dataclasses.field(kw_only=True, metadata=NOT_STORED)

    @classmethod
    def extending(cls, part: Any, **fields: Any) -> Self:
        """Make a record from an object of the class that it extends, and its other fields."""
        own = {one.name: getattr(part, one.name) for one in dataclasses.fields(part)}
        return cls(**(own | fields))

    def in_file(self, file: Path) -> Self:
        """The record with the results file that it was written to."""
        return dataclasses.replace(self, run=dataclasses.replace(self.run, file=file))

    def complete(self) -> Self:
        """Return the record with all that its pictures and its file have beside the text."""
        return self

    @property
    def design(self) -> Source:
        """The design that was analysed."""
        return self.run.design

    @property
    def model(self) -> str:
        """Name of the model."""
        return self.run.model

    @property
    def estimated_error(self) -> float:
        """Relative error of the model, estimated; NaN where it cannot be."""
        return self.run.error

    @property
    def subtitle(self) -> str:
        """Title of the design and name of the model, for the second line of a picture."""
        run = self.run
        return f"{run.title} · {run.model} model" if run.analysis.has_model else run.title

    def document(self) -> Document:
        """Return the JSON document that ``pendsus ... --json`` prints."""
        run = self.run
        head: Document = {"command": run.analysis.command_name, "design": run.name}
        own = run.analysis.document(self)
        if not run.analysis.has_model:
            return as_json(head | own)
        error: Document = {"estimated_error": run.error}
        if run.choice.error_unknown:
            error["error_unknown"] = run.choice.error_unknown
        return as_json(head | {"fidelity": run.model} | own | error)

    def figures(self, **setting: object) -> dict[str, Figure]:
        """Draw all pictures: the end of each file name, and the figure; settings as of `plot`."""
        from suspension_cli.analyses.python_functions import python_names

        analysis = self.run.analysis
        known = options.default_values(analysis.drawn_with)
        for key in setting.keys() - known.keys():
            problem = f"is no argument of plot() of {analysis.command_name}"
            raise InputError.of(key, problem, suggest(key, list(known)))
        with python_names():
            given = options.from_arguments(analysis.command_name, analysis.drawn_with, setting)
        drawn = analysis.figures(self, {**known, **given})
        if analysis.draws_neglected:
            from suspension_cli.drawing.style import name_neglected

            for figure in drawn.values():
                name_neglected(figure, self.run.choice)
        return drawn

    def plot(self, **setting: object) -> Figure:
        """Draw the picture that the command writes; of a loaded result nothing is solved for it.

        Parameters
        ----------
        **setting
            For responses ``scale``, ``"db"`` (the default) or ``"absolute"``; for local control
            ``loops``; others have none.

        Raises
        ------
        InputError
            If there is no picture (`export`), or no such argument.
        """
        for figure in self.figures(**setting).values():
            return figure
        raise InputError.of("", f"{self.run.analysis.name} has no picture", "print the result")

    def save(self, path: str | Path) -> None:
        """Write the results file (HDF5, see docs/format.md), whole or not at all.

        A path that ends in .csv gets the numbers as CSV, as ``--csv`` writes them: a row per
        frequency, mode or point. Arrays with other rows go into files beside it, NAME-ROWS.csv.
        The file of `export` has the format of its ending, see docs/handing-over.md; a noise budget
        of gwinc is a folder.

        Raises
        ------
        InputError
            If the file cannot be written, or the ending is that of another format.
        """
        from suspension_cli.analyses.python_functions import python_names

        target = Path(options.path(path, "path"))
        with python_names(out="path"):
            self.run.analysis.save(target, self)

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
        """Path of the file that has more than the record: of a sweep; None for other analyses.

        Raises `InputError` if the file was deleted or replaced since this result was read from it.
        """
        run = self.run
        if run.file is None or not run.analysis.fills_file:
            return None
        now = _stamp(run.file)
        if not now or now != run.stamp:
            problem = "was replaced by another file" if now else "was deleted"
            problem += "; this result is read from there"
            fault = Fault("", problem, "compute the result again, or load its copy")
            raise InputError([fault], str(run.file))
        return run.file

    @property
    def provenance(self) -> Provenance:
        """Origin that a results file records."""
        return self.run.provenance

    __eq__ = object.__eq__
    __hash__ = object.__hash__

    def __str__(self) -> str:
        return self.run.analysis.text(self)

    def __repr__(self) -> str:
        run = self.run
        model = f", {run.model} model" if run.analysis.has_model else ""
        return f"<pendsus {run.analysis.name} of {run.name}{model}>"

    def _repr_html_(self) -> str:
        import html

        return f"<pre>{html.escape(str(self))}</pre>"
