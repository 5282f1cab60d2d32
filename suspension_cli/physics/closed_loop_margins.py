"""Stability margins of loops from their closed-loop poles."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design.schema import Design
from suspension_cli.linear.solver import Solvable
from suspension_cli.linear.statespace import Poles
from suspension_cli.physics import local_control, margins
from suspension_cli.physics.closed_loop import find_poles
from suspension_cli.physics.local_control import Plant
from suspension_cli.physics.loop_network import Network
from suspension_cli.physics.margins import Margins, SensitivityPeak

if TYPE_CHECKING:
    from jaxtyping import Complex, Float


def find_margins(plant: Plant, closed: Poles) -> tuple[tuple[Margins, ...], SensitivityPeak]:
    """Find the margins of each loop and of all at once, from stable closed-loop poles."""
    corners = find_corner_frequencies(plant.network, closed.value)
    peak = margins.find_peak(partial(local_control.compute_sensitivity, plant), corners)
    return tuple(find_margins_of_loops(plant, closed)), peak


def find_margins_of_loops(plant: Plant, closed: Poles) -> list[Margins]:
    """Find the margins of each loop, from stable closed-loop poles."""
    corners = find_corner_frequencies(plant.network, closed.value)
    return margins.compute_margins(partial(local_control.compute_loop_gains, plant), corners)


def find_corner_frequencies(
    network: Network, poles: Complex[np.ndarray, " pole"]
) -> Float[np.ndarray, " frequency"]:
    """Find frequencies (Hz) of closed-loop poles (rad/s) and of roots of filters, and beside them.

    A resonance narrow in a loop gain L with the others closed is as near to a closed-loop pole,
    where 1 + L is 0, as it is wide.
    """
    filters = [node.filter.continuous for node in network.nodes]
    found = [root for one in filters for root in (*one.zeros, *one.poles)]
    every: Complex[np.ndarray, " root"] = np.append(poles / (2 * np.pi), found)
    every = every[np.abs(every) > 0]
    centre = np.abs(np.imag(every))
    width = np.abs(np.real(every))
    beside = [np.abs(centre + side * width) for side in (-3.0, -1.0, 0.0, 1.0, 3.0)]
    return np.unique(np.concatenate([np.abs(every), *beside]))


MARGINS = {"gain": "dB", "phase": "deg", "delay": "s", "distance": "1"}
"""Margins of a loop, with their units."""


def compute_margins(
    system: Solvable, design: Design
) -> tuple[bool, Float[np.ndarray, "loop margin"]]:
    """Compute whether a design is stable with its loops closed, and the `MARGINS` of all loops.

    Of the gain the smaller one; NaN if unstable. An infinite one means that nothing limits.
    """
    plant = local_control.build_plant(design, system)
    closed = find_poles(plant)
    if not closed.stable:
        return False, np.full((len(plant.loops), len(MARGINS)), np.nan)
    return True, tabulate_margins(find_margins_of_loops(plant, closed))


def tabulate_margins(found: Sequence[Margins]) -> Float[np.ndarray, "loop margin"]:
    """List the `MARGINS` of loops."""
    rows = [
        [min(one.gain_up_db, -one.gain_down_db), one.phase, one.delay, one.distance]
        for one in found
    ]
    return np.array(rows)
