"""The public API, for editors and type checkers; made by `make reference`."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from suspension_cli import api, errors
from suspension_cli.analyses.budget.solve import Budget as Budget
from suspension_cli.analyses.check.solve import Check as Check
from suspension_cli.analyses.compare.solve import Comparison as Comparison
from suspension_cli.analyses.damp.solve import Damped as Damped
from suspension_cli.analyses.export.solve import Export as Export
from suspension_cli.analyses.fit.result import Fit as Fit
from suspension_cli.analyses.modes.solve import Modes as Modes
from suspension_cli.analyses.optimise.optimum import Optimum as Optimum
from suspension_cli.analyses.record import Record as Record
from suspension_cli.analyses.report.solve import Report as Report
from suspension_cli.analyses.response.solve import Response as Response
from suspension_cli.analyses.sensitivity.solve import Sensitivity as Sensitivity
from suspension_cli.analyses.simulate.solve import Simulation as Simulation
from suspension_cli.analyses.sweep.solve import Sweep as Sweep
from suspension_cli.analyses.thermal.solve import Thermal as Thermal
from suspension_cli.analyses.tolerance.summary import Tolerance as Tolerance
from suspension_cli.analyses.tradeoff.measure import Tradeoff as Tradeoff
from suspension_cli.analyses.xcouple.solve import Coupling as Coupling
from suspension_cli.analyses.xcouple.solve import CouplingMatrix as CouplingMatrix
from suspension_cli.api import Design as Design, Grid, Names, PathLike, Paths

__version__: str
InputError = errors.InputError
PendsusError = errors.PendsusError
PendsusWarning = errors.PendsusWarning
animate = api.animate

def budget(
    design: Design | PathLike,
    *,
    outputs: Names = (),
    ground: Names = ('nhnm',),
    isolation: Paths = (),
    requirements: Paths = (),
    by: str = 'part',
    frequency: Grid = '0.01:100:2000',
    arm: float = 0.0,
    mirrors: float = 1.0,
    tolerance: float = 0.001,
    fidelity: str = 'auto',
) -> Budget:
    """Compute the motion of the mirror by cause, with cumulative RMS.

    Parameters
    ----------
    design : Design
        The design, or the path of its file.
    outputs : str or sequence of str
        Output: test.x, test.pitch, test.x@0,0,0.001, .... Default: x, pitch and yaw of the mirror.
    ground : str or sequence of str
        Motion of the support: nlnm (quiet ground), nhnm (noisy ground), vc-e (quiet laboratory) to
        vc-a (noisy one), kamioka-quiet, kamioka-noisy, aligo-isi (or aligo-bsc) and aligo-ham
        (platforms), a file, or none; x,y=SOURCE for some coordinates.
    isolation : path or sequence of paths
        CSV of a platform's transmissibility, a factor on the ground.
    requirements : path or sequence of paths
        CSV of the required spectrum of an output, by default the first; with arm also in
        strain/sqrt(Hz).
    by : {"part", "stage"}
        Lines of the table and the picture: each sensor and actuator, with equal OSEMs together, or
        all sensors, and all actuators, of a stage.
    frequency : grid
        Frequencies, Hz: start:stop:count[:log|lin], a comma list or a number.
    arm : float
        Observe x along the beam of an arm of this length (m), for example 4000.
    mirrors : float
        Add the powers of this many equal, independent suspensions: 4 for the difference of two
        arms. A mirror whose motion counts twice counts as 4.
    tolerance : float
        Largest relative error of the result that fidelity="auto" accepts.
    fidelity : {"auto", "closed-form", "force", "string", "beam", "violin"}
        Model of bodies and wires; auto takes the cheapest that is accurate enough.

    Returns
    -------
    Budget
        With `frequency` (f,) in Hz, `amplitude` (f, outputs) in m/sqrt(Hz) or rad/sqrt(Hz),
        `contribution` (f, outputs, causes), `rms` and `rms_velocity` (f, outputs) above each
        frequency; `motions` has an item per output, with `parts` by cause and `requirement`.

    Raises
    ------
    InputError
        If the closed loop is unstable, or a table has faults.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> found = sus.budget(sus.example("double"), frequency=[1.0, 10.0], ground=["nlnm"])
    >>> found.cause
    ('ground.x', 'ground.y', 'ground.z', 'thermal')
    """

def check(
    design: Design | PathLike,
) -> Check:
    """Check a design, and list what its wires and blades carry.

    Parameters
    ----------
    design : Design
        The design, or the path of its file.

    Returns
    -------
    Check
        With `stable`, `statics`, `verdicts`, and `warnings`, which are Python warnings too.

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

