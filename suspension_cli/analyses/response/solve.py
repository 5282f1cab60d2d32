"""Responses with loops open or closed, their peaks, and measured ones beside them.

>>> import suspension_cli as sus
>>> found = sus.response(sus.example("double"), frequency=[1.0, 10.0], fidelity="string")
>>> found.output, found.value.shape
(('test.x',), (2, 1, 1))

A measured response is compared with the modelled one by the ratio of both, chi^2, and the shifts of
resonances. Near resonances and zeros the curve of the picture has more frequencies than are asked
for (`Response.fine`).
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from numpy.polynomial import chebyshev
from scipy.optimize import elementwise, linear_sum_assignment

from suspension_cli.analyses import readings
from suspension_cli.analyses.record import Record
from suspension_cli.design import measured as tables
from suspension_cli.design.derive import mirror
from suspension_cli.design.measured import Measured
from suspension_cli.drawing.added_points import NARROWEST, add_from_model, add_points
from suspension_cli.errors import Fault, InputError, attribute_faults_to, format_value
from suspension_cli.files.declared import INLINE, NOT_STORED, in_unit
from suspension_cli.files.documents import Layout
from suspension_cli.grids import parse_frequencies
from suspension_cli.linear import damped, response, signals
from suspension_cli.linear.solver import Solvable, Solver
from suspension_cli.linear.system import LinearSystem
from suspension_cli.measurements import read, resonances
from suspension_cli.measurements.transfer_function import Channels, MeasuredResponse
from suspension_cli.models.choice import Transfer, estimate_resonances
from suspension_cli.physics import local_control, model_choice, near_limits
from suspension_cli.physics.closed_loop import find_steady_poles
from suspension_cli.scene.arrays import Array, Index

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float

    from suspension_cli.analyses.analysis import Analysis, Run
    from suspension_cli.design.schema import Design
    from suspension_cli.drawing.added_points import Curve
    from suspension_cli.linear.statespace import Poles

MANY = 8
"""Number of responses above which the frequencies of modes alone are added for the picture."""
LOW = 0.1
"""Fraction of the largest magnitude on the grid from which a peak may be the largest."""
NODES = 9
"""Points between the neighbours of a peak from which its top is interpolated."""
NOISY = 1 / 3
"""Uncertainty relative to the value from which a point is no evidence of a deviation."""
RESIDUE = 1e-4
"""Contribution of a mode relative to the largest, from which its pole can explain a peak."""
MODEL_ERROR = 0.1
"""Relative error of a computed frequency before anything was fitted; adds to the half width 1/(2 Q)
of a resonance."""
FARTHEST = 2.0
"""Distance, in these widths, from which a mode does not explain a peak."""
SLIP = 1e3
"""Median ratio of measured to modelled magnitude (or its inverse) that suggests wrong units."""
UNITS = {1e3: "mm", 1e6: "um", 1e9: "nm", 1e-3: "km"}


@dataclass(frozen=True)
class ClosedTransfer(Transfer):
    """Responses of outputs to inputs with all loops of a design closed."""

    design: Design

    def values(
        self, system: Solvable, frequency: Array
    ) -> Complex[np.ndarray, "frequency output input"]:
        """Solve for the responses (f, o, i) at frequencies (f,) in Hz."""
        plant = local_control.build_plant(self.design, system)
        at = np.asarray(frequency)
        return local_control.solve_responses(plant, at, self.inputs, self.outputs)


def make_transfer(
    design: Design,
    model: LinearSystem,
    names: tuple[Sequence[str], Sequence[str]],
    frequency: Array,
    *,
    closed: bool,
) -> Transfer:
    """Responses between inputs and outputs given by name, with all loops closed or not."""
    bodies = signals.bodies_with_signals(model)
    inputs, outputs = names
    into = [signals.parse_input(text, bodies) for text in inputs]
    out = [signals.parse_output(text, bodies) for text in outputs]
    if closed:
        return ClosedTransfer(into, out, frequency, design)
    return Transfer(into, out, frequency)


@dataclass(frozen=True)
class Item:
    """Measured transfer functions; the tables and file that say how they were measured, if any."""

    tables: Measured
    channels: Channels
    file: str = ""


@dataclass(frozen=True)
class Comparison:
    """A measured transfer function and its prediction by a model.

    Attributes
    ----------
    predicted, curve
        By the model, with gains, delays and mixes of the transducers; also on a finer grid.
    peak
        Frequencies of measured resonances, Hz.
    pole, mode
        Frequency (Hz) and label of the mode of the model that contributes there; NaN and "" if
        there is none. No two peaks have one mode.
    """

    in_json: ClassVar = Layout(
        only="data predicted points median extreme chi_squared peak pole mode shift",
        rows={"mode": "resonances"},
        names={
            "predicted": "model_real model_imag",
            "median": "median_ratio",
            "extreme": "extreme_ratio extreme_ratio_at_hz",
            "chi_squared": "chi_squared_per_number",
            "peak": "measured_hz",
            "pole": "model_hz",
        },
        flat="data",
    )
    data: MeasuredResponse = field(metadata=INLINE)
    predicted: Complex[np.ndarray, " frequency"] = field(metadata=in_unit("{unit}"))
    curve_frequency: Float[np.ndarray, " curve_frequency"] = field(metadata=in_unit("Hz"))
    curve: Complex[np.ndarray, " curve_frequency"] = field(metadata=in_unit("{unit}"))
    peak: Float[np.ndarray, " mode"] = field(metadata=in_unit("Hz"))
    pole: Float[np.ndarray, " mode"] = field(metadata=in_unit("Hz"))
    mode: tuple[str, ...]

    @property
    def points(self) -> int:
        """Number of frequencies."""
        return len(self.data.frequency)

    @property
    def ratio(self) -> Complex[np.ndarray, " point"]:
        """Measured over predicted value, (f,) complex."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.data.value / self.predicted

    @property
    def clear(self) -> Bool[np.ndarray, " point"]:
        """Whether the uncertainty of each point is below `NOISY` of its value; all if none is."""
        with np.errstate(invalid="ignore"):
            clear = ~(self.data.uncertainty > NOISY * np.abs(self.data.value))
        return np.isfinite(self.ratio) & (clear | ~clear.any())

    @property
    def median(self) -> float:
        """Median magnitude of the ratio; NaN where the model has no response."""
        size = np.abs(self.ratio)
        return float(np.median(size[np.isfinite(size)])) if np.isfinite(size).any() else np.nan

    @property
    def extreme(self) -> tuple[float, float]:
        """Magnitude of the clear ratio farthest from 1 (in its logarithm), and its frequency."""
        size = np.abs(self.ratio)
        with np.errstate(divide="ignore"):
            far = np.where(self.clear, np.abs(np.log(size)), -1.0)
        n = int(np.argmax(far))
        return float(size[n]), float(self.data.frequency[n])

    @property
    def chi_squared(self) -> float:
        """Chi^2 per number (real and imaginary parts); NaN without uncertainties."""
        sigma = self.data.uncertainty
        known = np.isfinite(sigma) & (sigma > 0)
        if not known.any():
            return np.nan
        off = np.abs(self.data.value - self.predicted)[known] / sigma[known]
        return float(np.mean(off**2) / 2)

    @property
    def shift(self) -> Float[np.ndarray, " mode"]:
        """Relative distance of measured resonances from those of the model, (p,)."""
        return self.peak / self.pole - 1


