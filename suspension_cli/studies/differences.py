"""Derivatives of a design's matrices with respect to its numbers, by differences.

They serve matrices that depend on frequency: losses of the beam model are complex, so a complex
step (`derivatives`) differentiates only the static matrices. Each number is moved by h and 2h
either way, and each matrix A has

    dA/dp = (8 (A(p + h) - A(p - h)) - (A(p + 2h) - A(p - 2h))) / 12h + O(h^4),

a central difference with one step of Richardson's (Phil. Trans. R. Soc. A 210, 307 (1911)).
Matrices are smooth also on resonances and where modes cross or are degenerate; derivatives of modes
and responses follow from theirs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design.schema import Design
from suspension_cli.errors import InputError
from suspension_cli.models import registry
from suspension_cli.scene import stack
from suspension_cli.scene.scene import Scene
from suspension_cli.studies import builds, derivatives, variants
from suspension_cli.studies.builds import Builds
from suspension_cli.studies.derivatives import Differentiable, Linear
from suspension_cli.studies.parameters import Parameter, shifted
from suspension_cli.studies.systems import further_stiffness

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Int

STEP = 1e-3
"""Step, relative to a number or to the change that would change a matrix by its own size:
truncation errors go with its fourth power, rounding errors with its inverse."""
FREE = 1e-7
"""Root of a diagonal element, relative to the largest, below which it is a rounding error."""
NODES = (-2, -1, 1, 2)
"""Steps at which the matrices are evaluated."""


@dataclass(frozen=True)
class DispersiveLinear(Linear):
    """Matrices of a model with frequency-dependent terms, or their derivatives.

    Attributes
    ----------
    dispersive
        Frequency-dependent part of the stiffness at each of the requested frequencies.
    kept
        See `mirrors`.
    ground_dispersive
        Likewise for the motion of the ground beside the support.
    """

    dispersive: Complex[np.ndarray, "frequency coordinate coordinate"]
    kept: Bool[np.ndarray, " 2"]
    ground_dispersive: Complex[np.ndarray, "frequency coordinate 6"] | None = None

    @cached_property
    def mirrors(self) -> Bool[np.ndarray, " 2"]:
        """Whether mirroring x and y changes nothing, including clamps and materials of wires."""
        return self.kept

    @property
    def matters(self) -> bool:
        """Whether any matrix is not 0."""
        return super().matters or bool(self.dispersive.any())

    def at(self, number: int) -> DispersiveLinear:
        """Matrices at one of the frequencies."""
        more, ground_columns = self.dispersive[number], self.ground_columns
        if ground_columns is not None:
            assert self.ground_dispersive is not None
            own = self.ground_dispersive[number]
            ground_columns = ground_columns + np.stack([own.real, 0 * own.real, own.imag])
        return replace(
            self,
            stiffness=self.stiffness + more.real,
            loss=self.loss + more.imag,
            ground_columns=ground_columns,
        )


def changes(
    design: Design, numbers: Sequence[Parameter], level: str, omega: Sequence[float] = ()
) -> tuple[Differentiable, Mapping[str, Linear | None]]:
    """Differentiate the matrices of a design, exactly where the model can.

    Static matrices are differentiated exactly in all models; those at frequencies `omega` only
    where they do not depend on frequency, else as by `derived`. `level` is the name of a model that
    supports builds.
    """
    tables = any(link.table is not None for link in design.link)
    if omega and (tables or not registry.by_name(level).exact_derivatives):
        return derived(design, numbers, level, omega)
    base = derivatives.prepared(design, level)
    return base, {item.name: derivatives.along(base, item.rates) for item in numbers}


def at(linear: Linear, number: int) -> Linear:
    """Matrices at a requested frequency; those of exact derivatives are constant."""
    return linear.at(number) if isinstance(linear, DispersiveLinear) else linear


def derived(
    design: Design,
    numbers: Sequence[Parameter],
    level: str = registry.BEAM.name,
    omega: Sequence[float] = (),
) -> tuple[Differentiable, dict[str, DispersiveLinear | None]]:
    """Differentiate the matrices of a design at frequencies `omega` (rad/s) by differences.

    `level` is the name of a model that supports builds.

    Returns
    -------
    Differentiable
        Of the string model, except `linear`, which is a `DispersiveLinear`.
    changes : dict
        By name; None for a number that cannot change alone: the suspension would not balance in its
        nominal pose.

    Raises `InputError` if there is no equilibrium, or a wire is slack in it.
    """
    base, steps = derivatives.prepared(design), dict[str, float | None]()
    rates = {item.name: item.rates for item in numbers}
    for item in numbers:
        change = derivatives.along(base, item.rates)
        steps[item.name] = (
            None if change is None else STEP * _scale(base.linear, change, item.value)
        )
    moves = [
        (name, step, node) for name, step in steps.items() if step is not None for node in NODES
    ]
    solved = _solve_designs(
        [design, *(_moved(design, rates[name], node * step) for name, step, node in moves)],
        np.array(omega, dtype=float),
        base.scene,
        level,
    )
    found: dict[str, DispersiveLinear | None] = dict.fromkeys(steps)
    for n in range(1, len(solved), len(NODES)):
        name, step, _ = moves[n - 1]
        found[name] = _difference(solved[n : n + len(NODES)], step)
    here = solved[0]
    if here is None:
        raise InputError.of(
            "stage",
            "has no equilibrium near the nominal pose with wires that bend",
            "see pendsus check",
        )
    return replace(base, linear=here), found


def _moved(design: Design, rates: dict[str, float], step: float) -> Design:
    """Add a step times its rate to each of some numbers."""
    for name, rate in rates.items():
        design = shifted(design, name, rate * step)
    return design


def _scale(linear: Linear, change: Linear, value: float) -> float:
    """Estimate how far a number moves to change a matrix of strings by about its own size.

    At most the size of the number.
    """
    rates = [np.abs(change.orientation).max()]
    for whole, part in ((linear.mass, change.mass), (linear.stiffness, change.stiffness)):
        own = np.sqrt(np.abs(np.diag(whole)))[6:]
        alive = own > FREE * own.max()
        rates.append(
            np.abs(part[6:, 6:][np.ix_(alive, alive)] / np.outer(own[alive], own[alive])).max(
                initial=0.0
            )
        )
    largest = float(max(rates))
    return min(
        abs(value) or np.inf,
        1 / largest if largest else np.inf,
        np.inf if value or largest else 1.0,
    )


def _solve_designs(
    designs: list[Design], omega: Float[np.ndarray, " frequency"], scene: Scene, level: str
) -> list[DispersiveLinear | None]:
    """Compute the matrices of each design in its equilibrium; None where it has none."""
    result: list[DispersiveLinear | None] = [None] * len(designs)
    for places, scenes, design in variants.alike(designs, level):
        found = builds.balance(stack.stack_scenes(scenes), design, level=level, allow_unstable=True)
        for place, one in zip(places, _solve_builds(found, omega, scene), strict=True):
            result[place] = one
    return result


def _solve_builds(
    found: Builds, omega: Float[np.ndarray, " frequency"], scene: Scene
) -> list[DispersiveLinear | None]:
    """Compute the matrices of each build of a batch."""
    model, count = found.model, len(found.status)
    size = model.size
    each, every = np.tile(omega, count), np.repeat(np.arange(count), len(omega))
    dispersive = further_stiffness(model, found.terms, every, each)
    dispersive = dispersive.reshape(count, len(omega), size, size)
    ground_columns, ground_dispersive = _ground_columns(
        found, every, each, (count, len(omega), size)
    )
    mass, stiffness, damping = (
        np.broadcast_to(matrix, (count, size, size))
        for matrix in (model.mass, model.stiffness, model.damping)
    )
    loss = (
        np.zeros((count, size, size))
        if model.lossy is None
        else np.broadcast_to(np.imag(model.lossy), (count, size, size))
    )
    assert model.orientation is not None
    turned, good = model.orientation, found.status == builds.GOOD
    return [
        DispersiveLinear(
            mass[n],
            stiffness[n],
            damping[n],
            loss[n],
            turned[n],
            scene,
            dispersive[n],
            found.mirrors[n],
            None if ground_dispersive is None else ground_dispersive[n],
            ground_columns=None if ground_columns is None else ground_columns[n],
        )
        if good[n]
        else None
        for n in range(count)
    ]


def _ground_columns(
    found: Builds,
    every: Int[np.ndarray, " system"],
    each: Float[np.ndarray, " system"],
    shape: tuple[int, int, int],
) -> tuple[
    Float[np.ndarray, "build 3 coordinate 6"] | None,
    Complex[np.ndarray, "build frequency coordinate 6"] | None,
]:
    """Compute the columns of the ground in each build, and their frequency-dependent parts."""
    ground = found.model.ground
    if ground is None:
        return None, None
    driven = builds.driven_by_ground(found)
    more = further_stiffness(driven.model, driven.terms, every, each)[..., :6]
    parts = (np.real(ground.stiffness), ground.damping, np.imag(ground.stiffness))
    static = [np.broadcast_to(part, (shape[0], shape[2], 6)) for part in parts]
    return np.stack(static, axis=1), more.reshape(*shape, 6)


def _difference(around: list[DispersiveLinear | None], step: float) -> DispersiveLinear | None:
    """Differentiate from the designs at `NODES`; None if one of them has no equilibrium."""
    if any(one is None for one in around):
        return None
    before, near, after, far = (one for one in around if one is not None)

    def slope(name: str) -> np.ndarray:
        a, b, c, d = (getattr(one, name) for one in (before, near, after, far))
        return (8 * (c - b) - (d - a)) / (12 * step)

    moving = {
        name: slope(name)
        for name in ("mass", "stiffness", "damping", "loss", "orientation", "dispersive")
    }
    if near.ground_columns is not None:
        moving |= {name: slope(name) for name in ("ground_columns", "ground_dispersive")}
    return replace(
        near, **moving, kept=np.all([one.kept for one in (before, near, after, far)], axis=0)
    )
