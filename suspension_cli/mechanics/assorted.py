"""Wires that bend, twist and have mass in many builds at once: in each as long and as taut as it hangs there.

No two wires of imperfect builds are alike, so a model of many builds adds to K + i omega C - omega^2 M

    sum over wires of G (F(omega) - F(0)) G^T,      F(0) without loss,

with the dynamic stiffness F (12, 12) of a wire against the motion of its ends and the forms G (N, 12) of those; the builds and their
frequencies stand side by side in the last axis of `mechanics.fibre`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from suspension_cli.design.fibres import Fibre, Gas
from suspension_cli.design.scene import Index, Scene
from suspension_cli.mechanics import assemble, hanging, string
from suspension_cli.mechanics.blocks import unsplit
from suspension_cli.mechanics.dispersion import LossTerm
from suspension_cli.mechanics.distributed import Drag, gas_terms, loss_terms, lossless, wire_forms
from suspension_cli.mechanics.equilibrium import Equilibrium
from suspension_cli.mechanics.fibre import PARTS, WIDTH, Strand, fitted
from suspension_cli.mechanics.model import LinearModel
from suspension_cli.mechanics.pose import Layout, layout

ENDS = sum(WIDTH.values())
"""Coordinates of the two ends of a wire."""


class Assorted(Protocol):
    """A part of a model of many builds that depends on frequency."""

    def add(self, dynamic: Any, omega: Any, which: Index) -> None:
        """Add it to dynamic stiffnesses (q, N, N) of builds (q,) at a frequency (q,) each, rad/s, in place."""
        ...

    def spread(self, from_new: Any) -> Assorted:
        """The same for new coordinates, from which the old ones follow as `from_new` (N, N') @ new."""
        ...


@dataclass(frozen=True)
class AssortedWire:
    """One wire in many builds.

    Attributes
    ----------
    fibre : Fibre
        As drawn.
    length, tension, stiffness, torsion : (p,) arrays
        In equilibrium: m, N; against stretching, N/m; against twisting, N m/rad, where it is given (else 0).
    massive : bool
        Whether its mass counts (`violin`).
    surrounded : Gas or None
    rows : (r,) int array
        Coordinates that move its ends.
    forms : (p, r, 12) array
        How they do, for all of `fibre.PARTS`.
    """

    fibre: Fibre
    length: Any
    tension: Any
    stiffness: Any
    torsion: Any
    massive: bool
    surrounded: Gas | None
    rows: Index
    forms: Any

    def add(self, dynamic: Any, omega: Any, which: Index) -> None:
        """Add it to dynamic stiffnesses (q, N, N) of builds, in place."""
        tension = self.tension[which]
        fibre = fitted(self.fibre, self.length[which], self.stiffness[which], tension, self.torsion[which])
        strand = Strand(fibre, tension, self.massive, lossy=True, surrounded=self.surrounded)
        moving = strand.at(omega)
        ends = np.zeros((len(which), ENDS, ENDS), dtype=complex)
        start = 0
        for part in PARTS:
            own = slice(start, start + WIDTH[part])
            ends[:, own, own] = np.moveaxis(moving.stiffness(part) - strand.resting(part), -1, 0)
            start = own.stop
        forms = self.forms[which]
        dynamic[:, self.rows[:, None], self.rows] += forms @ ends @ np.swapaxes(forms, -1, -2)

    def spread(self, from_new: Any) -> AssortedWire:
        """The same for new coordinates."""
        some = from_new[self.rows]
        rows = np.flatnonzero(some.any(0))
        return replace(self, rows=rows, forms=some[:, rows].T @ self.forms)


@dataclass(frozen=True)
class AssortedLoss:
    """A `LossTerm` whose matrix (p, N, N), or (N, N) for all, is that of many builds."""

    term: LossTerm

    def add(self, dynamic: Any, omega: Any, which: Index) -> None:
        """Add it to dynamic stiffnesses (q, N, N) of builds, in place."""
        matrix = self.term.matrix
        own = matrix[which] if matrix.ndim > 2 else matrix
        dynamic += 1j * self.term.angle(omega)[:, None, None] * own

    def spread(self, from_new: Any) -> AssortedLoss:
        """The same for new coordinates."""
        return AssortedLoss(self.term.spread(from_new))


def linear_model(scene: Scene, drag: Drag = (), *, massive: bool, split: bool = False) -> tuple[LinearModel, Equilibrium, tuple[Assorted, ...]]:
    """Linear models of many builds in equilibrium, static and without loss, and what depends on frequency.

    Parameters
    ----------
    scene : Scene
        With one batch axis; `fibres` filled.
    drag, massive
        As for `distributed.linear_model`.
    split : bool
        Whether mirror symmetries that all builds share are split off; then none depends on the others only if all have the same.

    Returns
    -------
    LinearModel
        With the builds as first axis.
    Equilibrium
        Not necessarily converged.
    terms : tuple of Assorted
    """
    numbering = layout(scene)
    scene, found = hanging.balanced(scene, numbering)
    model = assemble.linear_model(lossless(scene), found, split=split)
    plain = unsplit(numbering)
    lossy = [*loss_terms(scene, numbering, found.pose, plain), *gas_terms(scene, numbering, found.pose, plain, drag)]
    terms = [*_wires(scene, numbering, found, massive=massive), *(AssortedLoss(term) for term in lossy if isinstance(term, LossTerm))]
    return model, found, tuple(term.spread(model.basis) if split else term for term in terms)


def _wires(scene: Scene, numbering: Layout, found: Equilibrium, *, massive: bool) -> list[AssortedWire]:
    wires, fibres, result = scene.wires, scene.fibres, []
    assert fibres is not None
    every = wire_forms(scene, numbering, found.pose)
    forms = np.concatenate([every[part] for part in PARTS], axis=-1)
    length = string.state(scene, found.pose).length
    stiffness, torsion = (np.broadcast_to(values, found.tension.shape) for values in (wires.stiffness, wires.torsion))
    for n, fibre in enumerate(fibres.wire):
        bodies = [6 * body + np.arange(6) for body in (wires.upper[n], wires.lower[n])]
        tip = numbering.blade[wires.blade[n]] if wires.blade[n] >= 0 else np.zeros(0, dtype=np.intp)
        rows = np.concatenate([*bodies, tip[tip < numbering.size]])
        own = (..., n)
        result.append(AssortedWire(fibre, length[own], found.tension[own], stiffness[own], torsion[own], massive, fibres.gas, rows, forms[:, rows, n]))
    return result
