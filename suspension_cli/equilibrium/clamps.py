"""Wires that bend: their clamps and their equilibrium, and the strings that stand for them.

Of some wires the design gives the effective bending points instead of the clamps. A wire whose far
end is displaced sideways acts on its clamp with a shear force V and a moment M, as if hinged at u =
M / V from there (sqrt(EI / T) for a long uniform wire; Gonzalez and Saulson, J. Acoust. Soc. Am.
96, 207 (1994)). So the clamps lie u beyond the bending points, in line with the wire, and the
forces that carry the weight do not change. For a ribbon u is that of its soft plane.

Tension, length and direction of a wire are those of the nominal suspension: imperfections do not
move its clamps. Where the design gives natural lengths, they are those of strings without torsion
between the bending points, in the pose that is solved for. The clamps are then fixed in their
bodies along these strings, and the unstretched wire is longer by both u, so that nothing depends on
where the file draws the bodies.

Models without bending take a string between the hinges of a wire, u from its clamps, instead
(``bending = "hinged"``). It has the static stiffness of a uniform round wire against displacement
and rotation of its ends, but for a fraction of the order of exp(-l / u): T / (l - 2 u), T u / (1 -
2 u / l) and T u (l - u) / (l - 2 u). It omits necks, a ribbon's stiff plane, torsion, and loss in
bends.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.design import materials
from suspension_cli.design.derive import gives_natural_lengths
from suspension_cli.design.kept_results import keep_last
from suspension_cli.design.schema import Design
from suspension_cli.design.wires import stretches
from suspension_cli.elements.bending import with_bending
from suspension_cli.elements.resting import hinge_distances, principal_planes, with_planes
from suspension_cli.equilibrium import solve as equilibrium
from suspension_cli.equilibrium.hanging import HangingWires, hang, lengthened
from suspension_cli.equilibrium.nominal import expand_nominal
from suspension_cli.equilibrium.solve import Equilibrium
from suspension_cli.errors import Fault, InputError
from suspension_cli.scene import fibres as fibres_of
from suspension_cli.scene.pose import Layout
from suspension_cli.scene.scene import Fibres, Scene, Section

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Inexact

ITERATIONS = 4
"""Iterations of the distance u from clamp to hinge; each reduces the change by u / l."""
ALONG_X = 1e-6
"""Squared sine of the angle to x below which the first plane of a wire is that of y."""
LARGEST = 0.5
"""Largest fraction of a wire that its two bends may take."""


def solve_bending(scene: Scene, numbering: Layout) -> tuple[Scene, Equilibrium]:
    """Find the equilibrium, not necessarily converged, of a scene whose wires bend.

    The scene has `fibres`, and at most one batch axis. Also returns it with wires between their
    clamps, and `flex` at the tensions and lengths in equilibrium.
    """
    scene, hanging = to_clamps(scene)
    at = () if hanging is None else (hanging.tension, hanging.length)
    drawn = scene.drawn and with_bending(scene.drawn, *at)
    if drawn is None or not scene.batch:
        scene = with_bending(scene, *at)
    # else the search takes the stiffness of builds at their own tensions
    scene = replace(scene, drawn=drawn)
    found = equilibrium.solve_once(scene, numbering, start=hanging and hanging.found.pose)
    if scene.batch and hanging is not None:
        # where the strings that define the clamps have no equilibrium, these are reported
        unknown = np.asarray(np.isnan(hanging.tension).any(-1))
        strings = hanging.found
        residual = np.where(unknown, strings.residual, found.residual)
        tension = np.where(unknown[..., None], strings.tension, found.tension)
        found = replace(found, residual=residual, tension=tension)
    if found.bend is not None:
        assert scene.flex is not None and found.twist is not None
        scene = replace(scene, flex=replace(scene.flex, bend=found.bend, twist=found.twist))
    return scene, found


def to_clamps(scene: Scene) -> tuple[Scene, HangingWires | None]:
    """Move the ends of wires from given bending points to their clamps, in `drawn` too.

    Also returns the wires of the nominal scene if its pose is solved for, with lengths between
    clamps. Raises `InputError` if a single scene has no such pose, or a wire is slack in it.
    """
    fibres = scene.fibres
    assert fibres is not None
    drawn = None if scene.drawn is None else replace(scene.drawn, fibres=fibres)
    nominal = drawn or scene
    hanging = None
    effective = np.array([fibre.effective for fibre in fibres.wire], dtype=bool)
    u: Any = 0.0
    if effective.any():
        hanging = hang(nominal) if scene.solves_pose else None
        u = _all_distances(nominal, hanging)

    def moved(one: Scene) -> Scene:
        if effective.any():
            one = replace(one, wires=lengthened(one.wires, u, effective, hanging))
        one = with_planes(one)
        return one if hanging is None else _with_hanging_planes(one, effective, hanging)

    scene = replace(moved(scene), drawn=None if drawn is None else moved(drawn))
    return scene, hanging and replace(hanging, length=hanging.length + u.sum(-1))


@keep_last
def compose(design: Design) -> Fibres:
    """List the composition of wires and blades, as `fibres.compose` does.

    The tension along wires with weight follows from the slope at which they hang.
    """
    made = fibres_of.compose(design)
    if not (gives_natural_lengths(design) and design.constants.wire_weight):
        return made
    try:
        nominal = expand_nominal(design)
        hanging = hang(nominal)
    except InputError:  # whoever needs its equilibrium reports it
        return made
    slopes = hanging.rise * nominal.wires.length / nominal.wires.span[..., 2]
    wires = (
        replace(
            fibre,
            sections=tuple(
                replace(own, tension_offset=own.tension_offset * slope) for own in fibre.sections
            ),
        )
        for fibre, slope in zip(made.wire, slopes.tolist(), strict=True)
    )
    return replace(made, wire=tuple(wires))


def _with_hanging_planes(
    scene: Scene, effective: Bool[np.ndarray, " wire"], hanging: HangingWires
) -> Scene:
    """Turn the principal planes of wires with bending points to their clamps in that pose."""
    flex = scene.flex
    assert flex is not None
    along_x = np.real(1 - hanging.upper[..., :1] ** 2) < ALONG_X
    across = np.where(along_x, np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0]))
    upper, lower = (
        np.where(effective[:, None, None], principal_planes(across, clamp), given)
        for clamp, given in ((hanging.upper, flex.upper), (hanging.lower, flex.lower))
    )
    return replace(scene, flex=replace(flex, upper=upper, lower=lower))


def _all_distances(
    nominal: Scene, hanging: HangingWires | None
) -> Inexact[np.ndarray, "*batch wire 2"]:
    """Distances of given bending points from their clamps, m; 0 for other wires."""
    fibres = nominal.fibres
    wires = nominal.wires
    assert fibres is not None
    shape = (*nominal.batch, len(wires.label))
    at = wires if hanging is None else hanging
    length, tension = (np.broadcast_to(v, shape) for v in (at.length, at.tension))
    result = np.zeros((*shape, 2))
    kinds = [fibre.sections if fibre.effective else None for fibre in fibres.wire]
    for sections in dict.fromkeys(kinds):
        if sections is not None:
            which = [n for n, kind in enumerate(kinds) if kind == sections]
            own = _hinge_distances(sections, length[..., which], tension[..., which])
            result[..., which, :] = own
    return result


def _hinge_distances(
    sections: tuple[Section, ...],
    length: Float[np.ndarray, "*batch wire"],
    tension: Float[np.ndarray, "*batch wire"],
) -> Float[np.ndarray, "*batch wire 2"]:
    """Distances of the hinges of wires from their clamps, m; `length` (m) is between hinges."""
    upper = lower = np.zeros_like(length)
    for _ in range(ITERATIONS):
        upper, lower = hinge_distances(sections, length + upper + lower, tension)
    return np.stack([upper, lower], axis=-1)


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
            made = materials.resolve(design, piece.material or "", piece.temperature)
            modulus = made.youngs_modulus
            assert modulus is not None
            ends.append(modulus * min(piece.shape.moments, key=lambda value: value.real))
        result.append((ends[0], ends[1]))
    return tuple(result)


def to_hinges(scene: Scene, rigidity: tuple[tuple[float, float], ...]) -> Scene:
    """Move the ends of hinged wires by sqrt(E I / T) along them, with T of the nominal pose.

    Ends stay where that pose is solved for and does not exist. Raises `InputError` if the bends
    would take more than `LARGEST` of a wire.
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
