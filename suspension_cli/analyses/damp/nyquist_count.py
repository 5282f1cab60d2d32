"""Number of growing closed-loop poles by the argument principle, delays exact.

State spaces approximate a delay, so poles found from them may be incomplete. D = det(1 + H G) has
the closed-loop poles as zeros and the open-loop ones as poles, and is 1 far above all of them. From
i 0+ to i infinity its phase grows by pi/2 (P0 - Z0) + pi (P - Z), with P poles and Z zeros in the
right half plane and P0 - Z0 more poles than zeros at 0, where |D| rises with that power of
1 / omega (Nyquist's criterion; Astrom and Murray, Feedback Systems, 2nd ed., section 10.2).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from suspension_cli.analyses.damp import control, margins
from suspension_cli.analyses.damp.control import Plant
from suspension_cli.errors import Fault, InputError
from suspension_cli.linear.poles import Poles

FAINT = 1e-6
"""Distance of D from 1 below which its phase is not followed."""
LITTLE = 1e-10
"""Decay rate added to all open-loop poles, over the smallest modulus of a pole."""
NEAR = 1e-8
"""Real part of a pole over its modulus below which its sign is uncertain; also the relative shift
below which no loop moves a pole."""


def check_stable(plant: Plant, closed: Poles, opened: Poles) -> None:
    """Raise `InputError` if a closed loop without known growing poles has some."""
    counted = count_growing(plant, closed, opened)
    if counted:
        problem = f"{counted} poles of the closed loop grow, but their frequencies were not found"
        remedy = "shorten the delays, or lower the gain where they turn the phase"
        raise InputError([Fault("control", problem, remedy)])


def count_growing(plant: Plant, closed: Poles, opened: Poles) -> int | None:
    """Count closed-loop poles in the right half plane, both of a pair; None if uncertain."""
    every = np.concatenate([closed.value, opened.value])
    every = every[np.abs(every) > 0]
    moved = closed.value[np.abs(closed.value) > 0]
    apart = np.abs(moved[:, None] - opened.value).min(1, initial=np.inf)
    moved = moved[apart > NEAR * np.abs(moved)]  # others are no zeros of D
    if (np.abs(np.real(moved)) <= NEAR * np.abs(moved)).any():
        return None
    # a little damping moves lossless open-loop poles off the path
    model, rate = plant.model, LITTLE * np.abs(every).min()
    plant = replace(plant, model=replace(model, damping=model.damping + 2 * rate * model.mass))
    filters = [loop.controller_and_sensor for loop in plant.loops]
    roots = np.array([pole for one in filters for pole in (*one.zeros, *one.poles)])
    corners = np.concatenate([every / (2 * np.pi), roots[np.abs(roots) > 0]])
    corners = np.unique(np.concatenate([np.abs(corners), np.abs(corners.imag)]))

    def gain(frequency: np.ndarray) -> np.ndarray:
        return 1 / np.linalg.det(control.compute_sensitivity(plant, frequency))[:, None] - 1

    frequency, value = margins.refine_grid(gain, corners[corners > 0], faint=FAINT)
    value = 1 + value[:, 0]
    turns = np.angle(value[1:] / value[:-1])
    if np.abs(turns).max() > 2 * margins.STEP:
        return None
    slope = np.log(np.abs(value[1] / value[0])) / np.log(frequency[1] / frequency[0])
    at_zero = -round(float(slope))
    unstable = sum(pole.real < 0 for one in filters for pole in one.poles)
    return round(count_found(opened) + unstable + at_zero / 2 - float(turns.sum()) / np.pi)


def count_found(found: Poles) -> int:
    """Count poles that grow, both of each pair."""
    grows = found.growth_rate > 0
    return int(np.where(np.imag(found.value) != 0, 2, 1)[grows].sum())
