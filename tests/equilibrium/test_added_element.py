"""An element with arrays of its own, known to the registry alone: it acts in all models, and in
batches."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from suspension_cli.elements import known_elements
from suspension_cli.elements.configuration import Attached, Ends
from suspension_cli.elements.element import Element
from suspension_cli.elements.energy_derivatives import Terms
from suspension_cli.elements.vectors import dot, outer, plus_unit, unit
from suspension_cli.equilibrium import clamps
from suspension_cli.equilibrium import solve as equilibrium
from suspension_cli.linear.response import solve
from suspension_cli.linear.signals import bodies_with_signals, parse
from suspension_cli.linear.symmetry import is_mirror_symmetric
from suspension_cli.models import registry as models
from suspension_cli.scene import applied_imperfections
from suspension_cli.scene.arrays import inner
from suspension_cli.scene.pose import layout
from suspension_cli.scene.scene import stack_scenes
from suspension_cli.studies import builds
from tests.support import scenes

PLACES = np.array([[0.03, 0.02, 0.01], [-0.03, 0.02, 0.01]])
"""Ends on the lower body, m."""


@dataclass(frozen=True)
class Tethers:
    """Tethers with the energy k s^2 / 2 + q s^4 / 4 at the distance s of their ends."""

    label: tuple[str, ...]
    upper: np.ndarray
    lower: np.ndarray
    upper_point: np.ndarray = field(metadata=inner(3, frame="upper"))
    lower_point: np.ndarray = field(metadata=inner(3, frame="lower"))
    k: np.ndarray = field(metadata=inner())
    q: np.ndarray = field(metadata=inner())
    loss: np.ndarray


def make(design, scene):
    """Two tethers between the last body and the support, which pull it upwards by 2 mm."""
    del design
    last = len(scene.bodies.name)
    upper = scene.bodies.position[last] + PLACES + [0.0, 0.0, 2e-3]
    k, q = np.full(2, 400.0), np.full(2, 3e7)
    none, body = np.zeros(2, dtype=np.intp), np.full(2, last)
    return Tethers(("a", "b"), none, body, upper, PLACES, k, q, np.full(2, 1e-3))


def ends(now):
    """Both ends of all tethers, and the vectors from the upper to the lower one."""
    own = now.arrays.parts["tethers"]
    joined = Ends.of(own.upper, own.lower)
    above, _ = now.arms(joined.upper, own.upper_point)
    below, _ = now.arms(joined.lower, own.lower_point)
    d = now.place[:, own.lower] + below - now.place[:, own.upper] - above
    return own, Attached(joined, above, below), d


def add_derivatives(now, derivatives):
    own, attached, d = ends(now)
    stiffness = own.k + own.q * dot(d, d)
    s = plus_unit(2 * own.q * outer(d, d), stiffness)
    derivatives.add(attached, Terms(stiffness * d, s=s))


def add_loss(now, derivatives):
    own, attached, _ = ends(now)
    derivatives.add(attached, Terms(s=unit(own.k * own.loss[:, None])))


@pytest.fixture
def tethers(monkeypatch):
    element = Element(add_derivatives, add_loss=add_loss, make=make, name="tethers")
    monkeypatch.setattr(known_elements, "ELEMENTS", (*known_elements.ELEMENTS, element))


def design_of(rng):
    raw = scenes.bladed_chain(rng, 2, tip_mass=True, lateral=True)
    return scenes.design_of(scenes.fibred(raw))


def members_of(design, model):
    """Builds of a design that differ in a wire and a COM, and in the element itself."""
    scene = model.completed(scenes.expand(design), design)
    found = []
    for factor in (0.5, 1.0, -1.0):
        one = applied_imperfections.wire(scene, 0, length_change=1e-4 * factor)
        one = applied_imperfections.move_com(one, len(scene.bodies.name), [0.0, 1e-3 * factor, 0.0])
        own = one.added["tethers"]
        found.append(one.with_parts({"tethers": replace(own, k=own.k * (1 + factor / 9))}))
    return found


@pytest.mark.usefixtures("tethers")
@pytest.mark.parametrize("model", models.SCENE_MODELS, ids=lambda model: model.name)
def test_builds_of_a_batch_are_those_of_single_designs(model):
    """The tethers pull hard enough to move the body by more than the imperfections do."""
    design = design_of(np.random.default_rng(2))
    members = members_of(design, model)
    batch = builds.balance(stack_scenes(members), design, level=model.name)
    assert batch.pose is not None and (batch.status == builds.GOOD).all()
    known = bodies_with_signals(batch.model)
    inputs, outputs = ([parse(text, "", known)] for text in ("support.y", "mass2.y"))
    frequency = np.array([0.1, 1.0, 30.0])
    found = builds.transfer(batch, frequency, inputs, outputs)
    for n, member in enumerate(members):
        single = model.of_scene(member, design)
        _, one = (
            clamps.solve_bending(member, layout(member))
            if model.bends_wires
            else (member, equilibrium.solve(member, layout(member)))
        )
        assert np.abs(one.pose.shift).max() > 3e-5
        assert batch.pose.shift[n] == pytest.approx(one.pose.shift, rel=1e-8, abs=1e-14)
        expected = solve(single, frequency, inputs, outputs).value
        assert np.ravel(found[n]) == pytest.approx(np.ravel(expected), rel=1e-7)


@pytest.mark.usefixtures("tethers")
def test_mirror_images():
    """Tethers that are mirror images in x alone break the symmetry in y alone."""
    design = scenes.design_of(scenes.single(np.random.default_rng(3)))
    scene = scenes.expand(design)
    assert is_mirror_symmetric(replace(scene, added={})).all()
    assert is_mirror_symmetric(scene).tolist() == [True, False]
    softer = replace(scene.added["tethers"], k=np.array([400.0, 300.0]))
    assert not is_mirror_symmetric(scene.with_parts({"tethers": softer})).any()
