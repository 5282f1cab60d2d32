"""Questions about a design, which each model answers with its own time and error."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.analyses import registry as analyses
from suspension_cli.analyses import settings
from suspension_cli.analyses.growth import find_growth
from suspension_cli.analyses.modes import wire_modes
from suspension_cli.analyses.sweep.solve import ParameterSweep
from suspension_cli.analyses.thermal import solve as thermal
from suspension_cli.analyses.tradeoff.result import Entry, Tradeoff
from suspension_cli.analyses.xcouple.command import axes
from suspension_cli.analyses.xcouple.solve import ROUNDING, Sweep, parse_request
from suspension_cli.design.derive import mirror
from suspension_cli.design.reader import Source
from suspension_cli.errors import Fault, InputError
from suspension_cli.linear import response, signals
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.mode_pairing import pair_bodies
from suspension_cli.linear.named_results import Mode
from suspension_cli.models import registry
from suspension_cli.models.choice import away_from_modes, relative_change, spectrum_change
from suspension_cli.studies.job import Axis

if TYPE_CHECKING:
    from suspension_cli.design.schema import Design
    from suspension_cli.linear.system import LinearSystem
    from suspension_cli.models.base import Model

    Spectrum = tuple[LinearSystem, np.ndarray]
    """A linear system, and its response or noise on the grid of a question."""

FREQUENCIES = 200
"""Number of frequencies of a response or noise."""
DESIGNS = 100
"""Number of designs of a sweep."""
SPREAD = 0.01
"""Relative range of the mirror's mass in a sweep, to either side."""
REPEAT = 7
"""Samples per time, fewer where they take longer than `BUDGET`."""
BUDGET = 1.0
"""Processor time after which a function is not sampled again, s."""
RESOLUTION = time.get_clock_info("process_time").resolution
"""Least time, s, as others are divided by it."""


@dataclass(frozen=True)
class Question:
    """What is asked about a design.

    Attributes
    ----------
    quantity, text
        One of `command.QUANTITIES`, and words.
    solve
        Result in one model. Raises `InputError` if that has none.
    compare
        Largest relative error of a result against the true one, and where it is.
    prepare
        Makes the function whose time counts, if that is not `solve`; raises like that.
    count
        Number of designs or builds that are computed together; times are for one.
    """

    quantity: str
    text: str
    solve: Callable[[Model], Any]
    compare: Callable[[Any, Any], tuple[float, str]]
    prepare: Callable[[Model], Callable[[], object]] | None = None
    count: int = 1


def ask(source: Source) -> tuple[Question, ...]:
    """List all questions about a design."""

    def modes(model: Model) -> Modes:
        return wire_modes.solve_bodies(model.system(source.design))

    def compare(found: Modes, true: Modes) -> tuple[float, str]:
        partner = pair_bodies(true, found, registry.STRING.system(source.design))
        here = np.flatnonzero((partner >= 0) & (true.frequency > 0))
        if not len(here):
            return 0.0, ""
        error = np.abs(found.frequency[partner[here]] / true.frequency[here] - 1)
        worst = int(np.argmax(error))
        return float(error[worst]), true.label[here[worst]]

    text = f"mode frequencies in a sweep, each of {DESIGNS} designs"
    sweep = partial(_prepare_sweep, source)
    return (
        Question("modes", "mode frequencies", modes, compare),
        Question("modes", text, modes, compare, sweep, DESIGNS),
        _spectrum(source, "response", "response", 0.1, 10.0),
        _spectrum(source, "response", "response", 50.0, 1000.0),
        _spectrum(source, "thermal", "thermal noise", 10.0, 100.0),
        _coupling(source),
    )


def _prepare_sweep(source: Source, model: Model) -> Callable[[], object]:
    """Prepare a sweep of the mirror's mass, as `pendsus sweep` computes it."""
    if model.has_wire_mass:
        raise InputError.of("", "a sweep follows the modes of wires without mass", "")
    name = mirror(source.design)
    body = next(stage.body for stage in source.design.stage if stage.name == name)
    key = "density" if body.mass is None else "mass"
    values = getattr(body, key) * np.linspace(1 - SPREAD, 1 + SPREAD, DESIGNS)
    axis = Axis(f"stage.{name}.body.{key}", tuple(values.tolist()))
    job = ParameterSweep(source.text, (axis,), model.name, (Mode("every", 0),))
    job.check()
    return partial(job.compute, 0, DESIGNS)


