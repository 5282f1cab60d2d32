"""State space: x' = A x + B u, y = C x + D u, with named states, inputs and outputs.

With body coordinates q (massless ones eliminated) the equations of motion are

    M q'' + Cv q' + K q + Ms s'' + Cs s' + Ks s = f

for motions s of the support.  In z = q + M^-1 Ms s the accelerations of the support drop out, and in
w = z' + M^-1 (Cv z + (Cs - Cv M^-1 Ms) s) its velocities do, so that displacements of the support are a proper input:

    z' = w - M^-1 (Cv z + Cs~ s),    w' = M^-1 (f - K z - Ks~ s),
    Cs~ = Cs - Cv M^-1 Ms,    Ks~ = Ks - K M^-1 Ms.

Where nothing damps, w is the velocity.  Loss angles have no finite state space: each block's modes get the viscous
damping that gives them the same Q, and `band` says over which frequencies the result agrees with the direct solution.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from suspension_cli.analysis import response, signals
from suspension_cli.analysis.signals import Signal
from suspension_cli.design.scene import Array, Index
from suspension_cli.errors import Fault, InputError
from suspension_cli.mechanics import condensed
from suspension_cli.mechanics.model import LinearModel

FAINT = 1e-6
"""Share of an output's largest response below which another is judged against that."""


@dataclass(frozen=True)
class StateSpace:
    """A linear system in state space.

    Attributes
    ----------
    a, b, c, d : arrays (n, n), (n, i), (o, n), (o, i)
        SI.
    state, state_unit, input, input_unit, output, output_unit : tuple of str
    """

    a: Array
    b: Array
    c: Array
    d: Array
    state: tuple[str, ...]
    state_unit: tuple[str, ...]
    input: tuple[str, ...]
    input_unit: tuple[str, ...]
    output: tuple[str, ...]
    output_unit: tuple[str, ...]

    def at(self, frequency: Array) -> Any:
        """The transfer matrix (f, o, i) by a dense solve at every frequency in Hz.

        States are scaled for it by powers of 2 so that A is balanced, as MATLAB does: rates in SI are some omega times larger than
        displacements, and pivoting that takes this for a difference in weight loses up to 9 digits far above the modes.
        """
        from scipy.linalg import matrix_balance

        s = 2j * np.pi * np.asarray(frequency)
        scale = matrix_balance(self.a, permute=False, separate=True)[1][0] if len(self.a) else np.ones(0)
        dynamic = s[:, None, None] * np.eye(len(scale)) - self.a * scale / scale[:, None]
        drive = np.broadcast_to((self.b / scale[:, None]).astype(complex), (len(s), *self.b.shape))
        return (self.c * scale) @ np.linalg.solve(dynamic, drive) + self.d


def build(model: LinearModel, inputs: list[Signal], outputs: list[Signal]) -> StateSpace:
    """State space from support motions and forces to motions.

    Parameters
    ----------
    model : LinearModel
        Without batch axes.
    inputs, outputs : list of Signal

    Returns
    -------
    StateSpace
        Of the blocks that the signals touch, no more.
    """
    rows = np.array([signals.row(signal, model) for signal in outputs])
    drives = np.array([signals.row(signal, model) for signal in inputs])
    return assemble(model, drives, inputs, rows, outputs)


def assemble(model: LinearModel, drives: Array, inputs: list[Signal], rows: Array, outputs: list[Signal], *, undriven: bool = False) -> StateSpace:
    """State space from linear forms (i, N) that drive to linear forms (o, N) that are watched.

    Of the blocks that are driven and watched; of all that are watched if `undriven`.
    """
    acts = np.array([signal.acts for signal in inputs], dtype=bool)
    drives = drives.reshape(len(inputs), model.size)
    moves = np.where(acts[:, None], 0.0, drives[:, :6]).T
    forces = np.where(acts[:, None], drives, 0.0).T
    a: list[Array] = []
    b: list[Array] = []
    c: list[Array] = []
    feed = rows[:, :6] @ moves
    names: list[str] = []
    for block in condensed.condensed_blocks(model):
        if (not undriven and not block.driven(moves, forces).any()) or not rows[:, [*block.keep, *block.drop]].any():
            continue
        part = _block(block, moves, forces, rows)
        a.append(part.a)
        b.append(part.b)
        c.append(part.c)
        feed = feed + part.d
        names += [f"{model.coordinate[n]}{kind}" for kind, coordinates in part.states for n in coordinates]
    size = sum(len(part) for part in a)
    whole, place = np.zeros((size, size)), 0
    for part in a:
        whole[place : place + len(part), place : place + len(part)] = part
        place += len(part)
    return StateSpace(
        a=whole,
        b=np.concatenate([np.zeros((0, len(inputs))), *b]),
        c=np.concatenate([np.zeros((len(outputs), 0)), *c], axis=1),
        d=feed,
        state=tuple(names),
        state_unit=tuple(_unit(name) for name in names),
        input=tuple(signal.text for signal in inputs),
        input_unit=tuple(signal.unit for signal in inputs),
        output=tuple(signal.text for signal in outputs),
        output_unit=tuple(signal.unit for signal in outputs),
    )


