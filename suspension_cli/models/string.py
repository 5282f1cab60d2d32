"""Linear model of any scene on taut strings: mass, stiffness and damping about its equilibrium.

Every matrix is summed from closed-form contributions of the elements and is exactly symmetric.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Hashable
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.design.schema import Design
from suspension_cli.elements import bar, bending, blade, spring, string, weight
from suspension_cli.equilibrium.hinges import hinge_rigidities, to_hinges
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.equilibrium.solve import Equilibrium, solve
from suspension_cli.linear import separated_stiffness
from suspension_cli.linear.double_double import DoubleDouble
from suspension_cli.linear.stretching import Separated, Stretching
from suspension_cli.linear.symmetry import Symmetry, find_symmetry, no_symmetry
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models.base import BENDING, MASS, Model
from suspension_cli.scene.pose import Layout, Pose, layout, point_jacobian, rigid_motion
from suspension_cli.scene.scene import Scene

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact

    from suspension_cli.models.batch_terms import BatchTerm


def linear_model(
    scene: Scene,
    balanced: Equilibrium | None = None,
    *,
    split: bool = True,
    wire_inertia: bool = True,
) -> LinearSystem:
    """Linear model of small motions about the equilibrium of a scene on strings.

    Parameters
    ----------
    scene : Scene
        With any batch axes.
    balanced : Equilibrium, optional
        From `equilibrium.solve`, if it is known already.
    split : bool
        Whether to use mirror symmetries. Without them, the result for one scene of a batch does
        not depend on the others.
    wire_inertia : bool
        Whether the mass of wires that have weight moves as straight lines between their ends.

    Returns
    -------
    LinearModel
        If split, in symmetry-adapted coordinates, so that couplings that a symmetry forbids are
        exactly 0.

    Raises
    ------
    InputError
        If there is no equilibrium, or a wire is slack in it.
    """
    numbering = layout(scene)
    if balanced is None:
        balanced = solve(scene, numbering)
        balanced.demand(scene)
    pose = balanced.pose
    adapted = find_symmetry(scene, numbering) if split else no_symmetry(numbering)
    tips = np.zeros(numbering.size, dtype=bool)
    weightless = scene.blades.tip_mass == 0
    light = weightless.all(tuple(range(weightless.ndim - 1)))
    if wire_inertia and scene.wires.mass.any():
        light[scene.wires.blade[scene.wires.blade >= 0]] = False
    for number in np.flatnonzero(light):
        tips[numbering.blade[number][scene.blades.axes[number]]] = True
    stiffness, low, stretched = _stiffness(scene, numbering, balanced, adapted)
    separated, mass = _separated(scene, numbering, balanced, adapted)
    lossy = None
    if scene.wires.loss.any() or scene.blades.loss.any() or scene.springs.loss.any():
        lossy, lossy_low = _loss(scene, numbering, pose, adapted, stretched)
        if separated is not None:
            stretching = scene.wires.stiffness * (1 + 1j * scene.wires.loss)
            separated = Separated(separated.soft + 1j * lossy, separated.form, stretching)
            turned = np.swapaxes(separated.form, -1, -2) * stretching.imag[..., None, :]
            lossy = lossy + turned @ separated.form
        lossy, low = stiffness + 1j * lossy, None if low is None else low + 1j * lossy_low
    damping = (
        damping_matrix(scene, numbering, pose)
        if scene.springs.damping.any()
        else np.zeros((numbering.size,) * 2)
    )
    return LinearSystem(
        body=scene.bodies.name,
        coordinate=numbering.name,
        basis=adapted.basis,
        massless=adapted.carried(tips),
        mass=adapted.apply(
            mass_matrix(scene, numbering, pose, wire_inertia=wire_inertia) if mass is None else mass
        ),
        stiffness=stiffness,
        damping=adapted.apply(damping),
        lossy=lossy,
        low=low,
        stretched=stretched,
        separated=separated,
        orientation=None if balanced.iterations == 0 else pose.rotation,
        residual=float(np.max(balanced.residual)),
        wire=scene.wires.label,
        rigid=rigid_motion(numbering.size, scene.bodies.position + pose.shift),
    )


def _stiffness(
    scene: Scene, numbering: Layout, balanced: Equilibrium, adapted: Symmetry
) -> tuple[
    Inexact[np.ndarray, "*batch coordinate coordinate"],
    Float[np.ndarray, "coordinate coordinate"] | None,
    Stretching | None,
]:
    """Stiffness, its rounding error, and its part from the stretching of wires.

    The last two are None for a batch of scenes and for complex steps.
    """
    if scene.batch or np.issubdtype(scene.kind, np.complexfloating) or not scene.wires.label:
        return adapted.apply(balanced.stiffness), None, None
    soft, stretched = separated_stiffness.separate_stretching(scene, numbering, balanced, adapted)
    whole = stretched.added(DoubleDouble.of(soft), stretched.stiffness)
    return whole.high, whole.low, stretched


def _is_compiled(scene: Scene) -> bool:
    """Whether a scene is a batch that compiled loops take."""
    return len(scene.batch) == 1 and scene.kind == np.float64 and bool(scene.wires.label)


def _separated(
    scene: Scene, numbering: Layout, balanced: Equilibrium, adapted: Symmetry
) -> tuple[Separated | None, Any]:
    """The stiffness of a batch of builds apart from the stretching of wires, and the mass.

    None where these are not known.
    """
    if not _is_compiled(scene):
        return None, None
    from suspension_cli.equilibrium import compiled  # takes half a second

    soft, form, mass = compiled.tangent(scene, numbering, balanced.pose)
    separated = Separated(adapted.apply(soft), adapted.forms(form), scene.wires.stiffness)
    more = scene.blades.tip_mass.any() or scene.wires.mass.any() or scene.bars.label
    return separated, None if more else mass


def _loss(
    scene: Scene, numbering: Layout, pose: Pose, adapted: Symmetry, stretched: Stretching | None
) -> tuple[Any, Any]:
    """The imaginary part of the stiffness, and its rounding error (None if not known).

    Of a batch of builds, the part without the stretching of wires.
    """
    if stretched is None and not _is_compiled(scene):
        return adapted.apply(loss_matrix(scene, numbering, pose)), None
    rest = adapted.apply(loss_matrix(scene, numbering, pose, stretching=False))
    if stretched is None:
        return rest, None
    rest = DoubleDouble.of(rest)
    whole = stretched.added(rest, stretched.stiffness * scene.wires.loss)
    return whole.high, whole.low


def mass_matrix(
    scene: Scene, numbering: Layout, pose: Pose, *, wire_inertia: bool = True
) -> Inexact[np.ndarray, "*batch coordinate coordinate"]:
    """Mass matrix (..., N, N): bodies as they are turned, tip masses, bars and heavy wires."""
    result = np.zeros((*scene.batch, numbering.size, numbering.size), dtype=scene.kind)
    for n in range(1, len(scene.bodies.name) + 1):
        for axis in range(3):
            result[..., 6 * n + axis, 6 * n + axis] = scene.bodies.mass[..., n - 1]
        turn = pose.rotation[..., n, :, :]
        result[..., 6 * n + 3 : 6 * n + 6, 6 * n + 3 : 6 * n + 6] = (
            turn @ scene.bodies.inertia[..., n - 1, :, :] @ np.swapaxes(turn, -1, -2)
        )
    if scene.blades.tip_mass.any():
        every = np.arange(len(scene.blades.label))
        jacobian = point_jacobian(
            numbering, pose, scene.blades.body, blade.tip_arms(scene, pose), every
        )
        flat = jacobian.reshape(*jacobian.shape[:-2], -1)
        result = result + (
            flat * np.repeat(scene.blades.tip_mass, 3, axis=-1)[..., None, :]
        ) @ np.swapaxes(flat, -1, -2)
    if wire_inertia and scene.wires.mass.any():
        result = result + weight.wire_inertia(scene, numbering, pose)
    if scene.bars.label:
        result = result + bar.mass_matrix(scene, numbering, pose)
    return (result + np.swapaxes(result, -1, -2)) / 2


def damping_matrix(
    scene: Scene, numbering: Layout, pose: Pose
) -> Inexact[np.ndarray, "*batch coordinate coordinate"]:
    """Viscous damping (..., N, N) of the springs."""
    result = np.zeros((*scene.batch, numbering.size, numbering.size), dtype=scene.kind)
    now = spring.state(scene, pose)
    for number in range(len(scene.springs.label)):
        jacobian = spring.strain_jacobian(scene, numbering, pose, now, number)
        result = (
            result
            + np.swapaxes(jacobian, -1, -2) @ scene.springs.damping[..., number, :, :] @ jacobian
        )
    return (result + np.swapaxes(result, -1, -2)) / 2


def loss_matrix(
    scene: Scene, numbering: Layout, pose: Pose, *, stretching: bool = True
) -> Inexact[np.ndarray, "*batch coordinate coordinate"]:
    """Imaginary part (..., N, N) of the stiffness: each elastic constant times its loss angle.

    With or without the stretching of wires.

    Tension times geometry is not lossy: only the stretching of wires, their torsion where it is
    given, the bending of blades and springs are.
    """
    result = np.zeros((*scene.batch, numbering.size, numbering.size), dtype=scene.kind)
    if scene.wires.loss.any() and stretching:
        now = string.state(scene, pose)
        along = (
            string.span_jacobian(scene, numbering, pose, now) * now.direction[..., None, :, :]
        ).sum(-1)
        result = result + (
            along * (scene.wires.stiffness * scene.wires.loss)[..., None, :]
        ) @ np.swapaxes(along, -1, -2)
    if scene.wires.loss.any():
        _add_twist_loss(scene, pose, result)
    if scene.blades.loss.any():
        rows = numbering.blade[scene.blades.axes]
        result[..., rows, rows] += (scene.blades.stiffness * scene.blades.loss[:, None])[
            ..., scene.blades.axes
        ]
    now = spring.state(scene, pose)
    for number in np.flatnonzero(scene.springs.loss).tolist():
        jacobian = spring.strain_jacobian(scene, numbering, pose, now, number)
        matrix = scene.springs.stiffness[..., number, :, :] * scene.springs.loss[number]
        result = result + np.swapaxes(jacobian, -1, -2) @ matrix @ jacobian
    return (result + np.swapaxes(result, -1, -2)) / 2


def _add_twist_loss(
    scene: Scene, pose: Pose, result: Inexact[np.ndarray, "*batch coordinate coordinate"]
) -> None:
    """Add the loss of the torsion of wires."""
    wires, flex = scene.wires, bending.wire_resistance(scene)
    if flex is None:
        return
    turn = bending.twist_jacobian(scene, pose, flex)
    lost = (flex.twist * wires.loss)[..., None, None] * turn[..., :, None] * turn[..., None, :]
    for n in np.flatnonzero(wires.loss).tolist():
        rows = np.concatenate(
            [6 * body[n] + np.arange(3, 6) for body in (wires.upper, wires.lower)]
        )
        result[..., rows[:, None], rows] += lost[..., n, :, :]


class SceneModel(Model):
    """A model of any geometry, whose imperfect builds balance away from the nominal pose."""

    valid_for = "general geometry"
    supports_builds = True

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
    ) -> tuple[LinearSystem, Equilibrium, tuple[BatchTerm, ...]]:
        """Linear models of builds about their equilibria, on a rigid support without dampers.

        Parameters
        ----------
        scene : Scene
            From `completed`, with the builds as its one batch axis.
        design : Design
            The design of all, for what the scene does not say.
        split : bool
            Whether to use the mirror symmetries that all builds share. Without them, the result
            for one build does not depend on the others.

        Returns
        -------
        LinearModel
            With the builds as first axis.
        Equilibrium
            Not necessarily converged.
        terms : tuple of BatchTerm
            The parts that depend on frequency.
        """


class String(SceneModel):
    """The string model: any geometry on taut strings, blade tips as coordinates."""

    name = "string"
    description = "any geometry on taut, straight strings"
    omits = (BENDING, MASS)
    cost = 4.0
    supports_derivatives = True
    exact_derivatives = True

    def unsuitable(self, design: Design) -> str:
        """Never: every design has strings."""
        del design
        return ""

    def suspension(self, design: Design) -> LinearSystem:
        """The linear model on a rigid support."""
        return linear_model(self.completed(expand(design), design))

    def wire_properties(self, design: Design) -> tuple[Hashable, ...]:
        """Bending stiffness of hinged wires, which shortens their strings."""
        return hinge_rigidities(design)

    def completed(self, scene: Scene, design: Design) -> Scene:
        """The scene with its hinged wires ending at their hinges."""
        return to_hinges(scene, hinge_rigidities(design))

    def in_equilibrium(
        self, scene: Scene, design: Design, *, split: bool = False
    ) -> tuple[LinearSystem, Equilibrium, tuple[BatchTerm, ...]]:
        """Builds on strings, whose matrices do not depend on frequency."""
        del design
        found = solve(scene, layout(scene))
        return linear_model(scene, found, split=split), found, ()


STRING = String()
