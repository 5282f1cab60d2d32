"""Cross-coupling of imperfect builds: how much of one motion becomes another (Husman et al. 2000, section 6).

The ratio of two outputs for one input, by default longitudinal over vertical for vertical motion of the support, over the
product of any number of swept imperfections.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from suspension_cli.analysis import builds, variants
from suspension_cli.analysis.axes import Axis, Product, of_option
from suspension_cli.analysis.builds import Column
from suspension_cli.analysis.signals import Signal
from suspension_cli.design import perturb, reader
from suspension_cli.design.scene import Array, Scene
from suspension_cli.design.schema import Design
from suspension_cli.errors import Fault, InputError
from suspension_cli.mechanics.nominal import expand

OF_WIRE = {
    "k": "factor on the wire's spring constant",
    "offset": "of the wire's upper end along x, m",
    "offset_y": "of the wire's upper end along y, m",
    "offset_z": "of the wire's upper end along z, m",
    "lower_offset": "of the wire's lower end along x, m",
    "lower_offset_y": "of the wire's lower end along y, m",
    "lower_offset_z": "of the wire's lower end along z, m",
    "length": "change of the wire's unstretched length, m",
}
OF_BODY = {
    "mass": "factor on the body's mass",
    "com": "offset of the body's COM along x, m",
    "com_y": "offset of the body's COM along y, m",
    "com_z": "offset of the body's COM along z, m",
    "inertia": "factor on the body's inertia",
}
PARAMETERS = OF_WIRE | OF_BODY
"""What can be swept by a short name, and what it is; any dotted path of the design file goes too."""

FAINT = 1e-17
"""Ratio below which rounding shows: attachments are known to the last bit of their coordinates, and what that couples is of order 1e-19."""

UNITS = {name: "1" if "factor" in text else "m" for name, text in PARAMETERS.items()}


@dataclass(frozen=True)
class Question:
    """What is asked of every build.

    Attributes
    ----------
    wire : int
        The imperfect wire, from 0; -1 if there is none.
    body : int
        The imperfect body, from 1.
    hold : str
        See `design.perturb.wire`.
    input, over, under : Signal
        The ratio is that of `over` to `under` for the input.
    frequency : tuple of float
        Hz.
    """

    wire: int
    body: int
    hold: str
    input: Signal
    over: Signal
    under: Signal
    frequency: tuple[float, ...]


@dataclass(frozen=True)
class Sweep(Product):
    """A product of imperfections, as a job for `batch.run`: the first axis turns slowest.

    Attributes
    ----------
    text : str
        The design as TOML.
    axes : tuple of Axis
    question : Question
    allow_unstable : bool
        Whether a build with an unstable equilibrium is as good as any.
    level : str
        ``string``, ``beam`` or ``violin``.
    """

    text: str
    axes: tuple[Axis, ...]
    question: Question
    allow_unstable: bool = False
    level: str = "string"

    @property
    def identity(self) -> str:
        """What tells this sweep from another of the same design."""
        return repr((self.axes, self.question, self.allow_unstable, self.level))

    @property
    def wire_label(self) -> str:
        """The imperfect wire; empty if there is none."""
        return expand(self._design).wires.label[self.question.wire] if self.question.wire >= 0 else ""

    def check(self) -> None:
        """Raise `InputError` now if there is no wire to spoil, or a dotted path, one of its values or a signal is at fault."""
        of_wire = [axis.name for axis in self.axes if axis.name in OF_WIRE]
        if of_wire and self.question.wire < 0:
            raise InputError([Fault("--wire", f"{of_wire[0]} is of a wire, and the last stage hangs on none", "name one, or sweep mass, com or a path")])
        paths = [axis for axis in self.axes if axis.name not in PARAMETERS]
        for axis in paths:
            for value in dict.fromkeys((axis.values[0], axis.values[-1])):
                try:
                    expand(reader.overridden(self.text, (f"{axis.name}={float(value)!r}",)))
                except InputError as error:
                    raise of_option(error, "--sweep", axis, value) from None
        self.compute(0, 1)

    @property
    def columns(self) -> tuple[Column, ...]:
        """Ratio, both outputs, and how each build went."""
        asked, count = self.question, (len(self.question.frequency),)
        axes = ("frequency",)
        return (
            Column("ratio", "c16", count, over_unit(asked.over, asked.under), axes),
            Column("over", "c16", count, over_unit(asked.over, asked.input), axes),
            Column("under", "c16", count, over_unit(asked.under, asked.input), axes),
            Column("residual", "f8", (), "1"),
            Column("status", "u1", (), "1"),
            Column("slack_wire", "i2", (), "1"),
        )

    def compute(self, start: int, stop: int) -> dict[str, Any]:
        """Results of builds start to stop - 1."""
        values = self.values(start, stop)
        imperfections = {name: value for name, value in values.items() if name in PARAMETERS}
        if len(imperfections) == len(values):
            return answer(imperfect(expand(self._design), values, self.question), self._design, self.question, self.allow_unstable, self.level)
        paths = {name: value for name, value in values.items() if name not in PARAMETERS}
        result = {column.name: _nothing(column, stop - start) for column in self.columns}
        for scene, design, here in variants.scenes(self.text, paths, self.level):
            part = {name: value[here] for name, value in imperfections.items()}
            found = answer(imperfect(scene, part, self.question) if part else scene, design, self.question, self.allow_unstable, self.level)
            for name, value in found.items():
                result[name][here] = value
        return result

    @cached_property
    def _design(self) -> Any:
        return reader.parse(self.text)


def over_unit(out: Signal, into: Signal) -> str:
    """Unit of the ratio of two signals."""
    return "1" if out.unit == into.unit else f"{out.unit}/{into.unit}".replace("/N m", "/(N m)")


def _nothing(column: Column, count: int) -> Any:
    """What stands for builds of which there is no design."""
    shape = (count, *column.shape)
    if column.dtype == "u1":
        return np.full(shape, builds.IMPOSSIBLE, dtype=column.dtype)
    return np.full(shape, {"i2": -1, "f8": np.nan, "c16": builds.NOTHING}[column.dtype], dtype=column.dtype)


def imperfect(scene: Scene, values: dict[str, Array], question: Question) -> Scene:
    """A scene with the swept imperfections put in.

    Parameters
    ----------
    scene : Scene
        Without batch axes or with the builds as its first.
    values : dict of (p,) arrays
        By parameter name.
    question : Question
    """
    count = len(next(iter(values.values())))

    def vector(stem: str) -> Array:
        return np.stack([values.get(stem + axis, np.zeros(count)) for axis in ("", "_y", "_z")], axis=-1)

    if any(name in values for name in OF_WIRE):
        scene = perturb.wire(
            scene,
            question.wire,
            k_factor=values.get("k", np.ones(count)),
            upper_offset=vector("offset"),
            lower_offset=vector("lower_offset"),
            length_change=values.get("length", np.zeros(count)),
            hold=question.hold,
        )
    if any(name in values for name in ("com", "com_y", "com_z")):
        scene = perturb.move_com(scene, question.body, vector("com"))
    if "mass" in values:
        scene = perturb.scale_mass(scene, question.body, values["mass"])
    if "inertia" in values:
        scene = perturb.scale_inertia(scene, question.body, values["inertia"][:, None] * np.ones(3))
    return scene


def answer(scene: Scene, design: Design, question: Question, allow_unstable: bool = False, level: str = "string") -> dict[str, Any]:
    """The ratio of every build of a batch, by column name; on the rung ``string``, ``beam`` or ``violin``."""
    found = builds.balance(scene, design, level=level, allow_unstable=allow_unstable)
    outputs = builds.transfer(found, np.array(question.frequency), [question.input], [question.over, question.under])[..., 0]
    over, under = outputs[..., 0], outputs[..., 1]
    with np.errstate(all="ignore"):
        ratio = np.where((over == 0) & (np.abs(under) > 0), 0.0, over / under)
    return {"ratio": ratio, "over": over, "under": under, "residual": found.residual, "status": found.status, "slack_wire": found.wire}
