"""Time and error of each model for questions about a design, which model to use, its picture."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property, partial
from itertools import groupby
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from suspension_cli.analyses import known_analyses, settings
from suspension_cli.analyses.options import MOST_WIRE_MODES
from suspension_cli.analyses.record import Record
from suspension_cli.design.derive import mirror
from suspension_cli.design.imperfections import swept
from suspension_cli.design.reader import Source
from suspension_cli.drawing import labels, panels
from suspension_cli.drawing.panels import Across, Panel
from suspension_cli.drawing.style import NOTE, PALE, PALETTE
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.errors import InputError
from suspension_cli.files.declared import INLINE, along, in_unit
from suspension_cli.files.documents import Layout
from suspension_cli.linear import signals
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.mode_pairing import pair_bodies
from suspension_cli.linear.solver import Solvable, Solver
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import registry
from suspension_cli.models.choice import TOLERANCE, Transfer, percent, relative_change
from suspension_cli.models.registry import AUTO, Choice
from suspension_cli.models.spectrum_error import first_violin, largest_error
from suspension_cli.physics import model_choice, thermal_noise, wire_modes
from suspension_cli.physics.couplings import ROUNDING, couplings, parse_request
from suspension_cli.physics.growth import find_growth
from suspension_cli.quantities.needs import Needs
from suspension_cli.quantities.solved import of_designs
from suspension_cli.scene.arrays import Array
from suspension_cli.studies import builds, sampling, variants

if TYPE_CHECKING:
    from suspension_cli.design.schema import Design
    from suspension_cli.models.base import Model
    from suspension_cli.scene.scene import Scene

FREQUENCIES = 200
"""Number of frequencies of a response or noise."""
DESIGNS = 100
"""Number of designs of a sweep."""
SPREAD = 0.01
"""Relative range of the mirror's mass in a sweep, to either side."""
STIFFNESSES = np.linspace(0.6, 1.4, 41)
OFFSETS = np.linspace(-2e-3, 2e-3, 5)
"""Imperfections of builds: factors on the stiffness of one wire, and offsets of its upper end along
x, m; the default grids of `pendsus xcouple`."""
REPEAT = 7
"""Samples per time, fewer where they take longer than `BUDGET`."""
BUDGET = 1.0
"""Processor time after which a function is not sampled again, s."""
RESOLUTION = time.get_clock_info("process_time").resolution
"""Least time, s, as others are divided by it."""
WORTHWHILE = 1.2
"""Ratio of times from which a faster model is named as an alternative."""
COLOUR = dict(zip(registry.FILES, (PALETTE[n] for n in (3, 2, 0, 1, 6)), strict=True))
"""Colours of the models."""
EXACT = 1e-12
"""Errors below this are drawn with the reference."""


@dataclass(frozen=True)
class Entry:
    """Time and error of one model for one question about a design.

    `time` is the median processor time of one result, design or build, s; `left_out` says why it is
    NaN. `error` is the largest relative one against the most complete model that has a result (its
    own is 0; NaN without a result), `where` its mode or frequency.
    """

    in_json: ClassVar = Layout(without="quantity question")
    quantity: str
    question: str
    model: str
    time: float = field(metadata=in_unit("s"))
    error: float
    where: str
    left_out: str

    @property
    def size(self) -> str:
        """The error in words: ``15 % (test pitch)``."""
        return percent(self.error) + (f" ({self.where})" if self.where else "")


@dataclass(frozen=True)
class Automatic:
    """The model that ``--fidelity auto`` takes for one question, why, and what it neglects.

    `error` is what `auto` states, relative; NaN if unknown.
    """

    in_json: ClassVar = Layout(
        names={"model": "fidelity", "error": "estimated_error"}, without="question"
    )
    question: str
    model: str
    reason: str
    error: float

    @property
    def line(self) -> str:
        """The choice in one line, as the command prints it."""
        return Choice(self.model, self.reason, self.error).line


