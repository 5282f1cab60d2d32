"""Sensors and actuators of measurements in a model: their signals, and how modes appear in them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design.faults import suggest
from suspension_cli.design.measured import Measured
from suspension_cli.errors import Fault, InputError, format_value
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.signals import Signal, linear_form, parse_input, parse_output
from suspension_cli.linear.system import LinearSystem
from suspension_cli.measurements.transfer_function import TABLES, Channels

if TYPE_CHECKING:
    from jaxtyping import Inexact

Signals = tuple[tuple[Signal, ...], tuple[Signal, ...]]
"""Those of sensors, and those of actuators."""


def parse(channels: Channels, measured: Measured, known: tuple[str, ...]) -> Signals:
    """Find the signals of all channels among those of the bodies `known`.

    Raises `InputError` with all names that are neither a signal nor a channel of the file.
    """
    sides: list[tuple[Signal, ...]] = []
    bad = dict[Fault, None]()
    for side, (table, role) in enumerate(zip(TABLES, ("output", "input"), strict=True)):
        given = [one.name for one in getattr(measured, table)]
        found: dict[str, Signal] = {}
        for name, item in channels.transducer[side].items():
            for text in item.signals:
                try:
                    found[text] = (parse_input if side else parse_output)(text, known)
                except InputError as error:
                    fault, where, remedy = error.faults[0], f"{table}.{name}", ""
                    if name not in given:
                        where = f"{role} signal"
                        remedy = f"; or describe the channel by a [[{table}]]"
                        if given:
                            remedy = f"; or name a [[{table}]] ({suggest(name, given)})"
                    remedy = f"{fault.remedy}{remedy}"
                    bad[Fault(where, fault.problem, remedy, format_value(text))] = None
        sides.append(tuple(found[text] for text in channels.signal[side] if text in found))
    if bad:
        raise InputError(list(bad))
    return sides[0], sides[1]


def residues(
    channels: Channels, signals: Signals, model: LinearSystem, modes: Modes
) -> Inexact[np.ndarray, "function mode"]:
    """Compute the residues of the measured functions: H has residue/(omega_k^2 - omega^2).

    A motion of the support acts as the force of its stiffness.
    """
    parts = []
    for side, own in enumerate(signals):
        rows = [np.real(linear_form(signal, model)) for signal in own]
        for n, signal in enumerate(own):
            if side and not signal.acts:
                moved = model.driven_by_ground if signal.is_ground else model
                rows[n] = -np.real(moved.basis @ moved.stiffness @ rows[n])
        moving = np.array(rows).reshape(-1, model.size)[:, 6:] @ modes.shape.T
        parts.append(np.real(channels.weights(side, np.zeros(1))[0]) @ moving)
    return np.array([parts[0][one] * parts[1][other] for one, other in channels.pairs])
