"""Linear model of a suspension whose wires bend and twist, with losses as functions of frequency.

A wire is a beam under tension (`elements.dynamic_wire`), solved exactly. In the violin model it has
mass too (`massive`).
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design.schema import Design
from suspension_cli.elements import string
from suspension_cli.elements.bending import wire_geometry
from suspension_cli.elements.dynamic_wire import EQUAL_WITHIN, TautWire, fit_to_equilibrium
from suspension_cli.elements.gas import body_damping
from suspension_cli.equilibrium import bending_wires, clamps
from suspension_cli.equilibrium.solve import Equilibrium
from suspension_cli.linear.frequency_terms import LossTerm, Term, WireTerm
from suspension_cli.linear.symmetry import Symmetry, find_symmetry, no_symmetry
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import string as string_model
from suspension_cli.models.base import MASS
from suspension_cli.models.batch_terms import (
    BatchTerm,
    LossBatchTerm,
    WireBatchTerm,
    with_ground_terms,
)
from suspension_cli.models.loss_terms import Drag, gas_terms, loss_terms, lossless, spring_terms
from suspension_cli.rotations import cross
from suspension_cli.scene import fibres as fibres_of
from suspension_cli.scene.composition import Fibres
from suspension_cli.scene.pose import Layout, Pose, layout, point_jacobian
from suspension_cli.scene.scene import Scene

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact, Int


def linear_model(scene: Scene, drag: Drag = (), *, massive: bool) -> LinearSystem:
    """Linear model of small motions of a scene whose wires bend, and have mass if `massive`.

    The scene has no batch axes, and has `fibres`. The stiffness is static and lossless; `terms` are
    the rest, functions of frequency.

    Raises `InputError` if there is no equilibrium, or a wire is slack in it.
    """
    numbering = layout(scene)
    scene, balanced = bending_wires.solve_bending(scene, numbering)
    balanced.demand(scene)
    adapted = find_symmetry(scene, numbering)
    model = string_model.linear_model(
        lossless(scene), balanced, wire_inertia=not massive, adapted=adapted
    )
    of_springs, of_ground = spring_terms(scene, numbering, balanced.pose, adapted)
    grounded = of_springs[: len(of_ground)]
    terms = [
        *grounded,
        *_wire_terms(scene, numbering, balanced, adapted, massive=massive),
        *loss_terms(scene, numbering, balanced.pose, adapted),
        *of_springs[len(of_ground) :],
        *gas_terms(scene, numbering, balanced.pose, adapted, drag),
    ]
    ground = model.ground if model.ground is None else replace(model.ground, terms=of_ground)
    return replace(model, terms=tuple(terms), ground=ground)


def _wire_terms(
    scene: Scene, numbering: Layout, balanced: Equilibrium, adapted: Symmetry, *, massive: bool
) -> list[Term]:
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
        tension, k, torsion = (
            float(v)
            for v in (
                balanced.tension[alike].mean(),
                scene.wires.stiffness[first],
                scene.wires.torsion[first],
            )
        )
        fibre = fit_to_equilibrium(
            scene.fibres.wire[first], float(length[alike].mean()), k, tension, torsion
        )
        strand = TautWire(fibre, tension, massive, lossy=True, surrounded=scene.fibres.gas)
        stage = scene.bodies.name[scene.wires.lower[first] - 1]
        some = {}
        for part, rows in forms.items():
            moved = np.flatnonzero(rows[:, alike].any((1, 2)))
            some[part] = np.transpose(rows[moved][:, alike], (1, 2, 0)) @ adapted.basis[moved]
        terms.append(WireTerm(stage, strand, some, adapted.allowed))
    return terms


def _alike(
    scene: Scene,
    tension: Float[np.ndarray, " wire"],
    length: Float[np.ndarray, " wire"],
    one: int,
    other: int,
) -> bool:
    """Whether two wires agree in every number that their motion depends on."""
    assert scene.fibres is not None
    wires, (a, b) = scene.wires, (scene.fibres.wire[n] for n in (one, other))
    same = (
        wires.lower[one] == wires.lower[other]
        and a.sections == b.sections
        and a.temperature == b.temperature
    )
    return bool(
        same
        and all(
            abs(v[one] - v[other]) <= EQUAL_WITHIN * abs(v[one])
            for v in (tension, length, wires.stiffness, wires.torsion)
        )
    )


def wire_forms(
    scene: Scene, numbering: Layout, pose: Pose
) -> dict[str, Inexact[np.ndarray, "*batch coordinate wire _"]]:
    """Motion of the ends of every wire per coordinate, (..., N, w, c) for each of `PARTS`.

    In the axes of the wire as it hangs: e from its upper to its lower end, n_1 its first principal
    plane across e, n_2 = e x n_1. A rotation t of a body turns the wire's end to the slope (t x e)
    . n and twists it by t . e.
    """
    wires, now, flex = scene.wires, string.state(scene, pose), scene.flex
    assert flex is not None
    e = now.direction
    upper, lower = (
        pose.rotation[..., body, :, :] @ vector[..., 0, :, None]
        for body, vector in ((wires.upper, flex.upper), (wires.lower, flex.lower))
    )
    first = (upper + lower)[..., 0]
    first = first - (first * e).sum(-1, keepdims=True) * e
    first = first / np.sqrt((first**2).sum(-1, keepdims=True))
    planes = (first, cross(e, first))
    moved = (
        point_jacobian(numbering, pose, wires.upper, now.upper_arm, wires.blade),
        point_jacobian(numbering, pose, wires.lower, now.lower_arm),
    )
    turned = tuple(_turning(numbering, body) for body in (wires.upper, wires.lower))

    def even_odd(
        ends: Iterable[Inexact[np.ndarray, "*batch coordinate wire 3"]],
        along: Inexact[np.ndarray, "*batch wire 3"],
    ) -> tuple[
        Inexact[np.ndarray, "*batch coordinate wire"], Inexact[np.ndarray, "*batch coordinate wire"]
    ]:
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


def _turning(
    numbering: Layout, body: Int[np.ndarray, " wire"]
) -> Float[np.ndarray, "coordinate wire 3"]:
    """Rotation of the wires' bodies per coordinate."""
    result = np.zeros((numbering.size, len(body), 3))
    for axis in range(3):
        result[6 * body + 3 + axis, np.arange(len(body)), axis] = 1.0
    return result


