"""Normal modes: frequencies, shapes, and where each mode lives.

Each block of coordinates is solved alone: coordinates without inertia (tips of blades without tip mass) are eliminated,
then K v = omega^2 M v is a symmetric eigenvalue problem, solved so that soft modes keep their digits (`analysis.graded`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from suspension_cli.analysis import graded, quality
from suspension_cli.conventions import WIRE_WORDS, WORDS
from suspension_cli.design.scene import Array, Index
from suspension_cli.mechanics import reduction
from suspension_cli.mechanics.model import LinearModel

PER_MODE = ("omega_squared", "shape", "energy", "tip_energy", "block", "q", "dilution", "wire_energy", "order", "decay_rate")
"""What `Modes` has of every mode."""
DAMPING_BAND = (0.5, 5.0)
"""Hz; every mode that is to be damped from the top mass lies here (Husman et al. 2000, sections 1 and 5a)."""
COUPLED = 0.01
"""Share of its kinetic energy that a mode must have in the top mass to be damped from there; the paper says "strongly"."""
NEAR = 2e-3
"""Relative difference of frequencies below which violin modes of like wires are listed as one family."""
DEGENERATE = 1e-9
"""Relative difference of omega^2 below which modes of one block are one degenerate group."""


@dataclass(frozen=True)
class Modes:
    """The modes of one design, in ascending order of omega^2: unstable ones first, then rigid ones.

    Attributes
    ----------
    body : tuple of str
    coordinate : tuple of str
        The N - 6 coordinates of `shape`.
    omega_squared : (m,) array
        (rad/s)^2, of a damped mode |s|^2; negative for an unstable mode, exactly 0 for a rigid or an overdamped one.
    shape : (m, N - 6) array
        Unit modal mass; the largest body coordinate (by kinetic energy) is positive.
    energy : (m, n, 6) array
        Share of each body's degree of freedom in the mode's kinetic energy.
    tip_energy : (m, N - 6 - 6 n) array
        Share of each blade tip's motion on its blade; with `energy` it sums to 1.
    block : (m,) int array
        Modes of different blocks do not couple.
    q : (m,) array
        Quality factor from the design's loss angles and dampers; infinite where none acts.  To first order from `solve`, exact from `analysis.damped`.
    dilution : (m,) array
        Total energy over that in lossy elements (`beam`, `violin`; else NaN).
    wire : tuple of str
        What wires with mass can do: ``test.violin-x``, ``test.twist``, ... (`violin`; else none).
    wire_energy : (m, k) array
        Share of each of these in the mode's kinetic energy; with `energy` and `tip_energy` it sums to 1.
    order : (m,) int array
        Of a mode of wires, the number of half waves along them; 0 of others.
    decay_rate : (m,) array
        1/s, of the amplitude; 0 for a mode that is rigid, unstable or feels no loss.
    """

    body: tuple[str, ...]
    coordinate: tuple[str, ...]
    omega_squared: Array
    shape: Array
    energy: Array
    tip_energy: Array
    block: Index
    q: Array
    dilution: Array
    wire: tuple[str, ...]
    wire_energy: Array
    order: Index
    decay_rate: Array

    @property
    def frequency(self) -> Array:
        """Hz; 0 for a rigid mode, NaN for an unstable or an overdamped one."""
        return np.sqrt(np.where((self.omega_squared < 0) | self.overdamped, np.nan, self.omega_squared)) / (2 * np.pi)

    @property
    def overdamped(self) -> Any:
        """Which modes (m,) decay without oscillating."""
        return (self.omega_squared == 0) & (self.decay_rate > 0)

    @property
    def growth_rate(self) -> Array:
        """1/s; 0 unless unstable."""
        return np.sqrt(np.maximum(-self.omega_squared, 0.0))

    @property
    def stable(self) -> bool:
        """Whether no mode grows."""
        return not bool((self.omega_squared < 0).any())

    @property
    def shares(self) -> Array:
        """Kinetic-energy share of everything in `place`, (m, N - 6 + k)."""
        return np.concatenate([self.energy.reshape(len(self.energy), -1), self.tip_energy, self.wire_energy], axis=1)

    @property
    def place(self) -> tuple[str, ...]:
        """What can hold energy: every coordinate, then what wires do."""
        return (*self.coordinate, *self.wire)

    @property
    def home(self) -> list[tuple[str, str]]:
        """Body (or blade, or wires) and degree of freedom that hold most of each mode's kinetic energy."""
        # shares that differ by rounding alone (two equal bodies, a pair of blades) go to the first
        first = [int(np.flatnonzero(row >= row.max() - 1e-9)[0]) for row in self.shares]
        return [place(self.place[i]) for i in first]

    @property
    def label(self) -> list[str]:
        """``test pitch``, in the field's words."""
        return [described(f"{body}.{dof}") + (f" {order}" if order else "") for (body, dof), order in zip(self.home, self.order, strict=True)]

    @property
    def top_share(self) -> Array:
        """Share of each mode's kinetic energy in the top mass, (m,): how strongly it can be damped from there."""
        return self.energy[:, 0].sum(-1)

    @property
    def verdict(self) -> list[str]:
        """The paper's criterion for damping from the top mass, a word a mode."""
        low, high = DAMPING_BAND
        words = []
        for omega2, frequency, share in zip(self.omega_squared, self.frequency, self.top_share, strict=True):
            if omega2 < 0 or not frequency > 0:
                words.append("unstable" if omega2 < 0 else "rigid" if frequency == 0 else "overdamped")
            elif not low <= frequency <= high:
                words.append(f"below {low:g} Hz" if frequency < low else f"above {high:g} Hz")
            else:
                words.append("can be damped" if share >= COUPLED else "couples weakly")
        return words

    @property
    def groups(self) -> list[list[int]]:
        """Modes in order, those of the wires of one stage that lie together (one family, one order) as one group."""
        result: list[list[int]] = []
        home, frequency = self.home, self.frequency
        for n, order in enumerate(self.order):
            before = result[-1][-1] if result else -1
            kin = before >= 0 and order and order == self.order[before] and home[n][0] == home[before][0] and home[n][1][:5] == home[before][1][:5]
            if kin and frequency[n] - frequency[before] < NEAR * frequency[n]:
                result[-1].append(n)
            else:
                result.append([n])
        return result

    def up_to(self, highest: float) -> Modes:
        """The modes up to a frequency (Hz), and those that do not oscillate."""
        return self.some(self.omega_squared <= (2 * np.pi * highest) ** 2)

    def some(self, chosen: Any) -> Modes:
        """Some of the modes, by place."""
        return replace(self, **{name: getattr(self, name)[chosen] for name in PER_MODE})

    def followed_by(self, *others: Modes) -> Modes:
        """These modes and others of the same design after them."""
        return replace(self, **{name: np.concatenate([getattr(each, name) for each in (self, *others)]) for name in PER_MODE})

    def of(self, dof: str, body: str | None = None) -> list[float]:
        """Frequencies (Hz) of the stable modes that live in a degree of freedom (of one body)."""
        here = [(home[1] == dof) and (body in (None, home[0])) for home in self.home]
        return [float(f) for f, yes in zip(self.frequency, here, strict=True) if yes and np.isfinite(f)]


