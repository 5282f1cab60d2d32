"""Linear model of any scene on taut strings: mass, stiffness and damping about its equilibrium.

Every matrix is summed from closed-form contributions of the elements and is exactly symmetric.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Hashable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design.schema import Design
from suspension_cli.elements import loss, spring
from suspension_cli.elements.configuration import (
    Configuration,
    batch_of,
    builds_last,
    configuration,
)
from suspension_cli.elements.known_elements import elements_of
from suspension_cli.equilibrium.clamps import hinge_rigidities, to_hinges
from suspension_cli.equilibrium.energy import sum_in_pose
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.equilibrium.solve import Equilibrium, solve_once
from suspension_cli.equilibrium.tree import chain_tops
from suspension_cli.linear.coordinates import momentum_units
from suspension_cli.linear.matrix_terms import StiffnessTable, StructuralLoss
from suspension_cli.linear.symmetry import Symmetry, find_symmetry, no_symmetry
from suspension_cli.linear.system import Ground, LinearSystem
from suspension_cli.models.base import BENDING, MASS, Model
from suspension_cli.models.tip_dampers import with_tip_dampers
from suspension_cli.rotations import rigid_motion
from suspension_cli.scene.arrays import Array, inner_axes
from suspension_cli.scene.pose import Layout, Pose, layout
from suspension_cli.scene.scene import BladeLoss, Scene, Spectrum, Springs

if TYPE_CHECKING:
    from suspension_cli.elements.element import Contribution

Function = Callable[[Array], Array]
"""A loss angle, or a relative change of stiffness, against angular frequency (rad/s)."""


@dataclass(frozen=True)
class Assembly:
    """Elements of a scene in a pose, whose matrices are in the coordinates of its symmetry."""

    scene: Scene
    numbering: Layout
    pose: Pose
    adapted: Symmetry

    @cached_property
    def now(self) -> Configuration:
        """The scene in its pose, builds last."""
        return configuration(self.scene, self.numbering, self.pose)

    def sum(self, parts: Iterable[Contribution | None]) -> np.ndarray:
        """Sum quadratic forms of elements: (..., N, N), or (N, N) without any."""
        own = sum_in_pose(self.now, batch_of(self.scene, self.pose), [*parts])
        return self.adapted.apply(own)


def linear_model(
    scene: Scene, balanced: Equilibrium | None = None, *, split: bool = True
) -> LinearSystem:
    """Linear model of small motions about the equilibrium of a scene on strings, any batch axes.

    If `split`, couplings that a mirror symmetry forbids are exactly 0; otherwise a scene's result
    is independent of others in a batch. The equilibrium may be given.

    Raises `InputError` if there is no equilibrium, or a wire is slack in it.
    """
    numbering = layout(scene)
    if balanced is None:
        balanced = solve_once(scene, numbering)
        balanced.demand(scene)
    adapted = find_symmetry(scene, numbering) if split else no_symmetry(numbering)
    return assemble(Assembly(scene, numbering, balanced.pose, adapted), balanced)


def assemble(
    assembly: Assembly, balanced: Equilibrium, *, wire_inertia: bool = True
) -> LinearSystem:
    """Linear model of small motions about an equilibrium, see `linear_model`.

    With `wire_inertia`, wires that have weight also have mass, moving as straight lines between
    their ends.
    """
    scene = assembly.scene
    numbering = assembly.numbering
    adapted = assembly.adapted
    pose = assembly.pose
    kinds = elements_of(scene)
    tips = np.zeros(numbering.size, dtype=bool)
    weightless = scene.blades.tip_mass == 0
    light = weightless.all(tuple(range(weightless.ndim - 1)))
    if wire_inertia and scene.wires.mass.any():
        light[scene.wires.blade[scene.wires.blade >= 0]] = False
    tips[numbering.blade[scene.blades.axes & light[:, None]]] = True
    soft = adapted.apply(balanced.soft)
    elongation = adapted.forms(balanced.form)
    k = np.broadcast_to(scene.wires.stiffness, elongation.shape[:-1])
    if any(np.any(getattr(part, "loss", 0.0)) for part in scene.parts.values()):
        # each elastic constant times its loss angle, but the stretching of wires, see k;
        # geometric stiffness (tension) is not lossy
        soft = soft + 1j * assembly.sum(item.add_loss for item in kinds)
        k = k * (1 + 1j * scene.wires.loss)
    heavy = assembly
    if not wire_inertia and scene.wires.mass.any():
        wires = replace(scene.wires, mass=np.zeros_like(scene.wires.mass))
        heavy = replace(assembly, scene=replace(scene, wires=wires))
    terms, of_ground = spring_terms(assembly, tables=True)
    is_turned = np.abs(pose.turn).max() > 1e-13  # not only by a rounding error of Newton's method
    model = LinearSystem(
        body=scene.bodies.name,
        coordinate=numbering.name,
        unit=numbering.unit,
        momentum_unit=momentum_units(numbering.unit),
        basis=adapted.basis,
        massless=adapted.adapt_flags(tips),
        mass=heavy.sum(item.add_mass for item in kinds),
        damping=assembly.sum(item.add_damping for item in kinds),
        soft=soft,
        elongation=elongation,
        k=k,
        allowed=adapted.allowed,
        orientation=pose.rotation if is_turned else None,
        residual=float(np.max(balanced.residual)),
        wire=scene.wires.label,
        rigid=rigid_motion(numbering.size, scene.bodies.position + pose.shift),
        terms=tuple(terms),
        top=chain_tops(scene),
    )
    return _on_ground(model, assembly, of_ground) if scene.springs.grounded.any() else model


def _on_ground(
    model: LinearSystem, assembly: Assembly, terms: tuple[StructuralLoss, ...]
) -> LinearSystem:
    """Move the springs and dampers on the ground from the support to the ground.

    A scene attaches them to the support. Their elements in the support's six rows and columns
    belong to the ground.
    """
    springs = assembly.scene.springs
    own = {
        name: np.where(springs.grounded.reshape(-1, *(1,) * (axes - 1)), getattr(springs, name), 0)
        for name, axes in inner_axes(Springs).items()
        if name in ("stiffness", "damping", "preload")
    }
    scene = replace(assembly.scene, springs=replace(springs, **own))
    grounded = replace(assembly, scene=scene)
    # without what is between the moving bodies
    moving = np.arange(model.size) >= 6
    stiffness, damping, lost = (
        np.where(moving[:, None] & moving, 0.0, grounded.sum([part]))
        for part in (spring.add_derivatives, spring.add_damping, spring.add_loss)
    )

    def without(matrix: np.ndarray, coupling: np.ndarray) -> np.ndarray:
        # rounding residues where nothing else acts on the support become exactly 0
        result = matrix - coupling
        nothing = np.abs(result) <= 16 * np.finfo(float).eps * np.abs(coupling)
        return np.where((coupling != 0) & nothing, 0.0, result)

    soft = without(np.real(model.soft), stiffness)
    if np.iscomplexobj(model.soft):
        soft = soft + 1j * without(np.imag(model.soft), lost)
    whole = stiffness + 1j * lost if lost.any() else stiffness
    columns, resisted = (matrix[..., :6].copy() for matrix in (whole, damping))
    columns[..., :6, :] = 0.0
    resisted[..., :6, :] = 0.0
    ground = Ground(columns, resisted, terms)
    return replace(model, damping=without(model.damping, damping), soft=soft, ground=ground)


def spring_terms(
    assembly: Assembly, *, tables: bool = False
) -> tuple[list[StructuralLoss], tuple[StructuralLoss, ...]]:
    """Losses of springs and stiffnesses given as tables, or only the latter; any batch axes.

    The terms of the springs on the ground, which is at rest, are first. They are also returned
    alone, with the coordinates of the ground in place of the support's. Springs of one cause and
    loss share a term, so that what symmetry cancels between them is 0.
    """
    scene = assembly.scene
    springs = assembly.scene.springs
    known = {} if scene.fibres is None else {own.label: own for own in scene.fibres.spring}
    terms: dict[tuple[object, ...], StructuralLoss] = {}
    for n in np.argsort(~springs.grounded, kind="stable").tolist():
        spectrum = springs.spectrum[n]
        own = known.get(springs.label[n])
        if spectrum is None and (tables or not (own or springs.loss[n])):
            continue
        surroundings = scene.fibres or spectrum
        assert surroundings is not None
        own = own or BladeLoss(
            "", float(np.real(springs.loss[n])), None, 0.0, surroundings.temperature
        )
        owner, kind = springs.label[n].rsplit(".", 1)
        cause = springs.label[n] if kind == "link" else f"{owner}.springs"
        for axes, angle, storage in _functions(spectrum, own):
            chosen = np.zeros((len(springs.label), 6, 6))
            chosen[n] = axes
            form = builds_last(springs.stiffness * chosen, 3, scene.batch)
            matrix = assembly.sum([partial(spring.add_forms, form=form)])
            if storage is None:
                one = StructuralLoss(cause, own.temperature, matrix, angle)
            else:
                one = StiffnessTable(cause, own.temperature, matrix, angle, storage)
            alone = (n, len(terms)) if spectrum is not None else ()
            key = (bool(springs.grounded[n]), cause, replace(own, label=""), *alone)
            same = terms.get(key)
            terms[key] = one if same is None else replace(one, matrix=same.matrix + one.matrix)
    ground = tuple(term for key, term in terms.items() if key[0])
    others = np.diag(np.arange(assembly.numbering.size) >= 6).astype(float)
    return [*(term.spread(others) for term in ground), *[*terms.values()][len(ground) :]], ground


def _functions(
    spectrum: Spectrum | None, own: BladeLoss
) -> Iterator[tuple[Array, Function, Function | None]]:
    """Axes (6, 6) of a spring that share a function, loss angle and change of the real part."""
    if spectrum is None:
        yield np.ones((6, 6)), partial(loss.blade_angle, own), None
        return
    at = np.log(2 * np.pi * np.array(spectrum.frequency))

    def curve(values: tuple[float, ...], less: float) -> Function:
        def evaluate(omega: Array) -> Array:
            with np.errstate(divide="ignore"):
                return np.interp(np.log(np.abs(omega)), at, values) - less

        return evaluate

    for axis, real, imaginary in spectrum.axis:
        yield np.diag(np.eye(6)[axis]), curve(imaginary, 0.0), curve(real, 1.0)


class SceneModel(Model):
    """A model of any geometry, whose imperfect builds balance away from the nominal pose."""

    valid_for = "general geometry"
    supports_builds = True

    def suspension(self, design: Design) -> LinearSystem:
        """The linear model on a rigid support."""
        return self.of_scene(self.completed(expand(design), design), design)

    def of_scene(self, scene: Scene, design: Design) -> LinearSystem:
        """The linear model of a completed scene, on a rigid support without dampers."""
        return self.in_equilibrium(scene, design, split=True)[0]

    def wire_properties(self, design: Design) -> tuple[Hashable, ...]:
        """Properties of wires and gas, besides the scene, that designs of one batch must share."""
        del design
        return ()

    def completed(self, scene: Scene, design: Design) -> Scene:
        """A scene, or a batch of builds, with all properties of wires that the model needs."""
        del design
        return scene

    @abstractmethod
    def in_equilibrium(
        self, scene: Scene, design: Design, *, split: bool = False
    ) -> tuple[LinearSystem, Equilibrium]:
        """Linear models of builds about their equilibria, on a rigid support without dampers.

        The `scene` is from `completed`, with the builds as its one batch axis, which comes first in
        the linear models. Also returns the equilibria, not necessarily converged (those of a scene
        without batch axes are demanded). If `split`, the mirror symmetries that all builds share
        are used; otherwise the result for one build is independent of the others.
        """


class String(SceneModel):
    """The string model: any geometry on taut strings, blade tips as coordinates."""

    name = "string"
    description = "any geometry on taut, straight strings"
    omits = (BENDING, MASS)
    cost = 4.0

    def unsuitable(self, design: Design) -> str:
        """Never: every design has strings."""
        del design
        return ""

    def wire_properties(self, design: Design) -> tuple[Hashable, ...]:
        """Bending stiffness of hinged wires, which shortens their strings."""
        return hinge_rigidities(design)

    def completed(self, scene: Scene, design: Design) -> Scene:
        """The scene with its hinged wires ending at their hinges."""
        return to_hinges(replace(scene, fibres=None), hinge_rigidities(design))

    def in_equilibrium(
        self, scene: Scene, design: Design, *, split: bool = False
    ) -> tuple[LinearSystem, Equilibrium]:
        """Builds on strings."""
        found = solve_once(scene, layout(scene))
        if not scene.batch:
            found.demand(scene)
        model = linear_model(scene, found, split=split)
        return with_tip_dampers(model, design, scene, found.pose), found


STRING = String()
