"""Poles of a suspension with its loops closed as the roots s of the whole problem, with all digits of their decay.

With filters as x_f' = A_f x_f + B_f y, u = -(C_f x_f + D_f y), and losses as they are at the frequency Im s of the pole,

    [ K + i K''(Im s) + s C + s^2 M + P D_f S    P C_f    ] [ x   ]
    [ -B_f S                                     s - A_f  ] [ x_f ] = T(s) v = 0,

which Newton's method solves from the poles of the state space, whose losses are those of modes (inverse iteration, s - (w^T v)/(w^T y) with
T y = T' v; Ruhe, SIAM J. Numer. Anal. 10, 674 (1973)).  What does not oscillate loses nothing by loss angles.

A real part found so is wrong by a rounding of the stiffness: a Q of 1e10 drowns.  In the shape x that a pole
s = sigma + i omega has in Z(s) x = 0, though, x^H Z x is 0 too, and its imaginary part tells the decay by what alone dissipates or feeds,

    -2 sigma omega x^H M x = x^H K'' x + omega x^H C x + Im(sum over loops of H(s) (x^H push) (sense x)),

as M, K and C are symmetric: nothing of the stiffness is left in it, and an error in x counts as one of x does, not of the stiffness.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from suspension_cli.analysis import control
from suspension_cli.analysis.control import Plant
from suspension_cli.analysis.poles import Poles
from suspension_cli.analysis.quality import NOTHING

SLOW = 1e-3
"""Decay over frequency below which it is computed from what dissipates."""
NEWTON = 30
"""Steps of Newton's method at most; some 4 are enough."""
CONVERGED = 1e-13
"""Relative step that is the last one; as is one of roundings, which is no smaller than that before."""
UNCHANGED = 1e-10
"""Relative change of a frequency up to which losses stay what they are."""
RENEWALS = 20
"""Of the losses, at most; two are enough."""
STEPS = 4
"""Of inverse iteration; each brings the shape as much nearer as its own pole is nearer than others."""
NEAR = 1e-9
"""Change of a pole, over the frequency, up to which it may have been a rounding error."""
ASIDE = 1e-12
"""How far beside a pole, as a share of it, its shape is solved for, as on it there may be no solution."""


def refined(found: Poles, plant: Plant) -> Poles:
    """Poles of a plant with its loops closed, from those of its state space; exactly imaginary where nothing acts.

    Parameters
    ----------
    found : Poles
        Of the state space, which may have been given losses of modes.
    plant : Plant
        Its model with losses as they are.
    """
    model = plant.model
    values = _without_rounding(found.value, found.rounding)
    joined = np.abs(model.damping)
    for pushed, sensed in zip(plant.pushed, plant.sensed, strict=True):
        joined = joined + np.abs(np.outer(pushed, sensed))
    groups = replace(model, damping=joined).blocks
    known = {name: n for n, name in enumerate(model.coordinate)} | {
        f"loop {loop.name}": int(np.flatnonzero(pushed[6:])[0]) + 6 for loop, pushed in zip(plant.loops, plant.pushed, strict=True)
    }
    member = np.array([_group(state, known, groups) for state in found.state], dtype=np.intp)
    for number in set(member.tolist()):
        here = np.flatnonzero(member == number)
        part = _Part.of(plant, groups[number])
        starts = values[here]
        lossy = part.dispersive(starts.imag)
        found_here = [_root(complex(start), part, now) for start, now in zip(starts, lossy, strict=True)]
        roots: Any = np.array([root for root, _ in found_here])
        lossy = np.array([now for _, now in found_here])
        own = np.abs(roots[:, None] - starts).argmin(1) == np.arange(len(here))  # else it went to another pole
        values[here[own]] = _without_rounding(roots, found.rounding)[own]
        slow = np.flatnonzero(own & (roots.imag > 0) & (np.abs(roots.real) <= SLOW * np.abs(roots)))
        if len(slow):
            decay = _decays(roots[slow], part, np.array([_shape(root, part, now) for root, now in zip(roots[slow], lossy[slow], strict=True)]).T)
            alone = np.abs(decay - roots[slow].real) <= NEAR * np.abs(roots[slow])  # else one shape stands for two poles at one frequency
            values[here[slow[alone]]] = decay[alone] + 1j * roots[slow[alone]].imag
    order = np.argsort(np.abs(values), kind="stable")
    return Poles(values[order], tuple(found.state[n] for n in order))


