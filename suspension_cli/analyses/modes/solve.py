"""Normal modes of a design: the model, the losses, and what can be damped.

>>> import suspension_cli as sus
>>> found = sus.modes(sus.example("husman2000/table1-case3"), fidelity="string")
>>> found.label[0], round(float(found.frequency[0]), 4)
('test transverse', 0.7914)

The modes themselves are those of `linear.eigenmodes`; `physics.wire_modes` adds those of wires, and
solves for damping and loss.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from suspension_cli.analyses.record import Record
from suspension_cli.design.faults import suggest
from suspension_cli.errors import Fault, InputError
from suspension_cli.files.declared import ADDED, ATTRIBUTE
from suspension_cli.files.documents import Layout
from suspension_cli.grids import parse_band
from suspension_cli.linear import eigenmodes
from suspension_cli.linear.eigenmodes import DAMPING_BAND, TOP
from suspension_cli.linear.solver import Solver
from suspension_cli.models import registry
from suspension_cli.models.choice import percent, shifts
from suspension_cli.physics import growth, model_choice, near_limits, wire_modes
from suspension_cli.physics.lossless import describe_lossless, find_lossless
from suspension_cli.physics.missing_losses import state_missing_losses
from suspension_cli.physics.near_limits import describe_falsified_losses

if TYPE_CHECKING:
    from suspension_cli.analyses.analysis import Analysis, Run, Settings
    from suspension_cli.design.schema import Design
    from suspension_cli.linear.system import LinearSystem
    from suspension_cli.models.registry import Choice
    from suspension_cli.scene.arrays import Array

HIGHEST = 1000.0
"""Hz, up to which the violin model lists modes."""


@dataclass(frozen=True, eq=False, repr=False)
class Modes(Record, eigenmodes.Modes):
    """Normal modes of a design in ascending order: unstable modes first, then rigid ones.

    Attributes
    ----------
    without_loss
        Parts that have no loss.
    """

    in_json: ClassVar = Layout(
        rows={"mode": "modes"},
        names={"top_fraction": "top_mass_fraction"},
        without=(
            "body coordinate omega_squared shape energy tip_energy block wire wire_energy order top"
            " degree_of_freedom tip shape_unit damping_band damping_at"
        ),
        sparse="dilution growth_rate decay_rate",
    )
    without_loss: tuple[str, ...] = field(default=(), metadata=ATTRIBUTE | ADDED)


def solve(analysis: Analysis, run: Run, most: int) -> Modes:
    """Compute the modes of a design: of wires with mass at most a number, unless --all is given."""
    choice, model, undamped, modes = _solve(run, most)
    model_choice.describe_equilibrium(run.source, choice, model, run.log)
    modes = replace(modes, **_damping(run.design, run.setting["damping"]))
    lossless = find_lossless(run.design, choice.level)
    near_limits.warn(run.design, undamped, run.log)
    if np.isfinite(modes.q).any():
        for line in describe_lossless(lossless, choice.level):
            run.log.warn(f"{run.name}: {line}")
        choice, lines = _state_losses(run, choice)
        for line in lines:
            run.log.warn(line)
    if not modes.stable:
        grows = growth.find_growth(run.design, choice.model, model)
        remedy = "" if grows is None else f"; {grows.cause.remedy}"
        for n in np.flatnonzero(modes.growth_rate):
            run.log.warn(f"{run.name} is unstable: {growth.describe(modes, int(n))}{remedy}")
    parts = tuple(part.part for part in lossless)
    return Modes.extending(modes, without_loss=parts, run=run.origin(analysis, choice))


def _damping(design: Design, text: str | None) -> Settings:
    """Parse --damping into `damping_band` and `damping_at` of `Modes`."""
    on_legs = any(stage.inverted_pendulum for stage in design.stage)
    if (text is None and on_legs) or text == "none":
        return {"damping_band": ()}
    found: Settings = {"damping_band": DAMPING_BAND, "damping_at": TOP}
    known = [TOP, *(stage.name for stage in design.stage)]
    for item in re.split(r",(?=[a-z]+=)", text or f"at={TOP}"):
        key, _, value = item.partition("=")
        if key == "band":
            ends = value.replace(",", ":")
            found["damping_band"] = parse_band(ends, "--damping", with_zero=True, before="band=")
        elif key != "at":
            remedy = "give for example band=0.5:5,at=top, or none"
            raise InputError([Fault("--damping", "is no band, stage, or none", remedy, item)])
        elif value not in known:
            raise InputError([Fault("--damping", "is no stage", suggest(value, known), value)])
        else:
            found["damping_at"] = value
    return found


def _solve(run: Run, most: int) -> tuple[Choice, LinearSystem, eigenmodes.Modes, eigenmodes.Modes]:
    """The choice of model, its system, the modes without damping, and with all losses.

    If modes of wires are listed too, both are the modes with all losses.
    """
    highest = run.setting["max_frequency"]
    level = run.setting["fidelity"]
    tolerance = run.setting["tolerance"]
    auto = level == registry.AUTO
    wanted = registry.VIOLIN.name if auto and highest is not None else level
    choice, model = model_choice.for_modes(run.source, wanted, tolerance)
    most = wire_modes.most_in_a_minute(model, most)
    if choice.model.has_wire_mass and not (auto and highest is None):
        top = highest or HIGHEST
        cause = "--max-frequency" if highest else "by default"
        choice = registry.Choice(choice.level, f"all modes up to {top:g} Hz", 0.0)
        _admit(run, most, wire_modes.count_modes(model, top), top, cause)
        with run.log.progress() as bar:
            listed = wire_modes.solve(model, top, damping=True, progress=bar)
        return choice, model, listed, listed

    def admit(number: int, top: float) -> None:
        _admit(run, most, number, top, "that of the highest mode")

    try:
        solver = Solver(model)
        with run.log.progress() as bar:
            listed = wire_modes.solve_bodies(solver, admit, bar)
    except TooManyModes as many:
        if not auto:
            raise
        why = f"{many.faults[0].problem}, so wire mass is neglected (--all includes it)"
        run.log.say(f"{run.name}: {why}")
        heavy = model
        choice, model = model_choice.for_modes(run.source, level, tolerance, massless=True)
        shift = percent(float(np.median(shifts(model, heavy)[1])))
        worst = f"{percent(choice.error)} in {choice.what}, {shift} in the median mode"
        why = f"wire mass, {worst}, as its modes would take minutes"
        choice = replace(choice, reason=f"as --all is not given; neglected: {why}")
        solver = Solver(model)
        listed = wire_modes.solve_bodies(solver)
    if highest is not None:
        listed = listed.up_to(highest)
        if not len(listed.q):
            raise wire_modes.no_mode_error(highest)
    return choice, model, solver.modes, listed


def _state_losses(run: Run, choice: Choice) -> tuple[Choice, list[str]]:
    """Add losses that materials lack to what is neglected; also list what makes Q wrong."""
    lines = describe_falsified_losses(run.design, choice.level)
    if not choice.model.bends_wires:
        return choice, lines

    def compute(design: Design) -> tuple[Array, str]:
        q = eigenmodes.solve(choice.model.system(design)).q
        return np.where(np.isfinite(q) & (q > 0), q, 1.0), "the Q of a mode"

    lacking = state_missing_losses(run.design, choice, compute, run.setting["tolerance"])
    # the stated error is that of frequencies
    return replace(lacking.choice, error=choice.error), lines + lacking.warnings


class TooManyModes(InputError):
    """Wires with mass have so many modes that all would take minutes."""


def _admit(run: Run, most: int, number: int, top: float, cause: str) -> None:
    """Refuse more than `most` modes without --all, with what may be implausible in the design."""
    if number <= most or run.setting["every"]:
        return
    problem = (
        f"wires with mass have {number:,} modes up to {top:.4g} Hz ({cause}); more than {most:,}"
        " take minutes"
    )
    remedy = (
        "check lengths and radii of wires (m), give a lower --max-frequency, or --all to compute"
        " all"
    )
    causes = [item.line("") for item in near_limits.find_serious(run.design)]
    if causes and not causes[0].startswith("control."):
        remedy = f"probable cause: {causes[0]}"
    raise TooManyModes([Fault("", problem, remedy)])
