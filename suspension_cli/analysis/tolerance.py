"""Builds with everything a little wrong: distributions of mode frequencies and of the cross-coupling.

Modes are followed from the nominal design by their shapes: each nominal mode takes the mode of the build that overlaps it most.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from suspension_cli.analysis import builds, graded, modes, sampling
from suspension_cli.analysis.builds import Column
from suspension_cli.analysis.coupling import Question, over_unit
from suspension_cli.analysis.systems import solved
from suspension_cli.design import reader
from suspension_cli.design.scene import Array, Scene
from suspension_cli.mechanics.model import LinearModel
from suspension_cli.mechanics.nominal import expand
from suspension_cli.models import fidelity


@dataclass(frozen=True)
class Tolerances:
    """Random builds of one design, as a job for `batch.run`.

    Attributes
    ----------
    text : str
        The design as TOML, with its `[tolerance]` table.
    count : int
        Number of builds.
    seed : int
    question : Question
        Whose ratio is the cross-coupling; its wire and body do not matter.
    allow_unstable : bool
        Whether a build with an unstable equilibrium is as good as any.
    level : str
        ``string`` or ``beam``.
    """

    text: str
    count: int
    seed: int
    question: Question
    allow_unstable: bool = False
    level: str = "string"

    @property
    def shape(self) -> tuple[int, ...]:
        """One axis: the builds."""
        return (self.count,)

    @property
    def scales(self) -> tuple[str, ...]:
        """Dataset that numbers the builds."""
        return ("build",)

    @property
    def identity(self) -> str:
        """What tells this job from another of the same design."""
        return repr((self.count, self.seed, self.question, self.allow_unstable, self.level))

    @property
    def columns(self) -> tuple[Column, ...]:
        """Number, frequencies, cross-coupling, and how each build went."""
        ratio = over_unit(self.question.over, self.question.under)
        return (
            Column("build", "u4", (), "1"),
            Column("frequency", "f8", (len(self.nominal.omega_squared),), "Hz", ("mode",)),
            Column("ratio", "c16", (len(self.question.frequency),), ratio, ("coupling_frequency",)),
            Column("residual", "f8", (), "1"),
            Column("status", "u1", (), "1"),
            Column("slack_wire", "i2", (), "1"),
        )

    @cached_property
    def design(self) -> Any:
        """The design."""
        return reader.parse(self.text)

    @cached_property
    def scene(self) -> Scene:
        """The scene before the random imperfections."""
        return expand(self.design)

    @cached_property
    def factors(self) -> tuple[sampling.Factor, ...]:
        """What scatters."""
        return sampling.factors(self.design, self.scene)

    @cached_property
    def _start(self) -> tuple[modes.Modes, Array, Array]:
        """Nominal modes, and their mass-normalised shapes as (m, c), with the coordinates kept."""
        # exact zeros by symmetry keep the labels of degenerate modes apart
        from suspension_cli.mechanics import assemble
        from suspension_cli.models.surroundings import surrounded

        found = modes.solve(fidelity.linear_model(self.design, self.level))
        plain = surrounded(assemble.linear_model(self.scene, split=False), self.design)
        keep = kept(plain)
        root = np.linalg.cholesky(plain.mass[np.ix_(keep, keep)])
        return found, found.shape[:, keep - 6] @ root, keep

    @property
    def nominal(self) -> modes.Modes:
        """The modes of the design as drawn (with its own perturbations)."""
        return self._start[0]

    def check(self) -> None:
        """Raise `InputError` now if there is no table, or a signal is at fault."""
        self.compute(0, 1)

    def deviations(self, start: int, stop: int) -> Array:
        """What builds start to stop - 1 got wrong, (p, factors)."""
        return sampling.deviations(self.factors, self.seed, start, stop)

    def compute(self, start: int, stop: int) -> dict[str, Any]:
        """Results of builds start to stop - 1."""
        scene = sampling.imperfect(self.scene, self.factors, self.deviations(start, stop))
        found = builds.balance(scene, self.design, level=self.level, allow_unstable=self.allow_unstable)
        with np.errstate(all="ignore"):
            omega_squared = followed(found, self._start[1], self._start[2])
            outputs = builds.transfer(found, np.array(self.question.frequency), [self.question.input], [self.question.over, self.question.under])[..., 0]
            ratio = outputs[..., 0] / outputs[..., 1]
            frequency = np.sqrt(omega_squared if self.allow_unstable else np.maximum(omega_squared, 0.0)) / (2 * np.pi)
        frequency[found.status != builds.GOOD] = np.nan
        number = np.arange(start, stop, dtype=np.uint32)
        return {"build": number, "frequency": frequency, "ratio": ratio, "residual": found.residual, "status": found.status, "slack_wire": found.wire}


def kept(model: LinearModel) -> Any:
    """Coordinates with inertia, the support's left out."""
    return np.flatnonzero(~model.massless[6:]) + 6


def followed(found: builds.Builds, shapes: Array, keep: Any) -> Array:
    """omega^2 (p, m) of every build, in the order of the nominal modes.

    Parameters
    ----------
    found : Builds
    shapes : (m, c) array
        Nominal modes in coordinates scaled by the root of the mass matrix: orthonormal.
    keep : (c,) int array
        Their coordinates.
    """
    model = found.model
    light = np.setdiff1d(np.arange(6, model.size), keep)
    stiffness = model.stiffness[..., keep[:, None], keep]
    if len(light):
        across = model.stiffness[..., keep[:, None], light]
        stiffness = stiffness - across @ solved(model.stiffness[..., light[:, None], light], np.swapaxes(across, -1, -2))
    bad = found.status != builds.GOOD
    mass = np.where(bad[:, None, None], np.eye(len(keep)), model.mass[..., keep[:, None], keep])
    tension = np.where(bad, 0.0, graded.TURNING * graded.hanging(model))
    values, vectors = graded.quickly(mass, np.where(bad[:, None, None], mass, stiffness), tension)
    overlap = (shapes @ vectors) ** 2  # (p, m, m): nominal, build
    choice = overlap.argmax(-1)
    clash = (np.sort(choice, axis=-1) != np.arange(choice.shape[-1])).any(-1)
    for n in np.flatnonzero(clash).tolist():
        choice[n] = _assigned(overlap[n])
    return np.take_along_axis(values, choice, axis=-1)


def _assigned(overlap: Array) -> Any:
    """For every nominal mode one mode of the build, the most overlap in all."""
    from scipy.optimize import linear_sum_assignment

    return linear_sum_assignment(overlap, maximize=True)[1]
