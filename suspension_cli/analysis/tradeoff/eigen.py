"""Mode frequencies by every rung and method, and how far they are off."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from suspension_cli.analysis import builds, modes, spectrum, wire_modes
from suspension_cli.analysis.modes import Modes
from suspension_cli.analysis.tradeoff.subject import Subject
from suspension_cli.conventions import DOFS
from suspension_cli.design import perturb
from suspension_cli.design.scene import Array, Scene
from suspension_cli.models import closed_form, fidelity, force

KINDS = {"longitudinal-pitch": ("x", "pitch"), "transverse-roll": ("y", "roll"), "vertical": ("z",), "yaw": ("yaw",)}
DESIGNS = 256
"""In a batch."""
SCATTER = 0.01
"""Relative, of what varies over it."""
HIGHEST = 1.1
"""Times the highest mode of the beam rung, up to which modes of wires with mass are looked for."""


@dataclass(frozen=True)
class Reference:
    """The modes that a design has: signed frequencies (m,) in Hz (negative: unstable), their kinds, shapes of bodies (m, 6 n) scaled by root mass."""

    frequency: Array
    kind: tuple[str, ...]
    shape: Array


def signed(omega_squared: Any) -> Any:
    """Frequencies in Hz; minus the growth rate over 2 pi where unstable."""
    return np.sign(omega_squared) * np.sqrt(np.abs(omega_squared)) / (2 * np.pi)


def kinds(found: Modes) -> tuple[str, ...]:
    """In which of `KINDS` the bodies of each mode move most."""
    share = np.stack([found.energy[:, :, [DOFS.index(dof) for dof in dofs]].sum((1, 2)) for dofs in KINDS.values()], axis=1)
    return tuple(np.array(list(KINDS))[share.argmax(1)].tolist())


def bodily(subject: Subject, found: Modes) -> Array:
    """Shapes (m, 6 n) of bodies, so scaled that those of one design are orthonormal."""
    model, size = subject.model("string"), 6 * len(found.body)
    mass = model.mass[6 : 6 + size, 6 : 6 + size]
    return found.shape[:, :size] @ np.linalg.cholesky(mass)


def reference(subject: Subject) -> Reference:
    """The modes on the top rung; of those with wires that have mass, the ones in which bodies move."""
    found = counted(subject) if subject.top == "violin" else solved(subject, subject.top)
    bodies = found.energy.sum((1, 2)) + found.tip_energy.sum(1) > 0.5
    return Reference(signed(found.omega_squared)[bodies], tuple(np.array(kinds(found))[bodies].tolist()), bodily(subject, found)[bodies])


def error(subject: Subject, found: Modes | dict[str, Array], wanted: Reference) -> dict[str, float]:
    """Largest relative error of a frequency of each kind: modes are paired by their shapes, bare frequencies of one kind by rank."""
    from scipy.optimize import linear_sum_assignment

    result = dict.fromkeys(KINDS, 0.0)
    for kind in KINDS:
        mine = [n for n, name in enumerate(wanted.kind) if name == kind]
        true = wanted.frequency[mine]
        if isinstance(found, dict):
            rows, columns = linear_sum_assignment(np.abs(true[:, None] - found[kind]))  # of as many of either, by rank
            pairs = list(zip(found[kind][columns].tolist(), true[rows].tolist(), strict=True))
        else:
            rows, columns = linear_sum_assignment(np.abs(wanted.shape @ bodily(subject, found).T), maximize=True)
            partner, frequency = dict(zip(rows.tolist(), columns.tolist(), strict=True)), signed(found.omega_squared)
            pairs = [(float(frequency[partner[n]]), float(wanted.frequency[n])) for n in mine if n in partner]
        result[kind] = max((abs(ours - exact) / abs(exact) for ours, exact in pairs if exact != 0), default=0.0)
    return result


def solved(subject: Subject, rung: str) -> Modes:
    """Built and solved block by block: what `pendsus modes` does."""
    return modes.solve(fidelity.linear_model(subject.design, rung))


def counted(subject: Subject) -> Modes:
    """Wires with mass: modes counted, bisected and their shapes found."""
    model = fidelity.linear_model(subject.design, "violin")
    highest = modes.solve(replace(model, terms=())).frequency[-1]
    return wire_modes.solve(model, HIGHEST * float(highest))


def formulas(subject: Subject, factor: Any = 1.0) -> dict[str, Array]:
    """The paper's equations alone, on arrays of masses if need be."""
    p = closed_form.four_wires(subject.design)
    p = replace(p, mass=p.mass * factor)
    pairs = [_eigenvalues(matrix(p)) for matrix in (closed_form.longitudinal_tilt, closed_form.sideways_roll)]
    every = (*pairs, closed_form.vertical(p)[..., None] if np.ndim(factor) else np.array([closed_form.vertical(p)]), np.atleast_1d(closed_form.rotation(p)))
    return {kind: signed(values) for kind, values in zip(KINDS, every, strict=True)}


def _eigenvalues(matrix: Any) -> Any:
    """omega^2 (..., 2) of (..., 2, 2) matrices with x'' = A x: the larger from trace and determinant, the smaller from both, so that neither cancels."""
    a, b, c, d = matrix[..., 0, 0], matrix[..., 0, 1], matrix[..., 1, 0], matrix[..., 1, 1]
    larger = -(a + d) / 2 + np.sqrt(((a - d) / 2) ** 2 + b * c)
    return np.stack([(a * d - b * c) / larger, larger], axis=-1)


def scattered() -> Array:
    """Factors (p,) by which members of a batch differ."""
    return 1 + SCATTER * np.random.default_rng(0).standard_normal(DESIGNS)


def formulas_batch(subject: Subject) -> Any:
    """The paper's equations on arrays."""
    factor = scattered()
    return lambda: formulas(subject, factor)


def force_batch(subject: Subject) -> Any:
    """The force model on arrays."""
    chain, factor = force.chain(subject.design), scattered()
    last = chain.stages[-1]
    many = replace(chain, stages=(*chain.stages[:-1], replace(last, mass=last.mass * factor)))
    return lambda: force.eigenvalues(many)


def string_batch(subject: Subject) -> Any:
    """Scenes as one batch: balanced, assembled and solved block by block, as `pendsus sweep` does."""
    scene = _scenes(subject)
    return lambda: spectrum.solve(builds.balance(scene, subject.design, split=True).model)


def beam_batch(subject: Subject) -> Any:
    """The same with wires that bend, as `pendsus xcouple` balances and assembles them; mirror symmetries are not looked for."""
    scene = _scenes(subject)
    return lambda: spectrum.solve(builds.balance(scene, subject.design, level="beam").model)


def _scenes(subject: Subject) -> Scene:
    """The design with the masses of a batch."""
    return perturb.scale_mass(subject.scene, len(subject.scene.bodies.name), scattered())
