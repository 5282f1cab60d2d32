"""Derivatives of a design's matrices with wires that bend, by differences.

On `beam` stiffness comes from complex functions, equilibria from iterations, so nothing can be stepped into the complex plane as on `string`
(`derivatives`).  Each number is moved by h and 2h either way, and each matrix A has

    dA/dp = (8 (A(p + h) - A(p - h)) - (A(p + 2h) - A(p - 2h))) / 12h + O(h^4),

a central difference with one step of Richardson's (Phil. Trans. R. Soc. A 210, 307 (1911)).  Matrices change smoothly where modes cross, part or are
degenerate, and on resonances: what becomes of modes and responses follows from the derivatives of matrices as it does on strings.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from suspension_cli.analysis import builds, derivatives, variants
from suspension_cli.analysis.builds import Builds
from suspension_cli.analysis.derivatives import Differentiable, Linear
from suspension_cli.analysis.parameters import Parameter, shifted
from suspension_cli.design import stack
from suspension_cli.design.scene import Array, Scene
from suspension_cli.design.schema import Design
from suspension_cli.errors import Fault, InputError

SHARE = 1e-3
"""Step, of a number or of the change of it that would change a matrix by as much as there is: truncation is its fourth power, rounding is over it."""
FREE = 1e-7
"""Root of an element on a diagonal, of the largest, below which it is a rounding error: a motion that costs nothing."""
NODES = (-2, -1, 1, 2)
"""Steps from a design to those that its derivatives are made of."""


@dataclass(frozen=True)
class Bent(Linear):
    """Matrices, or their derivatives, on `beam`.

    Attributes
    ----------
    dispersive : (f, N, N) complex array
        What comes to the stiffness at each of the frequencies asked for: all losses of wires, blades and springs.
    kept : (2,) bool array
        See `mirrors`.
    """

    dispersive: Any
    kept: Any

    @cached_property
    def mirrors(self) -> Any:
        """As of strings, with the clamps of wires and what they are made of."""
        return self.kept

    @property
    def matters(self) -> bool:
        """Whether anything is not 0."""
        return super().matters or bool(self.dispersive.any())

    def at(self, number: int) -> Bent:
        """The same at one of the frequencies."""
        more = self.dispersive[number]
        return replace(self, stiffness=self.stiffness + more.real, loss=self.loss + more.imag)


def changes(design: Design, numbers: Sequence[Parameter], level: str, omega: Sequence[float] = ()) -> tuple[Differentiable, Mapping[str, Linear | None]]:
    """A design on a rung, and the derivatives of its matrices: exact ones on ``string``; see `derived`."""
    if level == "beam":
        return derived(design, numbers, omega)
    base = derivatives.prepared(design)
    return base, {item.name: derivatives.of(base, item.name) for item in numbers}


def at(linear: Linear, number: int) -> Linear:
    """Matrices at one of the frequencies asked for; those of strings are the same at all."""
    return linear.at(number) if isinstance(linear, Bent) else linear


def derived(design: Design, numbers: Iterable[Parameter], omega: Sequence[float] = ()) -> tuple[Differentiable, dict[str, Bent | None]]:
    """A design on `beam`, and the derivatives of its matrices.

    Parameters
    ----------
    design : Design
    numbers : iterable of Parameter
    omega : sequence of float
        Frequencies at which losses count, rad/s.

    Returns
    -------
    Differentiable
        Of strings, but for `linear`, which is a `Bent`.
    changes : dict
        By name; None for a number that cannot change alone: the suspension would not balance as it is drawn.

    Raises
    ------
    InputError
        If there is no equilibrium, or a wire is slack in it.
    """
    base, steps = derivatives.prepared(design), dict[str, float | None]()
    for item in numbers:
        change = derivatives.of(base, item.name)
        steps[item.name] = None if change is None else SHARE * _scale(base.linear, change, item.value)
    moves = [(name, step, node) for name, step in steps.items() if step is not None for node in NODES]
    solved = _solved([design, *(shifted(design, name, node * step) for name, step, node in moves)], np.array(omega, dtype=float), base.scene)
    found: dict[str, Bent | None] = dict.fromkeys(steps)
    for n in range(1, len(solved), len(NODES)):
        name, step, _ = moves[n - 1]
        found[name] = _difference(solved[n : n + len(NODES)], step)
    here = solved[0]
    if here is None:
        raise InputError([Fault("stage", "has no equilibrium near the nominal pose with wires that bend", "see pendsus check")])
    return replace(base, linear=here), found


def _scale(linear: Linear, change: Linear, value: float) -> float:
    """How far a number may move before matrices of strings are others: its size, or less where they change more quickly than in proportion."""
    rates = [np.abs(change.orientation).max()]
    for whole, part in ((linear.mass, change.mass), (linear.stiffness, change.stiffness)):
        own = np.sqrt(np.abs(np.diag(whole)))[6:]
        alive = own > FREE * own.max()
        rates.append(np.abs(part[6:, 6:][np.ix_(alive, alive)] / np.outer(own[alive], own[alive])).max(initial=0.0))
    largest = float(max(rates))
    return min(abs(value) or np.inf, 1 / largest if largest else np.inf, np.inf if value or largest else 1.0)


def _solved(designs: list[Design], omega: Array, scene: Scene) -> list[Bent | None]:
    """Matrices of each design in its equilibrium; None where it has none."""
    result: list[Bent | None] = [None] * len(designs)
    for places, scenes, design in variants.alike(designs, "beam"):
        found = builds.balance(stack.stacked(scenes), design, level="beam", allow_unstable=True)
        for place, one in zip(places, _each(found, omega, scene), strict=True):
            result[place] = one
    return result


def _each(found: Builds, omega: Array, scene: Scene) -> list[Bent | None]:
    """Matrices of each build of a batch."""
    model, count = found.model, len(found.status)
    which, size = np.arange(count), model.size
    dispersive = np.zeros((count, len(omega), size, size), dtype=complex)
    for n, at in enumerate(omega):
        for term in found.terms:
            term.add(dispersive[:, n], np.full(count, at), which)
    dispersive = (dispersive + np.swapaxes(dispersive, -1, -2)) / 2
    mass, stiffness, damping = (np.broadcast_to(matrix, (count, size, size)) for matrix in (model.mass, model.stiffness, model.damping))
    loss = np.zeros((count, size, size)) if model.lossy is None else np.broadcast_to(model.lossy.imag, (count, size, size))
    assert model.orientation is not None
    turned, stands = model.orientation, found.status == builds.GOOD
    return [Bent(mass[n], stiffness[n], damping[n], loss[n], turned[n], scene, dispersive[n], found.mirrors[n]) if stands[n] else None for n in range(count)]


def _difference(around: list[Bent | None], step: float) -> Bent | None:
    """The derivative from the designs at `NODES`; None if one of them is not there."""
    if any(one is None for one in around):
        return None
    before, near, after, far = (one for one in around if one is not None)

    def slope(name: str) -> Any:
        a, b, c, d = (getattr(one, name) for one in (before, near, after, far))
        return (8 * (c - b) - (d - a)) / (12 * step)

    moving = {name: slope(name) for name in ("mass", "stiffness", "damping", "loss", "orientation", "dispersive")}
    return replace(near, **moving, kept=np.all([one.kept for one in (before, near, after, far)], axis=0))
