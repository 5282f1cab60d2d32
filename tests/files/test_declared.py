"""Records with fields of every kind: what is stored, read again, and refused."""

from __future__ import annotations

import io
import re
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import h5py
import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.files import stored
from suspension_cli.files.declared import (
    ATTRIBUTE,
    AXES,
    INLINE,
    NOT_STORED,
    along,
    derived,
    in_unit,
    scale_of,
)
from suspension_cli.studies.job import Axis
from tests.support.designs import TEXTS

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Int


@dataclass(frozen=True)
class Peak:
    size: Float[np.ndarray, " output"] = field(metadata=in_unit("{unit}"))
    at: float


@dataclass(frozen=True)
class Row:
    name: str
    number: int
    known: bool
    time: float = field(metadata=in_unit("s"))


@dataclass(frozen=True)
class Curve:
    frequency: Float[np.ndarray, " frequency"] = field(metadata=in_unit("Hz"))
    value: Complex[np.ndarray, " frequency"] = field(metadata=in_unit("{unit}/Hz^0.5"))
    unit: str


@dataclass(frozen=True)
class Everything:
    axes: tuple[Axis, ...] = field(metadata=AXES)
    label: tuple[str, ...] = field(metadata=scale_of("output"))
    unit: tuple[str, ...] = field(metadata=along("output"))
    value: Float[np.ndarray, "*axes output"] = field(metadata=in_unit("{unit}^2"))
    status: Int[np.ndarray, "*axes"]
    free: Bool[np.ndarray, " mode"]
    largest: Peak | None
    row: tuple[Row, ...] = field(metadata=along("row") | INLINE)
    curve: tuple[Curve | None, ...]
    ends: tuple[tuple[float, float], ...] = field(metadata=in_unit("Hz", "interval end"))
    drawn: tuple[float, ...]
    words: tuple[str, ...] = field(metadata=ATTRIBUTE)
    title: str
    count: int
    stable: bool
    hidden: int = field(default=0, metadata=NOT_STORED)

    @property
    @derived("{unit}")
    def root(self) -> Float[np.ndarray, "*axes output"]:
        return np.sqrt(self.value)


def everything(units=("m", "rad"), **change) -> Everything:
    curve = Curve(np.array([1.0, 2.0]), np.array([1j, 2.0]), "m")
    made = Everything(
        axes=(Axis("k", (0.5, 1.0, 1.5)), Axis("stage.a b/c.wires.l", (0.4, 0.5))),
        label=("test.x", "test.pitch"),
        unit=units,
        value=np.arange(12.0).reshape(3, 2, 2),
        status=np.ones((3, 2), dtype=np.uint8),
        free=np.array([True, False, True]),
        largest=Peak(np.array([1.0, np.inf]), np.nan),
        row=(Row("a", 1, True, 0.5), Row("b", -1, False, np.nan)),
        curve=(None, curve, replace(curve, unit="rad")),
        ends=((1.0, 2.0),),
        drawn=(1.0, np.nan),
        words=("one", "two"),
        title="Überschrift",
        count=3,
        stable=False,
        hidden=7,
    )
    return replace(made, **change)


def written(record):
    file = h5py.File(io.BytesIO(), "w")
    stored.write(file.create_group("group"), record)
    return file["group"]


EMPTY = {
    "ends": (),
    "drawn": (),
    "words": (),
    "row": (),
    "curve": (),
    "free": np.zeros(0, dtype=bool),
    "largest": None,
}


@pytest.mark.parametrize("change", [{}, EMPTY], ids=["full", "empty"])
def test_a_record_is_read_as_it_was_stored(change):
    record = everything(**change)
    group = written(record)
    again = stored.read(group, Everything)
    assert again.hidden == 0 and repr(replace(again, hidden=7)) == repr(record)
    assert repr(stored.read(written(again), Everything)) == repr(again)


