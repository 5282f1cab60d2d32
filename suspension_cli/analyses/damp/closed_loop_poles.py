"""Closed-loop poles with frequency-dependent losses, accurate in their decay rates.

With filters x_f' = A_f x_f + B_f y, u = -(C_f x_f + D_f y), and losses at the frequency Im s, a
pole s is a root of

    [ K + i K''(Im s) + s C + s^2 M + P D_f S    P C_f    ] [ x   ]
    [ -B_f S                                     s - A_f  ] [ x_f ] = T(s) v = 0,

found by Newton's method from the poles of the state space, whose losses are constant matrices
(inverse iteration, s - (w^T v)/(w^T y) with T y = T' v; Ruhe, SIAM J. Numer. Anal. 10, 674 (1973)).
Loss angles do not act on a pole that does not oscillate. A delay T of a loop multiplies its C_f and
D_f, or its velocity damper, by exp(-s T): exactly in T(s), approximately in state spaces. Of the
infinitely many poles of a closed loop with delay, those near poles of the state space are found.

The rounding error of the stiffness in the real part of such a root hides a Q of 1e10. The shape x
of a pole s = sigma + i omega also satisfies x^H Z(s) x = 0, whose imaginary part gives the decay
from dissipation and feedback alone,

    -2 sigma omega x^H M x = x^H K'' x + omega x^H C x + Im(sum over loops of H(s) (x^H push) (sense
    x)),

as M, K and C are symmetric. The relative error of sigma is then about that of x.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.linalg import block_diag

from suspension_cli.analyses.damp import control, control_statespace
from suspension_cli.analyses.damp.control import Plant
from suspension_cli.design import loop_filters
from suspension_cli.design.schema import Loop
from suspension_cli.linear.frequency_terms import Term
from suspension_cli.linear.poles import Poles
from suspension_cli.linear.quality import NOTHING
from suspension_cli.scene.arrays import Index

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Int

SLOW = 1e-3
"""Decay rate over frequency up to which it is computed from the dissipation."""
NEWTON = 30
"""Most steps of Newton's method (usually 4)."""
CONVERGED = 1e-13
"""Relative step at which Newton's method ends, if steps do not stop shrinking before."""
UNCHANGED = 1e-10
"""Relative change of a frequency up to which its losses are not evaluated again."""
RENEWALS = 20
"""Most evaluations of the losses per pole (usually 2)."""
STEPS = 4
"""Steps of inverse iteration for a shape."""
NEAR = 1e-9
"""Relative change of a pole that may be a rounding error."""
FAR = 50.0
"""Decay within a delay, nepers, beyond which poles are given up."""
SAME = 1e-8
"""Relative distance up to which two roots are one."""
ASIDE = 1e-12
"""Relative distance from a pole where its shape is solved for, as Z is singular at the pole."""


def refine(found: Poles, plant: Plant) -> Poles:
    """Refine the poles of a closed-loop state space on the plant with its own losses.

    Returns
    -------
    Poles
        (p,), rad/s, ascending in modulus; exactly imaginary where nothing dissipates or feeds.
    """
    model = plant.model
    values = _drop_rounding(found.value, found.rounding)
    joined = np.abs(model.damping)
    for pushed, sensed in zip(plant.pushed, plant.sensed, strict=True):
        joined = joined + np.abs(np.outer(pushed, sensed))
    groups = replace(model, damping=joined).blocks
    known = {name: n for n, name in enumerate(model.coordinate)}
    for loop, pushed in zip(plant.loops, plant.pushed, strict=True):
        place = int(np.flatnonzero(pushed[6:])[0]) + 6
        known |= {f"loop {loop.name}": place, f"loop {loop.name} {control_statespace.DELAY}": place}
    member = np.array([_find_block(state, known, groups) for state in found.state], dtype=np.intp)
    spurious = np.zeros(len(values), dtype=bool)
    for number in set(member.tolist()):
        here = np.flatnonzero(member == number)
        block = _Block.of(plant, groups[number])
        starts = values[here]
        pairs = zip(starts, block.dispersive(np.imag(starts)), strict=True)
        solved = [_find_root(complex(start), block, lossy) for start, lossy in pairs]
        roots = np.array([root for root, *_ in solved], dtype=complex)
        if block.delays.any():
            own = _first_of_each(starts, roots, np.array([moved for *_, moved in solved]))
            spurious[here] = ~own  # poles of the approximation of the delay
        else:  # a root nearer to another start has converged to another pole
            own = np.abs(roots[:, None] - starts).argmin(1) == np.arange(len(here))
        values[here[own]] = _drop_rounding(roots, found.rounding)[own]
        lasting = (np.imag(roots) > 0) & (np.abs(np.real(roots)) <= SLOW * np.abs(roots))
        slow = np.flatnonzero(own & lasting)
        if len(slow):
            shapes = np.array([_solve_shape(solved[n][0], block, solved[n][1]) for n in slow])
            decay = _compute_decays(roots[slow], block, shapes.T)
            # a larger change is of two poles at one frequency, whose shapes mix
            alone = np.abs(decay - np.real(roots[slow])) <= NEAR * np.abs(roots[slow])
            values[here[slow[alone]]] = decay[alone] + 1j * np.imag(roots[slow[alone]])
    order = np.argsort(np.abs(values), kind="stable")
    order = order[~spurious[order]]
    return Poles(values[order], tuple(found.state[n] for n in order))


