"""Exact derivatives of a design's static matrices with respect to its numbers.

They include the change of the equilibrium. All matrices are closed forms of the scene. A number p
enters the scene, and through it the gradient g and the Hessian K of the energy in a pose q. In
equilibrium g(q, p) = 0, so the pose follows with dq/dp = -K^-1 dg/dp (the implicit function
theorem), and

    dK/dp = d/dh Im K(q + ih dq/dp, p + ih)   for h -> 0,

one complex step (see `parameters`) through the code that computes K itself; M, C and the losses
likewise. Newton's iterations are not differentiated.

In the beam model K also depends on the bending stiffness S of the wires, which follows from their
tensions and lengths in equilibrium. The change of the pose then changes S, and S the pose: a few
more steps with both, each smaller by the ratio of the forces of bending to the weight, settle them.
The losses of wires that bend are functions of frequency and not of these matrices
(`studies.differences` has them).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

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
from suspension_cli.scene.scene import Scene
from suspension_cli.studies.parameters import STEP, stepped

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Inexact

CONVERGED = 1e-11
"""Relative change of the derivative of a pose at which it is final, where wires bend."""
PASSES = 12
"""Most steps of that derivative."""
MOVED = 1e-7
"""Residual force (relative to the weight, per relative change of a number) above which that number
cannot change alone."""


@dataclass(frozen=True)
class Linear:
    """A linear model, or its derivative, in the named coordinates, with those of the support.

    Attributes
    ----------
    mass, stiffness, damping, loss : array
        SI; `loss` is the imaginary part of the stiffness.
    orientation : array
        Of each body, the support first.
    scene
        The scene of the model, with a complex step where this is a derivative.
    beside : array or None
        Columns of stiffness, damping and loss for the motion of the ground beside the support.
    """

    mass: Inexact[np.ndarray, "coordinate coordinate"]
    stiffness: Inexact[np.ndarray, "coordinate coordinate"]
    damping: Inexact[np.ndarray, "coordinate coordinate"]
    loss: Inexact[np.ndarray, "coordinate coordinate"]
    orientation: Inexact[np.ndarray, "1+body 3 3"]
    scene: Scene
    beside: Float[np.ndarray, "3 coordinate 6"] | None = field(default=None, kw_only=True)

    @property
    def driven_by_ground(self) -> Linear:
        """With the motion of the ground in the support's columns, without its rows."""
        assert self.beside is not None
        parts = {}
        for name, columns in zip(("stiffness", "damping", "loss"), self.beside, strict=True):
            matrix = getattr(self, name).copy()
            matrix[:, :6] = columns
            parts[name] = matrix
        mass = self.mass.copy()
        mass[:, :6] = 0.0
        return replace(self, mass=mass, **parts)

    @cached_property
    def mirrors(self) -> Bool[np.ndarray, " axis"]:
        """Symmetry (2,) under mirroring x and y; of a derivative, whether the change keeps it."""
        return is_mirror_symmetric(_enlarged(self.scene))

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
    """A design in its equilibrium, with all that its derivatives need.

    Attributes
    ----------
    stiffness : array
        Of the suspension alone, without dampers and a compliant support.
    model
        The complete model, without symmetry-adapted coordinates.
    linear
        Its matrices.
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
    """Find the equilibrium of a design, and the static matrices there.

    Parameters
    ----------
    level
        Name of a model that supports derivatives.

    Raises
    ------
    InputError
        If there is none, or a wire is slack in it.
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
    """Differentiate all matrices with respect to one number.

    Parameters
    ----------
    name
        Dotted path, see `parameters.every`.

    Returns
    -------
    Linear or None
        Per SI unit of the number; None if it cannot change alone: the suspension would not balance
        in its nominal pose.
    """
    return along(base, {name: 1.0})


def along(base: Differentiable, rates: dict[str, float]) -> Linear | None:
    """Differentiate all matrices as several numbers change together, each at its rate."""
    now = moved(base, rates)
    return None if now is None else linear(base, now)