@dataclass(frozen=True)
class Answer:
    """All models on one question, from the simplest to the most complete.

    `automatic` is the choice of ``--fidelity auto``; None where that compares many designs.
    """

    in_json: ClassVar = Layout(
        only="quantity question reference best_model advice entries automatic",
        names={"best_model": "best", "entries": "models", "automatic": "auto"},
        sparse="automatic",
    )
    entries: tuple[Entry, ...]
    automatic: Automatic | None = None

    @property
    def quantity(self) -> str:
        """What is asked, one of `command.QUANTITIES`."""
        return self.entries[0].quantity

    @property
    def question(self) -> str:
        """What is asked, in words."""
        return self.entries[0].question

    @property
    def reference(self) -> str | None:
        """Name of the model against which errors are taken; None if there is none."""
        return next((e.model for e in reversed(self.entries) if not math.isnan(e.error)), None)

    @property
    def options(self) -> list[Entry]:
        """The models that are not left out."""
        return [entry for entry in self.entries if 0 < entry.time < math.inf]

    @property
    def best(self) -> Entry | None:
        """The fastest model within the tolerance, else the most accurate; None if there is none."""
        good = [entry for entry in self.options if entry.error <= TOLERANCE]
        if good:
            return min(good, key=lambda entry: entry.time)
        return min(self.options, key=lambda entry: entry.error, default=None)

    @property
    def best_model(self) -> str | None:
        """Name of the best model; None if there is none."""
        return self.best and self.best.model

    @property
    def advice(self) -> str:
        """Which model to use and why, in one sentence."""
        best = self.best
        if best is None:
            return f"left out: {self.entries[-1].left_out}"
        if best.error > TOLERANCE:
            return f"Use {best.model}: it is off by {best.size}, the others by more."
        faster = [entry for entry in self.options if WORTHWHILE * entry.time < best.time]
        if faster:
            other = min(faster, key=lambda entry: entry.error)
            ratio = f"{float(f'{best.time / other.time:.2g}'):g}"
            return (
                f"Use {best.model}: {other.model} is {ratio} times faster, but off by {other.size}."
            )
        fastest = best.time <= min(entry.time for entry in self.options)
        why = "no other model is faster" if fastest else "simpler models save hardly any time"
        return f"Use {best.model}: {why}."


@dataclass(frozen=True, eq=False)
class Measured:
    """Times and errors of all models for all questions about a design.

    `choices` are those of ``--fidelity auto``. `first_violin` is the lowest first violin mode, Hz;
    infinite if the design does not give the mass of wires.
    """

    in_json: ClassVar = Layout(only="first_violin answers", names={"answers": "questions"})
    entries: tuple[Entry, ...] = field(metadata=along("entry") | INLINE)
    choices: tuple[Automatic, ...] = field(default=(), metadata=along("choice"))
    first_violin: float = field(default=math.inf, metadata=in_unit("Hz"))

    @cached_property
    def answers(self) -> tuple[Answer, ...]:
        """The entries by question."""
        chosen = {one.question: one for one in self.choices}
        return tuple(
            Answer(tuple(part), chosen.get(question))
            for question, part in groupby(self.entries, lambda entry: entry.question)
        )

    @property
    def within(self) -> str:
        """Tolerance and reference of the advice: ``within 0.1 % of violin``."""
        names = dict.fromkeys(answer.reference for answer in self.answers if answer.reference)
        return f"within {percent(TOLERANCE)} of {' or '.join(names)}"


@dataclass(frozen=True, eq=False, repr=False)
class Tradeoff(Record, Measured):
    """Times and errors of all models for all questions about a design, and the run."""


@dataclass(frozen=True)
class Question:
    """What is asked about a design: one of `command.QUANTITIES`, and words.

    `solve` gives the result of a model, or raises `InputError` if it has none; `compare` gives the
    largest relative error of a result against the true one, and where it is. The time is that of
    `timed` (by default of `solve`), for one of the `count` designs or builds computed together.
    `choose` makes the choice of ``--fidelity auto``; None where that compares many designs.
    """

    quantity: str
    text: str
    solve: Callable[[Model], Any]
    compare: Callable[[Any, Any], tuple[float, str]]
    timed: Callable[[Model], object] | None = None
    count: int = 1
    choose: Callable[[], Choice] | None = None


