"""Mode frequencies by every model, and their errors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.modes import wire_modes
from suspension_cli.analyses.tradeoff.subject import STRING, Subject
from suspension_cli.conventions import DOFS
from suspension_cli.linear import batch_modes, eigenmodes
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.mode_pairing import pair_by_overlap
from suspension_cli.models import closed_form, force, registry
from suspension_cli.scene import imperfections
from suspension_cli.scene.scene import Scene
from suspension_cli.studies import builds

if TYPE_CHECKING:
    from jaxtyping import Float

KINDS = {
    "longitudinal-pitch": ("x", "pitch"),
    "transverse-roll": ("y", "roll"),
    "vertical": ("z",),
    "yaw": ("yaw",),
}
DESIGNS = 256
"""Designs per batch."""
SCATTER = 0.01
"""Relative standard deviation of the masses or stiffnesses of a batch."""
HIGHEST = 1.1
"""Highest frequency searched with wire mass, over the highest mode without."""


@dataclass(frozen=True)
class Reference:
    """Reference modes of a design.

    Frequencies (Hz) are negative for unstable modes; shapes are those of `body_shapes`.
    """

    frequency: Float[np.ndarray, " mode"]
    kind: tuple[str, ...]
    shape: Float[np.ndarray, "mode coordinate"]


def signed_frequency(
    omega_squared: Float[np.ndarray, "*shape"],
) -> Float[np.ndarray, "*shape"]:
    """Frequencies in Hz from omega^2; minus the growth rate over 2 pi if unstable."""
    return np.sign(omega_squared) * np.sqrt(np.abs(omega_squared)) / (2 * np.pi)


def mode_kinds(found: Modes) -> tuple[str, ...]:
    """Find the one of `KINDS` with most kinetic energy in each mode."""
    by_dof = dict(zip(DOFS, found.energy.sum(1).T, strict=True))
    energy = np.array([sum(by_dof[dof] for dof in dofs) for dofs in KINDS.values()])
    return tuple(np.array(list(KINDS))[energy.argmax(0)].tolist())


def body_shapes(subject: Subject, found: Modes) -> Float[np.ndarray, "mode coordinate"]:
    """Compute mass-normalised motions of the bodies, orthonormal for one design."""
    model, size = subject.model(STRING), 6 * len(found.body)
    mass = model.mass[6 : 6 + size, 6 : 6 + size]
    return found.shape[:, :size] @ np.linalg.cholesky(mass)


def reference(subject: Subject) -> Reference:
    """Solve for the modes of the most complete valid model, without violin modes."""
    found = subject.modes.get(subject.top) or (
        solve_with_wire_mass(subject)
        if registry.by_name(subject.top).has_wire_mass
        else solve_blocks(subject, subject.top)
    )
    bodies = found.energy.sum((1, 2)) + found.tip_energy.sum(1) > 0.5
    return Reference(
        signed_frequency(found.omega_squared)[bodies],
        tuple(np.array(mode_kinds(found))[bodies].tolist()),
        body_shapes(subject, found)[bodies],
    )


def error(
    subject: Subject, found: Modes | dict[str, Float[np.ndarray, " _"]], wanted: Reference
) -> dict[str, float]:
    """Compute the largest relative error of the frequencies of each kind.

    Modes are paired by shape, frequencies without shapes by rank within a kind.
    """
    from scipy.optimize import linear_sum_assignment

    result = dict.fromkeys(KINDS, 0.0)
    for kind in KINDS:
        mine = [n for n, name in enumerate(wanted.kind) if name == kind]
        true = wanted.frequency[mine]
        if isinstance(found, dict):
            # pair nearest frequencies
            rows, columns = linear_sum_assignment(np.abs(true[:, None] - found[kind]))
            pairs = list(zip(found[kind][columns].tolist(), true[rows].tolist(), strict=True))
        else:
            partner = pair_by_overlap(np.abs(wanted.shape @ body_shapes(subject, found).T))
            frequency = signed_frequency(found.omega_squared)
            paired = [(partner[n], n) for n in mine if partner[n] >= 0]
            pairs = [(float(frequency[k]), float(wanted.frequency[n])) for k, n in paired]
        off = (abs(ours - exact) / abs(exact) for ours, exact in pairs if exact != 0)
        result[kind] = max(off, default=0.0)
    return result


def solve_blocks(subject: Subject, level: str) -> Modes:
    """Solve for the modes of a model block by block, as in `pendsus modes`."""
    found = eigenmodes.solve(registry.by_name(level).system(subject.design))
    subject.modes[level] = found
    return found


def solve_with_wire_mass(subject: Subject) -> Modes:
    """Solve for the modes with wire mass by counting and bisection, then for their shapes."""
    model = registry.VIOLIN.system(subject.design)
    highest = eigenmodes.solve(model.constant).frequency[-1]
    found = wire_modes.solve(model, HIGHEST * float(highest))
    subject.modes[registry.VIOLIN.name] = found
    return found


def by_block(level: str) -> Callable[[Subject], Modes]:
    """Return `solve_blocks` for a model."""
    return lambda subject: solve_blocks(subject, level)


def formulas(
    subject: Subject, factor: Float[np.ndarray, " build"] | float = 1.0
) -> dict[str, np.ndarray]:
    """Compute frequencies by kind (Husman et al. 2000) with scaled masses."""
    p = closed_form.four_wires(subject.design)
    p = replace(p, mass=p.mass * factor)
    every = (
        _eigenvalues(closed_form.longitudinal_tilt(p)),
        _eigenvalues(closed_form.sideways_roll(p)),
        np.asarray(closed_form.vertical(p))[..., None],
        np.atleast_1d(closed_form.rotation(p)),
    )
    return {kind: signed_frequency(values) for kind, values in zip(KINDS, every, strict=True)}


def _eigenvalues(matrix: Float[np.ndarray, "*batch 2 2"]) -> Float[np.ndarray, "*batch 2"]:
    """Compute omega^2, ascending, of matrices A with x'' = A x.

    The smaller one is the determinant over the larger one, without cancellation.
    """
    a, b, c, d = matrix[..., 0, 0], matrix[..., 0, 1], matrix[..., 1, 0], matrix[..., 1, 1]
    larger = -(a + d) / 2 + np.sqrt(((a - d) / 2) ** 2 + b * c)
    return np.stack([(a * d - b * c) / larger, larger], axis=-1)


def scatter_factors() -> Float[np.ndarray, " build"]:
    """Draw the factors of the members of a batch."""
    return 1 + SCATTER * np.random.default_rng(0).standard_normal(DESIGNS)


def formulas_batch(subject: Subject) -> Callable[[], object]:
    """Prepare the equations of Husman et al. for a batch."""
    factor = scatter_factors()
    return lambda: formulas(subject, factor)


def force_batch(subject: Subject) -> Callable[[], object]:
    """Prepare the force model for a batch."""
    chain, factor = force.chain(subject.design), scatter_factors()
    last = chain.stages[-1]
    many = replace(chain, stages=(*chain.stages[:-1], replace(last, mass=last.mass * factor)))
    return lambda: force.eigenvalues(many)


def string_batch(subject: Subject) -> Callable[[], object]:
    """Prepare the string model for a batch, as in `pendsus sweep`."""
    scene, design = _scenes(subject), subject.design
    return lambda: batch_modes.solve(builds.balance(scene, design, split=True).model)


def beam_batch(subject: Subject) -> Callable[[], object]:
    """Prepare the beam model for a batch, as in `pendsus xcouple`, without symmetry blocks."""
    scene, design, level = _scenes(subject), subject.design, registry.BEAM.name
    return lambda: batch_modes.solve(builds.balance(scene, design, level=level).model)


def _scenes(subject: Subject) -> Scene:
    """Build the scenes of a batch with scattered masses of the last body."""
    return imperfections.scale_mass(
        subject.scene, len(subject.scene.bodies.name), scatter_factors()
    )