def compare(
    *items: Design | Record | PathLike,
    variants: Names = (),
    results: Names = (),
    inputs: Names = (),
    outputs: Names = (),
    noises: Names = (),
    frequency: Grid = '0.1:100:2000',
    tolerance: float = 0.001,
    fidelity: str = 'auto',
) -> Comparison:
    """Compare designs, results and measurements: modes, quantities, responses, noises.

    Parameters
    ----------
    *items : Design | Record | PathLike
        Two or more with the variants; files as of ``pendsus compare``. At least one has a design.
    variants : str or sequence of str
        Add the first design with other values, under a name.
    results : str or sequence of str
        Compare this quantity (docs/quantities.md): test pitch, Q of test pitch, stress test wires,
        thermal test.x:10, .... Default: those of the designs' requirements.
    inputs : str or sequence of str
        Compare responses to this input, e.g. support.x.
    outputs : str or sequence of str
        Compare responses of this output, e.g. test.x.
    noises : str or sequence of str
        Compare the thermal noise of this motion, e.g. test.x.
    frequency : grid
        Frequencies of responses and noises of designs, Hz.
    tolerance : float
        Largest relative error of the result that fidelity="auto" accepts.
    fidelity : {"auto", "closed-form", "force", "string", "beam", "violin"}
        Model of bodies and wires; auto takes the cheapest that is accurate enough.

    Returns
    -------
    Comparison
        With `name`, `kind` and `models` of each item, `change`, `modes`, `quantities`, `overlay`.

    Raises
    ------
    InputError
        If fewer than two things are given, or a file is at fault.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> design = sus.example("double")
    >>> lower = design.replace({"stage.test.wires.d": 0.0005})
    >>> found = sus.compare(design, lower, fidelity="string")
    >>> [change.words for change in found.change[1]], found.modes.frequency.shape
    (['test wires d'], (12, 2))
    """

def damp(
    design: Design | PathLike,
    *,
    output: str | None = None,
    impulse: str | None = None,
    duration: float = 60.0,
    frequency: Grid = '0.1:100:2000',
    loops: Names = (),
    method: str | None = None,
    redesigned: Names = (),
    order: int = 3,
    settling: float | None = None,
    sensitivity: float | None = None,
    quiet_at: float = 10.0,
    highest: float = 10.0,
    reached: float = 0.0001,
    allow_unstable: bool = False,
    tolerance: float = 0.001,
    fidelity: str = 'auto',
) -> Damped:
    """Close the loops of the design's [control] table.

    Parameters
    ----------
    design : Design
        The design, or the path of its file.
    output : str, optional
        Motion whose impulse response and sensor noise are computed. Default: x of the mirror.
    impulse : str, optional
        Force or torque that gives an impulse of 1 N s or 1 N m s. Default: that along output.
    duration : float
        Length of the impulse response, s.
    frequency : grid
        Frequencies of loop gains and noise, Hz.
    loops : str or sequence of str
        Draw the gain of this loop. Default: the three most critical.
    method : {"lqg", "h2", "hinf", "blend"}, optional
        Find the filters of loops first, which damp all modes within settling, with the largest
        margins to the design's [[requirement]] tables, or without any the least noise of the
        sensor: lqg least squares with a prescribed decay, h2 without it, hinf H-infinity; or blend
        the filters of blends of two sensors, from their noise. Writes the design with them to
        DIR/NAME-lqg.toml, ...
    redesigned : str or sequence of str
        Loop, or blend, whose filter is found. Default: all, in their order.
    order : int
        Poles of the fitted ratio of two noises, for method blend, whose filters have up to twice
        as many.
    settling : float, optional
        Longest time, s, in which the amplitude of a mode falls to 1/e, for method. Default: as
        required, else 10.
    sensitivity : float, optional
        Largest magnitude of the sensitivity, for method. Default: as required, else 2.
    quiet_at : float
        Frequency in Hz at which the sensor's noise is to be least, at output or in the mirror's
        motion along the force, for method.
    highest : float
        Frequency in Hz up to which modes are damped, for method.
    reached : float
        Response of a mode to the loop's force, over that of the strongest mode, from which the
        loop has to damp it, for method: 0.01 leaves modes of coupled motions to their own loops.
    allow_unstable : bool
        Continue with motion that grows (an unstable equilibrium, active elements).
    tolerance : float
        Largest relative error of the result that fidelity="auto" accepts.
    fidelity : {"auto", "closed-form", "force", "string", "beam", "violin"}
        Model of bodies and wires; auto takes the cheapest that is accurate enough.

    Returns
    -------
    Damped
        With `closed` poles, `margin` of each loop, `sensitivity` of all at once, `noise`
        (f, sensors), ...

    Raises
    ------
    InputError
        If the design has no loops.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> design = sus.example("triple-damped")
    >>> sus.damp(design, frequency=[1.0], duration=1.0, fidelity="string").stable
    True
    """