def place(coordinate: str) -> tuple[str, str]:
    """Body (or blade) and degree of freedom of a coordinate's name."""
    body, _, dof = coordinate.rpartition(".")
    return body, dof


def described(coordinate: str) -> str:
    """A coordinate in words: ``test pitch``, ``upper.blade1 tip vertical``."""
    body, dof = place(coordinate)
    return f"{body}{' tip' if '.' in body else ''} {WORDS.get(dof) or WIRE_WORDS[dof]}"


def solve(model: LinearModel) -> Modes:
    """Modes of a linear model without batch axes.

    Parameters
    ----------
    model : LinearModel
        Damping and loss do not count.

    Returns
    -------
    Modes
    """
    tension = graded.TURNING * graded.hanging(model)
    found = [_solve_block(model, block, tension) for block in model.blocks]
    values = np.concatenate([values for values, _ in found])
    shapes = np.zeros((len(values), model.size))
    numbers = np.zeros(len(values), dtype=np.intp)
    start = 0
    for number, (block, (part, vectors)) in enumerate(zip(model.blocks, found, strict=True)):
        here = slice(start, start + len(part))
        shapes[here, block] = vectors.T
        numbers[here] = number
        start = here.stop
    order = np.argsort(values, kind="stable")
    shapes = shapes[order]
    q, dilution = _quality(model, shapes, values[order])
    energy, tips = energies(model, shapes)
    shapes = signed(shapes @ model.basis.T, np.concatenate([energy, tips], axis=1))[:, 6:]
    parts = energy.reshape(len(shapes), -1, 6), tips, numbers[order], q, dilution
    still = (), np.zeros((len(shapes), 0)), np.zeros(len(shapes), dtype=np.intp)
    return Modes(model.body, model.coordinate[6:], values[order], shapes, *parts, *still, decay(values[order], q))


def condensed(model: LinearModel, block: Index) -> tuple[Index, Any, Any, Any]:
    """Mass and stiffness of a block without its massless coordinates.

    Returns
    -------
    kept : (c,) int array
        The coordinates kept.
    mass, stiffness : (..., c, c) arrays
    recover : (..., r, c) array
        What the massless coordinates do for unit motions of the kept ones: -K_bb^-1 K_ba.
    """
    light = model.massless[block]
    a, b = block[~light], block[light]
    mass = model.mass[..., a[:, None], a]
    if not model.batch:
        (stiffness, _), recover = _reduced(model, block)
        return a, mass, stiffness, recover
    stiffness = model.stiffness[..., a[:, None], a]
    if not len(b):
        return a, mass, stiffness, np.zeros((*model.batch, 0, len(a)))
    across = model.stiffness[..., b[:, None], a]
    recover = -np.linalg.solve(model.stiffness[..., b[:, None], b], across)
    stiffness = stiffness + np.swapaxes(across, -1, -2) @ recover
    return a, mass, (stiffness + np.swapaxes(stiffness, -1, -2)) / 2, recover


