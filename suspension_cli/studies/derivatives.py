"""Derivatives of results of a design with respect to its numbers, by central differences.

    df/dp = (f(p + h) - f(p - h)) / 2h + O(h^2)

All neighbours of a design are solved as batches. Near a resonance of high quality a response is not
smooth over a step, but its inverse is; the one that bends less is differentiated.

Modes may cross or be degenerate, but the matrix of their shapes s in the design itself,

    R_jk = s_j (K(omega_k) - omega_k^2 M) s_k,

is smooth, and its diagonal changes as omega_k^2 does (Rayleigh), also with massless coordinates and
wire mass. The eigenvalues of its change among modes of one frequency are the derivatives of the
modes that split off (Lancaster, Numer. Math. 6, 377 (1964)). Stiff parts that resist the shapes s
are relaxed: else h^2 would count times the ratio of their stiffness to that of a mode.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design.paths import unit_of
from suspension_cli.design.schema import Design
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.errors import InputError
from suspension_cli.linear.batch_modes import DEGENERATE
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.mode_pairing import pair_by_shape
from suspension_cli.models import registry
from suspension_cli.scene.arrays import Array
from suspension_cli.studies import builds, variants
from suspension_cli.studies.builds import Builds
from suspension_cli.studies.parameters import Parameter, natural_step, shifted, value_of

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Inexact

STEP = 7e-5
"""Step, relative to a number or to the size of a change that matters. Truncation errors go with its
square, rounding errors (of 1e-11 at most) with its inverse."""
ELEMENTS = 1 << 21
"""Elements of matrices at frequencies that are in memory at once."""
RANGE = 10.0
"""Ratio of omega^2 up to which modes are relaxed together; its square makes another mode stiff."""
SIZES = {"N": 1.0, "N m": 1e-3, "N/m": 1.0, "N m/rad": 1e-3, "kg": 1e-3, "kg m^2": 1e-5}
"""Changes that matter of numbers that are 0, by unit, per newton that hangs; 1 SI for others."""


@dataclass(frozen=True)
class Differences:
    """Results of a design, and of its neighbours a step `step` above and below in each number.

    A number is `balanced` if both neighbours have an equilibrium, else it cannot change alone. It
    matters if it changes any result.
    """

    step: Float[np.ndarray, " number"]
    nominal: Inexact[np.ndarray, " result"]
    above: Inexact[np.ndarray, "number result"]
    below: Inexact[np.ndarray, "number result"]
    balanced: Bool[np.ndarray, " number"]
    matters: Bool[np.ndarray, " number"]

    @property
    def central(self) -> Inexact[np.ndarray, "number result"]:
        """Derivatives of smooth results; NaN where a number cannot change alone."""
        with np.errstate(invalid="ignore"):  # ratios to 0
            return (self.above - self.below) / (2 * self.step[:, None])

    @property
    def of_magnitudes(self) -> Float[np.ndarray, "number result"]:
        """Derivatives of the magnitudes of complex responses, which may be near a resonance.

        A zero grows with either sign.
        """
        value = self.nominal
        sides = np.array([self.above, np.broadcast_to(value, self.above.shape), self.below])
        with np.errstate(all="ignore"):
            inverse = 1 / sides
            smooth = (_bend(sides) <= _bend(inverse)) | (value == 0)
            along = (inverse[0] - inverse[2]) / (2 * self.step[:, None])
            rate = np.where(smooth, self.central, -(value**2) * along)
            along = np.real(np.conj(value) * rate) / np.abs(value)
        return np.where(value == 0, np.abs(rate), along)


def _bend(sides: Inexact[np.ndarray, "side ..."]) -> Float[np.ndarray, ...]:
    """Second difference of a function over its first one."""
    above, nominal, below = sides
    return np.nan_to_num(np.abs((above - nominal) - (nominal - below)) / np.abs(above - below))


def flat_matrices(found: Builds) -> Float[np.ndarray, "build element"]:
    """All elements of mass, stiffness, damping, loss and rotations of bodies, one after another."""
    model = found.model
    count = len(found.status)
    size = model.size
    parts = [
        np.broadcast_to(part, (count, size, size)).reshape(count, -1)
        for part in (model.mass, model.stiffness, model.damping, model.loss)
    ]
    assert model.orientation is not None
    return np.hstack([*parts, model.orientation.reshape(count, -1)])


def differentiate(
    design: Design,
    numbers: Sequence[Parameter],
    level: str,
    evaluate: Callable[[Builds], Inexact[np.ndarray, "build result"]] = flat_matrices,
    *,
    nominal: Array | None = None,
) -> Differences:
    """Evaluate a design and its neighbours in some numbers, in a model that supports builds.

    `nominal` are the results of the design itself, if known. Raises `InputError` if the design has
    no equilibrium, or a wire is slack in it.
    """
    step = STEP * np.array([size_of_changes(design, item) for item in numbers])
    designs = [
        shifted(design, item.name, sign * h)
        for item, h in zip(numbers, step, strict=True)
        for sign in (1, -1)
    ]
    rows: list[Array | None] = [None] * len(designs) + [nominal]
    for places, found in variants.solved(designs + [design] * (nominal is None), level):
        good = np.flatnonzero(found.status == builds.GOOD)
        for n, row in zip(good, evaluate(found)[good] if len(good) else (), strict=True):
            rows[places[n]] = row
    nominal = rows.pop()
    if nominal is None:
        registry.by_name(level).system(design)  # raises the fault of the design
        problem = "has no equilibrium near the nominal pose"
        raise InputError.of("stage", problem, "see pendsus check")
    nothing = np.full(nominal.shape, np.nan)
    filled = np.array([nothing if row is None else row for row in rows])
    above, below = filled.reshape(len(numbers), 2, nominal.size).swapaxes(0, 1)
    differs = (above != below) & ~(np.isnan(above) & np.isnan(below))
    known = np.array([row is not None for row in rows], dtype=bool).reshape(-1, 2)
    return Differences(step, nominal, above, below, known[:, 0] & known[:, 1], differs.any(1))


def mode_matrix(
    found: Builds, modes: Modes, *, massive: bool
) -> Float[np.ndarray, "build mode mode"]:
    """Compute R of builds with the modes of a design; `massive` if its wires have mass."""
    model = found.model
    shape = modes.shape
    count = len(found.status)
    squared = np.maximum(modes.omega_squared, 0.0)
    soft = np.real(model.soft)[..., 6:, 6:] @ shape.T
    form = model.elongation[..., 6:] + np.zeros((count, 1, 1))
    long = form @ shape.T
    stiff = np.real(model.k)[..., None] + np.zeros_like(long)
    step = max(ELEMENTS // (count * model.size**2), 1)
    for start in range(0, len(shape) if massive else 0, step):
        some = slice(start, start + step)
        omega = np.sqrt(squared[some])
        build = np.repeat(np.arange(count), len(omega))
        now = model.select(build).at(np.tile(omega, count))
        own_soft = np.real(now.soft[:, 6:, 6:]).reshape(count, len(omega), *2 * shape.shape[1:])
        soft[..., some] = np.einsum("pkxy,ky->pxk", own_soft, shape[some])
        k = np.real(now.k).reshape(count, len(omega), -1)
        stiff[..., some] = k.swapaxes(1, 2)
    force = soft - squared * (model.mass[..., 6:, 6:] @ shape.T)
    pull = stiff * long
    result = shape @ force + long.swapaxes(1, 2) @ pull
    force = force + form.swapaxes(1, 2) @ pull
    for own, soft in _ranges(modes.omega_squared):
        result[:, own, own] -= _relaxation(found, modes.shape[soft], force[..., own])
    return result


def _ranges(squared: Float[np.ndarray, " mode"]) -> Iterator[tuple[slice, slice]]:
    """Divide modes into ranges of frequency, each with the modes that are not much stiffer."""
    start = 0
    while start < len(squared):
        positive = squared[start:][squared[start:] > 0]
        least = positive[0] if len(positive) else 1.0
        end = int(np.searchsorted(squared, RANGE * least))
        yield slice(start, end), slice(0, int(np.searchsorted(squared, RANGE**2 * least)))
        start = end


def _relaxation(
    found: Builds,
    soft: Float[np.ndarray, "soft coordinate"],
    force: Float[np.ndarray, "build coordinate mode"],
) -> Float[np.ndarray, "build mode mode"]:
    """Work of forces on builds that deform in all ways but those of their soft modes."""
    stiffness = found.model.stiffness[:, 6:, 6:]
    held = found.model.mass[..., 6:, 6:] @ soft.T + np.zeros((len(stiffness), 1, 1))
    size = np.sqrt(np.abs(np.einsum("pxx->px", stiffness)))[..., None]
    size[size == 0] = 1.0
    held = held / size
    held = held / np.sqrt((held**2).sum(1, keepdims=True))
    none = np.zeros((len(stiffness), len(soft), len(soft)))
    scaled = stiffness / (size * size.swapaxes(1, 2))
    matrix = np.block([[scaled, held], [held.swapaxes(1, 2), none]])
    right = np.pad(force / size, ((0, 0), (0, len(soft)), (0, 0)))
    return right.swapaxes(1, 2) @ np.linalg.solve(matrix, right)


def frequency_rates(
    modes: Modes, change: Float[np.ndarray, "mode mode"]
) -> Float[np.ndarray, " mode"]:
    """Differentiate mode frequencies, Hz, from the derivative of R; NaN if rigid or unstable."""
    squared = modes.omega_squared
    close = np.diff(squared) <= DEGENERATE * np.abs(squared[1:])
    rates = np.full(len(squared), np.nan)
    for group in np.split(np.arange(len(squared)), np.flatnonzero(~close) + 1):
        part = change[np.ix_(group, group)]
        if np.isfinite(part).all():
            values, vectors = np.linalg.eigh((part + part.T) / 2)
            rates[group] = values[pair_by_shape(np.eye(len(group)), vectors.T)[0]]
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(squared > 0, rates / (8 * np.pi**2 * modes.frequency), np.nan)


def size_of_changes(design: Design, item: Parameter) -> float:
    """Choose the size of changes of a number that matter, SI; steps are small against it."""
    natural, unit = natural_step(item.name, item.value)
    if item.name.endswith("natural_length"):  # its difference from the loaded length matters
        return natural
    if unit != "%":  # lengths and angles
        return max(abs(item.value), natural)
    return abs(item.value) or _typical_size(design, item.name)


def _typical_size(design: Design, name: str) -> float:
    """Choose a change that matters of a number that is 0: by its list, else by what hangs."""
    head, _, last = name.rpartition(".")
    siblings = np.array(value_of(design, head) if last.isdigit() else 0.0, dtype=float)
    weight = float(expand(design).weight)
    return float(np.abs(siblings).max()) or SIZES.get(unit_of(name), 1 / weight) * weight
