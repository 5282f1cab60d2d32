"""Imperfect builds of a design, and the cross-coupling of each (Husman et al. 2000, section 6)::

    axes = (Axis("k", (0.9, 1.0, 1.1)), Axis("offset", (-1e-3, 0.0, 1e-3)))
    job = ImperfectBuilds(source.text, axes, couplings.parse_request(system, setting, "test"))
    ratio = job.compute(0, job.count)["ratio"]

Cross-coupling is the ratio of two motions for one input, by default longitudinal over vertical
motion for vertical motion of the support. It is computed on grids of any number of imperfections.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from suspension_cli.design.imperfections import swept
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.errors import InputError
from suspension_cli.models import registry
from suspension_cli.physics.couplings import CouplingRequest, couplings
from suspension_cli.scene.scene import Scene
from suspension_cli.studies import builds, interpolated, sampling, variants
from suspension_cli.studies.builds import Builds
from suspension_cli.studies.job import Grid
from suspension_cli.studies.run import Columns

if TYPE_CHECKING:
    from jaxtyping import Complex, Float, Int


PARAMETERS = swept()
"""Imperfection and axis of each short name of a swept parameter; others are dotted paths."""


@dataclass(frozen=True)
class ImperfectBuilds(Grid):
    """Grid of imperfections (see `PARAMETERS`) or dotted paths.

    If `allow_unstable`, builds with an unstable equilibrium are valid.
    """

    question: CouplingRequest
    allow_unstable: bool = False
    level: str = registry.STRING.name

    def check(self) -> None:
        """Raise `InputError` if no wire can be imperfect, or a path, value or signal is invalid."""
        names = [axis.name for axis in self.axes if axis.name in PARAMETERS]
        of_wire = [name for name in names if PARAMETERS[name][0].part == "wire"]
        if of_wire and self.question.wire < 0:
            problem = f"{of_wire[0]} changes a wire, but the mirror hangs on none"
            raise InputError.of("--wire", problem, "name a wire, or sweep mass, com or a path")
        paths = [axis for axis in self.axes if axis.name not in PARAMETERS]
        self.check_designs("--sweep", paths, expand)
        self.compute(0, 1)

    def compute(self, start: int, stop: int) -> Columns:
        """Compute the couplings of builds start to stop - 1, see `couplings`."""
        return self.compute_at(self.values(start, stop))

    compared: ClassVar[dict[str, float]] = {"ratio": 0.0}
    """Columns by which an interpolated map is compared with full solutions.

    And the sizes below which their differences are relative to these.
    """

    @property
    def is_analytic(self) -> bool:
        """Couplings follow from the functions of `sample`."""
        return True

    @property
    def least(self) -> Float[np.ndarray, " function"]:
        """Sizes of these functions below which they are rounding errors."""
        return np.zeros(3 * len(self.question.frequency))

    def sample(
        self, values: dict[str, Float[np.ndarray, " build"]]
    ) -> Complex[np.ndarray, "build function"]:
        """Both motions times the determinant of the dynamic stiffness, and that, by frequency.

        Analytic in the values, also where they make a mode cross a frequency. NaN where a build has
        no result.
        """
        count = len(self.question.frequency)
        result = np.full((len(next(iter(values.values()))), 3 * count), np.nan + 0j)
        for found, here in self._balanced(values):
            motions = couplings(found, self.question)
            good = found.status == builds.GOOD
            for n, frequency in enumerate(self.question.frequency):
                own = interpolated.determinants(found.model, 2 * np.pi * frequency)
                for k, factor in enumerate((motions["over"][:, n], motions["under"][:, n], 1.0)):
                    result[here, k * count + n] = np.where(good, own * factor, np.nan)
        return result

    def columns_of(self, functions: Complex[np.ndarray, "build function"]) -> Columns:
        """Couplings and motions that follow from the functions of `sample`."""
        over, under, determinant = np.split(functions, 3, axis=1)
        number = len(functions)
        with np.errstate(all="ignore"):
            motions = {"over": over / determinant, "under": under / determinant}
        return {
            "ratio": builds.divide(over, under),
            **motions,
            "residual": np.full(number, np.nan),
            "status": np.full(number, builds.GOOD, dtype=np.uint8),
            "slack_wire": np.full(number, -1, dtype=np.int16),
        }

    def compute_at(self, values: dict[str, Float[np.ndarray, " build"]]) -> Columns:
        """Compute the couplings of builds with these values of the parameters."""
        count = len(next(iter(values.values())))
        spectrum = ("c16", (len(self.question.frequency),))
        result = builds.blank(
            count,
            ratio=spectrum,
            over=spectrum,
            under=spectrum,
            residual=("f8", ()),
            status=("u1", ()),
            slack_wire=("i2", ()),
        )
        for found, here in self._balanced(values):
            for name, value in couplings(found, self.question).items():
                result[name][here] = value
        return result

    def _balanced(
        self, values: dict[str, Float[np.ndarray, " build"]]
    ) -> Iterator[tuple[Builds, Int[np.ndarray, " place"]]]:
        """Balance builds with these values, in batches of one topology, with their places."""
        paths = {name: value for name, value in values.items() if name not in PARAMETERS}
        count = len(next(iter(values.values())))
        alike: Iterable[Any] = [(self.scene, self.design, np.arange(count))]
        if paths:
            alike = variants.scenes(self.text, paths, self.level)
        for scene, design, here in alike:
            swept = {name: own[here] for name, own in values.items() if name in PARAMETERS}
            imperfect = impose(scene, swept, self.question)
            unstable = self.allow_unstable
            yield (
                builds.balance(imperfect, design, level=self.level, allow_unstable=unstable),
                here,
            )


def impose(
    scene: Scene, values: dict[str, Float[np.ndarray, " build"]], question: CouplingRequest
) -> Scene:
    """Impose swept imperfections, by name (see `PARAMETERS`), on a scene or a batch of scenes."""
    changes: list[sampling.Change] = []
    for part, number in (("wire", question.wire), ("body", question.body)):
        for name, value in values.items():
            item, axis = PARAMETERS[name]
            if item.part == part:
                changes.append((item, number, question.hold, axis, value - item.neutral))
    return sampling.impose(scene, changes)
