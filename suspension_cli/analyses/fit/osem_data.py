"""Measured responses of all sensors to all coils of a stage, arranged by sensor and coil."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design.control import Osem
from suspension_cli.design.faults import suggest
from suspension_cli.design.schema import Design
from suspension_cli.errors import Fault, InputError, format_value
from suspension_cli.measurements.transfer_function import OSEM, MeasuredResponse

if TYPE_CHECKING:
    from jaxtyping import Complex, Float


@dataclass(frozen=True)
class OsemData:
    """Measured responses of all sensors to all coils of the OSEMs of a stage, SI.

    `sigma` is the standard deviation of real and imaginary part.
    """

    sensors: tuple[Osem, ...]
    coils: tuple[Osem, ...]
    frequency: Float[np.ndarray, " frequency"]
    value: Complex[np.ndarray, "frequency sensor coil"]
    sigma: Float[np.ndarray, "frequency sensor coil"]

    @property
    def stage(self) -> str:
        """The stage of all OSEMs."""
        return self.sensors[0].stage


def collect(design: Design, functions: Sequence[MeasuredResponse]) -> OsemData:
    """Arrange measured functions by sensor and coil.

    Raises `InputError` if the functions are not those of all sensors to all coils of one stage at
    the same frequencies, or have no uncertainty.
    """
    known = {} if design.control is None else {one.name: one for one in design.control.osem}
    if not known:
        problem = "has none, so there are no matrices to find"
        raise InputError.of("control.osem", problem, "add [[control.osem]] to the design")
    bad = [
        fault
        for n, item in enumerate(functions, 1)
        for fault in _faults(f"transfer_function.{n}", item, known)
    ]
    if bad:
        raise InputError(bad)
    pairs = {(_osem(item.output), _osem(item.input)): item for item in functions}
    sensors = [known[name] for name in dict.fromkeys(sensor for sensor, _ in pairs)]
    coils = [known[name] for name in dict.fromkeys(coil for _, coil in pairs)]
    places = dict.fromkeys((one.stage, one.reference) for one in (*sensors, *coils))
    if len(places) > 1:
        listed = " and ".join(f"{stage} ({reference})" for stage, reference in places)
        problem = f"has OSEMs of {listed}"
        raise InputError.of("transfer_function", problem, "give each stage a file of its own")
    if len(pairs) < len(functions):
        problem = "gives a sensor and a coil twice"
        raise InputError.of("transfer_function", problem, "keep one function of each pair")
    every = [(one.name, other.name) for one in sensors for other in coils]
    missing = [
        f"{OSEM}{one} over {OSEM}{other}" for one, other in every if (one, other) not in pairs
    ]
    if missing:
        more = f" and {len(missing) - 3} more" if len(missing) > 3 else ""
        problem = f"lacks {', '.join(missing[:3])}{more}"
        remedy = "matrices need the functions of all sensors to all coils"
        raise InputError.of("transfer_function", problem, remedy)
    grid = functions[0].frequency
    for n, item in enumerate(functions, 1):
        if not np.array_equal(item.frequency, grid):
            problem = f"{item.name} has other frequencies than {functions[0].name}"
            remedy = "give all functions the same frequencies, or the same band"
            raise InputError.of(f"transfer_function.{n}", problem, remedy)
    size = (len(sensors), len(coils), len(grid))
    ordered = [pairs[pair] for pair in every]
    value = np.reshape([item.value for item in ordered], size)
    sigma = np.reshape([item.uncertainty for item in ordered], size)
    order = (2, 0, 1)
    return OsemData(
        tuple(sensors), tuple(coils), grid, value.transpose(order), sigma.transpose(order)
    )


def _osem(name: str) -> str:
    return name.removeprefix(OSEM)


def _faults(key: str, item: MeasuredResponse, known: dict[str, Osem]) -> list[Fault]:
    """List what is wrong with one function: its names, or its uncertainty."""
    found = []
    for end, name in (("input", item.input), ("output", item.output)):
        if not name.startswith(OSEM):
            remedy = (
                f"write {OSEM}{next(iter(known))} for the {'coil' if end == 'input' else 'sensor'}"
            )
            problem = "is not an OSEM, between which --matrices needs all functions"
            found.append(Fault(f"{key}.{end}", problem, remedy, format_value(name)))
        elif _osem(name) not in known:
            remedy = suggest(_osem(name), list(known))
            problem = "names no [[control.osem]] of the design"
            found.append(Fault(f"{key}.{end}", problem, remedy, format_value(name)))
    sigma = np.asarray(item.uncertainty, dtype=float)
    if not (np.isfinite(sigma) & (sigma > 0)).all():
        problem = f"{item.name} gives no uncertainty at some frequencies, so they have no weight"
        remedy = "give uncertainty, or coherence above 0 and averages; or --relative-uncertainty"
        found.append(Fault(key, problem, remedy))
    return found
