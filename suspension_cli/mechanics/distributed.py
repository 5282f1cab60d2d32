"""Scene -> LinearModel for wires that bend, twist and have mass (`beam`, `violin`), with all losses as functions of frequency."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from suspension_cli.design.fibres import Fibre
from suspension_cli.design.scene import Scene
from suspension_cli.mechanics import assemble, equilibrium, flexure, joined, loss, spring, string
from suspension_cli.mechanics.blocks import Symmetry, symmetry
from suspension_cli.mechanics.dispersion import LossTerm, Term, WireTerm
from suspension_cli.mechanics.equilibrium import Equilibrium
from suspension_cli.mechanics.fibre import Strand
from suspension_cli.mechanics.model import LinearModel
from suspension_cli.mechanics.pose import Layout, Pose, layout, point_jacobian
from suspension_cli.rotations import cross

Drag = tuple[Any, ...]

SETTLED = 1e-12
"""Relative change of tensions after which the stiffness of wires against bending need not be taken anew."""
HINGES = 4
"""How often the place of a wire's clamps is worked out anew for its length between them; each time changes the last change by u / l."""
PASSES = 4
ALIKE = 1e-12
"""Relative difference of lengths and tensions of wires that are alike."""


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
    scene, balanced = _balanced(_to_clamps(scene), numbering)
    adapted = symmetry(scene, numbering)
    still = replace(
        scene,
        wires=replace(scene.wires, loss=np.zeros_like(scene.wires.loss)),
        blades=replace(scene.blades, loss=np.zeros_like(scene.blades.loss)),
        springs=replace(scene.springs, loss=np.zeros_like(scene.springs.loss)),
    )
    model = assemble.linear_model(still, balanced)
    terms = [
        *_wire_terms(scene, numbering, balanced, adapted, massive=massive),
        *_loss_terms(scene, numbering, balanced.pose, adapted),
        *_gas_terms(scene, numbering, balanced.pose, adapted, drag),
    ]
    return replace(model, terms=tuple(terms))


def _to_clamps(scene: Scene) -> Scene:
    """A scene whose wires end at their clamps, where the design tells the points at which they seem to bend.

    A wire whose far end is pulled aside pushes on its clamp with a shear V and a moment M, as if it were hinged at u = M / V from there (sqrt(EI / T) for
    a long uniform one; Gonzalez and Saulson, J. Acoust. Soc. Am. 96, 207 (1994)).  So its clamps lie u beyond those points, in line with the wire:
    what carries the weight is the same.  Of a ribbon it is the soft plane that counts.
    """
    assert scene.fibres is not None
    ends = np.array([_hinges(fibre, scene, n) if fibre.effective else (0.0, 0.0) for n, fibre in enumerate(scene.fibres.wire)]).reshape(-1, 2)
    if not ends.any():
        return scene
    wires = scene.wires
    e, longer = wires.span / wires.length[:, None], ends.sum(1)
    moved = replace(
        wires,
        upper_point=wires.upper_point - ends[:, :1] * e,
        lower_point=wires.lower_point + ends[:, 1:] * e,
        span=wires.span + longer[:, None] * e,
        length=wires.length + longer,
    )
    return replace(scene, wires=moved)


def _hinges(fibre: Fibre, scene: Scene, number: int) -> tuple[float, float]:
    """How far (m) from its upper and its lower clamp a wire seems to bend, in its first plane, if it is that much longer than drawn."""
    upper = lower = 0.0
    for _ in range(HINGES):
        longer = _fitted(fibre, float(scene.wires.length[number]) + upper + lower, float(scene.wires.stiffness[number]))
        static = Strand(longer, float(scene.wires.tension[number]), massive=False, lossy=False).static["bend-1"]
        k = joined.ends(static[..., None])[..., 0]  # w_1, w'_1, w_2, w'_2
        upper, lower = abs(float(k[1, 2] / k[0, 2])), abs(float(k[3, 0] / k[2, 0]))
    return upper, lower


def _balanced(scene: Scene, numbering: Layout) -> tuple[Scene, Equilibrium]:
    """The equilibrium, with wires as stiff against bending as their tension in it makes them."""
    scene = flexure.flexible(scene)
    found = equilibrium.solve(scene, numbering)
    found.demand(scene)
    tension = scene.wires.tension
    for _ in range(PASSES):
        if not found.iterations or np.all(np.abs(found.tension - tension) <= SETTLED * tension):
            break
        tension = found.tension
        scene = flexure.flexible(scene, tension)
        found = equilibrium.solve(scene, numbering, start=found.pose)
        found.demand(scene)
    return scene, found


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
        fibre = _fitted(scene.fibres.wire[first], float(length[alike].mean()), float(scene.wires.stiffness[first]))
        strand = Strand(fibre, float(balanced.tension[alike].mean()), massive, lossy=True, surrounded=scene.fibres.gas)
        stage = scene.bodies.name[scene.wires.lower[first] - 1]
        some = {part: np.transpose(rows[:, alike], (1, 2, 0)) @ adapted.basis for part, rows in forms.items()}
        terms.append(WireTerm(stage, strand, some, adapted.allowed))
    return terms


def _alike(scene: Scene, tension: Any, length: Any, one: int, other: int) -> bool:
    """Whether two wires share every number that their motion depends on."""
    assert scene.fibres is not None
    wires, (a, b) = scene.wires, (scene.fibres.wire[n] for n in (one, other))
    same = wires.lower[one] == wires.lower[other] and a.sections == b.sections and a.temperature == b.temperature
    return bool(same and all(abs(v[one] - v[other]) <= ALIKE * abs(v[one]) for v in (tension, length, wires.stiffness)))


