"""Signals by name: ``support.x``, ``test.pitch``, ``test.x@0,0,-0.001``, ``upper.force_x``, ``upper.torque_pitch``."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from suspension_cli.conventions import DOFS, SUPPORT
from suspension_cli.design.faults import suggestion
from suspension_cli.design.scene import Array
from suspension_cli.errors import Fault, InputError, shown
from suspension_cli.mechanics.model import LinearModel
from suspension_cli.rotations import cross_matrix

FORCES = tuple(f"force_{dof}" for dof in DOFS[:3]) + tuple(f"torque_{dof}" for dof in DOFS[3:])
"""Names of what can act on a body, in the order of its coordinates."""


@dataclass(frozen=True)
class Signal:
    """One motion of a body (or of a point fixed in it), or one force or torque on it.

    Attributes
    ----------
    text : str
        As the user wrote it.
    body : str
    dof : int
        Index in `DOFS` (of the motion, or that the force works on).
    point : tuple of float
        From the COM in the frame of the body, m.
    acts : bool
        Whether it is a force or torque.
    """

    text: str
    body: str
    dof: int
    point: tuple[float, float, float]
    acts: bool

    @property
    def unit(self) -> str:
        """SI unit."""
        if self.acts:
            return "N" if self.dof < 3 else "N m"
        return "m" if self.dof < 3 else "rad"


def bodies(model: LinearModel) -> tuple[str, ...]:
    """Names that a signal may begin with."""
    frame = ("frame",) if any(name.startswith("frame.") for name in model.coordinate) else ()
    return (SUPPORT, *model.body, *frame)


def everything(model: LinearModel) -> tuple[list[str], list[str]]:
    """The inputs and outputs of a local control problem: support and first stage; first and last stage."""
    first, last = model.body[0], model.body[-1]
    inputs = [f"{SUPPORT}.{dof}" for dof in DOFS] + [f"{first}.{force}" for force in FORCES]
    return inputs, [f"{body}.{dof}" for body in dict.fromkeys((first, last)) for dof in DOFS]


def drive(text: str, known: tuple[str, ...]) -> Signal:
    """A signal that can be an input: a motion of the support, or a force or torque."""
    signal = parse(text, "--input", known)
    if not signal.acts and signal.body != SUPPORT:
        remedy = f"give support.{DOFS[signal.dof]}, or {signal.body}.{FORCES[signal.dof]}"
        raise InputError([Fault("--input", "a motion of a stage is an output", remedy, shown(text))])
    return signal


def motion(text: str, known: tuple[str, ...]) -> Signal:
    """A signal that can be an output: a motion."""
    signal = parse(text, "--output", known)
    if signal.acts:
        raise InputError([Fault("--output", "a force is an input", f"give {signal.body}.{DOFS[signal.dof]}", shown(text))])
    return signal


def parse(text: str, option: str, bodies: tuple[str, ...]) -> Signal:
    """Read a signal's name.

    Parameters
    ----------
    text : str
    option : str
        The option that it was given to, for faults.
    bodies : tuple of str
        Names that are known: the support, the stages, and the frame if there is one.
    """
    name, at, where = text.partition("@")
    body, _, motion = name.rpartition(".")
    if body not in bodies:
        raise InputError([Fault(option, "names no body", suggestion(body or name, list(bodies)) + "; write for example test.x", shown(text))])
    if motion not in DOFS and motion not in FORCES:
        raise InputError([Fault(option, "names no motion or force", suggestion(motion, [*DOFS, *FORCES]), shown(text))])
    acts = motion in FORCES
    if acts and body == SUPPORT:
        raise InputError([Fault(option, "the support's motion is given, so no force moves it", "take support.x, or a force on a stage", shown(text))])
    return Signal(text, body, (FORCES if acts else DOFS).index(motion), _point(where, at, text, option), acts)


def _point(where: str, at: str, text: str, option: str) -> tuple[float, float, float]:
    if not at:
        return (0.0, 0.0, 0.0)
    try:
        x, y, z = (float(part) for part in where.split(","))
    except ValueError:
        x = y = z = math.nan
    if not all(math.isfinite(value) and abs(value) < 1e5 for value in (x, y, z)):
        raise InputError([Fault(option, "is no point", "write three lengths in m, for example test.x@0,0,-0.001", shown(text))])
    return (x, y, z)


def row(signal: Signal, model: LinearModel) -> Array:
    """The signal as a linear form (..., N) of the model's coordinates.

    A point at p moves by x + t x p; a force at p acts on the coordinates as the point moves with them.
    """
    turned = model.orientation
    result = np.zeros((*turned.shape[:-3], model.size), dtype=turned.dtype) if turned is not None else np.zeros(model.size)
    if signal.body == "frame":
        name = f"frame.{DOFS[signal.dof]}"
        if name not in model.coordinate:
            raise InputError(
                [Fault("--output", "the support structure is rigid in this direction", "give it a stiffness in [support.stiffness]", shown(signal.text))]
            )
        result[..., model.coordinate.index(name)] = 1.0
        return result
    body = 0 if signal.body == SUPPORT else model.body.index(signal.body) + 1
    result[..., 6 * body + signal.dof] = 1.0
    if signal.dof < 3 and any(signal.point):
        point = np.array(signal.point)
        if model.orientation is not None:
            point = model.orientation[..., body, :, :] @ point
        result[..., 6 * body + 3 : 6 * body + 6] = -cross_matrix(point)[..., signal.dof, :]
    return result
