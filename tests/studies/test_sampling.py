"""Steps of numbers of designs."""

from __future__ import annotations

import pytest

from suspension_cli.studies.parameters import natural_step


@pytest.mark.parametrize(
    ("path", "step"),
    [
        ("stage.test.wires.d", (1e-3, "mm")),
        ("stage.test.wires.sections.2.radius.1", (0.02, "%")),
        ("stage.wire.body.radius", (1e-3, "mm")),
        ("stage.test.blades.geometry.thickness", (0.02, "%")),
        ("perturbation.1.rotation.3", (1e-3, "mrad")),
        ("materials.steel302.loss_angle", (0.02, "%")),
        ("link.strap.strands.diameter", (0.02, "%")),
    ],
)
def test_steps_of_numbers(path, step):
    assert natural_step(path, 2.0) == step