def _fitted(fibre: Fibre, length: float, k: float) -> Fibre:
    """A fibre as long as it is in equilibrium, and as stiff against stretching as the scene's wire."""
    stretch = length / sum(section.length for section in fibre.sections)
    compliance = sum(section.length * stretch / section.stretching for section in fibre.sections)
    if abs(stretch - 1) < ALIKE and abs(compliance * k - 1) < ALIKE:
        return fibre
    return replace(fibre, sections=tuple(replace(s, length=s.length * stretch, stretching=s.stretching * compliance * k) for s in fibre.sections))


def wire_forms(scene: Scene, numbering: Layout, pose: Pose) -> dict[str, Any]:
    """How the ends of every wire move with the coordinates: (N, w, c) for each part of `fibre.PARTS`.

    In the axes of the wire as it hangs: e from its upper to its lower end, n_1 its first principal plane across e, n_2 = e x n_1.
    A rotation t of a body turns the wire's end to the slope (t x e) . n and twists it by t . e.
    """
    wires, now, flex = scene.wires, string.state(scene, pose), scene.flex
    assert flex is not None
    e = now.direction
    upper, lower = (pose.rotation[body] @ vector[..., None] for body, vector in ((wires.upper, flex.upper[:, 0]), (wires.lower, flex.lower[:, 0])))
    first = (upper + lower)[..., 0]
    first = first - (first * e).sum(-1, keepdims=True) * e
    first = first / np.sqrt((first**2).sum(-1, keepdims=True))
    planes = (first, cross(e, first))
    moved = (point_jacobian(numbering, pose, wires.upper, now.upper_arm, wires.blade), point_jacobian(numbering, pose, wires.lower, now.lower_arm))
    turned = tuple(_turning(numbering, body) for body in (wires.upper, wires.lower))

    def even_odd(ends: list[Any]) -> tuple[Any, Any]:
        return (ends[0] + ends[1]) / 2, (ends[1] - ends[0]) / 2

    result = {}
    for part, n in zip(("bend-1", "bend-2"), planes, strict=True):
        even, odd = even_odd([(j * n).sum(-1) for j in moved])
        # (t x e) . n = t . (e x n)
        odd_turn, even_turn = even_odd([(t * cross(e, n)).sum(-1) for t in turned])
        result[part] = np.stack([even, even_turn, odd, odd_turn], axis=-1)
    result["stretch"] = np.stack(even_odd([(j * e).sum(-1) for j in moved]), axis=-1)
    result["twist"] = np.stack(even_odd([(t * e).sum(-1) for t in turned]), axis=-1)
    return result


def _turning(numbering: Layout, body: Any) -> Any:
    """Rotation (N, w, 3) of bodies with the coordinates."""
    result = np.zeros((numbering.size, len(body), 3))
    for axis in range(3):
        result[6 * body + 3 + axis, np.arange(len(body)), axis] = 1.0
    return result


def _loss_terms(scene: Scene, numbering: Layout, pose: Pose, adapted: Symmetry) -> list[Term]:
    """What blades and springs dissipate."""
    fibres, terms = scene.fibres, []
    assert fibres is not None
    place = {label: n for n, label in enumerate(scene.blades.label)}
    groups: dict[Any, list[int]] = {}
    for blade in fibres.blade:
        key = (blade.label.rsplit(".", 1)[0], blade.angle, blade.losses, blade.thickness, blade.temperature)
        groups.setdefault(key, []).append(place[blade.label])
    for (stage, *_, temperature), numbers in groups.items():
        matrix = np.zeros((numbering.size,) * 2)
        for n in numbers:
            rows = numbering.blade[n][scene.blades.axes[n]]
            matrix[rows, rows] = scene.blades.stiffness[n][scene.blades.axes[n]]
        one = fibres.blade[numbers[0]]
        terms.append(LossTerm(f"{stage}.blades", temperature, adapted.apply(matrix), lambda omega, one=one: loss.blade_angle(one, omega)))
    now = spring.state(scene, pose)
    for n in np.flatnonzero(scene.springs.loss).tolist():
        jacobian = spring.strain_jacobian(scene, numbering, pose, now, n)
        matrix = jacobian.T @ scene.springs.stiffness[n] @ jacobian
        angle = float(scene.springs.loss[n])
        label = scene.springs.label[n].rsplit(".", 1)[0]
        terms.append(LossTerm(f"{label}.springs", fibres.temperature, adapted.apply(matrix), lambda omega, angle=angle: angle + 0 * omega))
    return terms


def _gas_terms(scene: Scene, numbering: Layout, pose: Pose, adapted: Symmetry, drag: Drag) -> list[Term]:
    """What the gas around the bodies dissipates."""
    terms: list[Term] = []
    for n, own in enumerate(drag):
        if own is None:
            continue
        turn = pose.rotation[n + 1]
        whole = np.kron(np.eye(2), turn)
        matrix = np.zeros((numbering.size,) * 2)
        rows = slice(6 * (n + 1), 6 * (n + 2))
        matrix[rows, rows] = whole @ own @ whole.T
        assert scene.fibres is not None and scene.fibres.gas is not None
        terms.append(LossTerm(f"{scene.bodies.name[n]}.gas", scene.fibres.gas.temperature, adapted.apply(matrix), lambda omega: omega, elastic=False))
    return terms
