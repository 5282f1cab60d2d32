"""Pictures of modes: a few moving bodies of a tower are enlarged."""

from __future__ import annotations

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.analyses.modes import picture
from suspension_cli.drawing import geometry
from suspension_cli.equilibrium.nominal import expand_geometry


def make_panels(name):
    modes = sus.modes(sus.example(name), fidelity="string", damping="none")
    design = modes.run.design.design
    rest = geometry.sketch_at_rest(design, expand_geometry(design))
    numbers = range(len(modes.frequency))
    return modes, rest, {n: picture.make_panel(modes, n, rest) for n in numbers}


@pytest.mark.filterwarnings("ignore::suspension_cli.PendsusWarning")
def test_details_of_a_tower_show_the_bodies_that_move_most():
    modes, rest, panels = make_panels("built/kagra-typea")
    details = [panel for panel in panels.values() if panel.is_detail]
    assert 0 < len(details) < len(panels)  # in some modes the whole tower moves
    for panel in details:
        energy = modes.energy[panel.number].sum(-1)
        body = rest.scene.bodies.position[1 + int(energy.argmax())]
        at = panel.view.see(body)
        assert (panel.low < at).all() and (at < panel.high).all()
        assert np.max(panel.high - panel.low) < 0.3 * rest.size
    number = modes.label.index("TM pitch")
    assert panels[number].is_detail


def test_ordinary_suspensions_are_drawn_whole():
    _, _, panels = make_panels("quadruple")
    assert not any(panel.is_detail for panel in panels.values())
