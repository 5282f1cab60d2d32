"""Connected components against scipy's."""

import numpy as np
import pytest
from scipy.sparse.csgraph import connected_components

from suspension_cli.elimination import connected_groups


@pytest.mark.parametrize("density", [0.0, 0.02, 0.05, 1.0])
@pytest.mark.parametrize("count", [0, 1, 7, 70])
def test_groups_are_the_weak_components_of_a_directed_graph(count, density):
    linked = np.random.default_rng(1).random((count, count)) < density
    groups = connected_groups(linked)
    number, label = connected_components(linked, directed=True, connection="weak")
    assert len(groups) == number
    assert [group.tolist() for group in groups] == [
        np.flatnonzero(label == label[group[0]]).tolist() for group in groups
    ]
    assert [group[0] for group in groups] == sorted(group[0] for group in groups)