def draw(
    design: Design | PathLike,
) -> Any:
    """Draw a design to scale, from the side and from the front, with its dimensions.

    Parameters
    ----------
    design : Design
        The design, or the path of its file.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    InputError
        If the design does not balance.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> figure = sus.draw(sus.template("single"))
    """
example = api.example
examples = api.examples

def export(
    design: Design | PathLike,
    *,
    format: str = 'mat',
    inputs: Names = (),
    outputs: Names = (),
    closed_loop: bool = False,
    loss: bool = False,
    band: str | None = None,
    accuracy: float = 0.01,
    order: int | None = None,
    rate: float = 16384.0,
    interferometer: str = 'aLIGO',
    allow_unstable: bool = False,
    fidelity: str = 'auto',
    tolerance: float = 0.001,
) -> Export:
    """Export the state space of the model as DIR/NAME-statespace.*, or a noise budget of gwinc.

    Parameters
    ----------
    design : Design
        The design, or the path of its file.
    format : {"mat", "npz", "hdf5", "zpk", "control", "finesse", "foton", "front-end", "gwinc"}
        mat: MATLAB; npz: numpy; hdf5: HDF5; zpk: zeros, poles, gain; control: python-control;
        finesse: a Python module with an element of finesse 3; foton: a filter file of a front end;
        front-end: filters and matrices of the loops for a front end; gwinc: a folder with a noise
        budget of gwinc.
    inputs : str or sequence of str
        An input. Default: the support's six motions and six forces on the first stage; for finesse
        x, pitch and yaw of the support and of all stages of the main chain.
    outputs : str or sequence of str
        An output. Default: the six motions of the first stage and of the mirror; for finesse x,
        pitch and yaw of all stages of the main chain; for gwinc x of the mirror.
    closed_loop : bool
        Close the loops of the design's [control] table. Inputs are also sensor.NAME, noise of a
        sensor, and actuator.NAME, a force added to that of a loop or coil; outputs also
        sensor.NAME, its reading, and drive.NAME, the force demanded. All are exported by default.
    loss : bool
        Include losses and the mass of wires, with the right Q and the right isolation.
    band : str, optional
        Band in which losses are right, and filters of foton, Hz; for gwinc that of the table.
        Default: 0.1:100; for gwinc 5:3000.
    accuracy : float
        Largest relative error of responses off resonance with losses, and of filters of foton; of
        Q twice that; for gwinc of interpolation.
    order : int, optional
        Most states with losses: the most accurate system of up to so many. Default: as many as
        accuracy needs.
    rate : float
        Sample rate of foton and of front-end, Hz.
    interferometer : str
        For gwinc: the one whose budget gets the suspension, aLIGO, Aplus, Voyager, CE1, ... or the
        path of a budget.
    allow_unstable : bool
        Continue with motion that grows (an unstable equilibrium, active elements).
    fidelity : {"auto", "closed-form", "force", "string", "beam", "violin"}
        Model of bodies and wires; auto takes the cheapest that is accurate enough.
    tolerance : float
        Largest relative error of the result that fidelity="auto" accepts.

    Returns
    -------
    Export
        With `system` (matrices `a`, `b`, `c`, `d`), `band` in Hz, and `agreement` with the violin
        model; for gwinc `analyses.export.gwinc_tables.GwincTables`, with `table` and the
        `accuracy` of interpolation.

    Raises
    ------
    InputError
        If a signal does not exist.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> sus.export(sus.example("double"), fidelity="string").system.a.shape
    (24, 24)
    """
finesse = api.finesse

