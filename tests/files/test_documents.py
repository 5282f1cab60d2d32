"""JSON documents follow from the declarations of fields, and from the layout of their class."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest

from suspension_cli.files.declared import along, derived, in_unit
from suspension_cli.files.documents import Layout, as_json, document

if TYPE_CHECKING:
    from jaxtyping import Complex, Float


@dataclass(frozen=True)
class Peak:
    """One record among several."""

    in_json: ClassVar = Layout(also="double")
    size: float

    @property
    def double(self) -> float:
        """A property that no file has."""
        return 2 * self.size


@dataclass(frozen=True)
class Found:
    """A record with everything that a layout may change."""

    in_json: ClassVar = Layout(
        rows={"mode": "modes"},
        names={"label": "name", "both": "re im"},
        without="hidden",
        sparse="growth note",
    )
    frequency: Float[np.ndarray, " frequency"] = field(metadata=in_unit("Hz"))
    value: Complex[np.ndarray, " frequency"]
    both: Complex[np.ndarray, " frequency"]
    label: tuple[str, ...] = field(metadata=along("mode"))
    growth: Float[np.ndarray, " mode"] = field(metadata=in_unit("1/s"))
    part: Float[np.ndarray, "frequency mode"]
    peaks: tuple[Peak, ...] = field(metadata=along("mode"))
    hidden: str
    fine_frequency: Float[np.ndarray, " fine_frequency"]
    note: str | None = None
    remark: str | None = None

    @property
    @derived("rad")
    def tilt(self) -> float:
        """A stored property."""
        return np.inf


def test_rows_names_units_and_what_is_left_out():
    frequency = np.array([1.0, 2.0, 3.0])
    part = np.arange(6.0).reshape(3, 2)
    growth = np.array([0.0, 0.5])
    peaks = Peak(1.0), Peak(2.0)
    numbers = frequency * (1 + 2j)
    found = Found(frequency, numbers, numbers, ("a", "b"), growth, part, peaks, "x", frequency)
    assert as_json(document(found)) == {
        "frequency_hz": [1.0, 2.0, 3.0],
        "value_real": [1.0, 2.0, 3.0],
        "value_imag": [2.0, 4.0, 6.0],
        "re": [1.0, 2.0, 3.0],
        "im": [2.0, 4.0, 6.0],
        "modes": [
            {"name": "a", "part": [0.0, 2.0, 4.0], "size": 1.0, "double": 2.0},
            {
                "name": "b",
                "growth_per_s": 0.5,
                "part": [1.0, 3.0, 5.0],
                "size": 2.0,
                "double": 4.0,
            },
        ],
        "remark": None,
        "tilt_rad": None,
    }


@dataclass(frozen=True)
class Chosen:
    """A record that names all that JSON has."""

    in_json: ClassVar = Layout(
        only="peak parts ends closed peaks note",
        names={"ends": "low_hz high_hz", "peaks": "all"},
        sparse="closed note",
        flat="peak peaks",
    )
    hidden: float
    ends: tuple[float, float]
    peak: Peak
    peaks: tuple[Peak, ...]
    closed: bool = False
    note: str | None = None

    @property
    def parts(self) -> dict[str, Float[np.ndarray, " frequency"]]:
        """A property that no file has."""
        return {"a": np.array([1.0, np.nan])}


@pytest.mark.parametrize("closed", [False, True])
def test_chosen_keys_pairs_and_flat_records(closed):
    found = Chosen(0.0, (1.0, 2.0), Peak(1.0), (Peak(2.0), Peak(3.0)), closed=closed)
    made = as_json(document(found))
    given = {"closed": True} if closed else {}
    assert made == given | {
        "size": 1.0,
        "double": 2.0,
        "parts": {"a": [1.0, None]},
        "low_hz": 1.0,
        "high_hz": 2.0,
        "all": [{"size": 2.0, "double": 4.0}, {"size": 3.0, "double": 6.0}],
    }
    assert list(made)[:4] == ["size", "double", "parts", "low_hz"]


def test_several_records_are_flat_if_there_is_only_one():
    found = Chosen(0.0, (1.0, 2.0), Peak(1.0), (Peak(2.0),), note="x")
    made = document(found)
    assert made["size"] == 2.0
    assert made["note"] == "x"
    assert "all" not in made
