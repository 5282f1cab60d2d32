"""Mechanisms of loss: which act in a material."""

from __future__ import annotations

import msgspec

from suspension_cli.design import materials
from suspension_cli.design.losses import Bulk, MaterialLoss, mechanisms_of


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
