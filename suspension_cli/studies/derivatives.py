"""Exact derivatives of a design's static matrices with respect to its numbers.

They include the change of the equilibrium. All matrices are closed forms of the scene. A number p
enters the scene, and through it the gradient g and the Hessian K of the energy in a pose q. In
equilibrium g(q, p) = 0, so the pose follows with dq/dp = -K^-1 dg/dp (the implicit function
theorem), and

    dK/dp = d/dh Im K(q + ih dq/dp, p + ih)   for h -> 0,

one complex step (see `parameters`) through the code that computes K; M, C and the losses likewise.
Newton's iterations are not differentiated.

In the beam model K also depends on the bending stiffness S of the wires, which follows from their
tensions and lengths in equilibrium. The pose changes S, and S the pose. A few more steps with both
converge, each smaller by the ratio of bending forces to the weight. The losses of wires that bend
depend on frequency and are not in these matrices (`studies.differences` has them).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from suspension_cli.conventions import DOFS
from suspension_cli.design.derive import gives_natural_lengths, solves_pose
from suspension_cli.design.schema import Design
from suspension_cli.elements import bending, string
from suspension_cli.equilibrium import bending_wires, clamps
from suspension_cli.equilibrium import solve as equilibrium
from suspension_cli.equilibrium.energy import gradient_and_stiffness
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.linear.signals import Signal, linear_form
from suspension_cli.linear.symmetry import is_mirror_symmetric
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import registry
from suspension_cli.models import string as string_model
from suspension_cli.models.loss_terms import lossless
from suspension_cli.models.surroundings import surrounded, with_frame
from suspension_cli.scene.pose import Layout, Pose, displace, layout, nominal_pose
from suspension_cli.scene.scene import Part, Scene
from suspension_cli.studies.parameters import STEP, stepped

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Inexact

CONVERGED = 1e-11
"""Relative change at which the derivative of a pose has converged, where wires bend."""
PASSES = 12
"""Largest number of steps to that derivative."""
MOVED = 1e-7
"""Residual force (relative to the weight, per relative change of a number) above which that number
cannot change alone."""


@dataclass(frozen=True)
class Linear:
    """Matrices of a linear model, or their derivatives, in the named coordinates.

    Attributes
    ----------
    mass, stiffness, damping, loss
        SI, with the support's coordinates; `loss` is the imaginary part of the stiffness.
    orientation
        Of each body, the support first.
    scene
        The scene of the model, with a complex step where this is a derivative.
    ground_columns
        Columns of stiffness, damping and loss for the motion of the ground beside the support.
    """

    mass: Inexact[np.ndarray, "coordinate coordinate"]
    stiffness: Inexact[np.ndarray, "coordinate coordinate"]
    damping: Inexact[np.ndarray, "coordinate coordinate"]
    loss: Inexact[np.ndarray, "coordinate coordinate"]
    orientation: Inexact[np.ndarray, "1+body 3 3"]
    scene: Scene
    ground_columns: Float[np.ndarray, "3 coordinate 6"] | None = field(default=None, kw_only=True)

    @property
    def driven_by_ground(self) -> Linear:
        """With the motion of the ground in the support's columns, without its rows."""
        assert self.ground_columns is not None
        parts = {}
        for name, columns in zip(
            ("stiffness", "damping", "loss"), self.ground_columns, strict=True
        ):
            matrix = getattr(self, name).copy()
            matrix[:, :6] = columns
            parts[name] = matrix
        mass = self.mass.copy()
        mass[:, :6] = 0.0
        return replace(self, mass=mass, **parts)

    @cached_property
    def mirrors(self) -> Bool[np.ndarray, " axis"]:
        """Symmetry under mirroring x and y; of a derivative, whether the change keeps it."""
        return is_mirror_symmetric(_scale_steps(self.scene))

    def dynamic(
        self, omega: Float[np.ndarray, "*frequency"] | float
    ) -> Complex[np.ndarray, "*frequency coordinate coordinate"]:
        """K + i K'' + i omega C - omega^2 M at angular frequencies, rad/s."""
        w = np.asarray(omega)[..., None, None]
        return self.stiffness + 1j * (self.loss + w * self.damping) - w**2 * self.mass

    @property
    def matters(self) -> bool:
        """Whether any matrix is not 0."""
        return any(
            value.any()
            for value in (self.mass, self.stiffness, self.damping, self.loss, self.orientation)
        )


