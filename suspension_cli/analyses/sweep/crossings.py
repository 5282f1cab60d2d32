"""Crossings and avoided crossings of modes along the parameter of a sweep."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from suspension_cli.analyses.modes import picture
from suspension_cli.analyses.sweep.solve import SweepResult
from suspension_cli.design import reader
from suspension_cli.drawing import geometry
from suspension_cli.drawing.canvas import Canvas
from suspension_cli.drawing.geometry import FACE, SIDE, Sketch, View
from suspension_cli.drawing.style import NOTE, single_line
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.files.hdf5 import Stored
from suspension_cli.linear import eigenmodes
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.models import registry
from suspension_cli.scene.arrays import Array
from suspension_cli.scene.pose import layout
from suspension_cli.scene.scene import Scene

NEAR, NEAR_MIXED = 0.05, 0.5
"""Largest relative distance in frequency of two modes that meet, unmixed or mixed."""
CLOSER = 1.3
"""Factor by which they must be farther apart at both ends of the grid."""
PURE = 3.0
"""Factor by which modes that mixed are farther apart where 3 % of mixing is left."""
MIXED = 0.05
"""Fraction of the other mode's motion from which a crossing is avoided."""


@dataclass(frozen=True)
class Point:
    """Point of a grid near a crossing: the parameter (SI), and the two modes' numbers from 0."""

    at: float
    rank: tuple[int, int]


@dataclass(frozen=True)
class Crossing:
    """Two modes that come closest at a point of a grid.

    Attributes
    ----------
    at
        Value of the parameter, SI.
    frequency
        Mean of the two, Hz.
    mixing
        Fraction of each one's motion there that is the other's motion far away.
    around
        Points of the grid before, at and after it.
    """

    at: float
    frequency: float
    modes: tuple[str, str]
    mixing: tuple[float, float]
    around: tuple[Point, ...] = ()

    @property
    def is_avoided(self) -> bool:
        """Whether the motions mix."""
        return max(self.mixing) > MIXED

    def __str__(self) -> str:
        """Say which modes meet, and how the first is composed where they mix."""
        first, second = self.modes
        if not self.is_avoided:
            return f"{first} crosses {second}, unmixed"
        part = 100 * max(self.mixing)
        return f"{first} and {second} mix: {100 - part:.0f} % + {part:.0f} %"


def find_crossings(group: Stored, swept: SweepResult) -> list[Crossing]:
    """Find where modes among the results of a sweep over one parameter meet, most mixed first."""
    if "shape" not in group or len(swept.axes) != 1 or len(swept.axes[0].values) < 3:
        return []
    labels = [str(name) for name in group["mode"].asstr()[:]]
    shown = [n for n, name in enumerate(swept.result) if name in labels]
    rank, shape = group["rank"][:], group["shape"]
    found = []
    for k, a in enumerate(shown):
        for b in shown[k + 1 :]:
            numbers = labels.index(swept.result[a]), labels.index(swept.result[b])
            first, second = swept.value[:, a], swept.value[:, b]
            with np.errstate(invalid="ignore", divide="ignore"):
                gap = np.abs(first - second) / np.minimum(first, second)
            if not np.isfinite(gap).any():
                continue
            n = int(np.nanargmin(gap))
            if not 0 < n < len(gap) - 1 or gap[n] > NEAR_MIXED:
                continue
            ends = np.flatnonzero(np.isfinite(gap))[[0, -1]]
            if gap[ends].min() < max(CLOSER * gap[n], 0.2 * NEAR):
                continue
            far = int(ends[np.argmax(gap[ends])])
            if min(rank[n, list(numbers)]) < 0 or min(rank[far, list(numbers)]) < 0:
                continue
            here = np.asarray(shape[n], dtype=float)[rank[n, list(numbers)]]
            pure = np.asarray(shape[far], dtype=float)[rank[far, list(numbers)]]
            part = (here @ pure.T) ** 2
            part = part / np.maximum(part.sum(1, keepdims=True), 1e-300)
            mixing = float(part[0, 1]), float(part[1, 0])
            names = swept.result[a], swept.result[b]
            middle = float(np.mean([first[n], second[n]]))
            apart = np.isfinite(gap) & (gap > PURE * gap[n])
            before, after = np.flatnonzero(apart[:n]), np.flatnonzero(apart[n:])
            near = (
                before[-1] if len(before) else ends[0],
                n,
                n + after[0] if len(after) else ends[1],
            )
            around = tuple(
                Point(swept.axes[0].values[i], (int(rank[i, numbers[0]]), int(rank[i, numbers[1]])))
                for i in near
            )
            one = Crossing(swept.axes[0].values[n], middle, names, mixing, around)
            if one.is_avoided or gap[n] <= NEAR:
                found.append(one)
    return sorted(found, key=lambda one: -max(one.mixing))


