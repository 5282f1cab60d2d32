"""Every build that can hang does: the equilibrium of imperfect triples against following it from
the nominal pose."""

import numpy as np
import pytest

from suspension_cli.design import reader
from suspension_cli.equilibrium import solve as equilibrium
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.scene.pose import layout, nominal_pose
from suspension_cli.studies import sampling
from suspension_cli.studies.sampling import uniforms
from tests.support.golden import CONFIGS

TEXT = (CONFIGS / "triple-tolerance.toml").read_text()
COUNT = 600
SEED = 7


@pytest.fixture(scope="module")
def job():
    design = reader.parse(TEXT)
    scene = expand(design)
    chosen = sampling.factors(design, scene)
    return scene, chosen, sampling.deviations(chosen, uniforms(SEED, 0, COUNT, len(chosen)))


@pytest.fixture(scope="module")
def found(job):
    """Equilibria of all builds."""
    return equilibrium.solve(sampling.imperfect(*job))


@pytest.fixture(scope="module")
def lost(job):
    """Builds that send Newton's method elsewhere."""
    imperfect = sampling.imperfect(*job)
    alone = equilibrium._newton(
        imperfect, layout(imperfect), nominal_pose(imperfect), 0.0, 60, accept_nominal=True
    )
    return ~(alone.converged & (alone.tension > 0).all(-1))


def followed(scene, chosen, values, steps):
    """The imperfections grow from nothing; each pose starts from the last."""
    pose = None
    for share in np.arange(1, steps + 1) / steps:
        part = sampling.imperfect(scene, chosen, share * values)
        found = equilibrium.solve(part, start=pose or nominal_pose(part))
        pose = found.pose
    return found


def test_all_builds_hang_where_following_leads(job, found, lost):
    """Compared for those that Newton's method alone loses, and for every sixth."""
    scene, chosen, values = job
    assert found.converged.all()
    assert (found.tension > 5.0).all()
    some = lost | (np.arange(COUNT) % 6 == 0)
    expected = followed(scene, chosen, values[some], 12)
    assert expected.converged.all()
    np.testing.assert_allclose(found.pose.shift[some], expected.pose.shift, atol=1e-10)
    np.testing.assert_allclose(found.tension[some], expected.tension, rtol=1e-8)
