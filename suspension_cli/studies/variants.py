"""Designs that differ in a few numbers, as batches of balanced linear models.

Every design passes the reader's checks. Equilibria, matrices and what follows from them are
computed for arrays of designs of one topology.
"""

from __future__ import annotations

import contextlib
from collections.abc import Hashable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design import reader
from suspension_cli.design.schema import Design
from suspension_cli.equilibrium.nominal import expand, is_as_drawn
from suspension_cli.errors import InputError
from suspension_cli.linear import batch_modes
from suspension_cli.linear.symmetry import is_mirror_symmetric
from suspension_cli.models import registry
from suspension_cli.models.base import Model
from suspension_cli.models.surroundings import nominal_positions, surrounded, surroundings_key
from suspension_cli.scene.arrays import inner_axes
from suspension_cli.scene.expand import Members, balance_as_drawn
from suspension_cli.scene.scene import Scene, select_scenes, stack_scenes
from suspension_cli.studies import builds
from suspension_cli.studies.builds import Builds

if TYPE_CHECKING:
    from jaxtyping import Float, Int


TOGETHER = 128
"""Designs that are in memory at once."""


def scenes(
    text: str, values: dict[str, Float[np.ndarray, " point"]], level: str = registry.STRING.name
) -> Iterator[tuple[Scene, Design, Int[np.ndarray, " place"]]]:
    """Expand the designs given by values at dotted paths, in batches of one topology.

    Yields scenes with the points as first axis, one design of each batch, and the numbers of its
    points; points with an invalid design are in no batch.
    """
    rows, pick = np.unique(np.stack([*values.values()], axis=1), axis=0, return_inverse=True)
    designs = designs_at(text, dict(zip(values, rows.T, strict=True)))
    for numbers, scene, design in alike(designs, level):
        place = np.full(len(rows), -1)
        place[numbers] = np.arange(len(numbers))
        number = place[pick.ravel()]
        here = np.flatnonzero(number >= 0)
        yield select_scenes(scene, number[here]), design, here


def designs_at(
    text: str, values: dict[str, Float[np.ndarray, " point"]]
) -> Iterator[Design | None]:
    """Parse the designs given by values at dotted paths; None where one is invalid."""
    varied = reader.VariedDesign.of(text)
    for row in np.stack([*values.values()], axis=1).tolist():
        design = None
        with contextlib.suppress(InputError):
            design = varied.at(dict(zip(values, row, strict=True)))
        yield design


def alike(
    designs: Iterable[Design | None], level: str
) -> Iterator[tuple[list[int], Scene, Design]]:
    """Group designs that differ only in the arrays of their scenes.

    Yields their places, their scenes as one batch, and one design of each group; designs without a
    scene are left out. `level` is a model that supports builds.
    """
    model = registry.scene_model(level)
    drawn: dict[Hashable, list[tuple[int, Members]]] = {}
    others: dict[Hashable, list[tuple[int, Scene, Design]]] = {}
    last = None
    for n, design in enumerate(designs):
        if design is None:
            continue
        last = Members.of(design, last)
        key = (last.topology, surroundings_key(design), *model.wire_properties(design))
        if is_as_drawn(design):
            drawn.setdefault(key, []).append((n, last))
            continue
        with contextlib.suppress(InputError):
            scene = expand(design)
            others.setdefault((*key, *_of_loads(scene)), []).append((n, scene, design))
    for group in drawn.values():
        scene, faults = balance_as_drawn([members for _, members in group])
        good = [n for n in range(len(group)) if n not in faults]
        if good:
            scene = select_scenes(scene, np.array(good)) if faults else scene
            yield [group[n][0] for n in good], scene, group[good[0]][1].design
    for found in others.values():
        scene = stack_scenes([scene for _, scene, _ in found])
        yield [n for n, _, _ in found], scene, found[0][2]


def solved(designs: Sequence[Design | None], level: str) -> Iterator[tuple[list[int], Builds]]:
    """Balance designs, and build their linear models, also of unstable equilibria.

    Yields places and builds as `alike` groups them.
    """
    for start in range(0, len(designs), TOGETHER):
        for places, scene, one in alike(designs[start : start + TOGETHER], level):
            found = builds.balance(scene, one, level=level, allow_unstable=True)
            yield [start + place for place in places], found


def balanced(
    designs: Iterable[Design | None], level: str, *, allow_unstable: bool = False
) -> Iterator[tuple[Builds, Int[np.ndarray, " place"]]]:
    """Balance designs, and build their linear models, in any model, with mirror symmetries.

    Yields builds and their places.
    """
    model = registry.by_name(level)
    if not model.supports_builds:
        yield from _balanced_symmetric(designs, model, allow_unstable)
        return
    for places, scene, design in alike(designs, level):
        flags = is_mirror_symmetric(scene)
        for mirrors in np.unique(flags, axis=0):
            some = (flags == mirrors).all(-1)
            part = select_scenes(scene, some)
            found = builds.balance(
                part, design, level=level, allow_unstable=allow_unstable, split=True
            )
            yield found, np.array(places)[some]


def _balanced_symmetric(
    designs: Iterable[Design | None], model: Model, allow_unstable: bool
) -> Iterator[tuple[Builds, Int[np.ndarray, " place"]]]:
    """Build batches of symmetric designs of one key; their nominal pose is the equilibrium."""
    kinds: dict[Hashable, list[tuple[int, Design]]] = {}
    for n, design in enumerate(designs):
        if design is not None and not model.unsuitable(design):
            key = model.batch_key(design)
            kinds.setdefault(n if key is None else key, []).append((n, design))
    for members in kinds.values():
        alike = [design for _, design in members]
        count = len(members)
        position = np.array([nominal_positions(design) for design in alike])
        system = surrounded(model.batch(alike), alike[0], position)
        status = np.full(count, builds.GOOD, dtype=np.uint8)
        if not allow_unstable:
            status[batch_modes.grows(system)] = builds.UNSTABLE
            builds.mark_driven(status, system)
        upright = np.broadcast_to(np.eye(3), (count, len(system.body) + 1, 3, 3))
        wire = np.full(count, -1, dtype=np.int16)
        system = replace(system, orientation=upright)
        found = Builds(system, status, wire, np.zeros(count), (True, True))
        yield found, np.array([n for n, _ in members])


def _of_loads(scene: Scene) -> tuple[Hashable, ...]:
    """What the scenes of a batch share, but not all scenes of one topology: it follows from loads.

    The losses of legs and filters, the mass coupling of blades, and arrays of further elements.
    """
    added = [
        np.array(value).tobytes() if isinstance(value, np.ndarray) else value
        for part in scene.added.values()
        for name, value in vars(part).items()
        if name not in inner_axes(type(part))
    ]
    return (scene.springs.label, scene.springs.loss.tobytes(), scene.bars.label, *added)