def fit(
    measured: PathLike,
    design: Design | PathLike | None = None,
    *,
    starts: int = 1,
    seed: int = 1,
    relative_uncertainty: float | None = None,
    explain: bool = True,
    matrices: bool = False,
    tolerance: float = 0.001,
    fidelity: str = 'auto',
) -> Fit:
    """Fit numbers of designs to measured modes, quantities and transfer functions.

    Parameters
    ----------
    measured : path
        TOML file of modes, quantities or files of transfer functions, and the free numbers.
    design : Design, optional
        The design; None where `measured` names designs itself.
    starts : int
        Number of searches, of which the best is kept. All but the first start from random numbers.
    seed : int
        Seed of the random numbers.
    relative_uncertainty : float, optional
        Relative uncertainty of transfer functions whose files give none.
    explain : bool
        With transfer functions, also rank single changes of the design, and measurements to make
        next.
    matrices : bool
        Instead of parameters, find the sensing and driving matrices of the OSEMs of a stage, from
        transfer functions of all its sensors to all its coils.
    tolerance : float
        Largest relative error of the result that fidelity="auto" accepts.
    fidelity : {"auto", "closed-form", "force", "string", "beam", "violin"}
        Model of bodies and wires; auto takes the cheapest that is accurate enough.

    Returns
    -------
    Fit
        With `name`, `value`, `sigma`, `covariance`, `residual`, ...; for transfer functions
        `responses`, with `--matrices` `matrices`. `design` is the fitted design (of several
        experiments the first of `designs`), `run.design` the one as given.

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
gwinc = api.gwinc
import_gwinc = api.import_gwinc
import_sumcon = api.import_sumcon
load = api.load

def modes(
    design: Design | PathLike,
    *,
    max_frequency: float | None = None,
    every: bool = False,
    damping: str | Mapping[str, Grid] | None = None,
    tolerance: float = 0.001,
    fidelity: str = 'auto',
) -> Modes:
    """Compute the normal modes: frequencies, shapes, Q.

    Parameters
    ----------
    design : Design
        The design, or the path of its file.
    max_frequency : float, optional
        Highest frequency of the modes listed; auto and violin include violin modes.
    every : bool
        Compute all modes of wires with mass, even if there are more than 1000 (fewer of tall
        towers), which takes minutes.
    damping : str or mapping, optional
        Frequencies (Hz) and stage at which modes can be damped, or none. Default:
        band=0.5:5,at=top; of towers on legs none.
    tolerance : float
        Largest relative error of the result that fidelity="auto" accepts.
    fidelity : {"auto", "closed-form", "force", "string", "beam", "violin"}
        Model of bodies and wires; auto takes the cheapest that is accurate enough.

    Returns
    -------
    Modes
        With `frequency` (m,) in Hz, `q` (m,), `label`, `shape`, ...

    Raises
    ------
    InputError
        If the design does not balance, or the model is not valid for it.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> found = sus.modes(sus.example("husman2000/table1-case3"), fidelity="string")
    >>> found.label[0], round(float(found.frequency[0]), 4)
    ('test transverse', 0.7914)
    """

def optimise(
    design: Design | PathLike,
    goals: PathLike,
    *,
    starts: int = 6,
    seed: int = 1,
    tolerance: float = 0.001,
    fidelity: str = 'auto',
) -> Optimum:
    """Choose numbers of a design so that it meets goals.

    Parameters
    ----------
    design : Design
        The design, or the path of its file.
    goals : path
        TOML file of goals, and of the free numbers with bounds.
    starts : int
        Number of designs from which searches start; the first is the design itself. If it misses
        goals of loops, velocity damping is one more.
    seed : int
        Seed of the random starts.
    tolerance : float
        Largest relative error of the result that fidelity="auto" accepts.
    fidelity : {"auto", "closed-form", "force", "string", "beam", "violin"}
        Model of bodies and wires; auto takes the cheapest that is accurate enough.

    Returns
    -------
    Optimum
        With `design`, the one that was found (`run.design` is that from which the search started),
        `met`, and the tables `numbers`, `limits`, `quantities`, `modes` and `starts`.

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
parse = api.parse
python_control = api.python_control
read = api.read

