"""A few mutated runs of `make mutations`: computed or refused in words."""

from __future__ import annotations

import pytest

from tools import mutations


@pytest.fixture(scope="module")
def valid(tmp_path_factory):
    return mutations.valid_files(tmp_path_factory.mktemp("valid"), ("modes", "response", "thermal"))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", mutations.KINDS)
def test_a_mutation_is_computed_or_refused(kind, seed, valid):
    code, problem = mutations.run(kind, f"{kind}-test-{seed}", valid)
    assert code in (0, 1, 2) and not problem


@pytest.mark.parametrize(
    ("code", "out", "err", "says"),
    [
        (1, "", "Traceback (most recent call last):", "traceback"),
        (-11, "", "", "crash"),
        (-14, "", "", "no end"),
        (2, "", "", "without a word"),
        (0, '{"q": NaN}', "", "NaN"),
        (0, "", "x.py:1: RuntimeWarning: overflow", "raw warning"),
    ],
)
def test_what_is_wrong_is_found(code, out, err, says, tmp_path):
    assert says in mutations.judge(code, out, err, tmp_path)


def test_a_file_written_in_spite_of_an_error_is_found(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "x.h5").touch()
    assert "wrote" in mutations.judge(2, "", "x: is wrong; correct it", tmp_path)
