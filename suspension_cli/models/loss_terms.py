"""Losses as functions of frequency: of blades and springs, and of bodies by the gas around them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.elements import loss, spring
from suspension_cli.elements.configuration import builds_last
from suspension_cli.elements.registry import elements_of
from suspension_cli.equilibrium.energy import sum_forms
from suspension_cli.linear.frequency_terms import LossTerm, Term
from suspension_cli.linear.symmetry import Symmetry
from suspension_cli.scene.arrays import Array
from suspension_cli.scene.composition import BladeLoss
from suspension_cli.scene.pose import Layout, Pose
from suspension_cli.scene.scene import Scene, Spectrum

if TYPE_CHECKING:
    from jaxtyping import Inexact

Function = Callable[[Array], Array]
"""A loss angle, or a relative change of stiffness, against angular frequency (rad/s)."""
Drag = tuple[Array | None, ...]
"""Damping (6, 6) of each body by the gas around it, in its own frame at its COM; None for none."""


def lossless(scene: Scene) -> Scene:
    """The scene without the losses of wires, blades, springs and added elements."""
    parts = {name: part for name, part in scene.parts.items() if hasattr(part, "loss")}
    return scene.with_parts(
        {name: replace(part, loss=np.zeros_like(part.loss)) for name, part in parts.items()}
    )


def loss_terms(scene: Scene, numbering: Layout, pose: Pose, adapted: Symmetry) -> list[Term]:
    """Losses of blades and added elements. Any batch axes; none where the stiffness has none."""
    fibres, terms = scene.fibres, []
    assert fibres is not None
    shape = (*scene.blades.stiffness.shape[:-2], numbering.size, numbering.size)
    place = {label: n for n, label in enumerate(scene.blades.label)}
    groups: dict[tuple[str, float, object, float, float], list[int]] = {}
    for blade in fibres.blade:
        key = (
            blade.label.rsplit(".", 1)[0],
            blade.angle,
            blade.losses,
            blade.thickness,
            blade.temperature,
        )
        groups.setdefault(key, []).append(place[blade.label])
    for (stage, *_, temperature), numbers in groups.items():
        matrix = np.zeros(shape)
        for n in numbers:
            rows = numbering.blade[n][scene.blades.axes[n]]
            matrix[..., rows, rows] = scene.blades.stiffness[..., n, scene.blades.axes[n]]
        one = fibres.blade[numbers[0]]
        terms.append(
            LossTerm(
                f"{stage}.blades",
                temperature,
                adapted.apply(matrix),
                lambda omega, one=one: loss.blade_angle(one, omega),
            )
        )
    for item in elements_of(scene):
        if item.make is not None and item.add_loss is not None:
            lossy = adapted.apply(sum_forms(scene, numbering, pose, [item.add_loss]))
            terms.append(LossTerm(item.name, fibres.temperature, lossy, np.ones_like))
    return terms


def spring_terms(
    scene: Scene, numbering: Layout, pose: Pose, adapted: Symmetry, *, tables: bool = False
) -> tuple[list[LossTerm], tuple[LossTerm, ...]]:
    """Losses of springs and stiffnesses given as tables, or only the latter; any batch axes.

    The terms of the springs on the ground, which is at rest, are first. They are also returned
    alone, with the coordinates of the ground in place of the support's. Springs of one cause and
    loss share a term, so that what symmetry cancels between them is 0.
    """
    springs = scene.springs
    known = {} if scene.fibres is None else {own.label: own for own in scene.fibres.spring}
    if not known and not springs.loss.any() and not any(springs.spectrum):
        return [], ()
    terms: list[LossTerm] = []
    place: dict[tuple[object, ...], int] = {}
    for n in np.argsort(~springs.grounded, kind="stable").tolist():
        spectrum, own = springs.spectrum[n], known.get(springs.label[n])
        if spectrum is None and (tables or not (own or springs.loss[n])):
            continue
        surroundings = scene.fibres or spectrum
        assert surroundings is not None
        ambient = surroundings.temperature
        own = own or BladeLoss("", float(np.real(springs.loss[n])), None, 0.0, ambient)
        for axes, angle, storage in _functions(spectrum, own):
            chosen = np.zeros((len(springs.label), 6, 6))
            chosen[n] = axes
            matrix = adapted.apply(_spring_form(scene, numbering, pose, springs.stiffness * chosen))
            one = LossTerm(_cause(springs.label[n]), own.temperature, matrix, angle, True, storage)
            alone = (n, len(terms)) if spectrum is not None else ()
            key = (one.cause, springs.grounded[n], replace(own, label=""), *alone)
            same = place.setdefault(key, len(terms))
            if same == len(terms):
                terms.append(one)
            else:
                terms[same] = replace(one, matrix=terms[same].matrix + matrix)
    ground = tuple(terms[number] for key, number in place.items() if key[1])
    others = np.diag(np.arange(numbering.size) >= 6).astype(float)
    return [*(term.spread(others) for term in ground), *terms[len(ground) :]], ground


def _spring_form(
    scene: Scene,
    numbering: Layout,
    pose: Pose,
    form: Inexact[np.ndarray, "*batch spring 6 6"],
) -> Inexact[np.ndarray, "*batch coordinate coordinate"]:
    """Sum of forms in the strains of springs."""
    last = builds_last(form, 3, scene.batch)
    add = partial(spring.add_forms, form=last)
    return sum_forms(scene, numbering, pose, [add])


def _functions(
    spectrum: Spectrum | None, own: BladeLoss
) -> list[tuple[Array, Function, Function | None]]:
    """Axes (6, 6) of a spring that share a function, loss angle and change of the real part."""
    if spectrum is None:
        return [(np.ones((6, 6)), lambda omega: loss.blade_angle(own, omega), None)]
    at = np.log(2 * np.pi * np.array(spectrum.frequency))

    def curve(values: tuple[float, ...], less: float) -> Function:
        def evaluate(omega: Array) -> Array:
            with np.errstate(divide="ignore"):
                return np.interp(np.log(np.abs(omega)), at, values) - less

        return evaluate

    found = []
    for axis, real, imaginary in spectrum.axis:
        only = np.zeros((6, 6))
        only[axis, axis] = 1.0
        found.append((only, curve(imaginary, 0.0), curve(real, 1.0)))
    return found


def _cause(label: str) -> str:
    """Name of a spring among the causes of noise: those of a stage together, links each."""
    owner, kind = label.rsplit(".", 1)
    return label if kind == "link" else f"{owner}.springs"


def gas_terms(
    scene: Scene, numbering: Layout, pose: Pose, adapted: Symmetry, drag: Drag
) -> list[Term]:
    """Losses by the gas around the bodies; any batch axes."""
    terms: list[Term] = []
    for n, own in enumerate(drag):
        if own is None:
            continue
        turn = pose.rotation[..., n + 1, :, :]
        matrix = np.zeros((*turn.shape[:-2], numbering.size, numbering.size))
        for half in (0, 3):
            rows = slice(6 * (n + 1) + half, 6 * (n + 1) + half + 3)
            matrix[..., rows, rows] = (
                turn @ own[half : half + 3, half : half + 3] @ np.swapaxes(turn, -1, -2)
            )
        gas = scene.fibres and scene.fibres.gas
        assert gas is not None and gas.temperature is not None
        terms.append(
            LossTerm(
                f"{scene.bodies.name[n]}.gas",
                gas.temperature,
                adapted.apply(matrix),
                lambda omega: omega,
                elastic=False,
            )
        )
    return terms
