"""Imperfect builds: where they hang, and what of vertical motion they turn into longitudinal, by every rung and method."""

from __future__ import annotations

from typing import Any

import numpy as np

from suspension_cli.analysis import builds, signals
from suspension_cli.analysis.coupling import FAINT
from suspension_cli.analysis.tradeoff import balance, exact
from suspension_cli.analysis.tradeoff.subject import COUPLING, K_FACTOR, OFFSET, Subject
from suspension_cli.conventions import SUPPORT
from suspension_cli.design import perturb
from suspension_cli.design.scene import Array, Scene
from suspension_cli.mechanics import assemble, equilibrium
from suspension_cli.mechanics.blocks import mirrored
from suspension_cli.mechanics.equilibrium import Equilibrium
from suspension_cli.models import fidelity
from suspension_cli.models.surroundings import surrounded

BUILDS = 256
"""In a batch."""
SMALL = 1e-3
"""Share of the imperfection over which the slope of the coupling is taken: what is of third order in it is a millionth."""


def spoilt(subject: Subject, share: Any = 1.0) -> Scene:
    """The design with a share of the imperfection, or with each of many: (p,), or (p, 2) for stiffness and place apart."""
    amount = np.asarray(share, dtype=float)
    stiffer, moved = (amount[..., 0], amount[..., 1]) if amount.ndim == 2 else (amount, amount)
    offset = moved[..., None] * np.array([OFFSET, 0.0, 0.0])
    return perturb.wire(subject.scene, subject.wire, k_factor=1 + (K_FACTOR - 1) * stiffer, upper_offset=offset)


def shares() -> Array:
    """What a batch is made of."""
    return np.linspace(0.1, 1.0, BUILDS)


def no_wire(subject: Subject) -> str:
    """Why there is nothing to spoil; empty if there is."""
    return "" if subject.wire >= 0 else "the last stage hangs on no wire"


def unhung(subject: Subject, rungs: tuple[str, ...] = ("string",)) -> str:
    """Why builds with the least or the whole imperfection do not hang on a rung that holds for the design; empty if they do on all."""
    least_and_most = shares()[[0, -1]]
    for rung in rungs:
        if not subject.unsuited[rung]:
            status = builds.balance(spoilt(subject, least_and_most), subject.design, level=rung).status
            if status.any():
                return f"with the imperfection, on {rung}, {builds.STATUS[int(status.max())]}"
    return ""


def uncoupled(subject: Subject) -> str:
    """Why there is no coupling to compare; empty if there is."""
    if no_wire(subject) or unhung(subject):
        return no_wire(subject) or unhung(subject)
    size = float(np.abs(string_reference(subject))[0])
    return "" if size > FAINT else f"the imperfection couples nothing ({size:.0e} is rounding)"


def incomparable(subject: Subject) -> str:
    """Why there is no coupling to compare on all rungs; empty if there is."""
    return uncoupled(subject) or unhung(subject, ("beam", "violin"))


def fails(rung: str) -> Any:
    """What tells why a rung does not hold for the imperfect design; empty if it does."""
    return lambda subject: subject.imperfect.unsuited[rung]


def reference(subject: Subject) -> Any:
    """The ratio (1,) on the top rung in the pose that it hangs in, its matrices solved in 50 digits."""
    return _exact(subject, subject.imperfect.top)


def string_reference(subject: Subject) -> Any:
    """The same on the string rung."""
    return _exact(subject, "string")


def _exact(subject: Subject, rung: str) -> Any:
    model = fidelity.linear_model(subject.imperfect.design, rung)
    into, out = subject.coupled(model)
    drive, (over, under) = signals.row(into, model), (signals.row(signal, model) for signal in out)
    omega = 2 * np.pi * np.array([COUPLING])
    return exact.response(model, omega, drive, over) / exact.response(model, omega, drive, under)


def ratio(subject: Subject, found: builds.Builds) -> Any:
    """The ratio (p,) of builds."""
    known = (SUPPORT, *found.model.body)
    into = signals.drive("support.z", known)
    out = subject.coupled(found.model)[1]
    moved = builds.transfer(found, np.array([COUPLING]), [into], out)[:, 0, :, 0]
    return moved[:, 0] / moved[:, 1]


