"""Mechanisms of loss: their keys in the tables of the design file, and which act."""

from __future__ import annotations

from typing import Annotated

import msgspec
from msgspec import Meta

from suspension_cli.design import materials, wires
from suspension_cli.design.losses.bulk import Bulk
from suspension_cli.design.losses.mechanism import Mechanism, with_keys
from suspension_cli.design.losses.registry import MECHANISMS, mechanisms_of
from suspension_cli.design.schema import MaterialLoss
from suspension_cli.design.units import LossAngle, Table
from tests.support.commandline import run
from tests.support.paths import ROOT


class Rubbing(Mechanism):
    """One with a key in the tables of wires."""

    wire_keys = {"rubbing": Annotated[LossAngle, Meta(description="of its clamps")]}  # noqa: RUF012

    @classmethod
    def check_wire(cls, wire):
        if wire.k is None:
            yield "rubbing", "has no effect without k", "give k too"


def test_keys_go_to_their_tables():
    """Beside keys that a table requires; and not to other tables."""
    every = (*MECHANISMS, Rubbing)

    class Wire(with_keys(Table, every, of_wire=True)):
        length: float

    assert msgspec.convert({"length": 1.0, "rubbing": 1e-3}, Wire).rubbing == 1e-3
    assert msgspec.convert({"length": 1.0}, Wire).rubbing is None
    own = {key for kind in MECHANISMS for key in kind.keys}
    assert set(MaterialLoss.__struct_fields__) == own
    assert not hasattr(with_keys(Table, every, of_wire=False)(), "rubbing")


def test_a_mechanism_checks_its_keys_of_wires(tmp_path, monkeypatch):
    monkeypatch.setattr(wires, "MECHANISMS", (*MECHANISMS, Rubbing))
    result = run("modes", ROOT / "configs" / "husman2000" / "table1-case1.toml", "--out", tmp_path)
    assert result.exit_code == 2 and not list(tmp_path.iterdir())
    [line] = result.stderr.splitlines()
    assert line.endswith("stage.test.wires.rubbing: has no effect without k; give k too")


def test_a_material_has_the_mechanisms_whose_constants_are_known():
    found = {
        name: [own.name for own in mechanisms_of(of_built_in(name), None)]
        for name in ("steel302", "maraging", "fused-silica")
    }
    assert found["steel302"] == ["thermoelastic"]
    assert found["fused-silica"] == ["bulk", "thermoelastic"]
    bulk = mechanisms_of(of_built_in("fused-silica"), None)[0]
    assert bulk == Bulk(4.1e-10, surface_depth=1.5e-2)


def of_built_in(name: str) -> materials.Material:
    made = materials.BUILT_IN[name]
    return msgspec.structs.replace(made, loss=made.loss or MaterialLoss())
