"""Poles that hardly decay: the first digit of a Q of 1e13 and the last, by hand, from losses and in
50 digits."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest

from suspension_cli.analyses.damp import closed_loop_poles, control
from suspension_cli.design.schema import expand_roots
from suspension_cli.linear import eigenmodes
from tests.analyses.damp.test_control import LEAD, loop, plant, simple
from tests.support import plants, scenes
from tests.support.commandline import run, strict_json, written

MP = mpmath.mp.clone()
MP.dps = 50


def found_of(closed):
    return closed_loop_poles.find(closed)


@pytest.mark.parametrize("c", [40.0, 5.0, 0.4, 1e-3, 1e-8, 1e-12, 1e-20])
def test_a_pendulum_by_hand(c):
    """m x'' + c x' + m g x / l = 0 decays with c / 2m, whatever its rounding."""
    mass, length = 3.0, 0.7
    found = found_of(simple(c, mass=mass, length=length))
    own = np.array([state.startswith("test.x") for state in found.state])
    others = ~np.array([state.startswith(("test.x", "test.pitch")) for state in found.state])
    root = np.emath.sqrt((c / (2 * mass)) ** 2 - 9.81 / length)
    expected = -c / (2 * mass) + (np.array([-root, root]) if c > 20 else np.array([root]))
    np.testing.assert_allclose(np.sort(found.value[own].real), expected.real, rtol=1e-9)
    np.testing.assert_allclose(np.sort(found.value[own].imag), expected.imag, rtol=1e-9)
    np.testing.assert_allclose(found.q[own], abs(expected) / (-2 * expected.real), rtol=1e-9)
    assert np.isinf(found.q[others]).all()


def chain(gain):
    """Two stages, a filter with phase lead and a damper on the upper one, both weakened."""
    rng = np.random.default_rng(3)
    weak = LEAD | {"gain": LEAD["gain"] * gain}
    return plant(
        scenes.raw_of(scenes.stage(rng, "upper"), scenes.stage(rng, "test")),
        [loop("upper.x", **weak), loop("upper.roll", damper=0.3 * gain)],
    )


def polished(parts, s):
    """A zero of det(K + s C + s^2 M + sum of H p s^T) in 50 digits, by Newton's method from a
    pole."""
    return MP.findroot(
        lambda at: MP.fprod(part(at) for part in parts),
        MP.mpmathify(s),
        tol=1e-40,
        maxsteps=30,
        verify=False,
    )


def determinants(closed):
    """Those of groups of coordinates, which no loop joins."""
    model = closed.model
    every = [
        model.stiffness,
        model.damping,
        model.mass,
        *(np.outer(p, q) for p, q in zip(closed.pushed, closed.sensed, strict=True)),
    ]
    assert all(
        np.count_nonzero(one[6:, 6:])
        == sum(np.count_nonzero(one[np.ix_(group, group)]) for group in model.blocks)
        for one in every
    )
    return [
        determinant(closed, *(MP.matrix(one[np.ix_(group, group)].tolist()) for one in every))
        for group in model.blocks
    ]


def determinant(closed, k, c, m, *outer):
    def at_pole(at):
        total = k + at * c + at**2 * m
        for one, pair in zip(closed.loops, outer, strict=True):
            if one.damper is not None:
                h = MP.mpf(one.damper) * at
            else:
                f, h = at / (2 * MP.pi), MP.mpf(one.gain)
                for zero in expand_roots(one.zeros):
                    h *= f + MP.mpmathify(zero)
                for pole in expand_roots(one.poles):
                    h /= f + MP.mpmathify(pole)
            total = total + h * pair
        return MP.det(total)

    return at_pole


@pytest.mark.parametrize("gain", [1e-2, 1e-6, 1e-10])
def test_weak_loops_in_fifty_digits(gain):
    closed = chain(gain)
    found, parts = found_of(closed), determinants(closed)
    touched = [
        n
        for n, value in enumerate(found.value)
        if value.imag > 0 and 0 < -value.real < 1e-3 * abs(value)
    ]
    assert len(touched) >= 5
    for n in touched:
        expected = polished(parts, complex(found.value[n]))
        assert found.value[n].real == pytest.approx(float(expected.real), rel=1e-7)
    assert np.max(found.q[touched]) > 4e3 / gain


def test_without_loops_it_is_the_q_of_modes():
    """A spring of a tiny loss angle: to first order in the losses, which makes such a Q exact."""
    raw = plants.raw("quadruple")
    raw["stage"][0]["spring"] = [{"stiffness": [1.0, 2.0, 3.0, 0.1, 0.2, 0.3], "loss_angle": 1e-9}]
    closed = plant(raw, [loop(f"{raw['stage'][0]['name']}.x", damper=1e-9)], "string")
    bare = control.Plant(
        closed.model, (), [], [], np.zeros((0, closed.model.size)), np.zeros((0, closed.model.size))
    )
    found = found_of(bare)
    expected = eigenmodes.solve(closed.model)
    order = np.argsort(found.frequency)
    np.testing.assert_allclose(found.frequency[order], expected.frequency, rtol=1e-9)
    np.testing.assert_allclose(found.q[order], expected.q, rtol=1e-6)


def test_damp_reports_them(tmp_path):
    stage = scenes.hung({"count": 1, "l": 0.7, "k": 1e5}, 3.0, 0.1)
    file = written(
        tmp_path,
        scenes.plain(scenes.raw_of(stage, control={"loop": [loop("test.x", damper=1e-12)]})),
    )
    result = run("damp", file, "--json", "--no-plot", "--out", tmp_path)
    assert result.exit_code == 0, result.stderr
    answer = strict_json(result.stdout)
    expected = 3.0 * np.sqrt(9.81 / 0.7) / 1e-12
    q = {pole["state"]: pole["q"] for pole in answer["poles"]}
    assert answer["stable"]
    assert q["test.x"] == pytest.approx(expected, rel=1e-9)
    assert q["test.z"] is None
