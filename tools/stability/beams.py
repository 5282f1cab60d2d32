"""Beam functions of a wire under tension: overflow if slender, cancellation if stiff and slow."""

from __future__ import annotations

from typing import Any

import mpmath
import numpy as np

from suspension_cli.elements import beam, joined_sections
from tools.stability import naive
from tools.stability.row import SHIPPED, Row, relative

LENGTH, TENSION, MASS, FREQUENCY = 0.28, 13.7, 1.08e-4, 0.1
"""m, N, kg/m and Hz: a wire of Figure 6 of Husman et al. (2000), far below its pendulum mode."""
DIGITS = 120
SLENDERNESS = np.geomspace(1e-3, 1e5, 65)


def exact(rigidity: float) -> Any:
    """Dynamic stiffness (4, 4) of the wire from its boundary conditions, in 120 digits."""
    m = mpmath.mp.clone()
    m.dps = DIGITS
    ei, length = m.mpf(rigidity), m.mpf(LENGTH)
    tau, load = m.mpf(TENSION) / ei, m.mpf(MASS) * (2 * m.pi * m.mpf(FREQUENCY)) ** 2 / ei
    root = m.sqrt(tau**2 + 4 * load)
    waves = [
        m.sqrt((tau + root) / 2),
        -m.sqrt((tau + root) / 2),
        m.mpc(0, m.sqrt((root - tau) / 2)),
        m.mpc(0, -m.sqrt((root - tau) / 2)),
    ]
    # w = sum of c exp(r x); growing waves are scaled to 1 at the far end
    start = [m.exp(-r * length) if m.re(r) > 0 else m.mpf(1) for r in waves]
    stop = [m.mpf(1) if m.re(r) > 0 else m.exp(r * length) for r in waves]
    ends = m.matrix(
        [
            start,
            [r * a for r, a in zip(waves, start, strict=True)],
            stop,
            [r * b for r, b in zip(waves, stop, strict=True)],
        ]
    )
    force = m.matrix(
        [
            [(r**3 - tau * r) * a for r, a in zip(waves, start, strict=True)],
            [-(r**2) * a for r, a in zip(waves, start, strict=True)],
            [-(r**3 - tau * r) * b for r, b in zip(waves, stop, strict=True)],
            [r**2 * b for r, b in zip(waves, stop, strict=True)],
        ]
    )
    found = ei * force * m.inverse(ends)
    return np.array([[float(m.re(found[i, j])) for j in range(4)] for i in range(4)])


def shipped(rigidity: float) -> Any:
    """Dynamic stiffness (4, 4) of the wire by `elements.beam`, between its two ends."""
    omega = np.array([2 * np.pi * FREQUENCY])
    elements = beam.stiffness(rigidity, beam.waves(rigidity, TENSION, MASS, LENGTH / 2, omega))[
        :, 0
    ]
    matrix = np.zeros((4, 4, 1))
    for (i, j), value in zip(beam.ELEMENT_PLACES, elements, strict=True):
        matrix[i, j] = matrix[j, i] = value
    return joined_sections.to_ends(matrix)[..., 0]


def row(slenderness: Any = SLENDERNESS) -> Row:
    """Compute errors of the dynamic stiffness along L sqrt(T / EI)."""
    methods = {
        f"{SHIPPED}: halves, scaled, series": shipped,
        "cosh and sinh, 4 × 4 solve": lambda ei: naive.textbook_beam(
            ei, TENSION, MASS, LENGTH, 2 * np.pi * FREQUENCY
        ),
        "cosh and sinh, closed form": lambda ei: naive.howson_williams(
            ei, TENSION, MASS, LENGTH, 2 * np.pi * FREQUENCY
        ),
    }
    error: dict[str, list[float]] = {name: [] for name in methods}
    for value in slenderness:
        rigidity = float(TENSION * (LENGTH / value) ** 2)
        reference = exact(rigidity)
        for name, method in methods.items():
            error[name].append(float(relative(method(rigidity), reference).max()))
    return Row(
        title="Beam functions",
        driver="wire length × √(T / EI)",
        quantity="stiffness elements at 0.1 Hz",
        value=np.asarray(slenderness),
        error={name: np.array(values) for name, values in error.items()},
        finding=(
            "cosh and sinh of the whole wire overflow in a slender one, and their differences"
            " cancel in one that is stiff and slow. The program splits the motion into even and odd"
            " halves, uses tanh alone and sums a series where waves cancel."
        ),
        limit="none found",
        mark={"overflow of cosh": 710.0},
    )