@dataclass(frozen=True)
class SingleResponse:
    """The response of one output to one input, complex, in a unit."""

    in_json: ClassVar = Layout(names={"value": "real imag"})
    input: str
    output: str
    unit: str
    value: Complex[np.ndarray, " frequency"]


@dataclass(frozen=True)
class Peaks:
    """Largest magnitude (SI) of each response, infinite at a lossless pole, and where (Hz)."""

    frequency: Float[np.ndarray, "output input"] = field(metadata=in_unit("Hz"))
    size: Float[np.ndarray, "output input"] = field(metadata=in_unit("{unit}"))


@dataclass(frozen=True)
class _Curve:
    """Responses at any frequencies, to resolve resonances and find peaks.

    `poles` are the frequencies of closed loops, Hz; None if they are open.
    """

    solver: Solver
    transfer: Transfer
    poles: Array | None

    @cached_property
    def resonances(self) -> Array:
        """Frequencies where resonances may be, Hz."""
        return estimate_resonances(self.solver) if self.poles is None else self.poles

    def refine(
        self,
        frequency: Float[np.ndarray, " frequency"],
        value: Complex[np.ndarray, "frequency output input"],
    ) -> tuple[Curve, Peaks]:
        """Add frequencies (Hz) to those of responses until resonances are resolved; find peaks."""
        few = value[0].size <= MANY
        fine = add_from_model(lambda: (self.solve, self.resonances), frequency, value, few=few)
        resolved = few and len(fine[0]) > len(frequency)
        known = fine if resolved else (frequency, value)
        return fine, find_peaks(*known, self.solve, self.resonances, resolved=resolved)

    def solve(self, frequency: Array) -> Complex[np.ndarray, "frequency output input"]:
        """Solve at frequencies in Hz."""
        return self.transfer.values(self.solver, frequency)


