"""Local control of a suspension: poles, margins, impulse response, sensor noise."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.damp import closed_loop_poles, control, margins
from suspension_cli.analyses.damp.closed_loop_poles import build_closed_loop
from suspension_cli.analyses.damp.control import OsemMatrices, Plant
from suspension_cli.analyses.damp.margins import Margins, SensitivityPeak
from suspension_cli.design.schema import Design
from suspension_cli.errors import InputError
from suspension_cli.files.declared import along, derived, in_unit
from suspension_cli.linear import poles, signals
from suspension_cli.linear.poles import Poles
from suspension_cli.linear.statespace import with_constant_loss
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import registry

if TYPE_CHECKING:
    from jaxtyping import Complex, Float

    from suspension_cli.analyses.analysis import Log
    from suspension_cli.models.base import Model

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
        return "; ".join(describe_growth(self.closed))


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
    control.demand_loops(design)
    plant = control.build_plant(design, model)
    closed, opened = (closed_loop_poles.find(one) for one in (plant, plant.with_loops([])))
    known = signals.bodies_with_signals(model)
    observed = signals.parse_output(output, known)
    driven = signals.parse_input(drive, known, "--impulse")
    margin, peak = find_margins(plant, closed) if closed.stable else (None, None)
    constant = replace(plant, model=with_constant_loss(model))
    time = np.linspace(0.0, duration, samples)
    impulse, undamped = (
        poles.impulse(build_closed_loop(fixed, [driven], [observed]), time)[:, 0, 0]
        for fixed in (constant, constant.with_loops([]))
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
        sensor=tuple(one.name for one in plant.parts),
        noise=control.solve_responses(plant, frequency, [], [observed]).noise[:, 0],
        gain=control.compute_loop_gains(plant, frequency),
        sensitivity=peak,
        osems=control.compute_matrices(plant.osems) or None,
    )


def find_margins(plant: Plant, closed: Poles) -> tuple[tuple[Margins, ...], SensitivityPeak]:
    """Find the margins of each loop and of all at once, from stable closed-loop poles."""
    corners = _find_corner_frequencies(plant, closed)
    gain = partial(control.compute_loop_gains, plant)
    peak = margins.find_peak(partial(control.compute_sensitivity, plant), corners)
    return tuple(margins.compute_margins(gain, corners)), peak


def _find_corner_frequencies(plant: Plant, closed: Poles) -> Float[np.ndarray, " frequency"]:
    """Find frequencies (Hz) of closed-loop poles and of roots of filters, and beside them.

    A resonance narrow in a loop gain L with the others closed is as near to a closed-loop pole,
    where 1 + L is 0, as it is wide.
    """
    filters = [loop.controller_and_sensor.continuous for loop in plant.loops]
    found = [root for one in filters for root in (*one.zeros, *one.poles)]
    every: Complex[np.ndarray, " root"] = np.append(closed.value / (2 * np.pi), found)
    every = every[np.abs(every) > 0]
    centre, width = np.abs(np.imag(every)), np.abs(np.real(every))
    beside = [np.abs(centre + side * width) for side in (-3.0, -1.0, 0.0, 1.0, 3.0)]
    return np.unique(np.concatenate([np.abs(every), *beside]))


def find_steady_poles(
    design: Design,
    model: LinearSystem,
    kind: Model,
    motion: str,
    log: Log | None = None,
    allow_unstable: bool | None = None,
) -> Poles:
    """Find the poles, closed-loop if there are loops, on wires without mass.

    Raises `InputError` if one grows, as there is no steady `motion` then ("response", ...); with
    `allow_unstable` warns of it. This is None if the command has no such option.
    """
    massless = registry.BEAM.system(design) if kind.has_wire_mass else model
    found = closed_loop_poles.find(control.build_plant(design, massless))
    if not found.stable:
        where, remedy = describe_growth(found)
        if not allow_unstable:
            problem = f"the closed loop is unstable, so it has no steady {motion}: {where}"
            way = " (pendsus damp)" if allow_unstable is None else ", or give --allow-unstable"
            raise InputError.of("control", problem, remedy + way)
        assert log is not None
        log.warn(f"the closed loop is unstable: {where}; {remedy}")
    return found


def describe_growth(closed: Poles) -> tuple[str, str]:
    """Describe the pole that grows fastest, and a remedy."""
    worst = int(closed.growth_rate.argmax())
    others = int((closed.growth_rate > 0).sum()) - 1
    more = f" (and {others} more)" if others else ""
    where = (
        f"a pole at {closed.frequency[worst]:.5g} Hz in {closed.state[worst]} grows at"
        f" {closed.growth_rate[worst]:.4g} 1/s"
    )
    remedy = "check the sign of the loops that drive it, or lower their gain or phase lag there"
    return where + more, remedy
