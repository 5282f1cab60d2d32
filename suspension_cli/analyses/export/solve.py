"""State space and zero-pole-gain forms for control tools, with their band of agreement."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from suspension_cli.analyses.export.closed_poles import ComparedPoles
from suspension_cli.analyses.record import Record
from suspension_cli.conventions import DOFS
from suspension_cli.design.foton_file import FilterFile
from suspension_cli.design.schema import Design
from suspension_cli.elimination import connected_groups
from suspension_cli.files.documents import Layout
from suspension_cli.linear import eigenmodes, response, statespace
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.signals import Signal
from suspension_cli.linear.solver import Solvable, Solver
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import registry
from suspension_cli.physics.loop_signals import ClosedLoops
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Int

GRID = 800
"""Number of frequencies at which a system is compared with the direct solution. With an odd number
the only mode of a design without loss would be one of them."""
FAINT = 1e-6
"""Fraction of the motion of an output's body below which errors are relative to that fraction."""
AGREEMENT = (0.01, 0.1)
"""Errors against the most complete model whose bands are reported."""
NARROW = 0.07
"""Width, relative to its frequency, up to which a resonance or a zero does not interrupt a band: a
slight shift of either is a large error there."""
APART = 1e-3
"""Relative distance from a mode, or its width, within which its pole is looked for."""
TOLERANCE = 1e-9
"""Relative error of a state space in its band."""
TOLERANCE_ZPK = 1e-3
"""Relative error of a zero-pole-gain form in its band: the eigenvalue problem of its zeros has
rounding errors relative to the largest one."""


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
            zeros = self.zeros[o, i]
            poles = self.poles[o, i]
            factors = 1 / (s[:, None] - poles)
            factors[:, : len(zeros)] *= s[:, None] - zeros  # one by one, to avoid overflow
            result[:, o, i] = self.gain[o, i] * factors.prod(1)
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
    value
        Responses at `frequency`, SI.
    q_error
        With losses, the largest relative error of the Q of a mode in the band; None without.
    orders
        With losses, errors of systems with fewer states.
    mirror
        Name of the design's mirror.
    filters
        The same as a Foton filter file.
    poles
        With the loops closed, its poles beside those of the complete equations.
    """

    system: statespace.StateSpace
    zpk: ZeroPoleGain | None
    band: tuple[float, float] | None
    tolerance: float
    worst: float
    tried: tuple[float, float]
    value: Complex[np.ndarray, "frequency output input"]
    agreement: Agreement | None = None
    q_error: float | None = None
    orders: Orders | None = None
    mirror: str = ""
    filters: FilterFile | None = None
    poles: ComparedPoles | None = None

    @property
    def frequency(self) -> Float[np.ndarray, " frequency"]:
        """Frequencies compared, Hz."""
        return np.geomspace(*self.tried, GRID)


class Written(Record):
    """Record of an analysis that writes a file for another program."""

    @property
    def file(self) -> str | None:
        """Path of the file; None if none was written."""
        return None if self.run.file is None else str(self.run.file)


@dataclass(frozen=True, eq=False, repr=False)
class Export(Written, Exported):
    """An exported system: matrices, bands of agreement, and the format that was asked for."""

    in_json: ClassVar = Layout(
        only="format file closed_loop filters system band tolerance worst q_error orders poles"
        " agreement",
        names={"band": "band_hz", "worst": "worst_error", "q_error": "worst_q_error"},
        sparse="closed_loop filters orders poles",
        flat="filters system",
    )
    format: str = "mat"
    closed_loop: bool = False


@dataclass(frozen=True)
class Orders:
    """Errors of systems with losses against their number of states, up to that of the system.

    Attributes
    ----------
    states
        Number of states.
    worst
        Largest relative error off resonance.
    q_error
        Largest relative error of a Q.
    """

    in_json: ClassVar = Layout(
        rows={"order": ""}, names={"worst": "worst_error", "q_error": "worst_q_error"}
    )
    states: Int[np.ndarray, " order"]
    worst: Float[np.ndarray, " order"]
    q_error: Float[np.ndarray, " order"]


@dataclass(frozen=True)
class Agreement:
    """Bands in which an export agrees with the most complete model, off resonance.

    Attributes
    ----------
    model
        Name of that model.
    unknown
        Why the design has no such model; "" if it has.
    output, input
        Signals.
    low, high
        Ends of the band of each of `AGREEMENT` for each response, Hz; NaN where there is none.
    """

    in_json: ClassVar = Layout(only="model unknown pairs", sparse="unknown")
    model: str
    unknown: str
    output: tuple[str, ...]
    input: tuple[str, ...]
    low: Float[np.ndarray, "tolerance output input"]
    high: Float[np.ndarray, "tolerance output input"]

    @property
    def pairs(self) -> tuple[dict[str, Any], ...] | None:
        """Bands by response, with the errors of `AGREEMENT` in their names; None if unknown."""
        if self.unknown:
            return None
        pairs = []
        for o, i in np.ndindex(self.low.shape[1:]):
            pair: dict[str, Any] = {"output": self.output[o], "input": self.input[i]}
            for error, low, high in zip(AGREEMENT, self.low, self.high, strict=True):
                band = (float(low[o, i]), float(high[o, i])) if low[o, i] > 0 else None
                pair[f"band_hz_{100 * error:g}_percent"] = band
            pairs.append(pair)
        return tuple(pairs)


@dataclass(frozen=True)
class Opened:
    """Inputs and outputs of a suspension without loops."""

    inputs: list[Signal]
    outputs: list[Signal]

    def build(self, system: Solvable) -> statespace.StateSpace:
        """Build the state space of a model without wire mass."""
        return statespace.build(Solver.of(system).system, self.inputs, self.outputs)

    def solve(
        self, system: Solvable, frequency: Float[np.ndarray, " frequency"], more: Sequence[Signal]
    ) -> Complex[np.ndarray, "frequency output input"]:
        """Solve the complete equations at frequencies in Hz; `more` motions come last."""
        return response.solve(system, frequency, self.inputs, [*self.outputs, *more]).value

    def observed(self) -> list[Signal]:
        """List the outputs."""
        return self.outputs

    def pairs(self, system: Solvable) -> tuple[list[Signal], list[Signal]]:
        """List the inputs, and the outputs, of the mechanics."""
        del system
        return self.inputs, self.outputs


Ends = Opened | ClosedLoops
"""Inputs and outputs, and how they are connected."""


def build(model: LinearSystem, ends: Ends, *, zpk: bool = False) -> Exported:
    """Build the system between inputs and outputs, with its band of agreement.

    The `model` has constant matrices. If `zpk`, the zero-pole-gain form is computed, and compared.
    """
    lowest, highest = mode_range(model)
    tried = (lowest / 100, 100 * highest)
    tolerance = TOLERANCE_ZPK if zpk else TOLERANCE
    exact = solve_exactly(model, np.geomspace(*tried, GRID), ends)
    return measure(ends.build(model), exact, tried, tolerance, zpk=zpk, narrow=True)


def modes_within(modes: Modes, band: tuple[float, float]) -> Bool[np.ndarray, " mode"]:
    """Mark the modes in a band (Hz) that oscillate with losses."""
    inside = (modes.frequency > band[0]) & (modes.frequency < band[1])
    return inside & np.isfinite(modes.q) & (modes.q > 0.5)


def measure(
    system: statespace.StateSpace,
    exact: Exact,
    tried: tuple[float, float],
    tolerance: float,
    *,
    zpk: bool,
    narrow: bool,
) -> Exported:
    """Compare a system with exact responses; without errors at resonances unless `narrow`."""
    form = compute_zero_pole_gain(system) if zpk else None
    frequency = np.geomspace(*tried, GRID)
    value = (form or system).at(frequency)
    error = exact.errors_of(value)
    largest = (error if narrow else off_resonance(error, frequency)).max((1, 2))
    band = _find_band(frequency, largest <= tolerance)
    worst = float(largest.max())
    return Exported(system, form, band, tolerance, worst, tried, value)


def _find_band(
    frequency: Float[np.ndarray, " frequency"], agrees: Bool[np.ndarray, " frequency"]
) -> tuple[float, float] | None:
    """Find the widest band that agrees; None if no two neighbouring frequencies do."""
    edges = np.flatnonzero(np.diff(agrees, prepend=False, append=False)).reshape(-1, 2)
    count = edges[:, 1] - edges[:, 0]
    if count.max(initial=0) < 2:
        return None
    first, beyond = edges[count.argmax()]
    return float(frequency[first]), float(frequency[beyond - 1])


def mode_range(model: LinearSystem) -> tuple[float, float]:
    """Lowest and highest frequency of modes that are neither rigid nor unstable, Hz."""
    found = eigenmodes.solve(model).omega_squared
    positive = np.sqrt(found[found > 0]) / (2 * np.pi)
    return (float(positive[0]), float(positive[-1])) if len(positive) else (1.0, 1.0)


@dataclass(frozen=True)
class Exact:
    """Responses of the direct solution, and the motion of each output's body at the same inputs.

    The motion is the largest response of the body's six coordinates; 1 rad counts as 1 m.
    """

    value: Complex[np.ndarray, "frequency output input"]
    motion: Float[np.ndarray, "frequency output input"]

    @property
    def size(self) -> Float[np.ndarray, "frequency output input"]:
        """Magnitude of each response, or `FAINT` of the motion of its body; 0 if it is 0.

        Of a fainter one the direct solution has fewer digits too.
        """
        exact = np.abs(self.value)
        return np.where(exact > 0, np.maximum(exact, FAINT * self.motion), 0.0)

    def errors_of(
        self, value: Complex[np.ndarray, "frequency output input"]
    ) -> Float[np.ndarray, "frequency output input"]:
        """Compute errors relative to the `size` of each response."""
        size = self.size
        off = np.abs(value - self.value)
        with np.errstate(divide="ignore", invalid="ignore"):
            error = np.where(size > 0, off / size, np.where(off == 0, 0.0, np.inf))
        return np.where(np.isnan(error), np.inf, error)


def solve_exactly(
    system: Solvable, frequency: Float[np.ndarray, " frequency"], ends: Ends
) -> Exact:
    """Solve directly for responses and for the motions of the bodies."""
    solver = Solver.of(system)
    outputs = ends.observed()
    bodies = [one.body for one in outputs if one.body in solver.system.body]
    bodies = list(dict.fromkeys(bodies))
    motions = [
        Signal(f"{body}.{dof}", body, n, (0.0, 0.0, 0.0), acts=False)
        for body in bodies
        for n, dof in enumerate(DOFS)
    ]
    found = ends.solve(solver, frequency, motions)
    value, others = np.split(found, [len(outputs)], axis=1)
    by_body = (len(frequency), len(bodies), len(DOFS), value.shape[2])
    largest = np.abs(others).reshape(by_body).max(2)
    motion = np.zeros(value.shape)
    for n, one in enumerate(outputs):
        if one.body in bodies:
            motion[:, n] = largest[:, bodies.index(one.body)]
    return Exact(value, motion)


def error_of_q(system: statespace.StateSpace, modes: Modes, band: tuple[float, float]) -> float:
    """Largest relative error of the Q of a mode in a band, Hz.

    Each pole is compared with the mode beside it whose Q is nearest; the system may leave out
    modes of motions that are not driven.
    """
    poles = np.linalg.eigvals(system.a)
    poles = poles[np.imag(poles) > 0]
    frequency = np.abs(poles) / (2 * np.pi)
    q = np.abs(poles) / np.maximum(-2 * poles.real, 1e-300)
    some = modes_within(modes, band)
    expected = modes.frequency[some]
    own = modes.q[some]
    beside = np.abs(frequency[:, None] / expected - 1) < np.maximum(APART, 1 / own)
    off = np.where(beside, np.abs(np.log(q[:, None] / own)), np.inf).min(1, initial=np.inf)
    return float(np.expm1(off[np.isfinite(off)].max(initial=0.0)))


def off_resonance(
    error: Float[np.ndarray, "frequency output input"], frequency: Array
) -> Float[np.ndarray, "frequency output input"]:
    """Smooth errors of each response by a running median, which removes what is narrow."""
    from scipy.ndimage import median_filter

    points = 2 * round(NARROW / np.log(frequency[1] / frequency[0])) + 1
    return median_filter(error, (points, 1, 1), mode="nearest")


def compare_with_complete(made: Exported, design: Design, ends: Ends) -> Exported:
    """Add the bands in which an export agrees with the most complete model of the design."""
    complete = registry.MOST_COMPLETE
    unknown = complete.unsuitable(design)
    shape = len(made.system.output), len(made.system.input)
    band = np.full((len(AGREEMENT), *shape, 2), np.nan)
    if not unknown:
        exact = solve_exactly(complete.system(design), made.frequency, ends)
        error = off_resonance(exact.errors_of(made.value), made.frequency)
        for n, o, i in np.ndindex(band.shape[:-1]):
            agrees = error[:, o, i] <= AGREEMENT[n]
            band[n, o, i] = _find_band(made.frequency, agrees) or np.nan
    names = made.system.output, made.system.input
    agreement = Agreement(complete.name, unknown, *names, band[..., 0], band[..., 1])
    return replace(made, agreement=agreement)


def compute_zero_pole_gain(system: statespace.StateSpace) -> ZeroPoleGain:
    """Compute zeros, poles and gain of every input-output pair.

    Poles are eigenvalues of A. Zeros are the finite generalised eigenvalues of [[A, b], [c, d]]
    (Emami-Naeini and Van Dooren, Automatica 18, 415 (1982)); their number is that of poles less the
    relative degree. The gain is the first non-zero Markov parameter.
    """
    gain = np.zeros_like(system.d, dtype=float)
    zeros = np.empty(gain.shape, dtype=object)
    poles = np.empty(gain.shape, dtype=object)
    for o, i in np.ndindex(gain.shape):
        a, b, c = restrict_states(system, o, i)
        d = float(system.d[o, i])
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
    driven = system.b[:, i] != 0
    observed = system.c[o] != 0
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
    vector = b
    size = np.abs(b)
    for degree in range(1, len(a) + 1):
        value = float(c @ vector)
        bound = float(np.abs(c) @ size)
        if degree > beyond and abs(value) > 1e-9 * bound:
            return degree, value
        vector = a @ vector
        size = np.abs(a) @ size
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
    a = a * scale / scale[:, None]
    b = b / scale
    c = c * scale
    size = np.linalg.norm(a)
    size_b = size / np.linalg.norm(b)
    size_c = size / np.linalg.norm(c)
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
