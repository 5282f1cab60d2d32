"""Equilibrium of wires with bending stiffness, which depends on the tension to be found."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.elements import bending, joined_sections, string
from suspension_cli.elements.dynamic_wire import TautWire, fit_to_equilibrium, group_identical
from suspension_cli.equilibrium import solve as equilibrium
from suspension_cli.equilibrium.solve import Equilibrium
from suspension_cli.scene.composition import Fibre, Section
from suspension_cli.scene.pose import Layout
from suspension_cli.scene.scene import Scene

if TYPE_CHECKING:
    from jaxtyping import Inexact

CONVERGED = 1e-12
"""Relative change of tensions below which the bending stiffness of wires is not computed again."""
CLAMP_ITERATIONS = 4
"""Iterations of the distance u from clamp to hinge; each reduces the change by the factor u / l."""
PASSES = 4
"""Most updates of the bending stiffness."""


def solve_bending(scene: Scene, numbering: Layout) -> tuple[Scene, Equilibrium]:
    """Find the equilibrium of a scene whose wires bend.

    Parameters
    ----------
    scene : Scene
        With `fibres`, and at most one batch axis.
    numbering : Layout

    Returns
    -------
    scene : Scene
        With its wires between their clamps, and `flex` for the tensions and lengths in equilibrium.
    found : Equilibrium
        Not necessarily converged: see `Equilibrium.demand`.
    """
    if scene.batch:
        return _solve_batch(scene, numbering)
    scene = _clamped(scene)
    found = equilibrium.solve(scene, numbering)
    tension, threshold = scene.wires.tension, 0.0  # the first time any change counts
    for _ in range(PASSES):
        taut = found.converged and (found.tension > 0).all()
        if not taut or not (np.abs(found.tension - tension) > threshold * np.abs(tension)).any():
            break
        tension, length = found.tension, string.state(scene, found.pose).length
        scene = bending.with_bending(scene, tension, length)
        found = equilibrium.solve(scene, numbering, start=found.pose)
        threshold = CONVERGED
    return scene, found


def _solve_batch(scene: Scene, numbering: Layout) -> tuple[Scene, Equilibrium]:
    """Find the equilibria of many builds by compiled loops, which keep the bending up to date."""
    drawn = scene.drawn
    if drawn is not None:
        drawn = bending.with_planes(to_clamps(replace(drawn, fibres=scene.fibres)))
        drawn = drawn if drawn.batch else bending.with_bending(drawn)
    scene = replace(bending.with_planes(to_clamps(scene)), drawn=drawn)
    found = equilibrium.solve(scene, numbering)
    assert scene.flex is not None and found.flex is not None
    bend = found.flex[..., :6].reshape(*found.flex.shape[:-1], 2, 3)
    return replace(scene, flex=replace(scene.flex, bend=bend, twist=found.flex[..., 6])), found


def _clamped(scene: Scene) -> Scene:
    """Scene whose wires bend between their clamps; so do those of its nominal scene."""
    drawn = scene.drawn
    if drawn is not None:
        drawn = bending.with_bending(to_clamps(replace(drawn, fibres=scene.fibres)))
    return replace(bending.with_bending(to_clamps(scene)), drawn=drawn)


def to_clamps(scene: Scene) -> Scene:
    """Move the ends of wires to their clamps, where the design gives effective hinges instead.

    A wire whose far end is displaced sideways acts on its clamp with a shear force V and a moment
    M, as if it were hinged at u = M / V from there (sqrt(EI / T) for a long uniform one; Gonzalez
    and Saulson, J. Acoust. Soc. Am. 96, 207 (1994)). So the clamps lie u beyond the hinges, in line
    with the wire, which leaves the forces that carry the weight unchanged. For a ribbon u is taken
    in its soft plane. Tension and length are those of the nominal scene: imperfections change them,
    but not the distance of a clamp that is there already.
    """
    fibres, wires = scene.fibres, scene.wires
    assert fibres is not None
    if not any(fibre.effective for fibre in fibres.wire):
        return scene
    kind = np.result_type(scene.kind, *(s.rigidity[0] for f in fibres.wire for s in f.sections))
    ends = np.zeros((*scene.batch, len(wires.label), 2), dtype=kind)
    nominal = scene.drawn or scene
    drawn, shape = nominal.wires, (*nominal.batch, len(wires.label))
    numbers = [np.broadcast_to(v, shape) for v in (drawn.length, drawn.stiffness, drawn.tension)]
    for group in group_identical(fibres.wire, *numbers):
        fibre = fibres.wire[group[0]]
        if fibre.effective:
            own = [v[..., group[0]] for v in numbers]
            if nominal.batch and kind == np.float64:
                distance = _batch_distances(fibre, *own)
            elif nominal.batch:
                distance = _hinge_distances(fibre, *own)
            else:
                distance = _known_distances(fibre.sections, *(v.item() for v in own))
            ends[..., group, :] = distance[..., None, :]
    e, extra = wires.span / wires.length[..., None], ends.sum(-1)
    moved = replace(
        wires,
        upper_point=wires.upper_point - ends[..., :1] * e,
        lower_point=wires.lower_point + ends[..., 1:] * e,
        span=wires.span + extra[..., None] * e,
        length=wires.length + extra,
    )
    return replace(scene, wires=moved)


@lru_cache(maxsize=bending.KNOWN)
def _known_distances(
    sections: tuple[Section, ...], *numbers: complex
) -> Inexact[np.ndarray, "*batch 2"]:
    """Hinge distances (2,) of one wire; most do not change from one design to the next."""
    found = _hinge_distances(bending.bare_fibre(sections), *map(np.asarray, numbers))
    return found if np.imag(found).any() else np.real(found)


def _batch_distances(fibre: Fibre, length: Any, k: Any, tension: Any) -> Any:
    """Hinge distances (p, 2) of a wire in many builds, see `_hinge_distances`."""
    from suspension_cli.compiled import constant  # takes half a second
    from suspension_cli.elements import compiled_wire

    del k  # bending does not depend on it
    result = np.empty((*length.shape, 2))
    compiled_wire.hinge_distances(
        compiled_wire.wire_sections((fibre,)),
        0,
        CLAMP_ITERATIONS,
        constant(length),
        constant(tension),
        result,
    )
    return result


def _hinge_distances(
    fibre: Fibre,
    length: Inexact[np.ndarray, "*batch"],
    k: Inexact[np.ndarray, "*batch"],
    tension: Inexact[np.ndarray, "*batch"],
) -> Inexact[np.ndarray, "*batch 2"]:
    """Distances (..., 2) of the hinges of a wire from its upper and its lower clamp, m.

    Parameters
    ----------
    fibre : Fibre
    length
        Between the hinges, m.
    k, tension
        N/m and N.
    """
    upper = lower = np.zeros(length.size)
    for _ in range(CLAMP_ITERATIONS):
        whole = fit_to_equilibrium(
            fibre, length.ravel() + upper + lower, k.ravel(), tension.ravel(), 0.0
        )
        strand = TautWire(whole, tension.ravel(), massive=False, lossy=False)
        stiffness = joined_sections.to_ends(strand.resting("bend-1"))  # of w_1, w'_1, w_2, w'_2
        upper, lower = stiffness[1, 2] / stiffness[0, 2], stiffness[3, 0] / stiffness[2, 0]
        upper, lower = (ratio * np.sign(ratio.real) for ratio in (upper, lower))
    return np.stack([upper, lower], axis=-1).reshape(*length.shape, 2)
