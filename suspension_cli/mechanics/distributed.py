"""Scene -> LinearModel for wires that bend, twist and have mass (`beam`, `violin`), with all losses as functions of frequency."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from suspension_cli.design.scene import Scene
from suspension_cli.mechanics import assemble, hanging, loss, spring, string
from suspension_cli.mechanics.blocks import Symmetry, symmetry
from suspension_cli.mechanics.dispersion import LossTerm, Term, WireTerm
from suspension_cli.mechanics.equilibrium import Equilibrium
from suspension_cli.mechanics.fibre import ALIKE, Strand, fitted
from suspension_cli.mechanics.model import LinearModel
from suspension_cli.mechanics.pose import Layout, Pose, layout, point_jacobian
from suspension_cli.rotations import cross

Drag = tuple[Any, ...]


def linear_model(scene: Scene, drag: Drag = (), *, massive: bool) -> LinearModel:
    """The linear model of small motions of a scene with fibres.

    Parameters
    ----------
    scene : Scene
        Without batch axes; `fibres` filled.
    drag : tuple of (6, 6) arrays or None
        Damping of each body by the gas around it, in its own frame at its COM.
    massive : bool
        Whether the wires' mass counts (`violin`).

    Returns
    -------
    LinearModel
        Its stiffness is static and lossless; `terms` hold the rest.

    Raises
    ------
    InputError
        If there is no equilibrium, or a wire is slack in it.
    """
    numbering = layout(scene)
    scene, balanced = hanging.balanced(scene, numbering)
    balanced.demand(scene)
    adapted = symmetry(scene, numbering)
    model = assemble.linear_model(lossless(scene), balanced)
    terms = [
        *_wire_terms(scene, numbering, balanced, adapted, massive=massive),
        *loss_terms(scene, numbering, balanced.pose, adapted),
        *gas_terms(scene, numbering, balanced.pose, adapted, drag),
    ]
    return replace(model, terms=tuple(terms))


def lossless(scene: Scene) -> Scene:
    """A scene that dissipates nothing but by its dampers."""
    return replace(
        scene,
        wires=replace(scene.wires, loss=np.zeros_like(scene.wires.loss)),
        blades=replace(scene.blades, loss=np.zeros_like(scene.blades.loss)),
        springs=replace(scene.springs, loss=np.zeros_like(scene.springs.loss)),
    )


def loaded(model: LinearModel) -> LinearModel:
    """A model on `beam` with the mass of its wires, so on `violin`."""
    terms = (replace(term, strand=replace(term.strand, massive=True)) if isinstance(term, WireTerm) else term for term in model.terms)
    return replace(model, terms=tuple(terms))


def _wire_terms(scene: Scene, numbering: Layout, balanced: Equilibrium, adapted: Symmetry, *, massive: bool) -> list[Term]:
    assert scene.fibres is not None
    if not scene.wires.label:
        return []
    forms = wire_forms(scene, numbering, balanced.pose)
    length = string.state(scene, balanced.pose).length
    terms: list[Term] = []
    left = list(range(len(scene.wires.label)))
    while left:
        first = left[0]
        alike = [n for n in left if _alike(scene, balanced.tension, length, first, n)]
        left = [n for n in left if n not in alike]
        tension, k, torsion = (float(v) for v in (balanced.tension[alike].mean(), scene.wires.stiffness[first], scene.wires.torsion[first]))
        fibre = fitted(scene.fibres.wire[first], float(length[alike].mean()), k, tension, torsion)
        strand = Strand(fibre, tension, massive, lossy=True, surrounded=scene.fibres.gas)
        stage = scene.bodies.name[scene.wires.lower[first] - 1]
        some = {part: np.transpose(rows[:, alike], (1, 2, 0)) @ adapted.basis for part, rows in forms.items()}
        terms.append(WireTerm(stage, strand, some, adapted.allowed))
    return terms


def _alike(scene: Scene, tension: Any, length: Any, one: int, other: int) -> bool:
    """Whether two wires share every number that their motion depends on."""
    assert scene.fibres is not None
    wires, (a, b) = scene.wires, (scene.fibres.wire[n] for n in (one, other))
    same = wires.lower[one] == wires.lower[other] and a.sections == b.sections and a.temperature == b.temperature
    return bool(same and all(abs(v[one] - v[other]) <= ALIKE * abs(v[one]) for v in (tension, length, wires.stiffness, wires.torsion)))


def wire_forms(scene: Scene, numbering: Layout, pose: Pose) -> dict[str, Any]:
    """How the ends of every wire move with the coordinates: (..., N, w, c) for each part of `fibre.PARTS`.

    In the axes of the wire as it hangs: e from its upper to its lower end, n_1 its first principal plane across e, n_2 = e x n_1.
    A rotation t of a body turns the wire's end to the slope (t x e) . n and twists it by t . e.
    """
    wires, now, flex = scene.wires, string.state(scene, pose), scene.flex
    assert flex is not None
    e = now.direction
    upper, lower = (pose.rotation[..., body, :, :] @ vector[..., 0, :, None] for body, vector in ((wires.upper, flex.upper), (wires.lower, flex.lower)))
    first = (upper + lower)[..., 0]
    first = first - (first * e).sum(-1, keepdims=True) * e
    first = first / np.sqrt((first**2).sum(-1, keepdims=True))
    planes = (first, cross(e, first))
    moved = (point_jacobian(numbering, pose, wires.upper, now.upper_arm, wires.blade), point_jacobian(numbering, pose, wires.lower, now.lower_arm))
    turned = tuple(_turning(numbering, body) for body in (wires.upper, wires.lower))

    def even_odd(ends: Any, along: Any) -> tuple[Any, Any]:
        upper, lower = ((j * along[..., None, :, :]).sum(-1) for j in ends)
        return (upper + lower) / 2, (lower - upper) / 2

    result = {}
    for part, n in zip(("bend-1", "bend-2"), planes, strict=True):
        even, odd = even_odd(moved, n)
        # (t x e) . n = t . (e x n)
        odd_turn, even_turn = even_odd(turned, cross(e, n))
        result[part] = np.stack([even, even_turn, odd, odd_turn], axis=-1)
    result["stretch"] = np.stack(even_odd(moved, e), axis=-1)
    result["twist"] = np.stack(even_odd(turned, e), axis=-1)
    return result


def _turning(numbering: Layout, body: Any) -> Any:
    """Rotation (N, w, 3) of bodies with the coordinates."""
    result = np.zeros((numbering.size, len(body), 3))
    for axis in range(3):
        result[6 * body + 3 + axis, np.arange(len(body)), axis] = 1.0
    return result


def loss_terms(scene: Scene, numbering: Layout, pose: Pose, adapted: Symmetry) -> list[Term]:
    """What blades and springs dissipate; any batch axes."""
    fibres, terms = scene.fibres, []
    assert fibres is not None
    shape = (*scene.batch, numbering.size, numbering.size)
    place = {label: n for n, label in enumerate(scene.blades.label)}
    groups: dict[Any, list[int]] = {}
    for blade in fibres.blade:
        key = (blade.label.rsplit(".", 1)[0], blade.angle, blade.losses, blade.thickness, blade.temperature)
        groups.setdefault(key, []).append(place[blade.label])
    for (stage, *_, temperature), numbers in groups.items():
        matrix = np.zeros(shape)
        for n in numbers:
            rows = numbering.blade[n][scene.blades.axes[n]]
            matrix[..., rows, rows] = scene.blades.stiffness[..., n, scene.blades.axes[n]]
        one = fibres.blade[numbers[0]]
        terms.append(LossTerm(f"{stage}.blades", temperature, adapted.apply(matrix), lambda omega, one=one: loss.blade_angle(one, omega)))
    now = spring.state(scene, pose)
    for n in np.flatnonzero(scene.springs.loss).tolist():
        jacobian = spring.strain_jacobian(scene, numbering, pose, now, n)
        matrix = np.swapaxes(jacobian, -1, -2) @ scene.springs.stiffness[..., n, :, :] @ jacobian
        angle = float(scene.springs.loss[n])
        label = scene.springs.label[n].rsplit(".", 1)[0]
        terms.append(LossTerm(f"{label}.springs", fibres.temperature, adapted.apply(matrix), lambda omega, angle=angle: angle + 0 * omega))
    return terms


def gas_terms(scene: Scene, numbering: Layout, pose: Pose, adapted: Symmetry, drag: Drag) -> list[Term]:
    """What the gas around the bodies dissipates; any batch axes."""
    terms: list[Term] = []
    for n, own in enumerate(drag):
        if own is None:
            continue
        turn = pose.rotation[..., n + 1, :, :]
        matrix = np.zeros((*turn.shape[:-2], numbering.size, numbering.size))
        for half in (0, 3):
            rows = slice(6 * (n + 1) + half, 6 * (n + 1) + half + 3)
            matrix[..., rows, rows] = turn @ own[half : half + 3, half : half + 3] @ np.swapaxes(turn, -1, -2)
        assert scene.fibres is not None and scene.fibres.gas is not None
        terms.append(LossTerm(f"{scene.bodies.name[n]}.gas", scene.fibres.gas.temperature, adapted.apply(matrix), lambda omega: omega, elastic=False))
    return terms