def rebuilt(subject: Subject, share: Any, rung: str = "string") -> Any:
    """Every build balanced: what `pendsus xcouple` does."""
    return ratio(subject, builds.balance(spoilt(subject, share), subject.design, level=rung))


def on_rung(rung: str) -> Any:
    """The same on a rung."""
    return lambda subject, share: rebuilt(subject, share, rung)


def stepped(subject: Subject, share: Any, steps: int) -> Any:
    """Every build in the pose that so many Newton steps from the nominal one lead to."""
    scene = spoilt(subject, share)
    found = equilibrium.stepped(scene, steps)
    model = surrounded(assemble.linear_model(scene, found, split=False), subject.design)
    status = np.full(scene.batch, builds.GOOD, dtype=np.uint8)
    turned = builds.oriented(model, found)
    return ratio(subject, builds.Builds(turned, status, np.full(scene.batch, -1, dtype=np.int16), found.residual, mirrored(scene)))


def slopes(subject: Subject) -> Any:
    """First order: the ratio without imperfection, and its slope (2,) with stiffness and place of the wire."""
    unit = SMALL * np.eye(2)
    found = rebuilt(subject, np.concatenate([np.zeros((1, 2)), unit, -unit]))
    return found[0], (found[1:3] - found[3:5]) / (2 * SMALL)


def perturbed(subject: Subject, share: Any) -> Any:
    """Coupling linear in the imperfection."""
    level, slope = slopes(subject)
    amount = np.stack([share, share], axis=-1)
    return level + amount @ slope


def in_nominal_pose(subject: Subject, share: Any) -> Any:
    """As if the imperfection moved nothing."""
    return stepped(subject, share, 0)


def in_linear_pose(subject: Subject, share: Any) -> Any:
    """In the pose that the linear solution gives."""
    return stepped(subject, share, 1)


def one(solve: Any) -> Any:
    """A method on the string rung, for one build."""
    return lambda subject: solve(subject, np.ones(1))


def batch(solve: Any) -> Any:
    """The same for many."""
    return lambda subject: lambda: solve(subject, shares())


# From here on: the equilibrium itself.


def unbalanced(subject: Subject) -> str:
    """Why the equilibrium is not compared; empty if it is."""
    if no_wire(subject):
        return no_wire(subject)
    if subject.scene.springs.label or subject.scene.wires.torsion.any():
        return "springs and the torsion of wires are not written down in 50 digits"
    if unhung(subject):
        return unhung(subject)
    return "" if balance.settled(spoilt(subject)) is not None else "its equilibrium is not unique to 50 digits (a body is free to turn)"


def where(found: Equilibrium) -> Any:
    """Displacements, turns and tensions of a pose."""
    return np.array(found.pose.shift), found.pose.rotation - np.eye(3), np.array(found.tension)


def hung(subject: Subject) -> Any:
    """The same in 50 digits."""
    return balance.settled(spoilt(subject))


def apart(_: Subject, found: Any, wanted: Any) -> dict[str, float]:
    """Largest errors of displacements, turns and tensions, over the largest of each (if it is not 0)."""
    return {name: _largest(a - b) / (_largest(b) or 1.0) for name, a, b in zip(("position", "rotation", "tension"), found, wanted, strict=True)}


def _largest(values: Any) -> float:
    return float(np.abs(values).max())


def steps(count: int) -> tuple[Any, Any]:
    """So many Newton steps from the nominal pose: 1 is the linear solution."""
    return (
        lambda subject: where(equilibrium.stepped(spoilt(subject), count)),
        lambda subject: lambda: equilibrium.stepped(spoilt(subject, shares()), count),
    )


def full() -> tuple[Any, Any]:
    """Newton to the end, finite rotations: what every rung from `string` on does."""
    return (lambda subject: where(equilibrium.solve(spoilt(subject)))), (lambda subject: lambda: equilibrium.solve(spoilt(subject, shares())))
