"""Where a search starts: parameters, wrong channels and resonances.

Channels that the file of measurements describes wrongly are exchanged, scaled or inverted. Measured
and computed functions are compared in two ways that resonances at wrong frequencies hardly affect:
ln magnitudes, with heavily damped modes in the model, up to a largest difference; and the phase
between both, which is wrong only between a measured resonance and the computed one. The change of a
channel that improves the agreement most is made, until none does enough.

Where peaks of model and measurement are farther apart than their widths, the difference of two
functions has no useful gradient. Peaks are therefore assigned to modes by frequency and residue,
and the parameters fitted to these frequencies alone, as to measured modes.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from suspension_cli.analyses.fit import measured_values
from suspension_cli.analyses.fit.experiment import Experiment
from suspension_cli.analyses.fit.explanations import EXCHANGE, FACTOR, SIGN, Correction
from suspension_cli.analyses.fit.least_squares import minimise
from suspension_cli.analyses.fit.problem import Problem
from suspension_cli.design import paths, reader
from suspension_cli.design.measured import Free, Measured, Mode
from suspension_cli.errors import Fault, InputError, format_value
from suspension_cli.measurements.resonances import Peak
from suspension_cli.models import registry
from suspension_cli.scene.arrays import Array
from suspension_cli.studies import derivatives, parameters
from suspension_cli.studies.response_matrix import Plant

if TYPE_CHECKING:
    from jaxtyping import Bool, Int

ABSOLUTE = {
    key: sigma
    for sigma, keys in (
        (1e-3, "d d_upper l"),
        (0.3e-3, "s s_upper s_lower"),
        (0.5e-3, "t1 t2 upper lower com_offset upper_offset lower_offset"),
    )
    for key in keys.split()
}
"""Usual errors of careful building, m, of keys: prior standard deviations of default parameters."""
RELATIVE = {
    "mass": 0.002,
    "density": 0.005,
    "inertia": 0.02,
    "stiffness": 0.03,
    "uncoupled_frequency": 0.015,
    "thickness": 0.01,
    "youngs_modulus": 0.02,
    "k": 0.02,
}
"""The same of masses and bought materials, relative to the value."""


def default_parameters(text: str, level: str = registry.STRING.name) -> list[Free]:
    """List parameters of a design that are uncertain in a build, with priors around its values.

    >>> [item.name for item in default_parameters(text)]  # doctest: +SKIP
    ['stage.test.body.mass', 'stage.test.body.inertia.1', ..., 'materials.steel302.youngs_modulus']
    """
    found = [item for item in parameters.every(text, level) if default_sigma(item.name, item.value)]
    around = derivatives.differentiate(reader.parse(text), found, level)
    return [
        Free(name=item.name, prior=item.value, uncertainty=default_sigma(item.name, item.value))
        for item, matters in zip(found, around.balanced & around.matters, strict=True)
        if matters
    ]


def default_sigma(name: str, value: float) -> float | None:
    """Prior standard deviation of a parameter, SI; None for one that is not free by default.

    >>> default_sigma("stage.test.wires.d", 0.002), default_sigma("stage.test.body.mass", 10.0)
    (0.001, 0.02)
    """
    keys = [key for key in name.split(".") if not key.isdigit()]
    if keys[0] not in ("stage", "perturbation", "materials"):
        return None
    return ABSOLUTE.get(keys[-1]) or RELATIVE.get(keys[-1], 0.0) * abs(value) or None


def build(texts: Sequence[str], measured: Measured, files: Sequence[str], level: str) -> Problem:
    """Set up the problem of one or several measured designs, without transfer functions.

    Raises `InputError` if a design does not give a parameter, or a starting value lies outside its
    bounds.
    """
    free = measured.parameter
    rows = [measured.shares(n) for n in range(len(free))]
    shared = np.array(rows, dtype=bool).reshape(len(free), len(texts))
    start = _start(texts, measured, shared, level)
    _, _, low, high, *_ = Problem([], free, shared, start).unknowns
    for n in np.flatnonzero((start < low) | (start > high))[:1]:
        bounds = f"{low[n]:g} to {high[n]:g}"
        problem = f"the design's value {start[n]:g} lies outside the bounds {bounds}"
        raise InputError.of(
            f"parameter.{n + 1}", problem, "give a start between them, or widen them"
        )
    experiments = []
    for n, (text, modes, values, own, file) in enumerate(
        zip(texts, measured.modes, measured.quantities, shared.T, files, strict=True)
    ):
        names = tuple(item.name for item, here in zip(free, own, strict=True) if here)
        where = measured.where(n)
        one = Experiment(
            text,
            level,
            modes,
            names,
            start[own],
            where,
            file,
            measured=tuple(values),
            quantities=measured_values.look_up(values, text, file, where),
        )
        _check_start(one, np.flatnonzero(own))
        one.values(one.start)
        experiments.append(one)
    return Problem(experiments, free, shared, start)


def _start(
    texts: Sequence[str],
    measured: Measured,
    shared: Bool[np.ndarray, "parameter experiment"],
    level: str,
) -> Array:
    """Choose starting values: requested ones, else those of the designs, else the priors."""
    known = [{item.name: item.value for item in parameters.every(text, level)} for text in texts]
    found = []
    bad = []
    for n, (item, own) in enumerate(zip(measured.parameter, shared, strict=True), 1):
        name = item.name
        mine = np.flatnonzero(own)
        given = {known[e].get(name, item.prior) for e in mine}
        given = given if item.start is None else {item.start}
        problem = ""
        remedy = "give a start"
        if None in given:
            first = next(e for e in mine if name not in known[e])
            whose = f" of {measured.names[first]}" if measured.names[first] else ""
            reason, instead = parameters.why_unknown(texts[int(first)], name, known[first])
            problem = reason.replace("the design", f"the design{whose}")
            if any(name in known[e] for e in mine):
                remedy += ", or list only experiments whose designs give it"
            else:
                remedy = f"give a start, or {instead}"
        elif len(given) > 1:
            problem = "has different values in the designs that share it"
        if problem:
            bad.append(Fault(f"parameter.{n}.name", problem, remedy, format_value(name)))
        found.append(next(iter(given)))
    if bad:
        raise InputError(bad)
    return np.array(found, dtype=float)


def _check_start(one: Experiment, numbers: Int[np.ndarray, " free"]) -> None:
    """Attribute errors in starting values to the file of measurements that gives them."""
    try:
        reader.convert(one.at(one.start).document)
    except InputError as error:
        given = [*zip(numbers, one.free, one.start, strict=True)]
        bad = [
            Fault(f"parameter.{n + 1}", f"{name}: {fault.problem}", fault.remedy, f"{x:g}")
            for (n, name, x), fault in itertools.product(given, error.faults)
            if fault.key in paths.twins(name) or (fault.value or "").startswith(f'"{name}=')
        ]
        if bad:
            raise InputError(list(dict.fromkeys(bad))) from None
        return  # the design itself is at fault, which is reported where it is solved
    one.plant(one.start)
    for name, change in zip(one.free, one.at(one.start).changes, strict=True):
        if change is None:
            problem = "a change of this number alone unbalances the suspension"
            raise InputError.of(f"parameter {name}", problem, "fit another number")


HEAVY = 1 / 20
"""Added damping 1/Q of all modes of the model in the comparison of magnitudes."""
LARGEST = 3.0
"""Largest difference of ln magnitudes that counts."""
ASSUMED = 0.25
"""Decrease of the disagreement per function of a channel from which a change is assumed."""
SCALED = 0.4
"""ln of the least factor that is assumed."""
SURE = 0.15
"""Least mean cosine of the phase between measured and computed values that are not noise."""
CLEAR = 3.0
"""Least size of values whose phase counts, standard deviations."""
ALIKE = 0.98
"""Fraction of the best improvement from which another channel explains the data as well."""


def guess_channels(problem: Problem, z: Array) -> list[Correction]:
    """Find exchanged, scaled and inverted channels by the functions computed at z."""
    found = list[Correction]()
    while len(found) < 2 * sum(map(len, problem.channels.transducer)):
        rated = _improvements(problem, z)
        if not rated:
            break
        gain, best = max(rated, key=lambda item: (round(item[0], 3), -item[1].side))
        for other, one in rated:
            if (one.kind, one.side) == (best.kind, 1 - best.side) and other > ALIKE * gain:
                best = replace(best, also=one.what) if best.known and not best.also else best
        found.append(best)
        problem = replace(problem, channels=best.apply(problem.channels))
    return sorted(found, key=lambda one: one.kind)


def _improvements(problem: Problem, z: Array) -> list[tuple[float, Correction]]:
    """Rate all changes that reduce the disagreement enough."""
    found = []
    channels = problem.channels
    before, shift = _disagreement(problem, z)
    for change in _possible_changes(problem):
        rows = [channels.names(change.side).index(name) for name in change.channel]
        mine = np.isin(np.array(channels.pairs)[:, change.side], rows)
        sure = mine & np.isfinite(shift)
        if change.kind == FACTOR:
            by = float(np.median(shift[sure])) if sure.any() else 0.0
            if abs(by) < SCALED:
                continue
            change = replace(change, factor=math.exp(by))
        after, _ = _disagreement(replace(problem, channels=change.apply(channels)), z)
        gain = float((before - after)[mine].sum())
        doubt = ASSUMED * (mine if change.kind == EXCHANGE else sure).sum()
        if gain > (doubt if change.known else 0.0):
            found.append((gain, change))
    return found


def _possible_changes(problem: Problem) -> Iterator[Correction]:
    for side, items in enumerate(problem.channels.transducer):
        yield from (Correction(EXCHANGE, side, two) for two in itertools.combinations(items, 2))
        yield from (Correction(FACTOR, side, (name,)) for name in items)
        for name, item in items.items():
            yield Correction(SIGN, side, (name,), -1.0, item.sign_known)


def _disagreement(problem: Problem, z: Array) -> tuple[Array, Array]:
    """Compare measured and computed functions, each by two numbers.

    One is the mean difference of ln magnitudes up to `LARGEST`, with heavily damped modes, less the
    mean cosine of the phase (0 where unknown). The other is the median difference of ln magnitudes,
    NaN where the phases do not agree either way.
    """
    heavy = z.copy()
    rows = []
    heavy[problem.parts[2]] = math.log(HEAVY)
    computed = zip(problem.readings(z), problem.readings(heavy), strict=True)
    for (value, damped), item in zip(computed, problem.channels.function, strict=True):
        level, own, other = (
            np.log(np.maximum(np.abs(part), item.uncertainty))
            for part in (item.value, value, damped)
        )
        clear = np.minimum(np.abs(value), np.abs(item.value)) > CLEAR * item.uncertainty
        turn = np.cos(np.angle(np.conj(value[clear]) * item.value[clear]))
        cosine = min(1.0, 5 * clear.mean()) * turn.mean() if clear.sum() > 3 else 0.0
        distance = np.minimum(np.abs(level - other), LARGEST).mean()
        shift = np.median(level - own) if abs(cosine) > SURE else np.nan
        rows.append((distance - cosine, shift))
    disagreement, shift = np.array(rows, dtype=float).T
    return disagreement, shift


NEAR = 0.03
"""Typical error of a computed frequency."""
FARTHEST = 0.9
"""Largest ln of measured over computed frequency of a peak that may belong to a mode."""
AGREES = 0.01
"""Relative difference of frequencies within which peaks of several functions are one resonance."""
ROUNDS = (1e-2, 1e-3, 1e-4)
"""Least relative uncertainty of a resonance in each round of assignment and search."""


class Resonance(NamedTuple):
    """A nominal mode in the functions: frequency, Hz, 1/Q, and number of functions with a peak."""

    mode: int
    frequency: float
    sigma: float
    damping: float
    functions: int


def assign_peaks(problem: Problem, z: Array) -> list[Resonance]:
    """Assign the peaks of all functions to modes; the weighted median stands for those of one."""
    one = problem.experiment[0]
    x = z[problem.parts[0]]
    plant = one.plant(x)
    back = np.argsort(one.order(x))
    found: dict[int, list[Peak]] = {}
    for own, some in zip(problem.residues(plant), problem.peaks, strict=True):
        for mode, peak in _pair(plant, own, some):
            found.setdefault(mode, []).append(peak)
    rows = []
    for mode, several in found.items():
        several.sort(key=lambda peak: peak.frequency)
        weight = np.cumsum([1 / (peak.sigma / peak.frequency + 1e-4) for peak in several])
        best = several[np.searchsorted(weight, weight[-1] / 2)]
        count = sum(abs(peak.frequency / best.frequency - 1) < AGREES for peak in several)
        rows.append(Resonance(int(back[mode]), best.frequency, best.sigma, best.damping, count))
    return sorted(rows)


def _pair(plant: Plant, own: Array, peaks: list[Peak]) -> list[tuple[int, Peak]]:
    """Assign peaks of a function to modes, whose residues are given."""
    from scipy.optimize import linear_sum_assignment

    frequency = plant.modes.frequency
    squared = plant.modes.omega_squared
    visible = np.flatnonzero((squared > 0) & (own != 0))
    if not len(visible) or not peaks:
        return []
    off = np.log(np.array([peak.frequency for peak in peaks])[:, None] / frequency[visible])
    size = np.log(np.abs([peak.residue for peak in peaks])[:, None] / np.abs(own[visible]))
    near = np.abs(off) < NEAR
    size = size - (np.median(size[near]) if near.any() else 0.0)
    # the tails of the density of computed frequencies go with the inverse square of the error
    cost = np.log1p((off / NEAR) ** 2) + 0.1 * np.minimum(size**2, 100.0)
    alone = np.log1p((FARTHEST / NEAR) ** 2)  # a peak of no mode
    pairs = linear_sum_assignment(np.hstack([cost, np.full((len(peaks), len(peaks)), alone)]))
    return [
        (int(visible[column]), peaks[row])
        for row, column in zip(*pairs, strict=True)
        if column < len(visible) and cost[row, column] < alone
    ]


def mismatch(problem: Problem, z: Array) -> float:
    """Sum over the peaks of all functions of ln(1 + r^2), r the relative error over `NEAR`.

    A peak without a mode counts as one at `FARTHEST`.
    """
    plant = problem.experiment[0].plant(z[problem.parts[0]])
    total = 0.0
    alone = np.log1p((FARTHEST / NEAR) ** 2)
    for own, some in zip(problem.residues(plant), problem.peaks, strict=True):
        pairs = _pair(plant, own, some)
        off = [np.log(peak.frequency / plant.modes.frequency[mode]) for mode, peak in pairs]
        total += float(np.log1p((np.array(off) / NEAR) ** 2).sum())
        total += alone * (len(some) - len(pairs))
    return total


def fit_resonances(problem: Problem, z: Array) -> Array:
    """Fit the parameters to the resonances; dampings follow from their widths."""
    one = problem.experiment[0]
    parts = problem.parts
    z = z.copy()
    matched = assign_peaks(problem, z)
    for least in ROUNDS if problem.count else ():
        modes = []
        for peak in matched:
            doubt = max(float(np.hypot(peak.sigma / peak.frequency, 0.1 * peak.damping)), least)
            sigma = peak.frequency * doubt
            label = one.labels[peak.mode]
            modes.append(Mode(frequency=peak.frequency, uncertainty=sigma, label=label))
        alone = Problem([replace(one, mode=modes)], problem.free, problem.shared, problem.base)
        # robust, as a peak may be of another mode
        z[parts[0]], _ = minimise(
            alone, z[parts[0]], loss="soft_l1", steps=30, tolerance=1e-2, held=True
        )
        matched = assign_peaks(problem, z)
    for peak in matched:
        z[parts[2]][problem.damped == peak.mode] = np.clip(np.log(peak.damping), np.log(1e-8), -0.1)
    return z
