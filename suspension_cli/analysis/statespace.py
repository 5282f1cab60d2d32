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
from suspension_cli.design.scene import Array
from suspension_cli.mechanics.model import LinearModel


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
    for block in response.condensed_blocks(model):
        if (not undriven and not block.driven(moves, forces).any()) or not rows[:, [*block.keep, *block.drop]].any():
            continue
        part = _block(block, moves, forces, rows)
        a.append(part[0])
        b.append(part[1])
        c.append(part[2])
        feed = feed + part[3]
        names += [model.coordinate[n] for n in block.keep] + [f"{model.coordinate[n]} rate" for n in block.keep]
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
    name, _, rate = state.partition(" ")
    return ("m" if name.rsplit(".", 1)[1] in "xyz" else "rad") + ("/s" if rate else "")


def _block(block: response.Block, moves: Array, forces: Array, rows: Array) -> tuple[Array, Array, Array, Array]:
    """A, B, C and the direct feed of one block."""
    count = len(block.keep)
    mass, mass_support = block.mass[:, 6:], block.mass[:, :6]
    stiffness, stiffness_support = block.stiffness[:, 6:].real, block.stiffness[:, :6].real
    damping, damping_support = block.damping[:, 6:], block.damping[:, :6]
    if np.iscomplexobj(block.stiffness):
        damping = damping + equivalent_damping(mass, stiffness, block.stiffness[:, 6:].imag)
        damping_support = damping_support + 0.0
    shift = -np.linalg.solve(mass, mass_support)  # q = z + shift s
    pulled = _sum(stiffness_support, stiffness, shift)
    dragged = _sum(damping_support, damping, shift)
    a, b = np.zeros((2 * count, 2 * count)), np.zeros((2 * count, moves.shape[1]))
    a[:count, :count] = -np.linalg.solve(mass, damping)
    a[:count, count:] = np.eye(count)
    a[count:, :count] = -np.linalg.solve(mass, stiffness)
    b[:count] = -np.linalg.solve(mass, dragged @ moves)
    b[count:] = np.linalg.solve(mass, forces[block.keep] + block.recover.real @ forces[block.drop] - pulled @ moves)
    seen = rows[:, block.keep] + rows[:, block.drop] @ block.recover.real.T
    at_once = block.yielding.real @ (forces[block.drop] - block.pulled.real @ moves)
    c = np.concatenate([seen, np.zeros_like(seen)], axis=1)
    return a, b, c, seen @ shift @ moves + rows[:, block.drop] @ at_once


def _sum(direct: Array, matrix: Array, shift: Array) -> Array:
    """direct + matrix @ shift, exactly 0 where the summands cancel (a spurious 1e-16 would pose as a coupling and add zeros)."""
    total, size = direct + matrix @ shift, np.abs(direct) + np.abs(matrix) @ np.abs(shift)
    return np.where(np.abs(total) > 64 * np.finfo(float).eps * size, total, 0.0)


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


def band(system: Any, model: LinearModel, inputs: list[Signal], outputs: list[Signal], tolerance: float = 1e-9) -> tuple[float, float, float]:
    """Where a system agrees with the direct solution.

    Parameters
    ----------
    system : object with ``at(frequency)``
    model, inputs, outputs
    tolerance : float
        Largest error relative to each response's own magnitude.

    Returns
    -------
    low, high : float
        Widest band in Hz, around the modes, in which it holds (0, 0 if nowhere).
    worst : float
        Largest error at the frequencies tried, from 1/100 of the lowest to 100 times the highest mode.
    """
    lowest, highest = mode_range(model)
    frequency = np.geomspace(lowest / 100, highest * 100, 801)
    exact = response.solve(model, frequency, inputs, outputs).value
    found = system.at(frequency)
    size = np.abs(exact)
    error = np.where(size > 0, np.abs(found - exact) / np.where(size > 0, size, 1.0), np.where(found == 0, 0.0, np.inf)).max((1, 2))
    good = error <= tolerance
    if not good.any():
        return 0.0, 0.0, float(error.max())
    edges = np.flatnonzero(np.diff(np.concatenate([[False], good, [False]]).astype(int)))
    starts, stops = edges[::2], edges[1::2]
    widest = int((stops - starts).argmax())
    return float(frequency[starts[widest]]), float(frequency[stops[widest] - 1]), float(error.max())


def mode_range(model: LinearModel) -> tuple[float, float]:
    """Lowest and highest mode that is neither rigid nor unstable, Hz."""
    from suspension_cli.analysis import modes

    found = modes.solve(model).omega_squared
    positive = np.sqrt(found[found > 0]) / (2 * np.pi)
    return (float(positive[0]), float(positive[-1])) if len(positive) else (1.0, 1.0)