def report(
    design: Design | PathLike,
    path: PathLike,
    *,
    sections: Names | None = None,
    inputs: Names = (),
    outputs: Names = (),
    builds: int = 1000,
    arm: float = 0.0,
    mirrors: float = 1.0,
    fidelity: str = 'auto',
    tolerance: float = 0.001,
) -> Report:
    """Write one HTML file of a design with all its analyses, which opens without network.

    Parameters
    ----------
    design : Design
        The design, or the path of its file.
    path : path
        Of the file. Results files of the design in its folder are used where they save time.
    sections : str or sequence of str, optional
        Sections to include: drawing, numbers, check, modes, response, coupling, thermal, budget,
        tolerance, damping. Default: all that the design has.
    inputs : str or sequence of str
        Input of the responses. Default: the support's x, y, z and yaw.
    outputs : str or sequence of str
        Output of the responses. Default: motions of the mirror.
    builds : int
        Number of random builds, unless a results file has the tolerances of this design.
    arm : float
        Observe x along the beam of an arm of this length (m), for example 4000.
    mirrors : float
        Add the powers of this many equal, independent suspensions: 4 for the difference of two
        arms. A mirror whose motion counts twice counts as 4.
    fidelity : {"auto", "closed-form", "force", "string", "beam", "violin"}
        Model of bodies and wires; auto takes the cheapest that is accurate enough.
    tolerance : float
        Largest relative error of the result that fidelity="auto" accepts.

    Returns
    -------
    Report
        Record with the `path` of the page, its sections, commands and verdicts on requirements.

    Raises
    ------
    InputError
        If a section or signal does not exist, the design does not balance, or the file cannot be
        written. Other errors are reported in the section concerned.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> made = sus.report(sus.example("double"), "double.html", sections="numbers")
    >>> made.path, [one.title for one in made.sections]
    (PosixPath('double.html'), ['Main numbers'])
    """

def response(
    design: Design | PathLike,
    *,
    inputs: Names = (),
    outputs: Names = (),
    frequency: Grid = '0.1:100:2000',
    measured: Paths = (),
    closed_loop: bool = False,
    allow_unstable: bool = False,
    tolerance: float = 0.001,
    fidelity: str = 'auto',
) -> Response:
    """Compute frequency responses of motions to motions of the support and to forces.

    Parameters
    ----------
    design : Design
        The design, or the path of its file.
    inputs : str or sequence of str
        Input: support.x, upper.force_x, upper.torque_pitch, .... Default: support.x.
    outputs : str or sequence of str
        Output: test.x, test.pitch, test.x@0,0,0.001, .... Default: x of the mirror.
    frequency : grid
        Frequencies, Hz: start:stop:count[:log|lin], a comma list or a number.
    measured : path or sequence of paths
        Measured transfer functions to compare with: TOML (docs/measurements.md), or CSV, HDF5 or
        DTT XML with inputs and outputs.
    closed_loop : bool
        Close the loops of the design's [control] table.
    allow_unstable : bool
        Continue with motion that grows (an unstable equilibrium, active elements).
    tolerance : float
        Largest relative error of the result that fidelity="auto" accepts.
    fidelity : {"auto", "closed-form", "force", "string", "beam", "violin"}
        Model of bodies and wires; auto takes the cheapest that is accurate enough.

    Returns
    -------
    Response
        With `frequency` (f,) in Hz and `value` (f, outputs, inputs), complex, in SI units. With
        `measured`, the attribute `measured` is a tuple of `analyses.response.solve.Comparison`.

    Raises
    ------
    InputError
        If a signal does not exist, the equilibrium or closed loop is unstable, or there are no
        loops to close.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> found = sus.response(sus.example("double"), frequency=[1.0, 10.0], fidelity="string")
    >>> found.value.shape
    (2, 1, 1)
    """

def sensitivity(
    design: Design | PathLike,
    *,
    results: Names = (),
    vary: Names = (),
    allow_unstable: bool = False,
    tolerance: float = 0.001,
    fidelity: str = 'auto',
) -> Sensitivity:
    """Compute the effect of the numbers of a design on its modes, or on any quantity.

    Parameters
    ----------
    design : Design
        The design, or the path of its file.
    results : str or sequence of str
        A quantity: a mode by its label or number, 'Q of test pitch', 'thermal test.x:10', a
        response OUTPUT/INPUT:HZ, .... Default: modes, which stands for every mode.
    vary : str or sequence of str
        A number of the design by its dotted path, or all numbers below a path: stage.test.wires.l,
        stage.test.wires. Default: every number.
    allow_unstable : bool
        Continue with motion that grows (an unstable equilibrium, active elements).
    tolerance : float
        Largest relative error of the result that fidelity="auto" accepts.
    fidelity : {"auto", "closed-form", "force", "string", "beam", "violin"}
        Model of bodies and wires; auto takes the cheapest that is accurate enough.

    Returns
    -------
    Sensitivity
        With `parameter`, `result`, `derivative` and `derivative_error` (parameters, results).

    Raises
    ------
    InputError
        If a result does not exist.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> found = sus.sensitivity(sus.example("double"), results=["test yaw"], fidelity="string")
    >>> found.derivative.shape[1]
    1
    """

