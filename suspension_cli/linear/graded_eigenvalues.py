"""Generalised symmetric eigenvalues with the same relative accuracy for small and large ones.

A symmetric eigenvalue solver leaves rounding errors of the largest omega^2 in all of them: with
wires 1e12 times stiffer along than across, a pendulum mode is off by 1e-4. Its vectors, however,
leave the space of the soft modes only by a rounding error d, which changes Rayleigh quotients in
second order (d^2 times the stiffness ratio). So K and M are projected on the soft modes and solved
again there, until all remaining eigenvalues are of one size (Parlett, The Symmetric Eigenvalue
Problem, chapter 11). Where the stretching of wires is known apart from the rest of K, as E^T E, it
is E that is projected, which is nearly 0 on soft modes. Then leaning wires or blades with tip
masses keep their soft part however stiff they are; otherwise it is lost, see `rounding`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.linear.system import LinearSystem

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int

APART = 1e-3
"""Modes below this fraction of the largest omega^2 are solved again; the others lose at most three
digits."""
RIGID = 64 * np.finfo(float).eps
"""Fraction of its terms below which omega^2 is a rounding error and the mode rigid."""
TURNING = 1e3
"""Largest ratio of omega^2 from tension in rotation to that in translation: mass times lever arm
squared over moment of inertia."""
EPS = np.finfo(float).eps


def solve(
    mass: Float[np.ndarray, "*#batch coordinate coordinate"],
    stiffness: Float[np.ndarray, "*#batch coordinate coordinate"],
    form: Float[np.ndarray, "row coordinate"] | None = None,
) -> tuple[Float[np.ndarray, "*batch mode"], Float[np.ndarray, "*batch coordinate mode"]]:
    """Solve for eigenvalues, ascending, and shapes of unit modal mass.

    The mass (kg, kg m^2) is positive definite, the stiffness (N/m, N m/rad) symmetric. To that of
    one system `form`^T `form` is added.
    """
    if stiffness.ndim == 2:
        values, shapes = solve(mass[None], stiffness[None], form)
        return values[0], shapes[0]
    inverse = np.linalg.inv(np.linalg.cholesky(mass))
    whole = stiffness if form is None else stiffness + form.T @ form
    dynamic = inverse @ whole @ np.swapaxes(inverse, -1, -2)
    values, vectors = np.linalg.eigh((dynamic + np.swapaxes(dynamic, -1, -2)) / 2)
    shapes = np.swapaxes(inverse, -1, -2) @ vectors
    soft = np.abs(values) < APART * np.abs(values).max(-1, keepdims=True)
    for pattern, members in _group_rows(soft):
        if not pattern.any():
            continue
        soft_shapes = shapes[members][:, :, pattern]
        transposed = np.swapaxes(soft_shapes, -1, -2)
        less_mass, less_stiffness = (
            (less + np.swapaxes(less, -1, -2)) / 2
            for less in (transposed @ part[members] @ soft_shapes for part in (mass, stiffness))
        )
        less_form = None if form is None else form @ soft_shapes[0]
        soft_values, combination = solve(less_mass, less_stiffness, less_form)
        values[np.ix_(members, pattern)] = soft_values
        shapes[members[:, None], :, np.flatnonzero(pattern)] = np.swapaxes(
            soft_shapes @ combination, -1, -2
        )
    return values, shapes


def _group_rows(
    soft: Bool[np.ndarray, "row mode"],
) -> list[tuple[Bool[np.ndarray, " mode"], Int[np.ndarray, " _"]]]:
    """Group equal rows of (p, m): each pattern (m,) with the numbers (q,) of its rows."""
    if (soft == soft[:1]).all():
        return [(soft[0], np.arange(len(soft)))]
    patterns, pattern_of = np.unique(soft, axis=0, return_inverse=True)
    return [
        (pattern, np.flatnonzero(pattern_of.ravel() == number))
        for number, pattern in enumerate(patterns)
    ]


def rigid(
    values: Float[np.ndarray, "*batch mode"],
    error: Float[np.ndarray, "*batch mode"],
    tension: Float[np.ndarray, "*batch"] | float,
) -> Float[np.ndarray, "*batch mode"]:
    """Set eigenvalues, (rad/s)^2, of rigid modes to exactly 0.

    A mode is rigid if its omega^2 is a rounding error of its terms.

    Parameters
    ----------
    values, error
        omega^2, and its error from rounding K (see `rounding`).
    tension
        omega^2 of a rotation from tension alone: the size of terms that have cancelled within the
        elements of K. At most the largest eigenvalue counts.
    """
    size = np.abs(values)
    terms = np.maximum(
        error / EPS, np.minimum(np.asarray(tension)[..., None], size.max(-1, keepdims=True))
    )
    return np.where(size < RIGID * terms, 0.0, values)


def rounding(
    stiffness: Float[np.ndarray, "*#batch coordinate coordinate"],
    shapes: Float[np.ndarray, "*batch mode coordinate"],
) -> Float[np.ndarray, "*batch mode"]:
    """Bound on the error of omega^2 from rounding K, eps |v|^T |K| |v|, (rad/s)^2.

    For shapes v of unit modal mass.
    """
    size = np.abs(shapes)
    return EPS * ((size @ np.abs(stiffness)) * size).sum(-1)


def rounding_of(
    model: LinearSystem, shapes: Float[np.ndarray, "mode coordinate"]
) -> Float[np.ndarray, " mode"]:
    """Bound on the error of omega^2 from rounding the stiffness of one system, and elongations.

    For shapes of unit modal mass in the system's own coordinates.
    """
    stretched = model.stretched
    if stretched is None:
        return rounding(model.stiffness, shapes)
    pull = np.abs(shapes @ stretched.form.T) * np.real(stretched.stiffness)
    terms = (pull * (np.abs(shapes) @ np.abs(stretched.form).T)).sum(-1)
    return rounding(np.real(stretched.soft), shapes) + 2 * EPS * terms


def softest_translation(model: LinearSystem) -> Float[np.ndarray, "*batch"]:
    """Largest over the bodies of the omega^2 (...) of their softest translation, (rad/s)^2.

    From the diagonal of the stiffness; about tension over length and mass.
    """
    stop = 6 * (len(model.body) + 1)
    own, mass = (
        np.diagonal(matrix, axis1=-2, axis2=-1)[..., 6:stop]
        for matrix in (model.stiffness, model.mass)
    )
    softest = (
        np.abs(own / mass)
        .reshape(*np.broadcast_shapes(own.shape, mass.shape)[:-1], -1, 6)[..., :3]
        .min(-1)
    )
    return softest.max(-1)


def relative_error_bound(
    model: LinearSystem,
    omega_squared: Float[np.ndarray, " mode"],
    shape: Float[np.ndarray, "mode coordinate"],
) -> Float[np.ndarray, " mode"]:
    """Bound on the relative error of each mode's frequency from rounding the stiffness.

    Infinite for a rigid mode. `omega_squared`, (rad/s)^2, and `shape` are as in `eigenmodes.Modes`.
    """
    adapted = np.pad(shape, ((0, 0), (6, 0))) @ model.basis  # the basis is orthogonal
    size = rounding_of(model, adapted)
    return np.where(
        omega_squared != 0,
        size / (2 * np.abs(np.where(omega_squared == 0, 1.0, omega_squared))),
        np.inf,
    )
