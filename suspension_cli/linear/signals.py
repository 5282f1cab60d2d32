"""Input and output signals by name: ``support.x``, ``test.x@0,0,-0.001``, ``upper.force_x``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.conventions import BETWEEN, DOFS, FRAME, GROUND, SUPPORT
from suspension_cli.design.faults import suggest
from suspension_cli.errors import InputError, format_value
from suspension_cli.linear.system import LinearSystem
from suspension_cli.rotations import cross_matrix

if TYPE_CHECKING:
    from jaxtyping import Inexact

FORCES = tuple(f"force_{dof}" for dof in DOFS[:3]) + tuple(f"torque_{dof}" for dof in DOFS[3:])
"""Names of forces and torques on a body, in the order of its coordinates."""


@dataclass(frozen=True)
class Signal:
    """Motion of a body (or of a point fixed in it), or force or torque on it.

    Attributes
    ----------
    text
        As the user wrote it.
    dof
        Index in `DOFS` of the motion, or of the motion that the force acts along.
    point
        From the COM in the body's frame, m.
    acts
        Whether it is a force or torque.
    against
        A second body, "" for none: the motion is relative to it, and the force acts on it with the
        opposite sign, at the same point of space.
    tilt
        Angle (rad) by which the direction of a motion along x rises above x.
    """

    text: str
    body: str
    dof: int
    point: tuple[float, float, float]
    acts: bool
    against: str = ""
    tilt: float = 0.0

    @property
    def is_ground(self) -> bool:
        """Whether it is a motion of the ground beside the support."""
        return self.body == GROUND

    @property
    def unit(self) -> str:
        """SI unit."""
        if self.acts:
            return "N" if self.dof < 3 else "N m"
        return "m" if self.dof < 3 else "rad"


def unit_of(text: str) -> str:
    """Return the SI unit of a signal by its name.

    >>> unit_of("test.pitch"), unit_of("upper.torque_yaw"), unit_of("test.x@0,0,0.001")
    ('rad', 'N m', 'm')
    """
    name = text.partition("@")[0].rpartition(".")[2]
    if name in FORCES:
        return "N" if FORCES.index(name) < 3 else "N m"
    return "rad" if name in DOFS[3:] else "m"


def bodies_with_signals(model: LinearSystem) -> tuple[str, ...]:
    """List bodies with signals: support and stages; frame and ground if there are any."""
    frame = (FRAME,) if any(name.startswith(f"{FRAME}.") for name in model.coordinate) else ()
    ground = (GROUND,) if model.ground is not None else ()
    return (SUPPORT, *model.body, *frame, *ground)


def local_control_signals(chain: Sequence[str]) -> tuple[list[str], list[str]]:
    """List the signals of local control of a chain of stages.

    Inputs are the motions of the support and the forces on the first stage, outputs the motions of
    the first and the last stage.
    """
    first = chain[0]
    last = chain[-1]
    inputs = [f"{SUPPORT}.{dof}" for dof in DOFS] + [f"{first}.{force}" for force in FORCES]
    return inputs, [f"{body}.{dof}" for body in dict.fromkeys((first, last)) for dof in DOFS]


def parse_input(text: str, known: tuple[str, ...], option: str = "--input") -> Signal:
    """Parse an input: a motion of the support or the ground, or a force or torque."""
    signal = parse(text, option, known)
    if not is_input(signal):
        remedy = f"give support.{DOFS[signal.dof]}, or {signal.body}.{FORCES[signal.dof]}"
        raise InputError.of(option, "a motion of a stage is an output", remedy, format_value(text))
    return signal


def is_input(signal: Signal) -> bool:
    """Whether a signal drives the suspension: a motion that is given, or a force."""
    return signal.acts or (signal.body in (SUPPORT, GROUND) and not signal.against)


def parse_output(text: str, known: tuple[str, ...], option: str = "--output") -> Signal:
    """Parse an output: a motion."""
    signal = parse(text, option, known)
    problem = ""
    remedy = ""
    if signal.acts:
        problem = "a force is an input"
        noise = f"'force noise {signal.text}:10'"
        remedy = f"give {signal.body}.{DOFS[signal.dof]}"
        remedy += f"; its thermal noise is the quantity {noise} of sweep --result"
    elif signal.is_ground:
        problem = "the ground's motion is an input"
        remedy = f"take a stage's motion, or give {signal.text} as an input"
    if problem:
        raise InputError.of(option, problem, remedy, format_value(text))
    return signal


def parse(text: str, option: str, bodies: tuple[str, ...]) -> Signal:
    """Parse the name of a signal of `bodies_with_signals`; `option` is for error messages."""
    name, at, where = text.partition("@")
    body, _, motion = name.rpartition(".")
    body, pair, against = body.partition(BETWEEN)
    acts = motion in FORCES
    problem = ""
    remedy = ""
    if pair and (fault := _second_fault(body, against, bodies)):
        problem, remedy = fault
    elif name in bodies:
        problem = "names a body, but no motion of it"
        remedy = f"write for example {name}.x; motions are {', '.join(DOFS)}"
    elif body not in bodies:
        problem = "names no body"
        remedy = _suggest_body(body or name, bodies)
    elif motion not in DOFS and not acts:
        problem = "names no motion or force"
        remedy = suggest(motion, [*DOFS, *FORCES])
    elif acts and body in (SUPPORT, GROUND):
        problem = f"the {body}'s motion is given, so a force on it has no effect"
        remedy = f"take {body}.x, or a force on a stage"
    point = _point(where) if at else (0.0, 0.0, 0.0)
    if not problem and point is None:
        problem = "is no point"
        remedy = "write three lengths in m, for example test.x@0,0,-0.001"
    if problem or point is None:
        raise InputError.of(option, problem, remedy, format_value(text))
    dof = (FORCES if acts else DOFS).index(motion)
    return Signal(text, body, dof, point, acts, against)


def _suggest_body(name: str, bodies: tuple[str, ...]) -> str:
    """Suggest the body that the user may have meant, or list all with an example."""
    stages = [body for body in bodies if body not in (SUPPORT, FRAME, GROUND)]
    hint = suggest(name, list(bodies))
    return hint if hint.startswith("did you mean") else f"{hint}; write for example {stages[-1]}.x"


def _second_fault(body: str, against: str, bodies: tuple[str, ...]) -> tuple[str, str] | None:
    """Check the second body of a signal between two: problem and remedy."""
    stages = [name for name in bodies if name not in (FRAME, GROUND)]
    if body == SUPPORT or body not in stages:
        remedy = suggest(body, [name for name in stages if name != SUPPORT])
        return "names no stage before the ~", remedy
    if against not in stages:
        return "names no stage or support after the ~", suggest(against, stages)
    if against == body:
        return "names one body twice", "write for example test~reaction.x"
    return None


def _point(where: str) -> tuple[float, float, float] | None:
    """Coordinates in m; None if these are no such."""
    try:
        x, y, z = (float(part) for part in where.split(","))
    except ValueError:
        return None
    return (x, y, z) if all(abs(value) < 1e5 for value in (x, y, z)) else None


def linear_form(signal: Signal, model: LinearSystem) -> Inexact[np.ndarray, "*batch coordinate"]:
    """Compute the linear form of a signal in the coordinates of a system.

    A point p of a body that moves by x and turns by t moves by x + t x p; a force at p acts on the
    coordinates by the same form (virtual work). Between two bodies it is the difference of their
    forms at one point of space; the support's includes the deflection of its structure.
    """
    if signal.tilt:
        level, up = (linear_form(replace(signal, dof=dof, tilt=0.0), model) for dof in (0, 2))
        return np.cos(signal.tilt) * level + np.sin(signal.tilt) * up
    if signal.against:
        return _relative_form(signal, model)
    turn = model.orientation
    shape = (model.size,)
    if turn is not None:
        shape = (*turn.shape[:-3], model.size)
    result = np.zeros(shape, dtype=float if turn is None else turn.dtype)
    if signal.body == FRAME:
        name = f"frame.{DOFS[signal.dof]}"
        if name not in model.coordinate:
            raise InputError.of(
                "--output",
                "the support structure is rigid in this direction",
                "give it a stiffness in [support.stiffness]",
                format_value(signal.text),
            )
        result[..., model.coordinate.index(name)] = 1.0
        return result
    body = 0 if signal.body in (SUPPORT, GROUND) else model.body.index(signal.body) + 1
    result[..., 6 * body + signal.dof] = 1.0
    if signal.dof < 3 and any(signal.point):
        point = np.array(signal.point)
        if turn is not None:
            point = turn[..., body, :, :] @ point
        result[..., 6 * body + 3 : 6 * body + 6] = -cross_matrix(point)[..., signal.dof, :]
    return result


def _relative_form(signal: Signal, model: LinearSystem) -> Inexact[np.ndarray, "*batch coordinate"]:
    """Compute the linear form of a signal between two bodies."""
    own = linear_form(replace(signal, against=""), model)
    rigid = model.rigid
    if rigid is None:
        problem = "signals between two bodies need a general model"
        raise InputError.of(signal.text, problem, "rerun with --fidelity string", None)
    first = model.body.index(signal.body) + 1
    second = 0 if signal.against == SUPPORT else model.body.index(signal.against) + 1
    point = np.array(signal.point)
    if model.orientation is not None:
        point = model.orientation[..., first, :, :] @ point
    # a rigid motion t of the support moves a COM at r by t x r = -[r] t
    place = rigid[..., 6 * first : 6 * first + 3, 3:] - rigid[..., 6 * second : 6 * second + 3, 3:]
    other = np.zeros((*np.broadcast_shapes(point.shape[:-1], place.shape[:-2]), 6))
    other = other.astype(np.result_type(point, place))
    other[..., signal.dof] = 1.0
    if signal.dof < 3:
        other[..., 3:] = (place - cross_matrix(point))[..., signal.dof, :]
    result = np.broadcast_to(own, (*other.shape[:-1], model.size)).astype(
        np.result_type(own, other)
    )
    result[..., 6 * second : 6 * second + 6] -= other
    if second == 0:
        for n, dof in enumerate(DOFS):
            if f"{FRAME}.{dof}" in model.coordinate:
                result[..., model.coordinate.index(f"{FRAME}.{dof}")] -= other[..., n]
    return result
