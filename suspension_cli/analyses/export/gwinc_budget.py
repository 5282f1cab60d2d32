"""A noise budget of gwinc whose mirrors hang on a suspension that `pendsus` computed.

`pendsus export --format gwinc` writes this text beside the table of a design, so that the folder
needs numpy, scipy and gwinc alone. All that gwinc's noises know of a suspension is the result of
`gwinc.suspension.precomp_suspension`; those of this budget get that of the table instead. Of
`hForce` and `vForce`, which have a row for the upper and the lower joint of each stage from the
top, gwinc uses 4 k T |Im| / omega, which is the thermal noise of the table. The mirror's stage is
the last one of gwinc; if the chain is longer, gwinc's first stage has the noise of all above.
"""

from __future__ import annotations

import copy
import functools
import os
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator

INTERFEROMETER = "aLIGO"
"""One of gwinc, or the path of a budget or of parameters, whose mirrors hang on this suspension."""
Table = Mapping[str, np.ndarray]
"""`frequency` (f,), Hz; `horizontal_thermal` and `vertical_thermal` (f, 2 n), m/sqrt(Hz), of the
upper and lower joints of n stages; `horizontal`, `vertical` and `coupling` (f,), from the support's
x to the mirror's x, z to z and z to x; `susceptibility` (f,), m/N; `mass` of the mirror, kg; `name`
of the design."""


def interpolate(frequency: np.ndarray, value: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Interpolate columns (f, ...) to other frequencies, by logarithm of their size and phase."""
    known = np.log(frequency)
    wanted = np.log(at)
    size = PchipInterpolator(known, np.log(np.maximum(np.abs(value), 1e-300)))(wanted)
    phase = PchipInterpolator(known, np.unwrap(np.angle(value), axis=0))(wanted)
    return np.exp(size + 1j * phase) * value.any(axis=0)


def suspend(table: Table, interferometer: str, budget: str | None = None) -> type:
    """Make the class of the budget of an interferometer, by default of strain, with a table."""
    from gwinc import freq_from_spec, load_budget

    original = load_budget(interferometer, bname=budget)
    low, high = (float(table["frequency"][end]) for end in (0, -1))

    class Suspended(type(original)):
        name = f"{original.name} with {table['name']}"
        _freq = f"{low}:6000:{high}"  # where gwinc looks for the default

        def __init__(self, freq: Any = None, ifo: Any = None, **other: Any) -> None:
            freq = freq_from_spec(self._freq if freq is None else freq)
            check_band(table, freq)
            ifo = ifo or copy.deepcopy(original.ifo)
            ifo.Suspension.Stage[0].Mass = float(table["mass"])
            super().__init__(freq=freq, ifo=ifo, **other)
            for *_, item in self.walk():
                item._calc = functools.partial(_calculate, table, item, item._calc)

    return Suspended


def _calculate(table: Table, item: Any, original: Callable[..., Any], computed: Any = None) -> Any:
    """Calculate an item of a budget, with what was computed before; first the suspension."""
    from gwinc.suspension import precomp_suspension

    computed = {} if computed is None else computed
    if precomp_suspension not in computed:
        computed[precomp_suspension] = compute_suspension(table, item.freq, item.ifo)
    return original(computed)


def compute_suspension(table: Table, frequency: np.ndarray, ifo: Any) -> Any:
    """Compute the result of `gwinc.suspension.precomp_suspension` from a table.

    `vTable` includes the motion along the beam without coupling angle, `coupling`, as gwinc
    multiplies it by that angle.
    """
    from gwinc.const import kB
    from gwinc.suspension import getJointParams, precomp_suspension

    check_band(table, frequency)
    known = table["frequency"]
    at = np.clip(frequency, known[0], known[-1])
    found: Any = precomp_suspension(frequency, ifo)  # for its coupling angle
    angle = found.VHCoupling.theta
    found.hTable, found.vTable, found.tst_suscept, coupling = (
        interpolate(known, table[key], at)
        for key in ("horizontal", "vertical", "susceptibility", "coupling")
    )
    found.vTable = found.vTable + (coupling / angle if angle else 0.0)
    for key, noises in (("hForce", "horizontal_thermal"), ("vForce", "vertical_thermal")):
        density = np.abs(interpolate(known, table[noises], at)) ** 2
        force = np.zeros((2 * len(ifo.Suspension.Stage), len(at)), dtype=complex)
        for column, own in enumerate(density.T):
            stage, lower = divmod(column, 2)
            stage = max(stage + (len(force) - density.shape[1]) // 2, 0)
            temperature = getJointParams(ifo.Suspension, stage)[lower][1]
            force[2 * stage + lower] -= 2j * np.pi * at * own / (4 * kB * temperature)
        setattr(found, key, force)
    return found


def check_band(table: Table, frequency: np.ndarray) -> None:
    """Raise the error that gwinc prints, if the table does not have these frequencies."""
    low, high = table["frequency"][[0, -1]]
    if frequency.min() < low * (1 - 1e-9) or frequency.max() > high * (1 + 1e-9):
        raise RuntimeError(
            f"the table of {table['name']} has {low:g} to {high:g} Hz, and lacks some of"
            f" {frequency.min():g} to {frequency.max():g} Hz; export it again with --band"
        )


def __getattr__(name: str) -> type:
    """Make the budget that gwinc asks for by the name of this folder, or of one of its classes."""
    folder = os.path.dirname(os.path.abspath(__file__))
    file = os.path.join(folder, "suspension.npz")
    if name.startswith("__") or not os.path.exists(file):
        raise AttributeError(name)
    budget = None if name in (os.path.basename(folder), ".") else name
    return suspend(dict(np.load(file)), INTERFEROMETER, budget)
