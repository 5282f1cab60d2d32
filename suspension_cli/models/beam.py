"""Linear model of a suspension whose wires bend and twist, with losses as functions of frequency.

A wire is a beam under tension (`elements.dynamic_wire`), solved exactly. In the violin model it has
distributed mass too (`massive`), and so all violin modes; all else is the same.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design.schema import Design
from suspension_cli.elements import loss
from suspension_cli.elements.configuration import Configuration, batch_first
from suspension_cli.elements.dynamic_wire import EQUAL_WITHIN, TautWire, fit_to_equilibrium
from suspension_cli.elements.known_elements import elements_of
from suspension_cli.elements.vectors import Vector, cross, dot, times, transposed
from suspension_cli.equilibrium import clamps
from suspension_cli.equilibrium.solve import Equilibrium
from suspension_cli.linear.matrix_terms import Damper, StructuralLoss
from suspension_cli.linear.symmetry import find_symmetry, no_symmetry
from suspension_cli.linear.system import LinearSystem
from suspension_cli.linear.terms import Term
from suspension_cli.linear.wire_term import WireTerm
from suspension_cli.models import string as string_model
from suspension_cli.models.base import MASS
from suspension_cli.models.string import Assembly
from suspension_cli.models.tip_dampers import with_tip_dampers
from suspension_cli.scene import fibres as fibres_of
from suspension_cli.scene.arrays import Array
from suspension_cli.scene.pose import Layout, layout
from suspension_cli.scene.scene import BladeLoss, Fibres, Scene

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact, Int


def linear_model(
    scene: Scene, design: Design, *, massive: bool, split: bool = True
) -> tuple[LinearSystem, Equilibrium]:
    """Linear model of small motions of a scene whose wires bend, and have mass if `massive`.

    The scene has `fibres`, and one batch axis or none. The stiffness is static and lossless;
    `terms` are the rest, functions of frequency. Also returns the equilibria, not necessarily
    converged. `split` as for `string.linear_model`.

    Raises `InputError` if a scene without batch axes has no equilibrium, or a slack wire in it.
    """
    numbering = layout(scene)
    scene, balanced = clamps.solve_bending(scene, numbering)
    if not scene.batch:
        balanced.demand(scene)
    adapted = find_symmetry(scene, numbering) if split else no_symmetry(numbering)
    # `terms` have the losses
    bare = Assembly(lossless(scene), numbering, balanced.pose, adapted)
    model = string_model.assemble(bare, balanced, wire_inertia=not massive)
    assembly = replace(bare, scene=scene)
    of_springs, of_ground = string_model.spring_terms(assembly)
    terms = (
        *of_springs[: len(of_ground)],
        *_wire_terms(bare, balanced, massive=massive),
        *_blade_terms(assembly),
        *of_springs[len(of_ground) :],
        *_gas_terms(assembly, design),
    )
    ground = model.ground if model.ground is None else replace(model.ground, terms=of_ground)
    return replace(model, terms=terms, ground=ground), balanced


def lossless(scene: Scene) -> Scene:
    """The scene without the losses of wires, blades, springs and added elements."""
    parts = {name: part for name, part in scene.parts.items() if hasattr(part, "loss")}
    return scene.with_parts(
        {name: replace(part, loss=np.zeros_like(part.loss)) for name, part in parts.items()}
    )


def _blade_terms(assembly: Assembly) -> Iterator[StructuralLoss]:
    """Losses of blades, those of a stage that are alike together, and of added elements."""
    scene = assembly.scene
    fibres = assembly.scene.fibres
    size = assembly.numbering.size
    assert fibres is not None
    alike: dict[BladeLoss, list[int]] = {}
    for own in fibres.blade:
        stage = own.label.rsplit(".", 1)[0]
        number = scene.blades.label.index(own.label)
        alike.setdefault(replace(own, label=stage), []).append(number)
    stiffness = scene.blades.stiffness
    axes = scene.blades.axes
    for own, numbers in alike.items():
        matrix = np.zeros((*stiffness.shape[:-2], size, size))
        for n in numbers:
            rows = assembly.numbering.blade[n][axes[n]]
            matrix[..., rows, rows] = stiffness[..., n, axes[n]]
        matrix = assembly.adapted.apply(matrix)
        angle = partial(loss.blade_angle, own)
        yield StructuralLoss(f"{own.label}.blades", own.temperature, matrix, angle)
    for item in elements_of(scene):
        if item.make is not None and item.add_loss is not None:
            matrix = assembly.sum([item.add_loss])
            yield StructuralLoss(item.name, fibres.temperature, matrix, np.ones_like)


def _gas_terms(assembly: Assembly, design: Design) -> Iterator[Damper]:
    """Losses by the gas around the bodies."""
    scene = assembly.scene
    size = assembly.numbering.size
    for n, own in enumerate(_gas_damping(scene.fibres, design), 1):
        if own is None:
            continue
        gas = scene.fibres and scene.fibres.gas
        turn = assembly.pose.rotation[..., n, :, :]
        assert gas is not None and gas.temperature is not None
        matrix = np.zeros((*turn.shape[:-2], size, size))
        for half in (0, 3):
            rows = slice(6 * n + half, 6 * n + half + 3)
            drag = own[half:, half:][:3, :3]
            matrix[..., rows, rows] = turn @ drag @ np.swapaxes(turn, -1, -2)
        matrix = assembly.adapted.apply(matrix)
        cause = f"{scene.bodies.name[n - 1]}.gas"
        yield Damper(cause, gas.temperature, matrix)


def _gas_damping(made: Fibres | None, design: Design) -> list[Array | None]:
    """Damping (6, 6) of each body by the gas around it, in its own frame at its COM."""
    gas = made and made.gas
    return [] if gas is None else [loss.body_damping(stage.body, gas) for stage in design.stage]


def _wire_terms(assembly: Assembly, balanced: Equilibrium, *, massive: bool) -> list[Term]:
    scene = assembly.scene
    numbering = assembly.numbering
    adapted = assembly.adapted
    fibres = scene.fibres
    wires = scene.wires
    assert fibres is not None
    if not wires.label:
        return []
    place = _coordinates_at_ends(scene, numbering)
    forms = wire_forms(assembly.now)
    length = batch_first(assembly.now.wires.length, scene.batch)
    geometry = np.stack(
        np.broadcast_arrays(length, wires.stiffness, balanced.tension, wires.torsion)
    )
    terms: list[Term] = []
    for alike in _alike(scene, geometry):
        own = geometry[..., alike]
        number = np.array(alike)
        if scene.batch:
            own = np.ascontiguousarray(np.swapaxes(own, -1, -2))
        else:
            own = [float(own[0].mean()), own[1, 0], float(own[2].mean()), own[3, 0]]
        fibre = fit_to_equilibrium(fibres.wire[alike[0]], *own)
        strand = TautWire(fibre, own[2], massive, lossy=True, surrounded=fibres.gas)
        columns = np.unique(place[alike])
        columns = columns[columns < numbering.size]
        at = np.searchsorted(columns, place[alike])
        motion = {
            part: _per_column(rows[:, :, alike], at, len(columns), scene.batch)
            for part, rows in forms.items()
        }
        stage = scene.bodies.name[wires.lower[alike[0]] - 1]
        term = WireTerm(stage, strand, number, columns, motion, numbering.size)
        terms.append(term if adapted.trivial else term.spread(adapted.basis))
    return terms


def _alike(scene: Scene, geometry: Float[np.ndarray, "4 *build wire"]) -> list[list[int]]:
    """Group wires of equal sections on one stage; of one design, of equal geometry too."""
    assert scene.fibres is not None
    groups: list[tuple[tuple[object, ...], list[int]]] = []
    for n, fibre in enumerate(scene.fibres.wire):
        kind = fibre.sections, scene.wires.lower[n]
        for known, group in groups:
            here = geometry[..., n]
            there = geometry[..., group[0]]
            if known == kind and (
                scene.batch or (np.abs(here - there) <= EQUAL_WITHIN * np.abs(there)).all()
            ):
                group.append(n)
                break
        else:
            groups.append((kind, [n]))
    return [group for _, group in groups]


def _coordinates_at_ends(scene: Scene, numbering: Layout) -> Int[np.ndarray, "wire 15"]:
    """Coordinates that move the ends of wires: of both bodies and the blade's tip; N for none."""
    wires = scene.wires
    bodies = 6 * np.stack([wires.upper, wires.lower], axis=1)[..., None] + np.arange(6)
    tips = np.append(numbering.blade, np.full((1, 3), numbering.size), axis=0)[wires.blade]
    return np.concatenate([bodies.reshape(-1, 12), tips], axis=1)


