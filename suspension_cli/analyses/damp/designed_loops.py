"""Loops of a design whose filters are found, one after the other.

>>> import suspension_cli as sus
>>> wanted = {"method": "lqg", "redesigned": ["yaw"], "settling": 20.0, "fidelity": "string"}
>>> found = sus.damp(sus.example("triple-damped"), **wanted, frequency=[1.0], duration=1.0)
>>> found.designed[0].settling < 20
True
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING

from suspension_cli.analyses.damp.filter_keys import as_keys
from suspension_cli.analyses.damp.required_margins import LoopRequirements, list_results
from suspension_cli.conventions import DOFS
from suspension_cli.design import foton, reader
from suspension_cli.design.derive import mirror
from suspension_cli.errors import InputError
from suspension_cli.files.declared import in_unit
from suspension_cli.linear import signals
from suspension_cli.physics import closed_loop, local_control, model_choice, optimal_loops

if TYPE_CHECKING:
    from collections.abc import Sequence

    from suspension_cli.analyses.analysis import Run
    from suspension_cli.analyses.damp.required_margins import RequiredResult
    from suspension_cli.design.foton import Filter
    from suspension_cli.design.reader import Source
    from suspension_cli.design.schema import Design
    from suspension_cli.linear.system import LinearSystem

SETTLING = 10.0
"""Longest settling time, s, unless the design requires one."""
SENSITIVITY = 2.0
"""Largest magnitude of the sensitivity, unless the design requires a distance from -1."""
RATE = 16384.0
"""Sample rate of front ends at which loops that are found are closed again, Hz."""
KEYS = ("damper", "gain", "zeros", "poles", "filter", "gain_at")
"""Keys of a loop that give its filter."""


@dataclass(frozen=True)
class DesignedLoop:
    """What a filter that was found does, with the loops that were found before it closed.

    Attributes
    ----------
    redesigned
        Name of the loop.
    settling
        Longest time in which the amplitude of a mode falls to 1/e, s.
    sensitivity
        Largest magnitude of the loop's sensitivity.
    output, noise
        A motion, and how much of it noise of the sensor makes at `quiet_at` (Hz), SI.
    roll_off
        Frequency of its roll-off, Hz.
    poles
        Number of its poles.
    left_out
        Frequencies of modes that its actuator hardly reaches, Hz, as a text.
    """

    redesigned: str
    settling: float = field(metadata=in_unit("s"))
    sensitivity: float
    output: str
    noise: float = field(metadata=in_unit("SI"))
    quiet_at: float = field(metadata=in_unit("Hz"))
    roll_off: float = field(metadata=in_unit("Hz"))
    poles: int
    left_out: str


def solve(run: Run) -> tuple[Run, tuple[DesignedLoop, ...], tuple[RequiredResult, ...] | None]:
    """Find filters of some loops, one after the other.

    Returns the run of the design with them, what they do, and how the design meets requirements.
    """
    setting = run.setting
    local_control.demand_loops(run.design)
    choice, model = model_choice.for_modes(
        run.source, setting["fidelity"], setting["tolerance"], massless=True
    )
    growing = setting["allow_unstable"]
    model = model_choice.stable_system(run.source, choice, growing, run.log, model, bends=True)
    control = run.design.control
    assert control is not None
    names = [loop.name for loop in control.loop]
    required = LoopRequirements.of(run.source, choice.level, run.log)
    source = run.source
    done = []
    for name in setting["redesigned"] or names:
        number = names.index(name)
        output = setting["output"] or _motion_along(source.design, number)
        margins = partial(required.margins, source.design, number)
        wanted = optimal_loops.Wanted(
            settling=setting["settling"] or required.settling or SETTLING,
            sensitivity=setting["sensitivity"] or required.sensitivity(number) or SENSITIVITY,
            output=output,
            quiet_at=setting["quiet_at"],
            highest=setting["highest"],
            reached=setting["reached"],
            margins=margins if required.requirements else None,
        )
        found = optimal_loops.solve(source.design, model, number, wanted, setting["method"])
        source = with_filter(source, number, found.filter)
        done.append(
            DesignedLoop(
                redesigned=name,
                settling=found.settling,
                sensitivity=found.sensitivity,
                output=output,
                noise=found.noise,
                quiet_at=wanted.quiet_at,
                roll_off=found.roll_off,
                poles=len(found.filter.poles),
                left_out=", ".join(f"{one:.4g}" for one in found.left_out),
            )
        )
    _demand_stability_when_sampled(source, model, setting["redesigned"] or names)
    results = list_results(required.judge(source.design))
    return replace(run, source=source), tuple(done), results


def _demand_stability_when_sampled(
    source: Source, model: LinearSystem, names: Sequence[str]
) -> None:
    """Close the loops with the filters that were found as Foton samples them at `RATE`.

    Raises `InputError` if a pole grows then, or is lost.
    """
    assert source.design.control is not None
    loops = tomllib.loads(source.text)["control"]["loop"]
    for number, loop in enumerate(source.design.control.loop):
        if loop.name in names:
            sampled = {"design": foton.format_filter(loop.controller), "rate": RATE}
            kept = {key: value for key, value in loops[number].items() if key not in KEYS}
            loops[number] = kept | {"filter": sampled}
    design = reader.replaced(source, {"control.loop": loops}).design
    if closed_loop.find_poles(local_control.build_plant(design, model)).stable:
        return
    problem = f"is unstable with the filters that were found sampled at {RATE:g} Hz"
    raise InputError.of("control", problem, "allow a longer --settling or a smaller --sensitivity")


def _motion_along(design: Design, number: int) -> str:
    """The motion of the mirror along the force of a loop."""
    assert design.control is not None
    force = design.control.loop[number].actuator.partition("@")[0].rpartition(".")[2]
    return f"{mirror(design)}.{DOFS[signals.FORCES.index(force)]}"


def with_filter(source: Source, number: int, made: Filter) -> Source:
    """Replace the filter of a loop of a design.

    The keys of the filter before go first, with their comments, which are not true of the new one;
    until then the loop has the filter 1.
    """
    loops = tomllib.loads(source.text)["control"]["loop"]
    loops[number] = {key: value for key, value in loops[number].items() if key not in KEYS}
    loops[number] |= {"filter": "gain(1)"}
    bare = reader.replaced(source, {"control.loop": loops})
    del loops[number]["filter"]
    loops[number] |= {"gain": made.gain} | as_keys(made)
    return reader.replaced(bare, {"control.loop": loops})
