"""The public API: the analyses of the command line as functions, on designs as objects.

An argument at its default value takes that of the design's ``[analysis]`` table, if it gives one,
as options of the commands do.

Import it as ``import suspension_cli as sus``; docs/api.md has examples of every function. A
function is stable unless its docstring says "Provisional" under Notes; docs/api.md says what that
means.
"""

from __future__ import annotations

import dataclasses
import html
import inspect
import shutil
import tempfile
import tomllib
import warnings
import weakref
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.analyses import known_analyses, options, settings
from suspension_cli.analyses.analysis import Analysis, Run, Settings
from suspension_cli.analyses.logs import Log
from suspension_cli.analyses.python_functions import demand_known_arguments, describe, python_names
from suspension_cli.analyses.record import Record
from suspension_cli.conventions import ANALYSES
from suspension_cli.design import paths, reader
from suspension_cli.design.bodies import body_mass
from suspension_cli.design.faults import suggest
from suspension_cli.design.reader import Source
from suspension_cli.errors import InputError, PendsusWarning, text_of

if TYPE_CHECKING:
    from suspension_cli.importing.imported import Imported

Grid = str | float | Sequence[float] | np.ndarray
"""Numbers: ``"0.1:100:2000:log"``, one number, or an array."""
Names = str | Sequence[str]
"""One text, or several."""
PathLike = str | Path
Paths = PathLike | Sequence[PathLike]
"""One path, or several."""


@dataclasses.dataclass(frozen=True)
class Design(Source):
    """A design: a TOML file that was read and checked.

    Attributes
    ----------
    design : design.schema.Design
        The tables of the file as frozen objects; `Design.stage` is ``Design.design.stage``.
    text : str
        The whole design as TOML.
    file : str
        Name of the file; empty if there is none.
    """

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_") or name == "design":
            raise AttributeError(name)
        return getattr(self.design, name)

    def replace(self, changes: Mapping[str, object]) -> Design:
        """Return a copy of the design with other values.

        Parameters
        ----------
        changes : mapping
            New values by dotted path, as ``--set`` takes them; also of numpy.

        Raises
        ------
        InputError
            If a path leads nowhere or the new design has faults.

        Examples
        --------
        >>> import suspension_cli as sus
        >>> design = sus.template("double").replace({"stage.test.wires.d": 0.002})
        >>> design.stage[-1].wires.d
        0.002
        """
        with python_names(set="changes"):
            source = reader.replaced(self, changes)
        return Design(**vars(source))

    def __getitem__(self, path: str) -> Any:
        """Return the value at a dotted path of the file, as `replace` takes it.

        Examples
        --------
        >>> import suspension_cli as sus
        >>> sus.template("double")["stage.test.wires.d"]
        0.001
        """
        path = _text(path, "path", "write for example stage.test.wires.d")
        found = paths.value_at(tomllib.loads(self.text), path)
        if found is None:
            known = self._ipython_key_completions_()
            raise InputError.of(path, "is not given by the design", suggest(path, known))
        return found

    def _ipython_key_completions_(self) -> list[str]:
        """Paths that a notebook completes in ``design["stage...``."""
        document = tomllib.loads(self.text)
        return [path for key in document for path, _ in paths.numbers(key, document[key])]

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self.design.__struct_fields__})

    def _repr_html_(self) -> str:
        """Table of the stages, as notebooks show it."""
        rows = [("stage", "mass (kg)", "wires", "blades")]
        for one in self.design.stage:
            wires = one.wires.count if one.wires else len(one.wire)
            blades = one.blades.count if one.blades else len(one.blade)
            rows.append((one.name, f"{body_mass(one.body):.6g}", str(wires), str(blades)))
        title = html.escape(self.title)
        cells = "".join(
            f"<tr>{''.join(f'<td>{html.escape(cell)}</td>' for cell in row)}</tr>" for row in rows
        )
        return f"<table><caption>{title}</caption>{cells}</table>"

    def save(self, path: PathLike) -> None:
        """Write the design as a TOML file, whole or not at all.

        Raises
        ------
        InputError
            If the file cannot be written.

        Examples
        --------
        >>> import suspension_cli as sus
        >>> sus.template("double").replace({"design.name": "mine"}).save("mine.toml")
        >>> sus.read("mine.toml")
        <Design mine: upper, test>
        """
        from suspension_cli.files.whole_files import write_bytes

        with python_names(out="path"):
            write_bytes(Path(options.path(path, "path")), self.text.encode(), key="path")

    def foton(self) -> str:
        """Return the filters of the ``[control]`` loops as strings for Foton.

        Examples
        --------
        >>> import suspension_cli as sus
        >>> print(sus.example("triple-damped").foton().splitlines()[-1])
        zpk([0],[1.3+i*5;1.3-i*5;20],3.184713375796178,"n")
        """
        from suspension_cli.analyses.damp.command import write_foton

        return write_foton(self.design)

    def __hash__(self) -> int:
        return hash((self.text, self.file))  # tables of the design cannot be hashed

    def __repr__(self) -> str:
        stages = ", ".join(stage.name for stage in self.design.stage)
        return f"<Design {self.name}: {stages}>"