def simulate(
    design: Design | PathLike,
    *,
    outputs: Names = (),
    rate: float = 2048.0,
    duration: float = 10.0,
    ground: Names = (),
    step: Names = (),
    impulse: Names = (),
    noise: bool = True,
    seed: int = 0,
    allow_unstable: bool = False,
    tolerance: float = 0.001,
    fidelity: str = 'auto',
    folder: PathLike | None = None,
) -> Simulation:
    """Run the loops of a design in time.

    Parameters
    ----------
    design : Design
        The design, or the path of its file.
    outputs : str or sequence of str
        Output: test.x, test.pitch, test.x@0,0,0.001, .... Default: x of the mirror.
    rate : float
        Sample rate of the loops, Hz.
    duration : float
        Length of the run, s.
    ground : str or sequence of str
        Motion of the support, as in budget: nlnm, aligo-isi, a file, .... Default: none.
    step : str or sequence of str
        Constant force in N or torque in N m from 0 s on: upper.force_x=1e-3.
    impulse : str or sequence of str
        Impulse in N s or N m s at 0 s: upper.torque_yaw=1e-4.
    noise : bool
        Whether sensors and actuators have noise.
    seed : int
        Start of the random numbers; the same gives the same run.
    allow_unstable : bool
        Continue with motion that grows (an unstable equilibrium, active elements).
    tolerance : float
        Largest relative error of the result that fidelity="auto" accepts.
    fidelity : {"auto", "closed-form", "force", "string", "beam", "violin"}
        Model of bodies and wires; auto takes the cheapest that is accurate enough.
    folder : path, optional
        Folder of the results file; default: a temporary one, kept as long as the result.

    Returns
    -------
    Simulation
        With `time` (t,) in s, `value` (t, outputs), `force` (t, actuators), `limit`, `at_limit`,
        `frequency` (f,) in Hz, `density` (f, outputs). Arrays above 16 MB are read from the results
        file where they are used.

    Raises
    ------
    InputError
        If a loop is unstable, a filter does not fit the rate, or the disk has no space.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> design = sus.example("triple-damped")
    >>> how = {"rate": 512.0, "duration": 1.0, "fidelity": "string"}
    >>> sus.simulate(design, outputs=["upper.yaw"], step=["upper.torque_yaw=1e-6"], **how).unit
    ('rad',)
    """

def sweep(
    design: Design | PathLike,
    *,
    vary: Mapping[str, Grid],
    results: Names = (),
    require: Names = (),
    every_point: bool = False,
    workers: int = 1,
    scheduler: str | None = None,
    chunk: int = 600,
    resume: bool = False,
    tolerance: float = 0.001,
    allow_unstable: bool = False,
    fidelity: str = 'auto',
    folder: PathLike | None = None,
) -> Sweep:
    """Compute modes, or any quantities, over a grid of a design's parameters.

    Parameters
    ----------
    design : Design
        The design, or the path of its file.
    vary : mapping
        A parameter and its values: stage.test.wires.s=1e-3:0.05:50:log.
    results : str or sequence of str
        A quantity: a mode by its label or number, 'Q of test pitch', 'thermal test.x:10', a
        response OUTPUT/INPUT:HZ or any other. Default: modes, which stands for every mode.
    require : str or sequence of str
        A requirement beside those of the design: 'test pitch in 0.5:0.7', 'thermal test.x:10 <
        1e-19', SI units and Hz, margins in dB and degrees.
    every_point : bool
        Solve every point; else maps of analytic results are interpolated, and checked.
    workers : int
        Number of processes.
    scheduler : str, optional
        Address of a Dask scheduler that computes instead (pendsus[cluster]).
    chunk : int
        Number of builds or points computed at once.
    resume : bool
        Continue an interrupted run.
    tolerance : float
        Largest relative error of the result that fidelity="auto" accepts.
    allow_unstable : bool
        Continue with motion that grows (an unstable equilibrium, active elements).
    fidelity : {"auto", "closed-form", "force", "string", "beam", "violin"}
        Model of bodies and wires; auto takes the cheapest that is accurate enough.
    folder : path, optional
        Folder of the results file; default: a temporary one, kept as long as the result.

    Returns
    -------
    Sweep
        With `axes`, `result`, `value` (axis 1, axis 2, ..., results); `met`, whether each point
        meets each requirement.

    Raises
    ------
    InputError
        If a path leads nowhere or a result does not exist.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> design = sus.example("husman2000/table1-case3")
    >>> lengths = {"stage.test.wires.l": [0.4, 0.5]}
    >>> found = sus.sweep(design, vary=lengths, results=["test yaw"], fidelity="string")
    >>> found.value.shape
    (2, 1)
    """
