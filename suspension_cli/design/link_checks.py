"""Checks of `[[link]]`, `[[damper]]`, ... beyond single values."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Any

from suspension_cli.conventions import DOFS, FRAME, GROUND, SUPPORT
from suspension_cli.design import materials
from suspension_cli.design.body_checks import check_exactly_one
from suspension_cli.design.derive import com_positions, spring_loss
from suspension_cli.design.faults import fault_of, suggest
from suspension_cli.design.links import Damper, Link, StiffnessTable, Strands
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
        yield from item.faults(path)
    if GROUND in stages and any(GROUND in item.between for _, item in items):
        problem = "is the name of the ground, on which a link or damper ends"
        remedy = "give the stage another name"
        yield Fault(f"stage.{GROUND}.name", problem, remedy, format_value(GROUND))
    for link in design.link:
        yield from _check_link(design, link, f"link.{link.name}", placed=placed)
    for damper in design.damper:
        yield from _check_damper(damper, f"damper.{damper.name}")


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


def _check_link(design: Design, link: Link, path: str, *, placed: bool) -> Iterator[Fault]:
    given = {"stiffness": link.stiffness, "table": link.table, "strands": link.strands}
    yield from check_exactly_one(path, given, "stiffness, or table, or strands")
    for key in ("stiffness", "damping"):
        yield from check_matrix(getattr(link, key), f"{path}.{key}")
    if link.table is not None:
        yield from _check_table(link.table, f"{path}.table")
        if link.loss_angle is not None:
            problem = "conflicts with the imaginary part of the table"
            yield fault_of(link, path, "loss_angle", problem, "remove it")
    if link.strands is not None:
        yield from _check_strands(design, link, link.strands, f"{path}.strands", placed=placed)


def is_symmetric(matrix: list[list[float]]) -> bool:
    """Whether a square matrix is exactly symmetric."""
    return all(matrix[i][j] == matrix[j][i] for i in range(len(matrix)) for j in range(i))


def check_matrix(matrix: Any, path: str) -> Iterator[Fault]:
    """Check that a matrix is six numbers, or six rows that are symmetric."""
    rows = [isinstance(row, list) for row in matrix or ()]
    value = format_value(matrix)
    if any(rows) and not all(rows):
        yield Fault(path, "mixes numbers and rows", "give six numbers or six rows of six", value)
    elif any(rows) and not is_symmetric(matrix):
        yield Fault(path, "is not symmetric", "make element (i, j) equal to (j, i)", value)


def _check_table(table: StiffnessTable, path: str) -> Iterator[Fault]:
    if table.file is not None:
        problem = "is read only with a design file, not with its text alone"
        remedy = "read the design from its file, or give frequency, real and imaginary"
        yield fault_of(table, path, "file", problem, remedy)
        return
    axes = 6 if table.axis is None else 1
    if not table.frequency:
        yield Fault(path, "has no frequencies", "give file, or frequency, real and imaginary")
        return
    if any(after <= before for before, after in pairwise(table.frequency)):
        yield Fault(f"{path}.frequency", "is not in ascending order", "sort the table by frequency")
    for key in ("real", "imaginary"):
        columns = getattr(table, key)
        if len(columns) != axes:
            remedy = "give one list for the one axis, or remove axis"
            if axes == 6:
                one = 'or name the one axis: axis = "x"'
                remedy = f"give one list per axis, {', '.join(DOFS)}, {one}"
            yield Fault(f"{path}.{key}", f"has {len(columns)} axes instead of {axes}", remedy)
            return
        if any(len(column) != len(table.frequency) for column in columns):
            problem = f"has an axis without exactly {len(table.frequency)} values"
            yield Fault(f"{path}.{key}", problem, "give one value per frequency")
            return
    static = [row[0] for row in table.real] if table.static is None else table.static
    if len(static) != axes:
        problem = f"has {len(static)} numbers for {axes} axes"
        yield fault_of(table, path, "static", problem, "give one per axis")
        return
    for n, value in enumerate(static):
        if value == 0 and (any(table.real[n]) or any(table.imaginary[n])):
            axis = table.axis or DOFS[n]
            problem = f"the static stiffness along {axis} is 0, but at other frequencies it is not"
            remedy = "give static, or use damping for a viscous force"
            yield Fault(f"{path}.static", problem, remedy, format_value(value))


def _check_strands(
    design: Design, link: Link, given: Strands, path: str, *, placed: bool
) -> Iterator[Fault]:
    known = materials.known(design)
    if given.material not in known:
        remedy = suggest(given.material, known)
        yield fault_of(given, path, "material", "unknown material", remedy)
    yield from _check_shape(given, path)
    bodies = [*BESIDE, *(stage.name for stage in design.stage)]
    if not placed or any(name not in bodies for name in link.between):
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


def _check_shape(given: Strands, path: str) -> Iterator[Fault]:
    if given.shape == "points":
        if given.length is not None:
            yield Fault(f"{path}.length", "follows from the points", "remove it")
    elif given.points:
        yield Fault(f"{path}.points", f"conflict with shape {given.shape}", "remove them")
    elif given.length is None:
        yield Fault(f"{path}.length", "missing", "give the length of one wire, m")


def _check_damper(damper: Damper, path: str) -> Iterator[Fault]:
    magnet = damper.eddy_current
    ways = {"damping": damper.damping, "eddy_current": magnet}
    yield from check_exactly_one(path, ways, "damping or eddy_current")
    yield from check_matrix(damper.damping, f"{path}.damping")
    if magnet is None:
        return
    path = f"{path}.eddy_current"
    given = {"moment": magnet.moment, "remanence": magnet.remanence}
    yield from check_exactly_one(path, given, "moment, or remanence with volume")
    if (magnet.remanence is None) != (magnet.volume is None):
        yield Fault(f"{path}.volume", "belongs to remanence", "give both, or moment alone")
    if not 1e4 <= magnet.conductivity <= 1e12:
        remedy = "give it in S/m: copper has 5.8e7 at room temperature"
        yield fault_of(magnet, path, "conductivity", "is not that of a metal", remedy)