def read(file: PathLike, overrides: Names = (), ties: Names = ()) -> Design:
    """Read and check a design file.

    Parameters
    ----------
    file : path
    overrides : str or sequence of str
        Values to change, as ``--set`` takes them: ``"stage.test.wires.d=0.002"``.
    ties : str or sequence of str
        Parameters that follow from others, as ``--tie`` takes them:
        ``"stage.test.wires.t2 = stage.test.wires.t1 + 5e-3"``.

    Raises
    ------
    InputError
        With every fault of the file.

    Examples
    --------
    >>> from pathlib import Path
    >>> import suspension_cli as sus
    >>> written = Path("my.toml").write_text(sus.template("double").text)
    >>> sus.read("my.toml", "design.name=mine")
    <Design mine: upper, test>
    """
    with python_names(set="overrides", tie="ties"):
        path = options.path(file, "file")
        changes = options.items(overrides, "overrides")
        source = reader.read(path, changes, options.items(ties, "ties"))
    return Design(**vars(source))


def parse(text: str) -> Design:
    """Check a design given as TOML text.

    Parameters
    ----------
    text : str

    Raises
    ------
    InputError
        With every fault of the text.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> design = sus.parse('''
    ... [design]
    ... name = "pendulum"
    ... [[stage]]
    ... name = "test"
    ... body = { mass = 20.0, inertia = [0.147, 0.117, 0.110] }
    ... wires = { count = 4, l = 0.4, s = 0.025, t1 = 0.0, t2 = 0.133, k = 4e4 }
    ... ''')
    >>> design
    <Design pendulum: test>
    """
    with python_names():
        design = reader.parse(_text(text, "text", "give TOML; sus.read reads a file"))
    return Design(design, text, "")


def template(kind: str) -> Design:
    """Return a starting design.

    Parameters
    ----------
    kind : {"single", "double", "triple", "quad", "blades"}

    Raises
    ------
    InputError
        If there is no such template.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> [stage.name for stage in sus.template("triple").stage]
    ['upper', 'middle', 'test']
    """
    with python_names():
        known = f"give one of {', '.join(reader.TEMPLATES)}"
        return parse(reader.template(_text(kind, "kind", known), kind))


def example(name: str) -> Design:
    """Return a design that comes with the program.

    Parameters
    ----------
    name : str
        One of `examples`.

    Raises
    ------
    InputError
        If there is no such design.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> sus.example("geo-silica-triple").name
    'geo-silica-triple'
    """
    with python_names():
        source = reader.example(_text(name, "name", "give one of sus.examples()"))
    return Design(**vars(source))


def examples() -> list[str]:
    """List the designs that come with the program.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> "husman2000/table2" in sus.examples()
    True
    """
    return reader.examples()


