"""Poles of exported closed loops, beside those of the complete equations."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from suspension_cli.errors import InputError
from suspension_cli.files.declared import along, in_unit
from suspension_cli.files.documents import Layout
from suspension_cli.linear import statespace
from suspension_cli.linear.statespace import Poles, StateSpace
from suspension_cli.physics import closed_loop

if TYPE_CHECKING:
    from jaxtyping import Bool, Float


@dataclass(frozen=True)
class ComparedPoles:
    """Closed-loop poles of the complete equations, and of an exported system.

    Attributes
    ----------
    state
        The state that takes most part in each.
    frequency, q
        By the complete equations (`pendsus damp`), Hz: abs(p) / 2 pi, abs(p) / (-2 Re p).
    exported_frequency, exported_q
        Of the exported system.
    difference
        Distance of both over abs(p).
    """

    in_json: ClassVar = Layout(
        rows={"pole": ""},
        names={"frequency": "frequency_hz", "exported_frequency": "exported_frequency_hz"},
    )
    state: tuple[str, ...] = field(metadata=along("pole"))
    frequency: Float[np.ndarray, " pole"] = field(metadata=in_unit("Hz"))
    q: Float[np.ndarray, " pole"]
    exported_frequency: Float[np.ndarray, " pole"] = field(metadata=in_unit("Hz"))
    exported_q: Float[np.ndarray, " pole"]
    difference: Float[np.ndarray, " pole"]

    def largest(self, highest: float) -> tuple[float, int]:
        """Largest difference of a pole up to a frequency (Hz), and its number."""
        own = np.where(self.frequency <= highest, self.difference, 0.0)
        return float(own.max(initial=0.0)), int(own.argmax()) if len(own) else 0

    def q_error(self, band: tuple[float, float]) -> float:
        """Largest relative error of the Q of a pole in a band (Hz) that oscillates."""
        some = self._oscillates(band)
        ratio = np.abs(np.log(self.exported_q[some] / self.q[some]))
        return float(np.expm1(ratio.max(initial=0.0)))

    def _oscillates(self, band: tuple[float, float]) -> Bool[np.ndarray, " pole"]:
        """Which poles of a band oscillate, and decay, by both."""
        inside = (self.frequency >= band[0]) & (self.frequency <= band[1])
        both = np.minimum(self.q, self.exported_q)
        return inside & (both > 0.5) & np.isfinite(np.maximum(self.q, self.exported_q))


def compare(system: StateSpace, complete: Poles) -> ComparedPoles:
    """Compare the poles of an exported system with the complete ones nearest to them."""
    from scipy.optimize import linear_sum_assignment

    found, _ = statespace.find_poles(system)
    moving = np.flatnonzero(complete.value)  # others are those of free coordinates
    expected = complete.value[moving]
    apart = np.abs(found.value[None, :] / expected[:, None] - 1)
    rows, columns = linear_sum_assignment(np.log(apart + 1e-16))
    chosen = moving[rows]
    return ComparedPoles(
        state=tuple(complete.state[n] for n in chosen),
        frequency=complete.frequency[chosen],
        q=complete.q[chosen],
        exported_frequency=found.frequency[columns],
        exported_q=found.q[columns],
        difference=apart[rows, columns],
    )


def agree_in_stability(system: StateSpace, complete: Poles) -> bool:
    """Whether a system grows if, and only if, the complete closed loop does."""
    return statespace.find_poles(system)[0].stable == complete.stable


def demand_same_stability(system: StateSpace, complete: Poles, remedy: str) -> None:
    """Raise `InputError` if either an exported system or the complete closed loop grows."""
    found, _ = statespace.find_poles(system)
    if found.stable == complete.stable:
        return
    if complete.stable:
        where, _ = closed_loop.describe_growth(found)
        problem = f"the exported system would be unstable, but the closed loop is not: {where}"
    else:
        where, _ = closed_loop.describe_growth(complete)
        problem = f"the exported system would be stable, but the closed loop is not: {where}"
    raise InputError.of("--closed-loop", problem, remedy)
