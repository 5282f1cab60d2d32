"""Checks of `[[link]]`, `[[damper]]`, ... beyond single values."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

from suspension_cli.conventions import DOFS, FRAME, GROUND, SUPPORT
from suspension_cli.design.derive import com_positions, spring_loss
from suspension_cli.design.faults import fault_of, suggest
from suspension_cli.design.links import Damper, Link, Strands
from suspension_cli.design.schema import Design, Spring
from suspension_cli.design.units import Matrix6
from suspension_cli.errors import Fault, format_value

ROUNDING = 1e-9
"""Negative eigenvalue of a matrix, its diagonal scaled to 1, that is an error of its digits."""
BESIDE = (SUPPORT, GROUND)
"""Second bodies of a link or damper that are not stages."""


def check_links(design: Design, *, placed: bool) -> Iterator[Fault]:
    """Check all elements between two bodies; geometry only where the bodies are `placed`."""
    stages = [stage.name for stage in design.stage]
    taken = [*stages]
    items = design.between_bodies
    for kind, item in items:
        path = f"{kind}.{item.name}"
        if item.name in taken:
            problem = "is the name of another link, damper or stage"
            yield fault_of(item, path, "name", problem, "give each a name of its own")
        taken.append(item.name)
        yield from _check_between(item.between, stages, f"{path}.between")
    if GROUND in stages and any(GROUND in item.between for _, item in items):
        problem = "is the name of the ground, on which a link or damper ends"
        remedy = "give the stage another name"
        yield Fault(f"stage.{GROUND}.name", problem, remedy, format_value(GROUND))
    for link in design.link if placed else ():
        if link.strands is not None:
            yield from _check_strands(design, link, link.strands, f"link.{link.name}.strands")


def check_active(design: Design) -> Iterator[Fault]:
    """Check that springs, links and dampers take power from the motion, unless `active`."""
    for table, fault in find_active(design):
        if not table.active:
            remedy = f"{fault.remedy}, or give active = true if a sensor and an actuator do this"
            yield replace(fault, remedy=remedy)


def find_active(design: Design) -> Iterator[tuple[Link | Damper | Spring, Fault]]:
    """Find springs, links and dampers that give power to the motion, each with what does so."""
    parts: list[tuple[Link | Damper | Spring, str]] = [
        (spring, f"stage.{stage.name}.spring.{number}")
        for stage in design.stage
        for number, spring in enumerate(stage.spring, 1)
    ]
    parts += [(link, f"link.{link.name}") for link in design.link]
    parts += [(damper, f"damper.{damper.name}") for damper in design.damper]
    for part, path in parts:
        if problem := _negative(part.damping):
            problem = f"{problem}, so it drives the motion instead of damping it"
            yield part, fault_of(part, path, "damping", problem, "make it positive")
        if isinstance(part, Damper):
            continue
        angle = spring_loss(design, part) if isinstance(part, Spring) else part.loss_angle
        problem = _negative(part.stiffness)
        if angle and problem:
            problem = f"is that of a stiffness that {problem}, so it drives the motion"
            yield part, fault_of(part, path, "loss_angle", problem, "give loss_angle = 0.0")
        table = getattr(part, "table", None)
        least = min((min(row, default=0.0) for row in table.imaginary), default=0.0) if table else 0
        if table and least < 0:
            row = next(row for row in table.imaginary if least in row)
            axis = table.axis or DOFS[table.imaginary.index(row)]
            problem = (
                f"is negative along {axis} at {table.frequency[row.index(least)]:g} Hz, so it"
                " drives the motion instead of damping it"
            )
            yield part, Fault(f"{path}.table.imaginary", problem, "make it positive", f"{least:g}")


def _negative(given: Matrix6 | None) -> str:
    """In which direction a matrix is negative, as a verb phrase; "" if it is not."""
    import numpy as np

    if given is None or not np.isrealobj(given):
        return ""
    matrix = np.array(given, dtype=float)
    matrix = np.diag(matrix) if matrix.ndim == 1 else matrix
    diagonal = matrix.diagonal()
    if (diagonal < 0).any():
        return f"is negative along {DOFS[int(diagonal.argmin())]}"
    size = np.sqrt(np.where(diagonal > 0, diagonal, np.abs(matrix).max(initial=0.0) or 1.0))
    least = np.linalg.eigvalsh(matrix / np.outer(size, size))[0]
    return "has a negative eigenvalue" if least < -ROUNDING else ""


def _check_between(between: list[str], stages: list[str], path: str) -> Iterator[Fault]:
    first, second = between
    value = format_value(between)
    if first in BESIDE and second in stages:
        yield Fault(path, "must begin with a stage", f'swap them: ["{second}", "{first}"]', value)
        return
    if first not in stages:
        remedy = suggest(first, stages)
        yield Fault(path, f"begins with {first}, which is not a stage", remedy, value)
    if second == FRAME and second not in stages:
        remedy = f'write "{SUPPORT}" for the structure, or "{GROUND}" for the ground beside it'
        yield Fault(path, f"ends with {FRAME}, which is not a body of the file", remedy, value)
    elif second not in (*stages, *BESIDE):
        remedy = suggest(second, [*stages, *BESIDE])
        yield Fault(path, f"ends with {second}, which is not a body", remedy, value)
    if first == second:
        yield Fault(path, "joins a body to itself", "name two bodies", value)


def _check_strands(design: Design, link: Link, given: Strands, path: str) -> Iterator[Fault]:
    """Check that wires reach from end to end in their shape."""
    bodies = [*BESIDE, *(stage.name for stage in design.stage)]
    if any(name not in bodies for name in link.between):
        return
    position = com_positions(design) | dict.fromkeys(BESIDE, (0.0, 0.0, 0.0))
    first, second = (position[name] for name in link.between)
    x, y, z = (b + q - a - p for a, b, p, q in zip(first, second, link.at, given.to, strict=True))
    width = math.hypot(x, y)
    if given.shape == "points":
        end = tuple(p + d for p, d in zip(link.at, (x, y, z), strict=True))
        points = [link.at, *given.points, end]
        if any(math.dist(one, other) < 1e-9 for one, other in pairwise(points)):
            yield Fault(f"{path}.points", "two points of the wire coincide", "check at, points, to")
    elif width < 1e-6:
        problem = "lies above or below the point at, so the shape has no plane"
        yield fault_of(given, path, "to", problem, "move one end sideways, or give points")
    elif given.length is not None:
        least = math.hypot(width, z) if given.shape == "catenary" else math.pi / 2 * width + abs(z)
        if given.length <= least * (1 + 1e-9):
            problem = (
                f"is too short for ends {width:.4g} m apart and {abs(z):.4g} m in height: this"
                f" shape needs more than {least:.4g} m"
            )
            remedy = "give a longer wire, or check at and to (m)"
            yield fault_of(given, path, "length", problem, remedy)