MOST = 3
"""Largest number of crossings whose shapes are drawn: those that mix most."""
GAP = 0.2
"""Distance between the pictures of the two modes, in."""
TALLEST, LOWEST = 1.0, 0.5
"""Bounds of the height of a picture, in."""
CAPTION = 0.36
"""Height of the captions below pictures, in."""
THICK = 0.45
"""Thickness of wires, points."""


@dataclass(frozen=True)
class Shapes:
    """Shapes of two modes, ascending, at points around a crossing, and sketches at rest."""

    crossing: Crossing
    modes: tuple[Modes, ...]
    rest: tuple[Sketch, ...]


def solve_shapes(
    source: reader.Source, path: str, level: str, crossings: Sequence[Crossing]
) -> list[Shapes]:
    """Solve for the modes before, at and after the first `MOST` crossings where modes mix."""
    found = []
    for one in [one for one in crossings if one.is_avoided and one.around][:MOST]:
        designs = [reader.replaced(source, {path: point.at}).design for point in one.around]
        model = registry.by_name(level)
        modes = tuple(
            eigenmodes.solve(replace(model.system(design), terms=())) for design in designs
        )
        rest = tuple(picture.sketch_at_rest(design, expand(design)) for design in designs)
        found.append(Shapes(one, modes, rest))
    return found


class Strip:
    """Row of small pictures: one mode before, at and after a crossing, then the other.

    `width` and `height` (with captions) are in inches.
    """

    def __init__(self, shapes: Shapes, width: float) -> None:
        self.shapes = shapes
        view = _choose_view(shapes)
        self._panels = [_panels(shapes, n, view) for n in range(2)]
        self._frame = picture.measure_frame([panel for row in self._panels for panel in row])
        self._width = (width - GAP) / sum(len(row) for row in self._panels)
        fitting = self._width * self._frame.height / self._frame.width
        self._tall = float(np.clip(fitting, LOWEST, TALLEST))
        self.height = self._tall + CAPTION

    def draw(
        self,
        canvas: Canvas,
        left: float,
        top: float,
        colours: Sequence[str],
        values: Sequence[str],
        letter: str,
    ) -> None:
        """Draw the row of a crossing from its upper left corner, in inches, on a canvas."""
        for n, (row, name) in enumerate(zip(self._panels, self.shapes.crossing.modes, strict=True)):
            start = left + n * (len(row) * self._width + GAP)
            for k, panel in enumerate(row):
                corner = start + k * self._width, top
                modes, rest = self.shapes.modes[k], self.shapes.rest[k]
                size = self._width, self._tall
                colour = (colours[n],) * len(rest.outlines)
                picture.draw_shape(
                    canvas, corner, size, modes, panel, rest, self._frame, colour, THICK
                )
                at = corner[0] + self._width / 2, top - self._tall - 0.02
                canvas.text(*at, values[k], ha="center", va="top", fontsize=7.5, color=NOTE)
            middle = start + len(row) * self._width / 2
            canvas.text(
                middle,
                top - self._tall - 0.155,
                f"{letter}: {single_line(name, 20)}, {row[0].view.name}",
                ha="center",
                va="top",
                fontsize=7.5,
                color=colours[n],
            )


def _choose_view(shapes: Shapes) -> View:
    """Choose the view that shows most of both modes at the crossing."""
    rest, modes = shapes.rest[1], shapes.modes[1]
    above = geometry.from_above(rest.scene, rest.outlines)
    views = [picture.choose_view(modes, rank, above) for rank in shapes.crossing.around[1].rank]
    if views[0].normal != views[1].normal and {view.normal for view in views} == {0, 1}:
        x, y, _, roll, pitch, _ = modes.energy[[*shapes.crossing.around[1].rank]].sum((0, 1))
        return SIDE if x + pitch >= y + roll else FACE
    return views[0]


def _panels(shapes: Shapes, which: int, view: View) -> list[picture.Panel]:
    """Make the panels of one of the two modes; the sign of its momentum does not jump."""
    panels: list[picture.Panel] = []
    last = np.zeros(layout(shapes.rest[0].scene).size)
    for point, modes, rest in zip(shapes.crossing.around, shapes.modes, shapes.rest, strict=True):
        number = point.rank[which]
        shape = modes.shape[number]
        motion = geometry.mode_step(layout(rest.scene), modes.coordinate, shape)
        if float(last @ _momentum(rest.scene, motion)) < 0:
            shape, motion = -shape, -motion
        last = motion
        pose = geometry.mode_pose(rest.scene, modes.coordinate, shape)
        panels.append(picture.make_panel(modes, number, rest, pose, view))
    return panels


def _momentum(scene: Scene, motion: Array) -> Array:
    """Momentum of the bodies of a scene in their motion, about their principal axes."""
    bodies = scene.bodies
    inertia = np.diagonal(bodies.inertia, axis1=-2, axis2=-1)
    mass = np.concatenate([np.repeat(bodies.mass[:, None], 3, axis=1), inertia], axis=1)
    result = np.zeros_like(motion)
    result[6 : 6 + mass.size] = mass.ravel() * motion[6 : 6 + mass.size]
    return result