def linear(base: Differentiable, now: Moved) -> Linear:
    """Differentiate all matrices along a step that was made."""
    whole = _linear(now.design, now.scene, base.numbering, now.pose, now.stiffness)
    parts = (whole.mass, whole.stiffness, whole.damping, whole.loss, whole.orientation)
    beside = None if whole.beside is None else np.imag(whole.beside) / STEP
    return Linear(*(np.imag(part) / STEP for part in parts), scene=now.scene, beside=beside)


@dataclass(frozen=True)
class Moved:
    """A design, its equilibrium and its stiffness after a complex step of some of its numbers.

    Each number has `STEP` i times its rate added; imaginary parts over `STEP` are derivatives.
    """

    design: Design
    scene: Scene
    pose: Pose
    stiffness: Inexact[np.ndarray, "coordinate coordinate"]


def moved(base: Differentiable, rates: dict[str, float]) -> Moved | None:
    """Step numbers of a design into the complex plane, each at its rate, and its equilibrium.

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
    if _searched(base):
        free = slice(6, None)
        change = np.zeros(base.numbering.size)
        change[free] = -_solved(base.stiffness[free, free], np.imag(gradient[free]) / STEP)
        if change.any():
            pose = displace(base.numbering, pose, 1j * STEP * change)
            stiffness = gradient_and_stiffness(scene, base.numbering, pose)[1]
    return Moved(design, scene, pose, stiffness)


def _moved_bending(base: Differentiable, design: Design, scene: Scene) -> Moved:
    """Step the equilibrium of wires that bend: the pose and their bending stiffness together."""
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
        if not (base.turned or _searched(base) or np.abs(rest).max() > balanced):
            break
        step = -_solved(base.stiffness[free, free], rest)
        if np.abs(step).max() <= CONVERGED * np.abs(change).max():
            break
        change[free] += step
        pose = displace(base.numbering, base.pose, 1j * STEP * change)
    return Moved(design, scene, pose, stiffness)


def _enlarged(scene: Scene) -> Scene:
    """Scale complex steps of a scene to derivatives, for comparisons that allow for rounding."""

    def grown(part: Any) -> Any:
        steps = {
            name: value.real + 1j * (value.imag / STEP)
            for name, value in vars(part).items()
            if isinstance(value, np.ndarray) and value.dtype == complex
        }
        return replace(part, **steps)

    return scene.with_parts({name: grown(part) for name, part in scene.parts.items()})


def _searched(base: Differentiable) -> bool:
    """Whether the pose was solved for, and so depends on the design's numbers."""
    scene = base.scene
    return scene.drawn is not None or bool(scene.added) or solves_pose(base.design)


def _unbalanced(base: Differentiable, scene: Scene, design: Design) -> bool:
    """Whether a suspension that balances in its nominal pose no longer does after the step."""
    if gives_natural_lengths(design) or scene.field is not None or scene.added:
        return False
    drawn = scene.drawn or scene  # straight wires: the loads of blades are those without bending
    gradient = gradient_and_stiffness(drawn, base.numbering, nominal_pose(drawn))[0]
    # the loads of blades may differ from those in the nominal pose
    bodies = slice(6, 6 + 6 * len(drawn.bodies.name))
    left = np.abs(np.imag(gradient[bodies])).max() / STEP
    return bool(left > MOVED * float(base.scene.weight))


def _solved(
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
    loss, beside = string_model.loss_matrix(scene, numbering, pose), None
    if scene.springs.grounded.any():
        ground = string_model.ground_couplings(scene, numbering, pose)
        without = string_model.without_ground
        plain = replace(
            plain,
            stiffness=without(plain.stiffness, ground.stiffness),
            damping=without(plain.damping, ground.damping),
        )
        loss = without(loss, ground.loss)
        beside = np.stack([ground.stiffness, ground.damping, ground.loss])[..., :6]
        beside[:, :6] = 0.0
    whole = surrounded(plain, design)
    if design.support is not None:
        loss = with_frame(replace(plain, stiffness=loss), _lossy_frame(design)).stiffness
    turned = pose.rotation + np.zeros((len(body) + 1, 3, 3))
    if beside is not None:
        beside = np.pad(beside, ((0, 0), (0, whole.size - numbering.size), (0, 0)))
    return Linear(whole.mass, whole.stiffness, whole.damping, loss, turned, scene, beside=beside)


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