def _without_rounding(values: Any, rounding: float) -> Any:
    """Poles (p,) without real parts that may be rounding errors."""
    return np.where(np.abs(values.real) <= rounding * np.abs(values), 1j * values.imag, values)


def _group(state: str, known: dict[str, int], groups: Any) -> int:
    """Which group of coordinates a state belongs to: ``upper.x``, ``frame.x momentum``, ``loop roll 2``."""
    place = known[state if state in known else state.rpartition(" ")[0]]
    return next(n for n, group in enumerate(groups) if place in group)


@dataclass(frozen=True)
class _Part:
    """Coordinates (c,) that do not couple to others, with the loops that sense and push them.

    Attributes
    ----------
    plant : Plant
        Those loops alone, `sensed` and `pushed` (l, c).
    mass, stiffness, damping, lossy : (c, c) arrays
        `lossy` is K'' of constant loss angles.
    terms : tuple of Term
        Losses that depend on frequency.
    filters : tuple of (q, q), (q, l), (l, q), (l, l) arrays
        A_f, B_f, C_f, D_f of all filters; a velocity damper is in neither.
    resisting : (c, c) array
        The damping with that of velocity dampers.
    """

    plant: Plant
    mass: Any
    stiffness: Any
    damping: Any
    lossy: Any
    terms: tuple[Any, ...]
    filters: tuple[Any, Any, Any, Any]
    resisting: Any

    @staticmethod
    def of(plant: Plant, group: Any) -> _Part:
        model, rows = plant.model, np.ix_(group, group)
        keep = [n for n in range(len(plant.loops)) if plant.pushed[n, group].any() or plant.sensed[n, group].any()]
        loops, pushed, sensed = tuple(plant.loops[n] for n in keep), plant.pushed[keep][:, group], plant.sensed[keep][:, group]
        damping = model.damping[rows]
        resisting, filters = damping, []
        for n, loop in enumerate(loops):
            if loop.damper is None:
                filters.append(control.filter_matrices(loop))
            else:
                resisting = resisting + loop.damper * np.outer(pushed[n], sensed[n])
                filters.append((np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.zeros((1, 1))))
        return _Part(
            Plant(model, loops, [plant.sensor[n] for n in keep], [plant.actuator[n] for n in keep], sensed, pushed),
            model.mass[rows],
            model.stiffness[rows],
            damping,
            np.zeros(damping.shape) if model.lossy is None else model.lossy[rows].imag,
            tuple(term.within(group) for term in model.terms),
            tuple(_diagonal([one[n] for one in filters]) for n in range(4)),
            resisting,
        )

    def dispersive(self, omega: Any) -> Any:
        """i K'' and all else that depends on frequency, (p, c, c) at frequencies (p,); nothing at 0, where nothing oscillates."""
        result = np.zeros((len(omega), *self.mass.shape), dtype=complex)
        moving = omega > 0
        result[moving] = 1j * self.lossy
        for term in self.terms if moving.any() else ():
            result[moving] += np.einsum("nf,nij->fij", term.at(omega[moving]).all_functions(), term.all_matrices)
        return result

    def dissipated(self, x: Any, omega: Any) -> Any:
        """x^H K'' x + omega x^H C x (p,): what losses and dampers take from motions (c, p) at frequencies (p,)."""
        lost = np.einsum("ip,ij,jp->p", x.conj(), self.lossy, x).real + omega * np.einsum("ip,ij,jp->p", x.conj(), self.damping, x).real
        return lost + sum(value for term in self.terms for value in term.at(omega).dissipated(x).values())


def _diagonal(blocks: list[Any]) -> Any:
    """Matrices along the diagonal of one."""
    result = np.zeros((sum(len(block) for block in blocks), sum(block.shape[1] for block in blocks)))
    row = column = 0
    for block in blocks:
        result[row : row + len(block), column : column + block.shape[1]] = block
        row, column = row + len(block), column + block.shape[1]
    return result