def _first_of_each(
    starts: Complex[np.ndarray, " pole"],
    roots: Complex[np.ndarray, " pole"],
    converged: Bool[np.ndarray, " pole"],
) -> Bool[np.ndarray, " pole"]:
    """Mark the nearest of the starts that converged to each root."""
    own = np.zeros(len(starts), dtype=bool)
    for n in np.argsort(np.abs(roots - starts) / np.abs(starts).clip(1e-300)):
        again = np.abs(roots[own] - roots[n]) <= SAME * np.abs(roots[n])
        own[n] = converged[n] and not again.any()
    return own


def _drop_rounding(
    values: Complex[np.ndarray, " pole"], rounding: float
) -> Complex[np.ndarray, " pole"]:
    """Set real parts of poles that may be rounding errors to 0."""
    return np.where(
        np.abs(np.real(values)) <= rounding * np.abs(values), 1j * np.imag(values), values
    )


def _find_block(state: str, known: dict[str, int], groups: Sequence[Index]) -> int:
    """Find the block of a state, such as ``upper.x``, ``frame.x momentum`` or ``loop roll 2``."""
    place = known[state if state in known else state.rpartition(" ")[0]]
    return next(n for n, group in enumerate(groups) if place in group)


@dataclass(frozen=True)
class _Block:
    """Coordinates that couple to no others, with the loops that act on them.

    Attributes
    ----------
    plant
        Only these loops, with `sensed` and `pushed` (l, c).
    mass, stiffness, damping, lossy
        M, K, C and the K'' of constant loss angles.
    terms
        Losses that depend on frequency.
    filters
        A_f, B_f, C_f, D_f of all filters, without velocity dampers.
    resisting
        C with velocity dampers.
    delays
        s.
    delayed_dampers
        N s/m or N m s/rad; 0 for other loops.
    """

    plant: Plant
    mass: Float[np.ndarray, "coordinate coordinate"]
    stiffness: Float[np.ndarray, "coordinate coordinate"]
    damping: Float[np.ndarray, "coordinate coordinate"]
    lossy: Float[np.ndarray, "coordinate coordinate"]
    terms: tuple[Term, ...]
    filters: tuple[Any, ...]
    resisting: Float[np.ndarray, "coordinate coordinate"]
    delays: Float[np.ndarray, " loop"]
    delayed_dampers: Float[np.ndarray, " loop"]

    @staticmethod
    def of(plant: Plant, group: Int[np.ndarray, " coordinate"]) -> _Block:
        """Cut a block of coordinates out of a plant."""
        model, rows = plant.model, np.ix_(group, group)
        keep = [
            n
            for n in range(len(plant.loops))
            if plant.pushed[n, group].any() or plant.sensed[n, group].any()
        ]
        acting = plant.with_loops(keep)
        acting = replace(acting, pushed=acting.pushed[:, group], sensed=acting.sensed[:, group])
        damping = model.damping[rows]
        resisting, filters = damping, []
        for loop, pushed, sensed in zip(acting.loops, acting.pushed, acting.sensed, strict=True):
            filters.append(control_statespace.realise_filter(loop))
            if loop_filters.is_velocity_damper(loop):
                resisting = resisting + loop.damper * np.outer(pushed, sensed)
        return _Block(
            acting,
            model.mass[rows],
            model.stiffness[rows],
            damping,
            np.zeros(damping.shape) if model.lossy is None else np.imag(model.lossy[rows]),
            tuple(term.within(group) for term in model.terms),
            # the first, empty block: block_diag() of nothing has a row
            tuple(block_diag(np.zeros((0, 0)), *(one[n] for one in filters)) for n in range(4)),
            resisting,
            np.array([loop.delay for loop in acting.loops]),
            np.array([_delayed_damper(loop) for loop in acting.loops]),
        )

    def dispersive(
        self, omega: Float[np.ndarray, " pole"]
    ) -> Complex[np.ndarray, "pole coordinate coordinate"]:
        """i K'' of all losses at frequencies, rad/s; 0 at frequency 0."""
        result = np.zeros((len(omega), *self.mass.shape), dtype=complex)
        moving = omega > 0
        result[moving] = 1j * self.lossy
        for term in self.terms if moving.any() else ():
            at = np.ix_(moving, term.columns, term.columns)
            result[at] += term.at(omega[moving]).complete
        return result

    def dissipated(
        self, x: Complex[np.ndarray, "coordinate pole"], omega: Float[np.ndarray, " pole"]
    ) -> Float[np.ndarray, " pole"]:
        """x^H K'' x + omega x^H C x of motions x at frequencies omega, rad/s."""
        lost = (
            np.einsum("ip,ij,jp->p", x.conj(), self.lossy, x).real
            + omega * np.einsum("ip,ij,jp->p", x.conj(), self.damping, x).real
        )
        return lost + sum(
            value for term in self.terms for value in term.at(omega).dissipated(x).values()
        )