def test_names_scales_and_units():
    group = written(everything())
    assert [axis.label for axis in group["value"].dims] == ["k", "stage.a_b_c.wires.l", "output"]
    assert group["output"].is_scale and group["output"].asstr()[0] == "test.x"
    assert group["mode"][:].tolist() == [1, 2, 3]
    assert group["largest/size"].dims[0][0] == group["output"]
    assert group["value"].attrs["units"] == "{unit}^2"
    assert group["curve/3/value"].attrs["units"] == "rad/Hz^0.5"
    assert sorted(group["curve"]) == ["2", "3"]
    assert group["stage.a_b_c.wires.l"].attrs["units"] == "m" and group["k"].attrs["units"] == "1"
    equal = written(everything(units=("m/s", "m/s")))
    assert equal["value"].attrs["units"] == "(m/s)^2"
    assert equal["root"].attrs["units"] == "m/s"


def replaced(name, data):
    def change(group):
        del group[name]
        group[name] = data

    return change


DAMAGE = {
    "value": (replaced("value", np.zeros((3, 2, 3))), "value has 3 values where output has 2"),
    "root": (replaced("root", np.zeros((3, 2))), "root has 2 dimensions, not 3"),
    "text for numbers": (replaced("status", "x"), "status has values of another type"),
    "numbers for text": (replaced("unit", np.zeros(2)), "unit has values of another type"),
    "real": (replaced("curve/2/value", np.array([True, False])), "values of another type"),
    "axis": (replaced("k", np.array([0.5, np.nan, 1.5])), "k is no list of finite numbers"),
    "scale": (replaced("curve/2/frequency", np.array([1.0, np.inf])), "not finite"),
    "columns": (replaced("known", np.array([True])), "known has 1 values where row has 2"),
    "attribute": (lambda group: group.attrs.__setitem__("count", 1.5), "count is not of type int"),
    "missing": (lambda group: group.attrs.pop("title"), "title"),
    "no group": (replaced("largest", np.zeros(2)), "largest is no group"),
    "no dataset": (lambda group: group.pop("free"), "free"),
}


@pytest.mark.parametrize("kind", DAMAGE)
def test_what_does_not_fit_the_declaration_is_refused(kind):
    change, message = DAMAGE[kind]
    group = written(everything())
    change(group)
    with pytest.raises((ValueError, KeyError), match=message):
        stored.read(group, Everything)


UNIT = r"(?:[A-Za-z%]+|1|[\^/ ().-]|\d)+"
"""What a unit that pint reads consists of here."""


@pytest.mark.parametrize(
    "made",
    [
        lambda d: sus.modes(d, fidelity="string"),
        lambda d: sus.response(d, outputs=["test.x", "test.pitch"], frequency=[1.0, 2.0]),
        lambda d: sus.thermal(d, outputs=["test.x", "test.pitch"], frequency=[1.0, 2.0]),
        lambda d: sus.sensitivity(d, results=["test yaw", "test.x/support.x:1"]),
        lambda d: sus.xcouple(d, sweep={"k": [0.9, 1.1], "offset": [0.0, 1e-3]}),
        lambda d: sus.sweep(d, vary={"stage.test.wires.l": [0.3, 0.4]}, results=["test yaw"]),
    ],
)
@pytest.mark.filterwarnings("ignore::suspension_cli.errors.PendsusWarning")
def test_labelled_arrays_have_units_and_plain_names(made):
    table = made(sus.parse(TEXTS["double"])).to_xarray()
    assert not any(re.search(r"\s", str(name)) for name in (*table.variables, *table.dims))
    for name, one in table.variables.items():
        if one.dtype.kind in "OU":
            assert not one.attrs, name
        elif "units_in" in one.attrs:
            assert set(re.findall(r"{(\w+)}", one.attrs["units_in"])) <= set(table.variables)
        else:
            assert re.fullmatch(UNIT, one.attrs["units"]), name
