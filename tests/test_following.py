"""Every build that can hang does: the equilibrium of imperfect triples against following it from the nominal pose."""

import numpy as np
import pytest
from golden import CONFIGS

from suspension_cli.analysis import builds, sampling
from suspension_cli.analysis.tolerance import Tolerances
from suspension_cli.design import reader
from suspension_cli.mechanics import equilibrium
from suspension_cli.mechanics.nominal import expand
from suspension_cli.mechanics.pose import layout, nominal_pose

TEXT = (CONFIGS / "triple-tolerance.toml").read_text()
COUNT = 600
SEED = 7


@pytest.fixture(scope="module")
def job():
    design = reader.parse(TEXT)
    scene = expand(design)
    chosen = sampling.factors(design, scene)
    return scene, chosen, sampling.deviations(chosen, SEED, 0, COUNT)


def followed(scene, chosen, values, steps):
    """The imperfections grow from nothing; each pose starts from the last."""
    pose = None
    for share in np.arange(1, steps + 1) / steps:
        part = sampling.imperfect(scene, chosen, share * values)
        found = equilibrium.solve(part, start=pose or nominal_pose(part))
        pose = found.pose
    return found


def test_all_builds_hang_where_following_leads(job):
    scene, chosen, values = job
    found = equilibrium.solve(sampling.imperfect(scene, chosen, values))
    assert found.converged.all()
    assert (found.tension > 5.0).all()
    expected = followed(scene, chosen, values, 12)
    assert expected.converged.all()
    np.testing.assert_allclose(found.pose.shift, expected.pose.shift, atol=1e-10)
    np.testing.assert_allclose(found.tension, expected.tension, rtol=1e-8)


def test_newton_alone_would_lose_some(job):
    """The reason for following: some of these builds send Newton's method elsewhere."""
    scene, chosen, values = job
    imperfect = sampling.imperfect(scene, chosen, values)
    numbering = layout(imperfect)
    alone = equilibrium._newton(imperfect, numbering, nominal_pose(imperfect), 0.0, 60, rest=True)
    lost = ~(alone.converged & (alone.tension > 0).all(-1))
    assert 0 < lost.sum() < 0.05 * COUNT


def test_one_build_by_itself_hangs_the_same(job):
    scene, chosen, values = job
    imperfect = sampling.imperfect(scene, chosen, values)
    numbering = layout(imperfect)
    alone = equilibrium._newton(imperfect, numbering, nominal_pose(imperfect), 0.0, 15, rest=True)
    together = equilibrium.solve(imperfect)
    for n in np.flatnonzero(~alone.converged)[:5].tolist():
        single = equilibrium.solve(sampling.imperfect(scene, chosen, values[n : n + 1]))
        np.testing.assert_array_equal(single.pose.shift[0], together.pose.shift[n])


def test_no_build_is_dropped():
    known = ("support", "upper", "middle", "test")
    from suspension_cli.analysis import signals
    from suspension_cli.analysis.coupling import Question

    over, under = (signals.motion(f"test.{dof}@0,0,-0.001", known) for dof in "xz")
    task = Tolerances(TEXT, COUNT, SEED, Question(0, 1, "", signals.drive("support.z", known), over, under, (50.0,)))
    assert (task.compute(0, COUNT)["status"] == builds.GOOD).all()