def _delayed_damper(loop: Loop) -> float:
    """Coefficient of a velocity damper that has a delay or a sensor; 0 for other loops."""
    made = loop_filters.controller_and_sensor(loop)
    return made.gain / (2 * np.pi) if loop.delay and len(made.zeros) > len(made.poles) else 0.0


def _find_root(
    start: complex, block: _Block, lossy: Complex[np.ndarray, "coordinate coordinate"]
) -> tuple[complex, Complex[np.ndarray, "coordinate coordinate"], bool]:
    """Find a root of T(s) near a start, and the losses there, from the losses at the start.

    Returns the start and False if Newton's method does not converge.
    """
    if start == 0:  # a free coordinate
        return start, lossy, True
    s = start
    for _ in range(RENEWALS):
        last, s = s, _iterate_newton(s, block, lossy)
        if not np.isfinite(s) or s.imag < 0 or (start.imag > 0) != (s.imag > 0):
            return start, lossy, False
        if abs(s.imag - last.imag) <= UNCHANGED * abs(s):
            return s, lossy, True
        lossy = block.dispersive(np.array([s.imag]))[0]
    return start, lossy, False


def _iterate_newton(
    s: complex, block: _Block, lossy: Complex[np.ndarray, "coordinate coordinate"]
) -> complex:
    """Find a root of T(s) with given losses by Newton's method; NaN if it does not converge."""
    a, b, c, d = block.filters
    size, count = len(block.mass), len(block.mass) + len(a)
    pushed, sensed = block.plant.pushed, block.plant.sensed
    slope, matrix = np.eye(count, dtype=complex), np.zeros((count, count), dtype=complex)
    matrix[:size, size:], matrix[size:, :size] = pushed.T @ c, -b @ sensed
    last, constant, real = np.inf, block.stiffness + lossy + pushed.T @ d @ sensed, s.imag == 0
    delays, dampers = block.delays, block.delayed_dampers
    shape = np.random.default_rng(0).normal(size=count).astype(complex)
    for step in range(NEWTON):
        matrix[:size, :size] = constant + s * block.resisting + s**2 * block.mass
        matrix[size:, size:] = s * np.eye(len(a)) - a
        slope[:size, :size] = block.resisting + 2 * s * block.mass
        if delays.any():
            if (-s.real * delays > FAR).any():
                return complex(np.nan)
            late = np.exp(-s * delays)
            matrix[:size, :size] += (
                pushed.T @ (late[:, None] * d - d + np.diag(late * s * dampers)) @ sensed
            )
            matrix[:size, size:] = pushed.T @ (late[:, None] * c)
            slope[:size, :size] += (
                pushed.T
                @ np.diag(late * (dampers - delays * (d.diagonal() + s * dampers)))
                @ sensed
            )
            slope[:size, size:] = pushed.T @ ((-delays * late)[:, None] * c)
        row, column = _equilibrate(matrix)
        try:
            scaled = np.linalg.solve(row[:, None] * matrix * column, row * (slope @ shape))
        except np.linalg.LinAlgError:  # singular: s is the root to the last bit
            return s
        lead = int(np.abs(scaled).argmax())
        found = column * scaled
        if step > 0:  # the first step only finds the shape
            change = shape[lead] / found[lead]
            s = s - (complex(change.real) if real else change)
            if abs(change) <= CONVERGED * abs(s) or last / 2 <= abs(change) <= NEAR * abs(s):
                return s
            last = abs(change)
        shape = found / abs(scaled[lead])
    return complex(np.nan)


