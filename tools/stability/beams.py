"""Bending of a wire under tension: overflow, cancellation, and short sections joined to long."""

from __future__ import annotations

from typing import Any

import mpmath
import numpy as np

from suspension_cli.elements import joined_sections, tensioned_beam
from tools.stability import naive
from tools.stability.row import SHIPPED, Row, sample

LENGTH, TENSION, MASS, FREQUENCY = 0.28, 13.7, 1.08e-4, 0.1
"""m, N, kg/m and Hz: a wire of Figure 6 of Husman et al. (2000), far below its pendulum mode."""
DIGITS = 120
_OMEGA = np.array([2 * np.pi * FREQUENCY])
SLENDERNESS = np.geomspace(1e-3, 1e5, 65)


def exact(rigidity: float) -> Any:
    """Dynamic stiffness (4, 4) of the wire from its boundary conditions, in 120 digits."""
    return _rounded(_exact(rigidity, MASS, LENGTH))


def _rounded(matrix: Any) -> Any:
    return np.array([[float(matrix[i, j].real) for j in range(4)] for i in range(4)])


def _exact(rigidity: float, mass: float, total: float) -> Any:
    m = mpmath.mp.clone()
    m.dps = DIGITS
    ei, length = m.mpf(rigidity), m.mpf(total)
    tau, load = m.mpf(TENSION) / ei, m.mpf(mass) * (2 * m.pi * m.mpf(FREQUENCY)) ** 2 / ei
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
    return ei * force * m.inverse(ends)


def shipped(rigidity: float) -> Any:
    """Dynamic stiffness (4, 4) of the wire by `elements.tensioned_beam`, between its two ends."""
    return _between_ends(rigidity, MASS, LENGTH)


def _between_ends(rigidity: float, mass: float, length: float) -> Any:
    return _by_sections([(rigidity, mass, length)])


def _by_sections(sections: list[tuple[float, float, float]]) -> Any:
    """Dynamic stiffness (4, 4) between the ends of sections (EI, mass, length) as shipped."""
    ei, mass, lengths = (np.array(column)[:, None] for column in zip(*sections, strict=True))
    elements = tensioned_beam.stiffness(
        ei, tensioned_beam.waves(ei, TENSION, mass, lengths / 2, _OMEGA)
    )
    parts = np.zeros((4, 4, *elements[0].shape))
    for (i, j), value in zip(tensioned_beam.ELEMENT_PLACES, elements, strict=True):
        parts[i, j] = parts[j, i] = value
    tensions, length = np.full(lengths.shape, TENSION), lengths.sum()
    whole = joined_sections.join(parts, tensions, lengths).stiffness[..., 0]
    whole[2, 2] += TENSION * length
    chord = np.array([-1, 0, 1, 0]) / length
    form = np.array([[0.5, 0, 0.5, 0], [0, -0.5, 0, 0.5], chord, [0, 0.5, 0, 0.5] - chord])
    return form.T @ whole @ form


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

    def compute(value: float) -> Any:
        rigidity = TENSION * (LENGTH / value) ** 2
        return exact(rigidity), {name: method(rigidity) for name, method in methods.items()}

    return Row(
        title="Beam functions",
        driver="wire length × √(T / EI)",
        quantity="stiffness elements at 0.1 Hz",
        value=np.asarray(slenderness),
        error=sample(slenderness, compute),
        finding=(
            "cosh and sinh overflow in a slender wire and cancel in a stiff one. The program"
            " takes even and odd halves, tanh alone, and series."
        ),
        limit="none found",
        mark={"overflow of cosh": 710.0},
    )


MODULUS, DENSITY = 7.2e10, 2200.0
"""Of fused silica, Pa and kg/m^3."""
RADII = 1.5e-3, 0.2e-3
"""Of a short end and of the fibre below it, m."""


def _sections(length: float) -> list[tuple[float, float, float]]:
    """EI, mass per length and length of a thick end of a given length, and of the fibre."""
    return [
        (MODULUS * np.pi * radius**4 / 4, DENSITY * np.pi * radius**2, own)
        for radius, own in zip(RADII, (length, LENGTH), strict=True)
    ]


def _exact_joined(length: float) -> Any:
    """Dynamic stiffness (4, 4) of a fibre with a thick end between its ends, in 120 digits."""
    upper, lower = (_exact(*section) for section in _sections(length))
    m = upper.ctx
    both = m.zeros(6)
    for part, start in ((upper, 0), (lower, 2)):
        for i in range(4):
            for j in range(4):
                both[start + i, start + j] += part[i, j]
    ends, node = [0, 1, 4, 5], [2, 3]
    pick = lambda rows, columns: m.matrix([[both[i, j] for j in columns] for i in rows])  # noqa: E731
    return _rounded(
        pick(ends, ends) - pick(ends, node) * m.inverse(pick(node, node)) * pick(node, ends)
    )


def _joined(length: float) -> Any:
    """Dynamic stiffness (4, 4) of a fibre with a thick end, by `elements.joined_sections`."""
    return _by_sections(_sections(length))


def _eliminated(length: float) -> Any:
    """Dynamic stiffness (4, 4) of it, by elimination of the deflection and slope of the node."""
    both = np.zeros((6, 6))
    for (ei, mass, own), start in zip(_sections(length), (0, 2), strict=True):
        both[start : start + 4, start : start + 4] += _between_ends(ei, mass, own)
    ends, node = np.ix_([0, 1, 4, 5], [2, 3]), np.ix_([2, 3], [2, 3])
    rest = both[np.ix_([0, 1, 4, 5], [0, 1, 4, 5])]
    return rest - both[ends] @ np.linalg.solve(both[node], both[ends].T)


def short_sections(lengths: Any = None) -> Row:
    """Compute errors of a fibre with a thick end along the length of that end."""
    lengths = np.geomspace(1e-2, 1e-7, 41) if lengths is None else np.asarray(lengths)
    methods = {
        f"{SHIPPED}: chord, slopes relative to it": _joined,
        "stiffnesses between the ends, node eliminated": _eliminated,
    }

    def compute(length: float) -> Any:
        return _exact_joined(length), {name: method(length) for name, method in methods.items()}

    rigidity = _sections(0.0)[0][0]
    return Row(
        title="Short thick sections",
        driver="√(EI / T) / length of the thick end",
        quantity="stiffness elements at 0.1 Hz",
        value=np.sqrt(rigidity / TENSION) / lengths,
        error=sample(lengths, compute),
        finding=(
            "12 EI / l³ of a short section swamps the tension and the long section. Joined on"
            " slopes relative to the chord, only its own small deformation has that stiffness."
        ),
        limit="none found",
    )