def import_gwinc(file: PathLike, *, name: str = "") -> Design:
    """Convert the suspension of gwinc's parameters (``ifo.yaml``) into a design.

    What is chosen, as the file does not say it, and what is otherwise than in gwinc is given as
    Python warnings.

    Parameters
    ----------
    file : path
        The parameters, in YAML.
    name : str
        Name of the design; default the stem of the file.

    Raises
    ------
    InputError
        If the file is no YAML, has no suspension, lacks a key, or gives no valid design.

    Notes
    -----
    Provisional: it follows the parameters of another program.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> text = '''
    ... Suspension:
    ...   FiberType: Round
    ...   Temp: 290
    ...   Fiber: {Radius: 200e-6}
    ...   Stage:
    ...     - {Mass: 40, Length: 0.6, K: .nan, WireRadius: .nan, Blade: .nan, NWires: 4}
    ...   Silica:
    ...     {Rho: 2200, C: 772, K: 1.38, Alpha: 3.9e-7, dlnEdT: 1.52e-4, Phi: 4.1e-10, Y: 72e9}
    ... '''
    >>> written = open("ifo.yaml", "w").write(text)
    >>> sus.import_gwinc("ifo.yaml")
    <Design ifo: test>
    """
    from suspension_cli.importing import gwinc_suspension

    path = Path(options.path(file, "file"))
    with python_names():
        found = gwinc_suspension.read(path, _imported_name(name, path))
    return _imported(found, path)


def import_sumcon(
    file: PathLike, *, name: str = "", tables: PathLike | None = None, bending_points: bool = False
) -> Design:
    """Convert a save of SUMCON, KAGRA's modeller of suspensions, into a design.

    What the design has otherwise than the save is given as Python warnings.

    Parameters
    ----------
    file : path
        The save (``.m``).
    name : str
        Name of the design; default the stem of the file.
    tables : path
        Folder of the stiffness tables of heat links; default the folder ``HeatLink`` near the save.
    bending_points : bool
        End wires at SUMCON's hinges instead of at their clamps.

    Raises
    ------
    InputError
        If the file is no save, is damaged, or gives no valid design.

    Notes
    -----
    Provisional: it follows the saves of another program.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> text = '''
    ... save$bdn = {{True, "g"}, {False, "TM"}}
    ... save$mass = {{0, {{0, 0, 0}, {0, 0, 0}, {0, 0, 0}}},
    ...   {20., {{0.15, 0, 0}, {0, 0.12, 0}, {0, 0, 0.11}}}}
    ... save$mat = {{"Steel", 7.8, 206, 0.3, 3., -4, ""}}
    ... save$wire = {{1, {0, 0, 0}, 2, {0, 0.004, 0}, 1, 0.5, 0.001, 0, 0.001, 196.2,
    ...   {0, -1, 0}, {0, 1, 0}, "g-TM-1", 323000., 0.0156}}
    ... '''
    >>> written = open("save.m", "w").write(text)
    >>> sus.import_sumcon("save.m")
    <Design save: TM>
    """
    from suspension_cli.importing import convert as sumcon

    path = Path(options.path(file, "file"))
    folder = None if tables is None else Path(options.path(tables, "tables"))
    with python_names():
        own = _imported_name(name, path)
        found = sumcon.read(path, own, tables=folder, bending_points=bending_points)
    return _imported(found, path)


def _imported_name(name: str, path: Path) -> str:
    return _text(name, "name", "give one text") or reader.make_name(path.stem)


def _imported(found: Imported, path: Path) -> Design:
    """Give the notes on an imported design as warnings of the caller's caller, and return it."""
    for note in found.notes:
        warnings.warn(f"{path}: {note}", PendsusWarning, stacklevel=3)
    return Design(**vars(found.source()))


def load(file: PathLike) -> Any:
    """Read a result from a results file: the record that the analysis returned.

    Parameters
    ----------
    file : path
        HDF5 from a command or from `Record.save`.

    Raises
    ------
    InputError
        If the file holds no result; a state space from `export` is not one.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> found = sus.modes(sus.example("double"), fidelity="string")
    >>> found.save("modes.h5")
    >>> sus.load("modes.h5").document() == found.document()
    True
    """
    from suspension_cli.files.hdf5 import open_results

    with python_names(), open_results(options.path(file, "file")) as results:
        return known_analyses.loaded(results, str(file), Design)