def ask(source: Source) -> tuple[Question, ...]:
    """List all questions about a design."""

    def modes(model: Model) -> Modes:
        system = model.system(source.design)
        return wire_modes.solve_bodies(system, partial(_admit, system))

    def compare(found: Modes, true: Modes) -> tuple[float, str]:
        partner = pair_bodies(true, found, registry.STRING.system(source.design))
        here = np.flatnonzero((partner >= 0) & (true.frequency > 0))
        if not len(here):
            return 0.0, ""
        error = np.abs(found.frequency[partner[here]] / true.frequency[here] - 1)
        worst = int(np.argmax(error))
        return float(error[worst]), true.label[here[worst]]

    def choose() -> Choice:
        return model_choice.for_modes(source, AUTO, TOLERANCE)[0]

    def sweep(model: Model) -> list[Array]:
        if model.has_wire_mass:
            raise InputError.of("", "a sweep follows the modes of wires without mass", "")
        return [batch.frequency for _, batch in of_designs(designs(), model.name, Needs())]

    designs = cache(partial(_sweep, source))
    text = f"mode frequencies in a sweep, each of {DESIGNS} designs"
    return (
        Question("modes", "mode frequencies", modes, compare, choose=choose),
        Question("modes", text, modes, compare, sweep, DESIGNS),
        _spectrum(source, "response", "response", 0.1, 10.0),
        _spectrum(source, "response", "response", 50.0, 1000.0),
        _spectrum(source, "thermal", "thermal noise", 10.0, 100.0),
        _coupling(source),
    )


def _admit(system: LinearSystem, number: int, top: float) -> None:
    """Refuse wires with mass of so many modes that all would take minutes."""
    if number > wire_modes.most_in_a_minute(system, MOST_WIRE_MODES):
        problem = f"its wires have {number:,} modes up to {top:.4g} Hz, which would take minutes"
        raise InputError.of("", problem, "")


def _sweep(source: Source) -> list[Design | None]:
    """List the designs of a sweep of the mirror's mass; None where one is invalid."""
    name = mirror(source.design)
    body = next(stage.body for stage in source.design.stage if stage.name == name)
    solid = body.parts[0] if body.parts else body
    key = "density" if solid.mass is None else "mass"
    given = getattr(solid, key)
    key = f"parts.1.{key}" if body.parts else key
    values = given * np.linspace(1 - SPREAD, 1 + SPREAD, DESIGNS)
    return list(variants.designs_at(source.text, {f"stage.{name}.body.{key}": values}))


def _spectrum(source: Source, quantity: str, words: str, low: float, high: float) -> Question:
    """Response of the mirror to the support along x, or its thermal noise, over frequencies."""
    design = source.design
    frequency = np.geomspace(low, high, FREQUENCIES)
    observed = f"{mirror(design)}.x"

    def transfer(system: LinearSystem) -> Transfer:
        known = signals.bodies_with_signals(system)
        into = signals.parse_input("support.x", known)
        out = signals.parse_output(observed, known)
        return Transfer([into], [out], frequency)

    def values(given: Solvable, at: Array) -> Array:
        solver = Solver.of(given)
        system = solver.system
        if quantity == "thermal":
            motion = thermal_noise.parse_motion(system, observed)
            temperature = design.constants.temperature
            return thermal_noise.solve(solver, at, [motion], temperature)[0].amplitude
        return transfer(system).values(solver, at)[:, 0, 0]

    def solve(model: Model) -> LinearSystem:
        if quantity == "thermal" and not model.bends_wires:
            raise InputError.of("", "it does not know where along a wire its loss acts", "")
        system = model.system(design)
        if not values(system, frequency).any():
            raise InputError.of("", "nothing dissipates", "")
        return system

    def compare(found: LinearSystem, true: LinearSystem) -> tuple[float, str]:
        """Compute the error that `response` and `thermal` state."""
        error = largest_error(frequency, found, true, values)
        return error.value, f"at {error.frequency:.4g} Hz"

    def choose() -> Choice:
        if quantity == "thermal":
            return thermal_noise.choose(source, AUTO, frequency, [observed])[0]
        return model_choice.choose(source, AUTO, transfer)[0]

    text = f"{words} from {low:g} to {high:g} Hz, {FREQUENCIES} frequencies"
    return Question(quantity, text, solve, compare, choose=choose)


