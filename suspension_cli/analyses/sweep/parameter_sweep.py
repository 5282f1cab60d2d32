"""Grids of designs, and the quantities of each::

    results = find_results(["test pitch", "thermal test.x:10"], names, source.text, "beam")
    job = ParameterSweep(source.text, axes, "beam", results)
    columns = job.compute(0, job.count)

Each point of the grid is a design of its own. Designs of one topology are balanced together, and
all quantities read what they need from this batch (`quantities.solved`). What a name means in each
design does not depend on its neighbours, with one exception: modes of the design as drawn are
followed from point to neighbouring point by their shapes once all points are known
(`mode_pairing.follow`). Spectra and shapes of all points are kept for these, and for modes by
label, whose motion may pass from one mode to another (`sharing`).
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.design import reader
from suspension_cli.design.paths import value_at
from suspension_cli.design.schema import Design
from suspension_cli.errors import InputError
from suspension_cli.linear import batch_modes, eigenmodes, mode_content
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import registry
from suspension_cli.quantities.kinds.modes import FollowedMode, Frequency
from suspension_cli.quantities.kinds.responses import Ratio
from suspension_cli.quantities.needs import Needs
from suspension_cli.quantities.quantity import Quantity
from suspension_cli.quantities.requirements import Requirement
from suspension_cli.quantities.solved import Solved, of_designs
from suspension_cli.studies import builds, system_functions, variants
from suspension_cli.studies.job import Grid, nominal_system
from suspension_cli.studies.run import Columns

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact, Int

OTHER_COORDINATES = len(builds.STATUS)
STATUS = (*builds.STATUS, "the design has other coordinates than the one swept")
"""Meaning of the status of a point."""


@dataclass(frozen=True)
class ParameterSweep(Grid):
    """Grid of designs, whose axes are named by dotted paths.

    If `allow_unstable`, an unstable equilibrium has all results. `requirements` are judged at each
    point.
    """

    level: str
    results: tuple[Quantity, ...]
    allow_unstable: bool = False
    requirements: tuple[Requirement, ...] = ()

    @property
    def identity(self) -> str:
        """Text that differs between jobs of one design, with all numbers of its quantities."""
        with np.printoptions(threshold=10**9, floatmode="unique"):
            return super().identity

    @cached_property
    def quantities(self) -> tuple[Quantity, ...]:
        """Results, and quantities of requirements, each once."""
        required = [one.quantity for one in self.requirements]
        return tuple(dict.fromkeys([*self.results, *required]))

    @cached_property
    def needs(self) -> Needs:
        """What the quantities need."""
        return Needs.of(self.quantities)

    @cached_property
    def ratios(self) -> tuple[Ratio, ...]:
        """Responses and couplings among the results."""
        return tuple(one for one in self.results if isinstance(one, Ratio))

    @cached_property
    def followed(self) -> tuple[FollowedMode, ...]:
        """Modes among the results that are followed by their shapes."""
        return tuple(one for one in self.results if isinstance(one, FollowedMode))

    @cached_property
    def labelled(self) -> tuple[Frequency, ...]:
        """Modes among the results that are asked for by their labels."""
        return tuple(one for one in self.results if isinstance(one, Frequency))

    @property
    def has_modes(self) -> bool:
        """Whether modes are followed, or may share a motion."""
        return bool(self.followed or self.labelled)

    @property
    def is_slow(self) -> bool:
        """Whether a quantity is computed design by design."""
        return any(one.slow for one in self.quantities)

    @cached_property
    def nominal(self) -> Modes:
        """Modes of the nominal design; results are named by their labels."""
        return eigenmodes.solve(nominal_system(self.text, self.level))

    @property
    def nominal_shape(self) -> Float[np.ndarray, "mode coordinate"]:
        """Shapes of the nominal modes, as in `batch_modes.Spectrum`."""
        return batch_modes.solve(nominal_system(self.text, self.level)).shape

    @property
    def drawn(self) -> tuple[float, ...]:
        """Nominal value of each parameter; NaN where the design does not give it."""
        raw = tomllib.loads(self.text)
        given = [value_at(raw, axis.name) for axis in self.axes]
        return tuple(float(one) if type(one) in (int, float) else np.nan for one in given)

    def check(self) -> None:
        """Raise `InputError` if a path does not exist or its values give no valid design."""
        self.check_designs("--vary", self.axes, lambda one: registry.choose(one, self.level))

    def first_fault(self, status: Int[np.ndarray, "*axes"]) -> str:
        """Say what is wrong with the first point whose design is not possible."""
        [first, *_] = np.flatnonzero(status.ravel() == builds.IMPOSSIBLE).tolist()
        values = {name: float(one[0]) for name, one in self.values(first, first + 1).items()}
        at = ", ".join(f"{name} = {value:.4g}" for name, value in values.items())
        try:
            registry.by_name(self.level).system(reader.VariedDesign.of(self.text).at(values))
        except InputError as error:
            return f"at {at}: {error.faults[0].line('')}"
        return ""

    @property
    def compared(self) -> dict[str, Any]:
        """Columns by which an interpolated map is compared with full solutions.

        And the sizes below which their differences are relative to these.
        """
        columns: dict[str, Any] = {"value": np.array([one.negligible for one in self.results])}
        if self.has_modes:
            columns["omega_squared"] = 0.0
        return columns

    @property
    def is_analytic(self) -> bool:
        """Whether `sample` gives functions from which all results follow."""
        return all(one.analytic or one.undamped for one in self.quantities)

    @cached_property
    def _analytic(self) -> tuple[Quantity, ...]:
        """Results that have analytic functions of their own; others follow from the modes."""
        return tuple(one for one in self.quantities if one.analytic)

    @cached_property
    def _matrices(self) -> system_functions.Layout | None:
        """Elements of the linear system, if modes are asked for."""
        if all(one.analytic for one in self.quantities):
            return None
        return system_functions.Layout(nominal_system(self.text, self.level))

    @property
    def least(self) -> Float[np.ndarray, " function"]:
        """Sizes of the functions of `sample` below which they are rounding errors."""
        sizes = [np.full(one.function_count, one.negligible) for one in self._analytic]
        if self._matrices is not None:
            sizes.append(self._matrices.least)
        return np.concatenate(sizes)

    def sample(
        self, values: dict[str, Float[np.ndarray, " point"]]
    ) -> Inexact[np.ndarray, "point function"]:
        """Functions of all results, then the elements of the linear system if modes need them.

        NaN where a design has no result, or other coordinates.
        """
        count = len(next(iter(values.values())))
        result = np.full((count, len(self.least)), np.nan, complex if self.ratios else float)
        nominal = nominal_system(self.text, self.level)
        for places, batch, alike in self._solve(variants.designs_at(self.text, values)):
            if not (alike and _are_combined_alike(batch.found.model, nominal)):
                continue
            parts = [one.functions(batch) for one in self._analytic]
            if self._matrices is not None:
                parts.append(self._matrices.functions(batch.found.model))
            found = np.hstack(parts)
            result[places] = np.where(batch.is_steady[:, None], found, np.nan)
        return result

    def columns_of(self, functions: Inexact[np.ndarray, "point function"]) -> Columns:
        """Results that follow from the functions of `sample`."""
        count = len(functions)
        ends = np.cumsum([one.function_count for one in self._analytic], dtype=int)
        *parts, rest = np.split(functions, ends, axis=1)
        found = {one: one.of_functions(own) for one, own in zip(self._analytic, parts, strict=True)}
        batch = None
        if self._matrices is not None:
            batch = Solved.of_systems(self._matrices.system(np.real(rest)), self.design, self.level)
            others = set(self.quantities) - set(self._analytic) - set(self.followed)
            found |= {one: one.values(batch) for one in others}
        status = np.full(count, builds.GOOD, dtype=np.uint8)
        return {"status": status, **self._columns_of(found, batch)}

    def compute(self, start: int, stop: int) -> Columns:
        """Compute status and quantities of points start to stop - 1."""
        designs = variants.designs_at(self.text, self.values(start, stop))
        return self.compute_designs(designs, stop - start)

    def compute_designs(self, designs: Iterable[Design | None], count: int) -> Columns:
        """Compute status, quantities, and modes in ascending order of `count` designs."""
        result = builds.blank(count, **self._columns())
        for places, batch, alike in self._solve(designs):
            if not alike:
                result["status"][places] = OTHER_COORDINATES
                continue
            result["status"][places] = batch.found.status
            for name, values in self._evaluate(batch).items():
                result[name][places] = values
        return result

    def _solve(
        self, designs: Iterable[Design | None]
    ) -> Iterator[tuple[Int[np.ndarray, " place"], Solved, bool]]:
        """Solve designs in batches of one topology, with their places.

        And say whether each batch has the coordinates of the nominal design.
        """
        nominal = nominal_system(self.text, self.level)
        unstable = self.allow_unstable
        for places, batch in of_designs(designs, self.level, self.needs, allow_unstable=unstable):
            model = batch.found.model
            same = model.coordinate == nominal.coordinate
            yield places, batch, same and bool((model.massless == nominal.massless).all())

    def _columns(self) -> dict[str, tuple[str, tuple[int, ...]]]:
        """Type and shape per point of each column."""
        columns: dict[str, tuple[str, tuple[int, ...]]] = {
            "status": ("u1", ()),
            "value": ("f8", (len(self.results),)),
        }
        if self.requirements:
            columns["limited"] = ("f8", (len(self.requirements),))
        if self.ratios:
            columns["response"] = ("c16", (len(self.ratios),))
        if self.has_modes:
            shape = self.nominal_shape.shape
            columns["omega_squared"] = ("f8", shape[:1])
            columns["shape"] = ("f4", shape)
        if self.labelled:
            each = (len(self.labelled),)
            columns["label_mode"] = ("i2", each)
            columns["other_mode"] = ("i2", each)
            columns["label_fraction"] = ("f8", each)
            columns["other_fraction"] = ("f8", each)
        return columns

    def _evaluate(self, batch: Solved) -> dict[str, np.ndarray]:
        """Evaluate all columns but the status; modes that are followed are NaN until they are."""
        found = {}
        for one in self.quantities:
            if isinstance(one, Ratio):
                found[one] = np.where(batch.is_steady, one.read(batch), builds.NOTHING)
            elif one not in self.followed:
                found[one] = one.values(batch)
        return self._columns_of(found, batch)

    def _columns_of(
        self, found: dict[Quantity, np.ndarray], batch: Solved | None
    ) -> dict[str, np.ndarray]:
        """All columns but the status, from the values of quantities, complex of responses.

        Modes are read from the batch.
        """
        size = {one: np.abs(own) if np.iscomplexobj(own) else own for one, own in found.items()}
        if batch is not None:
            size |= dict.fromkeys(self.followed, np.full(batch.count, np.nan))
        columns = {"value": np.stack([size[one] for one in self.results], axis=-1)}
        if self.requirements:
            limited = [size[one.quantity] for one in self.requirements]
            columns["limited"] = np.stack(limited, axis=-1)
        if self.ratios:
            columns["response"] = np.stack([found[one] for one in self.ratios], axis=-1)
        if self.has_modes and batch is not None:
            columns["omega_squared"] = batch.spectrum.omega_squared
            columns["shape"] = batch.spectrum.shape.astype("f4")
            columns |= self._find_labelled(batch)
        return columns

    def _find_labelled(self, batch: Solved) -> dict[str, np.ndarray]:
        """Find the modes that labels mean at each point, and those that share their motions."""
        if not self.labelled:
            return {}
        found = [mode_content.find(batch.fractions, one.motion) for one in self.labelled]
        return {
            "label_mode": np.stack([one.mode for one in found], axis=-1).astype("i2"),
            "other_mode": np.stack([one.other for one in found], axis=-1).astype("i2"),
            "label_fraction": np.stack([one.fraction for one in found], axis=-1),
            "other_fraction": np.stack([one.other_fraction for one in found], axis=-1),
        }


def _are_combined_alike(model: LinearSystem, nominal: LinearSystem) -> bool:
    """Whether systems of the same coordinates combine them alike, and have as many wires."""
    return model.k.shape[-1] == nominal.k.shape[-1] and bool((model.basis == nominal.basis).all())