def _spectrum(source: Source, quantity: str, words: str, low: float, high: float) -> Question:
    """Response of the mirror to the support along x, or its thermal noise, over frequencies."""
    design, frequency = source.design, np.geomspace(low, high, FREQUENCIES)

    def solve_response(model: Model) -> Spectrum:
        system = model.system(design)
        known = signals.bodies_with_signals(system)
        into = signals.parse_input("support.x", known)
        out = signals.parse_output(f"{mirror(design)}.x", known)
        return system, response.solve(system, frequency, [into], [out]).value[:, 0, 0]

    def solve_noise(model: Model) -> Spectrum:
        if not model.bends_wires:
            raise InputError.of("", "it does not know where along a wire its loss acts", "")
        system = model.system(design)
        motion = thermal.parse_motion(system, f"{mirror(design)}.x")
        warmth = design.constants.temperature
        found = thermal.solve(system, frequency, [motion], warmth)[0].amplitude
        if not found.any():
            raise InputError.of("", "nothing dissipates", "")
        return system, found

    def compare(found: Spectrum, true: Spectrum) -> tuple[float, str]:
        """Compare at sampled frequencies away from the modes of bodies."""
        at = np.searchsorted(frequency, away_from_modes(frequency, found[0], true[0]))
        change = spectrum_change(found[1][at], true[1][at])
        worst = int(np.argmax(change))
        return float(change[worst]), f"at {frequency[at[worst]]:.4g} Hz"

    text = f"{words} from {low:g} to {high:g} Hz, {FREQUENCIES} frequencies"
    solve = solve_response if quantity == "response" else solve_noise
    return Question(quantity, text, solve, compare)


def _coupling(source: Source) -> Question:
    """Cross-coupling of imperfect builds: wire, signals and frequency of `pendsus xcouple`."""
    analysis = analyses.get("xcouple")
    setting = settings.merge(analysis, source, {})
    asked = parse_request(registry.STRING.system(source.design), setting, mirror(source.design))
    asked = replace(asked, frequency=asked.frequency[:1])
    job = Sweep(source.text, axes("k,offset", {}), asked)

    def solve(model: Model) -> np.ndarray:
        if not model.supports_builds:
            raise InputError.of("", "it has no imperfect builds", "")
        if job.question.wire < 0:
            raise InputError.of("", "the mirror hangs on no wire", "")
        found = replace(job, level=model.name).compute(0, job.count)["ratio"]
        if not np.isfinite(found).any():
            raise InputError.of("", "no imperfect build has a stable equilibrium on taut wires", "")
        if not np.nanmax(np.abs(found)) > ROUNDING:
            raise InputError.of("", "these imperfections couple nothing", "")
        return found

    def compare(found: np.ndarray, true: np.ndarray) -> tuple[float, str]:
        """Compute the largest error over the largest coupling; infinite if no build has both."""
        change = relative_change(found, true)
        return math.inf if math.isnan(change) else change, "of the largest"

    at = f"{asked.frequency[0]:.4g} Hz"
    text = f"cross-coupling at {at}, each of {job.count} imperfect builds"
    return Question("coupling", text, solve, compare, count=job.count)


def measure(
    source: Source,
    quantities: Sequence[str] = (),
    report: Callable[[int, int], None] = lambda *_: None,
) -> Tradeoff:
    """Measure all models for some quantities of a design (default: all).

    `report` is called with the numbers of answered and all questions. Raises `InputError` if the
    most complete model has no stable equilibrium.
    """
    invalid = {model: _explain_invalid(model, source.design) for model in registry.MODELS}
    questions = [one for one in ask(source) if not quantities or one.quantity in quantities]
    entries: list[Entry] = []
    for number, question in enumerate(questions):
        report(number, len(questions))
        entries += _answer(question, invalid)
    report(len(questions), len(questions))
    return Tradeoff(tuple(entries))


def _answer(question: Question, invalid: dict[Model, str]) -> list[Entry]:
    """Measure all models for one question; `invalid` gives why a model is not valid, or ""."""
    reasons, results, works = dict(invalid), {}, {}
    for model in [model for model, reason in reasons.items() if not reason]:
        try:
            results[model] = question.solve(model)
            prepare = question.prepare
            work = prepare(model) if prepare else partial(question.solve, model)
            work()  # fills caches
            works[model] = work
        except InputError as error:
            reasons[model] = error.faults[0].problem
    exact = results[max(results, key=registry.MODELS.index)] if results else None
    errors = {
        model: (0.0, "") if found is exact else question.compare(found, exact)
        for model, found in results.items()
    }
    times = dict(zip(works, median_times([*works.values()]), strict=True))
    return [
        Entry(
            question.quantity,
            question.text,
            model.name,
            times.get(model, math.nan) / question.count,
            *errors.get(model, (math.nan, "")),
            reason,
        )
        for model, reason in reasons.items()
    ]


def _explain_invalid(model: Model, design: Design) -> str:
    """Return why a model is not valid for a design; "" if it is."""
    if why := model.unsuitable(design):
        return why
    try:
        grows = find_growth(design, model, model.system(design))
        if grows is not None:
            remedy = f"{grows.fault.remedy}; responses of an unstable design are not compared"
            raise InputError([Fault(grows.fault.key, grows.fault.problem, remedy)])
    except InputError as error:
        if model == registry.most_complete(design):
            raise
        return error.faults[0].problem
    return ""


def median_times(works: Sequence[Callable[[], object]]) -> list[float]:
    """Measure the median processor times of functions, s.

    Processor time excludes waiting. The functions take turns, so that a drift of the machine
    affects all equally.
    """
    samples: list[list[float]] = [[] for _ in works]
    for _ in range(REPEAT):
        for work, taken in zip(works, samples, strict=True):
            if sum(taken) < BUDGET:
                begin = time.process_time()
                work()
                taken.append(max(time.process_time() - begin, RESOLUTION))
    return [statistics.median(taken) for taken in samples]
