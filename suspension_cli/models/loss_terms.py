"""Losses as functions of frequency: of blades and springs, and of bodies by the gas around them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from suspension_cli.elements import loss, spring
from suspension_cli.linear.frequency_terms import LossTerm, Term
from suspension_cli.linear.symmetry import Symmetry
from suspension_cli.scene.composition import BladeLoss
from suspension_cli.scene.pose import Layout, Pose
from suspension_cli.scene.scene import Scene

Drag = tuple[Any, ...]
"""Damping (6, 6) of each body by the gas around it, in its own frame at its COM; None for none."""


def lossless(scene: Scene) -> Scene:
    """The scene without the losses of wires, blades and springs."""
    return replace(
        scene,
        wires=replace(scene.wires, loss=np.zeros_like(scene.wires.loss)),
        blades=replace(scene.blades, loss=np.zeros_like(scene.blades.loss)),
        springs=replace(scene.springs, loss=np.zeros_like(scene.springs.loss)),
    )


def loss_terms(scene: Scene, numbering: Layout, pose: Pose, adapted: Symmetry) -> list[Term]:
    """Losses of blades and springs; any batch axes."""
    fibres, terms = scene.fibres, []
    assert fibres is not None
    shape = (*scene.batch, numbering.size, numbering.size)
    place = {label: n for n, label in enumerate(scene.blades.label)}
    groups: dict[Any, list[int]] = {}
    for blade in fibres.blade:
        key = (
            blade.label.rsplit(".", 1)[0],
            blade.angle,
            blade.losses,
            blade.thickness,
            blade.temperature,
        )
        groups.setdefault(key, []).append(place[blade.label])
    for (stage, *_, temperature), numbers in groups.items():
        matrix = np.zeros(shape)
        for n in numbers:
            rows = numbering.blade[n][scene.blades.axes[n]]
            matrix[..., rows, rows] = scene.blades.stiffness[..., n, scene.blades.axes[n]]
        one = fibres.blade[numbers[0]]
        terms.append(
            LossTerm(
                f"{stage}.blades",
                temperature,
                adapted.apply(matrix),
                lambda omega, one=one: loss.blade_angle(one, omega),
            )
        )
    now = spring.state(scene, pose)
    known = {own.label: own for own in fibres.spring}
    for n, name in enumerate(scene.springs.label):
        if name not in known and not scene.springs.loss[n]:
            continue
        own = known.get(name) or BladeLoss(
            name, float(scene.springs.loss[n]), None, 0.0, fibres.temperature
        )
        jacobian = spring.strain_jacobian(scene, numbering, pose, now, n)
        matrix = np.swapaxes(jacobian, -1, -2) @ scene.springs.stiffness[..., n, :, :] @ jacobian
        terms.append(
            LossTerm(
                f"{name.rsplit('.', 1)[0]}.springs",
                own.temperature,
                adapted.apply(matrix),
                lambda omega, own=own: loss.blade_angle(own, omega),
            )
        )
    return terms


def gas_terms(
    scene: Scene, numbering: Layout, pose: Pose, adapted: Symmetry, drag: Drag
) -> list[Term]:
    """Losses by the gas around the bodies; any batch axes."""
    terms: list[Term] = []
    for n, own in enumerate(drag):
        if own is None:
            continue
        turn = pose.rotation[..., n + 1, :, :]
        matrix = np.zeros((*turn.shape[:-2], numbering.size, numbering.size))
        for half in (0, 3):
            rows = slice(6 * (n + 1) + half, 6 * (n + 1) + half + 3)
            matrix[..., rows, rows] = (
                turn @ own[half : half + 3, half : half + 3] @ np.swapaxes(turn, -1, -2)
            )
        assert scene.fibres is not None and scene.fibres.gas is not None
        terms.append(
            LossTerm(
                f"{scene.bodies.name[n]}.gas",
                scene.fibres.gas.temperature,
                adapted.apply(matrix),
                lambda omega: omega,
                elastic=False,
            )
        )
    return terms