@dataclass(frozen=True, eq=False, repr=False)
class Response(Record, response.Response):
    """Responses, and measured transfer functions that they are compared with.

    Attributes
    ----------
    frequency
        Hz.
    input, output
        Signals.
    unit
        Unit of each output over each input, [output][input].
    value
        Complex, SI.
    closed_loop
        Whether the loops of the design's local control are closed.
    peaks
        Peaks within the band, also between the frequencies: `largest` computes them when they are
        first needed. None beside measured functions.
    fine_frequency, fine
        Values at more frequencies, which resolve resonances, for the picture. They are computed
        when the result is first printed, drawn or saved: of a result of `sus.response` itself they
        are None, `complete()` has them. None beside measured functions, too.
    measured
        Measured transfer functions, each with its prediction.
    """

    in_json: ClassVar = Layout(
        only="closed_loop frequency responses measured",
        sparse="closed_loop measured",
        flat="responses",
    )
    peaks: Peaks | None = field(default=None, metadata=in_unit("", name="largest"))
    fine_frequency: Float[np.ndarray, " fine_frequency"] | None = field(
        default=None, metadata=in_unit("Hz")
    )
    fine: Complex[np.ndarray, "fine_frequency output input"] | None = field(
        default=None, metadata=in_unit("{unit}")
    )
    measured: tuple[Comparison, ...] = ()
    refined: _Curve | None = field(default=None, metadata=NOT_STORED)

    def complete(self) -> Self:
        """Return the record with its peaks and the curve of its picture.

        Both are computed the first time.
        """
        return self._completed

    @cached_property
    def _completed(self) -> Self:
        if self.refined is None:
            return self
        (at, fine), peaks = self.refined.refine(self.frequency, self.value)
        return replace(self, fine_frequency=at, fine=fine, peaks=peaks, refined=None)

    @property
    def largest(self) -> Peaks | None:
        """Peaks within the band, computed the first time; None beside measured functions."""
        return self.complete().peaks

    @property
    def responses(self) -> tuple[SingleResponse, ...]:
        """The response of each output to each input."""
        return tuple(
            SingleResponse(into, out, self.unit[o][i], self.value[:, o, i])
            for o, out in enumerate(self.output)
            for i, into in enumerate(self.input)
        )

    @property
    def curve(self) -> tuple[Float[np.ndarray, " frequency"], Complex[np.ndarray, "frequency o i"]]:
        """Frequencies (Hz) and values of the picture, computed the first time."""
        drawn = self.complete()
        if drawn.fine_frequency is None or drawn.fine is None:
            return self.frequency, self.value
        return drawn.fine_frequency, drawn.fine