def animate(result: Record, mode: int | str, path: PathLike) -> Path:
    """Write one period of a mode as an animation (GIF) that repeats.

    Parameters
    ----------
    result : Record
        Of `modes`.
    mode : int or str
        Number of the mode, from 1, or its label.
    path : path

    Returns
    -------
    Path

    Raises
    ------
    InputError
        If there is no such mode, or the file cannot be written.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> found = sus.modes(sus.template("single"), fidelity="string")
    >>> sus.animate(found, "test yaw", "yaw.gif")
    PosixPath('yaw.gif')
    """
    from suspension_cli.analyses.modes import picture
    from suspension_cli.equilibrium.nominal import expand_geometry
    from suspension_cli.files.whole_files import write_bytes

    found = _of_analysis(result, "modes", "has no modes that move")
    path = options.path(path, "path")
    with python_names():
        if not isinstance(mode, (int, str)):
            remedy = "give its number, from 1, or its label"
            raise InputError.of("mode", "names no mode", remedy, options.shown(mode))
        numbers = picture.parse_names(found, text_of(mode), "mode")
        if len(numbers) > 1:
            problem, remedy = "names several modes", "give one number, and a file for each"
            raise InputError.of("mode", problem, remedy, options.shown(mode))
        number = numbers[0]
        design = found.run.design.design
        moving = picture.animate(found, number, design, expand_geometry(design))
        write_bytes(Path(path), moving, key="path")
    return Path(path)


def python_control(result: Record) -> Any:
    """Convert a result of `export` to a `control.StateSpace` of python-control.

    Dots in names of states, inputs and outputs become underscores.

    Parameters
    ----------
    result : Record
        Of `export`.

    Returns
    -------
    control.StateSpace

    Raises
    ------
    InputError
        If the result is of another analysis, or has zeros and poles instead of matrices.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> made = sus.export(sus.template("single"), inputs="support.x", outputs="test.x")
    >>> sus.python_control(made).nstates
    4
    """
    from suspension_cli.analyses.export import file

    return file.python_control(_state_space(result))


def finesse(result: Record, name: str, mirror: Any, facing: int = 1) -> Any:
    """Suspend a mirror of a finesse model by the state space of a result of `export`.

    Motions of the mirror and forces on it are the nodes of its own mechanical port; those of other
    bodies are ``name.body.signal``, with dashes of their names as underscores.

    Parameters
    ----------
    result : Record
        Of `export` with `format="finesse"`.
    name : str
        Of the new element.
    mirror : finesse.components.Mirror
        That is suspended.
    facing : int
        1 if its normal on side 1 points along the design's x, -1 if against it.

    Returns
    -------
    finesse.components.Connector
        To be added to the model that has the mirror.

    Raises
    ------
    InputError
        If the result is of another analysis, has zeros and poles instead of matrices, or signals
        that finesse's mirrors do not have.

    Notes
    -----
    Provisional: it follows the elements of another program.

    Examples
    --------
    >>> import finesse, suspension_cli as sus
    >>> made = sus.export(sus.template("single"), format="finesse", loss=True)
    >>> model = finesse.Model().parse("m etm R=1 T=0")
    >>> element = model.add(sus.finesse(made, "suspension", model.etm))
    >>> element.support.x.full_name
    'suspension.support.x'
    """
    from suspension_cli.analyses.export import file

    made = _state_space(result)
    with python_names():
        file.check_names(made.system.input, made.system.output, made.mirror)
    return file.suspend(made, name, mirror, facing)


def gwinc(result: Record, frequency: Any = None) -> Any:
    """Make a noise budget of gwinc whose mirrors hang as the design of a result of `export`.

    Parameters
    ----------
    result : Record
        Of `export` with `format="gwinc"`.
    frequency : array or str, optional
        Hz, or ``"FROM:COUNT:TO"``; by default 6000 frequencies of the table's band.

    Returns
    -------
    gwinc.nb.Budget
        Of the strain of the result's interferometer.

    Raises
    ------
    InputError
        If the result is of another analysis or format.
    RuntimeError
        If the table does not have these frequencies, or gwinc does not know the interferometer.

    Notes
    -----
    Provisional: it follows the noise budgets of another program.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> made = sus.export(sus.example("geo-silica-triple"), format="gwinc", band="10:100")
    >>> sus.gwinc(made, frequency="20:10:50").run()["SuspensionThermal"].asd.shape
    (10,)
    """
    from suspension_cli.analyses.export import gwinc_budget

    made: Any = result
    if not hasattr(made, "interferometer"):
        remedy = 'give a result of sus.export(..., format="gwinc")'
        raise InputError.of("result", "has no table for gwinc", remedy, options.shown(result))
    return gwinc_budget.suspend(made.table, made.interferometer)(freq=frequency)


