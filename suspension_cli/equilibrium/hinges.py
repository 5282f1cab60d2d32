"""Strings between effective hinges, by which models without bending approximate wires.

A wire of bending stiffness E I under the tension T bends over the length u = sqrt(E I / T) from its
clamp; farther away it hangs as a string from a point u below the clamp (Gonzalez and Saulson, J.
Acoust. Soc. Am. 96, 207 (1994)). A string between these points has the static stiffness of a
uniform round wire against displacement and rotation of its ends, but for a fraction of the order of
exp(-l / u): T / (l - 2 u), T u / (1 - 2 u / l) and T u (l - u) / (l - 2 u). It omits necks, a
ribbon's stiff plane, torsion, and loss where a wire bends.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from suspension_cli.design import materials
from suspension_cli.design.schema import Design
from suspension_cli.design.wires import stretches
from suspension_cli.equilibrium.hanging import hang, lengthened
from suspension_cli.errors import Fault, InputError
from suspension_cli.scene.scene import Scene

LARGEST = 0.5
"""Largest fraction of a wire that its two bends may take."""


def hinge_rigidities(design: Design) -> tuple[tuple[float, float], ...]:
    """E I (N m^2, soft plane) at the upper and lower end of each wire; 0 where it is not hinged.

    Empty if no wire is hinged.
    """
    tables = [
        table
        for stage in design.stage
        for table in ([stage.wires] * stage.wires.count if stage.wires else stage.wire)
    ]
    if all(table.bending is None for table in tables):
        return ()
    result = []
    for table in tables:
        if table.bending is None:
            result.append((0.0, 0.0))
            continue
        pieces = stretches(table, 1.0)
        ends = []
        for piece in (pieces[0], pieces[-1]):
            modulus = materials.resolve(design, piece.material or "").youngs_modulus
            assert modulus is not None
            ends.append(modulus * min(piece.shape.moments, key=lambda value: value.real))
        result.append((ends[0], ends[1]))
    return tuple(result)


def to_hinges(scene: Scene, rigidity: tuple[tuple[float, float], ...]) -> Scene:
    """Move the ends of hinged wires by sqrt(E I / T) along them, with T of the nominal pose.

    Ends stay where that pose is solved for and does not exist.

    Raises
    ------
    InputError
        If the bends would take more than `LARGEST` of a wire.
    """
    if not rigidity:
        return scene
    nominal = scene.drawn or scene
    hanging = hang(nominal) if scene.solves_pose else None
    at = hanging or nominal.wires
    hinged = np.array(rigidity).any(-1) & ~np.isnan(at.tension)
    u = np.sqrt(np.array(rigidity) / at.tension[..., None])
    taken = np.where(hinged, np.real(u.sum(-1) / at.length), 0.0)
    if taken.max() > LARGEST:
        worst = int(np.argmax(taken.reshape(-1, taken.shape[-1]).max(0)))
        label = scene.wires.label[worst]
        problem = f"the bends of wire {label} take {taken.max():.0%} of it, too much for a string"
        remedy = 'remove bending = "hinged" and use --fidelity beam'
        raise InputError([Fault(f"stage.{label.rsplit('.', 1)[0]}", problem, remedy)])

    def moved(one: Scene) -> Scene:
        return replace(one, wires=lengthened(one.wires, -u, hinged, hanging))

    return replace(moved(scene), drawn=None if scene.drawn is None else moved(scene.drawn))