def _unit(state: str) -> str:
    name, _, kind = state.partition(" ")
    linear = name.rsplit(".", 1)[1] in "xyz"
    if kind == "momentum":
        return "N s" if linear else "N m s"
    return ("m" if linear else "rad") + ("/s" if kind else "")


@dataclass(frozen=True)
class _Part:
    """One block: x' = A x + B u, y = C x + D u, and the kept coordinates that its states belong to, by kind of state."""

    a: Array
    b: Array
    c: Array
    d: Array
    states: tuple[tuple[str, Index], ...]


def _block(block: condensed.Block, moves: Array, forces: Array, rows: Array) -> _Part:
    """One block; `moves` (6, i) and `forces` (N, i) are what unit inputs do, `rows` (o, N) the outputs.

    Coordinates b without mass that a damper holds (a support structure told by its stiffness alone) add momenta p of that damper:

        p = U^T (C_ba a + C_bb b + C_bs s),    p' = U^T (f - K_ba a - K_bb b - K_bs s),

    with U the directions that dampers resist; in the others the forces of springs balance.  Both together give b.
    """
    from scipy.linalg import qr

    heavy = np.flatnonzero((block.mass[:, 6:] != 0).any(1))
    light = np.setdiff1d(np.arange(len(block.keep)), heavy)
    mass = block.mass[np.ix_(heavy, 6 + heavy)]
    stiffness, damping = block.stiffness.real, block.damping.copy()
    if np.iscomplexobj(block.stiffness):
        damping[np.ix_(heavy, 6 + heavy)] += _equivalent(block, mass, heavy, light)
    push = forces[block.keep] + block.recover.real @ forces[block.drop]
    k, c = stiffness[:, 6:], damping[:, 6:]
    k_s, c_s = stiffness[:, :6] @ moves, damping[:, :6] @ moves
    shift = -np.linalg.solve(mass, block.mass[heavy, :6] @ moves)  # a = z + shift u
    resisted, _, _ = np.linalg.svd(c[np.ix_(light, light)])
    rank = np.linalg.matrix_rank(c[np.ix_(light, light)], tol=1e-12 * np.abs(c).max(initial=0.0)) if len(light) else 0
    held, free = resisted[:, :rank].T, resisted[:, rank:].T
    if np.abs(free @ damping[light]).max(initial=0.0) > 1e-12 * np.abs(damping).max(initial=0.0):
        remedy = "give [support] a mass and inertia"
        raise InputError([Fault("control.loop", "a damper pushes a support structure without mass along what it does not sense", remedy)])
    solve = np.linalg.inv(np.concatenate([held @ c[np.ix_(light, light)], free @ k[np.ix_(light, light)]]))
    given = np.concatenate([held @ c[np.ix_(light, heavy)], free @ k[np.ix_(light, heavy)]])
    follow = _sum(np.zeros_like(given), -solve, given)
    # coordinates q = of_z z + of_p p + of_u u
    of_z, of_p, of_u = np.zeros((len(k), len(heavy))), np.zeros((len(k), rank)), np.zeros((len(k), moves.shape[1]))
    of_z[heavy], of_z[light] = np.eye(len(heavy)), follow
    of_p[light] = solve[:, :rank]
    of_u[heavy], of_u[light] = shift, follow @ shift + solve @ np.concatenate([-held @ c_s[light], free @ (push[light] - k_s[light])])
    z, w, p = (slice(n, m) for n, m in ((0, len(heavy)), (len(heavy), 2 * len(heavy)), (2 * len(heavy), 2 * len(heavy) + rank)))
    a, b = np.zeros((p.stop, p.stop)), np.zeros((p.stop, moves.shape[1]))
    a[z, w] = np.eye(len(heavy))
    a[z, z] = -np.linalg.solve(mass, _sum(c[np.ix_(heavy, heavy)], c[np.ix_(heavy, light)], follow))
    a[w, z] = -np.linalg.solve(mass, _sum(k[np.ix_(heavy, heavy)], k[np.ix_(heavy, light)], follow))
    a[p, z] = -held @ _sum(k[np.ix_(light, heavy)], k[np.ix_(light, light)], follow)
    a[z, p], a[w, p], a[p, p] = -np.linalg.solve(mass, c[heavy] @ of_p), -np.linalg.solve(mass, k[heavy] @ of_p), -held @ k[light] @ of_p
    b[z] = -np.linalg.solve(mass, _sum(c_s[heavy], c[heavy], of_u))
    b[w] = np.linalg.solve(mass, push[heavy] - _sum(k_s[heavy], k[heavy], of_u))
    b[p] = held @ (push[light] - _sum(k_s[light], k[light], of_u))
    seen = rows[:, block.keep] + rows[:, block.drop] @ block.recover.real.T
    at_once = block.yielding.real @ (forces[block.drop] - block.pulled.real @ moves)
    seen_z, seen_p = seen @ of_z, seen @ of_p
    leading = light[qr(held, mode="r", pivoting=True)[-1][:rank]] if rank else light[:0]
    return _Part(
        a,
        b,
        np.concatenate([seen_z, np.zeros_like(seen_z), seen_p], axis=1),
        seen @ of_u + rows[:, block.drop] @ at_once,
        (("", block.keep[heavy]), (" rate", block.keep[heavy]), (" momentum", block.keep[leading])),
    )