def linear_models(
    scene: Scene, drag: Drag = (), *, massive: bool, split: bool = False
) -> tuple[LinearSystem, Equilibrium, tuple[BatchTerm, ...]]:
    """Static, lossless linear models of many builds, and their frequency-dependent terms.

    The scene has one batch axis, which comes first in the models, and has `fibres`. Also returns
    the equilibria, not necessarily converged. `split` as for `string.SceneModel.in_equilibrium`,
    the rest as for `linear_model`.
    """
    numbering = layout(scene)
    scene, found = bending_wires.solve_bending(scene, numbering)
    model = string_model.linear_model(lossless(scene), found, split=split, wire_inertia=not massive)
    plain = no_symmetry(numbering)
    of_springs, of_ground = spring_terms(scene, numbering, found.pose, plain)
    lossy = [
        *loss_terms(scene, numbering, found.pose, plain),
        *of_springs[len(of_ground) :],
        *gas_terms(scene, numbering, found.pose, plain, drag),
    ]
    terms = [
        *(LossBatchTerm(term) for term in of_springs[: len(of_ground)]),
        *_batch_wires(scene, numbering, found, massive=massive),
        *(LossBatchTerm(term) for term in lossy if isinstance(term, LossTerm)),
    ]
    model = with_ground_terms(model, of_ground, split=split)
    return model, found, tuple(term.spread(model.basis) if split else term for term in terms)


def _batch_wires(
    scene: Scene, numbering: Layout, found: Equilibrium, *, massive: bool
) -> list[BatchTerm]:
    from suspension_cli.elements import compiled_wire  # takes half a second

    fibres = scene.fibres
    assert fibres is not None
    if not fibres.wire:
        return []
    own = wire_geometry(scene, numbering, found.pose, found.tension)
    columns = (
        *(own.direction, own.normal, own.upper_arm, own.lower_arm, *own.tip_motion),
        *(own.length[None], own.tension[None], own.stiffness[None], own.torsion[None]),
    )
    geometry = np.ascontiguousarray(np.concatenate(columns).T)
    sections = compiled_wire.wire_sections(fibres.wire)
    return [
        WireBatchTerm(
            fibres.wire, massive, fibres.gas, numbering.size, own.place, sections, geometry
        )
    ]


def _gas_damping(made: Fibres, design: Design) -> Drag:
    gas = made.gas
    return () if gas is None else tuple(body_damping(stage.body, gas) for stage in design.stage)


class Beam(string_model.SceneModel):
    """The beam model, valid below the first violin mode."""

    name = "beam"
    description = "wires bend and twist, with all losses"
    omits = (MASS,)
    cost = 20.0

    def unsuitable(self, design: Design) -> str:
        """Why wires lack a property that the model needs; "" if none does."""
        return fibres_of.explain_unsuitable(design, massive=self.has_wire_mass)

    def of_scene(self, scene: Scene, design: Design) -> LinearSystem:
        """The linear model of a completed scene, on a rigid support without dampers."""
        assert scene.fibres is not None
        return linear_model(scene, _gas_damping(scene.fibres, design), massive=self.has_wire_mass)

    def wire_properties(self, design: Design) -> tuple[Hashable, ...]:
        """Sections, clamps and losses of wires, losses of blades, and gas damping."""
        made = clamps.compose(design)
        drag = _gas_damping(made, design)
        directions = [np.array([fibre.plane, *fibre.clamp]).tobytes() for fibre in made.wire]
        kinds = [(fibre.sections, fibre.temperature, fibre.effective) for fibre in made.wire]
        return (
            *directions,
            *kinds,
            made.blade,
            made.spring,
            made.gas,
            made.temperature,
            *(None if own is None else own.tobytes() for own in drag),
        )

    def completed(self, scene: Scene, design: Design) -> Scene:
        """The scene with the sections, clamps, losses and gas of its wires."""
        known = scene.fibres is not None
        return scene if known else replace(scene, fibres=clamps.compose(design))

    def in_equilibrium(
        self, scene: Scene, design: Design, *, split: bool = False
    ) -> tuple[LinearSystem, Equilibrium, tuple[BatchTerm, ...]]:
        """Builds whose wires bend, each with its length and tension in its own equilibrium."""
        assert scene.fibres is not None
        drag = _gas_damping(scene.fibres, design)
        return linear_models(scene, drag, massive=self.has_wire_mass, split=split)


BEAM = Beam()