def solve(analysis: Analysis, run: Run, *, default: bool) -> Response:
    """Solve for every input at every frequency; by `default` frequencies cover measurements."""
    setting = run.setting
    ends = setting["inputs"], setting["outputs"]
    items = read_files(setting["measured"] or (), ends)
    ask = partial(request, setting=setting, items=items, design=run.design, default=default)
    unstable = setting["allow_unstable"]
    choice, model = model_choice.choose(run.source, setting["fidelity"], ask)
    allowed = unstable or setting["closed_loop"]
    solver = Solver(model)
    model_choice.stable_system(run.source, choice, allowed, run.log, solver, bends=True)
    wanted = ask(model)
    near_limits.warn_of_tables(run.design, wanted.frequency, run.log)
    closed = None
    if isinstance(wanted, ClosedTransfer):
        poles = find_steady_poles(run.design, solver, choice.model, "response", run.log, unstable)
        closed = wanted, poles
    found = response.Response(
        wanted.frequency,
        tuple(signal.text for signal in wanted.inputs),
        tuple(signal.text for signal in wanted.outputs),
        response.units(wanted.inputs, wanted.outputs),
        wanted.values(solver, wanted.frequency),
        closed_loop=closed is not None,
    )
    measured = compare(model, items, found, closed) if items else ()
    for text in filter(None, map(slip, measured)):
        run.log.warn(text)
    at_poles = None if closed is None else closed[1].frequency
    refined = None if items else _Curve(solver, wanted, at_poles)
    origin = run.origin(analysis, choice)
    return Response.extending(found, measured=measured, refined=refined, run=origin)


def read_files(files: Sequence[str], ends: Sequence[Sequence[str]]) -> tuple[Item, ...]:
    """Read files of measurements (TOML), and bare files of data.

    Bare data are from one input to one output, the `ends`. Raises `InputError`.
    """
    return tuple(_read(file, *ends) for file in files)


def _read(file: str, inputs: Sequence[str], outputs: Sequence[str]) -> Item:
    """Read one file; raises `InputError`."""
    if Path(file).suffix.lower() == ".toml":
        given = tables.read(file)
        if not given.transfer_function:
            remedy = "add one (docs/measurements.md), or name a file of data"
            raise InputError([Fault("", "has no [[transfer_function]]", remedy)], file)
        return Item(given, Channels.of(given, read.read_all(given, file)), file)
    if not os.path.isfile(file):  # False of names that are too long, too
        problem = "is a directory" if os.path.isdir(file) else "is missing"
        raise InputError([Fault("", problem, "name a file of measurements")], file)
    if len(inputs) != 1 or len(outputs) != 1:
        problem = "does not say what was driven and observed"
        remedy = "give one --input and one --output, or a TOML file of measurements"
        raise InputError([Fault("--measured", problem, remedy, format_value(file))])
    found = read.read_bare(file, input=inputs[0], output=outputs[0])
    if len(found) > 1:
        problem = f"has {len(found)} transfer functions"
        remedy = "name channels in a TOML file of measurements (docs/measurements.md)"
        raise InputError([Fault("", problem, remedy)], file)
    return Item(Measured(), Channels.of(Measured(), found))


def _parse(item: Item, known: tuple[str, ...]) -> readings.Signals:
    """Find the signals of a file; raises `InputError`, in that file, if the design lacks one."""
    with attribute_faults_to(item.file) if item.file else nullcontext():
        return readings.parse(item.channels, item.tables, known)