template = api.template

def thermal(
    design: Design | PathLike,
    *,
    outputs: Names = (),
    frequency: Grid = '0.1:1000:2000',
    arm: float = 0.0,
    mirrors: float = 1.0,
    allow_unstable: bool = False,
    tolerance: float = 0.001,
    fidelity: str = 'auto',
) -> Thermal:
    """Compute thermal noise of motions, split by cause.

    Parameters
    ----------
    design : Design
        The design, or the path of its file.
    outputs : str or sequence of str
        Output: test.x, test.pitch, test.x@0,0,0.001, .... Default: x of the mirror.
    frequency : grid
        Frequencies, Hz: start:stop:count[:log|lin], a comma list or a number.
    arm : float
        Observe x along the beam of an arm of this length (m), for example 4000.
    mirrors : float
        Add the powers of this many equal, independent suspensions: 4 for the difference of two
        arms. A mirror whose motion counts twice counts as 4.
    allow_unstable : bool
        Continue with motion that grows (an unstable equilibrium, active elements).
    tolerance : float
        Largest relative error of the result that fidelity="auto" accepts.
    fidelity : {"auto", "closed-form", "force", "string", "beam", "violin"}
        Model of bodies and wires; auto takes the cheapest that is accurate enough.

    Returns
    -------
    Thermal
        With `frequency` (f,) in Hz, `amplitude` (f, outputs) in m/sqrt(Hz) or rad/sqrt(Hz) and
        `contribution` (f, outputs, sources); `motions` has an item per output, with `parts` by
        source.

    Raises
    ------
    InputError
        If an output moves nothing that dissipates.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> found = sus.thermal(sus.example("geo-silica-triple"), frequency=[10.0, 100.0])
    >>> found.amplitude.shape
    (2, 1)
    """

def tolerance(
    design: Design | PathLike,
    *,
    builds: int | None = None,
    precision: float | None = None,
    seed: int = 1,
    limit: float = 0.001,
    require: Names = (),
    results: Names = (),
    input: str = 'support.z',
    observe: str | None = None,
    over: str | None = None,
    under: str | None = None,
    frequency: Grid = '50',
    workers: int = 1,
    scheduler: str | None = None,
    chunk: int = 600,
    resume: bool = False,
    tolerance: float = 0.001,
    allow_unstable: bool = False,
    fidelity: str = 'auto',
    folder: PathLike | None = None,
) -> Tolerance:
    """Compute the scatter of quantities over random builds, yields, and the causes of scatter.

    Parameters
    ----------
    design : Design
        The design, or the path of its file.
    builds : int, optional
        Number of random builds (default 10000); with precision the largest one (default 1000000).
    precision : float, optional
        Add builds until standard errors are below this fraction of the spread, and those of yields
        below this number: of the coupling, of quantities with requirements and of each results.
        For example 0.01.
    seed : int
        Seed of the random numbers; the same seed gives the same builds.
    limit : float
        Limit on the cross-coupling, whose yield is printed.
    require : str or sequence of str
        A requirement beside those of the design: 'test pitch in 0.5:0.7', 'coupling < 1e-3', 'Q of
        test pitch < 50'; any quantity, in its unit.
    results : str or sequence of str
        A quantity whose statistics are computed too, such as 'thermal test.x:10'.
    input : str
        The input: a motion of the support, or a force.
    observe : str, optional
        Observed point; the coupling is its motion along x over that along z. Default: mirror, 1 mm
        below its COM.
    over : str, optional
        Numerator of the ratio, instead of the point's x.
    under : str, optional
        Denominator of the ratio, instead of the point's z.
    frequency : grid
        Frequencies at which the coupling is computed, Hz.
    workers : int
        Number of processes.
    scheduler : str, optional
        Address of a Dask scheduler that computes instead (pendsus[cluster]).
    chunk : int
        Number of builds or points computed at once.
    resume : bool
        Continue an interrupted run.
    tolerance : float
        Largest relative error of the result that fidelity="auto" accepts.
    allow_unstable : bool
        Continue with motion that grows (an unstable equilibrium, active elements).
    fidelity : {"auto", "closed-form", "force", "string", "beam", "violin"}
        Model of bodies and wires; auto takes the cheapest that is accurate enough.
    folder : path, optional
        Folder of the results file; default: a temporary one, kept as long as the result.

    Returns
    -------
    Tolerance
        With `mean`, `spread`, `quantiles` of mode frequencies in Hz; `modes`, `coupling`, `static`,
        `others` and `required`, whose items have a `name`, `mean`, `deviation`, `quantiles`,
        `share`, ...; `yields`, `joint`.

    Raises
    ------
    InputError
        If the design has no ``[tolerance]`` table, or no quantity of a name.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> found = sus.tolerance(sus.example("triple-tolerance"), builds=20, fidelity="string")
    >>> found.good
    20
    """

