"""The public API: the analyses of the command line as functions, on designs as objects.

An argument at its default value takes that of the design's ``[analysis]`` table, if it gives one,
as options of the commands do.

Import it as ``import suspension_cli as sus``; docs/api.md has examples of every function.
"""

from __future__ import annotations

import dataclasses
import shutil
import tempfile
import weakref
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from suspension_cli.analyses import arguments as convert
from suspension_cli.analyses import options, registry, settings
from suspension_cli.analyses.analysis import Log, Result, Run, Settings
from suspension_cli.analyses.check.solve import Check
from suspension_cli.analyses.check.solve import solve as solve_check
from suspension_cli.analyses.info.solve import Info
from suspension_cli.analyses.info.solve import solve as solve_info
from suspension_cli.analyses.python_names import python_names
from suspension_cli.design import reader
from suspension_cli.design.reader import Source
from suspension_cli.errors import InputError

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

    @property
    def name(self) -> str:
        """Name of the design."""
        return self.design.design.name

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

    def foton(self) -> str:
        """Return the filters of the ``[control]`` loops as strings for Foton.

        Examples
        --------
        >>> import suspension_cli as sus
        >>> print(sus.example("triple-damped").foton().splitlines()[-1])
        zpk([0],[1.3+i*5;1.3-i*5;20],3.184713375796178,"n")
        """
        from suspension_cli.analyses.damp import foton_file

        return foton_file.write(self.design)

    def __hash__(self) -> int:
        return hash((self.text, self.file))  # tables of the design cannot be hashed

    def __repr__(self) -> str:
        stages = ", ".join(stage.name for stage in self.design.stage)
        return f"<Design {self.name}: {stages}>"


