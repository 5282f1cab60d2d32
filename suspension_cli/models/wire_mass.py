"""Effect of wire mass: first violin modes, and the change of thermal noise.

A wire is a string but for its ends. Held above and moved by x below at omega, its slope is k x /
sin(k L) at the upper end and k x cos(k L) / sin(k L) at the lower one, with k L = pi f / f1 and f1
= sqrt(T / mu) / (2 L) its first violin mode (any text on vibrations). Loss acts where it bends, at
its ends, and goes with the square of the slope there. With X = k L,

    upper: (x/L)^2 (1 + X^2/3 + ...),    lower: (x/L)^2 (1 - 2 X^2/3 + ...),    mean: (x/L)^2 (1 -
    X^2/6 + ...),

so without mass the amplitude of the sum is too large by X^2/12 = 0.82 (f/f1)^2, and that of one end
wrong by up to 3.3 (f/f1)^2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from suspension_cli.design.schema import Design
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.scene import fibres
from suspension_cli.scene.composition import Fibre

TOLERANCE = 1e-3
BELOW = 0.03
"""Of the lowest first violin mode: up to here neglecting mass costs less than `TOLERANCE`."""
VALID = 0.7
"""Of the lowest first violin mode: above it the series is not valid."""
ERROR = np.pi**2 / 12
"""Relative error of the amplitude without mass, over (f/f1)^2."""


@dataclass(frozen=True)
class NoiseEffect:
    """Effect of wire mass on thermal noise up to some frequency.

    Attributes
    ----------
    error : float
        Relative error of the amplitude of the sum without mass; infinite near violin modes.
    load : float
        Largest ratio of a third of the wires' mass to the mass that they hold.
    highest, lowest : float
        That frequency and the lowest first violin mode, Hz.
    wire : str
        The wire that has it; "" if none has one.
    """

    error: float
    load: float
    highest: float
    lowest: float
    wire: str

    @property
    def fraction(self) -> float:
        """The frequency over the lowest first violin mode."""
        return self.highest / self.lowest

    @property
    def where(self) -> str:
        """The frequency compared with the violin mode, in words."""
        return (
            f"as {self.highest:.4g} Hz is {float(f'{100 * self.fraction:.2g}'):g} % of the lowest"
            f" first violin mode ({self.lowest:.4g} Hz, wire {self.wire})"
        )


def effect_on_noise(design: Design, highest: float) -> NoiseEffect:
    """Estimate the change of thermal noise by wire mass, up to a frequency in Hz."""
    lowest, wire = first_violin(design)
    load = _load(design) if wire else 0.0
    fraction = highest / lowest
    error = max(ERROR * fraction**2, load) if fraction < VALID else np.inf
    return NoiseEffect(error, load, highest, lowest, wire)


def _load(design: Design) -> float:
    """Largest ratio of a third of the wires' mass to the mass that they hold.

    By so much a swinging wire adds to the inertia of its body.
    """
    made = fibres.compose(design).wire
    scene = expand(design)
    total = np.zeros(len(scene.bodies.name))
    for number, fibre in enumerate(made):
        total[scene.wires.lower[number] - 1] += sum(
            section.length * section.mass for section in fibre.sections
        )
    return float((total / 3 / scene.bodies.mass).max(initial=0.0))


def first_violin(design: Design) -> tuple[float, str]:
    """Lowest first violin mode (Hz) of all wires, as strings, and the name of that wire.

    Infinite and "" without wires.

    Parameters
    ----------
    design : Design
        With a cross-section and a density for every wire.

    Returns
    -------
    frequency : float
        sqrt(T / mu) / (2 L) with the mean mass per length mu, Hz.
    wire : str
    """
    wires = expand(design).wires
    made = fibres.compose(design).wire
    found = [
        (first_violin_of(fibre, float(wires.tension[number])), fibre.label)
        for number, fibre in enumerate(made)
    ]
    return min(found, key=lambda pair: pair[0], default=(np.inf, ""))


def first_violin_of(fibre: Fibre, tension: float) -> float:
    """First violin mode of one wire as a string, sqrt(T / m_w / l) / 2 in Hz; 0 if it is slack."""
    mass, length = (
        sum(s.mass * s.length for s in fibre.sections),
        sum(s.length for s in fibre.sections),
    )
    return float(np.sqrt(max(tension, 0.0) / (mass * length))) / 2 if mass > 0 else np.inf