def _per_column(
    rows: Inexact[np.ndarray, "row 15 wire build"],
    at: Int[np.ndarray, "wire 15"],
    count: int,
    batch: tuple[int, ...],
) -> Inexact[np.ndarray, "*batch wire row column"]:
    """Spread forms per coordinate at the ends of wires over columns; batch axes in front.

    `at` are the columns, of which there are `count`; that number stands for none.
    """
    spread = np.zeros((len(rows), count + 1, *rows.shape[2:]), dtype=rows.dtype)
    spread[:, at.T, np.arange(len(at))] = rows
    return np.ascontiguousarray(batch_first(spread[:, :-1], batch))


def wire_forms(now: Configuration) -> dict[str, Inexact[np.ndarray, "_ 15 wire build"]]:
    """Motion of the ends of every wire per coordinate that moves them, for each of `PARTS`.

    These are the coordinates of the upper and the lower body and of the blade's tip. The motion is
    in the axes of the wire as it hangs: e from its upper to its lower end, n_1 its first principal
    plane across e, n_2 = e x n_1. A rotation t of a body turns the wire's end to the slope (t x e)
    . n and twists it by t . e.
    """
    lines = now.wires
    flex = now.flex
    assert flex is not None
    e = lines.direction
    turn = now.turn_of(lines.ends.upper)
    first = flex.upper[0] + times(turn, flex.upper[0])
    first = first + flex.lower[0] + times(now.turn_of(lines.ends.lower), flex.lower[0])
    first = first - dot(first, e) * e
    first = first / np.sqrt(dot(first, first))

    shape = e.shape[1:]
    # what the upper end adds to the mean of both it takes from their difference
    lower_less_upper = np.ones((15, 1, 1))
    lower_less_upper[:6] = lower_less_upper[12:] = -1.0

    def move(mean: Vector, difference: Vector, along: Vector) -> None:
        """Fill in half the motion of both ends along a unit vector."""
        half = along / 2
        mean[:3] = mean[6:9] = half
        mean[3:6] = cross(lines.upper_arm, half)  # (t x arm) . n = t . (arm x n)
        mean[9:12] = cross(lines.lower_arm, half)
        mean[12:] = half + times(transposed(turn), half)
        np.multiply(mean, lower_less_upper, out=difference)

    def rotate(mean: Vector, difference: Vector, about: Vector) -> None:
        """Fill in half the rotation of both ends about a unit vector."""
        mean[3:6] = mean[9:12] = about / 2
        np.multiply(mean, lower_less_upper, out=difference)

    result = {}
    for part, n in (("bend-1", first), ("bend-2", cross(e, first))):
        even, even_turn, odd, odd_turn = result[part] = np.zeros((4, 15, *shape), dtype=e.dtype)
        move(even, odd, n)
        rotate(odd_turn, even_turn, cross(e, n))  # (t x e) . n = t . (e x n)
    for part, fill in (("stretch", move), ("twist", rotate)):
        even, odd = result[part] = np.zeros((2, 15, *shape), dtype=e.dtype)
        fill(even, odd, e)
    return result


