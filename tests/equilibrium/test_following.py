"""Every build that can hang does: the equilibrium of imperfect triples against following it from
the nominal pose."""

import numpy as np

from suspension_cli.design import reader
from suspension_cli.equilibrium import solve as equilibrium
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.scene.pose import nominal_pose
from suspension_cli.studies import sampling
from tests.support.golden import CONFIGS


def followed(scene, chosen, values, steps):
    """The imperfections grow from nothing; each pose starts from the last."""
    pose = None
    for share in np.arange(1, steps + 1) / steps:
        part = sampling.imperfect(scene, chosen, share * values)
        found = equilibrium.solve(part, start=pose or nominal_pose(part))
        pose = found.pose
    return found


def test_all_builds_hang_where_following_leads():
    """Also those that Newton's method alone sends elsewhere."""
    design = reader.parse((CONFIGS / "triple-tolerance.toml").read_text())
    scene = expand(design)
    chosen = sampling.factors(design, scene)
    values = sampling.deviations(chosen, sampling.uniforms(7, 0, 600, len(chosen)))
    found, expected = (
        equilibrium.solve(sampling.imperfect(scene, chosen, values)),
        followed(scene, chosen, values, 12),
    )
    assert found.converged.all() and expected.converged.all()
    assert (found.tension > 5.0).all()
    np.testing.assert_allclose(found.pose.shift, expected.pose.shift, atol=1e-10)
    np.testing.assert_allclose(found.tension, expected.tension, rtol=1e-8)
