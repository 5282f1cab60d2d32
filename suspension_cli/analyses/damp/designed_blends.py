"""Complementary filters that are found for blends, from the noise of two sensors."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design import noise_spectra, reader
from suspension_cli.design.foton import format_filter
from suspension_cli.design.loop_sensors import REST
from suspension_cli.errors import InputError, suggest
from suspension_cli.files.declared import in_unit
from suspension_cli.physics import blends

if TYPE_CHECKING:
    from suspension_cli.analyses.analysis import Run
    from suspension_cli.design.control import Control
    from suspension_cli.design.loop_sensors import Sensor
    from suspension_cli.physics.blends import Blend
    from suspension_cli.scene.arrays import Array

BAND = (1e-3, 100.0)
"""Frequencies, Hz, over which noise without a table is taken."""
POINTS = 400
"""Frequencies at which the ratio of noises is fitted."""


@dataclass(frozen=True)
class DesignedBlend:
    """Complementary filters that were found.

    Attributes
    ----------
    blended
        Name of the computed sensor.
    first, second
        Names of the two sensors.
    bound
        Largest square root of |K|^2 r^2 + |1 - K|^2 / r^2, with the filter K of the first sensor
        and the ratio r of its noise over that of the second.
    crossing
        Frequency where both sensors count alike, Hz.
    poles
        Number of poles of either filter.
    misfit
        Largest relative error of the fit of r.
    largest
        Where r or 1/r is larger, it counts as this.
    """

    blended: str
    first: str
    second: str
    bound: float
    crossing: float = field(metadata=in_unit("Hz"))
    poles: int
    misfit: float
    largest: float


def solve(run: Run) -> tuple[Run, tuple[DesignedBlend, ...]]:
    """Find the filters of blends; return the run of the design with them."""
    control = run.design.control
    own = [] if control is None else [one for one in control.sensor if one.blend]
    known = [one.name for one in own]
    if control is None or not own:
        remedy = "give one blend = true and two inputs"
        raise InputError.of("control.sensor", "has no blend of two sensors", remedy)
    names = run.setting["redesigned"] or known
    raw = tomllib.loads(run.source.text)["control"]["sensor"]
    done = []
    for name in names:
        if name not in known:
            raise InputError.of("--redesign", "names no blend", suggest(name, known), name)
        sensor = own[known.index(name)]
        first, second = _find_inputs(sensor, control)
        frequency, *noises = _evaluate(first, second)
        found = blends.solve(frequency, *noises, run.setting["order"])
        if found is None:
            problem = "no accurate complementary filters were found"
            raise InputError.of(f"control.sensor.{name}", problem, "try another --order")
        [table] = [one for one in raw if one["name"] == name]
        filters = [format_filter(found.filter), REST]
        if not found.of_first:
            filters.reverse()
        table["inputs"] = [
            {"sensor": one.name, "filter": made}
            for one, made in zip((first, second), filters, strict=True)
        ]
        done.append(_describe(name, first, second, found, frequency))
    source = reader.replaced(run.source, {"control.sensor": raw})
    return replace(run, source=source), tuple(done)


def _find_inputs(sensor: Sensor, control: Control) -> tuple[Sensor, Sensor]:
    """Find the two sensors of a blend; raises `InputError` if they are not two with noise."""
    key = f"control.sensor.{sensor.name}.inputs"
    named = {one.name: one for one in control.sensor}
    read = [named[one.sensor] for one in sensor.inputs if one.sensor is not None]
    if len(read) != 2 or len(sensor.inputs) != 2:
        problem = f"has {len(sensor.inputs)} inputs, but filters are found for two sensors"
        raise InputError.of(key, problem, "blend two sensors")
    for one in read:
        where = f"control.sensor.{one.name}"
        if one.motion is None or one.response is not None:
            problem = "is computed, or has a response, and noise alone decides on the filters found"
            raise InputError.of(where, problem, "blend two sensors that read motions as they are")
        if not one.sensor_noise:
            raise InputError.of(f"{where}.sensor_noise", "is 0, so all is read by it", "give noise")
    return read[0], read[1]


def _evaluate(first: Sensor, second: Sensor) -> tuple[Array, Array, Array]:
    """Evaluate two noises where both are known: frequencies in Hz, noise of either sensor."""
    spans = [_find_span(one) for one in (first, second)]
    low = max(span[0] for span in spans)
    high = min(span[1] for span in spans)
    if not 10 * low <= high:
        problem = f"is known from {low:g} Hz, that of {second.name} to {high:g} Hz"
        remedy = "give spectra that overlap over a decade"
        raise InputError.of(f"control.sensor.{first.name}.sensor_noise", problem, remedy)
    frequency = np.geomspace(low, high, POINTS)
    noises = [noise_spectra.density(one.sensor_noise, frequency) for one in (first, second)]
    return frequency, noises[0], noises[1]


def _find_span(sensor: Sensor) -> tuple[float, float]:
    """Lowest and highest frequency of a spectrum, Hz; `BAND` for one that has no table."""
    points = noise_spectra.frequencies(sensor.sensor_noise)
    return (points[0], points[-1]) if points else BAND


def _describe(
    name: str, first: Sensor, second: Sensor, found: Blend, frequency: Array
) -> DesignedBlend:
    """Describe filters that were found."""
    made = found.filter.at(frequency)
    alike = np.abs(np.log(np.abs(made / (1 - made)))).argmin()
    return DesignedBlend(
        name,
        first.name,
        second.name,
        found.bound,
        float(frequency[alike]),
        len(found.filter.poles),
        found.misfit,
        found.largest,
    )