def _of_analysis(result: object, name: str, problem: str) -> Any:
    """Return a result of an analysis; raises `InputError` for anything else."""
    remedy = f"give a result of sus.{name}"
    if not isinstance(result, Record):
        raise InputError.of("result", "is no result", remedy, options.shown(result))
    if result.run.analysis.name != name:
        raise InputError.of("result", problem, remedy, result.run.analysis.name)
    return result


def _state_space(result: object) -> Any:
    """Return the exported state space of a result."""
    made = _of_analysis(result, "export", "has no state space")
    if getattr(made, "zpk", "") is not None:
        remedy = "give a result of sus.export"
        raise InputError.of("result", "has no state space", remedy, "export")
    return made


def _text(value: object, name: str, remedy: str) -> str:
    """Return a text; raises `InputError` for anything else."""
    if not isinstance(value, str):
        raise InputError.of(name, "must be a text", remedy, options.shown(value))
    return value


def _design(value: object) -> Source:
    """Return a design, read from its file where a path is given."""
    if isinstance(value, PathLike):
        return read(value)
    if not isinstance(value, Source):
        remedy = "give one of sus.read, sus.parse, sus.template or sus.example"
        if isinstance(value, Record):
            remedy = "give the attribute design of the result"
        raise InputError.of("design", "is no design", remedy, options.shown(value))
    return value


def _function(name: str) -> Callable[..., Any]:
    """Make the function of an analysis from the record of its command."""
    analysis = known_analyses.get(name)

    def call(*positional: Any, **named: Any) -> Any:
        demand_known_arguments(analysis, inspect.signature(call).parameters, named)
        bound = inspect.signature(call).bind(*positional, **named)
        bound.apply_defaults()
        return _run(analysis, bound.arguments)

    describe(call, analysis)
    return call


def _run(analysis: Analysis, named: Settings) -> Any:
    """Run an analysis with the arguments of its function."""
    name = analysis.name
    folder = named.get("folder")
    folder = None if folder is None else options.path(folder, "folder")
    files = {}
    for one in analysis.inputs:
        own = one.name.lstrip("*")
        value = named[own]
        if one.kind == "Design" and not (one.optional and value is None):
            value = _design(value)
        files[own] = options.path(value, own) if one.kind == "PathLike" else value
    with python_names(analysis.parameters):
        given = options.from_arguments(name, analysis.parameters, named)
    if given.get("resume") and folder is None:
        remedy = "name the folder of the interrupted run"
        raise InputError.of("folder", "is missing, but resume is given", remedy)
    place = Path(tempfile.mkdtemp(prefix="pendsus-") if folder is None else folder)

    def ask(file: Source | PathLike, overrides: tuple[str, ...] = ()) -> Run:
        design = file if isinstance(file, Source) else read(file, overrides)
        setting = settings.merge(analysis, design, given | {"as_json": True})
        return Run(design, setting, Log(analysis.parameters), place, f"suspension_cli.{name}()")

    result = None
    try:
        with python_names(analysis.parameters):
            run = analysis.read(ask, analysis.files(files))
            with run.faults():
                result = analysis.solve(run)
        if folder is None and result.run.file is not None:
            held = dataclasses.replace(result.run, holder=_TemporaryFolder(place))
            result = dataclasses.replace(result, run=held)
        return analysis.returned(result, files)
    finally:
        if folder is None and (result is None or result.run.file is None):
            shutil.rmtree(place)


class _TemporaryFolder:
    """A folder that is deleted with the last result, or copy of it, that refers to its file."""

    def __init__(self, path: Path) -> None:
        weakref.finalize(self, shutil.rmtree, path, ignore_errors=True)

    def __deepcopy__(self, _memo: object) -> _TemporaryFolder:
        return self

    def __reduce__(self) -> tuple[type[None], tuple[()]]:
        return type(None), ()  # a pickle does not keep the folder


def __getattr__(name: str) -> Any:
    """Make the function of an analysis when it is first asked for."""
    if name not in ANALYSES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return globals().setdefault(name, _function(name))