class Beam(string_model.SceneModel):
    """The beam model, valid below the first violin mode."""

    name = "beam"
    description = "wires bend and twist, with all losses"
    omits = (MASS,)
    cost = 20.0

    def unsuitable(self, design: Design) -> str:
        """Why wires lack a property that the model needs; "" if none does."""
        return fibres_of.explain_unsuitable(design, massive=self.has_wire_mass)

    def wire_properties(self, design: Design) -> tuple[Hashable, ...]:
        """Sections, clamps and losses of wires, losses of blades, and gas damping."""
        made = clamps.compose(design)
        drag = _gas_damping(made, design)
        directions = [np.array([fibre.plane, *fibre.clamp]).tobytes() for fibre in made.wire]
        kinds = [(fibre.sections, fibre.effective) for fibre in made.wire]
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
    ) -> tuple[LinearSystem, Equilibrium]:
        """Builds whose wires bend, each with its length and tension in its own equilibrium."""
        assert scene.fibres is not None
        model, found = linear_model(scene, design, massive=self.has_wire_mass, split=split)
        return with_tip_dampers(model, design, scene, found.pose), found


class Violin(Beam):
    """The violin model, valid at any frequency."""

    name = "violin"
    description = "wires bend and have mass: all violin modes"
    omits = ()

    def refined(self, design: Design, built: Mapping[str, LinearSystem]) -> LinearSystem:
        """The system, from that of the beam model if that is `built`."""
        simpler = built.get(BEAM.name)
        if simpler is None or design.constants.wire_weight:  # the beam model then has their inertia
            return super().refined(design, built)
        terms = tuple(
            replace(term, strand=replace(term.strand, massive=True))
            if isinstance(term, WireTerm)
            else term
            for term in simpler.terms
        )
        return replace(simpler, terms=terms)


BEAM = Beam()
VIOLIN = Violin()
