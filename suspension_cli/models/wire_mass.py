"""Which rung thermal noise needs: whether the mass of wires counts at the frequencies asked for.

A wire is a string to all but its ends.  Held above and moved by x below at omega, its slope is k x / sin(k L) at the upper end and
k x cos(k L) / sin(k L) at the lower one, with k L = pi f / f1 and f1 = sqrt(T / mu) / (2 L) its first violin mode (any text on vibrations).
Loss sits where it bends, at its ends, and goes with the square of the slope there.  With X = k L,

    upper: (x/L)^2 (1 + X^2/3 + ...),    lower: (x/L)^2 (1 - 2 X^2/3 + ...),    mean: (x/L)^2 (1 - X^2/6 + ...),

so leaving mass out makes the amplitude of the sum too large by X^2/12 = 0.82 (f/f1)^2, that of one end wrong by up to 3.3 (f/f1)^2.
"""

from __future__ import annotations

import numpy as np

from suspension_cli.design import fibres
from suspension_cli.design.fibres import Fibre
from suspension_cli.design.schema import Design
from suspension_cli.errors import Fault, InputError, shown
from suspension_cli.mechanics.nominal import expand
from suspension_cli.models.fidelity import Choice

WHERE = ("auto", "beam", "violin")
"""Levels of fidelity that know where along a wire its loss sits."""
TOLERANCE = 1e-3
BELOW = 0.03
"""Of the lowest first violin mode: up to here leaving mass out costs less than `TOLERANCE`."""
VALID = 0.7
"""Of the lowest first violin mode: above it the series does not hold."""
ERROR = np.pi**2 / 12
"""Relative error of the amplitude that this makes, over (f/f1)^2."""


def choose(design: Design, wanted: str, highest: float, tolerance: float = TOLERANCE) -> Choice:
    """The rung for the thermal noise of a design.

    Parameters
    ----------
    design : Design
    wanted : str
        One of `fidelity.LEVELS`.
    highest : float
        The highest frequency asked for, Hz.
    tolerance : float
        Relative error that ``auto`` may leave, away from resonances.

    Raises
    ------
    InputError
        If the rung does not know where loss sits, or the design does not say what its wires are.
    """
    if wanted not in WHERE:
        raise InputError([Fault("--fidelity", "does not know where along a wire its loss sits", "take auto, beam or violin", shown(wanted))])
    _demand(design, massive=False)
    if wanted == "beam" and fibres.unsuited(design, massive=True):
        return Choice("beam", "as asked; wires are without mass")
    _demand(design, massive=True)
    if wanted == "violin":
        return Choice("violin", "as asked", 0.0)
    lowest, wire = first_violin(design)
    if wire == "":
        return Choice("beam", "no wire has a violin mode", 0.0)
    share, heavy = highest / lowest, _heaviest(design)
    error = max(ERROR * share**2, heavy) if share < VALID else np.inf
    if wanted == "beam":
        size = f"by {error:.1g}" if np.isfinite(error) else f"near and above {lowest:.4g} Hz, the first violin mode of wire {wire}, by any amount"
        return Choice("beam", f"as asked; wires are without mass, which changes the sum {size}", error)
    if heavy > tolerance:
        return Choice("violin", f"the mass of wires counts, as a third of it is {heavy:.1g} of the mass that hangs on them", 0.0)
    first = f"the lowest first violin mode ({lowest:.4g} Hz, wire {wire})"
    if share > BELOW * (tolerance / TOLERANCE) ** 0.5:
        return Choice("violin", f"the mass of wires counts, as {highest:.4g} Hz is {100 * share:.3g} % of {first}", 0.0)
    return Choice("beam", f"wires are without mass, which changes the sum by {error:.1g}, as {highest:.4g} Hz is {100 * share:.2g} % of {first}", error)


def _heaviest(design: Design) -> float:
    """The largest share that a third of the wires' mass makes of the mass that they hold: by so much they load it when it swings."""
    made = fibres.fibres(design).wire
    scene = expand(design)
    total = np.zeros(len(scene.bodies.name))
    for number, fibre in enumerate(made):
        total[scene.wires.lower[number] - 1] += sum(section.length * section.mass for section in fibre.sections)
    return float((total / 3 / scene.bodies.mass).max(initial=0.0))


def first_violin(design: Design) -> tuple[float, str]:
    """Lowest first violin mode of all wires, as strings, and the name of that wire; infinite and "" without wires.

    Parameters
    ----------
    design : Design
        With a cross-section and a density for every wire.

    Returns
    -------
    frequency : float
        sqrt(T / mu) / (2 L) with the mean mass a length, Hz.
    wire : str
    """
    wires = expand(design).wires
    made = fibres.fibres(design).wire
    found = [(first_violin_of(fibre, float(wires.tension[number])), fibre.label) for number, fibre in enumerate(made)]
    return min(found, key=lambda pair: pair[0], default=(np.inf, ""))


def first_violin_of(fibre: Fibre, tension: float) -> float:
    """First violin mode of one wire as a string, Hz: sqrt(T / m_w / l) / 2; 0 if it is slack."""
    mass, length = sum(s.mass * s.length for s in fibre.sections), sum(s.length for s in fibre.sections)
    return float(np.sqrt(max(tension, 0.0) / (mass * length))) / 2 if mass > 0 else np.inf


def _demand(design: Design, *, massive: bool) -> None:
    """Raise `InputError` unless every wire has all that the model takes."""
    why = fibres.unsuited(design, massive)
    if why:
        remedy = "give its material's density, or take --fidelity beam" if massive else "give its material and radius or section, for its loss"
        raise InputError([Fault("stage", why, remedy)])