def read(file: PathLike, overrides: Names = ()) -> Design:
    """Read and check a design file.

    Parameters
    ----------
    file : path
    overrides : str or sequence of str
        Values to change, as ``--set`` takes them: ``"stage.test.wires.d=0.002"``.

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
    with python_names(set="overrides"):
        source = reader.read(convert.path(file, "file"), convert.items(overrides, "overrides"))
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
        design = reader.parse(convert.text(text, "text", "give TOML; sus.read reads a file"))
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
        return parse(reader.template(convert.text(kind, "kind", known), kind))


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
        source = reader.example(convert.text(name, "name", "give one of sus.examples()"))
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


def load(file: PathLike) -> Result:
    """Read a result from a results file.

    Parameters
    ----------
    file : path
        HDF5 from a command or from `Result.save`.

    Raises
    ------
    InputError
        If the file holds no result; a state space from `export` is not one.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> found = sus.modes(sus.example("double"), model="string")
    >>> found.save("modes.h5")
    >>> sus.load("modes.h5").document() == found.document()
    True
    """
    from suspension_cli.files.hdf5 import open_results

    with python_names(), open_results(convert.path(file, "file")) as results:
        found = registry.loaded(results, str(file))
    return dataclasses.replace(found, source=Design(**vars(found.source)))


def modes(
    design: Design,
    *,
    max_frequency: float | None = None,
    every: bool = False,
    model: str = "auto",
    tolerance: float = 1e-3,
) -> Result:
    """Compute the normal modes: frequencies, shapes, Q.

    Parameters
    ----------
    design : Design
    max_frequency : float, optional
        Hz; list all modes up to here, violin modes too.
    every : bool
        Compute all modes of wires with mass, even if there are more than a thousand.
    model : str
        ``"auto"`` or the name of a model.
    tolerance : float
        Relative error that ``"auto"`` may leave.

    Returns
    -------
    Result
        With the attributes of `linear.eigenmodes.Modes`: `frequency` (m,) in Hz, `q` (m,), `label`,
        `shape`, ...

    Raises
    ------
    InputError
        If the design does not balance, or the model is not valid for it.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> found = sus.modes(sus.example("husman2000/table1-case3"), model="string")
    >>> found.label[0], round(float(found.frequency[0]), 4)
    ('test transverse', 0.7914)
    """
    return _run("modes", locals())


def response(
    design: Design,
    *,
    inputs: Names = (),
    outputs: Names = (),
    frequency: Grid = "0.1:100:2000",
    measured: Paths = (),
    model: str = "auto",
    tolerance: float = 1e-3,
    allow_unstable: bool = False,
    closed_loop: bool = False,
) -> Result:
    """Compute frequency responses.

    Parameters
    ----------
    design : Design
    inputs, outputs : str or sequences of str
        Signals: ``"support.x"``, ``"upper.force_x"``; ``"test.x"``, ``"test.x@0,0,0.001"``.
        Defaults: the support's x, x of the mirror.
    frequency : grid
        Hz.
    measured : path or sequence of paths
        Measured transfer functions to compare with: TOML files of measurements, or files of data
        with one input and one output. Their signals and frequencies are used besides those given.
    model, tolerance
        As in `modes`.
    allow_unstable : bool
        Continue with an unstable equilibrium or closed loop.
    closed_loop : bool
        Close the loops of the design's ``[control]`` table.

    Returns
    -------
    Result
        With the attributes of `linear.response.Response`: `frequency` (f,) in Hz, `value`
        (f, outputs, inputs), complex, in SI units. With `measured`, the attribute `measured` is a
        tuple of `analyses.response.measured.Comparison`.

    Raises
    ------
    InputError
        If a signal does not exist, the equilibrium or closed loop is unstable, or there are no
        loops to close.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> found = sus.response(sus.example("double"), frequency=[1.0, 10.0], model="string")
    >>> found.value.shape
    (2, 1, 1)
    """
    return _run("response", locals())


def thermal(
    design: Design,
    *,
    outputs: Names = (),
    frequency: Grid = "0.1:1000:2000",
    arm: float = 0.0,
    model: str = "auto",
    tolerance: float = 1e-3,
    allow_unstable: bool = False,
) -> Result:
    """Compute thermal noise, split by cause.

    Parameters
    ----------
    design : Design
    outputs : str or sequence of str
        Motions: ``"test.x"``. Default: x of the mirror.
    frequency : grid
        Hz.
    arm : float
        Observe x along the beam of an arm of this length, m; 0 for none.
    model, tolerance, allow_unstable
        As in `response`.

    Returns
    -------
    Result
        Its `data` is a list of `analyses.thermal.solve.Thermal`, one for each output, with
        `amplitude` (f,) in m/sqrt(Hz) or rad/sqrt(Hz) and `parts` by cause.

    Raises
    ------
    InputError
        If an output moves nothing that dissipates.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> found = sus.thermal(sus.example("geo-silica-triple"), frequency=[10.0, 100.0])
    >>> found.data[0].amplitude.shape
    (2,)
    """
    return _run("thermal", locals())


def budget(
    design: Design,
    *,
    outputs: Names = (),
    ground: Names = ("nhnm",),
    isolation: Names = (),
    requirements: Names = (),
    frequency: Grid = "0.01:100:2000",
    model: str = "auto",
    tolerance: float = 1e-3,
) -> Result:
    """Compute the motion of the mirror by cause, with cumulative RMS.

    Parameters
    ----------
    design : Design
    outputs : str or sequence of str
        Motions: ``"test.x"``. Default: x, pitch and yaw of the mirror.
    ground : str or sequence of str
        Motion of the support: ``"nlnm"``, ``"nhnm"``, ``"aligo-isi"``, a CSV file or ``"none"``;
        ``"z=site.csv"`` for one coordinate. Later items replace earlier ones.
    isolation : str or sequence of str
        CSV files of a platform's transmissibility; coordinates as for `ground`.
    requirements : str or sequence of str
        CSV files of required spectra: ``"goal.csv"`` for the first output, ``"test.yaw=yaw.csv"``.
    frequency : grid
        Hz. A grid ``"start:stop:count"`` gets more points around resonances, numbers are used as
        they are. The RMS is accurate for both.
    model, tolerance
        As in `response`.

    Returns
    -------
    Result
        Its `data` is a list of `analyses.budget.solve.Budget`, one for each output, with
        `amplitude` (f,) in m/sqrt(Hz) or rad/sqrt(Hz), `parts` by cause, `rms` and `rms_velocity`
        (f,) above each frequency, and `requirement`.

    Raises
    ------
    InputError
        If the closed loop is unstable, or a table has faults.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> found = sus.budget(sus.example("double"), frequency=[1.0, 10.0], ground=["nlnm"])
    >>> found.data[0].cause
    ('ground.x', 'ground.y', 'ground.z', 'thermal')
    """
    return _run("budget", locals())


def xcouple(
    design: Design,
    *,
    sweep: str | Mapping[str, Grid] = "k,offset",
    wire: str | None = None,
    body: str | None = None,
    hold: str = "loaded-length",
    input: str = "support.z",
    observe: str | None = None,
    over: str | None = None,
    under: str | None = None,
    frequency: Grid = "50",
    matrix: bool = False,
    model: str = "auto",
    tolerance: float = 1e-3,
    workers: int = 1,
    scheduler: str | None = None,
    chunk: int = 512,
    folder: PathLike | None = None,
    resume: bool = False,
    allow_unstable: bool = False,
) -> Result:
    """Compute the cross-coupling of imperfect builds.

    Parameters
    ----------
    design : Design
    sweep : str or mapping
        Imperfections or dotted paths and their grids: ``{"k": "0.6:1.4:41"}``.
    wire, body : str, optional
        The imperfect part: ``"test.1"``, ``"test"``.
    hold : {"loaded-length", "natural-length"}
        What stays the same when the wire changes.
    input : str
    observe : str, optional
        The observed point, ``"test@0,0,-0.001"``: its motion along x over that along z.
    over, under : str, optional
        Other signals for the ratio.
    frequency : grid
        Hz.
    matrix : bool
        Compute the six-by-six table of couplings of this design instead of a sweep.
    model : str
    tolerance : float
        Error that ``"auto"`` may leave, relative to the largest coupling.
    workers : int
        Number of processes.
    scheduler : str, optional
        Dask scheduler to compute on instead: ``"tls://HOST:PORT"``.
    chunk : int
        Builds computed at once.
    folder : path, optional
        Folder of the results file; default: a temporary one, kept as long as the result.
    resume : bool
        Continue the interrupted run of `folder`.
    allow_unstable : bool

    Returns
    -------
    Result
        With the attributes of `analyses.xcouple.file.Coupling`: `axes`, `ratio` (axis 1, axis 2,
        ..., f), complex.

    Raises
    ------
    InputError
        If a wire, body or imperfection does not exist.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> stage = sus.example("husman2000/figure6")
    >>> found = sus.xcouple(stage, sweep={"k": [0.9, 1.1]}, model="string")
    >>> found.ratio.shape
    (2, 1)
    """
    if not isinstance(sweep, str):
        sweep = ",".join(convert.grids(sweep, "sweep"))
    return _run("xcouple", locals())


def tolerance(
    design: Design,
    *,
    builds: int = 10_000,
    seed: int = 1,
    limit: float = 1e-3,
    require: Names = (),
    sampling: str = "random",
    sobol_indices: bool = False,
    input: str = "support.z",
    observe: str | None = None,
    over: str | None = None,
    under: str | None = None,
    frequency: Grid = "50",
    model: str = "auto",
    tolerance: float = 1e-3,
    workers: int = 1,
    scheduler: str | None = None,
    chunk: int = 512,
    folder: PathLike | None = None,
    resume: bool = False,
    allow_unstable: bool = False,
) -> Result:
    """Compute the scatter of modes and couplings over random builds (``[tolerance]`` table).

    Parameters
    ----------
    design : Design
    builds, seed : int
        Number of builds; the same seed gives the same builds.
    limit : float
        Largest acceptable cross-coupling.
    require : str or sequence of str
        Requirements beside those of the design: ``"test static pitch < 2e-3"``, ``"test pitch in
        0.5:0.7"``, ``"coupling < 1e-3"``; SI units.
    sampling : {"random", "sobol"}
        Independent builds, or 8 scrambled Sobol sequences.
    sobol_indices : bool
        Whether to compute Sobol indices, which take k + 2 sets of builds for k tolerances.
    input, observe, over, under, frequency
        The cross-coupling, as of `xcouple`.
    model, workers, scheduler, chunk, folder, resume, allow_unstable
        As in `xcouple`.
    tolerance : float
        Relative error that ``"auto"`` may leave.

    Returns
    -------
    Result
        With the attributes of `analyses.tolerance.statistics.Summary`: `mean`, `spread`,
        `quantiles` of mode frequencies in Hz, `static` (displacements in m and rotations in rad
        of the stages), `yields`, `joint`, `indices`, ...

    Raises
    ------
    InputError
        If the design has no ``[tolerance]`` table.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> found = sus.tolerance(sus.example("triple-tolerance"), builds=20, model="string")
    >>> found.good
    20
    """
    return _run("tolerance", locals())


def sweep(
    design: Design,
    *,
    vary: Mapping[str, Grid],
    results: Names = (),
    result: Names = (),
    model: str = "auto",
    tolerance: float = 1e-3,
    workers: int = 1,
    scheduler: str | None = None,
    chunk: int = 512,
    folder: PathLike | None = None,
    resume: bool = False,
    allow_unstable: bool = False,
) -> Result:
    """Compute modes, responses and couplings over a grid of parameters.

    Parameters
    ----------
    design : Design
    vary : mapping
        Dotted paths and their grids: ``{"stage.test.wires.d": "1e-3:5e-3:9"}``.
    results : str or sequence of str
        Modes by label, responses ``"OUTPUT/INPUT:HZ"``, couplings ``"OVER/UNDER/INPUT:HZ"``.
        Default: every mode.
    result : str or sequence of str
        More of `results`, under the name of the option.
    model, workers, scheduler, chunk, folder, resume, allow_unstable
        As in `xcouple`.
    tolerance : float
        Relative error that ``"auto"`` may leave.

    Returns
    -------
    Result
        With the attributes of `analyses.sweep.file.SweepResult`: `axes`, `result`, `value`
        (axis 1, axis 2, ..., results).

    Raises
    ------
    InputError
        If a path leads nowhere or a result does not exist.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> design = sus.example("husman2000/table1-case3")
    >>> lengths = {"stage.test.wires.l": [0.4, 0.5]}
    >>> found = sus.sweep(design, vary=lengths, results=["test yaw"], model="string")
    >>> found.value.shape
    (2, 1)
    """
    names = _joined(results, result)
    return _run("sweep", locals() | {"vary": convert.grids(vary, "vary"), "results": names})


def sensitivity(
    design: Design,
    *,
    results: Names = (),
    result: Names = (),
    model: str = "auto",
    tolerance: float = 1e-3,
    allow_unstable: bool = False,
) -> Result:
    """Compute first derivatives with respect to every number of a design.

    Parameters
    ----------
    design : Design
    results, result : str or sequence of str
        As in `sweep`.
    model, tolerance, allow_unstable
        As in `response`.

    Returns
    -------
    Result
        With the attributes of `analyses.sensitivity.solve.Sensitivity`: `parameter`, `derivative`
        (parameters, results).

    Raises
    ------
    InputError
        If a result does not exist.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> found = sus.sensitivity(sus.example("double"), results=["test yaw"], model="string")
    >>> found.derivative.shape[1]
    1
    """
    return _run("sensitivity", locals() | {"results": _joined(results, result)})


def damp(
    design: Design,
    *,
    output: str | None = None,
    impulse: str | None = None,
    duration: float = 60.0,
    frequency: Grid = "0.1:100:2000",
    model: str = "auto",
    tolerance: float = 1e-3,
    allow_unstable: bool = False,
) -> Result:
    """Close the control loops of a design: poles, margins, sensor noise, impulse response.

    Parameters
    ----------
    design : Design
    output, impulse : str, optional
        The observed motion; the force that gives a unit impulse.
    duration : float
        Length of the impulse response, s.
    frequency : grid
        Hz, of loop gains and sensor noise.
    model, tolerance, allow_unstable
        As in `response`.

    Returns
    -------
    Result
        With the attributes of `analyses.damp.solve.LocalControl`: `closed` poles, `margin` of each
        loop, `sensitivity` of all at once, `noise` (f, loops), ...

    Raises
    ------
    InputError
        If the design has no loops.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> sus.damp(sus.example("triple-damped"), frequency=[1.0], duration=1.0, model="string").stable
    True
    """
    return _run("damp", locals())


def export(
    design: Design,
    *,
    format: str = "mat",
    inputs: Names = (),
    outputs: Names = (),
    loss: bool = False,
    model: str = "auto",
    tolerance: float = 1e-3,
    allow_unstable: bool = False,
) -> Result:
    """Build the state space of the model.

    Parameters
    ----------
    design : Design
    format : {"mat", "npz", "hdf5", "zpk", "control"}
        Format that `Result.save` writes.
    inputs, outputs : str or sequences of str
        Signals, as of `response`.
    loss : bool
        Include loss angles, as viscous damping of each mode.
    model, tolerance, allow_unstable
        As in `response`.

    Returns
    -------
    Result
        With the attributes of `analyses.export.solve.Exported`: `system` with the matrices `a`,
        `b`, `c`, `d`; `band` in Hz; `agreement` with the violin model.

    Raises
    ------
    InputError
        If a signal does not exist.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> sus.export(sus.example("double"), model="string").system.a.shape
    (24, 24)
    """
    return _run("export", locals())


def compare(
    *items: Design | Result | PathLike,
    inputs: Names = (),
    outputs: Names = (),
    noises: Names = (),
    frequency: Grid = "0.1:100:2000",
    model: str = "auto",
    tolerance: float = 1e-3,
) -> Result:
    """Compare designs, results and measurements: modes, responses, noises.

    Parameters
    ----------
    *items : Design, Result or path
        Two or more; files as of ``pendsus compare``. At least one has a design.
    inputs, outputs : str or sequences of str
        Compare responses between these signals.
    noises : str or sequence of str
        Compare the thermal noise of these motions.
    frequency : grid
        Hz, of responses and noises where no result gives its own.
    model, tolerance
        As in `modes`, for the designs; all have the same model.

    Returns
    -------
    Result
        With the attributes of `analyses.compare.solve.Comparison`: `name`, `change`, `modes`,
        `overlay`.

    Raises
    ------
    InputError
        If fewer than two things are given, or a file is at fault.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> design = sus.example("double")
    >>> lower = design.replace({"stage.test.wires.d": 0.0005})
    >>> found = sus.compare(design, lower, model="string")
    >>> [change.words for change in found.change[1]], found.modes.frequency.shape
    (['test wires d'], (12, 2))
    """
    return _run("compare", locals(), {"items": items})


def fit(
    measured: PathLike,
    design: Design | None = None,
    *,
    starts: int = 1,
    seed: int = 1,
    relative_uncertainty: float | None = None,
    explain: bool = True,
    model: str = "auto",
    tolerance: float = 1e-3,
) -> Result:
    """Infer numbers of designs from measured mode frequencies and transfer functions.

    Parameters
    ----------
    measured : path
        TOML file of modes or files of transfer functions, and of the free numbers (docs/fit.md).
    design : Design, optional
        The design that was measured; None where `measured` names designs itself.
    starts, seed : int
        Number of searches, and the seed of the random starts of all but the first.
    relative_uncertainty : float, optional
        Of transfer functions whose files give none.
    explain : bool
        Whether to rank single changes and the next measurements (transfer functions).
    model, tolerance
        As in `modes`, for the measured modes; checked with the fitted numbers.

    Returns
    -------
    Result
        With the attributes of `analyses.fit.solve.Fit`: `name`, `value`, `sigma`, `covariance`,
        `residual`, ...; for transfer functions `responses`.

    Raises
    ------
    InputError
        With the faults of `measured` or of the design.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> design = sus.example("husman2000/table1-case4")
    >>> found = sus.fit("measured/husman2000/table1-case4.toml", design)
    >>> for name, value, sigma in zip(found.parameters, found.value, found.sigma):
    ...     print(f"{name}: {value:.3g} +- {sigma:.2g}")
    materials.steel302.youngs_modulus: 1.66e+11 +- 2.8e+09
    stage.test.body.inertia.2: 0.118 +- 0.0039
    """
    file = convert.path(measured, "measured")
    designs = () if design is None else (_design(design),)
    return _run("fit", locals(), {"files": (*designs, file)})


def optimise(
    design: Design,
    goals: PathLike,
    *,
    starts: int = 6,
    seed: int = 1,
    model: str = "auto",
    tolerance: float = 1e-3,
) -> Result:
    """Choose numbers of a design so that it meets goals.

    Parameters
    ----------
    design : Design
    goals : path
        TOML file of goals, and of the free numbers with their bounds (docs/optimise.md).
    starts, seed : int
        Number of designs to search from, and the seed of all but the first.
    model, tolerance
        As in `modes`, for the search and for the check of the new design.

    Returns
    -------
    Result
        With the attributes of `analyses.optimise.optimum.Optimum`: `numbers`, `limits`, `met`, ...

    Raises
    ------
    InputError
        With the faults of `goals` or of the design.

    Examples
    --------
    >>> from pathlib import Path
    >>> import suspension_cli as sus
    >>> written = Path("goals.toml").write_text('''
    ... goal = [{ kind = "band", dof = ["yaw"], at_least = 2.0 }]
    ... free = [{ name = "stage.test.wires.t2", lower = 0.01, upper = 0.2 }]
    ... ''')
    >>> found = sus.optimise(sus.template("single"), "goals.toml", starts=1)
    >>> found.met, found.numbers.after.round(3)
    (True, array([0.136]))
    """
    files = {"design": _design(design), "goals": convert.path(goals, "goals")}
    return _run("optimise", locals(), files)


def tradeoff(design: Design, *, quantities: Names = ()) -> Result:
    """Measure time and error of each model for one design, and advise on a model.

    Parameters
    ----------
    design : Design
    quantities : str or sequence of str
        ``"modes"``, ``"response"``, ``"thermal"``, ``"coupling"``; default: all.

    Returns
    -------
    Result
        With the attributes of `analyses.tradeoff.result.Tradeoff`: `answers`, `entries`.

    Raises
    ------
    InputError
        If the equilibrium is unstable.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> found = sus.tradeoff(sus.template("single"), quantities="modes")
    >>> [entry.model for entry in found.answers[0].options]
    ['closed-form', 'force', 'string', 'beam', 'violin']
    """
    return _run("tradeoff", locals())


def check(design: Design) -> Check:
    """Check the plausibility of a design, and compute what its wires and blades carry.

    Warnings are those of ``pendsus check``; they are Python warnings too.

    Parameters
    ----------
    design : Design

    Raises
    ------
    InputError
        If the design does not balance, or an ``[analysis]`` table has faults.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> found = sus.check(sus.template("single"))
    >>> found.stable, len(found.warnings), round(found.statics.wires[0].tension, 2)
    (True, 0, 13.75)
    """
    with python_names("check"):
        found = solve_check(_design(design))
    found.warn(Log())
    return found


def info(
    design: Design,
    *,
    input: str = "support.x",
    output: str | None = None,
    frequency: Grid = "0.1:100:2000",
    tolerance: float = 1e-3,
) -> Info:
    """Report which model a design needs for its modes, one response and its thermal noise.

    Parameters
    ----------
    design : Design
    input, output : str
        Signals of the response. Default output: x of the mirror.
    frequency : grid
        Hz.
    tolerance : float
        Relative error that ``"auto"`` may leave.

    Raises
    ------
    InputError
        If the design does not balance, or a signal does not exist.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> found = sus.info(sus.example("geo-silica-triple"), tolerance=0.01)
    >>> [choice.level for choice in found.choices.values()]
    ['beam', 'violin', 'violin']
    """
    given = convert.setting(options.INFO, locals(), "info")
    with python_names("info", options.INFO):
        source = _design(design)
        setting = settings.of_design("info", options.INFO, (), source, given)
        return solve_info(source, setting, Log(options.INFO))


def draw(design: Design) -> Any:
    """Draw a design to scale, side on and face on, with its dimensions.

    Parameters
    ----------
    design : Design

    Returns
    -------
    matplotlib.figure.Figure

    Examples
    --------
    >>> import suspension_cli as sus
    >>> figure = sus.draw(sus.template("single"))
    """
    from suspension_cli.drawing import draw as drawing
    from suspension_cli.equilibrium.nominal import expand_nominal

    with python_names():
        tables = _design(design).design
        return drawing.draw(tables, expand_nominal(tables))


def animate(result: Result, mode: int | str, path: PathLike) -> Path:
    """Write one period of a mode as an animation (GIF) that repeats.

    Parameters
    ----------
    result : Result
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
    >>> found = sus.modes(sus.template("single"), model="string")
    >>> sus.animate(found, "test yaw", "yaw.gif")
    PosixPath('yaw.gif')
    """
    from suspension_cli.analyses.modes import animation
    from suspension_cli.equilibrium.nominal import expand
    from suspension_cli.files.atomic import write_bytes

    remedy = "give a result of sus.modes"
    if not isinstance(result, Result):
        raise InputError.of("result", "is no result", remedy, convert.shown(result))
    if result.analysis.name != "modes":
        raise InputError.of("result", "has no modes that move", remedy, result.analysis.name)
    path = convert.path(path, "path")
    with python_names("animate"):
        numbers = animation.parse(result.data, str(mode), "mode")
        if len(numbers) > 1:
            problem, remedy = "names several modes", "give one number, and a file for each"
            raise InputError.of("mode", problem, remedy, convert.shown(mode))
        number = numbers[0]
        scene = expand(result.design)
        moving = animation.animate(result.data, number, result.design, scene)
        write_bytes(Path(path), moving, key="path")
    return Path(path)


def report(
    design: Design,
    path: PathLike,
    *,
    sections: Names = (),
    inputs: Names = (),
    outputs: Names = (),
    builds: int = 1000,
    model: str = "auto",
    tolerance: float = 1e-3,
) -> Path:
    """Write one HTML file of a design with all its analyses, which opens without network.

    Parameters
    ----------
    design : Design
    path : path
        Of the file. Results files of the design in its folder are used where they save time.
    sections : str or sequence of str
        ``"drawing"``, ``"numbers"``, ``"check"``, ``"modes"``, ``"response"``, ``"coupling"``,
        ``"thermal"``, ``"budget"``, ``"tolerance"``, ``"damping"``; default: all.
    inputs, outputs : str or sequences of str
        Signals of the responses. Defaults: motions of the support and of the mirror.
    builds : int
        Imperfect builds of a design with tolerances.
    model, tolerance
        As in `modes`, for every analysis.

    Returns
    -------
    Path

    Raises
    ------
    InputError
        If a section or signal does not exist, the design does not balance, or the file cannot be
        written. Other errors are reported in the section concerned.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> sus.report(sus.example("double"), "double.html", sections="numbers")
    PosixPath('double.html')
    """
    from suspension_cli.analyses.report.composition import Request
    from suspension_cli.analyses.report.solve import compose
    from suspension_cli.files.atomic import write_bytes

    chosen = convert.items(sections, "sections")
    given = locals() | {"sections": ",".join(chosen) or None}
    given = convert.setting(options.REPORT, given, "report")
    path = Path(convert.path(path, "path"))
    with python_names("report", options.REPORT):
        setting = options.context("report", options.REPORT, given).params
        request = Request(**setting | {"sections": chosen, "folder": path.parent})
        write_bytes(path, compose(_design(design), request, Log()).encode(), key="path")
    return path


def _design(value: object) -> Source:
    """Return a design, read from its file where a path is given."""
    return read(value) if isinstance(value, PathLike) else convert.design(value)


def _joined(results: Names, result: Names) -> Names:
    """Join names given under both of their arguments."""
    return convert.items(results, "results") + convert.items(result, "result")


def _run(name: str, arguments: Settings, files: Settings | None = None) -> Result:
    """Run an analysis with the arguments of its function.

    `files` are the designs and other files that it reads; default: the argument `design`.
    """
    analysis = registry.get(name)
    folder = arguments.pop("folder", None)
    folder = folder if folder is None else convert.path(folder, "folder")
    given = convert.setting(analysis.parameters, arguments, name)
    if given.get("resume") and folder is None:
        remedy = "name the folder of the interrupted run"
        raise InputError.of("folder", "is missing, but resume is given", remedy)
    place = Path(tempfile.mkdtemp(prefix="pendsus-") if folder is None else folder)

    def ask(file: Source | PathLike, overrides: tuple[str, ...] = ()) -> Run:
        design = file if isinstance(file, Source) else read(file, overrides)
        extra = analysis.swept_names()
        setting = settings.of_design(name, analysis.parameters, extra, design, given)
        return Run(design, setting, Log(analysis.parameters), place, f"suspension_cli.{name}()")

    result = None
    try:
        with python_names(name, analysis.parameters):
            if files is None:
                run = ask(_design(arguments["design"]))
            else:
                run = analysis.read(ask, files)[0]
            with run.faults():
                result = analysis.solve(run)
        if folder is None and result.file is not None:
            return dataclasses.replace(result, holder=_TemporaryFolder(place))
        return result
    finally:
        if folder is None and (result is None or result.file is None):
            shutil.rmtree(place)


class _TemporaryFolder:
    """A folder that is deleted with the last result, or copy of it, that refers to its file."""

    def __init__(self, path: Path) -> None:
        weakref.finalize(self, shutil.rmtree, path, ignore_errors=True)

    def __deepcopy__(self, _memo: object) -> _TemporaryFolder:
        return self

    def __reduce__(self) -> tuple[type[None], tuple[()]]:
        return type(None), ()  # a pickle does not keep the folder