def _root(start: complex, part: _Part, lossy: Any) -> tuple[complex, Any]:
    """A root of T(s) near a pole, and the losses (c, c) there, given those at the pole; the pole itself where Newton's method finds none."""
    if start == 0:  # nothing holds it
        return start, lossy
    s = start
    for _ in range(RENEWALS):
        last, s = s, _newton(s, part, lossy)
        if not np.isfinite(s) or s.imag < 0 or (start.imag > 0) != (s.imag > 0):
            return start, lossy
        if abs(s.imag - last.imag) <= UNCHANGED * abs(s):
            return s, lossy
        lossy = part.dispersive(np.array([s.imag]))[0]
    return start, lossy


def _newton(s: complex, part: _Part, lossy: Any) -> complex:
    """A root of T(s) with given losses (c, c); NaN where none is found."""
    a, b, c, d = part.filters
    size, count = len(part.mass), len(part.mass) + len(a)
    pushed, sensed = part.plant.pushed, part.plant.sensed
    slope, whole = np.eye(count, dtype=complex), np.zeros((count, count), dtype=complex)
    whole[:size, size:], whole[size:, :size] = pushed.T @ c, -b @ sensed
    last, still, real = np.inf, part.stiffness + lossy + pushed.T @ d @ sensed, s.imag == 0
    shape = np.random.default_rng(0).normal(size=count).astype(complex)
    for step in range(NEWTON):
        whole[:size, :size] = still + s * part.resisting + s**2 * part.mass
        whole[size:, size:] = s * np.eye(len(a)) - a
        slope[:size, :size] = part.resisting + 2 * s * part.mass
        row, column = _equilibrated(whole)
        try:
            scaled = np.linalg.solve(row[:, None] * whole * column, row * (slope @ shape))
        except np.linalg.LinAlgError:  # on the root, to the last bit
            return s
        lead = int(np.abs(scaled).argmax())
        found = column * scaled
        if step > 0:  # the first step but finds the shape
            change = shape[lead] / found[lead]
            s = s - (complex(change.real) if real else change)
            if abs(change) <= CONVERGED * abs(s) or last / 2 <= abs(change) <= NEAR * abs(s):
                return s
            last = abs(change)
        shape = found / abs(scaled[lead])
    return complex(np.nan)


def _equilibrated(matrix: Any) -> tuple[Any, Any]:
    """Factors of rows and columns (c,) that bring their largest elements to 1."""
    size = np.abs(matrix)
    row, column = np.ones(len(size)), np.ones(len(size))
    for _ in range(3):
        now = row[:, None] * size * column
        row, column = row / np.sqrt(_largest(now, 1)), column / np.sqrt(_largest(now, 0))
    return row, column


def _largest(size: Any, axis: int) -> Any:
    largest = size.max(axis, initial=0.0)
    return np.where(largest > 0, largest, 1.0)


def _shape(s: complex, part: _Part, lossy: Any) -> Any:
    """Motion (c,) of the coordinates in a pole s."""
    pushed, sensed = part.plant.pushed, part.plant.sensed
    root = np.sqrt(np.abs(np.diag(part.stiffness)) + abs(s) ** 2 * np.diag(part.mass))
    near = s * (1 + ASIDE)
    dynamic = part.stiffness + lossy + near * part.damping + near**2 * part.mass + (pushed.T * _fed(np.array([near]), part)[:, 0]) @ sensed
    shape = np.random.default_rng(0).normal(size=len(root)).astype(complex)
    for _ in range(STEPS):
        shape = np.linalg.solve(dynamic / np.outer(root, root), shape)
        shape = shape / np.abs(shape).max()
    return shape / root


def _fed(s: Any, part: _Part) -> Any:
    """H (l, p) of all loops at complex frequencies (p,)."""
    return np.array([control.filter_response(loop, s / (2j * np.pi)) for loop in part.plant.loops], dtype=complex).reshape(-1, len(s))


def _decays(s: Any, part: _Part, x: Any) -> Any:
    """Real parts (p,) of poles (p,) from their shapes (c, p)."""
    weight = np.einsum("ip,ij,jp->p", x.conj(), part.mass, x).real
    gain = (_fed(s, part) * (part.plant.pushed @ x.conj()) * (part.plant.sensed @ x)).sum(0).imag
    acting = part.dissipated(x, s.imag) + gain
    return np.where(np.abs(acting) > NOTHING * s.imag**2 * weight, -acting / (2 * s.imag * weight), 0.0)
