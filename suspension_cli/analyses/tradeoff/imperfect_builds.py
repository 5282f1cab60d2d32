"""Equilibrium and cross-coupling of imperfect builds by every model and method."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.tradeoff import equilibrium_mp, high_precision
from suspension_cli.analyses.tradeoff.comparison import Batch, Once
from suspension_cli.analyses.tradeoff.equilibrium_mp import EquilibriumArrays
from suspension_cli.analyses.tradeoff.subject import COUPLING, K_FACTOR, OFFSET, STRING, Subject
from suspension_cli.analyses.xcouple.solve import ROUNDING
from suspension_cli.equilibrium import solve as equilibrium
from suspension_cli.equilibrium.hanging import impose
from suspension_cli.equilibrium.solve import Equilibrium
from suspension_cli.linear import signals
from suspension_cli.linear.symmetry import is_mirror_symmetric
from suspension_cli.models import registry, string
from suspension_cli.models.surroundings import surrounded
from suspension_cli.scene.arrays import Array
from suspension_cli.scene.scene import Scene
from suspension_cli.studies import builds

if TYPE_CHECKING:
    from jaxtyping import Complex, Float

Method = Callable[[Subject, Array], np.ndarray]
"""Computes the coupling (p,) of builds with fractions (p,) of the imperfection."""
BUILDS = 256
"""Builds per batch."""
STEP = 1e-3
"""Fraction of the imperfection in the difference that gives the slope of the coupling; the relative
error is about 1e-6."""


def imperfect_scene(subject: Subject, fraction: Array | float = 1.0) -> Scene:
    """Build scenes with fractions of the imperfection, or of its stiffness and position."""
    amount = np.asarray(fraction, dtype=float)
    stiffer, moved = (amount[..., 0], amount[..., 1]) if amount.ndim == 2 else (amount, amount)
    offset = moved[..., None] * np.array([OFFSET, 0.0, 0.0])
    amounts = {"k_factor": 1 + (K_FACTOR - 1) * stiffer, "upper_offset": offset}
    return impose(subject.scene, "wire", subject.wire, amounts)


def fractions() -> Float[np.ndarray, " build"]:
    """Fractions of the imperfection in a batch."""
    return np.linspace(0.1, 1.0, BUILDS)


def no_wire(subject: Subject) -> str:
    """Return why no wire can be imperfect; empty if one can."""
    return "" if subject.wire >= 0 else "the mirror hangs on no wire"


def why_no_equilibrium(subject: Subject, levels: tuple[str, ...] = (STRING,)) -> str:
    """Return why the least or most imperfect build has no equilibrium in a valid model; or ""."""
    scene = imperfect_scene(subject, fractions()[[0, -1]])
    for level in levels:
        if not subject.unsuited[level]:
            status = builds.balance(scene, subject.design, level=level).status
            if status.any():
                return f"imperfect builds in the {level} model: {builds.STATUS[int(status.max())]}"
    return ""


def uncoupled(subject: Subject) -> str:
    """Return why there is no coupling to compare; empty if there is."""
    if why := no_wire(subject) or why_no_equilibrium(subject):
        return why
    size = float(np.abs(reference(subject, STRING))[0])
    return "" if size > ROUNDING else f"the imperfection couples nothing ({size:.0e}: rounding)"


def incomparable(subject: Subject) -> str:
    """Return why the coupling cannot be compared between models; empty if it can."""
    return uncoupled(subject) or why_no_equilibrium(
        subject, (registry.BEAM.name, registry.VIOLIN.name)
    )


def fails(level: str) -> Callable[[Subject], str]:
    """Return a function: why a model is not valid for the imperfect design."""
    return lambda subject: subject.imperfect.unsuited[level]


def reference(subject: Subject, level: str) -> Complex[np.ndarray, " 1"]:
    """Compute the coupling of a model in 50 digits, in its own equilibrium."""
    model = registry.by_name(level).system(subject.imperfect.design)
    into, out = subject.coupled(model)
    drive, over, under = (signals.linear_form(signal, model) for signal in (into, *out))
    omega = 2 * np.pi * np.array([COUPLING])
    above, below = (high_precision.response(model, omega, drive, row) for row in (over, under))
    return above / below


def ratio(subject: Subject, found: builds.Builds) -> Complex[np.ndarray, " build"]:
    """Compute the coupling of balanced builds."""
    into, out = subject.coupled(found.model)
    moved = builds.transfer(found, np.array([COUPLING]), [into], out)[:, 0, :, 0]
    return moved[:, 0] / moved[:, 1]


def rebuilt(
    subject: Subject, fraction: Array, level: str = STRING
) -> Complex[np.ndarray, " build"]:
    """Compute the coupling of builds in their equilibria, as in `pendsus xcouple`."""
    scene = imperfect_scene(subject, fraction)
    return ratio(subject, builds.balance(scene, subject.design, level=level))


def with_model(level: str) -> Method:
    """Return `rebuilt` for a model."""
    return lambda subject, fraction: rebuilt(subject, fraction, level)


def after_newton_steps(steps: int) -> Method:
    """Return the coupling of builds after some Newton steps from the nominal pose."""

    def solve(subject: Subject, fraction: Array) -> np.ndarray:
        scene = imperfect_scene(subject, fraction)
        found = equilibrium.newton_steps(scene, steps)
        model = surrounded(string.linear_model(scene, found, split=False), subject.design)
        balanced = builds.Builds(
            builds.oriented(model, found),
            np.full(scene.batch, builds.GOOD, dtype=np.uint8),
            np.full(scene.batch, -1, dtype=np.int16),
            found.residual,
            is_mirror_symmetric(scene),
        )
        return ratio(subject, balanced)

    return solve


def perturbed(
    subject: Subject, fraction: Float[np.ndarray, " build"]
) -> Complex[np.ndarray, " build"]:
    """Compute the coupling to first order in the imperfection."""
    step = STEP * np.eye(2)  # of stiffness and position
    found = rebuilt(subject, np.concatenate([np.zeros((1, 2)), step, -step]))
    slope = (found[1:3] - found[3:5]) / (2 * STEP)
    return found[0] + fraction * slope.sum()


def coupling(solve: Method) -> tuple[Once, Batch]:
    """Return a method for the whole imperfection, and for a batch of fractions."""
    return (lambda subject: solve(subject, np.ones(1))), (
        lambda subject: lambda: solve(subject, fractions())
    )


# Comparison of equilibria.


def unbalanced(subject: Subject) -> str:
    """Return why equilibria cannot be compared; empty if they can."""
    if why := no_wire(subject):
        return why
    if subject.scene.springs.label or subject.scene.wires.torsion.any():
        return "the reference in 50 digits has no springs and no torsion of wires"
    if why := why_no_equilibrium(subject):
        return why
    unique = equilibrium_reference(subject) is not None
    return "" if unique else "the equilibrium is not unique (a body can turn freely)"


def equilibrium_arrays(found: Equilibrium) -> EquilibriumArrays:
    """Return displacements (m), rotation matrices less the unit matrix, and tensions (N)."""
    return np.array(found.pose.shift), found.pose.rotation - np.eye(3), np.array(found.tension)


def equilibrium_reference(subject: Subject) -> EquilibriumArrays | None:
    """Compute `equilibrium_arrays` in 50 digits."""
    return equilibrium_mp.solve(imperfect_scene(subject))


def equilibrium_error(
    _: Subject, found: EquilibriumArrays, wanted: EquilibriumArrays
) -> dict[str, float]:
    """Largest errors of displacements, rotations and tensions, over the largest of each."""
    return {
        name: _largest(a - b) / (_largest(b) or 1.0)
        for name, a, b in zip(("position", "rotation", "tension"), found, wanted, strict=True)
    }


def _largest(values: Array) -> float:
    return float(np.abs(values).max())


def steps(count: int) -> tuple[Once, Batch]:
    """Return the method of some Newton steps from the nominal pose (1: linear)."""
    return _balanced(lambda scene: equilibrium.newton_steps(scene, count))


def full() -> tuple[Once, Batch]:
    """Return Newton's method with finite rotations, as in the models."""
    return _balanced(equilibrium.solve)


def _balanced(solve: Callable[[Scene], Equilibrium]) -> tuple[Once, Batch]:
    return (lambda subject: equilibrium_arrays(solve(imperfect_scene(subject)))), (
        lambda subject: lambda: solve(imperfect_scene(subject, fractions()))
    )
