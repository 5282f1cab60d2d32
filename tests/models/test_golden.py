"""The numbers of every shipped design, and what commands give out, stay what they are (`make
golden` regenerates them)."""

from __future__ import annotations

import json

import numpy as np
import pytest

from tests.support import golden

RELATIVE = {
    "estimated_error": 1e-2,
    "q": 1e-5,
    "dilution": 1e-6,
    "quantiles": 1e-6,
    "std_hz": 1e-6,
    "leading": 1e-9,
}
"""How far numbers may be off by name, relative to each, and all others by `OTHERWISE`."""
OTHERWISE = 1e-7
ABSOLUTE = {"fraction": 1e-7, "top_mass_fraction": 1e-7, "leading": 1e-9}
"""What may be rounding around 0: also so much."""
PAIRS = {
    "real": "imag",
    "ratio_real": "ratio_imag",
    "matrix_real": "matrix_imag",
    "real_per_s": "imag_per_s",
}
"""Parts of complex numbers, relative to whose size they are compared."""


def assert_close(found, expected, name=""):
    """The same names, words and whole numbers, and numbers alike."""
    if isinstance(expected, dict):
        assert found.keys() == expected.keys(), name
        for key, value in expected.items():
            if key in PAIRS:
                one, other = (
                    np.array(part[key], dtype=float) + 1j * np.array(part[PAIRS[key]], dtype=float)
                    for part in (found, expected)
                )
                np.testing.assert_allclose(one, other, rtol=OTHERWISE, atol=0, err_msg=key)
            elif key not in PAIRS.values():
                assert_close(found[key], value, key)
    elif isinstance(expected, list):
        assert len(found) == len(expected), name
        if name == "leading":  # two correlations that are alike may change places
            found, expected = (sorted(value for _, value in items) for items in (found, expected))
        for one, other in zip(found, expected, strict=True):
            assert_close(one, other, name)
    elif isinstance(expected, float) and isinstance(found, (int, float)):
        assert found == pytest.approx(
            expected, rel=RELATIVE.get(name, OTHERWISE), abs=ABSOLUTE.get(name, 0.0)
        ), name
    else:
        assert found == expected, name


ROUNDED = ("arm-cavity", "pulled-fibres", "reaction-chain", "tower")
"""Designs with couplings that would be 0 by symmetry but for rounding, which differs from one
processor to the next: they are compared to 1e-14 of the largest response, the accuracy that
`tests/linear/test_response_accuracy.py` finds. Others are 0 exactly, or known to all digits."""


@pytest.mark.parametrize("config", golden.configs(), ids=lambda path: path.stem)
def test_models_are_the_golden_ones(config):
    expected = json.loads(golden.golden_path(config).read_text())
    found = golden.computed(config)
    assert found.keys() == expected.keys()
    assert found["auto"] == expected["auto"]
    for level in expected.keys() - {"auto", "violin"}:
        # omega^2 at 2e-9 is the frequency at 1e-9
        square = np.array(expected[level]["omega_squared"])
        np.testing.assert_allclose(found[level]["omega_squared"], square, rtol=2e-9, atol=0)
        # modes of one frequency may change places
        group = np.cumsum(np.concatenate([[0], np.diff(square) > 1e-6 * np.abs(square[1:])]))
        one, other = (
            sorted((int(n), *home) for n, home in zip(group, part[level]["home"], strict=True))
            for part in (found, expected)
        )
        assert one == other
    if "violin" in expected:
        assert found["violin"]["below"] == expected["violin"]["below"]
        one, other = (
            np.array(part["violin"]["real"]) + 1j * np.array(part["violin"]["imag"])
            for part in (found, expected)
        )
        rounding = 1e-14 if config.stem in ROUNDED else 1e-18
        limit = 1e-8 * np.abs(other) + rounding * np.abs(other).max()
        assert (np.abs(one - other) <= limit).all()


@pytest.mark.parametrize("name", golden.COMMANDS)
def test_commands_give_out_the_golden_numbers(name):
    assert_close(golden.given_out(name), json.loads(golden.command_path(name).read_text()))


def test_every_golden_file_belongs_to_something():
    assert golden.every_path() == set(golden.GOLDEN.rglob("*.json"))


@pytest.mark.parametrize(
    "change", [{"real": 1.0 + 1e-6}, {"q": 9.0}, {"missing": None}, {"modes": [1.0]}]
)
def test_differences_are_seen(change):
    document = {"real": 1.0, "imag": 1e-3, "q": 10.0, "modes": [1.0, 2.0], "fraction": 1e-12}
    assert_close({**document, "fraction": 2e-12, "imag": 1e-3 + 1e-9}, document)
    with pytest.raises(AssertionError):
        assert_close({**document, **change}, document)