def _sum(direct: Array, matrix: Array, shift: Array) -> Array:
    """direct + matrix @ shift, exactly 0 where the summands cancel (a spurious 1e-16 would pose as a coupling and add zeros)."""
    total, size = direct + matrix @ shift, np.abs(direct) + np.abs(matrix) @ np.abs(shift)
    return np.where(np.abs(total) > 64 * np.finfo(float).eps * size, total, 0.0)


def _equivalent(block: condensed.Block, mass: Array, heavy: Index, light: Index) -> Array:
    """Viscous damping of a block's coordinates with mass, for the loss angles of all."""
    stiffness = block.stiffness[:, 6:]
    across = stiffness[np.ix_(light, heavy)]
    whole = stiffness[np.ix_(heavy, heavy)] - across.T @ np.linalg.solve(stiffness[np.ix_(light, light)], across)
    return equivalent_damping(mass, whole.real, whole.imag)


def equivalent_damping(mass: Array, stiffness: Array, loss: Array) -> Array:
    """Viscous damping that gives every mode of a block the Q that its loss angles give it.

    With modes v of unit modal mass, eta = v K'' v / omega^2 is the mode's loss angle; M (sum of v eta omega v^T) M damps it by as much.
    """
    root = np.linalg.inv(np.linalg.cholesky(mass))
    values, vectors = np.linalg.eigh(root @ stiffness @ root.T)
    shapes = root.T @ vectors
    dissipated = np.einsum("im,ij,jm->m", shapes, loss, shapes)
    rate = np.where(values > 0, dissipated / np.sqrt(np.where(values > 0, values, 1.0)), 0.0)
    return mass @ (shapes * rate) @ shapes.T @ mass


def band(
    system: Any, model: LinearModel, inputs: list[Signal], outputs: list[Signal], tolerance: float = 1e-9
) -> tuple[tuple[float, float] | None, float, tuple[float, float]]:
    """Where a system agrees with the direct solution.

    Parameters
    ----------
    system : object with ``at(frequency)``
    model, inputs, outputs
    tolerance : float
        Largest error relative to each response's magnitude, or to `FAINT` of the same output's largest response to an input of
        the same unit: of responses fainter than that the direct solution does not have all digits either.

    Returns
    -------
    band : tuple of float or None
        Widest band in Hz, around the modes, in which it agrees; None if it does at no two neighbouring frequencies.
    worst : float
        Largest error at the frequencies tried; infinite where a response is no number.
    tried : tuple of float
        The frequencies tried go from 1/100 of the lowest to 100 times the highest mode, Hz.
    """
    lowest, highest = mode_range(model)
    frequency = np.geomspace(lowest / 100, highest * 100, 801)
    exact = response.solve(model, frequency, inputs, outputs).value
    found = system.at(frequency)
    size = np.abs(exact)
    for unit in {signal.unit for signal in inputs}:
        alike = [signal.unit == unit for signal in inputs]
        size[:, :, alike] = np.where(exact[:, :, alike] == 0, 0.0, np.maximum(size[:, :, alike], FAINT * size[:, :, alike].max(-1, keepdims=True)))
    error = np.where(size > 0, np.abs(found - exact) / np.where(size > 0, size, 1.0), np.where(found == 0, 0.0, np.inf)).max((1, 2))
    error = np.where(np.isnan(error), np.inf, error)
    worst, tried = float(error.max()), (float(frequency[0]), float(frequency[-1]))
    edges = np.flatnonzero(np.diff(np.concatenate([[False], error <= tolerance, [False]]).astype(int)))
    starts, stops = edges[::2], edges[1::2]
    if (stops - starts).max(initial=0) < 2:
        return None, worst, tried
    widest = int((stops - starts).argmax())
    return (float(frequency[starts[widest]]), float(frequency[stops[widest] - 1])), worst, tried


def mode_range(model: LinearModel) -> tuple[float, float]:
    """Lowest and highest mode that is neither rigid nor unstable, Hz."""
    from suspension_cli.analysis import modes

    found = modes.solve(model).omega_squared
    positive = np.sqrt(found[found > 0]) / (2 * np.pi)
    return (float(positive[0]), float(positive[-1])) if len(positive) else (1.0, 1.0)
