"""Models agree where more than one is valid: closed forms, force model, general strings.

The force model shares no code with the general assembly, so each of them checks the other.
"""

from __future__ import annotations

import numpy as np
import pytest

from suspension_cli.equilibrium.nominal import expand
from suspension_cli.errors import InputError
from suspension_cli.linear import eigenmodes
from suspension_cli.models import closed_form, force, registry, string
from tests.support import paper, scenes


def string_model(design):
    return string.linear_model(expand(design))


def condensed_whole(model, k=None):
    """Stiffness of support and bodies, blade tips without mass eliminated."""
    n = 6 * (len(model.body) + 1)
    k = model.stiffness if k is None else k
    assert model.massless[n:].all()
    assert np.array_equal(model.basis[:n, :n], np.eye(n))
    return k[:n, :n] - k[:n, n:] @ np.linalg.solve(k[n:, n:], k[n:, :n])


def worst(one, other):
    """Largest relative difference of two sets of frequencies; a rigid mode must be exactly 0 in
    both."""
    a, b = eigenmodes.solve(one), eigenmodes.solve(other)
    assert a.stable
    assert a.frequency.shape == b.frequency.shape
    assert np.array_equal(a.frequency == 0, b.frequency == 0)
    return np.max(np.abs(a.frequency - b.frequency) / np.where(a.frequency == 0, 1.0, a.frequency))


def apart(stiffness, other):
    """Largest difference of two stiffness matrices as a share of the largest element."""
    assert stiffness.shape == other.shape
    return np.abs(stiffness - other).max() / np.abs(other).max()


def rngs(*seeds, count=4):
    return [np.random.default_rng([*seeds, n]) for n in range(count)]


def below_blades(wires, blades, rng):
    """Below a bladed stage, too: the support (or body) that carries the blades tilts them."""
    stages = [
        scenes.stage(rng, "top"),
        scenes.bladed_stage(rng, "middle", wires, blades),
        scenes.stage(rng, "low"),
    ]
    return scenes.raw_of(*stages)


DESIGNS = {
    "table 1": lambda: [paper.table_1(case) for case in paper.TABLE_1],
    "singles": lambda: [scenes.single(rng, splayed=False) for rng in rngs(count=20)],
    "chains": lambda: [scenes.chain(rng, n) for n in range(1, 6) for rng in rngs(1, n)],
    "blades above vertical wires": lambda: [
        scenes.bladed_chain(rng, n) for n in range(1, 6) for rng in rngs(2, n)
    ],
    "every number of blades": lambda: [
        below_blades(*counts, rng)
        for counts in scenes.BLADE_COUNTS
        for rng in rngs(3, *counts, count=3)
    ],
}


@pytest.mark.parametrize("kind", DESIGNS)
def test_frequencies_and_stiffness_of_all_models_that_fit(kind):
    """Closed forms and force model against strings."""
    one_stage = kind in ("table 1", "singles")
    for raw in DESIGNS[kind]():
        design = scenes.design_of(raw)
        string = string_model(design)
        assert not force.FORCE.unsuitable(design)
        assert not force.FORCE.approximated_stages(design)
        models = [force.FORCE]
        if one_stage:
            assert not closed_form.CLOSED_FORM.unsuitable(design)
            models.append(closed_form.CLOSED_FORM)
        for model in models:
            found = model.suspension(design)
            assert worst(found, string) < (1e-12 if one_stage else 1e-10)
            assert apart(found.stiffness, condensed_whole(string)) < 1e-13
            if "blades" not in kind:
                assert np.array_equal(found.mass, string.mass)


def lossy_design(rng, stages, blades):
    """Lossy wires everywhere, and lossy blades of another loss angle."""
    raw = scenes.bladed_chain(rng, stages) if blades else scenes.single(rng, splayed=False)
    for stage in raw["stage"]:
        stage["wires"]["material"] = "lossy"
        if "blades" in stage:
            stage["blades"]["loss_angle"] = 0.03
    return scenes.design_of(
        raw | {"materials": {"lossy": {"youngs_modulus": 2e11, "loss_angle": 0.01}}}
    )


