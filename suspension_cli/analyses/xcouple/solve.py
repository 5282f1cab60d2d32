"""Cross-coupling of imperfect builds (Husman et al. 2000, section 6).

Cross-coupling is the ratio of two motions for one input, by default longitudinal over vertical
motion for vertical motion of the support. It is computed on grids of any number of imperfections.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.sweep.solve import blank_values, divide
from suspension_cli.design.imperfections import swept
from suspension_cli.equilibrium import hanging
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.errors import InputError
from suspension_cli.linear.signals import Signal
from suspension_cli.models import registry
from suspension_cli.scene.scene import Scene
from suspension_cli.studies import builds, variants
from suspension_cli.studies.axes import Product
from suspension_cli.studies.builds import Builds, Column, ColumnValues

if TYPE_CHECKING:
    from jaxtyping import Float

PARAMETERS = swept()
"""Imperfection and axis of each short name of a swept parameter; others are dotted paths."""

UNITS = {name: item.unit for name, (item, _) in PARAMETERS.items()}

ROUNDING = 1e-17
"""Ratio below which rounding dominates: rounded coordinates of attachments couple some 1e-19."""


@dataclass(frozen=True)
class CouplingRequest:
    """Cross-coupling to compute for every build.

    Attributes
    ----------
    wire
        Number of the imperfect wire, from 0; -1 if there is none.
    body
        Number of the imperfect body, from 1.
    hold
        What is kept when the wire changes, see `scene.imperfections.wire`.
    input, over, under
        The coupling is the ratio of `over` to `under` for a motion or force `input`.
    frequency
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
    """Grid of imperfections (see `PARAMETERS`) or dotted paths.

    Attributes
    ----------
    allow_unstable
        Whether a build with an unstable equilibrium counts as valid.
    """

    question: CouplingRequest
    allow_unstable: bool = False
    level: str = registry.STRING.name

    @property
    def wire_label(self) -> str:
        """Label of the imperfect wire; empty if there is none."""
        wire = self.question.wire
        return self.scene.wires.label[wire] if wire >= 0 else ""

    def check(self) -> None:
        """Raise `InputError` if no wire can be imperfect, or a path, value or signal is invalid."""
        of_wire = [axis.name for axis in self.axes if _part(axis.name) == "wire"]
        if of_wire and self.question.wire < 0:
            problem = f"{of_wire[0]} changes a wire, but the mirror hangs on none"
            raise InputError.of("--wire", problem, "name a wire, or sweep mass, com or a path")
        paths = [axis for axis in self.axes if axis.name not in PARAMETERS]
        self.check_designs("--sweep", paths, expand, every=True)
        self.compute(0, 1)

    @property
    def columns(self) -> tuple[Column, ...]:
        """Datasets of the file: ratio, both motions per input, and the status of each build."""
        ask, count = self.question, (len(self.question.frequency),)
        axes = ("frequency",)
        return (
            Column("ratio", "c16", count, quotient_unit(ask.over, ask.under), axes),
            Column("over", "c16", count, quotient_unit(ask.over, ask.input), axes),
            Column("under", "c16", count, quotient_unit(ask.under, ask.input), axes),
            Column("residual", "f8", (), "1"),
            Column("status", "u1", (), "1"),
            Column("slack_wire", "i2", (), "1"),
        )

    def compute(self, start: int, stop: int) -> ColumnValues:
        """Compute the `columns` of builds start to stop - 1."""
        values = self.values(start, stop)
        paths = {name: value for name, value in values.items() if name not in PARAMETERS}
        result = {column.name: blank_values(column, stop - start) for column in self.columns}
        parts = [(self.scene, self.design, np.arange(stop - start))]
        for scene, design, here in (
            variants.scenes(self.text, paths, self.level) if paths else parts
        ):
            imperfections = {
                name: value[here] for name, value in values.items() if name in PARAMETERS
            }
            found = builds.balance(
                impose(scene, imperfections, self.question),
                design,
                level=self.level,
                allow_unstable=self.allow_unstable,
            )
            for name, value in couplings(found, self.question).items():
                result[name][here] = value
        return result


def quotient_unit(out: Signal, into: Signal) -> str:
    """Unit of the ratio of two signals, ``m/(N m)``."""
    return "1" if out.unit == into.unit else f"{out.unit}/{into.unit}".replace("/N m", "/(N m)")


def impose(
    scene: Scene, values: dict[str, Float[np.ndarray, " build"]], question: CouplingRequest
) -> Scene:
    """Impose swept imperfections, by name (see `PARAMETERS`), on a scene.

    The scene has no batch axes, or the builds along its first axis.
    """
    for part, number in (("wire", question.wire), ("body", question.body)):
        amounts: dict[str, np.ndarray] = {}
        for name, value in values.items():
            item, axis = PARAMETERS[name]
            if item.part != part:
                continue
            if not item.vector:
                amounts[item.name] = value
            elif axis is None:
                amounts[item.name] = value[:, None] * np.ones(3)
            else:
                amounts.setdefault(item.name, np.zeros((len(value), 3)))[:, axis] = value
        if amounts:
            scene = hanging.impose(scene, part, number, amounts, question.hold)
    return scene


def _part(name: str) -> str:
    """Part of a swept parameter, ``wire`` or ``body``; "" for a dotted path."""
    return PARAMETERS[name][0].part if name in PARAMETERS else ""


def couplings(found: Builds, question: CouplingRequest) -> ColumnValues:
    """Compute the coupling (`Sweep.columns`) of balanced builds."""
    outputs = builds.transfer(
        found, np.array(question.frequency), [question.input], [question.over, question.under]
    )[..., 0]
    over, under = outputs[..., 0], outputs[..., 1]
    return {
        "ratio": divide(over, under),
        "over": over,
        "under": under,
        "residual": found.residual,
        "status": found.status,
        "slack_wire": found.wire,
    }
