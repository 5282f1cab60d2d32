"""From the options of `pendsus export` to a state space, with loops open or closed."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from suspension_cli.analyses.export import closed_poles, file, foton_modules, lossy
from suspension_cli.analyses.export import solve as export
from suspension_cli.analyses.export.solve import Ends, Export, Opened
from suspension_cli.design.derive import gravity_strength, main_chain
from suspension_cli.grids import parse_band
from suspension_cli.linear import signals
from suspension_cli.linear.statespace import with_constant_loss
from suspension_cli.models import registry
from suspension_cli.models.choice import Frequencies
from suspension_cli.physics import (
    closed_loop,
    local_control,
    loop_network,
    loop_realisation,
    loop_signals,
    model_choice,
)
from suspension_cli.physics.loop_signals import ClosedLoops

if TYPE_CHECKING:
    from suspension_cli.analyses.analysis import Analysis, Run
    from suspension_cli.design.schema import Design
    from suspension_cli.linear.statespace import Poles
    from suspension_cli.linear.system import LinearSystem
    from suspension_cli.models.registry import Choice


def solve(analysis: Analysis, run: Run) -> Export:
    """Build the state space of a design and measure its errors."""
    setting = run.setting
    loss = setting["loss"]
    if setting["closed_loop"]:
        local_control.demand_loops(run.design)
    fidelity = setting["fidelity"]
    tolerance = setting["tolerance"]
    if loss:
        request = lambda _: Frequencies()  # noqa: E731
        choice, model = model_choice.choose(run.source, fidelity, request, tolerance=tolerance)
    else:
        choice, model = model_choice.for_modes(run.source, fidelity, tolerance, massless=True)
    # loops may hold what falls over; the poles of the closed loop tell
    allowed = setting["allow_unstable"] or setting["closed_loop"]
    model = model_choice.stable_system(run.source, choice, allowed, run.log, model, bends=True)
    ends = _parse_ends(run, model)
    poles = None
    if isinstance(ends, ClosedLoops):
        poles = _find_poles(run, choice, model, ends)
    zpk = setting["format"] == "zpk"
    band = parse_band(setting["band"] or "0.1:100", "--band")
    accuracy = setting["accuracy"]
    if loss:
        order = setting["order"]
        made = lossy.build_lossy(model, ends, band, accuracy, order=order, zpk=zpk, poles=poles)
    else:
        constant = with_constant_loss(model)
        lossless = replace(constant.lossless, terms=constant.terms)
        made = export.build(lossless, ends, zpk=zpk)
        if poles is not None:
            remedy = "give --loss: without losses undamped modes may grow"
            closed_poles.demand_same_stability(made.system, poles, remedy)
            made = replace(made, poles=closed_poles.compare(made.system, poles))
        if model.is_lossy or model.terms:
            run.log.warn("exported without damping: accurate off resonance; --loss gives Q too")
    made = replace(made, mirror=main_chain(run.design)[-1])
    if setting["format"] == "foton":
        filters = foton_modules.make_foton(made, setting["rate"], band, accuracy)
        made = replace(made, filters=filters)
    made = export.compare_with_complete(made, run.design, ends)
    return Export.extending(
        made,
        format=setting["format"],
        closed_loop=setting["closed_loop"],
        run=run.origin(analysis, choice),
    )


def _parse_ends(run: Run, model: LinearSystem) -> Ends:
    """Parse inputs and outputs; with the loops closed, those of loops are among the usual ones."""
    setting = run.setting
    chain = main_chain(run.design)
    finesse = setting["format"] == "finesse"
    usual = file.finesse_signals if finesse else signals.local_control_signals
    drives, motions = usual(chain)
    if setting["closed_loop"] and not finesse:
        of_loops = loop_signals.list_names(run.design, model)
        drives, motions = [*drives, *of_loops[0]], [*motions, *of_loops[1]]
    inputs = [*dict.fromkeys(setting["inputs"] or drives)]
    outputs = [*dict.fromkeys(setting["outputs"] or motions)]
    if finesse:
        file.check_names(inputs, outputs, chain[-1])
    if setting["closed_loop"]:
        return loop_signals.parse(run.design, model, inputs, outputs)
    known = signals.bodies_with_signals(model)
    return Opened(
        [signals.parse_input(text, known) for text in inputs],
        [signals.parse_output(text, known) for text in outputs],
    )


def _find_poles(run: Run, choice: Choice, model: LinearSystem, ends: ClosedLoops) -> Poles:
    """Find the poles of the complete closed loop that the state space has; none may grow.

    Raises `InputError` if one does, unless that is allowed.
    """
    kind = choice.model
    allowed = run.setting["allow_unstable"]
    found = closed_loop.find_steady_poles(run.design, model, kind, "response", run.log, allowed)
    light = registry.BEAM.system(run.design) if kind.has_wire_mass else model
    found = ends.select(light, found)
    if not kind.has_wire_mass:
        return found
    return closed_loop.follow_poles(local_control.build_plant(run.design, model), found)


def describe_filters(design: Design) -> Iterator[str]:
    """Describe how delays and digital filters of closed loops are approximated, a line each."""
    control = design.control
    if control is None:
        return
    nodes = loop_network.build(control, gravity_strength(design))[0].nodes
    if delay := max(node.delay for node in nodes):
        highest = loop_realisation.PADE_RANGE / (2 * math.pi * delay)
        yield (
            f"delays up to {delay:g} s: Pade's approximation of order {loop_realisation.PADE},"
            f" right to {loop_realisation.PADE_ERROR:g} up to {highest:.4g} Hz"
        )
    rates = [part.rate for node in nodes for part in node.filter.parts if part.rate]
    if rates:
        yield (
            f"digital filters at {min(rates):g} Hz are continuous ones here: what they have at f is"
            " at f (1 + (pi f/rate)^2/3)"
        )
