"""State space and zero-pole-gain forms for control tools, with their band of agreement."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import zip_longest
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.export.relaxation import relax
from suspension_cli.design.schema import Design
from suspension_cli.elimination import connected_groups
from suspension_cli.linear import damped, statespace
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.signals import Signal
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import registry
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Complex, Float


@dataclass(frozen=True)
class ZeroPoleGain:
    """Responses (o, i) as gain times the product of (s - z) over that of (s - p), in rad/s."""

    zeros: Array
    poles: Array
    gain: Array

    def at(self, frequency: Array) -> Complex[np.ndarray, "frequency output input"]:
        """Evaluate the transfer matrix (f, o, i) at frequencies (f,) in Hz."""
        s = 2j * np.pi * np.asarray(frequency)
        result = np.empty((len(s), *self.gain.shape), dtype=complex)
        for o, i in np.ndindex(self.gain.shape):
            result[:, o, i] = self.gain[o, i]
            # alternately, to avoid overflow
            for zero, pole in zip_longest(self.zeros[o, i], self.poles[o, i]):
                result[:, o, i] *= 1.0 if zero is None else s - zero
                result[:, o, i] /= 1.0 if pole is None else s - pole
        return result


@dataclass(frozen=True)
class Exported:
    """An exported system with its error against the direct solution.

    Attributes
    ----------
    band
        Frequencies in Hz between which it agrees with the direct solution to `tolerance`, relative;
        None if no two neighbouring ones do.
    worst
        Largest relative error at the frequencies compared.
    tried
        Lowest and highest frequency compared, Hz: 1/100 of the lowest mode's and 100 times the
        highest one's; with losses the band that they are asked for.
    q_error
        With losses, the largest relative error of the Q of a mode in the band; None without.
    """

    system: statespace.StateSpace
    zpk: ZeroPoleGain | None
    band: tuple[float, float] | None
    tolerance: float
    worst: float
    tried: tuple[float, float]
    agreement: Agreement | None = None
    q_error: float | None = None


@dataclass(frozen=True)
class Agreement:
    """Bands in which an export agrees with the most complete model, off resonance.

    Attributes
    ----------
    model
        Name of that model.
    unknown
        Why the design has no such model; "" if it has.
    low, high
        Ends of the band of each of `AGREEMENT` for each response, Hz; NaN where there is none.
    """

    model: str
    unknown: str
    low: Float[np.ndarray, "tolerance output input"]
    high: Float[np.ndarray, "tolerance output input"]


AGREEMENT = (0.01, 0.1)
"""Errors against the most complete model whose bands are reported."""
NARROW = 0.07
"""Width, relative to its frequency, up to which a resonance or a zero does not interrupt a band: a
slight shift of either is a large error there."""
GAIN = 0.8
"""Least improvement of the errors for which more rates are taken."""
APART = 1e-3
"""Relative distance from a mode, or its width, within which its pole is looked for."""
TOLERANCE = 1e-9
"""Relative error of a state space in its band."""
TOLERANCE_ZPK = 1e-3
"""Relative error of a zero-pole-gain form in its band: the eigenvalue problem of its zeros has
rounding errors relative to the largest one."""
DENSITIES = (2.0, 3.0, 4.5)
"""Relaxation rates per decade that are tried until losses are accurate enough."""


def build(
    model: LinearSystem,
    inputs: list[Signal],
    outputs: list[Signal],
    direct: LinearSystem | None = None,
    *,
    zpk: bool = False,
) -> Exported:
    """Build the system from inputs to outputs, with its band of agreement.

    The `model` has constant matrices; the direct solution to compare with is that of `direct`, or
    by default of `model`. If `zpk`, the zero-pole-gain form is also computed, and compared.
    """
    system = statespace.build(model, inputs, outputs)
    form = compute_zero_pole_gain(system) if zpk else None
    tolerance = TOLERANCE_ZPK if zpk else TOLERANCE
    band, worst, tried = statespace.agreement_band(
        form or system, direct or model, inputs, outputs, tolerance
    )
    return Exported(system, form, band, tolerance, worst, tried)


def build_lossy(
    model: LinearSystem,
    inputs: list[Signal],
    outputs: list[Signal],
    band: tuple[float, float],
    accuracy: float,
    *,
    zpk: bool = False,
) -> Exported:
    """Build the system with losses, and with the mass of wires that the `model` has.

    Of the densities of relaxation rates it takes the first with which responses off resonance have
    errors up to `accuracy` and Q up to twice that, in the band (Hz); or the best.
    """
    modes = damped.solve(model)
    frequency = np.geomspace(*band, statespace.GRID)
    best: tuple[float, Exported] | None = None
    for density in DENSITIES:
        system = statespace.build(relax(model, band, density), inputs, outputs)
        form = compute_zero_pole_gain(system) if zpk else None
        error = statespace.relative_errors(form or system, model, frequency, inputs, outputs)
        error = _off_resonance(error, frequency).max((1, 2))
        good = statespace.widest_band(frequency, error <= accuracy)
        q_error, worst = _error_of_q(system, modes, band), float(error.max())
        made = Exported(system, form, good, accuracy, worst, band, q_error=q_error)
        share = max(worst, q_error / 2) / accuracy
        if best is not None and share > GAIN * best[0]:
            break
        best = share, made
        if share <= 1:
            break
    assert best is not None
    return best[1]


def _error_of_q(system: statespace.StateSpace, modes: Modes, band: tuple[float, float]) -> float:
    """Largest relative error of the Q of a mode in a band, Hz.

    Modes of motions that the system leaves out have no pole closer to them than to others.
    """
    poles = np.linalg.eigvals(system.a)
    poles = poles[poles.imag > 0]
    frequency, q = np.abs(poles) / (2 * np.pi), np.abs(poles) / np.maximum(-2 * poles.real, 1e-300)
    some = np.isfinite(modes.q) & (modes.frequency > band[0]) & (modes.frequency < band[1])
    if not some.any() or not len(poles):
        return 0.0
    expected, own = modes.frequency[some], modes.q[some]
    apart = np.abs(frequency[:, None] / expected - 1)
    closest = apart.argmin(1)
    worst = 0.0
    for n in np.unique(closest):
        here = (closest == n) & (apart[:, n] < max(APART, 1 / own[n]))
        if here.any():
            worst = max(worst, float(np.exp(np.abs(np.log(q[here] / own[n])).min()) - 1))
    return worst


def _off_resonance(
    error: Float[np.ndarray, "frequency output input"], frequency: Array
) -> Float[np.ndarray, "frequency output input"]:
    """Smooth errors of each response by a running median, which removes what is narrow."""
    from scipy.ndimage import median_filter

    points = 2 * round(NARROW / np.log(frequency[1] / frequency[0])) + 1
    return median_filter(error, (points, 1, 1), mode="nearest")


def compare_with_complete(
    made: Exported, design: Design, inputs: list[Signal], outputs: list[Signal]
) -> Exported:
    """Add the bands in which an export agrees with the most complete model of the design."""
    complete, system = registry.MOST_COMPLETE, made.zpk or made.system
    unknown = complete.unsuitable(design)
    band = np.full((len(AGREEMENT), len(outputs), len(inputs), 2), np.nan)
    if not unknown:
        frequency = np.geomspace(*made.tried, statespace.GRID)
        model = complete.system(design)
        error = statespace.relative_errors(system, model, frequency, inputs, outputs)
        error = _off_resonance(error, frequency)
        for n, o, i in np.ndindex(band.shape[:-1]):
            found = statespace.widest_band(frequency, error[:, o, i] <= AGREEMENT[n])
            band[n, o, i] = found or np.nan
    return replace(made, agreement=Agreement(complete.name, unknown, band[..., 0], band[..., 1]))


def compute_zero_pole_gain(system: statespace.StateSpace) -> ZeroPoleGain:
    """Compute zeros, poles and gain of every input-output pair.

    Poles are eigenvalues of A. Zeros are the finite generalised eigenvalues of [[A, b], [c, d]]
    (Emami-Naeini and Van Dooren, Automatica 18, 415 (1982)); their number is that of poles less the
    relative degree. The gain is the first non-zero Markov parameter.
    """
    gain = np.zeros_like(system.d, dtype=float)
    zeros, poles = np.empty(gain.shape, dtype=object), np.empty(gain.shape, dtype=object)
    for o, i in np.ndindex(gain.shape):
        (a, b, c), d = restrict_states(system, o, i), float(system.d[o, i])
        degree, gain[o, i] = _leading(a, b, c, d)
        own = _zeros(a, b, c, d, degree)
        while not np.isfinite(own).all():  # its Markov parameter was a rounding error
            degree, gain[o, i] = _leading(a, b, c, 0.0, degree)
            own = _zeros(a, b, c, 0.0, degree) if gain[o, i] else own[:0]
        zeros[o, i] = own
        poles[o, i] = np.linalg.eigvals(a) if gain[o, i] else np.zeros(0, dtype=complex)
    return ZeroPoleGain(zeros, poles, gain)


def restrict_states(system: statespace.StateSpace, o: int, i: int) -> tuple[Array, Array, Array]:
    """Restrict A, b, c to the states that input i drives and output o observes."""
    driven, observed = system.b[:, i] != 0, system.c[o] != 0
    both = np.zeros(len(system.a), dtype=bool)
    for group in connected_groups(system.a != 0):
        both[group] = driven[group].any() and observed[group].any()
    return system.a[np.ix_(both, both)], system.b[both, i], system.c[o, both]


def _leading(a: Array, b: Array, c: Array, d: float, beyond: int = 0) -> tuple[int, float]:
    """Relative degree k above `beyond`, and its Markov parameter c A^(k-1) b.

    The first that exceeds its rounding errors; 0, 0.0 if there is none.
    """
    if d != 0:
        return 0, d
    vector, size = b, np.abs(b)
    for degree in range(1, len(a) + 1):
        value, bound = float(c @ vector), float(np.abs(c) @ size)
        if degree > beyond and abs(value) > 1e-9 * bound:
            return degree, value
        vector, size = a @ vector, np.abs(a) @ size
    return 0, 0.0


def _zeros(a: Array, b: Array, c: Array, d: float, degree: int) -> Complex[np.ndarray, " zero"]:
    """Finite eigenvalues (n - degree,) of [[A, b], [c, d]], rad/s.

    The matrix is balanced first, with b and c scaled to the norm of A.
    """
    from scipy.linalg import eig, matrix_balance

    count = len(a) - degree
    if count <= 0 or (degree == 0 and d == 0):
        return np.zeros(0, dtype=complex)
    scale = matrix_balance(a, permute=False, separate=True)[1][0]
    a, b, c = a * scale / scale[:, None], b / scale, c * scale
    size = np.linalg.norm(a)
    size_b, size_c = size / np.linalg.norm(b), size / np.linalg.norm(c)
    pencil = np.block(
        [[a, size_b * b[:, None]], [size_c * c[None, :], np.array([[size_b * size_c * d]])]]
    )
    unit = np.zeros_like(pencil)
    unit[: len(a), : len(a)] = np.eye(len(a))
    alpha, beta = np.asarray(eig(pencil, unit, right=False, homogeneous_eigvals=True))
    order = np.argsort(
        -np.abs(beta) / (np.abs(alpha) / size + np.abs(beta) + 1e-300), kind="stable"
    )[:count]
    with np.errstate(divide="ignore", invalid="ignore"):
        return alpha[order] / beta[order]