@dataclass(frozen=True)
class Differentiable:
    """A design in its equilibrium, with what its derivatives need.

    Attributes
    ----------
    stiffness
        Of the suspension alone, without dampers and a compliant support.
    model, linear
        The complete model, without symmetry-adapted coordinates, and its matrices.
    bends
        Whether wires bend; `scene` then has their bending stiffness in equilibrium.
    turned
        Whether the equilibrium is not the nominal pose.
    """

    design: Design
    scene: Scene
    numbering: Layout
    pose: Pose
    stiffness: Float[np.ndarray, "coordinate coordinate"]
    model: LinearSystem
    linear: Linear
    bends: bool = False
    turned: bool = False

    def row(self, signal: Signal) -> Float[np.ndarray, " coordinate"]:
        """Compute the linear form of a signal in the named coordinates."""
        return linear_form(signal, replace(self.model, orientation=self.linear.orientation))

    def row_change(self, change: Linear, signal: Signal) -> Float[np.ndarray, " coordinate"]:
        """Differentiate that form: points of signals move with their bodies."""
        if not change.orientation.any():
            return np.zeros(self.model.size)
        turned = self.linear.orientation + 1j * STEP * change.orientation
        return np.imag(linear_form(signal, replace(self.model, orientation=turned))) / STEP


def prepared(design: Design, level: str = registry.STRING.name) -> Differentiable:
    """Find the equilibrium of a design, and the static matrices there, in a differentiable model.

    Raises `InputError` if there is no equilibrium, or a wire is slack in it.
    """
    physics = registry.scene_model(level)
    scene = physics.completed(expand(design), design)
    numbering = layout(scene)
    if physics.bends_wires:
        scene, found = bending_wires.solve_bending(scene, numbering)
        scene = lossless(scene)
    else:
        found = equilibrium.solve(scene, numbering)
    found.demand(scene)
    assert found.stiffness is not None
    model = surrounded(string_model.linear_model(scene, found, split=False), design)
    return Differentiable(
        design,
        scene,
        numbering,
        found.pose,
        found.stiffness,
        model,
        _linear(design, scene, numbering, found.pose, found.stiffness),
        physics.bends_wires,
        found.iterations > 0,
    )


def of(base: Differentiable, name: str) -> Linear | None:
    """Differentiate all matrices with respect to one number by dotted path, per its SI unit.

    None if it cannot change alone: the suspension would not balance in its nominal pose.
    """
    return along(base, {name: 1.0})


def along(base: Differentiable, rates: dict[str, float]) -> Linear | None:
    """Differentiate all matrices as several numbers change together, each at its rate."""
    now = moved(base, rates)
    return None if now is None else linear(base, now)


def linear(base: Differentiable, now: Moved) -> Linear:
    """Differentiate all matrices along a complex step."""
    whole = _linear(now.design, now.scene, base.numbering, now.pose, now.stiffness)
    parts = (whole.mass, whole.stiffness, whole.damping, whole.loss, whole.orientation)
    ground_columns = None if whole.ground_columns is None else np.imag(whole.ground_columns) / STEP
    return Linear(
        *(np.imag(part) / STEP for part in parts), scene=now.scene, ground_columns=ground_columns
    )


@dataclass(frozen=True)
class Moved:
    """A design, its equilibrium and its stiffness after a complex step of some numbers.

    Each number has `STEP` i times its rate added; imaginary parts over `STEP` are derivatives.
    """

    design: Design
    scene: Scene
    pose: Pose
    stiffness: Inexact[np.ndarray, "coordinate coordinate"]


def moved(base: Differentiable, rates: dict[str, float]) -> Moved | None:
    """Take a complex step of numbers of a design, each at its rate, and of its equilibrium.

    None if the suspension would not balance in its nominal pose.
    """
    design = base.design
    for name, rate in rates.items():
        design = stepped(design, name, rate)
    scene = expand(design)
    if _unbalanced(base, scene, design):
        return None
    if base.bends:
        return _moved_bending(base, design, scene)
    scene = registry.STRING.completed(scene, design)
    gradient, stiffness = gradient_and_stiffness(scene, base.numbering, base.pose)
    pose = base.pose
    if _solves_for_pose(base):
        free = slice(6, None)
        change = np.zeros(base.numbering.size)
        change[free] = -_solve_scaled(base.stiffness[free, free], np.imag(gradient[free]) / STEP)
        if change.any():
            pose = displace(base.numbering, pose, 1j * STEP * change)
            stiffness = gradient_and_stiffness(scene, base.numbering, pose)[1]
    return Moved(design, scene, pose, stiffness)