def request(
    model: LinearSystem,
    setting: dict[str, Any],
    items: Sequence[Item],
    design: Design,
    *,
    default: bool,
) -> Transfer:
    """Inputs, outputs and frequencies in terms of a model of the design.

    Signals are those of the setting, then those that the measurements refer to. By `default`
    frequencies cover all measurements, if there are any, and a little more.
    """
    bodies = signals.bodies_with_signals(model)
    outputs, inputs = ([*setting["outputs"]], [*setting["inputs"]])
    for item in items:
        _parse(item, bodies)
        outputs += item.channels.signal[0]
        inputs += item.channels.signal[1]
    if items and default:
        every = [one.frequency for item in items for one in item.channels.function]
        above = np.concatenate(every)
        above = above[above > 0] if (above > 0).any() else np.array([0.1, 100.0])
        frequency = np.geomspace(above.min() / 1.2, above.max() * 1.2, 2000)
    else:
        frequency = np.array(parse_frequencies(setting["frequency"]))
    names = (
        [*dict.fromkeys(inputs)] or ["support.x"],
        [*dict.fromkeys(outputs)] or [f"{mirror(design)}.x"],
    )
    if setting["closed_loop"]:
        local_control.demand_loops(design)
    return make_transfer(design, model, names, frequency, closed=setting["closed_loop"])


def find_peaks(
    frequency: Float[np.ndarray, " frequency"],
    value: Complex[np.ndarray, "frequency output input"],
    solve: Callable[[Array], Complex[np.ndarray, "frequency output input"]],
    modes: Array,
    *,
    resolved: bool,
) -> Peaks:
    """Find the largest magnitude of every response within the band of its grid.

    If the curve has `resolved` each peak, its highest points are taken; else points are added
    first, at `modes` (or poles, Hz) and at maxima of the curve. Then the magnitude is maximised
    between the neighbours of the highest point. A peak narrower than the distance of neighbours can
    be is that of a pole without loss: infinite.
    """
    shape = value.shape[1:]
    frequency, order = np.unique(frequency, return_index=True)
    value = value[order]
    above = frequency > 0
    if above.any() and not resolved:
        points = add_points(solve, frequency[above], value[above], modes, least=LOW)
        frequency = np.concatenate([frequency[~above], points[0]])
        value = np.concatenate([value[~above], points[1]])
    size = np.abs(value).reshape(len(frequency), -1)
    top = size.argmax(0)
    best = size.max(0)
    where = frequency[top]
    pair = np.flatnonzero((top > 0) & (top < len(frequency) - 1) & (best > 0))
    low, middle, high = (frequency[top[pair] + shift] for shift in (-1, 0, 1))
    best[pair[high - low < 4 * NARROWEST * middle]] = np.inf
    inside = np.isfinite(best[pair]) & (low > 0)
    pair = pair[inside]
    if len(pair):
        place = _maximise(solve, frequency, top[pair], pair)
        found = np.abs(solve(place)).reshape(len(pair), -1)[np.arange(len(pair)), pair]
        better = found > best[pair]
        best[pair[better]] = found[better]
        where[pair[better]] = place[better]
    return Peaks(where.reshape(shape), best.reshape(shape))


def _maximise(
    solve: Callable[[Array], Complex[np.ndarray, "frequency output input"]],
    frequency: Float[np.ndarray, " frequency"],
    top: Index,
    pair: Index,
) -> Float[np.ndarray, " peak"]:
    """Frequencies (Hz) of the largest magnitudes between the neighbours of the points `top`.

    `pair` is the number of the response of each. Around a peak 1/|H|^2 is nearly a parabola in
    frequency, so its interpolant on `NODES` Chebyshev points has the same minimum.
    """
    centre, which = np.unique(top, return_inverse=True)  # responses that share a mode share points
    half = (frequency[centre + 1] - frequency[centre - 1]) / 2
    middle = (frequency[centre + 1] + frequency[centre - 1]) / 2
    node = chebyshev.chebpts1(NODES)
    value = solve((middle[:, None] + half[:, None] * node).ravel())
    size = np.abs(value).reshape(len(centre), NODES, -1)[which, :, pair]
    highest = size.max(1, keepdims=True)
    series = chebyshev.chebfit(node, ((highest / size) ** 2).T, NODES - 1)

    def inverse_power(place: Array, number: Index) -> Array:
        return chebyshev.chebval(place, series[:, number], tensor=False)

    start = (frequency[top] - middle[which]) / half[which]
    edge = np.ones(len(pair))
    found = elementwise.find_minimum(
        inverse_power,
        (-edge, start, edge),
        args=(np.arange(len(pair)),),
        tolerances={"xatol": 1e-6, "xrtol": 0.0, "fatol": 0.0, "frtol": 0.0},
    )
    inside = np.where(np.isfinite(found.x), found.x, start)
    return middle[which] + half[which] * inside


