"""Local control of a suspension: poles, margins, impulse response, sensor noise.

>>> import suspension_cli as sus
>>> found = sus.damp(sus.example("triple-damped"), frequency=[1.0], duration=1.0, fidelity="string")
>>> found.loop, found.stable
(('x', 'y', 'z', 'roll', 'pitch', 'yaw'), True)

Poles are roots of the pencil of the design with the forces of loops as unknowns. Start values are
the poles of the state space, with constant matrices for losses and fractions for delays.
`linear.roots` finds the roots near them, with losses at the frequency of each pole and exact
delays. Where it loses one, and where tables give a stiffness against frequency, the starts are
poles with the stiffness at their own frequency (`linear.oscillations`). Of the infinitely many
poles of a closed loop with delay, those near poles of the state space are found.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from suspension_cli.analyses.damp import designed_blends, designed_loops
from suspension_cli.analyses.damp.designed_blends import DesignedBlend
from suspension_cli.analyses.damp.designed_loops import DesignedLoop
from suspension_cli.analyses.damp.required_margins import RequiredResult
from suspension_cli.analyses.record import Record
from suspension_cli.conventions import DOFS, SUPPORT
from suspension_cli.design.derive import mirror
from suspension_cli.design.schema import Design
from suspension_cli.drawing.added_points import add_from_model
from suspension_cli.errors import InputError
from suspension_cli.files.declared import along, derived, in_unit
from suspension_cli.files.documents import Layout
from suspension_cli.grids import parse_frequencies
from suspension_cli.linear import signals, statespace
from suspension_cli.linear.statespace import Poles, with_constant_loss
from suspension_cli.linear.system import LinearSystem
from suspension_cli.physics import closed_loop, closed_loop_margins, local_control, model_choice
from suspension_cli.physics.local_control import OsemMatrices
from suspension_cli.physics.margins import Margins, SensitivityPeak

if TYPE_CHECKING:
    from jaxtyping import Complex, Float

    from suspension_cli.analyses.analysis import Analysis, Run
    from suspension_cli.scene.arrays import Array

BLEND = "blend"
"""Value of --design that finds filters of sensors, not of loops."""
SAMPLES = 4001
"""Number of times of impulse responses."""


@dataclass(frozen=True)
class LocalControl:
    """Poles, margins, impulse response and sensor noise of one design with local control.

    Attributes
    ----------
    loop
        Names of the loops (l).
    open, closed
        Poles with all loops open and closed, rad/s.
    margin
        Of each loop, the others closed; None if the closed loop is unstable.
    output, drive
        Observed motion, and signal that gets the impulse.
    time
        s.
    impulse, undamped
        Responses of the output to a unit impulse with loops closed and open, SI.
    frequency
        Hz.
    sensor, noise
        Loops and OSEMs, and the noise of the sensor of each at the output, m/sqrt(Hz) or
        rad/sqrt(Hz).
    gain
        Loop gains, the other loops closed.
    sensitivity
        Margin of all loops at once; None if the closed loop is unstable.
    osems
        Matrices of the stages with OSEMs; None without OSEMs.
    """

    in_json: ClassVar = Layout(
        rows={"loop": "margins"},
        names={"closed": "poles", "drive": "impulse"},
        without="open time impulse undamped sensor noise gain",
        sparse="osems designed required blends",
    )
    loop: tuple[str, ...]
    open: Poles
    closed: Poles
    margin: tuple[Margins, ...] | None = field(metadata=along("loop"))
    output: str
    drive: str
    time: Float[np.ndarray, " time"] = field(metadata=in_unit("s"))
    impulse: Float[np.ndarray, " time"] = field(metadata=in_unit("{unit}/({drive_unit} s)"))
    undamped: Float[np.ndarray, " time"] = field(metadata=in_unit("{unit}/({drive_unit} s)"))
    frequency: Float[np.ndarray, " frequency"] = field(metadata=in_unit("Hz"))
    sensor: tuple[str, ...]
    noise: Float[np.ndarray, "frequency sensor"] = field(metadata=in_unit("{unit}/Hz^0.5"))
    gain: Complex[np.ndarray, "frequency loop"]
    sensitivity: SensitivityPeak | None = None
    osems: tuple[OsemMatrices, ...] | None = None

    @property
    @derived()
    def unit(self) -> str:
        """Unit of the output."""
        return signals.unit_of(self.output)

    @property
    @derived()
    def drive_unit(self) -> str:
        """Unit of the signal that gets the impulse."""
        return signals.unit_of(self.drive)

    @property
    @derived()
    def stable(self) -> bool:
        """Whether no closed-loop pole grows."""
        return self.closed.stable

    @property
    def growth(self) -> str:
        """The pole that grows fastest, with a remedy."""
        return "; ".join(closed_loop.describe_growth(self.closed))


@dataclass(frozen=True, eq=False, repr=False)
class Damped(Record, LocalControl):
    """Local control of a design, with the curves of its picture.

    Attributes
    ----------
    fine_frequency, fine
        Loop gains at more frequencies, which resolve resonances, for the picture.
    designed
        What filters that were found do; None if none was asked for.
    required
        How the design with them meets its requirements on loops; None without any.
    blends
        What complementary filters that were found do; None if none were asked for.
    """

    fine_frequency: Float[np.ndarray, " fine_frequency"] | None = field(
        default=None, metadata=in_unit("Hz")
    )
    fine: Complex[np.ndarray, "fine_frequency loop"] | None = None
    designed: tuple[DesignedLoop, ...] | None = field(default=None, metadata=along("redesigned"))
    required: tuple[RequiredResult, ...] | None = field(default=None, metadata=along("requirement"))
    blends: tuple[DesignedBlend, ...] | None = field(default=None, metadata=along("blended"))

    @property
    def curve(self) -> tuple[Float[np.ndarray, " frequency"], Complex[np.ndarray, "frequency l"]]:
        """Frequencies (Hz) and loop gains of the picture."""
        if self.fine_frequency is None or self.fine is None:
            return self.frequency, self.gain
        return self.fine_frequency, self.fine


def close_loops(analysis: Analysis, run: Run) -> Damped:
    """Close all loops of a design, and add what its picture needs."""
    setting = run.setting
    designed = None
    required = None
    blends = None
    if setting["method"] == BLEND:
        run, blends = designed_blends.solve(run)
    elif setting["method"]:
        run, designed, required = designed_loops.solve(run)
    choice, model = model_choice.for_modes(
        run.source, setting["fidelity"], setting["tolerance"], massless=True
    )
    model = model_choice.stable_system(
        run.source, choice, setting["allow_unstable"], run.log, model, bends=True
    )
    output = setting["output"] or f"{mirror(run.design)}.x"
    drive = setting["impulse"] or _push_along(output, model)
    frequency = np.array(parse_frequencies(setting["frequency"]))
    found = solve(run.design, model, output, drive, frequency, setting["duration"])
    if not found.stable and designed:
        problem = f"the loops that were found are unstable in the {choice.level} model"
        remedy = "find them one by one (--redesign), or allow a longer --settling"
        raise InputError.of("--design", f"{problem}: {found.growth}", remedy, setting["method"])
    if not found.stable:
        run.log.warn(f"the closed loop is unstable: {found.growth}")
    plant = local_control.build_plant(run.design, model)

    def gains(at: Array) -> Complex[np.ndarray, "frequency 1 loop"]:
        return local_control.compute_loop_gains(plant, at)[:, None]

    no_modes = np.empty(0)
    curve = add_from_model(lambda: (gains, no_modes), frequency, found.gain[:, None])
    origin = run.origin(analysis, choice)
    curves = {"fine_frequency": curve[0], "fine": curve[1][:, 0]}
    made = {"designed": designed, "required": required, "blends": blends}
    return Damped.extending(found, **curves, **made, run=origin)


def _push_along(output: str, model: LinearSystem) -> str:
    """Name the force or torque along a motion; motion of the support if there is none."""
    body, dof = output.partition("@")[0].rpartition(".")[::2]
    if dof in DOFS and body in model.body:
        return f"{body}.{signals.FORCES[DOFS.index(dof)]}"
    return f"{SUPPORT}.x"


def solve(
    design: Design,
    model: LinearSystem,
    output: str,
    drive: str,
    frequency: Float[np.ndarray, " frequency"],
    duration: float,
    samples: int = SAMPLES,
) -> LocalControl:
    """Compute the closed-loop behaviour of a design with local control.

    `drive` gets the impulse, whose response lasts `duration` in s. Impulse responses approximate
    losses by constant matrices (`with_constant_loss`); all else has the losses of the model, which
    must be one without wire mass.
    """
    local_control.demand_loops(design)
    plant = local_control.build_plant(design, model)
    closed, opened = (closed_loop.find_poles(one) for one in (plant, plant.without_loops()))
    known = signals.bodies_with_signals(model)
    observed = signals.parse_output(output, known)
    driven = signals.parse_input(drive, known, "--impulse")
    margin, peak = (
        closed_loop_margins.find_margins(plant, closed) if closed.stable else (None, None)
    )
    constant = plant.with_model(with_constant_loss(model))
    time = np.linspace(0.0, duration, samples)
    impulse, undamped = (
        statespace.impulse(closed_loop.build_closed_loop(fixed, [driven], [observed]), time)[
            :, 0, 0
        ]
        for fixed in (constant, constant.without_loops())
    )
    return LocalControl(
        loop=tuple(loop.name for loop in plant.loops),
        open=opened,
        closed=closed,
        margin=margin,
        output=output,
        drive=drive,
        time=time,
        impulse=impulse,
        undamped=undamped,
        frequency=frequency,
        sensor=tuple(one.name for one in plant.sensors),
        noise=local_control.solve_sensor_noise(plant, frequency, observed),
        gain=local_control.compute_loop_gains(plant, frequency),
        sensitivity=peak,
        osems=local_control.compute_matrices(plant.osems) or None,
    )
