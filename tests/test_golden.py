"""The numbers of every shipped design stay what they are (`make golden` regenerates them)."""

import json

import golden
import numpy as np
import pytest


@pytest.mark.parametrize("config", golden.configs(), ids=lambda path: path.stem)
def test_modes_are_the_golden_ones(config):
    expected = json.loads(golden.golden_path(config).read_text())
    found = golden.computed(config)
    assert found.keys() == expected.keys()
    assert found["auto"] == expected["auto"]
    for level in expected.keys() - {"auto"}:
        assert found[level]["home"] == expected[level]["home"]
        # omega^2 at 2e-9 is the frequency at 1e-9
        np.testing.assert_allclose(found[level]["omega_squared"], expected[level]["omega_squared"], rtol=2e-9, atol=0)


def test_every_golden_file_belongs_to_a_design():
    assert {golden.golden_path(config) for config in golden.configs()} == set(golden.GOLDEN.rglob("*.json"))