def _coupling(source: Source) -> Question:
    """Cross-coupling of imperfect builds: wire, signals and frequency of `pendsus xcouple`."""
    design = source.design
    setting = settings.merge(known_analyses.get("xcouple"), source, {})
    asked = parse_request(registry.STRING.system(design), setting, mirror(design))
    asked = replace(asked, frequency=asked.frequency[:1])
    count = len(STIFFNESSES) * len(OFFSETS)

    def imperfect() -> Scene:
        known = swept()
        stiffness, along_all = known["k"]
        offset, along_x = known["offset"]
        factors, moves = (values.ravel() for values in np.meshgrid(STIFFNESSES, OFFSETS))
        deviations = (
            (stiffness, asked.wire, asked.hold, along_all, factors - stiffness.neutral),
            (offset, asked.wire, asked.hold, along_x, moves - offset.neutral),
        )
        return sampling.impose(expand(design), deviations)

    def solve(model: Model) -> Array:
        if not model.supports_builds:
            raise InputError.of("", "it has no imperfect builds", "")
        if asked.wire < 0:
            raise InputError.of("", "the mirror hangs on no wire", "")
        balanced = builds.balance(imperfect(), design, level=model.name)
        found = couplings(balanced, asked)["ratio"]
        if not np.isfinite(found).any():
            raise InputError.of("", "no imperfect build has a stable equilibrium on taut wires", "")
        if not np.nanmax(np.abs(found)) > ROUNDING:
            raise InputError.of("", "these imperfections couple nothing", "")
        return found

    def compare(found: Array, true: Array) -> tuple[float, str]:
        """Compute the largest error over the largest coupling; infinite if no build has both."""
        change = relative_change(found, true)
        return math.inf if math.isnan(change) else change, "of the largest"

    at = f"{asked.frequency[0]:.4g} Hz"
    text = f"cross-coupling at {at}, each of {count} imperfect builds"
    return Question("coupling", text, solve, compare, count=count)


def measure(
    source: Source,
    quantities: Sequence[str] = (),
    report: Callable[[int, int], None] = lambda *_: None,
) -> Measured:
    """Measure all models for some quantities of a design (default: all).

    `report` is called with the numbers of answered and all questions. Raises `InputError` if the
    most complete model has no stable equilibrium.
    """
    invalid = {model: _explain_invalid(model, source.design) for model in registry.MODELS}
    questions = [one for one in ask(source) if not quantities or one.quantity in quantities]
    entries: list[Entry] = []
    choices: list[Automatic] = []
    for number, question in enumerate(questions):
        report(number, len(questions))
        entries += _answer(question, invalid)
        if question.choose is not None:
            choices += _choose(question.text, question.choose)
    report(len(questions), len(questions))
    complete = registry.most_complete(source.design).system(source.design)
    return Measured(tuple(entries), tuple(choices), first_violin(complete))


def _choose(question: str, choose: Callable[[], Choice]) -> list[Automatic]:
    """Choose the model of one question as ``--fidelity auto`` does; none if no model is valid."""
    try:
        found = choose()
    except InputError:
        return []
    return [Automatic(question, found.level, found.reason, found.error)]


