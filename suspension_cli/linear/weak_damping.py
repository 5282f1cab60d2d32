"""Poles of weakly damped modes, followed from the undamped ones.

Modes that losses couple strongly, or that lie close together, form a group S. Its poles are found
by iterating the equation of the group, with all other modes eliminated (`modal_basis`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.linear.connected_groups import connected_groups
from suspension_cli.linear.modal_basis import CONVERGED, ROUNDING, STEPS, Basis, condense

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Int

LIGHT = 0.02
"""Fraction of omega^2 up to which losses change the equation of a light mode: one whose pole is
followed from the undamped one."""
WIDE = 0.3
"""Largest relative difference of omega^2 of modes that are followed together."""
COUPLED = 0.05
"""Coupling of two modes by losses, over the difference of their equations, above which they are
solved together."""
TOGETHER = 1e-6
"""Difference of the equations of two modes, over their losses, below which they are solved
together."""
NEGLIGIBLE = 1e-18
"""Relative contribution of another mode to the losses of a mode that is left out."""
MEMORY = 4_000_000
"""Elements of G evaluated at once."""


def group_modes(
    basis: Basis,
) -> tuple[list[Int[np.ndarray, " _"]], Bool[np.ndarray, " coordinate"]]:
    """Group modes that losses couple strongly; also return which modes are light."""
    massive = np.flatnonzero(basis.inertia > 0)
    n = len(basis.stiffness)
    start = np.where(basis.inertia > 0, 1j * np.sqrt(np.maximum(basis.stiffness, 0.0)), 0.0)
    # G_jk and G_kk at mode j
    oscillates = np.flatnonzero(start != 0)
    rows, own = np.zeros((n, n), dtype=complex), np.zeros((n, n), dtype=complex)
    rows[oscillates], own[oscillates] = basis.loss_rows(start[oscillates], oscillates)
    here = basis.stiffness + own - np.outer(basis.stiffness, basis.inertia)  # equation k at mode j
    coupling, size = np.abs(rows), np.abs(np.diag(rows))
    apart = np.abs(here - np.diag(here)[:, None])
    linked = (coupling > COUPLED * apart) | (apart < TOGETHER * np.add.outer(size, size))
    linked[:, basis.inertia == 0] = linked[basis.inertia == 0] = False
    groups = [group for group in connected_groups(linked) if np.isin(group, massive).all()]
    light = np.zeros(n, dtype=bool)
    for group in groups:
        others = np.delete(np.arange(n), group)
        for j in group:
            far = np.maximum(np.abs(here[j, others]), np.finfo(float).tiny)
            change = coupling[j, group].sum() + (coupling[j, others] ** 2 / far).sum()
            spread = np.abs(basis.stiffness[group] - basis.stiffness[j]).max()
            light[j] = change < LIGHT * basis.stiffness[j] and spread < WIDE * basis.stiffness[j]
    return groups, light


def follow_poles(
    basis: Basis, groups: list[Int[np.ndarray, " _"]]
) -> tuple[Complex[np.ndarray, " pole"], Complex[np.ndarray, "pole coordinate"]]:
    """Follow the poles and shapes of groups of light modes from the undamped ones.

    Poles are iterated one by one, with losses evaluated for all together.
    """
    group = [own for own in groups for _ in own]
    member = np.array([k for own in groups for k in range(len(own))], dtype=np.intp)
    middle = np.array([basis.stiffness[own].mean() for own in group])
    shift, change = np.zeros(len(group), dtype=complex), np.full(len(group), np.inf)
    motions = np.zeros((len(group), len(basis.stiffness)), dtype=complex)
    running = np.arange(len(group))
    for step in range(STEPS):
        going = []
        for part in _chunks(basis, len(running)):
            s = 1j * np.sqrt(middle[running[part]] + shift[running[part]])
            for n, at, losses in zip(running[part], s, basis.losses(s), strict=True):
                own = group[n]
                matrix, follow, others = condense(basis, own, at, losses, NEGLIGIBLE)
                small = np.abs(matrix) < ROUNDING * np.abs(matrix).max()
                every, vectors = np.linalg.eig(
                    np.diag(basis.stiffness[own] - middle[n]) + np.where(small, 0.0, matrix)
                )
                # with equal eigenvalues, each mode continues from its own shape
                which = (
                    member[n]
                    if step == 0
                    else int(np.abs(motions[n, own].conj() @ vectors).argmax())
                )
                moved, last = abs(every[which] - shift[n]), change[n]
                shift[n], change[n] = every[which], moved
                motions[n] = 0.0
                motions[n, own], motions[n, others] = vectors[:, which], follow @ vectors[:, which]
                limit = CONVERGED * abs(shift[n])
                # changes shrink at a steady rate: the next one would be moved^2 / last
                if step == 0 or (limit < moved < last and moved**2 > 0.1 * limit * last):
                    going.append(n)
        running = np.array(going, dtype=np.intp)
        if not len(running):
            break
    return 1j * np.sqrt(middle + shift), motions


def _chunks(basis: Basis, count: int) -> list[slice]:
    """Split `count` poles into parts whose G fits into memory."""
    most = max(1, MEMORY // len(basis.stiffness) ** 2)
    return [slice(start, start + most) for start in range(0, count, most)]
