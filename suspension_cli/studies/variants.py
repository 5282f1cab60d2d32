"""Designs that differ in a few numbers, as batches of balanced linear models.

Every design passes the reader's checks. Equilibria, matrices and what follows from them are
computed for arrays of designs of one topology.
"""

from __future__ import annotations

import contextlib
from collections.abc import Hashable, Iterable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design import paths, reader
from suspension_cli.design.schema import Design
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.errors import InputError
from suspension_cli.linear import batch_modes
from suspension_cli.linear.symmetry import is_mirror_symmetric
from suspension_cli.models import registry
from suspension_cli.models.base import Model
from suspension_cli.models.surroundings import surrounded, surroundings_key
from suspension_cli.scene import stack
from suspension_cli.scene.arrays import inner_axes
from suspension_cli.scene.scene import Scene
from suspension_cli.studies import builds
from suspension_cli.studies.builds import Builds

if TYPE_CHECKING:
    from jaxtyping import Float, Int


def overridden(text: str, values: dict[str, float]) -> Design:
    """Parse a design with numbers replaced at dotted paths."""
    return reader.parse_with_overrides(text, paths.settings(values))


def scenes(
    text: str, values: dict[str, Float[np.ndarray, " point"]], level: str = registry.STRING.name
) -> Iterator[tuple[Scene, Design, Int[np.ndarray, " place"]]]:
    """Expand the designs given by values at dotted paths, in batches of one topology.

    Designs of a batch differ only in the arrays of their scenes. `text` is the design as TOML,
    `level` the name of a model that supports builds; `SceneModel.wire_properties` are the same in a
    batch.

    Yields
    ------
    scene : Scene
        With the points as its first axis.
    design : Design
        One of them.
    here : array
        Numbers of the points. Points with an invalid design are in no batch.
    """
    rows, pick = np.unique(np.stack(list(values.values()), axis=1), axis=0, return_inverse=True)
    designs = (_parse_if_valid(text, dict(zip(values, row, strict=True))) for row in rows)
    for numbers, members, design in alike(designs, level):
        place = np.full(len(rows), -1)
        place[numbers] = np.arange(len(members))
        number = place[pick.ravel()]
        here = np.flatnonzero(number >= 0)
        yield stack.stack_scenes(members, number[here]), design, here


def _parse_if_valid(text: str, values: dict[str, float]) -> Design | None:
    """Parse a design with these numbers; None if it is invalid."""
    try:
        return overridden(text, values)
    except InputError:
        return None


def alike(
    designs: Iterable[Design | None], level: str
) -> Iterator[tuple[list[int], list[Scene], Design]]:
    """Group designs that differ only in the arrays of their scenes.

    Yields their places, their scenes and one design of each group; designs without a scene are left
    out.
    """
    model = registry.scene_model(level)
    kinds: dict[Hashable, list[tuple[int, Scene, Design]]] = {}
    for n, design in enumerate(designs):
        if design is None:
            continue
        with contextlib.suppress(InputError):
            scene = expand(design)
            key = (*_topology(scene, design), model.wire_properties(design))
            kinds.setdefault(key, []).append((n, scene, design))
    for members in kinds.values():
        yield [n for n, _, _ in members], [scene for _, scene, _ in members], members[0][2]


def balanced(
    text: str,
    values: dict[str, Float[np.ndarray, " point"]],
    level: str,
    *,
    allow_unstable: bool = False,
) -> Iterator[tuple[Builds, Int[np.ndarray, " place"]]]:
    """Balance the designs given by values at dotted paths, and build their linear models.

    Yields builds, with the points as first axis of the linear model, and the numbers of the points.
    Mirror symmetries are used. Arguments as of `scenes`, but any model; if `allow_unstable`, an
    unstable equilibrium has status `builds.GOOD`.
    """
    model = registry.by_name(level)
    if not model.supports_builds:
        yield from _balanced_designs(text, values, model, allow_unstable)
        return
    for scene, design, here in scenes(text, values, level):
        flags = is_mirror_symmetric(scene)
        for mirrors in np.unique(flags, axis=0):
            some = (flags == mirrors).all(-1)
            part = stack.select_scenes(scene, some)
            found = builds.balance(
                part, design, level=level, allow_unstable=allow_unstable, split=True
            )
            yield found, here[some]


def _balanced_designs(
    text: str,
    values: dict[str, Float[np.ndarray, " point"]],
    model: Model,
    allow_unstable: bool,
) -> Iterator[tuple[Builds, Int[np.ndarray, " place"]]]:
    """Build batches of symmetric designs of one key; their nominal pose is the equilibrium."""
    kinds: dict[Hashable, list[tuple[int, Design]]] = {}
    for n, row in enumerate(np.stack(list(values.values()), axis=1)):
        design = _parse_if_valid(text, dict(zip(values, row, strict=True)))
        if design is None or model.unsuitable(design):
            continue
        key = model.batch_key(design)
        kinds.setdefault(n if key is None else key, []).append((n, design))
    for members in kinds.values():
        designs, count = [design for _, design in members], len(members)
        system = surrounded(model.batch(designs), designs[0])
        status = np.full(count, builds.GOOD, dtype=np.uint8)
        if not allow_unstable:
            status[batch_modes.grows(system)] = builds.UNSTABLE
            builds.mark_driven(status, system)
        upright = np.broadcast_to(np.eye(3), (count, len(system.body) + 1, 3, 3))
        wire, mirrors = np.full(count, -1, dtype=np.int16), np.ones((count, 2), dtype=bool)
        system = replace(system, orientation=upright)
        found = Builds(system, status, wire, np.zeros(count), mirrors)
        yield found, np.array([n for n, _ in members])


def _topology(scene: Scene, design: Design) -> tuple[Hashable, ...]:
    """Collect the properties that scenes of one batch share."""
    static = [
        np.array(value).tobytes() if isinstance(value, np.ndarray) else value
        for part in scene.parts.values()
        for name, value in vars(part).items()
        if name not in inner_axes(type(part))
    ]
    wires, light = scene.wires, (scene.blades.tip_mass == 0).tobytes()
    damped, twisted = bool(scene.springs.damping.any()), (wires.torsion > 0).tobytes()
    field = scene.field and (scene.field.vector.tobytes(), scene.field.gradient.tobytes())
    heavy, around = (wires.mass != 0).tobytes(), surroundings_key(design)
    return (scene.gravity, field, heavy, *static, light, damped, twisted, around)
