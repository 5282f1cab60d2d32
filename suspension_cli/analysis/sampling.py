"""Random imperfections of builds, from the `[tolerance]` table: which numbers scatter, how, and how they get into a scene.

Random numbers are counter-based (Philox; Salmon et al., Proc. SC11 (2011)): build n takes the n-th row of one stream of
uniform numbers, whichever builds are drawn with it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from suspension_cli.design import perturb
from suspension_cli.design.scene import Array, Scene
from suspension_cli.design.schema import Design, Distribution
from suspension_cli.errors import Fault, InputError

AXES = ("x", "y", "z")
SMALLEST = 1e-3
"""Factors (on k, mass, ...) are kept above this: a normal distribution has tails."""


@dataclass(frozen=True)
class Factor:
    """One number that scatters.

    Attributes
    ----------
    label : str
        ``test.1 length``, ``test com x``.
    part : str
        ``wire``, ``body`` or ``blade``.
    number : int
        The wire or blade from 0, the body from 1.
    what : str
        Key of the tolerance table.
    axis : int
        0, 1, 2 for vectors, else 0.
    spread : Distribution
    unit : str
        ``m``, or ``1`` for a share of the nominal value.
    hold : str
        For wires.
    """

    label: str
    part: str
    number: int
    what: str
    axis: int
    spread: Distribution
    unit: str
    hold: str = "loaded-length"


def factors(design: Design, scene: Scene) -> tuple[Factor, ...]:
    """All numbers that a design's `[tolerance]` table lets scatter, in a fixed order.

    Raises
    ------
    InputError
        If there is no such table.
    """
    if design.tolerance is None:
        raise InputError([Fault("tolerance", "missing", "add [[tolerance.wire]], [[tolerance.body]] or [[tolerance.blade]]")])
    return (*_of_wires(design, scene), *_of_bodies(design, scene), *_of_blades(design, scene))


def _of_wires(design: Design, scene: Scene) -> Iterator[Factor]:
    for item in design.tolerance.wire if design.tolerance else ():
        for number, label in enumerate(scene.wires.label):
            if label != item.wire and label.rsplit(".", 1)[0] != item.stage:
                continue
            for what in ("k", "radius", "length"):
                if spread := getattr(item, what):
                    yield Factor(f"{label} {what}", "wire", number, what, 0, spread, "m" if what == "length" else "1", item.hold)
            for what in ("upper", "lower"):
                if spread := getattr(item, what):
                    for axis, name in enumerate(AXES):
                        yield Factor(f"{label} {what} {name}", "wire", number, what, axis, spread, "m", item.hold)


def _of_bodies(design: Design, scene: Scene) -> Iterator[Factor]:
    for item in design.tolerance.body if design.tolerance else ():
        number = scene.bodies.name.index(item.stage) + 1
        if item.mass:
            yield Factor(f"{item.stage} mass", "body", number, "mass", 0, item.mass, "1")
        for what in ("inertia", "com"):
            if spread := getattr(item, what):
                for axis, name in enumerate(AXES):
                    yield Factor(f"{item.stage} {what} {name}", "body", number, what, axis, spread, "1" if what == "inertia" else "m")


def _of_blades(design: Design, scene: Scene) -> Iterator[Factor]:
    for item in design.tolerance.blade if design.tolerance else ():
        for number, label in enumerate(scene.blades.label):
            if label.split(".", 1)[0] == item.stage:
                yield Factor(f"{label} stiffness", "blade", number, "stiffness", 0, item.stiffness, "1")


def uniforms(seed: int, start: int, stop: int, width: int) -> Array:
    """Uniform numbers in [0, 1) of builds start to stop - 1: (stop - start, width).

    Each build takes a whole number of Philox blocks (four numbers each), so its numbers depend on nothing but seed and build.
    """
    blocks = -(-width // 4)
    stream = np.random.Philox(key=seed)
    stream.advance(start * blocks)
    return np.random.Generator(stream).random((stop - start, 4 * blocks))[:, :width]


def deviations(chosen: tuple[Factor, ...], seed: int, start: int, stop: int) -> Array:
    """Deviations of every factor (columns) from nominal for builds start to stop - 1, m or shares."""
    from scipy.special import ndtr, ndtri

    u = uniforms(seed, start, stop, len(chosen))
    result = np.empty_like(u)
    for n, factor in enumerate(chosen):
        spread = factor.spread
        if spread.uniform is not None:
            result[:, n] = spread.uniform * (2 * u[:, n] - 1)
            continue
        sigma = spread.normal or 0.0
        tail = ndtr(-spread.truncate / sigma) if spread.truncate and sigma else 0.0
        # the middle of the interval that a 53-bit number stands for; the last one rounds to 1, whose deviation is infinite
        middle = np.minimum(u[:, n] + 2.0**-54, 1 - 2.0**-53)
        result[:, n] = sigma * ndtri(tail + (1 - 2 * tail) * middle)
        if spread.truncate:
            result[:, n] = np.clip(result[:, n], -spread.truncate, spread.truncate)
    return result


def imperfect(scene: Scene, chosen: tuple[Factor, ...], values: Array) -> Scene:
    """A scene with deviations (p, factors) put in: the builds become its first axis."""
    table: dict[tuple[str, int, str], Given] = {}
    for n, factor in enumerate(chosen):
        here = table.setdefault((factor.part, factor.number, factor.hold), {})
        if (factor.what, factor.axis) in here:  # named twice: they add up
            here[(factor.what, factor.axis)] = (factor, here[(factor.what, factor.axis)][1] + values[:, n])
        else:
            here[(factor.what, factor.axis)] = (factor, values[:, n])
    for part, number, hold in sorted(table, key=lambda key: key[2] == "natural-length"):  # a wire is trimmed first
        given = table[(part, number, hold)]
        scene = {"wire": _wire, "body": _body, "blade": _blade}[part](scene, number, given, len(values))
    return scene


Given = dict[tuple[str, int], tuple[Factor, Array]]


def _vector(given: Given, what: str, count: int) -> Array:
    zero = np.zeros(count)
    return np.stack([given[(what, axis)][1] if (what, axis) in given else zero for axis in range(3)], axis=-1)


def _scale(given: Given, what: str, axis: int, count: int) -> Array:
    if (what, axis) not in given:
        return np.ones(count)
    return np.maximum(1.0 + given[(what, axis)][1], SMALLEST)


def _wire(scene: Scene, number: int, given: Given, count: int) -> Scene:
    hold = next(iter(given.values()))[0].hold
    factor = _scale(given, "k", 0, count) * _scale(given, "radius", 0, count) ** 2
    length: Any = given[("length", 0)][1] if ("length", 0) in given else 0.0
    upper, lower = _vector(given, "upper", count), _vector(given, "lower", count)
    return perturb.wire(scene, number, k_factor=factor, upper_offset=upper, lower_offset=lower, length_change=length, hold=hold)


def _body(scene: Scene, number: int, given: Given, count: int) -> Scene:
    if any(what == "com" for what, _ in given):
        scene = perturb.move_com(scene, number, _vector(given, "com", count))
    if ("mass", 0) in given:
        scene = perturb.scale_mass(scene, number, _scale(given, "mass", 0, count))
    if any(what == "inertia" for what, _ in given):
        scene = perturb.scale_inertia(scene, number, np.stack([_scale(given, "inertia", axis, count) for axis in range(3)], axis=-1))
    return scene


def _blade(scene: Scene, number: int, given: Given, count: int) -> Scene:
    return perturb.scale_blade(scene, number, _scale(given, "stiffness", 0, count))
