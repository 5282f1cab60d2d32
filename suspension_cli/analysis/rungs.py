"""How far two rungs of the ladder are apart for one design."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from suspension_cli.analysis import modes
from suspension_cli.analysis.axes import Axis
from suspension_cli.analysis.coupling import Sweep
from suspension_cli.analysis.modes import Modes
from suspension_cli.analysis.tolerance import Tolerances
from suspension_cli.design import fibres, reader
from suspension_cli.design.schema import Design
from suspension_cli.models import fidelity, force
from suspension_cli.models.fidelity import Choice

PROBED = 3
"""Axes of a sweep at both ends of which rungs are compared, so 2 to this power of its builds."""
BUILDS = 32
"""Random builds that are compared."""
FREQUENCIES = 12
"""At how many frequencies."""
EDGE = 0.8
"""Share of a tolerance that strings may be seen to leave out there."""
MORE = {"beam": "bending of wires", "violin": "bending and mass of wires"}
"""What rungs have that strings have not."""


@dataclass(frozen=True)
class Apart:
    """The mode that two rungs differ most in: its label, and its frequency (Hz) on either."""

    label: str
    quick: float
    general: float

    @property
    def share(self) -> float:
        """Relative difference."""
        return self.quick / self.general - 1


def series_error(design: Design, quick: Modes) -> Apart | None:
    """What taking blades in series with angled wires costs, for a design on the force rung.

    Parameters
    ----------
    design : Design
    quick : Modes
        On the force rung.

    Returns
    -------
    Apart or None
        The worst mode against the string rung, modes paired by their shapes; None where the series is exact.
    """
    if not force.series_is_approximate(design):
        return None
    model = fidelity.linear_model(design, "string")
    general = modes.solve(model)
    count = quick.energy.shape[1] * 6
    mass = model.mass[6 : 6 + count, 6 : 6 + count]
    overlap = np.abs(quick.shape[:, :count] @ mass @ general.shape[:, :count].T)
    pair = overlap.argmax(1)
    pairs = [Apart(quick.label[n], float(quick.frequency[n]), float(general.frequency[pair[n]])) for n in range(len(pair))]
    finite = [item for item in pairs if np.isfinite(item.share) and item.general > 0]
    return max(finite, key=lambda item: abs(item.share), default=None)


def coupling_error(job: Sweep) -> tuple[str, float]:
    """What couplings of a sweep on `string` leave out: bending, torsion and loss of wires, and their mass.

    Parameters
    ----------
    job : Sweep
        On `string`.

    Returns
    -------
    rung : str
        The highest that the design says enough for, `violin` or `beam`; "" if neither.
    error : float
        How much it changes the ratio, of the largest ratio of the builds at the ends of the axes; NaN if that is not known, as there is no such rung, or as
        a build hangs on one of both rungs and not on the other, or none does on either.
    """
    design = reader.parse(job.text)
    rung = next((level for level in ("violin", "beam") if not fibres.unsuited(design, massive=level == "violin")), "")
    if not rung:
        return "", float("nan")
    axes = tuple(Axis(axis.name, tuple(dict.fromkeys((axis.values[0] if n < PROBED else axis.values[-1], axis.values[-1])))) for n, axis in enumerate(job.axes))
    asked = job.question.frequency
    some = tuple(asked[n] for n in np.unique(np.linspace(0, len(asked) - 1, min(FREQUENCIES, len(asked))).astype(int)))
    probe = replace(job, axes=axes, question=replace(job.question, frequency=some))
    old, new = (np.asarray(one.compute(0, one.count)["ratio"]) for one in (probe, replace(probe, level=rung)))
    return rung, float("nan") if (np.isfinite(new) != np.isfinite(old)).any() else _of_largest(old, new)


def scatter_error(job: Tolerances) -> float:
    """What the couplings of random builds on `string` leave out by the bending, torsion and loss of wires, of the largest of the first builds.

    NaN if that is not known, as the design says nothing of its wires or none of these builds hangs on either rung.
    """
    if fibres.unsuited(job.design, massive=False):
        return float("nan")
    first = min(job.count, BUILDS)
    old, new = (np.asarray(one.compute(0, first)["ratio"]) for one in (job, replace(job, level="beam")))
    return _of_largest(old, new)


def _of_largest(old: Any, new: Any) -> float:
    """The largest change of ratios, of the largest of them, among builds that hang on both rungs; NaN if there is none."""
    known = np.isfinite(old) & np.isfinite(new)
    if not known.any():
        return float("nan")
    largest, change = (float(np.abs(ratio[known]).max()) for ratio in (new, old - new))
    return change / largest if largest > 0 else 0.0 if change == 0 else float("inf")


def weighed(job: Sweep, choice: Choice, tolerance: float | None) -> tuple[Sweep, Choice, str]:
    """A sweep on strings, or on the rung that a tolerance asks for, with what that leaves out.

    Parameters
    ----------
    job : Sweep
    choice : Choice
        Of `string`.
    tolerance : float or None
        Of the largest coupling; None takes strings whatever they leave out.

    Returns
    -------
    job : Sweep
    choice : Choice
    higher : str
        The rung that has what strings leave out; "" if the design does not say enough for one.
    """
    higher, error = coupling_error(job)
    if higher and tolerance is not None and error > EDGE * tolerance:
        reason = f"for {MORE[higher]} ({error:.1g} of the largest coupling); tolerance {tolerance:g}"
        return replace(job, level=higher), Choice(higher, reason, 0.0 if higher == "violin" else math.nan), higher
    if not higher:
        left = "unknown, as wires lack material or cross-section: their bending"
    elif math.isnan(error):
        left = f"unknown, as not all builds at the ends of the axes hang both on string and on {higher}: {MORE[higher]}"
    else:
        left = f"left out: {MORE[higher]} ({error:.1g} of the largest coupling)"
    return job, replace(choice, error=error, reason=f"{choice.reason}; {left}"), higher
