"""Sweeps, random builds and couplings with default options against `modes` and `response` of the
same design: equal to the tolerance of both."""

from __future__ import annotations

import numpy as np
import pytest

import suspension_cli as sus

CHAINS = ("double", "quad")
TOLERANCE = 1e-3
TWICE = 2 * TOLERANCE
"""Both may be off by the tolerance."""
PATH = "stage.{}.wires.l"


def last(design):
    stage = design.stage[-1]
    return stage.name, stage.wires.l


@pytest.mark.parametrize("name", CHAINS)
def test_sweep(name):
    """At one swept value: all modes, and a response between resonances."""
    design = sus.template(name)
    body, length = last(design)
    path, result = PATH.format(body), f"{body}.x/support.x:10"
    vary = {path: [0.95 * length, 1.05 * length]}
    modes, shaken = sus.sweep(design, vary=vary), sus.sweep(design, vary=vary, results=[result])
    for n, value in enumerate(vary[path]):
        there = design.replace({path: value})
        found = np.sort(modes.value[n])
        assert modes.estimated_error <= TOLERANCE
        np.testing.assert_allclose(found, np.sort(sus.modes(there).frequency), rtol=TWICE)
        single = sus.response(there, outputs=[f"{body}.x"], frequency=[10.0])
        assert shaken.value[n, 0] == pytest.approx(abs(single.value[0, 0, 0]), rel=TWICE)


@pytest.mark.parametrize("name", CHAINS)
def test_xcouple(name):
    """One imperfect build against the responses of a design with this imperfection."""
    design = sus.template(name)
    body, _ = last(design)
    k = [1.0, 1.1]
    found = sus.xcouple(design, sweep={"k": k, "offset": [0.0, 1e-3]})
    imperfect = f'wire = "{body}.1"\nk_factor = 1.1\nupper_offset = [1e-3, 0.0, 0.0]'
    built = sus.parse(f"{design.text}\n[[perturbation]]\n{imperfect}\n")
    point = "@0,0,-0.001"
    single = sus.response(
        built,
        inputs=["support.z"],
        outputs=[f"{body}.x{point}", f"{body}.z{point}"],
        frequency=[50.0],
    )
    x, z = single.value[0, :, 0]
    assert found.estimated_error <= TOLERANCE
    assert abs(found.ratio[1, 1, 0] - x / z) < TWICE * abs(found.ratio).max()
    assert found.ratio[0, 0, 0] == 0


@pytest.mark.parametrize("name", CHAINS)
def test_tolerance(name):
    """The nominal modes."""
    design = sus.template(name)
    body, _ = last(design)
    text = design.text + f'\n[[tolerance.body]]\nstage = "{body}"\nmass = {{ normal = 1e-3 }}\n'
    found = sus.tolerance(sus.parse(text), builds=10)
    np.testing.assert_allclose(
        np.sort(found.nominal), np.sort(sus.modes(design).frequency), rtol=TWICE
    )