def test_losses_agree():
    """Tension is not lossy, stretching is: the imaginary parts of all models are one matrix."""
    for seed in range(4):
        rng = np.random.default_rng([6, seed])
        design = lossy_design(rng, 1, blades=False)
        models = [
            closed_form.CLOSED_FORM.suspension(design),
            force.FORCE.suspension(design),
            string_model(design),
        ]
        for model in models:
            assert apart(model.complete, models[-1].complete) < 1e-13
            assert apart(model.complete.real, model.stiffness) < 1e-13
        assert np.abs(models[-1].loss).max() > 1.0
        design = lossy_design(rng, 3, blades=True)
        chain, string = force.FORCE.suspension(design), string_model(design)
        condensed = condensed_whole(string, string.complete)
        assert apart(chain.loss, condensed.imag) < 1e-12
        # of springs in series the force model takes the real part without loss
        assert apart(chain.stiffness, condensed_whole(string)) < 1e-13


def angled_on_blades(tilt=0.3, blade=2e3, count=4):
    wires = {
        "count": 4,
        "l": 0.4,
        "s": 0.03,
        "t2": 0.13,
        "t1": 0.13 - 0.4 * tilt,
        "d": 0.004,
        "k": 4e4,
    }
    stage = {
        "name": "test",
        "body": paper.BODY,
        "wires": wires,
        "blades": {"count": count, "stiffness": blade},
    }
    return scenes.design_of(scenes.raw_of(stage))


@pytest.mark.parametrize("count", [2, 4])
def test_blades_above_angled_wires_are_approximate(count):
    """In series means a deflection along the wire; the tip really moves along z, so they part by up
    to sin^2 of the angle."""
    design = angled_on_blades(count=count)
    assert force.FORCE.approximated_stages(design) == ("test",)
    choice = registry.choose(design)
    assert choice.level == "string" or "string" in choice.reason
    difference = worst(force.FORCE.suspension(design), string_model(design))
    assert 1e-3 < difference < 0.2


def equations_6_to_9(m, iy, iz, l, s, t1, t2, k, g):
    """Vertical, longitudinal, tilt, rotation: omega^2 of wires angled in y and d = 0, as printed;
    equations 1 to 4 for vertical ones."""
    sin = (t2 - t1) / l
    cos = np.sqrt(1 - sin**2)
    return (
        4 * k * cos**2 / m + g * sin**2 / (l * cos),
        g / (l * cos),
        4 * k * s**2 * cos**2 / iy + m * g * s**2 * sin**2 / (iy * l * cos),
        m * g * (s**2 * cos**2 + t1 * t2) / (l * iz * cos)
        + 4 * k * s**2 * (t2 - t1) ** 2 / (l**2 * iz),
    )


@pytest.mark.parametrize("angled", [False, True])
def test_equations_as_printed(angled):
    names = ("z", "x", "pitch", "yaw")
    for seed in range(20):
        raw = scenes.single(
            np.random.default_rng([4, seed]), angled=angled, splayed=False, raised=False
        )
        body, w = raw["stage"][0]["body"], raw["stage"][0]["wires"]
        m, (_, iy, iz) = body["mass"], body["inertia"]
        printed = equations_6_to_9(m, iy, iz, w["l"], w["s"], w["t1"], w["t2"], w["k"], 9.81)
        p = closed_form.four_wires(scenes.design_of(raw))
        a = closed_form.longitudinal_tilt(p)
        assert np.array_equal(a, np.diag(np.diag(a)))  # d = 0: not coupled
        found = (closed_form.vertical(p), -a[0, 0], -a[1, 1], closed_form.rotation(p))
        np.testing.assert_allclose(found, printed, rtol=1e-13, err_msg=str(names))


def test_an_invalid_model_is_refused():
    chain = scenes.design_of(scenes.chain(np.random.default_rng(5), 2))
    assert "more than one stage" in closed_form.CLOSED_FORM.unsuitable(chain)
    raw = paper.table_1(1)
    wires = {key: value for key, value in raw["stage"][0]["wires"].items() if key != "s"} | {
        "s_upper": 0.02,
        "s_lower": 0.03,
    }
    splayed = scenes.design_of(scenes.raw_of(raw["stage"][0] | {"wires": wires}))
    assert "angled in x" in closed_form.CLOSED_FORM.unsuitable(splayed)
    with pytest.raises(InputError, match="angled in x"):
        registry.choose(splayed, "closed-form")
    crooked = scenes.design_of(scenes.crooked(np.random.default_rng(5)))
    assert "explicit wires" in force.FORCE.unsuitable(crooked)
    assert registry.choose(crooked).level == "string"
