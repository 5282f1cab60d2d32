"""Dampers on the tips of blades: masses on lossy springs, which damp bounce and roll.

A damper of the mass m on the spring k (1 + i phi) moves by u relative to the tip, along the z axis
of the body that carries the blade; w = r . x is the motion of the tip along that axis. Their
kinetic energy m (w' + u')^2 / 2 is m w'^2 / 2, which a scene has in the mass of the tip, and

    m u' r . x' + m u'^2 / 2.

The spring stores k u^2 / 2. At a fixed frequency the damper acts on its tip with the dynamic
stiffness -m omega^2 k / (k - m omega^2) (Den Hartog, Mechanical Vibrations, section 3.2): the mass
m on a stiff spring, no inertia on a soft one. Its weight rests on the tip in any case.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from suspension_cli.design.wires import names_on_tip
from suspension_cli.linear.coordinates import AddedCoordinates, momentum_units
from suspension_cli.linear.matrix_terms import StructuralLoss
from suspension_cli.scene.arrays import Array
from suspension_cli.scene.pose import layout

if TYPE_CHECKING:
    from jaxtyping import Inexact, Int

    from suspension_cli.design.schema import Design
    from suspension_cli.design.wires import TipDamper
    from suspension_cli.linear.system import LinearSystem
    from suspension_cli.scene.pose import Pose
    from suspension_cli.scene.scene import Scene

ROUNDING = 1e-14
"""Fraction of the largest element of a matrix below which one is a rounding error."""


class DamperOnTip(NamedTuple):
    """A damper, the number that it has on its blade, its coordinate, and the blade's stage."""

    number: int
    name: str
    blade: str
    stage: str
    table: TipDamper


def dampers_of(design: Design) -> list[DamperOnTip]:
    """List all dampers, first the first on each blade."""
    result: list[DamperOnTip] = []
    for stage in design.stage:
        tables = [stage.blades] * stage.blades.count if stage.blades else stage.blade
        for number, table in enumerate(tables, 1):
            label = f"{stage.name}.{getattr(table, 'name', f'blade{number}')}"
            names = names_on_tip(label, len(table.dampers))
            for n, (name, damper) in enumerate(zip(names, table.dampers, strict=True), 1):
                result.append(DamperOnTip(n, name, label, stage.name, damper))
    return sorted(result, key=lambda one: one.number)


def tip_motion(scene: Scene, pose: Pose, blade: int) -> Inexact[np.ndarray, "*batch coordinate"]:
    """Motion of a blade's tip along the z axis of its body per coordinate, 1 and m."""
    numbering = layout(scene)
    body = int(scene.blades.body[blade])
    axis = pose.rotation[..., body, :, 2]
    point = scene.blades.tip[..., blade, :] + pose.deflection[..., blade, :]
    arm = (pose.rotation[..., body, :, :] @ point[..., None])[..., 0]
    row = np.zeros((*axis.shape[:-1], numbering.size), dtype=axis.dtype)
    row[..., 6 * body : 6 * body + 3] = axis
    row[..., 6 * body + 3 : 6 * body + 6] = np.cross(arm, axis)
    row[..., numbering.blade[blade, 2]] = 1.0
    return row


def with_tip_dampers(model: LinearSystem, design: Design, scene: Scene, pose: Pose) -> LinearSystem:
    """Add the dampers on the tips of blades to a linear model about a pose, any batch axes.

    Where tips are combined by symmetry, so are their dampers: the first of all, and so on.
    """
    dampers = dampers_of(design)
    if not dampers:
        return model
    from scipy.linalg import block_diag

    numbers = np.array([scene.blades.label.index(one.blade) for one in dampers])
    tips = layout(scene).blade[numbers, 2]
    place = np.array([one.number for one in dampers])
    alike = [tips[place == n] for n in range(1, max(place) + 1)]
    mixed = np.array(block_diag(*(_combinations(model, some) for some in alike)), dtype=float)
    count = len(dampers)
    size = model.size
    masses = np.array([one.table.mass for one in dampers])
    motion = np.stack([tip_motion(scene, pose, number) for number in numbers], axis=-2)
    coupling = _without_rounding(mixed.T @ (masses[:, None] * motion) @ model.basis)
    mass = np.zeros((*coupling.shape[:-2], size + count, size + count), dtype=coupling.dtype)
    mass[..., size:, :size] = coupling
    mass[..., :size, size:] = np.swapaxes(coupling, -1, -2)
    mass[..., size:, size:] = _form(mixed, masses)
    stiffness = np.zeros((size + count, size + count))
    losses: dict[tuple[str, float], StructuralLoss] = {}
    for number, (*_, stage, damper) in enumerate(dampers):
        own = np.zeros_like(stiffness)
        own[size:, size:] = _form(mixed, damper.spring * np.eye(count)[number])
        stiffness += own
        key = stage, damper.loss_angle
        same = losses.get(key)
        matrix = own if same is None else same.matrix + own
        angle = partial(np.full_like, fill_value=damper.loss_angle, dtype=float)
        losses[key] = StructuralLoss(
            f"{stage}.dampers", design.constants.temperature, matrix, angle
        )
    cleaned = [replace(one, matrix=_without_rounding(one.matrix)) for one in losses.values()]
    units = ("m",) * count
    added = AddedCoordinates(
        name=tuple(one.name for one in dampers),
        unit=units,
        momentum_unit=momentum_units(units),
        mass=mass,
        stiffness=_without_rounding(stiffness),
        damping=np.zeros_like(stiffness),
    )
    wider = model.widened(added)
    return replace(wider, terms=(*wider.terms, *cleaned), basis=_basis(wider.basis, mixed))


def _combinations(model: LinearSystem, tips: Int[np.ndarray, " damper"]) -> Array:
    """The combinations of some tips in which a system has them, if these are no others."""
    combined = np.flatnonzero(model.basis[tips].any(0))
    if len(combined) != len(tips):
        return np.eye(len(tips))
    return model.basis[np.ix_(tips, combined)]


def _form(mixed: Array, diagonal: Array) -> Array:
    """Diagonal matrix of dampers in combined coordinates."""
    return _without_rounding(mixed.T @ (diagonal[:, None] * mixed))


def _without_rounding(matrix: Array) -> Array:
    """Set to 0 what is left where combined coordinates cancel, so that symmetry stays exact."""
    return np.where(np.abs(matrix) > ROUNDING * np.abs(matrix).max(), matrix, 0.0)


def _basis(basis: Array, mixed: Array) -> Array:
    """Basis of a system whose last coordinates are combined."""
    count = len(mixed)
    result = basis.copy()
    result[-count:, -count:] = mixed
    return result
