"""What is kept of references is what they are."""

from __future__ import annotations

import numpy as np
import pytest

from tests.analyses.xcouple import test_xcouple
from tests.elements import test_joined_sections, test_tensioned_beam
from tests.support import beam_mp, references

USERS = (test_tensioned_beam, test_joined_sections, test_xcouple)
"""Imported, they say which functions there are."""
SKIPPED = "test_joined_sections.held_resonances"
"""Half a minute; that they are where the determinant changes its sign is looked at instead."""


def same(one, other):
    """To the digits that are kept."""
    if isinstance(one, list):
        return len(one) == len(other) and all(same(a, b) for a, b in zip(one, other, strict=True))
    return abs(one - other) <= 1e-28 * abs(one)


@pytest.mark.parametrize("name", sorted(references.KEPT))
def test_kept_references_are_those_worked_out_now(name):
    """One of each kind at random, the same every time."""
    kept = references.stored(name)
    assert kept, (
        f"{name} has nothing in {references.DATA.name}: run python -m tests.support.references"
    )
    if name == SKIPPED:
        return
    arguments, value = kept[int(np.random.default_rng(2).integers(len(kept)))]
    found = references.numbers(references.plain(references.KEPT[name](*arguments)))
    assert same(found, value), (name, arguments)


def test_kept_resonances_are_where_the_determinant_changes_its_sign():
    kept = references.stored(SKIPPED)
    assert sorted(arguments[0] for arguments, _ in kept) == sorted(
        [list(part) for part in shape] for shape in test_joined_sections.STEPPED.values()
    )
    for (shape,), roots in kept:
        for root in (roots[0], roots[-1]):
            below, above = (
                beam_mp.transferred(
                    test_joined_sections.silica(shape),
                    test_joined_sections.TENSION,
                    root * (1 + off),
                )[1]
                for off in (-1e-10, 1e-10)
            )
            assert (below > 0) != (above > 0)
