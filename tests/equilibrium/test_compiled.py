"""Compiled loops against the same formulas on arrays."""

import numpy as np
import pytest

from suspension_cli.compiled import constant, factorise, substitute
from suspension_cli.elements import compiled_wire, joined_sections
from suspension_cli.elements.dynamic_wire import TautWire
from suspension_cli.models import registry
from suspension_cli.scene.stack import stack_scenes
from tests.support import scenes


@pytest.mark.parametrize("massive", [False, True])
@pytest.mark.parametrize("seed", range(2))
def test_dynamic_stiffness_of_a_wire(massive, seed):
    """A straight wire between two bodies at their COMs: its ends are their coordinates."""
    rng = np.random.default_rng([31, seed])
    raw = scenes.fibred(scenes.single(rng), ribbons=seed % 2 == 1)
    design = scenes.design_of(raw)
    scene = registry.BEAM.completed(scenes.scene_of(raw), design)
    fibre = scene.fibres.wire[0]
    length, tension = (float(v[0]) for v in (scene.wires.length, scene.wires.tension))
    omega = 2 * np.pi * np.geomspace(0.03, 3e3, 7)
    strand = TautWire(fibre, tension, massive, lossy=True)
    moving = strand.at(omega)
    geometry = np.zeros((1, 1, 25))
    geometry[0, 0, :6] = [0.0, 0.0, -1.0, 1.0, 0.0, 0.0]
    stiffness = 1 / sum(section.length / section.stretching for section in fibre.sections)
    geometry[0, 0, 21:] = [length, tension, stiffness, 0.0]
    one = registry.BEAM.in_equilibrium(stack_scenes([scene]), design)[2][0]
    angles, slopes, drag = (part[..., :1, :, :] for part in one._losses(omega))
    place = np.array([[*range(12), 12, 12, 12]])
    dynamic = np.zeros((7, 12, 12), dtype=complex)
    compliance = np.zeros((7, 1), dtype=complex)
    compiled_wire.add_dynamic(
        np.zeros(7, dtype=np.int64),
        constant(omega),
        np.arange(7),
        compiled_wire.WireArrays(place, one.sections[:1], geometry),
        compiled_wire.Losses(*map(np.ascontiguousarray, (angles, slopes, drag))),
        massive,
        dynamic,
        compliance,
    )
    # along x (slopes: a rotation by t about y turns -z to -x, so w' = -t)
    rows = np.ix_([0, 4, 6, 10], [0, 4, 6, 10])
    sign = np.array([1.0, -1.0, 1.0, -1.0])
    part = moving.stiffness("bend-1") - strand.resting("bend-1")
    expected = np.moveaxis(joined_sections.to_ends(part), -1, 0)
    found = dynamic[:, rows[0], rows[1]] * sign[:, None] * sign
    size = np.abs(np.moveaxis(joined_sections.to_ends(moving.stiffness("bend-1")), -1, 0))
    assert (np.abs(found - expected) <= 1e-12 * size.max((1, 2), keepdims=True)).all()
    stretch = moving.stiffness("stretch")
    assert compliance[:, 0] == pytest.approx(4 / (stretch[1, 1] - stretch[0, 0]), rel=1e-12)
    assert dynamic[:, 2, 2] == pytest.approx(stretch[0, 0] / 2, rel=1e-12)
    twist = np.moveaxis(moving.stiffness("twist") - strand.resting("twist"), -1, 0)
    form = np.array([[0.5, 0.5], [-0.5, 0.5]])
    assert dynamic[:, [[5], [11]], [5, 11]] == pytest.approx(form.T @ twist @ form, rel=1e-9)


def test_factors():
    """Against LAPACK, real and complex."""
    rng = np.random.default_rng(5)
    for kind in (float, complex):
        root = rng.normal(size=(9, 9)).astype(kind)
        if kind is complex:
            root += 1j * rng.normal(size=(9, 9)) / 3
        matrix = root @ root.T + 9 * np.eye(9)
        matrix[:4, 5:] = matrix[5:, :4] = 0.0
        right = rng.normal(size=9).astype(kind)
        factor, pivot = np.zeros((9, 9), dtype=kind), np.empty(9, dtype=kind)
        least = factorise(matrix, factor, pivot, np.empty(9, dtype=np.int64), 0, 0)
        assert least == pytest.approx(np.abs(pivot / np.diag(matrix)).min(), rel=1e-14)
        assert np.prod(pivot) == pytest.approx(np.linalg.det(matrix), rel=1e-12)
        x = right.copy()
        substitute(factor, x)
        assert x == pytest.approx(np.linalg.solve(matrix, right), rel=1e-12)