def compare(
    model: LinearSystem,
    items: Sequence[Item],
    found: response.Response,
    closed: tuple[ClosedTransfer, Poles] | None = None,
) -> tuple[Comparison, ...]:
    """Compare measured transfer functions with the responses of a model.

    `found` are the responses of all signals on a grid. For closed loops, `closed` solves them, and
    has the poles.
    """
    known = signals.bodies_with_signals(model)
    # with dampers and light, whose effect on poles losses do not have
    plain = replace(model, terms=model.terms_with_states)
    modes = damped.solve(plain)
    squared = np.where(modes.frequency > 0, modes.omega_squared, np.inf)
    result = []
    for item in items:
        channels = item.channels
        out, into = _parse(item, known)
        rows = [found.output.index(name) for name in channels.signal[0]]
        columns = [found.input.index(name) for name in channels.signal[1]]
        curves = channels.combine(found.value[:, rows][:, :, columns], found.frequency)
        static = np.abs(readings.residues(channels, (out, into), model, modes) / squared)
        for data, own, (sensor, actuator) in zip(
            channels.function, static, channels.pairs, strict=True
        ):
            at = data.frequency
            transfer = Transfer([*into], [*out], data.frequency)
            if closed is None:
                poles = np.flatnonzero(own > RESIDUE * own.max(initial=0.0))
                pole = modes.frequency[poles]
                label = [modes.label[n] for n in poles]
                q = modes.q[poles]
            else:
                transfer = replace(closed[0], inputs=[*into], outputs=[*out])
                resonant = np.abs(closed[1].q) > 0.5
                pole = closed[1].frequency[resonant]
                q = np.abs(closed[1].q[resonant])
                label = ["closed loop"] * len(pole)
            peaks = np.array([peak.frequency for peak in resonances.find_peaks(data)])
            paired = _pair(peaks, pole, pole * (MODEL_ERROR + 1 / (2 * q)))
            result.append(
                Comparison(
                    data,
                    channels.combine(transfer.values(model, at), at)[:, sensor, actuator],
                    found.frequency,
                    curves[:, sensor, actuator],
                    peaks,
                    np.append(pole, np.nan)[paired],
                    tuple([*label, ""][n] for n in paired),
                )
            )
    return tuple(result)


def _pair(peak: Array, pole: Array, width: Array) -> list[int]:
    """Number of the mode of each peak, one to one with the least sum of distances; -1 if none."""
    distance = np.abs(peak[:, None] - pole) / width
    cost = np.pad(
        np.minimum(distance, FARTHEST), ((0, 0), (0, len(peak))), constant_values=FARTHEST
    )
    chosen = linear_sum_assignment(cost)[1]
    return [n if row[n] < FARTHEST else -1 for n, row in zip(chosen.tolist(), cost, strict=True)]


def slip(one: Comparison) -> str:
    """Describe a ratio of measured to modelled magnitudes that suggests wrong units; "" if none."""
    median = one.median
    if not np.isfinite(median) or median == 0 or 1 / SLIP < median < SLIP:
        return ""
    factor = 10.0 ** round(np.log10(median))
    unit = UNITS.get(factor)
    advice = f"is the file in {unit}? then " if unit else "check units and gains: "
    return (
        f"{one.data.name}: measured magnitudes are {median:.3g} times those of the model (median);"
        f" {advice}set gain = {1 / factor:g} in its [[transfer_function]]"
    )
