"""Designs that differ in a few numbers, as batches of balanced linear models on any rung.

What a dotted path changes goes through the reader's checks point by point; equilibria, matrices and all that follows from them are
then worked out for whole arrays of designs of one topology.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from suspension_cli.analysis import builds
from suspension_cli.analysis.builds import Builds
from suspension_cli.design import reader, stack
from suspension_cli.design.derive import com_positions
from suspension_cli.design.scene import Array, Scene
from suspension_cli.design.schema import Design
from suspension_cli.errors import InputError
from suspension_cli.mechanics.blocks import mirrored
from suspension_cli.mechanics.model import LinearModel
from suspension_cli.mechanics.nominal import expand
from suspension_cli.models import closed_form, fidelity, force
from suspension_cli.models.surroundings import surrounded


def overridden(text: str, values: dict[str, float]) -> Design:
    """A design with numbers put in at dotted paths."""
    return reader.overridden(text, tuple(f"{path}={float(value)!r}" for path, value in values.items()))


def scenes(text: str, values: dict[str, Array], level: str = "string") -> Iterator[tuple[Scene, Design, Any]]:
    """The designs that dotted paths make, in batches of those that differ in nothing but the arrays of their scenes.

    Parameters
    ----------
    text : str
        The design as TOML.
    values : dict of (p,) arrays
        By dotted path.
    level : str
        Rung; on ``beam`` and ``violin`` what wires are made of is the same in a batch too.

    Yields
    ------
    scene : Scene
        With the points as its first axis.
    design : Design
        One of them.
    here : (p,) int array
        Which points they are.  One whose design is at fault is in no batch.
    """
    rows, pick = np.unique(np.stack(list(values.values()), axis=1), axis=0, return_inverse=True)
    for numbers, members, design in alike((_possible(text, dict(zip(values, row, strict=True))) for row in rows), level):
        place = np.full(len(rows), -1)
        place[numbers] = np.arange(len(members))
        here = np.flatnonzero(place[pick.ravel()] >= 0)
        yield stack.stacked(members, place[pick.ravel()[here]]), design, here


def _possible(text: str, values: dict[str, float]) -> Design | None:
    """A design with numbers put in; None if it is at fault."""
    try:
        return overridden(text, values)
    except InputError:
        return None


def alike(designs: Iterable[Design | None], level: str) -> Iterator[tuple[list[int], list[Scene], Design]]:
    """Scenes of designs that differ in nothing but the arrays of their scenes, with their numbers and one of the designs.

    Those without a scene are left out.
    """
    kinds: dict[tuple[Any, ...], list[tuple[int, Scene, Design]]] = {}
    for n, design in enumerate(designs):
        try:
            scene = None if design is None else expand(design)
        except InputError:
            continue
        if design is None or scene is None:
            continue
        made = _made_of(design) if level in ("beam", "violin") else ()
        kinds.setdefault((*_common(scene, design), made), []).append((n, scene, design))
    for members in kinds.values():
        yield [n for n, _, _ in members], [scene for _, scene, _ in members], members[0][2]


def balanced(text: str, values: dict[str, Array], level: str, *, allow_unstable: bool = False) -> Iterator[tuple[Builds, Any]]:
    """The same as balanced linear models of one rung, mirror symmetries split off.

    Parameters
    ----------
    text, values
        As for `scenes`.
    level : str
        One of `fidelity.LEVELS` but ``auto``.
    allow_unstable : bool
        Whether an unstable equilibrium is as good as any.

    Yields
    ------
    Builds
        With the points as first axis of the model.
    here : (p,) int array
        Which points they are.
    """
    if level in ("string", "beam", "violin"):
        for scene, design, here in scenes(text, values, level):
            flags = mirrored(scene)
            for mirrors in np.unique(flags, axis=0):
                some = (flags == mirrors).all(-1)
                yield builds.balance(stack.picked(scene, some), design, level=level, allow_unstable=allow_unstable, split=True), here[some]
        return
    kinds: dict[tuple[Any, ...], list[tuple[int, Design]]] = {}
    for n, row in enumerate(np.stack(list(values.values()), axis=1)):
        try:
            design = overridden(text, dict(zip(values, row, strict=True)))
        except InputError:
            continue
        if not (closed_form if level == "closed-form" else force).unsuited(design):
            kinds.setdefault(_shape(design, level, n), []).append((n, design))
    for members in kinds.values():
        designs = [design for _, design in members]
        model = _widened(closed_form.linear_model(designs[0])) if level == "closed-form" else _chains(designs)
        yield _standing(surrounded(model, designs[0]), allow_unstable), np.array([n for n, _ in members])


def _chains(designs: list[Design]) -> LinearModel:
    """The models of chains of the same stages, as one with a batch axis."""
    lossy = _together([force.chain(design, lossy=True) for design in designs]) if force.lossy(designs[0]) else None
    return force.assembled(designs[0], _together([force.chain(design) for design in designs]), lossy)


def _together(chains: list[force.Chain]) -> force.Chain:
    """Chains of the same stages as one of arrays."""

    def stacked(name: str, values: list[Any]) -> Any:
        if name in ("count", "blades"):
            return values[0]
        return tuple(np.array(v) for v in zip(*values, strict=True)) if name == "inertia" else np.array(values)

    stages = zip(*(links.stages for links in chains), strict=True)
    joined = (force.Stage(**{name: stacked(name, [vars(stage)[name] for stage in same]) for name in vars(same[0])}) for same in stages)
    return force.Chain(tuple(joined), np.array([links.gravity for links in chains]))


def _widened(model: LinearModel) -> LinearModel:
    """A model as a batch of one."""
    return replace(model, mass=model.mass[None], stiffness=model.stiffness[None], lossy=None if model.lossy is None else model.lossy[None])


def _standing(model: LinearModel, allow_unstable: bool) -> Builds:
    """Models of symmetric designs, which balance as they are drawn."""
    count = model.stiffness.shape[0]
    status = np.full(count, builds.GOOD, dtype=np.uint8)
    if not allow_unstable:
        status[builds.grows(model)] = builds.UNSTABLE
    upright = np.broadcast_to(np.eye(3), (count, len(model.body) + 1, 3, 3))
    wire, mirrors = np.full(count, -1, dtype=np.int16), np.ones((count, 2), dtype=bool)
    return Builds(replace(model, orientation=upright), status, wire, np.zeros(count), mirrors)


def _around(design: Design) -> tuple[str, ...]:
    """What `surrounded` adds to the models of one batch: a support that gives way, dampers, and where these act."""
    dampers = tuple(stage.damping for stage in design.stage)
    if all(own is None for own in dampers):
        return (repr(design.support),)
    return (repr(design.support), repr(dampers), repr(com_positions(design)))  # of floats, so to the last digit


def _shape(design: Design, level: str, number: int) -> tuple[Any, ...]:
    """What symmetric chains of one batch have in common."""
    if level == "closed-form":
        return (number,)
    sets = tuple((stage.wires and stage.wires.count, stage.blades and stage.blades.count) for stage in design.stage)
    return (sets, force.lossy(design), _around(design))


def _common(scene: Scene, design: Design) -> tuple[Any, ...]:
    """What scenes of one batch have in common."""
    static = [getattr(group, name) for group in (scene.bodies, scene.wires, scene.blades, scene.springs) for name in stack.STATIC if hasattr(group, name)]
    kinds = [np.array(item).tobytes() if isinstance(item, np.ndarray) else item for item in static]
    light, damped, twisted = (scene.blades.tip_mass == 0).tobytes(), bool(scene.springs.damping.any()), (scene.wires.torsion > 0).tobytes()
    return (scene.gravity, *kinds, light, damped, twisted, _around(design))


def _made_of(design: Design) -> tuple[Any, ...]:
    """What wires and blades of one batch are made of, and the gas around all."""
    scene, drag = fidelity.bending(expand(design), design)
    made = scene.fibres
    assert made is not None
    ways = [np.array([fibre.plane, *fibre.clamp]).tobytes() for fibre in made.wire]
    kinds = [(fibre.sections, fibre.temperature, fibre.effective) for fibre in made.wire]
    return (*ways, *kinds, made.blade, made.gas, made.temperature, *(None if own is None else own.tobytes() for own in drag))