def _moved_bending(base: Differentiable, design: Design, scene: Scene) -> Moved:
    """Take the step of an equilibrium of wires that bend: pose and bending stiffness together."""
    scene = lossless(registry.BEAM.completed(scene, design))
    scene, _ = clamps.to_clamps(scene)
    pose, free = base.pose, slice(6, None)
    change = np.zeros(base.numbering.size)
    balanced = MOVED * float(base.scene.weight)
    stiffness = base.stiffness
    for _ in range(PASSES):
        now = string.state(scene, pose)
        scene = bending.with_bending(scene, now.tension, now.length)
        gradient, stiffness = gradient_and_stiffness(scene, base.numbering, pose)
        rest = np.imag(gradient[free]) / STEP
        if not (base.turned or _solves_for_pose(base) or np.abs(rest).max() > balanced):
            break
        step = -_solve_scaled(base.stiffness[free, free], rest)
        if np.abs(step).max() <= CONVERGED * np.abs(change).max():
            break
        change[free] += step
        pose = displace(base.numbering, base.pose, 1j * STEP * change)
    return Moved(design, scene, pose, stiffness)


def _scale_steps(scene: Scene) -> Scene:
    """Scale complex steps of a scene to derivatives, for comparisons that allow for rounding."""

    def grown(part: Part) -> Part:
        steps = {
            name: value.real + 1j * (value.imag / STEP)
            for name, value in vars(part).items()
            if isinstance(value, np.ndarray) and value.dtype == complex
        }
        return replace(part, **steps)

    return scene.with_parts({name: grown(part) for name, part in scene.parts.items()})


def _solves_for_pose(base: Differentiable) -> bool:
    """Whether the pose was solved for, and so depends on the design's numbers."""
    scene = base.scene
    return scene.drawn is not None or bool(scene.added) or solves_pose(base.design)


def _unbalanced(base: Differentiable, scene: Scene, design: Design) -> bool:
    """Whether a suspension that balances in its nominal pose no longer does after the step."""
    if gives_natural_lengths(design) or scene.field is not None or scene.added:
        return False
    drawn = scene.drawn or scene  # straight wires: blades are loaded as without bending
    gradient = gradient_and_stiffness(drawn, base.numbering, nominal_pose(drawn))[0]
    # the loads of blades may differ from those in the nominal pose
    bodies = slice(6, 6 + 6 * len(drawn.bodies.name))
    left = np.abs(np.imag(gradient[bodies])).max() / STEP
    return bool(left > MOVED * float(base.scene.weight))


def _solve_scaled(
    matrix: Float[np.ndarray, "coordinate coordinate"], right: Float[np.ndarray, " coordinate"]
) -> Float[np.ndarray, " coordinate"]:
    """Solve K x = f in scaled coordinates; the shortest solution where K is singular."""
    root = np.sqrt(np.abs(np.diag(matrix)))
    root[root == 0] = 1.0
    return np.linalg.lstsq(matrix / np.outer(root, root), right / root, rcond=1e-13)[0] / root


def _linear(
    design: Design,
    scene: Scene,
    numbering: Layout,
    pose: Pose,
    stiffness: Inexact[np.ndarray, "coordinate coordinate"],
) -> Linear:
    """Compute all matrices in a pose, real or with complex steps."""
    body = scene.bodies.name
    plain = LinearSystem(
        body=body,
        coordinate=numbering.name,
        basis=np.eye(numbering.size),
        massless=np.zeros(numbering.size, dtype=bool),
        mass=string_model.mass_matrix(scene, numbering, pose),
        stiffness=stiffness,
        damping=string_model.damping_matrix(scene, numbering, pose),
    )
    loss, ground_columns = string_model.loss_matrix(scene, numbering, pose), None
    if scene.springs.grounded.any():
        ground = string_model.ground_couplings(scene, numbering, pose)
        without = string_model.without_ground
        plain = replace(
            plain,
            stiffness=without(plain.stiffness, ground.stiffness),
            damping=without(plain.damping, ground.damping),
        )
        loss = without(loss, ground.loss)
        ground_columns = np.stack([ground.stiffness, ground.damping, ground.loss])[..., :6]
        ground_columns[:, :6] = 0.0
    whole = surrounded(plain, design)
    if design.support is not None:
        loss = with_frame(replace(plain, stiffness=loss), _lossy_frame(design)).stiffness
    turned = pose.rotation + np.zeros((len(body) + 1, 3, 3))
    if ground_columns is not None:
        ground_columns = np.pad(ground_columns, ((0, 0), (0, whole.size - numbering.size), (0, 0)))
    return Linear(
        whole.mass,
        whole.stiffness,
        whole.damping,
        loss,
        turned,
        scene,
        ground_columns=ground_columns,
    )


def _lossy_frame(design: Design) -> Design:
    """The design with the loss of its support structure in place of its stiffness."""
    support = design.support
    assert support is not None
    given = {dof: getattr(support.stiffness, dof) for dof in DOFS}
    lossy = {dof: value * support.loss_angle for dof, value in given.items() if value is not None}
    return msgspec.structs.replace(
        design,
        support=msgspec.structs.replace(
            support, stiffness=msgspec.structs.replace(support.stiffness, **lossy)
        ),
    )