def tradeoff(
    design: Design | PathLike,
    *,
    quantities: Names = (),
) -> Tradeoff:
    """Measure time and error of each model for one design, and advise on a model.

    Parameters
    ----------
    design : Design
        The design, or the path of its file.
    quantities : {"modes", "response", "thermal", "coupling"}
        Compare only for this quantity. Default: all.

    Returns
    -------
    Tradeoff
        With `answers`, `entries`, `choices`, `first_violin`.

    Raises
    ------
    InputError
        If the equilibrium is unstable.

    Notes
    -----
    Provisional: the questions that it asks, and so its results, may change.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> found = sus.tradeoff(sus.template("single"), quantities="modes")
    >>> [entry.model for entry in found.answers[0].options]
    ['closed-form', 'force', 'string', 'beam', 'violin']
    """

def xcouple(
    design: Design | PathLike,
    *,
    sweep: str | Mapping[str, Grid] = 'k,offset',
    wire: str | None = None,
    body: str | None = None,
    hold: str = 'loaded-length',
    input: str = 'support.z',
    observe: str | None = None,
    over: str | None = None,
    under: str | None = None,
    frequency: Grid = '50',
    matrix: bool = False,
    every_point: bool = False,
    workers: int = 1,
    scheduler: str | None = None,
    chunk: int = 600,
    resume: bool = False,
    tolerance: float = 0.001,
    allow_unstable: bool = False,
    fidelity: str = 'auto',
    folder: PathLike | None = None,
) -> Coupling | CouplingMatrix:
    """Compute the cross-coupling of imperfect builds: the ratio of two motions.

    Parameters
    ----------
    design : Design
        The design, or the path of its file.
    sweep : str or mapping
        Imperfections (k, offset, lower_offset, length, mass, com, ...) or dotted paths.
    wire : str, optional
        The imperfect wire. Default: the first of the mirror.
    body : str, optional
        The imperfect body. Default: the wire's.
    hold : {"loaded-length", "natural-length"}
        Length that stays the same when the wire changes.
    input : str
        The input: a motion of the support, or a force.
    observe : str, optional
        Observed point; the coupling is its motion along x over that along z. Default: mirror, 1 mm
        below its COM.
    over : str, optional
        Numerator of the ratio, instead of the point's x.
    under : str, optional
        Denominator of the ratio, instead of the point's z.
    frequency : grid
        Frequencies at which the coupling is computed, Hz.
    matrix : bool
        The six-by-six table of couplings of this one design instead of a sweep.
    every_point : bool
        Solve every point; else maps of analytic results are interpolated, and checked.
    workers : int
        Number of processes.
    scheduler : str, optional
        Address of a Dask scheduler that computes instead (pendsus[cluster]).
    chunk : int
        Number of builds or points computed at once.
    resume : bool
        Continue an interrupted run.
    tolerance : float
        Largest relative error of the result that fidelity="auto" accepts.
    allow_unstable : bool
        Continue with motion that grows (an unstable equilibrium, active elements).
    fidelity : {"auto", "closed-form", "force", "string", "beam", "violin"}
        Model of bodies and wires; auto takes the cheapest that is accurate enough.
    folder : path, optional
        Folder of the results file; default: a temporary one, kept as long as the result.

    Returns
    -------
    Coupling or CouplingMatrix
        With `axes`, `ratio` (axis 1, axis 2, ..., f), complex; with `matrix` a matrix `value`
        (f, outputs, inputs).

    Raises
    ------
    InputError
        If a wire, body or imperfection does not exist.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> stage = sus.example("husman2000/figure6")
    >>> found = sus.xcouple(stage, sweep={"k": [0.9, 1.1]}, fidelity="string")
    >>> found.ratio.shape
    (2, 1)
    """