def _reduced(model: LinearModel, block: Index) -> tuple[tuple[Any, Any], Any]:
    """The stiffness of a block of one model without its massless coordinates, what rounding takes from it, and what these coordinates do."""
    low = np.real(model.low) if graded.known(model) else np.zeros_like(model.stiffness)
    rows = np.ix_(block, np.concatenate([np.arange(6), block]))
    whole, follows = reduction.reduced(model.stiffness[rows], low[rows], model.massless[block])
    high, rest = reduction.rounded(whole)
    return (high[:, 6:], rest[:, 6:]), -follows[:, 6:]


def _solve_block(model: LinearModel, block: Index, tension: float) -> tuple[Array, Array]:
    """omega^2 (m,) and shapes (c, m) of one block, over all of the block's coordinates."""
    light = model.massless[block]
    if light.all():
        return np.zeros(0), np.zeros((len(block), 0))
    kept = block[~light]
    mass = model.mass[np.ix_(kept, kept)]
    (stiffness, low), recover = _reduced(model, block)
    values, own = graded.solve(mass, stiffness, low)
    every = np.zeros((len(values), model.size))
    every[:, kept], every[:, block[light]] = own.T, (recover @ own).T
    values = graded.rigid(values, graded.kept(model, every) if graded.known(model) else graded.rounding(stiffness, own.T), tension)
    if (np.diff(values) <= DEGENERATE * np.abs(values[1:])).any():
        root = np.linalg.cholesky(mass)
        own = np.linalg.solve(root.T, localised(values, root.T @ own))
    shapes = np.zeros((len(block), len(values)))
    shapes[~light] = own
    shapes[light] = recover @ own
    return values, shapes


def localised(values: Array, vectors: Array) -> Array:
    """Within each degenerate group, the basis in which modes live in as few coordinates as possible.

    Any rotation of degenerate modes is as good for the equations; this one does not depend on rounding: each mode
    in turn takes the coordinate in which the group moves most, and the others are made to leave it at rest.
    """
    result, start = vectors.copy(), 0
    while start < len(values):
        stop = start + 1
        while stop < len(values) and values[stop] - values[start] <= DEGENERATE * abs(values[stop]):
            stop += 1
        for first in range(start, stop - 1):
            group = result[:, first:stop]
            size = (group**2).sum(1)
            row = group[int(np.flatnonzero(size >= size.max() * (1 - 1e-9))[0])]
            rotation = np.linalg.qr(np.column_stack([row, np.eye(len(row))]))[0]
            result[:, first:stop] = group @ rotation
        start = stop
    return result


def energies(model: LinearModel, shapes: Array) -> tuple[Array, Array]:
    """Kinetic-energy shares of the bodies' (m, 6 n) and of the tips' coordinates, summing to 1.

    Squares of M^(1/2) v for the M of each body, so never negative; a tip mass carried along counts as its body's.
    """
    bodies = len(model.body)
    result = np.zeros((len(shapes), 6 * bodies))
    for n in range(bodies):
        rows = slice(6 * (n + 1), 6 * (n + 2))
        values, vectors = np.linalg.eigh(model.mass[rows, rows])
        root = (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
        result[:, 6 * n : 6 * (n + 1)] = (shapes[:, rows] @ root) ** 2
    tips = slice(6 * (bodies + 1), model.size)
    mass = model.basis[tips, tips] @ model.mass[tips, tips] @ model.basis[tips, tips].T
    own = (shapes @ model.basis.T)[:, tips] ** 2 * np.diag(mass)
    total = (result.sum(1) + own.sum(1))[:, None]
    return result / total, own / total


def decay(squared: Array, q: Array) -> Array:
    """Decay rates omega / 2 Q (m,) of the amplitudes of weakly damped modes, 1/s."""
    return np.where(squared > 0, np.sqrt(np.maximum(squared, 0.0)) / (2 * np.where(q > 0, q, np.inf)), 0.0)


def _quality(model: LinearModel, shapes: Array, values: Array) -> tuple[Array, Array]:
    """Q = omega^2 / (v K'' v + omega v C v) and dilution for shapes v of unit modal mass."""
    omega = np.sqrt(np.maximum(values, 0.0))
    lost, elastic = quality.dissipated(model, omega, shapes, quality.ends_of(model, shapes))
    return quality.ratio(omega**2, lost), quality.ratio(omega**2, elastic) if model.terms else np.full(len(omega), np.nan)


def signed(shapes: Array, shares: Array) -> Array:
    """Shapes with the sign in which the leading coordinate is positive."""
    lead = shapes[np.arange(len(shapes)), 6 + shares.argmax(1)]
    return shapes * np.where(lead < 0, -1.0, 1.0)[:, None]