def _answer(question: Question, invalid: dict[Model, str]) -> list[Entry]:
    """Measure all models for one question; `invalid` gives why a model is not valid, or ""."""
    reasons = dict(invalid)
    results: dict[Model, Any] = {}
    works: dict[Model, Callable[[], object]] = {}
    for model in [model for model, reason in reasons.items() if not reason]:
        work = partial(question.timed or question.solve, model)
        try:
            results[model] = question.solve(model)
            work()  # fills caches
            works[model] = work
        except InputError as error:
            reasons[model] = error.faults[0].problem
    exact = [*results.values()][-1:]
    errors = {
        model: (0.0, "") if found is exact[0] else question.compare(found, exact[0])
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
        if grows := find_growth(design, model, model.system(design)):
            remedy = f"{grows.fault.remedy}; responses of an unstable design are not compared"
            raise InputError([replace(grows.fault, remedy=remedy)])
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


def unit_of_time(seconds: float) -> tuple[str, float]:
    """Return the unit in which a time is at least 1, and its size in s."""
    units = (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6))
    return next((unit for unit in units if seconds >= unit[1]), units[-1])


def format_time(seconds: float) -> str:
    """Format a time with two digits: ``2.3 ms``."""
    unit, size = unit_of_time(seconds)
    return f"{float(f'{seconds / size:.2g}'):g} {unit}"


def draw(found: Measured, title: str) -> Figure:
    """Draw error against time of the models, a chart per question, with the advice."""
    shown: list[Panel] = []
    notes: list[str] = []
    for answer in found.answers:
        name = answer.question[0].upper() + answer.question[1:]
        if answer.options:
            shown.append(_chart(answer, name))
        else:
            notes.append(f"{name}: {answer.advice}")
    if shown:
        notes.append(
            f"Left is fast, down is accurate. Shaded: {found.within}. Large: the model to use."
        )
    return panels.draw("Which model to use: error against time", title, shown, notes=notes)


def _chart(answer: Answer, name: str) -> Panel:
    """Make a panel with the models as points, and the tolerance as a band."""
    options = answer.options
    unit, size = unit_of_time(min(option.time for option in options))
    time = np.array([option.time for option in options]) / size
    error = np.nan_to_num([option.error for option in options])
    seen = np.append(error[(error > EXACT) & np.isfinite(error)], TOLERANCE)
    floor = float(10 ** (np.floor(np.log10(seen.min())) - 0.8))
    high = max(float(seen.max()), 10 * TOLERANCE)
    shown = np.clip(error, floor, high)
    wide = max(float(time.max() / time.min()), 2.0)
    limits = floor / 10**0.5, high * (high / floor) ** 0.25
    colours = [COLOUR.get(option.model, NOTE) for option in options]

    def paint(axes: Axes) -> None:
        decades = np.arange(np.ceil(np.log10(floor) + 0.3), np.floor(np.log10(limits[1])) + 1)
        decades = decades[:: -max(1, -(-len(decades) // 5))][::-1]
        names = {floor: "reference"} if error.min() <= EXACT else {}
        names |= {10.0**power: percent(10.0**power) for power in decades.tolist()}
        axes.set_yticks([*names], [*names.values()])
        axes.minorticks_off()
        axes.axhspan(limits[0], TOLERANCE, color=(PALE, 0.28), linewidth=0, zorder=0)
        for option, x, y, colour in zip(options, time, shown, colours, strict=True):
            size = 8.5 if option == answer.best else 5
            axes.plot(x, y, "o", color=colour, clip_on=False, ms=size, zorder=4)
        points = np.stack([time, shown], axis=1).tolist()
        labels.label_points(axes, points, [option.model for option in options], colours, pad=2.0)

    across = Across(
        f"processor time ({unit})", "log", (time.min() / wide**0.14, time.max() * wide**0.36)
    )
    return Panel(
        "relative error", (), 1.3, "log", limits, name, [answer.advice], across=across, paint=paint,
        left=0.86,
    )  # fmt: skip