def _equilibrate(
    matrix: Complex[np.ndarray, "row column"],
) -> tuple[Float[np.ndarray, " row"], Float[np.ndarray, " column"]]:
    """Compute factors of rows and columns that make their largest elements about 1."""
    size = np.abs(matrix)
    row, column = np.ones(len(size)), np.ones(len(size))
    for _ in range(3):
        now = row[:, None] * size * column
        across, down = (now.max(axis, initial=0.0) for axis in (1, 0))
        row = row / np.sqrt(np.where(across > 0, across, 1.0))
        column = column / np.sqrt(np.where(down > 0, down, 1.0))
    return row, column


def _solve_shape(
    s: complex, block: _Block, lossy: Complex[np.ndarray, "coordinate coordinate"]
) -> Complex[np.ndarray, " coordinate"]:
    """Solve for the shape of a pole s by inverse iteration."""
    pushed, sensed = block.plant.pushed, block.plant.sensed
    root = np.sqrt(np.abs(np.diag(block.stiffness)) + abs(s) ** 2 * np.diag(block.mass))
    near = s * (1 + ASIDE)
    dynamic = (
        block.stiffness
        + lossy
        + near * block.damping
        + near**2 * block.mass
        + (pushed.T * _filter_responses(np.array([near]), block)[:, 0]) @ sensed
    )
    shape = np.random.default_rng(0).normal(size=len(root)).astype(complex)
    for _ in range(STEPS):
        shape = np.linalg.solve(dynamic / np.outer(root, root), shape)
        shape = shape / np.abs(shape).max()
    return shape / root


def _filter_responses(
    s: Complex[np.ndarray, " pole"], block: _Block
) -> Complex[np.ndarray, "loop pole"]:
    return np.array(
        [control.evaluate_filter(loop, s / (2j * np.pi)) for loop in block.plant.loops],
        dtype=complex,
    ).reshape(-1, len(s))


def _compute_decays(
    s: Complex[np.ndarray, " pole"], block: _Block, x: Complex[np.ndarray, "coordinate pole"]
) -> Float[np.ndarray, " pole"]:
    """Compute the real parts of poles from their shapes."""
    weight = np.einsum("ip,ij,jp->p", x.conj(), block.mass, x).real
    gain = (
        (_filter_responses(s, block) * (block.plant.pushed @ x.conj()) * (block.plant.sensed @ x))
        .sum(0)
        .imag
    )
    acting = block.dissipated(x, np.imag(s)) + gain
    return np.where(
        np.abs(acting) > NOTHING * np.imag(s) ** 2 * weight,
        -acting / (2 * np.imag(s) * weight),
        0.0,
    )
